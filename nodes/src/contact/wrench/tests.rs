use super::*;
use crate::vector::{direction, distance, reject, sub};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Objects of the thesis and their like, standing on a sensor whose origin is 8 mm below them.
fn objects() -> Vec<Arc<TriangleMesh>> {
    let solids = [
        (TriangleMesh::cuboid([0.0254; 3]).unwrap(), 0.0127),
        (TriangleMesh::cylinder(0.015, 0.03, 64).unwrap(), 0.015),
        (TriangleMesh::sphere(0.02, 4).unwrap(), 0.02),
    ];
    solids
        .into_iter()
        .map(|(mesh, half_m)| Arc::new(mesh.moved([0.0, 0.0, half_m + 0.008]).unwrap()))
        .collect()
}

fn locator(object: &Arc<TriangleMesh>) -> WrenchLocator {
    WrenchLocator::new(object.clone(), WrenchSettings::default()).unwrap()
}

/// A point of the surface, its normal and its triangle, by area.
fn any_point(mesh: &TriangleMesh, rng: &mut Xoshiro256PlusPlus) -> (Vec3, Vec3, u32) {
    let face = rng.random_range(0..mesh.triangles().len() as u32);
    let [a, b, c] = mesh.corners(face);
    let (u, v) = (0.97 * rng.random::<f64>() + 0.01, 0.97 * rng.random::<f64>() + 0.01);
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    (add_scaled(add_scaled(a, sub(b, a), u), sub(c, a), v), mesh.normal(face), face)
}

#[test]
fn the_point_pressed_is_the_point_found_on_every_object() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    for object in objects() {
        let mut locator = locator(&object);
        for _ in 0..2000 {
            let (point_m, normal, _) = any_point(&object, &mut rng);
            let side: Vec3 = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            let along = direction(reject(side, normal)).unwrap();
            let (load_n, drag_n) = (rng.random_range(0.2..5.0), rng.random_range(0.0..0.5));
            let force_n = add_scaled(scale(normal, -load_n), along, drag_n * load_n);
            let found = locator.update(force_n, cross(point_m, force_n));
            assert!(found.touching && found.miss_m == 0.0);
            assert!(distance(found.position_m, point_m) < 1e-12);
            assert!((found.normal_force_n - load_n).abs() < 1e-12);
            assert!(distance(found.friction_n, scale(along, -drag_n * load_n)) < 1e-12);
            assert!(found.residual_m < 1e-15);
        }
    }
}

#[test]
fn of_the_two_points_on_the_line_the_compressed_one_is_taken() {
    let cube = &objects()[0];
    let mut locator = locator(cube);
    let down = locator.update([0.0, 0.0, -1.0], cross([0.003, 0.004, 0.0], [0.0, 0.0, -1.0]));
    assert!(distance(down.position_m, [0.003, 0.004, 0.0334]) < 1e-12);
    let up = locator.update([0.0, 0.0, 1.0], cross([0.003, 0.004, 0.0], [0.0, 0.0, 1.0]));
    assert!(distance(up.position_m, [0.003, 0.004, 0.008]) < 1e-12, "from below the bottom is pressed");
    assert!((up.normal_force_n - 1.0).abs() < 1e-12);
}

#[test]
fn below_the_threshold_nothing_touches_and_the_point_stays() {
    let mut locator = locator(&objects()[0]);
    let point_m = [0.002, -0.001, 0.0334];
    let pressed = |n: f64| ([0.0, 0.0, -n], cross(point_m, [0.0, 0.0, -n]));
    let (force, torque) = pressed(0.0799);
    assert!(!locator.update(force, torque).touching);
    let (force, torque) = pressed(0.08);
    assert!(locator.update(force, torque).touching);
    let after = locator.update([0.0; 3], [0.0; 3]);
    assert!(!after.touching && after.normal_force_n == 0.0);
    assert!(distance(after.position_m, point_m) < 1e-12);
    assert!(!locator.update([f64::NAN, 0.0, -1.0], [0.0; 3]).touching);
    assert!(!locator.update([0.0, 0.0, -1.0], [f64::INFINITY, 0.0, 0.0]).touching);
}

#[test]
fn a_twist_shows_in_the_residual() {
    let mut locator = locator(&objects()[0]);
    let force_n = [0.0, 0.0, -2.0];
    let twisted = locator.update(force_n, [0.0, 0.0, 0.003]);
    assert!((twisted.residual_m - 0.0015).abs() < 1e-15);
}

#[test]
fn uncertainty_is_that_of_eq_5_2_4() {
    let locator = locator(&objects()[0]);
    // The checklist's figures for a lever of 10 mm.
    for (force_n, expected_mm) in [(0.08, 0.87), (0.25, 0.28), (0.5, 0.14), (1.0, 0.07)] {
        let found_mm = locator.uncertainty_m(force_n, 0.01 * force_n) * 1e3;
        assert!((found_mm - expected_mm).abs() < 0.006, "{found_mm} mm at {force_n} N");
    }
    assert!((locator.uncertainty_m(1.0, 0.0) - 1e-3 / 32.0).abs() < 1e-15);
}

#[test]
fn a_line_that_misses_gives_the_nearest_point_of_the_rim() {
    let mut locator = locator(&objects()[0]);
    let force_n = [0.0, 0.0, -1.0];
    let found = locator.update(force_n, cross([0.0130, 0.002, 0.0334], force_n));
    assert!((found.miss_m - 0.0003).abs() < 1e-9, "{found:?}");
    assert!((found.position_m[0] - 0.0127).abs() < 1e-9 && (found.position_m[1] - 0.002).abs() < 1e-9);
}

#[test]
fn a_concave_object_is_refused_by_its_edge() {
    let corners =
        [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.02, 0.0], [0.004, 0.004, 0.004], [0.0, 0.0, 0.02]];
    let dart = [[0, 2, 1], [0, 1, 4], [2, 0, 4], [1, 2, 3], [1, 3, 4], [3, 2, 4]];
    let mesh = Arc::new(TriangleMesh::new(&corners, &dart).unwrap());
    let refused = WrenchLocator::new(mesh, WrenchSettings::default()).unwrap_err();
    assert!(refused.to_string().contains("bend inwards"), "{refused}");
}
