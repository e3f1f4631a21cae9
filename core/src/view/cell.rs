//! What is known of a voxel.

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
    /// Scans that looked at it in vain.
    pub tries: u8,
    /// Best cosine of incidence so far, 255 for 1.
    pub quality: u8,
    pub state: State,
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
