//! Synchronisation of a page's clock with the time of the run.

use super::pads::MAX_APART_S;

/// Bounds of the delay added to pointer events, s, which compensates jitter and gaps.
const MARGIN_S: (f64, f64) = (0.002, 0.03);
/// Time constant in which jitter is forgotten, s.
const FORGET_S: f64 = 1.0;
/// Maximum relative drift of the two clocks.
const DRIFT: f64 = 5e-4;

/// Estimate of the offset between a page's clock and the time of the run.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PageClock {
    /// Offset of the fastest message, and its time, s.
    offset: Option<(f64, f64)>,
    /// Time of the latest pointer by the page's clock, and its arrival by the run's, s.
    latest: (f64, f64),
    /// Delay of pointers relative to the fastest, and their spacing, s.
    late_s: f64,
    apart_s: f64,
}

impl PageClock {
    /// Time of the run at which to apply a pointer that occurred at `at_s` of the page's clock and arrives at
    /// `now_s`.
    pub(crate) fn due_s(&mut self, at_s: f64, now_s: f64) -> f64 {
        let offset = now_s - at_s;
        let known = self.offset.map(|(known, since_s)| known + DRIFT * (now_s - since_s).max(0.0));
        // The clock or the run was restarted.
        if known.is_none_or(|known| offset <= known || offset > known + 1.0) {
            self.offset = Some((offset, now_s));
        }
        let (known, since_s) = self.offset.unwrap_or((offset, now_s));
        let fastest = known + DRIFT * (now_s - since_s).max(0.0);
        let (before_at_s, before_s) = self.latest;
        let kept = (-(now_s - before_s).max(0.0) / FORGET_S).exp();
        self.late_s = (self.late_s * kept).max(offset - fastest);
        let apart_s = at_s - before_at_s;
        if (0.0..MAX_APART_S).contains(&apart_s) {
            self.apart_s += 0.1 * (apart_s - self.apart_s);
        }
        self.latest = (at_s, now_s);
        at_s + fastest + (self.late_s + self.apart_s).clamp(MARGIN_S.0, MARGIN_S.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bunched_pointers_keep_their_own_times() {
        let mut clock = PageClock::default();
        // Events every 4 ms on a clock 100 s ahead; they arrive in groups of four, 1 to 13 ms late.
        let due: Vec<f64> = (0..400)
            .map(|k| {
                let event_s = f64::from(k) * 0.004;
                let arrives_s = f64::from(k / 4 * 4 + 3) * 0.004 + 0.001;
                clock.due_s(event_s + 100.0, arrives_s)
            })
            .collect();
        let steps = due.windows(2).skip(200).map(|pair| pair[1] - pair[0]);
        assert!(steps.clone().all(|step| (step - 0.004).abs() < 5e-4), "evenly");
        // No event is applied before its arrival, nor long after.
        let in_time = |(k, due_s): (usize, &f64)| *due_s >= (k / 4 * 4 + 3) as f64 * 0.004 + 0.001;
        assert!(due.iter().enumerate().skip(200).all(in_time));
        let latency_s = due[399] - 399.0 * 0.004;
        assert!((0.001..0.025).contains(&latency_s), "{latency_s}");
    }

    #[test]
    fn a_clock_that_begins_anew_is_followed() {
        let mut clock = PageClock::default();
        clock.due_s(1000.0, 1.0);
        let due_s = clock.due_s(0.0, 2.0);
        assert!((due_s - 2.0).abs() < 0.04, "{due_s}");
    }
}
