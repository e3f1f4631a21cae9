//! Ground-truth objects made from signed distances, and the check of a user's own objects.

mod automotive_filter;
mod coffee;
mod machine_parts;
mod mesher;
mod sdf;
mod solids;
mod vessels;

use crate::geometry::Vec3;
use crate::mesh::Mesh;
use crate::{Error, Result};

/// What is known of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectInfo {
    /// The name that [`make_object`] takes.
    pub name: &'static str,
    /// One line for the user.
    pub description: &'static str,
    /// Number of handles.
    pub genus: u32,
    /// Extent along x, y and z, metres.
    pub size: [f64; 3],
}

/// An object, its distance field and the spacing of the lattice it is meshed on; millimetres.
struct Recipe {
    name: &'static str,
    genus: u32,
    size: [f64; 3],
    spacing: f64,
    field: sdf::Field,
    description: &'static str,
}

/// Spacings give 100,000 to 250,000 triangles (a lattice gives about nine a squared spacing).
#[rustfmt::skip]
static RECIPES: [Recipe; 10] = [
    Recipe { name: "filter", genus: 0, size: [82.0, 80.0, 103.0], spacing: 1.25, field: automotive_filter::filter,
        description: "automotive filter: ribbed body, neck 12 mm thick, small cylinder on top" },
    Recipe { name: "coffee", genus: 0, size: [66.0, 91.0, 180.0], spacing: 1.6, field: coffee::coffee,
        description: "vacuum-packed coffee: wrinkles, side folds, folded top" },
    Recipe { name: "mug", genus: 1, size: [107.5, 80.0, 95.0], spacing: 1.5, field: vessels::mug,
        description: "mug with a 4 mm wall, a deep cavity and a handle" },
    Recipe { name: "torus", genus: 1, size: [110.0, 110.0, 30.0], spacing: 1.1, field: solids::torus,
        description: "lying ring, 30 mm thick" },
    Recipe { name: "bracket", genus: 4, size: [100.0, 50.0, 80.0], spacing: 1.0, field: machine_parts::bracket,
        description: "L-shaped bracket, 8 mm thick, with a gusset and four through holes" },
    Recipe { name: "open_box", genus: 0, size: [80.0, 60.0, 50.0], spacing: 1.25, field: vessels::open_box,
        description: "open box with walls of 2 mm" },
    Recipe { name: "phantom", genus: 0, size: [60.0, 60.0, 84.0], spacing: 0.9, field: machine_parts::phantom,
        description: "ball and cap joined by a neck 6 mm thick and 10 mm long" },
    Recipe { name: "gear", genus: 1, size: [80.0, 80.0, 25.0], spacing: 1.0, field: machine_parts::gear,
        description: "gear of 20 teeth with hub, bore and keyway" },
    Recipe { name: "sphere", genus: 0, size: [100.0, 100.0, 100.0], spacing: 1.3, field: solids::sphere,
        description: "ball" },
    Recipe { name: "box", genus: 0, size: [100.0, 70.0, 50.0], spacing: 1.2, field: solids::cuboid,
        description: "box with edges rounded to 1.5 mm" },
];

/// All objects that [`make_object`] can make.
pub fn object_infos() -> impl Iterator<Item = ObjectInfo> {
    RECIPES.iter().map(|recipe| ObjectInfo {
        name: recipe.name,
        description: recipe.description,
        genus: recipe.genus,
        size: recipe.size.map(|mm| mm * 1e-3),
    })
}

/// The names of all objects.
pub fn object_names() -> Vec<&'static str> {
    RECIPES.iter().map(|recipe| recipe.name).collect()
}

/// Makes the object `name`: a closed, two-manifold, outward-oriented mesh without
/// self-intersections, metres, z up, standing on z = 0, centred in x and y, with vertex normals.
/// The same mesh each time.
///
/// # Errors
/// [`Error::Input`] if there is no such object; the text lists all names.
pub fn make_object(name: &str) -> Result<Mesh> {
    let recipe = RECIPES.iter().find(|recipe| recipe.name == name).ok_or_else(|| {
        Error::input(format!(
            "there is no object \"{name}\"; there are {}",
            object_names().join(", ")
        ))
    })?;
    let mut mesh = mesher::mesh_zero_set(recipe.field, recipe.size, recipe.spacing);
    let aabb = mesh.aabb();
    let foot = Vec3::new(aabb.center().x, aabb.center().y, aabb.min.z);
    for vertex in &mut mesh.vertices {
        *vertex = (*vertex - foot) * 1e-3;
    }
    mesh.compute_normals();
    Ok(mesh)
}

/// A larger object is refused, metres: it is most likely in millimetres.
const MAX_EXTENT: f64 = 10.0;

/// Checks that `mesh` can serve as ground truth.
///
/// # Errors
/// [`Error::Input`] if it is empty, broken, larger than 10 m, not closed or turned inside out; the
/// text says how to mend it.
pub fn check_ground_truth(mesh: &Mesh) -> Result<()> {
    if mesh.triangles.is_empty() {
        return Err(Error::input(
            "the ground truth has no triangles: give a triangle mesh, not a cloud",
        ));
    }
    let count = mesh.vertices.len();
    if let Some(at) = mesh.triangles.iter().flatten().find(|&&v| v as usize >= count) {
        return Err(Error::input(format!(
            "a triangle names vertex {at}, but there are only {count}"
        )));
    }
    if let Some(at) = mesh.vertices.iter().position(|v| v.iter().any(|c| !c.is_finite())) {
        return Err(Error::input(format!("vertex {at} of the ground truth is not finite")));
    }
    let extent = mesh.aabb().extent().max();
    if extent > MAX_EXTENT {
        return Err(Error::input(format!(
            "the ground truth is {extent:.0} m large; millimetres? use --unit mm"
        )));
    }
    let open = count_open_edges(mesh);
    if open > 0 {
        return Err(Error::input(format!(
            "the ground truth is not closed: {open} edges lack their counterpart; merge duplicate vertices, \
             fill the holes and orient all triangles alike"
        )));
    }
    if mesh.volume() <= 0.0 {
        return Err(Error::input(
            "the ground truth encloses no volume or is inside out: flip its triangles",
        ));
    }
    Ok(())
}

/// Number of directed edges without an opposite one.
fn count_open_edges(mesh: &Mesh) -> usize {
    let mut forward: Vec<(u32, u32)> =
        mesh.triangles.iter().flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]).collect();
    let mut backward: Vec<(u32, u32)> = forward.iter().map(|&(a, b)| (b, a)).collect();
    forward.sort_unstable();
    backward.sort_unstable();
    let (mut i, mut matched) = (0, 0);
    for edge in &forward {
        while i < backward.len() && backward[i] < *edge {
            i += 1;
        }
        if backward.get(i) == Some(edge) {
            (i, matched) = (i + 1, matched + 1);
        }
    }
    forward.len() - matched
}

#[cfg(test)]
mod tests;
