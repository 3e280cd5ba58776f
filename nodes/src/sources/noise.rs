//! Gaussian noise, white or pink.

use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, LiveId, NodeKind, Port, Processor, Tick};
use haptograph_signal::noise::Gaussian;

/// Where the power of pink noise begins to fall, Hz.
const LOWEST_HZ: f64 = 5.0;

/// Longest response of which the energy is computed, samples: 1.6 MHz.
const MAX_RESPONSE: usize = 500_000;

haptograph_engine::choices! {
    /// How the power of noise is spread over frequency.
    pub enum Colour {
        /// Equal power in each hertz: each number is independent of the others.
        White,
        /// Equal power in each octave, from 20 Hz to a quarter of the rate within 0.5 dB: masking noise for headphones.
        Pink,
    }
}

haptograph_engine::settings! {
    /// Settings of [`Noise`].
    pub struct NoiseSettings {
        /// Variance, in the SI unit of `quantity` squared.
        [live] variance: f64 = 1.0, in 0.0..=1e30;
        /// Quantity of the output, by name.
        quantity: String = "number".into();
        /// How its power is spread over frequency.
        colour: Colour = Colour::White;
    }
}

haptograph_engine::node! {
    /// Gaussian noise: random numbers, white or pink. Each node has a stream of its own, from the graph's seed and the node's path.
    /// Elsewhere: WhiteNoise, PinkNoise, LFNoise, noise~, randn.
    pub struct Noise(NoiseSettings) in "sources";
    example: r#""hiss": Noise(clock: "synth", variance: 0.01, quantity: "acceleration")"#;
    out OUTPUT: Scalar = Port::of_setting("quantity", "The noise.");
}

impl NodeKind for Noise {
    fn build(settings: NoiseSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let pink = match settings.colour {
            Colour::White => None,
            Colour::Pink => Some(Pink::new(cx.rate.hz())),
        };
        Ok(Built::new(Source { stream: Gaussian::new(cx.seed), deviation: settings.variance.sqrt(), pink }))
    }
}

#[derive(Debug, Clone)]
struct Source {
    stream: Gaussian,
    deviation: f64,
    pink: Option<Pink>,
}

/// A filter of 3 dB an octave: a pole in each octave, and a zero in its middle.
#[derive(Debug, Clone)]
struct Pink {
    /// Pole, zero and state of each section.
    sections: Vec<[f64; 3]>,
    /// Makes white noise of variance 1 pink noise of variance 1.
    gain: f64,
}

impl Pink {
    fn new(rate_hz: f64) -> Self {
        let at = |hz: f64| (-std::f64::consts::TAU * hz / rate_hz).exp();
        let octaves = (0..64).map(|octave| LOWEST_HZ * 2.0_f64.powi(octave));
        let poles = octaves.take_while(|hz| 2.0 * hz * std::f64::consts::SQRT_2 < rate_hz);
        let sections = poles.map(|hz| [at(hz), at(hz * std::f64::consts::SQRT_2), 0.0]).collect();
        let mut pink = Self { sections, gain: 1.0 };
        // The energy of its response to an impulse, until that has decayed by 80 dB.
        let length = if pink.sections.is_empty() { 1 } else { (1.5 * rate_hz / LOWEST_HZ) as usize };
        let length = length.min(MAX_RESPONSE);
        let energy: f64 = (0..length).map(|n| pink.step(f64::from(u8::from(n == 0))).powi(2)).sum();
        pink.gain = energy.sqrt().recip();
        pink.sections.iter_mut().for_each(|[.., state]| *state = 0.0);
        pink
    }

    fn step(&mut self, white: f64) -> f64 {
        let sections = self.sections.iter_mut();
        self.gain
            * sections.fold(white, |x, [pole, zero, state]| {
                let y = x + *state;
                *state = *pole * y - *zero * x;
                y
            })
    }
}

impl Processor<Noise> for Source {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Noise>) {
        let out = io.write(Noise::OUTPUT);
        self.stream.fill(out);
        if let Some(pink) = &mut self.pink {
            out.iter_mut().for_each(|y| *y = pink.step(*y));
        }
        for y in out {
            *y *= self.deviation;
        }
    }

    fn set(&mut self, setting: LiveId<NoiseSettings>, value: f64) {
        if setting == NoiseSettings::variance {
            self.deviation = value.max(0.0).sqrt();
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.stream.clone_from(&self.stream);
        if let (Some(old), Some(new)) = (&self.pink, &mut new.pink)
            && old.sections.len() == new.sections.len()
        {
            let states = new.sections.iter_mut().zip(&old.sections);
            states.for_each(|([.., new], [.., old])| *new = *old);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::testing::Bench;

    #[test]
    fn noise_has_its_variance_and_no_memory() {
        let settings = NoiseSettings { variance: 9.0, quantity: "number".into(), colour: Colour::White };
        let mut bench = Bench::new::<Noise>(settings, 1000.0, &[]).unwrap();
        let n = 200_000;
        let y = bench.run_frames(n, &[], &[64, 1]).remove(0);
        let mean = |f: &dyn Fn(usize) -> f64| (1..n).map(f).sum::<f64>() / (n - 1) as f64;
        let four_sigma = 4.0 / (n as f64).sqrt();
        assert!(mean(&|k| y[k] / 3.0).abs() < four_sigma);
        assert!((mean(&|k| y[k] * y[k] / 9.0) - 1.0).abs() < 2.0_f64.sqrt() * four_sigma);
        assert!(mean(&|k| y[k] * y[k - 1] / 9.0).abs() < four_sigma);
    }

    #[test]
    fn pink_noise_has_equal_power_in_each_octave_and_its_variance() {
        for rate_hz in [48_000.0, 10_000.0] {
            let mut pink = Pink::new(rate_hz);
            let response: Vec<f64> = (0..40_000).map(|n| pink.step(f64::from(u8::from(n == 0)))).collect();
            // 10 log of frequency times power.
            let level = |hz: f64| {
                let turn = std::f64::consts::TAU * hz / rate_hz;
                let part = |of: fn(f64) -> f64| -> f64 {
                    response.iter().enumerate().map(|(n, y)| y * of(turn * n as f64)).sum()
                };
                10.0 * (hz * (part(f64::cos).powi(2) + part(f64::sin).powi(2))).log10()
            };
            let levels: Vec<f64> = (0..60)
                .map(|k| 20.0 * 1.15_f64.powi(k))
                .take_while(|hz| *hz < rate_hz / 4.0)
                .map(level)
                .collect();
            let least = levels.iter().copied().fold(f64::INFINITY, f64::min);
            let most = levels.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            assert!(levels.len() > 30 && most - least < 1.0, "{rate_hz} Hz: {least} to {most} dB");
        }
        let settings = NoiseSettings { variance: 9.0, quantity: "number".into(), colour: Colour::Pink };
        let mut bench = Bench::new::<Noise>(settings, 10_000.0, &[]).unwrap();
        let y = bench.run_frames(200_000, &[], &[64, 1]).remove(0);
        let variance = y.iter().map(|y| y * y / 9.0).sum::<f64>() / y.len() as f64;
        assert!((variance - 1.0).abs() < 0.1, "{variance}");
    }
}
