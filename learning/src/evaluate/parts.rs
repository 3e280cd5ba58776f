//! Parts of a study: the learned and compared textures as lossless text, and the merge of all parts.
//!
//! Items are assigned to parts by their number, independently of the number of parts. Table and map of a
//! merge equal those of a single run to the bit.

use super::study::{
    Compared, Evaluation, RecordingName, Study, StudyError, StudySettings, TakeSource, conclude,
};
use crate::metrics::{ErrorStatistics, Pooling};
use crate::parts::{Part, PartsError, whole};
use haptograph_surfaces::files::{ReadError, native};
use haptograph_surfaces::{Origin, Provenance, Surface};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A part of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyPart {
    /// The study that it is a part of.
    pub head: StudyHead,
    /// The items with their numbers.
    items: Vec<Item>,
}

/// Data common to all parts of a study.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyHead {
    /// Version of haptograph.
    pub haptograph: String,
    /// Hash of everything that the items depend on: recordings and settings.
    pub study: String,
    /// Set over which deviations are pooled.
    pub pooling: Pooling,
    /// Seed of the vibrations and of the map.
    pub seed: u64,
    /// The person whose takes are the tests.
    pub expert: String,
    /// Number of recordings.
    pub recordings: usize,
    /// Number of simulated recordings.
    pub simulated: usize,
    /// Number of items of the whole study.
    pub of: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Item {
    number: usize,
    name: RecordingName,
    /// The texture, as the text of a surface file.
    surface: String,
    errors: BTreeMap<String, Vec<ErrorStatistics>>,
}

/// Error of reading or merging parts.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // see the messages
pub enum StudyPartError {
    #[error("{} is not a part of an evaluation: {message}", path.display())]
    Syntax { path: PathBuf, message: String },
    #[error("the texture of {name} in {} cannot be read: {source}", path.display())]
    Texture { path: PathBuf, name: String, source: Box<ReadError> },
    #[error(transparent)]
    Parts(#[from] PartsError),
    #[error(transparent)]
    Study(#[from] StudyError),
}

impl StudyHead {
    /// The head of a study of takes; `hash` covers their recordings and settings.
    pub fn of(hash: String, settings: &StudySettings, study: &Study<'_>, takes: &[impl TakeSource]) -> Self {
        let simulated = { takes.iter() }.filter(|take| take.origin() == Origin::Simulated);
        Self {
            haptograph: env!("CARGO_PKG_VERSION").to_owned(),
            study: hash,
            pooling: settings.table.pooling,
            seed: settings.table.synthesis.seed,
            expert: study.expert().to_owned(),
            recordings: takes.len(),
            simulated: simulated.count(),
            of: study.items(),
        }
    }
}

impl StudyPart {
    /// The part that consists of these items.
    pub fn new(head: StudyHead, compared: &[Compared]) -> Self {
        let item = |one: &Compared| {
            let provenance = Provenance::new(Origin::Procedural, "a part of an evaluation");
            let mut surface = Surface::new(one.name.to_string(), provenance);
            surface.texture = Some(one.texture.clone());
            Item {
                number: one.number,
                name: one.name.clone(),
                surface: native::write(&surface),
                errors: one.errors.clone(),
            }
        };
        let items = compared.iter().map(item).collect();
        Self { head, items }
    }

    /// The numbers of its items.
    pub fn numbers(&self) -> impl Iterator<Item = usize> + '_ {
        self.items.iter().map(|item| item.number)
    }

    /// The part as text.
    ///
    /// # Errors
    /// Serialisation errors; none are known.
    pub fn to_text(&self) -> Result<String, ron::Error> {
        let pretty = ron::ser::PrettyConfig::new().depth_limit(3);
        Ok(ron::ser::to_string_pretty(self, pretty)? + "\n")
    }

    /// Parses the text of a part.
    ///
    /// # Errors
    /// [`StudyPartError::Syntax`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, StudyPartError> {
        let options = ron::Options::default().with_recursion_limit(32);
        options
            .from_str(text)
            .map_err(|error| StudyPartError::Syntax { path: path.to_owned(), message: error.to_string() })
    }

    /// Merges all parts of a study into tables and map, equal to those of one run.
    ///
    /// # Errors
    /// [`StudyPartError`] if a part is missing, given twice, or belongs to another study.
    pub fn merged<'a>(
        parts: &'a [(PathBuf, Self)],
        settings: &StudySettings,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Evaluation, StudyPartError> {
        let head = &parts.first().ok_or(PartsError::Nothing)?.1.head;
        let part = |(path, part): &'a (PathBuf, Self)| Part {
            path,
            head: &part.head,
            items: part.items.iter().map(|item| (item.number as u64, item)).collect(),
        };
        let parts: Vec<_> = parts.iter().map(part).collect();
        let items = whole(&parts, head.of as u64, |item: &Item| item.name.to_string())?;
        let compared = items.into_iter().map(compared).collect::<Result<Vec<_>, _>>()?;
        Ok(conclude(&head.expert, &compared, settings, progress)?)
    }
}

fn compared((path, item): (&Path, &Item)) -> Result<Compared, StudyPartError> {
    let failed = |source| StudyPartError::Texture {
        path: path.to_owned(),
        name: item.name.to_string(),
        source: Box::new(source),
    };
    let surface = native::read(&item.surface).map_err(failed)?;
    let none =
        || StudyPartError::Syntax { path: path.to_owned(), message: format!("{} has no texture", item.name) };
    Ok(Compared {
        number: item.number,
        name: item.name.clone(),
        texture: surface.texture.ok_or_else(none)?,
        errors: item.errors.clone(),
    })
}
