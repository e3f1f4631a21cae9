use super::*;

fn planned() -> Event {
    Event::Planned { coverage: 0.5, gain: 10.0 }
}

/// Runs the events one after the other; the commands that came.
fn run(params: SessionParams, events: &[Event]) -> (State, Vec<Option<Command>>) {
    let mut state = State::new(params);
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
        Event::NothingLeft { coverage: 0.97, reason: "no view is left".into() },
        Event::Finished,
        Event::Finished,
        Event::Reconstructed { sigma: 1e-4 },
    ]);
    let (state, commands) = run(SessionParams::default(), &events);
    let expected = [
        Command::Plan { scans: 0, factor: 1 },
        Command::Move,
        Command::Scan,
        Command::AwaitVerdict { index: 0 },
        Command::Plan { scans: 1, factor: 1 },
        Command::Refine { scans: 1 },
        Command::Filter { scans: 1 },
        Command::Reconstruct,
        Command::End(Outcome::Modelled("no view is left".into())),
    ];
    assert_eq!(commands, expected.map(Some));
    assert_eq!((state.phase, state.scans, state.coverage), (Phase::Done, 1, 0.97));
    assert_eq!(step(&state, Event::Moved), (state.clone(), None));
}

#[test]
fn limits_end_the_loop_with_a_mesh_of_what_was_measured() {
    let goes_to_the_mesh = |params: SessionParams, events: &[Event], why: &str| {
        let mut all = vec![Event::Ready];
        all.extend(one_scan(Status::Accepted));
        all.extend_from_slice(events);
        let (state, commands) = run(params, &all);
        assert_eq!(commands.last(), Some(&Some(Command::Refine { scans: state.scans })), "{why}");
        assert!(state.reason.contains(why), "{} is not {why}", state.reason);
    };
    let defaults = SessionParams::default;
    let failed = || Event::Failed("controller says no".into());
    goes_to_the_mesh(SessionParams { max_scans: 1, ..defaults() }, &[], "number of scans");
    let half = SessionParams { coverage: 0.5, ..defaults() };
    goes_to_the_mesh(half, &[planned()], "coverage");
    let moves = [planned(), failed(), planned(), failed(), planned(), failed()];
    goes_to_the_mesh(defaults(), &moves, "does not move: controller says no");
    let scans = [planned(), Event::Moved, failed(), failed()];
    goes_to_the_mesh(defaults(), &scans, "does not deliver");
    let lost = [planned(), Event::Moved, Event::Scanned, failed()];
    goes_to_the_mesh(defaults(), &lost, "not registered");
    goes_to_the_mesh(defaults(), &[failed()], "planning failed");
    let refused = one_scan(Status::Refused);
    let strict = SessionParams { max_unplaced: 1, ..defaults() };
    goes_to_the_mesh(strict, &refused, "could not be registered");
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
    let Some(Some(Command::End(Outcome::Failed(Phase::Scanning, why)))) = commands.last() else {
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
    assert_eq!(commands.last(), Some(&Some(Command::Hold)));
    let (resumed, command) = step(&state, Event::Resume);
    assert_eq!(command, Some(Command::Plan { scans: 1, factor: 1 }));
    for state in [state, resumed, State::new(SessionParams::default())] {
        let (state, command) = step(&state, Event::Cancel);
        assert_eq!(command, Some(Command::End(Outcome::Cancelled)));
        assert_eq!(state.phase, Phase::Done);
    }
}

#[test]
fn events_out_of_place_change_nothing() {
    let start = State::new(SessionParams::default());
    for event in [Event::Moved, Event::Scanned, Event::Finished, planned()] {
        assert_eq!(step(&start, event), (start.clone(), None));
    }
}

/// From a plan without a view to a mesh with this sigma.
fn a_mesh(sigma: f64) -> [Event; 4] {
    [
        Event::NothingLeft { coverage: 0.9, reason: "no view is left".into() },
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
    assert_eq!(commands.last(), Some(&Some(Command::Plan { scans: 1, factor: 2 })));
    assert_eq!(state.coverage, 0.9);

    // Twice the points ask for no view, four times do; the second mesh is good enough.
    events.push(Event::NothingLeft { coverage: 0.8, reason: "none".into() });
    events.extend(one_scan(Status::Accepted));
    events.extend(a_mesh(1e-4));
    let (state, commands) = run(params, &events);
    let plans: Vec<_> =
        commands.iter().flatten().filter(|c| matches!(c, Command::Plan { .. })).collect();
    let last = |scans, factor| Command::Plan { scans, factor };
    assert_eq!(plans[2..], [&last(1, 2), &last(1, 4), &last(2, 4)]);
    let end = Command::End(Outcome::Modelled("no view is left".into()));
    assert_eq!(commands.last(), Some(&Some(end)));
    assert_eq!((state.scans, state.coverage), (2, 0.9));
}

#[test]
fn a_sigma_out_of_reach_ends_the_run_and_is_told() {
    let told = |params: SessionParams, events: &[Event], why: &str| {
        let (_, commands) = run(params, events);
        let Some(Some(Command::End(Outcome::Modelled(reason)))) = commands.last() else {
            panic!("{commands:?}");
        };
        let sigma = "the mean sigma is 0.300 mm, 0.100 mm was not reached";
        assert!(reason.contains(why) && reason.contains(sigma), "{reason}");
    };
    let params = SessionParams { sigma: 1e-4, ..SessionParams::default() };
    let mut events = vec![Event::Ready];
    events.extend(one_scan(Status::Accepted));
    let first = events.clone();
    events.extend(a_mesh(3e-4));
    let nothing = || Event::NothingLeft { coverage: 0.8, reason: "really none".into() };
    // No view whatever is asked for: 2, 4, 8, 16 times the points.
    let mut none = events.clone();
    none.extend([nothing(), nothing(), nothing(), nothing()]);
    told(params.clone(), &none, "really none");
    // No more scans are allowed.
    let mut full = first;
    full.extend_from_slice(&a_mesh(3e-4)[1..]);
    told(SessionParams { max_scans: 1, ..params.clone() }, &full, "number of scans");
    // What fails behind the first mesh leaves that.
    let mut broken = events.clone();
    broken.push(Event::Failed("no planner".into()));
    told(params.clone(), &broken, "no planner");
    events.extend(one_scan(Status::Accepted));
    events.extend([nothing(), Event::Failed("no memory".into())]);
    told(params, &events, "the mesh is that of 1 scans, Refining failed: no memory");
}
