//! Stage 4: which correspondences do not count at all (Rusinkiewicz & Levoy 2001, §3.4).

use super::matching::Correspondence;
use crate::register::RegisterParams;

crate::choice! {
    /// Which pairs within the search radius are rejected.
    pub enum Rejection {
        /// None: the search radius is the fixed threshold.
        Distance = "distance",
        /// Those whose normals differ by more than `max_normal_angle` (Zhang 1994). All choices below reject these too.
        Normals = "normals",
        /// Those farther apart than 2.5 standard deviations of the distances (Masuda, Sakaue & Yokoya 1996).
        Sigma = "sigma",
        /// The share `trim` that lies farthest apart (Pulli 1999; Chetverikov, Stepanov & Krsek 2005).
        Trimmed = "trimmed",
        /// Those whose point of the map lies at the border of the scans (Turk & Levoy 1994).
        Boundary = "boundary",
    }
}

/// Standard deviations of the distances beyond which a pair is rejected (Masuda et al. 1996).
const SIGMAS: f64 = 2.5;

/// Keeps the correspondences that count, in their order.
pub(crate) fn reject(found: &mut Vec<Correspondence>, params: &RegisterParams) {
    let rejection = params.stages().rejection;
    if rejection != Rejection::Distance {
        let cosine = params.max_normal_angle.cos();
        found.retain(|c| c.agreement() >= cosine);
    }
    match rejection {
        Rejection::Distance | Rejection::Normals => {}
        Rejection::Sigma => {
            let square = found.iter().map(|c| c.gap * c.gap).sum::<f64>() / found.len() as f64;
            let limit = SIGMAS * square.sqrt();
            found.retain(|c| c.gap <= limit);
        }
        Rejection::Trimmed => {
            let mut gaps: Vec<f64> = found.iter().map(|c| c.gap).collect();
            gaps.sort_unstable_by(f64::total_cmp);
            let kept = ((1.0 - params.trim) * gaps.len() as f64).ceil() as usize;
            let limit = kept.checked_sub(1).map_or(0.0, |last| gaps[last.min(gaps.len() - 1)]);
            found.retain(|c| c.gap <= limit);
        }
        Rejection::Boundary => found.retain(|c| !c.boundary),
    }
}

#[cfg(test)]
mod tests {
    use super::super::matching::tests::pair;
    use super::*;
    use crate::geometry::Vec3;

    fn kept(rejection: Rejection, change: impl Fn(usize, &mut Correspondence)) -> Vec<usize> {
        let mut pairs: Vec<Correspondence> = (0..20)
            .map(|i| {
                let mut c = pair(i, 0.001);
                change(i, &mut c);
                c
            })
            .collect();
        reject(&mut pairs, &RegisterParams { rejection, trim: 0.15, ..RegisterParams::default() });
        pairs.iter().map(|c| c.index).collect()
    }

    #[test]
    fn a_far_pair_is_rejected_by_sigma_and_the_farthest_by_trimming() {
        let far = |i: usize, c: &mut Correspondence| {
            if i == 3 {
                c.gap = 0.05;
            }
        };
        assert!(!kept(Rejection::Sigma, far).contains(&3));
        assert_eq!(kept(Rejection::Sigma, far).len(), 19);
        assert!(kept(Rejection::Normals, far).contains(&3));
        let growing = |i: usize, c: &mut Correspondence| c.gap = i as f64 * 1e-3;
        assert_eq!(kept(Rejection::Trimmed, growing), (0..17).collect::<Vec<_>>());
    }

    #[test]
    fn normals_and_borders_reject_their_own() {
        let turned = |i: usize, c: &mut Correspondence| {
            if i == 5 {
                c.here = Vec3::new(0.8, 0.0, 0.6);
            }
            c.boundary = i == 7;
        };
        assert_eq!(kept(Rejection::Distance, turned).len(), 20);
        let without = |gone: &[usize]| (0..20).filter(|i| !gone.contains(i)).collect::<Vec<_>>();
        assert_eq!(kept(Rejection::Normals, turned), without(&[5]));
        assert_eq!(kept(Rejection::Boundary, turned), without(&[5, 7]));
    }

    #[test]
    fn no_pair_at_all_stays_none() {
        for rejection in [Rejection::Sigma, Rejection::Trimmed] {
            let mut none = Vec::new();
            reject(&mut none, &RegisterParams { rejection, ..RegisterParams::default() });
            assert!(none.is_empty());
        }
    }
}
