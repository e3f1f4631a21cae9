//! The parameters of the registration, resolved.

use super::params::{
    Kernel, Matching, RegisterParams, RegistrationMethod, Rejection, Selection, Weight,
};

/// What the registration does: the consequences of the method that the parameters name. The
/// parameters are what a user wrote, this is what the algorithms ask.
#[derive(Clone, Debug)]
pub(crate) struct Strategy {
    /// The parameters that it was made from, for their numbers only.
    pub params: RegisterParams,
    /// Stage 1 of ICP: which points of a scan are aligned.
    pub selection: Selection,
    /// Stage 2: which point of the map a point of the scan should lie on.
    pub matching: Matching,
    /// Stage 3: what a pair of points counts for before the robust kernel.
    pub weight: Weight,
    /// The robust kernel.
    pub kernel: Kernel,
    /// Stage 4: which pairs are rejected.
    pub rejection: Rejection,
    /// Stage 5: which error is minimised.
    pub metric: Metric,
    /// Whether the robot's pose counts as a measurement (maximum a posteriori).
    pub uses_prior: bool,
    /// Whether the search radius shrinks while a scan is aligned.
    pub shrinks_radius: bool,
    /// Whether a subsample is aligned first, and all points only from where it has led.
    pub aligns_subsample_first: bool,
    /// Whether an alignment is examined beyond its number of correspondences: convergence,
    /// correction, residual, overlap, observability, second layers and ambiguity.
    pub examines_alignments: bool,
    /// Whether scans may be registered to each other before they overlap with the first scan's map.
    pub may_start_elsewhere: bool,
    /// Whether all accepted scans are optimised together at the end.
    pub joint: bool,
}

/// The error that the alignment minimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Metric {
    /// Weighted residuals with a robust kernel, scaled by their own spread.
    Weighted(ResidualKind),
    /// The thesis's: the plain sum of squared distances between points.
    SquaredDistances,
}

/// The residual of a pair of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ResidualKind {
    /// The distance along the normal halfway between the two points' normals.
    PointToPlane,
    /// The vector between the points.
    PointToPoint,
    /// The vector between the points, uncertain within both of their planes.
    PlaneToPlane,
}

impl Strategy {
    /// What `params` ask for; the thesis's method has its own choices for the stages of ICP.
    pub(crate) fn new(params: &RegisterParams) -> Strategy {
        let residual = match params.method {
            RegistrationMethod::PointToPlane => ResidualKind::PointToPlane,
            RegistrationMethod::PointToPoint => ResidualKind::PointToPoint,
            RegistrationMethod::PlaneToPlane => ResidualKind::PlaneToPlane,
            RegistrationMethod::Thesis => return Strategy::thesis(params),
        };
        Strategy {
            params: params.clone(),
            selection: params.selection,
            matching: params.matching,
            weight: params.weight,
            kernel: params.kernel,
            rejection: params.rejection,
            metric: Metric::Weighted(residual),
            uses_prior: true,
            shrinks_radius: true,
            aligns_subsample_first: true,
            examines_alignments: true,
            may_start_elsewhere: true,
            joint: params.joint,
        }
    }

    /// Wiedemann 2014, §2.3.1.
    fn thesis(params: &RegisterParams) -> Strategy {
        Strategy {
            params: params.clone(),
            selection: Selection::Uniform,
            matching: Matching::Closest,
            weight: Weight::Constant,
            kernel: Kernel::None,
            rejection: Rejection::Normals,
            metric: Metric::SquaredDistances,
            uses_prior: false,
            shrinks_radius: false,
            aligns_subsample_first: false,
            examines_alignments: false,
            may_start_elsewhere: false,
            joint: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_thesis_s_method_overrides_the_choices_of_the_stages() {
        let chosen = RegisterParams {
            selection: Selection::All,
            matching: Matching::Projective,
            weight: Weight::Mad,
            kernel: Kernel::Cauchy,
            rejection: Rejection::Boundary,
            ..RegisterParams::default()
        };
        let strategy = Strategy::new(&chosen);
        assert_eq!(strategy.selection, Selection::All);
        assert_eq!(strategy.rejection, Rejection::Boundary);
        assert!(strategy.uses_prior && strategy.joint);
        let thesis =
            Strategy::new(&RegisterParams { method: RegistrationMethod::Thesis, ..chosen });
        assert_eq!(thesis.selection, Selection::Uniform);
        assert_eq!(thesis.matching, Matching::Closest);
        assert_eq!(thesis.kernel, Kernel::None);
        assert_eq!(thesis.rejection, Rejection::Normals);
        assert_eq!(thesis.metric, Metric::SquaredDistances);
        assert!(!thesis.uses_prior && !thesis.joint);
    }

    #[test]
    fn the_joint_optimisation_can_be_switched_off() {
        let params = RegisterParams { joint: false, ..RegisterParams::default() };
        assert!(!Strategy::new(&params).joint);
    }
}
