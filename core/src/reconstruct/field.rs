//! The default inflation: the inside space is where the winding number of the points exceeds one half, as far as
//! it can be filled from its deepest voxel; the mesh is that space's border.
//!
//! It answers the thesis's two questions for all voxels at once. A beam that would escape through a hole or
//! meet the mesh's own back is a winding number below one half; fronts that meet are one space, so handles and
//! through-holes come out with their true genus.

use super::winding::Winding;
use crate::geometry::{Aabb, Cloud};
use crate::mesh::{Mesh, isosurface::Lattice};
use crate::{Error, Progress, Result};
use rayon::prelude::*;

/// Cells of the coarse lattice along each edge of a coarse cell.
const COARSE: usize = 4;
/// Lattice corners at most: 100 million take 0.4 GB.
const MOST_CORNERS: f64 = 1e8;
/// A coarse cell far from all points is filled from its corners if their winding numbers all keep this distance
/// from one half.
const CLEAR: f32 = 0.25;

/// The surface of the inside space at lattice spacing `spacing` (metres); the points lie `point_spacing` apart.
///
/// # Errors
/// [`Error::Input`] if the points enclose nothing, or the lattice would be too large; [`Error::Cancelled`].
pub(super) fn inflate(
    cloud: &Cloud,
    spacing: f64,
    point_spacing: f64,
    components: usize,
    progress: &Progress,
) -> Result<Mesh> {
    let winding = Winding::new(cloud, point_spacing);
    let mut lattice = sample(cloud, &winding, spacing, progress)?;
    keep_largest(&mut lattice, components);
    fill_cavities(&mut lattice);
    let mesh = lattice.surface();
    if mesh.triangles.is_empty() {
        return Err(Error::input(
            "the points enclose no volume: are the normals turned inwards, or is only one side scanned?",
        ));
    }
    Ok(mesh)
}

/// One half minus the winding number, coarse where no point is near and the answer clear.
fn sample(cloud: &Cloud, winding: &Winding, spacing: f64, progress: &Progress) -> Result<Lattice> {
    let bounds = Aabb::of(&cloud.points).padded(2.0 * COARSE as f64 * spacing);
    let corners = bounds.extent().iter().map(|e| e / spacing + 1.0).product::<f64>();
    if corners > MOST_CORNERS {
        return Err(Error::input(format!(
            "a lattice of {:.2} mm over {:.2} m has {corners:.1e} corners, {MOST_CORNERS:.0e} are allowed: raise \
             reconstruct.edge_length",
            spacing * 1e3,
            bounds.extent().max()
        )));
    }
    let coarse = Lattice::sample(&bounds, spacing * COARSE as f64, |p| 0.5 - winding.at(p));
    progress.report("inflate", 0.3)?;
    let near = near_points(cloud, &coarse);
    let size = coarse.size.map(|n| (n - 1) * COARSE + 1);
    let mut lattice = Lattice { origin: coarse.origin, spacing, size, values: Vec::new() };
    let slices: Vec<Vec<f32>> =
        (0..size[2])
            .into_par_iter()
            .map(|z| {
                let mut slice = Vec::with_capacity(size[0] * size[1]);
                for y in 0..size[1] {
                    for x in 0..size[0] {
                        let cell = [x, y, z].map(|v| v / COARSE);
                        slice.push(clear_value(&coarse, &near, cell).unwrap_or_else(|| {
                            (0.5 - winding.at(&lattice.position(x, y, z))) as f32
                        }));
                    }
                }
                slice
            })
            .collect();
    lattice.values = slices.concat();
    progress.report("inflate", 0.8)?;
    Ok(lattice)
}

/// Marks the coarse cells that hold points, and their neighbours.
fn near_points(cloud: &Cloud, coarse: &Lattice) -> Vec<bool> {
    let mut near = vec![false; coarse.values.len()];
    for point in &cloud.points {
        let cell = ((point - coarse.origin) / coarse.spacing).map(|v| v as usize);
        for z in cell.z.saturating_sub(1)..=cell.z + 1 {
            for y in cell.y.saturating_sub(1)..=cell.y + 1 {
                for x in cell.x.saturating_sub(1)..=cell.x + 1 {
                    near[coarse.index(x, y, z)] = true;
                }
            }
        }
    }
    near
}

/// The value of all of a coarse cell, where no point is near and its corners agree.
fn clear_value(coarse: &Lattice, near: &[bool], cell: [usize; 3]) -> Option<f32> {
    let corner = |bits: usize| {
        let [x, y, z] = [0, 1, 2].map(|i| (cell[i] + (bits >> i & 1)).min(coarse.size[i] - 1));
        coarse.index(x, y, z)
    };
    if near[corner(0)] {
        return None;
    }
    let first = coarse.values[corner(0)];
    let agrees = |bits| {
        let value = coarse.values[corner(bits)];
        value.abs() > CLEAR && (value > 0.0) == (first > 0.0)
    };
    (0..8).all(agrees).then_some(first)
}

/// Keeps the `count` largest connected inside spaces; the rest becomes outside.
fn keep_largest(lattice: &mut Lattice, count: usize) {
    let mut regions = regions(lattice, |value| value < 0.0);
    regions.sort_by_key(|region| (std::cmp::Reverse(region.len()), region.first().copied()));
    for &corner in regions.iter().skip(count).flatten() {
        lattice.values[corner] = 0.5;
    }
}

/// Outside spaces that the outside does not reach cannot have been seen: they become inside.
fn fill_cavities(lattice: &mut Lattice) {
    let outer = lattice.index(0, 0, 0);
    for region in regions(lattice, |value| value >= 0.0) {
        // Regions are found in ascending order of their first corner: the outer one holds corner 0.
        if region[0] != outer {
            for corner in region {
                lattice.values[corner] = -0.5;
            }
        }
    }
}

/// Connected sets of corners (6 neighbours) whose value fulfils `wanted`, each starting with its lowest corner.
fn regions(lattice: &Lattice, wanted: impl Fn(f32) -> bool) -> Vec<Vec<usize>> {
    let [nx, ny, nz] = lattice.size;
    let mut seen = vec![false; lattice.values.len()];
    let mut found = Vec::new();
    for start in 0..lattice.values.len() {
        if seen[start] || !wanted(lattice.values[start]) {
            continue;
        }
        seen[start] = true;
        let mut region = vec![start];
        let mut next = 0;
        while next < region.len() {
            let corner = region[next];
            next += 1;
            let (x, y, z) = (corner % nx, corner / nx % ny, corner / (nx * ny));
            let steps = [
                (x > 0).then(|| corner - 1),
                (x + 1 < nx).then(|| corner + 1),
                (y > 0).then(|| corner - nx),
                (y + 1 < ny).then(|| corner + nx),
                (z > 0).then(|| corner - nx * ny),
                (z + 1 < nz).then(|| corner + nx * ny),
            ];
            for neighbour in steps.into_iter().flatten() {
                if !seen[neighbour] && wanted(lattice.values[neighbour]) {
                    seen[neighbour] = true;
                    region.push(neighbour);
                }
            }
        }
        found.push(region);
    }
    found
}
