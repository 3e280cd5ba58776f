use super::*;
use proptest::prelude::*;
use std::sync::LazyLock;

const TETRAHEDRON_OBJ: &str = "# a corner of 10 mm\nmtllib none.mtl\no corner\nv 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\n\
                               f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

fn ascii_stl(mesh: &TriangleMesh) -> String {
    let mut text = String::from("solid test\n");
    for t in 0..mesh.triangles().len() as u32 {
        text += " facet normal 0 0 0\n  outer loop\n";
        for [x, y, z] in mesh.corners(t) {
            text += &format!("   vertex {:e} {:e} {:e}\n", x * 1e3, y * 1e3, z * 1e3);
        }
        text += "  endloop\n endfacet\n";
    }
    text + "endsolid test\n"
}

#[test]
fn solids_are_closed_convex_and_turned_outwards() {
    let solids = [
        TriangleMesh::cuboid([0.0254; 3]).unwrap(),
        TriangleMesh::cylinder(0.012, 0.03, 48).unwrap(),
        TriangleMesh::sphere(0.05, 3).unwrap(),
    ];
    for solid in &solids {
        assert_eq!(solid.check_convex(), Ok(()));
        for t in 0..solid.triangles().len() as u32 {
            assert!(dot(solid.normal(t), solid.corners(t)[0]) > 0.0);
        }
    }
    assert_eq!(solids[2].triangles().len(), 1280);
    assert_eq!(solids[2].vertices().len(), 642);
}

#[test]
fn a_file_that_ends_within_a_triangle_is_incomplete() {
    let format = MeshFormat::Stl;
    let two_announced = [&[0; 80][..], &2_u32.to_le_bytes(), &[0; 60]].concat();
    for bytes in [&two_announced[..], &two_announced[..70]] {
        let error = TriangleMesh::from_bytes(bytes, format, 0.001).err();
        assert_eq!(error, Some(MeshError::Incomplete { format }));
    }
}

#[test]
fn lines_of_normals_are_ignored_whatever_white_space_begins_them() {
    for space in ["", " \t", "\u{b}", "\u{a0}", "\u{3000}"] {
        let faces = TETRAHEDRON_OBJ.replace("f 1 3 2", "f 1//6148914691236517206 3 2");
        let text = format!("{space}vn 0 0 1\n{space}vt 0 0\n{faces}");
        let mesh = TriangleMesh::from_bytes(text.as_bytes(), MeshFormat::Obj, 1e-3).unwrap();
        assert_eq!(mesh.triangles().len(), 4, "{space:?}");
    }
}

#[test]
fn stl_and_obj_give_the_same_solid() {
    let obj = TriangleMesh::from_bytes(TETRAHEDRON_OBJ.as_bytes(), MeshFormat::Obj, 1e-3).unwrap();
    let stl = TriangleMesh::from_bytes(ascii_stl(&obj).as_bytes(), MeshFormat::Stl, 1e-3).unwrap();
    for mesh in [&obj, &stl] {
        assert_eq!((mesh.vertices().len(), mesh.triangles().len()), (4, 4));
        assert_eq!(mesh.check_convex(), Ok(()));
        assert!((mesh.diagonal_m() - 0.03_f64.sqrt() * 0.1).abs() < 1e-9);
    }
}

#[test]
fn a_binary_stl_is_read_and_welded() {
    let cube = TriangleMesh::cuboid([0.02; 3]).unwrap();
    let mut bytes = vec![0_u8; 80];
    bytes.extend(12_u32.to_le_bytes());
    for t in 0..12 {
        bytes.extend([0_u8; 12]);
        cube.corners(t).iter().flatten().for_each(|x| bytes.extend((*x as f32 * 1e3).to_le_bytes()));
        bytes.extend([0_u8; 2]);
    }
    let read = TriangleMesh::from_bytes(&bytes, MeshFormat::Stl, 1e-3).unwrap();
    assert_eq!((read.vertices().len(), read.triangles().len()), (8, 12));
    assert_eq!(read.check_convex(), Ok(()));
}

#[test]
fn triangles_without_area_are_left_out_and_inside_out_is_turned() {
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.0, 0.0]];
    let inside_out = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0], [0, 1, 4], [2, 2, 1]];
    let mesh = TriangleMesh::new(&corners, &inside_out).unwrap();
    assert_eq!(mesh.triangles().len(), inside_out.len() - 2);
    assert_eq!(mesh.check_convex(), Ok(()));
}

#[test]
fn a_concave_solid_names_its_edge() {
    // A cube whose top is pushed in at the middle.
    let mut corners = TriangleMesh::cuboid([0.02; 3]).unwrap().vertices().to_vec();
    corners.push([0.0, 0.0, 0.006]);
    let sides: [[u32; 4]; 5] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1]];
    let mut triangles: Vec<[u32; 3]> =
        sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    triangles.extend([[4, 5, 8], [5, 7, 8], [7, 6, 8], [6, 4, 8]]);
    let error = TriangleMesh::new(&corners, &triangles).unwrap().check_convex().unwrap_err();
    assert!(matches!(error.fault, EdgeFault::Concave { degrees } if degrees > 10.0), "{error}");
    assert!(error.to_string().contains("mm the faces bend inwards"), "{error}");
    triangles.pop();
    let error = TriangleMesh::new(&corners, &triangles).unwrap().check_convex().unwrap_err();
    assert!(matches!(error.fault, EdgeFault::Open), "{error}");
}

#[test]
fn two_bodies_are_no_convex_solid() {
    let cube = TriangleMesh::cuboid([0.01; 3]).unwrap();
    let mut corners = cube.vertices().to_vec();
    corners.extend(cube.vertices().iter().map(|v| add(*v, [0.05, 0.0, 0.0])));
    let mut triangles = cube.triangles().to_vec();
    triangles.extend(cube.triangles().iter().map(|t| t.map(|i| i + 8)));
    let error = TriangleMesh::new(&corners, &triangles).unwrap().check_convex().unwrap_err();
    assert_eq!(error.fault, EdgeFault::Apart);
}

#[test]
fn files_that_are_no_mesh_say_so() {
    let read = |bytes: &[u8], format| TriangleMesh::from_bytes(bytes, format, 1e-3).unwrap_err().to_string();
    assert!(read(b"solid x\n facet\n", MeshFormat::Stl).starts_with("the STL file"));
    assert!(read(&[0; 20], MeshFormat::Stl).starts_with("the STL file"));
    let mut huge = vec![0_u8; 80];
    huge.extend(u32::MAX.to_le_bytes());
    assert!(read(&huge, MeshFormat::Stl).starts_with("the STL file"));
    assert!(read(b"v 0 0 zero\n", MeshFormat::Obj).starts_with("the OBJ file"));
    assert!(read(b"v 0 0 0\nf 1 2 3\n", MeshFormat::Obj).starts_with("the OBJ file"));
    assert!(read(b"", MeshFormat::Obj).contains("no triangle"));
    let unit = TriangleMesh::from_bytes(TETRAHEDRON_OBJ.as_bytes(), MeshFormat::Obj, 0.0).unwrap_err();
    assert_eq!(unit, MeshError::BadUnit { unit_m: 0.0 });
}

#[test]
fn ways_through_edges_and_corners_never_slip_through() {
    let ball = TriangleMesh::sphere(0.05, 2).unwrap();
    for t in 0..ball.triangles().len() as u32 {
        let [a, b, c] = ball.corners(t);
        for target in [a, scale(add(a, b), 0.5), scale(add(add(a, b), c), 1.0 / 3.0)] {
            assert!(ball.first_hit(scale(target, 1.5), [0.0; 3]).is_some());
            assert!(ball.first_hit(scale(target, 1.001), scale(target, 0.999)).is_some());
        }
    }
}

/// The first intersection, by looking at every triangle.
fn first_of_all(mesh: &TriangleMesh, a: Vec3, b: Vec3) -> Option<f64> {
    let triangles = 0..mesh.triangles().len() as u32;
    let hits = triangles.filter_map(|t| index::crossing(mesh.corners(t), a, b));
    hits.reduce(f64::min)
}

/// A ball, and a cylinder of many strips, whose triangles are long and thin.
static BODIES: LazyLock<[TriangleMesh; 2]> = LazyLock::new(|| {
    [TriangleMesh::sphere(0.05, 2).unwrap(), TriangleMesh::cylinder(0.04, 0.05, 300).unwrap()]
});

proptest! {
    #[test]
    fn the_index_finds_what_looking_at_every_triangle_finds(
        a in prop::array::uniform3(-0.08..0.08_f64), b in prop::array::uniform3(-0.08..0.08_f64),
    ) {
        let ball = &BODIES[0];
        let (inside_a, inside_b) = (norm(a) < 0.047, norm(b) < 0.047);
        if inside_a != inside_b && norm(a).max(norm(b)) > 0.05 {
            prop_assert!(ball.first_hit(a, b).is_some());
        }
        for mesh in BODIES.iter() {
            let corners = (0..mesh.triangles().len() as u32).map(|t| mesh.corners(t));
            let nearest = corners.map(|corners| distance(closest_on_triangle(a, corners), a)).fold(1.0, f64::min);
            let (point, triangle) = mesh.closest(a);
            prop_assert!((distance(point, a) - nearest).abs() < 1e-15);
            prop_assert_eq!(closest_on_triangle(a, mesh.corners(triangle)), point);
            let first = mesh.first_hit(a, b);
            prop_assert_eq!(first.map(|hit| hit.fraction), first_of_all(mesh, a, b));
            if let Some(hit) = first {
                let point = crate::vector::add_scaled(a, sub(b, a), hit.fraction);
                let on = closest_on_triangle(point, mesh.corners(hit.triangle));
                prop_assert!(distance(on, point) < 1e-12);
            }
        }
    }
}

/// Mean number of triangles, or parts of them, at which the search for a first hit looks, for strokes of 20 um just above
/// the top.
fn looked_at(mesh: &TriangleMesh) -> f64 {
    let top_m = mesh.vertices().iter().map(|v| v[2]).fold(f64::NEG_INFINITY, f64::max);
    let strokes = (0..1000).map(|k| {
        let (sin, cos) = (2.4 * f64::from(k)).sin_cos();
        let radius_m = 0.009 * f64::from(k) / 1000.0;
        let from_m = mesh.closest([radius_m * cos, radius_m * sin, top_m]).0;
        let segment = index::Segment::new(from_m, add(from_m, [-2e-5 * sin, 2e-5 * cos, -1e-6]));
        let mut seen = 0;
        let into = |_: &mut usize, node: &index::Node| Some(segment.touches(node));
        mesh.index.walk(&mut seen, into, |seen, _| *seen += 1);
        seen
    });
    strokes.sum::<usize>() as f64 / 1000.0
}

#[test]
fn long_thin_triangles_are_found_about_as_fast_as_others() {
    let (ball, cube) = (TriangleMesh::sphere(0.0127, 5).unwrap(), TriangleMesh::cuboid([0.0254; 3]).unwrap());
    let cylinder = TriangleMesh::cylinder(0.0127, 0.0254, 1000).unwrap();
    let parts = |mesh: &TriangleMesh| {
        let mut parts = 0;
        mesh.index.walk(&mut parts, |_, _| Some(true), |parts, _| *parts += 1);
        parts
    };
    // Well-shaped triangles are indexed whole.
    assert_eq!((parts(&ball), parts(&cube)), (20_480, 12));
    assert!(parts(&cylinder) < 20 * 4000, "{}", parts(&cylinder));
    let (on_ball, on_cylinder) = (looked_at(&ball), looked_at(&cylinder));
    // By every triangle it would be 4000, by whole boxes 178.
    assert!(on_cylinder < 8.0 * on_ball, "{on_cylinder} on the cylinder, {on_ball} on the ball");
}

#[test]
fn meshes_that_cannot_be_computed_with_are_refused() {
    let corners = |scale: f64, at: f64| [[at, 0.0, 0.0], [at + scale, 0.0, 0.0], [at, scale, 0.0]];
    for (scale, at) in [(1e30, 0.0), (1e-30, 0.0), (1e-3, 1e30), (1.0, -1e9)] {
        let refused = TriangleMesh::new(&corners(scale, at), &[[0, 1, 2]]).unwrap_err();
        assert!(matches!(refused, MeshError::OutOfScale { .. }), "{scale} at {at}: {refused}");
    }
    assert!(TriangleMesh::new(&corners(0.01, 100.0), &[[0, 1, 2]]).is_ok());
}
