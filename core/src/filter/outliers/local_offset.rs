//! What a measurement shares with its neighbours of the same scan: an offset from the surface.

use super::surface_distance::{Deviation, MIN_SAME_SIDE_COS};
use crate::geometry::{NoiseComponents, Vec3};
use crate::voxel::CellIndex;

/// The measurements of one scan that lie on the surface, and with them its local offsets.
pub(super) struct LocalOffsets {
    feet: Vec<Vec3>,
    normals: Vec<Vec3>,
    heights: Vec<f64>,
    cells: CellIndex,
    radius: f64,
    noise: NoiseComponents,
}

impl LocalOffsets {
    /// Offsets within `radius` (metres) from the deviations of all measurements of one scan.
    pub(super) fn new(
        deviations: &[Option<Deviation>],
        radius: f64,
        noise: &NoiseComponents,
    ) -> LocalOffsets {
        let near: Vec<&Deviation> =
            deviations.iter().flatten().filter(|d| d.is_on_surface(noise)).collect();
        let feet: Vec<Vec3> = near.iter().map(|d| d.foot).collect();
        LocalOffsets {
            cells: CellIndex::new(&feet, radius),
            feet,
            normals: near.iter().map(|d| d.normal).collect(),
            heights: near.iter().map(|d| d.height).collect(),
            radius,
            noise: *noise,
        }
    }

    /// How many standard deviations a measurement is off the surface, or off the offset that it
    /// shares with its neighbours, whichever is more.
    ///
    /// With n neighbours of mean height h, the best prediction of the measurement's height (Searle,
    /// Casella, McCulloch 1992, ch. 7) and the variance of its error are
    ///
    /// ```text
    /// b = s / (s + w / n) c,   expected = b h                                                  (1)
    /// variance = w + s (1 - b c)                                                               (2)
    /// ```
    ///
    /// with the white variance w, the shared variance s and the correlation c of the offsets.
    pub(super) fn score(&self, deviation: &Deviation) -> f64 {
        let from_surface = deviation.sigmas(&self.noise);
        // The measurement itself does not count as a neighbour.
        let own = f64::from(u8::from(deviation.is_on_surface(&self.noise)));
        let (mut sum, mut count) = (-own * deviation.height, -own);
        let mut lateral = Vec3::zeros();
        self.cells.for_each_within(&self.feet, &deviation.foot, self.radius, |i, _| {
            if self.normals[i].dot(&deviation.normal) >= MIN_SAME_SIDE_COS {
                sum += self.heights[i];
                count += 1.0;
                lateral += self.feet[i] - deviation.foot;
            }
        });
        if count < 1.0 {
            return from_surface;
        }
        let (white, shared) = (self.noise.white, self.noise.shared + deviation.surface_variance);
        // Neighbours on one side only share less with a measurement at the border.
        let correlation = 1.0 - (lateral / (count * self.radius)).norm_squared();
        let shrinkage = shared / (shared + white / count) * correlation; // (1)
        let expected = shrinkage * sum / count;
        let variance = white + shared * (1.0 - shrinkage * correlation); // (2)
        from_surface.max((deviation.height - expected).abs() / variance.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn deviation(x: f64, height: f64) -> Deviation {
        Deviation { foot: Vec3::new(x, 0.0, 0.0), normal: Vec3::z(), height, surface_variance: 0.0 }
    }

    #[test]
    fn a_measurement_that_shares_the_offset_of_its_neighbours_is_less_off() {
        let noise = NoiseComponents { white: 0.2, shared: 0.8 };
        // The whole scan lies two standard deviations above the surface.
        let all: Vec<Option<Deviation>> =
            (-20..=20).map(|i| Some(deviation(f64::from(i) * 1e-4, 2.0))).collect();
        let offsets = LocalOffsets::new(&all, 2e-3, &noise);
        let scores = [2.0, 0.0, -2.0].map(|height| offsets.score(&deviation(0.0, height)));
        assert!((scores[0] - 2.0).abs() < 0.01, "{scores:?}");
        assert!(scores[1] > 4.0 && scores[2] > 8.0, "{scores:?}");
        // A measurement without neighbours is compared with the surface alone.
        assert!((offsets.score(&deviation(1.0, 3.0)) - 3.0).abs() < 0.01);
    }
}
