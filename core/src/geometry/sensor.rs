//! Geometry of the two kinds of sensors: which rays a scan consists of.
//!
//! Sensor frames look along z, with x to the right and y down.

use super::Vec3;

/// Where a measurement's ray starts and where it goes, sensor frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorRay {
    /// Start, metres.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Where the point must be visible from as well (the other camera, or the camera of the laser),
    /// metres.
    pub second_viewpoint: Vec3,
}

/// A pair of cameras side by side along x; the sensor frame is the left one's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StereoModel {
    /// Columns and rows of the grid of points.
    pub grid: [usize; 2],
    /// Columns and rows of the images, pixels.
    pub image: [f64; 2],
    /// Horizontal field of view, radians.
    pub field_of_view: f64,
    /// Distance between the cameras, metres.
    pub baseline: f64,
    /// From the cameras to the object's middle, metres.
    pub working_distance: f64,
    /// Nearest and farthest depth measured, metres.
    pub range: [f64; 2],
}

/// A laser whose fan lies in the xz plane, carried along y by the arm; its camera stands beside it
/// along y. The sensor frame is the laser's at the middle of the sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StriperModel {
    /// Points of a profile.
    pub points: usize,
    /// Distance between the points of a profile at the working distance, metres.
    pub point_spacing: f64,
    /// Profiles of a sweep.
    pub profiles: usize,
    /// Distance between profiles, metres.
    pub profile_spacing: f64,
    /// From the laser to its camera along -y, metres.
    pub camera_offset: f64,
    /// From the laser to the object's middle, metres.
    pub working_distance: f64,
    /// Nearest and farthest depth measured, metres.
    pub range: [f64; 2],
}

/// A sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SensorModel {
    /// A stereo pair.
    Stereo(StereoModel),
    /// A swept laser striper.
    Striper(StriperModel),
}

impl StereoModel {
    /// 2 x Allied Vision Guppy Pro F-125 (1292 x 964), matched on a grid of 320 x 240.
    pub const GUPPY: StereoModel = StereoModel {
        grid: [320, 240],
        // The data sheet of the camera; 40 degrees are those of its lens.
        image: [1292.0, 964.0],
        field_of_view: 40.0 / 180.0 * std::f64::consts::PI,
        // The setup of the thesis (Wiedemann 2014, ch. 3).
        baseline: 0.1,
        working_distance: 0.65,
        range: [0.4, 1.2],
    };

    /// Focal length, pixels of the image.
    pub fn focal_length(&self) -> f64 {
        self.image[0] / 2.0 / (self.field_of_view / 2.0).tan()
    }

    /// Direction of the ray through a pixel of the grid, scaled to z = 1.
    pub fn ray(&self, column: f64, row: f64) -> Vec3 {
        let (x, y) = (self.image_offset(column, 0), self.image_offset(row, 1));
        Vec3::new(x, y, self.focal_length()) / self.focal_length()
    }

    /// Distance of a grid coordinate from the middle of the image, pixels of the image; axis 0 are
    /// the columns, axis 1 the rows.
    fn image_offset(&self, coordinate: f64, axis: usize) -> f64 {
        // Coordinates are those of the middles of the grid's pixels.
        ((coordinate + 0.5) / self.grid[axis] as f64 - 0.5) * self.image[axis]
    }
}

impl StriperModel {
    /// Micro-Epsilon scanCONTROL 2700-100 (640 points a profile), swept over 240 mm.
    pub const SCANCONTROL: StriperModel = StriperModel {
        points: 640,
        point_spacing: 0.35e-3,
        profiles: 481,
        profile_spacing: 0.5e-3,
        camera_offset: 0.12,
        working_distance: 0.3,
        range: [0.12, 0.6],
    };

    /// Start of a profile's rays, the arm following the line exactly, metres.
    pub fn origin(&self, profile: f64) -> Vec3 {
        Vec3::y() * ((profile - (self.profiles - 1) as f64 / 2.0) * self.profile_spacing)
    }

    /// Unit direction of a ray of the fan.
    pub fn ray(&self, column: f64) -> Vec3 {
        let x = (column - (self.points - 1) as f64 / 2.0) * self.point_spacing;
        Vec3::new(x, 0.0, self.working_distance).normalize()
    }
}

impl SensorModel {
    /// From the sensor to the object's middle, metres.
    pub fn working_distance(&self) -> f64 {
        match self {
            SensorModel::Stereo(s) => s.working_distance,
            SensorModel::Striper(s) => s.working_distance,
        }
    }

    /// Nearest and farthest distance measured, metres.
    pub fn range(&self) -> [f64; 2] {
        match self {
            SensorModel::Stereo(s) => s.range,
            SensorModel::Striper(s) => s.range,
        }
    }

    /// Length of the way along y that a scan sweeps, half of it on either side of the sensor frame,
    /// metres; 0 if the sensor rests.
    pub fn sweep_length(&self) -> f64 {
        match self {
            SensorModel::Stereo(_) => 0.0,
            SensorModel::Striper(s) => (s.profiles - 1) as f64 * s.profile_spacing,
        }
    }

    /// Rays of a scan, row by row: every `step`-th column of every `step`-th row, centred.
    pub fn rays(&self, step: usize) -> Vec<SensorRay> {
        let step = step.max(1);
        match self {
            SensorModel::Stereo(s) => thinned_grid(s.grid, step)
                .map(|(column, row)| SensorRay {
                    origin: Vec3::zeros(),
                    direction: s.ray(column, row).normalize(),
                    second_viewpoint: Vec3::x() * s.baseline,
                })
                .collect(),
            SensorModel::Striper(s) => thinned_grid([s.points, s.profiles], step)
                .map(|(column, row)| {
                    let origin = s.origin(row);
                    let second_viewpoint = origin - Vec3::y() * s.camera_offset;
                    SensorRay { origin, direction: s.ray(column), second_viewpoint }
                })
                .collect(),
        }
    }
}

/// Columns and rows of a grid, row by row: every `step`-th column of every `step`-th row, centred.
fn thinned_grid(size: [usize; 2], step: usize) -> impl Iterator<Item = (f64, f64)> {
    thinned_indices(size[1], step)
        .flat_map(move |row| thinned_indices(size[0], step).map(move |column| (column, row)))
}

/// Every `step`-th of `count` indices, centred.
fn thinned_indices(count: usize, step: usize) -> impl Iterator<Item = f64> {
    let kept = count.div_ceil(step);
    let first = (count - 1 - (kept - 1) * step) as f64 / 2.0;
    (0..kept).map(move |i| first + (i * step) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rays_of_a_scan_are_centred_and_cover_the_field() {
        let stereo = SensorModel::Stereo(StereoModel::GUPPY);
        let rays = stereo.rays(4);
        assert_eq!(rays.len(), 80 * 60);
        let sum: Vec3 = rays.iter().map(|r| r.direction).sum();
        assert!((sum.normalize() - Vec3::z()).norm() < 1e-12);
        let half = rays[0].direction.x.atan2(rays[0].direction.z).abs().to_degrees();
        assert!((19.5..20.0).contains(&half), "{half}");
        assert!(rays.iter().all(|r| r.second_viewpoint == Vec3::x() * 0.1));

        let striper = SensorModel::Striper(StriperModel::SCANCONTROL);
        let rays = striper.rays(8);
        assert!((striper.sweep_length() - 0.24).abs() < 1e-12);
        let ends = [rays[0].origin.y, rays[rays.len() - 1].origin.y];
        assert!((ends[0] + ends[1]).abs() < 1e-12 && ends[1] > 0.115, "{ends:?}");
        assert!(
            rays.iter().all(|r| (r.second_viewpoint - r.origin + Vec3::y() * 0.12).norm() < 1e-12)
        );
    }
}
