//! Synchronisation of a page's clock with the time of the run.

use super::pads::MAX_APART_S;

/// Bounds of the delay added to pointer events, s, which compensates jitter and gaps.
const MARGIN_S: (f64, f64) = (0.002, 0.03);
/// Time constant in which jitter is forgotten, s.
const FORGET_S: f64 = 1.0;
/// Largest time by which planned events are sent ahead, s.
const MAX_AHEAD_S: f64 = 0.5;
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
    /// Offset of planned events.
    planned: Option<f64>,
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

    /// The same for an event of a plan, which is sent ahead of its time: all keep their distances.
    pub(crate) fn planned_s(&mut self, at_s: f64, now_s: f64) -> f64 {
        let in_time = |offset: &f64| (now_s..now_s + MAX_AHEAD_S).contains(&(at_s + offset));
        at_s + *self.planned.insert(self.planned.filter(in_time).unwrap_or(now_s - at_s))
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
    fn planned_events_keep_their_distances_however_late_their_messages_are() {
        let mut clock = PageClock::default();
        // Every 4 ms, sent 100 ms ahead, in messages that take up to 60 ms.
        let due = |k: u32, clock: &mut PageClock| {
            let sent_s = (f64::from(k) * 0.004 - 0.1).max(0.0);
            clock.planned_s(50.0 + f64::from(k) * 0.004, sent_s + f64::from(k % 16) * 0.004)
        };
        let due: Vec<f64> = (0..400).map(|k| due(k, &mut clock)).collect();
        assert!(due.windows(2).all(|pair| (pair[1] - pair[0] - 0.004).abs() < 1e-12));
        // Where none came in time, the plan goes on from now.
        assert_eq!(clock.planned_s(60.0, 30.0), 30.0);
    }

    #[test]
    fn a_clock_that_begins_anew_is_followed() {
        let mut clock = PageClock::default();
        clock.due_s(1000.0, 1.0);
        let due_s = clock.due_s(0.0, 2.0);
        assert!((due_s - 2.0).abs() < 0.04, "{due_s}");
    }
}
