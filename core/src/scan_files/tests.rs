use super::*;
use crate::geometry::{KdTree, Pose, Scan, Twist, Vec3, exp, log, transform};
use crate::mesh::io::read_mesh;
use crate::scan::{PoseSigma, SensorKind, Support};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

fn pose(seed: f64) -> Pose {
    exp(&Twist::new(0.3 * seed, -0.2, 0.5, 0.4, -0.9 * seed, 0.2))
}

fn view(name: &str, scan: Scan, seed: f64) -> View {
    View { name: name.into(), scan, object_from_sensor: pose(seed) }
}

/// An organised laser scan with origins, and a stereo scan without rows.
fn set() -> ScanSet {
    let organised = Scan {
        points: vec![[0.0, 0.1, 0.5], [f32::NAN; 3], [0.1, 0.1, 0.5], [0.0, 0.2, 0.6]],
        width: 2,
        origins: vec![[0.0; 3], [0.0; 3], [0.0, 0.01, 0.0], [0.0, 0.01, 0.0]],
    };
    let plain = Scan { points: vec![[0.0, 0.1, 0.5]; 3], ..Scan::default() };
    ScanSet {
        views: vec![view("view_000", organised, 1.0), view("view_001", plain, 0.5)],
        sensor: Some(SensorKind::Laser),
        support: Support::Table,
        pose_sigma: Some(PoseSigma { translation: 0.003, rotation: 0.01 }),
        nominal: json!({"distance": 0.65}),
    }
}

/// As debug text, in which NaN equals NaN.
fn text(scan: &Scan) -> String {
    format!("{scan:?}")
}

fn written() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_scans(folder.path(), &set(), &[]).unwrap();
    folder
}

fn document(folder: &Path) -> Value {
    serde_json::from_slice(&fs::read(folder.join("poses.json")).unwrap()).unwrap()
}

fn change(folder: &Path, change: impl FnOnce(&mut Value)) {
    let mut json = document(folder);
    change(&mut json);
    fs::write(folder.join("poses.json"), json.to_string()).unwrap();
}

#[test]
fn a_scan_folder_keeps_everything() {
    let folder = written();
    for path in [folder.path().to_path_buf(), folder.path().join("poses.json")] {
        let read = read_scans(&path, Unit::Metre).unwrap();
        assert_eq!((read.sensor, read.pose_sigma), (set().sensor, set().pose_sigma));
        assert_eq!(read.nominal, set().nominal);
        assert_eq!(read.views.len(), 2);
        for (read, view) in read.views.iter().zip(&set().views) {
            assert_eq!(read.name, view.name);
            assert_eq!(text(&read.scan), text(&view.scan));
            let moved = log(&(read.object_from_sensor.inverse() * view.object_from_sensor));
            assert!(moved.norm() < 1e-9);
        }
    }
}

#[test]
fn millimetres_scale_points_origins_poses_and_their_sigma() {
    let folder = written();
    let mut large = set();
    for view in &mut large.views {
        view.object_from_sensor.translation.vector *= 1000.0;
        for p in view.scan.points.iter_mut().chain(&mut view.scan.origins).flatten() {
            *p *= 1000.0;
        }
    }
    large.pose_sigma = Some(PoseSigma { translation: 3.0, rotation: 0.01 });
    // The first scan must say so, the second is a single point many times over.
    write_scans(folder.path(), &large, &[]).unwrap();
    let error = read_scans(folder.path(), Unit::Metre).unwrap_err().to_string();
    assert!(error.contains("millimetres? use --unit mm"), "{error}");
    change(folder.path(), |json| json["views"].as_array_mut().unwrap().truncate(1));
    let read = read_scans(folder.path(), Unit::Millimetre).unwrap();
    let view = &set().views[0];
    assert!((read.views[0].scan.origin(2) - view.scan.origin(2)).norm() < 1e-8);
    assert!((read.views[0].scan.point(3).unwrap() - view.scan.point(3).unwrap()).norm() < 1e-7);
    assert!(
        log(&(read.views[0].object_from_sensor.inverse() * view.object_from_sensor)).norm() < 1e-9
    );
    assert_eq!(read.pose_sigma, set().pose_sigma);
    // Clouds in metres with poses in millimetres.
    write_scans(folder.path(), &set(), &[]).unwrap();
    change(folder.path(), |json| json["views"][0]["object_from_sensor"][0][3] = 650.0.into());
    let error = read_scans(folder.path(), Unit::Metre).unwrap_err().to_string();
    assert!(error.contains("view_000.ply") && error.contains("millimetres?"), "{error}");
}

#[test]
fn broken_folders_say_what_and_where() {
    type Break = fn(&Path);
    let cases: [(Break, &str); 15] = [
        (|f| fs::remove_file(f.join("poses.json")).unwrap(), "has no poses.json"),
        (|f| fs::write(f.join("poses.json"), "{\"format\":").unwrap(), "is not JSON"),
        (|f| fs::write(f.join("poses.json"), "[]").unwrap(), "lacks the key \"format\""),
        (|f| change(f, |j| j["format"] = "puffer-scans-2".into()), "the format \"puffer-scans-2\""),
        (|f| change(f, |j| j["views"] = json!([])), "has no views"),
        (|f| change(f, |j| j["sensor"] = "radar".into()), "known are \"laser\" and \"stereo\""),
        (|f| change(f, |j| j["pose_sigma"] = json!({"translation": -1.0})), "not below 0"),
        (|f| change(f, |j| j["views"][1]["cloud"] = Value::Null), "view 1: lacks \"cloud\""),
        (
            |f| change(f, |j| j["views"][1]["cloud"] = "view_000.ply".into()),
            "view 1 (view_000.ply): an earlier view has this name",
        ),
        (
            |f| change(f, |j| j["views"][1]["object_from_sensor"] = Value::Null),
            "view 1 (view_001.ply): lacks \"object_from_sensor\"",
        ),
        (
            |f| change(f, |j| j["views"][1]["object_from_sensor"] = json!([1, 2, 3])),
            "view 1 (view_001.ply): \"object_from_sensor\" must be four rows",
        ),
        (
            |f| change(f, |j| j["views"][1]["object_from_sensor"][0][0] = 9.0.into()),
            "view 1 (view_001.ply): \"object_from_sensor\": the matrix is not a rigid transform",
        ),
        (|f| fs::remove_file(f.join("view_001.ply")).unwrap(), "view 1 (view_001): its cloud"),
        (|f| replace_cloud(f, 0, ""), "view view_001: the cloud is empty"),
        (|f| replace_cloud(f, 2, "nan 0 0\n0 inf 0\n"), "none of its 2 points has finite"),
    ];
    for (spoil, says) in cases {
        let folder = written();
        spoil(folder.path());
        let error = read_scans(folder.path(), Unit::Metre).unwrap_err().to_string();
        assert!(error.contains(says), "{error}\nnot: {says}");
    }
    let error =
        read_scans(&written().path().join("view_000.ply"), Unit::Metre).unwrap_err().to_string();
    assert!(error.contains("single PLY"), "{error}");
}

fn replace_cloud(folder: &Path, count: usize, rows: &str) {
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty double x\nproperty double y\n\
         property double z\nend_header\n{rows}"
    );
    fs::write(folder.join("view_001.ply"), text).unwrap();
}

fn width_of_second(folder: &Path) -> usize {
    read_scans(folder, Unit::Metre).unwrap().views[1].scan.width
}

#[test]
fn foreign_clouds_are_read_with_what_is_known_of_their_rows() {
    let folder = written();
    replace_cloud(folder.path(), 4, "0 0 1\n1 0 1\nnan nan nan\n1 1 1\n");
    assert_eq!(width_of_second(folder.path()), 0);
    change(folder.path(), |json| json["views"][1]["width"] = 2.into());
    assert_eq!(width_of_second(folder.path()), 2);
    change(folder.path(), |json| json["views"][1]["width"] = 3.into());
    let error = read_scans(folder.path(), Unit::Metre).unwrap_err().to_string();
    assert!(error.contains("do not fill rows of 3"), "{error}");
}

#[test]
fn corrected_poses_keep_every_other_key() {
    let folder = written();
    change(folder.path(), |json| {
        json["operator"] = "me".into();
        json["views"][1]["time"] = 12.5.into();
    });
    let elsewhere = tempfile::tempdir().unwrap();
    let poses = [pose(0.1), pose(0.2)];
    let verdicts =
        [json!({"verdict": {"status": "accepted"}}), json!({"verdict": {"status": "refused"}})];
    let source = ScanSource::open(folder.path(), Unit::Metre).unwrap();
    for target in [elsewhere.path().join("out.json"), folder.path().join("poses.json")] {
        write_poses(&target, &source, &poses, &verdicts).unwrap();
        let json: Value = serde_json::from_slice(&fs::read(&target).unwrap()).unwrap();
        assert_eq!((&json["operator"], &json["views"][1]["time"]), (&json!("me"), &json!(12.5)));
        assert_eq!(json["views"][1]["verdict"]["status"], "refused");
        assert_eq!(json["views"][1]["cloud"], "view_001.ply");
        // Readable where it is, with the clouds where they were.
        let read = read_scans(&target, Unit::Metre).unwrap();
        for (view, pose) in read.views.iter().zip(&poses) {
            assert!(log(&(view.object_from_sensor.inverse() * pose)).norm() < 1e-9);
        }
    }
    assert!(document(folder.path())["clouds_in"].is_null());
    let error = write_poses(&elsewhere.path().join("x"), &source, &poses[..1], &[]);
    assert!(error.unwrap_err().to_string().contains("2 views, but 1 poses"));
}

#[test]
fn view_extras_are_written_and_clashing_names_refused() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("new/scans");
    let extras = [json!({"verdict": 1}), json!({})];
    write_scans(&dir, &set(), &extras).unwrap();
    assert_eq!(document(&dir)["views"][0]["verdict"], 1);
    let mut clash = set();
    clash.views[0].name = "a/b".into();
    clash.views[1].name = "a_b".into();
    let error = write_scans(&dir, &clash, &[]).unwrap_err().to_string();
    assert!(error.contains("a_b.ply"), "{error}");
    assert!(write_scans(&dir, &set(), &extras[..1]).is_err());
}

/// A grid of 2 x 2 cells with three points, and its conf.
fn stanford(folder: &Path) {
    let grid = "ply\nformat ascii 1.0\nobj_info num_cols 2\nobj_info num_rows 2\nelement vertex 3\n\
        property float x\nproperty float y\nproperty float z\nelement range_grid 4\n\
        property list uchar int vertex_indices\nend_header\n0.1 0.2 0.3\n0.1 0.2 0.4\n0 0 0.5\n\
        1 2\n0\n1 0\n1 1\n";
    fs::write(folder.join("a.ply"), grid).unwrap();
    let conf = "camera 0 0 0 0 0 0 1\nbmesh a.ply 0.5 0 0 0 0 0.70710678 0.70710678\n";
    fs::write(folder.join("a.conf"), conf).unwrap();
}

#[test]
fn a_range_grid_becomes_an_organised_scan_in_our_sensor_frame() {
    let folder = tempfile::tempdir().unwrap();
    stanford(folder.path());
    let set = read_scans(&folder.path().join("a.conf"), Unit::Metre).unwrap();
    let View { name, scan, object_from_sensor } = &set.views[0];
    assert_eq!((name.as_str(), set.sensor), ("a", Some(SensorKind::Laser)));
    assert_eq!((scan.width, scan.height()), (2, 2));
    assert_eq!(scan.returns().collect::<Vec<_>>(), [0, 2, 3]);
    assert_eq!(scan.points[2], [0.1, -0.2, -0.3]);
    assert!((scan.point(2).unwrap() - scan.origin(2) - Vec3::z()).norm() < 1e-6);
    // R(q)^T turns by -90 degrees about z: (0.1, 0.2, 0.3) goes to (0.2, -0.1, 0.3), then moves by
    // t.
    let p = object_from_sensor * nalgebra::Point3::from(scan.point(2).unwrap());
    assert!((p.coords - Vec3::new(0.7, -0.1, 0.3)).norm() < 1e-7, "{p}");
}

#[test]
fn poses_corrected_for_a_conf_are_read_with_its_range_grids() {
    let folder = tempfile::tempdir().unwrap();
    stanford(folder.path());
    let conf = folder.path().join("a.conf");
    let out = folder.path().join("poses.json");
    let corrected = pose(0.3);
    let source = ScanSource::open(&conf, Unit::Metre).unwrap();
    write_poses(&out, &source, &[corrected], &[]).unwrap();
    let (before, after) =
        (read_scans(&conf, Unit::Metre).unwrap(), read_scans(&out, Unit::Metre).unwrap());
    assert_eq!(text(&before.views[0].scan), text(&after.views[0].scan));
    assert!(log(&(after.views[0].object_from_sensor.inverse() * corrected)).norm() < 1e-9);
}

#[test]
fn broken_confs_say_what_and_where() {
    let folder = tempfile::tempdir().unwrap();
    stanford(folder.path());
    let conf = folder.path().join("a.conf");
    for (text, says) in [
        ("camera 0\n", "no views"),
        ("bmesh a.ply 0 0 0 0 0 0\n", "line 1: must be 'bmesh"),
        ("\nbmesh a.ply 0 0 0 0 0 0 2\n", "line 2: must be 'bmesh"),
        ("bmesh b.ply 0 0 0 0 0 0 1\n", "view 0 (b): its cloud"),
    ] {
        fs::write(&conf, text).unwrap();
        let error = read_scans(&conf, Unit::Metre).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}

/// Whether the scans can be read after `file` was given other bytes.
fn is_readable(folder: &Path, file: &str, bytes: &[u8]) -> bool {
    fs::write(folder.join(file), bytes).unwrap();
    let source = match file {
        "view_000.ply" => "poses.json",
        "a.ply" => "a.conf",
        other => other,
    };
    read_scans(&folder.join(source), Unit::Metre).is_ok()
}

#[test]
fn no_damaged_poses_or_conf_makes_the_reader_panic() {
    let folder = written();
    stanford(folder.path());
    for file in ["poses.json", "a.conf", "view_000.ply", "a.ply"] {
        let whole = fs::read(folder.path().join(file)).unwrap();
        for at in 0..whole.len() {
            let cut = is_readable(folder.path(), file, &whole[..at]);
            assert!(!(cut && file == "view_000.ply"), "cut at {at} passes as whole");
            for byte in [b'9', 255] {
                let mut damaged = whole.clone();
                damaged[at] = byte;
                is_readable(folder.path(), file, &damaged);
            }
        }
        fs::write(folder.path().join(file), &whole).unwrap();
        assert!(read_scans(folder.path(), Unit::Metre).is_ok());
    }
}

/// Point `i` of a view in the object frame.
fn object_point(view: &View, i: usize) -> Vec3 {
    transform(&view.object_from_sensor, &view.scan.point(i).unwrap())
}

/// The direction of the ray to point `i` in the object frame.
fn object_ray(view: &View, i: usize) -> Vec3 {
    view.object_from_sensor.rotation * (view.scan.point(i).unwrap() - view.scan.origin(i))
}

#[test]
fn the_bunnys_scans_lie_on_the_mesh_that_was_made_of_them() {
    let Some(data) = std::env::var_os("PUFFER_DATA") else {
        eprintln!("SKIPPED: PUFFER_DATA is not set");
        return;
    };
    let bunny = Path::new(&data).join("bunny");
    let set = read_scans(&bunny.join("bun.conf"), Unit::Metre).unwrap();
    let mut mesh = read_mesh(&bunny.join("bun_zipper.ply")).unwrap();
    mesh.compute_normals();
    assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (35947, 69451));
    assert_eq!(set.views.len(), 10);
    let tree = KdTree::new(&mesh.vertices);
    for view in &set.views {
        assert_eq!((view.scan.width, view.scan.height()), (512, 400), "{}", view.name);
        let returns: Vec<usize> = view.scan.returns().step_by(7).collect();
        let nearest: Vec<(usize, f64)> =
            returns.iter().map(|&i| tree.nearest(&object_point(view, i)).unwrap()).collect();
        let mut squares: Vec<f64> = nearest.iter().map(|(_, square)| *square).collect();
        squares.sort_by(f64::total_cmp);
        let median = squares[squares.len() / 2].sqrt();
        assert!(median < 1e-3, "{}: median {median}", view.name);
        // The rays come from outside.
        let pairs = returns.iter().zip(&nearest);
        let facing =
            pairs.filter(|(i, (v, _))| object_ray(view, **i).dot(&mesh.normals[*v]) < 0.0).count();
        assert!(facing > returns.len() * 9 / 10, "{}: {facing} of {}", view.name, returns.len());
    }
}

#[test]
fn a_folder_grows_view_by_view_and_a_view_may_come_again() {
    let folder = tempfile::tempdir().unwrap();
    let ScanSet { mut views, .. } = set();
    let head = ScanSet { views: Vec::new(), ..set() };
    let mut growing = ScanFolder::create(&folder.path().join("scans"), head).unwrap();
    for (count, view) in views.iter().enumerate() {
        growing.write_view(view, json!({ "verdict": "first" })).unwrap();
        growing.save().unwrap();
        let read = read_scans(&folder.path().join("scans"), Unit::Metre).unwrap();
        assert_eq!(read.views.len(), count + 1);
    }
    views[0].object_from_sensor = pose(0.9);
    growing.write_view(&views[0], Value::Null).unwrap();
    growing.save().unwrap();
    let read = read_scans(&folder.path().join("scans"), Unit::Metre).unwrap();
    assert_eq!(read.views.len(), views.len());
    assert!(log(&(read.views[0].object_from_sensor.inverse() * pose(0.9))).norm() < 1e-9);
    assert_eq!((read.support, read.pose_sigma), (set().support, set().pose_sigma));
    assert!(document(&folder.path().join("scans"))["views"][0]["verdict"].is_null());
}

#[test]
fn a_pose_comes_back_bit_by_bit_unless_somebody_changed_its_matrix() {
    let set = ScanSet {
        views: (0..50)
            .map(|i| View {
                name: format!("v{i}"),
                scan: Scan { points: vec![[0.1, 0.0, 0.5]], ..Scan::default() },
                object_from_sensor: pose(f64::from(i) * 0.37 + 0.01),
            })
            .collect(),
        ..ScanSet::default()
    };
    let folder = tempfile::tempdir().unwrap();
    write_scans(folder.path(), &set, &[]).unwrap();
    let read = read_scans(folder.path(), Unit::Metre).unwrap();
    assert!(read.views == set.views, "a pose has changed");
    let other = pose(3.0);
    change(folder.path(), |json| {
        json["views"][0]["object_from_sensor"] =
            poses_document::pose_to_matrix(&other, Unit::Metre);
        json["views"][1]["quaternion"] = json!("none");
    });
    let read = read_scans(folder.path(), Unit::Metre).unwrap();
    for (i, expected) in [(0, other), (1, set.views[1].object_from_sensor)] {
        let difference = log(&(expected.inverse() * read.views[i].object_from_sensor)).norm();
        assert!(difference < 1e-12, "view {i}: {difference}");
    }
}
