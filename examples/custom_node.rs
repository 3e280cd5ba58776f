//! A program with a node kind of its own and every command of haptograph:
//! `cargo run --release --example custom_node -- run examples/custom_node.ron`.

use haptograph::engine::frame::Scalar;
use haptograph::engine::node::{
    BuildContext, BuildError, Built, Io, NodeEntry, NodeKind, Port, Processor, Tick,
};
use haptograph::engine::registry::Registry;
use haptograph::signal::quantity::Quantity;
use haptograph::signal::units::Millimetres;
use std::f64::consts::TAU;
use std::process::ExitCode;

haptograph::engine::settings! {
    /// Settings of [`Detents`].
    pub struct DetentsSettings {
        /// From one rest position to the next, mm.
        pitch_mm: Millimetres = Millimetres(2.0), in 0.01..=1000.0;
        /// The strongest pull, N.
        strength_n: f64 = 0.5, in 0.0..=10.0;
    }
}

haptograph::engine::node! {
    /// Pulls the tool to the nearest of evenly spaced rest positions: F = -F0 sin(2 pi x / pitch).
    pub struct Detents(DetentsSettings) in "mine";
    example: r#""detents": Detents(position: "hand", pitch_mm: 5)"#;
    in POSITION: Scalar = Port::of(Quantity::LENGTH, "Where the tool is, m.");
    out FORCE: Scalar = Port::of(Quantity::FORCE, "On the tool, N.");
}

impl NodeKind for Detents {
    fn build(settings: DetentsSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Pull { radians_per_m: TAU / settings.pitch_mm.si(), strength_n: settings.strength_n }))
    }
}

#[derive(Clone)]
struct Pull {
    radians_per_m: f64,
    strength_n: f64,
}

impl Processor<Detents> for Pull {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Detents>) {
        let positions_m = io.read(Detents::POSITION);
        for (force_n, position_m) in io.write(Detents::FORCE).iter_mut().zip(positions_m) {
            *force_n = -self.strength_n * (self.radians_per_m * position_m).sin();
        }
    }
}

/// The shipped kinds, and this program's.
pub fn registry() -> Registry {
    let mut registry = haptograph::nodes::registry();
    registry.add(NodeEntry::processor::<Detents>());
    registry
}

fn main() -> ExitCode {
    haptograph::cli::main(&registry())
}
