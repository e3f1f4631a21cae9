use super::*;
use crate::geometry::{Aabb, Surface};
use crate::mesh::isosurface::tests::{assert_manifold, pierces};
use rayon::prelude::*;

/// Number of triangles that an edge of another one goes through.
fn self_intersections(mesh: &Mesh) -> usize {
    let surface = Surface::new(&mesh.vertices, &mesh.triangles).unwrap();
    // Millimetres keep the volumes of the test well above rounding.
    (0..mesh.triangles.len())
        .into_par_iter()
        .filter(|&i| {
            let own = mesh.corners(i).map(|v| v * 1e3);
            surface.triangles_near(&Aabb::from_points(&mesh.corners(i))).into_iter().any(|j| {
                let other = mesh.triangles[j as usize];
                let shares_vertex = other.iter().any(|v| mesh.triangles[i].contains(v));
                let other = mesh.corners(j as usize).map(|v| v * 1e3);
                !shares_vertex && (0..3).any(|k| pierces(&other[k], &other[(k + 1) % 3], &own))
            })
        })
        .count()
}

#[test]
fn every_object_is_as_stated() {
    for info in object_infos() {
        let start = std::time::Instant::now();
        let mesh = make_object(info.name).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        let (name, triangles) = (info.name, mesh.triangles.len());
        let (euler, components) = assert_manifold(&mesh);
        assert_eq!((components, euler), (1, 2 - 2 * i64::from(info.genus)), "{name}");
        check_ground_truth(&mesh).unwrap();
        assert!((50_000..250_000).contains(&triangles), "{name} has {triangles} triangles");
        let aabb = mesh.aabb();
        for i in 0..3 {
            let off = aabb.extent()[i] - info.size[i];
            assert!(off.abs() < 4e-4, "{name} is {off} m too large along axis {i}");
        }
        assert!(aabb.min.z == 0.0 && aabb.center().xy().norm() < 1e-9, "{name}: {aabb:?}");
        assert_eq!(self_intersections(&mesh), 0, "{name} intersects itself");
        let smallest =
            (0..triangles).map(|i| smallest_angle(&mesh.corners(i))).fold(90.0, f64::min);
        assert!(smallest > 0.5, "{name} has an angle of {smallest} degrees");
        eprintln!("{name}: {triangles} triangles, {seconds:.2} s, least angle {smallest:.1}");
    }
}

fn smallest_angle(c: &[Vec3; 3]) -> f64 {
    (0..3)
        .map(|i| (c[(i + 1) % 3] - c[i]).angle(&(c[(i + 2) % 3] - c[i])).to_degrees())
        .fold(180.0, f64::min)
}

#[test]
fn vertices_lie_on_the_zero_set() {
    for recipe in &RECIPES {
        let mesh = mesher::mesh_zero_set(recipe.field, recipe.size, recipe.spacing);
        let off: Vec<f64> = mesh.vertices.iter().map(|v| (recipe.field)(v).abs()).collect();
        let beyond = off.iter().filter(|&&d| d > 1e-3).count();
        let worst = off.iter().copied().fold(0.0, f64::max);
        eprintln!("{}: {beyond} of {} beyond 1 um, worst {worst:.4} mm", recipe.name, off.len());
        assert!(worst < 0.05 && 200 * beyond < off.len(), "{}: {beyond}, {worst} mm", recipe.name);
    }
}

#[test]
fn an_unknown_name_lists_the_known_ones() {
    let error = make_object("teapot").unwrap_err().to_string();
    assert!(error.contains("teapot") && error.contains("coffee"), "{error}");
}

#[test]
fn unfit_ground_truth_is_refused_with_the_cure() {
    let good = make_object("box").unwrap();
    type Spoil = fn(&mut Mesh);
    let cases: [(Spoil, &str); 5] = [
        (|m| m.triangles.clear(), "no triangles"),
        (|m| m.vertices.iter_mut().for_each(|v| *v *= 1000.0), "use --unit mm"),
        (|m| m.triangles.truncate(m.triangles.len() - 1), "3 edges"),
        (|m| m.triangles.iter_mut().for_each(|t| t.swap(0, 1)), "inside out"),
        (|m| m.vertices[7].x = f64::NAN, "vertex 7"),
    ];
    for (spoil, says) in cases {
        let mut mesh = good.clone();
        spoil(&mut mesh);
        let error = check_ground_truth(&mesh).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}
