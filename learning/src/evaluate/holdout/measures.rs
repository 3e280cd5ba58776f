//! Error measures between rendered and recorded vibrations.

use super::HoldoutSettings;
use super::folds::Lengths;
use super::methods::Player;
use crate::metrics::bands::Estimator;
use crate::metrics::fluctuation::{Fluctuation, FluctuationErrors};
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

/// Errors of a method on a test part, rendered from several seeds, whose powers are averaged.
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
    /// Errors of the rendering of each seed; of the floor, those of stretches of the training part as long as the shortest piece
    /// of both parts.
    pub(super) seeds: Vec<SeedErrors>,
}

/// Errors of one rendering by itself.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SeedErrors {
    /// Log-spectral distance, dB.
    pub(super) lsd_db: f64,
    /// Errors of the fluctuation, of each piece of the test part that has one.
    fluctuation: Vec<FluctuationErrors>,
}

impl SeedErrors {
    /// Mean of an error over the pieces; `None` without any.
    pub(super) fn mean(&self, error: fn(&FluctuationErrors) -> f64) -> Option<f64> {
        let errors: Vec<f64> = self.fluctuation.iter().map(error).collect();
        (!errors.is_empty()).then(|| mean(&errors))
    }
}

/// A test part with its training part.
pub(super) struct Target<'a> {
    train: &'a [ProcessedRecording],
    test: &'a [ProcessedRecording],
    pub(super) estimator: Estimator,
    recorded: BandPowers,
    /// Of each piece of the test part; `None` where it has none.
    fluctuations: Vec<Option<Fluctuation>>,
}

impl<'a> Target<'a> {
    pub(super) fn new([train, test]: [&'a [ProcessedRecording]; 2], lengths: &Lengths) -> Self {
        let mut estimator = estimator(lengths);
        let recorded = estimator.of_signal(vibrations(test));
        let of = |piece: &[f64]| Fluctuation::of(piece, estimator.rate_hz);
        let fluctuations = vibrations(test).map(of).collect();
        Self { train, test, estimator, recorded, fluctuations }
    }

    /// The errors of pieces in the place of the test part's.
    fn seed_errors(&self, powers: &BandPowers, pieces: &[&[f64]]) -> SeedErrors {
        let errors = pieces.iter().zip(&self.fluctuations).filter_map(|(piece, recorded)| {
            Some(Fluctuation::of(piece, self.estimator.rate_hz)?.errors(recorded.as_ref()?))
        });
        SeedErrors {
            lsd_db: log_spectral_distance(powers.powers(), self.recorded.powers()),
            fluctuation: errors.collect(),
        }
    }

    /// The errors of stretches of the training part as long as the shortest piece, each in turn the first of as many as the test
    /// part has pieces.
    fn stretches(&mut self) -> Vec<SeedErrors> {
        let (train, pieces) = (self.train, self.test.len());
        let length =
            vibrations(train).chain(vibrations(self.test)).map(<[f64]>::len).min().unwrap_or(0).max(1);
        let stretches: Vec<&[f64]> = vibrations(train).flat_map(|piece| piece.chunks_exact(length)).collect();
        let errors = (0..stretches.len()).map(|first| {
            let from: Vec<&[f64]> = stretches.iter().cycle().skip(first).take(pieces).copied().collect();
            let powers = self.estimator.of_signal(from.iter().copied());
            self.seed_errors(&powers, &from)
        });
        errors.collect()
    }

    /// The training part compared with the test part.
    pub(super) fn floor(&mut self) -> Measures {
        let trained = self.estimator.of_signal(vibrations(self.train));
        Measures {
            bands: BandErrors::new(&trained, &self.recorded),
            kurtosis: kurtosis(vibrations(self.train)) - kurtosis(vibrations(self.test)),
            envelope_db: None,
            envelope_floor_db: None,
            nse_pe: None,
            seeds: self.stretches(),
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
}

/// Estimates powers in the bands that both parts of a fold resolve.
fn estimator(lengths: &Lengths) -> Estimator {
    let [trained_s, tested_s] = lengths.each_ref().map(|(rate_hz, pieces)| {
        let seconds = pieces.iter().map(|samples| *samples as f64 / f64::from_bits(*rate_hz));
        seconds.sum::<f64>()
    });
    let rate_hz = f64::from_bits(lengths[1].0);
    Bands::counted(trained_s.min(tested_s), rate_hz).estimator(rate_hz)
}

/// Distance of the estimator itself: between two takes of white noise with the lengths of the two parts, and between one of
/// them and the mean over as many seeds as are used.
pub(super) fn estimator_db(lengths: &Lengths, seeds: u64) -> (f64, f64) {
    let mut estimator = estimator(lengths);
    let mut white = |part: usize, seed: u64| {
        let mut noise = Gaussian::new(0x5eed ^ seed);
        let pieces = lengths[part].1.iter();
        let pieces: Vec<Vec<f64>> =
            pieces.map(|samples| (0..*samples).map(|_| noise.next_sample()).collect()).collect();
        estimator.of_signal(pieces.iter().map(Vec::as_slice))
    };
    let tests: Vec<BandPowers> = (0..seeds.max(STATIONARY)).map(|k| white(1, 2 * k)).collect();
    let mean_of_seeds = BandPowers::mean(&tests);
    let distances = (0..STATIONARY).map(|k| {
        let trained = white(0, 2 * k + 1);
        let alone = log_spectral_distance(trained.powers(), tests[k as usize].powers());
        let against =
            mean_of_seeds.as_ref().map_or(0.0, |mean| log_spectral_distance(trained.powers(), mean.powers()));
        (alone, against)
    });
    let (alone, against): (Vec<f64>, Vec<f64>) = distances.unzip();
    (mean(&alone), mean(&against))
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
    target: &mut Target<'_>,
    settings: &HoldoutSettings,
) -> Result<Measures, SynthesisError> {
    let rate_hz = target.estimator.rate_hz;
    let trajectories: Vec<Trajectory> = target.test.iter().map(ProcessedRecording::trajectory).collect();
    let recorded: Vec<Vec<f64>> = vibrations(target.test).map(|x| levels_db(x, rate_hz)).collect();
    let (mut powers, mut kurtoses, mut envelopes, mut floors) = (vec![], vec![], vec![], vec![]);
    let mut last: Option<Vec<Vec<f64>>> = None;
    let mut nse_pe = None;
    let mut seeds = vec![];
    let mut ahead = VecDeque::new();
    for seed in 0..settings.seeds.max(1) {
        if ahead.is_empty() {
            ahead = play_seeds(player, &trajectories, settings, seed)?;
        }
        let played: Vec<Vec<f64>> = ahead.drain(..trajectories.len()).collect();
        let pieces = || played.iter().map(Vec::as_slice);
        let of_seed = target.estimator.of_signal(pieces());
        seeds.push(target.seed_errors(&of_seed, &pieces().collect::<Vec<_>>()));
        powers.push(of_seed);
        kurtoses.push(kurtosis(pieces()));
        let levels: Vec<Vec<f64>> = pieces().map(|x| levels_db(x, rate_hz)).collect();
        envelopes.push(envelopes_apart(&levels, &recorded));
        if let Some(last) = &last {
            floors.push(envelopes_apart(&levels, last));
        }
        last = Some(levels);
        if seed == 0 {
            nse_pe = windowed(&played, target);
        }
    }
    let powers = BandPowers::mean(&powers);
    Ok(Measures {
        bands: BandErrors::new(powers.as_ref().unwrap_or(&target.recorded), &target.recorded),
        kurtosis: mean(&kurtoses) - kurtosis(vibrations(target.test)),
        envelope_db: Some(mean(&envelopes)),
        envelope_floor_db: (!floors.is_empty()).then(|| mean(&floors)),
        nse_pe,
        seeds,
    })
}

fn envelopes_apart(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let apart: Vec<f64> = a.iter().zip(b).map(|(a, b)| envelope_error_db(a, b)).collect();
    mean(&apart)
}

/// Window errors, as means over the pieces.
fn windowed(played: &[Vec<f64>], target: &Target<'_>) -> Option<(f64, f64)> {
    let rate_hz = target.estimator.rate_hz;
    let windows = WindowSettings::comparison_at(rate_hz);
    let found = played.iter().zip(vibrations(target.test)).map(|(played, recorded)| {
        let found = compare(played, recorded, rate_hz, &windows).ok()?;
        Some((found.nse, found.pe))
    });
    let found: Vec<(f64, f64)> = found.collect::<Option<_>>()?;
    let (nse, pe): (Vec<f64>, Vec<f64>) = found.into_iter().unzip();
    Some((mean(&nse), mean(&pe)))
}
