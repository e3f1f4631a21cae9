//! Labels of simulated points.

/// Label of a point with the sensor's ordinary noise.
pub const GOOD_LABEL: u8 = 0;
/// Label of a point anywhere along its ray.
pub const OUTLIER_LABEL: u8 = 1;
/// Label of a point between the surfaces on either side of a depth edge.
pub const FLYING_LABEL: u8 = 2;
/// Label of a point on the surroundings of the object, with the sensor's ordinary noise.
pub const SURROUNDINGS_LABEL: u8 = 3;
