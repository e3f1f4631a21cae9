//! Triangle meshes: the indexed mesh and its half-edge structure, invariants, self-intersections,
//! remeshing, isosurfaces, files and pictures.

mod aabb_tree;
mod half_edge_mesh;
pub mod invariants;
pub mod io;
pub mod isosurface;
pub mod lattice_topology;
pub mod remeshing;
pub mod render;
mod self_intersection;
#[cfg(test)]
pub(crate) mod test_shapes;
mod triangle;
mod triangle_mesh;
mod vertex_clustering;

pub use half_edge_mesh::HalfEdgeMesh;
pub use invariants::{
    components, degenerate_triangles, euler_characteristic, genus, is_closed, is_oriented,
    is_two_manifold, min_angles,
};
pub use self_intersection::{self_intersections, self_intersections_among};
pub use triangle::{triangle_angles, triangles_intersect};
pub use triangle_mesh::Mesh;
pub use vertex_clustering::simplify_by_clustering;
