//! One target for each decoder: whatever comes in, it answers with a value that keeps its promises
//! or with an error, and does neither panic nor take memory that the input does not pay for.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use puffer_core::geometry::{Cloud, Vec3};
use puffer_core::mesh::Mesh;
use puffer_core::mesh::io::{Unit, read_cloud, read_mesh, write_cloud, write_mesh};
use puffer_core::robot::RobotModel;
use puffer_core::scan_files::read_scans;
use puffer_fuzz::{Edit, damaged, numbered_edits};
use puffer_msgs::msg::Tile;
use puffer_msgs::sensor_msgs::msg::{PointCloud2, PointField};
use puffer_msgs::std_msgs::msg::String as Text;
use puffer_msgs::{Interface, cdr};
use puffer_ros::bag::{BagReader, BagWriter};
use puffer_ros::conversions::scan_from_message;
use puffer_ros::{QosProfile, Stamp};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Number of lists of edits that a target runs on in `cargo test`.
const NUMBERED_LISTS: u64 = 1000;

/// Runs the closure on lists of edits: on the numbered ones, then on those that bolero is asked
/// for. (Its `BOLERO_RANDOM_SEED` pins one list only; all others would differ from run to run.) A
/// macro, because each target's name is that of the function it stands in.
macro_rules! fuzz {
    ($check:expr) => {{
        let check = $check;
        (0..NUMBERED_LISTS).for_each(|number| check(numbered_edits(number).as_slice()));
        bolero::check!()
            .with_type::<Vec<Edit>>()
            .with_iterations(0)
            .for_each(|edits: &Vec<Edit>| check(edits.as_slice()))
    }};
}

/// A closed tetrahedron of 10 cm.
fn tetrahedron() -> Mesh {
    let corner = |x, y, z| Vec3::new(x, y, z) * 0.1;
    Mesh {
        vertices: vec![
            corner(0.0, 0.0, 0.0),
            corner(1.0, 0.0, 0.0),
            corner(0.0, 1.0, 0.0),
            corner(0.0, 0.0, 1.0),
        ],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        ..Mesh::default()
    }
}

/// A file that can be damaged, in a folder of its own.
struct Victim {
    folder: TempDir,
    path: PathBuf,
    valid: Vec<u8>,
}

impl Victim {
    /// `write` makes the valid file.
    fn new(name: &str, write: impl FnOnce(&Path)) -> Victim {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        write(&path);
        let valid = fs::read(&path).unwrap();
        Victim { folder, path, valid }
    }

    /// The path of the file, damaged.
    fn damage(&self, edits: &[Edit]) -> &Path {
        fs::write(&self.path, damaged(&self.valid, edits)).unwrap();
        &self.path
    }
}

/// A mesh that was read has finite vertices and only triangles between them.
fn check_mesh(path: &Path) {
    let Ok(mesh) = read_mesh(path) else { return };
    assert!(mesh.vertices.iter().all(|v| v.iter().all(|x| x.is_finite())));
    assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.vertices.len()));
}

fn mesh_victim(name: &str) -> Victim {
    Victim::new(name, |path| write_mesh(path, &tetrahedron(), &["a comment".to_owned()]).unwrap())
}

#[test]
fn ply_meshes() {
    let victim = mesh_victim("mesh.ply");
    fuzz!(|edits: &[Edit]| check_mesh(victim.damage(edits)));
}

#[test]
fn ascii_ply_meshes() {
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                element face 4\nproperty list uchar int vertex_indices\nend_header\n\
                0 0 0\n0.1 0 0\n0 0.1 0\n0 0 0.1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";
    let victim = Victim::new("mesh.ply", |path| fs::write(path, text).unwrap());
    assert_eq!(read_mesh(&victim.path).unwrap().triangles.len(), 4);
    fuzz!(|edits: &[Edit]| check_mesh(victim.damage(edits)));
}

#[test]
fn ply_clouds() {
    let cloud = Cloud {
        points: tetrahedron().vertices,
        normals: vec![Vec3::z(); 4],
        sigma: vec![1e-4; 4],
        support: vec![7; 4],
    };
    let victim = Victim::new("cloud.ply", |path| write_cloud(path, &cloud, &[]).unwrap());
    fuzz!(|edits: &[Edit]| {
        let Ok(cloud) = read_cloud(victim.damage(edits)) else { return };
        assert_eq!(cloud.points.len(), cloud.normals.len());
        assert!(cloud.points.iter().all(|p| p.iter().all(|x| x.is_finite())));
    });
}

#[test]
fn stl_meshes() {
    let victim = mesh_victim("mesh.stl");
    fuzz!(|edits: &[Edit]| check_mesh(victim.damage(edits)));
}

#[test]
fn obj_meshes() {
    let victim = mesh_victim("mesh.obj");
    fuzz!(|edits: &[Edit]| check_mesh(victim.damage(edits)));
}

#[test]
fn glb_meshes() {
    let victim = mesh_victim("mesh.glb");
    fuzz!(|edits: &[Edit]| check_mesh(victim.damage(edits)));
}

/// Two views of three points each, beside a list of them called `name`.
fn scan_victim(name: &str, list: &str) -> Victim {
    let victim = Victim::new(name, |path| fs::write(path, list).unwrap());
    let cloud = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                 end_header\n0 0 0.5\n0.01 0 0.5\nnan nan nan\n";
    for name in ["a.ply", "b.ply"] {
        fs::write(victim.folder.path().join(name), cloud).unwrap();
    }
    assert_eq!(read_scans(&victim.path, Unit::Metre).unwrap().views.len(), 2);
    victim
}

/// Scans that were read have rigid finite poses.
fn check_scans(path: &Path) {
    let Ok(set) = read_scans(path, Unit::Metre) else { return };
    for view in &set.views {
        let matrix = view.object_from_sensor.to_homogeneous();
        assert!(matrix.iter().all(|x| x.is_finite()), "{}: {matrix}", view.name);
    }
}

#[test]
fn poses_json() {
    let list = r#"{"format": "puffer-scans-1", "sensor": "laser", "support": "table",
        "pose_sigma": {"translation": 0.003, "rotation": 0.01}, "views": [
        {"cloud": "a.ply", "object_from_sensor": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]},
        {"cloud": "b.ply", "object_from_sensor": [[0,-1,0,0.1],[1,0,0,0],[0,0,1,0],[0,0,0,1]]}]}"#;
    let victim = scan_victim("poses.json", list);
    fuzz!(|edits: &[Edit]| check_scans(victim.damage(edits)));
}

#[test]
fn stanford_conf() {
    let list = "camera -0.0172 -0.0936 -0.734 -0.0461723 0.970603 -0.235889 0.0124573\n\
                bmesh a.ply 0 0 0 0 0 0 1\nbmesh b.ply -0.05 0.001 -0.01 0 0.6 0 0.8\n";
    let victim = scan_victim("scans.conf", list);
    fuzz!(|edits: &[Edit]| check_scans(victim.damage(edits)));
}

#[test]
fn bags() {
    let victim = Victim::new("bag.mcap", |path| {
        let mut bag = BagWriter::create(path).unwrap();
        for tick in 0..5 {
            let text = cdr::to_bytes(&Text { data: format!("message {tick}") }).unwrap();
            let at = Stamp::from_nanos(tick * 1_000_000);
            bag.add_topic("/text", Text::TYPE_NAME, QosProfile::Standard).unwrap();
            bag.write("/text", Text::TYPE_NAME, &text, at, at).unwrap();
        }
        bag.finish().unwrap();
    });
    fuzz!(|edits: &[Edit]| {
        let Ok(bag) = BagReader::open(victim.damage(edits)) else { return };
        let info = bag.info();
        let topics: Vec<&str> = info.topics.iter().map(|topic| &*topic.name).collect();
        let Ok(messages) = bag.messages(&topics) else { return };
        for message in messages {
            let Ok(message) = message else { return };
            let _: Result<Text, _> = message.decode();
        }
    });
}

#[test]
fn urdf() {
    let text = r#"<robot name="r"><link name="world"/><link name="arm"><collision><geometry><box size="1 1 1"/></geometry>
        </collision></link><link name="object"/><link name="sensor_optical"/>
        <joint name="j" type="revolute"><parent link="world"/><child link="arm"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
        <joint name="f" type="fixed"><parent link="arm"/><child link="object"/><origin xyz="0 0 1" rpy="0 0 1"/></joint>
        <joint name="g" type="fixed"><parent link="world"/><child link="sensor_optical"/></joint></robot>"#;
    assert_eq!(RobotModel::from_urdf(text).unwrap().joints().len(), 1);
    fuzz!(|edits: &[Edit]| {
        let bytes = damaged(text.as_bytes(), edits);
        let Ok(robot) = RobotModel::from_urdf(&String::from_utf8_lossy(&bytes)) else { return };
        let home = vec![0.0; robot.joints().len()];
        assert_eq!(robot.forward_kinematics(&home).len(), robot.link_names().len());
    });
}

#[test]
fn point_clouds() {
    let field = |name: &str, offset: u32| PointField {
        name: name.to_owned(),
        offset,
        datatype: PointField::FLOAT32,
        count: 1,
    };
    let cloud = PointCloud2 {
        height: 1,
        width: 3,
        fields: vec![field("x", 0), field("y", 4), field("z", 8)],
        point_step: 12,
        row_step: 36,
        data: vec![0x3f; 36],
        ..PointCloud2::default()
    };
    let valid = cdr::to_bytes(&cloud).unwrap();
    assert_eq!(scan_from_message(&cloud).unwrap().points.len(), 3);
    fuzz!(|edits: &[Edit]| {
        let Ok(cloud) = cdr::from_bytes::<PointCloud2>(&damaged(&valid, edits)) else { return };
        if let Ok(scan) = scan_from_message(&cloud) {
            assert_eq!(scan.points.len() as u64, u64::from(cloud.width) * u64::from(cloud.height));
        }
    });
}

#[test]
fn tiles() {
    let tile =
        Tile { sequence: 1, total: 5, tile_size: 5, data: vec![1, 2, 3, 4, 5], ..Tile::default() };
    let valid = cdr::to_bytes(&tile).unwrap();
    fuzz!(|edits: &[Edit]| {
        let bytes = damaged(&valid, edits);
        let Ok(tile) = cdr::from_bytes::<Tile>(&bytes) else { return };
        assert!(tile.data.len() <= bytes.len());
        let again: Tile = cdr::from_bytes(&cdr::to_bytes(&tile).unwrap()).unwrap();
        assert_eq!(again, tile);
    });
}
