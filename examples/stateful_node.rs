//! A node kind with state and a setting that can be changed while it runs:
//! `cargo run --release --example stateful_node -- run examples/stateful_node.ron`.

use haptograph::engine::frame::Scalar;
use haptograph::engine::node::{
    BuildContext, BuildError, Built, Io, LiveId, NodeEntry, NodeKind, Port, Processor, Tick,
};
use haptograph::engine::registry::Registry;
use haptograph::signal::quantity::Quantity;
use haptograph::signal::units::NewtonsPerMillimetre;
use std::process::ExitCode;

haptograph::engine::settings! {
    /// Settings of [`Bristle`].
    pub struct BristleSettings {
        /// Of the bristle while it sticks, N/mm.
        stiffness_n_per_mm: NewtonsPerMillimetre = NewtonsPerMillimetre(0.5), in 0.0..=100.0;
        /// The pull at which its foot slips, N.
        [live] slips_at_n: f64 = 0.6, in 0.0..=10.0;
    }
}

haptograph::engine::node! {
    /// Dry friction: a spring from the tool to a foot that sticks until the spring pulls too hard, and then is dragged.
    pub struct Bristle(BristleSettings) in "mine";
    example: r#""drag": Bristle(position: "hand", slips_at_n: 0.4)"#;
    in POSITION: Scalar = Port::of(Quantity::LENGTH, "Where the tool is, m.");
    out FORCE: Scalar = Port::of(Quantity::FORCE, "On the tool, N.");
}

impl NodeKind for Bristle {
    fn build(settings: BristleSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        if settings.stiffness_n_per_mm.si() == 0.0 && settings.slips_at_n > 0.0 {
            let wrong = BuildError::at("stiffness_n_per_mm", "a bristle without stiffness never slips");
            return Err(wrong.help("give it a stiffness above 0, or take the node away"));
        }
        Ok(Built::new(Spring {
            stiffness_n_per_m: settings.stiffness_n_per_mm.si(),
            slips_at_n: settings.slips_at_n,
            foot_m: None,
        }))
    }
}

#[derive(Clone)]
struct Spring {
    stiffness_n_per_m: f64,
    slips_at_n: f64,
    /// Where the foot is; nowhere before the first frame. This is the state: it goes from call to call.
    foot_m: Option<f64>,
}

impl Spring {
    /// One frame: the foot follows where it has to.
    fn pull_n(&mut self, position_m: f64) -> f64 {
        let reach_m = self.slips_at_n / self.stiffness_n_per_m;
        let foot_m = self.foot_m.unwrap_or(position_m);
        let foot_m = foot_m.max(position_m - reach_m).min(position_m + reach_m);
        self.foot_m = Some(foot_m);
        -self.stiffness_n_per_m * (position_m - foot_m)
    }
}

impl Processor<Bristle> for Spring {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Bristle>) {
        let positions_m = io.read(Bristle::POSITION);
        for (force_n, position_m) in io.write(Bristle::FORCE).iter_mut().zip(positions_m) {
            *force_n = self.pull_n(*position_m);
        }
    }

    /// The graph sets a live setting.
    fn set(&mut self, setting: LiveId<BristleSettings>, value: f64) {
        if setting == BristleSettings::slips_at_n {
            self.slips_at_n = value;
        }
    }

    /// The graph was changed while it runs: the new bristle stands where this one stood.
    fn copy_state_into(&self, new: &mut Self) {
        new.foot_m = self.foot_m;
    }
}

/// The shipped kinds, and this program's.
pub fn registry() -> Registry {
    let mut registry = haptograph::nodes::registry();
    registry.add(NodeEntry::processor::<Bristle>());
    registry
}

fn main() -> ExitCode {
    haptograph::cli::main(&registry())
}
