//! The actions of a simulated hand, as settings.

use super::drawing::{CirclesSettings, Drawing, DrawingSettings};
use super::hand::Grip;
use super::script::Action;
use haptograph_engine::node::BuildError;
use haptograph_signal::units::{Grams, Millimetres, MillimetresPerSecond, NewtonsPerMillimetre};

haptograph_engine::choices! {
    /// An action of a simulated hand.
    pub(crate) enum Doing {
        /// Hold the tip lifted.
        Hover(HoverSettings),
        /// Draw on the surface.
        Draw(DrawSettings),
        /// Tap the surface.
        Taps(TapsSettings),
        /// Press and release.
        Press(PressSettings),
    }
}

haptograph_engine::settings! {
    /// Hovering.
    pub struct HoverSettings {
        /// Duration, s.
        duration_s: f64 = 1.0, in 0.001..=100_000.0;
    }
}

haptograph_engine::settings! {
    /// Drawing.
    pub struct DrawSettings {
        /// The stroke: Still, Circles, ZigZag, Writing, Wander, or the Path of a file.
        stroke: Drawing = Drawing::Circles(CirclesSettings { radius_mm: Millimetres(20.0), period_s: 1.2 });
        /// Duration, s.
        duration_s: f64 = 5.0, in 0.001..=100_000.0;
        /// Mean normal force, N; a path has its own.
        force_n: f64 = 1.0, in 0.0..=50.0;
        /// Standard deviation of the force as a fraction of its mean.
        force_variation: f64 = 0.2, in 0.0..=0.3;
        /// Standard deviation of the pace as a fraction of its mean.
        pace_variation: f64 = 0.15, in 0.0..=0.3;
        /// Standard deviation of the size as a fraction.
        size_variation: f64 = 0.05, in 0.0..=0.3;
    }
}

haptograph_engine::settings! {
    /// Tapping.
    pub struct TapsSettings {
        /// Number of taps.
        count: u32 = 5, in 1..=10_000;
        /// Slowest speed at contact, mm/s.
        slowest_mm_s: MillimetresPerSecond = MillimetresPerSecond(60.0), in 0.1..=10_000.0;
        /// Fastest speed at contact, mm/s.
        fastest_mm_s: MillimetresPerSecond = MillimetresPerSecond(250.0), in 0.1..=10_000.0;
        /// Time from tap to tap, s.
        interval_s: f64 = 0.6, in 0.01..=1000.0;
        /// Force at the bottom of a tap, N.
        force_n: f64 = 0.8, in 0.001..=50.0;
    }
}

haptograph_engine::settings! {
    /// Pressing.
    pub struct PressSettings {
        /// Largest force, N.
        force_n: f64 = 2.0, in 0.001..=50.0;
        /// Time from lifted to lifted, s.
        duration_s: f64 = 2.0, in 0.01..=1000.0;
    }
}

haptograph_engine::settings! {
    /// The grip of a simulated hand. The numbers are ours, within the range of models of a pen grip.
    pub struct GripSettings {
        /// Mass that moves with the tip, g.
        mass_g: Grams = Grams::of_si(Grip::TYPICAL.mass_kg), in 0.1..=10_000.0;
        /// Stiffness towards the intended path, N/mm.
        stiffness_n_per_mm: NewtonsPerMillimetre = NewtonsPerMillimetre::of_si(Grip::TYPICAL.stiffness_n_per_m), in 1e-6..=1000.0;
        /// Damping towards the intended path, N s/m.
        damping_n_s_per_m: f64 = Grip::TYPICAL.damping_n_s_per_m, in 1e-6..=10_000.0;
        /// Standard deviation of the tremor along each axis, mm.
        tremor_mm: Millimetres = Millimetres::of_si(Grip::TYPICAL.tremor_m), in 0.0..=10.0;
    }
}

impl GripSettings {
    /// A typical grip.
    pub(crate) fn typical() -> Self {
        Self {
            mass_g: Grams::of_si(Grip::TYPICAL.mass_kg),
            stiffness_n_per_mm: NewtonsPerMillimetre::of_si(Grip::TYPICAL.stiffness_n_per_m),
            damping_n_s_per_m: Grip::TYPICAL.damping_n_s_per_m,
            tremor_mm: Millimetres::of_si(Grip::TYPICAL.tremor_m),
        }
    }

    /// The grip in SI.
    pub(crate) fn to_grip(&self) -> Grip {
        Grip {
            mass_kg: self.mass_g.si(),
            stiffness_n_per_m: self.stiffness_n_per_mm.si(),
            damping_n_s_per_m: self.damping_n_s_per_m,
            tremor_m: self.tremor_mm.si(),
        }
    }
}

/// Default actions: circles, taps and a press.
pub(crate) fn a_bit_of_everything() -> Vec<Doing> {
    let draw = DrawSettings {
        stroke: Drawing::Circles(CirclesSettings { radius_mm: Millimetres(20.0), period_s: 1.2 }),
        duration_s: 5.0,
        force_n: 1.0,
        force_variation: 0.2,
        pace_variation: 0.15,
        size_variation: 0.05,
    };
    let taps = TapsSettings {
        count: 4,
        slowest_mm_s: MillimetresPerSecond(60.0),
        fastest_mm_s: MillimetresPerSecond(250.0),
        interval_s: 0.6,
        force_n: 0.8,
    };
    vec![Doing::Draw(draw), Doing::Taps(taps), Doing::Press(PressSettings { force_n: 2.0, duration_s: 2.0 })]
}

/// Actions in SI.
///
/// # Errors
/// [`BuildError`] if the file of a path is invalid.
pub(crate) fn actions(doings: &[Doing]) -> Result<Vec<Action>, BuildError> {
    doings.iter().map(action).collect()
}

fn action(doing: &Doing) -> Result<Action, BuildError> {
    Ok(match doing {
        Doing::Hover(hover) => Action::Hover { duration_s: hover.duration_s },
        Doing::Draw(draw) => {
            let drawing = DrawingSettings {
                stroke: draw.stroke.clone(),
                force_n: draw.force_n,
                force_variation: draw.force_variation,
                pace_variation: draw.pace_variation,
                size_variation: draw.size_variation,
            };
            Action::Draw { stroke: drawing.to_stroke()?, duration_s: draw.duration_s }
        }
        Doing::Taps(taps) => Action::Taps {
            count: taps.count,
            slowest_m_s: taps.slowest_mm_s.si(),
            fastest_m_s: taps.fastest_mm_s.si(),
            interval_s: taps.interval_s,
            force_n: taps.force_n,
        },
        Doing::Press(press) => Action::Press { force_n: press.force_n, duration_s: press.duration_s },
    })
}
