//! Axis-aligned boxes.

use super::Vec3;

/// Axis-aligned box, metres. Empty when `min > max` in some axis.
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
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> Aabb {
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
