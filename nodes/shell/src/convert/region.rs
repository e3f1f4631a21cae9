//! Regions of interest.

use puffer_core::geometry::Aabb;
use puffer_msgs::geometry_msgs::msg::Vector3;

/// The region of interest with the edges of a message (metres), object frame: x and y reach half an edge to each side
/// of the origin, z an edge above it. What is 0 stays as in `otherwise`, and so does the lower end.
///
/// # Errors
/// Edges that are negative or no numbers, in words.
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
