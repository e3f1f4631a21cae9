//! The main function of a program that is a node.

use crate::{RosArgs, Stop};
use std::process::ExitCode;
use std::time::Duration;

/// How long remaining tasks may take to end.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_millis(800);
/// Exit status after an error.
const FAILURE_STATUS: u8 = 1;
/// Exit status after wrong arguments.
const USAGE_ERROR_STATUS: u8 = 2;
/// Exit status after SIGINT or SIGTERM: 128 + SIGINT, as shells have it.
const INTERRUPTED_STATUS: u8 = 130;

/// Runs a node as a whole program, with the program's arguments: see [`main_with`].
///
/// ```no_run
/// # use puffer_ros::{RosArgs, Stop};
/// async fn run(args: RosArgs, stop: Stop) -> anyhow::Result<()> {
///     stop.stopped().await;
///     Ok(())
/// }
///
/// fn main() -> std::process::ExitCode {
///     puffer_ros::main(run)
/// }
/// ```
pub fn main<F>(run: impl FnOnce(RosArgs, Stop) -> F) -> ExitCode
where
    F: Future<Output = anyhow::Result<()>>,
{
    main_with(std::env::args().skip(1), run)
}

/// Reads the arguments `args`, runs `run` in a tokio runtime and returns the exit status: 0 after
/// success, 1 after an error (with one message on standard error), 2 after wrong usage, 130 when
/// interrupted by SIGINT or SIGTERM.
pub fn main_with<F>(
    args: impl IntoIterator<Item = String>,
    run: impl FnOnce(RosArgs, Stop) -> F,
) -> ExitCode
where
    F: Future<Output = anyhow::Result<()>>,
{
    let args = match RosArgs::parse(args) {
        Ok(args) => args,
        Err(error) => return fail(USAGE_ERROR_STATUS, &error),
    };
    if let Some(unknown) = args.rest().first() {
        return fail(
            USAGE_ERROR_STATUS,
            &anyhow::anyhow!("unknown argument `{unknown}`; this program takes --ros-args only"),
        );
    }
    let runtime = match tokio::runtime::Builder::new_multi_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(error) => return fail(FAILURE_STATUS, &error.into()),
    };
    let status = runtime.block_on(async {
        let stop = match Stop::on_signals() {
            Ok(stop) => stop,
            Err(error) => return fail(FAILURE_STATUS, &error),
        };
        match run(args, stop.clone()).await {
            Ok(()) if stop.is_stopped() => ExitCode::from(INTERRUPTED_STATUS),
            Ok(()) => ExitCode::SUCCESS,
            Err(error) if stop.is_stopped() => fail(INTERRUPTED_STATUS, &error),
            Err(error) => fail(FAILURE_STATUS, &error),
        }
    });
    runtime.shutdown_timeout(SHUTDOWN_TIMEOUT);
    status
}

/// Prints an error; returns the exit status.
fn fail(status: u8, error: &anyhow::Error) -> ExitCode {
    eprintln!("error: {error:#}");
    ExitCode::from(status)
}
