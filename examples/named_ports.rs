//! A node kind whose inputs and outputs the graph names:
//! `cargo run --release --example named_ports -- run examples/named_ports.ron`.

use haptograph::engine::frame::Scalar;
use haptograph::engine::node::{
    BuildContext, BuildError, Built, Family, Io, Named, NodeEntry, NodeKind, Port, Processor, Tick,
};
use haptograph::engine::registry::Registry;
use haptograph::signal::quantity::Quantity;
use std::process::ExitCode;

haptograph::engine::settings! {
    /// Settings of [`Grip`].
    pub struct GripSettings {
        /// The fingers whose shares of the whole are outputs.
        shares: Vec<String> = vec![];
    }
}

haptograph::engine::node! {
    /// Adds the forces of fingers, and gives the shares of some of them.
    pub struct Grip(GripSettings) in "mine";
    example: r#""grip": Grip(fingers: {"thumb": "a.output", "index": "b.output"}, shares: ["thumb"])"#;
    in FINGERS: Scalar, Named = Port::of(Quantity::FORCE, "Force of each finger, N.");
    out WHOLE: Scalar = Port::of(Quantity::FORCE, "Sum of the forces, N.");
    out SHARES: Scalar, Family =
        Port::of(Quantity::NUMBER, "Part of the whole; 0 without a force.").named_by("shares");
}

impl NodeKind for Grip {
    fn members(settings: &GripSettings) -> Result<Vec<String>, BuildError> {
        Ok(settings.shares.clone())
    }

    fn build(settings: GripSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let fingers = cx.names(Grip::FINGERS);
        if fingers.is_empty() {
            let wrong = BuildError::at("fingers", "the fingers need names");
            return Err(wrong.help("write a map: {\"thumb\": \"a.output\", \"index\": \"b.output\"}"));
        }
        let finger_of = |share: &String| {
            let place = fingers.iter().position(|finger| finger == share);
            place.ok_or_else(|| {
                let wrong = BuildError::at("shares", format!("`{share}` is none of the fingers"));
                wrong.help(format!("the fingers are {}", fingers.join(", ")))
            })
        };
        let shares: Result<_, BuildError> = settings.shares.iter().map(finger_of).collect();
        Ok(Built::new(Sum { shares: shares? }))
    }
}

#[derive(Clone)]
struct Sum {
    /// The finger of each share.
    shares: Box<[usize]>,
}

impl Processor<Grip> for Sum {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Grip>) {
        let fingers = io.read(Grip::FINGERS);
        for frame in 0..tick.frames {
            let whole_n: f64 = fingers.iter().map(|force_n| force_n[frame]).sum();
            io.write(Grip::WHOLE)[frame] = whole_n;
            for (member, finger) in self.shares.iter().enumerate() {
                let share = fingers.nth_or_last(*finger)[frame] / whole_n;
                io.write_member(Grip::SHARES, member)[frame] = if share.is_finite() { share } else { 0.0 };
            }
        }
    }
}

/// The shipped kinds, and this program's.
pub fn registry() -> Registry {
    let mut registry = haptograph::nodes::registry();
    registry.add(NodeEntry::processor::<Grip>());
    registry
}

fn main() -> ExitCode {
    haptograph::cli::main(&registry())
}
