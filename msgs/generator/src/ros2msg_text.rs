//! The full text of a type as bags store it (schema encoding `ros2msg`): its own text, and those of
//! all types that it contains, each below a line of `=` and its name.

use crate::interface_tree::{InterfaceTree, nested};
use crate::model::{MessageName, Part};

/// Stands between the texts of two types.
const SEPARATOR_LINE: &str =
    "================================================================================";

/// The text of a part and of everything in it.
pub(crate) fn full_text(tree: &InterfaceTree, part: &Part) -> String {
    let mut out = part.text.clone();
    append_nested(tree, part, &mut Vec::new(), &mut out);
    out.push('\n');
    out
}

/// The text of an action's feedback message: goal id and feedback.
pub(crate) fn feedback_text(
    tree: &InterfaceTree,
    package: &str,
    action: &str,
    feedback: &Part,
) -> String {
    let id = MessageName { package: "unique_identifier_msgs".into(), name: "UUID".into() };
    let name = MessageName { package: package.into(), name: format!("{action}_Feedback") };
    let mut out = format!("{}/{} goal_id\n{}/{} feedback", id.package, id.name, package, name.name);
    let mut seen = Vec::new();
    if let Some(part) = tree.message(&id) {
        section(&id, &part.text, &mut out);
        seen.push(&id);
    }
    section(&name, &feedback.text, &mut out);
    append_nested(tree, feedback, &mut seen, &mut out);
    out.push('\n');
    out
}

/// Appends the texts of all types in a part that are not in `seen`.
fn append_nested<'a>(
    tree: &'a InterfaceTree,
    part: &'a Part,
    seen: &mut Vec<&'a MessageName>,
    out: &mut String,
) {
    for name in nested(part) {
        if seen.contains(&name) {
            continue;
        }
        seen.push(name);
        if let Some(inner) = tree.message(name) {
            section(name, &inner.text, out);
            append_nested(tree, inner, seen, out);
        }
    }
}

/// Appends the separator, the name and the text of a type.
fn section(name: &MessageName, text: &str, out: &mut String) {
    out.push_str(&format!("\n{SEPARATOR_LINE}\nMSG: {}/{}\n{text}", name.package, name.name));
}
