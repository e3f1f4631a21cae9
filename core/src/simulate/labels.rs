//! What became of a simulated point.

/// Label of a point with the sensor's ordinary noise.
pub const GOOD: u8 = 0;
/// Label of a point anywhere along its ray.
pub const OUTLIER: u8 = 1;
/// Label of a point between the surfaces on either side of a depth edge.
pub const FLYING: u8 = 2;
/// Label of a point on what stands round the object, with the sensor's ordinary noise.
pub const SURROUNDINGS: u8 = 3;
