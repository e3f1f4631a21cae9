//! The thesis's filter (Wiedemann 2014, §2.3.2): normals from the two nearest points, expected positions by
//! averaging along the normal, and of the points within the reduction radius the one with the most similar
//! measurements.

use super::FilterParams;
use super::merged::Merged;
use crate::geometry::{Cloud, KdTree, Vec3};
use crate::voxel::CellIndex;
use crate::{Progress, Result};
use rayon::prelude::*;

/// Radius of the slim neighbourhood along the normal, as a share of the noise radius (ours; the thesis says
/// "slim").
const SLIM: f64 = 0.25;
/// A normal within this cosine of a right angle to the viewing direction is tried again with the next point.
const SIDEWAYS: f64 = 0.1;
/// Neighbours tried at most to find a normal.
const TRIES: usize = 12;

pub(super) fn filter(
    merged: &Merged,
    noise_radius: f64,
    reduction_radius: f64,
    params: &FilterParams,
    progress: &Progress,
) -> Result<Cloud> {
    let points = &merged.points;
    let tree = KdTree::new(points);
    let normals: Vec<Option<Vec3>> =
        (0..points.len()).into_par_iter().map(|i| normal(merged, &tree, i)).collect();
    progress.report("filter", 0.3)?;
    let cosine = params.max_normal_angle.cos();
    let expected: Vec<Option<Expected>> = (0..points.len())
        .into_par_iter()
        .map(|i| expected(merged, &normals, i, noise_radius, cosine))
        .collect();
    progress.report("filter", 0.8)?;
    Ok(reduce(points, &normals, &expected, reduction_radius, params.min_measurements))
}

/// The normal `(p - p1) x (p - p2)` of the two nearest points, turned to the sensor.
fn normal(merged: &Merged, tree: &KdTree, index: usize) -> Option<Vec3> {
    let p = merged.points[index];
    let near = tree.nearest_n(&p, TRIES + 1);
    let mut others = near.iter().filter(|(i, _)| *i != index).map(|(i, _)| merged.points[*i]);
    let first = others.next()?;
    others.find_map(|second| {
        let normal = (p - first).cross(&(p - second)).try_normalize(0.0)?;
        let cosine = normal.dot(&-merged.rays[index]);
        (cosine.abs() > SIDEWAYS).then(|| normal * cosine.signum())
    })
}

struct Expected {
    position: Vec3,
    similar: usize,
    deviation: f64,
    scans: u16,
}

/// The mean of the similar measurements in the slim neighbourhood along the normal.
fn expected(
    merged: &Merged,
    normals: &[Option<Vec3>],
    index: usize,
    noise_radius: f64,
    cosine: f64,
) -> Option<Expected> {
    let (p, n) = (merged.points[index], normals[index]?);
    let (mut sum, mut squares, mut similar) = (0.0, 0.0, 0);
    let mut scans: Vec<u16> = Vec::new();
    merged.cells.for_each_within(&merged.points, &p, noise_radius, |i, _| {
        let offset = merged.points[i] - p;
        let height = offset.dot(&n);
        let aside = (offset - n * height).norm();
        if aside <= SLIM * noise_radius && normals[i].is_some_and(|other| other.dot(&n) >= cosine) {
            sum += height;
            squares += height * height;
            similar += 1;
            if !scans.contains(&merged.scan[i]) {
                scans.push(merged.scan[i]);
            }
        }
    });
    let count = similar as f64;
    let variance = (squares / count - (sum / count).powi(2)).max(0.0);
    Some(Expected {
        position: p + n * (sum / count),
        similar,
        deviation: (variance / count).sqrt(),
        scans: scans.len() as u16,
    })
}

/// The point of each reduction radius with the most similar measurements, at its expected position.
fn reduce(
    points: &[Vec3],
    normals: &[Option<Vec3>],
    expected: &[Option<Expected>],
    reduction_radius: f64,
    least: usize,
) -> Cloud {
    let similar = |i: usize| expected[i].as_ref().map_or(0, |e| e.similar);
    let mut order: Vec<usize> = (0..points.len()).filter(|&i| similar(i) >= least).collect();
    order.sort_by(|&a, &b| similar(b).cmp(&similar(a)).then(a.cmp(&b)));
    let cells = CellIndex::new(points, reduction_radius);
    let mut dropped = vec![false; points.len()];
    let mut cloud = Cloud::default();
    for i in order {
        if dropped[i] {
            continue;
        }
        cells.for_each_within(points, &points[i], reduction_radius, |j, _| dropped[j] = true);
        if let (Some(e), Some(n)) = (&expected[i], normals[i]) {
            cloud.push(e.position, n, e.deviation, e.scans);
        }
    }
    cloud
}
