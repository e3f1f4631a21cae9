//! Parameters of the mock driver.

use puffer_core::robot::SETUPS;

puffer_core::choice! {
    /// A set-up.
    pub enum Setup {
        /// KUKA KR 16-2 with a laser striper; the object stands on a table.
        Kr16Laser = "kr16_laser",
        /// KUKA omniRob: the arm holds the object before a stereo pair on a pan-tilt unit.
        OmnirobStereo = "omnirob_stereo",
    }
}

impl Setup {
    /// Its name.
    pub fn name(self) -> &'static str {
        SETUPS[self as usize]
    }
}

puffer_core::params! {
    /// What is simulated, and how fast.
    pub struct DriverParams("driver") {
        /// Robot and sensor.
        setup: Setup = Setup::Kr16Laser;
        /// Object by name (`puffer objects`), or a closed mesh file in metres.
        object: String = "coffee".to_owned();
        /// Seed of noise, outliers, drop-outs and pose errors.
        seed: usize = 0, in [0, 9007199254740991_u64];
        /// Seconds that the robot moves while a second passes on the clock on the wall.
        speed_up: f64 = 10.0, in [0.1, 1000.0];
        /// Joint states and transforms a simulated second while the robot moves.
        rate: f64 = 20.0, in [1.0, 1000.0], unit "Hz";
        /// Folder for the truth (truth.ply at the start, seen.ply at the end); empty: none is written.
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
        assert_eq!(Setup::CHOICES, SETUPS);
        assert_eq!(Setup::OmnirobStereo.name(), "omnirob_stereo");
    }
}
