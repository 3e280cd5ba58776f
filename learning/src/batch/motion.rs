//! The speed and force of jobs.

use super::document::Motion;
use super::hash;
use super::problem::PlanProblem;
use crate::processing;
use haptograph_surfaces::rendering::{RandomWalk, Trajectory};

use crate::recording::{self, ImportSettings, Series};
use haptograph_signal::noise::stream_seed;
use std::path::Path;

/// The longest motion, s.
const MAX_SECONDS: f64 = 3600.0;

/// A motion with its data.
#[derive(Debug)]
pub(super) enum Source {
    Walk(RandomWalk),
    Constant {
        seconds: f64,
        speed_m_s: f64,
        force_n: f64,
    },
    /// Speed and force, and the hash of their file.
    Recording {
        file: String,
        sha256: String,
        series: Series<[f64; 2]>,
    },
}

impl Source {
    /// Loads a plan's motion; paths are relative to `folder`. The ranges are what all surfaces recorded, m/s and N.
    pub(super) fn of(
        motion: &Motion,
        folder: &Path,
        [speed_m_s, usual_n]: [Option<(f64, f64)>; 2],
    ) -> Result<Self, PlanProblem> {
        match motion {
            Motion::RandomWalk { seconds, speed_mm_s, force_n, cutoff_hz } => {
                let usual = speed_m_s.map(|(slow, fast)| (1e3 * slow, 1e3 * fast));
                let missing = |range| PlanProblem::NoRange { range };
                let speed_mm_s = &speed_mm_s.or(usual).ok_or(missing("speed_mm_s"))?;
                let force_n = &force_n.or(usual_n).ok_or(missing("force_n"))?;
                let (slow, fast) = *speed_mm_s;
                check_seconds(*seconds)?;
                check(
                    "speed_mm_s",
                    format!("{speed_mm_s:?}"),
                    0.0 <= slow && slow <= fast && fast <= 1e5,
                    RANGE,
                )?;
                let (light, firm) = *force_n;
                check(
                    "force_n",
                    format!("{force_n:?}"),
                    0.0 <= light && light <= firm && firm <= 1e3,
                    RANGE,
                )?;
                let is_slow = 0.0 < *cutoff_hz && *cutoff_hz <= 40.0;
                check("cutoff_hz", cutoff_hz.to_string(), is_slow, "above 0 and at most 40")?;
                Ok(Self::Walk(RandomWalk {
                    seconds: *seconds,
                    speed_m_s: (slow / 1e3, fast / 1e3),
                    force_n: *force_n,
                    cutoff_hz: *cutoff_hz,
                    ..RandomWalk::default()
                }))
            }
            Motion::Constant { seconds, speed_mm_s, force_n } => {
                check_seconds(*seconds)?;
                check(
                    "speed_mm_s",
                    speed_mm_s.to_string(),
                    (0.0..=1e5).contains(speed_mm_s),
                    "from 0 to 100000",
                )?;
                check("force_n", force_n.to_string(), (0.0..=1e3).contains(force_n), "from 0 to 1000")?;
                Ok(Self::Constant { seconds: *seconds, speed_m_s: speed_mm_s / 1e3, force_n: *force_n })
            }
            Motion::Recording(file) => Self::recorded(file, &folder.join(file)),
        }
    }

    fn recorded(file: &str, path: &Path) -> Result<Self, PlanProblem> {
        let import = ImportSettings { keeps_offset: true, ..ImportSettings::strict() };
        let (recording, _) = recording::load_with(&[path.to_owned()], &import)?;
        let recording = processing::processed(&recording, &Default::default())?;
        let signals = recording.signals();
        let both = signals.speed_m_s.iter().zip(&signals.force_normal_n);
        let series = Series::new(signals.rate_hz, both.map(|(speed, force)| [*speed, *force]).collect());
        check(
            "the recording's length, s",
            series.end_s().to_string(),
            !series.samples.is_empty() && series.end_s() <= MAX_SECONDS,
            "at most 3600",
        )?;
        // The content that was read, from any number of files.
        let frames = series.samples.iter().flatten().copied();
        let bytes = std::iter::once(series.rate_hz).chain(frames);
        let sha256 = hash(&bytes.flat_map(f64::to_le_bytes).collect::<Vec<u8>>());
        Ok(Self::Recording { file: file.to_owned(), sha256, series })
    }

    /// The number of samples at a rate.
    pub(super) fn samples(&self, rate_hz: f64) -> usize {
        match self {
            Self::Walk(walk) => (walk.seconds * rate_hz) as usize,
            Self::Constant { seconds, .. } => (seconds * rate_hz) as usize,
            Self::Recording { series, .. } if series.rate_hz == rate_hz => series.samples.len(),
            Self::Recording { series, .. } => (series.end_s() * rate_hz) as usize + 1,
        }
    }

    /// The motion at a rate. A random walk depends on the job's seed, not on the surface.
    pub(super) fn trajectory(&self, rate_hz: f64, seed: u64) -> Trajectory {
        let samples = self.samples(rate_hz);
        match self {
            Self::Walk(walk) => {
                let seed = stream_seed(seed, "motion");
                RandomWalk { rate_hz, seed, ..*walk }.trajectory()
            }
            Self::Constant { speed_m_s, force_n, .. } => {
                Trajectory { rate_hz, speed_m_s: vec![*speed_m_s; samples], force_n: vec![*force_n; samples] }
            }
            Self::Recording { series, .. } => {
                let at = |n: usize| {
                    let (before, part) = series.place(n as f64 / rate_hz);
                    let [a, b] =
                        [before, (before + 1).min(series.samples.len() - 1)].map(|i| series.samples[i]);
                    std::array::from_fn(|i| if part == 0.0 { a[i] } else { a[i] + part * (b[i] - a[i]) })
                };
                let both: Vec<[f64; 2]> = match series.rate_hz == rate_hz {
                    true => series.samples.clone(),
                    false => (0..samples).map(at).collect(),
                };
                let [speed_m_s, force_n] = [0, 1].map(|i| both.iter().map(|both| both[i]).collect());
                Trajectory { rate_hz, speed_m_s, force_n }
            }
        }
    }
}

const RANGE: &str = "two numbers from 0 on, the smaller first";

fn check_seconds(seconds: f64) -> Result<(), PlanProblem> {
    let fits = 0.0 < seconds && seconds <= MAX_SECONDS;
    check("seconds", seconds.to_string(), fits, "above 0 and at most 3600")
}

fn check(what: &'static str, value: String, fits: bool, expected: &'static str) -> Result<(), PlanProblem> {
    match fits {
        true => Ok(()),
        false => Err(PlanProblem::Range { what, value, expected }),
    }
}
