//! The default inflation: the inside space is where the winding number of the points and the votes
//! of single points say inside, with the loops that they support. The mesh is the border of that
//! space.
//!
//! It answers the two questions of the thesis (Wiedemann 2014, §2.4.1) for all voxels at once. A
//! beam that would escape through a hole or meet the back of the mesh is a winding number below one
//! half. Fronts that meet are one space, so handles and through-holes come out with their true
//! genus.

use super::topology_filter::filter_topology;
use super::votes::add_votes;
use super::winding_number::{WindingNumber, point_areas};
use crate::geometry::{Aabb, Cloud, Vec3};
use crate::mesh::{Mesh, isosurface::Lattice};
use crate::{Error, Progress, Result};
use rayon::prelude::*;

/// Times that the lattice is refined by two near the points.
const REFINEMENT_LEVELS: usize = 2;
/// Largest number of lattice corners: 100 million take 1 GB.
const MAX_CORNERS: f64 = 1e8;
/// Space round the points, in coarse lattice spacings, so that the surface does not meet the
/// border.
const PADDING_COARSE_SPACINGS: f64 = 2.0;
/// How far on both sides of zero a loop must be supported, in votes of a whole sheet. Single stray
/// points change the winding number by about a quarter.
const LOOP_MARGIN: f32 = 0.25;
/// Share of the inflation that is done once the lattice is sampled, and once all points have voted.
const PROGRESS_AFTER_SAMPLING: f64 = 0.7;
const PROGRESS_AFTER_VOTES: f64 = 0.8;

/// The surface of the inside space on a lattice of spacing `spacing` (metres), of at most
/// `components` bodies, the largest ones. The points lie `point_spacing` (metres) apart.
///
/// # Errors
/// [`Error::Input`] if the points enclose nothing, or the lattice would be too large;
/// [`Error::Cancelled`].
pub(super) fn inflate(
    cloud: &Cloud,
    spacing: f64,
    point_spacing: f64,
    components: usize,
    progress: &Progress,
) -> Result<Mesh> {
    let areas = point_areas(cloud, point_spacing);
    let winding = WindingNumber::new(cloud, &areas, point_spacing);
    let mut lattice = sample(cloud, &winding, spacing, progress)?;
    add_votes(&mut lattice, cloud, &areas, point_spacing);
    progress.report("inflate", PROGRESS_AFTER_VOTES)?;
    filter_topology(&mut lattice, LOOP_MARGIN, components);
    let mesh = lattice.extract_isosurface();
    if mesh.triangles.is_empty() {
        return Err(Error::input(
            "the points enclose no volume: are the normals turned inwards, or is only one side scanned?",
        ));
    }
    Ok(mesh)
}

/// The field of the winding number (see [`side`]): exact near the points, interpolated between
/// coarser corners elsewhere.
///
/// # Errors
/// [`Error::Input`] if the lattice would be too large; [`Error::Cancelled`].
fn sample(
    cloud: &Cloud,
    winding: &WindingNumber,
    spacing: f64,
    progress: &Progress,
) -> Result<Lattice> {
    let coarse = spacing * f64::from(1 << REFINEMENT_LEVELS);
    let bounds = Aabb::from_points(&cloud.points).padded(PADDING_COARSE_SPACINGS * coarse);
    let corners = bounds.extent().iter().map(|e| e / spacing + 1.0).product::<f64>();
    if corners > MAX_CORNERS {
        return Err(Error::input(format!(
            "a lattice of {:.2} mm over {:.2} m has {corners:.1e} corners, {MAX_CORNERS:.0e} are allowed: raise \
             reconstruct.edge_length or reconstruct.voxel_edge",
            spacing * 1e3,
            bounds.extent().max()
        )));
    }
    let mut lattice = Lattice::sample(&bounds, coarse, |p| side(winding, p));
    for level in 1..=REFINEMENT_LEVELS {
        let share = PROGRESS_AFTER_SAMPLING * level as f64 / (REFINEMENT_LEVELS + 1) as f64;
        progress.report("inflate", share)?;
        lattice = refine(&lattice, cloud, winding);
    }
    Ok(lattice)
}

/// On which side the winding number places `p`: from -1 inside to 1 outside, and no more where
/// sheets overlap.
fn side(winding: &WindingNumber, p: &Vec3) -> f64 {
    (1.0 - 2.0 * winding.at(p)).clamp(-1.0, 1.0)
}

/// The lattice at half the spacing: new corners of cells near points are sampled, all others are
/// interpolated between the old ones.
fn refine(coarse: &Lattice, cloud: &Cloud, winding: &WindingNumber) -> Lattice {
    let near = cells_near_points(cloud, coarse);
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
                side(winding, &lattice.position(corner[0], corner[1], corner[2])) as f32
            } else {
                interpolate(coarse, corner)
            };
        }
    });
    lattice.values = values;
    lattice
}

/// The mean of the coarse corners that `corner` of the refined lattice lies between.
fn interpolate(coarse: &Lattice, corner: [usize; 3]) -> f32 {
    // Each bit says whether the upper of two coarse corners is taken along one axis. Where the
    // refined corner lies on a coarse one, both are the same.
    let values = (0..8_usize).map(|bits| {
        let [x, y, z] = [0, 1, 2].map(|axis| (corner[axis] + (bits >> axis & 1)) / 2);
        coarse.values[coarse.index(x, y, z)]
    });
    // The mean over the eight combinations.
    values.sum::<f32>() / 8.0
}

/// Marks the coarse cells that hold points, and their neighbours.
fn cells_near_points(cloud: &Cloud, coarse: &Lattice) -> Vec<bool> {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A lattice with the values of a linear function at its corners.
    fn linear(size: [usize; 3], spacing: f64) -> Lattice {
        let mut lattice = Lattice { spacing, size, ..Lattice::default() };
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let p = lattice.position(x, y, z);
                    lattice.values.push((p.x - 2.0 * p.y + 0.5 * p.z) as f32);
                }
            }
        }
        lattice
    }

    #[test]
    fn interpolation_is_exact_for_linear_fields() {
        let (coarse, fine) = (linear([3, 4, 5], 1.0), linear([5, 7, 9], 0.5));
        for z in 0..9 {
            for y in 0..7 {
                for x in 0..5 {
                    let expected = fine.values[fine.index(x, y, z)];
                    let found = interpolate(&coarse, [x, y, z]);
                    assert!((found - expected).abs() < 1e-5, "{x} {y} {z}: {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn cells_are_near_if_they_or_a_neighbour_hold_a_point() {
        let lattice = linear([9, 9, 9], 1.0);
        let mut cloud = Cloud::default();
        cloud.push(Vec3::new(4.5, 4.2, 4.9), Vec3::z(), 1e-4, 1);
        let near = cells_near_points(&cloud, &lattice);
        assert_eq!(near.iter().filter(|near| **near).count(), 27);
        assert!(near[lattice.index(3, 3, 3)] && near[lattice.index(5, 5, 5)]);
        assert!(!near[lattice.index(2, 4, 4)] && !near[lattice.index(4, 6, 4)]);
    }

    #[test]
    fn a_refined_lattice_is_exact_near_the_points() {
        // Six points of an octahedron: the winding number near them is that of the fine lattice.
        let mut cloud = Cloud::default();
        for n in [Vec3::x(), -Vec3::x(), Vec3::y(), -Vec3::y(), Vec3::z(), -Vec3::z()] {
            cloud.push(n, n, 1e-3, 1);
        }
        let winding = WindingNumber::new(&cloud, &[2.0; 6], 1.0);
        let bounds = Aabb { min: Vec3::repeat(-3.0), max: Vec3::repeat(3.0) };
        let coarse = Lattice::sample(&bounds, 1.0, |p| side(&winding, p));
        let fine = refine(&coarse, &cloud, &winding);
        let exact = Lattice::sample(&bounds, 0.5, |p| side(&winding, p));
        assert_eq!(fine.size, coarse.size.map(|n| 2 * n - 1));
        for (x, y, z) in [(8, 6, 6), (7, 6, 6), (6, 5, 7), (6, 6, 9)] {
            let found = fine.values[fine.index(x, y, z)];
            let expected = exact.values[exact.index(x, y, z)];
            assert!((found - expected).abs() < 1e-6, "{x} {y} {z}: {found} {expected}");
        }
    }
}
