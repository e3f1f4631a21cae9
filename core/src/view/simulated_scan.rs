//! Simulated scans of the voxel space (Wiedemann 2014, §2.2.1).

use super::params::ray_spacing;
use super::space::ViewSpace;
use super::voxel_state::{VoxelRecord, VoxelState};
use crate::geometry::{Pose, SensorModel, SensorRay, Vec3};
use crate::voxel::SlotSet;
use nalgebra::Point3;

/// Whether the second camera sees a voxel is decided by the voxels up to this many voxel edges
/// before it: those nearer to it hold the same surface.
const SURFACE_DEPTH_VOXELS: f64 = 2.0;

/// The rays of simulated scans.
pub(crate) struct RayPattern {
    rays: Vec<SensorRay>,
    range: [f64; 2],
}

impl RayPattern {
    /// Rays about `spacing` (metres) apart at the sensor's working distance.
    pub(crate) fn new(sensor: &SensorModel, spacing: f64) -> RayPattern {
        let step = (spacing / ray_spacing(sensor)).round().max(1.0) as usize;
        RayPattern { rays: sensor.rays(step), range: sensor.range() }
    }
}

/// Numbers of rays of a simulated scan, by what they hit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RayHits {
    /// Rays that hit measurable surface, with no hidden voxel before it.
    pub surface: usize,
    /// Rays that enter a voxel that may hide surface before they hit surface.
    pub hidden: usize,
}

impl RayHits {
    /// Share of the rays into the object that hit known surface, 0 to 1. Hidden space far from
    /// surface does not count as the object.
    pub(crate) fn overlap(&self) -> f64 {
        self.surface as f64 / (self.surface + self.hidden).max(1) as f64
    }
}

/// A voxel that a simulated scan sees.
pub(crate) struct SeenVoxel<'a> {
    pub slot: u32,
    pub voxel: &'a VoxelRecord,
    /// Direction of the first ray that meets it, a unit vector.
    pub along: Vec3,
}

/// Casts all rays from `pose` (`object_from_sensor`). Calls `visit` once for each voxel that a ray
/// crosses and that is neither free nor solid. A ray ends in the first occupied voxel, else at the
/// sensor's range. A surface voxel that lacks points is visited only if the second camera sees it,
/// too.
///
/// * `seen` - the visited voxels are added; those that are in it are not visited
pub(crate) fn simulate_scan(
    space: &ViewSpace,
    pattern: &RayPattern,
    pose: &Pose,
    seen: &mut SlotSet,
    mut visit: impl FnMut(SeenVoxel<'_>),
) -> RayHits {
    let mut hits = RayHits::default();
    for ray in &pattern.rays {
        let origin = pose.transform_point(&Point3::from(ray.origin)).coords;
        let along = pose.rotation * ray.direction;
        let mut hidden = false;
        for step in space.grid.walk_ray(&origin, &along, pattern.range[0], pattern.range[1]) {
            let (slot, voxel) = (step.slot, space.grid.get(step.slot));
            match voxel.state {
                VoxelState::Free => {}
                VoxelState::Excluded => break,
                VoxelState::Occupied => {
                    hits.surface += usize::from(!hidden && voxel.is_measurable_along(&along));
                    if !seen.contains(slot)
                        && (!space.lacks_points(voxel)
                            || visible_to_second_camera(space, pose, ray, slot))
                    {
                        seen.insert(slot);
                        visit(SeenVoxel { slot, voxel, along });
                    }
                    break;
                }
                VoxelState::Unknown | VoxelState::PossibleInside | VoxelState::PossibleBorder => {
                    hidden |= space.may_hide_surface(voxel);
                    if seen.insert(slot) {
                        visit(SeenVoxel { slot, voxel, along });
                    }
                }
            }
        }
        hits.hidden += usize::from(hidden);
    }
    hits
}

/// Whether no known surface lies between a voxel and the second camera of the sensor (for a laser
/// striper, its camera).
fn visible_to_second_camera(space: &ViewSpace, pose: &Pose, ray: &SensorRay, slot: u32) -> bool {
    let camera = pose.transform_point(&Point3::from(ray.second_viewpoint)).coords;
    let center = space.grid.center(slot);
    let distance = (center - camera).norm();
    let along = (center - camera) / distance;
    let end = distance - SURFACE_DEPTH_VOXELS * space.edge();
    !space.grid.walk_ray(&camera, &along, 0.0, end).any(|step| {
        matches!(space.grid.get(step.slot).state, VoxelState::Occupied | VoxelState::Excluded)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::ViewParams;
    use crate::view::tests::{space_with_plate, unknown_space, view_along};

    /// The slots of the voxels that a ray crosses between the distances of `range`, in order, by
    /// the slab method.
    fn crossed(space: &ViewSpace, origin: &Vec3, along: &Vec3, range: [f64; 2]) -> Vec<u32> {
        let mut found: Vec<(f64, u32)> = Vec::new();
        for slot in 0..space.grid.slots() as u32 {
            let voxel = space.grid.voxel(slot);
            if space.grid.slot(voxel).is_none() {
                continue;
            }
            let (mut enter, mut leave) = (range[0], range[1]);
            for axis in 0..3 {
                let low = f64::from(voxel[axis]) * space.edge() - origin[axis];
                let [a, b] = [low, low + space.edge()].map(|d| d / along[axis]);
                (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
            }
            if leave > enter + 1e-9 {
                found.push((enter, slot));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().map(|(_, slot)| slot).collect()
    }

    #[test]
    fn a_simulated_scan_sees_what_brute_force_sees() {
        let space = space_with_plate(&ViewParams::default());
        let pattern = RayPattern::new(&space.sensor, 0.06);
        for direction in [[0.1, 0.2, -1.0], [1.0, 0.3, -0.5], [0.4, -0.3, 1.0]].map(Vec3::from) {
            let pose = view_along(direction);
            let mut seen = SlotSet::new(space.grid.slots());
            let mut visited = Vec::new();
            let hits = simulate_scan(&space, &pattern, &pose, &mut seen, |voxel| {
                visited.push(voxel.slot);
            });
            let mut expected = Vec::new();
            let mut expected_hits = RayHits::default();
            for ray in &pattern.rays {
                let origin = pose.transform_point(&Point3::from(ray.origin)).coords;
                let along = pose.rotation * ray.direction;
                let mut hidden = false;
                for slot in crossed(&space, &origin, &along, pattern.range) {
                    let voxel = space.grid.get(slot);
                    if voxel.state == VoxelState::Free {
                        continue;
                    }
                    if !expected.contains(&slot) {
                        expected.push(slot);
                    }
                    if voxel.state == VoxelState::Occupied {
                        expected_hits.surface +=
                            usize::from(!hidden && voxel.is_measurable_along(&along));
                        break;
                    }
                    hidden |= space.may_hide_surface(voxel);
                }
                expected_hits.hidden += usize::from(hidden);
            }
            assert!(expected.len() > 100, "{}", expected.len());
            assert_eq!(visited, expected, "{direction:?}");
            assert_eq!(hits, expected_hits, "{direction:?}");
        }
    }

    fn is_seen_from_above(space: &ViewSpace, slot: u32) -> bool {
        let pattern = RayPattern::new(&space.sensor, space.edge());
        let mut seen = SlotSet::new(space.grid.slots());
        simulate_scan(space, &pattern, &view_along(-Vec3::z()), &mut seen, |_| {});
        seen.contains(slot)
    }

    #[test]
    fn a_voxel_that_lacks_points_is_seen_only_if_the_second_camera_sees_it() {
        let mut space = unknown_space(&ViewParams::default());
        let lacking = space.grid.slot_at(&Vec3::new(0.001, 0.001, -0.05)).unwrap();
        space.grid.get_mut(lacking).state = VoxelState::Occupied;
        assert!(is_seen_from_above(&space, lacking));
        // A voxel on the line from the second camera, which stands along the sensor's x.
        let SensorModel::Stereo(stereo) = space.sensor else { panic!("not a stereo pair") };
        let camera = view_along(-Vec3::z()) * Point3::new(stereo.baseline, 0.0, 0.0);
        let center = space.grid.center(lacking);
        let towards = (camera.coords - center).normalize();
        let between = space.grid.slot_at(&(center + towards * 0.12)).unwrap();
        space.grid.get_mut(between).state = VoxelState::Occupied;
        assert!(!is_seen_from_above(&space, lacking));
        // Once it has its points, nothing more is to be measured there and one camera is enough.
        space.grid.get_mut(lacking).points = 100;
        assert!(is_seen_from_above(&space, lacking));
    }

    #[test]
    fn overlap_is_the_share_of_surface_among_rays_into_the_object() {
        assert_eq!(RayHits { surface: 3, hidden: 1 }.overlap(), 0.75);
        assert_eq!(RayHits::default().overlap(), 0.0);
    }
}
