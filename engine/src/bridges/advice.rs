//! What a bridge cannot do at a connection, and which one can stand there.

use super::{BridgeEntry, Direction, Hold, least_ring_latency_s};
use crate::frame::Kind;
use crate::node::Flow;
use haptograph_signal::time::Rate;
use std::cmp::Ordering;

/// Largest ring in frames: 50 MB for wrenches.
const MAX_RING_FRAMES: f64 = 1e6;

/// A connection from one clock to another.
pub(crate) struct Crossing<'a> {
    pub from: End<'a>,
    pub to: End<'a>,
    /// The output that it comes from: `tone.out`.
    pub output: String,
    /// Kind of its frames, as far as it is known.
    pub kind: Option<Kind>,
    /// Name of the input, and how it reads frames.
    pub input: &'static str,
    pub flow: Flow,
    /// The bridges that can be written.
    pub bridges: &'a [BridgeEntry],
}

/// A clock at an end of a connection.
#[derive(Clone, Copy)]
pub(crate) struct End<'a> {
    pub clock: &'a str,
    pub rate: Rate,
    pub driver: &'a str,
}

/// Why a bridge cannot stand at a connection.
pub(crate) struct Refusal {
    pub code: &'static str,
    pub message: String,
    pub label: String,
    pub help: String,
}

fn refusal(
    message: impl Into<String>,
    label: impl Into<String>,
    help: impl Into<String>,
) -> Result<(), Refusal> {
    Err(Refusal { code: "E0406", message: message.into(), label: label.into(), help: help.into() })
}

fn bad_latency(message: String, label: String, help: &str) -> Result<(), Refusal> {
    Err(Refusal { code: "E0413", message, label, help: help.to_owned() })
}

impl Crossing<'_> {
    fn has_two_drivers(&self) -> bool {
        self.from.driver != self.to.driver
    }

    fn ends(&self) -> String {
        let Self { from, to, .. } = self;
        format!("from {} on `{}` to {} on `{}`", from.rate, from.clock, to.rate, to.clock)
    }

    fn different_drivers(&self) -> String {
        format!("`{}` and `{}` have different drivers", self.from.clock, self.to.clock)
    }

    /// Checks what the input needs of a bridge, whatever its type.
    fn flows(&self, name: &str, is_hold: bool) -> Result<(), Refusal> {
        if self.flow != Flow::Held {
            return Ok(());
        }
        let input = self.input;
        if self.has_two_drivers() {
            return refusal(
                format!("a ring cannot carry the held signal that `{input}` reads"),
                self.different_drivers(),
                format!("send its inputs through the ring and compute it on `{}`", self.to.clock),
            );
        }
        match is_hold {
            true => Ok(()),
            false => refusal(
                format!("`{name}` cannot feed `{input}`, which reads a held signal"),
                "not a held signal",
                "a held input reads frames unchanged: use Hold(...)",
            ),
        }
    }

    /// Checks frames that the bridge has to carry.
    fn carries(
        &self,
        name: &str,
        carries: impl Fn(Kind) -> bool,
        help: impl Into<String>,
    ) -> Result<(), Refusal> {
        match self.kind {
            Some(kind) if !carries(kind) => refusal(
                format!("`{name}` cannot mix frames of {kind}"),
                format!("`{}` carries {kind}", self.output),
                help,
            ),
            _ => Ok(()),
        }
    }

    /// Refuses a delay, which stays on one clock.
    pub(crate) fn delay(&self) -> Result<(), Refusal> {
        self.flows("Delay", false)?;
        let help = format!("{}; delay on one side of it", self.choices());
        refusal("`Delay` stays on one clock", format!("this connection goes {}", self.ends()), help)
    }

    /// Checks a ring.
    pub(crate) fn ring(&self, latency_s: f64) -> Result<(), Refusal> {
        self.flows("Ring", false)?;
        if !self.has_two_drivers() {
            let label = format!("both ends have driver `{}`", self.from.driver);
            return refusal("`Ring` goes from one driver to another", label, self.choices());
        }
        let (from, to) = (self.from.rate, self.to.rate);
        let least_s = match least_ring_latency_s(from, to) {
            Ok(least_s) => least_s,
            Err(problem) => {
                return refusal("these rates cannot be resampled", self.ends(), problem.to_string());
            }
        };
        if latency_s < least_s {
            return bad_latency(
                format!("a ring from {from} to {to} needs a latency of at least {:.3} ms", least_s * 1e3),
                format!("{} ms is too short", latency_s * 1e3),
                "most of it is the delay of the resampler; for live runs add the longest callbacks of both drivers",
            );
        }
        if latency_s * from.hz() > MAX_RING_FRAMES {
            return bad_latency(
                format!("a ring holds at most {MAX_RING_FRAMES} frames"),
                format!("{} ms at {from} is too long", latency_s * 1e3),
                "choose a shorter latency",
            );
        }
        let help = "send what it is computed from, or the components that you need";
        self.carries("Ring", Kind::is_linear, help)
    }

    /// Checks a bridge between clocks of one driver.
    pub(crate) fn between(&self, bridge: BridgeEntry) -> Result<(), Refusal> {
        let name = bridge.spec.name;
        self.flows(name, bridge.is_hold())?;
        if self.has_two_drivers() {
            let message = format!("`{name}` works within one driver");
            return refusal(message, self.different_drivers(), self.choices());
        }
        let direction = bridge.spec.direction;
        if !direction.leads(self.from.rate, self.to.rate) {
            let label = format!("this connection goes {}", self.ends());
            return refusal(format!("`{name}` goes from {direction}"), label, self.choices());
        }
        if let Err(problem) = bridge.check(self.from.rate, self.to.rate) {
            return refusal(format!("`{name}` cannot connect these rates"), self.ends(), problem);
        }
        let help = match self.kind.is_some_and(|kind| !kind.spec().bridges.is_empty()) {
            true => self.choices(),
            false => "use Hold(...), which passes frames as they are".to_owned(),
        };
        self.carries(name, |kind| bridge.carries(kind), help)
    }

    /// Help: the possible bridges and their descriptions.
    pub(crate) fn choices(&self) -> String {
        let is_linear = self.kind.is_none_or(Kind::is_linear);
        if self.has_two_drivers() {
            return match (is_linear, self.flow) {
                (true, Flow::Sampled) => format!(
                    "their drivers differ; bridge it: Ring(from: \"{}\", latency_ms: ...), a ring and a resampler that \
                     follows both clocks",
                    self.output
                ),
                _ => format!(
                    "the drivers differ, and a ring carries only sampled, linear signals: send this node's inputs through \
                     rings and run the node on `{}`",
                    self.to.clock
                ),
            };
        }
        let fits = |bridge: &&BridgeEntry| {
            bridge.is_hold()
                || self.flow == Flow::Sampled
                    && bridge.spec.direction.leads(self.from.rate, self.to.rate)
                    && self.kind.is_none_or(|kind| bridge.carries(kind))
        };
        let fitting = self.bridges.iter().filter(fits);
        let fitting: Vec<String> =
            fitting.map(|bridge| format!("{}(...), {}", bridge.spec.name, bridge.spec.gives)).collect();
        format!("bridge it: {}", fitting.join("; or "))
    }
}

impl BridgeEntry {
    /// True if it passes frames unchanged, as an input of held frames needs.
    fn is_hold(self) -> bool {
        self == Self::of::<Hold>()
    }
}

impl Direction {
    /// True if a bridge leads from one clock to another.
    fn leads(self, from: Rate, to: Rate) -> bool {
        let ((n, d), (m, e)) = (from.parts(), to.parts());
        let rates = (u128::from(n) * u128::from(e)).cmp(&(u128::from(m) * u128::from(d)));
        match self {
            Self::Any => true,
            Self::ToFaster => rates == Ordering::Less,
            Self::ToSlower => rates == Ordering::Greater,
        }
    }
}
