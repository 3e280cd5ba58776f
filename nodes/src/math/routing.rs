//! Switch and delay.

use haptograph_engine::frame::{AnyKind, Kind, Linear, Scalar};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, Latency, LiveId, Many, NodeKind, Optional, Port, Processor, Tick,
};
use haptograph_signal::quantity::Quantity;

haptograph_engine::settings! {
    /// Settings of [`Switch`].
    pub struct SwitchSettings {
        /// Input that is passed on while `selector` is not connected; 0 is the first.
        [live] select: u32 = 0;
    }
}

haptograph_engine::node! {
    /// Selects one of several signals of one kind and quantity, by a signal or by a setting.
    /// Elsewhere: Select, selector~, selectn, gate.
    pub struct Switch(SwitchSettings) in "math";
    example: r#""source": Switch(inputs: ["texture.acceleration", "tone.output"], select: 1)"#;
    in SELECTOR: Scalar, Optional =
        Port::of(Quantity::NUMBER, "Index of the input, from 0; rounded, and clamped to the last input.");
    in INPUTS: AnyKind, Many = Port::any("The signals to choose from.");
    out OUTPUT: AnyKind = Port::like("inputs", "The selected signal.");
}

impl NodeKind for Switch {
    fn build(settings: SwitchSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let inputs = cx.connections(Self::INPUTS);
        let select = settings.select as usize;
        if select >= inputs {
            let message = format!("`select` is {select}, but there are {inputs} inputs");
            return Err(BuildError::at("select", message).help("inputs are counted from 0"));
        }
        Ok(Built::new(Switching { select }))
    }
}

#[derive(Debug, Clone)]
struct Switching {
    select: usize,
}

impl Processor<Switch> for Switching {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Switch>) {
        let (inputs, width) = (io.read(Switch::INPUTS), io.width(Switch::INPUTS));
        let Some(selector) = io.read(Switch::SELECTOR) else {
            io.write(Switch::OUTPUT).copy_from_slice(inputs.nth_or_last(self.select));
            return;
        };
        let frames = io.write(Switch::OUTPUT).chunks_exact_mut(width);
        for (frame, (y, selected)) in frames.zip(selector).enumerate() {
            // The conversion saturates and turns NaN into 0.
            let x = inputs.nth_or_last(selected.round() as usize);
            y.copy_from_slice(&x[frame * width..(frame + 1) * width]);
        }
    }

    fn set(&mut self, setting: LiveId<SwitchSettings>, value: f64) {
        if setting == SwitchSettings::select {
            self.select = value.round() as usize;
        }
    }
}

haptograph_engine::settings! {
    /// Settings of [`Delay`].
    pub struct DelaySettings {
        /// Delay in frames, at most ten million.
        frames: u32, in 0..=10_000_000;
    }
}

haptograph_engine::node! {
    /// Delays a signal by a number of frames; the output is neutral before that, which is zero for the shipped kinds. It
    /// does not close a feedback loop: for that, write the delay on the connection, as `Delay(...)` in place of the input.
    /// Elsewhere: DelayN, delay~, delread~.
    pub struct Delay(DelaySettings) in "math";
    example: r#""echo": Delay(input: "texture.acceleration", frames: 480)"#;
    in INPUT: Linear = Port::any("The signal.");
    out OUTPUT: Linear = Port::like("input", "The delayed signal.");
}

impl NodeKind for Delay {
    fn memory_bytes(settings: &DelaySettings, cx: &BuildContext) -> u64 {
        let width = cx.width(Self::INPUT);
        u64::from(settings.frames) * (width * size_of::<f64>()) as u64
    }

    fn build(settings: DelaySettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let kind = cx.kind(Self::INPUT).unwrap_or(Kind::SCALAR);
        let frames = settings.frames as usize;
        Ok(Built::new(Later {
            kind,
            ring: kind.neutral().collect::<Vec<_>>().repeat(frames).into(),
            next: 0,
            delay_s: frames as f64 * cx.rate.period_s(),
        }))
    }
}

#[derive(Debug, Clone)]
struct Later {
    kind: Kind,
    /// The last frames, the oldest at `next`.
    ring: Box<[f64]>,
    next: usize,
    delay_s: f64,
}

impl Processor<Delay> for Later {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Delay>) {
        let (mut x, mut y) = (io.read(Delay::INPUT), io.write(Delay::OUTPUT));
        if self.ring.is_empty() {
            y.copy_from_slice(x);
            return;
        }
        while !x.is_empty() {
            let part = x.len().min(self.ring.len() - self.next);
            let ring = &mut self.ring[self.next..self.next + part];
            let (now, later) = y.split_at_mut(part);
            now.copy_from_slice(ring);
            ring.copy_from_slice(&x[..part]);
            self.next = (self.next + part) % self.ring.len();
            (x, y) = (&x[part..], later);
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        if (new.kind, new.ring.len()) == (self.kind, self.ring.len()) {
            new.ring.copy_from_slice(&self.ring);
            new.next = self.next;
        }
    }

    fn latency(&self) -> Latency {
        Latency { transport_s: self.delay_s, group_delay_s: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::testing::Bench;

    #[test]
    fn a_switch_follows_its_setting_or_its_selector() {
        let settings = || SwitchSettings { select: 1 };
        let scalar = Some(Kind::SCALAR);
        let mut bench = Bench::with_gaps::<Switch>(settings(), 1.0, &[None, scalar, scalar]).unwrap();
        let (a, b) = ([1.0, 2.0, 3.0, 4.0], [-1.0, -2.0, -3.0, -4.0]);
        assert_eq!(bench.run(&[&[], &a, &b]), [b]);
        bench.set(SwitchSettings::select, 0.0);
        assert_eq!(bench.run(&[&[], &a, &b]), [a]);
        let mut bench = Bench::with_gaps::<Switch>(settings(), 1.0, &[scalar; 3]).unwrap();
        let selector = [0.0, 1.0, 99.0, f64::NAN];
        assert_eq!(bench.run(&[&selector, &a, &b]), [[1.0, -2.0, -3.0, 4.0]]);
        let few = Bench::with_gaps::<Switch>(settings(), 1.0, &[None, scalar]);
        assert_eq!(few.err().and_then(|e| e.field), Some("select"));
    }

    #[test]
    fn what_goes_in_comes_out_later_however_it_is_cut() {
        let x: Vec<f64> = (1..=600).map(f64::from).collect();
        for frames in [0, 1, 3, 64, 500] {
            for blocks in [&[1][..], &[7, 64, 3], &[512]] {
                let mut bench =
                    Bench::new::<Delay>(DelaySettings { frames }, 1000.0, &[Kind::VECTOR]).unwrap();
                let y = &bench.run_in_blocks(&[&x], blocks)[0];
                let shift = 3 * frames as usize;
                assert!(y[..shift.min(600)].iter().all(|y| *y == 0.0));
                assert_eq!(y[shift.min(600)..], x[..600 - shift.min(600)]);
            }
        }
    }
}
