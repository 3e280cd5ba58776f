//! Plays a sound once on the default soundcard, independent of any graph.

use super::system::{Direction, OPENING, card_name, choose, find, system};
use super::{CardFormat, Request, SoundcardError};
use cpal::traits::{DeviceTrait, StreamTrait};
use cpal::{BufferSize, Error, ErrorKind, FromSample, I24, SampleFormat, SizedSample, Stream, StreamConfig};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Time between polls of the waiting thread.
const POLL: Duration = Duration::from_millis(10);
/// A card that takes no samples for this long is broken.
const PATIENCE: Duration = Duration::from_secs(3);
/// Fade-out of a stopped sound, s.
const FADE_S: f64 = 0.01;
/// Time for samples that the card holds without reporting them.
const DRAIN: Duration = Duration::from_millis(150);
/// Longest time that a card is believed to hold.
const MAX_HELD: Duration = Duration::from_secs(5);

/// State shared by the callback and the waiting thread.
#[derive(Debug, Default)]
struct Shared {
    /// Samples taken.
    taken: AtomicUsize,
    /// Time from the last call of the card until the last sample of that call has been played, us.
    held_us: AtomicU64,
    stop: AtomicBool,
    lost: AtomicBool,
}

/// Checks that a soundcard can play a sound.
///
/// # Errors
/// [`SoundcardError::Unknown`] if there is none.
pub fn ready_to_play() -> Result<(), SoundcardError> {
    find(Direction::Play, None, |_| true).map(drop)
}

/// Plays one channel, relative to full scale, on every channel of the default soundcard. Returns at its end, or soon
/// after `stop` is set.
///
/// # Errors
/// [`SoundcardError`] if there is no soundcard, it does not support the rate, or it vanishes.
pub fn play_once(samples: Vec<f32>, rate_hz: u32, stop: &AtomicBool) -> Result<(), SoundcardError> {
    let request =
        Request { device: None, rate_hz, buffer_frames: 1024, format: CardFormat::Best, channels: 1 };
    let device = find(Direction::Play, None, |_| true)?;
    let (channels, format) = choose(Direction::Play, &request, &device, &card_name(&device))?;
    let config = StreamConfig { channels, sample_rate: rate_hz, buffer_size: BufferSize::Default };
    let (shared, count) = (Arc::new(Shared::default()), samples.len());
    let voice = Voice {
        samples,
        next: 0,
        level: 1.0,
        fall: (1.0 / (FADE_S * f64::from(rate_hz))) as f32,
        shared: Arc::clone(&shared),
    };
    let stream = match format {
        SampleFormat::F32 => voice.stream::<f32>(&device, config),
        SampleFormat::I32 => voice.stream::<i32>(&device, config),
        SampleFormat::I24 => voice.stream::<I24>(&device, config),
        _ => voice.stream::<i16>(&device, config),
    };
    let stream = stream.map_err(system)?;
    stream.play().map_err(system)?;
    wait(&shared, count, stop)
}

/// Waits until all samples are taken and played.
fn wait(shared: &Shared, count: usize, stop: &AtomicBool) -> Result<(), SoundcardError> {
    let (mut before, mut since) = (0, Instant::now());
    while shared.taken.load(Relaxed) < count && !stop.load(Relaxed) {
        let taken = shared.taken.load(Relaxed);
        if taken != before {
            (before, since) = (taken, Instant::now());
        }
        if shared.lost.load(Relaxed) || since.elapsed() > PATIENCE {
            return Err(SoundcardError::System(
                "it stopped taking samples while a sound was played".to_owned(),
            ));
        }
        std::thread::sleep(POLL);
    }
    shared.stop.store(true, Relaxed);
    let held = Duration::from_micros(shared.held_us.load(Relaxed));
    std::thread::sleep(held.min(MAX_HELD) + DRAIN);
    Ok(())
}

/// State of the callback.
struct Voice {
    samples: Vec<f32>,
    next: usize,
    /// Gain; falls to 0 after a stop.
    level: f32,
    /// Decrease of the gain per frame.
    fall: f32,
    shared: Arc<Shared>,
}

impl Voice {
    fn stream<T>(mut self, device: &cpal::Device, config: StreamConfig) -> Result<Stream, Error>
    where
        T: SizedSample + FromSample<f32> + Send + 'static,
    {
        let (channels, rate_hz) = (usize::from(config.channels), f64::from(config.sample_rate));
        let shared = Arc::clone(&self.shared);
        let fill = move |data: &mut [T], info: &cpal::OutputCallbackInfo| {
            let stamp = info.timestamp();
            let ahead = stamp.playback.saturating_duration_since(stamp.callback);
            let lasts = Duration::from_secs_f64((data.len() / channels) as f64 / rate_hz);
            for frame in data.chunks_mut(channels) {
                frame.fill(T::from_sample(self.next_sample()));
            }
            let held_us = u64::try_from((ahead + lasts).as_micros());
            self.shared.held_us.store(held_us.unwrap_or(0), Relaxed);
            self.shared.taken.store(self.next, Relaxed);
        };
        let failed = move |error: Error| {
            if matches!(error.kind(), ErrorKind::DeviceNotAvailable | ErrorKind::StreamInvalidated) {
                shared.lost.store(true, Relaxed);
            }
        };
        device.build_output_stream(config, fill, failed, Some(OPENING))
    }

    fn next_sample(&mut self) -> f32 {
        if self.shared.stop.load(Relaxed) {
            self.level = (self.level - self.fall).max(0.0);
        }
        let sample = self.samples.get(self.next).copied().unwrap_or(0.0);
        self.next = (self.next + 1).min(self.samples.len());
        sample * self.level
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn voice(shared: &Arc<Shared>) -> Voice {
        Voice { samples: vec![0.25; 1000], next: 0, level: 1.0, fall: 0.01, shared: Arc::clone(shared) }
    }

    #[test]
    fn a_sound_is_played_once_and_then_is_silent() {
        let mut voice = voice(&Arc::default());
        let played: Vec<f32> = (0..1200).map(|_| voice.next_sample()).collect();
        assert!(played[..1000].iter().all(|x| *x == 0.25) && played[1000..].iter().all(|x| *x == 0.0));
    }

    #[test]
    fn a_sound_that_is_stopped_fades() {
        let shared = Arc::default();
        let mut voice = voice(&shared);
        voice.next_sample();
        shared.stop.store(true, Relaxed);
        let played: Vec<f32> = (0..200).map(|_| voice.next_sample()).collect();
        let largest_step = played.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        assert!(largest_step.fold(0.0, f32::max) < 0.003 && played[150] == 0.0);
    }
}
