//! Hold-out evaluation of taps, friction and stiffness at other speeds and forces than those of the training
//! data, with plain alternatives.
//!
//! The recordings of a material are split by impact speed, by sliding speed and by normal force. The model
//! learned from one side of a split predicts the other side.

use super::super::Take;
use super::Mean;
use crate::learn::TextureMethod;
use crate::learn::breakaway::learn_with_onset;
use crate::learn::friction::{FrictionFit, FrictionSettings, Sliding, fit_friction, sliding};
use crate::learn::stiffness::{StiffnessSettings, fit_stiffness, learn_stiffness};
use crate::learn::taps::{TapSettings, learn_taps};
use crate::metrics::onset_levels_db;
use crate::processing::{ProcessingSettings, processed};
use crate::recording::{AnyRecording, Gesture, ProcessedRecording};
use haptograph_signal::statistics::{Line, mean, median};
use haptograph_surfaces::rendering::{SynthesisSettings, synthesise};
use haptograph_surfaces::{Tap, Taps, TextureModel};
use std::collections::BTreeSet;
use std::ops::Range;

/// Force from which a press counts as contact, N.
const TOUCH_N: f64 = 0.1;
/// Renderings over which the levels of onsets are averaged.
const ONSET_SEEDS: u64 = 4;

/// The predicted quantity of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Contact {
    /// Transient of a tap: RMS of the error over the RMS of the recording, percent.
    TapShape,
    /// Energy of a tap: magnitude of the error, dB.
    TapLevel,
    /// Tangential force of circles: RMS of the error over the RMS of the recorded force, percent.
    CircleFriction,
    /// Tangential force of drags, likewise.
    DragFriction,
    /// Force of a press by indentation, with the rest position of the spring as a free parameter: RMS of the
    /// error over the standard deviation of the force, percent.
    Stiffness,
    /// Level of the first 100 ms of strokes from rest over their slides, of drags: mean magnitude of the error over three bands, dB.
    Onset,
}

impl Contact {
    /// All quantities.
    pub const ALL: [Self; 6] = [
        Self::TapShape,
        Self::TapLevel,
        Self::CircleFriction,
        Self::DragFriction,
        Self::Stiffness,
        Self::Onset,
    ];

    /// Name in files; it ends in the unit of the errors.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::TapShape => "tap_shape_percent",
            Self::TapLevel => "tap_level_db",
            Self::CircleFriction => "circle_friction_percent",
            Self::DragFriction => "drag_friction_percent",
            Self::Stiffness => "stiffness_percent",
            Self::Onset => "onset_db",
        }
    }

    /// Title in tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::TapShape => "taps, shape (%)",
            Self::TapLevel => "taps, level (dB)",
            Self::CircleFriction => "friction, circles (%)",
            Self::DragFriction => "friction, drags (%)",
            Self::Stiffness => "stiffness (%)",
            Self::Onset => "onset, level (dB)",
        }
    }

    /// Prediction methods; the first is the one used by `learn`.
    pub fn methods(self) -> &'static [&'static str] {
        match self {
            Self::TapShape | Self::TapLevel => {
                &["learned", "plain: nearest tap, scaled by speed", "plain: mean tap"]
            }
            Self::CircleFriction => &["learned", "plain: mean ratio of forces"],
            Self::DragFriction => {
                &["learned", "plain: mean ratio of forces", "thesis's: line with an intercept"]
            }
            Self::Stiffness => &["learned", "plain: one line through all"],
            Self::Onset => &["learned", "plain: no onset"],
        }
    }

    /// Indices of the plain methods.
    fn plain(self) -> Range<usize> {
        match self {
            Self::TapShape | Self::TapLevel => 1..3,
            Self::CircleFriction | Self::DragFriction | Self::Stiffness | Self::Onset => 1..2,
        }
    }
}

/// Errors in one fold.
#[derive(Debug, Clone, PartialEq)]
struct Fold {
    material: usize,
    contact: Contact,
    split: &'static str,
    /// One error for each method, in the order of [`Contact::methods`].
    errors: Vec<f64>,
}

/// The errors of one quantity at one split, over all materials that have it.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactResult {
    /// The predicted quantity.
    pub contact: Contact,
    /// The tested part.
    pub split: &'static str,
    /// Names of the materials with such recordings.
    pub materials: Vec<String>,
    /// Errors of each material by method, in the order of [`Contact::methods`].
    pub by_material: Vec<Vec<f64>>,
    /// Means over materials by method.
    pub means: Vec<Mean>,
    /// True if the method used by `learn` is worse than a plain alternative.
    pub loses: bool,
}

/// Evaluates all circles, drags, taps and presses by hold-out; data that cannot be learned from have no
/// result.
pub fn hold_out_contact(takes: &[Take], processing: &ProcessingSettings) -> Vec<ContactResult> {
    let names: BTreeSet<&String> = takes.iter().map(|take| &take.name.material).collect();
    let names: Vec<&String> = names.into_iter().collect();
    let mut folds = vec![];
    for (material, name) in names.iter().enumerate() {
        let of = |gesture: Gesture| -> Vec<&AnyRecording> {
            let own = takes.iter().filter(|take| take.name.material == **name);
            own.map(|take| &take.recording).filter(|recording| recording.gesture() == gesture).collect()
        };
        let mut add = |contact: Contact, split: &'static str, errors: Option<Vec<f64>>| {
            folds.extend(errors.map(|errors| Fold { material, contact, split, errors }));
        };
        taps(&of(Gesture::Tap), processing, &mut add);
        friction(&of(Gesture::Circle), processing, &mut |split, train, test| {
            let errors = friction_errors(train, test, &[FrictionFit::ThroughOrigin]);
            add(Contact::CircleFriction, split, errors);
        });
        friction(&of(Gesture::Drag), processing, &mut |split, train, test| {
            let errors =
                friction_errors(train, test, &[FrictionFit::RobustThroughOrigin, FrictionFit::Robust]);
            add(Contact::DragFriction, split, errors);
        });
        stiffness(&of(Gesture::Press), processing, &mut add);
        onsets(&of(Gesture::Drag), processing, &mut add);
    }
    summed_up(&names, &folds)
}

fn summed_up(names: &[&String], folds: &[Fold]) -> Vec<ContactResult> {
    let mut kinds: Vec<(Contact, &'static str)> = vec![];
    for fold in folds {
        if !kinds.contains(&(fold.contact, fold.split)) {
            kinds.push((fold.contact, fold.split));
        }
    }
    kinds.sort_by_key(|(contact, _)| *contact);
    let result = |(contact, split): (Contact, &'static str)| {
        let own: Vec<&Fold> =
            folds.iter().filter(|fold| (fold.contact, fold.split) == (contact, split)).collect();
        let materials: BTreeSet<usize> = own.iter().map(|fold| fold.material).collect();
        let of = |method: usize, material: usize| {
            let folds = own.iter().filter(|fold| fold.material == material);
            mean(&folds.map(|fold| fold.errors[method]).collect::<Vec<_>>())
        };
        let by_material: Vec<Vec<f64>> = (0..contact.methods().len())
            .map(|method| materials.iter().map(|material| of(method, *material)).collect())
            .collect();
        let means: Vec<Mean> = by_material.iter().map(|values| Mean::of(values)).collect();
        ContactResult {
            contact,
            split,
            materials: materials.iter().map(|material| names[*material].clone()).collect(),
            loses: means[contact.plain()].iter().any(|plain| plain.mean < means[0].mean),
            by_material,
            means,
        }
    };
    kinds.into_iter().map(result).collect()
}

/// Three folds by speed: every second tap from the taps between, the faster half from the slower, and the
/// slower from the faster.
fn taps(
    recordings: &[&AnyRecording],
    processing: &ProcessingSettings,
    add: &mut dyn FnMut(Contact, &'static str, Option<Vec<f64>>),
) {
    let Ok((taps, _)) = learn_taps(recordings, processing, &TapSettings::default()) else {
        return;
    };
    let all = taps.taps();
    // The slowest and the fastest tap always belong to the training data, so that all others lie between.
    let between = |rank: usize| rank % 2 == 1 && rank + 1 < all.len();
    let half = all.len() / 2;
    let splits: [(&'static str, &dyn Fn(usize) -> bool); 3] =
        [("between", &between), ("faster", &|rank| rank >= half), ("slower", &|rank| rank < half)];
    for (split, tested) in splits {
        let part = |test: bool| -> Vec<Tap> {
            let ranks = (0..all.len()).filter(|rank| tested(*rank) == test);
            ranks.map(|rank| all[rank].clone()).collect()
        };
        let (train, test) = (part(false), part(true));
        let errors = (!test.is_empty())
            .then(|| Taps::new(taps.rate_hz(), train).ok())
            .flatten()
            .map(|train| tap_errors(&train, &test));
        let (shape, level) = errors.unzip();
        add(Contact::TapShape, split, shape);
        add(Contact::TapLevel, split, level);
    }
}

/// Errors of shape and level by method, as means over the tested taps.
fn tap_errors(train: &Taps, test: &[Tap]) -> (Vec<f64>, Vec<f64>) {
    let energy = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    let of = |tap: &Tap, predicted: &[f64]| {
        let recorded = &tap.acceleration_m_s2;
        let error: Vec<f64> = predicted.iter().zip(recorded).map(|(p, r)| p - r).collect();
        let shape = 100.0 * (energy(&error) / energy(recorded)).sqrt();
        (shape, 10.0 * (energy(predicted) / energy(recorded)).log10().abs())
    };
    let methods: [&dyn Fn(f64) -> Vec<f64>; 3] = [
        &|speed_m_s| {
            let mix = train.mix(speed_m_s);
            (0..train.length()).map(|i| train.sample(&mix, i)).collect()
        },
        &|speed_m_s| {
            let off = |tap: &&Tap| (tap.speed_m_s - speed_m_s).abs();
            let nearest = train.taps().iter().min_by(|a, b| off(a).total_cmp(&off(b)));
            nearest.map_or_else(Vec::new, |tap| {
                let scaled = tap.acceleration_m_s2.iter();
                scaled.map(|a| a * speed_m_s / tap.speed_m_s).collect()
            })
        },
        &|_| {
            let at =
                |i: usize| mean(&train.taps().iter().map(|t| t.acceleration_m_s2[i]).collect::<Vec<_>>());
            (0..train.length()).map(at).collect()
        },
    ];
    let errors = methods.map(|method| {
        let found = test.iter().map(|tap| of(tap, &method(tap.speed_m_s)));
        let (shape, level): (Vec<f64>, Vec<f64>) = found.filter(|(_, level)| level.is_finite()).unzip();
        (mean(&shape), mean(&level))
    });
    errors.into_iter().unzip()
}

/// Called with the name of the tested part, the training data and the test data.
type OnSplit<'a> = dyn FnMut(&'static str, &[Sliding], &[Sliding]) + 'a;
/// A split: the names of the parts above and below the median, and the measure.
type Split = (&'static str, &'static str, fn(&Sliding) -> f64);

/// Folds of the sliding data above and below the median force, and above and below the median speed.
fn friction(recordings: &[&AnyRecording], processing: &ProcessingSettings, fold: &mut OnSplit<'_>) {
    for recording in recordings {
        let Ok(moments) = sliding(recording, processing, &FrictionSettings::default()) else {
            continue;
        };
        if moments.is_empty() {
            continue;
        }
        let splits: [Split; 2] =
            [("harder", "lighter", |m| m.normal_n), ("faster", "slower", |m| m.speed_m_s)];
        for (more, less, of) in splits {
            let middle = median(&moments.iter().map(of).collect::<Vec<_>>());
            let (above, below): (Vec<Sliding>, Vec<Sliding>) = moments.iter().partition(|m| of(m) > middle);
            fold(more, &below, &above);
            fold(less, &above, &below);
        }
    }
}

/// Errors of the first fit, the mean ratio, and the other fits.
fn friction_errors(train: &[Sliding], test: &[Sliding], fits: &[FrictionFit]) -> Option<Vec<f64>> {
    let points: Vec<(f64, f64)> = train.iter().map(|m| (m.normal_n, m.tangential_n)).collect();
    let ratios: Vec<f64> = points.iter().map(|(normal, tangential)| tangential / normal).collect();
    let slope = |fit: &FrictionFit| Some(fit_friction(points.clone(), *fit)?.line.slope);
    let mut coefficients = fits.iter().map(slope).collect::<Option<Vec<f64>>>()?;
    coefficients.insert(1, mean(&ratios));
    let square = |value: &dyn Fn(&Sliding) -> f64| test.iter().map(|m| value(m).powi(2)).sum::<f64>();
    let recorded = square(&|m| m.tangential_n);
    // At a single speed or force there is nothing beyond the median.
    if recorded == 0.0 {
        return None;
    }
    let error = |mu: f64| 100.0 * (square(&|m| m.tangential_n - mu * m.normal_n) / recorded).sqrt();
    Some(coefficients.into_iter().map(error).collect())
}

/// Folds above and below the median force of a press, and for another press.
fn stiffness(
    recordings: &[&AnyRecording],
    processing: &ProcessingSettings,
    add: &mut dyn FnMut(Contact, &'static str, Option<Vec<f64>>),
) {
    let settings = StiffnessSettings::default();
    let curves: Vec<Vec<(f64, f64)>> = recordings
        .iter()
        .filter_map(|recording| match recording {
            AnyRecording::Raw(raw) => Some(learn_stiffness(raw, processing, &settings).ok()?.1.curve),
            AnyRecording::Processed(_) => None,
        })
        .collect();
    let between = |curve: &[(f64, f64)], from_n: f64, to_n: f64| -> Vec<(f64, f64)> {
        let inside = curve.iter().filter(|(_, force)| (from_n..=to_n).contains(force));
        inside.copied().collect()
    };
    let most = f64::INFINITY;
    for (number, curve) in curves.iter().enumerate() {
        let next = &curves[(number + 1) % curves.len()];
        for (split, train, test) in [
            ("harder", between(curve, TOUCH_N, settings.to_n), between(curve, settings.to_n, most)),
            ("lighter", between(curve, settings.from_n, most), between(curve, TOUCH_N, settings.from_n)),
            ("another", between(curve, TOUCH_N, most), between(next, TOUCH_N, most)),
        ] {
            if split != "another" || curves.len() > 1 {
                add(Contact::Stiffness, split, stiffness_errors(train, &test, &settings));
            }
        }
    }
}

fn stiffness_errors(
    train: Vec<(f64, f64)>,
    test: &[(f64, f64)],
    settings: &StiffnessSettings,
) -> Option<Vec<f64>> {
    let plain = Line::fit(&train)?.slope;
    let learned = fit_stiffness(train, settings).ok()?.line.slope;
    let deviation = |values: &[f64]| {
        let middle = mean(values);
        values.iter().map(|x| (x - middle).powi(2)).sum::<f64>().sqrt()
    };
    let recorded = deviation(&test.iter().map(|(_, force)| *force).collect::<Vec<_>>());
    let error = |slope: f64| {
        let left: Vec<f64> = test.iter().map(|(depth, force)| force - slope * depth).collect();
        100.0 * deviation(&left) / recorded
    };
    (recorded > 0.0).then(|| vec![error(learned), error(plain)])
}

/// Each drag with strokes from rest against the texture and the onset of the others; nothing without several such drags.
fn onsets(
    recordings: &[&AnyRecording],
    processing: &ProcessingSettings,
    add: &mut dyn FnMut(Contact, &'static str, Option<Vec<f64>>),
) {
    let levels_of = |recording: &ProcessedRecording, vibration: &[f64]| {
        let signals = recording.signals();
        onset_levels_db(vibration, &signals.speed_m_s, &signals.force_normal_n, signals.rate_hz)
    };
    let drags = recordings.iter().filter_map(|recording| processed(recording, processing).ok());
    let drags: Vec<(ProcessedRecording, [f64; 3])> = drags
        .filter_map(|drag| levels_of(&drag, &drag.signals().acceleration_m_s2).map(|(_, db)| (drag, db)))
        .collect();
    for (number, (test, recorded_db)) in drags.iter().enumerate() {
        let others = drags.iter().enumerate().filter(|(other, _)| *other != number);
        let train: Vec<ProcessedRecording> = others.map(|(_, (drag, _))| drag.clone()).collect();
        let method = TextureMethod::default();
        let Some((plain, _)) = method.learn(&train, &|_| ()).ok().filter(|_| !train.is_empty()) else {
            continue;
        };
        let with = learn_with_onset(&method, &train, &|_| ()).ok().filter(|with| with.onset.is_ok());
        let Some(with) = with else { continue };
        let error = |texture: &TextureModel| {
            let of = |seed| {
                let settings = SynthesisSettings { seed, lines_seed: seed, ..SynthesisSettings::default() };
                levels_of(test, &synthesise(texture, &test.trajectory(), &settings).ok()?).map(|(_, db)| db)
            };
            let rendered = (1..=ONSET_SEEDS).map(of).collect::<Option<Vec<_>>>()?;
            let off = |band: usize| {
                let levels: Vec<f64> = rendered.iter().map(|db| db[band]).collect();
                (mean(&levels) - recorded_db[band]).abs()
            };
            Some(mean(&[0, 1, 2].map(off)))
        };
        add(Contact::Onset, "another take", [error(&with.texture), error(&plain)].into_iter().collect());
    }
}

#[cfg(test)]
mod tests;
