//! Contact of a tool with a surface: position, penetration and normal force.

pub(crate) mod force_node;
pub mod mesh;
pub mod nodes;
pub(crate) mod object;
pub(crate) mod proxy;
pub mod shape;
pub(crate) mod stiffness;
pub(crate) mod wrench;
pub(crate) mod wrench_node;

use crate::vector::Vec3;
use haptograph_engine::frame::{Kind, KindSpec, Level, OneKind, Record};

/// A contact between tool and object. Positions in m, in the object's frame; the normal points out of the object,
/// towards the tool.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Contact {
    /// True if the tool touches the object.
    pub touching: bool,
    /// Haptic interface point (HIP): position of the device, m.
    pub hip_m: Vec3,
    /// Ideal haptic interface point (IHIP, proxy, god-object): position of the tool on a rigid surface, m. In free
    /// space it is the HIP.
    pub ihip_m: Vec3,
    /// Outward unit normal at the IHIP; zero in free space.
    pub normal: Vec3,
    /// Distance from IHIP to HIP into the object; zero in free space.
    pub penetration_m: f64,
    /// The touched face: the triangle of a mesh, the side of a box (0 to 5: -x +x -y +y -z +z), else 0.
    pub face: u32,
}

impl OneKind for Contact {
    const KIND: Kind = Kind::new(&KindSpec {
        name: "contact",
        one: "a contact",
        components: &[
            "touching",
            "hip_x",
            "hip_y",
            "hip_z",
            "ihip_x",
            "ihip_y",
            "ihip_z",
            "normal_x",
            "normal_y",
            "normal_z",
            "penetration_m",
            "face",
        ],
        neutral: &[],
        is_linear: false,
        bridges: &[],
        level: Level {
            name: "penetration",
            unit: Some("m"),
            square: |frame| frame.iter().skip(10).take(1).map(|x| x * x).sum(),
        },
    });
    type Array = [f64; Self::KIND.width()];
}

impl Record for Contact {
    fn from_components(components: &Self::Array) -> Self {
        let [touching, hx, hy, hz, px, py, pz, nx, ny, nz, penetration_m, face] = *components;
        Self {
            touching: touching != 0.0,
            hip_m: [hx, hy, hz],
            ihip_m: [px, py, pz],
            normal: [nx, ny, nz],
            penetration_m,
            face: face as u32,
        }
    }

    fn to_components(&self) -> Self::Array {
        let ([hx, hy, hz], [px, py, pz], [nx, ny, nz]) = (self.hip_m, self.ihip_m, self.normal);
        let touching = f64::from(u8::from(self.touching));
        let (depth_m, face) = (self.penetration_m, f64::from(self.face));
        [touching, hx, hy, hz, px, py, pz, nx, ny, nz, depth_m, face]
    }
}

impl Contact {
    /// No contact.
    pub(crate) const fn free(hip_m: Vec3) -> Self {
        Self { touching: false, hip_m, ihip_m: hip_m, penetration_m: 0.0, normal: [0.0; 3], face: 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_survive_their_components() {
        let contact = Contact {
            touching: true,
            hip_m: [1.0, 2.0, 3.0],
            ihip_m: [4.0, 5.0, 6.0],
            normal: [0.0, 0.0, 1.0],
            penetration_m: 0.25,
            face: 99_999,
        };
        assert_eq!(Contact::from_components(&contact.to_components()), contact);
    }
}
