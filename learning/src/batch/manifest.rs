//! The manifest of a folder of chunks, as JSON.

use super::chunk::{About, file_name};
use super::document::{Document, Format};
use super::plan::{Batch, Input, MAX_CHUNKS, count, identify};
use crate::parts::Part;
use haptograph_signal::files::{self, write_atomically};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;

/// The name of a manifest.
pub const MANIFEST: &str = "manifest.json";

/// A chunk in a folder.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChunkEntry {
    /// The number, from 0.
    pub chunk: u64,
    /// The file name.
    pub file: String,
    /// The first job, and the one after its last.
    pub jobs: [u64; 2],
    /// The hash of its content.
    pub sha256: String,
}

/// The content of a folder. It depends only on the chunks, not on how they were rendered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Manifest {
    pub haptograph: String,
    /// See [`Batch::identity`].
    pub batch: String,
    /// Vibrations are rendered from models, never measured.
    pub rendered: bool,
    pub plan: String,
    pub inputs: Vec<Input>,
    /// Names by number.
    pub surfaces: Vec<String>,
    pub motions: Vec<String>,
    pub signals: Vec<String>,
    pub samples: String,
    pub format: Format,
    /// The families of processors that rendered the chunks; the bits of samples may differ between families.
    pub processors: BTreeSet<String>,
    pub jobs: u64,
    pub jobs_per_chunk: u64,
    pub update_hz: f64,
    /// True if every chunk exists.
    pub complete: bool,
    pub chunks: Vec<ChunkEntry>,
}

impl Manifest {
    /// The manifest of a batch with these chunks, by number.
    pub(super) fn of(batch: &Batch, found: &BTreeMap<u64, About>) -> Self {
        let entry = |(chunk, about): (&u64, &About)| {
            let jobs = batch.jobs_of(*chunk);
            ChunkEntry {
                chunk: *chunk,
                file: file_name(*chunk, batch.format()),
                jobs: [jobs.start, jobs.end],
                sha256: about.sha256.clone(),
            }
        };
        Self {
            haptograph: env!("CARGO_PKG_VERSION").to_owned(),
            batch: batch.identity().to_owned(),
            rendered: true,
            plan: batch.text().to_owned(),
            inputs: batch.inputs().to_vec(),
            surfaces: batch.surfaces().iter().map(|surface| surface.name.clone()).collect(),
            motions: batch.motions().map(str::to_owned).collect(),
            signals: batch.signals().iter().map(|signal| signal.name().to_owned()).collect(),
            samples: batch.samples().as_str().to_owned(),
            format: batch.format(),
            processors: found.values().map(|about| about.processor.clone()).collect(),
            jobs: batch.jobs(),
            jobs_per_chunk: batch.jobs_per_chunk(),
            update_hz: batch.update_hz(),
            complete: found.len() as u64 == batch.chunks(),
            chunks: found.iter().map(entry).collect(),
        }
    }

    /// The manifest in a folder.
    pub(super) fn read(folder: &Path) -> io::Result<Self> {
        let text = files::read_text(&folder.join(MANIFEST), files::MAX_MANIFEST_BYTES)?;
        Ok(serde_json::from_str(&text)?)
    }

    /// Checks that the manifest is consistent with its plan and its entries, so that a run can have written it.
    pub(super) fn check(&self) -> Result<(), String> {
        if self.batch != identify(&self.haptograph, &self.plan, &self.inputs) {
            return Err("it does not belong to its plan and files".to_owned());
        }
        let plan = Document::parse(&self.plan);
        let plan = plan.map_err(|(place, why)| format!("its plan is invalid: {place}: {why}"))?;
        let jobs = count(&plan, self.surfaces.len(), self.motions.len());
        if jobs.is_some_and(|jobs| jobs != u128::from(self.jobs))
            || plan.jobs_per_chunk != self.jobs_per_chunk
            || plan.format != self.format
            || !(1..=MAX_CHUNKS).contains(&self.whole())
        {
            let (jobs, each, format) = (self.jobs, self.jobs_per_chunk, self.format);
            return Err(format!("its plan does not give {jobs} jobs in chunks of {each} as {format:?}"));
        }
        for entry in &self.chunks {
            let start = entry.chunk.saturating_mul(self.jobs_per_chunk);
            let end = self.jobs.min(start.saturating_add(self.jobs_per_chunk));
            if entry.chunk >= self.whole()
                || entry.file != file_name(entry.chunk, self.format)
                || entry.jobs != [start, end]
            {
                return Err(format!("its entry for chunk {} does not match its plan", entry.chunk));
            }
        }
        Ok(())
    }

    /// The part of the batch in a folder.
    pub(super) fn part<'a>(&'a self, folder: &'a Path) -> Part<'a, Self, ChunkEntry> {
        let head = Self { complete: false, chunks: vec![], processors: BTreeSet::new(), ..self.clone() };
        Part { path: folder, head, items: self.chunks.iter().map(|entry| (entry.chunk, entry)).collect() }
    }

    /// Writes the manifest atomically.
    pub(super) fn write(&self, folder: &Path) -> io::Result<()> {
        let text = serde_json::to_string_pretty(self)? + "\n";
        write_atomically(&folder.join(MANIFEST), text.as_bytes())
    }

    /// Number of chunks of the whole batch.
    pub(super) fn whole(&self) -> u64 {
        self.jobs.div_ceil(self.jobs_per_chunk.max(1))
    }
}
