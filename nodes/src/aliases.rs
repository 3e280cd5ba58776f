//! Former names of node kinds: graph files that have them load to the same samples. This is the one table of them.

use haptograph_engine::registry::Alias;

/// Fields of a `Contact` and of every node, and fields that no node has; all others were those of a shape.
const OF_CONTACT: [&str; 5] = ["position", "proxy_diameter_mm", "clock", "only", "endpoint"];
/// The same for a mesh, whose tool was a point always.
const OF_MESH: [&str; 4] = ["position", "clock", "only", "endpoint"];

/// Those of touch. Each shape had a kind of its own, with the shape's settings among those of the node.
pub(crate) const TOUCH: &[Alias] = &[
    Alias::new("ContactPlane", "Contact", |fields, _| {
        fields.nest("solids", "Plane", &OF_CONTACT);
        fields.put_default("proxy_diameter_mm", 0.0);
    }),
    Alias::new("ContactSphere", "Contact", |fields, _| {
        fields.nest("solids", "Sphere", &OF_CONTACT);
    }),
    Alias::new("ContactBox", "Contact", |fields, reading| {
        let shape = match fields.setting("inside", Some(false), None, reading) {
            Some(true) => "Room",
            _ => "Box",
        };
        fields.nest("solids", shape, &OF_CONTACT);
    }),
    Alias::new("ContactMesh", "Contact", |fields, _| {
        fields.nest("solids", "Mesh", &OF_MESH);
        fields.put_default("proxy_diameter_mm", 0.0);
    }),
    Alias::new("ContactScene", "Contact", |_, _| {}),
];
