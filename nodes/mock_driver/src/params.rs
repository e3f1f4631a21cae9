//! Parameters of the mock driver.

use puffer_core::robot::SETUP_NAMES;

puffer_core::choice! {
    /// The robot and sensor that are simulated.
    pub enum Setup {
        /// KUKA KR 16-2 with a laser striper; the object stands on a table.
        Kr16Laser = "kr16_laser",
        /// KUKA omniRob: the arm holds the object before a stereo pair on a pan-tilt unit.
        OmnirobStereo = "omnirob_stereo",
    }
}

impl Setup {
    /// Its name in [`SETUP_NAMES`].
    pub fn name(self) -> &'static str {
        SETUP_NAMES[self as usize]
    }
}

puffer_core::params! {
    /// What is simulated, and how fast.
    pub struct DriverParams("driver") {
        /// Robot and sensor that are simulated.
        setup: Setup = Setup::Kr16Laser;
        /// Object to be scanned: a name that `puffer objects` lists, or the path of a closed mesh
        /// file in metres.
        object: String = "coffee".to_owned();
        /// Seed of the random noise, outliers, drop-outs and pose errors.
        seed: usize = 0, in [0, 9007199254740991_u64];
        /// Simulated seconds per second of wall clock while the robot moves.
        speed_up: f64 = 10.0, in [0.1, 1000.0];
        /// Rate at which joint states and transforms are published while the robot moves, per
        /// simulated second.
        rate: f64 = 20.0, in [1.0, 1000.0], unit "Hz";
        /// Folder for the true mesh (truth.ply, written at the start) and the points that the scans
        /// saw of it (seen.ply, written at the end); empty for none.
        truth_folder: String = String::new();
    }
}

puffer_core::param_groups! {
    /// All parameters of the mock driver.
    pub struct Params {
        /// What is simulated.
        driver: DriverParams,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::params::ParamValue;

    #[test]
    fn the_words_are_the_names_of_the_set_ups() {
        assert_eq!(Setup::CHOICES, SETUP_NAMES);
        assert_eq!(Setup::OmnirobStereo.name(), "omnirob_stereo");
    }
}
