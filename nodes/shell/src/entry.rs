//! What a node's program does around its `run`.

use crate::{RosArgs, Stop};
use std::process::ExitCode;
use std::time::Duration;

/// How long tasks that are left may take to end.
const GRACE: Duration = Duration::from_millis(800);
const FAILED: u8 = 1;
const WRONG_USAGE: u8 = 2;
const INTERRUPTED: u8 = 130;

/// As [`main_with`], with the arguments of the program.
pub fn main<F>(run: impl FnOnce(RosArgs, Stop) -> F) -> ExitCode
where
    F: Future<Output = anyhow::Result<()>>,
{
    main_with(std::env::args().skip(1), run)
}

/// Reads the arguments `args`, runs `run` and gives the exit status: 0 done, 1 failed (one message on
/// standard error), 2 wrong usage, 130 interrupted by SIGINT or SIGTERM.
pub fn main_with<F>(
    args: impl IntoIterator<Item = String>,
    run: impl FnOnce(RosArgs, Stop) -> F,
) -> ExitCode
where
    F: Future<Output = anyhow::Result<()>>,
{
    let args = match RosArgs::parse(args) {
        Ok(args) => args,
        Err(error) => return fail(WRONG_USAGE, &error),
    };
    if let Some(unknown) = args.rest().first() {
        return fail(
            WRONG_USAGE,
            &anyhow::anyhow!("unknown argument `{unknown}`; this program takes --ros-args only"),
        );
    }
    let runtime = match tokio::runtime::Builder::new_multi_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(error) => return fail(FAILED, &error.into()),
    };
    let status = runtime.block_on(async {
        let stop = match Stop::on_signals() {
            Ok(stop) => stop,
            Err(error) => return fail(FAILED, &error),
        };
        match run(args, stop.clone()).await {
            Ok(()) if stop.is_stopped() => ExitCode::from(INTERRUPTED),
            Ok(()) => ExitCode::SUCCESS,
            Err(error) if stop.is_stopped() => fail(INTERRUPTED, &error),
            Err(error) => fail(FAILED, &error),
        }
    });
    runtime.shutdown_timeout(GRACE);
    status
}

fn fail(status: u8, error: &anyhow::Error) -> ExitCode {
    eprintln!("error: {error:#}");
    ExitCode::from(status)
}
