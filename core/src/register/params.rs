//! The parameters of the registration.

crate::choice! {
    /// How scans are aligned.
    pub enum RegistrationMethod {
        /// The distance along the normal halfway between the two points' (Chen & Medioni 1992;
        /// Rusinkiewicz 2019), with the robot's pose as prior.
        PointToPlane = "point_to_plane",
        /// The distance between the two points (Besl & McKay 1992), with the robot's pose as prior.
        PointToPoint = "point_to_point",
        /// Generalized ICP (Segal, Haehnel & Thrun 2009): both points are uncertain within their
        /// planes; with the robot's pose as prior.
        PlaneToPlane = "plane_to_plane",
        /// The thesis's: point-to-point within a fixed radius, normals compared, no prior.
        Thesis = "thesis",
    }
}

crate::choice! {
    /// Which points of a scan are aligned.
    pub enum Selection {
        /// Every point (Besl & McKay 1992).
        All = "all",
        /// Points drawn at random (Masuda, Sakaue & Yokoya 1996).
        Random = "random",
        /// One point a cell of a grid (Turk & Levoy 1994).
        Uniform = "uniform",
        /// Points whose normals are spread as evenly as they can be (Rusinkiewicz & Levoy 2001), so
        /// that the few that hold a sliding direction count.
        NormalSpace = "normal_space",
        /// As uniform, a sixteenth at first and twice as many in each iteration (Turk & Levoy 1994,
        /// Zhang 1994).
        CoarseToFine = "coarse_to_fine",
    }
}

crate::choice! {
    /// Which point of the map a point of the scan should lie on.
    pub enum Matching {
        /// The closest (Besl & McKay 1992).
        Closest = "closest",
        /// The closest, if of the scan's points this one is the closest to it (Pajdla & Van Gool
        /// 1995).
        Mutual = "mutual",
        /// Where the point's ray meets the map: the ray is intersected with the tangent planes of
        /// closest points in turn (Chen & Medioni 1992, §3.2, there along the normal).
        Projective = "projective",
    }
}

crate::choice! {
    /// What each correspondence counts for before the robust kernel.
    pub enum Weight {
        /// All the same.
        Constant = "constant",
        /// 1 - d / d_max for points d apart (Godin, Rioux & Baribeau 1994).
        Distance = "distance",
        /// The cosine between the normals (Rusinkiewicz & Levoy 2001).
        Normals = "normals",
        /// The inverse variance of a triangulating sensor: its standard deviation grows with the
        /// square of the distance and with 1 / cos of the angle of incidence (Turk & Levoy 1994;
        /// Curless & Levoy 1996).
        SensorNoise = "sensor_noise",
        /// One minus the deviation of d from its median, in units of its median absolute deviation
        /// scaled to a standard deviation and counted to three; beyond, nothing.
        Mad = "mad",
    }
}

crate::choice! {
    /// What residuals count for beside smaller ones.
    pub enum Kernel {
        /// Least squares.
        None = "none",
        /// Tukey's biweight: nothing beyond 4.685 standard deviations.
        Tukey = "tukey",
        /// Huber's: least squares to 1.345 standard deviations, least absolute deviations beyond.
        Huber = "huber",
        /// Cauchy's (Lorentzian), 2.385 standard deviations wide.
        Cauchy = "cauchy",
    }
}

crate::choice! {
    /// Which pairs within the search radius are rejected.
    pub enum Rejection {
        /// None: the search radius is the fixed threshold.
        Distance = "distance",
        /// Those whose normals differ by more than `max_normal_angle` (Zhang 1994). All choices
        /// below reject these too.
        Normals = "normals",
        /// Those farther apart than 2.5 standard deviations of the distances (Masuda, Sakaue &
        /// Yokoya 1996).
        Sigma = "sigma",
        /// The share `trim` that lies farthest apart (Pulli 1999; Chetverikov, Stepanov & Krsek
        /// 2005).
        Trimmed = "trimmed",
        /// Those whose point of the map lies at the border of the scans (Turk & Levoy 1994).
        Boundary = "boundary",
    }
}

crate::params! {
    /// Parameters of the registration.
    pub struct RegisterParams("register") {
        /// How scans are aligned to each other; `thesis` overrides the choices for the stages of
        /// ICP (selection, matching, weight, kernel, rejection) with its own.
        method: RegistrationMethod = RegistrationMethod::PointToPlane;
        /// Stage 1 of ICP, selection: which points of a scan are aligned.
        selection: Selection = Selection::Uniform;
        /// Stage 2 of ICP, matching: which point of the map a point of the scan should lie on.
        matching: Matching = Matching::Closest;
        /// Stage 3 of ICP, weighting: what a pair of points counts for.
        weight: Weight = Weight::Constant;
        /// Robust kernel of the alignment: what large residuals count for beside small ones.
        kernel: Kernel = Kernel::Tukey;
        /// Stage 4 of ICP, rejection: which pairs of points within the search radius do not count.
        rejection: Rejection = Rejection::Normals;
        /// Share of the pairs of points, those farthest apart, that `rejection: trimmed` rejects.
        trim: f64 = 0.1, in [0.0, 0.9];
        /// Seed of the random numbers with which points are selected.
        seed: usize = 1, in [0, 1000000];
        /// Search radius for pairs of points at the start of an alignment; 0 takes it from the
        /// standard deviation of the robot's pose.
        radius: f64 = 0.0, in [0.0, 1.0], unit "m";
        /// Pairs of points whose normals differ by more than this angle are rejected.
        max_normal_angle: f64 = 0.785, in [0.0, 3.15], unit "rad";
        /// A scan of which fewer points find a point of the map is deferred.
        min_correspondences: usize = 100, in [6, 1000000];
        /// A scan of which a smaller share of points lies on the map is deferred.
        min_overlap: f64 = 0.1, in [0.0, 1.0];
        /// Number of points of each scan that are aligned.
        samples: usize = 2000, in [50, 1000000];
        /// Maximum number of iterations of one alignment.
        max_iterations: usize = 60, in [1, 1000];
        /// Maximum number of times that a deferred scan is tried again.
        max_rounds: usize = 5, in [1, 100];
        /// What a pair of points counts for beside the robot's pose while scans are aligned one by
        /// one; below 1 because neighbouring points share their noise. In the joint optimisation
        /// what they share is estimated from the residuals and taken out.
        information_share: f64 = 0.05, in [0.0001, 1.0];
        /// A scan that is corrected by more than this many standard deviations of the robot's pose
        /// is deferred, and refused if that does not change.
        max_correction: f64 = 3.0, in [0.5, 100.0];
        /// A scan whose residual exceeds what noise explains by this factor is deferred: its points
        /// belong to another surface than the map's.
        max_residual: f64 = 2.2, in [1.0, 100.0];
        /// Whether the poses of all accepted scans are optimised together at the end.
        joint: bool = true;
        /// Maximum number of passes of the joint optimisation, each with new correspondences.
        joint_iterations: usize = 12, in [1, 1000];
    }
}
