//! What happens in the callback of a card that listens: real-time code, and nothing of the soundcard's system in it.

use super::card::Ear;
use super::shared::{Away, Due, Home, Shared};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

/// Samples that are sent at a time.
const AT_ONCE: usize = 64;

/// Sends what a card hears to all endpoints that listen to it.
pub(super) struct Listener {
    ears: Away<Vec<Ear>>,
    shared: Arc<Shared>,
    due: Due,
}

impl Listener {
    /// Takes the ears from their home.
    pub fn new(home: &Home<Vec<Ear>>, shared: &Arc<Shared>, rate_hz: u32, start: Instant) -> Self {
        Self {
            ears: home.leave(),
            shared: Arc::clone(shared),
            due: Due::new(rate_hz, start),
        }
    }

    /// Takes a buffer of any length, frames of `channels` samples, the last of which was captured `age` ago.
    pub fn hear<T: Copy>(&mut self, data: &[T], channels: usize, age: Duration, convert: impl Fn(T) -> f64) {
        let began = Instant::now();
        let mut clipped = 0;
        for ear in self.ears.get().into_iter().flatten() {
            ear.writer.look();
            for frames in data.chunks(AT_ONCE * channels) {
                let mut heard = [0.0; AT_ONCE];
                let samples = frames.chunks_exact(channels).zip(&mut heard);
                let count = samples.len();
                for (frame, heard) in samples {
                    let sample = frame.get(ear.channel).map_or(0.0, |sample| convert(*sample));
                    clipped += u64::from(sample.abs() >= FULL);
                    *heard = sample * ear.full_scale;
                }
                ear.writer.write(&heard[..count]);
            }
            ear.captured.note(began.checked_sub(age).unwrap_or(began));
        }
        self.shared.clipped.fetch_add(clipped, Relaxed);
        self.due.note(began, data.len() / channels, &self.shared);
    }
}

/// The largest sample of the coarsest form: what is no smaller was cut off, or as good as.
const FULL: f64 = 1.0 - 1.0 / 32_768.0;
