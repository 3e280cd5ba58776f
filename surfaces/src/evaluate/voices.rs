//! Synthesis of many textures at once in SIMD lanes. The bits of a voice do not depend on the others.

mod group;

use super::synthesis::{SynthesisError, SynthesisSettings, Trajectory, check};
use crate::TextureModel;
use group::{Group, LANES};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A vibration to synthesise: see [`synthesise`](super::synthesise).
#[derive(Debug, Clone, Copy)]
pub struct Voice<'a> {
    /// Its texture.
    pub texture: &'a TextureModel,
    /// Its trajectory.
    pub trajectory: &'a Trajectory,
    /// Its settings.
    pub settings: SynthesisSettings,
}

/// Error of a voice.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("voice {voice} (from 0): {source}")]
pub struct VoiceError {
    /// Number of the voice, from 0.
    pub voice: usize,
    /// The error.
    pub source: SynthesisError,
}

/// Common properties of voices that share lanes, so that no lane does operations for the sake of another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Shape {
    /// Sampling rate, update rate and warping factor, as bits.
    numbers: [u64; 3],
    orders: [usize; 2],
    crackles: bool,
    has_highpass: bool,
}

impl Shape {
    fn of(voice: &Voice<'_>) -> Self {
        let Voice {
            texture, settings, ..
        } = voice;
        Self {
            numbers: [texture.rate_hz(), settings.update_hz, texture.warping()].map(f64::to_bits),
            orders: [texture.ar_order(), texture.ma_order()],
            crackles: texture.crackle().is_some(),
            has_highpass: texture.highpass_hz().is_some(),
        }
    }
}

/// The acceleration, m/s², of each voice, computed on `threads` threads.
///
/// A voice has the same bits for any other voices and any number of threads; they equal those of
/// [`synthesise`](super::synthesise) except for rounding. Memory is that of the vibrations. Voices of one
/// order and rate fill the lanes best, sixteen at a time.
///
/// # Errors
/// The error that [`synthesise`](super::synthesise) would return for a voice.
pub fn synthesise_many(voices: &[Voice<'_>], threads: usize) -> Result<Vec<Vec<f64>>, VoiceError> {
    synthesise_many_with(voices, threads, &|_| ControlFlow::Continue(()))
}

/// The same; `progress` receives the fraction done, from any thread, and says whether to go on.
///
/// # Errors
/// As [`synthesise_many`]; [`SynthesisError::Stopped`] where `progress` breaks.
pub fn synthesise_many_with(
    voices: &[Voice<'_>],
    threads: usize,
    progress: &(dyn Fn(f64) -> ControlFlow<()> + Sync),
) -> Result<Vec<Vec<f64>>, VoiceError> {
    let groups = groups(voices)?;
    let samples = |number: &usize| voices[*number].trajectory.speed_m_s.len();
    let longest = groups.iter().filter_map(|group| group.iter().map(samples).max());
    let (all, done) = (longest.sum::<usize>(), AtomicUsize::new(0));
    let advance = |samples: usize| {
        let done = done.fetch_add(samples, Ordering::Relaxed) + samples;
        progress(done as f64 / all.max(1) as f64)
    };
    let next = AtomicUsize::new(0);
    let work = || {
        let mine = std::iter::from_fn(|| groups.get(next.fetch_add(1, Ordering::Relaxed)));
        mine.map(|group| play(voices, group, &advance))
            .collect::<Result<Vec<_>, _>>()
    };
    let played = match threads.min(groups.len()) {
        0 | 1 => vec![work()],
        threads => std::thread::scope(|scope| {
            let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
            let ended = workers.into_iter().map(|worker| worker.join());
            ended
                .map(|ended| ended.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
                .collect()
        }),
    };
    let mut vibrations = vec![vec![]; voices.len()];
    for group in played {
        for (number, vibration) in group?.into_iter().flatten() {
            vibrations[number] = vibration;
        }
    }
    Ok(vibrations)
}

/// The numbers of the voices in each group that shares lanes.
fn groups(voices: &[Voice<'_>]) -> Result<Vec<Vec<usize>>, VoiceError> {
    let mut shapes: BTreeMap<Shape, Vec<usize>> = BTreeMap::new();
    for (number, voice) in voices.iter().enumerate() {
        check(voice.texture, voice.trajectory, &voice.settings).map_err(|source| VoiceError {
            voice: number,
            source,
        })?;
        shapes.entry(Shape::of(voice)).or_default().push(number);
    }
    let groups = shapes.values().flat_map(|numbers| numbers.chunks(LANES));
    Ok(groups.map(<[usize]>::to_vec).collect())
}

/// The vibrations of a group, by number. `advance` receives the number of further samples done, and says whether to go on.
fn play(
    voices: &[Voice<'_>],
    numbers: &[usize],
    advance: &dyn Fn(usize) -> ControlFlow<()>,
) -> Result<Vec<(usize, Vec<f64>)>, VoiceError> {
    let members: Vec<&Voice<'_>> = numbers.iter().map(|number| &voices[*number]).collect();
    let played = Group::new(&members)
        .play(advance)
        .map_err(|(lane, source)| VoiceError {
            voice: numbers.get(lane).copied().unwrap_or_default(),
            source,
        })?;
    Ok(numbers.iter().copied().zip(played).collect())
}

#[cfg(test)]
mod tests;
