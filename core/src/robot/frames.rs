//! Names of the two frames between which a viewpoint is a pose.

/// Frame of the object, in which everything is modelled.
pub const OBJECT_FRAME: &str = "object";
/// Optical frame of the sensor: z forward, x right, y down.
pub const SENSOR_FRAME: &str = "sensor_optical";
