//! Error measures between rendered and recorded vibrations.

use super::HoldoutSettings;
use super::methods::Player;
use crate::metrics::level::{envelope_error_db, excess_kurtosis, levels_db, unexplained_level_db};
use crate::metrics::{BandErrors, BandPowers, Bands, WindowSettings, compare, log_spectral_distance};
use crate::recording::ProcessedRecording;
use haptograph_signal::noise::Gaussian;
use haptograph_signal::statistics::mean;
use haptograph_surfaces::rendering::{SynthesisError, Trajectory};
use std::collections::VecDeque;

/// Number of pairs of stationary takes that determine the distance of the estimator itself.
const STATIONARY: u64 = 8;
/// Maximum number of samples rendered ahead, unless a single seed is longer: 128 MiB.
const MAX_SAMPLES: usize = 16 << 20;

/// Errors of a method on a test part. The rendering is Gaussian noise of several seeds, whose powers are
/// averaged.
#[derive(Debug, Clone, PartialEq)]
pub struct Measures {
    /// Errors per band and over bands.
    pub bands: BandErrors,
    /// Excess kurtosis minus that of the recording.
    pub kurtosis: f64,
    /// RMS difference of the levels over 50 ms, dB; `None` for the floor.
    pub envelope_db: Option<f64>,
    /// RMS difference of the levels over 50 ms between two seeds of the method, dB.
    pub envelope_floor_db: Option<f64>,
    /// Normalised spectral error and power error of the first seed, Eq. 2.5.1 and 2.5.2; `None` for the
    /// floor.
    pub nse_pe: Option<(f64, f64)>,
}

/// A test part with its training part.
pub(super) struct Target<'a> {
    train: &'a [ProcessedRecording],
    test: &'a [ProcessedRecording],
    rate_hz: f64,
    bands: Bands,
    recorded: BandPowers,
}

impl<'a> Target<'a> {
    pub(super) fn new(train: &'a [ProcessedRecording], test: &'a [ProcessedRecording]) -> Self {
        let rate_hz = test.first().map_or(1.0, ProcessedRecording::rate_hz);
        let bands = Bands::counted(seconds(train).min(seconds(test)), rate_hz);
        let recorded = bands.of_signal(vibrations(test), rate_hz);
        Self { train, test, rate_hz, bands, recorded }
    }

    pub(super) fn bands(&self) -> &Bands {
        &self.bands
    }

    /// The training part compared with the test part.
    pub(super) fn floor(&self) -> Measures {
        let trained = self.bands.of_signal(vibrations(self.train), self.rate_hz);
        Measures {
            bands: BandErrors::new(&trained, &self.recorded),
            kurtosis: kurtosis(vibrations(self.train)) - kurtosis(vibrations(self.test)),
            envelope_db: None,
            envelope_floor_db: None,
            nse_pe: None,
        }
    }

    /// Part of the test part's levels that force and speed do not explain, dB; mean over its pieces.
    pub(super) fn unexplained_level_db(&self) -> Option<f64> {
        let left = self.test.iter().map(|piece| {
            let s = piece.signals();
            unexplained_level_db(&s.acceleration_m_s2, &s.speed_m_s, &s.force_normal_n, s.rate_hz)
        });
        left.collect::<Option<Vec<f64>>>().map(|left| mean(&left))
    }

    /// Distance of the estimator itself: between two takes of white noise with the lengths of the two parts,
    /// and between one of them and the mean over as many seeds as are used.
    pub(super) fn estimator_db(&self, seeds: u64) -> (f64, f64) {
        let white = |parts: &[ProcessedRecording], seed: u64| {
            let mut noise = Gaussian::new(0x5eed ^ seed);
            let pieces: Vec<Vec<f64>> =
                parts.iter().map(|part| (0..part.samples()).map(|_| noise.next_sample()).collect()).collect();
            self.bands.of_signal(pieces.iter().map(Vec::as_slice), self.rate_hz)
        };
        let tests: Vec<BandPowers> = (0..seeds.max(STATIONARY)).map(|k| white(self.test, 2 * k)).collect();
        let mean_of_seeds = BandPowers::mean(&tests);
        let distances = (0..STATIONARY).map(|k| {
            let trained = white(self.train, 2 * k + 1);
            let alone = log_spectral_distance(trained.powers(), tests[k as usize].powers());
            let against = mean_of_seeds
                .as_ref()
                .map_or(0.0, |mean| log_spectral_distance(trained.powers(), mean.powers()));
            (alone, against)
        });
        let (alone, against): (Vec<f64>, Vec<f64>) = distances.unzip();
        (mean(&alone), mean(&against))
    }
}

fn seconds(parts: &[ProcessedRecording]) -> f64 {
    parts.iter().map(|part| part.samples() as f64 / part.rate_hz()).sum()
}

fn vibrations(parts: &[ProcessedRecording]) -> impl Iterator<Item = &[f64]> {
    parts.iter().map(|part| part.signals().acceleration_m_s2.as_slice())
}

/// Mean over the pieces, weighted by length.
fn kurtosis<'a>(pieces: impl Iterator<Item = &'a [f64]>) -> f64 {
    let (sum, samples) = pieces.fold((0.0, 0), |(sum, samples), piece| {
        (sum + excess_kurtosis(piece) * piece.len() as f64, samples + piece.len())
    });
    sum / samples.max(1) as f64
}

/// The vibrations of a seed along each trajectory, and of as many following seeds as fit into a bank and into
/// memory.
fn play_seeds(
    player: &Player,
    trajectories: &[Trajectory],
    settings: &HoldoutSettings,
    first: u64,
) -> Result<VecDeque<Vec<f64>>, SynthesisError> {
    let samples: usize = trajectories.iter().map(|along| along.speed_m_s.len()).sum();
    let at_once = (MAX_SAMPLES / samples.max(1)).clamp(1, 16) as u64;
    let seeds = first..settings.seeds.max(1).min(first + at_once);
    // Each piece has its own excitation noise.
    let seeded = |seed: u64| {
        let pieces = trajectories.iter().zip(0..);
        pieces.map(move |(along, piece)| (along, settings.seed.wrapping_add(seed + 1000 * piece)))
    };
    let each: Vec<(&Trajectory, u64)> = seeds.flat_map(seeded).collect();
    Ok(player.play(&each)?.into())
}

/// Renders a learned texture along the test part and measures the errors.
pub(super) fn measured(
    player: &Player,
    target: &Target<'_>,
    settings: &HoldoutSettings,
) -> Result<Measures, SynthesisError> {
    let trajectories: Vec<Trajectory> = target.test.iter().map(ProcessedRecording::trajectory).collect();
    let recorded: Vec<Vec<f64>> = vibrations(target.test).map(|x| levels_db(x, target.rate_hz)).collect();
    let (mut powers, mut kurtoses, mut envelopes, mut floors) = (vec![], vec![], vec![], vec![]);
    let mut last: Option<Vec<Vec<f64>>> = None;
    let mut nse_pe = None;
    let mut ahead = VecDeque::new();
    for seed in 0..settings.seeds.max(1) {
        if ahead.is_empty() {
            ahead = play_seeds(player, &trajectories, settings, seed)?;
        }
        let played: Vec<Vec<f64>> = ahead.drain(..trajectories.len()).collect();
        let pieces = || played.iter().map(Vec::as_slice);
        powers.push(target.bands.of_signal(pieces(), target.rate_hz));
        kurtoses.push(kurtosis(pieces()));
        let levels: Vec<Vec<f64>> = pieces().map(|x| levels_db(x, target.rate_hz)).collect();
        envelopes.push(envelopes_apart(&levels, &recorded));
        if let Some(last) = &last {
            floors.push(envelopes_apart(&levels, last));
        }
        last = Some(levels);
        if seed == 0 {
            nse_pe = windowed(&played, target);
        }
    }
    let bands = match BandPowers::mean(&powers) {
        Some(powers) => BandErrors::new(&powers, &target.recorded),
        None => BandErrors::new(&target.recorded, &target.recorded),
    };
    Ok(Measures {
        bands,
        kurtosis: mean(&kurtoses) - kurtosis(vibrations(target.test)),
        envelope_db: Some(mean(&envelopes)),
        envelope_floor_db: (!floors.is_empty()).then(|| mean(&floors)),
        nse_pe,
    })
}

fn envelopes_apart(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let apart: Vec<f64> = a.iter().zip(b).map(|(a, b)| envelope_error_db(a, b)).collect();
    mean(&apart)
}

/// Window errors, as means over the pieces.
fn windowed(played: &[Vec<f64>], target: &Target<'_>) -> Option<(f64, f64)> {
    let windows = WindowSettings::comparison_at(target.rate_hz);
    let found = played.iter().zip(vibrations(target.test)).map(|(played, recorded)| {
        let found = compare(played, recorded, target.rate_hz, &windows).ok()?;
        Some((found.nse, found.pe))
    });
    let found: Vec<(f64, f64)> = found.collect::<Option<_>>()?;
    let (nse, pe): (Vec<f64>, Vec<f64>) = found.into_iter().unzip();
    Some((mean(&nse), mean(&pe)))
}
