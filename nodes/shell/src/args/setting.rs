//! Parameter settings and the nodes that they are meant for.

use serde_json::Value;

/// Which nodes a setting is meant for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Scope {
    /// Every node that the arguments start.
    Any,
    /// The nodes whose full name fits: `/**` stands for any words, `/*` for one word; a name without a slash
    /// for a node of that name in any namespace.
    Pattern(String),
}

/// One parameter as the user wrote it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Setting {
    pub scope: Scope,
    /// Full name, `group.field`.
    pub name: String,
    pub value: Value,
    /// Where it stands, for messages.
    pub origin: String,
}

impl Setting {
    /// Whether it is meant for the node `full` (namespace and name, such as "/cell/planner").
    pub fn applies_to(&self, full: &str) -> bool {
        match &self.scope {
            Scope::Any => true,
            Scope::Pattern(pattern) if !pattern.contains(['/', '*']) => {
                full.rsplit('/').next() == Some(pattern)
            }
            Scope::Pattern(pattern) => {
                let pattern: Vec<_> = pattern.trim_start_matches('/').split('/').collect();
                let words: Vec<_> = full.trim_start_matches('/').split('/').collect();
                fits(&pattern, &words)
            }
        }
    }

    /// Whether the user named this very node, so that an unknown parameter is a mistake.
    pub fn is_meant_exactly(&self) -> bool {
        !matches!(&self.scope, Scope::Pattern(pattern) if pattern.contains('*'))
    }
}

fn fits(pattern: &[&str], words: &[&str]) -> bool {
    match pattern {
        [] => words.is_empty(),
        ["**", rest @ ..] => (0..=words.len()).any(|skip| fits(rest, &words[skip..])),
        [first, rest @ ..] => {
            words.first().is_some_and(|word| *first == "*" || first == word)
                && fits(rest, &words[1..])
        }
    }
}
