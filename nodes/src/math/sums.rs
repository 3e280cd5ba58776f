//! Sums of signals of one quantity: add, subtract, mix. Terms are added in the order in which they are connected.

use haptograph_engine::frame::Linear;
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Flow, Input, InputSpec, Io, KindRule, LiveId, Many, NodeKind, NodeSpec,
    Output, Presence, Processor, QuantityRule, Tick, any_input, output_like,
};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::elementwise;

const TERMS: InputSpec = InputSpec {
    name: "inputs",
    kind: KindRule::Linear,
    quantity: QuantityRule::Any,
    flow: Flow::Sampled,
    presence: Presence::Many,
    doc: "The terms, all of one kind and quantity.",
};

/// Adds signals.
#[derive(Debug, Clone, Copy)]
pub struct Add;

impl NodeKind for Add {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Add",
        group: "math",
        doc: "Adds any number of signals of one kind and quantity.",
        source: "",
        inputs: &[TERMS],
        outputs: &[output_like("output", "inputs", "The sum, added in the order of the list.")],
        example: r#""total": Add(inputs: ["texture.acceleration", "taps.acceleration"])"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Add))
    }
}

impl Add {
    const INPUTS: Input<Self, Linear, Many> = Input::named("inputs");
    const OUTPUT: Output<Self, Linear> = Output::named("output");
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
}

/// Subtracts one signal from another.
#[derive(Debug, Clone, Copy)]
pub struct Subtract;

impl NodeKind for Subtract {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Subtract",
        group: "math",
        doc: "Subtracts `less` from `input`, both of one kind and quantity.",
        source: "",
        inputs: &[
            any_input("input", "The minuend."),
            InputSpec {
                kind: KindRule::Same("input"),
                quantity: QuantityRule::Same("input"),
                ..any_input("less", "The subtrahend.")
            },
        ],
        outputs: &[output_like("output", "input", "The difference.")],
        example: r#""error": Subtract(input: "reference.output", less: "sensor.force")"#,
    };

    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Subtract))
    }
}

impl Subtract {
    const INPUT: Input<Self, Linear> = Input::named("input");
    const LESS: Input<Self, Linear> = Input::named("less");
    const OUTPUT: Output<Self, Linear> = Output::named("output");
}

impl Processor<Subtract> for Subtract {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Subtract>) {
        let (a, b) = (io.read(Subtract::INPUT), io.read(Subtract::LESS));
        for ((y, a), b) in io.write(Subtract::OUTPUT).iter_mut().zip(a).zip(b) {
            *y = a - b;
        }
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

/// Adds signals with a gain each.
pub struct Mixer;

impl NodeKind for Mixer {
    type Settings = MixerSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Mixer",
        group: "math",
        doc: "Adds any number of signals of one kind and quantity, each with its own gain.",
        source: "",
        inputs: &[TERMS],
        outputs: &[output_like("output", "inputs", "The weighted sum, added in the order of the list.")],
        example: r#""mix": Mixer(inputs: ["texture.acceleration", "taps.acceleration"], gains: [1.0, 0.5])"#,
    };

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

impl Mixer {
    const INPUTS: Input<Self, Linear, Many> = Input::named("inputs");
    const OUTPUT: Output<Self, Linear> = Output::named("output");
    const GAINS: LiveId<Self> = LiveId::named("gains");
    const MASTER: LiveId<Self> = LiveId::named("master");
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

    fn set(&mut self, setting: LiveId<Mixer>, value: f64) {
        if setting == Mixer::MASTER {
            self.master = value;
        }
    }

    fn set_item(&mut self, setting: LiveId<Mixer>, item: usize, value: f64) {
        if setting == Mixer::GAINS
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
