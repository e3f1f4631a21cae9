//! What a measurement shares with its neighbours of the same scan.

use super::standing::{ONE_SIDE, Standing};
use crate::geometry::{Components, Vec3};
use crate::voxel::CellIndex;

/// The measurements of one scan that stand on the surface.
pub(super) struct Neighbours {
    feet: Vec<Vec3>,
    normals: Vec<Vec3>,
    heights: Vec<f64>,
    cells: CellIndex,
    radius: f64,
    noise: Components,
}

impl Neighbours {
    pub(super) fn new(
        standings: &[Option<Standing>],
        radius: f64,
        noise: &Components,
    ) -> Neighbours {
        let near: Vec<&Standing> =
            standings.iter().flatten().filter(|s| s.is_on_surface(noise)).collect();
        let feet: Vec<Vec3> = near.iter().map(|s| s.foot).collect();
        Neighbours {
            cells: CellIndex::new(&feet, radius),
            feet,
            normals: near.iter().map(|s| s.normal).collect(),
            heights: near.iter().map(|s| s.height).collect(),
            radius,
            noise: *noise,
        }
    }

    /// How many standard deviations a measurement is off, from the surface or from what it shares with its neighbours (best
    /// prediction of a random offset; Searle, Casella, McCulloch 1992, ch. 7), whichever is more.
    pub(super) fn off(&self, standing: &Standing) -> f64 {
        let variance = self.noise.total() + standing.surface;
        let from_surface = standing.height.abs() / variance.sqrt();
        let own = f64::from(u8::from(standing.is_on_surface(&self.noise)));
        let (mut sum, mut count) = (-own * standing.height, -own);
        let mut aside = Vec3::zeros();
        self.cells.for_each_within(&self.feet, &standing.foot, self.radius, |i, _| {
            if self.normals[i].dot(&standing.normal) >= ONE_SIDE {
                sum += self.heights[i];
                count += 1.0;
                aside += self.feet[i] - standing.foot;
            }
        });
        if count < 1.0 {
            return from_surface;
        }
        let (white, shared) = (self.noise.white, self.noise.shared + standing.surface);
        // What neighbours on one side share, a measurement at the border shares less.
        let alike = 1.0 - (aside / (count * self.radius)).norm_squared();
        let believed = shared / (shared + white / count) * alike;
        let expected = believed * sum / count;
        let variance = white + shared * (1.0 - believed * alike);
        from_surface.max((standing.height - expected).abs() / variance.sqrt())
    }
}
