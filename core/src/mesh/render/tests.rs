use super::*;
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
    let index = |i: usize, j: usize| (i * 2 * steps + j % (2 * steps)) as u32;
    for (i, j) in (0..steps).flat_map(|i| (0..2 * steps).map(move |j| (i, j))) {
        let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// A box with its lower corner at the origin.
fn cuboid(size: Vec3) -> Mesh {
    let corner = |i: usize| Vec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64);
    let vertices = (0..8).map(|i| corner(i).component_mul(&size)).collect();
    let quads: [[u32; 4]; 6] =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    Mesh::new(vertices, triangles)
}

fn along(direction: Vec3, up: Vec3) -> RenderView {
    RenderView { direction, up }
}

fn pixels(image: &Image) -> impl Iterator<Item = [u8; 3]> + '_ {
    image.rgb.chunks_exact(3).map(|p| [p[0], p[1], p[2]])
}

/// Covered pixels, and the box (left, right, top, bottom; inclusive) that they fill.
fn covered(image: &Image) -> (usize, [usize; 4]) {
    let mut bounds = [usize::MAX, 0, usize::MAX, 0];
    let mut count = 0;
    for (i, _) in pixels(image).enumerate().filter(|(_, p)| *p != BACKGROUND) {
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
    let side = 300.0 * (1.0 - 2.0 * MARGIN);
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
    // Red above, green below, seen from the front; the violet inside shows where the lid is missing.
    let mut mesh = cuboid(Vec3::new(1.0, 1.0, 1.0));
    mesh.sigma = mesh.vertices.iter().map(|v| if v.z > 0.5 { 1.0 } else { 1e-3 }).collect();
    let image = render(&mesh, along(Vec3::y(), Vec3::z()), 100, 100);
    let at = |image: &Image, x: usize, y: usize| {
        let i = 3 * (y * image.width + x);
        [image.rgb[i], image.rgb[i + 1], image.rgb[i + 2]]
    };
    let (above, below) = (at(&image, 50, 8), at(&image, 50, 92));
    assert!(below[1] > below[0] && above[0] > below[0], "{above:?} over {below:?}");
    let closed = at(&render(&mesh, along(-Vec3::z(), Vec3::y()), 100, 100), 50, 50);
    mesh.triangles.drain(2..4);
    let open = at(&render(&mesh, along(-Vec3::z(), Vec3::y()), 100, 100), 50, 50);
    let violet = |c: [u8; 3]| c[2] > c[0] && c[0] > c[1];
    assert!(violet(open) && !violet(closed), "{open:?} {closed:?}");
}

#[test]
fn smooth_shading_removes_the_facets() {
    let mut mesh = sphere(6);
    let step = |image: &Image| {
        let row: Vec<i32> =
            pixels(image).skip(100 * 200).take(200).map(|p| i32::from(p[1])).collect();
        row[20..180].windows(2).map(|w| (w[1] - w[0]).abs()).max().unwrap()
    };
    let flat = step(&render(&mesh, along(Vec3::y(), Vec3::z()), 200, 200));
    mesh.compute_normals();
    let smooth = step(&render(&mesh, along(Vec3::y(), Vec3::z()), 200, 200));
    assert!(flat > 3 * smooth, "{flat} {smooth}");
}

#[test]
fn a_sheet_shows_six_sides_to_one_scale() {
    let sheet = render_sheet(&cuboid(Vec3::new(0.4, 0.2, 0.1)), 302, 200);
    assert_eq!((sheet.width, sheet.height, sheet.rgb.len()), (302, 200, 3 * 302 * 200));
    let cell = |column: usize, row: usize| {
        let mut part = Image::empty(100, 100);
        for y in 0..100 {
            let from = 3 * ((row * 100 + y) * 302 + column * 100);
            part.rgb[300 * y..300 * (y + 1)].copy_from_slice(&sheet.rgb[from..from + 300]);
        }
        let (_, [left, right, top, bottom]) = covered(&part);
        (right - left + 1, bottom - top + 1)
    };
    let expected = [(94, 24), (47, 24), (94, 24), (47, 24), (94, 47), (94, 47)];
    for (index, (width, height)) in expected.into_iter().enumerate() {
        let (w, h) = cell(index % 3, index / 3);
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
