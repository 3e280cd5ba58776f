//! Six simulated materials to record.
//!
//! T1 to T5 take stiffness, friction and fineness from Table 3.1 (rough plastic, canvas, floor tile, silk, vinyl). The table's
//! roughness is a statistic of photographs, not a height: the mapping from it to heights is ours ([`Material::of`]), and so are
//! spread, grain and damping. They imitate no measured vibration. T6 is made up throughout and is not the thesis's wood.

use super::terrain::Relief;

/// Properties of a simulated material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// The height field.
    pub relief: Relief,
    /// Stiffness under a tool at 2 N, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping of the contact: force by closing speed as a fraction of the elastic force, s/m (Hunt and Crossley 1975).
    pub damping_s_per_m: f64,
    /// Coefficient of kinetic friction.
    pub friction: f64,
    /// Static over kinetic friction after 1 s at rest, of a tool that sticks and slips.
    pub static_ratio: f64,
}

/// Names of the materials.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MaterialName {
    /// Like rough plastic.
    T1,
    /// Like canvas.
    T2,
    /// Like floor tile.
    T3,
    /// Like silk.
    T4,
    /// Like vinyl.
    T5,
    /// Made up: coarse, sticky, firm.
    T6,
}

impl MaterialName {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::T1, Self::T2, Self::T3, Self::T4, Self::T5, Self::T6];

    /// The name in files and on the command line.
    pub fn as_str(self) -> &'static str {
        ["T1", "T2", "T3", "T4", "T5", "T6"][self as usize]
    }
}

impl std::str::FromStr for MaterialName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|name| name.as_str() == text);
        found.ok_or_else(|| format!("unknown material {text:?}; expected one of: T1, T2, T3, T4, T5, T6"))
    }
}

/// Columns of Table 3.1: roughness, stiffness in N/mm, friction, fineness in 1/mm. The last row is ours.
const TABLE: [[f64; 4]; 6] = [
    [0.3252, 42.20, 0.18, 1.25],
    [0.3515, 17.82, 0.36, 1.04],
    [0.3702, 10.81, 0.32, 0.98],
    [0.2776, 37.86, 0.30, 1.46],
    [0.2842, 15.07, 0.49, 1.18],
    [0.3400, 26.00, 0.42, 0.65],
];
/// Spread of the spectrum, grain, contact damping in s/m, static friction over kinetic. Ours: weaves (canvas, silk) are nearly periodic, mouldings less, and the
/// bumps of a tile or the grain of vinyl come in all sizes.
const CHARACTER: [[f64; 4]; 6] = [
    [0.50, 0.05, 1.5, 1.5],
    [0.20, 0.05, 3.0, 1.8],
    [0.80, 0.03, 2.0, 2.0],
    [0.20, 0.08, 2.0, 1.6],
    [0.70, 0.06, 4.0, 2.4],
    [0.35, 0.02, 2.5, 2.2],
];
/// The table's smoothest surface stands for this height as the tip traces it, m. Ours: with it the six vibrate between half a
/// metre and some metres a second squared, as the public models of such materials do.
const SMOOTHEST_M: f64 = 0.6e-6;

impl Material {
    /// The material of a name. Roughness r of the table becomes a height of 0.6 um (r / 0.2776)^6, so that the roughest is
    /// between five and six times as high as the smoothest.
    pub fn of(name: MaterialName) -> Self {
        let [roughness, stiffness_n_per_mm, friction, fineness_per_mm] = TABLE[name as usize];
        let [spread, grain, damping_s_per_m, static_ratio] = CHARACTER[name as usize];
        let rms_m = SMOOTHEST_M * (roughness / 0.2776_f64).powi(6);
        Self {
            relief: Relief { rms_m, fineness_per_m: 1e3 * fineness_per_mm, spread, grain },
            stiffness_n_per_m: 1e3 * stiffness_n_per_mm,
            damping_s_per_m,
            friction,
            static_ratio,
        }
    }

    /// K of the contact law N = K depth^1.5 whose slope at 2 N is the stiffness, N/m^1.5.
    pub(crate) fn hertz_n_per_m32(&self) -> f64 {
        // dN/d depth = 1.5 K^(2/3) N^(1/3)
        (self.stiffness_n_per_m / (1.5 * 2.0_f64.cbrt())).powf(1.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_parse() {
        for name in MaterialName::ALL {
            assert_eq!(name.as_str().parse::<MaterialName>(), Ok(name));
        }
        assert!("T7".parse::<MaterialName>().is_err());
    }

    #[test]
    fn the_contact_law_has_the_tables_stiffness_at_2_n() {
        for name in MaterialName::ALL {
            let material = Material::of(name);
            let k = material.hertz_n_per_m32();
            let depth_m = |n: f64| (n / k).powf(2.0 / 3.0);
            let slope = 2e-3 / (depth_m(2.001) - depth_m(1.999));
            assert!((slope / material.stiffness_n_per_m - 1.0).abs() < 1e-6);
        }
    }
}
