//! A soundcard as a device of graphs, and the sink that drives it by voltage.

use crate::actuators::limit::VoltageLimitSettings;
use haptograph_engine::device::{Channel, Device, DeviceKind, DeviceSpec};
use haptograph_engine::frame::Kind;
use haptograph_engine::node::{ActuatorKind, BuildContext, BuildError, Limit, NodeSpec, input, output};
use haptograph_engine::plan::MAX_BLOCK;
use haptograph_signal::quantity::Quantity;

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

haptograph_engine::settings! {
    /// A soundcard and the amplifier behind it, by the current that it drives.
    pub struct SoundcardSettings {
        /// Current through the actuator at full scale, A: measure it.
        amperes_full_scale: f64, in 1e-9..=1e6;
        /// The card, by its name in `haptograph devices`; none: the system's default.
        device: Option<String> = None;
        /// Output channels that carry the signal, counted from 1.
        channels: Vec<u32> = vec![1];
        /// Frames of a buffer that are asked for; the run says what was got.
        buffer_frames: u32 = 64, in 8..=16_384;
        /// Form of the samples that are asked for.
        format: CardFormat = CardFormat::Best;
    }
}

haptograph_engine::settings! {
    /// A soundcard and the amplifier behind it, by the voltage that it drives.
    pub struct SoundcardVoltageSettings {
        /// Voltage at the actuator at full scale, V: measure it.
        volts_full_scale: f64, in 1e-9..=1e6;
        /// The card, by its name in `haptograph devices`; none: the system's default.
        device: Option<String> = None;
        /// Output channels that carry the signal, counted from 1.
        channels: Vec<u32> = vec![1];
        /// Frames of a buffer that are asked for; the run says what was got.
        buffer_frames: u32 = 64, in 8..=16_384;
        /// Form of the samples that are asked for.
        format: CardFormat = CardFormat::Best;
    }
}

/// A soundcard before an amplifier that is calibrated in current.
pub struct Soundcard;

impl DeviceKind for Soundcard {
    type Settings = SoundcardSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "Soundcard",
        doc: "A soundcard and the amplifier behind it, calibrated in current: it drives a graph that runs live. It has \
              to tick on a driver clock, at a rate that the card has. Offline, what it would play is written to \
              `<endpoint>.soundcard.wav`.",
        source: "3.1.2",
        simulated: false,
        senses: &[],
        drives: &[Channel {
            name: "current",
            kind: Kind::Scalar,
            quantity: Quantity::CURRENT,
            doc: "Current through the actuator, A.",
        }],
        example: r#""haptuator": Soundcard(amperes_full_scale: 1.0)"#,
    };

    fn build(settings: SoundcardSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        let card = Card::new(
            settings.device,
            settings.channels,
            settings.buffer_frames,
            settings.format,
            cx,
        )?;
        Ok(Box::new(Card {
            full_scale: settings.amperes_full_scale,
            ..card
        }))
    }
}

/// A soundcard before an amplifier that is calibrated in voltage.
pub struct SoundcardVoltage;

impl DeviceKind for SoundcardVoltage {
    type Settings = SoundcardVoltageSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "SoundcardVoltage",
        doc: "A soundcard and the amplifier behind it, calibrated in voltage; else like `Soundcard`.",
        source: "",
        simulated: false,
        senses: &[],
        drives: &[Channel {
            name: "voltage",
            kind: Kind::Scalar,
            quantity: Quantity::VOLTAGE,
            doc: "Voltage at the actuator, V.",
        }],
        example: r#""shaker": SoundcardVoltage(volts_full_scale: 2.0)"#,
    };

    fn build(settings: SoundcardVoltageSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        let card = Card::new(
            settings.device,
            settings.channels,
            settings.buffer_frames,
            settings.format,
            cx,
        )?;
        Ok(Box::new(Card {
            full_scale: settings.volts_full_scale,
            ..card
        }))
    }
}

/// What an endpoint plays, until the card's driver takes it.
#[derive(Debug, Clone)]
pub(crate) struct Card {
    pub device: Option<String>,
    /// Counted from 1.
    pub channels: Vec<u32>,
    pub buffer_frames: u32,
    pub format: CardFormat,
    pub rate_hz: u32,
    pub full_scale: f64,
    /// Samples in full scale; the first `waiting` are new.
    samples: Box<[f64]>,
    waiting: usize,
}

impl Card {
    fn new(
        device: Option<String>,
        channels: Vec<u32>,
        buffer_frames: u32,
        format: CardFormat,
        cx: &BuildContext,
    ) -> Result<Self, BuildError> {
        let (hz, per) = cx.rate.parts();
        let rate_hz = u32::try_from(hz).ok().filter(|_| per == 1).ok_or_else(|| {
            let message = format!("a soundcard plays whole hertz, not {}", cx.rate);
            BuildError {
                field: None,
                message,
                help: Some("give its clock a rate that soundcards have, like 48000".into()),
            }
        })?;
        let mut sorted = channels.clone();
        sorted.sort_unstable();
        sorted.dedup();
        if sorted.len() != channels.len()
            || !sorted.iter().all(|channel| (1..=256).contains(channel))
            || sorted.is_empty()
        {
            let message = "`channels` are different numbers from 1 to 256, at least one";
            return Err(
                BuildError::at("channels", message).help("for the left and right one: `channels: [1, 2]`")
            );
        }
        Ok(Self {
            device,
            channels,
            buffer_frames,
            format,
            rate_hz,
            full_scale: 1.0,
            // A block that ended in a panic, and the ramp that the engine put out in its place.
            samples: vec![0.0; 2 * MAX_BLOCK].into_boxed_slice(),
            waiting: 0,
        })
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

impl Device for Card {
    fn advance(&mut self) {}

    fn read(&mut self, _: usize, frame: &mut [f64]) {
        frame.fill(0.0);
    }

    fn write(&mut self, _: usize, frame: &[f64]) {
        if self.waiting == self.samples.len() {
            // Nobody takes them: an offline run.
            self.waiting = 0;
        }
        self.samples[self.waiting] = frame.first().map_or(0.0, |x| x * (1.0 / self.full_scale));
        self.waiting += 1;
    }

    fn latency_s(&self) -> f64 {
        BUFFERS * f64::from(self.buffer_frames) / f64::from(self.rate_hz)
    }
}

haptograph_engine::settings! {
    /// Settings of [`SoundcardSink`].
    pub struct SoundcardSinkSettings {
        /// A plain factor on the voltage, before the limit.
        [live] gain: f64 = 1.0;
        /// What the actuator may be given.
        limit: VoltageLimitSettings;
    }
}

/// Drives an actuator by voltage through a soundcard.
pub struct SoundcardSink;

impl ActuatorKind for SoundcardSink {
    type Settings = SoundcardSinkSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "SoundcardSink",
        group: "sinks",
        doc: "Drives an actuator by voltage through a soundcard, within limits that it has to state. What is not a \
              number becomes no voltage. An actuator that is driven by current is an `ActuatorSink` on a `Soundcard`.",
        source: "",
        inputs: &[input(
            "voltage",
            Kind::Scalar,
            Quantity::VOLTAGE,
            "Voltage that is asked for, V.",
        )],
        outputs: &[output(
            "delivered",
            Kind::Scalar,
            Quantity::VOLTAGE,
            "Voltage that the actuator was given, V.",
        )],
        example: r#""out": SoundcardSink(voltage: "shaped", endpoint: "shaker", limit: (peak_v: 2.0, continuous_v: 1.0))"#,
    };

    fn limit(settings: &SoundcardSinkSettings) -> Result<(f64, Limit), BuildError> {
        Ok((settings.gain, settings.limit.limit()?))
    }
}
