//! Streams of cards: one that drives a live run, and those that it listens to.

use super::fill::Filler;
use super::kept::Kept;
use super::listen::{Ear, Listener, heard};
use super::system::{OPENING, Plug, Plugged, Way};
use super::{CardCounts, CardNote, Got, Request, SoundcardError};
use cpal::traits::DeviceTrait;
use cpal::{Error, FromSample, InputCallbackInfo, OutputCallbackInfo, SizedSample, Stream, StreamConfig};
use haptograph_engine::graph::Graph;
use haptograph_engine::run::{Live, RingMeter};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

/// A stream that drives a live run.
pub struct CardDriver {
    kept: Kept<Live>,
    rested: Option<Instant>,
}

impl CardDriver {
    /// Opens the card and lets it drive a live run.
    ///
    /// # Errors
    /// [`SoundcardError`] where there is no such card, or it cannot do what is asked for.
    pub fn start(request: Request, live: Live) -> Result<Self, SoundcardError> {
        Ok(Self {
            kept: Kept::open(request, live)?,
            rested: None,
        })
    }

    /// What was got.
    pub fn got(&self) -> &Got {
        &self.kept.got
    }

    /// Looks after the stream: reopens it where the card has gone and come back. Returns what there is to say.
    pub fn tend(&mut self) -> Vec<CardNote> {
        if self.kept.shared().at_rest.load(Relaxed) && self.rested.is_none() {
            self.rested = Some(Instant::now());
        }
        // What was driven by the card is at rest with it.
        self.kept.tend("the run waits", Live::resume)
    }

    /// Is the run over, and have the last buffers been played?
    pub fn is_finished(&self) -> bool {
        let got = self.got();
        let frames = got.buffer_frames.unwrap_or(self.kept.request.buffer_frames);
        let plays = Duration::from_secs_f64(3.0 * f64::from(frames) / f64::from(got.rate_hz));
        self.rested.is_some_and(|since| since.elapsed() > plays)
    }

    /// Is the card away?
    pub fn is_waiting(&self) -> bool {
        self.kept.is_away()
    }

    /// What was counted.
    pub fn counts(&self) -> CardCounts {
        self.kept.counts()
    }

    /// Closes the stream and gives the run back.
    pub fn join(self) -> Option<Live> {
        self.kept.close()
    }
}

impl Plugged for Live {
    const WAY: Way = Way::Play;

    fn build<T>(plug: &Plug<Self>, device: &cpal::Device, config: StreamConfig) -> Result<Stream, Error>
    where
        T: SizedSample + FromSample<f64> + Send + 'static,
        f64: FromSample<T>,
    {
        let mut filler = Filler::new(&plug.home, &plug.shared, config.sample_rate, plug.start);
        let channels = usize::from(config.channels);
        let (shared, mut prepare) = (Arc::clone(&plug.shared), plug.preparation());
        let fill = move |data: &mut [T], info: &OutputCallbackInfo| {
            prepare();
            let stamp = info.timestamp();
            let ahead = stamp.playback.saturating_duration_since(stamp.callback);
            shared.latency.record(ahead.as_nanos() as u64);
            filler.fill(data, channels, T::EQUILIBRIUM, T::from_sample);
        };
        device.build_output_stream(config, fill, plug.failed(), Some(OPENING))
    }
}

/// The streams that a live run listens to.
#[derive(Default)]
pub struct Inputs {
    /// Each with the endpoints that listen to it.
    streams: Vec<(Vec<String>, Kept<Vec<Ear>>)>,
    rings: Vec<Arc<RingMeter>>,
}

impl Inputs {
    /// Opens what the endpoints of a live run listen to: `lives` has the graph's drivers, in its order. Endpoints that
    /// ask for one stream share it.
    ///
    /// # Errors
    /// [`SoundcardError`] where there is no such card, or it cannot do what is asked for.
    pub fn open(graph: &Graph, lives: &mut [Live]) -> Result<Self, SoundcardError> {
        let mut inputs = Self::default();
        let mut asked: Vec<(Request, Vec<String>, Vec<Ear>)> = Vec::new();
        for input in heard(graph, lives) {
            let ear = input.listen();
            inputs.rings.push(Arc::clone(ear.writer.meter()));
            let (endpoint, stream) = (input.endpoint.clone(), &input.stream);
            match asked
                .iter_mut()
                .find(|(known, ..)| known.differs_from(stream).is_none())
            {
                Some((known, endpoints, ears)) => {
                    known.channels = known.channels.max(stream.channels);
                    endpoints.push(endpoint);
                    ears.push(ear);
                }
                None => asked.push((stream.clone(), vec![endpoint], vec![ear])),
            }
        }
        for (request, endpoints, ears) in asked {
            inputs.streams.push((endpoints, Kept::open(request, ears)?));
        }
        Ok(inputs)
    }

    /// The endpoints that listen to each stream, what was asked for and got, and what was counted.
    pub fn streams(&self) -> impl Iterator<Item = (&[String], &Request, &Got, CardCounts)> {
        let streams = self.streams.iter();
        streams.map(|(endpoints, kept)| (&endpoints[..], &kept.request, &kept.got, kept.counts()))
    }

    /// What is known of the rings that lead from the cards to the graph.
    pub fn rings(&self) -> impl Iterator<Item = &RingMeter> {
        self.rings.iter().map(|meter| &**meter)
    }

    /// Looks after the streams; returns what there is to say.
    pub fn tend(&mut self) -> Vec<CardNote> {
        // What hung on the card fell to nothing when its ring ran dry, and rises when that is filled again.
        let streams = self.streams.iter_mut();
        streams
            .flat_map(|(_, kept)| kept.tend("nothing is heard of it", |_| {}))
            .collect()
    }
}

impl Plugged for Vec<Ear> {
    const WAY: Way = Way::Listen;

    fn build<T>(plug: &Plug<Self>, device: &cpal::Device, config: StreamConfig) -> Result<Stream, Error>
    where
        T: SizedSample + FromSample<f64> + Send + 'static,
        f64: FromSample<T>,
    {
        let mut listener = Listener::new(&plug.home, &plug.shared, config.sample_rate, plug.start);
        let channels = usize::from(config.channels);
        let rate_hz = f64::from(config.sample_rate);
        let (shared, mut prepare) = (Arc::clone(&plug.shared), plug.preparation());
        let hear = move |data: &[T], info: &InputCallbackInfo| {
            prepare();
            let stamp = info.timestamp();
            // The stamp is that of the first frame.
            let lasts = Duration::from_secs_f64((data.len() / channels) as f64 / rate_hz);
            let first_age = stamp.callback.saturating_duration_since(stamp.capture);
            let age = first_age.saturating_sub(lasts);
            shared.latency.record(age.as_nanos() as u64);
            listener.hear(data, channels, age, f64::from_sample_);
        };
        device.build_input_stream(config, hear, plug.failed(), Some(OPENING))
    }
}
