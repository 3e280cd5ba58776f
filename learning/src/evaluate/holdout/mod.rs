//! Hold-out evaluation of textures on recordings that they were not learned from, with floors and plain
//! baselines.
//!
//! The takes of each material are split in several ways ([`Split`]) into folds of a training and a test part.
//! Every [`Method`] learns from the training part, is rendered along the force and speed of the test part
//! with several seeds of noise, and is compared with it: [`Measures`]. Errors are paired by fold, then
//! averaged over a material's folds. The standard error is over materials, since the folds and seeds of one
//! material are not independent samples.

mod baselines;
mod contact;
mod folds;
mod measures;
mod methods;
mod summary;

pub use contact::{Contact, ContactResult, hold_out_contact};
use folds::Lengths;
pub use folds::{Fold, Split};
pub use measures::Measures;
use methods::Player;
pub use methods::{BASELINES, Method};
pub use summary::{BandMean, Holdout, Mean, Measure, MethodMean, SplitResult};

use super::study::StudyError;
use crate::learn::TextureMethod;
use crate::learn::texture::LearnTextureError;
use crate::processing::{ProcessingSettings, processed};
use crate::recording::{Gesture, ProcessedRecording, RecordingError};
use haptograph_signal::parallel;
use haptograph_surfaces::TextureModel;
use haptograph_surfaces::rendering::SynthesisError;
use measures::{Target, estimator_db, measured};
use std::collections::{BTreeMap, BTreeSet};

/// Settings of a hold-out evaluation.
#[derive(Debug, Clone, PartialEq)]
pub struct HoldoutSettings {
    /// Processing of sensor readings to physical quantities.
    pub processing: ProcessingSettings,
    /// The method that counts as the default.
    pub texture: TextureMethod,
    /// Number of noise seeds whose powers are averaged before the logarithm.
    pub seeds: u64,
    /// The first seed.
    pub seed: u64,
    /// Kinds of splits; those that need more takes than a material has are omitted.
    pub splits: Vec<Split>,
}

impl Default for HoldoutSettings {
    fn default() -> Self {
        Self {
            processing: ProcessingSettings::default(),
            texture: TextureMethod::default(),
            seeds: 16,
            seed: 1,
            splits: Split::ALL.to_vec(),
        }
    }
}

/// Error of a hold-out evaluation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum HoldoutError {
    #[error(transparent)]
    Study(#[from] StudyError),
    #[error("a part of {material} is not a recording: {source}")]
    Part { material: String, source: RecordingError },
    #[error("{method} cannot learn from a part of {material} ({split}): {reason}")]
    Learning { material: String, split: &'static str, method: &'static str, reason: String },
    #[error("cannot render what {method} learned from a part of {material}: {source}")]
    Synthesis { material: String, method: &'static str, source: SynthesisError },
    #[error(
        "{material}: its parts have {samples} samples, too few to estimate the power of any third octave"
    )]
    TooShort { material: String, samples: usize },
}

impl HoldoutError {
    fn learning(material: &str, split: Split, method: Method, error: &LearnTextureError) -> Self {
        Self::Learning {
            material: material.to_owned(),
            split: split.as_str(),
            method: method.as_str(),
            reason: error.to_string(),
        }
    }
}

/// The result of one fold, by method in the order of `Method::ALL`.
#[derive(Debug, Clone, PartialEq)]
pub struct FoldResult {
    /// Number of the material.
    pub material: usize,
    /// Kind of split.
    pub split: Split,
    /// Measures by method.
    pub measures: Vec<Measures>,
    /// Standard deviation of the test part's levels not explained by force and speed, dB.
    pub unexplained_level_db: Option<f64>,
    /// Log-spectral distance between two stationary takes with the lengths of the two parts, dB, and between
    /// one of them and the mean over all seeds.
    pub estimator_db: (f64, f64),
}

/// Part of the progress that the distances of stationary takes count for.
const CHANCE_PART: f64 = 0.1;

/// Evaluates the drags among `takes` by hold-out. `progress` receives the fraction done.
///
/// # Errors
/// [`HoldoutError`].
pub fn hold_out(
    takes: &[super::Take],
    settings: &HoldoutSettings,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Holdout, HoldoutError> {
    let recordings = by_material(takes, settings)?;
    let materials: Vec<String> = recordings.keys().cloned().collect();
    let mut jobs = vec![];
    for (number, (name, takes)) in recordings.iter().enumerate() {
        for split in &settings.splits {
            jobs.extend(split.folds(takes).into_iter().map(|fold| (number, name, *split, fold)));
        }
    }
    // Many folds have parts of the same lengths.
    let lengths: BTreeSet<Lengths> = jobs.iter().map(|(.., fold)| fold.lengths()).collect();
    let by_chance =
        parallel::map(parallel::cores(), &lengths, &|part| progress(CHANCE_PART * part), |lengths| {
            estimator_db(lengths, settings.seeds)
        });
    let by_chance: BTreeMap<&Lengths, (f64, f64)> = lengths.iter().zip(by_chance).collect();
    let work = |(number, name, split, fold): (usize, &String, Split, Fold)| {
        let estimator_db = by_chance.get(&fold.lengths()).copied().unwrap_or_default();
        let found = one_fold(number, name, split, &fold, settings);
        found.map(|found| FoldResult { estimator_db, ..found })
    };
    let progress = |part: f64| progress(CHANCE_PART + (1.0 - CHANCE_PART) * part);
    let results = parallel::try_map(parallel::cores(), jobs, &progress, work)?;
    Ok(Holdout { materials, seeds: settings.seeds, folds: results })
}

/// Errors of a texture along a processed drag of its rate, rendered from several seeds; and the log-spectral distance between two
/// stationary takes of that length, dB.
///
/// # Errors
/// A drag that the texture cannot be rendered along.
pub fn measure(
    texture: &TextureModel,
    drag: &ProcessedRecording,
    settings: &HoldoutSettings,
) -> Result<(Measures, f64), SynthesisError> {
    let length = (drag.rate_hz().to_bits(), vec![drag.samples()]);
    let (test, lengths) = (std::slice::from_ref(drag), [length.clone(), length]);
    let player = Player::Texture(Box::new(texture.clone()));
    let measures = measured(&player, &mut Target::new([test, test], &lengths), settings)?;
    Ok((measures, estimator_db(&lengths, settings.seeds).0))
}

/// Processed drags by material.
fn by_material(
    takes: &[super::Take],
    settings: &HoldoutSettings,
) -> Result<BTreeMap<String, Vec<ProcessedRecording>>, HoldoutError> {
    let mut drags: Vec<&super::Take> =
        takes.iter().filter(|take| take.recording.gesture() == Gesture::Drag).collect();
    drags.sort_by(|a, b| a.name.cmp(&b.name));
    if drags.is_empty() {
        return Err(StudyError::NoRecordings.into());
    }
    let mut found: BTreeMap<String, Vec<ProcessedRecording>> = BTreeMap::new();
    for take in drags {
        let recording = processed(&take.recording, &settings.processing).map_err(|source| {
            StudyError::Processing { recording: take.name.to_string(), source: Box::new(source) }
        })?;
        found.entry(take.name.material.clone()).or_default().push(recording);
    }
    Ok(found)
}

fn one_fold(
    number: usize,
    material: &str,
    split: Split,
    fold: &Fold,
    settings: &HoldoutSettings,
) -> Result<FoldResult, HoldoutError> {
    let part = |source| HoldoutError::Part { material: material.to_owned(), source };
    let train = fold.train.recordings().map_err(part)?;
    let test = fold.test.recordings().map_err(part)?;
    let mut target = Target::new([&train, &test], &fold.lengths());
    if target.estimator.bands.is_empty() {
        return Err(HoldoutError::TooShort {
            material: material.to_owned(),
            samples: test.iter().map(ProcessedRecording::samples).sum(),
        });
    }
    let mut measures = vec![];
    for method in Method::ALL {
        let Some(player) = Player::learned(method, &train, &settings.texture)
            .map_err(|error| HoldoutError::learning(material, split, method, &error))?
        else {
            measures.push(target.floor());
            continue;
        };
        let found = measured(&player, &mut target, settings).map_err(|source| HoldoutError::Synthesis {
            material: material.to_owned(),
            method: method.as_str(),
            source,
        })?;
        measures.push(found);
    }
    Ok(FoldResult {
        material: number,
        split,
        measures,
        unexplained_level_db: target.unexplained_level_db(),
        estimator_db: (0.0, 0.0),
    })
}

#[cfg(test)]
mod tests;
