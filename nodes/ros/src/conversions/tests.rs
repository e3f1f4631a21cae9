use super::*;
use puffer_core::geometry::{Cloud, Scan, Twist, Vec3, exp};
use puffer_core::mesh::Mesh;
use puffer_msgs::sensor_msgs::msg::{PointCloud2, PointField};
use puffer_msgs::std_msgs::msg::Header;

fn double(name: &str, offset: u32) -> PointField {
    PointField { name: name.into(), offset, datatype: PointField::FLOAT64, count: 1 }
}

#[test]
fn a_scan_keeps_points_rows_and_origins_and_foreign_layouts_are_read() {
    let points = vec![[1.0, 2.0, 3.0], [f32::NAN; 3], [4.0, 5.0, 6.0], [7.0, 8.0, 9.5]];
    let scan =
        Scan { origins: points.iter().map(|p| [p[0], 0.0, 0.1]).collect(), points, width: 2 };
    let message = scan_message(&scan, Header::default());
    assert_eq!((message.width, message.height, message.is_dense), (2, 2, false));
    let read = scan_from_message(&message).unwrap();
    assert_eq!(format!("{read:?}"), format!("{scan:?}"));

    let mut foreign = message.clone();
    foreign.is_bigendian = true;
    for number in foreign.data.chunks_exact_mut(4) {
        number.reverse();
    }
    assert_eq!(format!("{:?}", scan_from_message(&foreign).unwrap()), format!("{scan:?}"));
    // Doubles, padded rows.
    let mut data = Vec::new();
    for row in 0..2 {
        data.extend([1.0 + f64::from(row), 2.0, 3.0].iter().flat_map(|v| v.to_le_bytes()));
        data.extend([0; 5]);
    }
    let padded = PointCloud2 {
        height: 2,
        width: 1,
        fields: vec![double("x", 0), double("y", 8), double("z", 16)],
        point_step: 24,
        row_step: 29,
        data,
        ..Default::default()
    };
    let read = scan_from_message(&padded).unwrap();
    assert_eq!(read.points, [[1.0, 2.0, 3.0], [2.0, 2.0, 3.0]]);
}

/// A change to a message, and what the error then says.
type Fault = (fn(&mut PointCloud2), &'static str);

#[test]
fn a_broken_cloud_says_what_does_not_fit() {
    let scan = Scan { points: vec![[1.0; 3]; 4], width: 2, origins: Vec::new() };
    let good = scan_message(&scan, Header::default());
    let faults: [Fault; 5] = [
        (|c| c.data.truncate(40), "holds 40 bytes"),
        (|c| c.fields.truncate(2), "no field z; it has x, y"),
        (|c| c.fields[2].datatype = 77, "datatype 77"),
        (|c| c.fields[2].offset = 11, "ends at byte 15"),
        (|c| c.width = u32::MAX, "rows of"),
    ];
    for (change, text) in faults {
        let mut cloud = good.clone();
        change(&mut cloud);
        let error = scan_from_message(&cloud).unwrap_err();
        assert!(error.contains(text), "{error}");
    }
}

#[test]
fn clouds_meshes_and_poses_survive_the_way() {
    let mut cloud = Cloud::default();
    cloud.push(Vec3::new(0.1, -0.2, 0.3), Vec3::z(), f64::NAN, 0);
    cloud.push(Vec3::new(0.4, 0.5, 0.6), -Vec3::x(), 1e-4, 7);
    let cloud = cloud.to_single_precision();
    let read = cloud_from_message(&cloud_message(&cloud, Header::default())).unwrap();
    assert_eq!(format!("{read:?}"), format!("{cloud:?}"));

    let mut mesh = Mesh {
        vertices: vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        observed: vec![true, false, true, true],
        sigma: vec![0.5, 0.25, 0.125, 1.0],
        ..Mesh::default()
    };
    mesh.normals = mesh.vertices.clone();
    let message = mesh_message(&mesh, Header::default());
    assert_eq!(format!("{:?}", mesh_from_message(&message).unwrap()), format!("{mesh:?}"));
    let mut broken = message;
    broken.triangles[0] = 9;
    assert!(mesh_from_message(&broken).unwrap_err().contains("vertex 9"));

    let pose = exp(&Twist::new(0.3, -0.2, 0.5, 1.0, 2.0, 0.5));
    assert_eq!(pose_from_message(&pose_message(&pose)).unwrap(), pose);
    assert_eq!(pose_from_transform(&transform_message(&pose)).unwrap(), pose);
    let mut wrong = pose_message(&pose);
    wrong.orientation.w += 1.0;
    assert!(pose_from_message(&wrong).unwrap_err().contains("length"));
}

#[test]
fn a_region_keeps_what_its_message_leaves_open() {
    use puffer_core::geometry::Aabb;
    let configured = Aabb { min: Vec3::new(-1.0, -2.0, -0.1), max: Vec3::new(1.0, 2.0, 3.0) };
    assert_eq!(
        region_from_message(&vector_message(&Vec3::new(0.0, 0.0, 0.0)), &configured),
        Ok(configured)
    );
    let asked =
        region_from_message(&vector_message(&Vec3::new(0.2, 0.0, 0.5)), &configured).unwrap();
    assert_eq!(asked.min, Vec3::new(-0.1, -2.0, -0.1));
    assert_eq!(asked.max, Vec3::new(0.1, 2.0, 0.5));
    for wrong in [-0.1, f64::NAN, f64::INFINITY] {
        let error = region_from_message(&vector_message(&Vec3::new(0.1, wrong, 0.1)), &configured)
            .unwrap_err();
        assert!(error.contains("roi"), "{error}");
    }
}
