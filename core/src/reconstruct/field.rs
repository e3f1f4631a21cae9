//! The default inflation: the inside space is where the winding number of the points and the votes of single points
//! say inside, with the loops that they support; the mesh is that space's border.
//!
//! It answers the thesis's two questions for all voxels at once. A beam that would escape through a hole or
//! meet the mesh's own back is a winding number below one half; fronts that meet are one space, so handles and
//! through-holes come out with their true genus.

use super::topology::filter_topology;
use super::votes::add_votes;
use super::winding::{Winding, areas};
use crate::geometry::{Aabb, Cloud, Vec3};
use crate::mesh::{Mesh, isosurface::Lattice};
use crate::{Error, Progress, Result};
use rayon::prelude::*;

/// Times that the lattice is refined by two near the points.
const REFINEMENTS: usize = 2;
/// Lattice corners at most: 100 million take 1 GB.
const MAX_CORNERS: f64 = 1e8;
/// How far on both sides of zero a loop must be supported, in votes of a whole sheet: a quarter is what single stray
/// points make of the winding number.
const LOOP_MARGIN: f32 = 0.25;

/// The surface of the inside space at lattice spacing `spacing` (metres), of the `components` largest bodies at most; the
/// points lie `point_spacing` apart.
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
    let areas = areas(cloud, point_spacing);
    let winding = Winding::new(cloud, &areas, point_spacing);
    let mut lattice = sample(cloud, &winding, spacing, progress)?;
    add_votes(&mut lattice, cloud, &areas, point_spacing);
    progress.report("inflate", 0.8)?;
    filter_topology(&mut lattice, LOOP_MARGIN, components);
    let mesh = lattice.surface();
    if mesh.triangles.is_empty() {
        return Err(Error::input(
            "the points enclose no volume: are the normals turned inwards, or is only one side scanned?",
        ));
    }
    Ok(mesh)
}

/// What the winding number says, scaled as [`vote`] does: exact near the points, between coarser corners elsewhere.
fn sample(cloud: &Cloud, winding: &Winding, spacing: f64, progress: &Progress) -> Result<Lattice> {
    let coarse = spacing * f64::from(1 << REFINEMENTS);
    let bounds = Aabb::of(&cloud.points).padded(2.0 * coarse);
    let corners = bounds.extent().iter().map(|e| e / spacing + 1.0).product::<f64>();
    if corners > MAX_CORNERS {
        return Err(Error::input(format!(
            "a lattice of {:.2} mm over {:.2} m has {corners:.1e} corners, {MAX_CORNERS:.0e} are allowed: raise \
             reconstruct.edge_length or reconstruct.voxel_edge",
            spacing * 1e3,
            bounds.extent().max()
        )));
    }
    let mut lattice = Lattice::sample(&bounds, coarse, |p| vote(winding, p));
    for level in 1..=REFINEMENTS {
        progress.report("inflate", 0.7 * level as f64 / (REFINEMENTS + 1) as f64)?;
        lattice = refine(&lattice, cloud, winding);
    }
    Ok(lattice)
}

/// The winding number's vote at `p`: from -1 inside to 1 outside, and no more where sheets overlap.
fn vote(winding: &Winding, p: &Vec3) -> f64 {
    (1.0 - 2.0 * winding.at(p)).clamp(-1.0, 1.0)
}

/// The lattice at half the spacing: new corners of cells near points are sampled, all others lie between the old ones.
fn refine(coarse: &Lattice, cloud: &Cloud, winding: &Winding) -> Lattice {
    let near = near_points(cloud, coarse);
    let size = coarse.size.map(|n| 2 * (n - 1) + 1);
    let mut lattice = Lattice { spacing: coarse.spacing / 2.0, size, ..coarse.clone() };
    let mut values = vec![0f32; size.iter().product()];
    values.par_chunks_mut(size[0]).enumerate().for_each(|(row, values)| {
        for (x, value) in values.iter_mut().enumerate() {
            let corner = [x, row % size[1], row / size[1]];
            let cell = corner.map(|v| v / 2);
            *value = if corner.iter().any(|v| v % 2 == 1)
                && near[coarse.index(cell[0], cell[1], cell[2])]
            {
                vote(winding, &lattice.position(corner[0], corner[1], corner[2])) as f32
            } else {
                between(coarse, corner)
            };
        }
    });
    lattice.values = values;
    lattice
}

/// The mean of the coarse corners that `corner` of the refined lattice lies between.
fn between(coarse: &Lattice, corner: [usize; 3]) -> f32 {
    let place = |bits: usize, axis: usize| (corner[axis] + (bits >> axis & 1)) / 2;
    let value = |bits| coarse.values[coarse.index(place(bits, 0), place(bits, 1), place(bits, 2))];
    (0..8).map(value).sum::<f32>() / 8.0
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
