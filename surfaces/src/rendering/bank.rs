//! Synthesis of many textures at once in SIMD lanes. The bits of a voice do not depend on the others.

mod group;
mod lanes;

pub use lanes::Block;
pub(crate) use lanes::{BLOCK, LANES, Row};

use super::{SynthesisError, SynthesisSettings, Trajectory, UpdatePoints, check, check_points};
use crate::TextureModel;
use crate::layers::{Layer, Stage};
use group::Group;
use haptograph_signal::parallel;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A vibration to synthesise: see [`synthesise`](super::synthesise).
#[derive(Debug, Clone, Copy)]
pub struct Voice<'a> {
    /// The texture.
    pub texture: &'a TextureModel,
    /// The trajectory.
    pub trajectory: &'a Trajectory,
    /// The settings.
    pub settings: SynthesisSettings,
}

/// A vibration to synthesise into memory of the caller.
#[derive(Debug)]
pub struct VoiceInto<'a> {
    /// The texture.
    pub texture: &'a TextureModel,
    /// The speed and force at the updates of its filter.
    pub points: &'a UpdatePoints,
    /// As [`SynthesisSettings::seed`].
    pub seed: u64,
    /// As [`SynthesisSettings::lines_seed`].
    pub lines_seed: u64,
    /// Output of the vibration, [`UpdatePoints::samples`] long.
    pub out: &'a mut [f64],
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
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Shape {
    /// Sampling rate, update rate and warping factor, as bits.
    numbers: [u64; 3],
    orders: [usize; 2],
    /// Names of the layers of the excitation.
    layers: Vec<&'static str>,
    has_highpass: bool,
}

impl Shape {
    fn of(voice: &VoiceInto<'_>) -> Self {
        let VoiceInto { texture, points, .. } = voice;
        let layers = texture.layers().map(Layer::kind).filter(|kind| kind.stage == Stage::Excitation);
        Self {
            numbers: [texture.rate_hz(), points.update_hz, texture.warping()].map(f64::to_bits),
            orders: [texture.ar_order(), texture.ma_order()],
            layers: layers.map(|kind| kind.name).collect(),
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

/// Like [`synthesise_many`]; `progress` receives the fraction done, from any thread, and returns whether to continue.
///
/// # Errors
/// As [`synthesise_many`]; [`SynthesisError::Stopped`] if `progress` breaks.
pub fn synthesise_many_with(
    voices: &[Voice<'_>],
    threads: usize,
    progress: &(dyn Fn(f64) -> ControlFlow<()> + Sync),
) -> Result<Vec<Vec<f64>>, VoiceError> {
    let mut points = Vec::with_capacity(voices.len());
    for (number, voice) in voices.iter().enumerate() {
        check(voice.texture, voice.trajectory, &voice.settings)
            .map_err(|source| VoiceError { voice: number, source })?;
        points.push(voice.trajectory.at_updates(voice.settings.update_hz));
    }
    let mut vibrations: Vec<Vec<f64>> = points.iter().map(|points| vec![0.0; points.samples]).collect();
    let each = voices.iter().zip(&points).zip(&mut vibrations);
    let into = each.map(|((voice, points), out)| VoiceInto {
        texture: voice.texture,
        points,
        seed: voice.settings.seed,
        lines_seed: voice.settings.lines_seed,
        out,
    });
    synthesise_into(into.collect(), threads, progress)?;
    Ok(vibrations)
}

/// Like [`synthesise_many_with`], into memory of the caller, from speeds and forces at the updates only. It allocates
/// no memory that grows with the length of the vibrations. After an error the output is undefined.
///
/// # Errors
/// The errors of [`synthesise_many`], and wrong numbers of points or of output samples.
pub fn synthesise_into(
    voices: Vec<VoiceInto<'_>>,
    threads: usize,
    progress: &(dyn Fn(f64) -> ControlFlow<()> + Sync),
) -> Result<(), VoiceError> {
    let groups = groups(voices)?;
    let longest = groups.iter().filter_map(|group| {
        let samples = group.iter().map(|(_, voice)| voice.points.samples);
        samples.max()
    });
    let (all, done) = (longest.sum::<usize>(), AtomicUsize::new(0));
    let advance = |samples: usize| {
        let done = done.fetch_add(samples, Ordering::Relaxed) + samples;
        progress(done as f64 / all.max(1) as f64)
    };
    parallel::try_map(threads, groups, &|_| (), |group| play(group, &advance)).map(drop)
}

/// Voices that share lanes, with their numbers.
type Numbered<'a> = Vec<(usize, VoiceInto<'a>)>;

/// The voices in groups that share lanes.
fn groups(voices: Vec<VoiceInto<'_>>) -> Result<Vec<Numbered<'_>>, VoiceError> {
    let mut shapes: BTreeMap<Shape, Vec<Numbered<'_>>> = BTreeMap::new();
    for (number, voice) in voices.into_iter().enumerate() {
        check_points(voice.texture, voice.points, voice.out.len())
            .map_err(|source| VoiceError { voice: number, source })?;
        let groups = shapes.entry(Shape::of(&voice)).or_default();
        match groups.last_mut().filter(|group| group.len() < LANES) {
            Some(group) => group.push((number, voice)),
            None => groups.push(vec![(number, voice)]),
        }
    }
    Ok(shapes.into_values().flatten().collect())
}

/// Synthesises a group. `advance` receives the number of further samples done, and returns whether to continue.
fn play(group: Numbered<'_>, advance: &dyn Fn(usize) -> ControlFlow<()>) -> Result<(), VoiceError> {
    let (numbers, voices): (Vec<usize>, Vec<VoiceInto<'_>>) = group.into_iter().unzip();
    Group::new(voices).play(advance).map_err(|(lane, source)| VoiceError {
        voice: numbers.get(lane).copied().unwrap_or_default(),
        source,
    })
}

#[cfg(test)]
mod tests;
