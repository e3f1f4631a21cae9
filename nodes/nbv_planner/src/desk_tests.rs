use super::*;
use puffer_core::geometry::{Mat6, Vec3};
use puffer_core::robot::{SENSOR_FRAME, description, home};
use puffer_core::simulate::{SimulateParams, Simulator, objects};
use puffer_msgs::geometry_msgs::msg::Vector3;
use puffer_msgs::std_msgs::msg::Header;
use puffer_shell::convert::{pose_message, pose_with_covariance, scan_message, status_message};

#[test]
fn a_request_bounds_what_views_are_planned_for() {
    let mut desk = Desk::new(Params::default()).unwrap();
    let configured = desk.params.planner.region();
    assert_eq!(*desk.space().roi(), configured);
    let roi = Vector3 { x: 0.1, y: 0.2, z: 0.15 };
    let request = PlanViewRequest { roi, point_factor: 4, ..PlanViewRequest::default() };
    let aim = desk.aim(&request).unwrap();
    assert_eq!(aim.factor, 4);
    desk.aim_at(aim);
    desk.refresh(&[]).unwrap();
    let region = *desk.space().roi();
    assert_eq!(region.min, Vec3::new(-0.05, -0.1, configured.min.z));
    assert_eq!(region.max, Vec3::new(0.05, 0.1, 0.15));
    assert!(desk.space().state_at(&Vec3::new(0.06, 0.0, 0.1)).is_none());

    let aim = desk.aim(&PlanViewRequest::default()).unwrap();
    assert_eq!(aim, Aim { region: configured, factor: 1 });
    let roi = Vector3 { x: -0.1, y: 0.2, z: 0.15 };
    let error = desk.aim(&PlanViewRequest { roi, ..PlanViewRequest::default() }).unwrap_err();
    assert!(error.to_string().contains("roi"), "{error}");
    assert!(desk.missing_robot().is_some());
    assert!(desk.missing_scans(&PlanViewRequest::default()).is_none());
}

/// A planner of the KR 16 that knows its robot, at rest.
fn desk() -> Desk {
    let mut params = Params::default();
    params.planner.support = Support::Table;
    let mut desk = Desk::new(params).unwrap();
    desk.describe(description("kr16_laser").unwrap()).unwrap();
    desk.stand(&at_home());
    desk
}

fn joint_state(names: Vec<String>, position: Vec<f64>) -> JointState {
    JointState { name: names, position, ..JointState::default() }
}

fn at_home() -> JointState {
    let robot = RobotModel::from_urdf(description("kr16_laser").unwrap()).unwrap();
    let names = robot.joints().iter().map(|joint| joint.name.clone()).collect();
    joint_state(names, home("kr16_laser").unwrap())
}

/// Scans of the coffee package from all sides, as scan_registrar tells them.
fn scans(count: usize) -> Vec<RegisteredScan> {
    let truth = objects::make("coffee").unwrap();
    let simulator = Simulator::new(&truth, &SimulateParams::default(), 1).unwrap();
    let above = simulator.view_poses(12).into_iter().filter(|pose| pose.translation.z > 0.1);
    let told = |(id, pose): (usize, Pose)| RegisteredScan {
        id: id as u32,
        version: 1,
        cloud: scan_message(&simulator.scan(id, &pose).scan, header()),
        beyond: scan_message(&Scan::default(), header()),
        object_from_sensor: pose_with_covariance(&pose, &Mat6::identity()),
        prior: pose_message(&pose),
        ..RegisteredScan::default()
    };
    above.take(count).enumerate().map(told).collect()
}

#[test]
fn what_is_told_of_the_space_bears_the_frame_of_the_scans() {
    let mut scan = with(&scans(1)[0], 1, Status::Accepted);
    scan.header.frame_id = "workpiece".to_owned();
    let mut desk = desk();
    assert_eq!(desk.header(Stamp::new(7, 8)).frame_id, "object");
    desk.take(&scan).unwrap();
    let header = desk.header(Stamp::new(7, 8));
    assert_eq!((header.frame_id.as_str(), header.stamp.sec), ("workpiece", 7));
}

fn header() -> Header {
    Header { frame_id: SENSOR_FRAME.to_owned(), ..Header::default() }
}

fn with(scan: &RegisteredScan, version: u32, status: Status) -> RegisteredScan {
    RegisteredScan { version, status: status_message(status), ..scan.clone() }
}

#[test]
fn a_plan_rests_on_the_scans_that_are_listed_in_whatever_order_they_come() {
    let all = scans(4);
    let scan = |id: usize, version: u32| with(&all[id], version, Status::Accepted);
    let deferred = with(&all[1], 1, Status::Deferred);
    let request = PlanViewRequest {
        scans: 3,
        scans_listed: true,
        accepted: vec![0, 1, 2],
        accepted_versions: vec![1, 2, 1],
        ..PlanViewRequest::default()
    };
    let plan = |arrivals: &[&RegisteredScan]| {
        let mut desk = desk();
        arrivals.iter().for_each(|scan| desk.take(scan).unwrap());
        assert_eq!(desk.missing_scans(&request), None);
        let Answer { plan, reached, .. } = desk.plan(&request).unwrap();
        assert!(plan.chosen.is_some() && reached.is_some());
        (plan, reached, desk.space().voxels())
    };
    // The second is put aside at first, and accepted once the third is there.
    let first = plan(&[&scan(0, 1), &deferred, &scan(2, 1), &scan(1, 2)]);
    // The same, but messages overtake each other.
    assert!(first == plan(&[&scan(2, 1), &scan(1, 2), &deferred, &scan(0, 1)]));
    // One more has come already, which the request does not know of.
    assert!(first == plan(&[&scan(0, 1), &scan(3, 1), &deferred, &scan(2, 1), &scan(1, 2)]));
    // Without a list, all that were accepted count.
    let mut late = desk();
    for scan in [&scan(0, 1), &deferred, &scan(2, 1)] {
        late.take(scan).unwrap();
    }
    assert!(late.plan(&PlanViewRequest::default()).unwrap().plan != first.0);
    let missing = late.missing_scans(&request).unwrap();
    assert!(missing.contains("scan 1") && missing.contains("version 2"), "{missing}");
    late.take(&scan(1, 2)).unwrap();
    assert_eq!(late.missing_scans(&request), None);
}

#[test]
fn corrected_poses_count_until_something_newer_is_told_of_the_scan() {
    let all = scans(2);
    let mut desk = desk();
    for scan in &all {
        desk.take(&with(scan, 3, Status::Accepted)).unwrap();
    }
    let mut poses = RegisteredPoses {
        revision: 1,
        ids: vec![0, 1],
        versions: vec![2, 3],
        status: vec![RegisteredScan::REFUSED; 2],
        object_from_sensor: vec![all[0].object_from_sensor.clone(); 2],
        ..RegisteredPoses::default()
    };
    poses.object_from_sensor[1].pose.position.z += 0.1;
    desk.correct(&poses).unwrap();
    assert_eq!(desk.members(&PlanViewRequest::default()), [0]);
    assert_eq!(desk.scans[&1].pose.translation.z, poses.object_from_sensor[1].pose.position.z);
}

#[test]
fn a_way_starts_where_the_robot_was_sent_to_as_soon_as_joint_states_agree() {
    let (mut desk, sent_to) = (desk(), at_home());
    let beside = |by: f64| {
        let mut position = sent_to.position.clone();
        position[0] += by;
        joint_state(sent_to.name.clone(), position)
    };
    let request = PlanViewRequest { sent_to: sent_to.clone(), ..PlanViewRequest::default() };
    let start = |desk: &Desk, request: &PlanViewRequest| {
        desk.start(desk.robot.as_ref().unwrap().robot(), request).unwrap()
    };
    // It still comes to rest, or its encoders are noisy.
    desk.stand(&beside(0.003));
    assert!(desk.stands_at(&sent_to));
    assert_eq!(start(&desk, &request), sent_to.position);
    // It went somewhere else.
    desk.stand(&beside(0.3));
    assert!(!desk.stands_at(&sent_to));
    assert_eq!(start(&desk, &request), beside(0.3).position);
    assert_eq!(start(&desk, &PlanViewRequest::default()), beside(0.3).position);
}
