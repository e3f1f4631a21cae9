//! One check of the machine, and how it is reported.

use crate::table::print_text;
use serde_json::{Value, json};

/// How a check went.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum CheckOutcome {
    Good,
    /// Works, but something is better.
    Advice,
    Bad,
}

/// A check that was made.
pub(super) struct Check {
    pub name: &'static str,
    pub finding: CheckOutcome,
    /// What was found, for the user.
    pub found: String,
    /// The command that mends it.
    pub mend: String,
}

impl Check {
    /// A check that is good or bad.
    pub fn new(name: &'static str, good: bool, found: impl Into<String>, mend: &str) -> Check {
        let finding = if good { CheckOutcome::Good } else { CheckOutcome::Bad };
        Check { name, finding, found: found.into(), mend: mend.to_owned() }
    }

    /// Prints the check, and how to mend what is not good.
    pub fn print(&self) {
        let word = match self.finding {
            CheckOutcome::Good => "ok",
            CheckOutcome::Advice => "note",
            CheckOutcome::Bad => "FAIL",
        };
        print_text(&format!("{word:<4}  {:<16}  {}\n", self.name, self.found));
        if self.finding != CheckOutcome::Good {
            print_text(&format!("      mend: {}\n", self.mend));
        }
    }

    /// The check as the JSON output has it.
    pub fn as_json(&self) -> Value {
        json!({
            "good": self.finding != CheckOutcome::Bad,
            "advice": self.finding == CheckOutcome::Advice,
            "found": self.found,
            "mend": self.mend,
        })
    }
}
