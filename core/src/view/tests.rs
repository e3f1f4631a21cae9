use super::*;
use crate::geometry::{Aabb, Pose, Scan, SensorModel, StereoModel, Vec3};

/// A sensor at the height 0.65 m above the middle of the region, looking down.
pub(super) fn above() -> Pose {
    looking_along(&(Vec3::z() * 0.65), &-Vec3::z())
}

fn roi() -> Aabb {
    Aabb { min: Vec3::new(-0.1, -0.1, -0.1), max: Vec3::new(0.1, 0.1, 0.1) }
}

pub(super) fn unknown_space(params: &ViewParams) -> ViewSpace {
    let params = ViewParams { voxel_edge: 0.005, ..params.clone() };
    ViewSpace::new(SensorModel::Stereo(StereoModel::GUPPY), roi(), &params).unwrap()
}

/// A scan from [`above`] of a square plate (half its edge, metres) at the height `z`, a point each
/// 1 mm.
pub(super) fn plate(half: f64, z: f64) -> Scan {
    let n = (half / 1e-3).round() as i32;
    let steps = (-n..=n).flat_map(|x| (-n..=n).map(move |y| (x, y)));
    let points =
        steps.map(|(x, y)| [f64::from(x) * 1e-3, f64::from(y) * 1e-3, 0.65 - z].map(|v| v as f32));
    Scan { points: points.collect(), ..Scan::default() }
}

/// A space that has integrated a [`plate`] of 0.06 m at the height 2 mm.
pub(super) fn space_with_plate(params: &ViewParams) -> ViewSpace {
    let mut space = unknown_space(params);
    space.integrate(&plate(0.03, 0.002), &above()).unwrap();
    space
}

/// A view of the origin from 0.65 m, looking in `direction`.
pub(super) fn view_along(direction: Vec3) -> Pose {
    looking_along(&(direction.normalize() * -0.65), &direction.normalize())
}

pub(super) fn gain_of(space: &ViewSpace, pose: &Pose) -> gain::Gain {
    let evaluator = gain::GainEvaluator::new(space);
    evaluator.gain(pose, &mut evaluator.empty_set())
}

fn state_at(space: &ViewSpace, x: f64, z: f64) -> VoxelState {
    space.state_at(&Vec3::new(x, 0.001, z)).unwrap()
}

fn accept(pose: &Pose) -> Result<ReachedView, RefusedView> {
    Ok(ReachedView { pose: *pose, duration: 1.0 })
}

fn refuse(kind: &'static str) -> Result<ReachedView, RefusedView> {
    Err(RefusedView { kind, reason: format!("{kind} by 3 mm") })
}

#[test]
fn a_scan_leaves_free_space_before_surface_before_hidden_space_with_a_border() {
    let space = space_with_plate(&ViewParams::default());
    assert_eq!(state_at(&space, 0.0, 0.06), VoxelState::Free);
    assert_eq!(state_at(&space, 0.0, 0.0061), VoxelState::Free);
    assert_eq!(state_at(&space, 0.0, 0.002), VoxelState::Occupied);
    assert_eq!(state_at(&space, 0.0, -0.003), VoxelState::PossibleInside);
    assert_eq!(state_at(&space, 0.0, -0.09), VoxelState::PossibleInside);
    assert_eq!(state_at(&space, 0.09, 0.0), VoxelState::Unknown);
    let border = (0..20)
        .map(|i| f64::from(i) * 5e-3 + 1e-3)
        .find(|x| state_at(&space, *x, -0.02) == VoxelState::PossibleBorder);
    assert!((0.03..0.04).contains(&border.unwrap()), "{border:?}");
    assert_eq!(space.state_at(&Vec3::x()), None);
    let counts = space.counts();
    assert_eq!(counts.satisfied, counts.occupied);
    let told = counts.free + counts.occupied + counts.possible_inside + counts.possible_border;
    assert_eq!(counts.unknown + told, 41usize.pow(3));
}

#[test]
fn outliers_are_left_out_and_a_false_surface_gives_way_to_evidence() {
    let mut space = unknown_space(&ViewParams::default());
    let mut scan = plate(0.03, -0.05);
    scan.points.push([0.0, 0.0, 0.6]);
    space.integrate(&scan, &above()).unwrap();
    assert_eq!(state_at(&space, 0.001, 0.05), VoxelState::Free, "one point alone is no surface");
    space.integrate(&plate(0.01, 0.052), &above()).unwrap();
    assert_eq!(state_at(&space, 0.001, 0.052), VoxelState::Occupied);
    let behind = plate(0.03, -0.05);
    space.integrate(&behind, &above()).unwrap();
    assert_eq!(
        state_at(&space, 0.001, 0.052),
        VoxelState::Occupied,
        "two scans saw through it, one hit it"
    );
    space.integrate(&behind, &above()).unwrap();
    assert_eq!(state_at(&space, 0.001, 0.052), VoxelState::Free, "three saw through it");
    assert_eq!(state_at(&space, 0.001, -0.049), VoxelState::Occupied);
}

#[test]
fn solid_space_needs_no_measurements_and_stops_rays() {
    let mut space = unknown_space(&ViewParams::default());
    space.exclude_below(0.0);
    space.exclude(&[Aabb { min: Vec3::new(-0.1, -0.1, -0.1), max: Vec3::new(-0.05, 0.1, 0.1) }]);
    let before = space.counts().excluded;
    assert_eq!(before, 41 * 41 * 20 + 10 * 40 * 20);
    space.integrate(&plate(0.08, 0.012), &above()).unwrap();
    let counts = space.counts();
    assert_eq!(counts.excluded, before);
    assert!(space.voxels().iter().all(|(c, s, _)| c.z > 0.0 || *s == VoxelState::Excluded));
    assert_eq!(space.state_at(&Vec3::new(-0.07, 0.0, 0.012)), Some(VoxelState::Excluded));
    // Through the solid side nothing is seen.
    let [through, open] = [-0.6_f64, 0.6].map(|x| {
        let pose = looking_along(&Vec3::new(x, 0.0, 0.006), &Vec3::new(-x.signum(), 0.0, 0.0));
        gain_of(&space, &pose)
    });
    assert!(through.hidden == 0 && open.hidden > 10, "{through:?} {open:?}");
}

#[test]
fn voxels_that_scans_see_in_vain_are_given_up() {
    let params = ViewParams { max_tries: 3, ..ViewParams::default() };
    let mut space = space_with_plate(&params);
    let side = looking_along(&(Vec3::x() * 0.65), &-Vec3::x());
    let nothing = Scan { points: vec![[f32::NAN; 3]; 10], ..Scan::default() };
    let first = gain_of(&space, &side).hidden;
    assert!(first > 300, "{first}");
    // The border was looked at from above once already.
    space.integrate(&nothing, &side).unwrap();
    assert_eq!(gain_of(&space, &side).hidden, first);
    space.integrate(&nothing, &side).unwrap();
    space.integrate(&nothing, &side).unwrap();
    assert_eq!(gain_of(&space, &side).hidden, 0);
    assert!(space.counts().unresolved >= first);
}

#[test]
fn the_first_view_is_the_first_predefined_one_that_can_be_reached() {
    let mut space = unknown_space(&ViewParams::default());
    let plan = next_view(&space, &mut |pose| match pose.translation.x < -0.1 {
        true => accept(pose),
        false => refuse("too far"),
    });
    let chosen = plan.chosen.unwrap();
    assert!(chosen.pose.translation.x < -0.1 && chosen.candidate > 0);
    assert!(plan.candidates[..chosen.candidate].iter().all(|c| c.asked && !c.reachable));
    assert_eq!(plan.candidates[0].reason, "too far by 3 mm");
    let done = next_view(&space, &mut |_| refuse("too far")).done.unwrap();
    assert_eq!(
        (done.cause, done.refusals.as_slice()),
        (TerminationCause::NoFirstView, &[("too far", 42)][..])
    );
    assert!(done.text.contains("none of 42") && done.text.contains("42 too far"), "{}", done.text);
    // Nothing measured: the next one, until none is left.
    let mut views = 0;
    let done = loop {
        match next_view(&space, &mut |pose| accept(pose)) {
            Plan { chosen: Some(view), .. } => {
                space.integrate(&Scan::default(), &view.pose).unwrap();
                views += 1;
            }
            plan => break plan.done.unwrap().text,
        }
    };
    assert_eq!(views, 42);
    assert!(done.contains("no surface was measured") && done.contains("42 scans"), "{done}");
}

#[test]
fn a_plan_takes_the_best_that_can_be_reached_and_says_why_not_the_others() {
    let space = space_with_plate(&ViewParams::default());
    let free = next_view(&space, &mut |pose| accept(pose));
    let best = free.chosen.unwrap();
    assert_eq!(free.candidates.iter().filter(|c| c.asked).count(), 1);
    assert!(best.gain > 0.0 && best.expected_new > 100 && free.done.is_none());
    let plan = next_view(&space, &mut |pose| match *pose == best.pose {
        true => refuse("in collision"),
        false => accept(pose),
    });
    let other = plan.chosen.unwrap();
    assert!(other.candidate > 0 && other.gain <= best.gain);
    // A pose from which nothing is seen is not taken as the candidate that it stands for.
    let away = looking_along(&(Vec3::x() * 2.0), &Vec3::x());
    let plan = next_view(&space, &mut |_| Ok(ReachedView { pose: away, duration: 1.0 }));
    assert!(plan.chosen.is_none() && plan.candidates[0].reason.contains("nothing new"));
}

#[test]
fn what_the_robot_refuses_and_what_is_not_worth_it_are_told_apart() {
    let mut space = space_with_plate(&ViewParams::default());
    // The robot takes nothing.
    let plan = next_view(&space, &mut |_| refuse("out of reach"));
    assert!(plan.candidates.iter().all(|c| c.asked && !c.reachable));
    assert!(plan.candidates.iter().all(|c| c.reason == "out of reach by 3 mm"));
    let (all, done) = (plan.candidates.len(), plan.done.unwrap());
    assert_eq!(
        (done.cause, done.refused(), done.not_worth_it),
        (TerminationCause::Refused, all, 0)
    );
    let text = format!(
        "of {all} that would show something new: the robot refuses {all} ({all} out of reach)"
    );
    assert!(done.text.ends_with(&text), "{}", done.text);
    // It takes all, but from where nothing new is seen.
    let away = looking_along(&(Vec3::x() * 2.0), &Vec3::x());
    let nothing = Ok(ReachedView { pose: away, duration: 1.0 });
    let done = next_view(&space, &mut |_| nothing.clone()).done.unwrap();
    assert_eq!(
        (done.cause, done.refused(), done.not_worth_it),
        (TerminationCause::NotWorthIt, 0, all)
    );
    assert!(!done.text.contains("refuses") && done.text.contains("would show less than"));
    // Both, and for two reasons.
    let mut asked = 0;
    let plan = next_view(&space, &mut |_| {
        asked += 1;
        match asked {
            1 => refuse("in collision"),
            2 | 3 => refuse("out of reach"),
            _ => nothing.clone(),
        }
    });
    let done = plan.done.unwrap();
    assert_eq!((done.cause, done.not_worth_it), (TerminationCause::Refused, all - 3));
    assert_eq!(done.refusals, [("out of reach", 2), ("in collision", 1)]);
    let text = format!("refuses 3 (2 out of reach, 1 in collision), {} would show less", all - 3);
    assert!(done.text.contains(&text), "{}", done.text);
    // Nothing is worth asking for.
    let params = ViewParams { min_gain: 1.0, weight_inside: 0.0, ..ViewParams::default() };
    space.params = ViewParams { voxel_edge: 0.005, ..params };
    let done = next_view(&space, &mut |pose| accept(pose)).done.unwrap();
    assert_eq!(
        (done.cause, done.refused(), done.not_worth_it),
        (TerminationCause::NotWorthIt, 0, 0)
    );
}

#[test]
fn hidden_space_counts_only_near_surface_unless_all_is_asked_for() {
    let [near, far, all] = [3, 6, 0].map(|hidden_reach| {
        let space = space_with_plate(&ViewParams { hidden_reach, ..ViewParams::default() });
        gain_of(&space, &view_along(-Vec3::x()))
    });
    // The plate is 13 voxels wide and stands 20 voxels above the end of its shadow.
    assert!((13 * 13 * 2..17 * 17 * 4).contains(&near.hidden), "{near:?}");
    assert!((13 * 13 * 5..19 * 19 * 7).contains(&far.hidden), "{far:?}");
    assert!(all.hidden > 13 * 13 * 18, "{all:?}");
    // Rays that meet nothing but shadow are no rays into the object: they do not make the overlap
    // small.
    assert!(near.overlap > 2.0 * all.overlap, "{near:?} {all:?}");
    // What is unknown does not decide.
    assert_eq!(near.worth, 0.5 * near.hidden as f64);
}

#[test]
fn surface_seen_from_behind_or_at_a_grazing_angle_is_no_overlap() {
    let space = space_with_plate(&ViewParams::default());
    let [front, slanted, grazing, back] = [[0.0, -1.0], [1.0, -1.0], [1.0, -0.1], [0.2, 1.0]]
        .map(|[x, z]| gain_of(&space, &view_along(Vec3::new(x, 0.0, z))).overlap);
    assert!(front > 0.6 && slanted > 0.4, "{front} {slanted}");
    assert!(grazing < 0.1 && back == 0.0, "{grazing} {back}");
}

/// The gain of scanning again, and the counts, after `scan`.
fn gain_and_counts_after(params: &ViewParams, scan: &Scan) -> (gain::Gain, VoxelCounts) {
    let mut space = unknown_space(params);
    space.integrate(scan, &above()).unwrap();
    (gain_of(&space, &above()), space.counts())
}

#[test]
fn voxels_beside_those_that_have_their_points_count_less_and_all_count_in_the_coverage() {
    let mut params = ViewParams { weight_inside: 0.0, ..ViewParams::default() };
    // A plate whose last row of voxels lies under its edge.
    let (gain, counts) = gain_and_counts_after(&params, &plate(0.0305, 0.002));
    assert!(gain.lacking == 0 || gain.beside == gain.lacking, "{gain:?}");
    // A few points beside it, and as many on their own.
    let mut scan = plate(0.03, 0.002);
    for i in 1..4_u8 {
        scan.points.push([0.032, 1e-3 * f32::from(i), 0.648]);
        scan.points.push([0.062, 1e-3 * f32::from(i), 0.648]);
    }
    let (gain, both) = gain_and_counts_after(&params, &scan);
    assert_eq!((gain.lacking, gain.beside), (2, 1));
    assert_eq!(gain.worth, 1.0 + params.beside_share);
    assert_eq!(both.occupied - both.satisfied, 2);
    assert_eq!((both.occupied - both.covered, counts.occupied - counts.covered), (1, 0));
    assert!(both.frontier > 0 && both.coverage() < both.covered as f64 / both.occupied as f64);
    params.beside_share = 1.0;
    assert_eq!(gain_and_counts_after(&params, &scan).0.worth, 2.0);
}

#[test]
fn gain_per_second_prefers_what_is_near() {
    let params = ViewParams { utility: Utility::PerSecond, ..ViewParams::default() };
    let space = space_with_plate(&params);
    let best = next_view(&space, &mut |pose| accept(pose)).chosen.unwrap();
    let plan = next_view(&space, &mut |pose| {
        let duration = if *pose == best.pose { 1000.0 } else { 2.0 };
        Ok(ReachedView { pose: *pose, duration })
    });
    let near = plan.chosen.unwrap();
    assert!(near.pose != best.pose && near.duration < 3.0);
}

#[test]
fn every_measure_finds_a_view_and_views_used_are_not_repeated() {
    for word in <GainMeasure as crate::params::ParamValue>::CHOICES {
        let mut params = ViewParams::default();
        params.set("measure", &serde_json::json!(word)).unwrap();
        let mut space = space_with_plate(&params);
        let mut taken: Vec<Pose> = vec![above()];
        for _ in 0..4 {
            let view = next_view(&space, &mut |pose| accept(pose)).chosen.unwrap();
            for old in &taken {
                let angle = (old.rotation * Vec3::z()).angle(&(view.pose.rotation * Vec3::z()));
                let apart = (old.translation.vector - view.pose.translation.vector).norm();
                assert!(
                    angle >= params.used_angle || apart >= params.used_distance * 0.65,
                    "{word}"
                );
            }
            space.mark_used(&view.pose);
            taken.push(view.pose);
        }
    }
}

#[test]
fn broken_input_is_refused_with_what_to_change() {
    let mut space = unknown_space(&ViewParams::default());
    let mut pose = above();
    pose.translation.x = f64::NAN;
    let error = space.integrate(&plate(0.01, 0.0), &pose).unwrap_err().to_string();
    assert!(error.contains("not finite"), "{error}");
    let scan = Scan { origins: vec![[0.0; 3]; 3], ..plate(0.01, 0.0) };
    let error = space.integrate(&scan, &above()).unwrap_err().to_string();
    assert!(error.contains("441 points but 3 ray origins"), "{error}");
    assert_eq!((space.scan_count(), space.counts().occupied), (0, 0));
    let striper = SensorModel::Stereo(StereoModel::GUPPY);
    assert!(ViewSpace::new(striper, Aabb::EMPTY, &ViewParams::default()).is_err());
    // A scan without a return, one outside the region and a point at the sensor itself are no
    // errors.
    let odd = [[f32::NAN; 3], [9.0, 9.0, 9.0], [0.0; 3], [f32::INFINITY; 3], [1e30; 3]];
    space.integrate(&Scan { points: odd.to_vec(), ..Scan::default() }, &above()).unwrap();
    assert_eq!(space.counts().unknown, 41usize.pow(3));
}
