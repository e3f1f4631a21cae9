//! Settings of parameters, and the nodes that they are meant for.

use serde_json::Value;

/// Which nodes a setting is meant for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Scope {
    /// Every node that the arguments start.
    Any,
    /// The nodes whose full name matches: `/**` stands for any words, `/*` for one word. A name
    /// without a slash stands for a node of that name in any namespace.
    Pattern(String),
}

/// One parameter as the user wrote it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Setting {
    pub scope: Scope,
    /// The parameter's full name, `group.field`.
    pub name: String,
    pub value: Value,
    /// Where the setting comes from, for error messages.
    pub origin: String,
}

impl Setting {
    /// Whether the setting is meant for the node with the full name `full`, such as
    /// "/cell/planner".
    pub fn applies_to(&self, full: &str) -> bool {
        match &self.scope {
            Scope::Any => true,
            Scope::Pattern(pattern) if !pattern.contains(['/', '*']) => {
                full.rsplit('/').next() == Some(pattern)
            }
            Scope::Pattern(pattern) => {
                let pattern: Vec<_> = pattern.trim_start_matches('/').split('/').collect();
                let words: Vec<_> = full.trim_start_matches('/').split('/').collect();
                matches_words(&pattern, &words)
            }
        }
    }

    /// Whether the user named the node itself, so that an unknown parameter is a mistake.
    pub fn is_meant_exactly(&self) -> bool {
        !matches!(&self.scope, Scope::Pattern(pattern) if pattern.contains('*'))
    }
}

/// Whether the words of a name match those of a pattern.
fn matches_words(pattern: &[&str], words: &[&str]) -> bool {
    match pattern {
        [] => words.is_empty(),
        ["**", rest @ ..] => (0..=words.len()).any(|skip| matches_words(rest, &words[skip..])),
        [first, rest @ ..] => {
            words.first().is_some_and(|word| *first == "*" || first == word)
                && matches_words(rest, &words[1..])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn applies(pattern: &str, node: &str) -> bool {
        let (name, origin) = ("a.b".to_owned(), "test".to_owned());
        let scope = Scope::Pattern(pattern.to_owned());
        Setting { scope, name, value: Value::Null, origin }.applies_to(node)
    }

    #[test]
    fn one_star_is_one_word_and_two_are_any_number() {
        for (pattern, node, expected) in [
            ("/**", "/planner", true),
            ("/**", "/cell/a/planner", true),
            ("/*", "/planner", true),
            ("/*", "/cell/planner", false),
            ("/cell/*", "/cell/planner", true),
            ("/cell/*", "/cell", false),
            ("/cell/**", "/cell", true),
            ("/**/planner", "/planner", true),
            ("/**/planner", "/cell/a/planner", true),
            ("/**/planner", "/cell/planner/a", false),
            ("/*/**/planner", "/planner", false),
            ("planner", "/cell/planner", true),
            ("planner", "/cell/planner2", false),
            ("cell/planner", "/cell/planner", true),
            ("", "/planner", false),
        ] {
            assert_eq!(applies(pattern, node), expected, "{pattern} {node}");
        }
    }
}
