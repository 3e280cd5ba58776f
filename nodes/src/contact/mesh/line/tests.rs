use super::*;
use crate::vector::{cross, direction, tangents};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Solids that stand in graphs, the shipped ball among them, and fans of thousands of triangles.
fn solids() -> Vec<TriangleMesh> {
    [
        TriangleMesh::cuboid([0.0254; 3]),
        TriangleMesh::cylinder(0.0127, 0.0254, 96),
        TriangleMesh::cylinder(0.0127, 0.0254, 5120),
        TriangleMesh::cylinder(0.5, 0.001, 2000),
        TriangleMesh::sphere(0.0127, 3),
        TriangleMesh::sphere(0.0127, 5),
    ]
    .map(|solid| turned(&solid.unwrap(), [0.3, 0.5, -0.2]))
    .into_iter()
    .chain([TriangleMesh::cylinder(0.0127, 0.0254, 5120).unwrap()])
    .collect()
}

/// The same, no edge along an axis.
fn turned(mesh: &TriangleMesh, towards: Vec3) -> TriangleMesh {
    let up = direction(add_scaled([0.0, 0.0, 1.0], towards, 1.0)).unwrap();
    let [a, b] = tangents(up);
    let turn = |v: &Vec3| add_scaled(add_scaled(add_scaled([0.0; 3], a, v[0]), b, v[1]), up, v[2]);
    let corners: Vec<Vec3> = mesh.vertices().iter().map(turn).collect();
    TriangleMesh::new(&corners, mesh.triangles()).unwrap()
}

fn any_direction(random: &mut Xoshiro256PlusPlus) -> Vec3 {
    let v: Vec3 = std::array::from_fn(|_| random.random_range(-1.0..1.0));
    direction(v).unwrap_or([1.0, 0.0, 0.0])
}

/// Lines that are hard: along faces and edges, through corners and the middle, beside the rim, far away, and any.
fn hard_lines(mesh: &TriangleMesh, count: usize, seed: u64) -> Vec<(Vec3, Vec3)> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut lines = Vec::new();
    for number in 0..count {
        let face = random.random_range(0..mesh.triangles().len() as u32);
        let [a, b, c] = mesh.corners(face);
        let normal = mesh.normal(face);
        let inside = std::array::from_fn(|i| (a[i] + b[i] + c[i]) / 3.0);
        let nudge = [0.0, 1e-15, 1e-9, 1e-6, 1e-3, 10.0][random.random_range(0..6)];
        let nudge_m = [-1.0, 1.0][random.random_range(0..2)] * nudge * mesh.diagonal_m();
        let any = any_direction(&mut random);
        let flat = direction(cross(normal, any)).unwrap();
        let edge = direction(sub(b, a)).unwrap();
        lines.push(match number % 8 {
            0 => (add_scaled(inside, normal, nudge_m), flat),
            1 => (add_scaled(a, normal, nudge_m), edge),
            2 => (add_scaled(a, any, nudge_m), normal),
            3 => (add_scaled(a, flat, nudge_m), any),
            4 => (add_scaled(mesh.centre_m(), flat, nudge_m), normal),
            5 => (add_scaled(inside, normal, nudge_m), edge),
            6 => (add_scaled(a, flat, nudge_m), direction(sub(a, mesh.centre_m())).unwrap()),
            _ => (add_scaled(inside, any, nudge_m), flat),
        });
    }
    lines
}

#[test]
fn no_line_costs_more_than_is_stated() {
    let mut through_all = 0;
    for mesh in solids() {
        let triangles = mesh.triangles().len();
        assert!(triangles <= 20_480);
        let most_visits = 4096 + 2 * triangles;
        let lines = if triangles < 9000 { 1000 } else { 150 };
        let visits: Vec<usize> = hard_lines(&mesh, lines, 1)
            .into_iter()
            .map(|(foot_m, along)| mesh.meet_line(foot_m, along).visits)
            .collect();
        let most = visits.iter().copied().max().unwrap();
        assert!(most <= most_visits, "{most} of {triangles}");
        through_all += visits.iter().filter(|visits| **visits > HIERARCHY_VISITS).count();
    }
    assert!(through_all > 10, "{through_all} went through all triangles");
}

#[test]
fn the_hierarchy_and_all_triangles_give_the_same_place() {
    for mesh in solids() {
        let lines = if mesh.triangles().len() < 9000 { 400 } else { 80 };
        for (foot_m, along) in hard_lines(&mesh, lines, 2) {
            let found = mesh.meet_line(foot_m, along);
            let foot_m = add_scaled(foot_m, along, dot(sub(mesh.centre_m, foot_m), along));
            let mut line = Line { foot_m, along, slack_m: 1e-9 * mesh.diagonal_m, visits: 0 };
            let by_all = mesh.clip(&mut line).unwrap_or_else(|| mesh.beside(&mut line));
            let apart_m = distance(found.position_m, by_all.position_m);
            let gaps_m = (found.miss_m, line.gap_m(by_all.position_m));
            assert!((gaps_m.0 - gaps_m.1).abs() <= 4.0 * line.slack_m, "{gaps_m:?}");
            assert!(apart_m <= 1e-6 * mesh.diagonal_m, "{apart_m}, {found:?}, {:?}", by_all.position_m);
        }
    }
}

/// By its definition: the least distance between the line and a fine grid of points of the surface.
#[test]
fn a_line_that_misses_is_given_the_nearest_point() {
    let mesh = turned(&TriangleMesh::cylinder(0.02, 0.03, 12).unwrap(), [0.2, -0.4, 0.1]);
    let mut missed = 0;
    for (foot_m, along) in hard_lines(&mesh, 300, 3) {
        let found = mesh.meet_line(foot_m, along);
        let line = Line { foot_m, along, slack_m: 0.0, visits: 0 };
        let mut least_m = f64::INFINITY;
        for triangle in 0..mesh.triangles().len() as u32 {
            let [a, b, c] = mesh.corners(triangle);
            for (u, v) in (0..=40).flat_map(|u| (0..=40 - u).map(move |v| (u, v))) {
                let (u, v) = (f64::from(u) / 40.0, f64::from(v) / 40.0);
                let point = add_scaled(add_scaled(a, sub(b, a), u), sub(c, a), v);
                least_m = least_m.min(line.gap_m(point));
            }
        }
        assert!(found.miss_m <= least_m + 1e-12, "{} of {least_m}", found.miss_m);
        if found.miss_m > 0.0 {
            missed += 1;
            assert!((line.gap_m(found.position_m) - found.miss_m).abs() < 1e-9 * (1.0 + found.miss_m));
            assert!(found.miss_m > least_m - 0.02 * mesh.diagonal_m());
        }
    }
    assert!(missed > 60, "{missed}");
}
