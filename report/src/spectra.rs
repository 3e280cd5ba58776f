//! Spectra of a signal of any length: over time, and their mean.

use super::plot::{Mark, Style, Weight};
use super::theme::Ink;
use haptograph_signal::spectrum::Spectrogram;
use haptograph_signal::window::Window;

/// Frequency range of mean spectra on pages, Hz: motion lies below, and frequencies above are not felt.
pub(crate) const SHOWN_HZ: (f64, f64) = (20.0, 5000.0);

/// Receptors of the hand with the bands that they respond to, Hz (thesis, Table 1.1). Those of SA-I and SA-II end at 5 Hz,
/// below all that is shown.
const RECEPTORS: [(&str, (f64, f64)); 2] = [("FA-I", (5.0, 50.0)), ("FA-II", (20.0, 1000.0))];
/// Levels of the two lines of receptors above the highest density, dB; a frame ends at the last.
const LEVELS_DB: [f64; 3] = [6.0, 12.0, 18.0];

/// The highest density of a frame that has [`receptors`] above a highest one.
pub(crate) fn top_with_receptors(loudest: f64) -> f64 {
    loudest * 10f64.powf(LEVELS_DB[2] / 10.0)
}

/// The bands of the receptors above a highest density: a line over the shown part of each, and its name.
pub(crate) fn receptors(shown_hz: (f64, f64), loudest: f64) -> [Mark; 2] {
    let (mut lines, mut names) = (vec![], vec![]);
    for ((name, band), db) in RECEPTORS.into_iter().zip(LEVELS_DB) {
        let (low, high) = (band.0.max(shown_hz.0), band.1.min(shown_hz.1));
        let level = loudest * 10f64.powf(db / 10.0);
        lines.push([(low, level), (high, level)]);
        names.push(((low * high).sqrt(), level, format!("{name}, {} to {} Hz", band.0, band.1)));
    }
    [Mark::Segments(Style::of(Ink::Grey).weight(Weight::Hair), lines), Mark::Words(names)]
}

/// Approximate bin width of a spectrogram, Hz: separates resonances, and the segments are short enough for
/// strokes.
const COARSE_HZ: f64 = 20.0;
/// Bin width of a mean spectrum, Hz.
const FINE_HZ: f64 = 5.0;
/// Maximum number of columns of a spectrogram; joining leaves at least half as many.
const MAX_COLUMNS: usize = 720;

/// Columns of spectral density, of which neighbours are averaged if there are too many, and the mean at a
/// finer resolution.
#[derive(Debug, Clone)]
pub struct Spectra {
    coarse: Segments,
    /// Segments averaged in a column.
    every: usize,
    columns: Vec<Vec<f64>>,
    open: Vec<f64>,
    in_open: usize,
    fine: Segments,
    fine_sum: Vec<f64>,
    fine_count: usize,
}

/// A signal cut into overlapping segments.
#[derive(Debug, Clone)]
struct Segments {
    rate_hz: f64,
    samples: usize,
    /// Samples not yet used by a complete segment.
    waiting: Vec<f64>,
}

impl Segments {
    fn new(rate_hz: f64, bin_hz: f64) -> Self {
        Self {
            rate_hz,
            samples: ((rate_hz / bin_hz) as usize).next_power_of_two().clamp(64, 16_384),
            waiting: Vec::new(),
        }
    }

    fn bin_hz(&self) -> f64 {
        self.rate_hz / self.samples as f64
    }

    /// Adds samples; `row` receives the densities of each segment. Segments are processed in batches, which
    /// share the windows and transforms.
    fn extend(&mut self, samples: &[f64], row: impl FnMut(&[f64])) {
        // One NaN or infinite sample would spoil a whole segment.
        let finite = samples.iter().map(|x| if x.is_finite() { *x } else { 0.0 });
        self.waiting.extend(finite);
        let batch = 16 * self.samples;
        let whole = self.waiting.len() / batch * batch;
        self.take(whole, row);
    }

    fn take(&mut self, samples: usize, mut row: impl FnMut(&[f64])) {
        let (segment, half) = (self.samples, self.samples / 2);
        let Some(part) = self.waiting.get(..samples).filter(|part| part.len() >= segment) else {
            return;
        };
        let Ok(rows) = Spectrogram::new(part, self.rate_hz, segment, half, Window::Hann) else {
            return;
        };
        (0..rows.time_s.len()).for_each(|i| row(rows.row(i)));
        self.waiting.drain(..rows.time_s.len() * half);
    }
}

impl Spectra {
    /// Spectra of a signal with `rate_hz` samples per second.
    pub(super) fn new(rate_hz: f64) -> Self {
        Self {
            coarse: Segments::new(rate_hz, COARSE_HZ),
            every: 1,
            columns: Vec::new(),
            open: Vec::new(),
            in_open: 0,
            fine: Segments::new(rate_hz, FINE_HZ),
            fine_sum: Vec::new(),
            fine_count: 0,
        }
    }

    /// Adds samples.
    pub(super) fn extend(&mut self, samples: &[f64]) {
        let mut rows: Vec<Vec<f64>> = Vec::new();
        self.coarse.extend(samples, |row| rows.push(row.to_vec()));
        rows.iter().for_each(|row| self.push(row));
        let (sum, count) = (&mut self.fine_sum, &mut self.fine_count);
        self.fine.extend(samples, |row| add(sum, count, row));
    }

    fn push(&mut self, row: &[f64]) {
        add(&mut self.open, &mut self.in_open, row);
        if self.in_open < self.every {
            return;
        }
        let scale = 1.0 / self.every as f64;
        self.columns.push(self.open.drain(..).map(|sum| sum * scale).collect());
        self.in_open = 0;
        if self.columns.len() == MAX_COLUMNS {
            let mean = |pair: &[Vec<f64>]| match pair {
                [a, b] => a.iter().zip(b).map(|(x, y)| (x + y) / 2.0).collect(),
                other => other.concat(),
            };
            self.columns = self.columns.chunks(2).map(mean).collect();
            self.every *= 2;
        }
    }

    /// Uses the remaining samples; call it at the end of the signal.
    pub fn finish(&mut self) {
        let mut rows: Vec<Vec<f64>> = Vec::new();
        let waiting = self.coarse.waiting.len();
        self.coarse.take(waiting, |row| rows.push(row.to_vec()));
        rows.iter().for_each(|row| self.push(row));
        let waiting = self.fine.waiting.len();
        let (sum, count) = (&mut self.fine_sum, &mut self.fine_count);
        self.fine.take(waiting, |row| add(sum, count, row));
    }

    /// Bin width of the columns, Hz.
    pub(crate) fn bin_hz(&self) -> f64 {
        self.coarse.bin_hz()
    }

    /// Densities from 0 Hz on, in the signal's unit squared per hertz; one column per time step.
    pub(crate) fn columns(&self) -> &[Vec<f64>] {
        &self.columns
    }

    /// Welch's estimate over the whole signal: (frequency in Hz, density), without 0 Hz. For a signal shorter
    /// than a fine segment, the mean of the columns; empty if there are none.
    pub(crate) fn mean(&self) -> Vec<(f64, f64)> {
        let (bin_hz, sum, count) = match self.fine_count {
            0 => {
                let (mut sum, mut count) = (Vec::new(), 0);
                self.columns.iter().for_each(|column| add(&mut sum, &mut count, column));
                (self.coarse.bin_hz(), sum, count)
            }
            count => (self.fine.bin_hz(), self.fine_sum.clone(), count),
        };
        let point = |(bin, sum): (usize, f64)| (bin as f64 * bin_hz, sum / count as f64);
        sum.into_iter().enumerate().skip(1).map(point).collect()
    }

    /// The mean spectrum over `SHOWN_HZ`, from the bin that contains its lower end.
    pub(crate) fn shown(&self) -> Vec<(f64, f64)> {
        let mut points = self.mean();
        let lowest = shown_from(&points);
        points.drain(..lowest);
        points.retain(|(hz, density)| *hz <= SHOWN_HZ.1 && *density > 0.0);
        points
    }

    /// Frequency of the maximum of [`Self::shown`], Hz, interpolated by a parabola through the levels of the
    /// strongest bin and its neighbours. `None` for silence.
    pub(crate) fn strongest_hz(&self) -> Option<f64> {
        let points = self.mean();
        let shown = points.iter().enumerate().skip(shown_from(&points));
        let shown = shown.filter(|(_, (hz, density))| *hz <= SHOWN_HZ.1 && *density > 0.0);
        let (peak, (hz, top)) = shown.max_by(|(_, a), (_, b)| a.1.total_cmp(&b.1))?;
        let level = |bin: usize| points.get(bin).map(|(hz, density)| (*hz, density.max(1e-300).ln()));
        let Some(((_, below), (next_hz, above))) = peak.checked_sub(1).and_then(level).zip(level(peak + 1))
        else {
            return Some(*hz);
        };
        let bend = below - 2.0 * top.ln() + above;
        let beside = if bend < 0.0 { 0.5 * (below - above) / bend } else { 0.0 };
        Some((hz + beside.clamp(-0.5, 0.5) * (next_hz - hz)).max(SHOWN_HZ.0))
    }
}

/// Index of the first point whose bin reaches into [`SHOWN_HZ`].
fn shown_from(points: &[(f64, f64)]) -> usize {
    let half_hz = points.first().map_or(0.0, |(bin_hz, _)| 0.5 * bin_hz);
    points.partition_point(|(hz, _)| hz + half_hz <= SHOWN_HZ.0)
}

/// Adds a row to a sum of rows.
fn add(sum: &mut Vec<f64>, count: &mut usize, row: &[f64]) {
    sum.resize(row.len(), 0.0);
    sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
    *count += 1;
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn tone(hz: f64, rate_hz: u32, seconds: u32) -> Spectra {
        let rate = f64::from(rate_hz);
        let mut spectra = Spectra::new(rate);
        let samples: Vec<f64> =
            (0..seconds * rate_hz).map(|i| (TAU * hz * f64::from(i) / rate).sin()).collect();
        samples.chunks(777).for_each(|block| spectra.extend(block));
        spectra.finish();
        spectra
    }

    #[test]
    fn a_tone_stands_at_its_frequency_for_the_whole_run() {
        let spectra = tone(500.0, 10_000, 60);
        assert!(spectra.columns().len() <= MAX_COLUMNS);
        let duration_s =
            (spectra.columns.len() * spectra.every * spectra.coarse.samples / 2) as f64 / 10_000.0;
        assert!((duration_s - 60.0).abs() < 1.0, "{duration_s}");
        let mean = spectra.mean();
        let bin_hz = mean[1].0 - mean[0].0;
        assert!(bin_hz < 5.01);
        let power: f64 = mean.iter().map(|(_, density)| density).sum::<f64>() * bin_hz;
        assert!((power - 0.5).abs() < 0.01, "{power}");
    }

    #[test]
    fn receptors_are_named_over_the_shown_part_of_their_bands() {
        let [Mark::Segments(_, lines), Mark::Words(names)] = receptors(SHOWN_HZ, 1.0) else {
            panic!("a line and a name each");
        };
        let bands: Vec<_> = lines.iter().map(|[from, to]| (from.0, to.0)).collect();
        assert_eq!(bands, [(20.0, 50.0), (20.0, 1000.0)]);
        assert!(names[0].2.starts_with("FA-I,") && names[1].2.starts_with("FA-II,"));
        assert!(lines.iter().flatten().all(|(_, level)| *level < top_with_receptors(1.0)));
    }

    #[test]
    fn the_strongest_frequency_lies_between_bins_of_the_whole_shown_range() {
        for (rate_hz, hz) in [(48_000, 120.0), (10_000, 22.0), (10_000, 31.5), (10_000, 245.0), (2_000, 60.0)]
        {
            let found = tone(hz, rate_hz, 2).strongest_hz().unwrap();
            assert!((found - hz).abs() < 0.6, "{found} of {hz} at {rate_hz}");
        }
        assert_eq!(Spectra::new(10_000.0).strongest_hz(), None);
    }

    #[test]
    fn a_mean_beside_a_tone_is_not_taken_for_it() {
        let mut spectra = Spectra::new(10_000.0);
        let samples: Vec<f64> =
            (0..20_000).map(|i| 5.0 + 0.01 * (TAU * 40.0 * f64::from(i) / 1e4).sin()).collect();
        spectra.extend(&samples);
        spectra.finish();
        assert!((spectra.strongest_hz().unwrap() - 40.0).abs() < 0.6);
    }
}
