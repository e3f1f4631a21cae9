//! The variants of ICP that the parameters offer.

use super::params::RegisterParams;
use crate::params::Value;

/// A choice for one stage of ICP, all others as they are.
#[derive(Clone, Debug)]
pub struct IcpVariant {
    /// The parameter and its word, as `matching mutual`.
    pub name: String,
    /// The parameters with that choice.
    pub params: RegisterParams,
}

/// Each word of each choice parameter that differs from `params`: one variant each, family by
/// family. `method thesis` is the thesis's own ICP.
pub fn icp_variants(params: &RegisterParams) -> Vec<IcpVariant> {
    let mut found = Vec::new();
    let values = params.values();
    for (spec, (field, chosen)) in RegisterParams::specs().iter().zip(values) {
        for word in spec.choices.iter().filter(|word| chosen != **word) {
            let mut params = params.clone();
            // A word from the list is always taken.
            if params.set(field, &Value::from(*word)).is_ok() {
                found.push(IcpVariant { name: format!("{field} {word}"), params });
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::tests::{SIGMA, case, pair_error};
    use super::super::{PairScan, align_pair};
    use super::*;
    use serde_json::json;

    #[test]
    fn each_family_offers_all_but_what_is_chosen() {
        let all = icp_variants(&RegisterParams::default());
        let names: Vec<&str> = all.iter().map(|v| v.name.as_str()).collect();
        for family in ["method", "selection", "matching", "weight", "kernel", "rejection"] {
            assert!(names.iter().filter(|n| n.starts_with(family)).count() >= 2, "{names:?}");
        }
        assert!(names.contains(&"method thesis") && !names.contains(&"method point_to_plane"));
        for variant in &all {
            assert_ne!(variant.params, RegisterParams::default(), "{}", variant.name);
        }
    }

    #[test]
    fn each_variant_brings_a_pair_together() {
        let case = case(SIGMA);
        let mut worse = Vec::new();
        for IcpVariant { name, params } in icp_variants(&RegisterParams::default()) {
            let ready: Vec<PairScan> =
                case.scans[..2].iter().map(|s| PairScan::new(s, SIGMA, &params)).collect();
            let guess = case.robot[1].inverse() * case.robot[0];
            let (pose, _) = align_pair(&ready[0], &ready[1], &guess, SIGMA, &params);
            let [before, after] = [guess, pose].map(|p| pair_error(&case, 0, 1, &p));
            // The robot is 3 mm off, the noise is 0.06 mm, points lie 1.3 mm apart. Where only
            // points are compared, the parts that do not overlap pull, and the thesis's radius does
            // not shrink.
            let bound = match name.as_str() {
                "method thesis" => 0.8 * before,
                "method point_to_point" => 0.4 * before,
                _ => 1e-4,
            };
            if after > bound {
                worse.push(format!("{name}: {before} to {after}, bound {bound}"));
            }
        }
        assert!(worse.is_empty(), "{worse:#?}");
    }

    #[test]
    fn a_word_that_no_stage_knows_is_an_error_with_those_it_knows() {
        let mut params = RegisterParams::default();
        for (field, choices) in [
            ("method", "point_to_plane, point_to_point, plane_to_plane, thesis"),
            ("selection", "all, random, uniform, normal_space, coarse_to_fine"),
            ("matching", "closest, mutual, projective"),
            ("weight", "constant, distance, normals, sensor_noise, mad"),
            ("kernel", "none, tukey, huber, cauchy"),
            ("rejection", "distance, normals, sigma, trimmed, boundary"),
        ] {
            let error = params.set(field, &json!("nearby")).unwrap_err().to_string();
            assert!(error.contains(&format!("register.{field}")), "{error}");
            assert!(error.contains(&format!("\"nearby\" is not one of {choices}")), "{error}");
        }
        assert_eq!(params, RegisterParams::default());
    }
}
