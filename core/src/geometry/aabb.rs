//! Axis-aligned boxes.

use super::Vec3;

/// Axis-aligned box, metres. Empty when `min > max` in some axis.
///
/// ```
/// use puffer_core::geometry::{Aabb, Vec3};
///
/// let corners = [Vec3::zeros(), Vec3::new(0.1, 0.2, 0.3)];
/// let aabb = Aabb::from_points(&corners);
/// assert_eq!(aabb.extent(), corners[1]);
/// assert!(!aabb.contains(&Vec3::new(0.0, 0.0, 0.4)));
/// assert!(aabb.padded(0.2).contains(&Vec3::new(0.0, 0.0, 0.4)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Corner with the smallest coordinates.
    pub min: Vec3,
    /// Corner with the largest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// The empty box: holds nothing, and grows to whatever is put in.
    pub const EMPTY: Aabb = Aabb {
        min: Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        max: Vec3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    /// The smallest box round `points`.
    pub fn from_points<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> Aabb {
        let mut aabb = Aabb::EMPTY;
        for point in points {
            aabb.insert(point);
        }
        aabb
    }

    /// Grows to hold `point`.
    pub fn insert(&mut self, point: &Vec3) {
        self.min = self.min.inf(point);
        self.max = self.max.sup(point);
    }

    /// Edge lengths; zero for an empty box.
    pub fn extent(&self) -> Vec3 {
        (self.max - self.min).sup(&Vec3::zeros())
    }

    /// Length of the space diagonal; zero for an empty box.
    pub fn diagonal(&self) -> f64 {
        self.extent().norm()
    }

    /// Middle of the box.
    pub fn center(&self) -> Vec3 {
        (self.min + self.max) / 2.0
    }

    /// The box with `margin` added on every side.
    pub fn padded(&self, margin: f64) -> Aabb {
        Aabb { min: self.min.add_scalar(-margin), max: self.max.add_scalar(margin) }
    }

    /// Whether `point` lies inside or on the border.
    pub fn contains(&self, point: &Vec3) -> bool {
        (0..3).all(|i| self.min[i] <= point[i] && point[i] <= self.max[i])
    }

    /// Whether the two boxes share at least one point.
    pub fn intersects(&self, other: &Aabb) -> bool {
        (0..3).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_holds_the_points_that_it_was_made_of() {
        let points = [Vec3::new(1.0, -2.0, 0.5), Vec3::new(-1.0, 4.0, 0.5)];
        let aabb = Aabb::from_points(&points);
        assert_eq!((aabb.min, aabb.max), (Vec3::new(-1.0, -2.0, 0.5), Vec3::new(1.0, 4.0, 0.5)));
        assert_eq!(
            (aabb.center(), aabb.extent()),
            (Vec3::new(0.0, 1.0, 0.5), Vec3::new(2.0, 6.0, 0.0))
        );
        assert!(points.iter().all(|p| aabb.contains(p)));
        assert!(!aabb.contains(&Vec3::new(0.0, 0.0, 0.6)));
        assert!(aabb.padded(0.2).contains(&Vec3::new(0.0, 0.0, 0.6)));
    }

    #[test]
    fn boxes_that_touch_intersect_and_the_empty_one_meets_nothing() {
        let unit = Aabb::from_points(&[Vec3::zeros(), Vec3::repeat(1.0)]);
        let beside = Aabb::from_points(&[Vec3::x(), Vec3::repeat(2.0)]);
        assert!(unit.intersects(&beside) && !unit.padded(-0.1).intersects(&beside));
        assert!(!Aabb::EMPTY.intersects(&unit) && !Aabb::EMPTY.contains(&Vec3::zeros()));
        assert_eq!((Aabb::EMPTY.extent(), Aabb::EMPTY.diagonal()), (Vec3::zeros(), 0.0));
    }
}
