//! A chunk: the results of its jobs in one file with a description.

mod npz;
mod parquet;
mod thrift;

use super::document::{Format, Samples};
use super::plan::{Batch, Job};
use haptograph_signal::files::{self, write_atomically_by};
use haptograph_signal::instructions::processor_family;
use haptograph_signal::statistics::mean;
use haptograph_surfaces::rendering::{SynthesisError, SynthesisSettings, Trajectory, Voice, synthesise_many};
use haptograph_surfaces::{Recorded, TextureModel};
use serde::{Deserialize, Serialize};
use std::io;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Number of voices rendered together.
const TOGETHER: usize = 16;
/// Bytes hashed at a time.
const BLOCK: usize = 1 << 16;

/// The name of a chunk's file.
pub(super) fn file_name(chunk: u64, format: Format) -> String {
    format!("chunk-{chunk:06}.{}", format.extension())
}

/// The description of a chunk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct About {
    haptograph: String,
    /// See [`Batch::identity`].
    batch: String,
    chunk: u64,
    /// See [`processor_family`].
    pub processor: String,
    /// The hash of the content, as its format defines it.
    pub sha256: String,
}

/// The numbers of an array.
#[derive(Debug)]
enum Numbers {
    I64(Vec<i64>),
    U64(Vec<u64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl Numbers {
    fn descr(&self) -> &'static str {
        match self {
            Self::I64(_) => "<i8",
            Self::U64(_) => "<u8",
            Self::F32(_) => "<f4",
            Self::F64(_) => "<f8",
        }
    }

    fn zeros(samples: Samples, count: usize) -> Self {
        match samples {
            Samples::Float32 => Self::F32(vec![0.0; count]),
            Samples::Float64 => Self::F64(vec![0.0; count]),
        }
    }

    /// Stores a signal at an index.
    fn put(&mut self, start: usize, signal: &[f64]) {
        match self {
            Self::F32(numbers) => {
                let place = &mut numbers[start..start + signal.len()];
                place.iter_mut().zip(signal).for_each(|(place, x)| *place = *x as f32);
            }
            Self::F64(numbers) => numbers[start..start + signal.len()].copy_from_slice(signal),
            Self::I64(_) | Self::U64(_) => {}
        }
    }

    /// Appends some of the numbers, little-endian.
    fn append(&self, place: Range<usize>, to: &mut Vec<u8>) {
        match self {
            Self::I64(numbers) => to.extend(numbers[place].iter().flat_map(|x| x.to_le_bytes())),
            Self::U64(numbers) => to.extend(numbers[place].iter().flat_map(|x| x.to_le_bytes())),
            Self::F32(numbers) => to.extend(numbers[place].iter().flat_map(|x| x.to_le_bytes())),
            Self::F64(numbers) => to.extend(numbers[place].iter().flat_map(|x| x.to_le_bytes())),
        }
    }
}

/// The arrays of a chunk.
#[derive(Debug)]
pub(super) struct Chunk {
    number: u64,
    arrays: Vec<(&'static str, Vec<u64>, Numbers)>,
}

impl Chunk {
    /// Renders a chunk; `None` if `stop` is set. An error has the number of its job.
    pub(super) fn render(
        batch: &Batch,
        number: u64,
        stop: &AtomicBool,
    ) -> Result<Option<Self>, (u64, SynthesisError)> {
        let numbers = batch.jobs_of(number);
        let jobs: Vec<Job> = numbers.clone().map(|job| batch.job(job)).collect();
        let longest = jobs.iter().map(|job| batch.samples_of(job)).max().unwrap_or(0);
        let signals = signals(batch, &jobs, longest, stop);
        let signals = signals.map_err(|(place, error)| (numbers.start + place as u64, error))?;
        let Some((signals, [speeds, forces, outside])) = signals else {
            return Ok(None);
        };
        let (count, longest) = (jobs.len() as u64, longest as u64);
        let whole =
            |of: &dyn Fn(&Job) -> usize| Numbers::I64(jobs.iter().map(|job| of(job) as i64).collect());
        let lines = [
            ("job", Numbers::I64(numbers.map(|job| job as i64).collect())),
            ("surface", whole(&|job| job.surface)),
            ("motion", whole(&|job| job.motion)),
            ("seed", Numbers::U64(jobs.iter().map(|job| job.seed).collect())),
            ("samples", whole(&|job| batch.samples_of(job))),
            ("rate_hz", Numbers::F64(jobs.iter().map(|job| batch.rate_hz(job)).collect())),
            ("gain", Numbers::F64(jobs.iter().map(|job| job.gain).collect())),
            ("update_hz", Numbers::F64(jobs.iter().map(|job| job.update_hz).collect())),
            ("mean_speed_m_s", Numbers::F64(speeds)),
            ("mean_force_n", Numbers::F64(forces)),
            ("outside", Numbers::F64(outside)),
        ];
        let lines = lines.into_iter().map(|(name, numbers)| (name, vec![count], numbers));
        let signals = batch.signals().iter().zip(signals);
        let signals = signals.map(|(signal, numbers)| (signal.name(), vec![count, longest], numbers));
        let arrays = lines.chain(signals).collect();
        Ok(Some(Self { number, arrays }))
    }

    /// Writes the chunk atomically and returns its description.
    pub(super) fn write(&self, batch: &Batch, path: &Path) -> io::Result<About> {
        let about = About {
            haptograph: env!("CARGO_PKG_VERSION").to_owned(),
            batch: batch.identity().to_owned(),
            chunk: self.number,
            processor: processor_family(),
            sha256: String::new(),
        };
        write_atomically_by(path, |file| match batch.format() {
            Format::Npz => npz::write(self, about, file),
            Format::Parquet => parquet::write(self, about, batch, file),
        })
    }
}

/// The stored signals of some jobs, a row each; of each job the mean speed and force, and the share that is outside.
type Stored = (Vec<Numbers>, [Vec<f64>; 3]);

/// Of some jobs; `None` if `stop` is set. An error has the index of its job.
fn signals(
    batch: &Batch,
    jobs: &[Job],
    longest: usize,
    stop: &AtomicBool,
) -> Result<Option<Stored>, (usize, SynthesisError)> {
    let mut labels = [(); 3].map(|()| vec![f64::NAN; jobs.len()]);
    let zeros = |_| Numbers::zeros(batch.samples(), jobs.len() * longest);
    let mut signals: Vec<Numbers> = batch.signals().iter().map(zeros).collect();
    // Voices of one surface fill SIMD lanes best.
    let mut order: Vec<usize> = (0..jobs.len()).collect();
    order.sort_by_key(|place| jobs[*place].surface);
    for places in order.chunks(TOGETHER) {
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        for (place, (trajectory, vibration)) in places.iter().zip(&play(batch, jobs, places)?) {
            let beyond = outside(&batch.surfaces()[jobs[*place].surface].texture, trajectory);
            let of = [mean(&trajectory.speed_m_s), mean(&trajectory.force_n), beyond];
            labels.iter_mut().zip(of).for_each(|(label, of)| label[*place] = of);
            for (into, signal) in signals.iter_mut().zip(batch.signals()) {
                into.put(place * longest, signal.of(trajectory, vibration));
            }
        }
    }
    Ok(Some((signals, labels)))
}

/// The share of a motion that is beyond what was recorded, where a texture is extrapolated; NaN if it does not tell.
fn outside(texture: &TextureModel, trajectory: &Trajectory) -> f64 {
    let Some(recorded) = texture.recorded() else { return f64::NAN };
    // Ranges in mm/s may round.
    let wider = |(least, most): (f64, f64)| ((1.0 - 1e-12) * least, (1.0 + 1e-12) * most);
    let recorded = Recorded { speed_m_s: wider(recorded.speed_m_s), force_n: wider(recorded.force_n) };
    let places = trajectory.speed_m_s.iter().zip(&trajectory.force_n);
    let beyond = places.filter(|(speed_m_s, force_n)| !recorded.contains(**speed_m_s, **force_n)).count();
    beyond as f64 / trajectory.speed_m_s.len().max(1) as f64
}

/// The vibration of one job, before rounding to the chunk's precision, m/s².
pub fn vibration(batch: &Batch, job: Job) -> Result<Vec<f64>, SynthesisError> {
    let played = play(batch, &[job], &[0]).map_err(|(_, error)| error)?;
    Ok(played.into_iter().flat_map(|(_, vibration)| vibration).collect())
}

/// The results of some jobs, or the index of the job with an error.
fn play(batch: &Batch, jobs: &[Job], places: &[usize]) -> Result<Vec<Played>, (usize, SynthesisError)> {
    let trajectory = |place: &usize| {
        let job = &jobs[*place];
        batch.motion(job.motion).trajectory(batch.rate_hz(job), job.seed)
    };
    let trajectories: Vec<Trajectory> = places.iter().map(trajectory).collect();
    let mut voices = vec![];
    for (place, trajectory) in places.iter().zip(&trajectories) {
        let Job { surface, seed, update_hz, .. } = jobs[*place];
        voices.push(Voice {
            texture: &batch.surfaces()[surface].texture,
            trajectory,
            settings: SynthesisSettings { update_hz, seed, lines_seed: seed },
        });
    }
    let mut played = synthesise_many(&voices, 1).map_err(|error| (places[error.voice], error.source))?;
    for (place, vibration) in places.iter().zip(&mut played) {
        let gain = jobs[*place].gain;
        vibration.iter_mut().for_each(|sample| *sample *= gain);
    }
    Ok(trajectories.into_iter().zip(played).collect())
}

/// The motion and the vibration of a job.
type Played = (Trajectory, Vec<f64>);

/// Verifies a batch's chunk in a file and returns its description, or the reason why it is not that chunk.
pub(super) fn verify(path: &Path, format: Format, identity: &str, chunk: u64) -> Result<About, String> {
    let file = files::open(path, u64::MAX).map_err(|error| error.to_string())?;
    let read = match format {
        Format::Npz => npz::read(file.as_file()),
        Format::Parquet => parquet::read(file.as_file()).map(|(about, hash, _)| (about, hash)),
    };
    let (about, found) = read.map_err(|error| error.to_string())?;
    if about.batch != identity || about.chunk != chunk {
        return Err(format!("it is chunk {} of another batch", about.chunk));
    }
    match found == about.sha256 {
        true => Ok(about),
        false => Err("its content does not match its hash".to_owned()),
    }
}

/// An error of a file's content.
fn invalid(why: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, why)
}
