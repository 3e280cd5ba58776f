//! What becomes of events: their number, and a signal at the last of them.

use haptograph_engine::frame::{Event, Kind, Linear, Record, Scalar};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, NodeKind, Optional, Port, Processor, Tick,
};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::quantity::Quantity;

/// Components of the widest linear frame.
const WIDEST: usize = Kind::WRENCH.width();

haptograph_engine::node! {
    /// The number of events so far. A reset comes before an event of the same tick, which then is the first.
    /// Elsewhere: PulseCount, Stepper.
    pub struct Counter(NoSettings) in "math";
    example: r#""taps so far": Counter(event: "taps.tap")"#;
    in EVENT: Event = Port::any("The events to count, of any value.");
    in RESET: Event, Optional = Port::any("Sets the number to 0.");
    out COUNT: Scalar = Port::of(Quantity::NUMBER, "The number of events up to this tick.");
}

impl NodeKind for Counter {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Counting { count: 0.0 }))
    }
}

#[derive(Debug, Clone)]
struct Counting {
    count: f64,
}

impl Processor<Counter> for Counting {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Counter>) {
        let (events, resets) = (io.decode(Counter::EVENT), io.read(Counter::RESET));
        let counts = io.write(Counter::COUNT).iter_mut();
        for (frame, (count, event)) in counts.zip(events).enumerate() {
            if resets.is_some_and(|resets| Event::from_components(&resets[frame]).fired) {
                self.count = 0.0;
            }
            self.count += f64::from(u8::from(event.fired));
            *count = self.count;
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.count = self.count;
    }
}

haptograph_engine::node! {
    /// A signal as it was at the last event; zero before the first. It holds the signal, not the value of the event. A
    /// frame with NaN or infinity is not taken.
    /// Elsewhere: Latch, sah, samphold~, sAndH.
    pub struct SampleHold(NoSettings) in "math";
    example: r#""place of the last tap": SampleHold(input: "arm.position", event: "taps.tap")"#;
    in INPUT: Linear = Port::any("The signal.");
    in EVENT: Event = Port::any("Takes the signal's frame of the same tick.");
    out OUTPUT: Linear = Port::like("input", "The signal at the last event.");
}

impl NodeKind for SampleHold {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Holding { held: [0.0; WIDEST] }))
    }
}

#[derive(Debug, Clone)]
struct Holding {
    held: [f64; WIDEST],
}

impl Processor<SampleHold> for Holding {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, SampleHold>) {
        let width = io.width(SampleHold::INPUT).min(WIDEST);
        let (x, events) = (io.read(SampleHold::INPUT), io.decode(SampleHold::EVENT));
        let frames = io.write(SampleHold::OUTPUT).chunks_exact_mut(width);
        for ((y, x), event) in frames.zip(x.chunks_exact(width)).zip(events) {
            if event.fired && x.iter().all(|x| x.is_finite()) {
                self.held[..width].copy_from_slice(x);
            }
            y.copy_from_slice(&self.held[..width]);
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.held = self.held;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::testing::Bench;

    /// Events at these of eight ticks.
    fn at(ticks: &[usize]) -> Vec<f64> {
        let event = |tick| Event { fired: ticks.contains(&tick), value: 0.3 };
        (0..8).flat_map(|tick| event(tick).to_components()).collect()
    }

    #[test]
    fn events_are_counted_one_by_one_and_from_a_reset_on() {
        let run = |inputs: &[Kind], signals: &[&[f64]]| {
            let mut bench = Bench::new::<Counter>(NoSettings {}, 1000.0, inputs).unwrap();
            bench.run_in_blocks(signals, &[1, 3, 64]).remove(0)
        };
        let (events, resets) = (at(&[1, 2, 4, 6]), at(&[4, 7]));
        let counts = run(&[Kind::EVENT], &[&events]);
        assert_eq!(counts, [0.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0]);
        let counts = run(&[Kind::EVENT; 2], &[&events, &resets]);
        assert_eq!(counts, [0.0, 1.0, 2.0, 2.0, 1.0, 1.0, 2.0, 0.0]);
    }

    #[test]
    fn the_signal_of_the_last_event_is_held() {
        let kinds = [Kind::VECTOR, Kind::EVENT];
        let mut bench = Bench::new::<SampleHold>(NoSettings {}, 1000.0, &kinds).unwrap();
        let mut x: Vec<f64> = (0..24).map(f64::from).collect();
        x[3 * 6] = f64::NAN;
        let y = bench.run_in_blocks(&[&x, &at(&[2, 5, 6])], &[1, 3, 64]).remove(0);
        let held = [None, None, Some(2), Some(2), Some(2), Some(5), Some(5), Some(5)];
        for (y, tick) in y.as_chunks::<3>().0.iter().zip(held) {
            assert_eq!(y.as_slice(), tick.map_or(&[0.0; 3][..], |tick: usize| &x[3 * tick..3 * tick + 3]));
        }
    }
}
