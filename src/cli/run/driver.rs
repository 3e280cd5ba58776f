//! Driver of a live run: a soundcard if one of its endpoints is one, otherwise a timer.

use super::super::Failure;
use super::message;
use crate::engine::run::{Histogram, Live};
use crate::live::BackendEvent;
use crate::live::soundcard::{CardCounts, CardDriver, OpenedStream, Request};
use crate::live::timer::{Timer, TimerThread};
use serde_json::{Value, json};

/// A started driver.
pub enum Driver {
    Timer(TimerThread),
    Card(Box<CardDriver>, Request),
}

impl Driver {
    /// Starts the driver that the graph needs.
    pub fn start(request: Option<Request>, live: Live) -> Result<Self, Failure> {
        match request {
            Some(request) => {
                let card = CardDriver::start(request.clone(), live).map_err(message)?;
                Ok(Self::Card(Box::new(card), request))
            }
            None => Timer::default().start(live).map(Self::Timer).map_err(message),
        }
    }

    /// Description for the user.
    pub fn description(&self) -> String {
        match self {
            Self::Timer(_) => "a timer with 1000 wake-ups a second".to_owned(),
            Self::Card(card, request) => stream(card.got(), request),
        }
    }

    /// Scheduling requests that the system refused at the start.
    pub fn notes(&self) -> Vec<String> {
        match self {
            Self::Timer(timer) => timer.notes.refused.clone(),
            Self::Card(..) => Vec::new(),
        }
    }

    /// Polls the driver; returns notes for the user.
    pub fn poll(&mut self) -> Vec<BackendEvent> {
        match self {
            Self::Timer(_) => Vec::new(),
            Self::Card(card, _) => card.poll(),
        }
    }

    /// True if the run is over or, with `stopping`, if its soundcard is gone and nothing can end it.
    pub fn is_finished(&self, stopping: bool) -> bool {
        match self {
            Self::Timer(timer) => timer.is_finished(),
            Self::Card(card, _) => card.is_finished() || stopping && card.is_waiting(),
        }
    }

    /// Waits for the end of the run.
    pub fn join(self) -> Result<Live, Failure> {
        let live = match self {
            Self::Timer(timer) => timer.join(),
            Self::Card(card, _) => card.join(),
        };
        live.ok_or_else(|| Failure::Message("the driver thread ended early".to_owned()))
    }

    /// Driver-specific part of the status line.
    pub fn status(&self) -> String {
        match self {
            Self::Timer(_) => String::new(),
            Self::Card(card, _) => format!(", {} xruns", card.counts().xruns),
        }
    }

    /// Facts about the finished driver for `run.json`.
    pub fn facts(&self) -> Vec<(&'static str, &'static str, Value)> {
        let mut facts = vec![("driver", "Driver", json!(self.description()))];
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

    /// Warnings for the summary.
    pub fn warnings(&self) -> Vec<String> {
        let Self::Card(card, _) = self else {
            return Vec::new();
        };
        troubles("the soundcard", "ran dry", &card.counts())
    }

    /// The output latency stated by the system.
    pub fn output_latency(&self) -> Option<Histogram> {
        match self {
            Self::Timer(_) => None,
            Self::Card(card, _) => Some(card.counts().latency),
        }
    }
}

/// Description of a soundcard stream.
pub fn stream(got: &OpenedStream, request: &Request) -> String {
    let frames = got
        .buffer_frames
        .map_or_else(|| "?".to_owned(), |frames| frames.to_string());
    format!(
        "soundcard {}: {} Hz, {} channels, {}, buffers of {frames} frames ({} requested)",
        got.card, got.rate_hz, got.channels, got.format, request.buffer_frames
    )
}

/// Interruptions of a stream, as JSON.
pub fn xruns(counts: &CardCounts) -> Value {
    json!({
        "count": counts.xruns,
        "longest_ms": ms(counts.xrun_delay_max_ns),
        "last_at_ms": ms(counts.xrun_last_ns),
    })
}

/// Warnings about a stream; `xrun` describes an xrun of it.
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

/// Quantiles in milliseconds, as JSON.
pub fn quantiles_ms(histogram: &Histogram) -> Value {
    let at = |fraction: f64| ms(histogram.quantile_ns(fraction));
    json!({ "p50": at(0.5), "p99": at(0.99), "max": ms(histogram.max_ns()) })
}

/// Nanoseconds to milliseconds.
pub fn ms(ns: u64) -> f64 {
    (ns as f64 / 1e3).round() / 1e3
}
