//! Sums of signals of one quantity: add, subtract, mix. Terms are added in the order in which they are connected.

use haptograph_engine::frame::Linear;
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, Law, LiveId, Many, NodeKind, Port, Processor, Tick,
};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::elementwise;

haptograph_engine::node! {
    /// Adds any number of signals of one kind and quantity.
    pub struct Add(NoSettings) in "math";
    example: r#""total": Add(inputs: ["texture.acceleration", "taps.acceleration"])"#;
    in INPUTS: Linear, Many = Port::any("The terms, all of one kind and quantity.");
    out OUTPUT: Linear = Port::like("inputs", "The sum, added in the order of the list.");
}

impl NodeKind for Add {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Add))
    }
}

impl Processor<Add> for Add {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Add>) {
        let (terms, sum) = (io.read(Add::INPUTS), io.write(Add::OUTPUT));
        let first = terms.nth_or_last(0);
        if terms.len() < 2 {
            sum.copy_from_slice(first);
            return;
        }
        for ((y, a), b) in sum.iter_mut().zip(first).zip(terms.nth_or_last(1)) {
            *y = a + b;
        }
        for x in terms.iter().skip(2) {
            for (y, x) in sum.iter_mut().zip(x) {
                *y += x;
            }
        }
    }

    /// Of two terms.
    fn law(&self) -> Option<Law> {
        Some(Law::Sum)
    }
}

haptograph_engine::node! {
    /// Subtracts `less` from `input`, both of one kind and quantity.
    pub struct Subtract(NoSettings) in "math";
    example: r#""error": Subtract(input: "reference.output", less: "sensor.force")"#;
    in INPUT: Linear = Port::any("The minuend.");
    in LESS: Linear = Port::like("input", "The subtrahend.");
    out OUTPUT: Linear = Port::like("input", "The difference.");
}

impl NodeKind for Subtract {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Subtract))
    }
}

impl Processor<Subtract> for Subtract {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Subtract>) {
        let (a, b) = (io.read(Subtract::INPUT), io.read(Subtract::LESS));
        for ((y, a), b) in io.write(Subtract::OUTPUT).iter_mut().zip(a).zip(b) {
            *y = a - b;
        }
    }

    fn law(&self) -> Option<Law> {
        Some(Law::Difference)
    }
}

haptograph_engine::settings! {
    /// Settings of [`Mixer`].
    pub struct MixerSettings {
        /// A gain for each input, in the order of `inputs`.
        [live] gains: Vec<f64>, in -1e9..=1e9;
        /// Gain of the whole mix.
        [live] master: f64 = 1.0, in -1e9..=1e9;
    }
}

haptograph_engine::node! {
    /// Adds any number of signals of one kind and quantity, each with its own gain.
    /// Elsewhere: Mix, mixer~, sum.
    pub struct Mixer(MixerSettings) in "math";
    example: r#""mix": Mixer(inputs: ["texture.acceleration", "taps.acceleration"], gains: [1.0, 0.5])"#;
    in INPUTS: Linear, Many = Port::any("The terms, all of one kind and quantity.");
    out OUTPUT: Linear = Port::like("inputs", "The weighted sum, added in the order of the list.");
}

impl NodeKind for Mixer {
    fn build(settings: MixerSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let (gains, inputs) = (settings.gains.len(), cx.connections(Self::INPUTS));
        if gains != inputs {
            let message = format!("the number of gains is {gains}, that of inputs {inputs}");
            return Err(
                BuildError::at("gains", message).help("give one gain for each input, in the same order")
            );
        }
        Ok(Built::new(Mixing { gains: settings.gains.into(), master: settings.master }))
    }
}

#[derive(Debug, Clone)]
struct Mixing {
    gains: Box<[f64]>,
    master: f64,
}

impl Processor<Mixer> for Mixing {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Mixer>) {
        let (terms, mix) = (io.read(Mixer::INPUTS), io.write(Mixer::OUTPUT));
        // The first two in one pass: most mixes have no more.
        let done = match *self.gains {
            [a, b, ..] => {
                let (x, z) = (terms.nth_or_last(0), terms.nth_or_last(1));
                elementwise::mix([a * self.master, b * self.master], x, z, mix);
                2
            }
            _ => {
                mix.fill(0.0);
                0
            }
        };
        for (x, gain) in terms.iter().zip(&self.gains).skip(done) {
            let gain = gain * self.master;
            for (y, x) in mix.iter_mut().zip(x) {
                *y += gain * x;
            }
        }
    }

    fn law(&self) -> Option<Law> {
        match *self.gains {
            [a, b] => Some(Law::Mix(a * self.master, b * self.master)),
            _ => None,
        }
    }

    fn set(&mut self, setting: LiveId<MixerSettings>, value: f64) {
        if setting == MixerSettings::master {
            self.master = value;
        }
    }

    fn set_item(&mut self, setting: LiveId<MixerSettings>, item: usize, value: f64) {
        if setting == MixerSettings::gains
            && let Some(gain) = self.gains.get_mut(item)
        {
            *gain = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    #[test]
    fn sums_of_one_two_and_four_terms() {
        for terms in [1, 2, 4] {
            let kinds = vec![Kind::SCALAR; terms];
            let mut bench = Bench::new::<Add>(NoSettings {}, 1.0, &kinds).unwrap();
            let inputs: Vec<[f64; 2]> = (0..terms).map(|i| [i as f64 + 1.0, 10.0 * i as f64]).collect();
            let inputs: Vec<&[f64]> = inputs.iter().map(|x| &x[..]).collect();
            let n = terms as f64;
            assert_eq!(bench.run(&inputs), [[n * (n + 1.0) / 2.0, 5.0 * n * (n - 1.0)]]);
        }
    }

    #[test]
    fn a_difference_has_a_sign() {
        let mut bench = Bench::new::<Subtract>(NoSettings {}, 1.0, &[Kind::SCALAR; 2]).unwrap();
        assert_eq!(bench.run(&[&[3.0], &[5.0]]), [[-2.0]]);
    }

    #[test]
    fn a_mixer_needs_a_gain_for_every_input() {
        let settings = |gains: &[f64]| MixerSettings { gains: gains.to_vec(), master: 10.0 };
        let mut bench = Bench::new::<Mixer>(settings(&[1.0, -0.5]), 1.0, &[Kind::SCALAR; 2]).unwrap();
        assert_eq!(bench.run(&[&[3.0], &[4.0]]), [[10.0]]);
        let refused = Bench::new::<Mixer>(settings(&[1.0]), 1.0, &[Kind::SCALAR; 2]).err();
        assert_eq!(refused.map(|e| e.field), Some(Some("gains")));
    }
}
