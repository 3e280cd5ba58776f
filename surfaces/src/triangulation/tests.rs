use super::*;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// A map with corners, border points and `inner` random ones.
fn random_points(inner: usize, seed: u64) -> Vec<(f64, f64)> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let (max_speed, max_force) = (0.2422, 3.17);
    let mut points = vec![(0.0, 0.0), (max_speed, 0.0), (0.0, max_force), (max_speed, max_force)];
    for k in 1..5 {
        let part = k as f64 / 5.0;
        points.extend([(part * max_speed, 0.0), (part * max_speed, max_force)]);
        points.extend([(0.0, part * max_force), (max_speed, part * max_force)]);
    }
    points.extend((0..inner).map(|_| {
        (random.random_range(0.001..0.999) * max_speed, random.random_range(0.001..0.999) * max_force)
    }));
    points
}

fn random_map(inner: usize, seed: u64) -> (Vec<(f64, f64)>, Triangulation) {
    let points = random_points(inner, seed);
    let triangulation = Triangulation::new(&points, delaunay(&points).unwrap()).unwrap();
    (points, triangulation)
}

fn place(points: &[(f64, f64)], map: &Triangulation, location: &Location) -> (f64, f64) {
    let corners = map.triangles()[location.triangle as usize].map(|vertex| points[vertex as usize]);
    let mix = |f: fn(&(f64, f64)) -> f64| (0..3).map(|i| location.weights[i] * f(&corners[i])).sum();
    (mix(|p| p.0), mix(|p| p.1))
}

#[test]
fn delaunay_circles_are_empty_among_z_scores() {
    let points = random_points(30, 5);
    let (x, y) = (z_scores(points.iter().map(|p| p.0)), z_scores(points.iter().map(|p| p.1)));
    for triangle in delaunay(&points).unwrap() {
        let [a, b, c] = triangle.map(|v| nalgebra::Vector2::new(x[v as usize], y[v as usize]));
        let (ab, ac) = (b - a, c - a);
        let twice_area = ab.perp(&ac);
        let centre = nalgebra::Vector2::new(
            ac.y * ab.norm_squared() - ab.y * ac.norm_squared(),
            ab.x * ac.norm_squared() - ac.x * ab.norm_squared(),
        ) / (2.0 * twice_area);
        for v in 0..points.len() {
            let distance = (nalgebra::Vector2::new(x[v], y[v]) - a - centre).norm();
            assert!(distance >= centre.norm() * (1.0 - 1e-9), "vertex {v} inside the circle of {triangle:?}");
        }
    }
}

#[test]
fn a_walk_ends_where_trying_all_ends_whatever_its_start() {
    let (_, map) = random_map(25, 1);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
    for _ in 0..2000 {
        let point =
            (random.random::<f64>() * map.max_speed_m_s(), random.random::<f64>() * map.max_force_n());
        let expected = map.locate_by_trying_all(point.0, point.1);
        let start = random.random_range(0..map.triangles().len() as u32);
        assert_eq!(map.locate_from(start, point.0, point.1), expected);
    }
}

#[test]
fn on_the_sides_of_a_grid_a_walk_ends_where_trying_all_ends() {
    let places = (0..6).flat_map(|i| (0..5).map(move |j| (0.05 * f64::from(i), 0.7 * f64::from(j))));
    let points: Vec<(f64, f64)> = places.collect();
    let map = Triangulation::new(&points, delaunay(&points).unwrap()).unwrap();
    for triangle in map.triangles() {
        for i in 0..3 {
            let [a, b] = [triangle[i], triangle[(i + 1) % 3]].map(|vertex| points[vertex as usize]);
            for part in [0.0, 1e-300, 1e-17, 0.3, 0.5, 1.0 - 1e-16] {
                let (speed, force) = (a.0 + part * (b.0 - a.0), a.1 + part * (b.1 - a.1));
                let expected = map.locate_by_trying_all(speed, force);
                for start in 0..map.triangles().len() as u32 {
                    assert_eq!(map.locate_from(start, speed, force), expected);
                }
            }
        }
    }
}

#[test]
fn at_a_vertex_its_weight_is_exactly_one_whatever_the_start() {
    let (points, map) = random_map(25, 3);
    for (vertex, &(speed, force)) in points.iter().enumerate() {
        let expected = map.locate_from(0, speed, force);
        for start in 0..map.triangles().len() as u32 {
            let location = map.locate_from(start, speed, force);
            assert_eq!(location, expected);
            let triangle = map.triangles()[location.triangle as usize];
            let expected = triangle.map(|corner| if corner as usize == vertex { 1.0 } else { 0.0 });
            assert_eq!(location.weights, expected);
        }
    }
}

#[test]
fn on_the_border_only_border_vertices_weigh() {
    let (points, map) = random_map(25, 4);
    let (max_speed, max_force) = (map.max_speed_m_s(), map.max_force_n());
    for k in 0..=1000 {
        let part = k as f64 / 1000.0;
        for (speed, force) in [
            (0.0, part * max_force),
            (max_speed, part * max_force),
            (part * max_speed, 0.0),
            (part * max_speed, max_force),
        ] {
            let (speed, force) = map.saturate(speed, force);
            let location = map.locate_from(k % 7, speed, force);
            let triangle = map.triangles()[location.triangle as usize];
            for i in 0..3 {
                let (s, f) = points[triangle[i] as usize];
                let shares = (speed == s && (s == 0.0 || s == max_speed))
                    || (force == f && (f == 0.0 || f == max_force));
                assert!(shares || location.weights[i] == 0.0);
            }
        }
    }
}

#[test]
fn saturation_takes_anything() {
    let (_, map) = random_map(3, 4);
    assert_eq!(map.saturate(f64::NAN, f64::INFINITY), (0.0, 0.0));
    assert_eq!(map.saturate(-1.0, f64::NEG_INFINITY), (0.0, 0.0));
    assert_eq!(map.saturate(9.0, 0.5), (map.max_speed_m_s(), 0.5));
}

#[test]
fn a_map_with_a_hole_a_fold_or_a_missing_vertex_is_refused() {
    let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.5, 0.5)];
    let good = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    assert!(Triangulation::new(&square, good.clone()).is_ok());
    assert!(matches!(Triangulation::new(&square, good[..3].to_vec()), Err(TriangulationError::Gap { .. })));
    let twice = [&good[..], &good[..]].concat();
    assert!(matches!(Triangulation::new(&square, twice), Err(TriangulationError::Overlap { .. })));
    let beyond = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 5]];
    assert!(matches!(
        Triangulation::new(&square, beyond),
        Err(TriangulationError::NoSuchVertex { vertex: 5, .. })
    ));
    let without_centre = vec![[0, 1, 2], [0, 2, 3]];
    assert_eq!(Triangulation::new(&square, without_centre), Err(TriangulationError::Unused { vertex: 4 }));
    assert!(matches!(Triangulation::new(&square, vec![]), Err(TriangulationError::Cover { .. })));
    assert!(matches!(Triangulation::new(&[], vec![]), Err(TriangulationError::Flat)));
    assert!(matches!(
        Triangulation::new(&square, vec![[0, 0, 4]]),
        Err(TriangulationError::Degenerate { triangle: 0 })
    ));
}

proptest! {
    #[test]
    fn weights_give_the_point_back(seed in 0u64..50, inner in 0usize..40, speed in 0.0..1.0f64, force in 0.0..1.0f64, start in 0u32..200) {
        let (points, map) = random_map(inner, seed);
        let (speed, force) = (speed * map.max_speed_m_s(), force * map.max_force_n());
        let location = map.locate_from(start, speed, force);
        prop_assert!(location.weights.iter().all(|w| (0.0..=1.0).contains(w)));
        prop_assert!((location.weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        let back = place(&points, &map, &location);
        prop_assert!((back.0 - speed).abs() < 1e-13 && (back.1 - force).abs() < 1e-12);
    }
}
