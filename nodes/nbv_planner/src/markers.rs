//! The planner's space and candidates as markers for visualisation.

use crate::Params;
use anyhow::Result;
use puffer_core::geometry::{Pose, Vec3};
use puffer_core::view::{Plan, ViewSpace, VoxelState};
use puffer_msgs::geometry_msgs::msg::Vector3;
use puffer_msgs::std_msgs::msg::{ColorRGBA, Header};
use puffer_msgs::visualization_msgs::msg::{Marker, MarkerArray};
use puffer_ros::conversions::point_message;
use puffer_ros::{Node, Publisher, QosProfile};

/// Voxels shown at most: at 40 bytes each they fit the socket buffers of a stock machine (212992
/// bytes).
const MAX_VOXELS: usize = 5000;
/// Candidates shown at most.
const MAX_CANDIDATES: usize = 60;
/// Length of a candidate's arrow, metres.
const ARROW_LENGTH_M: f64 = 0.06;

/// Surface voxels that have their points.
const SATISFIED_COLOUR: ColorRGBA = colour(0.2, 0.7, 0.3, 0.9);
/// Surface voxels that lack points.
const LACKING_COLOUR: ColorRGBA = colour(1.0, 0.6, 0.1, 0.9);
/// Possible border voxels.
const BORDER_COLOUR: ColorRGBA = colour(0.3, 0.5, 1.0, 0.3);
/// The chosen view.
const CHOSEN_COLOUR: ColorRGBA = colour(0.1, 1.0, 0.2, 1.0);
/// Candidates that were not chosen.
const CONSIDERED_COLOUR: ColorRGBA = colour(0.8, 0.8, 0.2, 0.6);
/// Candidates that the robot refuses.
const REFUSED_COLOUR: ColorRGBA = colour(0.9, 0.2, 0.2, 0.4);

const fn colour(r: f32, g: f32, b: f32, a: f32) -> ColorRGBA {
    ColorRGBA { r, g, b, a }
}

/// Publishers of `~/voxels` and `~/candidates`, which publish only while there are subscribers.
pub(crate) struct Markers {
    voxels: Publisher<Marker>,
    candidates: Publisher<MarkerArray>,
}

impl Markers {
    pub(crate) fn new(node: &Node<Params>) -> Result<Markers> {
        let voxels = node.publisher("~/voxels", QosProfile::Standard)?;
        let candidates = node.publisher("~/candidates", QosProfile::Standard)?;
        Ok(Markers { voxels, candidates })
    }

    pub(crate) fn show_space(&self, space: &ViewSpace, header: Header) {
        if self.voxels.readers() > 0 {
            let marker = voxel_marker(&space.voxels(), space.edge(), header);
            log_failure(self.voxels.publish(&marker));
        }
    }

    pub(crate) fn show_plan(&self, plan: &Plan, header: &Header) {
        if self.candidates.readers() > 0 {
            log_failure(self.candidates.publish(&candidate_markers(plan, header)));
        }
    }
}

/// A marker that cannot be published is logged; planning goes on.
fn log_failure(published: Result<()>) {
    if let Err(error) = published {
        tracing::debug!("{error:#}");
    }
}

/// Surface and possible border voxels as cubes. If they are too many, each n-th is shown.
fn voxel_marker(space: &[(Vec3, VoxelState, bool)], edge: f64, header: Header) -> Marker {
    let shown = space.iter().filter_map(|(center, state, satisfied)| match state {
        VoxelState::Occupied => {
            Some((center, if *satisfied { SATISFIED_COLOUR } else { LACKING_COLOUR }))
        }
        VoxelState::PossibleBorder => Some((center, BORDER_COLOUR)),
        _ => None,
    });
    let all: Vec<(&Vec3, ColorRGBA)> = shown.collect();
    let step = all.len().div_ceil(MAX_VOXELS).max(1);
    if step > 1 {
        tracing::debug!("~/voxels shows one of {step} of {} voxels", all.len());
    }
    let mut marker = Marker {
        header,
        ns: "voxels".to_owned(),
        r#type: Marker::CUBE_LIST,
        scale: Vector3 { x: edge, y: edge, z: edge },
        color: SATISFIED_COLOUR,
        ..at_origin()
    };
    for (center, colour) in all.into_iter().step_by(step) {
        marker.points.push(point_message(center));
        marker.colors.push(colour);
    }
    marker
}

/// An arrow along the viewing direction of each candidate. They replace the earlier ones.
fn candidate_markers(plan: &Plan, header: &Header) -> MarkerArray {
    let clear = Marker { header: header.clone(), action: Marker::DELETEALL, ..Marker::default() };
    let mut markers = vec![clear];
    let chosen = plan.chosen.as_ref().map(|chosen| chosen.candidate);
    for (index, candidate) in plan.candidates.iter().enumerate().take(MAX_CANDIDATES) {
        if Some(index) != chosen {
            let refused = candidate.asked && !candidate.reachable;
            let colour = if refused { REFUSED_COLOUR } else { CONSIDERED_COLOUR };
            markers.push(arrow_marker(&candidate.pose, index, colour, 1.0, header));
        }
    }
    if let Some(chosen) = &plan.chosen {
        // As the robot takes it, which may be nearer than it was asked for.
        markers.push(arrow_marker(&chosen.pose, chosen.candidate, CHOSEN_COLOUR, 2.0, header));
    }
    MarkerArray { markers }
}

/// An arrow at a viewpoint (`object_from_sensor`), `size` times the usual length.
fn arrow_marker(
    object_from_sensor: &Pose,
    index: usize,
    color: ColorRGBA,
    size: f64,
    header: &Header,
) -> Marker {
    let tail = object_from_sensor.translation.vector;
    let tip = tail + object_from_sensor.rotation * Vec3::z() * (ARROW_LENGTH_M * size);
    Marker {
        header: header.clone(),
        ns: "candidates".to_owned(),
        id: index as i32,
        r#type: Marker::ARROW,
        // Diameters of shaft and head.
        scale: Vector3 { x: ARROW_LENGTH_M * size / 12.0, y: ARROW_LENGTH_M * size / 6.0, z: 0.0 },
        color,
        points: vec![point_message(&tail), point_message(&tip)],
        ..at_origin()
    }
}

/// A marker at the origin of its frame.
fn at_origin() -> Marker {
    let mut marker = Marker::default();
    marker.pose.orientation.w = 1.0;
    marker
}

#[cfg(test)]
mod tests {
    use super::*;

    use puffer_core::view::{Candidate, ChosenView, VoxelCounts};

    fn header() -> Header {
        Header { frame_id: "workpiece".to_owned(), ..Header::default() }
    }

    /// The centre of the `k`-th voxel of a row.
    fn at(k: usize) -> Vec3 {
        Vec3::new(k as f64 * 0.01, 0.0, 0.0)
    }

    fn candidate(x: f64, asked: bool, reachable: bool) -> Candidate {
        Candidate {
            pose: Pose::translation(x, 0.0, 0.0),
            gain: 1.0,
            lacking: 0,
            hidden: 0,
            unknown: 0,
            overlap: 1.0,
            asked,
            reachable,
            reason: String::new(),
            refusal: None,
        }
    }

    #[test]
    fn surface_and_border_are_cubes_coloured_by_state_and_bounded_in_number() {
        let space = [
            (at(0), VoxelState::Occupied, true),
            (at(1), VoxelState::Occupied, false),
            (at(2), VoxelState::PossibleBorder, false),
            (at(3), VoxelState::PossibleInside, false),
            (at(4), VoxelState::Excluded, false),
        ];
        let marker = voxel_marker(&space, 0.004, header());
        assert_eq!(
            (marker.r#type, marker.header.frame_id.as_str()),
            (Marker::CUBE_LIST, "workpiece")
        );
        assert_eq!((marker.scale.x, marker.pose.orientation.w), (0.004, 1.0));
        assert_eq!(marker.colors, [SATISFIED_COLOUR, LACKING_COLOUR, BORDER_COLOUR]);
        assert_eq!(marker.points[2].x, 0.02);
        let many: Vec<_> = (0..12_001).map(|k| (at(k), VoxelState::Occupied, true)).collect();
        let marker = voxel_marker(&many, 0.004, header());
        assert_eq!((marker.points.len(), marker.colors.len()), (4001, 4001));
        assert_eq!(marker.points[4000].x, 120.0, "evenly thinned out, to the last");
        let bytes = puffer_msgs::cdr::to_bytes(&marker).unwrap().len();
        assert!(bytes * MAX_VOXELS / 4001 < 212_992, "{bytes}");
    }

    #[test]
    fn candidates_are_arrows_and_the_chosen_one_stands_out() {
        let taken = Pose::translation(0.25, 0.0, 0.0);
        let plan = Plan {
            chosen: Some(ChosenView {
                pose: taken,
                candidate: 1,
                gain: 1.0,
                expected_new: 1,
                duration: 1.0,
            }),
            candidates: vec![
                candidate(0.1, true, false),
                candidate(0.2, true, true),
                candidate(0.3, false, false),
            ],
            coverage: 0.5,
            counts: VoxelCounts::default(),
            done: None,
        };
        let markers = candidate_markers(&plan, &header()).markers;
        let (clear, arrows) = markers.split_first().unwrap();
        assert_eq!(clear.action, Marker::DELETEALL);
        let colours: Vec<_> = arrows.iter().map(|a| (a.id, a.color)).collect();
        assert_eq!(colours, [(0, REFUSED_COLOUR), (2, CONSIDERED_COLOUR), (1, CHOSEN_COLOUR)]);
        let chosen = &arrows[2];
        assert_eq!((chosen.r#type, chosen.points[0].x), (Marker::ARROW, 0.25));
        assert!((chosen.points[1].z - 2.0 * ARROW_LENGTH_M).abs() < 1e-12, "along the sensor's z");
        assert!(chosen.scale.x > arrows[0].scale.x);
    }
}
