use super::*;
use crate::Progress;
use crate::geometry::{Pose, Scan, Shape, Twist, Vec3, exp, transform};
use crate::register::{RegisterParams, Status, register};
use crate::robot::RobotModel;
use crate::scan::{PoseSigma, PreparedScan};
use crate::{Error, Result};
use nalgebra::Point3;

fn params() -> IntakeParams {
    IntakeParams {
        cut: CutParams {
            region: Region { radius: 0.2, height: 0.4, depth: 0.05 },
            body_margin: 0.005,
            pose_sigma: PoseSigma { translation: 0.003, rotation: 0.01 },
        },
        register: RegisterParams::default(),
    }
}

fn label(nanoseconds: i64) -> ScanLabel {
    ScanLabel { nanoseconds, frame: "camera".to_owned() }
}

fn observe(scan: &Scan, prior: Pose, bodies: Vec<(Shape, Pose)>) -> Observation {
    Observation::new(label(0), scan, prior, bodies, &params().cut.region)
}

/// Points along the x axis, at 0.5 mm, 1.5 mm and so on to 100.5 mm.
fn line() -> Scan {
    let points = (0..=100_u8).map(|i| [(f32::from(i) + 0.5) * 1e-3, 0.0, 0.0]).collect();
    Scan { points, ..Scan::default() }
}

/// The x coordinates of a scan, millimetres without the fraction.
fn millimetres(scan: &Scan) -> Vec<i32> {
    scan.points.iter().map(|p| (p[0] * 1e3).floor() as i32).collect()
}

/// A lumpy body without symmetry about the origin, as seen from direction `angle` about z.
fn lumpy_scan(angle: f64) -> (Scan, Pose) {
    let eye = Point3::new(0.3 * angle.cos(), 0.3 * angle.sin(), 0.1);
    let pose = Pose::face_towards(&eye, &Point3::origin(), &Vec3::z());
    let mut points = Vec::new();
    for i in 0..80 {
        for j in 0..160 {
            let (theta, phi) = ((f64::from(i) + 0.5) * 0.0393, f64::from(j) * 0.0393);
            let u = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
            let lumps = 0.25 * u.x * u.y + 0.2 * u.z * u.x + 0.15 * (4.0 * u.y).sin();
            if (pose.rotation.inverse() * u).z < -0.2 {
                let seen = transform(&pose.inverse(), &(u * 0.045 * (1.0 + lumps)));
                points.push([seen.x as f32, seen.y as f32, seen.z as f32]);
            }
        }
    }
    (Scan { points, ..Scan::default() }, pose)
}

/// Where the robot believes a sensor at `pose` to be.
fn displaced(pose: Pose, sign: f64) -> Pose {
    pose * exp(&(Twist::new(0.002, -0.001, 0.001, 0.004, 0.003, -0.005) * sign))
}

#[test]
fn the_region_is_a_cylinder_with_its_boundary() {
    let region = Region { radius: 0.2, height: 0.4, depth: 0.05 };
    for inside in [[0.2, 0.0, 0.0], [0.0, 0.0, 0.4], [0.0, 0.0, -0.05], [0.14, -0.14, 0.1]] {
        assert!(region.contains(&inside.into()), "{inside:?}");
    }
    for outside in [[0.15, 0.15, 0.0], [0.0, 0.0, 0.401], [0.0, 0.0, -0.051], [f64::NAN; 3]] {
        assert!(!region.contains(&outside.into()), "{outside:?}");
    }
}

#[test]
fn points_beyond_the_region_are_thinned_and_show_free_space_only() {
    let mut scan = line();
    scan.points.push([f32::NAN; 3]);
    // The sensor is 150 mm along x, so that points from 50 mm on lie beyond 200 mm.
    let observation = observe(&scan, Pose::translation(0.15, 0.0, 0.0), Vec::new());
    let split = observation.split_at_prior(&params().cut);
    assert_eq!(millimetres(&split.object), (0..50).collect::<Vec<_>>());
    let beyond = millimetres(&split.beyond);
    assert!(beyond.len() <= 12 && beyond.len() >= 10, "{beyond:?}");
    assert!(beyond.iter().all(|x| *x >= 50));
    assert!(beyond.windows(2).all(|pair| pair[1] - pair[0] <= 6), "{beyond:?}");
}

#[test]
fn bodies_are_cut_with_a_margin_that_shrinks_once_the_pose_is_known() {
    let sphere = (Shape::Sphere { radius: 0.03 }, Pose::identity());
    let observation = observe(&line(), Pose::identity(), vec![sphere]);
    // At the origin the pose error is 3 mm: 30 + 5 + 2 x 3 mm are cut.
    let split = observation.split_at_prior(&params().cut);
    assert_eq!(millimetres(&split.object), (41..=100).collect::<Vec<_>>());
    let split = observation.split_at(&Pose::identity(), &params().cut);
    assert_eq!(millimetres(&split.object), (35..=100).collect::<Vec<_>>());
    // What is cut still shows that the space before it is free.
    assert!(millimetres(&split.beyond).iter().all(|x| *x < 35) && !split.beyond.points.is_empty());
}

#[test]
fn bodies_are_where_the_estimated_pose_sees_them() {
    let sphere = (Shape::Sphere { radius: 0.03 }, Pose::identity());
    let observation = observe(&line(), Pose::identity(), vec![sphere]);
    let split = observation.split_at(&Pose::translation(0.02, 0.0, 0.0), &params().cut);
    assert_eq!(millimetres(&split.object), (15..=100).collect::<Vec<_>>());
}

#[test]
fn the_margin_grows_with_the_distance_of_the_sensor() {
    let sphere = (Shape::Sphere { radius: 0.03 }, Pose::identity());
    let away = Pose::translation(0.0, 0.0, 0.4);
    let mut scan = line();
    scan.points.iter_mut().for_each(|point| point[2] = -0.4);
    let split = observe(&scan, away, vec![sphere]).split_at_prior(&params().cut);
    // 10 mrad over 400 mm and 3 mm are 5 mm: 30 + 5 + 2 x 5 mm are cut.
    assert_eq!(millimetres(&split.object).first(), Some(&45));
}

const ROBOT: &str = r#"<robot name="arm">
    <link name="base"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
    <link name="tool">
        <collision><origin xyz="0 0 0.2"/><geometry><sphere radius="0.02"/></geometry></collision>
    </link>
    <link name="camera"><collision><geometry><sphere radius="0.03"/></geometry></collision></link>
    <joint name="a1" type="revolute">
        <parent link="base"/><child link="tool"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/>
    </joint>
    <joint name="mount" type="fixed"><parent link="tool"/><child link="camera"/></joint>
</robot>"#;

#[test]
fn only_bodies_that_do_not_move_with_the_sensor_are_looked_up_and_posed() {
    let robot = RobotModel::from_urdf(ROBOT).unwrap();
    let mut asked = Vec::new();
    let from_camera = posed_bodies(&robot, "camera", |link| {
        asked.push(link.to_owned());
        Ok(Pose::translation(0.0, 1.0, 0.0))
    });
    assert_eq!(asked, ["base"]);
    assert_eq!(from_camera.unwrap().len(), 1);
    let from_base = posed_bodies(&robot, "base", |_| Ok(Pose::translation(0.0, 1.0, 0.0))).unwrap();
    assert_eq!(from_base[0].1.translation.vector, Vec3::new(0.0, 1.0, 0.2));
}

#[test]
fn a_missing_frame_or_transform_is_an_error_in_words() {
    fn fail(link: &str) -> Result<Pose> {
        Err(Error::input(format!("no transform of {link}")))
    }
    let robot = RobotModel::from_urdf(ROBOT).unwrap();
    let error = posed_bodies(&robot, "zivid", fail).unwrap_err().to_string();
    assert!(error.contains("no frame (link) `zivid`"), "{error}");
    let error = posed_bodies(&robot, "camera", fail).unwrap_err().to_string();
    assert_eq!(error, "no transform of base");
}

/// A square plate of `side` x `side` points, 1 mm apart.
fn plate(side: u8) -> Scan {
    let points = (0..side * side)
        .map(|i| [f32::from(i % side) * 1e-3, f32::from(i / side) * 1e-3, 0.1])
        .collect();
    Scan { points, ..Scan::default() }
}

#[test]
fn a_scan_of_too_few_points_is_refused_with_the_reason() {
    let mut intake = Intake::new(params());
    assert_eq!(intake.add(observe(&line(), Pose::identity(), Vec::new())), [0]);
    assert_eq!(intake.add(observe(&plate(3), Pose::identity(), Vec::new())), [1]);
    assert_eq!(intake.add(observe(&plate(9), Pose::identity(), Vec::new())), [2]);
    assert_eq!(intake.add(observe(&plate(15), Pose::identity(), Vec::new())), [3]);
    assert!(
        intake.state(1).reason.contains("at least 10 are needed"),
        "{}",
        intake.state(1).reason
    );
    assert!(intake.state(2).reason.contains("100 are needed"), "{}", intake.state(2).reason);
    for id in 0..3 {
        assert_eq!(intake.state(id).status(), Status::Refused);
        assert!(intake.state(id).verdict.is_none());
    }
    assert_eq!(intake.state(3).status(), Status::Accepted);
    assert_eq!(intake.usable_ids(), [3]);
    assert_eq!(intake.accepted(), (vec![3], vec![1]));
}

fn first_from_last(poses: &[Pose]) -> Pose {
    poses[0].inverse() * poses[poses.len() - 1]
}

#[test]
fn settling_and_refining_keep_the_order_of_the_usable_scans_and_raise_their_versions() {
    let mut intake = Intake::new(params());
    let mut truth = Vec::new();
    for (i, angle) in [0.0, 0.5, 1.0].into_iter().enumerate() {
        let (scan, pose) = lumpy_scan(angle);
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        let changed = intake.add(observe(&scan, displaced(pose, sign), Vec::new()));
        assert_eq!(changed[0], intake.len() - 1);
        truth.push(pose);
        if i == 0 {
            assert_eq!(intake.add_unusable(label(5), "no transform".to_owned()), 1);
        }
    }
    assert_eq!(intake.usable_ids(), [0, 2, 3]);
    assert_eq!(intake.accepted(), (vec![0, 2, 3], vec![1, 1, 1]));
    assert_eq!(intake.state(1).reason, "no transform");
    assert_eq!(intake.state(1).label, &label(5));

    let registration = intake.refine(&Progress::silent()).unwrap();
    assert_eq!(intake.accepted(), (vec![0, 2, 3], vec![2, 2, 2]));
    assert_eq!(intake.state(1).version, 1);
    let views = intake.views();
    let names: Vec<&str> = views.iter().map(|view| view.name.as_str()).collect();
    assert_eq!(names, ["view_000", "view_002", "view_003"]);
    for (place, id) in [0, 2, 3].into_iter().enumerate() {
        assert_eq!(intake.state(id).pose, registration.poses[place]);
        assert_eq!(intake.state(id).prior, views[place].object_from_sensor);
    }
    // The scans fit each other better than the robot's poses put them.
    let error = first_from_last(&registration.poses).inverse() * first_from_last(&truth);
    let error = error.translation.vector.norm();
    assert!(error < 5e-4, "{error}");

    // Refining is what is made of a scan folder with the views, bit for bit.
    let prepared: Vec<PreparedScan> =
        views.iter().map(|view| PreparedScan::new(&view.scan).unwrap()).collect();
    let robot: Vec<Pose> = views.iter().map(|view| view.object_from_sensor).collect();
    let sigma = Some(params().cut.pose_sigma);
    let again = register(&prepared, &robot, sigma, &RegisterParams::default(), &Progress::silent())
        .unwrap();
    assert_eq!(again.poses, registration.poses);
}

#[test]
fn a_restart_forgets_the_scans_but_not_the_versions() {
    fn add(intake: &mut Intake) -> (usize, u32) {
        let id = intake.add_unusable(label(0), "no transform".to_owned());
        (id, intake.state(id).version)
    }
    let mut intake = Intake::new(params());
    assert_eq!([add(&mut intake), add(&mut intake)], [(0, 1), (1, 1)]);
    intake.restart(params());
    assert!(intake.is_empty());
    assert_eq!(add(&mut intake), (0, 2));
    intake.restart(params());
    intake.restart(params());
    assert_eq!(add(&mut intake), (0, 3));
    assert_eq!(intake.accepted(), (vec![], vec![]));
}
