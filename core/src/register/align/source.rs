//! The points of a scan that is aligned to the map.

use crate::geometry::Vec3;

/// Selected points of the scan that is aligned, in its sensor frame.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    /// Metres.
    pub points: &'a [Vec3],
    /// Unit normals, towards the sensor.
    pub normals: &'a [Vec3],
    /// Unit vectors along the rays, away from the sensor.
    pub rays: &'a [Vec3],
    /// Standard deviation of a point-to-plane residual, metres.
    pub noise: f64,
}

impl<'a> Source<'a> {
    /// The first `count` points.
    pub(crate) fn first(&self, count: usize) -> Source<'a> {
        Source {
            points: &self.points[..count],
            normals: &self.normals[..count],
            rays: &self.rays[..count],
            noise: self.noise,
        }
    }

    /// Every `stride`-th point.
    pub(crate) fn every(&self, stride: usize) -> SourceSubset {
        SourceSubset {
            points: self.points.iter().copied().step_by(stride).collect(),
            normals: self.normals.iter().copied().step_by(stride).collect(),
            rays: self.rays.iter().copied().step_by(stride).collect(),
        }
    }
}

/// Some of the points of a scan.
pub(crate) struct SourceSubset {
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    rays: Vec<Vec3>,
}

impl SourceSubset {
    /// The points to be aligned, with residuals of standard deviation `noise` (metres).
    pub(crate) fn source(&self, noise: f64) -> Source<'_> {
        Source { points: &self.points, normals: &self.normals, rays: &self.rays, noise }
    }
}
