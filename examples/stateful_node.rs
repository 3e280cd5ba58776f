//! A node kind with state and a setting that can be changed while it runs:
//! `cargo run --release --example stateful_node -- run examples/stateful_node.ron`.

use haptograph::engine::frame::{Kind, Scalar};
use haptograph::engine::node::{
    BuildContext, BuildError, Built, Input, Io, LiveId, NodeEntry, NodeKind, NodeSpec, Output, Processor,
    Tick, input, output,
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

/// A bristle whose foot sticks until it is pulled too hard.
pub struct Bristle;

impl NodeKind for Bristle {
    type Settings = BristleSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Bristle",
        group: "mine",
        doc: "Dry friction: a spring from the tool to a foot that sticks until the spring pulls too hard, and then is dragged.",
        source: "",
        inputs: &[input("position", Kind::SCALAR, Quantity::LENGTH, "Where the tool is, m.")],
        outputs: &[output("force", Kind::SCALAR, Quantity::FORCE, "On the tool, N.")],
        example: r#""drag": Bristle(position: "hand", slips_at_n: 0.4)"#,
    };

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

const POSITION: Input<Bristle, Scalar> = Input::named("position");
const FORCE: Output<Bristle, Scalar> = Output::named("force");
const SLIPS_AT_N: LiveId<Bristle> = LiveId::named("slips_at_n");

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
        let positions_m = io.read(POSITION);
        for (force_n, position_m) in io.write(FORCE).iter_mut().zip(positions_m) {
            *force_n = self.pull_n(*position_m);
        }
    }

    /// The graph sets a live setting.
    fn set(&mut self, setting: LiveId<Bristle>, value: f64) {
        if setting == SLIPS_AT_N {
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
