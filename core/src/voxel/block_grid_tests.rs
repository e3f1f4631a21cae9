use super::*;
use crate::voxel::walk_ray;

fn bounds() -> Aabb {
    Aabb { min: Vec3::new(-0.53, -0.2, 0.11), max: Vec3::new(0.71, 0.94, 1.23) }
}

#[test]
fn slots_name_the_voxels_of_the_box_one_to_one() {
    let grid = BlockGrid::<u8>::new(&bounds(), 0.1).unwrap();
    let mut seen = vec![false; grid.slots()];
    for x in -7..10 {
        for y in -4..12 {
            for z in 0..15 {
                let inside = (-6..8).contains(&x) && (-2..10).contains(&y) && (1..13).contains(&z);
                let slot = grid.slot([x, y, z]);
                assert_eq!(slot.is_some(), inside, "{x} {y} {z}");
                let Some(slot) = slot else { continue };
                assert_eq!(grid.voxel(slot), [x, y, z]);
                assert!(!std::mem::replace(&mut seen[slot as usize], true));
            }
        }
    }
    assert_eq!(seen.iter().filter(|s| **s).count(), grid.voxels());
}

#[test]
fn what_is_written_is_read_and_listed_and_the_rest_takes_no_room() {
    let mut grid = BlockGrid::<u8>::new(&bounds(), 0.01).unwrap();
    let slot = grid.slot([3, 40, 50]).unwrap();
    *grid.get_mut(slot) = 7;
    assert_eq!((*grid.get(slot), *grid.get(slot + 1)), (7, 0));
    assert_eq!(grid.iter().filter(|(_, v)| **v > 0).collect::<Vec<_>>(), [(slot, &7)]);
    assert_eq!(grid.iter().count(), 512);
    assert!(grid.memory() < 40_000, "{}", grid.memory());
}

#[test]
fn a_ray_crosses_the_same_voxels_as_the_plain_walk() {
    let grid = BlockGrid::<u8>::new(&bounds(), 0.1).unwrap();
    for i in 0..200 {
        let t = f64::from(i);
        let origin = Vec3::new((t * 1.3).sin() * 2.0, (t * 0.7).cos() * 2.0, (t * 2.9).sin() * 2.0);
        let aim = Vec3::new((t * 0.31).sin() * 0.4, 0.4, 0.6 + (t * 0.17).cos() * 0.4);
        let direction = (aim - origin).normalize();
        let expected: Vec<Voxel> = walk_ray(&origin, &direction, 0.1, 5.0)
            .map(|(voxel, _)| voxel)
            .filter(|voxel| grid.slot(*voxel).is_some())
            .collect();
        let steps: Vec<RayStep> = grid.walk_ray(&origin, &direction, 0.0, 5.0).collect();
        let found: Vec<Voxel> = steps.iter().map(|s| grid.voxel(s.slot)).collect();
        assert_eq!(found, expected, "ray {i}");
        for pair in steps.windows(2) {
            assert!((pair[0].leave - pair[1].enter).abs() < 1e-12);
        }
    }
}

#[test]
fn a_ray_along_an_axis_a_ray_beside_the_box_and_one_that_ends_early() {
    let grid = BlockGrid::<u8>::new(&bounds(), 0.1).unwrap();
    let origin = Vec3::new(0.05, 0.05, 5.0);
    assert_eq!(grid.walk_ray(&origin, &-Vec3::z(), 0.0, 9.0).count(), 12);
    assert_eq!(grid.walk_ray(&origin, &Vec3::z(), 0.0, 9.0).count(), 0);
    assert_eq!(grid.walk_ray(&Vec3::new(3.0, 0.0, 5.0), &-Vec3::z(), 0.0, 9.0).count(), 0);
    assert_eq!(grid.walk_ray(&origin, &-Vec3::z(), 0.0, 5.0 - 1.25).count(), 1);
    assert_eq!(grid.walk_ray(&origin, &-Vec3::z(), 4.65, 9.0).count(), 3);
}

/// What a box is refused with.
fn refusal(bounds: &Aabb, edge: f64) -> String {
    BlockGrid::<u8>::new(bounds, edge).err().unwrap().to_string()
}

#[test]
fn a_senseless_box_is_refused_with_what_to_change() {
    assert!(refusal(&Aabb::EMPTY, 0.1).contains("first corner below"));
    assert!(refusal(&bounds(), 0.0).contains("must be positive"));
    assert!(refusal(&bounds(), 1e-5).contains("larger voxels"));
    let far = Aabb { min: Vec3::repeat(1e9), max: Vec3::repeat(1e9 + 1.0) };
    assert!(refusal(&far, 0.1).contains("smaller box"));
}

#[test]
fn neighbours_are_those_of_the_box_whose_coordinates_differ_by_one() {
    let grid = BlockGrid::<u8>::new(&bounds(), 0.1).unwrap();
    for voxel in [[0, 0, 5], [-6, -2, 1], [7, 9, 12], [7, 3, 4]] {
        let slot = grid.slot(voxel).unwrap();
        let (mut faces, mut cube) = (Vec::new(), Vec::new());
        for other in (0..grid.slots() as u32).filter(|s| grid.slot(grid.voxel(*s)) == Some(*s)) {
            let apart = [0, 1, 2].map(|i| (grid.voxel(other)[i] - voxel[i]).abs());
            if apart.iter().sum::<i32>() == 1 {
                faces.push(other);
            }
            if apart.iter().all(|d| *d <= 1) {
                cube.push(other);
            }
        }
        let [mut near_faces, mut near_cube]: [Vec<u32>; 2] =
            [grid.neighbours(slot).collect(), grid.cube_around(slot).collect()];
        near_faces.sort_unstable();
        near_cube.sort_unstable();
        assert_eq!((near_faces, near_cube), (faces, cube), "{voxel:?}");
    }
}
