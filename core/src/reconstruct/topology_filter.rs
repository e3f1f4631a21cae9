//! The topology filter: a loop of a noisy field stays only if the votes support it well enough.
//!
//! The bodies of the *core*, where the field lies inside by a margin, grow by the corners in
//! ascending order of their value up to the same margin outside of zero, but by no corner that
//! would close a loop within one body. A tunnel may be filled on the way. What was grown beyond
//! zero is then taken back without a change of topology. Therefore a handle is there only if the
//! core has it, and a hole only if it is still open where the field lies outside by the margin: the
//! first homology of the result is what persists over the margin (Bazin and Pham 2007,
//! Topology-preserving tissue classification of magnetic resonance brain images; Segonne 2008,
//! Active contours under topology control). Each step keeps the corners' bodies manifold on the
//! tetrahedral lattice, see [`crate::mesh::lattice_topology`].

use crate::mesh::isosurface::Lattice;
use crate::mesh::lattice_topology::{
    ALL_NEIGHBOURS, NEIGHBOUR_OFFSETS, connected_components, is_simple_point,
};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Bodies of the core with fewer corners than this share of the largest are noise.
const MIN_BODY_RATIO: f64 = 0.01;
/// Value of a corner whose side the filter decided against its sign: the surface passes close to
/// it.
const DECIDED_VALUE: f32 = 1e-3;
/// Largest margin as a share of the deepest value: with scans from few sides nothing lies inside by
/// a whole margin.
const MAX_MARGIN_RATIO: f32 = 0.5;
/// Label of corners outside.
const OUTSIDE_LABEL: u32 = 0;

/// Gives `lattice` (negative inside) the bodies that its values support by `margin`, or by half of
/// the deepest value if that is less: at most `max_bodies`, the largest ones, without voids. Values
/// whose sign says something else are set to just the other side of zero.
pub(super) fn filter_topology(lattice: &mut Lattice, margin: f32, max_bodies: usize) {
    let deepest = lattice.values.iter().copied().fold(0.0, f32::min);
    let margin = margin.min(-MAX_MARGIN_RATIO * deepest);
    let mut bodies = Bodies::core(lattice, margin);
    bodies.grow(margin);
    bodies.keep_largest(max_bodies);
    bodies.fill_voids();
    bodies.shrink();
    let inside: Vec<bool> = bodies.label.iter().map(|label| *label != OUTSIDE_LABEL).collect();
    for (value, inside) in lattice.values.iter_mut().zip(inside) {
        if inside && *value >= 0.0 {
            *value = -DECIDED_VALUE;
        } else if !inside && *value < 0.0 {
            *value = DECIDED_VALUE;
        }
    }
}

/// Which body each corner of a lattice belongs to.
struct Bodies<'a> {
    lattice: &'a Lattice,
    /// Label of each corner; bodies that have merged have several, joined in `parent`.
    label: Vec<u32>,
    /// Union-find over the labels; that of [`OUTSIDE_LABEL`] is itself.
    parent: Vec<u32>,
}

impl<'a> Bodies<'a> {
    /// The bodies of corners below `-margin`, each with a label of its own, small ones left out.
    fn core(lattice: &'a Lattice, margin: f32) -> Bodies<'a> {
        let mut bodies = Bodies {
            lattice,
            label: vec![OUTSIDE_LABEL; lattice.values.len()],
            parent: vec![OUTSIDE_LABEL],
        };
        let mut found = Vec::new();
        for start in 0..lattice.values.len() {
            if lattice.values[start] < -margin && bodies.label[start] == OUTSIDE_LABEL {
                let label = bodies.parent.len() as u32;
                bodies.parent.push(label);
                let body = bodies.flood(start, label, |at, _| lattice.values[at] < -margin);
                found.push(body);
            }
        }
        let largest = found.iter().map(Vec::len).max().unwrap_or(0);
        for body in found {
            if (body.len() as f64) < MIN_BODY_RATIO * largest as f64 {
                body.into_iter().for_each(|corner| bodies.label[corner] = OUTSIDE_LABEL);
            }
        }
        bodies
    }

    /// Gives `label` to the corner `start` and to all connected corners that have another label and
    /// for which `is_wanted` of the corner and its label is true; returns them.
    fn flood(
        &mut self,
        start: usize,
        label: u32,
        is_wanted: impl Fn(usize, u32) -> bool,
    ) -> Vec<usize> {
        self.label[start] = label;
        let mut body = vec![start];
        let mut next = 0;
        while next < body.len() {
            for neighbour in neighbours(self.lattice, body[next]).into_iter().flatten() {
                let old = self.label[neighbour];
                if old != label && is_wanted(neighbour, old) {
                    self.label[neighbour] = label;
                    body.push(neighbour);
                }
            }
            next += 1;
        }
        body
    }

    /// Adds the corners up to the value `margin` that close no loop, the lowest first.
    fn grow(&mut self, margin: f32) {
        let mut queue = CornerQueue::new(self.lattice.values.len());
        for corner in 0..self.label.len() {
            if self.label[corner] != OUTSIDE_LABEL {
                self.queue_neighbours(corner, margin, &mut queue);
            }
        }
        while let Some(corner) = queue.pop() {
            if let Some(label) = self.joined(corner) {
                self.label[corner] = label;
                self.queue_neighbours(corner, margin, &mut queue);
            }
        }
    }

    /// Queues the outside neighbours of `corner` whose values are at most `margin`.
    fn queue_neighbours(&self, corner: usize, margin: f32, queue: &mut CornerQueue) {
        for neighbour in neighbours(self.lattice, corner).into_iter().flatten() {
            if self.label[neighbour] == OUTSIDE_LABEL && self.lattice.values[neighbour] <= margin {
                queue.push(neighbour, self.lattice.values[neighbour]);
            }
        }
    }

    /// The label that `corner` takes when it is added; `None` if it must not be added because it
    /// would close a loop, or would join bodies although its value lies outside. Bodies that it
    /// joins are one from then on.
    fn joined(&mut self, corner: usize) -> Option<u32> {
        let around = neighbours(self.lattice, corner);
        let inside = neighbour_mask(&around, |at| self.label[at] != OUTSIDE_LABEL);
        let mut adjacent: Vec<u32> = Vec::new();
        for piece in connected_components(inside) {
            let neighbour = around[piece.trailing_zeros() as usize]?;
            let body = self.root(self.label[neighbour]);
            if adjacent.contains(&body) {
                return None;
            }
            adjacent.push(body);
        }
        if adjacent.len() > 1 && self.lattice.values[corner] >= 0.0 {
            return None;
        }
        let first = adjacent.iter().copied().min()?;
        adjacent.into_iter().for_each(|body| self.parent[body as usize] = first);
        Some(first)
    }

    /// The label that stands for all labels joined with `label`.
    fn root(&mut self, label: u32) -> u32 {
        let mut root = label as usize;
        while self.parent[root] as usize != root {
            self.parent[root] = self.parent[self.parent[root] as usize];
            root = self.parent[root] as usize;
        }
        root as u32
    }

    /// Keeps the `count` bodies with most corners, the first of equals.
    fn keep_largest(&mut self, count: usize) {
        let roots: Vec<u32> = (0..self.parent.len() as u32).map(|label| self.root(label)).collect();
        let mut sizes = vec![0_usize; roots.len()];
        for label in &mut self.label {
            *label = roots[*label as usize];
            sizes[*label as usize] += 1;
        }
        let mut order: Vec<usize> = (1..sizes.len()).filter(|&body| sizes[body] > 0).collect();
        order.sort_by_key(|&body| Reverse(sizes[body]));
        for &body in order.iter().skip(count) {
            sizes[body] = 0;
        }
        for label in &mut self.label {
            if sizes[*label as usize] == 0 {
                *label = OUTSIDE_LABEL;
            }
        }
    }

    /// Makes spaces outside inside if they are not connected to the lattice's border: no sensor can
    /// have seen them.
    fn fill_voids(&mut self) {
        let open = self.parent.len() as u32;
        for corner in 0..self.label.len() {
            if self.label[corner] == OUTSIDE_LABEL && is_on_border(self.lattice, corner) {
                self.flood(corner, open, |_, label| label == OUTSIDE_LABEL);
            }
        }
        for label in &mut self.label {
            *label = if *label == open { OUTSIDE_LABEL } else { 1.max(*label) };
        }
    }

    /// Removes the corners whose value lies outside, the highest first, where that does not change
    /// the topology.
    fn shrink(&mut self) {
        let mut queue = CornerQueue::new(self.lattice.values.len());
        for corner in 0..self.label.len() {
            self.queue_if_grown(corner, &mut queue);
        }
        while let Some(corner) = queue.pop() {
            let around = neighbours(self.lattice, corner);
            if is_simple_point(neighbour_mask(&around, |at| self.label[at] != OUTSIDE_LABEL)) {
                self.label[corner] = OUTSIDE_LABEL;
                for neighbour in around.into_iter().flatten() {
                    self.queue_if_grown(neighbour, &mut queue);
                }
            }
        }
    }

    /// Queues `corner` if it is inside although its value lies outside.
    fn queue_if_grown(&self, corner: usize, queue: &mut CornerQueue) {
        if self.label[corner] != OUTSIDE_LABEL && self.lattice.values[corner] >= 0.0 {
            queue.push(corner, -self.lattice.values[corner]);
        }
    }
}

/// Corners by ascending key, equal ones by index; each is in the queue once at most.
struct CornerQueue {
    heap: BinaryHeap<Reverse<(u32, usize)>>,
    queued: Vec<bool>,
}

impl CornerQueue {
    /// An empty queue for corners below `corners`.
    fn new(corners: usize) -> CornerQueue {
        CornerQueue { heap: BinaryHeap::new(), queued: vec![false; corners] }
    }

    fn push(&mut self, corner: usize, key: f32) {
        if !self.queued[corner] {
            self.queued[corner] = true;
            // The bits of a float, as an integer, ascend with it if the sign bit of positive ones
            // is set and all bits of negative ones are inverted.
            let bits = key.to_bits();
            let ordered = if bits >> 31 == 1 { !bits } else { bits | 1 << 31 };
            self.heap.push(Reverse((ordered, corner)));
        }
    }

    fn pop(&mut self) -> Option<usize> {
        let Reverse((_, corner)) = self.heap.pop()?;
        self.queued[corner] = false;
        Some(corner)
    }
}

/// The neighbours of `corner` in the order of [`NEIGHBOUR_OFFSETS`]; `None` beyond the lattice.
fn neighbours(lattice: &Lattice, corner: usize) -> [Option<usize>; NEIGHBOUR_OFFSETS.len()] {
    let place = grid_indices(lattice, corner);
    NEIGHBOUR_OFFSETS.map(|step| {
        let x = place[0].checked_add_signed(step[0] as isize)?;
        let y = place[1].checked_add_signed(step[1] as isize)?;
        let z = place[2].checked_add_signed(step[2] as isize)?;
        let [nx, ny, nz] = lattice.size;
        (x < nx && y < ny && z < nz).then(|| lattice.index(x, y, z))
    })
}

/// The indices of `corner` along x, y and z.
fn grid_indices(lattice: &Lattice, corner: usize) -> [usize; 3] {
    let [nx, ny, _] = lattice.size;
    [corner % nx, corner / nx % ny, corner / (nx * ny)]
}

fn is_on_border(lattice: &Lattice, corner: usize) -> bool {
    let place = grid_indices(lattice, corner);
    (0..3).any(|axis| place[axis] == 0 || place[axis] + 1 == lattice.size[axis])
}

/// One bit for each neighbour: whether `is_wanted` is true for it; 0 beyond the lattice.
fn neighbour_mask(
    around: &[Option<usize>; NEIGHBOUR_OFFSETS.len()],
    is_wanted: impl Fn(usize) -> bool,
) -> u16 {
    let mut mask = 0;
    for (i, neighbour) in around.iter().enumerate() {
        mask |= u16::from(neighbour.is_some_and(&is_wanted)) << i;
    }
    mask & ALL_NEIGHBOURS
}

#[cfg(test)]
#[path = "topology_filter_tests.rs"]
mod tests;
