//! What a folder of chunks holds, as JSON.

use super::chunk::file_name;
use super::document::Document;
use super::plan::{Batch, MAX_CHUNKS, count, identify};
use crate::files::write_atomically;
use haptograph_signal::files;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

/// The name of a manifest.
pub const MANIFEST: &str = "manifest.json";
/// Longer manifests are not read, bytes.
const MAX_BYTES: u64 = 256 << 20;

/// A file that a plan names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Input {
    pub kind: String,
    /// Its path as the plan has it.
    pub file: String,
    pub sha256: String,
    /// Of a surface: what kind of data stands behind it, and which.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
}

impl Input {
    pub fn new(kind: &str, file: &str, sha256: String) -> Self {
        Self {
            kind: kind.to_owned(),
            file: file.to_owned(),
            sha256,
            origin: None,
            source: None,
        }
    }
}

/// A chunk in a folder.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChunkEntry {
    /// Its number, from 0.
    pub chunk: u64,
    /// Its file's name.
    pub file: String,
    /// Its first job, and the one after its last.
    pub jobs: [u64; 2],
    /// The hash of its arrays.
    pub sha256: String,
}

/// What a folder holds. The same for the same chunks, whoever rendered them in however many parts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    pub haptograph: String,
    /// See [`Batch::identity`].
    pub batch: String,
    /// Vibrations are rendered from models, none is measured.
    pub rendered: bool,
    pub plan: String,
    pub inputs: Vec<Input>,
    /// Names by number.
    pub surfaces: Vec<String>,
    pub motions: Vec<String>,
    pub signals: Vec<String>,
    pub samples: String,
    pub jobs: u64,
    pub jobs_per_chunk: u64,
    pub update_hz: f64,
    /// Whether every chunk is there.
    pub complete: bool,
    pub chunks: Vec<ChunkEntry>,
}

impl Manifest {
    /// The manifest of a batch of which these chunks, by number and hash, are there.
    pub fn of(batch: &Batch, found: &BTreeMap<u64, String>) -> Self {
        let entry = |(chunk, sha256): (&u64, &String)| {
            let jobs = batch.jobs_of(*chunk);
            ChunkEntry {
                chunk: *chunk,
                file: file_name(*chunk),
                jobs: [jobs.start, jobs.end],
                sha256: sha256.clone(),
            }
        };
        Self {
            haptograph: env!("CARGO_PKG_VERSION").to_owned(),
            batch: batch.identity().to_owned(),
            rendered: true,
            plan: batch.text().to_owned(),
            inputs: batch.inputs().to_vec(),
            surfaces: batch
                .surfaces()
                .iter()
                .map(|surface| surface.name.clone())
                .collect(),
            motions: batch.motions().map(str::to_owned).collect(),
            signals: batch
                .signals()
                .iter()
                .map(|signal| signal.name().to_owned())
                .collect(),
            samples: batch.samples().as_str().to_owned(),
            jobs: batch.jobs(),
            jobs_per_chunk: batch.jobs_per_chunk(),
            update_hz: batch.update_hz(),
            complete: found.len() as u64 == batch.chunks(),
            chunks: found.iter().map(entry).collect(),
        }
    }

    /// The manifest in a folder.
    pub fn read(folder: &Path) -> io::Result<Self> {
        let text = files::read_text(&folder.join(MANIFEST), MAX_BYTES)?;
        Ok(serde_json::from_str(&text)?)
    }

    /// Whether it is one that a run may have written: its numbers are those of its plan, and its entries those of its numbers. Why not.
    pub fn check(&self) -> Result<(), String> {
        if self.batch != identify(&self.haptograph, &self.plan, &self.inputs) {
            return Err("it does not belong to its plan and files".to_owned());
        }
        let plan = Document::parse(&self.plan);
        let plan = plan.map_err(|(place, why)| format!("its plan is none: {place}: {why}"))?;
        let jobs = count(&plan, self.surfaces.len(), self.motions.len());
        if jobs.is_some_and(|jobs| jobs != u128::from(self.jobs))
            || plan.jobs_per_chunk != self.jobs_per_chunk
            || !(1..=MAX_CHUNKS).contains(&self.whole())
        {
            let (jobs, each) = (self.jobs, self.jobs_per_chunk);
            return Err(format!(
                "its plan gives other jobs than {jobs} in chunks of {each}"
            ));
        }
        for entry in &self.chunks {
            let start = entry.chunk.saturating_mul(self.jobs_per_chunk);
            let end = self.jobs.min(start.saturating_add(self.jobs_per_chunk));
            if entry.chunk >= self.whole()
                || entry.file != file_name(entry.chunk)
                || entry.jobs != [start, end]
            {
                return Err(format!("its plan gives no chunk {} as it lists it", entry.chunk));
            }
        }
        Ok(())
    }

    /// Writes it whole or not at all.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        let text = serde_json::to_string_pretty(self)? + "\n";
        write_atomically(&folder.join(MANIFEST), text.as_bytes())
    }

    /// How many chunks the whole batch has.
    pub fn whole(&self) -> u64 {
        self.jobs.div_ceil(self.jobs_per_chunk.max(1))
    }
}
