//! Which corners of a lattice are neighbours, and what adding one corner to a body does to its topology.
//!
//! [`Lattice::surface`](super::isosurface::Lattice::surface) cuts each cube into Kuhn's six tetrahedra. Their edges join a corner to 14
//! others, and their triangles opposite the corner form a sphere, the corner's *link*. Seen from that sphere, a set of
//! corners and its complement are alike: both are connected along the same 14 edges. How many pieces of the link
//! lie inside, and how many outside, tells what adding the corner does (Bertrand 1994, Simple points, topological
//! numbers and geodesic neighborhoods in cubic grids; here for the tetrahedral lattice).

/// The steps to the 14 neighbours: the seven edges of the tetrahedra, both ways.
pub const STEPS: [[i32; 3]; 14] = [
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

/// All 14 neighbours, a bit each in the order of [`STEPS`].
pub const ALL: u16 = (1 << STEPS.len()) - 1;

/// For each neighbour the neighbours that are its own in the link.
const LINK: [u16; STEPS.len()] = link();

const fn link() -> [u16; STEPS.len()] {
    let mut link = [0; STEPS.len()];
    let mut a = 0;
    while a < STEPS.len() {
        let mut b = 0;
        while b < STEPS.len() {
            if a != b && is_edge(STEPS[a], STEPS[b]) {
                link[a] |= 1 << b;
            }
            b += 1;
        }
        a += 1;
    }
    link
}

/// Whether the step from `a` to `b` is an edge of a tetrahedron: 0 and 1 only, or 0 and -1 only.
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

/// The connected pieces of a set of neighbours, each a set of its own, the one with the lowest neighbour first.
pub fn pieces(set: u16) -> impl Iterator<Item = u16> {
    let mut left = set;
    std::iter::from_fn(move || {
        if left == 0 {
            return None;
        }
        let piece = piece_of(left, left & left.wrapping_neg());
        left &= !piece;
        Some(piece)
    })
}

/// The connected piece of `set` that holds the neighbours `seed`.
fn piece_of(set: u16, seed: u16) -> u16 {
    let (mut piece, mut front) = (seed, seed);
    while front != 0 {
        let mut reached = 0;
        while front != 0 {
            reached |= LINK[front.trailing_zeros() as usize];
            front &= front - 1;
        }
        front = reached & set & !piece;
        piece |= front;
    }
    piece
}

/// Whether adding the corner to a body that holds the neighbours `inside`, or taking it out, leaves bodies, loops and
/// voids as they are: the link is cut in just two.
pub fn is_simple(inside: u16) -> bool {
    let outside = ALL & !inside;
    is_connected(inside) && is_connected(outside)
}

/// Whether `set` is one piece; none is not one.
fn is_connected(set: u16) -> bool {
    set != 0 && piece_of(set, set & set.wrapping_neg()) == set
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_link_is_a_sphere_of_14_corners_36_edges_and_24_triangles() {
        let edges: u32 = LINK.iter().map(|l| l.count_ones()).sum::<u32>() / 2;
        let mut triangles = 0;
        for (a, link) in LINK.iter().enumerate() {
            let (after, own) = (!0 << (a + 1), *link);
            for (b, other) in LINK.iter().enumerate().filter(|(b, _)| own & after & 1 << b != 0) {
                triangles += (own & other & !0 << (b + 1)).count_ones();
            }
        }
        assert_eq!((edges, triangles), (36, 24));
        assert_eq!(pieces(ALL).count(), 1);
    }

    #[test]
    fn pieces_are_disjoint_cover_the_set_and_do_not_touch() {
        for set in 0..=ALL {
            let found: Vec<u16> = pieces(set).collect();
            assert_eq!(found.iter().fold(0, |all, piece| all | piece), set);
            for (i, a) in found.iter().enumerate() {
                assert!(is_connected(*a));
                let touched = (0..14).filter(|n| a >> n & 1 == 1).fold(0, |t, n| t | LINK[n]);
                assert!(found[i + 1..].iter().all(|b| a & b == 0 && touched & b == 0));
            }
        }
    }

    #[test]
    fn a_corner_on_a_flat_border_is_simple_and_one_between_two_bodies_is_not() {
        let below = (0..14).filter(|&i| STEPS[i][2] < 0).fold(0, |set, i| set | 1 << i);
        assert!(is_simple(below) && is_simple(ALL & !below));
        assert!(!is_simple(0) && !is_simple(ALL));
        let poles = 1 << 3 | 1 << 10;
        assert!(!is_simple(poles) && !is_simple(ALL & !poles));
    }
}
