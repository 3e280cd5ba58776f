//! A build without soundcards: every request fails.

use super::{Listed, SoundcardError};
use std::sync::atomic::AtomicBool;

/// The soundcards of this machine.
///
/// # Errors
/// [`SoundcardError::NotBuilt`], always.
pub fn list() -> Result<Vec<Listed>, SoundcardError> {
    Err(SoundcardError::NotBuilt)
}

/// Checks that a soundcard can play a sound.
///
/// # Errors
/// [`SoundcardError::NotBuilt`], always.
pub fn ready_to_play() -> Result<(), SoundcardError> {
    Err(SoundcardError::NotBuilt)
}

/// Plays a sound on the default soundcard.
///
/// # Errors
/// [`SoundcardError::NotBuilt`], always.
pub fn play_once(_: Vec<f32>, _: u32, _: &AtomicBool) -> Result<(), SoundcardError> {
    Err(SoundcardError::NotBuilt)
}
