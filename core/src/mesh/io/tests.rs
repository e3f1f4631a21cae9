use super::*;
use crate::geometry::{Pose, Vec3};
use crate::mesh::test_shapes;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::PathBuf;

/// An octahedron with every attribute; the coordinates are exact in single precision.
fn octahedron() -> Mesh {
    let mut mesh = test_shapes::octahedron();
    mesh.vertices.iter_mut().for_each(|v| *v = *v * 0.125 + Vec3::z());
    mesh.compute_normals();
    mesh.sigma = vec![0.0, 2f64.powi(-12), 2f64.powi(-11), f64::NAN, 2f64.powi(-13), 0.0];
    mesh.observed = vec![true, true, true, false, true, true];
    mesh
}

fn cloud() -> Cloud {
    let mut cloud = Cloud::default();
    for (i, point) in octahedron().vertices.iter().enumerate() {
        cloud.push(*point, Vec3::y(), if i == 2 { f64::NAN } else { 0.25 }, 7 + i as u16);
    }
    cloud
}

fn written(name: &str, mesh: &Mesh) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    write_mesh(&path, mesh, &["first\nsecond".into(), "third".into()]).unwrap();
    (folder, path)
}

fn bytes_of(name: &str) -> Vec<u8> {
    let (_folder, path) = written(name, &octahedron());
    std::fs::read(path).unwrap()
}

fn close(a: &[Vec3], b: &[Vec3], tolerance: f64) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).norm() <= tolerance)
}

#[test]
fn ply_keeps_the_mesh_with_its_attributes() {
    let mesh = octahedron();
    let (_folder, path) = written("mesh.ply", &mesh);
    let read = read_mesh(&path).unwrap();
    assert_eq!(read.vertices, mesh.vertices);
    assert_eq!(read.triangles, mesh.triangles);
    assert_eq!(read.observed, mesh.observed);
    assert!(close(&read.normals, &mesh.normals, 1e-7));
    let [read_bits, bits] =
        [&read, &mesh].map(|m| m.sigma.iter().map(|s| s.to_bits()).collect::<Vec<_>>());
    assert_eq!(read_bits, bits);
}

#[test]
fn the_ply_header_is_that_of_the_page_output_mesh() {
    let bytes = bytes_of("mesh.ply");
    let header = "ply\nformat binary_little_endian 1.0\ncomment first\ncomment second\ncomment third\n\
        element vertex 6\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n\
        property float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\n\
        property uchar blue\nproperty float sigma\nproperty uchar observed\nelement face 8\n\
        property list uchar int vertex_indices\nend_header\n";
    assert!(bytes.starts_with(header.as_bytes()));
    let first = &bytes[header.len()..];
    assert_eq!(first[24..27], confidence_colour(0.0, 1.0));
    assert_eq!(bytes.len(), header.len() + 6 * 32 + 8 * 13);
}

#[test]
fn stl_keeps_the_closed_surface() {
    let mesh = octahedron();
    let (_folder, path) = written("mesh.stl", &mesh);
    let read = read_mesh(&path).unwrap();
    assert_eq!((read.vertices.len(), read.triangles.len()), (6, 8));
    assert!((read.volume() - mesh.volume()).abs() < 1e-12 && mesh.volume() > 0.0);
}

#[test]
fn ascii_stl_is_read() {
    let facet = "facet normal 0 0 1\n outer loop\n vertex 0 0 0\n vertex 1 0 0\n vertex 0 1 -0\n \
                 endloop\n endfacet\n";
    let text = format!("solid name\n{facet}{facet}endsolid name\n");
    let mesh = parse_mesh(text.as_bytes(), Path::new("x.stl")).unwrap();
    assert_eq!((mesh.vertices.len(), mesh.triangles), (3, vec![[0, 1, 2]; 2]));
    let cut = &text[..text.len() - 34];
    let error = parse_mesh(cut.as_bytes(), Path::new("x.stl")).unwrap_err().to_string();
    assert!(error.contains("within facet"), "{error}");
}

#[test]
fn obj_keeps_vertices_normals_and_triangles() {
    let mesh = octahedron();
    let (_folder, path) = written("mesh.obj", &mesh);
    let read = read_mesh(&path).unwrap();
    assert_eq!(read.vertices, mesh.vertices);
    assert_eq!(read.triangles, mesh.triangles);
    assert!(close(&read.normals, &mesh.normals, 1e-7));
}

#[test]
fn obj_polygons_textures_and_negative_indices_are_read() {
    let text = "# a square\nmtllib a.mtl\no square\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\n\
                vn 0 0 1\nusemtl m\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -4 -3 -2\n";
    let mesh = parse_mesh(text.as_bytes(), Path::new("x.obj")).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    assert!(mesh.normals.is_empty(), "the second face has none");
    for (bad, says) in [
        ("v 0 0\n", "line 1: a vertex must have three numbers"),
        ("v 0 0 0\nf 1 2 3\n", "line 2: the face names vertex 1"),
        ("v 0 0 0\nf 0 1 1\n", "OBJ counts from 1"),
        ("v 0 0 0\nf 1 x 1\n", "'x' is not an index"),
        ("v 0 0 0\n", "not a mesh"),
    ] {
        let error = parse_mesh(bad.as_bytes(), Path::new("x.obj")).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn glb_keeps_vertices_normals_and_triangles() {
    let mesh = octahedron();
    let (_folder, path) = written("mesh.glb", &mesh);
    let read = read_mesh(&path).unwrap();
    assert!(close(&read.vertices, &mesh.vertices, 1e-12));
    assert_eq!(read.triangles, mesh.triangles);
    assert!(close(&read.normals, &mesh.normals, 1e-7));
}

fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

#[test]
fn glb_is_aligned_bounded_and_y_up() {
    let bytes = bytes_of("mesh.glb");
    assert_eq!((word(&bytes, 4), word(&bytes, 8)), (2, bytes.len()));
    let json_length = word(&bytes, 12);
    assert!(json_length.is_multiple_of(4) && word(&bytes, 20 + json_length).is_multiple_of(4));
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + json_length]).unwrap();
    for view in json["bufferViews"].as_array().unwrap() {
        assert_eq!(view["byteOffset"].as_u64().unwrap() % 4, 0);
    }
    assert_eq!(json["accessors"][0]["min"], serde_json::json!([-0.125, -0.125, 0.875]));
    assert_eq!(json["accessors"][0]["max"], serde_json::json!([0.125, 0.125, 1.125]));
    let q: Vec<f64> = json["nodes"][0]["rotation"]
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect();
    let rotation = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
        q[3], q[0], q[1], q[2],
    ));
    assert!((rotation * Vec3::z() - Vec3::y()).norm() < 1e-12);
    assert_eq!(json["asset"]["extras"]["comments"][1], "third");
}

#[test]
fn a_glb_without_rotation_is_turned_from_y_up_and_welded() {
    let bytes = bytes_of("mesh.glb");
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let at = text.find("\"rotation\"").unwrap();
    let mut foreign = bytes.clone();
    foreign[at + 1..at + 9].copy_from_slice(b"rotatiox");
    let start = bytes.windows(8).position(|w| w == b"\"puffer\"").unwrap();
    foreign[start..start + 8].copy_from_slice(b"\"foreig\"");
    let read = parse_mesh(&foreign, Path::new("x.glb")).unwrap();
    let turn =
        nalgebra::UnitQuaternion::from_axis_angle(&Vec3::x_axis(), std::f64::consts::FRAC_PI_2);
    let expected =
        octahedron().transformed(&Pose::from_parts(nalgebra::Translation3::identity(), turn));
    assert!(close(&read.vertices, &expected.vertices, 1e-12));
    assert!(read.normals.is_empty(), "a welded mesh has no normals of its own");
}

#[test]
fn the_content_tells_the_format_where_the_extension_does_not() {
    for name in ["mesh.ply", "mesh.stl", "mesh.obj", "mesh.glb"] {
        let mesh = parse_mesh(&bytes_of(name), Path::new("download")).unwrap();
        assert_eq!(mesh.triangles.len(), 8, "{name}");
    }
    let error = parse_mesh(b"what?", Path::new("download")).unwrap_err().to_string();
    assert!(error.contains("no known format"), "{error}");
}

#[test]
fn inconsistent_meshes_and_unknown_extensions_are_not_written() {
    let folder = tempfile::tempdir().unwrap();
    for (name, mesh, says) in [
        ("mesh.xyz", octahedron(), ".ply, .stl, .obj or .glb"),
        ("mesh.ply", Mesh { sigma: vec![0.0], ..octahedron() }, "6 vertices but 1 sigma"),
        ("mesh.ply", Mesh { triangles: vec![[0, 1, 6]], ..octahedron() }, "names vertex 6"),
        ("mesh.ply", Mesh::default(), "no triangle"),
    ] {
        let error = write_mesh(&folder.path().join(name), &mesh, &[]).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

fn one_vertex_ply(rest: &str) -> String {
    format!("ply\nformat ascii 1.0\nelement vertex 1\n{rest}")
}

#[test]
fn mesh_files_that_make_no_mesh_say_why() {
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let face = "element face 1\nproperty list uchar int vertex_index\nend_header\n";
    for (text, says) in [
        (
            one_vertex_ply(&format!("{xyz}end_header\n0 0 0\n")),
            "has no element 'face' (only: vertex)",
        ),
        (
            one_vertex_ply(&format!("property float x\n{face}0\n3 0 0 0\n")),
            "need the properties x, y and z",
        ),
        (
            one_vertex_ply(&format!("{xyz}{face}0 0 0\n3 0 0 1\n")),
            "face 0 names vertex 1, but there are 1",
        ),
        (one_vertex_ply(&format!("{xyz}{face}0 0 0\n2 0 0\n")), "has no face"),
        (one_vertex_ply(&format!("{xyz}{face}0 nan 0\n3 0 0 0\n")), "vertex 0 are not finite"),
    ] {
        let error = parse_mesh(text.as_bytes(), Path::new("x.ply")).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    let error = read_mesh(Path::new("/no/such.ply")).unwrap_err().to_string();
    assert!(error.contains("cannot read /no/such.ply"), "{error}");
}

#[test]
fn a_cloud_keeps_its_columns() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.ply");
    write_cloud(&path, &cloud(), &["by test".into()]).unwrap();
    let read = read_cloud(&path).unwrap();
    assert_eq!(read.points, cloud().points);
    assert_eq!(read.normals, cloud().normals);
    assert_eq!(read.support, cloud().support);
    assert!(read.sigma[2].is_nan() && read.sigma[1] == 0.25);
    let scaled = read_cloud_with_unit(&path, Unit::Millimetre).unwrap_err().to_string();
    assert!(scaled.contains("leave out --unit mm"), "{scaled}");
}

/// An ASCII file with float properties of its vertices.
fn cloud_ply(properties: &str, rows: &str) -> String {
    let properties: String =
        properties.split(' ').map(|p| format!("property float {p}\n")).collect();
    let count = rows.lines().count();
    format!("ply\nformat ascii 1.0\nelement vertex {count}\n{properties}end_header\n{rows}\n")
}

#[test]
fn a_cloud_without_normals_or_in_millimetres_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.ply");
    let pcl = "x y z normal_x normal_y normal_z";
    for (properties, rows, says) in [
        ("x y z", "0 0 0", "scan folder with poses.json"),
        (pcl, "0 0 0 0 0 1\n100 0 0 0 0 1", "millimetres? use --unit mm"),
        (pcl, "0 0 0 0 0 0\nnan 0 0 0 0 1\n0 0 0 nan 0 1", "none of its 3 points"),
    ] {
        std::fs::write(&path, cloud_ply(properties, rows)).unwrap();
        let error = read_cloud(&path).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
    std::fs::write(&path, cloud_ply(pcl, "0 0 0 0 0 2\nnan 0 0 0 0 1")).unwrap();
    let cloud = read_cloud(&path).unwrap();
    assert_eq!((cloud.normals, cloud.support), (vec![Vec3::z()], vec![1]));
}

/// Files of every format that are read by some parser; `.ply` also as clouds.
fn valid_files() -> Vec<(&'static str, Vec<u8>)> {
    let ascii_stl = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n\
                     endloop\nendfacet\nendsolid s\n";
    let header = "element vertex 3\nproperty float x\nproperty double y\nproperty float z\n\
                  property float nx\nproperty float ny\nproperty float nz\nelement face 1\n\
                  property list uchar int vertex_indices\nend_header\n";
    let ascii =
        format!("ply\nformat ascii 1.0\n{header}0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n");
    let mut big = format!("ply\r\nformat binary_big_endian 1.0\r\n{header}").into_bytes();
    for _ in 0..3 {
        big.extend(0.5f32.to_be_bytes());
        big.extend(0.5f64.to_be_bytes());
        big.extend([0.5f32; 4].iter().flat_map(|v| v.to_be_bytes()));
    }
    big.push(3);
    big.extend([0u32, 1, 2].iter().flat_map(|v| v.to_be_bytes()));
    vec![
        ("x.ply", bytes_of("mesh.ply")),
        ("x.ply", ascii.into_bytes()),
        ("x.ply", big),
        ("x.stl", bytes_of("mesh.stl")),
        ("x.stl", ascii_stl.into()),
        ("x.obj", bytes_of("mesh.obj")),
        ("x.glb", bytes_of("mesh.glb")),
    ]
}

fn try_all(name: &str, bytes: &[u8]) -> bool {
    // What matters is that each returns.
    let _ = ply::parse_cloud(bytes, Path::new(name));
    parse_mesh(bytes, Path::new(name)).is_ok()
}

#[test]
fn no_truncated_file_makes_a_reader_panic() {
    for (name, bytes) in valid_files() {
        assert!(try_all(name, &bytes), "{name} must be valid before it is cut");
        let read = (0..bytes.len()).filter(|length| try_all(name, &bytes[..*length])).count();
        // Only text may still be whole without its last bytes.
        let text = bytes.is_ascii() && !bytes.windows(7).any(|w| w == b"binary_");
        let most = if text { bytes.len() } else { 0 };
        assert!(read <= most, "{name}: {read} truncated files passed as whole");
    }
    for (name, bytes) in valid_files().into_iter().filter(|(name, _)| *name == "x.glb") {
        let error = parse_mesh(&bytes[..bytes.len() / 2], Path::new(name)).unwrap_err().to_string();
        assert!(error.contains("truncated"), "{error}");
    }
}

#[test]
fn no_damaged_file_makes_a_reader_panic() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for (name, bytes) in valid_files() {
        for round in 0..4000 {
            let mut damaged = bytes.clone();
            for _ in 0..=round % 4 {
                let at = random.random_range(0..damaged.len());
                match random.random_range(0..6) {
                    0 => damaged[at] = random.random(),
                    1 => damaged[at] = b'9',
                    2 => damaged[at] = b'-',
                    3 => damaged[at] = 255,
                    4 => {
                        damaged.remove(at);
                    }
                    _ => damaged.insert(at, random.next_u32() as u8),
                }
            }
            try_all(name, &damaged);
        }
    }
}
