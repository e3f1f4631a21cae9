//! The topology filter: a loop of a noisy field stays only if the votes support it well enough.
//!
//! The bodies of the *core*, where the field lies clearly inside, grow by the corners in ascending order of their value up
//! to the same distance outside of zero, but by no corner that would close a loop within one body. A tunnel may be
//! filled on the way. What was grown beyond zero is then taken back without a change of topology. So a handle
//! is there only if the core has it, and a hole only if it is still open when the field lies clearly outside: the
//! first homology of the result is what persists over the margin (Bazin and Pham 2007, Topology-preserving tissue
//! classification of magnetic resonance brain images; Segonne 2008, Active contours under topology control). Each
//! step keeps the corners' bodies manifold on the tetrahedral lattice, see [`crate::mesh::neighbours`].

use crate::mesh::isosurface::Lattice;
use crate::mesh::neighbours::{ALL, STEPS, is_simple, pieces};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Bodies of the core with fewer corners than this share of the largest are noise.
const MIN_BODY_RATIO: f64 = 0.01;
/// Value of a corner whose side the filter decided against its sign: the surface passes close to it.
const DECIDED_VALUE: f32 = 1e-3;
/// The margin as a share of the deepest value at most: with scans from few sides nothing lies inside by a whole margin.
const MAX_MARGIN_RATIO: f32 = 0.5;
/// Label of corners outside.
const OUTSIDE: u32 = 0;

/// Gives `lattice` (negative inside) the bodies that its values support by `margin`, or by half of the deepest value if that
/// is less, the `max_bodies` largest at most, without voids: values whose sign says something else come to lie just on
/// the other side of zero.
pub(super) fn filter_topology(lattice: &mut Lattice, margin: f32, max_bodies: usize) {
    let deepest = lattice.values.iter().copied().fold(0.0, f32::min);
    let margin = margin.min(-MAX_MARGIN_RATIO * deepest);
    let mut bodies = Bodies::core(lattice, margin);
    bodies.grow(margin);
    bodies.keep_largest(max_bodies);
    bodies.fill_voids();
    bodies.shrink();
    let inside: Vec<bool> = bodies.label.iter().map(|label| *label != OUTSIDE).collect();
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
    /// Union-find over the labels; that of [`OUTSIDE`] is itself.
    parent: Vec<u32>,
}

impl<'a> Bodies<'a> {
    /// The bodies of corners below `-margin`, each with a label of its own, small ones left out.
    fn core(lattice: &'a Lattice, margin: f32) -> Bodies<'a> {
        let mut bodies =
            Bodies { lattice, label: vec![OUTSIDE; lattice.values.len()], parent: vec![OUTSIDE] };
        let wanted = |value: f32| value < -margin;
        let mut found = Vec::new();
        for start in 0..lattice.values.len() {
            if wanted(lattice.values[start]) && bodies.label[start] == OUTSIDE {
                let label = bodies.parent.len() as u32;
                bodies.parent.push(label);
                let body = bodies.flood(start, label, |at, _| wanted(lattice.values[at]));
                found.push(body);
            }
        }
        let largest = found.iter().map(Vec::len).max().unwrap_or(0);
        for body in found {
            if (body.len() as f64) < MIN_BODY_RATIO * largest as f64 {
                body.into_iter().for_each(|corner| bodies.label[corner] = OUTSIDE);
            }
        }
        bodies
    }

    /// Gives `label` to the corner `start` and all connected to it that are `wanted`, asked with the corner and its
    /// label, and have another label; returns them.
    fn flood(
        &mut self,
        start: usize,
        label: u32,
        wanted: impl Fn(usize, u32) -> bool,
    ) -> Vec<usize> {
        self.label[start] = label;
        let mut body = vec![start];
        let mut next = 0;
        while next < body.len() {
            for neighbour in neighbours(self.lattice, body[next]).into_iter().flatten() {
                let old = self.label[neighbour];
                if old != label && wanted(neighbour, old) {
                    self.label[neighbour] = label;
                    body.push(neighbour);
                }
            }
            next += 1;
        }
        body
    }

    /// Adds corners up to `margin`, the lowest first, that close no loop.
    fn grow(&mut self, margin: f32) {
        let mut queue = Queue::new(self.lattice.values.len());
        for corner in 0..self.label.len() {
            if self.label[corner] != OUTSIDE {
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
    fn queue_neighbours(&self, corner: usize, margin: f32, queue: &mut Queue) {
        for neighbour in neighbours(self.lattice, corner).into_iter().flatten() {
            if self.label[neighbour] == OUTSIDE && self.lattice.values[neighbour] <= margin {
                queue.push(neighbour, self.lattice.values[neighbour]);
            }
        }
    }

    /// The label that `corner` takes when it is added; `None` if it must not be: it would close a loop, or would join
    /// bodies although its value lies outside. Bodies that it joins are one from then on.
    fn joined(&mut self, corner: usize) -> Option<u32> {
        let around = neighbours(self.lattice, corner);
        let inside = set_of(&around, |at| self.label[at] != OUTSIDE);
        let mut met: Vec<u32> = Vec::new();
        for piece in pieces(inside) {
            let neighbour = around[piece.trailing_zeros() as usize]?;
            let body = self.root(self.label[neighbour]);
            if met.contains(&body) {
                return None;
            }
            met.push(body);
        }
        if met.len() > 1 && self.lattice.values[corner] >= 0.0 {
            return None;
        }
        let first = met.iter().copied().min()?;
        met.into_iter().for_each(|body| self.parent[body as usize] = first);
        Some(first)
    }

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
                *label = OUTSIDE;
            }
        }
    }

    /// Outside spaces that the lattice's border does not reach cannot have been seen: they become inside.
    fn fill_voids(&mut self) {
        let open = self.parent.len() as u32;
        for corner in 0..self.label.len() {
            if self.label[corner] == OUTSIDE && is_on_border(self.lattice, corner) {
                self.flood(corner, open, |_, label| label == OUTSIDE);
            }
        }
        for label in &mut self.label {
            *label = if *label == open { OUTSIDE } else { 1.max(*label) };
        }
    }

    /// Takes back what lies outside by its value, the highest first, where that changes no topology.
    fn shrink(&mut self) {
        let mut queue = Queue::new(self.lattice.values.len());
        for corner in 0..self.label.len() {
            self.queue_if_grown(corner, &mut queue);
        }
        while let Some(corner) = queue.pop() {
            let around = neighbours(self.lattice, corner);
            if is_simple(set_of(&around, |at| self.label[at] != OUTSIDE)) {
                self.label[corner] = OUTSIDE;
                for neighbour in around.into_iter().flatten() {
                    self.queue_if_grown(neighbour, &mut queue);
                }
            }
        }
    }

    fn queue_if_grown(&self, corner: usize, queue: &mut Queue) {
        if self.label[corner] != OUTSIDE && self.lattice.values[corner] >= 0.0 {
            queue.push(corner, -self.lattice.values[corner]);
        }
    }
}

/// Corners by ascending key, equal ones by index; each stands in it once.
struct Queue {
    heap: BinaryHeap<Reverse<(u32, usize)>>,
    queued: Vec<bool>,
}

impl Queue {
    /// An empty queue for corners below `corners`.
    fn new(corners: usize) -> Queue {
        Queue { heap: BinaryHeap::new(), queued: vec![false; corners] }
    }

    fn push(&mut self, corner: usize, key: f32) {
        if !self.queued[corner] {
            self.queued[corner] = true;
            // The bits of a float ascend with it if those of negative ones are turned over.
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

/// The corners round `corner` in the order of [`STEPS`], as far as the lattice reaches.
fn neighbours(lattice: &Lattice, corner: usize) -> [Option<usize>; STEPS.len()] {
    let place = place_of(lattice, corner);
    STEPS.map(|step| {
        let at = |axis: usize| place[axis].checked_add_signed(step[axis] as isize);
        let [x, y, z] = [at(0)?, at(1)?, at(2)?];
        let [nx, ny, nz] = lattice.size;
        (x < nx && y < ny && z < nz).then(|| lattice.index(x, y, z))
    })
}

/// Place of `corner` along x, y and z.
fn place_of(lattice: &Lattice, corner: usize) -> [usize; 3] {
    let [nx, ny, _] = lattice.size;
    [corner % nx, corner / nx % ny, corner / (nx * ny)]
}

fn is_on_border(lattice: &Lattice, corner: usize) -> bool {
    let place = place_of(lattice, corner);
    (0..3).any(|axis| place[axis] == 0 || place[axis] + 1 == lattice.size[axis])
}

/// The neighbours that are `wanted`, a bit each; those beyond the lattice are not.
fn set_of(around: &[Option<usize>; STEPS.len()], wanted: impl Fn(usize) -> bool) -> u16 {
    let bit = |(i, at): (usize, &Option<usize>)| u16::from(at.is_some_and(&wanted)) << i;
    around.iter().enumerate().map(bit).fold(0, |set, bit| set | bit) & ALL
}

#[cfg(test)]
#[path = "topology_tests.rs"]
mod tests;
