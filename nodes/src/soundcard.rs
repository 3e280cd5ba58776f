//! Soundcards: the kinds of devices that connect a voice-coil actuator's amplifier, or a sensor, and their body.
//!
//! They exist in every build, so that any machine can check graphs that name them and run them offline.

mod card;
mod kinds;

pub use card::{Card, CardFormat, CardInput, CardOutput, Request};
pub use kinds::{
    Soundcard, SoundcardAccelerometer, SoundcardAccelerometerSettings, SoundcardHaptuator,
    SoundcardHaptuatorSettings, SoundcardInput, SoundcardInputSettings, SoundcardSettings, SoundcardSink,
    SoundcardSinkSettings, SoundcardSource, SoundcardVoltage, SoundcardVoltageSettings,
};
