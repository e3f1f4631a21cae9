//! Raw scans and oriented clouds.

use super::Vec3;
use crate::{Error, Result};

/// One raw scan in the sensor frame (z forward, x right, y down), metres.
///
/// Stored in single precision, as sensors deliver it. In an organised scan (`width` > 0) the points
/// stand row by row and NaN means "no return"; in an unorganised one `width` is 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scan {
    /// Points, metres.
    pub points: Vec<[f32; 3]>,
    /// Points in a row; 0 if the scan is not organised.
    pub width: usize,
    /// Where each point's ray started (empty: at the origin of the sensor frame), metres.
    pub origins: Vec<[f32; 3]>,
}

impl Scan {
    /// Number of rows of an organised scan, 0 otherwise.
    pub fn height(&self) -> usize {
        self.points.len().checked_div(self.width).unwrap_or(0)
    }

    /// The point at `index`, if there was a return.
    pub fn point(&self, index: usize) -> Option<Vec3> {
        let p = self.points.get(index)?;
        p.iter().all(|v| v.is_finite()).then(|| to_vec3(p))
    }

    /// The start of the ray of point `index`.
    pub fn origin(&self, index: usize) -> Vec3 {
        self.origins.get(index).map_or_else(Vec3::zeros, to_vec3)
    }

    /// Indices of all points with a return.
    pub fn returns(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.points.len()).filter(|&i| self.points[i].iter().all(|v| v.is_finite()))
    }
}

/// A single-precision point in double precision.
fn to_vec3(p: &[f32; 3]) -> Vec3 {
    Vec3::new(p[0].into(), p[1].into(), p[2].into())
}

/// Least thickness of a cloud, relative to its extent: thinner ones lie in a plane.
const MIN_THICKNESS_RATIO: f64 = 1e-4;

/// Oriented points: position, outward unit normal, standard deviation along it, number of
/// supporting scans.
///
/// All vectors have the same length. `sigma` is in metres, NaN where unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// Positions, metres, object frame.
    pub points: Vec<Vec3>,
    /// Outward unit normals.
    pub normals: Vec<Vec3>,
    /// Standard deviation along the normal, metres.
    pub sigma: Vec<f64>,
    /// Number of scans that saw the point.
    pub support: Vec<u16>,
}

impl Cloud {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Appends a point.
    pub fn push(&mut self, point: Vec3, normal: Vec3, sigma: f64, support: u16) {
        self.points.push(point);
        self.normals.push(normal);
        self.sigma.push(sigma);
        self.support.push(support);
    }

    /// Appends all points of `other`.
    pub fn extend(&mut self, other: &Cloud) {
        self.points.extend_from_slice(&other.points);
        self.normals.extend_from_slice(&other.normals);
        self.sigma.extend_from_slice(&other.sigma);
        self.support.extend_from_slice(&other.support);
    }

    /// The points at `indices`, in that order.
    pub fn select(&self, indices: &[usize]) -> Cloud {
        let mut selected = Cloud::default();
        for &i in indices {
            selected.push(self.points[i], self.normals[i], self.sigma[i], self.support[i]);
        }
        selected
    }

    /// The cloud as files and messages hold it, so that every way from the points to a mesh gives
    /// the same bytes.
    pub fn to_single_precision(mut self) -> Cloud {
        for vector in self.points.iter_mut().chain(&mut self.normals) {
            *vector = vector.map(|v| f64::from(v as f32));
        }
        for sigma in &mut self.sigma {
            *sigma = f64::from(*sigma as f32);
        }
        self
    }

    /// Checks that a surface can be made of the cloud.
    ///
    /// # Errors
    /// [`Error::Input`] if there are fewer than `min_points` points or all lie in one plane or
    /// line.
    pub fn check_volume(&self, min_points: usize) -> Result<()> {
        if self.len() < min_points {
            return Err(Error::input(format!(
                "the cloud has {} usable points; a surface needs at least {min_points}: scan more of the object \
                 or loosen the filter",
                self.len()
            )));
        }
        let flat = super::fit_plane(self.points.iter().map(|p| (*p, 1.0))).is_none_or(|fit| {
            fit.variances[0].sqrt() < MIN_THICKNESS_RATIO * fit.variances[2].sqrt()
        });
        if flat {
            return Err(Error::input(
                "all points lie in one plane or line: no volume can be enclosed; add scans from other sides",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square sheet of 10 x 10 points, of which one lies `height` above the others.
    fn sheet(height: f64) -> Cloud {
        let mut cloud = Cloud::default();
        for i in 0..100 {
            let z = if i == 44 { height } else { 0.0 };
            cloud.push(Vec3::new(f64::from(i % 10), f64::from(i / 10), z), Vec3::z(), 1e-4, 1);
        }
        cloud
    }

    #[test]
    fn points_without_a_return_are_none() {
        let points = vec![[1.0, 2.0, 3.0], [f32::NAN, 0.0, 0.0]];
        let scan = Scan { points, width: 2, origins: vec![[0.5, 0.0, 0.0]] };
        assert_eq!(scan.point(0), Some(Vec3::new(1.0, 2.0, 3.0)));
        assert_eq!((scan.point(1), scan.point(2)), (None, None));
        assert_eq!(scan.returns().collect::<Vec<_>>(), [0]);
        assert_eq!((scan.height(), scan.origin(0).x, scan.origin(1).x), (1, 0.5, 0.0));
    }

    #[test]
    fn single_precision_rounds_all_but_the_support() {
        let mut cloud = Cloud::default();
        cloud.push(Vec3::new(0.1, 0.2, 0.3), Vec3::z(), 0.1, 7);
        let rounded = cloud.to_single_precision();
        assert_eq!(rounded.points[0].x, f64::from(0.1_f32));
        assert_eq!((rounded.sigma[0], rounded.support[0]), (f64::from(0.1_f32), 7));
    }

    #[test]
    fn a_plane_and_too_few_points_enclose_no_volume() {
        assert!(sheet(0.0).check_volume(50).unwrap_err().to_string().contains("plane"));
        assert!(sheet(0.0).check_volume(101).unwrap_err().to_string().contains("100 usable"));
        assert!(sheet(1.0).check_volume(50).is_ok());
    }
}
