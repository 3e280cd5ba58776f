//! A stream that is opened again when its card has gone and come back.

use super::shared::{Home, Shared};
use super::system::{Plug, Plugged, open};
use super::{CardCounts, CardNote, Got, Request, SoundcardError};
use cpal::Stream;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::{Duration, Instant};

/// A card whose callback has not been called for so long has gone.
const SILENT: Duration = Duration::from_secs(2);
/// One that something was said to be wrong with since has gone sooner. Some recover by themselves in less.
const TROUBLED: Duration = Duration::from_secs(1);
/// How often one that has gone is looked for.
const RETRY: Duration = Duration::from_millis(500);

/// A stream, its card, and what its callback works with.
pub(super) struct Kept<P> {
    pub request: Request,
    pub got: Got,
    stream: Option<Stream>,
    plug: Plug<P>,
    told: Receiver<String>,
    vanished: u64,
    /// When the last new callback was seen, and which.
    heard: (Instant, u64),
    tried: Instant,
}

impl<P: Plugged> Kept<P> {
    /// Opens a stream and lets it have `it`.
    pub fn open(request: Request, it: P) -> Result<Self, SoundcardError> {
        let (sender, told) = sync_channel(64);
        let start = Instant::now();
        let plug = Plug {
            home: Home::of(it),
            shared: Arc::default(),
            health: Arc::default(),
            told: sender,
            start,
        };
        let (stream, got) = open(&request, &plug)?;
        // That may have taken seconds.
        let opened = Instant::now();
        Ok(Self {
            request,
            got,
            stream: Some(stream),
            plug,
            told,
            vanished: 0,
            heard: (opened, 0),
            tried: opened,
        })
    }

    /// Looks after the stream: where its card has gone, it is looked for now and then until it is back, each time
    /// with what it works with as `anew` makes it. Returns what there is to say; `without` says what happens meanwhile.
    pub fn tend(&mut self, without: &str, anew: impl FnOnce(&mut P)) -> Vec<CardNote> {
        let mut said: Vec<CardNote> = self.told.try_iter().map(CardNote::Complaint).collect();
        let now = Instant::now();
        let callbacks = self.shared().callbacks.load(Relaxed);
        if callbacks != self.heard.1 {
            self.heard = (now, callbacks);
            self.plug.health.troubled.store(false, Relaxed);
        }
        let troubled = self.plug.health.troubled.load(Relaxed);
        let patience = if troubled { TROUBLED } else { SILENT };
        let silent = now.saturating_duration_since(self.heard.0) > patience;
        if self.stream.is_some() && (silent || self.plug.health.lost.load(Relaxed)) {
            self.stream = None;
            self.vanished += 1;
            self.tried = now;
            said.push(CardNote::Turn(format!(
                "soundcard {} has gone; {without} until it is back",
                self.got.card
            )));
        } else if self.stream.is_none() && now.saturating_duration_since(self.tried) > RETRY {
            self.tried = now;
            said.extend(self.reopen(anew).map(CardNote::Turn));
        }
        said
    }

    fn reopen(&mut self, anew: impl FnOnce(&mut P)) -> Option<String> {
        self.plug.health.lost.store(false, Relaxed);
        self.plug.health.troubled.store(false, Relaxed);
        if let Some(it) = self.plug.home.open().as_mut() {
            anew(it);
        }
        let (stream, got) = open(&self.request, &self.plug).ok()?;
        (self.stream, self.got) = (Some(stream), got);
        self.heard.0 = Instant::now();
        Some(format!("soundcard {} is back", self.got.card))
    }

    /// What the callback shares.
    pub fn shared(&self) -> &Shared {
        &self.plug.shared
    }

    /// Is the card away?
    pub fn is_away(&self) -> bool {
        self.stream.is_none()
    }

    /// What was counted.
    pub fn counts(&self) -> CardCounts {
        self.shared().counts(self.vanished)
    }

    /// Closes the stream and gives back what it worked with.
    pub fn close(mut self) -> Option<P> {
        self.stream = None;
        self.plug.home.open().take().map(|it| *it)
    }
}
