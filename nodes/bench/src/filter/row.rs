//! The figures of a case, and how they are printed.

use super::case::FilterCase;
use anyhow::Result;
use puffer_core::assess::FilterFigures;
use serde_json::{Value, json};

/// The figures of one case.
pub(super) struct FilterRow {
    pub case: FilterCase,
    pub figures: FilterFigures,
    pub seconds: f64,
    pub noise_radius_mm: f64,
}

/// The heading of the table.
pub(super) fn heading() -> String {
    "precision and recall of removed outliers; error of kept points in mm, in brackets over the statistical \
     limit; share within 1 and 2 stated sigma\n"
        .to_owned()
}

impl FilterRow {
    /// Ratio of the error of the kept points to the statistical limit.
    fn ratio(&self) -> f64 {
        self.figures.rms_limited / self.figures.limit
    }

    /// The line of the case in the table.
    pub(super) fn line(&self) -> String {
        let f = &self.figures;
        format!(
            "{} {:>5}  precision {:.4} recall {:.4}  error {:.4} ({:.2})  within {:.3} {:.3}  {} of {} points, {:.1} s\n",
            self.case.label(),
            self.case.seed,
            f.precision,
            f.recall,
            f.rms,
            self.ratio(),
            f.within_1_sigma,
            f.within_2_sigma,
            f.kept,
            f.measurements,
            self.seconds
        )
    }

    /// The figures as a JSON object.
    pub(super) fn json(&self) -> Result<Value> {
        let mut value = serde_json::to_value(self.figures)?;
        let more = json!({
            "object": self.case.object, "noise": format!("{:?}", self.case.family),
            "outlier_share": self.case.outliers, "seed": self.case.seed, "seconds": self.seconds,
            "noise_radius": self.noise_radius_mm, "rms_over_limit": self.ratio(),
        });
        if let (Some(all), Value::Object(more)) = (value.as_object_mut(), more) {
            all.extend(more);
        }
        Ok(value)
    }
}

/// The line of the worst figures of several seeds.
pub(super) fn worst_row(rows: &[FilterRow]) -> String {
    format!(
        "{} worst  precision {:.4} recall {:.4}  error {:.4} ({:.2})  within {:.3} {:.3}\n",
        rows[0].case.label(),
        smallest(rows, |r| r.figures.precision),
        smallest(rows, |r| r.figures.recall),
        largest(rows, |r| r.figures.rms),
        largest(rows, FilterRow::ratio),
        smallest(rows, |r| r.figures.within_1_sigma),
        smallest(rows, |r| r.figures.within_2_sigma)
    )
}

fn largest(rows: &[FilterRow], figure: fn(&FilterRow) -> f64) -> f64 {
    rows.iter().map(figure).fold(f64::NEG_INFINITY, f64::max)
}

fn smallest(rows: &[FilterRow], figure: fn(&FilterRow) -> f64) -> f64 {
    rows.iter().map(figure).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use puffer_core::simulate::NoiseFamily;

    fn row(seed: u64, rms: f64, recall: f64) -> FilterRow {
        let case =
            FilterCase { object: "mug".into(), family: NoiseFamily::P1, outliers: 0.1, seed };
        let figures = FilterFigures {
            measurements: 1000,
            outliers: 100,
            removed: 90,
            precision: 0.95,
            recall,
            kept: 500,
            rms,
            limit: 0.02,
            limit_oracle: 0.02,
            rms_limited: rms,
            within_1_sigma: 0.6,
            within_2_sigma: 0.9,
            sigma: 0.03,
            bias: 0.0,
        };
        FilterRow { case, figures, seconds: 1.25, noise_radius_mm: 2.0 }
    }

    #[test]
    fn the_worst_row_has_the_largest_errors_and_the_smallest_shares() {
        let text = worst_row(&[row(1, 0.04, 0.8), row(2, 0.06, 0.9)]);
        assert_eq!(
            text,
            "mug          P1    10.0 % worst  precision 0.9500 recall 0.8000  error 0.0600 (3.00)  \
             within 0.600 0.900\n"
        );
    }

    #[test]
    fn the_json_has_the_figures_and_the_case() {
        let json = row(3, 0.04, 0.8).json().unwrap();
        assert_eq!((&json["object"], &json["noise"]), (&json!("mug"), &json!("P1")));
        assert_eq!((&json["seed"], &json["rms_over_limit"]), (&json!(3), &json!(2.0)));
        assert_eq!((&json["kept"], &json["noise_radius"]), (&json!(500), &json!(2.0)));
    }
}
