//! The parameters of the filter.

crate::choice! {
    /// How redundant measurements are combined.
    pub enum FilterMethod {
        /// A robust quadric through all scans' measurements.
        Weighted = "weighted",
        /// The thesis's averaging along the normals.
        Thesis = "thesis",
    }
}

crate::params! {
    /// Parameters of the filter.
    pub struct FilterParams("filter") {
        /// How redundant measurements are combined: weighted fits a quadric robustly to the
        /// measurements of all scans, thesis averages them along the normals (Wiedemann 2014).
        method: FilterMethod = FilterMethod::Weighted;
        /// Radius within which measurements are combined; 0 derives it from the point spacing and
        /// the noise of the scans.
        noise_radius: f64 = 0.0, in [0.0, 0.1], unit "m";
        /// Distance between the points of the filtered cloud; 0 derives it from the point spacing
        /// and the noise of the scans.
        reduction_radius: f64 = 0.0, in [0.0, 0.1], unit "m";
        /// Largest angle between the normals of measurements that are combined.
        max_normal_angle: f64 = 0.785, in [0.0, 3.15], unit "rad";
        /// Least number of measurements that support a point of the filtered cloud.
        min_measurements: usize = 6, in [1, 1000000];
    }
}
