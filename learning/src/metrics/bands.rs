//! Powers in third-octave bands from 20 to 1000 Hz, of signals and of models, and the errors between two sets
//! of powers.
//!
//! Signals are estimated with several sine tapers (Riedel and Sidorenko 1995), whose resolution is never
//! coarser than the narrowest band. Only bands within the rate and with enough degrees of freedom for the
//! duration are used.

use super::multitaper::Multitaper;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Bands are centred at 1000 · 10^(k/10) Hz, for k from this value to 0: 20 Hz to 1000 Hz.
const LOWEST: i32 = -17;
/// Number of third octaves merged into one band for a short take: 20 to 40 Hz.
const LOW_BANDS: usize = 4;
/// Duration below which a take cannot resolve 20 Hz from 25 Hz, s.
pub(crate) const SHORT_S: f64 = 4.0;
/// Maximum upper edge of a band, relative to the rate.
const HIGHEST_PART: f64 = 0.45;
/// Minimum degrees of freedom of a power estimate.
const LEAST_DEGREES: f64 = 4.0;
/// Maximum number of tapers: more would only smooth what bands already sum.
const MAX_TAPERS: usize = 6;
/// Points per band at which a density is evaluated.
const POINTS: usize = 64;
/// From 40 to 250 Hz the detection threshold of the Pacinian channel, as a displacement, falls by 12 dB per
/// octave (Verrillo 1963, contactors of 2.9 cm² and more on the thenar eminence, as summarised by Gescheider
/// and Verrillo 1979, doi 10.1007/978-1-4613-3039-4_10): as an acceleration the threshold is the same in all
/// of these bands.
const PACINIAN_HZ: (f64, f64) = (40.0, 250.0);
/// Error of a band that is empty on one side only, dB.
const MAX_DB: f64 = 100.0;

/// A frequency band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// Centre on a logarithmic scale, Hz.
    pub centre_hz: f64,
    /// Lower edge, Hz.
    pub low_hz: f64,
    /// Upper edge, Hz.
    pub high_hz: f64,
}

/// The bands for vibrations of a rate and duration.
#[derive(Debug, Clone, PartialEq)]
pub struct Bands {
    bands: Vec<Band>,
}

impl Bands {
    /// Third octaves from 20 to 1000 Hz whose upper edge is below 0.45 of the rate and that have at least
    /// four degrees of freedom in `seconds`; in takes under 4 s those from 20 to 40 Hz are one band.
    pub fn counted(seconds: f64, rate_hz: f64) -> Self {
        let third = |k: i32| Band::between(10f64.powf(2.95 + f64::from(k) / 10.0), 1.0 / 10.0);
        let mut bands: Vec<Band> = (LOWEST..=0).map(third).collect();
        if seconds < SHORT_S {
            let merged = Band::between(bands[0].low_hz, LOW_BANDS as f64 / 10.0);
            bands.splice(..LOW_BANDS, [merged]);
        }
        let degrees = |band: &Band| 2.0 * seconds * (band.high_hz - band.low_hz);
        bands.retain(|band| band.high_hz < HIGHEST_PART * rate_hz && degrees(band) >= LEAST_DEGREES);
        Self { bands }
    }

    /// All bands within the rate, for models, which have no duration.
    pub(crate) fn of_rate(rate_hz: f64) -> Self {
        Self::counted(f64::INFINITY, rate_hz)
    }

    /// The bands, from low to high.
    pub fn as_slice(&self) -> &[Band] {
        &self.bands
    }

    /// Number of bands.
    pub fn len(&self) -> usize {
        self.bands.len()
    }

    /// True if there are no bands.
    pub fn is_empty(&self) -> bool {
        self.bands.is_empty()
    }

    /// Selects the bands between two frequencies, to a hundredth of a band.
    fn within(&self, low_hz: f64, high_hz: f64) -> impl Fn(usize) -> bool + '_ {
        move |band| {
            let centre_hz = self.bands[band].centre_hz;
            centre_hz >= low_hz / 1.03 && centre_hz <= high_hz * 1.03
        }
    }

    /// Powers of a signal in one or several separate pieces, weighted by length.
    pub fn of_signal<'a>(&self, pieces: impl IntoIterator<Item = &'a [f64]>, rate_hz: f64) -> BandPowers {
        self.estimator(rate_hz).of_signal(pieces)
    }

    /// What estimates the powers of many signals of a rate.
    pub(crate) fn estimator(&self, rate_hz: f64) -> Estimator {
        Estimator { bands: self.clone(), rate_hz, by_length: BTreeMap::new() }
    }

    /// Powers of a one-sided density in unit squared per Hz, as a function of frequency.
    pub(crate) fn of_density(&self, density: impl Fn(f64) -> f64) -> BandPowers {
        let power = |band: &Band| {
            let step = (band.high_hz / band.low_hz).powf(1.0 / POINTS as f64);
            let mut low_hz = band.low_hz;
            let mut sum = 0.0;
            for _ in 0..POINTS {
                let high_hz = low_hz * step;
                sum += (high_hz - low_hz) * density((low_hz * high_hz).sqrt());
                low_hz = high_hz;
            }
            sum
        };
        self.powers(self.bands.iter().map(power).collect())
    }

    fn powers(&self, powers: Vec<f64>) -> BandPowers {
        BandPowers { bands: self.clone(), powers }
    }

    /// Number of sine tapers for a piece that keeps the resolution within the narrowest band.
    fn tapers(&self, seconds: f64) -> usize {
        let width = |band: &Band| band.high_hz - band.low_hz;
        let narrowest = self.bands.iter().map(width).fold(f64::INFINITY, f64::min);
        // K tapers spread a line over K + 1 inverse durations.
        ((narrowest * seconds) as usize).saturating_sub(1).clamp(1, MAX_TAPERS)
    }
}

/// Estimates powers of signals whose pieces have few lengths: the tapers of a length are made once.
pub(crate) struct Estimator {
    pub(crate) bands: Bands,
    pub(crate) rate_hz: f64,
    by_length: BTreeMap<usize, Multitaper>,
}

impl Estimator {
    /// As [`Bands::of_signal`].
    pub(crate) fn of_signal<'a>(&mut self, pieces: impl IntoIterator<Item = &'a [f64]>) -> BandPowers {
        let mut powers = vec![0.0; self.bands.len()];
        let mut samples = 0;
        for piece in pieces {
            samples += piece.len();
            for (sum, power) in powers.iter_mut().zip(self.estimate(piece)) {
                *sum += power * piece.len() as f64;
            }
        }
        powers.iter_mut().for_each(|sum| *sum /= samples.max(1) as f64);
        self.bands.powers(powers)
    }

    /// Multitaper estimate of the power in each band.
    fn estimate(&mut self, piece: &[f64]) -> Vec<f64> {
        let Self { bands, rate_hz, by_length } = self;
        let Some(highest) = bands.bands.last().filter(|_| !piece.is_empty()) else {
            return vec![0.0; bands.len()];
        };
        let length = piece.len();
        let tapers = bands.tapers(length as f64 / *rate_hz);
        let size = length.next_power_of_two().max(2);
        let multitaper = by_length.entry(length).or_insert_with(|| {
            let scale = (2.0 / (length as f64 + 1.0)).sqrt();
            Multitaper::new([length, size, tapers], |order, n| {
                scale * (PI * order as f64 * n as f64 / (length as f64 + 1.0)).sin()
            })
        });
        let width_hz = *rate_hz / size as f64;
        let bins = ((highest.high_hz / width_hz + 0.5) as usize).saturating_add(1);
        let mut spectrum = multitaper.powers(piece, bins.min(size / 2 + 1));
        // The two-sided sum over all bins is the size times the energy; each taper has energy one.
        let all = 1.0 / (size as f64 * tapers as f64);
        spectrum.iter_mut().for_each(|power| *power *= all);
        spectrum.iter_mut().step_by(size / 2).for_each(|own| *own *= 0.5);
        let mut sums = vec![0.0];
        for power in &spectrum {
            sums.push(sums[sums.len() - 1] + power);
        }
        // Each bin's power is spread evenly over the bin.
        let below = |frequency_hz: f64| {
            let place = (frequency_hz / width_hz + 0.5).clamp(0.0, spectrum.len() as f64);
            let bin = (place as usize).min(spectrum.len() - 1);
            sums[bin] + (place - bin as f64) * spectrum[bin]
        };
        bands.bands.iter().map(|band| below(band.high_hz) - below(band.low_hz)).collect()
    }
}

impl Band {
    /// The band from a frequency up by `decades`.
    fn between(low_hz: f64, decades: f64) -> Self {
        Self { centre_hz: low_hz * 10f64.powf(0.5 * decades), low_hz, high_hz: low_hz * 10f64.powf(decades) }
    }
}

/// Powers in bands, in the signal's unit squared.
#[derive(Debug, Clone, PartialEq)]
pub struct BandPowers {
    bands: Bands,
    powers: Vec<f64>,
}

impl BandPowers {
    /// The powers, from low to high.
    pub fn powers(&self) -> &[f64] {
        &self.powers
    }

    /// Total power in all bands.
    pub(crate) fn total(&self) -> f64 {
        self.powers.iter().sum()
    }

    /// Mean of several powers in the same bands; `None` if `of` is empty.
    pub fn mean(of: &[Self]) -> Option<Self> {
        let mut mean = of.first()?.clone();
        for (band, power) in mean.powers.iter_mut().enumerate() {
            *power = of.iter().map(|powers| powers.powers[band]).sum::<f64>() / of.len() as f64;
        }
        Some(mean)
    }

    /// Shares of the power in nine bands from low to high, each of two third octaves if no band is omitted.
    pub(crate) fn shares_of_nine(&self) -> Vec<f64> {
        let total = self.total();
        let edge = |n: i32| 10f64.powf(2.95 + f64::from(LOWEST + 2 * n) / 10.0);
        let edges: Vec<f64> = (0..9).map(edge).collect();
        let mut shares = vec![0.0; 9];
        for (band, power) in self.bands.as_slice().iter().zip(&self.powers) {
            let nine = edges.iter().rposition(|edge| band.centre_hz >= *edge).unwrap_or(0);
            shares[nine] += if total > 0.0 { power / total } else { 0.0 };
        }
        shares
    }
}

/// Errors of band powers against recorded ones, positive if too loud.
#[derive(Debug, Clone, PartialEq)]
pub struct BandErrors {
    /// The bands.
    pub bands: Bands,
    /// Error of each band, dB.
    pub signed_db: Vec<f64>,
    /// Root mean square over all bands, dB.
    pub lsd_db: f64,
    /// Root mean square over the bands from 100 to 500 Hz, dB; `None` without such bands.
    pub middle_lsd_db: Option<f64>,
    /// Root mean square over the bands from 40 to 250 Hz, to which the Pacinian channel is equally sensitive,
    /// dB; 0 without such bands.
    pub pacinian_lsd_db: f64,
    /// Mean of the bands' absolute errors, dB.
    pub absolute_db: f64,
    /// Mean error of the bands from 20 to 40 Hz, dB; `None` without such bands.
    pub low_db: Option<f64>,
    /// Error of the total power, dB.
    pub total_db: f64,
    /// Share of the energy in the wrong one of nine bands, 0 to 1.
    pub misplaced: f64,
}

impl BandErrors {
    /// Errors of `played` against `recorded`, which must have the same bands.
    pub fn new(played: &BandPowers, recorded: &BandPowers) -> Self {
        let bands = &recorded.bands;
        let signed_db: Vec<f64> = differences_db(&played.powers, &recorded.powers);
        let rms_within = |low_hz, high_hz| {
            let inside = bands.within(low_hz, high_hz);
            let weights: Vec<f64> = (0..bands.len()).map(|band| f64::from(inside(band))).collect();
            weighted_rms(&signed_db, &weights)
        };
        let (have, want) = (played.shares_of_nine(), recorded.shares_of_nine());
        Self {
            lsd_db: weighted_rms(&signed_db, &vec![1.0; bands.len()]).unwrap_or(0.0),
            middle_lsd_db: rms_within(100.0, 500.0),
            pacinian_lsd_db: rms_within(PACINIAN_HZ.0, PACINIAN_HZ.1).unwrap_or(0.0),
            absolute_db: signed_db.iter().map(|db| db.abs()).sum::<f64>() / bands.len().max(1) as f64,
            low_db: mean_within(&signed_db, &bands.within(20.0, 40.0)),
            total_db: difference_db(played.total(), recorded.total()),
            misplaced: 0.5 * have.iter().zip(&want).map(|(a, b)| (a - b).abs()).sum::<f64>(),
            signed_db,
            bands: bands.clone(),
        }
    }
}

/// Root mean square of the differences between powers by band, dB; 0 without bands. A band that is empty on
/// one side only counts as 100 dB.
pub fn log_spectral_distance(a: &[f64], b: &[f64]) -> f64 {
    let differences = differences_db(a, b);
    weighted_rms(&differences, &vec![1.0; differences.len()]).unwrap_or(0.0)
}

fn differences_db(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| difference_db(*a, *b)).collect()
}

fn difference_db(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (10.0 * (a.max(0.0) / b.max(0.0)).log10()).clamp(-MAX_DB, MAX_DB) }
}

fn mean_within(values: &[f64], inside: &dyn Fn(usize) -> bool) -> Option<f64> {
    let chosen = values.iter().enumerate().filter(|(band, _)| inside(*band));
    let (sum, count) = chosen.fold((0.0, 0), |(sum, count), (_, x)| (sum + x, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

fn weighted_rms(values: &[f64], weights: &[f64]) -> Option<f64> {
    let total: f64 = weights.iter().sum();
    let squares: f64 = values.iter().zip(weights).map(|(x, w)| w * x * x).sum();
    (total > 0.0).then(|| (squares / total).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;

    const RATE_HZ: f64 = 10_000.0;

    fn noise(seed: u64, samples: usize) -> Vec<f64> {
        let mut noise = vec![0.0; samples];
        Gaussian::new(seed).fill(&mut noise);
        noise
    }

    #[test]
    fn bands_count_where_the_rate_holds_them_and_the_time_tells_them() {
        let all = Bands::counted(10.0, RATE_HZ);
        assert_eq!(all.len(), 18);
        assert!((all.as_slice()[0].centre_hz - 19.95).abs() < 0.01);
        assert!((all.as_slice()[17].centre_hz - 1000.0).abs() < 1e-6);
        assert_eq!(Bands::counted(10.0, 2200.0).len(), 17);
        // The upper edge of 126 Hz is 141, 0.45 of 356 is 160.
        let slow = Bands::counted(10.0, 356.0);
        assert!(slow.as_slice().last().is_some_and(|band| band.high_hz < 160.2));
        let short = Bands::counted(3.9, RATE_HZ);
        assert_eq!(short.len(), 15);
        assert!((short.as_slice()[0].high_hz - all.as_slice()[3].high_hz).abs() < 1e-9);
        // 0.1 s: bands of 20 Hz and more.
        let shortest = Bands::counted(0.1, RATE_HZ);
        let width = |band: &Band| band.high_hz - band.low_hz;
        assert!(shortest.as_slice().iter().all(|band| width(band) >= 20.0) && !shortest.is_empty());
    }

    #[test]
    fn white_noise_has_the_power_of_its_bandwidth_in_each_band() {
        let bands = Bands::counted(60.0, RATE_HZ);
        let powers = bands.of_signal([&*noise(1, 600_000)], RATE_HZ);
        for (band, power) in bands.as_slice().iter().zip(powers.powers()) {
            let wanted = (band.high_hz - band.low_hz) * 2.0 / RATE_HZ;
            let off_db = difference_db(*power, wanted);
            assert!(off_db.abs() < 1.0, "{} Hz: {off_db} dB", band.centre_hz);
        }
        let flat = bands.of_density(|_| 2.0 / RATE_HZ);
        assert!(log_spectral_distance(powers.powers(), flat.powers()) < 0.4);
    }

    #[test]
    fn a_tone_lies_in_its_own_band_and_has_half_its_amplitude_squared() {
        let tone: Vec<f64> =
            (0..100_000).map(|n| 3.0 * (2.0 * PI * 25.0 * n as f64 / RATE_HZ).sin()).collect();
        let powers = Bands::counted(10.0, RATE_HZ).of_signal([&*tone], RATE_HZ);
        assert!((powers.powers()[1] / 4.5 - 1.0).abs() < 0.01, "{powers:?}");
        assert!((powers.total() / 4.5 - 1.0).abs() < 0.01);
        assert!(powers.powers()[3] < 1e-4 * 4.5);
    }

    #[test]
    fn the_estimator_of_two_takes_of_one_process_is_as_sure_as_its_degrees_of_freedom() {
        // Two estimates of a band of B Hz in T s differ by 10/ln 10 sqrt(2 / (B T)) dB.
        for (samples, wanted_db) in [(100_000, 0.44), (20_000, 1.08)] {
            let bands = Bands::counted(samples as f64 / RATE_HZ, RATE_HZ);
            let pairs = (0..12u64).map(|k| {
                let powers = [2 * k, 2 * k + 1].map(|seed| {
                    let signal = noise(100 + seed, samples);
                    bands.of_signal([&*signal], RATE_HZ)
                });
                log_spectral_distance(powers[0].powers(), powers[1].powers())
            });
            let mean = pairs.sum::<f64>() / 12.0;
            assert!((mean / wanted_db - 1.0).abs() < 0.45, "{samples}: {mean} for {wanted_db}");
        }
    }

    #[test]
    fn pieces_count_by_their_length() {
        let (loud, soft) = (noise(1, 90_000), noise(2, 30_000));
        let loud: Vec<f64> = loud.iter().map(|x| 2.0 * x).collect();
        let bands = Bands::counted(12.0, RATE_HZ);
        let both = bands.of_signal([&*loud, &*soft], RATE_HZ).total();
        let wanted = 0.75 * bands.of_signal([&*loud], RATE_HZ).total()
            + 0.25 * bands.of_signal([&*soft], RATE_HZ).total();
        assert!((both / wanted - 1.0).abs() < 1e-12);
    }

    #[test]
    fn errors_say_where_what_is_played_is_too_loud() {
        let bands = Bands::counted(10.0, RATE_HZ);
        let recorded = bands.of_density(|f| 1.0 / f);
        // 6 dB too loud up to 40 Hz.
        let played = bands.of_density(|f| if f < 44.668 { 4.0 / f } else { 1.0 / f });
        let errors = BandErrors::new(&played, &recorded);
        let off_db = 10.0 * 4f64.log10();
        assert!((errors.low_db.unwrap() - off_db).abs() < 1e-3);
        assert!((errors.lsd_db - off_db * (4.0_f64 / 18.0).sqrt()).abs() < 1e-3);
        assert!((errors.absolute_db - off_db * 4.0 / 18.0).abs() < 1e-3);
        assert_eq!(errors.middle_lsd_db, Some(0.0));
        // One of nine bands.
        assert!((errors.pacinian_lsd_db - off_db / 3.0).abs() < 1e-3);
        // Of 18 equal parts the lowest 4 have become 16 of 30.
        assert!((errors.misplaced - (16.0 / 30.0 - 4.0 / 18.0)).abs() < 1e-3);
        assert!((errors.total_db - 10.0 * (30.0_f64 / 18.0).log10()).abs() < 1e-3);
    }

    #[test]
    fn silence_is_far_from_sound_and_equal_to_itself() {
        assert_eq!(log_spectral_distance(&[0.0, 1.0], &[0.0, 1.0]), 0.0);
        assert_eq!(log_spectral_distance(&[0.0], &[1.0]), 100.0);
        assert_eq!(log_spectral_distance(&[], &[]), 0.0);
    }
}
