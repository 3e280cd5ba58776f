//! What a live run is driven by: a soundcard where one of its endpoints is one, or else a timer.

use super::super::Failure;
use super::message;
use crate::engine::run::{Histogram, Live, Timer, TimerThread};
use crate::nodes::soundcard::{CardCounts, CardDriver, CardNote, OpenedStream, Request};
use serde_json::{Value, json};

/// What to start, and then what runs.
pub enum Driver {
    Timer(TimerThread),
    Card(Box<CardDriver>, Request),
}

impl Driver {
    /// Starts the driver that the graph asks for.
    pub fn start(wanted: Option<Request>, live: Live) -> Result<Self, Failure> {
        match wanted {
            Some(request) => {
                let card = CardDriver::start(request.clone(), live).map_err(message)?;
                Ok(Self::Card(Box::new(card), request))
            }
            None => Timer::default().start(live).map(Self::Timer).map_err(message),
        }
    }

    /// What it is, in words.
    pub fn about(&self) -> String {
        match self {
            Self::Timer(_) => "a timer with 1000 wake-ups a second".to_owned(),
            Self::Card(card, request) => stream(card.got(), request),
        }
    }

    /// What the system did not allow at the start.
    pub fn notes(&self) -> Vec<String> {
        match self {
            Self::Timer(timer) => timer.notes.refused.clone(),
            Self::Card(..) => Vec::new(),
        }
    }

    /// Looks after it; returns what there is to say.
    pub fn tend(&mut self) -> Vec<CardNote> {
        match self {
            Self::Timer(_) => Vec::new(),
            Self::Card(card, _) => card.poll(),
        }
    }

    /// Is the run over, or with `stopping` is nobody there to end it?
    pub fn is_finished(&self, stopping: bool) -> bool {
        match self {
            Self::Timer(timer) => timer.is_finished(),
            Self::Card(card, _) => card.is_finished() || stopping && card.is_waiting(),
        }
    }

    /// Waits for the end.
    pub fn join(self) -> Result<Live, Failure> {
        let live = match self {
            Self::Timer(timer) => timer.join(),
            Self::Card(card, _) => card.join(),
        };
        live.ok_or_else(|| Failure::Message("the thread that drives the run ended early".to_owned()))
    }

    /// What is shown of it every second, besides the time it keeps.
    pub fn status(&self) -> String {
        match self {
            Self::Timer(_) => String::new(),
            Self::Card(card, _) => format!(", {} xruns", card.counts().xruns),
        }
    }

    /// What is to be known of it when it is over.
    pub fn facts(&self) -> Vec<(&'static str, &'static str, Value)> {
        let mut facts = vec![("driver", "Driver", json!(self.about()))];
        if let Self::Card(card, _) = self {
            let counts = card.counts();
            facts.extend([
                ("xruns", "Xruns", xruns(&counts)),
                (
                    "clipped_samples",
                    "Samples beyond full scale",
                    json!(counts.clipped),
                ),
                ("vanished", "Times the soundcard was gone", json!(counts.vanished)),
                (
                    "output_latency_ms",
                    "Output latency that the system stated (ms)",
                    quantiles_ms(&counts.latency),
                ),
            ]);
        }
        facts
    }

    /// What went wrong, for the summary.
    pub fn warnings(&self) -> Vec<String> {
        let Self::Card(card, _) = self else {
            return Vec::new();
        };
        troubles("the soundcard", "ran dry", &card.counts())
    }

    /// The latency that the system states of what it plays on.
    pub fn output_latency(&self) -> Option<Histogram> {
        match self {
            Self::Timer(_) => None,
            Self::Card(card, _) => Some(card.counts().latency),
        }
    }
}

/// A stream of a card, in words.
pub fn stream(got: &OpenedStream, asked: &Request) -> String {
    let frames = got
        .buffer_frames
        .map_or_else(|| "?".to_owned(), |frames| frames.to_string());
    format!(
        "soundcard {}: {} Hz, {} channels, {}, buffers of {frames} frames ({} asked for)",
        got.card, got.rate_hz, got.channels, got.format, asked.buffer_frames
    )
}

/// How often a stream was interrupted.
pub fn xruns(counts: &CardCounts) -> Value {
    json!({
        "count": counts.xruns,
        "longest_ms": ms(counts.xrun_delay_max_ns),
        "last_at_ms": ms(counts.xrun_last_ns),
    })
}

/// What went wrong with a stream: of whom, and what an xrun is to it.
pub fn troubles(whose: &str, xrun: &str, counts: &CardCounts) -> Vec<String> {
    let mut list = Vec::new();
    if counts.xruns > 0 {
        list.push(format!(
            "{whose} {xrun} {} times: the signal has gaps",
            counts.xruns
        ));
    }
    if counts.clipped > 0 {
        list.push(format!(
            "{} samples were beyond the full scale of {whose} and were cut off",
            counts.clipped
        ));
    }
    list
}

/// Durations in milliseconds.
pub fn quantiles_ms(histogram: &Histogram) -> Value {
    let at = |fraction: f64| ms(histogram.quantile_ns(fraction));
    json!({ "p50": at(0.5), "p99": at(0.99), "max": ms(histogram.max_ns()) })
}

/// Milliseconds.
pub fn ms(ns: u64) -> f64 {
    (ns as f64 / 1e3).round() / 1e3
}
