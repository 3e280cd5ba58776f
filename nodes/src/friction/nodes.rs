//! Nodes of the friction laws.

use super::dahl::{Dahl, DahlSettings, UnderLoad};
use super::viscous_coulomb::ViscousCoulomb;
use crate::contact::Contact;
use crate::texture::load_surface;
use crate::vector::{Vec3, ZERO, add_scaled, norm, reject, scale, sub};
use haptograph_engine::frame::{Scalar, Vector};
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, LiveId, NodeKind, Port, Processor, Tick};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{Millimetres, MillimetresPerSecond, SecondsPerMillimetre};
use haptograph_surfaces::{Friction, StaticPeak};
use std::path::{Path, PathBuf};

/// The coefficient of friction and its static peak: the settings, or else the surface's.
fn friction(mu: Option<f64>, peak: StaticFriction, surface: Option<&Path>) -> Result<Friction, BuildError> {
    let learned = || -> Result<Friction, BuildError> {
        let Some(path) = surface else {
            return Err(BuildError::at("mu", "the coefficient of friction is missing")
                .help("give `mu` or a `surface` that has one"));
        };
        let surface = load_surface(path)?;
        surface.friction.ok_or_else(|| {
            let message = format!("the surface {} has no friction", surface.name);
            BuildError::at("surface", message).help("give `mu`")
        })
    };
    let plain = match mu {
        Some(mu) => Friction::new(mu, None).map_err(|error| BuildError::at("mu", error.to_string()))?,
        None => learned()?,
    };
    let peak = match peak {
        StaticFriction::None => return Ok(plain.with_peak(None)),
        StaticFriction::Peak(peak) => StaticPeak::new(peak.ratio, peak.stribeck_mm_s.si()),
        StaticFriction::Learned => {
            let peak = if surface.is_some() { learned()?.peak() } else { None };
            return peak.map(|peak| plain.with_peak(Some(peak))).ok_or_else(|| {
                BuildError::at("static_friction", "the surface has no static friction")
                    .help("learn it from a drag with strokes from rest, or give `Peak(ratio: 1.5)`")
            });
        }
    };
    let peak = peak.map_err(|error| BuildError::at("static_friction", error.to_string()))?;
    Ok(plain.with_peak(Some(peak)))
}

haptograph_engine::choices! {
    /// Friction at rest over that of sliding.
    pub(crate) enum StaticFriction {
        /// The same, as in the thesis.
        None,
        /// As the surface has it.
        Learned,
        /// Larger at rest.
        Peak(PeakSettings),
    }
}

haptograph_engine::settings! {
    /// A static peak: friction is `1 + (ratio - 1) exp(-(v / stribeck_mm_s)²)` times as large at the speed v.
    pub struct PeakSettings {
        /// Friction at rest over that of sliding.
        ratio: f64 = 1.5, in 1.0..=10.0;
        /// Speed at which it has fallen to 1/e, mm/s.
        stribeck_mm_s: MillimetresPerSecond = MillimetresPerSecond(10.0), in 0.01..=10_000.0;
    }
}

haptograph_engine::choices! {
    /// Effect of a growing load on the stretch of [`DahlFriction`].
    pub(crate) enum UnderGrowingLoad {
        /// The stretch shrinks until its energy is covered: no motion gains energy.
        Passive,
        /// The stretch does not change and gains energy, as printed in the thesis.
        AsPrinted,
    }
}

haptograph_engine::settings! {
    /// Settings of [`DahlFriction`].
    pub struct DahlFrictionSettings {
        /// Surface file with the coefficient of friction, relative to the graph file.
        surface: Option<PathBuf> = None;
        /// Coefficient of friction; replaces the surface's.
        [live] mu: Option<f64> = None, in 0.0..=10.0;
        /// Largest stretch for a coefficient of friction of 1, mm.
        stretch_mm: Millimetres = Millimetres(4.0), in 0.001..=1000.0;
        /// Effect of a growing load on the stretch.
        under_load: UnderGrowingLoad = UnderGrowingLoad::Passive;
        /// Friction at rest over that of sliding: None, Learned (the surface's) or Peak.
        static_friction: StaticFriction = StaticFriction::None;
    }
}

haptograph_engine::node! {
    /// Stick-slip friction after Dahl: tool and surface stick by a spring that stretches up to 4 mm times mu, then slip.
    /// The passive variant, the default, never adds energy, whatever the load does.
    pub struct DahlFriction(DahlFrictionSettings) in "friction";
    source: "4.3.1, Eq. 4.3.1 and 4.3.2 (corrected)";
    example: r#""friction": DahlFriction(contact: "touch.contact", load: "normal.load", surface: "surfaces/t3-tile.ron")"#;
    in CONTACT: Contact = Port::of(Quantity::NUMBER, "The contact.");
    in LOAD: Scalar = Port::of(Quantity::FORCE, "Normal force, N.");
    out FORCE: Vector = Port::of(Quantity::FORCE, "Friction on the tool, N, in the tangent plane.");
}

impl NodeKind for DahlFriction {
    fn build(settings: DahlFrictionSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let law = DahlSettings {
            stretch_m: settings.stretch_mm.si(),
            under_load: match settings.under_load {
                UnderGrowingLoad::Passive => UnderLoad::Passive,
                UnderGrowingLoad::AsPrinted => UnderLoad::AsPrinted,
            },
        };
        let friction = friction(settings.mu, settings.static_friction, settings.surface.as_deref())?;
        Ok(Built::new(Sticking {
            dahl: Dahl::new(law),
            mu: friction.mu(),
            peak: friction.peak(),
            slip: Slip {
                follow: 1.0 - (-1.0 / (SLIP_S * cx.rate.hz())).exp(),
                rate_hz: cx.rate.hz(),
                last_m: None,
                velocity_m_s: ZERO,
            },
        }))
    }
}

#[derive(Debug, Clone)]
struct Sticking {
    dahl: Dahl,
    mu: f64,
    peak: Option<StaticPeak>,
    slip: Slip,
}

/// Time over which the speed of a slip is smoothed, s: a step of a position is no speed.
const SLIP_S: f64 = 0.01;

/// The speed of a tool along what it touches.
#[derive(Debug, Clone, Copy)]
struct Slip {
    follow: f64,
    rate_hz: f64,
    last_m: Option<Vec3>,
    velocity_m_s: Vec3,
}

impl Slip {
    /// Advances one tick: the speed, m/s; zero where the touch begins.
    fn update(&mut self, contact: &Contact) -> f64 {
        let place_m =
            Some(contact.ihip_m).filter(|place| contact.touching && place.iter().all(|x| x.is_finite()));
        self.velocity_m_s = match (self.last_m, place_m) {
            (Some(last_m), Some(place_m)) => {
                let now_m_s = scale(sub(place_m, last_m), self.rate_hz);
                add_scaled(self.velocity_m_s, sub(now_m_s, self.velocity_m_s), self.follow)
            }
            _ => ZERO,
        };
        self.last_m = place_m;
        norm(self.velocity_m_s)
    }
}

impl Processor<DahlFriction> for Sticking {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, DahlFriction>) {
        let (contacts, loads) = (io.decode(DahlFriction::CONTACT), io.read(DahlFriction::LOAD));
        let forces = io.write(DahlFriction::FORCE).iter_mut();
        for ((force, contact), load) in forces.zip(contacts).zip(loads) {
            let slip_m_s = self.slip.update(&contact);
            let factor = self.peak.map_or(1.0, |peak| peak.factor(slip_m_s));
            *force = self.dahl.update(&contact, *load, self.mu * factor);
        }
    }

    fn set(&mut self, setting: LiveId<DahlFrictionSettings>, value: f64) {
        if setting == DahlFrictionSettings::mu {
            self.mu = value;
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.dahl.copy_state_from(&self.dahl);
        (new.slip.last_m, new.slip.velocity_m_s) = (self.slip.last_m, self.slip.velocity_m_s);
    }
}

haptograph_engine::settings! {
    /// Settings of [`ViscousCoulombFriction`].
    pub struct ViscousCoulombSettings {
        /// Surface file with the coefficient of friction, relative to the graph file.
        surface: Option<PathBuf> = None;
        /// Coefficient of friction; replaces the surface's.
        [live] mu: Option<f64> = None, in 0.0..=10.0;
        /// Slope of the viscous region by normal force, s/mm.
        [live] slope_s_per_mm: SecondsPerMillimetre = SecondsPerMillimetre(0.004), in 1e-9..=1e3;
        /// Friction at rest over that of sliding: None, Learned (the surface's) or Peak. It shows where the slope is steep.
        static_friction: StaticFriction = StaticFriction::None;
    }
}

haptograph_engine::node! {
    /// Coulomb friction that is viscous below mu / slope: simple, without stiction.
    pub struct ViscousCoulombFriction(ViscousCoulombSettings) in "friction";
    source: "A.3.2, Eq. A.3.1 (corrected)";
    example: r#""friction": ViscousCoulombFriction(contact: "touch.contact", load: "normal.load", velocity: "speed.velocity", mu: 0.35)"#;
    in CONTACT: Contact = Port::of(Quantity::NUMBER, "The contact.");
    in LOAD: Scalar = Port::of(Quantity::FORCE, "Normal force, N.");
    in VELOCITY: Vector = Port::of(Quantity::SPEED, "Velocity of the tool, m/s.");
    out FORCE: Vector = Port::of(Quantity::FORCE, "Friction on the tool, N, in the tangent plane.");
}

impl NodeKind for ViscousCoulombFriction {
    fn build(settings: ViscousCoulombSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        let friction = friction(settings.mu, settings.static_friction, settings.surface.as_deref())?;
        let law = ViscousCoulomb { slope_s_per_m: settings.slope_s_per_mm.si() };
        Ok(Built::new(Dragging { law, mu: friction.mu(), peak: friction.peak() }))
    }
}

#[derive(Debug, Clone)]
struct Dragging {
    law: ViscousCoulomb,
    mu: f64,
    peak: Option<StaticPeak>,
}

impl Processor<ViscousCoulombFriction> for Dragging {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, ViscousCoulombFriction>) {
        let contacts = io.decode(ViscousCoulombFriction::CONTACT);
        let loads = io.read(ViscousCoulombFriction::LOAD);
        let velocities = io.read(ViscousCoulombFriction::VELOCITY);
        let forces = io.write(ViscousCoulombFriction::FORCE).iter_mut();
        let frames = forces.zip(contacts).zip(loads).zip(velocities);
        for (((force, contact), load), velocity) in frames {
            *force = if contact.touching {
                let along = |peak: StaticPeak| peak.factor(norm(reject(*velocity, contact.normal)));
                self.law.force_n(*velocity, contact.normal, *load, self.mu * self.peak.map_or(1.0, along))
            } else {
                [0.0; 3]
            };
        }
    }

    fn set(&mut self, setting: LiveId<ViscousCoulombSettings>, value: f64) {
        match setting {
            ViscousCoulombSettings::mu => self.mu = value,
            ViscousCoulombSettings::slope_s_per_mm => self.law.slope_s_per_m = value,
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::tile;
    use haptograph_engine::frame::Record;
    use haptograph_engine::frame::{Kind, OneKind};
    use haptograph_engine::testing::Bench;

    /// A slide along x at 100 mm/s on a plane, pressed with 1 N.
    fn slide(frames: u32) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let contacts = (0..frames).flat_map(|k| {
            Contact {
                touching: true,
                ihip_m: [1e-4 * f64::from(k), 0.0, 0.0],
                normal: [0.0, 0.0, 1.0],
                ..Contact::default()
            }
            .to_components()
        });
        let n = frames as usize;
        (contacts.collect(), vec![1.0; n], [0.1, 0.0, 0.0].repeat(n))
    }

    #[test]
    fn a_sliding_tool_is_dragged_by_mu_times_its_load() {
        let (contacts, loads, velocities) = slide(100);
        let shipped = haptograph_surfaces::files::load(&tile()).unwrap();
        let mu = shipped.friction.unwrap().mu();
        let settings = DahlFrictionSettings {
            surface: Some(tile()),
            mu: None,
            stretch_mm: Millimetres(4.0),
            under_load: UnderGrowingLoad::Passive,
            static_friction: StaticFriction::None,
        };
        let mut dahl = Bench::new::<DahlFriction>(settings, 1000.0, &[Contact::KIND, Kind::SCALAR]).unwrap();
        let force = dahl.run(&[&contacts, &loads]).remove(0);
        assert!((force[30] + 10.0 * 1e-4 / 0.004).abs() < 1e-12, "it sticks first");
        assert!((force[297] + mu).abs() < 1e-12, "then it slips at the surface's {mu}");
        dahl.set(DahlFrictionSettings::mu, 0.1);
        assert!((dahl.run(&[&contacts, &loads])[0][297] + 0.1).abs() < 1e-12);
        let settings = ViscousCoulombSettings {
            surface: None,
            mu: Some(0.3),
            slope_s_per_mm: SecondsPerMillimetre(0.004),
            static_friction: StaticFriction::None,
        };
        let kinds = [Contact::KIND, Kind::SCALAR, Kind::VECTOR];
        let mut viscous = Bench::new::<ViscousCoulombFriction>(settings, 1000.0, &kinds).unwrap();
        assert!((viscous.run(&[&contacts, &loads, &velocities])[0][0] + 0.3).abs() < 1e-12);
    }

    #[test]
    fn with_a_static_peak_friction_is_larger_at_rest_and_the_same_where_it_slides() {
        // 1 mm/s for 4 s, then 100 mm/s.
        let x = (0..4500).scan(0.0, |x, k| {
            *x += if k < 4000 { 1e-6 } else { 1e-4 };
            Some(*x)
        });
        let contacts: Vec<f64> = x
            .flat_map(|x| {
                let (ihip_m, normal) = ([x, 0.0, 0.0], [0.0, 0.0, 1.0]);
                Contact { touching: true, ihip_m, normal, ..Contact::default() }.to_components()
            })
            .collect();
        let settings = |static_friction| DahlFrictionSettings {
            surface: None,
            mu: Some(0.3),
            stretch_mm: Millimetres(4.0),
            under_load: UnderGrowingLoad::Passive,
            static_friction,
        };
        let peak = PeakSettings { ratio: 1.5, stribeck_mm_s: MillimetresPerSecond(10.0) };
        let mut bench = Bench::new::<DahlFriction>(
            settings(StaticFriction::Peak(peak)),
            1000.0,
            &[Contact::KIND, Kind::SCALAR],
        )
        .unwrap();
        let force = bench.run_in_blocks(&[&contacts, &[1.0; 4500]], &[1, 64]).remove(0);
        assert!((force[3 * 3990] + 0.45 * 0.99).abs() < 0.01, "{}", force[3 * 3990]);
        assert!((force[3 * 4490] + 0.3).abs() < 1e-6, "{}", force[3 * 4490]);
        let kinds = [Contact::KIND, Kind::SCALAR];
        let refused = Bench::new::<DahlFriction>(settings(StaticFriction::Learned), 1000.0, &kinds).err();
        assert_eq!(refused.and_then(|e| e.field), Some("static_friction"));
    }

    #[test]
    fn a_law_without_a_coefficient_is_refused() {
        let settings = ViscousCoulombSettings {
            surface: None,
            mu: None,
            slope_s_per_mm: SecondsPerMillimetre(0.004),
            static_friction: StaticFriction::None,
        };
        let kinds = [Contact::KIND, Kind::SCALAR, Kind::VECTOR];
        let refused = Bench::new::<ViscousCoulombFriction>(settings, 1000.0, &kinds).err();
        assert_eq!(refused.and_then(|e| e.field), Some("mu"));
    }
}
