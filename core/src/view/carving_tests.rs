use super::*;
use crate::geometry::Aabb;

const EDGE: f64 = 0.1;

fn grid() -> BlockGrid<VoxelRecord> {
    let bounds = Aabb { min: Vec3::repeat(-0.55), max: Vec3::repeat(0.55) };
    BlockGrid::new(&bounds, EDGE).unwrap()
}

/// A pose outside the grid that is not aligned with it.
fn pose() -> Pose {
    Pose::new(Vec3::new(0.9, 1.1, -1.3), Vec3::new(0.3, -0.2, 0.5))
}

/// A scan from [`pose`] of points that are given in the object frame.
fn scan_of(points: &[Vec3]) -> Scan {
    let sensor_from_object = pose().inverse();
    let points = points.iter().map(|point| {
        let local = sensor_from_object * Point3::from(*point);
        [local.x as f32, local.y as f32, local.z as f32]
    });
    Scan { points: points.collect(), ..Scan::default() }
}

fn scattered_points(count: usize) -> Vec<Vec3> {
    let directions = (0..count).map(|i| {
        let t = i as f64 * 1.7;
        Vec3::new((t * 1.31).sin(), (t * 0.73).cos(), (t * 2.17).sin()) * 0.5
    });
    directions.collect()
}

/// Distances at which a ray enters and leaves a voxel, by the slab method; `None` if it misses.
fn crossing(grid: &BlockGrid<VoxelRecord>, slot: u32, ray: &Ray) -> Option<[f64; 2]> {
    let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let low = f64::from(grid.voxel(slot)[axis]) * EDGE - ray.origin[axis];
        let [a, b] = [low, low + EDGE].map(|d| d / ray.direction[axis]);
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    (leave > enter + 1e-9).then_some([enter, leave])
}

/// The slots of all voxels of the box, ascending.
fn all_slots(grid: &BlockGrid<VoxelRecord>) -> Vec<u32> {
    (0..grid.slots() as u32).filter(|slot| grid.slot(grid.voxel(*slot)) == Some(*slot)).collect()
}

fn slots_of(set: &SlotSet) -> Vec<u32> {
    set.iter().collect()
}

#[test]
fn rays_carve_the_voxels_that_brute_force_finds() {
    let grid = grid();
    let scan = scan_of(&scattered_points(25));
    let evidence = carve(&grid, &scan, &pose(), 1);
    let rays: Vec<Ray> = (0..25).filter_map(|i| measured_ray(&scan, &pose(), i)).collect();
    let (mut traversed, mut passed, mut occluded) = (Vec::new(), Vec::new(), Vec::new());
    for slot in all_slots(&grid) {
        let crossings: Vec<([f64; 2], f64)> =
            rays.iter().filter_map(|ray| Some((crossing(&grid, slot, ray)?, ray.length))).collect();
        if crossings.iter().any(|([_, leave], length)| leave <= length) {
            traversed.push(slot);
        }
        if crossings.iter().any(|([_, leave], length)| *leave <= length - EDGE) {
            passed.push(slot);
        }
        if crossings.iter().any(|([enter, _], length)| enter > length) {
            occluded.push(slot);
        }
    }
    assert!(passed.len() > 50 && passed.len() < traversed.len(), "{}", passed.len());
    assert_eq!(slots_of(&evidence.traversed), traversed);
    assert_eq!(slots_of(&evidence.passed), passed);
    assert_eq!(slots_of(&evidence.occluded), occluded);
}

#[test]
fn points_are_counted_by_voxel_and_those_without_support_are_left_out() {
    let grid = grid();
    let (alone, pair) = (Vec3::new(-0.3, -0.3, -0.33), Vec3::new(0.33, 0.31, 0.32));
    // Two voxels that touch at an edge support each other.
    let points = [alone, pair, pair.add_scalar(0.01), pair + Vec3::new(0.1, 0.1, 0.0)];
    let evidence = carve(&grid, &scan_of(&points), &pose(), 3);
    let expected = [(pair, 2), (points[3], 1)]
        .map(|(point, points)| VoxelHits { slot: grid.slot_at(&point).unwrap(), points });
    assert_eq!(evidence.hits.len(), 2);
    assert!(expected.iter().all(|hits| evidence.hits.contains(hits)));
    assert_eq!(slots_of(&evidence.hit).len(), 2);
    assert!(carve(&grid, &scan_of(&points), &pose(), 4).hits.is_empty());
    assert_eq!(carve(&grid, &scan_of(&points), &pose(), 1).hits.len(), 3);
}

#[test]
fn of_the_points_in_an_eighth_of_a_voxel_one_ray_is_cast_and_all_are_counted() {
    let grid = grid();
    let center = grid.center(grid.slot_at(&Vec3::new(0.1, 0.2, 0.3)).unwrap());
    let octants: Vec<Vec3> = (0..8)
        .map(|i| center + Vec3::from_fn(|axis, _| if i >> axis & 1 == 0 { -0.02 } else { 0.02 }))
        .collect();
    let ends = ray_ends(&grid, &scan_of(&octants), &pose());
    assert_eq!(ends.iter().map(|end| end.octant % 8).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5, 6, 7]);
    assert!(ends.iter().all(|end| end.slot() == ends[0].slot()));
    let twice: Vec<Vec3> = octants.iter().flat_map(|p| [*p, p.add_scalar(0.001)]).collect();
    let evidence = carve(&grid, &scan_of(&twice), &pose(), 3);
    assert_eq!(evidence.hits, [VoxelHits { slot: ends[0].slot(), points: 16 }]);
}

#[test]
fn points_in_solid_space_outside_the_grid_and_without_a_return_say_nothing() {
    let mut grid = grid();
    let solid = Vec3::new(0.12, 0.12, 0.12);
    let slot = grid.slot_at(&solid).unwrap();
    grid.get_mut(slot).state = VoxelState::Excluded;
    let mut scan = scan_of(&[solid, Vec3::repeat(3.0)]);
    scan.points.push([f32::NAN; 3]);
    let evidence = carve(&grid, &scan, &pose(), 1);
    assert!(evidence.hits.is_empty());
    assert_eq!(slots_of(&evidence.traversed).len() + slots_of(&evidence.occluded).len(), 0);
}

#[test]
fn returns_from_beyond_free_the_voxels_well_before_them_and_nothing_else() {
    let grid = grid();
    let mut evidence = carve(&grid, &Scan::default(), &pose(), 1);
    let beyond = scan_of(&[Vec3::new(-0.2, 0.1, 0.3), Vec3::new(0.4, -0.3, 0.2)]);
    carve_beyond(&grid, &beyond, &pose(), &mut evidence);
    let rays: Vec<Ray> = (0..2).filter_map(|i| measured_ray(&beyond, &pose(), i)).collect();
    let mut free = all_slots(&grid);
    free.retain(|slot| {
        rays.iter().any(|ray| {
            crossing(&grid, *slot, ray).is_some_and(|[_, leave]| leave <= ray.length - EDGE)
        })
    });
    assert!(free.len() > 5, "{}", free.len());
    assert_eq!(slots_of(&evidence.traversed), free);
    assert_eq!(slots_of(&evidence.passed), free);
    assert!(evidence.hits.is_empty() && slots_of(&evidence.occluded).is_empty());
}
