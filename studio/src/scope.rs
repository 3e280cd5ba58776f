//! Scopes: the frames of a port for display.

use super::frames;
use super::levels::Level;
use haptograph_engine::frame::Kind;
use haptograph_engine::graph::{Graph, Output};
use haptograph_engine::host::AnyOutput;

/// Number of intervals per second of a thinned port.
const THINNED_HZ: f64 = 2000.0;
/// Ports with a higher rate are thinned.
pub(crate) const MAX_HZ: f64 = 4000.0;
/// Buffer length for new frames without allocation, s.
const ROOM_S: f64 = 0.1;
/// Difference between the frame count and the time of the run that indicates lost frames, s.
const APART_S: f64 = 0.25;

/// A port of a graph.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Port {
    pub name: String,
    pub node: String,
    pub kind: Kind,
    pub quantity: haptograph_signal::quantity::Quantity,
    pub rate_hz: f64,
    pub driver: Option<String>,
}

impl Port {
    /// True if its frames can be displayed, component by component.
    pub(crate) fn is_shown(&self) -> bool {
        self.kind.is_linear()
    }
}

/// The names of the components of a frame, as they are printed.
pub(crate) fn components(kind: Kind) -> Vec<String> {
    kind.spec().components.iter().map(|name| name.replace('_', " ")).collect()
}

/// The ports of a graph.
pub(crate) fn ports(graph: &Graph) -> Vec<Port> {
    let nodes = graph.nodes().iter();
    let all = nodes.flat_map(|node| node.outputs.iter().filter_map(|output| port(graph, node, output)));
    all.collect()
}

fn port(graph: &Graph, node: &haptograph_engine::graph::Node, output: &Output) -> Option<Port> {
    let clock = graph.clocks().get(node.clock?)?;
    Some(Port {
        name: format!("{}.{}", node.path, output.name),
        node: node.path.clone(),
        kind: output.kind,
        quantity: output.quantity,
        rate_hz: clock.rate.hz(),
        driver: driver_of(graph, node.clock?),
    })
}

/// Name of the driver of a clock; `None` if the graph has one driver alone, which a swap may rename.
pub(crate) fn driver_of(graph: &Graph, clock: usize) -> Option<String> {
    let driver = graph.clocks().get(clock)?.driver;
    (graph.drivers().len() > 1).then(|| graph.clocks()[driver].name.clone())
}

/// A port with its incoming frames.
#[derive(Debug)]
pub(crate) struct Scope {
    pub port: Port,
    pub level: Level,
    frames: AnyOutput,
    /// Time of its driver at the first frame, s; `None` before it. An estimate, to within a block, if the scope was added to a
    /// run or lost frames.
    begin_s: Option<f64>,
    /// Number of frames before the fresh ones.
    count: u64,
    /// The frames since the last call of [`Scope::look`], and the number of their components already
    /// processed.
    fresh: Vec<f64>,
    seen: usize,
    thinning: Thinning,
    thinned_from: u64,
}

/// The extremes of each component in intervals of several frames.
#[derive(Debug)]
struct Thinning {
    /// Frames in an interval, and in the unfinished one.
    group: usize,
    grouped: usize,
    /// Minimum and maximum of each component in the unfinished interval.
    open: Vec<(f64, f64)>,
    /// The pairs of the finished intervals.
    pairs: Vec<f32>,
}

impl Thinning {
    const EMPTY: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

    fn of(lanes: usize, rate_hz: f64) -> Self {
        Self {
            group: (rate_hz / THINNED_HZ).ceil().max(1.0) as usize,
            grouped: 0,
            open: vec![Self::EMPTY; lanes],
            pairs: Vec::new(),
        }
    }

    /// Takes frames with interleaved components. An interval with NaN becomes NaN and the maximum of the
    /// rest, NaN twice without a rest.
    fn take(&mut self, frames: &[f64]) {
        for frame in frames.chunks_exact(self.open.len()) {
            for ((least, most), value) in self.open.iter_mut().zip(frame) {
                // `f64::min` and `f64::max` return the other operand for NaN.
                let is_nan = least.is_nan() || value.is_nan();
                *least = if is_nan { f64::NAN } else { least.min(*value) };
                *most = most.max(*value);
            }
            self.grouped += 1;
            if self.grouped == self.group {
                self.grouped = 0;
                for extremes in &mut self.open {
                    let (least, most) = std::mem::replace(extremes, Self::EMPTY);
                    let has_rest = !least.is_nan() || most > f64::NEG_INFINITY;
                    let most = if has_rest { most } else { f64::NAN };
                    self.pairs.extend([least as f32, most as f32]);
                }
            }
        }
    }
}

impl Scope {
    /// A scope that begins with the first frame of the run, so that its frames have exact times.
    pub(crate) fn from_start(port: Port, frames: AnyOutput) -> Self {
        Self { begin_s: Some(0.0), ..Self::of(port, frames) }
    }

    /// A scope that begins with the next frame of a port.
    pub(crate) fn of(port: Port, frames: AnyOutput) -> Self {
        let (lanes, rate_hz) = (port.kind.width(), port.rate_hz);
        Self {
            port,
            level: Level::default(),
            frames,
            begin_s: None,
            count: 0,
            fresh: Vec::with_capacity((rate_hz * ROOM_S) as usize * lanes),
            seen: 0,
            thinning: Thinning::of(lanes, rate_hz),
            thinned_from: 0,
        }
    }

    /// Reads the new frames and returns them. Does not allocate if it is called at least every 100 ms.
    pub(crate) fn take_in(&mut self) -> &[f64] {
        let lanes = self.lanes();
        if self.seen > 0 {
            self.count += (self.seen / lanes) as u64;
            self.fresh.drain(..self.seen);
            self.thinning.pairs.clear();
            self.seen = 0;
        }
        let before = self.fresh.len();
        loop {
            let end = self.fresh.len();
            self.fresh.resize(end + lanes, 0.0);
            if !self.frames.take(&mut self.fresh[end..]) {
                self.fresh.truncate(end);
                break;
            }
        }
        &self.fresh[before..]
    }

    /// Processes the frames up to the time of its driver, s; those of a run that is over follow the ones before.
    pub(crate) fn look(&mut self, now_s: Option<f64>) {
        self.take_in();
        let lanes = self.lanes();
        self.seen = self.fresh.len();
        let end_s = (self.count + (self.fresh.len() / lanes) as u64) as f64 / self.port.rate_hz;
        let is_at = |begin_s: f64, now_s: f64| (begin_s + end_s - now_s).abs() < APART_S;
        if let Some(now_s) = now_s.filter(|now_s| !self.begin_s.is_some_and(|begin_s| is_at(begin_s, *now_s)))
            && !self.fresh.is_empty()
        {
            self.begin_s = Some(now_s - end_s);
        }
        self.level.take(self.port.kind, &self.fresh);
        if self.port.is_shown() {
            self.thinned_from = self.count - self.thinning.grouped as u64;
            self.thinning.take(&self.fresh);
        }
    }

    pub(crate) fn lanes(&self) -> usize {
        self.port.kind.width()
    }

    /// The new frames, with interleaved components.
    pub(crate) fn fresh(&self) -> &[f64] {
        &self.fresh
    }

    /// Time of its driver at the first new frame, s.
    pub(crate) fn fresh_s(&self) -> f64 {
        self.begin_s.unwrap_or(0.0) + self.count as f64 / self.port.rate_hz
    }

    /// The message for a page that has this port at `place` of its list; `None` without new frames.
    pub(crate) fn message(&self, place: usize, raw: bool) -> Option<Vec<u8>> {
        let is_thinned = !raw && self.port.rate_hz > MAX_HZ;
        let interval_s = 1.0 / self.port.rate_hz;
        if is_thinned {
            let at_s = self.begin_s.unwrap_or(0.0) + self.thinned_from as f64 * interval_s;
            let times = (at_s, interval_s * self.thinning.group as f64);
            let pairs = &self.thinning.pairs;
            return (!pairs.is_empty()).then(|| frames::samples(place, self.lanes(), true, times, pairs));
        }
        let values: Vec<f32> = self.fresh.iter().map(|value| *value as f32).collect();
        let times = (self.fresh_s(), interval_s);
        (!values.is_empty()).then(|| frames::samples(place, self.lanes(), false, times, &values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A second of zeros at 48 kHz with these frames, in blocks that do not fit the intervals.
    fn thinned(odd: &[(usize, f64)]) -> Vec<(f32, f32)> {
        let mut frames = vec![0.0; 48_000];
        odd.iter().for_each(|(at, value)| frames[*at] = *value);
        let mut thinning = Thinning::of(1, 48_000.0);
        frames.chunks(77).for_each(|block| thinning.take(block));
        let pairs: Vec<_> = thinning.pairs.chunks(2).map(|pair| (pair[0], pair[1])).collect();
        assert_eq!(pairs.len(), 2000);
        pairs
    }

    #[test]
    fn one_spike_and_one_nan_of_a_second_are_in_the_pairs() {
        let pairs = thinned(&[(12_345, 7.0), (20_000, -5.0), (30_001, f64::NAN)]);
        let odd: Vec<usize> = (0..2000).filter(|at| pairs[*at] != (0.0, 0.0)).collect();
        assert_eq!(odd, [12_345 / 24, 20_000 / 24, 30_001 / 24]);
        assert_eq!([pairs[odd[0]], pairs[odd[1]]], [(0.0, 7.0), (-5.0, 0.0)]);
        assert!(pairs[odd[2]].0.is_nan() && pairs[odd[2]].1 == 0.0, "{:?}", pairs[odd[2]]);
    }

    #[test]
    fn a_spike_beside_nan_is_kept_and_an_interval_of_nan_alone_is_no_number() {
        let all: Vec<(usize, f64)> = (0..24).map(|at| (24 + at, f64::NAN)).collect();
        let pairs = thinned(&[&all[..], &[(2, 9.0), (7, f64::NAN)]].concat());
        assert!(pairs[0].0.is_nan() && pairs[0].1 == 9.0, "{:?}", pairs[0]);
        assert!(pairs[1].0.is_nan() && pairs[1].1.is_nan(), "{:?}", pairs[1]);
        assert_eq!(pairs[2], (0.0, 0.0));
    }
}
