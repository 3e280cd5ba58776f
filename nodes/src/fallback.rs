//! Inputs that a setting stands in for while they are not connected.

use haptograph_engine::frame::Kind;
use haptograph_engine::node::{BuildContext, BuildError, InputSpec, input};
use haptograph_signal::quantity::Quantity;

/// An input, and the setting that counts while it is not connected.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fallback {
    /// Place of the input among those of its node.
    pub input: usize,
    /// Name of the input.
    pub port: &'static str,
    /// Name of the setting, which is an `Option`.
    pub field: &'static str,
}

impl Fallback {
    /// Is the input connected?
    pub fn is_connected(&self, cx: &BuildContext) -> bool {
        cx.input_widths.get(self.input).is_some_and(|width| *width > 0)
    }

    /// The setting; none is needed where the input is connected.
    ///
    /// # Errors
    /// [`BuildError`] where there is neither.
    pub fn setting(&self, setting: Option<f64>, cx: &BuildContext) -> Result<Option<f64>, BuildError> {
        if setting.is_some() || self.is_connected(cx) {
            return Ok(setting);
        }
        let Self { port, field, .. } = self;
        let message = format!("`{field}` is missing, and `{port}` is not connected");
        Err(BuildError::of_node(message).help(format!("add `{field}: ...`, or connect `{port}`")))
    }

    /// A warning where the setting is written and counts for nothing.
    pub fn advice(&self, setting: Option<f64>, cx: &BuildContext) -> Option<BuildError> {
        let Self { port, field, .. } = self;
        (setting.is_some() && self.is_connected(cx)).then(|| {
            let message = format!("`{field}` has no effect: `{port}` is connected");
            BuildError::at(field, message).help(format!("remove `{field}`, or disconnect `{port}`"))
        })
    }
}

/// An input of a frequency that a setting stands in for.
pub(crate) const fn frequency_input(name: &'static str, doc: &'static str) -> InputSpec {
    input(name, Kind::Scalar, Quantity::FREQUENCY, doc).optional()
}

/// The first frame after `from` at which one of the signals has another value than at `from`; `frames` where there is none.
/// Signals that are not connected are empty.
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
