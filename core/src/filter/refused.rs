//! Which measurements the filtered cloud does not explain.

use super::learnt::Learnt;
use super::merged::Merged;
use super::neighbours::Neighbours;
use super::standing::{Explainer, Measurement, Standing};
use crate::geometry::{Cloud, Pose};
use crate::register::PreparedScan;
use rayon::prelude::*;

/// The standard deviations within which measurements are believed whose scan gave them a normal: few are outliers.
const REACH_OF_ORIENTED: f64 = 4.5;
/// The least of the others.
const LEAST_REACH: f64 = 2.0;
/// Good ones among those refused if they were normal to the ends; their tails are some times heavier.
const FALSE: f64 = 0.005;
/// Standard deviations beyond which there are outliers only.
const SURELY_OUT: f64 = 6.0;

/// The raw points of each scan that belong to no point of `cloud`, ascending.
pub(super) fn refused(
    scans: &[(&PreparedScan, Pose)],
    merged: &Merged,
    cloud: &Cloud,
    noise_radius: f64,
    spacing: f64,
    noise: &Learnt,
) -> Vec<Vec<u32>> {
    let explainer = Explainer::new(cloud, merged, noise_radius, spacing, noise);
    let of_scan = |(scan, pose): &(&PreparedScan, Pose)| -> Vec<Judged> {
        let all = Measurement::all_of(scan, pose);
        let standings: Vec<Option<Standing>> =
            all.par_iter().map(|m| explainer.standing(m)).collect();
        let neighbours = Neighbours::new(&standings, noise_radius, &noise.components);
        let off = |s: &Option<Standing>| s.as_ref().map_or(f64::INFINITY, |s| neighbours.off(s));
        let judged = |(m, s): (&Measurement, &Option<Standing>)| Judged {
            source: m.source,
            oriented: m.oriented,
            off: off(s),
        };
        all.par_iter().zip(&standings).map(judged).collect()
    };
    let judged: Vec<Vec<Judged>> = scans.iter().map(of_scan).collect();
    let reach = [reach_of_aside(&judged), REACH_OF_ORIENTED];
    let lost = |scan: Vec<Judged>| {
        let beyond = scan.into_iter().filter(|j| j.off > reach[usize::from(j.oriented)]);
        let mut found: Vec<u32> = beyond.map(|j| j.source).collect();
        found.sort_unstable();
        found
    };
    judged.into_iter().map(lost).collect()
}

/// A measurement and how far it is off in standard deviations: infinite if there is no surface beside it.
struct Judged {
    source: u32,
    oriented: bool,
    off: f64,
}

/// The standard deviations within which measurements are believed that have no normal: so many that few of those beyond are
/// good (false discovery rate). Those that are good lie off their neighbours and scatter more than others:
/// they are taken for normal numbers whose scale follows from how many lie near the surface, where outliers are few (empirical
/// null; Efron 2010, Large-scale inference, ch. 6).
fn reach_of_aside(judged: &[Vec<Judged>]) -> f64 {
    let aside = judged.iter().flatten().filter(|j| !j.oriented);
    let off: Vec<f64> = aside.map(|j| j.off).collect();
    let count =
        |low: f64, high: f64| off.iter().filter(|off| (low..high).contains(*off)).count() as f64;
    let outliers = off.iter().filter(|off| **off >= SURELY_OUT).count();
    // The logarithm of the normal density falls by x^2 / 2; the middles of both counts are 1/2 and 3/2.
    let fall = (count(0.0, 1.0).max(1.0) / count(1.0, 2.0).max(1.0)).ln();
    let scale = if fall > 0.0 { fall.powf(-0.5).max(1.0) } else { f64::INFINITY };
    let good = count(0.0, SURELY_OUT).max(1.0);
    let tail = (FALSE * outliers as f64 / good).clamp(1e-9, 0.1);
    (scale * normal_reach(tail)).clamp(LEAST_REACH, REACH_OF_ORIENTED)
}

/// Beyond this on both sides lies the part `tail` of normal numbers (Mills' ratio, exact to a hundredth below a tenth).
fn normal_reach(tail: f64) -> f64 {
    let density = (2.0 / std::f64::consts::PI).sqrt() / tail;
    let beyond = |x: f64| (2.0 * (density / (x + 0.8 / (x + 1.0))).ln()).max(1.0).sqrt();
    (0..20).fold(2.0, |x, _| beyond(x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reach_of_normal_numbers_is_that_of_tables() {
        for (tail, reach) in [(0.1, 1.645), (0.05, 1.960), (0.01, 2.576), (6.3e-5, 4.0)] {
            assert!((normal_reach(tail) - reach).abs() < 0.03, "{tail}: {}", normal_reach(tail));
        }
    }
}
