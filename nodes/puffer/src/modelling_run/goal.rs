//! The goal of a run, as its operator sees it.

use anyhow::Result;
use puffer_msgs::action::{ModelObject, ModelObjectFeedback, ModelObjectGoal, ModelObjectResult};
use puffer_ros::{NoParams, Node, Outcome, Stop};
use std::time::Duration;

/// How long the modeller may take to be there and accept the goal.
const ACCEPT_DEADLINE: Duration = Duration::from_secs(60);
/// How long a run may take; each of its steps has a deadline of its own.
const RUN_DEADLINE: Duration = Duration::from_secs(24 * 3600);
/// How long a cancelled run may take to end.
const CANCEL_DEADLINE: Duration = Duration::from_secs(30);

/// How a run ended.
pub(crate) enum RunEnding {
    Modelled,
    Cancelled,
    /// There is no mesh, because it would not be trustworthy; why.
    NotTrustworthy(String),
    Failed(String),
}

/// Sends the goal, prints its progress, and waits for its end. When `stop` is set, the goal is
/// cancelled.
pub(crate) async fn run_goal(
    node: &Node<NoParams>,
    goal: &ModelObjectGoal,
    stop: &Stop,
) -> Result<RunEnding> {
    let client = node.action_client::<ModelObject>("model_object")?;
    let sent = match stop.or(client.send(goal, ACCEPT_DEADLINE)).await {
        Some(sent) => sent,
        None => return Ok(RunEnding::Cancelled),
    };
    let Some(mut handle) = sent? else {
        return Ok(RunEnding::Failed("the modeller rejects the goal: is it busy?".to_owned()));
    };
    let mut last = String::new();
    loop {
        match stop.or(handle.feedback()).await {
            Some(Some(feedback)) => {
                let line = progress_line(&feedback);
                if line != last {
                    eprintln!("{line}");
                    last = line;
                }
            }
            Some(None) => break,
            None => {
                eprintln!("puffer: interrupted, stopping");
                let cancelled = async {
                    handle.cancel(CANCEL_DEADLINE).await?;
                    handle.result(CANCEL_DEADLINE).await
                };
                return Ok(match cancelled.await {
                    Ok(Outcome::Succeeded(_)) => RunEnding::Modelled,
                    Ok(_) => RunEnding::Cancelled,
                    Err(error) => {
                        eprintln!("puffer: the modeller does not stop: {error}");
                        RunEnding::Cancelled
                    }
                });
            }
        }
    }
    Ok(match handle.result(RUN_DEADLINE).await? {
        Outcome::Succeeded(_) => RunEnding::Modelled,
        Outcome::Canceled(_) => RunEnding::Cancelled,
        Outcome::Aborted(ModelObjectResult {
            error_code: ModelObjectResult::NOT_TRUSTWORTHY,
            error_msg,
            ..
        }) => RunEnding::NotTrustworthy(error_msg),
        Outcome::Aborted(ModelObjectResult { error_code, error_msg, .. }) => {
            RunEnding::Failed(format!("{error_msg} (code {error_code})"))
        }
    })
}

/// A line of progress.
fn progress_line(feedback: &ModelObjectFeedback) -> String {
    let phase = match feedback.phase {
        ModelObjectFeedback::PREPARING => "preparing",
        ModelObjectFeedback::PLANNING => "planning",
        ModelObjectFeedback::MOVING => "moving",
        ModelObjectFeedback::SCANNING => "scanning",
        ModelObjectFeedback::REGISTERING => "registering",
        ModelObjectFeedback::REFINING => "refining",
        ModelObjectFeedback::FILTERING => "filtering",
        ModelObjectFeedback::RECONSTRUCTING => "reconstructing",
        ModelObjectFeedback::PAUSED => "paused",
        _ => "done",
    };
    let mut line = format!(
        "{:>6.1} s  {phase:<14}  {} scans, coverage {:.1} %",
        f64::from(feedback.elapsed.sec) + f64::from(feedback.elapsed.nanosec) * 1e-9,
        feedback.scans,
        feedback.coverage * 100.0
    );
    if feedback.expected_gain > 0.0 {
        line += &format!(", expected gain {:.0}", feedback.expected_gain);
    }
    if !feedback.message.is_empty() {
        line += &format!("  ({})", feedback.message);
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_msgs::builtin_interfaces::msg::Duration as DurationMessage;

    #[test]
    fn a_line_of_progress_leaves_out_what_is_not_known() {
        let mut feedback = ModelObjectFeedback {
            phase: ModelObjectFeedback::SCANNING,
            scans: 3,
            coverage: 0.25,
            elapsed: DurationMessage { sec: 12, nanosec: 500_000_000 },
            ..ModelObjectFeedback::default()
        };
        let line = "  12.5 s  scanning        3 scans, coverage 25.0 %";
        assert_eq!(progress_line(&feedback), line);
        feedback.expected_gain = 41.0;
        feedback.message = "the sensor is slow".into();
        let more = ", expected gain 41  (the sensor is slow)";
        assert_eq!(progress_line(&feedback), format!("{line}{more}"));
    }
}
