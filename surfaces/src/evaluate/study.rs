//! A whole evaluation from recordings named `<material>.<person>.<take>`: learn, compare, map.
//!
//! For every material and person the first take is learned from. The person with the most takes (the first by name among equals) is the
//! expert; the expert's other takes are the tests.

use super::map::{MapError, MapSettings, PerceptualMap, perceptual_map};
use super::tables::{DifferenceTable, TableError, TableSettings, TestSet, spectral_differences};
use crate::TextureModel;
use crate::learning::TextureMethod;
use crate::learning::processing::{ProcessingError, ProcessingSettings, processed};
use crate::learning::texture::{LearnTextureError, TextureReport};
use crate::recording::{AnyRecording, Gesture, ProcessedRecording};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicUsize, Ordering};

/// What a recording is of, by its file's name.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RecordingName {
    /// The material.
    pub material: String,
    /// Who dragged.
    pub person: String,
    /// Which time.
    pub take: String,
}

impl RecordingName {
    /// The name in a file's name such as `canvas.anna.1.npz`; `None` if it is not of that form. Only the last part is the extension, so a take
    /// may contain dots.
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

/// A recording and what it is of.
#[derive(Debug, Clone)]
pub struct Take {
    /// What it is of.
    pub name: RecordingName,
    /// The recording. Only drags count.
    pub recording: AnyRecording,
}

/// How a study is done.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StudySettings {
    /// From sensor readings to physical quantities.
    pub processing: ProcessingSettings,
    /// How textures are learned.
    pub texture: TextureMethod,
    /// How they are compared with recordings.
    pub table: TableSettings,
    /// How they are compared with each other.
    pub map: MapSettings,
}

/// What a study found.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Materials, by name.
    pub materials: Vec<String>,
    /// People, by name.
    pub people: Vec<String>,
    /// Whose takes the tests are.
    pub expert: String,
    /// What was learned from which recording.
    pub learned: Vec<Learned>,
    /// The expert's textures against the tests of all materials (Table 2.1).
    pub materials_table: DifferenceTable,
    /// Everybody's textures against the tests of the same material (Table 2.2), where there are several people.
    pub people_table: Option<DifferenceTable>,
    /// All textures on a map (Fig. 2.11), where there are three at least.
    pub map: Option<PerceptualMap>,
}

/// A texture and what it was learned from.
#[derive(Debug, Clone, PartialEq)]
pub struct Learned {
    /// The recording.
    pub name: RecordingName,
    /// The recording, processed.
    pub recording: ProcessedRecording,
    /// The texture.
    pub texture: TextureModel,
    /// How it came about.
    pub report: TextureReport,
}

/// Why a study came to nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum StudyError {
    #[error("there is no dragging recording named <material>.<person>.<take>.<extension>")]
    NoRecordings,
    #[error(
        "{material} has no test: {person} needs two takes of it at least, one to learn from and others to compare with"
    )]
    NoTest { material: String, person: String },
    #[error("{recording} cannot be processed: {source}")]
    Processing {
        recording: String,
        source: Box<ProcessingError>,
    },
    #[error("no texture can be learned from {recording}: {source}")]
    Learning {
        recording: String,
        source: Box<LearnTextureError>,
    },
    #[error(transparent)]
    Table(#[from] TableError),
    #[error(transparent)]
    Map(#[from] MapError),
}

impl std::fmt::Display for RecordingName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}.{}", self.material, self.person, self.take)
    }
}

/// Evaluates a set of recordings, learning on all cores. `progress` gets the part done.
pub fn evaluate(
    takes: &[Take],
    settings: &StudySettings,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Evaluation, StudyError> {
    let mut drags: Vec<&Take> = takes
        .iter()
        .filter(|take| take.recording.gesture() == Gesture::Drag)
        .collect();
    drags.sort_by(|a, b| a.name.cmp(&b.name));
    let expert = expert(&drags).ok_or(StudyError::NoRecordings)?;
    let names = |part: fn(&RecordingName) -> &String| -> Vec<String> {
        drags
            .iter()
            .map(|take| part(&take.name).clone())
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect()
    };
    let (materials, people) = (names(|name| &name.material), names(|name| &name.person));

    let mut firsts: BTreeMap<(&str, &str), &Take> = BTreeMap::new();
    let mut tests: Vec<&Take> = vec![];
    for take in &drags {
        let key = (&*take.name.material, &*take.name.person);
        match firsts.entry(key) {
            Entry::Vacant(first) => {
                first.insert(take);
            }
            Entry::Occupied(_) if take.name.person == expert => tests.push(take),
            Entry::Occupied(_) => {}
        }
    }
    for material in &materials {
        if !tests.iter().any(|take| take.name.material == *material) {
            return Err(StudyError::NoTest {
                material: material.clone(),
                person: expert,
            });
        }
    }
    let firsts: Vec<&Take> = firsts.into_values().collect();
    let learned = learn_all(&firsts, settings, &|part| progress(0.5 * part))?;
    let tests = process_all(&tests, settings)?;
    progress(0.55);

    let sets: Vec<TestSet> = materials
        .iter()
        .map(|material| {
            let of_material = |(name, _): &&(RecordingName, ProcessedRecording)| name.material == *material;
            let recordings = tests
                .iter()
                .filter(of_material)
                .map(|(_, recording)| recording)
                .collect();
            TestSet {
                name: material.clone(),
                recordings,
            }
        })
        .collect();
    let find = |material: &str, person: &str| {
        let found = learned
            .iter()
            .find(|l| l.name.material == material && l.name.person == person);
        found.map(|learned| &learned.texture)
    };
    let table = |rows: &[String], texture: &(dyn Fn(usize, usize) -> Option<_> + Sync), from: f64| {
        spectral_differences(rows, &sets, texture, &settings.table, &|part| {
            progress(from + 0.15 * part)
        })
    };
    let materials_table = table(&materials, &|row, _| find(&materials[row], &expert), 0.55)?;
    let people_table = match people.len() {
        1 => None,
        _ => Some(table(
            &people,
            &|row, column| find(&materials[column], &people[row]),
            0.7,
        )?),
    };
    let named: Vec<(String, String, &TextureModel)> = learned
        .iter()
        .map(|l| (l.name.to_string(), l.name.material.clone(), &l.texture))
        .collect();
    let map = match named.len() {
        0..3 => None,
        _ => Some(perceptual_map(&named, &settings.map, &|part| {
            progress(0.85 + 0.15 * part)
        })?),
    };
    progress(1.0);
    Ok(Evaluation {
        materials,
        people,
        expert,
        learned,
        materials_table,
        people_table,
        map,
    })
}

/// The person with the most takes.
fn expert(drags: &[&Take]) -> Option<String> {
    let mut counts: BTreeMap<&String, usize> = BTreeMap::new();
    drags
        .iter()
        .for_each(|take| *counts.entry(&take.name.person).or_default() += 1);
    let most = counts.values().copied().max()?;
    counts
        .into_iter()
        .find(|(_, count)| *count == most)
        .map(|(person, _)| person.clone())
}

fn process_one(take: &Take, settings: &StudySettings) -> Result<ProcessedRecording, StudyError> {
    processed(&take.recording, &settings.processing).map_err(|source| StudyError::Processing {
        recording: take.name.to_string(),
        source: Box::new(source),
    })
}

fn process_all(
    takes: &[&Take],
    settings: &StudySettings,
) -> Result<Vec<(RecordingName, ProcessedRecording)>, StudyError> {
    takes
        .iter()
        .map(|take| Ok((take.name.clone(), process_one(take, settings)?)))
        .collect()
}

fn learn_all(
    takes: &[&Take],
    settings: &StudySettings,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<Learned>, StudyError> {
    let done = AtomicUsize::new(0);
    let learn = |take: &Take| {
        let recording = process_one(take, settings)?;
        let found = settings.texture.learn(std::slice::from_ref(&recording), &|_| ());
        let (texture, report) = found.map_err(|source| StudyError::Learning {
            recording: take.name.to_string(),
            source: Box::new(source),
        })?;
        progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / takes.len() as f64);
        Ok(Learned {
            name: take.name.clone(),
            recording,
            texture,
            report,
        })
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let share = takes.len().div_ceil(threads).max(1);
    let mut learned: Vec<Option<Result<Learned, StudyError>>> = takes.iter().map(|_| None).collect();
    std::thread::scope(|scope| {
        for (takes, slots) in takes.chunks(share).zip(learned.chunks_mut(share)) {
            let learn = &learn;
            scope.spawn(move || {
                takes
                    .iter()
                    .zip(slots)
                    .for_each(|(take, slot)| *slot = Some(learn(take)))
            });
        }
    });
    learned.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::RandomWalk;
    use crate::metrics::Pooling;
    use crate::recording::synthetic::drag;

    #[test]
    fn names_are_read_from_file_names() {
        let name = RecordingName::parse("rough plastic.S1.take.2.npz").unwrap();
        assert_eq!(
            (&*name.material, &*name.person, &*name.take),
            ("rough plastic", "S1", "take.2")
        );
        for bad in [
            "canvas",
            "canvas.anna",
            "canvas.anna.1",
            "canvas..1.npz",
            ".anna.1.npz",
        ] {
            assert_eq!(RecordingName::parse(bad), None, "{bad}");
        }
    }

    fn take(material: usize, person: &str, number: u64) -> Take {
        let steps: Vec<_> = (0..9)
            .map(|i| {
                (
                    0.12,
                    0.05 + 0.05 * ((i * 2) % 3) as f64,
                    0.5 + 0.5 * (i / 3) as f64,
                )
            })
            .collect();
        let seed = number + 10 * material as u64 + 100 * person.len() as u64;
        let recording = drag(&steps, 0.3, seed, |speed, force| {
            let angle = 0.3 + 0.5 * material as f64;
            (
                vec![-1.8 * angle.cos(), 0.81],
                (1.0 + material as f64) * speed * force,
            )
        });
        let name = RecordingName {
            material: format!("m{material}"),
            person: person.into(),
            take: number.to_string(),
        };
        Take {
            name,
            recording: AnyRecording::Processed(recording),
        }
    }

    fn settings() -> StudySettings {
        let walk = RandomWalk {
            seconds: 2.0,
            ..Default::default()
        };
        StudySettings {
            map: MapSettings {
                walk,
                ..Default::default()
            },
            ..Default::default()
        }
    }

    #[test]
    fn a_study_makes_both_tables_and_the_map() {
        let mut takes = vec![];
        for material in 0..3 {
            takes.extend((1..=3).map(|number| take(material, "expert", number)));
            takes.push(take(material, "novice", 1));
        }
        // Order of files does not matter.
        takes.reverse();
        let evaluation = evaluate(&takes, &settings(), &|_| ()).unwrap();
        assert_eq!(evaluation.expert, "expert");
        assert_eq!(evaluation.learned.len(), 6);
        assert!(
            evaluation.materials_table.diagonal_is_least(),
            "{:?}",
            evaluation.materials_table
        );
        let people = evaluation.people_table.unwrap().pooled(Pooling::Pair);
        assert_eq!((people.rows.len(), people.columns.len()), (2, 3));
        // The expert's row of Table 2.2 is the diagonal of Table 2.1, where deviations are each pair's own.
        let row: Vec<f64> = people.differences[0].iter().copied().flatten().collect();
        assert_eq!(row, evaluation.materials_table.pooled(Pooling::Pair).diagonal());
        assert_eq!(evaluation.map.unwrap().k_means_purity, 1.0);
    }

    #[test]
    fn what_is_missing_is_said() {
        assert!(matches!(
            evaluate(&[], &settings(), &|_| ()),
            Err(StudyError::NoRecordings)
        ));
        let single = [take(0, "expert", 1)];
        assert!(matches!(
            evaluate(&single, &settings(), &|_| ()),
            Err(StudyError::NoTest { .. })
        ));
        let two = [take(0, "expert", 1), take(0, "expert", 2)];
        let evaluation = evaluate(&two, &settings(), &|_| ()).unwrap();
        assert!(evaluation.people_table.is_none() && evaluation.map.is_none());
    }
}
