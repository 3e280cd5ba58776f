//! A soundcard as a device of graphs: the output and the input of an endpoint.

use haptograph_engine::device::{Device, DeviceLatency, Playback};
use haptograph_engine::frame::Kind;
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::plan::MAX_BLOCK;
use haptograph_engine::run::{AgeMeter, AsyncResamplerReader, RingSpec, least_ring_latency_s};
use haptograph_engine::silence::{InputCell, InputState, LiveInput};
use haptograph_signal::time::Rate;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// cpal uses two buffers: one plays while the other is filled.
const BUFFERS: f64 = 2.0;

haptograph_engine::choices! {
    /// The sample format.
    pub enum CardFormat {
        /// The best format of the card: float, then 32, 24 and 16 bits.
        Best,
        /// 32-bit floats.
        Float,
        /// 32-bit integers.
        Bits32,
        /// 24-bit integers.
        Bits24,
        /// 16-bit integers.
        Bits16,
    }
}

/// A requested stream to or from a card.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// Name of the card; none: the default card.
    pub device: Option<String>,
    /// Rate, Hz.
    pub rate_hz: u32,
    /// Frames of a buffer.
    pub buffer_frames: u32,
    /// Sample format.
    pub format: CardFormat,
    /// Minimum number of channels.
    pub channels: u16,
}

impl Request {
    /// Duration of a buffer, s.
    pub(crate) fn buffer_s(&self) -> f64 {
        f64::from(self.buffer_frames) / f64::from(self.rate_hz)
    }

    /// The first difference, other than channels, that keeps two requests from sharing a stream.
    pub fn differs_from(&self, other: &Self) -> Option<&'static str> {
        match () {
            () if self.device != other.device => Some("`device`"),
            () if self.rate_hz != other.rate_hz => Some("their rates"),
            () if self.buffer_frames != other.buffer_frames => Some("`buffer_frames`"),
            () if self.format != other.format => Some("`format`"),
            () => None,
        }
    }
}

/// An endpoint on a card.
#[derive(Debug, Clone)]
pub struct Card {
    /// Output of the endpoint, if it plays.
    pub output: Option<CardOutput>,
    /// Input of the endpoint, if it records.
    pub input: Option<CardInput>,
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
            output.playback.play(*given);
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
        self.output.as_ref().map(|output| output.playback.full_scale)
    }

    fn playback(&mut self) -> Option<&mut Playback> {
        self.output.as_mut().map(|output| &mut output.playback)
    }

    fn ages(&self) -> Option<Arc<AgeMeter>> {
        self.input.as_ref().map(|input| Arc::clone(&input.ages))
    }

    fn live_input(&self) -> Option<LiveInput> {
        self.input.as_ref().map(|input| LiveInput {
            cell: Arc::clone(&input.cell),
            holds: input.holds,
            // The samples in its ring are played first.
            timeout_s: input.ring.latency_s,
        })
    }
}

/// The output of an endpoint.
#[derive(Debug, Clone)]
pub struct CardOutput {
    /// The stream that it needs.
    pub stream: Request,
    /// The channels, the full scale and the samples for the card's driver.
    pub playback: Playback,
}

impl CardOutput {
    pub(super) fn new(
        full_scale: f64,
        device: Option<String>,
        channels: Vec<u32>,
        buffer_frames: u32,
        format: CardFormat,
        cx: &BuildContext,
    ) -> Result<Self, BuildError> {
        let rate_hz = whole_hz(cx.rate).ok_or_else(|| {
            let message = format!("a soundcard's rate is in whole hertz, not {}", cx.rate);
            let help = "give its clock a rate that soundcards support, such as 48000".to_owned();
            BuildError::of_node(message).help(help)
        })?;
        let mut sorted = channels.clone();
        sorted.sort_unstable();
        sorted.dedup();
        let most = match sorted.last() {
            Some(most @ 1..=256) if sorted.len() == channels.len() && sorted[0] > 0 => *most,
            _ => {
                let message = "`channels` needs at least one number from 1 to 256, each once";
                return Err(BuildError::at("channels", message)
                    .help("for the left and right channel: `channels: [1, 2]`"));
            }
        };
        Ok(Self {
            stream: Request { device, rate_hz, buffer_frames, format, channels: most as u16 },
            // After a block that panicked: the engine's ramp replaces it.
            playback: Playback::new(full_scale, channels, 2 * MAX_BLOCK),
        })
    }
}

/// The input of an endpoint, fed by the card's stream.
#[derive(Debug, Clone)]
pub struct CardInput {
    /// Name of the endpoint.
    pub endpoint: String,
    /// The stream that it needs.
    pub stream: Request,
    /// The channel, counted from 1.
    pub channel: u32,
    /// Value of a full-scale sample, in the unit of the sensor.
    pub full_scale: f64,
    /// Ring from the card's clock to that of the graph.
    pub ring: RingSpec,
    reader: Reader,
    /// The last sample, in the unit of the sensor.
    latest: f64,
    /// Age of the samples when they are read.
    pub ages: Arc<AgeMeter>,
    /// Whether samples arrive.
    cell: Arc<InputCell>,
    /// True if dependent actuators continue while the input is silent.
    holds: bool,
}

/// The reader of a ring, held by the running device only; copies hold none.
#[derive(Default)]
struct Reader(Option<Box<Mutex<AsyncResamplerReader>>>);

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
    /// Exclusive access needs no lock.
    fn get(&mut self) -> Option<&mut AsyncResamplerReader> {
        self.0.as_mut()?.get_mut().ok()
    }
}

impl CardInput {
    pub(super) fn new(
        full_scale: f64,
        (device, buffer_frames, format): (Option<String>, u32, CardFormat),
        channel: u32,
        rate_hz: Option<u32>,
        latency_s: Option<f64>,
        holds: bool,
        cx: &BuildContext,
    ) -> Result<Self, BuildError> {
        let rate_hz = rate_hz.or(whole_hz(cx.rate)).ok_or_else(|| {
            let message = format!("a soundcard's rate is in whole hertz, not {}", cx.rate);
            BuildError::at("rate_hz", message).help("state its rate, for example `rate_hz: 48000`")
        })?;
        let stream = Request { device, rate_hz, buffer_frames, format, channels: channel as u16 };
        let unlike = |error: &dyn std::fmt::Display| BuildError::at("rate_hz", error.to_string());
        let from = Rate::from_hz(u64::from(rate_hz)).map_err(|error| unlike(&error))?;
        let least_s = least_ring_latency_s(from, cx.rate).map_err(|error| unlike(&error))?;
        // The card delivers samples per buffer, and the driver takes them per callback.
        let least_s = least_s + BUFFERS * stream.buffer_s();
        let latency_s = latency_s.unwrap_or(least_s + stream.buffer_s());
        if latency_s < least_s {
            let message = format!(
                "a latency of {} ms is too short: the resampler and two buffers of the card need {:.2} ms",
                1e3 * latency_s,
                1e3 * least_s
            );
            let help = format!("use shorter buffers, or write `latency_ms: {}`", (1e3 * least_s).ceil());
            return Err(BuildError::at("latency_ms", message).help(help));
        }
        Ok(Self {
            ring: RingSpec {
                name: format!("soundcard to {}", cx.path),
                kind: Kind::SCALAR,
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

    /// Reads the samples of a stream from now on. Copies of the device read none.
    pub fn attach(&mut self, reader: AsyncResamplerReader) {
        self.reader = Reader(Some(Box::new(Mutex::new(reader))));
    }

    /// True if the endpoint reads the samples of a stream.
    pub fn is_attached(&self) -> bool {
        self.reader.0.is_some()
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
