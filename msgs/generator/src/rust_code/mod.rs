//! The generated code: a module for each package, and in it `msg`, `srv` and `action`.

mod doc_comments;
mod structs;
mod values;

use crate::interface_tree::InterfaceTree;
use crate::model::{Interface, Kind};
use crate::ros2msg_text;
use structs::StructNames;

/// Rust code of all packages; the types of the package `own` stand at the root of the crate.
pub(crate) fn generate(tree: &InterfaceTree, own: &str) -> String {
    let mut out = String::new();
    let mut packages: Vec<&str> = tree.interfaces.iter().map(|i| i.package.as_str()).collect();
    packages.dedup();
    for package in packages {
        let interfaces = tree.interfaces.iter().filter(|i| i.package == package);
        let modules = modules(tree, &interfaces.collect::<Vec<_>>(), own);
        if package == own {
            out.push_str(&modules);
        } else {
            out.push_str(&format!(
                "/// Interfaces of the package {package}.\npub mod {package} {{\n"
            ));
            out.push_str(&modules);
            out.push_str("}\n\n");
        }
    }
    out.push_str(&table(tree, own));
    out
}

fn modules(tree: &InterfaceTree, interfaces: &[&Interface], own: &str) -> String {
    let mut out = String::new();
    for (kind, title) in
        [(Kind::Msg, "Messages"), (Kind::Srv, "Services"), (Kind::Action, "Actions")]
    {
        let mut of_kind = interfaces.iter().filter(|i| i.kind == kind).peekable();
        let Some(first) = of_kind.peek() else {
            continue;
        };
        let (name, package) = (kind.name(), &first.package);
        out.push_str(&format!("/// {title} of the package {package}.\npub mod {name} {{\n"));
        for interface in of_kind {
            match kind {
                Kind::Msg => message(&mut out, tree, interface, own),
                Kind::Srv => service(&mut out, tree, interface, own),
                Kind::Action => action(&mut out, tree, interface, own),
            }
        }
        out.push_str("}\n\n");
    }
    out
}

fn message(out: &mut String, tree: &InterfaceTree, interface: &Interface, own: &str) {
    let docs = format!("Message `{}/msg/{}`.", interface.package, interface.name);
    for part in &interface.parts {
        structs::write(
            out,
            tree,
            part,
            &StructNames {
                own,
                package: &interface.package,
                kind: "msg",
                ros: &interface.name,
                rust: &interface.name,
                docs: &docs,
            },
        );
    }
}

fn parts(
    out: &mut String,
    tree: &InterfaceTree,
    interface: &Interface,
    own: &str,
    ends: &[(&str, &str)],
) {
    let (package, kind, name) = (&interface.package, interface.kind.name(), &interface.name);
    for (part, (end, what)) in interface.parts.iter().zip(ends) {
        let mut part = part.clone();
        // The comment at the top is that of the whole interface.
        part.docs.clear();
        structs::write(
            out,
            tree,
            &part,
            &StructNames {
                own,
                package,
                kind,
                ros: &format!("{name}_{end}"),
                rust: &format!("{name}{end}"),
                docs: &format!("{what} [`{name}`]."),
            },
        );
    }
}

fn interface_docs(out: &mut String, interface: &Interface, what: &str) {
    let (package, kind, name) = (&interface.package, interface.kind.name(), &interface.name);
    let lines = interface.parts.first().map(|part| part.docs.as_slice()).unwrap_or_default();
    doc_comments::write(out, "", lines, &format!("{what} `{package}/{kind}/{name}`."));
    out.push_str("#[derive(Clone, Copy, Debug)]\n");
    out.push_str(&format!("pub struct {name};\n\n"));
}

fn service(out: &mut String, tree: &InterfaceTree, interface: &Interface, own: &str) {
    interface_docs(out, interface, "Service");
    let (package, name) = (&interface.package, &interface.name);
    service_trait(
        out,
        package,
        "srv",
        name,
        name,
        [&format!("{name}Request"), &format!("{name}Response")],
    );
    let ends = [("Request", "What is asked of"), ("Response", "What is answered by")];
    parts(out, tree, interface, own, &ends);
}

/// Implements the trait for a service with these types of request and response.
fn service_trait(
    out: &mut String,
    package: &str,
    kind: &str,
    ros: &str,
    rust: &str,
    [request, response]: [&str; 2],
) {
    out.push_str(&format!(
        "impl crate::Service for {rust} {{\n    \
         const PACKAGE: &'static str = \"{package}\";\n    \
         const KIND: &'static str = \"{kind}\";\n    \
         const NAME: &'static str = \"{ros}\";\n    \
         const TYPE_NAME: &'static str = \"{package}/{kind}/{ros}\";\n    \
         type Request = {request};\n    \
         type Response = {response};\n}}\n\n"
    ));
}

fn action(out: &mut String, tree: &InterfaceTree, interface: &Interface, own: &str) {
    interface_docs(out, interface, "Action");
    let (package, name) = (&interface.package, &interface.name);
    out.push_str(&format!(
        "impl crate::Action for {name} {{\n    \
         const PACKAGE: &'static str = \"{package}\";\n    \
         const NAME: &'static str = \"{name}\";\n    \
         const TYPE_NAME: &'static str = \"{package}/action/{name}\";\n    \
         type Goal = {name}Goal;\n    \
         type Result = {name}Result;\n    \
         type Feedback = {name}Feedback;\n    \
         type SendGoal = {name}SendGoal;\n    \
         type GetResult = {name}GetResult;\n}}\n\n"
    ));
    let ends = [
        ("Goal", "What is asked of"),
        ("Result", "What comes out of"),
        ("Feedback", "What is told in the course of"),
    ];
    parts(out, tree, interface, own, &ends);
    action_services(out, package, name);
    feedback_message(out, tree, interface, own);
}

fn action_services(out: &mut String, package: &str, name: &str) {
    let services = [
        (
            "SendGoal",
            "takes a goal in",
            format!("crate::SendGoalRequest<{name}Goal>"),
            "crate::SendGoalResponse".to_string(),
        ),
        (
            "GetResult",
            "gives the result",
            "crate::GetResultRequest".to_string(),
            format!("crate::GetResultResponse<{name}Result>"),
        ),
    ];
    for (end, what, request, response) in services {
        let rust = format!("{name}{end}");
        out.push_str(&format!("/// The service of [`{name}`] that {what}.\n"));
        out.push_str(&format!("#[derive(Clone, Copy, Debug)]\npub struct {rust};\n\n"));
        out.push_str(&format!("/// Request of [`{rust}`].\npub type {rust}Request = {request};\n"));
        out.push_str(&format!(
            "/// Response of [`{rust}`].\npub type {rust}Response = {response};\n\n"
        ));
        let types = [&format!("{rust}Request"), &format!("{rust}Response")];
        service_trait(
            out,
            package,
            "action",
            &format!("{name}_{end}"),
            &rust,
            types.map(|t| t.as_str()),
        );
    }
}

fn feedback_message(out: &mut String, tree: &InterfaceTree, interface: &Interface, own: &str) {
    let (package, name) = (&interface.package, &interface.name);
    let Some(feedback) = interface.parts.get(2) else {
        return;
    };
    out.push_str(&format!("/// What the feedback topic of [`{name}`] carries.\n"));
    out.push_str(&format!(
        "pub type {name}FeedbackMessage = crate::FeedbackMessage<{name}Feedback>;\n\n"
    ));
    let names = StructNames {
        own,
        package,
        kind: "action",
        ros: &format!("{name}_FeedbackMessage"),
        rust: &format!("{name}FeedbackMessage"),
        docs: "",
    };
    let definition = ros2msg_text::feedback_text(tree, package, name, feedback);
    structs::write_interface_trait(out, &names, &definition);
}

/// The table of all types, by name.
fn table(tree: &InterfaceTree, own: &str) -> String {
    let mut types: Vec<(String, String)> = Vec::new();
    for interface in &tree.interfaces {
        let (package, kind, name) = (&interface.package, interface.kind.name(), &interface.name);
        let ends: &[&str] = match interface.kind {
            Kind::Msg => &[""],
            Kind::Srv => &["Request", "Response"],
            Kind::Action => &["Goal", "Result", "Feedback", "FeedbackMessage"],
        };
        let path = if package == own {
            format!("crate::{kind}")
        } else {
            format!("crate::{package}::{kind}")
        };
        for end in ends {
            let bar = if end.is_empty() { "" } else { "_" };
            types.push((
                format!("{package}/{kind}/{name}{bar}{end}"),
                format!("{path}::{name}{end}"),
            ));
        }
    }
    types.sort();
    let mut out = format!("static DEFINITIONS: [(&str, &str); {}] = [\n", types.len());
    for (_, path) in &types {
        let known = format!("<{path} as crate::Interface>");
        out.push_str(&format!("    ({known}::TYPE_NAME, {known}::DEFINITION),\n"));
    }
    out.push_str("];\n\n/// Shows all types to the visitor, sorted by name.\n");
    out.push_str("pub fn visit_types(visitor: &mut impl crate::TypeVisitor) {\n");
    for (_, path) in &types {
        out.push_str(&format!("    visitor.visit::<{path}>();\n"));
    }
    out.push_str("}\n");
    out
}
