//! What is known of a voxel.

use crate::geometry::Vec3;

/// State of a voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// Nothing is known.
    #[default]
    Unknown,
    /// Between the sensor and a measured surface.
    Free,
    /// A surface was measured.
    Occupied,
    /// Behind a measured surface, seen from every view so far.
    PossibleInside,
    /// Between unknown and possible inside.
    PossibleBorder,
    /// Known to be solid (gripper, table): stops rays, and asks for nothing.
    Excluded,
}

/// Evidence and state of a voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Cell {
    /// Measured points of all scans.
    pub points: u32,
    /// Scans with points in it.
    pub hits: u16,
    /// Scans without, that saw through it well before a surface.
    pub passes: u16,
    /// Whether a ray went through it before its surface.
    pub freed: bool,
    /// Whether a ray would have gone through it behind its surface.
    pub behind: bool,
    /// Whether a surface voxel lies within [`super::ViewParams::hidden_reach`].
    pub near: bool,
    /// Whether a surface voxel that holds its minimum of points touches it.
    pub beside: bool,
    /// Outward direction of a surface voxel, times 127; zero if it is not known.
    pub outward: [i8; 3],
    /// Scans that looked at it in vain.
    pub tries: u8,
    /// Best cosine of incidence so far, 255 for 1.
    pub quality: u8,
    pub state: State,
}

/// The least cosine of incidence at which a sensor is taken to measure a surface well enough to be aligned: at 75 degrees
/// a pattern is drawn out to four times its length.
const MIN_INCIDENCE_COS: f64 = 0.25;
/// A component of one, as [`Cell::outward`] keeps it.
const UNIT: f64 = 127.0;

impl Cell {
    /// Notes the outward direction, a unit vector.
    pub(crate) fn set_outward(&mut self, outward: Option<Vec3>) {
        let kept = |v: f64| (v * UNIT).round() as i8;
        self.outward = outward.map_or([0; 3], |n| [kept(n.x), kept(n.y), kept(n.z)]);
    }

    /// Whether a ray along the unit vector `along` meets the surface from the outside, at an incidence at which it is
    /// measured. Where the outside is not known, as in a thin wall, it does.
    pub(crate) fn faces(&self, along: &Vec3) -> bool {
        let outward = Vec3::from(self.outward.map(f64::from)) / UNIT;
        outward == Vec3::zeros() || -outward.dot(along) >= MIN_INCIDENCE_COS
    }

    /// Whether it lies behind a surface, or on the border of what does.
    pub(crate) fn is_hidden(&self) -> bool {
        matches!(self.state, State::PossibleInside | State::PossibleBorder)
    }
}

/// Numbers of voxels by what is known of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Never seen, within the region of interest.
    pub unknown: usize,
    /// Seen through.
    pub free: usize,
    /// A surface was measured.
    pub occupied: usize,
    /// Occupied with at least the minimum of points.
    pub satisfied: usize,
    /// Occupied, and it or one that touches it holds at least the minimum of points.
    pub covered: usize,
    /// Hidden near surface, not looked at in vain too often, and bordering on free space: surface that was not measured yet
    /// begins there.
    pub frontier: usize,
    /// Behind a surface.
    pub possible_inside: usize,
    /// Between unknown and possible inside.
    pub possible_border: usize,
    /// Occupied without the minimum of points, and looked at in vain so often that they count as not measurable.
    pub unmeasurable: usize,
    /// Possible inside or border, and looked at in vain that often.
    pub unresolved: usize,
    /// Known to be solid.
    pub excluded: usize,
}

impl Counts {
    /// The share of the surface that holds its measurements, 0 to 1, as far as can be told: what was not seen yet counts
    /// with its frontier.
    pub fn coverage(&self) -> f64 {
        self.covered as f64 / (self.occupied + self.frontier).max(1) as f64
    }
}
