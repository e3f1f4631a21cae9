//! What the planner knows and considers, as markers for those who watch.

use crate::Params;
use anyhow::Result;
use puffer_core::geometry::{Pose, Vec3};
use puffer_core::view::{Plan, State, ViewSpace};
use puffer_msgs::geometry_msgs::msg::Vector3;
use puffer_msgs::std_msgs::msg::{ColorRGBA, Header};
use puffer_msgs::visualization_msgs::msg::{Marker, MarkerArray};
use puffer_shell::convert::point_message;
use puffer_shell::{Node, Profile, Publisher};

/// Voxels shown at most: at 40 bytes each they fit the socket buffers of a stock machine (212992 bytes).
const MOST_VOXELS: usize = 5000;
/// Candidates shown at most.
const MOST_CANDIDATES: usize = 60;
/// Length of a candidate's arrow, metres.
const ARROW: f64 = 0.06;

/// Surface that holds its points, surface that lacks some, and the border of what is hidden.
const SATISFIED: ColorRGBA = colour(0.2, 0.7, 0.3, 0.9);
const LACKING: ColorRGBA = colour(1.0, 0.6, 0.1, 0.9);
const BORDER: ColorRGBA = colour(0.3, 0.5, 1.0, 0.3);
/// The view that is taken, those that might have been, and those that the robot cannot take.
const CHOSEN: ColorRGBA = colour(0.1, 1.0, 0.2, 1.0);
const CONSIDERED: ColorRGBA = colour(0.8, 0.8, 0.2, 0.6);
const REFUSED: ColorRGBA = colour(0.9, 0.2, 0.2, 0.4);

const fn colour(r: f32, g: f32, b: f32, a: f32) -> ColorRGBA {
    ColorRGBA { r, g, b, a }
}

/// `~/voxels` and `~/candidates`; written only while somebody reads.
pub(crate) struct Markers {
    voxels: Publisher<Marker>,
    candidates: Publisher<MarkerArray>,
}

impl Markers {
    pub(crate) fn new(node: &Node<Params>) -> Result<Markers> {
        let voxels = node.publisher("~/voxels", Profile::Standard)?;
        let candidates = node.publisher("~/candidates", Profile::Standard)?;
        Ok(Markers { voxels, candidates })
    }

    pub(crate) fn show_space(&self, space: &ViewSpace, header: Header) {
        if self.voxels.readers() > 0 {
            tell(self.voxels.publish(&voxels(&space.voxels(), space.edge(), header)));
        }
    }

    pub(crate) fn show_plan(&self, plan: &Plan, header: &Header) {
        if self.candidates.readers() > 0 {
            tell(self.candidates.publish(&candidates(plan, header)));
        }
    }
}

/// Who watches may miss something; the planner goes on.
fn tell(published: Result<()>) {
    if let Err(error) = published {
        tracing::debug!("{error:#}");
    }
}

/// Surface and possible border voxels as cubes; evenly thinned out where they are too many.
fn voxels(space: &[(Vec3, State, bool)], edge: f64, header: Header) -> Marker {
    let shown = space.iter().filter_map(|(center, state, satisfied)| match state {
        State::Occupied => Some((center, if *satisfied { SATISFIED } else { LACKING })),
        State::PossibleBorder => Some((center, BORDER)),
        _ => None,
    });
    let all: Vec<(&Vec3, ColorRGBA)> = shown.collect();
    let step = all.len().div_ceil(MOST_VOXELS).max(1);
    if step > 1 {
        tracing::debug!("~/voxels shows one of {step} of {} voxels", all.len());
    }
    let mut marker = Marker {
        header,
        ns: "voxels".to_owned(),
        r#type: Marker::CUBE_LIST,
        scale: Vector3 { x: edge, y: edge, z: edge },
        color: SATISFIED,
        ..upright()
    };
    for (center, colour) in all.into_iter().step_by(step) {
        marker.points.push(point_message(center));
        marker.colors.push(colour);
    }
    marker
}

/// An arrow along the viewing direction of each candidate, in place of those before.
fn candidates(plan: &Plan, header: &Header) -> MarkerArray {
    let clear = Marker { header: header.clone(), action: Marker::DELETEALL, ..Marker::default() };
    let mut markers = vec![clear];
    let chosen = plan.chosen.as_ref().map(|chosen| chosen.candidate);
    for (index, candidate) in plan.candidates.iter().enumerate().take(MOST_CANDIDATES) {
        if Some(index) != chosen {
            let refused = candidate.asked && !candidate.reachable;
            let colour = if refused { REFUSED } else { CONSIDERED };
            markers.push(arrow(&candidate.pose, index, colour, 1.0, header));
        }
    }
    if let Some(chosen) = &plan.chosen {
        // As the robot takes it, which may be nearer than it was asked for.
        markers.push(arrow(&chosen.pose, chosen.candidate, CHOSEN, 2.0, header));
    }
    MarkerArray { markers }
}

fn arrow(
    object_from_sensor: &Pose,
    index: usize,
    color: ColorRGBA,
    size: f64,
    header: &Header,
) -> Marker {
    let tail = object_from_sensor.translation.vector;
    let tip = tail + object_from_sensor.rotation * Vec3::z() * (ARROW * size);
    Marker {
        header: header.clone(),
        ns: "candidates".to_owned(),
        id: index as i32,
        r#type: Marker::ARROW,
        // Diameters of shaft and head.
        scale: Vector3 { x: ARROW * size / 12.0, y: ARROW * size / 6.0, z: 0.0 },
        color,
        points: vec![point_message(&tail), point_message(&tip)],
        ..upright()
    }
}

/// A marker at the origin of its frame.
fn upright() -> Marker {
    let mut marker = Marker::default();
    marker.pose.orientation.w = 1.0;
    marker
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        Header { frame_id: "workpiece".to_owned(), ..Header::default() }
    }
    use puffer_core::view::{Candidate, ChosenView, Counts};

    #[test]
    fn surface_and_border_are_cubes_coloured_by_state_and_bounded_in_number() {
        let at = |k: usize| Vec3::new(k as f64 * 0.01, 0.0, 0.0);
        let space = [
            (at(0), State::Occupied, true),
            (at(1), State::Occupied, false),
            (at(2), State::PossibleBorder, false),
            (at(3), State::PossibleInside, false),
            (at(4), State::Excluded, false),
        ];
        let marker = voxels(&space, 0.004, header());
        assert_eq!(
            (marker.r#type, marker.header.frame_id.as_str()),
            (Marker::CUBE_LIST, "workpiece")
        );
        assert_eq!((marker.scale.x, marker.pose.orientation.w), (0.004, 1.0));
        assert_eq!(marker.colors, [SATISFIED, LACKING, BORDER]);
        assert_eq!(marker.points[2].x, 0.02);
        let many: Vec<_> = (0..12_001).map(|k| (at(k), State::Occupied, true)).collect();
        let marker = voxels(&many, 0.004, header());
        assert_eq!((marker.points.len(), marker.colors.len()), (4001, 4001));
        assert_eq!(marker.points[4000].x, 120.0, "evenly thinned out, to the last");
        let bytes = puffer_msgs::cdr::to_bytes(&marker).unwrap().len();
        assert!(bytes * MOST_VOXELS / 4001 < 212_992, "{bytes}");
    }

    #[test]
    fn candidates_are_arrows_and_the_chosen_one_stands_out() {
        let candidate = |x: f64, asked: bool, reachable: bool| Candidate {
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
        };
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
            counts: Counts::default(),
            done: None,
        };
        let markers = candidates(&plan, &header()).markers;
        let (clear, arrows) = markers.split_first().unwrap();
        assert_eq!(clear.action, Marker::DELETEALL);
        let colours: Vec<_> = arrows.iter().map(|a| (a.id, a.color)).collect();
        assert_eq!(colours, [(0, REFUSED), (2, CONSIDERED), (1, CHOSEN)]);
        let chosen = &arrows[2];
        assert_eq!((chosen.r#type, chosen.points[0].x), (Marker::ARROW, 0.25));
        assert!((chosen.points[1].z - 2.0 * ARROW).abs() < 1e-12, "along the sensor's z");
        assert!(chosen.scale.x > arrows[0].scale.x);
    }
}
