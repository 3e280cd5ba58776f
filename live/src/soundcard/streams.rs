//! The soundcard streams of a live run: the one that drives it, and its inputs.

use super::fill::PlaybackCallback;
use super::listen::{CaptureCallback, InputTap, InputTaps, inputs_of};
use super::reconnecting::ReconnectingStream;
use super::system::{CallbackState, Direction, OPENING, Setup};
use super::{CardCounts, OpenedStream, Request, SoundcardError};
use crate::backend::BackendEvent;
use cpal::traits::DeviceTrait;
use cpal::{Error, FromSample, InputCallbackInfo, OutputCallbackInfo, SizedSample, Stream, StreamConfig};
use haptograph_engine::graph::Graph;
use haptograph_engine::run::{Player, RingMeter};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

/// A stream that drives a live run.
pub(super) struct CardDriver {
    stream: ReconnectingStream<Player>,
    rested: Option<Instant>,
}

impl CardDriver {
    /// Opens the card, which then drives the live run.
    ///
    /// # Errors
    /// [`SoundcardError`] if there is no such card, or it does not support the request.
    pub(super) fn start(request: Request, live: Player) -> Result<Self, SoundcardError> {
        Ok(Self { stream: ReconnectingStream::open(request, live)?, rested: None })
    }

    /// The stream as the card opened it.
    pub(super) fn got(&self) -> &OpenedStream {
        &self.stream.got
    }

    /// Polls the stream, and reopens it when a vanished card is back. Returns messages.
    pub(super) fn poll(&mut self) -> Vec<BackendEvent> {
        if self.stream.shared().at_rest.load(Relaxed) && self.rested.is_none() {
            self.rested = Some(Instant::now());
        }
        // The run stands still without its card.
        self.stream.poll("the run waits", Player::resume)
    }

    /// True if the run has ended and its last buffers have been played.
    pub(super) fn is_finished(&self) -> bool {
        let got = self.got();
        let frames = got.buffer_frames.unwrap_or(self.stream.request.buffer_frames);
        let plays = Duration::from_secs_f64(3.0 * f64::from(frames) / f64::from(got.rate_hz));
        self.rested.is_some_and(|since| since.elapsed() > plays)
    }

    /// True if the card is gone.
    pub(super) fn is_waiting(&self) -> bool {
        self.stream.is_away()
    }

    /// Counts of the stream.
    pub(super) fn counts(&self) -> CardCounts {
        self.stream.counts()
    }

    /// Closes the stream and returns the run.
    pub(super) fn join(self) -> Option<Player> {
        self.stream.close()
    }
}

impl CallbackState for Player {
    const DIRECTION: Direction = Direction::Play;

    fn build<T>(setup: &Setup<Self>, device: &cpal::Device, config: StreamConfig) -> Result<Stream, Error>
    where
        T: SizedSample + FromSample<f64> + Send + 'static,
        f64: FromSample<T>,
    {
        let mut callback = PlaybackCallback::new(&setup.slot, &setup.shared, config.sample_rate, setup.start);
        let channels = usize::from(config.channels);
        let (shared, mut prepare) = (Arc::clone(&setup.shared), setup.preparation());
        let fill = move |data: &mut [T], info: &OutputCallbackInfo| {
            prepare();
            let stamp = info.timestamp();
            let ahead = stamp.playback.saturating_duration_since(stamp.callback);
            shared.latency.record(ahead.as_nanos() as u64);
            callback.fill(data, channels, T::EQUILIBRIUM, T::from_sample);
        };
        device.build_output_stream(config, fill, setup.failed(), Some(OPENING))
    }
}

/// The input streams of a live run.
#[derive(Default)]
pub(super) struct Inputs {
    /// Streams with their endpoints.
    streams: Vec<(Vec<String>, ReconnectingStream<InputTaps>)>,
    rings: Vec<Arc<RingMeter>>,
}

impl Inputs {
    /// Opens the inputs of a live run: `lives` are the graph's drivers, in its order. Endpoints with the same
    /// request share a stream.
    ///
    /// # Errors
    /// [`SoundcardError`] if there is no such card, or it does not support the request.
    pub(super) fn open<'l>(
        graph: &'l Graph,
        lives: impl IntoIterator<Item = &'l mut Player>,
    ) -> Result<Self, SoundcardError> {
        let mut inputs = Self::default();
        let mut requested: Vec<(Request, Vec<String>, Vec<InputTap>)> = Vec::new();
        for input in inputs_of(graph, lives) {
            let tap = InputTap::of(input);
            inputs.rings.push(Arc::clone(tap.writer.meter()));
            let (endpoint, stream) = (input.endpoint.clone(), &input.stream);
            match requested.iter_mut().find(|(known, ..)| known.differs_from(stream).is_none()) {
                Some((known, endpoints, taps)) => {
                    known.channels = known.channels.max(stream.channels);
                    endpoints.push(endpoint);
                    taps.push(tap);
                }
                None => requested.push((stream.clone(), vec![endpoint], vec![tap])),
            }
        }
        for (request, endpoints, taps) in requested {
            let stream = ReconnectingStream::open(request, InputTaps(taps))?;
            inputs.streams.push((endpoints, stream));
        }
        Ok(inputs)
    }

    /// For each stream: its endpoints, the request, the stream as opened, and its counts.
    pub(super) fn streams(&self) -> impl Iterator<Item = (&[String], &Request, &OpenedStream, CardCounts)> {
        let streams = self.streams.iter();
        streams.map(|(endpoints, stream)| (&endpoints[..], &stream.request, &stream.got, stream.counts()))
    }

    /// Meters of the rings from the cards to the graph.
    pub(super) fn rings(&self) -> impl Iterator<Item = &RingMeter> {
        self.rings.iter().map(|meter| &**meter)
    }

    /// Polls the streams; returns messages.
    pub(super) fn poll(&mut self) -> Vec<BackendEvent> {
        // Dependent outputs fade out when the card's ring is empty, and rise when it fills again.
        let streams = self.streams.iter_mut();
        streams.flat_map(|(_, stream)| stream.poll("its inputs are silent", |_| {})).collect()
    }
}

impl CallbackState for InputTaps {
    const DIRECTION: Direction = Direction::Listen;

    fn build<T>(setup: &Setup<Self>, device: &cpal::Device, config: StreamConfig) -> Result<Stream, Error>
    where
        T: SizedSample + FromSample<f64> + Send + 'static,
        f64: FromSample<T>,
    {
        let mut callback = CaptureCallback::new(&setup.slot, &setup.shared, config.sample_rate, setup.start);
        let channels = usize::from(config.channels);
        let rate_hz = f64::from(config.sample_rate);
        let (shared, mut prepare) = (Arc::clone(&setup.shared), setup.preparation());
        let capture = move |data: &[T], info: &InputCallbackInfo| {
            prepare();
            let stamp = info.timestamp();
            // The stamp is that of the first frame.
            let lasts = Duration::from_secs_f64((data.len() / channels) as f64 / rate_hz);
            let first_age = stamp.callback.saturating_duration_since(stamp.capture);
            let age = first_age.saturating_sub(lasts);
            shared.latency.record(age.as_nanos() as u64);
            callback.capture(data, channels, age, f64::from_sample_);
        };
        device.build_input_stream(config, capture, setup.failed(), Some(OPENING))
    }
}
