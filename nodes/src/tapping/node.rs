//! The node of tapping.

use super::onset::{Onset, OnsetSettings};
use super::transient::{EFFECTIVE_MASS_KG, Transient};
use crate::contact::Contact;
use crate::texture::load_surface;
use crate::vector::{Vec3, scale};
use haptograph_engine::frame::{Event, Record, Vector};
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, LiveId, NodeKind, Port, Processor, Tick};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{Grams, MillimetresPerSecond, Milliseconds};
use haptograph_surfaces::{Surface, SurfaceError, Taps};
use std::path::PathBuf;
use std::sync::Arc;

haptograph_engine::choices! {
    /// What answers an impact that is faster than the fastest recorded tap.
    pub(crate) enum Above {
        /// The fastest tap, its amplitude grown by the ratio of the speeds to the power of 0.70 (the mean of real materials), up to three times its speed.
        Grow,
        /// The fastest tap as it was recorded, as in the thesis.
        Hold,
    }
}

haptograph_engine::settings! {
    /// Settings of [`Tapping`].
    pub struct TappingSettings {
        /// Surface file with the taps, relative to the graph file.
        surface: PathBuf;
        /// Effective mass of handle and hand, g; it converts acceleration to force.
        [live] mass_g: Grams = Grams::of_si(EFFECTIVE_MASS_KG), in 0.0..=10_000.0;
        /// Time in free space after which the next contact can be a tap, ms.
        rearm_ms: Milliseconds = Milliseconds::of_si(OnsetSettings::default().rearm_s), in 0.0..=10_000.0;
        /// Lowest speed of a tap, mm/s.
        [live] least_mm_s: MillimetresPerSecond = MillimetresPerSecond::of_si(OnsetSettings::default().least_m_s), in 0.0..=10_000.0;
        /// Time before contact over which its speed is measured, ms.
        window_ms: Milliseconds = Milliseconds::of_si(OnsetSettings::default().window_s), in 0.0..=60.0;
        /// What answers an impact that is faster than the fastest recorded tap: Grow or Hold.
        above: Above = Above::Grow;
    }
}

haptograph_engine::node! {
    /// Renders taps: at contact, the surface's recorded transient for the tool's speed, as a force along the normal. A
    /// contact is a tap when the tool was free for `rearm_ms` and comes at `least_mm_s` or faster; a new tap replaces one
    /// that still rings. An impact faster than the fastest recorded tap grows with its speed; with `above: Hold` it is the
    /// fastest tap as recorded, as in the thesis. Taps of another rate are resampled to the node's clock. With a surface
    /// without taps nothing is played.
    /// Elsewhere: tapper, impact.
    pub struct Tapping(TappingSettings) in "tapping";
    source: "4.3.2";
    example: r#""taps": Tapping(contact: "touch.contact", surface: "surfaces/t3-tile.ron")"#;
    in CONTACT: Contact = Port::of(Quantity::NUMBER, "The contact.");
    out FORCE: Vector = Port::of(Quantity::FORCE, "Force on the tool, N.");
    out TAP: Event = Port::of(Quantity::SPEED, "Event at a tap, with its speed, m/s.");
}

impl NodeKind for Tapping {
    fn build(settings: TappingSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let played = |taps: Taps| -> Result<Transient, SurfaceError> {
            let taps = taps.resampled(cx.rate.hz())?;
            let transient = Transient::new(Arc::new(taps), settings.mass_g.si());
            Ok(match settings.above {
                Above::Grow => transient,
                Above::Hold => transient.held_above_the_fastest(),
            })
        };
        let transient = load_surface(&settings.surface)?.taps.map(played).transpose();
        let transient = transient.map_err(|error| BuildError::at("surface", error.to_string()))?;
        let onset = OnsetSettings {
            rearm_s: settings.rearm_ms.si(),
            least_m_s: settings.least_mm_s.si(),
            window_s: settings.window_ms.si(),
        };
        Ok(Built::new(Striking { onset: Onset::new(&onset, cx.rate.hz()), transient, normal: [0.0; 3] }))
    }

    fn advice(settings: &TappingSettings, _: &BuildContext) -> Vec<BuildError> {
        let silent = load_surface(&settings.surface).ok().filter(|surface| surface.taps.is_none());
        let advise = |surface: Surface| {
            let message = format!("the surface {} has no taps, so `Tapping` outputs zero", surface.name);
            // The warning is the node's: other nodes may warn at the same surface, and each place is reported once.
            let help = "learn the surface with a recording of taps, or choose one that has taps";
            BuildError::of_node(message).help(help)
        };
        silent.map(advise).into_iter().collect()
    }
}

#[derive(Debug, Clone)]
struct Striking {
    onset: Onset,
    /// The recorded taps; none if the surface has none.
    transient: Option<Transient>,
    /// Direction of the tap's force, also after the tool has bounced off.
    normal: Vec3,
}

impl Processor<Tapping> for Striking {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Tapping>) {
        let contacts = io.decode(Tapping::CONTACT);
        let (force, tap) = io.write_all((Tapping::FORCE, Tapping::TAP));
        let frames = force.iter_mut().zip(tap);
        for ((force, event), contact) in frames.zip(contacts) {
            let struck = self.onset.update(&contact).filter(|speed_m_s| speed_m_s.is_finite());
            if struck.is_some() {
                self.normal = contact.normal;
            }
            let rings_n = self.transient.as_mut().map_or(0.0, |transient| transient.update(struck));
            *force = scale(self.normal, rings_n);
            *event = Event { fired: struck.is_some(), value: struck.unwrap_or(0.0) }.to_components();
        }
    }

    fn set(&mut self, setting: LiveId<TappingSettings>, value: f64) {
        match (setting, &mut self.transient) {
            (TappingSettings::least_mm_s, _) => self.onset.least_m_s = value,
            (TappingSettings::mass_g, Some(transient)) => transient.mass_kg = value,
            _ => {}
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.onset.copy_state_from(&self.onset);
        if let (Some(new), Some(old)) = (&mut new.transient, &self.transient) {
            new.copy_state_from(old);
        }
        new.normal = self.normal;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::tile;
    use haptograph_engine::frame::OneKind;
    use haptograph_engine::testing::Bench;

    fn settings() -> TappingSettings {
        TappingSettings {
            surface: tile(),
            mass_g: Grams(50.0),
            rearm_ms: Milliseconds(20.0),
            least_mm_s: MillimetresPerSecond(10.0),
            window_ms: Milliseconds(12.0),
            above: Above::Grow,
        }
    }

    /// Down through z = 0 at a speed, from 1 ms a tick.
    fn fall(speed_m_s: f64) -> Vec<f64> {
        let height = |k: i32| speed_m_s * f64::from(50 - k) * 1e-3;
        let contact = |k| Contact {
            touching: height(k) < 0.0,
            hip_m: [0.0, 0.0, height(k)],
            normal: [0.0, 0.0, f64::from(u8::from(height(k) < 0.0))],
            ..Contact::default()
        };
        (0..200).flat_map(|k| contact(k).to_components()).collect()
    }

    #[test]
    fn a_tap_plays_the_surfaces_transient_for_its_speed() {
        let taps = load_surface(&tile()).unwrap().taps.unwrap();
        let mut bench = Bench::new::<Tapping>(settings(), 1000.0, &[Contact::KIND]).unwrap();
        let out = bench.run_in_blocks(&[&fall(0.15)], &[1, 64]);
        let fired: Vec<usize> = (0..200).filter(|k| out[1][2 * k] != 0.0).collect();
        assert_eq!(fired, [51]);
        assert!((out[1][103] - 0.15).abs() < 1e-9, "its speed");
        let mix = taps.mix(out[1][103]);
        for k in 0..taps.length().min(149) {
            assert!((out[0][3 * (51 + k) + 2] - 0.05 * taps.sample(&mix, k)).abs() < 1e-12);
        }
    }

    #[test]
    fn beyond_the_fastest_tap_the_thesis_plays_it_as_recorded() {
        let taps = load_surface(&tile()).unwrap().taps.unwrap();
        let fastest = taps.taps().last().unwrap();
        let fall = fall(1.5 * fastest.speed_m_s);
        let rendered = |above| {
            let settings = TappingSettings { above, ..settings() };
            let mut bench = Bench::new::<Tapping>(settings, 1000.0, &[Contact::KIND]).unwrap();
            let out = bench.run_in_blocks(&[&fall], &[1, 64]);
            let (force, tap) = (out[0].as_chunks::<3>().0, out[1].as_chunks::<2>().0);
            let tick = tap.iter().position(|event| event[0] != 0.0).unwrap();
            assert!((tap[tick][1] - 1.5 * fastest.speed_m_s).abs() < 1e-9, "its true speed");
            force[tick..].iter().map(|force| force[2]).collect::<Vec<f64>>()
        };
        let (held, grown) = (rendered(Above::Hold), rendered(Above::Grow));
        for ((held, grown), recorded) in held.iter().zip(&grown).zip(&fastest.acceleration_m_s2) {
            assert_eq!(*held, 0.05 * recorded);
            assert!((grown - 1.5_f64.powf(0.7) * held).abs() < 1e-12);
        }
    }

    #[test]
    fn a_surface_without_taps_is_told_of_and_only_fires() {
        let mut surface = load_surface(&tile()).unwrap();
        surface.taps = None;
        let file = tempfile::NamedTempFile::with_suffix(".ron").unwrap();
        std::fs::write(file.path(), haptograph_surfaces::files::native::write(&surface)).unwrap();
        let mut bench = Bench::new::<Tapping>(
            TappingSettings { surface: file.path().to_owned(), ..settings() },
            1000.0,
            &[Contact::KIND],
        )
        .unwrap();
        let out = bench.run(&[&fall(0.15)]);
        assert!(out[0].iter().all(|f| *f == 0.0));
        assert!((out[1][103] - 0.15).abs() < 1e-9);
    }

    #[test]
    fn a_slow_touch_is_no_tap() {
        let mut bench = Bench::new::<Tapping>(settings(), 1000.0, &[Contact::KIND]).unwrap();
        assert!(bench.run(&[&fall(0.005)])[0].iter().all(|f| *f == 0.0));
    }
}
