use super::*;
use crate::vector::scale;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

fn touch(shape: Shape) -> Touch {
    Touch::new(&shape, 0.0).unwrap()
}

#[test]
fn the_sphere_of_the_toolkit_is_felt_at_51_6_mm() {
    let sphere = Shape::Sphere { centre_m: [0.0; 3], diameter_m: 0.1 };
    let mut touch = Touch::new(&sphere, 0.0032).unwrap();
    assert!(!touch.update([0.0, 0.0, 0.0517]).touching);
    let contact = touch.update([0.0, 0.03, 0.04]);
    assert!((contact.penetration_m - 0.0016).abs() < 1e-15);
    assert!(distance(contact.normal, [0.0, 0.6, 0.8]) < 1e-15);
    assert!(distance(contact.ihip_m, scale([0.0, 0.6, 0.8], 0.0516)) < 1e-15);
}

#[test]
fn a_plane_pushes_along_its_normal() {
    let mut touch = touch(Shape::Plane { origin_m: [0.0, 0.0, 0.1], normal: [0.0, 0.0, 2.0] });
    assert!(!touch.update([1.0, 1.0, 0.1]).touching);
    let contact = touch.update([0.2, 0.3, 0.097]);
    assert!((contact.penetration_m - 0.003).abs() < 1e-15);
    assert_eq!((contact.normal, contact.ihip_m), ([0.0, 0.0, 1.0], [0.2, 0.3, 0.1]));
}

#[test]
fn a_box_in_closed_form_and_as_a_mesh_feel_the_same() {
    let size_m = [0.02, 0.03, 0.025];
    let mut closed = touch(Shape::Box { centre_m: [0.0; 3], size_m });
    let mesh = Arc::new(TriangleMesh::cuboid(size_m).unwrap());
    let mut meshed = touch(Shape::Mesh { mesh, start_m: None });
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    let (mut hip_m, mut velocity) = ([0.0, 0.0, 0.03], [0.0; 3]);
    let (mut touching, mut different) = (0, 0);
    for _ in 0..60_000 {
        velocity = std::array::from_fn(|i| {
            velocity[i] * 0.995 + rng.random_range(-1e-5..1e-5) - 3e-6 * (hip_m[i] / 0.02)
        });
        hip_m = add(hip_m, velocity);
        let (a, b) = (closed.update(hip_m), meshed.update(hip_m));
        touching += usize::from(a.touching);
        different += usize::from(a.touching != b.touching || distance(a.ihip_m, b.ihip_m) > 1e-6);
    }
    assert!(touching > 10_000, "{touching}");
    // Where the way runs over an edge within the mesh's skin the two may part for a moment.
    assert!(different < touching / 1000, "{different} of {touching}");
}

#[test]
fn a_box_cannot_be_passed_in_one_step() {
    let mut touch = touch(Shape::Box { centre_m: [0.0; 3], size_m: [0.1, 0.1, 0.001] });
    touch.update([0.0, 0.0, 0.05]);
    let contact = touch.update([0.0, 0.0, -0.05]);
    assert!(contact.touching && contact.face == 5);
    assert_eq!(contact.ihip_m, [0.0, 0.0, 0.0005]);
}

#[test]
fn a_room_holds_the_tool_in_its_corners() {
    let mut touch = Touch::new(&Shape::Room { centre_m: [0.0; 3], size_m: [0.1; 3] }, 0.01).unwrap();
    assert!(!touch.update([0.0449, 0.0, 0.0]).touching);
    let wall = touch.update([0.046, 0.0, 0.01]);
    assert_eq!(wall.face, 1);
    assert!(distance(wall.normal, [-1.0, 0.0, 0.0]) < 1e-12 && (wall.penetration_m - 0.001).abs() < 1e-12);
    let corner = touch.update([0.048, 0.0, 0.049]);
    assert!(
        distance(corner.normal, [-0.6, 0.0, -0.8]) < 1e-12 && (corner.penetration_m - 0.005).abs() < 1e-12
    );
}

#[test]
fn of_a_scene_the_deepest_contact_counts() {
    let shapes = [
        Shape::Room { centre_m: [0.0; 3], size_m: [0.16; 3] },
        Shape::Sphere { centre_m: [-0.04, 0.0, 0.0], diameter_m: 0.05 },
        Shape::Box { centre_m: [0.04, 0.0, 0.0], size_m: [0.04; 3] },
    ];
    let mut scene = Scene::new(&shapes, 0.0032).unwrap();
    assert!(!scene.update([0.0, 0.05, 0.0]).0.touching);
    assert_eq!(scene.update([-0.04, 0.025, 0.0]).1, 1);
    scene.update([0.04, 0.05, 0.0]);
    assert_eq!(scene.update([0.04, 0.02, 0.0]).1, 2);
    assert_eq!(scene.update([0.0, 0.079, 0.0]).1, 0);
}

#[test]
fn shapes_without_extent_are_refused() {
    let refused = |shape: Shape| Touch::new(&shape, 0.002).unwrap_err().to_string();
    assert!(refused(Shape::Sphere { centre_m: [0.0; 3], diameter_m: -1.0 }).contains("diameter_m is -1"));
    assert!(
        refused(Shape::Room { centre_m: [0.0; 3], size_m: [0.1, 0.001, 0.1] }).contains("size_m is 0.001")
    );
    assert!(refused(Shape::Plane { origin_m: [0.0; 3], normal: [0.0; 3] }).contains("normal"));
}
