//! Contact nodes: of a tool with one shape or several, and the parts of a contact.

use super::Contact;
use super::mesh::{MeshFormat, TriangleMesh};
use super::shape::{Scene, Shape as SolidShape, ShapeError};
use crate::vector::Vec3;
use haptograph_engine::document::value::{Shape, Value};
use haptograph_engine::frame::{Record, Scalar, Vector};
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, NodeKind, Port, Processor, Tick};
use haptograph_engine::settings::{Expected, NoSettings, Part, Reading, Setting};
use haptograph_signal::files;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::Millimetres;
use std::path::{Path, PathBuf};
use std::sync::Arc;

haptograph_engine::settings! {
    /// A half space.
    pub struct PlaneSettings {
        /// A point of its surface, mm.
        origin_mm: [Millimetres; 3] = [Millimetres(0.0); 3];
        /// Outward direction, of any length.
        normal: [f64; 3] = [0.0, 0.0, 1.0];
    }
}

haptograph_engine::settings! {
    /// A sphere.
    pub struct SphereSettings {
        /// Centre, mm.
        centre_mm: [Millimetres; 3] = [Millimetres(0.0); 3];
        /// Diameter, mm.
        diameter_mm: Millimetres = Millimetres(100.0), in 0.001..=100_000.0;
    }
}

haptograph_engine::settings! {
    /// A box with edges along the axes.
    pub struct BoxSettings {
        /// Centre, mm.
        centre_mm: [Millimetres; 3] = [Millimetres(0.0); 3];
        /// Extents along x, y and z, mm.
        size_mm: [Millimetres; 3];
    }
}

haptograph_engine::settings! {
    /// A triangle mesh.
    pub(crate) struct MeshSettings {
        /// STL or OBJ file, relative to the graph file.
        file: PathBuf;
        /// Millimetres of one unit of the file.
        unit_mm: Millimetres = Millimetres(1.0), in 1e-9..=1e9;
        /// A point in free space on the side that the tool feels, mm; none: above the mesh.
        start_mm: Option<[Millimetres; 3]> = None;
    }
}

haptograph_engine::choices! {
    /// One shape of a scene.
    pub(crate) enum Solid {
        /// A half space.
        Plane(PlaneSettings),
        /// A sphere.
        Sphere(SphereSettings),
        /// A box, touched from outside.
        Box(BoxSettings),
        /// A room: a box touched from inside.
        Room(BoxSettings),
        /// A triangle mesh.
        Mesh(MeshSettings),
    }
}

/// One shape, written as such, or a list of shapes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Solids(pub Vec<Solid>);

impl Setting for Solids {
    fn expected() -> Expected {
        let one = Solid::expected();
        Expected::described(format!("{one}, or a list of them"))
    }

    fn parts() -> Vec<Part> {
        Solid::parts()
    }

    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        match value.shape {
            Shape::List(_) => Vec::read(value, reading).map(Self),
            _ => Solid::read(value, reading).map(|solid| Self(vec![solid])),
        }
    }

    fn value(&self) -> Value {
        match &self.0[..] {
            [one] => one.value(),
            _ => self.0.value(),
        }
    }
}

pub(crate) fn metres(mm: [Millimetres; 3]) -> Vec3 {
    mm.map(Millimetres::si)
}

impl Solid {
    pub(crate) fn to_shape(&self) -> Result<SolidShape, BuildError> {
        Ok(match self {
            Self::Plane(plane) => {
                SolidShape::Plane { origin_m: metres(plane.origin_mm), normal: plane.normal }
            }
            Self::Sphere(sphere) => {
                SolidShape::Sphere { centre_m: metres(sphere.centre_mm), diameter_m: sphere.diameter_mm.si() }
            }
            Self::Box(cuboid) => {
                SolidShape::Box { centre_m: metres(cuboid.centre_mm), size_m: metres(cuboid.size_mm) }
            }
            Self::Room(room) => {
                SolidShape::Room { centre_m: metres(room.centre_mm), size_m: metres(room.size_mm) }
            }
            Self::Mesh(mesh) => SolidShape::Mesh {
                mesh: Arc::new(load_mesh(&mesh.file, mesh.unit_mm)?),
                start_m: mesh.start_mm.map(metres),
            },
        })
    }
}

/// A mesh from the file that the setting `file` names.
pub(crate) fn load_mesh(file: &Path, unit: Millimetres) -> Result<TriangleMesh, BuildError> {
    let Some(format) = MeshFormat::of(file) else {
        let message = format!("{} has neither the extension .stl nor .obj", file.display());
        return Err(BuildError::at("file", message).help("export the mesh as STL or OBJ"));
    };
    let failed =
        |error: &dyn std::error::Error| BuildError::at("file", format!("{}: {error}", file.display()));
    let unread =
        |error: std::io::Error| BuildError::at("file", format!("cannot read {}: {error}", file.display()));
    let bytes = files::read(file, files::MAX_MESH_BYTES).map_err(unread)?;
    TriangleMesh::from_bytes(&bytes, format, unit.si()).map_err(|error| failed(&error))
}

haptograph_engine::settings! {
    /// Settings of [`ContactNode`].
    pub struct ContactSettings {
        /// The shape, or a list of shapes: Plane, Sphere, Box, Room or Mesh with their settings.
        solids: Solids;
        /// Diameter of the ball at the tool's tip, mm.
        proxy_diameter_mm: Millimetres = Millimetres(3.2), in 0.0..=1000.0;
    }
}

haptograph_engine::node! {
    /// Contact of a tool with a plane, a sphere, a box, a room or a triangle mesh, or with several of them at once, of
    /// which the deepest contact applies. HIP and IHIP are positions of the centre of the ball at the tool's tip. A mesh
    /// comes from an STL or OBJ file and is touched by a point only, `proxy_diameter_mm: 0`; the god-object proxy never
    /// passes through one of its triangles.
    pub struct ContactNode as "Contact"(ContactSettings) in "contact";
    source: "4.3, 4.5.2, A.3.2; Zilles and Salisbury 1995";
    example: r#""touch": Contact(position: "arm.position", solids: [Room(size_mm: [160.0, 160.0, 120.0]), Sphere(diameter_mm: 50.0)])"#;
    in POSITION: Vector = Port::of(Quantity::LENGTH, "Position of the tool (HIP), m.");
    out CONTACT: Contact = Port::of(Quantity::NUMBER, "HIP, IHIP, penetration, outward normal and face.");
    out SOLID: Scalar = Port::of(Quantity::NUMBER, "Index of the touched shape, from 0.");
}

impl NodeKind for ContactNode {
    fn build(settings: ContactSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        let (Solids(solids), proxy_diameter_m) = (settings.solids, settings.proxy_diameter_mm.si());
        if solids.is_empty() {
            return Err(BuildError::at("solids", "`solids` is empty").help("list at least one shape"));
        }
        let mut shapes = Vec::with_capacity(solids.len());
        for (place, solid) in solids.iter().enumerate() {
            let shape = solid.to_shape().map_err(|error| error.inside("solids", place))?;
            // Each by itself first, so that an error names its shape.
            Scene::new(std::slice::from_ref(&shape), proxy_diameter_m).map_err(|error| at(error, place))?;
            shapes.push(shape);
        }
        let scene = Scene::new(&shapes, proxy_diameter_m).map_err(|error| at(error, 0))?;
        Ok(Built::new(Toucher { scene }))
    }
}

/// An error of a shape at its setting.
fn at(error: ShapeError, place: usize) -> BuildError {
    let ShapeError::OutOfRange { name, .. } = error;
    let own = match name {
        "proxy_diameter_m" => return BuildError::at("proxy_diameter_mm", error.to_string()),
        "normal" => "normal",
        "diameter_m" => "diameter_mm",
        _ => "size_mm",
    };
    BuildError::at(own, error.to_string()).inside("solids", place)
}

#[derive(Debug, Clone)]
struct Toucher {
    scene: Scene,
}

impl Processor<ContactNode> for Toucher {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, ContactNode>) {
        let positions = io.read(ContactNode::POSITION);
        let (contacts, solids) = io.write_all((ContactNode::CONTACT, ContactNode::SOLID));
        for ((contact, solid), hip_m) in contacts.iter_mut().zip(solids).zip(positions) {
            let (touch, which): (Contact, usize) = self.scene.update(*hip_m);
            *contact = touch.to_components();
            *solid = which as f64;
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.scene.copy_state_from(&self.scene);
    }
}

haptograph_engine::node! {
    /// The components of a contact as separate signals.
    pub struct ContactParts(NoSettings) in "contact";
    source: "4.3";
    example: r#""parts": ContactParts(contact: "touch.contact")"#;
    in CONTACT: Contact = Port::of(Quantity::NUMBER, "The contact.");
    out TOUCHING: Scalar = Port::of(Quantity::NUMBER, "1 while the tool touches, else 0.");
    out HIP: Vector = Port::of(Quantity::LENGTH, "Haptic interface point: position of the tool, m.");
    out IHIP: Vector = Port::of(Quantity::LENGTH, "Ideal haptic interface point: the proxy, m.");
    out NORMAL: Vector = Port::of(Quantity::NUMBER, "Outward unit normal; zero in free space.");
    out PENETRATION: Scalar = Port::of(Quantity::LENGTH, "Distance from HIP to IHIP, m.");
}

impl NodeKind for ContactParts {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(ContactParts))
    }
}

impl Processor<ContactParts> for ContactParts {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, ContactParts>) {
        let contacts = io.decode(ContactParts::CONTACT);
        let (touching, hip, ihip, normal, penetration) = io.write_all((
            ContactParts::TOUCHING,
            ContactParts::HIP,
            ContactParts::IHIP,
            ContactParts::NORMAL,
            ContactParts::PENETRATION,
        ));
        for (frame, contact) in contacts.enumerate() {
            touching[frame] = f64::from(u8::from(contact.touching));
            hip[frame] = contact.hip_m;
            ihip[frame] = contact.ihip_m;
            normal[frame] = contact.normal;
            penetration[frame] = contact.penetration_m;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{add_scaled, norm};
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    fn bench(solids: Vec<Solid>, proxy_diameter_mm: f64) -> Result<Bench, BuildError> {
        let settings =
            ContactSettings { solids: Solids(solids), proxy_diameter_mm: Millimetres(proxy_diameter_mm) };
        Bench::new::<ContactNode>(settings, 1000.0, &[Kind::VECTOR])
    }

    fn sphere(diameter_mm: f64) -> Solid {
        Solid::Sphere(SphereSettings {
            centre_mm: [Millimetres(0.0); 3],
            diameter_mm: Millimetres(diameter_mm),
        })
    }

    #[test]
    fn a_tip_in_the_thesis_sphere_is_pushed_out_of_it() {
        let mut bench = bench(vec![sphere(100.0)], 3.2).unwrap();
        let out = bench.run(&[&[0.0, 0.0, 0.0506, 0.0, 0.03, 0.04, 0.0, 0.0, 0.06]]).remove(0);
        let contacts: Vec<Contact> = out.as_chunks().0.iter().map(Contact::from_components).collect();
        assert!(contacts[0].touching && contacts[1].touching && !contacts[2].touching);
        assert!((contacts[0].penetration_m - 0.001).abs() < 1e-12);
        assert!((norm(contacts[1].ihip_m) - 0.0516).abs() < 1e-12);
        let along = add_scaled(contacts[1].hip_m, contacts[1].normal, contacts[1].penetration_m);
        assert!(crate::vector::distance(along, contacts[1].ihip_m) < 1e-12);
    }

    #[test]
    fn a_scene_says_which_solid_is_touched() {
        let room = BoxSettings { centre_mm: [Millimetres(0.0); 3], size_mm: [Millimetres(100.0); 3] };
        let mut bench = bench(vec![Solid::Room(room), sphere(20.0)], 0.0).unwrap();
        let out = bench.run(&[&[0.0, 0.0, 0.052, 0.0, 0.0, 0.03, 0.0, 0.0, 0.009]]);
        assert_eq!(out[1], [0.0, 0.0, 1.0]);
        let touching: Vec<f64> = out[0].iter().step_by(12).copied().collect();
        assert_eq!(touching, [1.0, 0.0, 1.0]);
    }

    #[test]
    fn shapes_that_cannot_be_touched_are_refused_at_their_field() {
        let plane = PlaneSettings { origin_mm: [Millimetres(0.0); 3], normal: [0.0; 3] };
        let mesh = MeshSettings { file: "tool.step".into(), unit_mm: Millimetres(1.0), start_mm: None };
        for (wrong, field) in [(Solid::Plane(plane), "normal"), (Solid::Mesh(mesh), "file")] {
            let refused = bench(vec![sphere(10.0), wrong], 0.0).err().unwrap();
            assert_eq!((refused.field, refused.inside), (Some(field), Some(("solids", 1))));
        }
        let refused = bench(Vec::new(), 0.0).err();
        assert_eq!(refused.and_then(|e| e.field), Some("solids"));
    }
}
