//! A build without soundcards: every request fails.

use super::{CardCounts, Listed, OpenedStream, Request, SoundcardError, card_requests};
use crate::backend::BackendEvent;
use haptograph_engine::graph::Graph;
use haptograph_engine::run::{Driven, Player};
use std::convert::Infallible;
use std::marker::PhantomData;
use std::sync::atomic::AtomicBool;

/// Cannot exist in this build.
#[derive(Debug)]
pub struct CardDriver<D = Player>(Infallible, PhantomData<D>);

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

impl<D: Driven> CardDriver<D> {
    /// Opens the card, which then drives the live run.
    ///
    /// # Errors
    /// [`SoundcardError::NotBuilt`], always.
    pub fn start(_: Request, _: D) -> Result<Self, SoundcardError> {
        Err(SoundcardError::NotBuilt)
    }

    /// The stream as the card opened it.
    pub fn got(&self) -> &OpenedStream {
        match self.0 {}
    }

    /// Polls the stream; returns messages.
    pub fn poll(&mut self) -> Vec<BackendEvent> {
        match self.0 {}
    }

    /// True if the run has ended.
    pub fn is_finished(&self) -> bool {
        match self.0 {}
    }

    /// True if the card is gone.
    pub fn is_waiting(&self) -> bool {
        match self.0 {}
    }

    /// Counts of the stream.
    pub fn counts(&self) -> CardCounts {
        match self.0 {}
    }

    /// Closes the stream and returns the run.
    pub fn join(self) -> Option<D> {
        match self.0 {}
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
    pub fn open<'l>(
        graph: &'l Graph,
        _: impl IntoIterator<Item = &'l mut Player>,
    ) -> Result<Self, SoundcardError> {
        match card_requests(graph)?.inputs.is_empty() {
            true => Ok(Self {}),
            false => Err(SoundcardError::NotBuilt),
        }
    }

    /// For each stream: its endpoints, the request, the stream as opened, and its counts.
    pub fn streams(&self) -> impl Iterator<Item = (&[String], &Request, &OpenedStream, CardCounts)> {
        std::iter::empty()
    }

    /// Polls the streams; returns messages.
    pub fn poll(&mut self) -> Vec<BackendEvent> {
        Vec::new()
    }
}
