//! Signals out of nothing but time, chance or a file.

pub mod csv;
pub mod noise;
pub mod one_shot;
pub mod steps;
pub mod wav;
pub mod waves;

use haptograph_engine::frame::Kind;
use haptograph_engine::node::{BuildContext, KindRule, OutputSpec, QuantityRule};

/// A scalar output of the quantity that the setting `quantity` names.
const fn made(doc: &'static str) -> OutputSpec {
    OutputSpec {
        name: "output",
        kind: KindRule::Is(Kind::Scalar),
        quantity: QuantityRule::Setting("quantity"),
        doc,
    }
}

/// The first tick at or after a time, so that an instant falls on the same tick whatever the rounding of `time_s`.
fn tick_at(time_s: f64, cx: &BuildContext) -> u64 {
    (time_s * cx.rate.hz() - 1e-6).ceil().max(0.0) as u64
}
