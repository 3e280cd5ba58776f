//! A whole evaluation of recordings named `<material>.<person>.<take>`: learning, comparison, map.
//!
//! For every material and person, the first take is learned from. The person with the most takes (the first
//! by name among equals) is the expert; the expert's other takes are the tests.

use super::conditions::{ConditionLoss, centre_of, condition_losses};
use super::map::{MapError, MapSettings, PerceptualMap, perceptual_map};
use super::tables::{DifferenceTable, Reference, TableError, TableSettings};
use crate::learn::TextureMethod;
use crate::learn::texture::{LearnTextureError, TextureReport};
use crate::metrics::ErrorStatistics;
use crate::parts::Shard;
use crate::processing::{ProcessingError, ProcessingSettings, processed};
use crate::recording::{AnyRecording, Gesture, ProcessedRecording};
use haptograph_signal::parallel;
use haptograph_surfaces::Origin;
use haptograph_surfaces::TextureModel;
use haptograph_surfaces::rendering::SynthesisError;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;

/// Material, person and take of a recording, from its file name.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct RecordingName {
    /// The material.
    pub material: String,
    /// The person.
    pub person: String,
    /// The take.
    pub take: String,
}

impl RecordingName {
    /// Parses a file name such as `canvas.anna.1.npz`; `None` if it does not have this form. Only the last
    /// part is the extension, so a take may contain dots.
    pub fn parse(file_name: &str) -> Option<Self> {
        let mut parts = file_name.splitn(3, '.');
        let (material, person, rest) = (parts.next()?, parts.next()?, parts.next()?);
        let (take, _extension) = rest.rsplit_once('.')?;
        let named = ![material, person, take].iter().any(|part| part.is_empty());
        named.then(|| Self {
            material: material.to_owned(),
            person: person.to_owned(),
            take: take.to_owned(),
        })
    }
}

/// A recording with its name.
#[derive(Debug, Clone)]
pub struct Take {
    /// Name of the recording.
    pub name: RecordingName,
    /// The recording. Only drags are used.
    pub recording: AnyRecording,
}

/// A recording of a study that need not be in memory all the time.
pub trait TakeSource: Debug + Sync {
    /// Name of the recording.
    fn name(&self) -> &RecordingName;

    /// The hand's movement.
    fn gesture(&self) -> Gesture;

    /// The origin.
    fn origin(&self) -> Origin;

    /// The recording, from memory or wherever it lies.
    ///
    /// # Errors
    /// A description of the error, in one sentence.
    fn load(&self) -> Result<Cow<'_, AnyRecording>, String>;
}

impl TakeSource for Take {
    fn name(&self) -> &RecordingName {
        &self.name
    }

    fn gesture(&self) -> Gesture {
        self.recording.gesture()
    }

    fn origin(&self) -> Origin {
        self.recording.provenance().origin
    }

    fn load(&self) -> Result<Cow<'_, AnyRecording>, String> {
        Ok(Cow::Borrowed(&self.recording))
    }
}

/// Settings of a study.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StudySettings {
    /// Processing of sensor readings to physical quantities.
    pub processing: ProcessingSettings,
    /// Method of learning textures.
    pub texture: TextureMethod,
    /// Settings of the comparison with recordings.
    pub table: TableSettings,
    /// Settings of the comparison of textures with each other.
    pub map: MapSettings,
}

/// Result of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Names of the materials.
    pub materials: Vec<String>,
    /// Names of the people.
    pub people: Vec<String>,
    /// The person whose takes are the tests.
    pub expert: String,
    /// The learned textures; empty if the tables are merged from parts.
    pub learned: Vec<Learned>,
    /// The expert's textures against the tests of all materials (Table 2.1).
    pub materials_table: DifferenceTable,
    /// Each person's textures against the tests of the same material (Table 2.2), if there are several
    /// people.
    pub people_table: Option<DifferenceTable>,
    /// All textures on a map (Fig. 2.11), if there are at least three.
    pub map: Option<PerceptualMap>,
    /// What the expert's textures lose that respond to less than force and speed (section 4.5.3).
    pub losses: Vec<ConditionLoss>,
    /// The centre of the expert's textures (section 4.5.2): speed, m/s, and force, N. `None` if they have no measured models.
    pub centre: Option<(f64, f64)>,
}

/// A learned texture.
#[derive(Debug, Clone, PartialEq)]
pub struct Learned {
    /// Name of the recording that it was learned from.
    pub name: RecordingName,
    /// The texture.
    pub texture: TextureModel,
    /// Report of the learning.
    pub report: TextureReport,
}

/// Error of a study.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum StudyError {
    #[error("found no drag recording named <material>.<person>.<take>.<extension>")]
    NoRecordings,
    #[error(
        "{material} has no test: {person} needs at least two takes of it, one to learn from and another to compare with"
    )]
    NoTest { material: String, person: String },
    #[error("cannot read {recording} again: {message}")]
    Loading { recording: String, message: String },
    #[error("cannot process {recording}: {source}")]
    Processing { recording: String, source: Box<ProcessingError> },
    #[error("cannot learn a texture from {recording}: {source}")]
    Learning { recording: String, source: Box<LearnTextureError> },
    #[error(transparent)]
    Table(#[from] TableError),
    #[error(transparent)]
    Map(#[from] MapError),
    #[error("cannot render a texture: {0}")]
    Synthesis(#[from] SynthesisError),
}

impl std::fmt::Display for RecordingName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}.{}", self.material, self.person, self.take)
    }
}

/// The items of a study: the textures to learn and compare, numbered by material and person.
#[derive(Debug)]
pub struct Study<'t> {
    expert: String,
    firsts: Vec<&'t dyn TakeSource>,
    /// One recording for each material.
    tests: Vec<&'t dyn TakeSource>,
}

/// A learned texture with the window errors of its renderings along the tests: the expert's along those of
/// all materials, another person's along those of the same material.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// Number of the item in the study, from 0.
    pub number: usize,
    /// Name of the recording that it was learned from.
    pub name: RecordingName,
    /// The texture.
    pub texture: TextureModel,
    /// Errors by material, one per test.
    pub errors: BTreeMap<String, Vec<ErrorStatistics>>,
}

impl<'t> Study<'t> {
    /// The study of a set of recordings.
    ///
    /// # Errors
    /// [`StudyError::NoRecordings`] and [`StudyError::NoTest`].
    pub fn of(takes: &'t [impl TakeSource]) -> Result<Self, StudyError> {
        let drags = takes.iter().filter(|take| take.gesture() == Gesture::Drag);
        let mut drags: Vec<&dyn TakeSource> = drags.map(|take| take as &dyn TakeSource).collect();
        drags.sort_by(|a, b| a.name().cmp(b.name()));
        let expert = expert(&drags).ok_or(StudyError::NoRecordings)?;
        let materials: BTreeSet<&str> = drags.iter().map(|take| &*take.name().material).collect();
        let mut firsts: BTreeMap<(&str, &str), &dyn TakeSource> = BTreeMap::new();
        let mut tests: Vec<&dyn TakeSource> = vec![];
        for take in &drags {
            let name = take.name();
            match firsts.entry((&*name.material, &*name.person)) {
                Entry::Vacant(first) => {
                    first.insert(*take);
                }
                Entry::Occupied(_) if name.person == expert => tests.push(*take),
                Entry::Occupied(_) => {}
            }
        }
        let tested: BTreeSet<&str> = tests.iter().map(|take| &*take.name().material).collect();
        if let Some(material) = materials.difference(&tested).next() {
            return Err(StudyError::NoTest { material: (*material).to_owned(), person: expert });
        }
        Ok(Self { expert, firsts: firsts.into_values().collect(), tests })
    }

    /// Learns and compares all items on all cores, and computes tables and map. `progress` receives the fraction done.
    ///
    /// # Errors
    /// As [`Self::compare`] and [`conclude`].
    pub fn evaluate(
        &self,
        settings: &StudySettings,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Evaluation, StudyError> {
        let found = self.compare(None, settings, &|part| progress(0.85 * part))?;
        let (learned, compared): (Vec<Learned>, Vec<Compared>) = found.into_iter().unzip();
        let evaluation = conclude(self.expert(), &compared, settings, &|part| progress(0.85 + 0.15 * part))?;
        Ok(Evaluation { learned, ..evaluation })
    }

    /// The person whose takes are the tests.
    pub(crate) fn expert(&self) -> &str {
        &self.expert
    }

    /// Number of items.
    pub(crate) fn items(&self) -> usize {
        self.firsts.len()
    }

    /// Learns and compares the items of a shard, or all items, in order. `progress` receives the fraction
    /// done. A recording is in memory while it is learned from or compared with: one a core at a time.
    ///
    /// # Errors
    /// The first error of an item, or of a test.
    pub fn compare(
        &self,
        shard: Option<Shard>,
        settings: &StudySettings,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Vec<(Learned, Compared)>, StudyError> {
        let items: Vec<(usize, &dyn TakeSource)> = { self.firsts.iter().copied().enumerate() }
            .filter(|(number, _)| shard.is_none_or(|shard| shard.has(*number as u64)))
            .collect();
        // The first part of the work is learning, the rest comparing.
        let part = items.len() as f64 / (items.len() + self.tests.len()) as f64;
        let learned = parallel::try_map(
            parallel::cores(),
            &items,
            &|learned| progress(part * learned),
            |(_, take)| learn_one(*take, settings),
        )?;
        // The expert's textures are played along the tests of all materials, those of others along the same material's.
        let is_along = |row: &Learned, test: &RecordingName| {
            row.name.person == self.expert || row.name.material == test.material
        };
        let mut tests: Vec<(usize, &dyn TakeSource)> = vec![];
        for take in &self.tests {
            let of_material = tests.last().filter(|(_, last)| last.name().material == take.name().material);
            let number = of_material.map_or(0, |(number, _)| number + 1);
            tests.push((number, *take));
        }
        let along = |(number, take): &(usize, &dyn TakeSource)| {
            let rows: Vec<_> = learned.iter().map(|row| is_along(row, take.name())).collect();
            let reference = match rows.contains(&true) {
                true => Some(Reference::new(
                    &take.name().material,
                    *number,
                    &process_one(*take, settings)?,
                    &settings.table,
                )?),
                false => None,
            };
            let errors = learned.iter().zip(rows).map(|(row, is_along)| {
                let reference = reference.as_ref().filter(|_| is_along);
                let errors = reference
                    .map(|reference| reference.errors(&row.name.to_string(), &row.texture, &settings.table));
                errors.transpose().map_err(StudyError::Table)
            });
            errors.collect::<Result<Vec<_>, StudyError>>()
        };
        let compared = |compared: f64| progress(part + (1.0 - part) * compared);
        let found = parallel::try_map(parallel::cores(), &tests, &compared, along)?;
        let compared = |(row, ((number, _), learned)): (usize, (&(usize, &dyn TakeSource), &Learned))| {
            let mut errors: BTreeMap<String, Vec<ErrorStatistics>> = BTreeMap::new();
            for ((_, test), found) in tests.iter().zip(&found) {
                if let Some(statistics) = found[row] {
                    let of_material = errors.entry(test.name().material.clone()).or_default();
                    of_material.push(statistics);
                }
            }
            Compared { number: *number, name: learned.name.clone(), texture: learned.texture.clone(), errors }
        };
        let compared: Vec<Compared> = items.iter().zip(&learned).enumerate().map(compared).collect();
        Ok(learned.into_iter().zip(compared).collect())
    }
}

/// Computes tables and map of all items of a study, given in order. [`Evaluation::learned`] stays empty,
/// since the items do not include the recordings.
///
/// # Errors
/// [`StudyError::Map`] and [`StudyError::Synthesis`].
pub fn conclude(
    expert: &str,
    compared: &[Compared],
    settings: &StudySettings,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Evaluation, StudyError> {
    let names = |part: fn(&RecordingName) -> &String| -> Vec<String> {
        let names: BTreeSet<&String> = compared.iter().map(|item| part(&item.name)).collect();
        names.into_iter().cloned().collect()
    };
    let (materials, people) = (names(|name| &name.material), names(|name| &name.person));
    let items: BTreeMap<(&str, &str), &Compared> =
        compared.iter().map(|item| ((&*item.name.material, &*item.name.person), item)).collect();
    let table = |rows: &[String], of: &dyn Fn(&str, &str) -> Option<Vec<ErrorStatistics>>| {
        let row = |row: &String| materials.iter().map(|column| of(row, column)).collect();
        let errors = rows.iter().map(row).collect();
        DifferenceTable::of_errors(rows.to_vec(), materials.clone(), errors, settings.table.pooling)
    };
    let cell = |material: &str, person: &str, column: &str| {
        items.get(&(material, person))?.errors.get(column).cloned()
    };
    let materials_table = table(&materials, &|row, column| cell(row, expert, column));
    let people_table = (people.len() > 1).then(|| table(&people, &|row, column| cell(column, row, column)));
    let named: Vec<(String, String, &TextureModel)> = compared
        .iter()
        .map(|item| (item.name.to_string(), item.name.material.clone(), &item.texture))
        .collect();
    let map = match named.len() {
        0..3 => None,
        _ => Some(perceptual_map(&named, &settings.map, progress)?),
    };
    let own = materials.iter().filter_map(|material| {
        let item = items.get(&(material.as_str(), expert))?;
        Some((material.as_str(), &item.texture))
    });
    let own: Vec<(&str, &TextureModel)> = own.collect();
    let losses = condition_losses(&own);
    let centre = centre_of(own.iter().map(|(_, texture)| *texture));
    progress(1.0);
    Ok(Evaluation {
        losses,
        centre,
        materials,
        people,
        expert: expert.to_owned(),
        learned: vec![],
        materials_table,
        people_table,
        map,
    })
}

/// The person with the most takes.
fn expert(drags: &[&dyn TakeSource]) -> Option<String> {
    let mut counts: BTreeMap<&String, usize> = BTreeMap::new();
    drags.iter().for_each(|take| *counts.entry(&take.name().person).or_default() += 1);
    let most = counts.values().copied().max()?;
    counts.into_iter().find(|(_, count)| *count == most).map(|(person, _)| person.clone())
}

fn process_one(take: &dyn TakeSource, settings: &StudySettings) -> Result<ProcessedRecording, StudyError> {
    let recording =
        take.load().map_err(|message| StudyError::Loading { recording: take.name().to_string(), message })?;
    processed(&recording, &settings.processing).map_err(|source| StudyError::Processing {
        recording: take.name().to_string(),
        source: Box::new(source),
    })
}

fn learn_one(take: &dyn TakeSource, settings: &StudySettings) -> Result<Learned, StudyError> {
    let recording = process_one(take, settings)?;
    let found = settings.texture.learn(std::slice::from_ref(&recording), &|_| ());
    let (texture, report) = found.map_err(|source| StudyError::Learning {
        recording: take.name().to_string(),
        source: Box::new(source),
    })?;
    Ok(Learned { name: take.name().clone(), texture, report })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::{StudyHead, StudyPart, StudyPartError};
    use crate::metrics::Pooling;
    use crate::parts::PartsError;
    use crate::recording::tests::synthetic::drag;
    use haptograph_surfaces::rendering::RandomWalk;

    #[test]
    fn names_are_read_from_file_names() {
        let name = RecordingName::parse("rough plastic.S1.take.2.npz").unwrap();
        assert_eq!((&*name.material, &*name.person, &*name.take), ("rough plastic", "S1", "take.2"));
        for bad in ["canvas", "canvas.anna", "canvas.anna.1", "canvas..1.npz", ".anna.1.npz"] {
            assert_eq!(RecordingName::parse(bad), None, "{bad}");
        }
    }

    fn take(material: usize, person: &str, number: u64) -> Take {
        let steps: Vec<_> =
            (0..9).map(|i| (0.12, 0.05 + 0.05 * ((i * 2) % 3) as f64, 0.5 + 0.5 * (i / 3) as f64)).collect();
        let seed = number + 10 * material as u64 + 100 * person.len() as u64;
        let recording = drag(&steps, 0.3, seed, |speed, force| {
            let angle = 0.3 + 0.5 * material as f64;
            (vec![-1.8 * angle.cos(), 0.81], (1.0 + material as f64) * speed * force)
        });
        let name = RecordingName {
            material: format!("m{material}"),
            person: person.into(),
            take: number.to_string(),
        };
        Take { name, recording: AnyRecording::Processed(recording) }
    }

    fn evaluate(
        takes: &[Take],
        settings: &StudySettings,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Evaluation, StudyError> {
        Study::of(takes)?.evaluate(settings, progress)
    }

    fn settings() -> StudySettings {
        let walk = RandomWalk { seconds: 2.0, ..Default::default() };
        StudySettings { map: MapSettings { walk, ..Default::default() }, ..Default::default() }
    }

    fn study_of(takes: &[Take], shard: Option<&str>) -> StudyPart {
        let study = Study::of(takes).unwrap();
        let shard = shard.map(|shard| shard.parse().unwrap());
        let found = study.compare(shard, &settings(), &|_| ()).unwrap();
        let compared: Vec<Compared> = found.into_iter().map(|(_, compared)| compared).collect();
        let head = StudyHead::of("hash".to_owned(), &settings(), &study, takes);
        StudyPart::new(head, &compared)
    }

    #[test]
    fn parts_in_any_number_make_the_tables_and_the_map_of_one_run() {
        let mut takes = vec![];
        for material in 0..2 {
            takes.extend((1..=2).map(|number| take(material, "expert", number)));
            takes.push(take(material, "novice", 1));
        }
        let whole = Evaluation { learned: vec![], ..evaluate(&takes, &settings(), &|_| ()).unwrap() };
        let path = |name: &str| std::path::PathBuf::from(name);
        let through_text = |(name, part): (&str, StudyPart)| {
            let text = part.to_text().unwrap();
            (path(name), StudyPart::parse(&path(name), &text).unwrap())
        };
        let merged =
            |parts: &[(std::path::PathBuf, StudyPart)]| StudyPart::merged(parts, &settings(), &|_| ());
        for shards in [&["1/1"][..], &["1/2", "2/2"], &["3/3", "1/3", "2/3"]] {
            let parts: Vec<_> =
                shards.iter().map(|shard| through_text((shard, study_of(&takes, Some(shard))))).collect();
            assert_eq!(merged(&parts).unwrap(), whole);
            if parts.len() > 1 {
                assert!(matches!(
                    merged(&parts[1..]),
                    Err(StudyPartError::Parts(PartsError::Missing { .. }))
                ));
                let twice = [&parts[..1], &parts[..]].concat();
                assert!(matches!(merged(&twice), Err(StudyPartError::Parts(PartsError::Twice { .. }))));
                let mut other = parts.clone();
                other[1].1.head.study = "other".to_owned();
                assert!(matches!(merged(&other), Err(StudyPartError::Parts(PartsError::Different { .. }))));
                let mut beyond = parts.clone();
                beyond.iter_mut().for_each(|(_, part)| part.head.of = 1);
                assert!(matches!(merged(&beyond), Err(StudyPartError::Parts(PartsError::Number { .. }))));
            }
        }
        assert!(matches!(merged(&[]), Err(StudyPartError::Parts(PartsError::Nothing))));
        assert!(matches!(StudyPart::parse(&path("x"), "(of: 1)"), Err(StudyPartError::Syntax { .. })));
    }

    #[test]
    fn a_study_makes_both_tables_and_the_map() {
        let mut takes = vec![];
        for material in 0..3 {
            takes.extend((1..=3).map(|number| take(material, "expert", number)));
            takes.push(take(material, "novice", 1));
        }
        // The result does not depend on the order of files.
        takes.reverse();
        let evaluation = evaluate(&takes, &settings(), &|_| ()).unwrap();
        assert_eq!(evaluation.expert, "expert");
        assert_eq!(evaluation.learned.len(), 6);
        assert!(evaluation.materials_table.diagonal_is_least(), "{:?}", evaluation.materials_table);
        let people = evaluation.people_table.unwrap().pooled(Pooling::Pair);
        assert_eq!((people.rows.len(), people.columns.len()), (2, 3));
        // The expert's row of Table 2.2 is the diagonal of Table 2.1 if deviations are pooled by pair.
        let row: Vec<f64> = people.differences[0].iter().copied().flatten().collect();
        assert_eq!(row, evaluation.materials_table.pooled(Pooling::Pair).diagonal());
        assert_eq!(evaluation.map.unwrap().k_means_purity, 1.0);
    }

    #[test]
    fn what_is_missing_is_said() {
        assert!(matches!(evaluate(&[], &settings(), &|_| ()), Err(StudyError::NoRecordings)));
        let single = [take(0, "expert", 1)];
        assert!(matches!(evaluate(&single, &settings(), &|_| ()), Err(StudyError::NoTest { .. })));
        let two = [take(0, "expert", 1), take(0, "expert", 2)];
        let evaluation = evaluate(&two, &settings(), &|_| ()).unwrap();
        assert!(evaluation.people_table.is_none() && evaluation.map.is_none());
    }
}
