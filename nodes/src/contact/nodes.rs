//! Contact nodes: one for each shape, and one for scenes of several shapes.

use super::Contact;
use super::mesh::{MeshFormat, TriangleMesh};
use super::shape::{Scene, Shape, ShapeError};
use crate::successor;
use crate::vector::Vec3;
use haptograph_engine::frame::{Kind, OneKind, Record, Scalar, Vector};
use haptograph_engine::node::{
    BuildContext, BuildError, Input, InputSpec, Io, NodeKind, NodeSpec, Output, OutputSpec, Processor, Tick,
    input, output,
};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::files;
use haptograph_signal::quantity::Quantity;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const POSITION: &[InputSpec] = &[input(
    "position",
    Kind::VECTOR,
    Quantity::LENGTH,
    "Position of the tool (HIP), m.",
)];

const CONTACT: OutputSpec = output(
    "contact",
    Contact::KIND,
    Quantity::NUMBER,
    "HIP, IHIP, penetration, outward normal and face.",
);

const SOURCE: &str = "4.3, A.3.2; Zilles and Salisbury 1995";

haptograph_engine::settings! {
    /// A half space.
    pub struct PlaneSettings {
        /// A point of its surface, mm.
        origin_mm: [f64; 3] = [0.0, 0.0, 0.0];
        /// Outward direction, of any length.
        normal: [f64; 3] = [0.0, 0.0, 1.0];
    }
}

haptograph_engine::settings! {
    /// A sphere.
    pub struct SphereSettings {
        /// Centre, mm.
        centre_mm: [f64; 3] = [0.0, 0.0, 0.0];
        /// Diameter, mm.
        diameter_mm: f64 = 100.0, in 0.001..=100_000.0;
    }
}

haptograph_engine::settings! {
    /// A box with edges along the axes.
    pub struct BoxSettings {
        /// Centre, mm.
        centre_mm: [f64; 3] = [0.0, 0.0, 0.0];
        /// Extents along x, y and z, mm.
        size_mm: [f64; 3];
    }
}

haptograph_engine::settings! {
    /// A triangle mesh.
    pub struct MeshSettings {
        /// STL or OBJ file, relative to the graph file.
        file: PathBuf;
        /// Millimetres of one unit of the file.
        unit_mm: f64 = 1.0, in 1e-9..=1e9;
        /// A point in free space on the side that the tool feels, mm; none: above the mesh.
        start_mm: Option<[f64; 3]> = None;
    }
}

haptograph_engine::choices! {
    /// One shape of a scene.
    pub enum Solid {
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

pub(crate) fn metres(mm: [f64; 3]) -> Vec3 {
    mm.map(|x| x * 1e-3)
}

impl Solid {
    fn to_shape(&self) -> Result<Shape, BuildError> {
        Ok(match self {
            Self::Plane(plane) => Shape::Plane {
                origin_m: metres(plane.origin_mm),
                normal: plane.normal,
            },
            Self::Sphere(sphere) => Shape::Sphere {
                centre_m: metres(sphere.centre_mm),
                diameter_m: sphere.diameter_mm * 1e-3,
            },
            Self::Box(cuboid) => Shape::Box {
                centre_m: metres(cuboid.centre_mm),
                size_m: metres(cuboid.size_mm),
            },
            Self::Room(room) => Shape::Room {
                centre_m: metres(room.centre_mm),
                size_m: metres(room.size_mm),
            },
            Self::Mesh(mesh) => Shape::Mesh {
                mesh: Arc::new(load_mesh(&mesh.file, mesh.unit_mm)?),
                start_m: mesh.start_mm.map(metres),
            },
        })
    }
}

/// A mesh from the file that the setting `file` names.
pub(crate) fn load_mesh(file: &Path, unit_mm: f64) -> Result<TriangleMesh, BuildError> {
    let Some(format) = MeshFormat::of(file) else {
        let message = format!("{} has neither the extension .stl nor .obj", file.display());
        return Err(BuildError::at("file", message).help("export the mesh as STL or OBJ"));
    };
    let failed =
        |error: &dyn std::error::Error| BuildError::at("file", format!("{}: {error}", file.display()));
    let bytes = files::read(file, files::MAX_MESH_BYTES).map_err(|error| failed(&error))?;
    TriangleMesh::from_bytes(&bytes, format, unit_mm * 1e-3).map_err(|error| failed(&error))
}

/// The setting that a shape's error belongs to.
fn field(error: ShapeError) -> BuildError {
    let ShapeError::OutOfRange { name, .. } = error;
    let field = match name {
        "proxy_diameter_m" => "proxy_diameter_mm",
        "normal" => "normal",
        "diameter_m" => "diameter_mm",
        _ => "size_mm",
    };
    BuildError::at(field, error.to_string())
}

fn toucher(
    solids: &[Solid],
    proxy_diameter_mm: f64,
    solid: Option<Output<Scalar>>,
) -> Result<Box<dyn Processor>, BuildError> {
    let shapes = solids
        .iter()
        .map(Solid::to_shape)
        .collect::<Result<Vec<_>, _>>()?;
    let scene = Scene::new(&shapes, proxy_diameter_mm * 1e-3).map_err(field)?;
    Ok(Box::new(Toucher { scene, solid }))
}

const TOOL: Input<Vector> = Input::common([
    ContactPlane::SPEC.input("position"),
    ContactSphere::SPEC.input("position"),
    ContactBox::SPEC.input("position"),
    ContactMesh::SPEC.input("position"),
    ContactScene::SPEC.input("position"),
]);
const TOUCH: Output<Contact> = Output::common([
    ContactPlane::SPEC.output("contact"),
    ContactSphere::SPEC.output("contact"),
    ContactBox::SPEC.output("contact"),
    ContactMesh::SPEC.output("contact"),
    ContactScene::SPEC.output("contact"),
]);
const SOLID: Output<Scalar> = ContactScene::SPEC.output("solid");

#[derive(Debug, Clone)]
struct Toucher {
    scene: Scene,
    /// Where the index of the touched shape goes; only scenes have this output.
    solid: Option<Output<Scalar>>,
}

impl Processor for Toucher {
    fn process(&mut self, _: &Tick, io: &mut Io<'_>) {
        let positions = io.read(TOOL);
        let (contacts, solids) = match self.solid {
            None => (io.write(TOUCH), None),
            Some(solid) => {
                let (contacts, solids) = io.write_all((TOUCH, solid));
                (contacts, Some(solids))
            }
        };
        let mut solids = solids.into_iter().flatten();
        for (components, hip_m) in contacts.iter_mut().zip(positions) {
            let (touch, which): (Contact, usize) = self.scene.update(*hip_m);
            *components = touch.to_components();
            if let Some(solid) = solids.next() {
                *solid = which as f64;
            }
        }
    }

    fn copy_state_into(&self, new: &mut dyn Processor) {
        if let Some(new) = successor::<Self>(new) {
            new.scene.copy_state_from(&self.scene);
        }
    }
}

haptograph_engine::settings! {
    /// Settings of [`ContactPlane`].
    pub struct ContactPlaneSettings {
        /// A point of its surface, mm.
        origin_mm: [f64; 3] = [0.0, 0.0, 0.0];
        /// Outward direction, of any length.
        normal: [f64; 3] = [0.0, 0.0, 1.0];
        /// Diameter of the ball at the tool's tip, mm.
        proxy_diameter_mm: f64 = 0.0, in 0.0..=1000.0;
    }
}

/// Contact with a plane.
pub struct ContactPlane;

impl NodeKind for ContactPlane {
    type Settings = ContactPlaneSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "ContactPlane",
        group: "contact",
        doc: "Contact of a tool with a plane.",
        source: SOURCE,
        inputs: POSITION,
        outputs: &[CONTACT],
        example: r#""touch": ContactPlane(position: "arm.position", origin_mm: [0.0, 0.0, 0.0])"#,
    };

    fn build(settings: ContactPlaneSettings, _: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        let ContactPlaneSettings {
            origin_mm,
            normal,
            proxy_diameter_mm,
        } = settings;
        toucher(
            &[Solid::Plane(PlaneSettings { origin_mm, normal })],
            proxy_diameter_mm,
            None,
        )
    }
}

haptograph_engine::settings! {
    /// Settings of [`ContactSphere`].
    pub struct ContactSphereSettings {
        /// Centre, mm.
        centre_mm: [f64; 3] = [0.0, 0.0, 0.0];
        /// Diameter, mm.
        diameter_mm: f64 = 100.0, in 0.001..=100_000.0;
        /// Diameter of the ball at the tool's tip, mm.
        proxy_diameter_mm: f64 = 3.2, in 0.0..=1000.0;
    }
}

/// Contact with a sphere.
pub struct ContactSphere;

impl NodeKind for ContactSphere {
    type Settings = ContactSphereSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "ContactSphere",
        group: "contact",
        doc: "Contact of a tool with a sphere. HIP and IHIP are positions of the centre of the ball at the tool's tip.",
        source: SOURCE,
        inputs: POSITION,
        outputs: &[CONTACT],
        example: r#""touch": ContactSphere(position: "arm.position", diameter_mm: 100.0, proxy_diameter_mm: 3.2)"#,
    };

    fn build(settings: ContactSphereSettings, _: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        let ContactSphereSettings {
            centre_mm,
            diameter_mm,
            proxy_diameter_mm,
        } = settings;
        toucher(
            &[Solid::Sphere(SphereSettings {
                centre_mm,
                diameter_mm,
            })],
            proxy_diameter_mm,
            None,
        )
    }
}

haptograph_engine::settings! {
    /// Settings of [`ContactBox`].
    pub struct ContactBoxSettings {
        /// Centre, mm.
        centre_mm: [f64; 3] = [0.0, 0.0, 0.0];
        /// Extents along x, y and z, mm.
        size_mm: [f64; 3];
        /// Contact from inside: a room.
        inside: bool = false;
        /// Diameter of the ball at the tool's tip, mm.
        proxy_diameter_mm: f64 = 3.2, in 0.0..=1000.0;
    }
}

/// Contact with a box, from outside or inside.
pub struct ContactBox;

impl NodeKind for ContactBox {
    type Settings = ContactBoxSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "ContactBox",
        group: "contact",
        doc: "Contact of a tool with a box whose edges lie along the axes, from outside or from inside.",
        source: "4.5.2",
        inputs: POSITION,
        outputs: &[CONTACT],
        example: r#""touch": ContactBox(position: "arm.position", size_mm: [100.0, 100.0, 50.0])"#,
    };

    fn build(settings: ContactBoxSettings, _: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        let ContactBoxSettings {
            centre_mm,
            size_mm,
            inside,
            proxy_diameter_mm,
        } = settings;
        let cuboid = BoxSettings { centre_mm, size_mm };
        let solid = if inside {
            Solid::Room(cuboid)
        } else {
            Solid::Box(cuboid)
        };
        toucher(&[solid], proxy_diameter_mm, None)
    }
}

/// Contact with a triangle mesh.
pub struct ContactMesh;

impl NodeKind for ContactMesh {
    type Settings = MeshSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "ContactMesh",
        group: "contact",
        doc: "Contact of a point with a triangle mesh from an STL or OBJ file, by a god-object proxy that never passes \
              through a triangle.",
        source: SOURCE,
        inputs: POSITION,
        outputs: &[CONTACT],
        example: r#""touch": ContactMesh(position: "arm.position", file: "shapes/wedge.stl")"#,
    };

    fn build(settings: MeshSettings, _: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        toucher(&[Solid::Mesh(settings)], 0.0, None)
    }
}

haptograph_engine::settings! {
    /// Settings of [`ContactScene`].
    pub struct ContactSceneSettings {
        /// The shapes: Plane, Sphere, Box, Room or Mesh with their settings.
        solids: Vec<Solid>;
        /// Diameter of the ball at the tool's tip, mm.
        proxy_diameter_mm: f64 = 3.2, in 0.0..=1000.0;
    }
}

/// Contact with several shapes.
pub struct ContactScene;

impl NodeKind for ContactScene {
    type Settings = ContactSceneSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "ContactScene",
        group: "contact",
        doc: "Contact of a tool with several shapes at once; the deepest contact applies.",
        source: "4.5.2",
        inputs: POSITION,
        outputs: &[
            CONTACT,
            output(
                "solid",
                Kind::SCALAR,
                Quantity::NUMBER,
                "Index of the touched shape, from 0.",
            ),
        ],
        example: r#""touch": ContactScene(position: "arm.position", solids: [Room(size_mm: [160.0, 160.0, 120.0]), Sphere(diameter_mm: 50.0)])"#,
    };

    fn build(settings: ContactSceneSettings, _: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        if settings.solids.is_empty() {
            return Err(BuildError::at("solids", "`solids` is empty").help("list at least one shape"));
        }
        toucher(&settings.solids, settings.proxy_diameter_mm, Some(SOLID))
    }
}

/// The components of a contact.
pub struct ContactParts;

impl NodeKind for ContactParts {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "ContactParts",
        group: "contact",
        doc: "The components of a contact as separate signals.",
        source: "4.3",
        inputs: &[input("contact", Contact::KIND, Quantity::NUMBER, "The contact.")],
        outputs: &[
            output(
                "touching",
                Kind::SCALAR,
                Quantity::NUMBER,
                "1 while the tool touches, else 0.",
            ),
            output(
                "hip",
                Kind::VECTOR,
                Quantity::LENGTH,
                "Haptic interface point: position of the tool, m.",
            ),
            output(
                "ihip",
                Kind::VECTOR,
                Quantity::LENGTH,
                "Ideal haptic interface point: the proxy, m.",
            ),
            output(
                "normal",
                Kind::VECTOR,
                Quantity::NUMBER,
                "Outward unit normal; zero in free space.",
            ),
            output(
                "penetration",
                Kind::SCALAR,
                Quantity::LENGTH,
                "Distance from HIP to IHIP, m.",
            ),
        ],
        example: r#""parts": ContactParts(contact: "touch.contact")"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        Ok(Box::new(Parting))
    }
}

impl ContactParts {
    const CONTACT: Input<Contact> = Self::SPEC.input("contact");
    const TOUCHING: Output<Scalar> = Self::SPEC.output("touching");
    const HIP: Output<Vector> = Self::SPEC.output("hip");
    const IHIP: Output<Vector> = Self::SPEC.output("ihip");
    const NORMAL: Output<Vector> = Self::SPEC.output("normal");
    const PENETRATION: Output<Scalar> = Self::SPEC.output("penetration");
}

#[derive(Debug, Clone)]
struct Parting;

impl Processor for Parting {
    fn process(&mut self, _: &Tick, io: &mut Io<'_>) {
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
    use haptograph_engine::testing::Bench;

    #[test]
    fn a_tip_in_the_thesis_sphere_is_pushed_out_of_it() {
        let settings = ContactSphereSettings {
            centre_mm: [0.0; 3],
            diameter_mm: 100.0,
            proxy_diameter_mm: 3.2,
        };
        let mut bench = Bench::new::<ContactSphere>(settings, 1000.0, &[Kind::VECTOR]).unwrap();
        let out = bench
            .run(&[&[0.0, 0.0, 0.0506, 0.0, 0.03, 0.04, 0.0, 0.0, 0.06]])
            .remove(0);
        let contacts: Vec<Contact> = out.as_chunks().0.iter().map(Contact::from_components).collect();
        assert!(contacts[0].touching && contacts[1].touching && !contacts[2].touching);
        assert!((contacts[0].penetration_m - 0.001).abs() < 1e-12);
        assert!((norm(contacts[1].ihip_m) - 0.0516).abs() < 1e-12);
        let along = add_scaled(contacts[1].hip_m, contacts[1].normal, contacts[1].penetration_m);
        assert!(crate::vector::distance(along, contacts[1].ihip_m) < 1e-12);
    }

    #[test]
    fn a_scene_says_which_solid_is_touched() {
        let room = BoxSettings {
            centre_mm: [0.0; 3],
            size_mm: [100.0; 3],
        };
        let ball = SphereSettings {
            centre_mm: [0.0; 3],
            diameter_mm: 20.0,
        };
        let settings = ContactSceneSettings {
            solids: vec![Solid::Room(room), Solid::Sphere(ball)],
            proxy_diameter_mm: 0.0,
        };
        let mut bench = Bench::new::<ContactScene>(settings, 1000.0, &[Kind::VECTOR]).unwrap();
        let out = bench.run(&[&[0.0, 0.0, 0.052, 0.0, 0.0, 0.03, 0.0, 0.0, 0.009]]);
        assert_eq!(out[1], [0.0, 0.0, 1.0]);
        let touching: Vec<f64> = out[0].iter().step_by(12).copied().collect();
        assert_eq!(touching, [1.0, 0.0, 1.0]);
    }

    #[test]
    fn shapes_that_cannot_be_touched_are_refused_at_their_field() {
        let plane = ContactPlaneSettings {
            origin_mm: [0.0; 3],
            normal: [0.0; 3],
            proxy_diameter_mm: 0.0,
        };
        let refused = Bench::new::<ContactPlane>(plane, 1000.0, &[Kind::VECTOR]).err();
        assert_eq!(refused.and_then(|e| e.field), Some("normal"));
        let mesh = MeshSettings {
            file: "tool.step".into(),
            unit_mm: 1.0,
            start_mm: None,
        };
        let refused = Bench::new::<ContactMesh>(mesh, 1000.0, &[Kind::VECTOR]).err();
        assert_eq!(refused.and_then(|e| e.field), Some("file"));
    }
}
