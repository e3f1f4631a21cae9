//! Digital topology of the tetrahedral lattice: the neighbours of a corner, and whether adding the
//! corner to a body changes the body's topology.
//!
//! [`Lattice::extract_isosurface`](super::isosurface::Lattice::extract_isosurface) cuts each cube
//! into Kuhn's six tetrahedra. Their edges join a corner to 14 others, and their triangles opposite
//! of the corner form a sphere, the corner's *link*. A set of corners and its complement have the
//! same connectivity on it, along the same 14 edges. The numbers of components of the link inside
//! and outside of a body tell how adding the corner changes the body (Bertrand 1994, Simple points,
//! topological numbers and geodesic neighborhoods in cubic grids; here for the tetrahedral
//! lattice).

/// The offsets to the 14 neighbours: the seven edges of the tetrahedra in both directions.
pub const NEIGHBOUR_OFFSETS: [[i32; 3]; 14] = [
    [1, 0, 0],
    [0, 1, 0],
    [1, 1, 0],
    [0, 0, 1],
    [1, 0, 1],
    [0, 1, 1],
    [1, 1, 1],
    [-1, 0, 0],
    [0, -1, 0],
    [-1, -1, 0],
    [0, 0, -1],
    [-1, 0, -1],
    [0, -1, -1],
    [-1, -1, -1],
];

/// The set of all 14 neighbours: one bit each, in the order of [`NEIGHBOUR_OFFSETS`].
pub const ALL_NEIGHBOURS: u16 = (1 << NEIGHBOUR_OFFSETS.len()) - 1;

/// For each neighbour the set of those neighbours to which an edge of the link joins it.
const LINK_ADJACENCY: [u16; NEIGHBOUR_OFFSETS.len()] = link_adjacency();

const fn link_adjacency() -> [u16; NEIGHBOUR_OFFSETS.len()] {
    let mut link = [0; NEIGHBOUR_OFFSETS.len()];
    let mut a = 0;
    while a < NEIGHBOUR_OFFSETS.len() {
        let mut b = 0;
        while b < NEIGHBOUR_OFFSETS.len() {
            if a != b && is_edge(NEIGHBOUR_OFFSETS[a], NEIGHBOUR_OFFSETS[b]) {
                link[a] |= 1 << b;
            }
            b += 1;
        }
        a += 1;
    }
    link
}

/// Whether the offset from `a` to `b` is an edge of a tetrahedron: it has only 0 and 1, or only 0
/// and -1.
const fn is_edge(a: [i32; 3], b: [i32; 3]) -> bool {
    let (mut low, mut high, mut i) = (0, 0, 0);
    while i < 3 {
        let step = b[i] - a[i];
        if step < low {
            low = step;
        }
        if step > high {
            high = step;
        }
        i += 1;
    }
    high - low == 1
}

/// The connected components of a set of neighbours, each a set of its own; that with the lowest
/// neighbour comes first.
pub fn connected_components(set: u16) -> impl Iterator<Item = u16> {
    let mut remaining = set;
    std::iter::from_fn(move || {
        if remaining == 0 {
            return None;
        }
        let component = component_containing(remaining, lowest_bit(remaining));
        remaining &= !component;
        Some(component)
    })
}

/// The connected component of `set` that contains the neighbours `seed`.
fn component_containing(set: u16, seed: u16) -> u16 {
    let (mut component, mut front) = (seed, seed);
    while front != 0 {
        let mut reached = 0;
        while front != 0 {
            reached |= LINK_ADJACENCY[front.trailing_zeros() as usize];
            front &= front - 1;
        }
        front = reached & set & !component;
        component |= front;
    }
    component
}

/// Whether the corner is a simple point of a body that contains the neighbours `inside`.
///
/// Adding a simple point to the body or removing it changes neither the components nor the handles
/// nor the voids: the link consists of just one component inside and one outside.
pub fn is_simple_point(inside: u16) -> bool {
    let outside = ALL_NEIGHBOURS & !inside;
    is_connected(inside) && is_connected(outside)
}

/// Whether `set` has exactly one component.
fn is_connected(set: u16) -> bool {
    set != 0 && component_containing(set, lowest_bit(set)) == set
}

/// The set of the lowest neighbour in `set` alone.
fn lowest_bit(set: u16) -> u16 {
    set & set.wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_link_is_a_sphere_of_14_corners_36_edges_and_24_triangles() {
        let edges: u32 = LINK_ADJACENCY.iter().map(|l| l.count_ones()).sum::<u32>() / 2;
        let mut triangles = 0;
        for (a, link) in LINK_ADJACENCY.iter().enumerate() {
            let (after, own) = (!0 << (a + 1), *link);
            for (b, other) in
                LINK_ADJACENCY.iter().enumerate().filter(|(b, _)| own & after & 1 << b != 0)
            {
                triangles += (own & other & !0 << (b + 1)).count_ones();
            }
        }
        assert_eq!((edges, triangles), (36, 24));
        assert_eq!(connected_components(ALL_NEIGHBOURS).count(), 1);
    }

    #[test]
    fn components_are_disjoint_cover_the_set_and_do_not_touch() {
        for set in 0..=ALL_NEIGHBOURS {
            let found: Vec<u16> = connected_components(set).collect();
            assert_eq!(found.iter().fold(0, |all, component| all | component), set);
            for (i, a) in found.iter().enumerate() {
                assert!(is_connected(*a));
                let touched =
                    (0..14).filter(|n| a >> n & 1 == 1).fold(0, |t, n| t | LINK_ADJACENCY[n]);
                assert!(found[i + 1..].iter().all(|b| a & b == 0 && touched & b == 0));
            }
        }
    }

    #[test]
    fn a_corner_on_a_flat_border_is_simple_and_one_between_two_bodies_is_not() {
        let below = (0..14).filter(|&i| NEIGHBOUR_OFFSETS[i][2] < 0).fold(0, |set, i| set | 1 << i);
        assert!(is_simple_point(below) && is_simple_point(ALL_NEIGHBOURS & !below));
        assert!(!is_simple_point(0) && !is_simple_point(ALL_NEIGHBOURS));
        let poles = 1 << 3 | 1 << 10;
        assert!(!is_simple_point(poles) && !is_simple_point(ALL_NEIGHBOURS & !poles));
    }

    /// Brute force on a block of 3 x 3 x 3 corners: a simple point changes the Euler characteristic
    /// of the simplicial complex of the corners inside by nothing.
    #[test]
    fn a_simple_point_leaves_the_euler_characteristic() {
        let mut simple = 0;
        for inside in (0..=ALL_NEIGHBOURS).step_by(7) {
            let corners = (0..14).filter(|n| inside >> n & 1 == 1);
            let edges: u32 =
                corners.clone().map(|n| (LINK_ADJACENCY[n] & inside).count_ones()).sum();
            let mut triangles = 0;
            for a in corners.clone() {
                for b in corners.clone().filter(|b| LINK_ADJACENCY[a] >> b & 1 == 1) {
                    triangles += (LINK_ADJACENCY[a] & LINK_ADJACENCY[b] & inside).count_ones();
                }
            }
            // Each simplex of the link spans one with the corner, which itself adds one.
            let link_characteristic =
                i64::from(inside.count_ones()) - i64::from(edges) / 2 + i64::from(triangles) / 6;
            if is_simple_point(inside) {
                simple += 1;
                assert_eq!(link_characteristic, 1, "{inside:b}");
            }
        }
        assert!(simple > 100);
    }
}
