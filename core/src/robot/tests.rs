//! Tests of the robot as a whole.

use super::kinematic_chain::{KinematicChain, view_from_sensor};
use super::view_solutions::{IkSearch, solve_view};
use super::*;
use crate::geometry::{
    Aabb, Pose, SensorModel, Shape, StriperModel, Twist, Vec3, exp, log, transform,
};
use crate::mesh::{is_closed, is_oriented};
use nalgebra::{Rotation3, Translation3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The extent of an object of 0.1 x 0.1 x 0.18 m that stands on z = 0.
pub(super) fn object() -> Obstacle {
    Obstacle::from_box(&Aabb {
        min: Vec3::new(-0.05, -0.05, 0.0),
        max: Vec3::new(0.05, 0.05, 0.18),
    })
}

/// The view of the object's middle from a direction.
pub(super) fn view(direction: &Vec3, distance: f64) -> Pose {
    let z = -direction.normalize();
    let x = if z.z.abs() > 0.99 { Vec3::x() } else { z.cross(&Vec3::z()).normalize() };
    let rotation = Rotation3::from_basis_unchecked(&[x, z.cross(&x), z]);
    let position = Vec3::new(0.0, 0.0, 0.09) - z * distance;
    Pose::from_parts(Translation3::from(position), UnitQuaternion::from_rotation_matrix(&rotation))
}

fn robot(setup: &str) -> RobotModel {
    RobotModel::from_urdf(setup_urdf(setup).unwrap()).unwrap()
}

pub(super) fn cell(setup: &str) -> Workcell {
    Workcell::new(robot(setup)).unwrap()
}

fn random(robot: &RobotModel, rng: &mut ChaCha8Rng) -> Vec<f64> {
    robot.joints().iter().map(|j| rng.random_range(j.limits[0]..=j.limits[1])).collect()
}

fn request<'a>(view: Pose, start: &'a [f64], obstacle: &'a Obstacle) -> ReachabilityRequest<'a> {
    let sensor = SensorModel::Striper(StriperModel::SCANCONTROL);
    let slide = slide_range(&sensor, 0.15);
    ReachabilityRequest { view, start, sweep: sensor.sweep_length(), slide, obstacle, margin: 0.01 }
}

#[test]
fn the_flange_of_the_kr16_stands_where_the_data_sheet_puts_it() {
    let robot = robot("kr16_laser");
    for (degrees, expected) in [
        ([0.0; 6], [1.768, 0.0, 0.640]),
        ([0.0, -90.0, 90.0, 0.0, 0.0, 0.0], [1.088, 0.0, 1.320]),
        // A1 turns clockwise seen from above.
        ([90.0, -90.0, 90.0, 0.0, 0.0, 0.0], [0.0, -1.088, 1.320]),
        // The wrist bent down: the flange hangs 0.158 below the wrist's centre.
        ([0.0, -90.0, 90.0, 0.0, 90.0, 45.0], [0.930, 0.0, 1.162]),
    ] {
        let q = degrees.map(f64::to_radians);
        let flange = robot.pose(&q, "base_link", "flange").unwrap();
        let off = flange.translation.vector - Vec3::from(expected);
        assert!(off.norm() < 1e-9, "{degrees:?}: {}", flange.translation.vector);
    }
    let names: Vec<&str> = robot.joints().iter().map(|j| j.name.as_str()).collect();
    assert_eq!(names, ["joint_a1", "joint_a2", "joint_a3", "joint_a4", "joint_a5", "joint_a6"]);
}

#[test]
fn the_flange_of_the_lwr_stands_where_its_lengths_put_it() {
    let robot = robot("omnirob_stereo");
    for (joint, degrees, expected) in [
        (0, 0.0, [0.0, 0.0, 1.178]),
        (1, 90.0, [-0.868, 0.0, 0.310]),
        (3, 90.0, [0.468, 0.0, 0.710]),
        (5, -90.0, [0.078, 0.0, 1.100]),
    ] {
        let mut q = vec![0.0; robot.joints().len()];
        q[joint] = f64::to_radians(degrees);
        let flange = robot.pose(&q, "lwr_base", "flange").unwrap();
        let off = flange.translation.vector - Vec3::from(expected);
        assert!(off.norm() < 1e-9, "{joint}: {}", flange.translation.vector);
    }
}

#[test]
fn the_second_jaw_follows_the_first() {
    let robot = robot("omnirob_stereo");
    let mut q = home_configuration("omnirob_stereo").unwrap();
    let jaw = robot.joints().iter().position(|j| j.name == "gripper_left_joint").unwrap();
    assert!(robot.joints().iter().all(|j| j.name != "gripper_right_joint"));
    for opening in [0.0, 0.055] {
        q[jaw] = opening;
        let left = robot.pose(&q, OBJECT_FRAME, "gripper_left").unwrap().translation.vector;
        let right = robot.pose(&q, OBJECT_FRAME, "gripper_right").unwrap().translation.vector;
        assert!((left - right - Vec3::y() * 2.0 * opening).norm() < 1e-12);
    }
}

#[test]
fn the_jacobian_is_the_derivative_of_the_view() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for setup in SETUP_NAMES {
        let robot = robot(setup);
        let ends = [robot.link(OBJECT_FRAME).unwrap(), robot.link(SENSOR_FRAME).unwrap()];
        let chain = KinematicChain::new(&robot, ends[0], ends[1]);
        for _ in 0..20 {
            let q = random(&robot, &mut rng);
            let mut x = chain.joint_positions(&q);
            let expected = robot.pose(&q, OBJECT_FRAME, SENSOR_FRAME).unwrap();
            assert!(log(&(chain.end_pose(&x).inverse() * expected)).norm() < 1e-9);
            x.extend([0.05, 0.7]);
            let (mut columns, mut unused) = (Vec::new(), Vec::new());
            let here = chain.view_with_jacobian(&x, &mut columns);
            assert!(
                log(&((here * view_from_sensor(0.05, 0.7)).inverse() * expected)).norm() < 1e-9
            );
            for i in 0..x.len() {
                let [ahead, behind] = [1e-5, -1e-5].map(|step| {
                    let mut moved = x.clone();
                    moved[i] += step;
                    log(&(here.inverse() * chain.view_with_jacobian(&moved, &mut unused)))
                });
                let slope = (ahead - behind) / 2e-5;
                assert!((slope - columns[i]).norm() < 1e-7, "{setup} {i}");
            }
        }
    }
}

#[test]
fn views_of_random_joint_positions_are_found_again_within_the_limits() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for setup in SETUP_NAMES {
        let cell = cell(setup);
        let start = home_configuration(setup).unwrap();
        let (count, mut found) = (60, 0);
        for _ in 0..count {
            let pose = cell.object_from_sensor(&random(cell.robot(), &mut rng)).unwrap();
            let search = IkSearch { seed_count: 96, slide: [0.0; 2] };
            let members = solve_view(cell.robot(), &cell.chain, &cell.seeds, &pose, &start, search);
            found += usize::from(!members.is_empty());
            for member in &members {
                assert_eq!(cell.robot().joint_beyond_limits(&member.q), None);
                let actual = cell.object_from_sensor(&member.q).unwrap();
                assert!(log(&(member.pose.inverse() * actual)).norm() < 1e-6);
                // Same place and viewing axis; only the roll differs.
                let relative = pose.inverse() * member.pose;
                assert!(relative.translation.vector.norm() < 1e-6);
                assert!((relative.rotation * Vec3::z() - Vec3::z()).norm() < 1e-6);
            }
            assert!(members.is_sorted_by(|a, b| a.time <= b.time));
        }
        assert!(found >= 58, "{setup}: {found} of {count}");
    }
}

#[test]
fn collisions_are_seen_and_free_positions_are_free() {
    for setup in SETUP_NAMES {
        let home = home_configuration(setup).unwrap();
        assert_eq!(obstruction(&cell(setup), &home), None);
    }
    let cell = cell("kr16_laser");
    // The forearm through the table, and the sensor folded into the arm.
    let why = obstruction(&cell, &radians([0.0, -20.0, 60.0, 0.0, 0.0, 0.0])).unwrap();
    assert!(why.contains("table") || why.contains("object"), "{why}");
    assert!(obstruction(&cell, &radians([180.0, -90.0, 150.0, 0.0, 0.0, 0.0])).is_some());
    assert_eq!(obstruction(&cell, &radians([180.0, -90.0, 0.0, 0.0, 0.0, 0.0])), None);
    let why = obstruction(&cell, &radians([0.0, 40.0, 0.0, 0.0, 0.0, 0.0])).unwrap();
    assert!(why.contains("`joint_a2` is beyond its limits"), "{why}");
    assert!(cell.find_obstruction(&[0.0; 5], &object(), 0.01).is_err());
}

fn obstruction(cell: &Workcell, q: &[f64]) -> Option<String> {
    cell.find_obstruction(q, &object(), 0.01).unwrap()
}

fn radians(degrees: [f64; 6]) -> [f64; 6] {
    degrees.map(f64::to_radians)
}

#[test]
fn ways_and_sweeps_are_free_when_checked_densely() {
    let cell = cell("kr16_laser");
    let obstacle = object();
    let all = cell.collisions.with_obstacle(cell.robot(), &cell.chain, &obstacle);
    let mut start = home_configuration("kr16_laser").unwrap();
    let mut bent = 0;
    for (azimuth, elevation) in
        [(90.0, 10.0), (-90.0, 15.0), (170.0, 20.0), (10.0, 30.0), (120.0, 5.0)]
    {
        let (a, e) = (f64::to_radians(azimuth), f64::to_radians(elevation));
        let direction = Vec3::new(e.cos() * a.cos(), e.cos() * a.sin(), e.sin());
        let request = request(view(&direction, 0.3), &start, &obstacle);
        let reach = cell.check_reachability(&request).unwrap();
        assert_eq!(reach, cell.check_reachability(&request).unwrap(), "not the same twice");
        let Reachability::Reachable(reached) = reach else {
            panic!("{azimuth} {elevation}: {reach:?}")
        };
        assert_eq!(reached.path.positions.first(), Some(&start));
        assert_eq!(reached.path.positions.last(), Some(&reached.q));
        let sweep = reached.sweep.unwrap();
        for trajectory in [&reached.path, &sweep] {
            for (pair, times) in trajectory.positions.windows(2).zip(trajectory.times.windows(2)) {
                let time = cell.robot().min_travel_time(&pair[0], &pair[1]);
                assert!(time <= (times[1] - times[0]) * (1.0 + 1e-9));
                for i in 0..=20 {
                    let q = planning_space::interpolate(&pair[0], &pair[1], f64::from(i) / 20.0);
                    let clearance = all.clearance(&cell.robot().forward_kinematics(&q), 0.01);
                    assert!(clearance.distance > 0.003, "{clearance:?}");
                    assert_eq!(cell.robot().joint_beyond_limits(&q), None);
                }
            }
        }
        check_sweep(&cell, &sweep, &reached.object_from_sensor);
        let straight =
            cell.planning_space(&all, 0.01).collision_between(&start, &reached.q).is_none();
        bent += usize::from(!straight);
        start = reached.q;
    }
    assert!(bent > 0, "no case needed a detour");
}

fn check_sweep(cell: &Workcell, sweep: &Trajectory, middle: &Pose) {
    let count = sweep.positions.len();
    for (i, q) in sweep.positions.iter().enumerate() {
        let along = 0.24 * (i as f64 / (count - 1) as f64 - 0.5);
        let expected = middle * Pose::translation(0.0, along, 0.0);
        let actual = cell.object_from_sensor(q).unwrap();
        assert!(log(&(expected.inverse() * actual)).norm() < 1e-6);
    }
}

#[test]
fn refusals_say_why() {
    let cell = cell("kr16_laser");
    let (home, obstacle) = (home_configuration("kr16_laser").unwrap(), object());
    let far = request(view(&Vec3::x(), 3.0), &home, &obstacle);
    assert!(refusal(&cell, &far).starts_with("out of reach"), "{}", refusal(&cell, &far));
    // From below: the table is in the way.
    let below = request(view(&Vec3::new(-0.2, 0.0, -1.0), 0.3), &home, &obstacle);
    assert!(refusal(&cell, &below).contains("collide"), "{}", refusal(&cell, &below));
    let huge = Obstacle::from_sphere(&Vec3::zeros(), 0.9);
    let why = refusal(&cell, &request(view(&Vec3::x(), 0.3), &home, &huge));
    assert!(why.contains("stands in a collision"), "{why}");
    assert!(
        cell.check_reachability(&request(view(&Vec3::x(), 0.3), &home[1..], &obstacle)).is_err()
    );
}

fn refusal(cell: &Workcell, request: &ReachabilityRequest) -> String {
    match cell.check_reachability(request).unwrap() {
        Reachability::Unreachable { reason, .. } => reason,
        Reachability::Reachable(motion) => panic!("{:?}", motion.q),
    }
}

fn link(name: &str) -> String {
    format!("<link name='{name}'/>")
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, rest: &str) -> String {
    format!(
        "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>{rest}</joint>"
    )
}

#[test]
fn wrong_descriptions_are_refused_with_the_name_of_what_is_wrong() {
    let limit = "<limit lower='-1' upper='1' effort='1' velocity='1'/>";
    let two = link("a") + &link("b");
    let mesh = "<link name='m'><collision><geometry><mesh filename='x.stl'/></geometry></collision></link>";
    for (body, names) in [
        (two.clone(), vec!["`a`", "`b`", "no parent"]),
        (link("a") + &joint("j", "fixed", "a", "c", ""), vec!["`j`", "`c`"]),
        (two.clone() + &joint("j", "revolute", "a", "b", ""), vec!["`j`", "limits"]),
        (two.clone() + &joint("j", "planar", "a", "b", limit), vec!["`j`", "supported"]),
        (
            two.clone() + &joint("j", "revolute", "a", "b", &format!("<axis xyz='0 0 0'/>{limit}")),
            vec!["`j`", "axis"],
        ),
        (
            two.clone() + &joint("j", "revolute", "a", "b", &format!("<mimic joint='k'/>{limit}")),
            vec!["`j`", "`k`", "not described"],
        ),
        (
            two.clone()
                + &link("c")
                + &joint("i", "fixed", "b", "c", "")
                + &joint("j", "fixed", "c", "b", ""),
            vec!["cycle", "`c`"],
        ),
        (
            two.clone() + &joint("i", "fixed", "a", "b", "") + &joint("j", "fixed", "a", "b", ""),
            vec!["`b`", "more than one joint"],
        ),
        (link("a") + &link("a"), vec!["`a`", "twice"]),
        (mesh.to_owned(), vec!["`m`", "mesh"]),
        (String::new(), vec!["no link"]),
    ] {
        let text = format!("<robot name='r'>{body}</robot>");
        let error = RobotModel::from_urdf(&text).unwrap_err().to_string();
        assert!(names.iter().all(|n| error.contains(n)), "{names:?} not in: {error}");
    }
    let error = RobotModel::from_urdf("<robot").unwrap_err().to_string();
    assert!(error.contains("no valid URDF"), "{error}");
    let good =
        format!("<robot name='r'>{}{}</robot>", two, joint("j", "revolute", "a", "b", limit));
    let robot = RobotModel::from_urdf(&good).unwrap();
    let error = robot.pose(&[0.0], "a", "elsewhere").unwrap_err().to_string();
    assert!(error.contains("`elsewhere`"), "{error}");
    assert!(Workcell::new(robot).unwrap_err().to_string().contains("`object`"));
    assert!(setup_urdf("kr17").unwrap_err().to_string().contains("omnirob_stereo"));
}

#[test]
fn the_bodies_as_meshes_are_closed_and_their_points_are_cut() {
    let robot = robot("omnirob_stereo");
    let q = home_configuration("omnirob_stereo").unwrap();
    let links = ["gripper", "gripper_left", "gripper_right", "lwr_link_6"];
    let mesh = robot.link_shapes_mesh(&links, &q).unwrap();
    assert!(is_closed(&mesh) && is_oriented(&mesh));
    let volume = std::f64::consts::PI * 0.045f64.powi(2) * 0.03
        + 0.08 * 0.14 * 0.08
        + 2.0 * 0.03 * 0.012 * 0.07
        + 4.0 / 3.0 * std::f64::consts::PI * 0.065f64.powi(3);
    assert!((mesh.volume() / volume - 1.0).abs() < 0.01, "{} {volume}", mesh.volume());

    let poses = robot.forward_kinematics(&q);
    let object = poses[robot.link(OBJECT_FRAME).unwrap()].inverse();
    let bodies: Vec<(Shape, Pose)> = robot
        .link_shapes()
        .iter()
        .filter(|s| links.contains(&robot.link_names()[s.link].as_str()))
        .map(|s| (s.shape, object * poses[s.link] * s.link_from_shape))
        .collect();
    let filter = BodyFilter::new(&bodies, 0.005);
    assert!(filter.mask_on_bodies(&mesh.vertices).iter().all(|on| *on));
    // The palm ends 70 mm below the jaws' tips; the space between the open jaws is free.
    let nan = Vec3::repeat(f64::NAN);
    let points = [Vec3::zeros(), Vec3::new(0.0, 0.034, 0.015), Vec3::new(0.0, 0.0, 0.03), nan];
    assert_eq!(filter.mask_on_bodies(&points), [false, true, false, false]);
    assert!(robot.link_shapes_mesh(&["nothing"], &q).is_err());
}

#[test]
fn the_filter_cuts_what_lies_within_its_margin_and_nothing_else() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let pose = exp(&Twist::new(0.1, 0.2, 0.9, 0.4, -0.3, 0.8));
    let bodies = [
        (Shape::Box { half: Vec3::new(0.1, 0.2, 0.05) }, pose),
        (Shape::Cylinder { radius: 0.05, half_length: 0.2 }, Pose::translation(0.3, 0.0, 0.5)),
        (Shape::Sphere { radius: 0.1 }, Pose::translation(-0.3, 0.0, 0.5)),
    ];
    let points: Vec<Vec3> =
        (0..20000).map(|_| Vec3::from_fn(|_, _| rng.random_range(-0.6..1.2))).collect();
    let cut = BodyFilter::new(&bodies, 0.02).mask_on_bodies(&points);
    for (point, cut) in points.iter().zip(&cut) {
        let distance = bodies
            .iter()
            .map(|(shape, pose)| shape.distance(&transform(&pose.inverse(), point)))
            .fold(f64::INFINITY, f64::min);
        assert_eq!(distance <= 0.02, *cut, "{point:?} {distance}");
    }
    assert!(cut.iter().filter(|c| **c).count() > 50);
}
