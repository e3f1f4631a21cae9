//! Depth edges in a grid of hits, and the flying points that a sensor measures at them.

use super::scene::Hit;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// What a pixel at a depth edge sees beside its own surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum DepthEdge {
    /// The pixel is not at an edge.
    None,
    /// The neighbour whose depth differs most has this depth, metres.
    Step(f64),
    /// A neighbour has no hit.
    Void,
}

/// Looks for a depth edge between the hit `index` of a grid of rows of `width` and its four
/// neighbours: a difference in depth of more than `min_step` (metres), or else a neighbour without
/// a hit.
pub(crate) fn find_depth_edge(
    hits: &[Option<Hit>],
    width: usize,
    index: usize,
    min_step: f64,
) -> DepthEdge {
    let Some(hit) = &hits[index] else { return DepthEdge::None };
    let (x, y, height) = (index % width, index / width, hits.len() / width);
    let neighbours = [
        (x > 0).then(|| index - 1),
        (x + 1 < width).then(|| index + 1),
        (y > 0).then(|| index - width),
        (y + 1 < height).then(|| index + width),
    ];
    let (mut found, mut largest) = (DepthEdge::None, min_step);
    for neighbour in neighbours.into_iter().flatten() {
        match &hits[neighbour] {
            Some(other) if (other.depth - hit.depth).abs() > largest => {
                largest = (other.depth - hit.depth).abs();
                found = DepthEdge::Step(other.depth);
            }
            None if found == DepthEdge::None => found = DepthEdge::Void,
            _ => {}
        }
    }
    found
}

/// Draws the depth of a flying point: anywhere between both sides of the edge, or up to `max_tail`
/// (metres) behind the surface if there is nothing on the other side.
pub(crate) fn draw_flying_depth(
    depth: f64,
    edge: DepthEdge,
    max_tail: f64,
    rng: &mut ChaCha8Rng,
) -> f64 {
    let share: f64 = rng.random();
    match edge {
        DepthEdge::None => depth,
        DepthEdge::Step(other) => depth + share * (other - depth),
        DepthEdge::Void => depth + share * max_tail,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec3;
    use rand::SeedableRng;

    /// A grid of three columns with these depths; NaN for a pixel without a hit.
    fn grid(depths: [f64; 9]) -> Vec<Option<Hit>> {
        depths
            .map(|depth| Hit { point: Vec3::zeros(), cosine: 1.0, depth, on_object: true })
            .map(|hit| hit.depth.is_finite().then_some(hit))
            .to_vec()
    }

    #[test]
    fn an_edge_is_the_largest_step_to_one_of_four_neighbours() {
        let none = f64::NAN;
        // Rows 0.30 to 0.32, 0.30 to 0.35 and nothing; the diagonal 0.9 does not count.
        let hits = grid([0.30, 0.31, 0.9, 0.305, 0.30, 0.35, none, 0.301, none]);
        assert_eq!(find_depth_edge(&hits, 3, 4, 0.02), DepthEdge::Step(0.35));
        assert_eq!(find_depth_edge(&hits, 3, 4, 0.06), DepthEdge::None);
        assert_eq!(find_depth_edge(&hits, 3, 3, 0.02), DepthEdge::Void);
        // A step is preferred to a void, and a pixel without a hit has no edge.
        assert_eq!(find_depth_edge(&hits, 3, 7, 0.0005), DepthEdge::Step(0.30));
        assert_eq!(find_depth_edge(&hits, 3, 6, 0.02), DepthEdge::None);
        // The first pixel of a row is no neighbour of the last one of the row before.
        assert_eq!(find_depth_edge(&hits, 3, 3, 0.5), DepthEdge::Void);
        assert_eq!(find_depth_edge(&hits, 3, 2, 0.56), DepthEdge::Step(0.31));
    }

    #[test]
    fn flying_points_lie_between_both_sides_of_the_edge() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut least, mut most) = (f64::INFINITY, 0.0f64);
        for _ in 0..1000 {
            let depth = draw_flying_depth(0.4, DepthEdge::Step(0.3), 0.02, &mut rng);
            (least, most) = (least.min(depth), most.max(depth));
            let depth = draw_flying_depth(0.4, DepthEdge::Void, 0.02, &mut rng);
            assert!((0.4..0.42).contains(&depth), "{depth}");
        }
        assert!((0.3..0.301).contains(&least) && (0.399..=0.4).contains(&most), "{least} {most}");
    }
}
