//! The state of a modelling session and its transitions.

use super::params::SessionParams;
use super::protocol::{Command, Event, Phase, SessionOutcome};

/// A mesh whose sigma is too large may ask for at most this many times the configured points of a
/// surface voxel. The factor doubles with each further mesh.
const MAX_POINT_FACTOR: usize = 16;

/// The state of a modelling session.
#[derive(Clone, Debug, PartialEq)]
pub struct SessionState {
    params: SessionParams,
    /// What the session is waiting for.
    pub phase: Phase,
    /// Number of scans that the sensor delivered.
    pub scans: usize,
    /// Number of scans that were registered.
    pub accepted: usize,
    /// Share of the known surface that holds its measurements, 0 to 1, as the planner stated it
    /// last.
    pub coverage: f64,
    /// What the planned view is expected to gain, as the planner stated it last.
    pub expected_gain: f64,
    /// Why no more scans are taken; empty until that is so.
    pub reason: String,
    /// Points that a surface voxel needs, as a multiple of the configured number.
    point_factor: usize,
    mesh: Option<FinishedMesh>,
    /// Whether more scans can make the mesh more certain.
    can_take_more_scans: bool,
    failed_moves: usize,
    failed_scans: usize,
    /// Number of scans in a row that were not registered.
    unregistered: usize,
    is_pause_requested: bool,
}

/// A mesh that was reconstructed.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FinishedMesh {
    /// Number of scans that it was made of.
    scans: usize,
    /// Mean standard deviation of its vertices, metres.
    sigma: f64,
}

impl SessionState {
    /// A session that has not begun.
    pub fn new(params: SessionParams) -> SessionState {
        SessionState {
            params,
            phase: Phase::Preparing,
            scans: 0,
            accepted: 0,
            coverage: 0.0,
            expected_gain: 0.0,
            reason: String::new(),
            point_factor: 1,
            mesh: None,
            can_take_more_scans: false,
            failed_moves: 0,
            failed_scans: 0,
            unregistered: 0,
            is_pause_requested: false,
        }
    }

    /// A session that has not begun, for `scans` scans that were taken and registered before. Once
    /// it is ready, it goes on to the mesh at once.
    pub fn with_scans(params: SessionParams, scans: usize) -> SessionState {
        SessionState { scans, accepted: scans, ..SessionState::new(params) }
    }

    /// Changes to the next state; the next command.
    pub(super) fn apply(&mut self, event: Event) -> Option<Command> {
        match (self.phase, event) {
            (Phase::Done, _) => None,
            (_, Event::Cancel) => Some(self.end(SessionOutcome::Cancelled)),
            (_, Event::Pause) => {
                self.is_pause_requested = true;
                None
            }
            (Phase::Paused, Event::Resume) => {
                self.is_pause_requested = false;
                Some(self.plan())
            }
            (_, Event::Resume) => {
                self.is_pause_requested = false;
                None
            }
            (Phase::Preparing, Event::Ready) if self.scans > 0 => {
                Some(self.start_meshing("the scans were taken before"))
            }
            (Phase::Preparing, Event::Ready) => Some(self.plan()),
            (Phase::Planning, event) => self.on_planning_event(event),
            (Phase::Moving, event) => self.on_moving_event(event),
            (Phase::Scanning, event) => self.on_scanning_event(event),
            (Phase::Registering, event) => self.on_registering_event(event),
            (phase, event) => self.on_meshing_event(phase, event),
        }
    }

    fn on_planning_event(&mut self, event: Event) -> Option<Command> {
        match event {
            Event::Planned { coverage, gain } => {
                self.record_plan(coverage, gain);
                if self.scans > 0 && self.params.coverage < 1.0 && coverage >= self.params.coverage
                {
                    return Some(self.end_scanning("the coverage asked for is reached"));
                }
                self.phase = Phase::Moving;
                Some(Command::Move)
            }
            Event::NoViewLeft { coverage, reason } => {
                self.record_plan(coverage, 0.0);
                Some(self.end_scanning(&reason))
            }
            Event::Failed(why) => Some(self.start_meshing(&format!("planning failed: {why}"))),
            _ => None,
        }
    }

    fn on_moving_event(&mut self, event: Event) -> Option<Command> {
        match event {
            Event::Moved => {
                self.failed_moves = 0;
                self.phase = Phase::Scanning;
                Some(Command::Scan)
            }
            Event::Failed(why) => {
                self.failed_moves += 1;
                if self.failed_moves >= self.params.max_failed_moves {
                    return Some(self.start_meshing(&format!("the robot does not move: {why}")));
                }
                Some(self.plan())
            }
            _ => None,
        }
    }

    fn on_scanning_event(&mut self, event: Event) -> Option<Command> {
        match event {
            Event::Scanned => {
                self.failed_scans = 0;
                self.phase = Phase::Registering;
                self.scans += 1;
                Some(Command::AwaitVerdict { index: self.scans - 1 })
            }
            Event::Failed(why) => {
                self.failed_scans += 1;
                if self.failed_scans >= self.params.max_failed_scans {
                    let reason = format!("the sensor does not deliver: {why}");
                    return Some(self.start_meshing(&reason));
                }
                Some(Command::Scan)
            }
            _ => None,
        }
    }

    fn on_registering_event(&mut self, event: Event) -> Option<Command> {
        match event {
            Event::Registered(status) => {
                if status.is_accepted() {
                    self.accepted += 1;
                    self.unregistered = 0;
                } else {
                    self.unregistered += 1;
                }
                if self.unregistered >= self.params.max_unplaced {
                    let reason = "too many scans in a row could not be registered";
                    return Some(self.start_meshing(reason));
                }
                if self.scans >= self.params.max_scans {
                    return Some(self.start_meshing("the number of scans allowed is reached"));
                }
                Some(self.plan())
            }
            Event::Failed(why) => {
                // The registrar may have lost this scan; the others still make a mesh.
                self.scans -= 1;
                Some(self.start_meshing(&format!("a scan was not registered: {why}")))
            }
            _ => None,
        }
    }

    /// Refine, filter, reconstruct: the only place that knows their order.
    fn on_meshing_event(&mut self, phase: Phase, event: Event) -> Option<Command> {
        match (phase, event) {
            (phase, Event::Failed(why)) => Some(match self.mesh {
                Some(mesh) => {
                    let scans = mesh.scans;
                    let reason =
                        format!("the mesh is that of {scans} scans, {phase:?} failed: {why}");
                    self.end_with_uncertain_mesh(mesh, &reason)
                }
                None => self.end(SessionOutcome::Failed(phase, why)),
            }),
            (Phase::Refining, Event::Finished) => {
                self.phase = Phase::Filtering;
                Some(Command::Filter { scans: self.scans })
            }
            (Phase::Filtering, Event::Finished) => {
                self.phase = Phase::Reconstructing;
                Some(Command::Reconstruct)
            }
            (Phase::Reconstructing, Event::Reconstructed { sigma }) => {
                let mesh = FinishedMesh { scans: self.scans, sigma };
                self.mesh = Some(mesh);
                Some(self.judge_mesh(mesh))
            }
            _ => None,
        }
    }

    /// Plans the next view, unless the operator wants to pause.
    fn plan(&mut self) -> Command {
        if self.is_pause_requested {
            self.phase = Phase::Paused;
            return Command::WaitForResume;
        }
        self.phase = Phase::Planning;
        Command::Plan { scans: self.scans, point_factor: self.point_factor }
    }

    fn record_plan(&mut self, coverage: f64, gain: f64) {
        self.expected_gain = gain;
        // With more points than configured, the share is not that of the configured points.
        if self.point_factor == 1 {
            self.coverage = coverage;
        }
    }

    /// The mesh of all scans so far, if there is one.
    fn current_mesh(&self) -> Option<FinishedMesh> {
        self.mesh.filter(|mesh| mesh.scans == self.scans)
    }

    /// No further view is needed: goes on to the mesh, or asks for more points if the mesh of these
    /// scans is known to be too uncertain.
    fn end_scanning(&mut self, reason: &str) -> Command {
        if let Some(mesh) = self.current_mesh() {
            return self.request_more_points(mesh, reason);
        }
        let command = self.start_meshing(reason);
        self.can_take_more_scans = true;
        command
    }

    /// Ends the session if the mesh is certain enough; else asks for more points if that is
    /// possible.
    fn judge_mesh(&mut self, mesh: FinishedMesh) -> Command {
        let reason = self.reason.clone();
        if self.params.sigma == 0.0 || mesh.sigma <= self.params.sigma {
            return self.end(SessionOutcome::Modelled(reason));
        }
        if self.can_take_more_scans {
            self.request_more_points(mesh, &reason)
        } else {
            self.end_with_uncertain_mesh(mesh, &reason)
        }
    }

    /// Plans views for twice the points, up to the largest factor.
    fn request_more_points(&mut self, mesh: FinishedMesh, reason: &str) -> Command {
        if self.point_factor >= MAX_POINT_FACTOR {
            return self.end_with_uncertain_mesh(mesh, reason);
        }
        self.point_factor *= 2;
        self.can_take_more_scans = false;
        self.plan()
    }

    /// Ends with a mesh that is less certain than was asked for.
    fn end_with_uncertain_mesh(&mut self, mesh: FinishedMesh, reason: &str) -> Command {
        let (reached, wanted) = (mesh.sigma * 1e3, self.params.sigma * 1e3);
        self.reason =
            format!("{reason}; the mean sigma is {reached:.3} mm, {wanted:.3} mm was not reached");
        self.end(SessionOutcome::Modelled(self.reason.clone()))
    }

    /// Takes no more scans and goes on to the mesh of those that were registered.
    fn start_meshing(&mut self, reason: &str) -> Command {
        if let Some(mesh) = self.current_mesh() {
            return self.end_with_uncertain_mesh(mesh, reason);
        }
        self.reason = reason.to_owned();
        self.can_take_more_scans = false;
        if self.accepted == 0 {
            let why = format!("no scan to make a mesh of: {reason}");
            return self.end(SessionOutcome::Failed(self.phase, why));
        }
        self.phase = Phase::Refining;
        Command::Refine { scans: self.scans }
    }

    fn end(&mut self, outcome: SessionOutcome) -> Command {
        self.phase = Phase::Done;
        Command::End(outcome)
    }
}
