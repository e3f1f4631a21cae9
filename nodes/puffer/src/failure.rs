//! Exit statuses.

use puffer_core::Error;

/// Wrong usage.
pub(crate) const USAGE: u8 = 2;
const FAILED: u8 = 1;
const INTERRUPTED: u8 = 130;

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
pub(crate) fn usage(message: impl Into<String>) -> anyhow::Error {
    anyhow::Error::new(Usage(message.into()))
}

/// The exit status that fits `error`.
pub(crate) fn status(error: &anyhow::Error) -> u8 {
    let parameter = |e: &(dyn std::error::Error + 'static)| {
        e.is::<Usage>() || matches!(e.downcast_ref(), Some(Error::Parameter { .. }))
    };
    if error.chain().any(|e| matches!(e.downcast_ref(), Some(Error::Cancelled))) {
        INTERRUPTED
    } else if error.chain().any(parameter) {
        USAGE
    } else {
        FAILED
    }
}
