//! The figures of a case, and how they are printed.

use super::Case;
use anyhow::Result;
use puffer_core::assess::FilterFigures;
use serde_json::{Value, json};

/// What came out of one case.
pub(super) struct Row {
    pub case: Case,
    pub figures: FilterFigures,
    pub seconds: f64,
    /// Millimetres.
    pub noise_radius: f64,
}

pub(super) fn heading() -> String {
    "precision and recall of removed outliers; error of kept points in mm, in brackets over the statistical \
     limit; share within 1 and 2 stated sigma\n"
        .to_owned()
}

impl Row {
    /// Error of the kept points over the statistical limit.
    fn ratio(&self) -> f64 {
        self.figures.rms_limited / self.figures.limit
    }

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

    pub(super) fn json(&self) -> Result<Value> {
        let mut value = serde_json::to_value(self.figures)?;
        let more = json!({
            "object": self.case.object, "noise": format!("{:?}", self.case.family),
            "outlier_share": self.case.outliers, "seed": self.case.seed, "seconds": self.seconds,
            "noise_radius": self.noise_radius, "rms_over_limit": self.ratio(),
        });
        if let (Some(all), Value::Object(more)) = (value.as_object_mut(), more) {
            all.extend(more);
        }
        Ok(value)
    }
}

impl Case {
    fn label(&self) -> String {
        let noise = format!("{:?}", self.family);
        format!("{:<12} {noise:<4} {:>5.1} %", self.object, self.outliers * 100.0)
    }
}

/// The worst figure of each kind.
pub(super) fn worst(rows: &[Row]) -> String {
    let largest = |of: fn(&Row) -> f64| rows.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
    let smallest = |of: fn(&Row) -> f64| rows.iter().map(of).fold(f64::INFINITY, f64::min);
    format!(
        "{} worst  precision {:.4} recall {:.4}  error {:.4} ({:.2})  within {:.3} {:.3}\n",
        rows[0].case.label(),
        smallest(|r| r.figures.precision),
        smallest(|r| r.figures.recall),
        largest(|r| r.figures.rms),
        largest(Row::ratio),
        smallest(|r| r.figures.within_1_sigma),
        smallest(|r| r.figures.within_2_sigma)
    )
}
