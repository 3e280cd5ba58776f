//! A build without soundcards: every request says how to get one with them.

use super::{CardCounts, CardNote, Got, Listed, Request, SoundcardError, wanted};
use haptograph_engine::graph::Graph;
use haptograph_engine::run::{Live, RingMeter};
use std::sync::atomic::AtomicBool;

/// There is none in this build.
#[derive(Debug)]
pub enum CardDriver {}

/// The soundcards of this machine.
///
/// # Errors
/// [`SoundcardError::NotBuilt`], always.
pub fn list() -> Result<Vec<Listed>, SoundcardError> {
    Err(SoundcardError::NotBuilt)
}

/// Is there a soundcard that a sound can be played on?
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
    /// Opens the card and lets it drive a live run.
    ///
    /// # Errors
    /// [`SoundcardError::NotBuilt`], always.
    pub fn start(_: Request, _: Live) -> Result<Self, SoundcardError> {
        Err(SoundcardError::NotBuilt)
    }

    /// What was got.
    pub fn got(&self) -> &Got {
        match *self {}
    }

    /// Looks after the stream; returns what there is to say.
    pub fn tend(&mut self) -> Vec<CardNote> {
        match *self {}
    }

    /// Is the run over?
    pub fn is_finished(&self) -> bool {
        match *self {}
    }

    /// Is the card away?
    pub fn is_waiting(&self) -> bool {
        match *self {}
    }

    /// What was counted.
    pub fn counts(&self) -> CardCounts {
        match *self {}
    }

    /// Closes the stream and gives the run back.
    pub fn join(self) -> Option<Live> {
        match self {}
    }
}

/// What a live run listens to: nothing.
#[derive(Debug, Default)]
pub struct Inputs {}

impl Inputs {
    /// Opens what the endpoints of a live run listen to.
    ///
    /// # Errors
    /// [`SoundcardError::NotBuilt`] where one does.
    pub fn open(graph: &Graph, _: &mut [Live]) -> Result<Self, SoundcardError> {
        match wanted(graph)?.inputs.is_empty() {
            true => Ok(Self {}),
            false => Err(SoundcardError::NotBuilt),
        }
    }

    /// The endpoints that listen to each stream, what was asked for and got, and what was counted.
    pub fn streams(&self) -> impl Iterator<Item = (&[String], &Request, &Got, CardCounts)> {
        std::iter::empty()
    }

    /// What is known of the rings that lead from the cards to the graph.
    pub fn rings(&self) -> impl Iterator<Item = &RingMeter> {
        std::iter::empty()
    }

    /// Looks after the streams; returns what there is to say.
    pub fn tend(&mut self) -> Vec<CardNote> {
        Vec::new()
    }
}
