//! What a node's program does around its `run`.

use crate::{RosArgs, Stop};
use std::process::ExitCode;

/// Reads the program's arguments, runs `run` and gives the exit status: 0 done, 1 failed (one message on
/// standard error), 2 wrong usage, 130 interrupted.
pub fn main<F>(run: impl FnOnce(RosArgs, Stop) -> F) -> ExitCode
where
    F: Future<Output = anyhow::Result<()>>,
{
    let _ = run;
    ExitCode::from(1)
}
