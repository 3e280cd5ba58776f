//! A soundcard as a device of graphs: what an endpoint plays on it, and what it hears.

use super::Request;
use haptograph_engine::device::{Device, DeviceLatency};
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::plan::MAX_BLOCK;
use haptograph_engine::run::{AgeMeter, AsyncResamplerReader, RingSpec, least_ring_latency_s};
use haptograph_engine::silence::{InputCell, InputState, LiveInput};
use haptograph_signal::time::Rate;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// cpal asks for two buffers: one plays while the other is filled.
const BUFFERS: f64 = 2.0;

haptograph_engine::choices! {
    /// The form of samples.
    pub enum CardFormat {
        /// The best that the card has: float, 32, 24, then 16 bits.
        Best,
        /// 32-bit floats.
        Float,
        /// 32-bit whole numbers.
        Bits32,
        /// 24-bit whole numbers.
        Bits24,
        /// 16-bit whole numbers.
        Bits16,
    }
}

/// What an endpoint has of a card.
#[derive(Debug, Clone)]
pub(crate) struct Card {
    pub output: Option<Output>,
    pub input: Option<Input>,
}

impl Device for Card {
    fn advance(&mut self) {
        if let Some(input) = &mut self.input {
            input.advance();
        }
    }

    fn read(&mut self, _: usize, frame: &mut [f64]) {
        frame.fill(self.input.as_ref().map_or(0.0, |input| input.latest));
    }

    fn write(&mut self, _: usize, frame: &[f64]) {
        if let (Some(output), Some(given)) = (&mut self.output, frame.first()) {
            output.play(*given);
        }
    }

    fn poll(&mut self, now: Instant) {
        if let Some(input) = &mut self.input {
            input.poll(now);
        }
    }

    fn latency(&self) -> DeviceLatency {
        let (output, input) = (self.output.as_ref(), self.input.as_ref());
        DeviceLatency {
            sensing_s: input.map_or(0.0, |input| input.stream.buffer_s() + input.ring.latency_s),
            driving_s: output.map_or(0.0, |output| BUFFERS * output.stream.buffer_s()),
        }
    }

    fn max_output_bound(&self, _: usize) -> Option<f64> {
        self.output.as_ref().map(|output| output.full_scale)
    }

    fn ages(&self) -> Option<Arc<AgeMeter>> {
        self.input.as_ref().map(|input| Arc::clone(&input.ages))
    }

    fn live_input(&self) -> Option<LiveInput> {
        self.input.as_ref().map(|input| LiveInput {
            cell: Arc::clone(&input.cell),
            holds: input.holds,
            // What its ring holds is played out first.
            timeout_s: input.ring.latency_s,
        })
    }
}

/// What an endpoint plays, until the card's driver takes it.
#[derive(Debug, Clone)]
pub(crate) struct Output {
    pub stream: Request,
    /// Counted from 1.
    pub channels: Vec<u32>,
    pub full_scale: f64,
    /// Samples in full scale; the first `waiting` are new.
    samples: Box<[f64]>,
    waiting: usize,
}

impl Output {
    pub fn new(
        full_scale: f64,
        device: Option<String>,
        channels: Vec<u32>,
        buffer_frames: u32,
        format: CardFormat,
        cx: &BuildContext,
    ) -> Result<Self, BuildError> {
        let rate_hz = whole_hz(cx.rate).ok_or_else(|| {
            let message = format!("a soundcard plays whole hertz, not {}", cx.rate);
            let help = "give its clock a rate that soundcards have, like 48000".to_owned();
            BuildError::of_node(message).help(help)
        })?;
        let mut sorted = channels.clone();
        sorted.sort_unstable();
        sorted.dedup();
        let most = match sorted.last() {
            Some(most @ 1..=256) if sorted.len() == channels.len() && sorted[0] > 0 => *most,
            _ => {
                let message = "`channels` are different numbers from 1 to 256, at least one";
                return Err(BuildError::at("channels", message)
                    .help("for the left and right one: `channels: [1, 2]`"));
            }
        };
        Ok(Self {
            stream: Request {
                device,
                rate_hz,
                buffer_frames,
                format,
                channels: most as u16,
            },
            channels,
            full_scale,
            // A block that ended in a panic, and the ramp that the engine put out in its place.
            samples: vec![0.0; 2 * MAX_BLOCK].into_boxed_slice(),
            waiting: 0,
        })
    }

    fn play(&mut self, given: f64) {
        if self.waiting == self.samples.len() {
            // Nobody takes them: an offline run.
            self.waiting = 0;
        }
        self.samples[self.waiting] = given * (1.0 / self.full_scale);
        self.waiting += 1;
    }

    /// The oldest samples that were written and not taken, at most so many, in full scale, and their channels.
    #[cfg(any(test, feature = "soundcard", target_os = "macos", windows))]
    pub fn waiting(&self, most: usize) -> (&[f64], &[u32]) {
        (&self.samples[..self.waiting.min(most)], &self.channels)
    }

    /// Forgets as many of the oldest.
    #[cfg(any(test, feature = "soundcard", target_os = "macos", windows))]
    pub fn taken(&mut self, count: usize) {
        self.samples.copy_within(count..self.waiting, 0);
        self.waiting -= count;
    }
}

/// What an endpoint hears, from where the card's stream puts it.
#[derive(Debug, Clone)]
#[cfg_attr(
    not(any(test, feature = "soundcard", target_os = "macos", windows)),
    allow(dead_code, reason = "read by what listens to a card")
)]
pub(crate) struct Input {
    pub endpoint: String,
    pub stream: Request,
    /// Counted from 1.
    pub channel: u32,
    pub full_scale: f64,
    /// From the card's clock to that of the graph.
    pub ring: RingSpec,
    pub(super) reader: Reader,
    /// The last sample that was taken, in the unit of the sensor.
    latest: f64,
    pub(super) ages: Arc<AgeMeter>,
    /// Whether the card is heard.
    cell: Arc<InputCell>,
    /// Do the actuators that depend on it go on while it is silent?
    holds: bool,
}

/// The end of a ring that a running device holds. Its copies hold none: only one may.
#[derive(Default)]
pub(super) struct Reader(pub Option<Box<Mutex<AsyncResamplerReader>>>);

impl Clone for Reader {
    fn clone(&self) -> Self {
        Self(None)
    }
}

impl std::fmt::Debug for Reader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Reader({})", self.0.is_some())
    }
}

impl Reader {
    /// Nothing is locked: who holds it holds it alone.
    fn get(&mut self) -> Option<&mut AsyncResamplerReader> {
        self.0.as_mut()?.get_mut().ok()
    }
}

impl Input {
    pub fn new(
        full_scale: f64,
        (device, buffer_frames, format): (Option<String>, u32, CardFormat),
        channel: u32,
        rate_hz: Option<u32>,
        latency_s: Option<f64>,
        holds: bool,
        cx: &BuildContext,
    ) -> Result<Self, BuildError> {
        let rate_hz = rate_hz.or(whole_hz(cx.rate)).ok_or_else(|| {
            let message = format!("a soundcard listens at whole hertz, not at {}", cx.rate);
            BuildError::at("rate_hz", message).help("say at which: `rate_hz: 48000`")
        })?;
        let stream = Request {
            device,
            rate_hz,
            buffer_frames,
            format,
            channels: channel as u16,
        };
        let unlike = |error: &dyn std::fmt::Display| BuildError::at("rate_hz", error.to_string());
        let from = Rate::from_hz(u64::from(rate_hz)).map_err(|error| unlike(&error))?;
        let least_s = least_ring_latency_s(from, cx.rate).map_err(|error| unlike(&error))?;
        // Samples come by the buffer and are taken by the callback.
        let least_s = least_s + BUFFERS * stream.buffer_s();
        let latency_s = latency_s.unwrap_or(least_s + stream.buffer_s());
        if latency_s < least_s {
            let message = format!(
                "a latency of {} ms is too short: the resampler and two buffers of the card need {:.2} ms",
                1e3 * latency_s,
                1e3 * least_s
            );
            let help = format!(
                "ask for shorter buffers, or write `latency_ms: {}`",
                (1e3 * least_s).ceil()
            );
            return Err(BuildError::at("latency_ms", message).help(help));
        }
        Ok(Self {
            ring: RingSpec {
                name: format!("soundcard to {}", cx.path),
                width: 1,
                from,
                to: cx.rate,
                latency_s,
                max_to: 1,
            },
            endpoint: cx.path.clone(),
            stream,
            channel,
            full_scale,
            reader: Reader::default(),
            latest: 0.0,
            ages: Arc::default(),
            cell: Arc::default(),
            holds,
        })
    }

    fn poll(&mut self, now: Instant) {
        if let Some(reader) = self.reader.get() {
            reader.poll(reader.arrivals());
            if reader.is_running() {
                self.ages.read(now, reader.fill_s());
            }
        }
    }

    fn advance(&mut self) {
        let Some(reader) = self.reader.get() else { return };
        let mut frame = [0.0];
        reader.read(&mut frame);
        let state = match reader.is_running() {
            true => InputState::Heard,
            false if self.cell.get() == InputState::Never => InputState::Never,
            false => InputState::Silent,
        };
        self.latest = frame[0];
        self.cell.set(state);
    }
}

fn whole_hz(rate: Rate) -> Option<u32> {
    let (hz, per) = rate.parts();
    u32::try_from(hz).ok().filter(|_| per == 1)
}
