//! A build without soundcards: every request fails with build instructions.

use super::{CardCounts, CardNote, Listed, OpenedStream, Request, SoundcardError, wanted};
use haptograph_engine::graph::Graph;
use haptograph_engine::run::{Live, RingMeter};
use std::sync::atomic::AtomicBool;

/// Cannot exist in this build.
#[derive(Debug)]
pub enum CardDriver {}

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

impl CardDriver {
    /// Opens the card, which then drives the live run.
    ///
    /// # Errors
    /// [`SoundcardError::NotBuilt`], always.
    pub fn start(_: Request, _: Live) -> Result<Self, SoundcardError> {
        Err(SoundcardError::NotBuilt)
    }

    /// The stream as the card opened it.
    pub fn got(&self) -> &OpenedStream {
        match *self {}
    }

    /// Polls the stream; returns messages.
    pub fn poll(&mut self) -> Vec<CardNote> {
        match *self {}
    }

    /// Whether the run has ended.
    pub fn is_finished(&self) -> bool {
        match *self {}
    }

    /// Whether the card is gone.
    pub fn is_waiting(&self) -> bool {
        match *self {}
    }

    /// Counts of the stream.
    pub fn counts(&self) -> CardCounts {
        match *self {}
    }

    /// Closes the stream and returns the run.
    pub fn join(self) -> Option<Live> {
        match self {}
    }
}

/// The input streams of a live run: none.
#[derive(Debug, Default)]
pub struct Inputs {}

impl Inputs {
    /// Opens the inputs of a live run.
    ///
    /// # Errors
    /// [`SoundcardError::NotBuilt`] if the graph has one.
    pub fn open(graph: &Graph, _: &mut [Live]) -> Result<Self, SoundcardError> {
        match wanted(graph)?.inputs.is_empty() {
            true => Ok(Self {}),
            false => Err(SoundcardError::NotBuilt),
        }
    }

    /// For each stream: its endpoints, the request, the stream as opened, and its counts.
    pub fn streams(&self) -> impl Iterator<Item = (&[String], &Request, &OpenedStream, CardCounts)> {
        std::iter::empty()
    }

    /// Meters of the rings from the cards to the graph.
    pub fn rings(&self) -> impl Iterator<Item = &RingMeter> {
        std::iter::empty()
    }

    /// Polls the streams; returns messages.
    pub fn poll(&mut self) -> Vec<CardNote> {
        Vec::new()
    }
}
