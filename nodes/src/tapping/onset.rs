//! Detection of taps, with their speed.
//!
//! The rule: the first tick in contact is a tap if the tool has been free for at least `rearm_s` without interruption and
//! came down at `least_m_s` or more. A tool that bounces or grazes within that time taps once.

use crate::contact::Contact;
use crate::vector::{Vec3, ZERO, add_scaled, dot, sub};

/// Conditions of a tap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OnsetSettings {
    /// Time in free space after which the next contact can be a tap, s.
    pub rearm_s: f64,
    /// Lowest speed of a tap, m/s.
    pub least_m_s: f64,
    /// Time before contact over which the speed is measured, s (a straight line through the positions).
    pub window_s: f64,
}

impl Default for OnsetSettings {
    /// Armed after 20 ms, from 10 mm/s, measured over 12 ms: with position steps of 0.055 mm the speed is accurate to 5 mm/s.
    fn default() -> Self {
        Self { rearm_s: 0.02, least_m_s: 0.01, window_s: 0.012 }
    }
}

/// Largest number of stored positions.
const MAX_SAMPLES: usize = 64;

/// Detects the taps of one tool. Never allocates.
#[derive(Debug, Clone)]
pub(crate) struct Onset {
    /// Lowest speed of a tap, m/s.
    pub least_m_s: f64,
    period_s: f64,
    window: usize,
    /// Ticks per stored position, so that the window has the same duration at any rate.
    stride: u64,
    rearm_ticks: u32,
    free_ticks: u32,
    ticks: u64,
    /// The latest positions, the newest at `next - 1`.
    positions_m: [Vec3; MAX_SAMPLES],
    next: usize,
}

impl Onset {
    /// A detector for ticks at `rate_hz`; it starts armed. The speed is measured between at least 2 ticks.
    pub(crate) fn new(settings: &OnsetSettings, rate_hz: f64) -> Self {
        let rearm_ticks = (settings.rearm_s * rate_hz).ceil().max(1.0) as u32;
        let window_ticks = settings.window_s * rate_hz;
        let stride = (window_ticks / (MAX_SAMPLES - 1) as f64).ceil().max(1.0);
        Self {
            least_m_s: settings.least_m_s,
            period_s: stride / rate_hz,
            window: ((window_ticks / stride).round() as usize + 1).clamp(2, MAX_SAMPLES),
            stride: stride as u64,
            rearm_ticks,
            free_ticks: rearm_ticks,
            ticks: 0,
            positions_m: [ZERO; MAX_SAMPLES],
            next: 0,
        }
    }

    /// Takes over the state of another detector.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        (self.free_ticks, self.ticks) = (other.free_ticks, other.ticks);
        (self.positions_m, self.next) = (other.positions_m, other.next);
    }

    /// Advances one tick: the speed into the surface, m/s, if this contact is a tap.
    pub(crate) fn update(&mut self, contact: &Contact) -> Option<f64> {
        if !contact.hip_m.iter().all(|x| x.is_finite()) {
            return None;
        }
        if self.ticks.is_multiple_of(self.stride) {
            self.positions_m[self.next % MAX_SAMPLES] = contact.hip_m;
            self.next += 1;
        }
        self.ticks += 1;
        if !contact.touching {
            self.free_ticks = self.free_ticks.saturating_add(1);
            return None;
        }
        let armed = std::mem::take(&mut self.free_ticks) >= self.rearm_ticks;
        let speed_m_s = -dot(self.velocity_m_s(), contact.normal);
        (armed && speed_m_s >= self.least_m_s).then_some(speed_m_s)
    }

    /// Slope of the least-squares line through the latest positions.
    fn velocity_m_s(&self) -> Vec3 {
        let count = self.window.min(self.next);
        if count < 2 {
            return ZERO;
        }
        let newest = self.positions_m[(self.next - 1) % MAX_SAMPLES];
        let middle = 0.5 * (count - 1) as f64;
        let (sum, weight) = (0..count).fold((ZERO, 0.0), |(sum, weight), back| {
            let position = self.positions_m[(self.next - 1 - back) % MAX_SAMPLES];
            let arm = middle - back as f64;
            (add_scaled(sum, sub(position, newest), arm), weight + arm * arm)
        });
        sum.map(|s| s / (weight * self.period_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::shape::{Shape, Touch};

    const TABLE: Shape = Shape::Plane { origin_m: [0.0; 3], normal: [0.0, 0.0, 1.0] };

    /// Taps seen along heights at 1 kHz: (tick, speed).
    fn taps(heights: impl Iterator<Item = f64>) -> Vec<(usize, f64)> {
        taps_at(1000.0, heights)
    }

    fn taps_at(rate_hz: f64, heights: impl Iterator<Item = f64>) -> Vec<(usize, f64)> {
        let mut touch = Touch::new(&TABLE, 0.0).unwrap();
        let mut onset = Onset::new(&OnsetSettings::default(), rate_hz);
        let seen = heights.enumerate().filter_map(|(tick, z)| {
            onset.update(&touch.update([0.0, 0.001 * tick as f64, z])).map(|speed| (tick, speed))
        });
        seen.collect()
    }

    #[test]
    fn one_tap_at_its_speed_for_one_contact() {
        let seen = taps((0..200).map(|k| 0.01 - 0.0002 * f64::from(k)));
        assert_eq!(seen.len(), 1);
        assert_eq!(seen[0].0, 51);
        assert!((seen[0].1 - 0.2).abs() < 1e-9);
    }

    #[test]
    fn coarse_positions_still_tell_the_speed() {
        let step_m = 0.055e-3;
        let seen = taps((0..200).map(|k| ((0.01 - 0.00012 * f64::from(k)) / step_m).round() * step_m));
        assert!((seen[0].1 - 0.12).abs() < 0.006, "{seen:?}");
    }

    #[test]
    fn the_speed_is_as_well_known_at_any_rate() {
        let step_m = 0.055e-3;
        for rate_hz in [500.0, 2000.0, 5000.0, 10_000.0, 48_000.0] {
            let height = |k: u32| 0.01 - 0.12 * f64::from(k) / rate_hz;
            let heights = (0..rate_hz as u32 / 4).map(|k| (height(k) / step_m).round() * step_m);
            let seen = taps_at(rate_hz, heights);
            assert!((seen[0].1 - 0.12).abs() < 0.006, "{rate_hz} Hz: {seen:?}");
        }
    }

    #[test]
    fn a_bounce_is_no_second_tap_and_a_lift_of_20_ms_is() {
        let fall = |k: i32| 0.004 - 0.0002 * f64::from(k);
        let bounce =
            (0..15).map(|k| if k < 8 { 0.0002 * f64::from(k) } else { 0.0016 - 0.0002 * f64::from(k - 8) });
        let sink = |_: i32| -0.001;
        let once = taps((0..30).map(fall).chain(bounce).chain((0..50).map(sink)));
        assert_eq!(once.len(), 1, "{once:?}");
        let lift = (0..60).map(|k| 0.006 - 0.0002 * f64::from((k - 30_i32).abs()));
        let twice = taps((0..30).map(fall).chain(lift).chain((0..20).map(|k| -0.0002 * f64::from(k))));
        assert_eq!(twice.len(), 2, "{twice:?}");
    }

    #[test]
    fn a_gentle_touch_is_no_tap() {
        assert!(taps((0..3000).map(|k| 0.01 - 5e-6 * f64::from(k))).is_empty());
    }
}
