//! Exit statuses.

use puffer_core::Error;

/// Wrong usage.
pub(crate) const USAGE_STATUS: u8 = 2;
const FAILURE_STATUS: u8 = 1;
const INTERRUPTION_STATUS: u8 = 130;

/// A mistake in how the program was called.
#[derive(Debug)]
struct Usage(String);

impl std::fmt::Display for Usage {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Usage {}

/// An error that ends with exit status 2.
pub fn usage_error(message: impl Into<String>) -> anyhow::Error {
    anyhow::Error::new(Usage(message.into()))
}

/// The exit status that fits `error`.
pub(crate) fn exit_status(error: &anyhow::Error) -> u8 {
    if error.chain().any(|e| matches!(e.downcast_ref(), Some(Error::Cancelled))) {
        INTERRUPTION_STATUS
    } else if error.chain().any(is_usage_error) {
        USAGE_STATUS
    } else {
        FAILURE_STATUS
    }
}

/// Whether the user can mend an error by another call.
fn is_usage_error(error: &(dyn std::error::Error + 'static)) -> bool {
    error.is::<Usage>() || matches!(error.downcast_ref(), Some(Error::Parameter { .. }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cause_decides_whatever_stands_before_it() {
        let usage = usage_error("--out: missing").context("cannot start");
        let parameter = anyhow::Error::new(Error::Parameter {
            name: "planner.margin".into(),
            message: "7 is too large".into(),
        });
        let cancelled = anyhow::Error::new(Error::Cancelled).context("a node ended");
        for (error, status) in [
            (usage, USAGE_STATUS),
            (parameter.context("nbv_planner"), USAGE_STATUS),
            (cancelled, INTERRUPTION_STATUS),
            (anyhow::anyhow!("no space left"), FAILURE_STATUS),
        ] {
            assert_eq!(exit_status(&error), status, "{error:#}");
        }
    }
}
