//! Pads: pointers as the endpoints of a graph.

use super::channels::{Gives, PadSpec, Touch};
use super::pointer::Pointer;
use super::scope::driver_of;
use haptograph_engine::graph::Graph;
use haptograph_engine::host::{AnyInput, HostError};
use haptograph_nodes::simulated::touchable::Touchable;
use haptograph_signal::vector::{reject, scale, sub};
use serde_json::{Value, json};

impl PadSpec {
    /// What everybody may know of it.
    pub(crate) fn plain(&self) -> Value {
        json!({ "width_mm": self.size_mm.0, "height_mm": self.size_mm.1, "force_n": FULL_N })
    }
}

/// Force at full pressure of a pen, N, since tablets do not report newtons.
pub(crate) const FULL_N: f64 = 3.0;
/// Gap between pointer events above which the hand is assumed to have been elsewhere, s.
pub(crate) const MAX_APART_S: f64 = 0.06;
/// Height of the tip over a surface while its pointer is lifted, m.
const LIFTED_M: f64 = 1e-3;
/// Maximum speed of the tip down to and into the surface, m/s, since a pointer touches down instantly.
const DOWN_M_S: f64 = 0.1;

/// An endpoint represented by pointers.
#[derive(Debug)]
pub(crate) struct Pad {
    /// The driver of its endpoint, as in [`scope::driver_of`](super::scope::driver_of).
    pub driver: Option<String>,
    channels: Vec<(AnyInput, Gives)>,
    /// The surface that the pad lies on.
    on: Option<Touchable>,
    /// Period of the ticks that read it.
    period_s: f64,
    /// Time and state of the last pointer event.
    latest: (f64, Option<Pointer>),
    /// Time, touch and height over the surface, m, of the last values sent.
    given: (f64, Touch, f64),
}

impl Pad {
    /// The pad of an endpoint.
    pub(crate) fn of(graph: &Graph, spec: &PadSpec) -> Result<Self, HostError> {
        let channel = |(name, gives): &(&'static str, Gives)| {
            let input = graph.any_input(&format!("{}.{name}", spec.endpoint))?;
            Ok((input, *gives))
        };
        let channels = spec.channels.iter().map(channel).collect::<Result<Vec<_>, HostError>>()?;
        let period_s = channels.first().map_or(0.0, |(input, _)| input.rate().period_s());
        let device = graph.devices().iter().find(|device| device.name == spec.endpoint);
        Ok(Self {
            driver: device.and_then(|device| driver_of(graph, device.clock)),
            channels,
            on: spec.on.clone(),
            period_s,
            latest: (0.0, None),
            given: (0.0, Touch::default(), LIFTED_M),
        })
    }

    /// The latest pointer if it is down.
    pub(crate) fn held(&self) -> Option<Pointer> {
        self.latest.1.filter(|pointer| pointer.force_n > 0.0)
    }

    /// Force of the latest pointer, N.
    pub(crate) fn force_n(&self) -> f64 {
        self.latest.1.map_or(0.0, |pointer| pointer.force_n)
    }

    /// True if it is the pad of these channels.
    pub(crate) fn is_of(&self, spec: &PadSpec) -> bool {
        let is_of = |(input, _): &(AnyInput, Gives)| {
            let (name, (known, _)) = (input.name(), &spec.channels[0]);
            name.strip_suffix(known).and_then(|name| name.strip_suffix('.')) == Some(&*spec.endpoint)
        };
        self.channels.first().is_some_and(is_of)
    }

    /// Moves the pad to the same endpoint of another graph.
    pub(crate) fn lay_on(&mut self, spec: &PadSpec) {
        self.on.clone_from(&spec.on);
    }

    /// Adds a pointer event at a time of the run, s. The ticks since the previous one get what lies on the line between both
    /// at their time.
    pub(crate) fn move_to(&mut self, at_s: f64, pointer: &Pointer) {
        let (from_s, from) = self.latest;
        let at_s = at_s.max(from_s);
        let apart_s = at_s - from_s;
        if let Some(from) =
            from.filter(|from| from.force_n > 0.0 && pointer.force_n > 0.0 && apart_s < MAX_APART_S)
        {
            let first = (from_s / self.period_s).floor() as u64 + 1;
            for tick in first..(at_s / self.period_s).ceil() as u64 {
                let time_s = tick as f64 * self.period_s;
                self.put(time_s, &from.towards(pointer, (time_s - from_s) / apart_s));
            }
        }
        self.put(at_s, pointer);
        self.latest = (at_s, Some(*pointer));
    }

    fn put(&mut self, at_s: f64, pointer: &Pointer) {
        let (before_s, before, height_m) = self.given;
        let goes_on = pointer.force_n > 0.0 && before.force_n > 0.0;
        let passed_s = if goes_on { at_s - before_s } else { 0.0 };
        let above_m = self.above_m(pointer.force_n, height_m, passed_s);
        let mut touch = Touch::of(pointer, self.on.as_ref(), above_m);
        if goes_on && passed_s < MAX_APART_S {
            touch.velocity_m_s = match passed_s > 0.0 {
                true => scale(reject(sub(touch.tip_m, before.tip_m), touch.normal), 1.0 / passed_s),
                false => before.velocity_m_s,
            };
        }
        for (input, gives) in &mut self.channels {
            let mut frame = [0.0; 6];
            touch.put(*gives, &mut frame);
            // A full queue belongs to a run that no longer advances: nothing is lost.
            let _ = match (*gives, pointer.force_n > 0.0) {
                (Gives::Numbers(_), false) => input.release_at(at_s),
                _ => input.set_at(at_s, &frame[..input.kind().width()]),
            };
        }
        self.given = (at_s, touch, above_m);
    }

    /// Height of the tip over the surface that the pad lies on; negative if the surface yields.
    fn above_m(&self, force_n: f64, before_m: f64, passed_s: f64) -> f64 {
        let Some(on) = &self.on else { return 0.0 };
        if force_n == 0.0 {
            return LIFTED_M;
        }
        let down_m = DOWN_M_S * passed_s.clamp(0.0, MAX_APART_S);
        (-force_n / on.gives_n_per_m).max(before_m - down_m)
    }
}
