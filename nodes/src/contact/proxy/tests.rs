use super::*;
use crate::vector::add;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

fn proxy(mesh: TriangleMesh) -> MeshProxy {
    MeshProxy::outside(Arc::new(mesh))
}

/// Moves the device in small steps, as a servo would.
fn glide(proxy: &mut MeshProxy, from_m: Vec3, to_m: Vec3) -> Contact {
    (1..=200)
        .map(|k| proxy.update(add_scaled(from_m, sub(to_m, from_m), f64::from(k) / 200.0)))
        .last()
        .unwrap()
}

/// True if a point is inside a closed mesh, by the solid angles of all triangles: independent of index and predicates.
fn inside(mesh: &TriangleMesh, x: Vec3) -> bool {
    let angles = (0..mesh.triangles().len() as u32).map(|t| {
        let [a, b, c] = mesh.corners(t).map(|v| sub(v, x));
        let (la, lb, lc) = (norm(a), norm(b), norm(c));
        let below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
        2.0 * dot(a, cross(b, c)).atan2(below)
    });
    angles.sum::<f64>() > std::f64::consts::TAU
}

/// A closed body of bumps and dents (a sphere with a wavy radius): concave and convex edges everywhere.
fn bumpy(splits: u32) -> TriangleMesh {
    let ball = TriangleMesh::sphere(1.0, splits).unwrap();
    let radius = |v: Vec3| {
        0.05 * (1.0 + 0.15 * (9.0 * v[0]).sin() * (8.0 * v[1]).cos() + 0.1 * (11.0 * v[2] + 2.0 * v[0]).sin())
    };
    let corners: Vec<Vec3> = ball.vertices().iter().map(|v| scale(*v, radius(*v))).collect();
    TriangleMesh::new(&corners, ball.triangles()).unwrap()
}

#[test]
fn on_a_cube_the_proxy_is_the_projection_onto_the_face_first_touched() {
    let mut proxy = proxy(TriangleMesh::cuboid([0.02; 3]).unwrap());
    let contact = glide(&mut proxy, [0.003, 0.001, 0.02], [0.003, 0.001, 0.008]);
    assert!(contact.touching);
    assert!(distance(contact.ihip_m, [0.003, 0.001, 0.01]) < 2.0 * proxy.skin_m);
    assert!((contact.penetration_m - 0.002).abs() < 2.0 * proxy.skin_m);
    assert!(distance(contact.normal, [0.0, 0.0, 1.0]) < 1e-6);
    // Nearer to the side face than to the top: the god-object stays on top.
    let contact = glide(&mut proxy, [0.003, 0.001, 0.008], [0.0095, 0.001, 0.006]);
    assert!(distance(contact.ihip_m, [0.0095, 0.001, 0.01]) < 2.0 * proxy.skin_m);
    // Beyond the edge and down: now it is the side.
    glide(&mut proxy, [0.0095, 0.001, 0.006], [0.0105, 0.001, 0.006]);
    let contact = glide(&mut proxy, [0.0105, 0.001, 0.006], [0.009, 0.001, 0.006]);
    assert!(distance(contact.ihip_m, [0.01, 0.001, 0.006]) < 2.0 * proxy.skin_m);
    assert!(distance(contact.normal, [1.0, 0.0, 0.0]) < 1e-3);
    // And free again.
    assert!(!glide(&mut proxy, [0.009, 0.001, 0.006], [0.02, 0.0, 0.0]).touching);
}

#[test]
fn a_thin_plate_cannot_be_passed_in_one_step() {
    let mut proxy = proxy(TriangleMesh::cuboid([0.1, 0.1, 0.001]).unwrap());
    proxy.update([0.0, 0.0, 0.05]);
    let contact = proxy.update([0.001, 0.0, -0.05]);
    assert!(contact.touching);
    assert!((contact.ihip_m[2] - 0.0005).abs() < 2.0 * proxy.skin_m);
}

#[test]
fn in_a_dihedral_groove_the_proxy_finds_the_edge_and_in_a_pit_the_corner() {
    // Three walls meeting at the origin, the free side at positive coordinates.
    let far = 0.05;
    let corners = [
        [0.0; 3],
        [far, 0.0, 0.0],
        [0.0, far, 0.0],
        [0.0, 0.0, far],
        [far, far, 0.0],
        [0.0, far, far],
        [far, 0.0, far],
    ];
    let walls = [[0, 1, 4], [0, 4, 2], [0, 2, 5], [0, 5, 3], [0, 3, 6], [0, 6, 1]];
    let mesh = Arc::new(TriangleMesh::new(&corners, &walls).unwrap());
    let mut proxy = MeshProxy::new(mesh, [0.02, 0.02, 0.02]);
    let skin_m = proxy.skin_m;
    let contact = glide(&mut proxy, [0.02, 0.02, 0.02], [-0.003, -0.004, 0.02]);
    assert!(distance(contact.ihip_m, [0.0, 0.0, 0.02]) < 3.0 * skin_m, "{contact:?}");
    assert!(distance(contact.normal, [0.6, 0.8, 0.0]) < 1e-3);
    let contact = glide(&mut proxy, [-0.003, -0.004, 0.02], [-0.003, -0.004, -0.005]);
    assert!(norm(contact.ihip_m) < 4.0 * skin_m, "{contact:?}");
    let contact = glide(&mut proxy, [-0.003, -0.004, -0.005], [0.01, -0.004, -0.005]);
    assert!(distance(contact.ihip_m, [0.01, 0.0, 0.0]) < 4.0 * skin_m, "{contact:?}");
}

#[test]
fn on_a_fine_sphere_the_proxy_is_the_radial_projection() {
    let mut proxy = proxy(TriangleMesh::sphere(0.05, 5).unwrap());
    let mut hip_m = [0.0, 0.0, 0.06];
    for k in 0..4000 {
        let angle = f64::from(k) * 5e-4;
        let next_m = scale([angle.sin() * angle.cos(), angle.sin() * angle.sin(), angle.cos()], 0.046);
        let contact = if k == 0 { glide(&mut proxy, hip_m, next_m) } else { proxy.update(next_m) };
        hip_m = next_m;
        let expected = scale(next_m, 0.05 / 0.046);
        // Facets of 1.7 mm: the foot of the perpendicular moves by up to depth times facet angle.
        assert!(distance(contact.ihip_m, expected) < 2.5e-4, "{} at {k}", distance(contact.ihip_m, expected));
        assert!((contact.penetration_m - 0.004).abs() < 2e-5);
    }
}

#[test]
fn the_proxy_is_never_further_than_the_way_it_could_see_and_moves_without_jumps() {
    let mut proxy = proxy(TriangleMesh::cuboid([0.02; 3]).unwrap());
    glide(&mut proxy, [0.0, 0.0, 0.02], [0.0, 0.0, 0.0095]);
    let mut previous_m = proxy.proxy_m;
    for k in 0..2000 {
        let x = 0.008 * (f64::from(k) * 0.01).sin();
        let contact = proxy.update([x, 0.3 * x, 0.0095]);
        assert!(distance(contact.ihip_m, previous_m) < 1.2e-4);
        previous_m = contact.ihip_m;
    }
}

#[test]
fn a_tool_inside_feels_the_inside() {
    let mesh = Arc::new(TriangleMesh::cuboid([0.1; 3]).unwrap());
    let mut proxy = MeshProxy::new(mesh, [0.0; 3]);
    let contact = glide(&mut proxy, [0.0; 3], [0.01, 0.02, 0.055]);
    assert!(distance(contact.ihip_m, [0.01, 0.02, 0.05]) < 3.0 * proxy.skin_m);
    assert!(distance(contact.normal, [0.0, 0.0, -1.0]) < 1e-3);
}

#[test]
fn a_lost_position_is_no_contact_and_not_forgotten() {
    let mut proxy = proxy(TriangleMesh::cuboid([0.02; 3]).unwrap());
    glide(&mut proxy, [0.0, 0.0, 0.02], [0.0, 0.0, 0.009]);
    assert!(!proxy.update([f64::NAN, 0.0, 0.0]).touching);
    assert!(proxy.update([0.0, 0.0, 0.009]).touching);
}

/// A seeded walk that presses, glides, leaves and jumps.
struct Walk {
    rng: Xoshiro256PlusPlus,
    hip_m: Vec3,
    velocity: Vec3,
}

impl Walk {
    fn new(seed: u64) -> Self {
        Self { rng: Xoshiro256PlusPlus::seed_from_u64(seed), hip_m: [0.0, 0.0, 0.08], velocity: [0.0; 3] }
    }

    fn step(&mut self) -> Vec3 {
        if self.rng.random_range(0..5000) == 0 {
            self.hip_m = std::array::from_fn(|_| self.rng.random_range(-0.07..0.07));
        }
        for axis in 0..3 {
            self.velocity[axis] += self.rng.random_range(-2e-5..2e-5) - 3e-3 * self.velocity[axis];
        }
        // Drawn towards a shell at the surface, so that most of the walk is in contact.
        let pull = (0.046 - norm(self.hip_m)) * 2e-3 / norm(self.hip_m).max(1e-3);
        self.velocity = add_scaled(self.velocity, self.hip_m, pull);
        self.hip_m = add(self.hip_m, self.velocity);
        self.hip_m
    }
}

fn walk(mesh: TriangleMesh, steps: usize, looks: usize) -> (Vec<f64>, usize) {
    let mut proxy = proxy(mesh);
    let mut walk = Walk::new(11);
    let (mut times_s, mut touching) = (Vec::with_capacity(steps), 0);
    for k in 0..steps {
        let hip_m = walk.step();
        let start = std::time::Instant::now();
        let contact = proxy.update(hip_m);
        times_s.push(start.elapsed().as_secs_f64());
        touching += usize::from(contact.touching);
        assert!(contact.touching || contact.ihip_m == hip_m);
        if k % (steps / looks) == 0 {
            assert!(!inside(&proxy.mesh, contact.ihip_m), "popped through before step {k}");
        }
    }
    times_s.sort_by(f64::total_cmp);
    (times_s, touching)
}

#[test]
fn a_random_walk_over_bumps_never_pops_through() {
    let (_, touching) = walk(bumpy(4), 40_000, 400);
    assert!(touching > 10_000, "{touching} of 40000 steps in contact");
}

/// 100 000 triangles and a million steps: minutes in a debug build.
#[test]
#[ignore = "takes a minute; prints times"]
fn a_million_steps_over_a_hundred_thousand_triangles_never_pop_through() {
    let mesh = {
        // 81 920 triangles of the bumpy body, and a second one in its way.
        let body = bumpy(6);
        let mut corners = body.vertices().to_vec();
        let mut triangles = body.triangles().to_vec();
        let other = bumpy(5);
        let shift = corners.len() as u32;
        corners.extend(other.vertices().iter().map(|v| add(scale(*v, 0.4), [0.06, 0.0, 0.0])));
        triangles.extend(other.triangles().iter().map(|t| t.map(|i| i + shift)));
        TriangleMesh::new(&corners, &triangles).unwrap()
    };
    assert!(mesh.triangles().len() > 100_000);
    let (times_s, touching) = walk(mesh, 1_000_000, 1000);
    let at = |fraction: f64| times_s[(fraction * 999_999.0) as usize] * 1e6;
    #[allow(clippy::print_stderr)]
    {
        eprintln!(
            "god-object tick on 100 000 triangles: median {:.2} us, 99.9th percentile {:.2} us, {touching} steps in contact",
            at(0.5),
            at(0.999)
        );
    }
    assert!(at(0.5) < 50.0);
}
