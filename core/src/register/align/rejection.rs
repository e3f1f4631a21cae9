//! Stage 4: which correspondences do not count at all (Rusinkiewicz & Levoy 2001, §3.4).

use super::matching::Correspondence;
use crate::register::params::Rejection;
use crate::register::strategy::Strategy;

/// Standard deviations of the distances beyond which a pair is rejected (Masuda et al. 1996).
const MAX_DISTANCE_SIGMAS: f64 = 2.5;

/// Keeps the correspondences that count, in their order.
pub(crate) fn reject(pairs: &mut Vec<Correspondence>, strategy: &Strategy) {
    if strategy.rejection != Rejection::Distance {
        let min_cosine = strategy.params.max_normal_angle.cos();
        pairs.retain(|c| c.normal_cos() >= min_cosine);
    }
    match strategy.rejection {
        Rejection::Distance | Rejection::Normals => {}
        Rejection::Sigma => {
            let square = pairs.iter().map(|c| c.point_distance * c.point_distance).sum::<f64>()
                / pairs.len() as f64;
            let limit = MAX_DISTANCE_SIGMAS * square.sqrt();
            pairs.retain(|c| c.point_distance <= limit);
        }
        Rejection::Trimmed => {
            let mut gaps: Vec<f64> = pairs.iter().map(|c| c.point_distance).collect();
            gaps.sort_unstable_by(f64::total_cmp);
            let kept = ((1.0 - strategy.params.trim) * gaps.len() as f64).ceil() as usize;
            let limit = kept.checked_sub(1).map_or(0.0, |last| gaps[last.min(gaps.len() - 1)]);
            pairs.retain(|c| c.point_distance <= limit);
        }
        Rejection::Boundary => pairs.retain(|c| !c.boundary),
    }
}

#[cfg(test)]
mod tests {
    use super::super::matching_tests::pair;
    use super::*;
    use crate::geometry::Vec3;
    use crate::register::RegisterParams;

    fn kept(rejection: Rejection, change: impl Fn(usize, &mut Correspondence)) -> Vec<usize> {
        let mut pairs: Vec<Correspondence> = (0..20)
            .map(|i| {
                let mut c = pair(i, 0.001);
                change(i, &mut c);
                c
            })
            .collect();
        let params = RegisterParams { rejection, trim: 0.15, ..RegisterParams::default() };
        reject(&mut pairs, &Strategy::new(&params));
        pairs.iter().map(|c| c.index).collect()
    }

    #[test]
    fn a_far_pair_is_rejected_by_sigma_and_the_farthest_by_trimming() {
        assert!(!kept(Rejection::Sigma, move_third_away).contains(&3));
        assert_eq!(kept(Rejection::Sigma, move_third_away).len(), 19);
        assert!(kept(Rejection::Normals, move_third_away).contains(&3));
        let trimmed = kept(Rejection::Trimmed, |i, c| c.point_distance = i as f64 * 1e-3);
        assert_eq!(trimmed, (0..17).collect::<Vec<_>>());
    }

    fn move_third_away(i: usize, c: &mut Correspondence) {
        if i == 3 {
            c.point_distance = 0.05;
        }
    }

    #[test]
    fn normals_and_borders_reject_their_own() {
        assert_eq!(kept(Rejection::Distance, turn_fifth_and_mark_seventh).len(), 20);
        assert_eq!(kept(Rejection::Normals, turn_fifth_and_mark_seventh), all_but(&[5]));
        assert_eq!(kept(Rejection::Boundary, turn_fifth_and_mark_seventh), all_but(&[5, 7]));
    }

    fn turn_fifth_and_mark_seventh(i: usize, c: &mut Correspondence) {
        if i == 5 {
            c.source_normal = Vec3::new(0.8, 0.0, 0.6);
        }
        c.boundary = i == 7;
    }

    fn all_but(gone: &[usize]) -> Vec<usize> {
        (0..20).filter(|i| !gone.contains(i)).collect()
    }

    #[test]
    fn no_pair_at_all_stays_none() {
        for rejection in [Rejection::Sigma, Rejection::Trimmed] {
            let mut none = Vec::new();
            let params = RegisterParams { rejection, ..RegisterParams::default() };
            reject(&mut none, &Strategy::new(&params));
            assert!(none.is_empty());
        }
    }
}
