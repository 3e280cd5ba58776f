//! Comparison of every pair of many signals on all cores.

use haptograph_signal::parallel;

use super::spectral::{ErrorStatistics, MetricError, WindowedSpectra};

/// Windows processed at a time, so that the spectra of all signals stay in the cache.
const BLOCK: usize = 8;

/// Window errors of all pairs of signals, as `(0, 1), (0, 2), ..., (1, 2), ...`: see [`pair_index`]. Equal to
/// the bit to `PairErrors::statistics` of each pair, on any number of cores.
pub fn all_pairs(
    signals: &[WindowedSpectra],
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<ErrorStatistics>, MetricError> {
    let pairs: Vec<(usize, usize)> =
        (0..signals.len()).flat_map(|a| (a + 1..signals.len()).map(move |b| (a, b))).collect();
    let mut work = vec![];
    for &(a, b) in &pairs {
        work.push(Pair {
            a,
            b,
            windows: signals[a].shared_windows(&signals[b])?,
            errors: ErrorStatistics::default(),
        });
    }
    let threads = parallel::cores();
    let share = work.len().div_ceil(threads).max(1);
    parallel::map(threads, work.chunks_mut(share).enumerate(), &|_| (), |(thread, pairs)| {
        // One thread reports for all, since their shares are equal.
        let report = |part| {
            if thread == 0 {
                progress(part)
            }
        };
        haptograph_signal::instructions::arch().dispatch(Compare { signals, pairs, report });
    });
    progress(1.0);
    Ok(work.into_iter().map(|pair| pair.errors).collect())
}

/// Index of the pair of two different signals among all pairs of `count` signals.
pub fn pair_index(count: usize, a: usize, b: usize) -> usize {
    let (a, b) = (a.min(b), a.max(b));
    a * count - a * (a + 1) / 2 + (b - a - 1)
}

struct Pair {
    a: usize,
    b: usize,
    windows: usize,
    errors: ErrorStatistics,
}

struct Compare<'a, R> {
    signals: &'a [WindowedSpectra],
    pairs: &'a mut [Pair],
    report: R,
}

impl<R: Fn(f64)> pulp::WithSimd for Compare<'_, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let longest = self.pairs.iter().map(|pair| pair.windows).max().unwrap_or(0);
        for first in (0..longest).step_by(BLOCK) {
            for pair in &mut *self.pairs {
                let (a, b) = (&self.signals[pair.a], &self.signals[pair.b]);
                for window in first..(first + BLOCK).min(pair.windows) {
                    pair.errors.add(a.spectral_error(b, window), a.power_error(b, window));
                }
            }
            (self.report)(first as f64 / longest as f64);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{PairErrors, WindowSettings};
    use super::*;
    use haptograph_signal::noise::Gaussian;

    fn signals(count: usize, samples: usize) -> Vec<WindowedSpectra> {
        (0..count)
            .map(|seed| {
                let mut noise = Gaussian::new(seed as u64);
                // The lengths differ.
                let signal: Vec<f64> = (0..samples + 300 * seed).map(|_| noise.next_sample()).collect();
                WindowedSpectra::new(&signal, 10_000.0, &WindowSettings::COMPARISON).unwrap()
            })
            .collect()
    }

    #[test]
    fn all_pairs_are_compared_as_each_alone() {
        let signals = signals(7, 3000);
        let all = all_pairs(&signals, &|_| ()).unwrap();
        assert_eq!(all.len(), 21);
        for a in 0..7 {
            for b in 0..7 {
                if a != b {
                    let alone = PairErrors::new(&signals[a.min(b)], &signals[a.max(b)]).unwrap().statistics();
                    assert_eq!(all[pair_index(7, a, b)], alone);
                }
            }
        }
        assert_eq!(all_pairs(&signals[..1], &|_| ()).unwrap(), []);
        assert_eq!(all_pairs(&[], &|_| ()).unwrap(), []);
    }
}
