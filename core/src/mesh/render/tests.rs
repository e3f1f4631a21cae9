use super::camera::MARGIN_RATIO;
use super::*;
use crate::geometry::Vec3;
use crate::mesh::test_shapes;
use std::f64::consts::PI;

/// A sphere of unit radius, by longitude and latitude.
fn sphere(steps: usize) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..=steps {
        for j in 0..2 * steps {
            let (theta, phi) = (PI * i as f64 / steps as f64, PI * j as f64 / steps as f64);
            let (ring, z) = theta.sin_cos();
            mesh.vertices.push(Vec3::new(ring * phi.cos(), ring * phi.sin(), z));
        }
    }
    for (i, j) in (0..steps).flat_map(|i| (0..2 * steps).map(move |j| (i, j))) {
        let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            .map(|(i, j)| (i * 2 * steps + j % (2 * steps)) as u32);
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// A box with its lower corner at the origin.
fn cuboid(size: Vec3) -> Mesh {
    test_shapes::cuboid(Vec3::zeros(), size)
}

fn along(direction: Vec3, up: Vec3) -> RenderView {
    RenderView { direction, up }
}

fn pixels(image: &Image) -> impl Iterator<Item = [u8; 3]> + '_ {
    image.rgb.chunks_exact(3).map(|p| [p[0], p[1], p[2]])
}

fn pixel(image: &Image, x: usize, y: usize) -> [u8; 3] {
    let i = 3 * (y * image.width + x);
    [image.rgb[i], image.rgb[i + 1], image.rgb[i + 2]]
}

fn is_violet([red, green, blue]: [u8; 3]) -> bool {
    blue > red && red > green
}

/// Largest step of the green channel between neighbours in the middle row of a picture of 200 x 200
/// pixels.
fn largest_step(image: &Image) -> i32 {
    let row: Vec<i32> = pixels(image).skip(100 * 200).take(200).map(|p| i32::from(p[1])).collect();
    row[20..180].windows(2).map(|w| (w[1] - w[0]).abs()).max().unwrap()
}

/// Size of what a cell of 100 x 100 pixels of a sheet shows.
fn extent_in_cell(sheet: &Image, column: usize, row: usize) -> (usize, usize) {
    let mut part = Image::empty(100, 100);
    for y in 0..100 {
        let from = 3 * ((row * 100 + y) * sheet.width + column * 100);
        part.rgb[300 * y..300 * (y + 1)].copy_from_slice(&sheet.rgb[from..from + 300]);
    }
    let (_, [left, right, top, bottom]) = covered(&part);
    (right - left + 1, bottom - top + 1)
}

/// Covered pixels, and the box (left, right, top, bottom; inclusive) that they fill.
fn covered(image: &Image) -> (usize, [usize; 4]) {
    let mut bounds = [usize::MAX, 0, usize::MAX, 0];
    let mut count = 0;
    for (i, _) in pixels(image).enumerate().filter(|(_, p)| *p != BACKGROUND_RGB) {
        let (x, y) = (i % image.width, i / image.width);
        bounds = [bounds[0].min(x), bounds[1].max(x), bounds[2].min(y), bounds[3].max(y)];
        count += 1;
    }
    (count, bounds)
}

#[test]
fn a_sphere_covers_a_quarter_of_pi_of_its_box() {
    let view = along(Vec3::new(1.0, 2.0, -0.5), Vec3::z());
    let image = render(&sphere(60), view, 400, 300);
    let (count, [left, right, top, bottom]) = covered(&image);
    let side = 300.0 * (1.0 - 2.0 * MARGIN_RATIO);
    assert!(
        ((right - left) as f64 - side).abs() < 3.0 && ((bottom - top) as f64 - side).abs() < 3.0
    );
    // Pixels that are covered in part count whole.
    let share = count as f64 / ((side + 1.0) * (side + 1.0));
    assert!((share / (PI / 4.0) - 1.0).abs() < 0.01, "{share}");
}

#[test]
fn a_box_shows_its_silhouette_from_each_side() {
    let mesh = cuboid(Vec3::new(0.4, 0.2, 0.1));
    for (direction, up, ratio) in
        [(Vec3::y(), Vec3::z(), 4.0), (Vec3::x(), Vec3::z(), 2.0), (-Vec3::z(), Vec3::y(), 2.0)]
    {
        let (count, [left, right, top, bottom]) =
            covered(&render(&mesh, along(direction, up), 300, 200));
        let (width, height) = (right - left + 1, bottom - top + 1);
        assert_eq!(count, width * height, "a rectangle without holes");
        assert!((width as f64 / height as f64 - ratio).abs() < 0.1, "{width} x {height}");
    }
}

#[test]
fn the_nearer_side_hides_the_other_and_up_is_up() {
    // Red above, green below, seen from the front; the violet inside shows where the lid is
    // missing.
    let mut mesh = cuboid(Vec3::new(1.0, 1.0, 1.0));
    mesh.sigma = mesh.vertices.iter().map(|v| if v.z > 0.5 { 1.0 } else { 1e-3 }).collect();
    let image = render(&mesh, along(Vec3::y(), Vec3::z()), 100, 100);
    let (above, below) = (pixel(&image, 50, 8), pixel(&image, 50, 92));
    assert!(below[1] > below[0] && above[0] > below[0], "{above:?} over {below:?}");
    let closed = pixel(&render(&mesh, along(-Vec3::z(), Vec3::y()), 100, 100), 50, 50);
    mesh.triangles.drain(2..4);
    let open = pixel(&render(&mesh, along(-Vec3::z(), Vec3::y()), 100, 100), 50, 50);
    assert!(is_violet(open) && !is_violet(closed), "{open:?} {closed:?}");
}

#[test]
fn smooth_shading_removes_the_facets() {
    let mut mesh = sphere(6);
    let flat = largest_step(&render(&mesh, along(Vec3::y(), Vec3::z()), 200, 200));
    mesh.compute_normals();
    let smooth = largest_step(&render(&mesh, along(Vec3::y(), Vec3::z()), 200, 200));
    assert!(flat > 3 * smooth, "{flat} {smooth}");
}

#[test]
fn a_sheet_shows_six_sides_to_one_scale() {
    let sheet = render_sheet(&cuboid(Vec3::new(0.4, 0.2, 0.1)), 302, 200);
    assert_eq!((sheet.width, sheet.height, sheet.rgb.len()), (302, 200, 3 * 302 * 200));
    let expected = [(94, 24), (47, 24), (94, 24), (47, 24), (94, 47), (94, 47)];
    for (index, (width, height)) in expected.into_iter().enumerate() {
        let (w, h) = extent_in_cell(&sheet, index % 3, index / 3);
        assert!(w.abs_diff(width) <= 1 && h.abs_diff(height) <= 1, "{index}: {w} x {h}");
    }
}

#[test]
fn nothing_and_broken_vertices_give_a_picture_all_the_same() {
    let view = RenderView::default();
    assert_eq!(render(&Mesh::default(), view, 10, 10), Image::empty(10, 10));
    assert_eq!(render(&cuboid(Vec3::x()), view, 0, 10).rgb, Vec::<u8>::new());
    let mut mesh = cuboid(Vec3::new(1.0, 1.0, 1.0));
    mesh.vertices[0].x = f64::NAN;
    assert!(covered(&render(&mesh, along(Vec3::zeros(), Vec3::zeros()), 50, 50)).0 > 100);
}
