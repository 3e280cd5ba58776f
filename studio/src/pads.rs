//! Pointers as the tablets of a graph.

use super::wire::Pointer;
use haptograph_engine::graph::Graph;
use haptograph_engine::host::{HostError, Input, Scalar, Vector};
use std::collections::BTreeMap;

/// Size of a pad, mm: that of a small pen tablet.
pub const SIZE_MM: (f64, f64) = (160.0, 100.0);
/// Force at full pressure of a pen, N: no tablet states newtons.
pub const FULL_N: f64 = 3.0;
/// Pointers are taken later than they might be by what their lateness and their distance ask for, within these bounds, s.
const MARGIN_S: (f64, f64) = (0.002, 0.03);
/// What was late is forgotten in this time, s.
const FORGET_S: f64 = 1.0;
/// Between pointers further apart the hand was elsewhere, s.
const MOST_APART_S: f64 = 0.06;
/// The finest steps between two pointers, s.
const LEAST_STEP_S: f64 = 1e-3;
/// Two clocks drift by less than this part.
const DRIFT: f64 = 5e-4;

/// The endpoints of a graph whose endpoints are all the caller's that a pointer can be.
pub fn endpoints(hosted: &Graph) -> Vec<String> {
    let mut channels: BTreeMap<String, Vec<&'static str>> = BTreeMap::new();
    for (name, channel) in hosted.host_inputs() {
        let endpoint = name.rsplit_once('.').map_or(&*name, |(endpoint, _)| endpoint);
        channels
            .entry(endpoint.to_owned())
            .or_default()
            .push(channel.name);
    }
    let is_pad = |names: &Vec<&str>| {
        ["position", "force", "touching"]
            .iter()
            .all(|name| names.contains(name))
    };
    channels.retain(|_, names| is_pad(names));
    channels.into_keys().collect()
}

/// An endpoint that pointers move.
#[derive(Debug)]
pub struct Pad {
    position_m: Input<Vector>,
    force_n: Input<Scalar>,
    touching: Input<Scalar>,
    /// When and where the pointer was last.
    latest: (f64, Option<Pointer>),
}

impl Pad {
    /// The pad of an endpoint.
    pub fn of(graph: &Graph, endpoint: &str) -> Result<Self, HostError> {
        Ok(Self {
            position_m: graph.input(&format!("{endpoint}.position"))?,
            force_n: graph.input(&format!("{endpoint}.force"))?,
            touching: graph.input(&format!("{endpoint}.touching"))?,
            latest: (0.0, None),
        })
    }

    /// The pointer was there at that time of the run, s; from where it was before it went straight.
    pub fn move_to(&mut self, at_s: f64, pointer: &Pointer) {
        let (from_s, from) = self.latest;
        let at_s = at_s.max(from_s);
        let apart_s = at_s - from_s;
        if let Some(from) =
            from.filter(|from| from.force_n > 0.0 && pointer.force_n > 0.0 && apart_s < MOST_APART_S)
        {
            let step_s = self.position_m.rate().period_s().max(LEAST_STEP_S);
            let steps = (apart_s / step_s) as u32;
            for step in 1..=steps {
                let part = f64::from(step) / f64::from(steps + 1);
                let between =
                    |k: usize| from.position_m[k] + part * (pointer.position_m[k] - from.position_m[k]);
                let force_n = from.force_n + part * (pointer.force_n - from.force_n);
                self.put(from_s + part * apart_s, [between(0), between(1)], force_n);
            }
        }
        self.put(at_s, pointer.position_m, pointer.force_n);
        self.latest = (at_s, Some(*pointer));
    }

    fn put(&mut self, at_s: f64, [x, y]: [f64; 2], force_n: f64) {
        // A queue that is full is one of a run that does not go on: nothing is lost.
        let _ = self.position_m.set_at(at_s, [x, y, 0.0]);
        let _ = self.force_n.set_at(at_s, force_n);
        let _ = self.touching.set_at(at_s, f64::from(u8::from(force_n > 0.0)));
    }
}

/// What a page's clock says at the times of the run.
#[derive(Debug, Clone, Copy, Default)]
pub struct PageClock {
    /// Of the fastest message, and when that was, s.
    offset: Option<(f64, f64)>,
    /// The latest pointer by the page's clock, and when it came by the run's, s.
    latest: (f64, f64),
    /// How late pointers come after the fastest, and how far they are apart, s.
    late_s: f64,
    apart_s: f64,
}

impl PageClock {
    /// The time of the run at which a pointer is taken, that was at `at_s` of the page's clock and arrives at `now_s`.
    pub fn due_s(&mut self, at_s: f64, now_s: f64) -> f64 {
        let offset = now_s - at_s;
        let known = self
            .offset
            .map(|(known, since_s)| known + DRIFT * (now_s - since_s).max(0.0));
        // A clock that began anew, or a run.
        if known.is_none_or(|known| offset <= known || offset > known + 1.0) {
            self.offset = Some((offset, now_s));
        }
        let (known, since_s) = self.offset.unwrap_or((offset, now_s));
        let fastest = known + DRIFT * (now_s - since_s).max(0.0);
        let (before_at_s, before_s) = self.latest;
        let kept = (-(now_s - before_s).max(0.0) / FORGET_S).exp();
        self.late_s = (self.late_s * kept).max(offset - fastest);
        let apart_s = at_s - before_at_s;
        if (0.0..MOST_APART_S).contains(&apart_s) {
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
        // Events every 4 ms on a clock 100 s ahead; they arrive in fours, 1 to 13 ms late.
        let due: Vec<f64> = (0..400)
            .map(|k| {
                let event_s = f64::from(k) * 0.004;
                let arrives_s = f64::from(k / 4 * 4 + 3) * 0.004 + 0.001;
                clock.due_s(event_s + 100.0, arrives_s)
            })
            .collect();
        let steps = due.windows(2).skip(200).map(|pair| pair[1] - pair[0]);
        assert!(steps.clone().all(|step| (step - 0.004).abs() < 5e-4), "evenly");
        // None is taken before it came, nor long after.
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
