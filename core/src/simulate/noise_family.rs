//! Which robot and which sensor the simulated errors are those of.

use crate::{Error, Result};

crate::choice! {
    /// Noise of poses and sensor, after the benchmarks' table.
    pub enum NoiseFamily {
        /// Exact poses, laser striper.
        P1 = "P1",
        /// Poses of a KR 16 (0.1 to 0.3 mm, 0.01 to 0.03 degrees), laser striper.
        P2K = "P2K",
        /// Poses of an LWR (2 to 5 mm, 0.3 to 1 degree), laser striper.
        P2 = "P2",
        /// Poses of an LWR, stereo pair.
        P3 = "P3",
    }
}

impl NoiseFamily {
    /// The family of a set-up: `kr16_laser` or `omnirob_stereo`.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no such set-up.
    pub fn from_setup(name: &str) -> Result<NoiseFamily> {
        match name {
            "kr16_laser" => Ok(NoiseFamily::P2K),
            "omnirob_stereo" => Ok(NoiseFamily::P3),
            _ => Err(Error::input(format!(
                "there is no set-up \"{name}\"; there are kr16_laser, omnirob_stereo"
            ))),
        }
    }

    /// Whether the sensor is the stereo pair; otherwise it is the laser striper.
    pub fn is_stereo(self) -> bool {
        self == NoiseFamily::P3
    }

    /// The name of the sensor in a scan folder: "laser" or "stereo".
    pub fn sensor_name(self) -> &'static str {
        if self.is_stereo() { "stereo" } else { "laser" }
    }
}
