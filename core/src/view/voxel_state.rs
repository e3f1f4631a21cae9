//! What is known of a voxel.

use crate::geometry::Vec3;

/// State of a voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum VoxelState {
    /// Nothing is known.
    #[default]
    Unknown,
    /// Between the sensor and a measured surface.
    Free,
    /// A surface was measured in it.
    Occupied,
    /// Behind a measured surface in every scan so far that reaches it.
    PossibleInside,
    /// Unknown, and face to face with a possible inside voxel.
    PossibleBorder,
    /// Known to be solid (gripper, table): it stops rays and needs no measurements.
    Excluded,
}

/// Evidence and state of a voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct VoxelRecord {
    /// Measured points of all scans.
    pub points: u32,
    /// Scans with points in it.
    pub hits: u16,
    /// Scans without points in it that saw through it well before a surface.
    pub passes: u16,
    /// Whether a ray went through it before its surface.
    pub traversed: bool,
    /// Whether it lies behind the surface that a ray met.
    pub occluded: bool,
    /// Whether a surface voxel lies within [`super::ViewParams::hidden_reach`].
    pub near_surface: bool,
    /// Whether it or a voxel that touches it is a surface voxel with its minimum of points.
    pub beside_satisfied: bool,
    /// Outward direction of a surface voxel, times 127; zero if it is not known.
    pub outward: [i8; 3],
    /// Scans from which it was visible but got no measurements.
    pub tries: u8,
    /// Best cosine of incidence so far, 255 for 1.
    pub quality: u8,
    pub state: VoxelState,
}

/// The least cosine of incidence at which a sensor is taken to measure a surface well enough for
/// registration: at 75 degrees a pattern is stretched to four times its length.
const MIN_INCIDENCE_COS: f64 = 0.25;
/// What a component of 1 is stored as in [`VoxelRecord::outward`]: the largest `i8`.
const OUTWARD_SCALE: f64 = 127.0;
/// What a cosine of 1 is stored as in [`VoxelRecord::quality`]: the largest `u8`.
const QUALITY_SCALE: f64 = 255.0;

impl VoxelRecord {
    /// Stores the outward direction, a unit vector.
    pub(crate) fn set_outward(&mut self, outward: Option<Vec3>) {
        self.outward = outward.map_or([0; 3], quantized);
    }

    /// Whether a ray along the unit vector `along` meets the surface from outside, at an incidence
    /// at which it is measured. True where the outside is not known, as in a thin wall.
    pub(crate) fn is_measurable_along(&self, along: &Vec3) -> bool {
        let outward = Vec3::from(self.outward.map(f64::from)) / OUTWARD_SCALE;
        outward == Vec3::zeros() || -outward.dot(along) >= MIN_INCIDENCE_COS
    }

    /// Raises the quality to that of a measurement along the unit vector `along` of a surface with
    /// the unit normal `normal`.
    pub(crate) fn raise_quality(&mut self, along: &Vec3, normal: &Vec3) {
        let quality = (-along.dot(normal)).clamp(0.0, 1.0) * QUALITY_SCALE;
        self.quality = self.quality.max(quality as u8);
    }

    /// The best cosine of incidence so far, 0 to 1.
    pub(crate) fn quality(&self) -> f64 {
        f64::from(self.quality) / QUALITY_SCALE
    }

    /// Whether it lies behind a surface, or on the border of the space behind surfaces.
    pub(crate) fn is_hidden(&self) -> bool {
        matches!(self.state, VoxelState::PossibleInside | VoxelState::PossibleBorder)
    }
}

fn quantized(direction: Vec3) -> [i8; 3] {
    [direction.x, direction.y, direction.z].map(|v| (v * OUTWARD_SCALE).round() as i8)
}

/// Numbers of voxels by what is known of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VoxelCounts {
    /// Within the region of interest, and nothing is known of them.
    pub unknown: usize,
    /// Seen through.
    pub free: usize,
    /// With a measured surface.
    pub occupied: usize,
    /// Occupied with at least the minimum of points.
    pub satisfied: usize,
    /// Occupied, and the voxel or one that touches it holds at least the minimum of points.
    pub covered: usize,
    /// Hidden near surface, not given up, and face to face with free space: surface that was not
    /// measured yet begins there.
    pub frontier: usize,
    /// Behind a surface.
    pub possible_inside: usize,
    /// Between unknown and possible inside.
    pub possible_border: usize,
    /// Occupied without the minimum of points, and given up after too many scans in vain.
    pub unmeasurable: usize,
    /// Possible inside or border, and given up after too many scans in vain.
    pub unresolved: usize,
    /// Known to be solid.
    pub excluded: usize,
}

impl VoxelCounts {
    /// The share of the surface that holds its measurements, 0 to 1, as far as is known: the
    /// frontier counts as surface that was not seen yet.
    pub fn coverage(&self) -> f64 {
        self.covered as f64 / (self.occupied + self.frontier).max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_is_measurable_up_to_75_degrees_from_outside_and_from_anywhere_without_a_direction()
    {
        let mut voxel = VoxelRecord::default();
        assert!(voxel.is_measurable_along(&Vec3::z()));
        voxel.set_outward(Some(Vec3::z()));
        for degrees in [0.0_f64, 30.0, 75.0, 76.0, 90.0, 120.0, 180.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let along = Vec3::new(sin, 0.0, -cos);
            assert_eq!(voxel.is_measurable_along(&along), degrees <= 75.0, "{degrees}");
        }
        voxel.set_outward(Some(Vec3::new(0.6, 0.0, -0.8)));
        assert_eq!(voxel.outward, [76, 0, -102]);
        voxel.set_outward(None);
        assert_eq!(voxel.outward, [0; 3]);
    }

    #[test]
    fn quality_is_the_best_cosine_of_incidence() {
        let mut voxel = VoxelRecord::default();
        let slanted = Vec3::new(0.0, 0.6, -0.8);
        voxel.raise_quality(&slanted, &Vec3::z());
        assert_eq!(voxel.quality, 204);
        assert!((voxel.quality() - 0.8).abs() < 1e-12);
        // From behind and at a worse incidence it stays.
        voxel.raise_quality(&Vec3::z(), &Vec3::z());
        voxel.raise_quality(&Vec3::new(0.0, 0.8, -0.6), &Vec3::z());
        assert_eq!(voxel.quality, 204);
        voxel.raise_quality(&-Vec3::z(), &Vec3::z());
        assert_eq!(voxel.quality, 255);
    }

    #[test]
    fn coverage_counts_the_frontier_as_surface_and_is_defined_for_nothing() {
        let counts = VoxelCounts { occupied: 6, covered: 4, frontier: 2, ..Default::default() };
        assert_eq!(counts.coverage(), 0.5);
        assert_eq!(VoxelCounts::default().coverage(), 0.0);
    }
}
