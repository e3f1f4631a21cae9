use super::*;
use crate::geometry::{Scan, Vec3};
use crate::register::Status;
use crate::robot::{RobotModel, home_configuration, setup_urdf};
use crate::simulate::{SimulateParams, Simulator, objects};
use crate::view::{Plan, VoxelState};

const ROBOT: &str = "kr16_laser";

fn scans_missing(text: &str) -> Readiness {
    Readiness::ScansMissing(text.to_owned())
}

/// A request for whatever is known.
fn any_request() -> PlanRequest {
    PlanRequest {
        scans: 0,
        revision: 0,
        required: Vec::new(),
        members: None,
        region: PlannerParams::default().region(),
        point_factor: 1,
        start: None,
        sent_to: None,
    }
}

/// A planner of the KR 16 that knows its robot, at home.
fn planner_with_robot() -> Planner {
    let params = PlannerParams { support: Support::Table, ..PlannerParams::default() };
    let mut planner = Planner::new(params, ViewParams::default()).unwrap();
    planner.on_robot_description(setup_urdf(ROBOT).unwrap()).unwrap();
    planner.on_joint_state(&home_positions());
    planner
}

fn home_positions() -> JointPositions {
    let robot = RobotModel::from_urdf(setup_urdf(ROBOT).unwrap()).unwrap();
    let names = robot.joints().iter().map(|joint| joint.name.clone()).collect();
    JointPositions { names, positions: home_configuration(ROBOT).unwrap() }
}

/// Home with the first joint turned by `angle` radians.
fn beside_home(angle: f64) -> JointPositions {
    let mut positions = home_positions();
    positions.positions[0] += angle;
    positions
}

/// Accepted scans of the coffee package from above, numbered from 0, in their version 1.
fn coffee_scans(count: usize) -> Vec<ScanUpdate> {
    let truth = objects::make_object("coffee").unwrap();
    let simulator = Simulator::new(&truth, &SimulateParams::default(), 1).unwrap();
    let above = simulator.view_poses(12).into_iter().filter(|pose| pose.translation.z > 0.1);
    let poses = above.take(count).enumerate();
    poses.map(|(id, pose)| scan_from(id as u32, simulator.scan(id, &pose).scan, pose)).collect()
}

/// Accepted scans from straight above, numbered from 0, in their version 1: each of a square plate
/// of 0.06 m, a point each 1 mm, higher and farther along x than the one before.
fn plate_scans(count: u32) -> Vec<ScanUpdate> {
    let steps = (-30..=30).flat_map(|x| (-30..=30).map(move |y| [x as f32, y as f32]));
    let points: Vec<[f32; 3]> = steps.map(|[x, y]| [x * 1e-3, y * 1e-3, 0.3]).collect();
    let scan = Scan { points, ..Scan::default() };
    let poses = (0..count).map(|id| {
        let position = Vec3::new(0.02 * f64::from(id), 0.0, 0.35 + 0.03 * f64::from(id));
        (id, crate::view::looking_along(&position, &-Vec3::z()))
    });
    poses.map(|(id, pose)| scan_from(id, scan.clone(), pose)).collect()
}

fn scan_from(id: u32, scan: Scan, pose: Pose) -> ScanUpdate {
    ScanUpdate {
        version: ScanVersion { id, version: 1 },
        scan,
        beyond: Scan::default(),
        prior: pose,
        pose,
        status: Status::Accepted,
        frame: "object".to_owned(),
    }
}

fn with_version(scan: &ScanUpdate, version: u32, status: Status) -> ScanUpdate {
    let id = scan.version.id;
    ScanUpdate { version: ScanVersion { id, version }, status, ..scan.clone() }
}

/// What the planner answers after the scans have arrived in this order, and the space that it
/// planned in.
fn plan_after(
    arrivals: &[&ScanUpdate],
    request: &PlanRequest,
) -> (Plan, f64, Vec<(Vec3, VoxelState, bool)>) {
    let mut planner = planner_with_robot();
    for scan in arrivals {
        planner.on_scan((*scan).clone()).unwrap();
    }
    assert_eq!(planner.readiness(request), Readiness::Ready);
    let PlanningResult { plan, motion, .. } = planner.plan(request).unwrap();
    assert!(plan.chosen.is_some());
    (plan, motion.unwrap().duration, planner.space().voxels())
}

#[test]
fn a_request_bounds_what_views_are_planned_for() {
    let mut planner = planner_with_robot();
    let configured = planner.params.region();
    assert_eq!(*planner.space().roi(), configured);
    let mut region = configured;
    (region.min.x, region.max.x, region.max.z) = (-0.05, 0.05, 0.15);
    let request = PlanRequest { region, point_factor: 4, ..any_request() };
    planner.plan(&request).unwrap();
    assert_eq!(*planner.target(), Target { region, point_factor: 4 });
    assert_eq!(*planner.space().roi(), region);
    assert!(planner.space().state_at(&Vec3::new(0.06, 0.0, 0.1)).is_none());
    assert_eq!(planner.space().params.min_points, 4 * ViewParams::default().min_points);
    planner.plan(&PlanRequest { point_factor: 0, ..any_request() }).unwrap();
    assert_eq!(*planner.target(), Target { region: configured, point_factor: 1 });
}

#[test]
fn what_is_missing_is_said_until_it_arrives() {
    let mut planner = Planner::new(PlannerParams::default(), ViewParams::default()).unwrap();
    let request = PlanRequest { scans: 1, revision: 2, ..any_request() };
    assert_eq!(planner.readiness(&request), scans_missing("0 of 1 scans came"));
    planner.on_scan(scan_from(0, Scan::default(), Pose::identity())).unwrap();
    assert_eq!(
        planner.readiness(&request),
        scans_missing("corrected poses of revision 0 of 2 came")
    );
    planner.on_corrected_poses(2, &[]);
    let Readiness::RobotMissing(text) = planner.readiness(&request) else { panic!() };
    assert!(text.contains("robot_description"), "{text}");
    assert!(planner.on_robot_description("<robot").is_err());
    let Readiness::RobotUnusable(text) = planner.readiness(&request) else { panic!() };
    assert!(text.starts_with("robot_description: "), "{text}");
    planner.on_robot_description(setup_urdf(ROBOT).unwrap()).unwrap();
    let Readiness::RobotMissing(text) = planner.readiness(&request) else { panic!() };
    assert!(text.contains("joint_states"), "{text}");
    let mut incomplete = home_positions();
    incomplete.names[2] = "another".to_owned();
    planner.on_joint_state(&incomplete);
    assert_ne!(planner.readiness(&request), Readiness::Ready);
    planner.on_joint_state(&home_positions());
    assert_eq!(planner.readiness(&request), Readiness::Ready);
    assert_eq!(planner.joint_names(), home_positions().names);
}

#[test]
fn the_frame_is_that_of_the_newest_scan() {
    let mut planner = planner_with_robot();
    assert_eq!(planner.frame(), "object");
    let mut scan = scan_from(0, Scan::default(), Pose::identity());
    scan.frame = "workpiece".to_owned();
    planner.on_scan(with_version(&scan, 2, Status::Accepted)).unwrap();
    assert_eq!(planner.frame(), "workpiece");
    scan.frame = "late".to_owned();
    planner.on_scan(scan).unwrap();
    assert_eq!(planner.frame(), "workpiece", "an older version changes nothing");
}

#[test]
fn a_plan_rests_on_the_scans_that_are_listed_in_whatever_order_they_come() {
    let all = coffee_scans(4);
    let deferred = with_version(&all[1], 1, Status::Deferred);
    let accepted = with_version(&all[1], 2, Status::Accepted);
    let required = [(0, 1), (1, 2), (2, 1)].map(|(id, version)| ScanVersion { id, version });
    let request = PlanRequest {
        scans: 3,
        required: required.to_vec(),
        members: Some(vec![0, 1, 2]),
        ..any_request()
    };
    // The second is put aside at first, and accepted once the third is there.
    let first = plan_after(&[&all[0], &deferred, &all[2], &accepted], &request);
    // The same, but messages overtake each other.
    assert!(first == plan_after(&[&all[2], &accepted, &deferred, &all[0]], &request));
    // One more has come already, which the request does not know of.
    assert!(first == plan_after(&[&all[0], &all[3], &deferred, &all[2], &accepted], &request));
    // Without a list, all that were accepted count.
    let mut late = planner_with_robot();
    for scan in [&all[0], &deferred, &all[2]] {
        late.on_scan(scan.clone()).unwrap();
    }
    assert!(late.plan(&any_request()).unwrap().plan != first.0);
    let Readiness::ScansMissing(missing) = late.readiness(&request) else { panic!() };
    assert!(missing.contains("scan 1") && missing.contains("version 2"), "{missing}");
    late.on_scan(accepted).unwrap();
    assert_eq!(late.readiness(&request), Readiness::Ready);
}

#[test]
fn corrected_poses_count_until_a_newer_version_of_the_scan_arrives() {
    let mut planner = planner_with_robot();
    for id in [0, 1] {
        let scan = scan_from(id, Scan::default(), Pose::identity());
        planner.on_scan(with_version(&scan, 3, Status::Accepted)).unwrap();
    }
    let (outdated, current) =
        (ScanVersion { id: 0, version: 2 }, ScanVersion { id: 1, version: 3 });
    let pose = Pose::translation(0.0, 0.0, 0.1);
    let updates =
        [outdated, current].map(|version| PoseUpdate { version, pose, status: Status::Refused });
    planner.on_corrected_poses(1, &updates);
    assert_eq!(planner.members(&any_request()), [0]);
    assert_eq!(planner.scans.get(0).unwrap().pose, Pose::identity());
    assert_eq!(planner.scans.get(1).unwrap().pose, pose);
}

/// The state 0.15 m above the table, `x` metres beside the object's axis.
fn state_beside_axis(planner: &Planner, x: f64) -> Option<VoxelState> {
    planner.space().state_at(&Vec3::new(x, 0.0, 0.15))
}

#[test]
fn space_seen_free_by_returns_from_beyond_survives_corrected_poses() {
    let mut planner = planner_with_robot();
    let pose = crate::view::looking_along(&Vec3::new(0.0, 0.0, 0.3), &-Vec3::z());
    let mut scan = scan_from(0, Scan::default(), pose);
    // A return from the table, 0.02 m beside the axis.
    scan.beyond.points.push([0.02, 0.0, 0.3]);
    planner.on_scan(scan).unwrap();
    planner.refresh(&[0]).unwrap();
    let before = planner.space().voxels();
    let free = planner.space().counts().free;
    assert!(free > 10, "{free}");
    assert_eq!(state_beside_axis(&planner, 0.01), Some(VoxelState::Free));

    let version = ScanVersion { id: 0, version: 1 };
    let same = PoseUpdate { version, pose, status: Status::Accepted };
    planner.on_corrected_poses(1, &[same]);
    planner.refresh(&[0]).unwrap();
    assert_eq!((planner.space().counts().free, planner.space().voxels()), (free, before));

    let moved = PoseUpdate { pose: Pose::translation(0.04, 0.0, 0.0) * pose, ..same };
    planner.on_corrected_poses(2, &[moved]);
    planner.refresh(&[0]).unwrap();
    assert_eq!(state_beside_axis(&planner, 0.01), Some(VoxelState::Unknown));
    assert_eq!(state_beside_axis(&planner, 0.05), Some(VoxelState::Free));
    assert_eq!(planner.space().scan_count(), 1);
}

#[test]
fn refreshing_by_corrected_poses_gives_the_space_of_the_same_poses_from_the_start() {
    let all = plate_scans(2);
    let (mut direct, mut corrected) = (planner_with_robot(), planner_with_robot());
    let mut updates = Vec::new();
    for scan in &all {
        direct.on_scan(scan.clone()).unwrap();
        updates.push(PoseUpdate { version: scan.version, pose: scan.pose, status: scan.status });
        let pose = Pose::translation(0.004, 0.0, 0.02) * scan.pose;
        corrected.on_scan(ScanUpdate { pose, ..scan.clone() }).unwrap();
    }
    direct.refresh(&[0, 1]).unwrap();
    corrected.refresh(&[0, 1]).unwrap();
    assert_ne!(direct.space().voxels(), corrected.space().voxels());
    corrected.on_corrected_poses(1, &updates);
    corrected.refresh(&[0, 1]).unwrap();
    assert_eq!(direct.space().voxels(), corrected.space().voxels());
    assert_eq!(direct.space().counts(), corrected.space().counts());
}

#[test]
fn views_that_were_planned_or_not_accepted_are_used_and_a_reset_forgets_them() {
    let mut planner = planner_with_robot();
    let first = planner.plan(&any_request()).unwrap().plan.chosen.unwrap();
    let second = planner.plan(&any_request()).unwrap().plan.chosen.unwrap();
    assert_ne!(first.pose, second.pose, "no view is planned twice");
    let refused = scan_from(0, Scan::default(), Pose::translation(0.0, 0.5, 0.5));
    planner.on_scan(with_version(&refused, 1, Status::Refused)).unwrap();
    planner.refresh(&[]).unwrap();
    assert_eq!(planner.space().used_views().count(), 3);
    assert_eq!(planner.scan_count(), 1);
    planner.reset().unwrap();
    assert_eq!((planner.space().used_views().count(), planner.scan_count()), (0, 0));
    let again = planner.plan(&any_request()).unwrap().plan.chosen.unwrap();
    assert_eq!(again.pose, first.pose);
}

#[test]
fn on_a_table_no_view_from_below_is_asked_of_the_robot() {
    let plan = planner_with_robot().plan(&any_request()).unwrap().plan;
    let below = plan.candidates.iter().filter(|c| c.pose.translation.z <= 0.0);
    assert!(below.clone().all(|c| c.refusal.is_none_or(|kind| kind == "from below the table")));
    assert!(plan.chosen.unwrap().pose.translation.z > 0.0);
}

#[test]
fn what_holds_the_object_is_solid_once_the_joints_are_known() {
    let mut planner = Planner::new(PlannerParams::default(), ViewParams::default()).unwrap();
    planner.on_robot_description(setup_urdf(ROBOT).unwrap()).unwrap();
    planner.refresh(&[]).unwrap();
    assert_eq!(planner.space().counts().excluded, 0, "where the robot stands is not known");
    planner.on_joint_state(&home_positions());
    planner.refresh(&[]).unwrap();
    let solid = planner.space().counts().excluded;
    assert!(solid > 100, "{solid}");
    // The fixture lies below the object: its origin is the lowest point of the object.
    let voxels = planner.space().voxels();
    assert!(voxels.iter().all(|(center, ..)| center.z < planner.space().edge()));
}

#[test]
fn a_motion_starts_where_the_robot_was_sent_to_as_soon_as_joint_states_agree() {
    let mut planner = planner_with_robot();
    let sent_to = home_positions();
    let request = PlanRequest { sent_to: Some(sent_to.clone()), ..any_request() };
    // It still comes to rest, or its encoders are noisy.
    planner.on_joint_state(&beside_home(0.003));
    assert!(planner.is_at(&sent_to));
    assert_eq!(planner.robot.start(&request).unwrap(), sent_to.positions);
    // It went somewhere else.
    planner.on_joint_state(&beside_home(0.3));
    assert!(!planner.is_at(&sent_to));
    let there = beside_home(0.3).positions;
    assert_eq!(planner.robot.start(&request).unwrap(), there);
    assert_eq!(planner.robot.start(&any_request()).unwrap(), there);
    // A request can name a start of its own, with all joints.
    let start = Some(beside_home(0.1));
    let named = PlanRequest { start, ..request.clone() };
    assert_eq!(planner.robot.start(&named).unwrap(), beside_home(0.1).positions);
    let start = Some(JointPositions { names: vec!["a".to_owned()], positions: vec![0.0] });
    let error = planner.robot.start(&PlanRequest { start, ..request }).unwrap_err().to_string();
    assert!(error.contains("all joints"), "{error}");
}
