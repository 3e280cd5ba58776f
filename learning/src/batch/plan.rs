//! A plan with all files that it names.

use super::document::{Document, Format, Jobs, Part, Samples, Signal, place_of};
use super::motion::Source;
use super::problem::{PlanError, PlanProblem, find};
use super::{hash, hex, pattern, table};
use haptograph_signal::files;
use haptograph_surfaces::files::{FileError, read_surface};
use haptograph_surfaces::{Recorded, TextureModel};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::ops::Range;
use std::path::Path;

/// Most chunks of a batch, because its manifest lists each.
pub(super) const MAX_CHUNKS: u64 = 200_000;
// A chunk and its temporary file are two names of a folder that is listed.
const _: () = assert!(2 * MAX_CHUNKS < haptograph_signal::files::MAX_NAMES as u64);
/// Largest memory of a chunk during rendering, bytes.
const MAX_CHUNK_BYTES: u64 = 2 << 30;

/// A file named in a plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Input {
    pub kind: String,
    /// The path in the plan.
    pub file: String,
    pub sha256: String,
    /// Origin and source of a surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
}

impl Input {
    pub(super) fn new(kind: &str, file: &str, sha256: String) -> Self {
        Self { kind: kind.to_owned(), file: file.to_owned(), sha256, origin: None, source: None }
    }
}

/// A vibration to be rendered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Job {
    /// The number of its surface, from 0.
    pub surface: usize,
    /// The number of its motion, from 0.
    pub motion: usize,
    /// Seed of its noise, and of a random motion.
    pub seed: u64,
    /// Gain of its vibration.
    pub gain: f64,
    /// Update rate of its filter, Hz.
    pub update_hz: f64,
}

/// A surface of a batch.
#[derive(Debug)]
pub struct BatchSurface {
    /// The file's name without extension.
    pub name: String,
    /// The texture.
    pub texture: TextureModel,
}

/// A plan, ready to be rendered.
#[derive(Debug)]
pub struct Batch {
    text: String,
    document: Document,
    surfaces: Vec<BatchSurface>,
    motions: Vec<(String, Source)>,
    inputs: Vec<Input>,
    table: Vec<Job>,
    identity: String,
}

impl Batch {
    /// Loads a batch from a plan file. Paths in a plan are relative to its folder.
    ///
    /// # Errors
    /// The first problem of the plan or of a file that it names, with its location.
    pub fn load(path: &Path) -> Result<Self, PlanError> {
        let failed = |place, problem| PlanError { path: path.to_owned(), place, problem };
        let text =
            files::read_text(path, files::MAX_PLAN_BYTES).map_err(|error| failed(None, error.into()))?;
        let parsed = Document::parse(&text);
        let document = parsed.map_err(|(place, reason)| failed(Some(place), reason.into()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let at = |(part, problem)| failed(place_of(&part, &text), problem);
        let mut batch = Self {
            surfaces: vec![],
            motions: vec![],
            inputs: vec![],
            table: vec![],
            identity: String::new(),
            text: text.clone(),
            document,
        };
        batch.load_surfaces(folder).map_err(at)?;
        batch.load_motions(folder).map_err(at)?;
        if let Jobs::Table(file) = batch.document.jobs.clone() {
            let (jobs, bytes) = table::read(&folder.join(&file), &batch)?;
            batch.inputs.push(Input::new("jobs", &file, hash(&bytes)));
            batch.table = jobs;
        }
        batch.check().map_err(at)?;
        batch.identity = identify(env!("CARGO_PKG_VERSION"), &batch.text, &batch.inputs);
        Ok(batch)
    }

    fn load_surfaces(&mut self, folder: &Path) -> Result<(), (Part, PlanProblem)> {
        for (number, pattern) in self.document.surfaces.iter().enumerate() {
            let at = |problem: PlanProblem| (Part::Surface(number), problem);
            for file in pattern::matching(folder, pattern).map_err(at)? {
                let path = folder.join(&file);
                let (surface, sha256) = load_surface(&path).map_err(|error| at(error.into()))?;
                let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                let file = file.display().to_string();
                if let Some(first) = self.surfaces.iter().position(|other| other.name == name) {
                    let files = format!("{} and {file}", self.inputs[first].file);
                    return Err(at(PlanProblem::SameName { name, files }));
                }
                let Some(texture) = surface.texture else {
                    return Err(at(PlanProblem::NoTexture { file }));
                };
                let mut input = Input::new("surface", &file, sha256);
                input.origin = Some(surface.provenance.origin.as_str().to_owned());
                input.source = Some(surface.provenance.source);
                self.inputs.push(input);
                self.surfaces.push(BatchSurface { name, texture });
            }
        }
        match self.surfaces.is_empty() {
            true => Err((Part::Jobs, PlanProblem::Nothing { what: "surfaces" })),
            false => Ok(()),
        }
    }

    /// The ranges of speed (m/s) and of force (N) that all surfaces recorded; none if one does not say, or they have none in common.
    fn recorded(&self) -> [Option<(f64, f64)>; 2] {
        let common = |of: fn(Recorded) -> (f64, f64)| {
            let mut each = self.surfaces.iter().map(|surface| surface.texture.recorded().map(of));
            let all = each.try_fold((0.0_f64, f64::INFINITY), |(least, most), range| {
                range.map(|(low, high)| (least.max(low), most.min(high)))
            });
            all.filter(|(least, most)| least <= most)
        };
        [common(|recorded| recorded.speed_m_s), common(|recorded| recorded.force_n)]
    }

    fn load_motions(&mut self, folder: &Path) -> Result<(), (Part, PlanProblem)> {
        let recorded = self.recorded();
        for (name, motion) in &self.document.motions {
            let source = Source::of(motion, folder, recorded);
            let source = source.map_err(|problem| (Part::Motion(name.clone()), problem))?;
            if let Source::Recording { file, sha256, .. } = &source {
                self.inputs.push(Input::new("recording", file, sha256.clone()));
            }
            self.motions.push((name.clone(), source));
        }
        match self.motions.is_empty() {
            true => Err((Part::Jobs, PlanProblem::Nothing { what: "motions" })),
            false => Ok(()),
        }
    }

    /// Refuses a plan that cannot be rendered.
    fn check(&self) -> Result<(), (Part, PlanProblem)> {
        let Document { update_hz, gain, jobs_per_chunk, .. } = &self.document;
        check_update_hz(*update_hz).map_err(|problem| (Part::UpdateHz, problem))?;
        check_gain(*gain).map_err(|problem| (Part::Gain, problem))?;
        let range =
            |part, what, value: String, expected| Err((part, PlanProblem::Range { what, value, expected }));
        if !(1..=65_536).contains(jobs_per_chunk) {
            let value = jobs_per_chunk.to_string();
            return range(Part::JobsPerChunk, "jobs_per_chunk", value, "from 1 to 65536");
        }
        let mut signals = self.document.write.iter().enumerate();
        if self.document.write.is_empty()
            || signals.any(|(i, signal)| self.document.write[..i].contains(signal))
        {
            let expected = "a list of Vibration, Speed and Force without duplicates";
            return range(Part::Write, "write", format!("{:?}", self.document.write), expected);
        }
        if let Jobs::Product { seeds: (from, to) } = self.document.jobs
            && from > to
        {
            return Err((Part::Jobs, PlanProblem::Seeds { from, to }));
        }
        self.check_size().map_err(|problem| (Part::Jobs, problem))
    }

    fn check_size(&self) -> Result<(), PlanProblem> {
        let jobs = self.count();
        let jobs_per_chunk = self.document.jobs_per_chunk;
        if jobs == 0 {
            return Err(PlanProblem::Nothing { what: "jobs" });
        }
        if jobs.div_ceil(jobs_per_chunk.into()) > MAX_CHUNKS.into() {
            return Err(PlanProblem::TooManyChunks {
                jobs: u64::try_from(jobs).unwrap_or(u64::MAX),
                jobs_per_chunk,
                most: MAX_CHUNKS,
            });
        }
        let rates = self.surfaces.iter().map(|surface| surface.texture.rate_hz());
        let fastest = rates.fold(0.0, f64::max);
        let longest = self.motions.iter().map(|(_, motion)| motion.samples(fastest) as u64).max();
        let (samples, jobs) = (longest.unwrap_or(0), (jobs as u64).min(jobs_per_chunk));
        let stored = self.document.write.len() as u64 * self.document.samples.bytes();
        let bytes = samples.saturating_mul(jobs.saturating_mul(stored) + 16 * 24);
        match bytes > MAX_CHUNK_BYTES {
            true => Err(PlanProblem::TooLarge {
                jobs,
                samples,
                mebibytes: bytes >> 20,
                most: MAX_CHUNK_BYTES >> 20,
            }),
            false => Ok(()),
        }
    }

    fn count(&self) -> u128 {
        let product = count(&self.document, self.surfaces.len(), self.motions.len());
        product.unwrap_or(self.table.len() as u128)
    }

    /// The identity: two batches with the same identity have the same chunks.
    pub(crate) fn identity(&self) -> &str {
        &self.identity
    }

    /// Number of jobs.
    pub fn jobs(&self) -> u64 {
        self.count() as u64
    }

    /// A job by its number, from 0 to [`Self::jobs`]: seeds change fastest, then motions, then surfaces; or the rows of the table.
    pub fn job(&self, number: u64) -> Job {
        let Jobs::Product { seeds: (from, to) } = self.document.jobs else {
            return self.table[number as usize];
        };
        // All seeds there are: the first is the only one of each.
        let seeds = (to - from).saturating_add(1);
        let (rest, motions) = (number / seeds, self.motions.len() as u64);
        Job {
            surface: (rest / motions) as usize,
            motion: (rest % motions) as usize,
            seed: from + number % seeds,
            gain: self.document.gain,
            update_hz: self.document.update_hz,
        }
    }

    /// Duration of all jobs, s.
    pub fn seconds(&self) -> f64 {
        let of_kind = |surface: &BatchSurface, motion: &Source| {
            let rate_hz = surface.texture.rate_hz();
            motion.samples(rate_hz) as f64 / rate_hz
        };
        self.sum(of_kind)
    }

    /// Bytes on disk of the signals of all jobs, if all jobs of a chunk have the same length.
    pub fn bytes(&self) -> u64 {
        let stored = self.document.write.len() as u64 * self.document.samples.bytes();
        let samples = self.sum(|surface, motion| motion.samples(surface.texture.rate_hz()) as f64);
        samples as u64 * stored
    }

    /// Sums a function of surface and motion over all jobs.
    fn sum(&self, of: impl Fn(&BatchSurface, &Source) -> f64) -> f64 {
        let Jobs::Product { seeds: (from, to) } = self.document.jobs else {
            let jobs = self.table.iter();
            return jobs.map(|job| of(&self.surfaces[job.surface], self.motion(job.motion))).sum();
        };
        let along = |surface| self.motions.iter().map(|(_, motion)| of(surface, motion)).sum::<f64>();
        self.surfaces.iter().map(along).sum::<f64>() * ((to - from) as f64 + 1.0)
    }

    /// Sample rate of a job, Hz.
    pub fn rate_hz(&self, job: &Job) -> f64 {
        self.surfaces[job.surface].texture.rate_hz()
    }

    /// Number of samples of a job.
    pub(super) fn samples_of(&self, job: &Job) -> usize {
        self.motion(job.motion).samples(self.rate_hz(job))
    }

    /// Number of chunks.
    pub fn chunks(&self) -> u64 {
        self.jobs().div_ceil(self.document.jobs_per_chunk)
    }

    /// The numbers of a chunk's jobs.
    pub(crate) fn jobs_of(&self, chunk: u64) -> Range<u64> {
        let start = chunk * self.document.jobs_per_chunk;
        start..self.jobs().min(start + self.document.jobs_per_chunk)
    }

    /// The surfaces, by number.
    pub fn surfaces(&self) -> &[BatchSurface] {
        &self.surfaces
    }

    /// The motions' names, by number.
    pub fn motions(&self) -> impl Iterator<Item = &str> + Clone {
        self.motions.iter().map(|(name, _)| name.as_str())
    }

    pub(super) fn motion(&self, number: usize) -> &Source {
        &self.motions[number].1
    }

    pub(super) fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }

    pub(super) fn signals(&self) -> &[Signal] {
        &self.document.write
    }

    pub(super) fn samples(&self) -> Samples {
        self.document.samples
    }

    pub(super) fn format(&self) -> Format {
        self.document.format
    }

    pub(super) fn jobs_per_chunk(&self) -> u64 {
        self.document.jobs_per_chunk
    }

    pub(super) fn update_hz(&self) -> f64 {
        self.document.update_hz
    }

    pub(super) fn gain(&self) -> f64 {
        self.document.gain
    }

    pub(super) fn surface_of(&self, name: &str) -> Result<usize, PlanProblem> {
        find("surface", self.surfaces.iter().map(|surface| surface.name.as_str()), name)
    }

    pub(super) fn motion_of(&self, name: &str) -> Result<usize, PlanProblem> {
        find("motion", self.motions(), name)
    }
}

/// A hash of everything that determines the chunks: the version, the plan, and the files that it names.
pub(super) fn identify(version: &str, plan: &str, inputs: &[Input]) -> String {
    let mut hash = Sha256::new();
    hash.update(format!("haptograph {version}\n"));
    hash.update(plan);
    for input in inputs {
        hash.update(format!("\n{} {} {}", input.kind, input.sha256, input.file));
    }
    hex(&hash.finalize())
}

/// Number of jobs of a plan's document for these numbers of surfaces and motions; `None` if it has a table.
pub(super) fn count(document: &Document, surfaces: usize, motions: usize) -> Option<u128> {
    let Jobs::Product { seeds: (from, to) } = document.jobs else {
        return None;
    };
    let seeds = u128::from(to.checked_sub(from)?) + 1;
    Some((surfaces as u128 * motions as u128).saturating_mul(seeds))
}

/// Refuses an invalid update rate.
pub(super) fn check_update_hz(update_hz: f64) -> Result<(), PlanProblem> {
    match (1.0..=1e5).contains(&update_hz) {
        true => Ok(()),
        false => Err(PlanProblem::Range {
            what: "update_hz",
            value: update_hz.to_string(),
            expected: "from 1 to 100000",
        }),
    }
}

/// Refuses an invalid gain.
pub(super) fn check_gain(gain: f64) -> Result<(), PlanProblem> {
    match gain.abs() <= 1e9 {
        true => Ok(()),
        false => {
            Err(PlanProblem::Range { what: "gain", value: gain.to_string(), expected: "from -1e9 to 1e9" })
        }
    }
}

fn load_surface(path: &Path) -> Result<(haptograph_surfaces::Surface, String), FileError> {
    let bytes = files::read(path, files::MAX_SURFACE_BYTES);
    let bytes = bytes.map_err(|source| FileError::Io { path: path.to_owned(), source })?;
    let surface = read_surface(&bytes).map_err(|error| FileError::Read { path: path.to_owned(), error })?;
    Ok((surface, hash(&bytes)))
}
