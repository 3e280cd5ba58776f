//! Learns the onset of a texture: the burst of a tool that breaks away, from strokes that begin from rest.
//!
//! The power of the first 100 ms of each stroke in three bands, less the texture's own there, is a burst that decays: its growth
//! with force and with the time at rest is that which makes the strokes likeliest (their powers are about exponential), its decay
//! that whose later half has the recorded share, its powers those that give the recorded ones through the renderer.

use super::method::TextureMethod;
use super::texture::{LearnTextureError, TextureReport};
use crate::metrics::strokes::{OnsetPowers, Stroke, powers, settled, strokes, thresholds};
use crate::recording::{ProcessedRecording, Signals};
use haptograph_signal::statistics::median;
use haptograph_surfaces::layers::onset::{ARMED_AFTER_S, LONGEST_S, Onset, OnsetOrigin};
use haptograph_surfaces::layers::{Layer, RenderRates};
use haptograph_surfaces::rendering::{SynthesisSettings, synthesise};
use haptograph_surfaces::{StaticPeak, TextureModel};
use std::sync::Arc;

/// Fewest strokes of which an onset is learned, and of which its growth is; without that it is constant.
const FEWEST: usize = 20;
const FEWEST_FOR_GROWTH: usize = 20;
/// Longest beginning of a recording of which an onset is learned, samples.
const MOST_SAMPLES: usize = 1 << 20;
/// Renderings of the texture of which its own powers are the mean.
const SEEDS: u64 = 4;
/// Decays that are tried, s.
const DECAYS_S: [f64; 6] = [0.01, 0.016, 0.025, 0.04, 0.06, 0.1];
/// Onsets rendered to see what comes out.
const RENDERED: usize = 32;
/// Least part of a stroke's power that counts as its burst, so that no stroke decides alone.
const LEAST_PART: f64 = 0.05;
/// Least burst over the texture's own power in one band: 3 dB together.
const LEAST_BURST: f64 = 1.0;

/// Why a texture has no onset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum NoOnset {
    #[error(
        "no stroke begins from rest: hold the tool still on the surface before each, in all for a tenth of the recording"
    )]
    NoStrokes,
    #[error(
        "only {strokes} strokes begin from rest, and an onset is learned from {FEWEST} or more: hold the tool still on the surface before each"
    )]
    FewStrokes { strokes: usize },
    #[error(
        "the tool vibrates before its {strokes} strokes from rest too, so it was not at rest: check the speed"
    )]
    NotAtRest { strokes: usize },
    #[error(
        "the burst of its {strokes} strokes from rest is out of range: check the unit of the acceleration and of the speed"
    )]
    Range { strokes: usize },
    #[error("its {strokes} strokes from rest begin no louder than the texture is")]
    NoBurst { strokes: usize },
}

/// A shown stroke begins and ends so long before and after the release, s.
const SHOWN_S: [f64; 2] = [0.05, 0.25];
/// A static peak is sought so long before and after the release, s.
const PEAK_S: [f64; 2] = [0.02, 0.15];
/// The Stribeck speed of every static peak, m/s, as of the nodes: it is not learned. Sampled speeds are smoothed over the few milliseconds in
/// which a tool passes it, and a still tool's are as large; the smoothed force falls later than the speed rises.
const STRIBECK_M_S: f64 = 0.01;
/// Smallest static peak, and the largest.
const LEAST_RATIO: f64 = 1.05;
const MOST_RATIO: f64 = 10.0;

/// A stroke with its powers, and those of the texture there.
struct Observed {
    stroke: Stroke,
    recorded: OnsetPowers,
    own: OnsetPowers,
}

/// A texture with its onset.
pub(crate) struct WithOnset {
    /// The texture.
    pub texture: TextureModel,
    /// Segments and models.
    pub report: TextureReport,
    /// The slides without the onsets, to which the report refers; without an onset, it refers to the recordings.
    pub slides: Option<Vec<ProcessedRecording>>,
    /// One stroke, or why there is no onset.
    pub onset: Result<OnsetShown, NoOnset>,
}

/// The start of a stroke from rest, as recorded and as rendered.
#[derive(Debug, Clone, PartialEq)]
pub struct OnsetShown {
    /// Samples per second.
    pub rate_hz: f64,
    /// The vibration from 50 ms before the tool breaks away, m/s².
    pub recorded: Vec<f64>,
    /// What the texture makes of the same motion, m/s².
    pub rendered: Vec<f64>,
}

/// Learns a texture from drags, and, unless by the thesis's method, its onset. With an onset the texture is learned again from the
/// slides alone, since the bursts would raise its level at low speeds.
///
/// # Errors
/// Those of [`TextureMethod::learn`].
pub(crate) fn learn_with_onset(
    method: &TextureMethod,
    drags: &[ProcessedRecording],
    progress: &dyn Fn(f64),
) -> Result<WithOnset, LearnTextureError> {
    let (texture, report) = method.learn(drags, progress)?;
    let first = match method {
        TextureMethod::Law(_) => find_onset(drags, &texture),
        TextureMethod::Thesis(_) => Err(NoOnset::NoStrokes),
    };
    let first = match first {
        Ok(onset) => onset,
        Err(none) => return Ok(WithOnset { texture, report, slides: None, onset: Err(none) }),
    };
    let slides: Option<Vec<_>> = drags.iter().map(without_onsets).collect();
    // Nothing is left of strokes as short as their onsets.
    let again = slides.and_then(|slides| Some((method.learn(&slides, progress).ok()?, Some(slides))));
    let ((texture, report), slides) = again.unwrap_or(((texture, report), None));
    let texture = texture.clone().with_layer(Arc::new(find_onset(drags, &texture).unwrap_or(first)))?;
    let onset = shown(drags, &texture).ok_or(NoOnset::NoStrokes);
    Ok(WithOnset { texture, report, slides, onset })
}

/// The stroke of the middle power.
fn shown(drags: &[ProcessedRecording], texture: &TextureModel) -> Option<OnsetShown> {
    let of = |drag: &ProcessedRecording| -> Vec<(f64, usize)> {
        let signals = drag.signals();
        let strokes = strokes(&signals.speed_m_s, &signals.force_normal_n, signals.rate_hz);
        let starts = || strokes.iter().map(|stroke| stroke.start);
        let powers = powers(&signals.acceleration_m_s2, starts(), signals.rate_hz);
        powers.iter().map(|powers| powers.whole.iter().sum()).zip(starts()).collect()
    };
    let mut all: Vec<(f64, usize, &ProcessedRecording)> = drags
        .iter()
        .flat_map(|drag| of(drag).into_iter().map(move |(power, start)| (power, start, drag)))
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let &(_, start, drag) = all.get(all.len() / 2)?;
    let rate_hz = drag.rate_hz();
    let [before, after] = SHOWN_S.map(|seconds| (seconds * rate_hz) as usize);
    let samples = start.saturating_sub(before)..(start + after).min(drag.samples());
    let vibration = synthesise(texture, &drag.trajectory(), &SynthesisSettings::default()).ok()?;
    let recorded = drag.signals().acceleration_m_s2[samples.clone()].to_vec();
    Some(OnsetShown { rate_hz, recorded, rendered: vibration[samples].to_vec() })
}

/// The static peak of drags over a coefficient of friction: the middle of the strokes' largest ratios of tangential and normal force
/// around the release. `None` with few strokes, without tangential force, or where there is hardly a peak.
pub(super) fn static_peak(drags: &[ProcessedRecording], mu: f64) -> Option<StaticPeak> {
    let mut highest = vec![];
    for signals in drags.iter().map(ProcessedRecording::signals) {
        let tangential = signals.force_tangential_n.as_ref()?;
        for Stroke { start, .. } in strokes(&signals.speed_m_s, &signals.force_normal_n, signals.rate_hz) {
            let [before, after] = PEAK_S.map(|seconds| (seconds * signals.rate_hz) as usize);
            let samples = start.saturating_sub(before)..(start + after).min(tangential.len());
            let ratios = samples.map(|i| tangential[i] / (mu * signals.force_normal_n[i]));
            highest.push(ratios.filter(|ratio| ratio.is_finite()).fold(0.0, f64::max));
        }
    }
    let ratio = median(&highest).min(MOST_RATIO);
    let is_peak = highest.len() >= FEWEST && ratio >= LEAST_RATIO;
    StaticPeak::new(ratio, STRIBECK_M_S).ok().filter(|_| is_peak)
}

/// A recording without its onsets; `None` if too little is left.
fn without_onsets(recording: &ProcessedRecording) -> Option<ProcessedRecording> {
    let signals = recording.signals();
    let settled = settled(&signals.speed_m_s, &signals.force_normal_n, signals.rate_hz);
    let left = |all: &[f64]| -> Vec<f64> {
        all.iter().zip(&settled).filter(|(_, settled)| **settled).map(|(x, _)| *x).collect()
    };
    let left = Signals {
        rate_hz: signals.rate_hz,
        acceleration_m_s2: left(&signals.acceleration_m_s2),
        force_normal_n: left(&signals.force_normal_n),
        force_tangential_n: signals.force_tangential_n.as_deref().map(left),
        speed_m_s: left(&signals.speed_m_s),
        axes_m_s2: None,
    };
    ProcessedRecording::new(left, recording.gesture(), recording.provenance().clone()).ok()
}

/// Finds the onset that recordings have beside what `texture` renders.
///
/// # Errors
/// [`NoOnset`].
fn find_onset(recordings: &[ProcessedRecording], texture: &TextureModel) -> Result<Onset, NoOnset> {
    let mut observed = vec![];
    for (recording, strokes) in recordings.iter().zip(enough_strokes(recordings)?) {
        match beginning(recording) {
            None => observed.extend(observe(recording, strokes, texture)),
            Some(first) => {
                let whole = |stroke: &Stroke| stroke.start + (first.rate_hz() as usize) < first.samples();
                let strokes = strokes.into_iter().filter(whole).collect();
                observed.extend(observe(&first, strokes, texture));
            }
        }
    }
    let strokes = observed.len();
    let excess = |of: fn(&OnsetPowers) -> [f64; 3]| -> [f64; 3] {
        [0, 1, 2].map(|band| {
            let sum = |powers: fn(&Observed) -> &OnsetPowers| {
                observed.iter().map(|o| of(powers(o))[band]).sum::<f64>()
            };
            (sum(|o| &o.recorded) - sum(|o| &o.own)).max(0.0)
        })
    };
    let sum = |of: fn(&OnsetPowers) -> [f64; 3]| observed.iter().flat_map(|o| of(&o.recorded)).sum::<f64>();
    if sum(|p| p.before) > 0.5 * sum(|p| p.whole) {
        return Err(NoOnset::NotAtRest { strokes });
    }
    let (burst, late) = (excess(|p| p.whole), excess(|p| p.late));
    let own = |band: usize| observed.iter().map(|o| o.own.whole[band]).sum::<f64>();
    if (0..3).all(|band| burst[band] <= LEAST_BURST * own(band)) {
        return Err(NoOnset::NoBurst { strokes });
    }
    let middle = |of: fn(&Stroke) -> f64| median(&observed.iter().map(|o| of(&o.stroke)).collect::<Vec<_>>());
    let slowest =
        |at: usize| recordings.iter().map(|r| thresholds(&r.signals().speed_m_s)[at]).fold(0.0, f64::max);
    let [rest_m_s, slide_m_s] = [slowest(0), slowest(1)];
    let mut onset = Onset {
        origin: OnsetOrigin::Learned(strokes as u32),
        powers_m2_s4: [0.0; 3],
        decay_s: DECAYS_S[0],
        force_n: middle(|stroke| stroke.force_n),
        force_exponent: 0.0,
        stuck_s: middle(|stroke| stroke.stuck_s).clamp(ARMED_AFTER_S, LONGEST_S),
        stuck_exponent: 0.0,
        rest_m_s,
        slide_m_s,
    };
    if strokes >= FEWEST_FOR_GROWTH {
        onset = with_growth(onset, &observed, burst);
    }
    let rate_hz = texture.rate_hz();
    let share = late.iter().sum::<f64>() / burst.iter().sum::<f64>();
    let off = |decay_s: &f64| {
        // Of bursts as loud as the recorded ones in each band.
        let rendered = rendered(*decay_s, rate_hz);
        let mix = |part: usize| (0..3).map(|band| burst[band] * rendered[band][part][band]).sum::<f64>();
        (mix(1) / mix(0) / share.max(0.01)).ln().abs()
    };
    onset.decay_s = DECAYS_S.into_iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(onset.decay_s);
    let growth: f64 = observed.iter().map(|o| onset.growth(o.stroke.force_n, o.stroke.stuck_s)).sum();
    onset.powers_m2_s4 = powers_for(burst.map(|sum| sum / growth), &rendered(onset.decay_s, rate_hz));
    onset.checked().map_err(|_| NoOnset::Range { strokes })
}

/// As much of a long recording as its onset is learned from: rendering all of it would take several times its memory.
fn beginning(recording: &ProcessedRecording) -> Option<ProcessedRecording> {
    let (signals, most) = (recording.signals(), MOST_SAMPLES);
    let first = |all: &[f64]| all[..most].to_vec();
    let cut = (recording.samples() > most).then(|| Signals {
        rate_hz: signals.rate_hz,
        acceleration_m_s2: first(&signals.acceleration_m_s2),
        force_normal_n: first(&signals.force_normal_n),
        speed_m_s: first(&signals.speed_m_s),
        ..Signals::default()
    });
    ProcessedRecording::new(cut?, recording.gesture(), recording.provenance().clone()).ok()
}

/// The strokes from rest of each recording.
fn enough_strokes(recordings: &[ProcessedRecording]) -> Result<Vec<Vec<Stroke>>, NoOnset> {
    let found = recordings.iter().map(|recording| {
        let signals = recording.signals();
        strokes(&signals.speed_m_s, &signals.force_normal_n, signals.rate_hz)
    });
    let found: Vec<Vec<Stroke>> = found.collect();
    match found.iter().map(Vec::len).sum() {
        0 => Err(NoOnset::NoStrokes),
        strokes if strokes < FEWEST => Err(NoOnset::FewStrokes { strokes }),
        _ => Ok(found),
    }
}

fn observe(recording: &ProcessedRecording, strokes: Vec<Stroke>, texture: &TextureModel) -> Vec<Observed> {
    let (signals, rate_hz) = (recording.signals(), recording.rate_hz());
    if strokes.is_empty() {
        return vec![];
    }
    let starts = || strokes.iter().map(|stroke| stroke.start);
    let recorded = powers(&signals.acceleration_m_s2, starts(), rate_hz);
    let trajectory = recording.trajectory();
    let mut own = vec![OnsetPowers::default(); strokes.len()];
    for seed in 1..=SEEDS {
        let settings = SynthesisSettings { seed, lines_seed: seed, ..SynthesisSettings::default() };
        let Ok(vibration) = synthesise(texture, &trajectory, &settings) else { continue };
        for (own, rendered) in own.iter_mut().zip(powers(&vibration, starts(), rate_hz)) {
            for band in 0..3 {
                own.whole[band] += rendered.whole[band] / SEEDS as f64;
                own.late[band] += rendered.late[band] / SEEDS as f64;
            }
        }
    }
    let all = strokes.into_iter().zip(recorded).zip(own);
    all.map(|((stroke, recorded), own)| Observed { stroke, recorded, own }).collect()
}

/// The onset with the exponents of force and of time at rest under which the strokes are likeliest, were their powers exponential.
fn with_growth(onset: Onset, observed: &[Observed], burst: [f64; 3]) -> Onset {
    let levels: Vec<f64> = observed
        .iter()
        .map(|Observed { recorded, own, .. }| {
            let of = |band: usize| {
                let all = recorded.whole[band];
                (all - own.whole[band]).max(LEAST_PART * all) / burst[band].max(f64::MIN_POSITIVE)
            };
            (0..3).filter(|band| burst[*band] > 0.0).map(of).sum::<f64>()
        })
        .collect();
    let tried = (0..=20).flat_map(|force| (0..=10).map(move |stuck| (f64::from(force), f64::from(stuck))));
    let candidates = tried.map(|(force, stuck)| Onset {
        force_exponent: force / 10.0,
        stuck_exponent: stuck / 10.0,
        ..onset
    });
    let unlikely = |onset: &Onset| {
        let (mut level, mut log) = (0.0, 0.0);
        for (seen, Observed { stroke, .. }) in levels.iter().zip(observed) {
            let growth = onset.growth(stroke.force_n, stroke.stuck_s).max(f64::MIN_POSITIVE);
            level += seen / growth / levels.len() as f64;
            log += growth.ln() / levels.len() as f64;
        }
        level.ln() + log
    };
    candidates.min_by(|a, b| unlikely(a).total_cmp(&unlikely(b))).unwrap_or(onset)
}

/// What comes out of an onset of power 1 in each band: the powers of its first 100 ms, and of the later half, in all bands.
fn rendered(decay_s: f64, rate_hz: f64) -> [[[f64; 3]; 2]; 3] {
    [0, 1, 2].map(|band| {
        let mut powers_m2_s4 = [0.0; 3];
        powers_m2_s4[band] = 1.0;
        let onset = Onset {
            origin: OnsetOrigin::Learned(0),
            powers_m2_s4,
            decay_s,
            force_n: 1.0,
            force_exponent: 0.0,
            stuck_s: 1.0,
            stuck_exponent: 0.0,
            rest_m_s: 0.01,
            slide_m_s: 0.02,
        };
        let mut voice = onset.voice(RenderRates { rate_hz, models_hz: rate_hz }, 1);
        let [rest, slide] = [1.5 * ARMED_AFTER_S, 0.25].map(|seconds| (seconds * rate_hz) as usize);
        let mut vibration = vec![0.0; RENDERED * (rest + slide)];
        for stroke in vibration.chunks_exact_mut(rest + slide) {
            let (still, moving) = stroke.split_at_mut(rest);
            voice.set(0.0, &[1.0]);
            voice.process(still);
            voice.set(0.1, &[1.0]);
            voice.process(moving);
        }
        let starts = (0..RENDERED).map(|stroke| stroke * (rest + slide) + rest);
        let all = powers(&vibration, starts, rate_hz);
        let mean = |of: fn(&OnsetPowers) -> [f64; 3]| -> [f64; 3] {
            [0, 1, 2].map(|band| all.iter().map(|p| of(p)[band]).sum::<f64>() / RENDERED as f64)
        };
        [mean(|p| p.whole), mean(|p| p.late)]
    })
}

/// The powers, none below zero, that give `wanted` in the first 100 ms (Richardson 1972; Lucy 1974).
fn powers_for(wanted: [f64; 3], rendered: &[[[f64; 3]; 2]; 3]) -> [f64; 3] {
    let gain = |made: usize, seen: usize| rendered[made][0][seen];
    let mut found = wanted;
    for _ in 0..200 {
        let seen = [0, 1, 2].map(|seen| (0..3).map(|made| gain(made, seen) * found[made]).sum::<f64>());
        found = [0, 1, 2].map(|made| {
            let whole: f64 = (0..3).map(|seen| gain(made, seen)).sum();
            let sum: f64 = (0..3)
                .filter(|band| seen[*band] > 0.0)
                .map(|band| gain(made, band) * wanted[band] / seen[band])
                .sum();
            if whole > 0.0 { found[made] * sum / whole } else { 0.0 }
        });
    }
    let loudest = found.into_iter().fold(0.0, f64::max);
    found.map(|power| if power > 1e-6 * loudest { power } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::super::law::{LawSettings, learn_law};
    use super::*;
    use crate::recording::tests::synthetic::drag;

    /// Strokes of 0.5 s after rests of 0.2 s, with the vibration of `onset`, if any.
    fn take(count: usize, onset: Option<Onset>) -> (ProcessedRecording, TextureModel) {
        let steps = (0..count).flat_map(|k| {
            let force_n = 0.6 + 0.4 * (k % 4) as f64;
            [(0.2, 0.0001, force_n), (0.5, 0.1, force_n)]
        });
        let plain = drag(&steps.collect::<Vec<_>>(), 0.3, 1, |speed, force| {
            (vec![-1.72, 0.81], 400.0 * speed * speed * force)
        });
        let texture = learn_law(std::slice::from_ref(&plain), &LawSettings::default(), &|_| ()).unwrap().0;
        let with = onset
            .map_or_else(|| texture.clone(), |onset| texture.clone().with_layer(Arc::new(onset)).unwrap());
        let settings = SynthesisSettings { seed: 9, lines_seed: 9, ..SynthesisSettings::default() };
        let acceleration_m_s2 = synthesise(&with, &plain.trajectory(), &settings).unwrap();
        let signals = Signals { acceleration_m_s2, ..plain.signals().clone() };
        (ProcessedRecording::new(signals, plain.gesture(), plain.provenance().clone()).unwrap(), texture)
    }

    #[test]
    fn an_onset_that_a_recording_has_is_found_and_none_where_it_has_none() {
        let truth = Onset {
            origin: OnsetOrigin::Learned(0),
            powers_m2_s4: [400.0, 100.0, 100.0],
            decay_s: 0.025,
            force_n: 1.2,
            force_exponent: 1.0,
            stuck_s: 0.2,
            stuck_exponent: 0.0,
            rest_m_s: 0.01,
            slide_m_s: 0.02,
        };
        let (recorded, texture) = take(40, Some(truth));
        let found = find_onset(&[recorded], &texture).unwrap();
        assert_eq!(found.origin, OnsetOrigin::Learned(40));
        let energy =
            |onset: &Onset, band: usize| onset.decay_s * onset.growth(1.0, 0.2) * onset.powers_m2_s4[band];
        let off_db = |bands: std::ops::Range<usize>| {
            let of = |onset: &Onset| bands.clone().map(|band| energy(onset, band)).sum::<f64>();
            10.0 * (of(&found) / of(&truth)).log10()
        };
        // Forty bursts of a few cycles each.
        assert!(off_db(0..3).abs() < 2.0, "{} dB, {found:?}", off_db(0..3));
        assert!((0..3).all(|band| off_db(band..band + 1).abs() < 4.5), "{found:?}");
        assert!((0.4..=1.6).contains(&found.force_exponent), "{found:?}");
        let (plain, texture) = take(40, None);
        assert_eq!(find_onset(&[plain], &texture), Err(NoOnset::NoBurst { strokes: 40 }));
        let (few, texture) = take(7, Some(truth));
        assert_eq!(find_onset(&[few], &texture), Err(NoOnset::FewStrokes { strokes: 7 }));
    }
}
