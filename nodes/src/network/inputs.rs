//! Inputs of one number each: a fader, a key, a sensor on a serial line. Whatever they receive, a graph gets numbers in
//! the range of its settings.

mod midi;
mod osc;
mod serial;

pub use midi::{MidiInput, MidiInputSettings, MidiMessage};
pub use osc::{OscInput, OscInputSettings};
pub use serial::{SERIAL_RATES, SerialInput, SerialInputSettings};

use super::link::{Link, Reader};
use haptograph_engine::device::{Channel, Device};
use haptograph_engine::frame::Kind;
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::run::AgeMeter;
use haptograph_engine::silence::{LiveInput, OnSilence};
use haptograph_signal::quantity::Quantity;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The channel of such an endpoint.
pub(crate) const VALUE: &[Channel] = &[Channel::new(
    "value",
    Kind::SCALAR,
    Quantity::NUMBER,
    "The number, in the SI unit of the quantity that the `LiveInput` names.",
)];

/// Largest magnitude of a mapped number, in its SI unit.
const LARGEST: f64 = 1e6;
/// Largest magnitude of a received number.
const LARGEST_FROM: f64 = 1e9;

/// A linear map from a range of received numbers to an output range, with clamping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mapping {
    from: [f64; 2],
    to: [f64; 2],
}

impl Mapping {
    /// A map from one range to another.
    pub(crate) fn new(from: [f64; 2], to: [f64; 2]) -> Result<Self, BuildError> {
        if from[0] == from[1] {
            let message = format!("both ends of `from` are {}", from[0]);
            return Err(BuildError::at("from", message)
                .help("give the smallest and the largest number that is received"));
        }
        for (field, pair, largest) in [("from", from, LARGEST_FROM), ("to", to, LARGEST)] {
            if let Some(far) = pair.iter().find(|end| !(-largest..=largest).contains(*end)) {
                return Err(BuildError::at(field, format!("{far} is beyond ±{largest:e}")));
            }
        }
        Ok(Self { from, to })
    }

    /// Maps a finite number.
    pub(crate) fn of(&self, heard: f64) -> f64 {
        let [[from, last], [low, high]] = [self.from, self.to];
        let share = ((heard - from) / (last - from)).clamp(0.0, 1.0);
        // Rounding may put the end of the line out of range.
        (low + share * (high - low)).clamp(low.min(high), low.max(high))
    }
}

/// The body of an input. It is silent until it is [attached](Self::attach) to a link that someone publishes to.
#[derive(Debug, Clone)]
pub struct NumberInput {
    reader: Reader,
    mapping: Mapping,
    timeout: Duration,
    holds: bool,
    value: f64,
}

impl NumberInput {
    /// The body of a device of a program's own, whose numbers are in SI units and clamped to a range; NaN and infinity are
    /// as silence. It begins at the range's lower end, and counts as gone after this silence.
    ///
    /// # Errors
    /// [`BuildError`] if the range is empty or goes beyond ±1e6.
    pub fn in_range(
        range: [f64; 2],
        silence: Duration,
        on_silence: OnSilence,
        cx: &BuildContext,
    ) -> Result<Self, BuildError> {
        Ok(Self::new(Mapping::new(range, range)?, silence, on_silence, cx))
    }

    fn new(mapping: Mapping, timeout: Duration, on_silence: OnSilence, cx: &BuildContext) -> Self {
        Self {
            reader: Reader::new(&Arc::new(Link::default()), cx.rate, timeout),
            value: mapping.to[0],
            mapping,
            timeout,
            holds: on_silence == OnSilence::Hold,
        }
    }

    /// The link that it reads.
    pub fn link(&self) -> &Arc<Link> {
        &self.reader.link
    }

    /// Reads another link from now on, that of the input as it is connected.
    pub fn attach(&mut self, link: &Arc<Link>) {
        self.reader.link = Arc::clone(link);
    }

    /// Silence after which the input counts as gone. Inputs that differ in it cannot share a link, because the link
    /// holds the silence.
    pub fn timeout(&self) -> Duration {
        self.timeout
    }
}

impl Device for NumberInput {
    fn advance(&mut self) {
        // An input that gives no numbers falls silent.
        let news = self.reader.advance().filter(|news| news.sensed[0].is_finite());
        if let Some(news) = &news {
            self.value = self.mapping.of(news.sensed[0]);
            self.reader.take(news);
        }
        self.reader.measure_age(news.is_some(), self.holds);
        self.link().input.set(self.reader.state());
    }

    fn read(&mut self, _: usize, frame: &mut [f64]) {
        frame.fill(self.value);
    }

    fn write(&mut self, _: usize, _: &[f64]) {}

    fn range(&self, _: usize) -> Option<[f64; 2]> {
        Some(self.mapping.to)
    }

    fn poll(&mut self, now: Instant) {
        self.reader.woke = Some(now);
    }

    fn ages(&self) -> Option<Arc<AgeMeter>> {
        Some(Arc::clone(&self.link().ages))
    }

    fn live_input(&self) -> Option<LiveInput> {
        Some(LiveInput {
            cell: Arc::clone(&self.link().input),
            holds: self.holds,
            timeout_s: self.timeout.as_secs_f64(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::silence::InputState;
    use haptograph_signal::time::Rate;
    use proptest::prelude::*;

    fn input(on_silence: OnSilence) -> NumberInput {
        let cx = BuildContext::new("knob", Rate::new(1000, 1).unwrap());
        let mapping = Mapping::new([0.0, 10.0], [100.0, 200.0]).unwrap();
        NumberInput::new(mapping, Duration::from_millis(20), on_silence, &cx)
    }

    fn read(input: &mut NumberInput) -> (f64, InputState) {
        input.advance();
        let mut frame = [0.0];
        input.read(0, &mut frame);
        (frame[0], input.live_input().unwrap().cell.get())
    }

    #[test]
    fn a_number_holds_while_its_sender_is_silent() {
        let mut knob = input(OnSilence::Zero);
        assert_eq!(read(&mut knob), (100.0, InputState::Never));
        knob.link().publish_number(5.0);
        assert_eq!(read(&mut knob), (150.0, InputState::Heard));
        (0..30).for_each(|_| knob.advance());
        assert_eq!(read(&mut knob), (150.0, InputState::Silent));
        assert!(!knob.live_input().unwrap().holds && input(OnSilence::Hold).live_input().unwrap().holds);
    }

    #[test]
    fn the_ends_of_a_range_are_met_and_it_may_run_backwards() {
        let mapping = Mapping::new([1023.0, 0.0], [-0.3, 0.7]).unwrap();
        assert_eq!((mapping.of(1023.0), mapping.of(0.0)), (-0.3, 0.7));
        assert!((mapping.of(511.5) - 0.2).abs() < 1e-15);
        assert_eq!(Mapping::new([3.0, 3.0], [0.0, 1.0]).unwrap_err().field, Some("from"));
        assert_eq!(Mapping::new([0.0, 1.0], [0.0, 2e6]).unwrap_err().field, Some("to"));
    }

    proptest! {
        #[test]
        fn nothing_leaves_the_range(
            heard in any::<f64>().prop_filter("finite", |x| x.is_finite()),
            from in prop::array::uniform2(-1e9..1e9), to in prop::array::uniform2(-1e6..1e6),
        ) {
            prop_assume!(from[0] != from[1]);
            let value = Mapping::new(from, to).unwrap().of(heard);
            prop_assert!(value >= to[0].min(to[1]) && value <= to[0].max(to[1]));
        }
    }
}
