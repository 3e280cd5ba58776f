//! Inputs that fall back to a setting while they are not connected.

use haptograph_engine::frame::Kind;
use haptograph_engine::node::{BuildContext, BuildError, InputSpec, input};
use haptograph_signal::quantity::Quantity;

/// An input, and the setting that replaces it while it is not connected.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fallback {
    /// Index of the input in its node.
    pub input: usize,
    /// Name of the input.
    pub port: &'static str,
    /// Name of the setting, which is an `Option`.
    pub field: &'static str,
}

impl Fallback {
    /// Whether the input is connected.
    pub fn is_connected(&self, cx: &BuildContext) -> bool {
        cx.input_widths.get(self.input).is_some_and(|width| *width > 0)
    }

    /// The setting, which is optional if the input is connected.
    ///
    /// # Errors
    /// [`BuildError`] if the setting is missing and the input is not connected.
    pub fn setting(&self, setting: Option<f64>, cx: &BuildContext) -> Result<Option<f64>, BuildError> {
        if setting.is_some() || self.is_connected(cx) {
            return Ok(setting);
        }
        let Self { port, field, .. } = self;
        let message = format!("`{field}` is missing, and `{port}` is not connected");
        Err(BuildError::of_node(message).help(format!("add `{field}: ...`, or connect `{port}`")))
    }

    /// A warning if the setting has no effect.
    pub fn advice(&self, setting: Option<f64>, cx: &BuildContext) -> Option<BuildError> {
        let Self { port, field, .. } = self;
        (setting.is_some() && self.is_connected(cx)).then(|| {
            let message = format!("`{field}` has no effect: `{port}` is connected");
            BuildError::at(field, message).help(format!("remove `{field}`, or disconnect `{port}`"))
        })
    }
}

/// A frequency input that falls back to a setting.
pub(crate) const fn frequency_input(name: &'static str, doc: &'static str) -> InputSpec {
    input(name, Kind::Scalar, Quantity::FREQUENCY, doc).optional()
}

/// The first frame after `from` at which one of the signals changes; `frames` if there is none.
/// Unconnected signals are empty.
pub(crate) fn next_change(signals: &[&[f64]], from: usize, frames: usize) -> usize {
    let change = |signal: &&[f64]| {
        let first = signal.get(from)?.to_bits();
        let rest = signal.get(from + 1..frames)?;
        rest.iter()
            .position(|x| x.to_bits() != first)
            .map(|at| from + 1 + at)
    };
    signals.iter().filter_map(change).min().unwrap_or(frames)
}
