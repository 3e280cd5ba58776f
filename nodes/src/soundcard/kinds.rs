//! The kinds of soundcard endpoints, by the hardware on the card: their settings, their channels, and the nodes
//! for them.

use super::card::{Card, CardFormat, CardInput, CardOutput};
use crate::actuators::limit::VoltageLimitSettings;
use haptograph_engine::device::{Channel, Device, DeviceKind, DeviceSpec};
use haptograph_engine::frame::{Kind, Scalar};
use haptograph_engine::node::{ActuatorKind, BuildContext, BuildError, Limit, Port};
use haptograph_engine::settings::NoSettings;
use haptograph_engine::silence::OnSilence;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::Milliseconds;

/// Settings of an output: the actuator's value at full scale, and possibly an input.
macro_rules! output_settings {
    ($(#[doc = $summary:expr])* $name:ident: $full_scale:ident $doc:literal $(, $also:ident: $type:ident $also_doc:literal)?) => {
        haptograph_engine::settings! {
            $(#[doc = $summary])*
            pub struct $name {
                #[doc = $doc]
                $full_scale: f64, in 1e-9..=1e6;
                $(#[doc = $also_doc] $also: $type;)?
                /// Name of the card as `haptograph devices` lists it, or a part of its name or description; none: the system's default.
                device: Option<String> = None;
                /// Output channels that carry the signal, counted from 1.
                channels: Vec<u32> = vec![1];
                /// Requested frames per buffer; the run reports the actual ones.
                buffer_frames: u32 = 64, in 8..=16_384;
                /// Requested sample format.
                format: CardFormat = CardFormat::Best;
            }
        }

        impl $name {
            fn output(self, cx: &BuildContext) -> Result<CardOutput, BuildError> {
                CardOutput::new(self.$full_scale, self.device, self.channels, self.buffer_frames, self.format, cx)
            }
        }
    };
}

/// Settings of an input: the sensor's value at full scale.
macro_rules! input_settings {
    ($(#[doc = $summary:expr])* $name:ident: $full_scale:ident $doc:literal) => {
        haptograph_engine::settings! {
            $(#[doc = $summary])*
            pub struct $name {
                #[doc = $doc]
                $full_scale: f64, in 1e-9..=1e6;
                /// Name of the card as `haptograph devices` lists it, or a part of its name or description; none: the system's default.
                device: Option<String> = None;
                /// Input channel that carries the signal, counted from 1.
                channel: u32 = 1, in 1..=256;
                /// Requested rate, Hz; none: the rate of the clock that reads it.
                rate_hz: Option<u32> = None, in 1000..=768_000;
                /// Requested frames per buffer; the run reports the actual ones.
                buffer_frames: u32 = 64, in 8..=16_384;
                /// Requested sample format.
                format: CardFormat = CardFormat::Best;
                /// Target delay from the card's clock to the graph's, ms; none: three buffers plus what the
                /// resampler between them needs.
                latency_ms: Option<Milliseconds> = None, in 0.1..=10_000.0;
                /// Effect of its silence on the actuators that depend on it.
                on_silence: OnSilence = OnSilence::Zero;
            }
        }

        impl $name {
            fn input(self, cx: &BuildContext) -> Result<CardInput, BuildError> {
                let rate_hz = self.rate_hz;
                let stream = (self.device, self.buffer_frames, self.format);
                let latency_s = self.latency_ms.map(Milliseconds::si);
                let holds = self.on_silence == OnSilence::Hold;
                CardInput::new(self.$full_scale, stream, self.channel, rate_hz, latency_s, holds, cx)
            }
        }
    };
}

output_settings! {
    /// A soundcard with a current amplifier.
    SoundcardSettings: amperes_full_scale "Current through the actuator at full scale, A: measure it."
}

output_settings! {
    /// A soundcard with a voltage amplifier.
    SoundcardVoltageSettings: volts_full_scale "Voltage at the actuator at full scale, V: measure it."
}

output_settings! {
    /// A soundcard with an actuator and the accelerometer on its tool.
    SoundcardHaptuatorSettings: amperes_full_scale "Current through the actuator at full scale, A: measure it.",
    accelerometer: SoundcardAccelerometerSettings "Input of the accelerometer."
}

input_settings! {
    /// A soundcard input with an accelerometer.
    SoundcardAccelerometerSettings: m_s2_full_scale "Acceleration at full scale, m/s2: measure it, or multiply the input's volts at full scale by the sensor's m/s2 per V."
}

input_settings! {
    /// A soundcard input that measures a voltage.
    SoundcardInputSettings: volts_full_scale "Voltage at the input at full scale, V: measure it."
}

const fn channel(name: &'static str, quantity: Quantity, doc: &'static str) -> Channel {
    Channel::new(name, Kind::SCALAR, quantity, doc)
}

const CURRENT: Channel = channel("current", Quantity::CURRENT, "Current through the actuator, A.");
const DRIVEN_VOLTAGE: Channel = channel("voltage", Quantity::VOLTAGE, "Voltage at the actuator, V.");
const ACCELERATION: Channel = channel("acceleration", Quantity::ACCELERATION, "Acceleration, m/s2.");
const SENSED_VOLTAGE: Channel = channel("voltage", Quantity::VOLTAGE, "Voltage at the input, V.");

/// Declares a kind of soundcard endpoint: name, settings, outputs, inputs, and the card's parts.
macro_rules! card_kind {
    (
        $(#[doc = $summary:expr])* $name:ident($settings:ident): drives $drives:expr, senses $senses:expr,
        $doc:expr, $source:literal, $example:literal, |$given:ident, $cx:ident| $parts:expr
    ) => {
        $(#[doc = $summary])*
        pub struct $name;

        impl DeviceKind for $name {
            type Settings = $settings;
            const SPEC: DeviceSpec = DeviceSpec {
                name: stringify!($name),
                doc: $doc,
                source: $source,
                simulated: false,
                senses: $senses,
                drives: $drives,
                example: $example,
            };

            fn build($given: $settings, $cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
                let (output, input) = $parts;
                Ok(Box::new(Card { output, input }))
            }
        }
    };
}

card_kind! {
    /// A soundcard with an amplifier calibrated in current.
    Soundcard(SoundcardSettings): drives &[CURRENT], senses &[],
    "A soundcard and its amplifier, calibrated in current. It drives the live run of a graph and has to tick on \
     a driver clock, at a rate that the card supports. Offline, its signal is written to `<endpoint>.soundcard.wav`.",
    "3.1.3",
    r#""haptuator": Soundcard(amperes_full_scale: 1.0)"#,
    |settings, cx| (Some(settings.output(cx)?), None)
}

card_kind! {
    /// A soundcard with an amplifier calibrated in voltage.
    SoundcardVoltage(SoundcardVoltageSettings): drives &[DRIVEN_VOLTAGE], senses &[],
    "A soundcard and its amplifier, calibrated in voltage; otherwise like `Soundcard`.",
    "",
    r#""shaker": SoundcardVoltage(volts_full_scale: 2.0)"#,
    |settings, cx| (Some(settings.output(cx)?), None)
}

card_kind! {
    /// A soundcard input with an accelerometer.
    SoundcardAccelerometer(SoundcardAccelerometerSettings): drives &[], senses &[ACCELERATION],
    "An accelerometer on the input of a soundcard, calibrated in acceleration. It may tick on any clock, because a \
     resampler connects the card's clock to the graph's. It works in live runs only. Offline, and while the card is silent, it reads zero, and \
     every actuator that depends on it is at zero, unless `on_silence` is `Hold`.",
    "2.2.1",
    r#""tool": SoundcardAccelerometer(m_s2_full_scale: 50.0)"#,
    |settings, cx| (None, Some(settings.input(cx)?))
}

card_kind! {
    /// A soundcard input with a voltage sensor.
    SoundcardInput(SoundcardInputSettings): drives &[], senses &[SENSED_VOLTAGE],
    "A sensor on the input of a soundcard, calibrated in voltage; otherwise like `SoundcardAccelerometer`.",
    "",
    r#""line": SoundcardInput(volts_full_scale: 1.4)"#,
    |settings, cx| (None, Some(settings.input(cx)?))
}

card_kind! {
    /// A soundcard with an actuator and the accelerometer on its tool.
    SoundcardHaptuator(SoundcardHaptuatorSettings): drives &[CURRENT], senses &[ACCELERATION],
    "A `Soundcard` with an actuator and a `SoundcardAccelerometer` on the same tool, as one device; \
     `SimulatedHaptuator` simulates it. While the accelerometer is silent the actuator is at zero.",
    "3.1.3",
    r#""haptuator": SoundcardHaptuator(amperes_full_scale: 1.0, accelerometer: (m_s2_full_scale: 50.0))"#,
    |settings, cx| {
        let within = |error| BuildError { field: Some("accelerometer"), ..error };
        let input = settings.accelerometer.clone().input(cx).map_err(within)?;
        (Some(settings.output(cx)?), Some(input))
    }
}

haptograph_engine::settings! {
    /// Settings of [`SoundcardSink`].
    pub struct SoundcardSinkSettings {
        /// Gain on the voltage, without unit, before the limit.
        [live] gain: f64 = 1.0;
        /// Limit of the actuator.
        [limit] limit: VoltageLimitSettings;
    }
}

haptograph_engine::node! {
    /// Drives an actuator by voltage through a soundcard, within limits that the graph has to state. NaN and infinity
    /// become zero. An actuator that is driven by current uses an `ActuatorSink` on a `Soundcard`.
    /// Elsewhere: Out, dac~.
    pub struct SoundcardSink(SoundcardSinkSettings) in "sinks";
    example: r#""out": SoundcardSink(voltage: "shaped", endpoint: "shaker", limit: (peak_v: 2.0, continuous_v: 1.0))"#;
    in VOLTAGE: Scalar = Port::of(Quantity::VOLTAGE, "Requested voltage, V.");
    out DELIVERED: Scalar = Port::of(Quantity::VOLTAGE, "Voltage after the limit, V.");
}

impl ActuatorKind for SoundcardSink {
    fn limit(settings: &SoundcardSinkSettings) -> Result<(f64, Limit), BuildError> {
        Ok((settings.gain, settings.limit.limit()?))
    }
}

haptograph_engine::node! {
    /// Reads a voltage from a soundcard. `Calibrate` converts it to the sensor's quantity; an accelerometer on a soundcard
    /// uses `Accelerometer`.
    /// Elsewhere: In, SoundIn, adc~.
    pub struct SoundcardSource(NoSettings) in "sources";
    example: r#""line": SoundcardSource(clock: "audio", endpoint: "line")"#;
    out VOLTAGE: Scalar = Port::of(Quantity::VOLTAGE, "Voltage at the input, V.");
}
