//! A kind of frames, a bridge that interpolates them, and nodes that make and take them:
//! `cargo run --release --example custom_kind -- run examples/custom_kind.ron`.

use haptograph::engine::bridges::{
    BridgeContext, BridgeEntry, BridgeSpec, BridgeType, Carries, Direction, Ends, Neighbours,
};
use haptograph::engine::frame::{Kind, KindSpec, Level, OneKind, Scalar, Vector};
use haptograph::engine::node::{
    BuildContext, BuildError, Built, Io, Latency, NodeEntry, NodeKind, Port, Processor, Tick,
};
use haptograph::engine::registry::Registry;
use haptograph::engine::settings::NoSettings;
use haptograph::signal::quantity::Quantity;
use haptograph::signal::time::Rate;
use std::process::ExitCode;

/// How a tool is turned, as a unit quaternion.
pub struct Orientation;

impl OneKind for Orientation {
    const KIND: Kind = Kind::new(&KindSpec {
        name: "orientation",
        one: "an orientation",
        components: &["w", "x", "y", "z"],
        neutral: &[1.0],
        is_linear: false,
        bridges: &["Slerp"],
        level: Level::norm("norm"),
    });
    type Array = [f64; Self::KIND.width()];
}

/// Turns from one orientation to the next at a constant speed.
pub struct Slerp(Neighbours);

impl BridgeType for Slerp {
    const SPEC: BridgeSpec = BridgeSpec {
        name: "Slerp",
        doc: "The shortest turn between frames, one slow period late, from a slow clock to a fast one of one driver",
        gives: "the shortest turn between frames, one slow frame late",
        direction: Direction::ToFaster,
        carries: Carries::Named,
    };

    fn new(cx: &BridgeContext) -> Self {
        Self(Neighbours::new(cx))
    }

    fn latency(from: Rate, _: Rate) -> Latency {
        Latency::of_transport(from.period_s())
    }

    fn cross(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
        self.0.cross(ends, x, y, |older, newer, part, out| {
            let cosine: f64 = older.iter().zip(newer).map(|(a, b)| a * b).sum();
            let angle = cosine.abs().min(1.0).acos();
            let (a, b) = match angle.sin() {
                sine if sine > 1e-9 => (((1.0 - part) * angle).sin() / sine, (part * angle).sin() / sine),
                _ => (1.0 - part, part),
            };
            for ((out, older), newer) in out.iter_mut().zip(older).zip(newer) {
                // A quaternion and its negative are one orientation.
                *out = a * older + b * newer * cosine.signum();
            }
        });
    }

    fn copy_state_from(&mut self, old: &Self) {
        self.0.copy_from(&old.0);
    }
}

haptograph::engine::node! {
    /// The orientation of a tool that is turned about the vertical.
    pub struct Turn(NoSettings) in "mine";
    example: r#""tool": Turn(angle: "wrist")"#;
    in ANGLE: Scalar = Port::of(Quantity::ANGLE, "How far, rad.");
    out ORIENTATION: Orientation = Port::of(Quantity::NUMBER, "Of the tool.");
}

impl NodeKind for Turn {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Turning))
    }
}

#[derive(Clone)]
struct Turning;

impl Processor<Turn> for Turning {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Turn>) {
        let angles_rad = io.read(Turn::ANGLE);
        for (frame, angle_rad) in io.write(Turn::ORIENTATION).iter_mut().zip(angles_rad) {
            let (sine, cosine) = (angle_rad / 2.0).sin_cos();
            *frame = [cosine, 0.0, 0.0, sine];
        }
    }
}

haptograph::engine::node! {
    /// The direction of a tool that lies along x before it is turned.
    pub struct Pointing(NoSettings) in "mine";
    example: r#""tip": Pointing(clock: "servo", orientation: Slerp("tool"))"#;
    in ORIENTATION: Orientation = Port::of(Quantity::NUMBER, "Of the tool.");
    out DIRECTION: Vector = Port::of(Quantity::NUMBER, "A unit vector.");
}

impl NodeKind for Pointing {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Axis))
    }
}

#[derive(Clone)]
struct Axis;

impl Processor<Pointing> for Axis {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Pointing>) {
        let orientations = io.read(Pointing::ORIENTATION);
        for (direction, [w, x, y, z]) in io.write(Pointing::DIRECTION).iter_mut().zip(orientations) {
            *direction = [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)];
        }
    }
}

/// The shipped kinds, and this program's.
pub fn registry() -> Registry {
    let mut registry = haptograph::nodes::registry();
    registry
        .add_kind(Orientation::KIND)
        .add_bridge(BridgeEntry::of::<Slerp>())
        .add(NodeEntry::processor::<Turn>())
        .add(NodeEntry::processor::<Pointing>());
    registry
}

fn main() -> ExitCode {
    haptograph::cli::main(&registry())
}
