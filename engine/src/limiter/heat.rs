//! Heat of an actuator: bounds the mean square of its output for any window.
//!
//! A limit may change its window while the actuator is warm, and the mean square of one window does not tell that of
//! another. So the energy `E_b` = sum of y^2 exp(-age / b), in unit^2 s, is kept for windows b of 1 ms, 2 ms, 4 ms to
//! 2^30 ms. Of a window w between two neighbours a and b, where 1/w = p/a + (1-p)/b, the weighted means of arithmetic
//! and geometry give, at every age,
//!
//! ```text
//! exp(-age / w) = exp(-age / a)^p exp(-age / b)^(1-p) <= p exp(-age / a) + (1-p) exp(-age / b)
//! ```
//!
//! so E_w <= p E_a + (1-p) E_b: never too little, and at most an eighth too much for a steady drive. A window below the
//! first is bounded by the first; every window by the largest square that was ever given. Squares are collected for
//! [`CHUNK_S`] and then counted as if all had been given at its end, which is never too little either.

use std::sync::atomic::{AtomicU64, Ordering};

/// Number of windows.
const WINDOWS: usize = 31;
/// The first window, s; each is twice the one before.
const FIRST_S: f64 = 1e-3;
/// Interval after which collected squares are counted, s.
const CHUNK_S: f64 = 0.25e-3;

/// Heat of an actuator, in the unit of its output.
#[derive(Debug, Clone)]
pub(crate) struct Heat {
    known: Known,
    /// Time since when the output is known, s; infinite if it was zero before.
    known_for_s: f64,
    rate_hz: f64,
    /// Decay of each energy over a chunk.
    decay: [f64; WINDOWS],
    chunk_ticks: u32,
    /// Squares and ticks of the present chunk.
    pending: f64,
    ticks: u32,
}

#[derive(Debug, Clone, Copy)]
struct Known {
    energies: [f64; WINDOWS],
    largest_square: f64,
}

fn window_s(place: usize) -> f64 {
    FIRST_S * (1_u64 << place) as f64
}

impl Heat {
    /// A cold actuator, at ticks of `rate_hz`.
    pub(super) fn cold(rate_hz: f64) -> Self {
        let chunk_ticks = (CHUNK_S * rate_hz).clamp(1.0, 1e6) as u32;
        let chunk_s = f64::from(chunk_ticks) / rate_hz;
        Self {
            known: Known { energies: [0.0; WINDOWS], largest_square: 0.0 },
            known_for_s: f64::INFINITY,
            rate_hz,
            decay: std::array::from_fn(|place| (-chunk_s / window_s(place)).exp()),
            chunk_ticks,
            pending: 0.0,
            ticks: 0,
        }
    }

    /// Adds a tick with an output of this square.
    pub(super) fn note(&mut self, square: f64) {
        self.pending += square;
        self.known.largest_square = self.known.largest_square.max(square);
        self.ticks += 1;
        if self.ticks >= self.chunk_ticks {
            self.count_chunk();
        }
    }

    fn count_chunk(&mut self) {
        let energy = self.pending / self.rate_hz;
        for (known, decay) in self.known.energies.iter_mut().zip(&self.decay) {
            *known = *known * decay + energy;
        }
        self.known_for_s += f64::from(self.ticks) / self.rate_hz;
        (self.pending, self.ticks) = (0.0, 0);
    }

    /// Upper bound of the mean square of the known output over a window, as a limiter of that window counts it.
    pub(super) fn mean_square(&self, window: f64) -> f64 {
        let largest = self.known.largest_square;
        let weight = -(-1.0 / (window * self.rate_hz)).exp_m1();
        let energies = &self.known.energies;
        let above = (0..WINDOWS).find(|place| window_s(*place) >= window);
        let energy = match above {
            None => return largest,
            Some(0) => energies[0],
            Some(above) => {
                let (a, b) = (window_s(above - 1), window_s(above));
                let part = (1.0 / window - 1.0 / b) / (1.0 / a - 1.0 / b);
                part * energies[above - 1] + (1.0 - part) * energies[above]
            }
        };
        (weight * (self.rate_hz * energy + self.pending)).min(largest)
    }

    /// Weight of the time of unknown output in the mean over a window.
    pub(super) fn unknown_part(&self, window: f64) -> f64 {
        let known_for_s = self.known_for_s + f64::from(self.ticks) / self.rate_hz;
        (-known_for_s / window).exp()
    }

    /// True if the heat includes a time of unknown output.
    pub(super) fn is_partly_unknown(&self) -> bool {
        self.known_for_s.is_finite()
    }

    /// Marks the output before now as unknown, but with at least the heat of `hottest`.
    pub(super) fn begin_unknown(&mut self, hottest: Option<&Hottest>) {
        self.known_for_s = 0.0;
        (self.pending, self.ticks) = (0.0, 0);
        if let Some(hottest) = hottest {
            self.known = hottest.known();
        }
    }

    /// Continues the heat of the same actuator at another rate.
    pub(super) fn continue_from(&mut self, other: &Self) {
        self.known = other.known;
        let energy = other.pending / other.rate_hz;
        self.known.energies.iter_mut().for_each(|known| *known += energy);
        self.known_for_s = other.known_for_s + f64::from(other.ticks) / other.rate_hz;
        (self.pending, self.ticks) = (0.0, 0);
    }
}

/// Upper bound of the heat of all removed actuators of a run, any of which may come back under another name. Shared by
/// all drivers without a lock.
#[derive(Debug, Default)]
pub(crate) struct Hottest {
    /// Bits of non-negative numbers, which have the order of the numbers.
    energies: [AtomicU64; WINDOWS],
    largest_square: AtomicU64,
}

impl Hottest {
    /// Adds a removed actuator.
    pub(super) fn take_in(&self, heat: &Heat) {
        let raise = |to: &AtomicU64, value: f64| to.fetch_max(value.to_bits(), Ordering::AcqRel);
        let pending = heat.pending / heat.rate_hz;
        for (to, energy) in self.energies.iter().zip(&heat.known.energies) {
            raise(to, energy + pending);
        }
        raise(&self.largest_square, heat.known.largest_square);
    }

    fn known(&self) -> Known {
        let value = |of: &AtomicU64| f64::from_bits(of.load(Ordering::Acquire));
        Known {
            energies: std::array::from_fn(|place| value(&self.energies[place])),
            largest_square: value(&self.largest_square),
        }
    }
}
