//! Inputs that fall back to a setting while they are not connected.

use haptograph_engine::frame::{Kind, Scalar};
use haptograph_engine::node::{
    BuildContext, BuildError, Input, InputSpec, NodeKind, Optional, SettingId, input,
};
use haptograph_signal::quantity::Quantity;

/// An input, and the setting that replaces it while it is not connected.
#[derive(Debug)]
pub(crate) struct Fallback<K> {
    pub input: Input<K, Scalar, Optional>,
    pub setting: SettingId,
    port: &'static str,
    field: &'static str,
}

impl<K: NodeKind> Fallback<K> {
    /// The input `port` of the kind, and its setting `field`, which is an `Option`.
    pub const fn named(port: &'static str, field: &'static str) -> Self {
        Self {
            input: Input::named(port),
            setting: SettingId::of::<K::Settings>(field),
            port,
            field,
        }
    }

    /// True if the input is connected.
    pub fn is_connected(&self, cx: &BuildContext) -> bool {
        cx.is_connected(self.input)
    }

    /// The setting, which is optional if the input is connected.
    ///
    /// # Errors
    /// [`BuildError`] if the setting is missing and the input is not connected.
    pub fn value(&self, setting: Option<f64>, cx: &BuildContext) -> Result<Option<f64>, BuildError> {
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
    input(name, Kind::SCALAR, Quantity::FREQUENCY, doc).optional()
}

/// The first frame after `from` at which one of the signals changes; `frames` if there is none.
/// A signal that is not connected never changes.
pub(crate) fn next_change(signals: &[Option<&[f64]>], from: usize, frames: usize) -> usize {
    let change = |signal: &&[f64]| {
        let first = signal.get(from)?.to_bits();
        let rest = signal.get(from + 1..frames)?;
        rest.iter()
            .position(|x| x.to_bits() != first)
            .map(|at| from + 1 + at)
    };
    signals
        .iter()
        .flatten()
        .filter_map(change)
        .min()
        .unwrap_or(frames)
}
