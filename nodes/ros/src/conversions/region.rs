//! Regions of interest.

use puffer_core::geometry::Aabb;
use puffer_msgs::geometry_msgs::msg::Vector3;

/// The region of interest whose edges (metres) a message holds, in the object frame: along x and y
/// it reaches half an edge to each side of the origin, along z one edge above it. An edge of 0
/// leaves the extent of `otherwise`, and so stays the lower end of z.
///
/// # Errors
/// In words, if an edge is negative or not finite.
pub fn region_from_message(edges: &Vector3, otherwise: &Aabb) -> Result<Aabb, String> {
    if ![edges.x, edges.y, edges.z].iter().all(|edge| edge.is_finite() && *edge >= 0.0) {
        return Err(format!(
            "roi has the edges {}, {} and {} m: they must be positive, or 0 for what is configured",
            edges.x, edges.y, edges.z
        ));
    }
    let mut region = *otherwise;
    for (axis, edge) in [edges.x, edges.y].into_iter().enumerate().filter(|(_, edge)| *edge > 0.0) {
        (region.min[axis], region.max[axis]) = (-edge / 2.0, edge / 2.0);
    }
    if edges.z > 0.0 {
        region.max.z = edges.z;
    }
    Ok(region)
}
