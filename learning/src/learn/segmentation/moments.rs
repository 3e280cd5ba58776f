//! Second moments of any segment without a pass over it: lagged products, summed up to every grid point.

/// A sum carried in two parts, so that the difference of two long sums keeps the accuracy of a short one: a quiet segment
/// late in a loud recording would otherwise drown in the rounding of what came before.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LongSum {
    pub high: f64,
    pub low: f64,
}

impl LongSum {
    /// Adds `term` and keeps what rounding drops (Knuth's two-sum).
    #[inline]
    pub(super) fn add(&mut self, term: f64) {
        let sum = self.high + term;
        let back = sum - self.high;
        self.low += (self.high - (sum - back)) + (term - back);
        self.high = sum;
    }
}

/// Lagged products of a signal, `sum of x[u] x[u-lag] for u < position`, for all lags up to an order.
#[derive(Debug)]
pub(super) struct Moments<'a> {
    /// The signal; before its first sample it is zero.
    pub signal: &'a [f64],
    /// Highest lag.
    pub order: usize,
    /// Samples between two stored positions.
    pub step: usize,
    stored: Vec<LongSum>,
}

impl<'a> Moments<'a> {
    pub(super) fn new(signal: &'a [f64], order: usize, step: usize) -> Self {
        let points = signal.len() / step + 1;
        let mut stored = Vec::with_capacity(points * (order + 1));
        let mut sums = vec![LongSum::default(); order + 1];
        for point in 0..points {
            stored.extend_from_slice(&sums);
            let end = ((point + 1) * step).min(signal.len());
            add_products(signal, point * step..end, &mut sums);
        }
        Self { signal, order, step, stored }
    }

    /// The sums up to `position` (at most the signal's length), one a lag.
    pub(super) fn up_to(&self, position: usize, sums: &mut [LongSum]) {
        let point = position / self.step;
        let lags = self.order + 1;
        sums.copy_from_slice(&self.stored[point * lags..(point + 1) * lags]);
        add_products(self.signal, point * self.step..position, sums);
    }

    /// Sample `position`, zero outside the signal.
    pub(super) fn sample(&self, position: isize) -> f64 {
        usize::try_from(position).ok().and_then(|position| self.signal.get(position)).copied().unwrap_or(0.0)
    }
}

fn add_products(signal: &[f64], range: std::ops::Range<usize>, sums: &mut [LongSum]) {
    for u in range {
        // Lags that reach before the signal would add products with zero.
        for (lag, sum) in sums.iter_mut().enumerate().take(u + 1) {
            sum.add(signal[u] * signal[u - lag]);
        }
    }
}
