//! Whole runs against nodes that are played here, on paused time.

use crate::journal::Journal;
use crate::node_services::NodeServices;
use crate::params::ModellerParams;
use crate::report::End;
use crate::runner::Runner;
use crate::scan_inbox::ScanInbox;
use anyhow::{Result, anyhow, bail};
use puffer_core::session::{Event, Phase, SessionOutcome, SessionParams, SessionState};
use puffer_msgs::action::{
    ModelObjectGoal, ReconstructMeshGoal, ReconstructMeshResult, RefineResult,
};
use puffer_msgs::builtin_interfaces::msg::Duration as DurationMessage;
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::srv::{FilterResponse, PlanViewRequest, PlanViewResponse};
use puffer_msgs::trajectory_msgs::msg::{JointTrajectory, JointTrajectoryPoint};
use puffer_ros::{Stamp, Stop};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::mpsc::{UnboundedSender, unbounded_channel};
use tokio::time::Instant;

/// Time that every step of these nodes takes.
const STEP_TIME: Duration = Duration::from_secs(3);
/// Time that the planned trajectory takes, seconds.
const MOTION_TIME: i32 = 10;

/// What a node does with a call.
#[derive(Clone, Copy, PartialEq)]
enum Reply {
    /// Does what is asked.
    Done,
    /// Answers that it cannot.
    Failed,
    /// Does not answer.
    Silent,
}

/// All other nodes. They find a view as long as fewer than `views` scans have come.
struct FakeNodes {
    inbox: Arc<ScanInbox>,
    views: usize,
    /// Replies by the name of the step, the first one first; done where there is none.
    replies: Mutex<BTreeMap<&'static str, Vec<Reply>>>,
    /// Names of the calls so far, with what they ask for.
    calls: Mutex<Vec<String>>,
    /// Whether a scan that was taken is registered.
    registers: bool,
    params: ModellerParams,
}

impl FakeNodes {
    fn new(views: usize) -> FakeNodes {
        FakeNodes {
            inbox: Arc::default(),
            views,
            replies: Mutex::default(),
            calls: Mutex::default(),
            registers: true,
            params: ModellerParams { mesh_path: "object.ply".into(), ..ModellerParams::default() },
        }
    }

    fn with_replies(self, step: &'static str, replies: &[Reply]) -> FakeNodes {
        self.replies.lock().unwrap().insert(step, replies.to_vec());
        self
    }

    fn calls(&self) -> Vec<String> {
        self.calls.lock().unwrap().clone()
    }

    /// Notes a call and replies to it after [`STEP_TIME`], or with the deadline.
    async fn answer(&self, step: &'static str, asked: &str, deadline: Duration) -> Result<()> {
        self.calls.lock().unwrap().push(format!("{step} {asked}").trim_end().to_owned());
        let reply = {
            let mut replies = self.replies.lock().unwrap();
            let left = replies.entry(step).or_default();
            if left.is_empty() { Reply::Done } else { left.remove(0) }
        };
        match reply {
            Reply::Silent => {
                tokio::time::sleep(deadline).await;
                bail!("{step}: no answer within {} s", deadline.as_secs())
            }
            Reply::Failed => {
                tokio::time::sleep(STEP_TIME).await;
                bail!("{step}: it cannot")
            }
            Reply::Done => {
                tokio::time::sleep(STEP_TIME).await;
                Ok(())
            }
        }
    }
}

impl NodeServices for FakeNodes {
    fn params(&self) -> ModellerParams {
        self.params.clone()
    }

    fn now(&self) -> Stamp {
        Stamp::ZERO
    }

    async fn plan_view(
        &self,
        request: &PlanViewRequest,
        deadline: Duration,
    ) -> Result<PlanViewResponse> {
        let asked = format!(
            "{} of {:?}, robot at {:?}",
            request.scans, request.accepted, request.sent_to.position
        );
        self.answer("plan", &asked, deadline).await?;
        let end = JointTrajectoryPoint {
            positions: vec![f64::from(request.scans)],
            time_from_start: DurationMessage { sec: MOTION_TIME, nanosec: 0 },
            ..JointTrajectoryPoint::default()
        };
        Ok(PlanViewResponse {
            success: true,
            done: request.scans as usize >= self.views,
            message: "nothing asks".into(),
            coverage: 0.5,
            trajectory: JointTrajectory {
                joint_names: vec!["axis".into()],
                points: vec![end],
                ..JointTrajectory::default()
            },
            ..PlanViewResponse::default()
        })
    }

    async fn follow_trajectory(
        &self,
        _trajectory: &JointTrajectory,
        deadline: Duration,
        stop: &Stop,
    ) -> Result<()> {
        match stop.or(self.answer("move", "", deadline)).await {
            Some(outcome) => outcome,
            None => {
                self.calls.lock().unwrap().push("halt".into());
                Err(anyhow!("stopped"))
            }
        }
    }

    async fn trigger_scan(&self, deadline: Duration) -> Result<()> {
        self.answer("scan", "", deadline).await?;
        if self.registers {
            let id = self.inbox.len() as u32;
            self.inbox.put(RegisteredScan {
                id,
                version: 1,
                status: RegisteredScan::ACCEPTED,
                accepted: (0..=id).collect(),
                accepted_versions: vec![1; id as usize + 1],
                ..RegisteredScan::default()
            });
        }
        Ok(())
    }

    async fn refine(&self, scans: usize, deadline: Duration, _stop: &Stop) -> Result<RefineResult> {
        self.answer("refine", &scans.to_string(), deadline).await?;
        let ids: Vec<u32> = (0..scans as u32).collect();
        for &id in &ids {
            self.inbox.put(RegisteredScan { id, version: 2, ..RegisteredScan::default() });
        }
        Ok(RefineResult {
            success: true,
            revision: 7,
            versions: vec![2; scans],
            status: vec![RegisteredScan::ACCEPTED; scans],
            ids,
            ..RefineResult::default()
        })
    }

    async fn filter(
        &self,
        scans: usize,
        revision: u32,
        deadline: Duration,
    ) -> Result<FilterResponse> {
        self.answer("filter", &format!("{scans} of revision {revision}"), deadline).await?;
        Ok(FilterResponse { success: true, cloud_hash: "abc".into(), ..FilterResponse::default() })
    }

    async fn reconstruct(
        &self,
        goal: ReconstructMeshGoal,
        deadline: Duration,
        _stop: &Stop,
    ) -> Result<ReconstructMeshResult> {
        let asked = format!("{} {}/{}", goal.cloud_hash, goal.accepted, goal.scans);
        self.answer("reconstruct", &asked, deadline).await?;
        Ok(ReconstructMeshResult {
            success: true,
            mesh_path: goal.output_path,
            scans: goal.scans,
            accepted: goal.accepted,
            ..ReconstructMeshResult::default()
        })
    }
}

/// Everything that a test looks at after a run.
struct Run {
    end: End,
    mesh: ReconstructMeshResult,
    /// Paused time that it took.
    time: Duration,
}

/// Runs a session to its end; `control` sends the operator's wishes.
async fn run_with(
    nodes: &FakeNodes,
    stop: Stop,
    control: impl AsyncFnOnce(UnboundedSender<Event>),
) -> Run {
    let journal = Journal::without_folder(Stamp::ZERO);
    let mut runner = Runner::new(nodes, &nodes.inbox, journal, ModelObjectGoal::default(), stop);
    let (sender, controls) = unbounded_channel();
    let kept = sender.clone();
    let begin = Instant::now();
    let session = SessionState::new(SessionParams::default());
    let (end, ()) =
        tokio::join!(runner.run(session, Event::Ready, controls, |_, _| {}), control(sender));
    drop(kept);
    Run { end, mesh: runner.mesh.clone(), time: begin.elapsed() }
}

async fn run(nodes: &FakeNodes) -> Run {
    run_with(nodes, Stop::new(), async |_| {}).await
}

#[tokio::test(start_paused = true)]
async fn a_run_calls_the_nodes_in_order_and_tells_each_what_must_have_arrived() {
    let nodes = FakeNodes::new(2);
    let run = run(&nodes).await;
    assert_eq!(run.end.outcome, SessionOutcome::Modelled("nothing asks".into()));
    let expected = [
        "plan 0 of [], robot at []",
        "move",
        "scan",
        "plan 1 of [0], robot at [0.0]",
        "move",
        "scan",
        "plan 2 of [0, 1], robot at [1.0]",
        "refine 2",
        "filter 2 of revision 7",
        "reconstruct abc 2/2",
    ];
    assert_eq!(nodes.calls(), expected);
    assert_eq!(run.mesh.mesh_path, "object.ply");
    assert_eq!((run.end.state.scans, run.end.state.accepted), (2, 2));
    assert_eq!(run.time, STEP_TIME * expected.len() as u32);
}

#[tokio::test(start_paused = true)]
async fn a_motion_that_fails_is_planned_anew_from_an_unknown_place() {
    let nodes = FakeNodes::new(1).with_replies("move", &[Reply::Failed]);
    let run = run(&nodes).await;
    assert_eq!(run.end.outcome, SessionOutcome::Modelled("nothing asks".into()));
    let again = ["plan 0 of [], robot at []", "move"].repeat(2);
    assert_eq!(nodes.calls()[..4], again);
}

#[tokio::test(start_paused = true)]
async fn a_node_that_fails_after_the_scans_ends_the_run_with_its_reason() {
    for (step, phase) in [
        ("refine", Phase::Refining),
        ("filter", Phase::Filtering),
        ("reconstruct", Phase::Reconstructing),
    ] {
        let nodes = FakeNodes::new(1).with_replies(step, &[Reply::Failed]);
        let run = run(&nodes).await;
        assert_eq!(run.end.outcome, SessionOutcome::Failed(phase, format!("{step}: it cannot")));
        assert!(!run.mesh.success);
        assert!(nodes.calls().last().unwrap().starts_with(step));
    }
}

#[tokio::test(start_paused = true)]
async fn a_silent_node_is_given_its_own_deadline() {
    let params = ModellerParams::default();
    let motion = params.move_deadline + f64::from(MOTION_TIME);
    for (step, deadline) in [
        ("plan", params.plan_deadline),
        ("move", motion),
        ("scan", params.scan_deadline),
        ("refine", params.refine_deadline),
        ("filter", params.filter_deadline),
        ("reconstruct", params.reconstruct_deadline),
    ] {
        let nodes = FakeNodes::new(1).with_replies(step, &[Reply::Silent]);
        let run = run(&nodes).await;
        let answered = nodes.calls().len() - 1;
        let expected = STEP_TIME * answered as u32 + Duration::from_secs_f64(deadline);
        assert_eq!(run.time, expected, "{step}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_scan_without_a_verdict_ends_the_measuring_after_its_deadline() {
    let nodes = FakeNodes { registers: false, ..FakeNodes::new(1) };
    let run = run(&nodes).await;
    let SessionOutcome::Failed(Phase::Registering, why) = &run.end.outcome else {
        panic!("{:?}", run.end.outcome);
    };
    assert!(why.contains("no registered_scan with id 0 within 120 s"), "{why}");
    let deadline = Duration::from_secs_f64(ModellerParams::default().register_deadline);
    assert_eq!(run.time, STEP_TIME * 3 + deadline);
}

#[tokio::test(start_paused = true)]
async fn cancelling_halts_the_moving_robot_and_calls_nothing_else() {
    let nodes = FakeNodes::new(1);
    let cancelled = run_with(&nodes, Stop::new(), async |operator| {
        tokio::time::sleep(STEP_TIME + STEP_TIME / 2).await;
        operator.send(Event::Cancel).unwrap();
    });
    let run = cancelled.await;
    assert_eq!(run.end.outcome, SessionOutcome::Cancelled);
    assert_eq!(nodes.calls(), ["plan 0 of [], robot at []", "move", "halt"]);
    assert_eq!(run.time, STEP_TIME + STEP_TIME / 2);
}

#[tokio::test(start_paused = true)]
async fn a_pause_holds_before_the_next_plan_until_the_operator_resumes_or_cancels() {
    for wish in [Event::Resume, Event::Cancel] {
        let nodes = FakeNodes::new(2);
        let resumes = wish == Event::Resume;
        let paused = run_with(&nodes, Stop::new(), async |operator| {
            operator.send(Event::Pause).unwrap();
            tokio::time::sleep(STEP_TIME * 20).await;
            assert_eq!(nodes.calls().len(), 3, "{:?}", nodes.calls());
            operator.send(wish).unwrap();
        });
        let outcome = paused.await.end.outcome;
        if resumes {
            assert_eq!(outcome, SessionOutcome::Modelled("nothing asks".into()));
        } else {
            assert_eq!(outcome, SessionOutcome::Cancelled);
            assert_eq!(nodes.calls().len(), 3);
        }
    }
}

#[tokio::test(start_paused = true)]
async fn the_end_of_the_node_cancels_the_run_instead_of_failing_it() {
    let (nodes, stop) = (FakeNodes::new(1), Stop::new());
    let run = run_with(&nodes, stop.clone(), async |_| {
        tokio::time::sleep(STEP_TIME + STEP_TIME / 2).await;
        stop.stop();
    });
    assert_eq!(run.await.end.outcome, SessionOutcome::Cancelled);
    assert_eq!(nodes.calls().last().unwrap(), "halt");
}
