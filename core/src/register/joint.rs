//! Joint optimisation of all accepted scans: each is held to the surface that all share, and to the robot's pose
//! (multi-view registration; Pulli 1999 for the problem, Barfoot 2017 for the perturbations). No scan is fixed, so
//! that the error is spread and the priors alone place the whole.
//!
//! The height of each patch of the surface is an unknown of its own, eliminated in `equations`:
//! each measurement counts once, however many scans saw the same place. What neighbouring
//! measurements of one scan share in noise is learnt from the residuals (`correlation`) and taken
//! out (`whiten`). What only the noise of normals pretends to know is left to the priors (`trust`).

use super::correlation::{Correlation, Residuals};
use super::equations::{Row, reduced};
use super::sample::Sample;
use super::surfels::{OnSurfel, Surfels, Term, terms};
use super::trust::{Seen, SharedNoise, Trust};
use super::verdict::Status;
use super::whiten::{WhiteRow, whiten};
use super::{RegisterParams, Registration};
use crate::geometry::{Mat6, Pose, Twist, Vec3, exp, log, median};
use crate::{Error, Progress, Result};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// The search radius shrinks to its end by this factor a pass.
const SHRINK: f64 = 0.6;
/// A step below this many standard deviations of a pose ends the search: surfels laid anew move
/// poses by a third of it.
const SMALL_STEP: f64 = 0.5;
/// Steps at the finest scale are this much longer (over-relaxation; below 2 it converges).
const RELAXATION: f64 = 1.7;
/// Surfels along the diagonal of the largest scan at most: finer ones cost time and tell nothing new.
const FINEST: f64 = 64.0;

/// How far from the optimum the poses may still be.
#[derive(Clone, Copy)]
pub(crate) enum Start {
    /// By the errors that scans had when they were placed one by one.
    Coarse,
    /// Only a few have moved.
    Fine,
}

/// Moves the poses of all accepted scans to their joint optimum.
pub(crate) fn optimise(
    samples: &[Sample],
    robot: &[Pose],
    registration: &mut Registration,
    start: Start,
    params: &RegisterParams,
    progress: &Progress,
) -> Result<()> {
    let members = accepted(samples, registration);
    if members.len() < 2 {
        return Ok(());
    }
    let mut poses: Vec<Pose> = members.iter().map(|&i| registration.poses[i]).collect();
    let prior = registration.pose_sigma.information();
    let scans: Vec<&Sample> = members.iter().map(|&i| &samples[i]).collect();
    let end = Scale::finest(&scans);
    let mut now = match start {
        Start::Coarse => end.coarser(4.0),
        Start::Fine => end,
    };
    let mut hessian = DMatrix::zeros(0, 0);
    let mut passed: Vec<Vec<Pose>> = Vec::new();
    for pass in 0..params.joint_iterations {
        progress.report("optimise", pass as f64 / params.joint_iterations as f64)?;
        let at_end = now.reach <= end.reach;
        let found = Measured::new(&scans, &poses, now, at_end, params);
        let (geometry, mut gradient) = found.system()?;
        let mut stiffness = geometry.clone();
        hessian = geometry;
        if at_end {
            let trust = found.trust(&poses, &prior, now.edge).ok_or_else(singular)?;
            gradient = trust.gradient(&gradient);
            stiffness = trust.stiffness(&hessian);
            hessian = trust.information(&hessian);
            // New surfels follow the scans that they are made of: a full step goes a part of the
            // way only. The prior stays.
            if pass + 1 < params.joint_iterations {
                stiffness /= RELAXATION;
            }
        }
        for (k, pose) in poses.iter().enumerate() {
            let mut block = hessian.fixed_view_mut::<6, 6>(6 * k, 6 * k);
            block += prior;
            let mut block = stiffness.fixed_view_mut::<6, 6>(6 * k, 6 * k);
            block += prior;
            let mut rows = gradient.fixed_rows_mut::<6>(6 * k);
            rows += prior * log(&(robot[members[k]].inverse() * pose));
        }
        let solver = stiffness.cholesky().ok_or_else(singular)?;
        let step = solver.solve(&-gradient);
        let mut moved = 0.0_f64;
        for (k, pose) in poses.iter_mut().enumerate() {
            let xi: Twist = step.fixed_rows::<6>(6 * k).into_owned();
            let block: Mat6 = hessian.fixed_view::<6, 6>(6 * k, 6 * k).into_owned();
            moved = moved.max(xi.dot(&(block * xi)).sqrt());
            *pose *= exp(&xi);
        }
        if at_end && moved < SMALL_STEP {
            passed.clear();
            break;
        }
        if at_end && 2 * pass >= params.joint_iterations {
            passed.push(poses.clone());
        }
        now = now.finer(&end);
    }
    average(&mut poses, &passed);
    let covariance = hessian.cholesky().map(|c| c.inverse());
    for (k, &i) in members.iter().enumerate() {
        registration.poses[i] = poses[k];
        if let Some(covariance) = &covariance {
            registration.verdicts[i].covariance =
                covariance.fixed_view::<6, 6>(6 * k, 6 * k).into_owned();
        }
    }
    Ok(())
}

/// Moves `poses` to the mean of all that were `passed`, as far as there are any. With surfels laid
/// anew in each pass, the steps are noisy: where the geometry tells little, poses wander about their
/// optimum, and their mean is nearer to it (Polyak & Juditsky 1992, Acceleration of Stochastic
/// Approximation by Averaging).
fn average(poses: &mut [Pose], passed: &[Vec<Pose>]) {
    if passed.is_empty() {
        return;
    }
    for (k, pose) in poses.iter_mut().enumerate() {
        let away: Twist = passed.iter().map(|poses| log(&(pose.inverse() * poses[k]))).sum();
        *pose *= exp(&(away / passed.len() as f64));
    }
}

fn singular() -> Error {
    Error::input("the joint registration is singular: is a pose sigma infinite?")
}

fn accepted(samples: &[Sample], registration: &Registration) -> Vec<usize> {
    (0..samples.len()).filter(|&i| registration.verdicts[i].status == Status::Accepted).collect()
}

/// How finely the surface is looked at.
#[derive(Clone, Copy)]
struct Scale {
    /// Distance between surfels, metres.
    edge: f64,
    /// How far off a measurement may lie, metres.
    reach: f64,
}

impl Scale {
    fn finest(scans: &[&Sample]) -> Scale {
        let typical =
            |f: fn(&Sample) -> f64| median(scans.iter().map(|s| f(s)).collect()).unwrap_or(1e-3);
        let extent = scans.iter().map(|s| s.extent).fold(0.0, f64::max);
        let edge = (2.5 * typical(|s| s.target_spacing)).max(3.0 * typical(|s| s.noise));
        let edge = edge.max(extent / FINEST);
        Scale { edge, reach: edge.max(6.0 * typical(|s| s.noise)) }
    }

    fn coarser(self, factor: f64) -> Scale {
        Scale { edge: self.edge * factor, reach: self.reach * factor }
    }

    fn finer(self, end: &Scale) -> Scale {
        Scale {
            edge: (self.edge * SHRINK).max(end.edge),
            reach: (self.reach * SHRINK).max(end.reach),
        }
    }
}

/// All scans' measurements of the common surface.
struct Measured {
    surfels: Surfels,
    /// One list a scan.
    terms: Vec<Vec<Term>>,
    /// Measurements of places that other scans saw too.
    redundant: usize,
    /// Robust standard deviation of a point about the surface, metres.
    scale: f64,
    /// Variance of a measurement of `n` points: `between + within / n`, square metres.
    between: f64,
    within: f64,
    /// What a measurement counts for beside the priors, and what its neighbours share with it.
    share: f64,
    correlation: Correlation,
    /// Within how far the points around one have a say in its normal, metres.
    normal_radius: f64,
}

impl Measured {
    fn new(
        scans: &[&Sample],
        poses: &[Pose],
        at: Scale,
        at_end: bool,
        params: &RegisterParams,
    ) -> Measured {
        let cosine = params.max_normal_angle.cos();
        let views: Vec<(&Sample, Pose)> =
            scans.iter().copied().zip(poses.iter().copied()).collect();
        let surfels = Surfels::new(&views, at.edge, cosine);
        let floor = median(scans.iter().map(|s| s.noise).collect()).unwrap_or(1e-6) / 2.0;
        let met: Vec<Vec<OnSurfel>> = views
            .par_iter()
            .map(|(sample, pose)| surfels.met(sample, pose, at.reach, cosine))
            .collect();
        let look = |scale: f64| -> Vec<Vec<Term>> {
            met.par_iter().map(|met| terms(met, scale)).collect()
        };
        let count = surfels.centers.len();
        // First everything in reach, to learn how large the residuals are.
        let scale = spread(&look(at.reach), count).max(floor);
        let mut terms = look(scale);
        let heights = heights(&terms, count);
        let (between, within) = variances(&terms, &heights, floor);
        let redundant = deviations(&terms, &heights).count();
        for term in terms.iter_mut().flatten() {
            term.residual -= heights[term.surfel as usize].0;
        }
        let mut found = Measured {
            surfels,
            terms,
            redundant,
            scale,
            between,
            within,
            share: params.information_share,
            correlation: Correlation::NONE,
            normal_radius: median(scans.iter().map(|s| s.normal_radius).collect()).unwrap_or(0.0),
        };
        if at_end {
            let residuals: Vec<Residuals> =
                found.terms.iter().map(|t| found.residuals(t)).collect();
            found.correlation = Correlation::learn(&residuals, at.edge);
            found.share = 1.0;
        }
        found
    }

    /// The inverse of a measurement's standard deviation, 1 / metres.
    fn precision(&self, term: &Term) -> f64 {
        (self.share / (self.between + self.within / term.weight)).sqrt()
    }

    fn residuals(&self, terms: &[Term]) -> Residuals {
        let value = terms.iter().map(|t| t.residual * self.precision(t)).collect();
        Residuals { at: across(terms), value }
    }

    /// Hessian and gradient by the poses of the geometry's half squared error.
    fn system(&self) -> Result<(DMatrix<f64>, DVector<f64>)> {
        let rows: Vec<Vec<Row>> = self.terms.par_iter().map(|terms| self.rows(terms)).collect();
        reduced(&rows, self.surfels.centers.len())
    }

    /// How far the geometry is to be trusted; surfels lie `edge` (metres) apart.
    fn trust(&self, poses: &[Pose], prior: &Mat6, edge: f64) -> Option<Trust> {
        let of_normals = self.correlation.of_normals(self.normal_radius);
        let noise = SharedNoise {
            rho: self.correlation.share,
            independent: of_normals.independent_share(edge),
        };
        Trust::new(&self.seen(), poses, prior, noise)
    }

    /// What each scan saw of each surfel, by surfel.
    fn seen(&self) -> Vec<Seen> {
        let of_term = |(scan, term): (usize, &Term)| Seen {
            surfel: term.surfel,
            scan,
            weight: self.precision(term).powi(2),
            center: self.surfels.centers[term.surfel as usize],
            own: term.normal,
            shared: self.surfels.normals[term.surfel as usize],
        };
        let terms = self.terms.iter().enumerate();
        let terms = terms.flat_map(|(scan, terms)| terms.iter().map(move |term| (scan, term)));
        let mut seen: Vec<Seen> = terms.map(of_term).collect();
        seen.sort_by_key(|s| (s.surfel, s.scan));
        seen
    }

    /// The equations of one scan, their noise white.
    fn rows(&self, terms: &[Term]) -> Vec<Row> {
        let equation = |white: WhiteRow| {
            let mut row = Row { jacobian: Twist::zeros(), residual: 0.0, heights: Vec::new() };
            for (index, coefficient) in white.terms {
                let term = &terms[index];
                let factor = coefficient * self.precision(term);
                row.jacobian += term.jacobian * factor;
                row.residual += term.residual * factor;
                row.heights.push((term.surfel, factor));
            }
            row
        };
        whiten(&across(terms), &self.correlation).into_iter().map(equation).collect()
    }
}

/// Where a scan's measurements lie across its line of sight, metres.
fn across(terms: &[Term]) -> Vec<Vec3> {
    let ray = terms.iter().map(|t| t.at).sum::<Vec3>().try_normalize(0.0);
    let ray = ray.unwrap_or_else(Vec3::z);
    terms.iter().map(|t| t.at - ray * ray.dot(&t.at)).collect()
}

/// The mean height of each surfel over the scans that saw it, with the number of scans.
fn heights(terms: &[Vec<Term>], surfels: usize) -> Vec<(f64, f64)> {
    let mut sums = vec![(0.0, 0.0); surfels];
    for term in terms.iter().flatten() {
        let sum = &mut sums[term.surfel as usize];
        sum.0 += term.residual;
        sum.1 += 1.0;
    }
    sums.into_iter().map(|(sum, count)| (sum / f64::max(count, 1.0), count)).collect()
}

/// Deviations of the scans' measurements from the mean of all, scaled to the deviation of one scan alone (n of them
/// about their own mean scatter too little, by (n - 1) / n); surfels that one scan alone saw have none.
fn deviations<'a>(
    terms: &'a [Vec<Term>],
    heights: &'a [(f64, f64)],
) -> impl Iterator<Item = (f64, &'a Term)> {
    terms.iter().flatten().filter_map(|term| {
        let (height, scans) = heights[term.surfel as usize];
        (scans > 1.0).then(|| ((term.residual - height) * (scans / (scans - 1.0)).sqrt(), term))
    })
}

/// Robust standard deviation of a single point about the surface, metres; 0 without redundant measurements.
fn spread(terms: &[Vec<Term>], surfels: usize) -> f64 {
    let heights = heights(terms, surfels);
    let off = median(deviations(terms, &heights).map(|(d, _)| d.abs()).collect()).unwrap_or(0.0);
    let within = terms.iter().flatten().filter(|t| t.weight > 2.0).map(|t| t.variance);
    // The median absolute deviation of a normal distribution is 0.6745 standard deviations.
    (off / 0.6745).hypot(median(within.collect()).unwrap_or(0.0).sqrt())
}

/// Variances between and within the scans' measurements, square metres.
fn variances(terms: &[Vec<Term>], heights: &[(f64, f64)], floor: f64) -> (f64, f64) {
    let (mut square, mut points) = (0.0, 0.0);
    for term in terms.iter().flatten().filter(|t| t.weight > 2.0) {
        square += term.variance * term.weight;
        points += term.weight - 1.0;
    }
    let within = square / f64::max(points, 1.0);
    let (mut square, mut white, mut count) = (0.0, 0.0, 0.0);
    for (deviation, term) in deviations(terms, heights) {
        square += deviation * deviation;
        white += within / term.weight;
        count += 1.0;
    }
    let total = square / f64::max(count, 1.0);
    let between =
        (total - white / f64::max(count, 1.0)).max(0.05 * total).max(1e-4 * floor * floor);
    (between, within)
}

/// Root mean square point-to-plane distance between the accepted scans, metres, robustly (from the median
/// absolute distance); NaN if no two overlap.
pub(crate) fn residual(
    samples: &[Sample],
    registration: &Registration,
    params: &RegisterParams,
) -> f64 {
    let members = accepted(samples, registration);
    let scans: Vec<&Sample> = members.iter().map(|&i| &samples[i]).collect();
    let poses: Vec<Pose> = members.iter().map(|&i| registration.poses[i]).collect();
    if members.len() < 2 {
        return f64::NAN;
    }
    let found = Measured::new(&scans, &poses, Scale::finest(&scans), false, params);
    if found.redundant == 0 {
        return f64::NAN;
    }
    // Two scans' errors lie between two points.
    found.scale * std::f64::consts::SQRT_2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_that_wander_end_in_their_middle() {
        let middle = exp(&Twist::new(0.1, -0.2, 0.3, 0.4, 0.5, -0.6));
        let away = Twist::new(1e-3, 2e-3, -1e-3, 2e-3, 1e-3, 3e-3);
        let steps = [-2.0, 1.0, -1.0, 2.0];
        let passed: Vec<Vec<Pose>> =
            steps.iter().map(|step| vec![middle * exp(&(away * *step))]).collect();
        let mut poses = passed[3].clone();
        average(&mut poses, &passed);
        assert!(log(&(middle.inverse() * poses[0])).norm() < 1e-5);
        average(&mut poses, &[]);
        assert!(log(&(middle.inverse() * poses[0])).norm() < 1e-5);
    }
}
