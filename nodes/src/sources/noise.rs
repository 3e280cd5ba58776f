//! White Gaussian noise.

use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, LiveId, NodeKind, Port, Processor, Tick};
use haptograph_signal::noise::Gaussian;

haptograph_engine::settings! {
    /// Settings of [`Noise`].
    pub struct NoiseSettings {
        /// Variance, in the SI unit of `quantity` squared.
        [live] variance: f64 = 1.0, in 0.0..=1e30;
        /// Quantity of the output, by name.
        quantity: String = "number".into();
    }
}

haptograph_engine::node! {
    /// White Gaussian noise: random numbers, each independent of the others. Each node has a stream of its own, from the
    /// graph's seed and the node's path.
    pub struct Noise(NoiseSettings) in "sources";
    example: r#""hiss": Noise(clock: "synth", variance: 0.01, quantity: "acceleration")"#;
    out OUTPUT: Scalar = Port::of_setting("quantity", "The noise.");
}

impl NodeKind for Noise {
    fn build(settings: NoiseSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Source { stream: Gaussian::new(cx.seed), deviation: settings.variance.sqrt() }))
    }
}

#[derive(Debug, Clone)]
struct Source {
    stream: Gaussian,
    deviation: f64,
}

impl Processor<Noise> for Source {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Noise>) {
        let out = io.write(Noise::OUTPUT);
        self.stream.fill(out);
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
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::testing::Bench;

    #[test]
    fn noise_has_its_variance_and_no_memory() {
        let settings = NoiseSettings { variance: 9.0, quantity: "number".into() };
        let mut bench = Bench::new::<Noise>(settings, 1000.0, &[]).unwrap();
        let n = 200_000;
        let y = bench.run_frames(n, &[], &[64, 1]).remove(0);
        let mean = |f: &dyn Fn(usize) -> f64| (1..n).map(f).sum::<f64>() / (n - 1) as f64;
        let four_sigma = 4.0 / (n as f64).sqrt();
        assert!(mean(&|k| y[k] / 3.0).abs() < four_sigma);
        assert!((mean(&|k| y[k] * y[k] / 9.0) - 1.0).abs() < 2.0_f64.sqrt() * four_sigma);
        assert!(mean(&|k| y[k] * y[k - 1] / 9.0).abs() < four_sigma);
    }
}
