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
        let from_surface = standing.off(&self.noise);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_lies_where_its_neighbours_do_is_less_off_than_who_does_not() {
        let noise = Components { white: 0.2, shared: 0.8 };
        let standing = |x: f64, height: f64| Standing {
            foot: Vec3::new(x, 0.0, 0.0),
            normal: Vec3::z(),
            height,
            surface: 0.0,
        };
        // The whole scan lies two deviations above the surface.
        let all: Vec<Option<Standing>> =
            (-20..=20).map(|i| Some(standing(f64::from(i) * 1e-4, 2.0))).collect();
        let neighbours = Neighbours::new(&all, 2e-3, &noise);
        let off = |height: f64| neighbours.off(&standing(0.0, height));
        assert!((off(2.0) - 2.0).abs() < 0.01, "{}", off(2.0));
        assert!(off(0.0) > 4.0 && off(-2.0) > 8.0, "{} {}", off(0.0), off(-2.0));
        // Alone it is measured by the surface.
        assert!((neighbours.off(&standing(1.0, 3.0)) - 3.0).abs() < 0.01);
    }
}
