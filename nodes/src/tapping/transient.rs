//! The transient that follows a tap: the surface's recorded accelerations, mixed for the tap's speed, as a force along the
//! normal (momentum cancellation makes a surface hard; a vibration alone would not).

use haptograph_surfaces::Taps;
pub(crate) use haptograph_surfaces::taps::EFFECTIVE_MASS_KG;
use std::sync::Arc;

/// Plays the taps of a surface, one at a time; a new tap replaces one that still rings. Allocates only when made.
#[derive(Debug, Clone)]
pub(crate) struct Transient {
    taps: Arc<Taps>,
    pub(super) mass_kg: f64,
    /// A faster tap is played as one of this speed, m/s.
    most_m_s: f64,
    /// Speed of the present tap, m/s, and its next sample.
    ringing: Option<(f64, usize)>,
}

impl Transient {
    /// A silent player of taps recorded (or resampled) at the rate of its ticks, felt by this mass.
    pub(crate) fn new(taps: Arc<Taps>, mass_kg: f64) -> Self {
        Self { taps, mass_kg, most_m_s: f64::INFINITY, ringing: None }
    }

    /// Plays a tap faster than the fastest recorded one as that (4.3.2), where [`Taps::mix`] lets it grow.
    pub(super) fn held_above_the_fastest(mut self) -> Self {
        self.most_m_s = self.taps.taps().last().map_or(f64::INFINITY, |tap| tap.speed_m_s);
        self
    }

    /// Takes over the present tap of another player.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        self.ringing = other
            .ringing
            .map(|(speed_m_s, next)| (self.within(speed_m_s), next))
            .filter(|(_, next)| *next < self.taps.length());
    }

    /// The speed as which a tap is played; NaN stays.
    fn within(&self, speed_m_s: f64) -> f64 {
        match speed_m_s > self.most_m_s {
            true => self.most_m_s,
            false => speed_m_s,
        }
    }

    /// Advances one tick: restarts if there was a tap (its speed, m/s); returns the force along the outward normal, N.
    pub(crate) fn update(&mut self, tap_m_s: Option<f64>) -> f64 {
        let struck = tap_m_s.map(|speed_m_s| (self.within(speed_m_s), 0));
        let now = struck.or(self.ringing);
        self.ringing = now
            .map(|(speed_m_s, sample)| (speed_m_s, sample + 1))
            .filter(|(_, next)| *next < self.taps.length());
        now.map_or(0.0, |(speed_m_s, sample)| {
            self.mass_kg * self.taps.sample(&self.taps.mix(speed_m_s), sample)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_surfaces::Tap;

    fn player() -> Transient {
        let tap = |speed_m_s: f64, size: f64| Tap {
            speed_m_s,
            acceleration_m_s2: (0..100).map(|k| size * (-f64::from(k) / 20.0).exp()).collect(),
            peak_force_n: None,
        };
        let taps = Taps::new(1000.0, vec![tap(0.05, 10.0), tap(0.1, 30.0), tap(0.2, 50.0)]).unwrap();
        Transient::new(Arc::new(taps), EFFECTIVE_MASS_KG)
    }

    fn first(speed_m_s: f64) -> f64 {
        player().update(Some(speed_m_s))
    }

    #[test]
    fn speed_scales_below_mixes_between_and_grows_above() {
        assert!((first(0.025) - 0.05 * 5.0).abs() < 1e-12, "v / v_min");
        assert!((first(0.05) - 0.05 * 10.0).abs() < 1e-12);
        assert!((first(0.075) - 0.05 * 20.0).abs() < 1e-12, "half of each neighbour");
        assert!((first(0.2) - 0.05 * 50.0).abs() < 1e-12);
        assert!((first(0.4) - 0.05 * 50.0 * 2_f64.powf(0.7)).abs() < 1e-12);
        let most = 0.05 * 50.0 * 3_f64.powf(0.7);
        assert!((first(3.0) - most).abs() < 1e-12, "up to three times the fastest");
    }

    #[test]
    fn a_player_that_holds_holds_the_tap_that_it_takes_over() {
        let (mut grows, mut holds) = (player(), player().held_above_the_fastest());
        grows.update(Some(0.4));
        holds.copy_state_from(&grows);
        let expected = 0.05 * 50.0 * (-1.0_f64 / 20.0).exp();
        assert!((holds.update(None) - expected).abs() < 1e-12);
    }

    #[test]
    fn a_transient_ends_and_is_replaced_by_a_new_tap() {
        let mut player = player();
        assert_eq!(player.update(None), 0.0);
        let whole: Vec<f64> =
            (0..150).map(|k| player.update(if k == 0 { Some(0.1) } else { None })).collect();
        assert!((whole[20] - 1.5 * (-1.0_f64).exp()).abs() < 1e-12);
        assert!(whole[99] > 0.0 && whole[100..].iter().all(|f| *f == 0.0) && player.ringing.is_none());
        player.update(Some(0.1));
        (0..30).for_each(|_| {
            player.update(None);
        });
        assert!((player.update(Some(0.2)) - 2.5).abs() < 1e-12);
    }
}
