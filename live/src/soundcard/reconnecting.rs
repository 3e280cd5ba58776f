//! A stream that reopens when its card has vanished and come back.

use super::shared::{Detached, Shared};
use super::system::{CallbackState, Setup, open};
use super::{CardCounts, OpenedStream, Request, SoundcardError};
use crate::backend::BackendEvent;
use cpal::Stream;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::{Duration, Instant};

/// Time without callbacks after which a card counts as gone.
const SILENT: Duration = Duration::from_secs(2);
/// The same after an error of the stream. Some cards recover in less.
const TROUBLED: Duration = Duration::from_secs(1);
/// Time between attempts to reopen.
const RETRY: Duration = Duration::from_millis(500);

/// A stream, its card, and the state of its callback.
pub(super) struct ReconnectingStream<P> {
    pub request: Request,
    pub got: OpenedStream,
    stream: Option<Stream>,
    setup: Setup<P>,
    errors: Receiver<String>,
    vanished: u64,
    /// Time and number of the last new callback.
    heard: (Instant, u64),
    tried: Instant,
}

impl<P: CallbackState> ReconnectingStream<P> {
    /// Opens a stream whose callback works with `it`.
    pub(super) fn open(request: Request, it: P) -> Result<Self, SoundcardError> {
        let (sender, errors) = sync_channel(64);
        let start = Instant::now();
        let setup = Setup {
            slot: Detached::of(it),
            shared: Arc::default(),
            health: Arc::default(),
            errors: sender,
            start,
        };
        let (stream, got) = open(&request, &setup)?;
        // Opening may have taken seconds.
        let opened = Instant::now();
        Ok(Self {
            request,
            got,
            stream: Some(stream),
            setup,
            errors,
            vanished: 0,
            heard: (opened, 0),
            tried: opened,
        })
    }

    /// Polls the stream, and tries to reopen it while its card is gone, each time
    /// after `anew` has reset the callback's state. Returns messages; `without` states what happens meanwhile.
    pub(super) fn poll(&mut self, without: &str, anew: impl FnOnce(&mut P)) -> Vec<BackendEvent> {
        let mut events: Vec<BackendEvent> = self.errors.try_iter().map(BackendEvent::Failed).collect();
        let now = Instant::now();
        let callbacks = self.shared().callbacks.load(Relaxed);
        if callbacks != self.heard.1 {
            self.heard = (now, callbacks);
            self.setup.health.troubled.store(false, Relaxed);
        }
        let troubled = self.setup.health.troubled.load(Relaxed);
        let patience = if troubled { TROUBLED } else { SILENT };
        let silent = now.saturating_duration_since(self.heard.0) > patience;
        if self.stream.is_some() && (silent || self.setup.health.lost.load(Relaxed)) {
            self.stream = None;
            self.vanished += 1;
            self.tried = now;
            events.push(BackendEvent::Changed(format!(
                "soundcard {} is gone; {without} until it is back",
                self.got.card
            )));
        } else if self.stream.is_none() && now.saturating_duration_since(self.tried) > RETRY {
            self.tried = now;
            events.extend(self.reopen(anew).map(BackendEvent::Changed));
        }
        events
    }

    fn reopen(&mut self, anew: impl FnOnce(&mut P)) -> Option<String> {
        self.setup.health.lost.store(false, Relaxed);
        self.setup.health.troubled.store(false, Relaxed);
        if let Some(it) = self.setup.slot.lock().as_mut() {
            anew(it);
        }
        let (stream, got) = open(&self.request, &self.setup).ok()?;
        (self.stream, self.got) = (Some(stream), got);
        self.heard.0 = Instant::now();
        Some(format!("soundcard {} is back", self.got.card))
    }

    /// Counts and flags that the callback shares.
    pub(crate) fn shared(&self) -> &Shared {
        &self.setup.shared
    }

    /// True if the card is gone.
    pub(crate) fn is_away(&self) -> bool {
        self.stream.is_none()
    }

    /// Counts of the stream.
    pub(super) fn counts(&self) -> CardCounts {
        self.shared().counts(self.vanished)
    }

    /// Closes the stream and returns the state of its callback.
    pub(crate) fn close(mut self) -> Option<P> {
        self.stream = None;
        self.setup.slot.lock().take().map(|it| *it)
    }
}
