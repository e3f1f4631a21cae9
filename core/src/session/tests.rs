use super::*;
use crate::register::Status;

fn planned() -> Event {
    Event::Planned { coverage: 0.5, gain: 10.0 }
}

/// Runs the events one after the other; the commands that came.
fn run(params: SessionParams, events: &[Event]) -> (SessionState, Vec<Option<Command>>) {
    let mut state = SessionState::new(params);
    let mut commands = Vec::new();
    for event in events {
        let (next, command) = step(&state, event.clone());
        state = next;
        commands.push(command);
    }
    (state, commands)
}

fn one_scan(status: Status) -> [Event; 4] {
    [planned(), Event::Moved, Event::Scanned, Event::Registered(status)]
}

#[test]
fn a_run_goes_from_the_first_view_to_the_mesh() {
    let mut events = vec![Event::Ready];
    events.extend(one_scan(Status::Accepted));
    events.extend([
        Event::NoViewLeft { coverage: 0.97, reason: "no view is left".into() },
        Event::Finished,
        Event::Finished,
        Event::Reconstructed { sigma: 1e-4 },
    ]);
    let (state, commands) = run(SessionParams::default(), &events);
    let expected = [
        Command::Plan { scans: 0, point_factor: 1 },
        Command::Move,
        Command::Scan,
        Command::AwaitVerdict { index: 0 },
        Command::Plan { scans: 1, point_factor: 1 },
        Command::Refine { scans: 1 },
        Command::Filter { scans: 1 },
        Command::Reconstruct,
        Command::End(SessionOutcome::Modelled("no view is left".into())),
    ];
    assert_eq!(commands, expected.map(Some));
    assert_eq!((state.phase, state.scans, state.coverage), (Phase::Done, 1, 0.97));
    assert_eq!(step(&state, Event::Moved), (state.clone(), None));
}

fn failure() -> Event {
    Event::Failed("controller says no".into())
}

/// Asserts that the events after a first scan lead to the mesh, for a reason that contains `why`.
fn assert_goes_to_mesh(params: SessionParams, events: &[Event], why: &str) {
    let mut all = vec![Event::Ready];
    all.extend(one_scan(Status::Accepted));
    all.extend_from_slice(events);
    let (state, commands) = run(params, &all);
    assert_eq!(commands.last(), Some(&Some(Command::Refine { scans: state.scans })), "{why}");
    assert!(state.reason.contains(why), "{} is not {why}", state.reason);
}

#[test]
fn limits_end_the_loop_with_a_mesh_of_what_was_measured() {
    assert_goes_to_mesh(
        SessionParams { max_scans: 1, ..SessionParams::default() },
        &[],
        "number of scans",
    );
    let half = SessionParams { coverage: 0.5, ..SessionParams::default() };
    assert_goes_to_mesh(half, &[planned()], "coverage");
    let moves = [planned(), failure(), planned(), failure(), planned(), failure()];
    assert_goes_to_mesh(SessionParams::default(), &moves, "does not move: controller says no");
    let scans = [planned(), Event::Moved, failure(), failure()];
    assert_goes_to_mesh(SessionParams::default(), &scans, "does not deliver");
    let lost = [planned(), Event::Moved, Event::Scanned, failure()];
    assert_goes_to_mesh(SessionParams::default(), &lost, "not registered");
    assert_goes_to_mesh(SessionParams::default(), &[failure()], "planning failed");
    let refused = one_scan(Status::Refused);
    let strict = SessionParams { max_unplaced: 1, ..SessionParams::default() };
    assert_goes_to_mesh(strict, &refused, "could not be registered");
}

#[test]
fn without_any_scan_it_fails_and_says_where() {
    let (_, commands) = run(
        SessionParams::default(),
        &[
            Event::Ready,
            planned(),
            Event::Moved,
            Event::Failed("a".into()),
            Event::Failed("b".into()),
        ],
    );
    let Some(Some(Command::End(SessionOutcome::Failed(Phase::Scanning, why)))) = commands.last()
    else {
        panic!("{commands:?}");
    };
    assert!(why.contains("no scan") && why.contains('b'), "{why}");
}

#[test]
fn a_pause_holds_before_the_next_plan_and_cancel_ends_anywhere() {
    let mut events = vec![Event::Ready, planned(), Event::Pause, Event::Moved, Event::Scanned];
    events.push(Event::Registered(Status::Accepted));
    let (state, commands) = run(SessionParams::default(), &events);
    assert_eq!(state.phase, Phase::Paused);
    assert_eq!(commands.last(), Some(&Some(Command::WaitForResume)));
    let (resumed, command) = step(&state, Event::Resume);
    assert_eq!(command, Some(Command::Plan { scans: 1, point_factor: 1 }));
    for state in [state, resumed, SessionState::new(SessionParams::default())] {
        let (state, command) = step(&state, Event::Cancel);
        assert_eq!(command, Some(Command::End(SessionOutcome::Cancelled)));
        assert_eq!(state.phase, Phase::Done);
    }
}

#[test]
fn events_out_of_place_change_no_view_left() {
    let start = SessionState::new(SessionParams::default());
    for event in [Event::Moved, Event::Scanned, Event::Finished, planned()] {
        assert_eq!(step(&start, event), (start.clone(), None));
    }
}

/// From a plan without a view to a mesh with this sigma.
fn a_mesh(sigma: f64) -> [Event; 4] {
    [
        Event::NoViewLeft { coverage: 0.9, reason: "no view is left".into() },
        Event::Finished,
        Event::Finished,
        Event::Reconstructed { sigma },
    ]
}

#[test]
fn a_mesh_that_is_not_certain_enough_gets_more_scans() {
    let params = SessionParams { sigma: 1e-4, ..SessionParams::default() };
    let mut events = vec![Event::Ready];
    events.extend(one_scan(Status::Accepted));
    events.extend(a_mesh(3e-4));
    let (state, commands) = run(params.clone(), &events);
    assert_eq!(commands.last(), Some(&Some(Command::Plan { scans: 1, point_factor: 2 })));
    assert_eq!(state.coverage, 0.9);

    // Twice the points ask for no view, four times do; the second mesh is good enough.
    events.push(Event::NoViewLeft { coverage: 0.8, reason: "none".into() });
    events.extend(one_scan(Status::Accepted));
    events.extend(a_mesh(1e-4));
    let (state, commands) = run(params, &events);
    let plans: Vec<_> =
        commands.iter().flatten().filter(|c| matches!(c, Command::Plan { .. })).collect();
    let expected =
        [(1, 2), (1, 4), (2, 4)].map(|(scans, point_factor)| Command::Plan { scans, point_factor });
    assert!(plans[2..].iter().copied().eq(&expected), "{plans:?}");
    let end = Command::End(SessionOutcome::Modelled("no view is left".into()));
    assert_eq!(commands.last(), Some(&Some(end)));
    assert_eq!((state.scans, state.coverage), (2, 0.9));
}

fn no_view_left() -> Event {
    Event::NoViewLeft { coverage: 0.8, reason: "really none".into() }
}

/// Asserts that the events end the session with a mesh of 0.3 mm where 0.1 mm was wanted, for a
/// reason that contains `why`.
fn assert_sigma_not_reached(params: SessionParams, events: &[Event], why: &str) {
    let (_, commands) = run(params, events);
    let Some(Some(Command::End(SessionOutcome::Modelled(reason)))) = commands.last() else {
        panic!("{commands:?}");
    };
    let sigma = "the mean sigma is 0.300 mm, 0.100 mm was not reached";
    assert!(reason.contains(why) && reason.contains(sigma), "{reason}");
}

#[test]
fn a_sigma_out_of_reach_ends_the_run_and_is_told() {
    let params = SessionParams { sigma: 1e-4, ..SessionParams::default() };
    let mut events = vec![Event::Ready];
    events.extend(one_scan(Status::Accepted));
    let first = events.clone();
    events.extend(a_mesh(3e-4));
    // No view whatever is asked for: 2, 4, 8, 16 times the points.
    let mut none = events.clone();
    none.extend([no_view_left(), no_view_left(), no_view_left(), no_view_left()]);
    assert_sigma_not_reached(params.clone(), &none, "really none");
    // No more scans are allowed.
    let mut full = first;
    full.extend_from_slice(&a_mesh(3e-4)[1..]);
    assert_sigma_not_reached(
        SessionParams { max_scans: 1, ..params.clone() },
        &full,
        "number of scans",
    );
    // What fails behind the first mesh leaves that.
    let mut broken = events.clone();
    broken.push(Event::Failed("no planner".into()));
    assert_sigma_not_reached(params.clone(), &broken, "no planner");
    events.extend(one_scan(Status::Accepted));
    events.extend([no_view_left(), Event::Failed("no memory".into())]);
    assert_sigma_not_reached(
        params,
        &events,
        "the mesh is that of 1 scans, Refining failed: no memory",
    );
}

#[test]
fn scans_that_were_taken_before_go_to_the_mesh_at_once() {
    let mut state = SessionState::with_scans(SessionParams::default(), 3);
    let events =
        [Event::Ready, Event::Finished, Event::Finished, Event::Reconstructed { sigma: 1e-4 }];
    let mut commands = Vec::new();
    for event in events {
        let (next, command) = step(&state, event);
        state = next;
        commands.extend(command);
    }
    let end = Command::End(SessionOutcome::Modelled("the scans were taken before".into()));
    let expected =
        [Command::Refine { scans: 3 }, Command::Filter { scans: 3 }, Command::Reconstruct, end];
    assert_eq!(commands, expected);
}

/// All events that a session reacts to.
fn every_event() -> Vec<Event> {
    vec![
        Event::Ready,
        planned(),
        no_view_left(),
        Event::Moved,
        Event::Scanned,
        Event::Registered(Status::Accepted),
        Event::Registered(Status::Refused),
        Event::Finished,
        Event::Reconstructed { sigma: 3e-4 },
        failure(),
        Event::Pause,
        Event::Resume,
        Event::Cancel,
    ]
}

/// Whether the session waits for what the command brings.
fn fits(command: &Command, phase: Phase) -> bool {
    match command {
        Command::Plan { .. } => phase == Phase::Planning,
        Command::Move => phase == Phase::Moving,
        Command::Scan => phase == Phase::Scanning,
        Command::AwaitVerdict { .. } => phase == Phase::Registering,
        Command::Refine { .. } => phase == Phase::Refining,
        Command::Filter { .. } => phase == Phase::Filtering,
        Command::Reconstruct => phase == Phase::Reconstructing,
        Command::WaitForResume => phase == Phase::Paused,
        Command::End(_) => phase == Phase::Done,
    }
}

#[test]
fn in_every_reachable_state_commands_fit_the_phase_and_limits_hold() {
    let params = SessionParams { max_scans: 2, sigma: 1e-4, ..SessionParams::default() };
    let mut states = vec![SessionState::new(params)];
    let mut at = 0;
    while at < states.len() {
        let state = states[at].clone();
        at += 1;
        for event in every_event() {
            let (next, command) = step(&state, event);
            match &command {
                // Without a command the session waits for the same as before.
                None => assert_eq!(next.phase, state.phase),
                Some(command) => assert!(fits(command, next.phase), "{command:?} {next:?}"),
            }
            assert!(next.accepted <= next.scans && next.scans <= 2, "{next:?}");
            if !states.contains(&next) {
                states.push(next);
            }
        }
    }
    assert!(states.iter().any(|state| state.phase == Phase::Done));
    assert!(states.len() > 100, "{}", states.len());
}
