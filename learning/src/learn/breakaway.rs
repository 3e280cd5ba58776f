//! Learns the onset of a texture: the burst of a tool that breaks away, from strokes that begin from rest.
//!
//! The power of the first 100 ms of each stroke in three bands, less the texture's own there, is a burst that decays: its growth
//! with force and with the time at rest is that which makes the strokes likeliest (their powers are about exponential), its decay
//! that whose later half has the recorded share, its powers those with which the strokes, rendered, are as much louder than their
//! slides as the recorded ones. The bands share one noise and overlap, so what one adds to its neighbour depends on both.

use super::method::TextureMethod;
use super::texture::{LearnTextureError, TextureReport};
use crate::metrics::strokes::{
    BEFORE, LATE, OnsetPowers, Stroke, WHOLE, powers, settled, slides, strokes, thresholds,
};
use crate::recording::{ProcessedRecording, Signals};
use haptograph_signal::statistics::{mean, median, standard_deviation};
use haptograph_surfaces::layers::onset::{ARMED_AFTER_S, LONGEST_S, Onset, OnsetOrigin};
use haptograph_surfaces::layers::{Layer, RenderRates};
use haptograph_surfaces::rendering::{SynthesisSettings, Trajectory, synthesise};
use haptograph_surfaces::{StaticPeak, TextureModel};
use std::ops::Range;
use std::sync::Arc;

/// Fewest strokes of which an onset is learned.
const FEWEST: usize = 20;
/// Most strokes of a recording that are rendered, and the samples in which they are so at once.
const MOST_STROKES: usize = 200;
const MOST_SAMPLES: usize = 1 << 20;
/// Renderings of the texture of which its own powers are the mean.
const SEEDS: u64 = 4;
/// Decays that are tried, s.
const DECAYS_S: [f64; 6] = [0.01, 0.016, 0.025, 0.04, 0.06, 0.1];
/// Onsets rendered to see what comes out.
const RENDERED: usize = 96;
/// Times that powers are set by what comes out of an onset alone, for each decay, and on the texture, at the recorded strokes.
const ROUNDS: usize = 5;
const CORRECTIONS: usize = 2;
/// Least part of a stroke's power that counts as its burst, so that no stroke decides alone.
const LEAST_PART: f64 = 0.05;
/// A burst is so many standard errors over strokes, and so many dB, louder than the texture over all bands.
const LEAST_ERRORS: f64 = 2.5;
const LEAST_BURST_DB: f64 = 1.0;

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
    #[error(
        "its {strokes} strokes from rest begin no louder than the texture is, as far as so many can tell"
    )]
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
    let found = match method {
        TextureMethod::Law(_) => enough_strokes(drags),
        TextureMethod::Thesis(_) => Err(NoOnset::NoStrokes),
    };
    let found = found.and_then(|found| bursts(drags, &found, &texture).map(|_| found));
    let again = found.and_then(|found| {
        let slides: Option<Vec<_>> = drags.iter().map(without_onsets).collect();
        // Nothing is left of strokes as short as their onsets.
        let again = slides.and_then(|slides| Some((method.learn(&slides, progress).ok()?, Some(slides))));
        let (learned, slides) = again.unwrap_or_else(|| ((texture.clone(), report.clone()), None));
        Ok((find_onset(drags, &found, &learned.0)?, found, learned, slides))
    });
    match again {
        Ok((onset, found, (texture, report), slides)) => {
            let texture = texture.with_layer(Arc::new(onset))?;
            let onset = shown(drags, &found, &texture).ok_or(NoOnset::NoStrokes);
            Ok(WithOnset { texture, report, slides, onset })
        }
        Err(none) => Ok(WithOnset { texture, report, slides: None, onset: Err(none) }),
    }
}

/// The middle one of all strokes.
fn shown(drags: &[ProcessedRecording], found: &[Vec<Stroke>], texture: &TextureModel) -> Option<OnsetShown> {
    let all =
        drags.iter().zip(found).flat_map(|(drag, strokes)| strokes.iter().map(move |s| (drag, s.start)));
    let (drag, start) = all.clone().nth(all.count() / 2)?;
    let rate_hz = drag.rate_hz();
    let [before, after] = SHOWN_S.map(|seconds| (seconds * rate_hz) as usize);
    let samples = start.saturating_sub(before)..(start + after).min(drag.samples());
    let from = start.saturating_sub((LONGEST_S * rate_hz) as usize);
    let motion = trajectory(drag.signals(), from..samples.end);
    let vibration = synthesise(texture, &motion, &SynthesisSettings::default()).ok()?;
    let recorded = drag.signals().acceleration_m_s2[samples.clone()].to_vec();
    Some(OnsetShown { rate_hz, recorded, rendered: vibration[samples.start - from..].to_vec() })
}

/// The static peak of drags over a coefficient of friction: the middle of the strokes' largest ratios of tangential and normal force
/// around the release. `None` with few strokes, without tangential force, or where there is hardly a peak.
pub(super) fn static_peak(drags: impl Iterator<Item = ProcessedRecording>, mu: f64) -> Option<StaticPeak> {
    let mut highest = vec![];
    for drag in drags {
        let signals = drag.signals();
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
        let (mut left, mut settled) = (all.to_vec(), settled.iter());
        left.retain(|_| settled.next() == Some(&true));
        left.shrink_to_fit();
        left
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

/// The strokes, if they begin with bursts beside what `texture` renders.
fn bursts(
    recordings: &[ProcessedRecording],
    found: &[Vec<Stroke>],
    texture: &TextureModel,
) -> Result<Vec<Observed>, NoOnset> {
    let observed = observe(recordings, found, texture);
    let strokes = observed.len();
    let all = |part: usize| sum(&observed, |o| o.recorded[part].iter().sum());
    if all(BEFORE) > 0.5 * all(WHOLE) {
        return Err(NoOnset::NotAtRest { strokes });
    }
    if is_louder(&observed) { Ok(observed) } else { Err(NoOnset::NoBurst { strokes }) }
}

/// Finds the onset that recordings have beside what `texture` renders.
///
/// # Errors
/// [`NoOnset`].
fn find_onset(
    recordings: &[ProcessedRecording],
    found: &[Vec<Stroke>],
    texture: &TextureModel,
) -> Result<Onset, NoOnset> {
    let observed = bursts(recordings, found, texture)?;
    let strokes = observed.len();
    let excess = |part: usize| -> [f64; 3] {
        [0, 1, 2].map(|band| sum(&observed, |o| o.recorded[part][band] - o.own[part][band]).max(0.0))
    };
    let (burst, late) = (excess(WHOLE), excess(LATE));
    let middle = |of: fn(&Stroke) -> f64| median(&observed.iter().map(|o| of(&o.stroke)).collect::<Vec<_>>());
    let slowest =
        |at: usize| recordings.iter().map(|r| thresholds(&r.signals().speed_m_s)[at]).fold(0.0, f64::max);
    let onset = Onset {
        origin: OnsetOrigin::Learned(strokes as u32),
        powers_m2_s4: burst,
        decay_s: DECAYS_S[0],
        force_n: middle(|stroke| stroke.force_n),
        force_exponent: 0.0,
        stuck_s: middle(|stroke| stroke.stuck_s).clamp(ARMED_AFTER_S, LONGEST_S),
        stuck_exponent: 0.0,
        rest_m_s: slowest(0),
        slide_m_s: slowest(1),
    };
    let onset = with_growth(onset, &observed, burst);
    let growth = sum(&observed, |o| onset.growth(o.stroke.force_n, o.stroke.stuck_s));
    let share = late.iter().sum::<f64>() / burst.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let mut onset = with_decay(onset, burst.map(|sum| sum / growth), share, texture.rate_hz());
    for _ in 0..CORRECTIONS {
        let Ok(texture) = texture.clone().with_layer(Arc::new(onset)) else { break };
        let with = observe(recordings, found, &texture);
        let made = |band: usize| sum(&with, |o| o.own[WHOLE][band]) - sum(&observed, |o| o.own[WHOLE][band]);
        onset.powers_m2_s4 = corrected(onset.powers_m2_s4, burst, [0, 1, 2].map(made));
    }
    onset.checked().map_err(|_| NoOnset::Range { strokes })
}

/// True if the strokes begin louder than the texture, over all bands and beyond chance (a t test of their levels).
fn is_louder(observed: &[Observed]) -> bool {
    let level_db = |o: &Observed| {
        let over = |band: usize| o.recorded[WHOLE][band] / o.own[WHOLE][band].max(f64::MIN_POSITIVE);
        10.0 * ([0, 1, 2].map(over).iter().sum::<f64>() / 3.0).max(f64::MIN_POSITIVE).log10()
    };
    let levels_db: Vec<f64> = observed.iter().map(level_db).collect();
    let error_db = standard_deviation(&levels_db) / (levels_db.len() as f64).sqrt();
    mean(&levels_db) >= LEAST_BURST_DB.max(LEAST_ERRORS * error_db)
}

fn sum(observed: &[Observed], of: impl Fn(&Observed) -> f64) -> f64 {
    observed.iter().map(of).sum()
}

/// The powers in proportion to what is `wanted` of each over what it `made`, by 10 at most; as they are where one is nothing.
fn corrected(powers: [f64; 3], wanted: [f64; 3], made: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|band| {
        powers[band] * if made[band] > 0.0 { (wanted[band] / made[band]).clamp(0.1, 10.0) } else { 1.0 }
    })
}

/// The strokes from rest of each recording, as many as are rendered.
fn enough_strokes(recordings: &[ProcessedRecording]) -> Result<Vec<Vec<Stroke>>, NoOnset> {
    let of = |recording: &ProcessedRecording| {
        let signals = recording.signals();
        let mut found = strokes(&signals.speed_m_s, &signals.force_normal_n, signals.rate_hz);
        found.truncate(MOST_STROKES);
        found
    };
    let found: Vec<Vec<Stroke>> = recordings.iter().map(of).collect();
    match found.iter().map(Vec::len).sum() {
        0 => Err(NoOnset::NoStrokes),
        strokes if strokes < FEWEST => Err(NoOnset::FewStrokes { strokes }),
        _ => Ok(found),
    }
}

/// The powers of strokes, and those of `texture` there. What lies far apart is rendered piece by piece.
fn observe(
    recordings: &[ProcessedRecording],
    strokes: &[Vec<Stroke>],
    texture: &TextureModel,
) -> Vec<Observed> {
    let near = |a: &Stroke, b: &Stroke| a.start / MOST_SAMPLES == b.start / MOST_SAMPLES;
    let of = |(recording, strokes): (&ProcessedRecording, &Vec<Stroke>)| -> Vec<Observed> {
        let signals = recording.signals();
        let slides = slides(&signals.speed_m_s, &signals.force_normal_n, signals.rate_hz);
        strokes.chunk_by(near).flat_map(|near| observe_near(signals, near, &slides, texture)).collect()
    };
    recordings.iter().zip(strokes).flat_map(of).collect()
}

/// A part of a motion.
fn trajectory(signals: &Signals, samples: Range<usize>) -> Trajectory {
    Trajectory {
        rate_hz: signals.rate_hz,
        speed_m_s: signals.speed_m_s[samples.clone()].to_vec(),
        force_n: signals.force_normal_n[samples].to_vec(),
    }
}

/// Those of strokes that are near one another. The recorded ones are scaled, band by band, by the power of the texture's slides over that of
/// the recorded ones: an onset is as much louder than its slide as it was, where the texture's level is off.
fn observe_near(
    signals: &Signals,
    strokes: &[Stroke],
    slides: &[bool],
    texture: &TextureModel,
) -> Vec<Observed> {
    let (rate_hz, second) = (signals.rate_hz, signals.rate_hz as usize);
    let [first, last] = [0, strokes.len() - 1].map(|k| strokes[k].start);
    let from = first.saturating_sub(second);
    let samples = from..(last + second).min(slides.len());
    let trajectory = trajectory(signals, samples.clone());
    let of = |vibration: &[f64]| {
        let starts = strokes.iter().map(|stroke| stroke.start - from);
        powers(vibration, starts, &slides[samples.clone()], rate_hz)
    };
    let (mut recorded, recorded_slide) = of(&signals.acceleration_m_s2[samples.clone()]);
    let mut own = vec![OnsetPowers::default(); strokes.len()];
    let mut own_slide = [0.0; 3];
    let add = |sum: &mut [f64; 3], more: &[f64; 3]| {
        sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more / SEEDS as f64);
    };
    for seed in 1..=SEEDS {
        let settings = SynthesisSettings { seed, lines_seed: seed, ..SynthesisSettings::default() };
        let Ok(vibration) = synthesise(texture, &trajectory, &settings) else { continue };
        let (rendered, slide) = of(&vibration);
        add(&mut own_slide, &slide);
        own.iter_mut().flatten().zip(rendered.iter().flatten()).for_each(|(own, more)| add(own, more));
    }
    let scale = |powers: &mut [f64; 3]| *powers = corrected(*powers, own_slide, recorded_slide);
    recorded.iter_mut().flatten().for_each(scale);
    let all = strokes.iter().cloned().zip(recorded).zip(own);
    all.map(|((stroke, recorded), own)| Observed { stroke, recorded, own }).collect()
}

/// The onset with the exponents of force and of time at rest under which the strokes are likeliest, were their powers exponential.
fn with_growth(onset: Onset, observed: &[Observed], burst: [f64; 3]) -> Onset {
    let level = |o: &Observed| {
        let of = |band: usize| {
            let all = o.recorded[WHOLE][band];
            (all - o.own[WHOLE][band]).max(LEAST_PART * all) / burst[band]
        };
        (0..3).filter(|band| burst[*band] > 0.0).map(of).sum::<f64>()
    };
    let tenth = |count: i32| f64::from(count) / 10.0;
    let candidates = (0..=20).flat_map(|force| (0..=10).map(move |stuck| (force, stuck)));
    let candidates = candidates.map(|(force, stuck)| Onset {
        force_exponent: tenth(force),
        stuck_exponent: tenth(stuck),
        ..onset
    });
    let unlikely = |onset: &Onset| {
        let growth = |o: &Observed| onset.growth(o.stroke.force_n, o.stroke.stuck_s).max(f64::MIN_POSITIVE);
        let logs = sum(observed, |o| growth(o).ln());
        sum(observed, |o| level(o) / growth(o)).ln() + logs / observed.len() as f64
    };
    candidates.min_by(|a, b| unlikely(a).total_cmp(&unlikely(b))).unwrap_or(onset)
}

/// The onset with the decay whose later half has most nearly `share` of its power, and the powers that give `wanted` in the first 100 ms.
fn with_decay(mut onset: Onset, wanted: [f64; 3], share: f64, rate_hz: f64) -> Onset {
    let mut best = (f64::INFINITY, onset);
    onset.powers_m2_s4 = wanted;
    for decay_s in DECAYS_S {
        onset.decay_s = decay_s;
        let mut off = 0.0;
        for _ in 0..ROUNDS {
            let [whole, late] = rendered(&onset, rate_hz);
            onset.powers_m2_s4 = corrected(onset.powers_m2_s4, wanted, whole);
            off = (late.iter().sum::<f64>() / whole.iter().sum::<f64>() / share.max(0.01)).ln().abs();
        }
        if off < best.0 {
            best = (off, onset);
        }
    }
    best.1
}

/// Mean powers of the first 100 ms of an onset that does not grow, and of the later half. Its voice hears of the speed 240 times a second.
fn rendered(onset: &Onset, rate_hz: f64) -> [[f64; 3]; 2] {
    let onset = Onset { force_exponent: 0.0, stuck_exponent: 0.0, ..*onset };
    let mut voice = onset.voice(RenderRates { rate_hz, models_hz: rate_hz }, 1);
    let [rest, slide, late] =
        [1.5 * ARMED_AFTER_S, 0.2, 1.0 / 240.0].map(|seconds| (seconds * rate_hz) as usize);
    let mut vibration = vec![0.0; RENDERED * (rest + slide)];
    for (stroke, vibration) in vibration.chunks_exact_mut(rest + slide).enumerate() {
        let (still, moving) = vibration.split_at_mut(rest + stroke * late / RENDERED);
        voice.set(0.0, &[onset.force_n]);
        voice.process(still);
        voice.set(2.0 * onset.slide_m_s, &[onset.force_n]);
        voice.process(moving);
    }
    let starts = (0..RENDERED).map(|stroke| stroke * (rest + slide) + rest);
    let (all, _) = powers(&vibration, starts, &[], rate_hz);
    let mean = |part: usize, band: usize| all.iter().map(|p| p[part][band]).sum::<f64>() / RENDERED as f64;
    [WHOLE, LATE].map(|part| [0, 1, 2].map(|band| mean(part, band)))
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
        let onset_of = |recording: &ProcessedRecording, texture: &TextureModel| {
            let recordings = std::slice::from_ref(recording);
            find_onset(recordings, &enough_strokes(recordings)?, texture)
        };
        let (recorded, texture) = take(40, Some(truth));
        let found = onset_of(&recorded, &texture).unwrap();
        assert_eq!(found.origin, OnsetOrigin::Learned(40));
        let energy =
            |onset: &Onset, band: usize| onset.decay_s * onset.growth(1.0, 0.2) * onset.powers_m2_s4[band];
        let off_db = |bands: std::ops::Range<usize>| {
            let of = |onset: &Onset| bands.clone().map(|band| energy(onset, band)).sum::<f64>();
            10.0 * (of(&found) / of(&truth)).log10()
        };
        assert!(off_db(0..3).abs() < 1.5, "{} dB, {found:?}", off_db(0..3));
        assert!(
            (0..3).all(|band| off_db(band..band + 1).abs() < 3.0),
            "{:?}, {found:?}",
            [0, 1, 2].map(|band| off_db(band..band + 1))
        );
        assert!((0.4..=1.6).contains(&found.force_exponent), "{found:?}");
        let late = onset_of(&after_rest(&recorded), &texture).unwrap();
        assert_eq!(late.origin, OnsetOrigin::Learned(40));
        assert!((0..3).all(|band| (late.powers_m2_s4[band] / found.powers_m2_s4[band]).log10().abs() < 0.1));
        let (plain, texture) = take(40, None);
        assert_eq!(onset_of(&plain, &texture), Err(NoOnset::NoBurst { strokes: 40 }));
        let (few, texture) = take(7, Some(truth));
        assert_eq!(onset_of(&few, &texture), Err(NoOnset::FewStrokes { strokes: 7 }));
    }

    /// The recording after a rest that is longer than what is rendered at once.
    fn after_rest(recording: &ProcessedRecording) -> ProcessedRecording {
        let after = |at_rest: f64, all: &[f64]| [&vec![at_rest; MOST_SAMPLES + 1000], all].concat();
        let signals = recording.signals();
        let late = Signals {
            rate_hz: signals.rate_hz,
            acceleration_m_s2: after(0.0, &signals.acceleration_m_s2),
            force_normal_n: after(1.0, &signals.force_normal_n),
            speed_m_s: after(0.0001, &signals.speed_m_s),
            ..Signals::default()
        };
        ProcessedRecording::new(late, recording.gesture(), recording.provenance().clone()).unwrap()
    }
}
