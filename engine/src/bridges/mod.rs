//! Bridges between clocks of one driver: a file for each type behind one trait, and a table of them.
//!
//! Alignment is exact: a reader's tick at time t reads the writer's frames with time <= t, by integer arithmetic, so
//! that the result does not depend on the block size.

mod advice;
mod average;
mod ends;
mod hold;
mod linear;
mod neighbours;
mod resample;
mod ring;

use crate::frame::Kind;
use crate::node::Latency;
use haptograph_signal::time::Rate;
use std::any::Any;
use std::fmt;

pub(crate) use advice::{Crossing, End};
pub use average::Average;
pub use ends::Ends;
pub(crate) use ends::Ticks;
pub use hold::Hold;
pub(crate) use hold::HoldRuns;
pub use linear::Linear;
pub use neighbours::Neighbours;
pub use resample::Resample;
pub use ring::least_ring_latency_s;
pub(crate) use ring::steered;

/// A type of bridge between clocks of one driver, and the state of one such bridge.
///
/// A graph writes it around a connection: `Hold("node.output")`.
///
/// ```
/// use haptograph_engine::bridges::{
///     BridgeContext, BridgeEntry, BridgeSpec, BridgeType, Carries, Direction, Ends, Hold,
/// };
/// use haptograph_engine::frame::Kind;
/// use haptograph_engine::node::Latency;
/// use haptograph_engine::registry::Registry;
/// use haptograph_signal::time::Rate;
///
/// /// The latest frame, at half its size.
/// struct Half(Hold);
///
/// impl BridgeType for Half {
///     const SPEC: BridgeSpec = BridgeSpec {
///         name: "Half",
///         doc: "Half of the latest frame, between clocks of one driver",
///         gives: "half of the latest frame",
///         direction: Direction::Any,
///         carries: Carries::Linear,
///     };
///
///     fn new(cx: &BridgeContext) -> Self {
///         Self(Hold::new(cx))
///     }
///
///     fn latency(from: Rate, to: Rate) -> Latency {
///         Hold::latency(from, to)
///     }
///
///     fn cross(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
///         self.0.cross(ends, x, y);
///         y.iter_mut().for_each(|y| *y *= 0.5);
///     }
///
///     fn copy_state_from(&mut self, old: &Self) {
///         self.0.copy_state_from(&old.0);
///     }
/// }
///
/// let mut registry = Registry::new();
/// registry.add_bridge(BridgeEntry::of::<Half>());
/// let half = registry.bridge("Half").unwrap();
/// assert!(half.carries(Kind::VECTOR) && !half.carries(Kind::EVENT));
/// ```
pub trait BridgeType: Send + Sync + 'static {
    /// Name, documentation and the clocks that the bridge connects.
    const SPEC: BridgeSpec;

    /// Checks that the bridge can connect clocks of these rates.
    ///
    /// # Errors
    /// The reason and the remedy, for the help of a message.
    fn check(from: Rate, to: Rate) -> Result<(), String> {
        let _ = (from, to);
        Ok(())
    }

    /// Makes the state of a bridge that no frame has crossed yet, between clocks that [`check`](Self::check) has accepted. May
    /// allocate.
    fn new(cx: &BridgeContext) -> Self;

    /// Delay between clocks of these rates.
    fn latency(from: Rate, to: Rate) -> Latency;

    /// Converts the frames `x` of the writer to the frames `y` of the reader, all components of a frame side by side.
    /// Real-time code: it does not allocate, and it writes every frame of `y`.
    ///
    /// Either slice may be empty. The frames must not depend on how time is divided into windows.
    fn cross(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]);

    /// Copies the state of the corresponding bridge of the replaced graph, made in an equal context. Real-time code.
    fn copy_state_from(&mut self, old: &Self);
}

/// Specification of a type of bridge; the source of its documentation, messages and checks.
#[derive(Debug, Clone, Copy)]
pub struct BridgeSpec {
    /// Name in graph files.
    pub name: &'static str,
    /// Description and the clocks that it connects, without a full stop.
    pub doc: &'static str,
    /// The result of the bridge, for the list of choices in a message: `the latest frame`.
    pub gives: &'static str,
    /// Clocks that it connects.
    pub direction: Direction,
    /// Frames that it carries.
    pub carries: Carries,
}

/// The clocks that a type of bridge connects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Any two clocks of one driver.
    Any,
    /// From a slow clock to a faster one.
    ToFaster,
    /// From a fast clock to a slower one.
    ToSlower,
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Any => "any clock to another",
            Self::ToFaster => "a slow clock to a faster one",
            Self::ToSlower => "a fast clock to a slower one",
        })
    }
}

/// The kinds of frames that a type of bridge carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Carries {
    /// All: frames pass unchanged.
    Every,
    /// Linear kinds, which the bridge mixes component by component, and those that name it.
    Linear,
    /// Kinds that name the bridge in [`KindSpec::bridges`](crate::frame::KindSpec::bridges).
    Named,
}

/// Context in which a bridge is made.
#[derive(Debug, Clone)]
pub struct BridgeContext {
    /// Kind of the frames.
    pub kind: Kind,
    /// Rate of the writer.
    pub from: Rate,
    /// Rate of the reader.
    pub to: Rate,
    /// Largest number of the writer's frames in one call of [`BridgeType::cross`].
    pub max_from: usize,
    /// Largest number of the reader's frames in one call.
    pub max_to: usize,
}

/// A registered type of bridge, its type erased. Equal entries have equal names.
#[derive(Clone, Copy)]
pub struct BridgeEntry {
    /// Name, documentation and the clocks that the bridge connects.
    pub spec: &'static BridgeSpec,
    check: fn(Rate, Rate) -> Result<(), String>,
    latency: fn(Rate, Rate) -> Latency,
    build: fn(&BridgeContext) -> Box<dyn BridgeState>,
}

impl BridgeEntry {
    /// The types that every registry has.
    pub(crate) const ENGINE: [Self; 4] =
        [Self::of::<Hold>(), Self::of::<Linear>(), Self::of::<Average>(), Self::of::<Resample>()];

    /// Erases the type of a bridge.
    pub const fn of<B: BridgeType>() -> Self {
        Self {
            spec: &const { B::SPEC },
            check: B::check,
            latency: B::latency,
            build: |cx| Box::new(B::new(cx)),
        }
    }

    /// True if frames of this kind can cross it.
    pub fn carries(self, kind: Kind) -> bool {
        match self.spec.carries {
            Carries::Every => true,
            Carries::Linear if kind.is_linear() => true,
            Carries::Linear | Carries::Named => kind.spec().bridges.contains(&self.spec.name),
        }
    }

    pub(crate) fn check(self, from: Rate, to: Rate) -> Result<(), String> {
        (self.check)(from, to)
    }

    pub(crate) fn latency(self, from: Rate, to: Rate) -> Latency {
        (self.latency)(from, to)
    }

    pub(crate) fn build(self, cx: &BridgeContext) -> Box<dyn BridgeState> {
        (self.build)(cx)
    }
}

impl PartialEq for BridgeEntry {
    fn eq(&self, other: &Self) -> bool {
        self.spec.name == other.spec.name
    }
}

impl fmt::Debug for BridgeEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.spec.name)
    }
}

/// State of a bridge, its type erased.
pub(crate) trait BridgeState: Any + Send + Sync {
    fn convert(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]);
    /// Leaves the state if the other is of another type.
    fn continue_from(&mut self, old: &dyn BridgeState);
}

impl<B: BridgeType> BridgeState for B {
    fn convert(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
        self.cross(ends, x, y);
    }

    fn continue_from(&mut self, old: &dyn BridgeState) {
        let old: &dyn Any = old;
        if let Some(old) = old.downcast_ref() {
            self.copy_state_from(old);
        }
    }
}

/// Period of the slower clock, s.
fn slow_s(from: Rate, to: Rate) -> f64 {
    from.period_s().max(to.period_s())
}
