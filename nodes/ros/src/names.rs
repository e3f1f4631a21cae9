//! Names of nodes, topics and services: relative, private (`~/x`) and absolute ones, and remapping.
//!
//! Rules: <https://design.ros2.org/articles/topic_and_service_names.html> and
//! <https://design.ros2.org/articles/static_remapping.html>.

use anyhow::{Result, bail, ensure};

/// A remapping rule `[node:]from:=to`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Remap {
    /// Name of the node that the rule is for; `None` if it is for all nodes.
    pub node: Option<String>,
    pub from: String,
    pub to: String,
}

/// A node's full name and the remapping rules for the names that it uses.
#[derive(Clone, Debug)]
pub(crate) struct Names {
    namespace: String,
    name: String,
    remaps: Vec<Remap>,
}

impl Names {
    /// The names of a node that is called `default_name` in `namespace` unless the rules `__node`
    /// and `__ns` say otherwise; the first rule that matches wins.
    pub fn new(default_name: &str, namespace: &str, remaps: &[Remap]) -> Result<Self> {
        let name = find_rule(remaps, "__node", default_name)
            .or_else(|| find_rule(remaps, "__name", default_name))
            .unwrap_or_else(|| default_name.to_owned());
        ensure!(
            is_token(&name),
            "the node name `{name}` is not allowed: use letters, digits and _, not a digit first"
        );
        let namespace =
            find_rule(remaps, "__ns", default_name).unwrap_or_else(|| namespace.to_owned());
        let namespace = format!("/{}", namespace.trim_matches('/'));
        ensure!(
            namespace == "/" || namespace.split('/').skip(1).all(is_token),
            "the namespace `{namespace}` is not allowed: use words of letters, digits and _, with / between"
        );
        let remaps = remaps
            .iter()
            .filter(|r| !r.from.starts_with("__"))
            .filter(|r| r.node.as_deref().is_none_or(|n| n == name || n == default_name))
            .cloned()
            .collect();
        Ok(Self { namespace, name, remaps })
    }

    /// The node's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The node's namespace. It starts with a slash; the root is "/".
    pub fn namespace(&self) -> &str {
        &self.namespace
    }

    /// The node's namespace and name.
    pub fn full(&self) -> String {
        join(&self.namespace, &self.name)
    }

    /// The absolute name of a topic or service after remapping.
    ///
    /// # Errors
    /// A name that ROS 2 does not allow.
    pub fn resolve(&self, name: &str) -> Result<String> {
        let expanded = self.expand(name)?;
        for rule in &self.remaps {
            if self.expand(&rule.from)? == expanded {
                return self.expand(&rule.to);
            }
        }
        Ok(expanded)
    }

    /// The absolute name of a relative, private or absolute one.
    fn expand(&self, name: &str) -> Result<String> {
        // rcl's explicit schemes for topics and services only.
        let name = name.strip_prefix("rostopic://").unwrap_or(name);
        let name = name.strip_prefix("rosservice://").unwrap_or(name);
        let full = if let Some(private) = name.strip_prefix("~/") {
            join(&self.full(), private)
        } else if name.starts_with('/') {
            name.to_owned()
        } else {
            join(&self.namespace, name)
        };
        if !full.split('/').skip(1).all(is_token) {
            bail!(
                "the name `{name}` is not allowed: use words of letters, digits and _ (not a digit first, no \
                 two _ in a row), with / between, or ~/ in front"
            );
        }
        Ok(full)
    }
}

/// The new name that the first rule for `key` and the node gives.
fn find_rule(remaps: &[Remap], key: &str, node: &str) -> Option<String> {
    remaps
        .iter()
        .find(|r| r.from == key && r.node.as_deref().is_none_or(|n| n == node))
        .map(|r| r.to.clone())
}

fn join(namespace: &str, name: &str) -> String {
    format!("{}/{name}", namespace.trim_end_matches('/'))
}

/// Whether a word may be a part of a name.
fn is_token(word: &str) -> bool {
    word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && !word.contains("__")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn remap(node: Option<&str>, from: &str, to: &str) -> Remap {
        Remap { node: node.map(str::to_owned), from: from.to_owned(), to: to.to_owned() }
    }

    #[test]
    fn names_are_relative_private_or_absolute() {
        let names = Names::new("planner", "cell", &[]).unwrap();
        assert_eq!(names.full(), "/cell/planner");
        assert_eq!(names.resolve("points").unwrap(), "/cell/points");
        assert_eq!(names.resolve("~/plan_view").unwrap(), "/cell/planner/plan_view");
        assert_eq!(names.resolve("/clock").unwrap(), "/clock");
        for bad in ["", "/", "a//b", "9a", "a-b", "a__b", "points/", "~x"] {
            assert!(names.resolve(bad).unwrap_err().to_string().contains("not allowed"), "{bad}");
        }
    }

    #[test]
    fn the_first_rule_that_fits_renames() {
        let rules = [
            remap(None, "points", "camera/depth"),
            remap(None, "/points", "/never"),
            remap(Some("other"), "scan", "/wrong"),
            remap(Some("planner"), "scan", "/right"),
            remap(None, "~/plan_view", "plan"),
        ];
        let names = Names::new("planner", "/", &rules).unwrap();
        assert_eq!(names.resolve("points").unwrap(), "/camera/depth");
        assert_eq!(names.resolve("/points").unwrap(), "/camera/depth");
        assert_eq!(names.resolve("scan").unwrap(), "/right");
        assert_eq!(names.resolve("~/plan_view").unwrap(), "/plan");
        assert_eq!(names.resolve("other").unwrap(), "/other");
    }

    #[test]
    fn node_and_namespace_are_renamed_for_the_node_that_a_rule_names() {
        let rules = [
            remap(Some("other"), "__node", "x"),
            remap(None, "__node", "mine"),
            remap(None, "__ns", "/a/b"),
        ];
        let names = Names::new("planner", "/", &rules).unwrap();
        assert_eq!(names.full(), "/a/b/mine");
        assert_eq!(Names::new("other", "/", &rules).unwrap().name(), "x");
        assert!(Names::new("planner", "/", &[remap(None, "__ns", "/a//b")]).is_err());
        assert!(Names::new("planner", "/", &[remap(None, "__node", "a/b")]).is_err());
    }

    #[test]
    fn schemes_of_rcl_are_left_out_and_a_name_is_remapped_once() {
        let rules =
            [remap(None, "a", "b"), remap(None, "b", "c"), remap(None, "rostopic://d", "e")];
        let names = Names::new("planner", "/", &rules).unwrap();
        assert_eq!(names.resolve("a").unwrap(), "/b");
        assert_eq!(names.resolve("b").unwrap(), "/c");
        assert_eq!(names.resolve("d").unwrap(), "/e");
        assert_eq!(names.resolve("rosservice://~/f").unwrap(), "/planner/f");
    }

    #[test]
    fn a_namespace_may_come_with_or_without_slashes() {
        for namespace in ["cell/a", "/cell/a", "cell/a/", "/cell/a/"] {
            let names = Names::new("planner", namespace, &[]).unwrap();
            assert_eq!((names.namespace(), &*names.full()), ("/cell/a", "/cell/a/planner"));
        }
        for root in ["", "/"] {
            assert_eq!(Names::new("planner", root, &[]).unwrap().full(), "/planner");
        }
        for bad in ["9a", "a-b", "", "a__b"] {
            assert!(Names::new(bad, "/", &[]).is_err(), "{bad}");
        }
    }
}
