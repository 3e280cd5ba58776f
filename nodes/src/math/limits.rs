//! Bounds on signals: clamp, soft clip, slew limit. NaN and infinity pass and leave no state, so that the engine's
//! check at the sinks finds their origin.

use haptograph_engine::frame::Linear;
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, Law, LiveId, NodeKind, Port, Processor, Tick,
};

haptograph_engine::settings! {
    /// Clamps a signal to two bounds.
    pub struct ClampSettings {
        /// Smallest output, in the SI unit of the signal.
        [live] lowest: f64;
        /// Largest output, in the SI unit of the signal.
        [live] highest: f64;
    }
}

haptograph_engine::node! {
    /// Clamps every component of a signal to two bounds.
    /// Elsewhere: Clip, clip~, min, max.
    pub struct Clamp(ClampSettings) in "math";
    example: r#""pressed": Clamp(input: "stylus.force", lowest: 0.0, highest: 3.0)"#;
    in INPUT: Linear = Port::any("The signal.");
    out OUTPUT: Linear = Port::like("input", "The signal within the bounds.");
}

impl NodeKind for Clamp {
    fn build(settings: ClampSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        let ClampSettings { lowest, highest } = settings;
        if lowest > highest {
            let message = format!("the lowest value {lowest} is above the highest, {highest}");
            return Err(BuildError::at("lowest", message).help("swap them"));
        }
        Ok(Built::new(settings))
    }
}

impl Processor<Clamp> for ClampSettings {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Clamp>) {
        let x = io.read(Clamp::INPUT);
        for (y, x) in io.write(Clamp::OUTPUT).iter_mut().zip(x) {
            let above = if *x < self.lowest { self.lowest } else { *x };
            *y = if above > self.highest { self.highest } else { above };
        }
    }

    fn law(&self) -> Option<Law> {
        Some(Law::Clamp(self.lowest, self.highest))
    }

    fn set(&mut self, setting: LiveId<ClampSettings>, value: f64) {
        match setting {
            ClampSettings::lowest => self.lowest = value,
            ClampSettings::highest => self.highest = value,
            _ => {}
        }
    }
}

haptograph_engine::settings! {
    /// Limits a signal smoothly.
    pub struct SoftClipSettings {
        /// Bound that the output approaches and never exceeds, in the SI unit of the signal.
        [live] limit: f64, in 1e-12..=1e12;
    }
}

haptograph_engine::node! {
    /// Limits every component of a signal smoothly: limit tanh(x / limit). Small signals pass nearly unchanged.
    /// Elsewhere: tanh, softclip, Distort.
    pub struct SoftClip(SoftClipSettings) in "math";
    example: r#""soft": SoftClip(input: "texture.acceleration", limit: 20.0)"#;
    in INPUT: Linear = Port::any("The signal.");
    out OUTPUT: Linear = Port::like("input", "The signal within plus and minus the limit.");
}

impl NodeKind for SoftClip {
    fn build(settings: SoftClipSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(settings))
    }
}

impl Processor<SoftClip> for SoftClipSettings {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, SoftClip>) {
        let x = io.read(SoftClip::INPUT);
        for (y, x) in io.write(SoftClip::OUTPUT).iter_mut().zip(x) {
            *y = self.limit * (x / self.limit).tanh();
        }
    }

    fn set(&mut self, setting: LiveId<SoftClipSettings>, value: f64) {
        if setting == SoftClipSettings::limit {
            self.limit = value;
        }
    }
}

haptograph_engine::settings! {
    /// Settings of [`SlewLimit`].
    pub struct SlewLimitSettings {
        /// Largest rate of change, in the SI unit of the signal per second.
        [live] most_per_s: f64, in 0.0..=1e15;
    }
}

haptograph_engine::node! {
    /// Limits the slew rate of a signal; for a vector, the length of its change. The output starts at the first input.
    /// Elsewhere: Slew, slide~, VarLag, rate limiter.
    pub struct SlewLimit(SlewLimitSettings) in "math";
    example: r#""eased": SlewLimit(input: "stylus.force", most_per_s: 50.0)"#;
    in INPUT: Linear = Port::any("The signal.");
    out OUTPUT: Linear = Port::like("input", "The signal, delayed where it changes too fast.");
}

impl NodeKind for SlewLimit {
    fn build(settings: SlewLimitSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(SlewLimiting {
            most_per_s: settings.most_per_s,
            previous: [0.0; 6],
            started: false,
            period_s: cx.rate.period_s(),
        }))
    }
}

#[derive(Debug, Clone)]
struct SlewLimiting {
    most_per_s: f64,
    /// Components of the last output, as many as the widest linear frame has.
    previous: [f64; 6],
    started: bool,
    period_s: f64,
}

impl Processor<SlewLimit> for SlewLimiting {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, SlewLimit>) {
        let (width, x) = (io.width(SlewLimit::INPUT).min(6), io.read(SlewLimit::INPUT));
        let step = self.most_per_s * self.period_s;
        for (y, x) in io.write(SlewLimit::OUTPUT).chunks_exact_mut(width).zip(x.chunks_exact(width)) {
            let previous = &mut self.previous[..width];
            let square = |(x, p): (&f64, &f64)| (x - p) * (x - p);
            let change = x.iter().zip(previous.iter()).map(square).sum::<f64>().sqrt();
            if !change.is_finite() {
                y.copy_from_slice(x);
                continue;
            }
            let part = if self.started && change > step { step / change } else { 1.0 };
            for ((y, p), x) in y.iter_mut().zip(previous).zip(x) {
                // A change within the limit is taken exactly.
                *p = if part < 1.0 { *p + part * (x - *p) } else { *x };
                *y = *p;
            }
            self.started = true;
        }
    }

    fn set(&mut self, setting: LiveId<SlewLimitSettings>, value: f64) {
        if setting == SlewLimitSettings::most_per_s {
            self.most_per_s = value;
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        (new.previous, new.started) = (self.previous, self.started);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    #[test]
    fn a_clamp_keeps_its_bounds_and_lets_nan_be_seen() {
        let settings = |lowest, highest| ClampSettings { lowest, highest };
        let mut bench = Bench::new::<Clamp>(settings(-1.0, 2.0), 1.0, &[Kind::SCALAR]).unwrap();
        let y = &bench.run(&[&[-5.0, 0.5, 7.0, f64::NAN, f64::INFINITY]])[0];
        assert_eq!((y[0], y[1], y[2], y[4]), (-1.0, 0.5, 2.0, 2.0));
        assert!(y[3].is_nan());
        assert!(Bench::new::<Clamp>(settings(1.0, 0.0), 1.0, &[Kind::SCALAR]).is_err());
    }

    #[test]
    fn a_soft_clip_is_the_signal_when_small_and_the_limit_when_large() {
        let mut bench =
            Bench::new::<SoftClip>(SoftClipSettings { limit: 2.0 }, 1.0, &[Kind::SCALAR]).unwrap();
        let y = &bench.run(&[&[1e-4, 1e6, -1e6]])[0];
        assert!((y[0] - 1e-4).abs() < 1e-12);
        assert_eq!((y[1], y[2]), (2.0, -2.0));
    }

    #[test]
    fn a_vector_changes_by_no_more_than_its_slew_and_arrives_exactly() {
        let settings = SlewLimitSettings { most_per_s: 500.0 };
        let mut bench = Bench::new::<SlewLimit>(settings, 1000.0, &[Kind::VECTOR]).unwrap();
        let target = [3.0, 4.0, 0.0];
        let mut x = vec![0.0; 3];
        (0..12).for_each(|_| x.extend(target));
        let y = &bench.run(&[&x])[0];
        for pair in y.as_chunks::<3>().0.windows(2) {
            assert!(crate::vector::distance(pair[0], pair[1]) <= 0.5 + 1e-12);
        }
        assert_eq!(y[y.len() - 3..], target);
        assert!((y[3] - 0.3).abs() < 1e-12 && (y[4] - 0.4).abs() < 1e-12);
    }
}
