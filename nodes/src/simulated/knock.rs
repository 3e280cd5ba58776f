//! Knocks on the table: short oscillations of the floor under a sensor, at seeded times.

use crate::vector::{Vec3, ZERO, direction, scale};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

/// Settings of the knocks. The numbers are ours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct KnockSettings {
    /// Mean time between knocks, s.
    pub every_s: f64,
    /// Hardest knock: acceleration of the table at its start, m/s2. Knocks are spread evenly from a fifth of it.
    pub hardest_m_s2: f64,
    /// Lowest and highest frequency of the table, Hz.
    pub table_hz: [f64; 2],
    /// Time in which a knock dies away to 1/e, s.
    pub decay_s: f64,
}

impl Default for KnockSettings {
    /// Every 4 s, up to 2 m/s2, 15 to 30 Hz, 80 ms.
    fn default() -> Self {
        Self { every_s: 4.0, hardest_m_s2: 2.0, table_hz: [15.0, 30.0], decay_s: 0.08 }
    }
}

/// A table that is knocked. Never allocates.
#[derive(Debug, Clone)]
pub(crate) struct Knocks {
    settings: KnockSettings,
    rng: Xoshiro256PlusPlus,
    period_s: f64,
    /// Time since the latest knock, s, and until the next.
    since_s: f64,
    next_s: f64,
    peak_m_s2: Vec3,
    table_hz: f64,
}

impl Knocks {
    /// A quiet table, for ticks of `period_s`.
    pub(crate) fn new(settings: KnockSettings, period_s: f64, seed: u64) -> Self {
        let rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut knocks = Self {
            settings,
            rng,
            period_s,
            since_s: 0.0,
            next_s: 0.0,
            peak_m_s2: ZERO,
            table_hz: settings.table_hz[0],
        };
        knocks.next_s = knocks.pause_s();
        knocks
    }

    /// The table's acceleration in this tick, m/s2, on to the next.
    pub(crate) fn advance(&mut self) -> Vec3 {
        self.since_s += self.period_s;
        if self.since_s >= self.next_s {
            self.knock();
        }
        let swing =
            (-self.since_s / self.settings.decay_s).exp() * (TAU * self.table_hz * self.since_s).sin();
        scale(self.peak_m_s2, swing)
    }

    fn knock(&mut self) {
        let along: Vec3 = std::array::from_fn(|_| self.rng.random_range(-1.0..1.0));
        let size_m_s2 = self.settings.hardest_m_s2 * self.rng.random_range(0.2..1.0);
        let [low_hz, high_hz] = self.settings.table_hz;
        self.peak_m_s2 = scale(direction(along).unwrap_or([0.0, 0.0, 1.0]), size_m_s2);
        self.table_hz = low_hz + (high_hz - low_hz) * self.rng.random::<f64>();
        self.since_s = 0.0;
        self.next_s = self.pause_s();
    }

    /// Time until the next knock: at least until this one has decayed.
    fn pause_s(&mut self) -> f64 {
        let waiting = -(1.0 - self.rng.random::<f64>()).ln();
        8.0 * self.settings.decay_s + waiting * (self.settings.every_s - 8.0 * self.settings.decay_s).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::norm;

    #[test]
    fn knocks_come_as_often_and_as_hard_as_was_said() {
        let mut knocks = Knocks::new(KnockSettings::default(), 1e-3, 5);
        let (mut count, mut hardest) = (0, 0.0_f64);
        for _ in 0..600_000 {
            hardest = hardest.max(norm(knocks.advance()));
            count += u32::from(knocks.since_s == 0.0);
        }
        assert!((110..190).contains(&count), "{count} knocks in 10 minutes");
        assert!(hardest > 1.5 && hardest <= 2.0, "{hardest}");
    }
}
