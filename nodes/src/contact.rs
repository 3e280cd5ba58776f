//! Contact of a tool with a surface: position, penetration and normal force.

pub mod force_node;
pub mod mesh;
pub mod nodes;
pub mod object;
pub mod proxy;
pub mod shape;
pub mod stiffness;
pub mod wrench;
pub mod wrench_node;

use crate::vector::Vec3;
use haptograph_engine::frame;

/// The contact of one tick. Normals point out of the object, towards the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Whether the tool touches.
    pub touching: bool,
    /// Haptic interface point (HIP): position of the device, m.
    pub hip_m: Vec3,
    /// Ideal haptic interface point (IHIP, proxy, god-object): position of the tool on a rigid surface, m. In free
    /// space it is the HIP.
    pub proxy_m: Vec3,
    /// Distance from HIP to proxy, m; zero in free space.
    pub penetration_m: f64,
    /// Unit normal at the proxy, from HIP to proxy; zero in free space.
    pub normal: Vec3,
    /// The touched face: the triangle of a mesh, the side of a box (0 to 5: -x +x -y +y -z +z), else 0.
    pub face: u32,
}

impl From<frame::Contact> for Contact {
    fn from(frame: frame::Contact) -> Self {
        Self {
            touching: frame.touching,
            hip_m: frame.hip_m,
            proxy_m: frame.ihip_m,
            penetration_m: frame.penetration_m,
            normal: frame.normal,
            face: frame.face,
        }
    }
}

impl From<Contact> for frame::Contact {
    fn from(contact: Contact) -> Self {
        Self {
            touching: contact.touching,
            hip_m: contact.hip_m,
            ihip_m: contact.proxy_m,
            normal: contact.normal,
            penetration_m: contact.penetration_m,
            face: contact.face,
        }
    }
}

impl Contact {
    /// No contact.
    pub const fn free(hip_m: Vec3) -> Self {
        Self {
            touching: false,
            hip_m,
            proxy_m: hip_m,
            penetration_m: 0.0,
            normal: [0.0; 3],
            face: 0,
        }
    }
}
