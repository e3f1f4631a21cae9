//! The kinds of sensors that differ in their noise.

/// The family of noise that a sensor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorKind {
    /// Laser triangulation, profile by profile.
    Laser,
    /// Stereo camera.
    Stereo,
}

impl SensorKind {
    /// The word for this kind in files.
    pub fn word(self) -> &'static str {
        match self {
            SensorKind::Laser => "laser",
            SensorKind::Stereo => "stereo",
        }
    }

    /// The kind with this word in files.
    pub fn from_word(word: &str) -> Option<SensorKind> {
        [SensorKind::Laser, SensorKind::Stereo].into_iter().find(|kind| kind.word() == word)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_has_a_word_of_its_own() {
        for kind in [SensorKind::Laser, SensorKind::Stereo] {
            assert_eq!(SensorKind::from_word(kind.word()), Some(kind));
        }
        assert_eq!(SensorKind::from_word("Laser"), None);
    }
}
