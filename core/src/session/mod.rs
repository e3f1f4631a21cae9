//! The modelling loop as a pure state machine (Wiedemann 2014, §2): plan a view, move, scan,
//! register, and again, until no view is left; then refine all poses, filter and reconstruct. While
//! the mesh is less certain than wanted, views are planned for twice the points and more, and the
//! mesh is made again.
//!
//! [`step`] takes the state and an event and gives the next state and the next command. It knows no
//! clock and no ROS: the caller carries the commands out and reports what came of them.
//!
//! ```
//! use puffer_core::session::{Command, Event, SessionParams, SessionState, step};
//!
//! let state = SessionState::new(SessionParams::default());
//! let (state, command) = step(&state, Event::Ready);
//! assert_eq!(command, Some(Command::Plan { scans: 0, point_factor: 1 }));
//! let (state, command) = step(&state, Event::Planned { coverage: 0.0, gain: 1.0 });
//! assert_eq!(command, Some(Command::Move));
//! let (_, command) = step(&state, Event::Moved);
//! assert_eq!(command, Some(Command::Scan));
//! ```

mod params;
mod protocol;
mod state;

pub use params::SessionParams;
pub use protocol::{Command, Event, Phase, SessionOutcome};
pub use state::SessionState;

/// The next state and the next command, if there is one. An event that does not fit the phase
/// changes nothing.
pub fn step(state: &SessionState, event: Event) -> (SessionState, Option<Command>) {
    let mut next = state.clone();
    let command = next.apply(event);
    (next, command)
}

#[cfg(test)]
mod tests;
