//! The modelling loop as a pure state machine (Wiedemann 2014, §2): plan a view, move, scan, register,
//! and again, until no view is left; then refine all poses, filter, reconstruct. While the mesh is less certain than
//! wanted, views are planned for twice the points and more, and the mesh is made again.
//!
//! [`step`] takes the state and an event and gives the next state and what is to be done. It knows no clock and no
//! ROS: whoever runs it carries the commands out and reports what came of them.

mod protocol;

pub use protocol::{Command, Event, Outcome, Phase};

use crate::register::Status;

crate::params! {
    /// When the loop ends.
    pub struct SessionParams("session") {
        /// Scans taken at most.
        max_scans: usize = 60, in [1, 10000];
        /// Share of the known surface that must hold its measurements; 1 ends only when no view is left.
        coverage: f64 = 1.0, in [0.0, 1.0];
        /// Mean standard deviation of the mesh that is to be reached with more scans; 0: what the scans give.
        sigma: f64 = 0.0, in [0.0, 1.0], unit "m";
        /// Moves that may fail in a row before the loop goes on to the mesh.
        max_failed_moves: usize = 3, in [1, 100];
        /// Scans that may fail in a row before the loop goes on to the mesh.
        max_failed_scans: usize = 2, in [1, 100];
        /// Scans in a row that may not be registered before the loop goes on to the mesh.
        max_unplaced: usize = 8, in [1, 1000];
    }
}

/// Everything that the session remembers.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    params: SessionParams,
    /// What it is waiting for.
    pub phase: Phase,
    /// Scans that the sensor delivered.
    pub scans: usize,
    /// Scans that were registered.
    pub accepted: usize,
    /// As the planner said last.
    pub coverage: f64,
    /// As the planner said last.
    pub expected_gain: f64,
    /// Why no more scans are taken, once that is so.
    pub reason: String,
    /// How many times the points that are configured a surface voxel needs.
    factor: usize,
    mesh: Option<Made>,
    /// Whether more scans may make the mesh more certain.
    may_go_on: bool,
    failed_moves: usize,
    failed_scans: usize,
    unplaced: usize,
    pause_wanted: bool,
}

/// Points a surface voxel is to hold at most, times those configured, for a mesh that is not certain enough.
const MOST_POINTS: usize = 16;

/// A mesh that was made.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Made {
    /// Of so many scans.
    scans: usize,
    /// Mean standard deviation, metres.
    sigma: f64,
}

impl State {
    /// A session that has not begun.
    pub fn new(params: SessionParams) -> State {
        State {
            params,
            phase: Phase::Preparing,
            scans: 0,
            accepted: 0,
            coverage: 0.0,
            expected_gain: 0.0,
            reason: String::new(),
            factor: 1,
            mesh: None,
            may_go_on: false,
            failed_moves: 0,
            failed_scans: 0,
            unplaced: 0,
            pause_wanted: false,
        }
    }
}

/// The next state, and what is to be done. An event that does not fit the phase changes nothing.
pub fn step(state: &State, event: Event) -> (State, Option<Command>) {
    let mut next = state.clone();
    let command = next.take(event);
    (next, command)
}

impl State {
    fn take(&mut self, event: Event) -> Option<Command> {
        match (self.phase, event) {
            (Phase::Done, _) => None,
            (_, Event::Cancel) => Some(self.end(Outcome::Cancelled)),
            (_, Event::Pause) => {
                self.pause_wanted = true;
                None
            }
            (Phase::Paused, Event::Resume) => {
                self.pause_wanted = false;
                Some(self.plan())
            }
            (_, Event::Resume) => {
                self.pause_wanted = false;
                None
            }
            (Phase::Preparing, Event::Ready) => Some(self.plan()),
            (Phase::Planning, event) => self.planned(event),
            (Phase::Moving, event) => self.moved(event),
            (Phase::Scanning, event) => self.scanned(event),
            (Phase::Registering, event) => self.registered(event),
            (phase, Event::Failed(why)) => Some(match self.mesh {
                Some(Made { scans, .. }) => self.give_up(&format!(
                    "the mesh is that of {scans} scans, {phase:?} failed: {why}"
                )),
                None => self.end(Outcome::Failed(phase, why)),
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
                self.mesh = Some(Made { scans: self.scans, sigma });
                Some(self.judge(sigma))
            }
            _ => None,
        }
    }

    fn planned(&mut self, event: Event) -> Option<Command> {
        match event {
            Event::Planned { coverage, gain } => {
                self.note(coverage, gain);
                if self.scans > 0 && self.params.coverage < 1.0 && coverage >= self.params.coverage
                {
                    return Some(self.enough("the coverage asked for is reached"));
                }
                self.phase = Phase::Moving;
                Some(Command::Move)
            }
            Event::NothingLeft { coverage, reason } => {
                self.note(coverage, 0.0);
                Some(self.enough(&reason))
            }
            Event::Failed(why) => Some(self.finish(&format!("planning failed: {why}"))),
            _ => None,
        }
    }

    fn moved(&mut self, event: Event) -> Option<Command> {
        match event {
            Event::Moved => {
                self.failed_moves = 0;
                self.phase = Phase::Scanning;
                Some(Command::Scan)
            }
            Event::Failed(why) => {
                self.failed_moves += 1;
                if self.failed_moves >= self.params.max_failed_moves {
                    return Some(self.finish(&format!("the robot does not move: {why}")));
                }
                Some(self.plan())
            }
            _ => None,
        }
    }

    fn scanned(&mut self, event: Event) -> Option<Command> {
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
                    return Some(self.finish(&format!("the sensor does not deliver: {why}")));
                }
                Some(Command::Scan)
            }
            _ => None,
        }
    }

    fn registered(&mut self, event: Event) -> Option<Command> {
        match event {
            Event::Registered(status) => {
                if status == Status::Accepted {
                    self.accepted += 1;
                    self.unplaced = 0;
                } else {
                    self.unplaced += 1;
                }
                if self.unplaced >= self.params.max_unplaced {
                    return Some(self.finish("too many scans in a row could not be registered"));
                }
                if self.scans >= self.params.max_scans {
                    return Some(self.finish("the number of scans allowed is reached"));
                }
                Some(self.plan())
            }
            Event::Failed(why) => {
                // The registrar may have lost it: what it holds still makes a mesh.
                self.scans -= 1;
                Some(self.finish(&format!("a scan was not registered: {why}")))
            }
            _ => None,
        }
    }

    /// Plans, unless the operator wants to hold.
    fn plan(&mut self) -> Command {
        if self.pause_wanted {
            self.phase = Phase::Paused;
            return Command::Hold;
        }
        self.phase = Phase::Planning;
        Command::Plan { scans: self.scans, factor: self.factor }
    }

    fn note(&mut self, coverage: f64, gain: f64) {
        self.expected_gain = gain;
        // A share of more points than are configured is no coverage.
        if self.factor == 1 {
            self.coverage = coverage;
        }
    }

    /// Scans show what they were to show: a mesh of them, or more of them if there is one that is not certain enough.
    fn enough(&mut self, reason: &str) -> Command {
        if self.mesh.is_some_and(|made| made.scans == self.scans) {
            self.ask_for_more(reason)
        } else {
            let command = self.finish(reason);
            self.may_go_on = true;
            command
        }
    }

    /// What follows from a mesh with this mean sigma, metres.
    fn judge(&mut self, sigma: f64) -> Command {
        if self.params.sigma == 0.0 || sigma <= self.params.sigma {
            return self.end(Outcome::Modelled(self.reason.clone()));
        }
        let reason = self.reason.clone();
        if self.may_go_on { self.ask_for_more(&reason) } else { self.give_up(&reason) }
    }

    fn ask_for_more(&mut self, reason: &str) -> Command {
        if self.factor >= MOST_POINTS {
            return self.give_up(reason);
        }
        self.factor *= 2;
        self.may_go_on = false;
        self.plan()
    }

    /// Ends with the mesh that there is.
    fn give_up(&mut self, reason: &str) -> Command {
        let wanted = self.params.sigma * 1e3;
        let reached = self.mesh.map_or(f64::NAN, |made| made.sigma * 1e3);
        self.reason =
            format!("{reason}; the mean sigma is {reached:.3} mm, {wanted:.3} mm was not reached");
        self.end(Outcome::Modelled(self.reason.clone()))
    }

    /// Goes on to the mesh with what was measured.
    fn finish(&mut self, reason: &str) -> Command {
        if self.mesh.is_some_and(|made| made.scans == self.scans) {
            return self.give_up(reason);
        }
        self.reason = reason.to_owned();
        self.may_go_on = false;
        if self.accepted == 0 {
            let phase = self.phase;
            return self
                .end(Outcome::Failed(phase, format!("no scan to make a mesh of: {reason}")));
        }
        self.phase = Phase::Refining;
        Command::Refine { scans: self.scans }
    }

    fn end(&mut self, outcome: Outcome) -> Command {
        self.phase = Phase::Done;
        Command::End(outcome)
    }
}

#[cfg(test)]
mod tests;
