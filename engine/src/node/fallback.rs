//! Inputs that fall back to a setting while they are not connected.

use super::{BuildContext, BuildError, Declared, Input, LiveId, Optional};
use crate::frame::Scalar;

/// An input, and the setting that replaces it while it is not connected: the frequency of an oscillator, the cut-off of a
/// filter.
///
/// The input is declared `.optional()`, the setting an `Option` that is `None` by default. A node without either is
/// refused, one with both gets a warning:
///
/// ```
/// use haptograph_engine::frame::{Kind, Scalar};
/// use haptograph_engine::node::{
///     BuildContext, BuildError, Built, Fallback, Io, LiveId, NodeKind, Optional, Port, Processor, Tick,
/// };
/// use haptograph_engine::testing::Bench;
/// use haptograph_signal::quantity::Quantity;
///
/// haptograph_engine::settings! {
///     /// Settings of [`Sawtooth`].
///     pub struct SawtoothSettings {
///         /// Periods a second; required unless `frequency` is connected.
///         [live] frequency_hz: Option<f64> = None, in 0.0..=1e4;
///     }
/// }
///
/// haptograph_engine::node! {
///     /// Rises from 0 to 1, over and over.
///     pub struct Sawtooth(SawtoothSettings) in "mine";
///     example: r#""saw": Sawtooth(clock: "servo", frequency_hz: 2)"#;
///     in FREQUENCY: Scalar, Optional = Port::of(Quantity::FREQUENCY, "Replaces `frequency_hz`.");
///     out OUTPUT: Scalar = Port::of(Quantity::NUMBER, "The sawtooth.");
/// }
/// const FREQUENCY: Fallback<Sawtooth> = Fallback::new(Sawtooth::FREQUENCY, SawtoothSettings::frequency_hz);
///
/// impl NodeKind for Sawtooth {
///     fn build(settings: SawtoothSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
///         let frequency_hz = FREQUENCY.value(settings.frequency_hz, cx)?.unwrap_or(0.0);
///         Ok(Built::new(Rising { frequency_hz, turns: 0.0 }))
///     }
///
///     fn advice(settings: &SawtoothSettings, cx: &BuildContext) -> Vec<BuildError> {
///         FREQUENCY.advice(settings.frequency_hz, cx).into_iter().collect()
///     }
/// }
///
/// #[derive(Clone)]
/// struct Rising {
///     frequency_hz: f64,
///     turns: f64,
/// }
///
/// impl Processor<Sawtooth> for Rising {
///     fn process(&mut self, tick: &Tick, io: &mut Io<'_, Sawtooth>) {
///         let signal = io.read(FREQUENCY.input);
///         for (frame, y) in io.write(Sawtooth::OUTPUT).iter_mut().enumerate() {
///             // At its own tick and at no other, or the samples would depend on the blocks.
///             if let Some(hz) = signal.and_then(|signal| signal.get(frame)).filter(|hz| hz.is_finite()) {
///                 self.frequency_hz = hz.clamp(0.0, 1e4);
///             }
///             *y = self.turns;
///             self.turns = (self.turns + self.frequency_hz * tick.period_s).fract();
///         }
///     }
///
///     fn set(&mut self, setting: LiveId<SawtoothSettings>, value: f64) {
///         if setting == FREQUENCY.setting {
///             self.frequency_hz = value;
///         }
///     }
/// }
///
/// let given = |frequency_hz| SawtoothSettings { frequency_hz };
/// let mut alone = Bench::new::<Sawtooth>(given(Some(250.0)), 1000.0, &[])?;
/// assert_eq!(alone.run_source(5), [[0.0, 0.25, 0.5, 0.75, 0.0]]);
/// let mut follows = Bench::new::<Sawtooth>(given(None), 1000.0, &[Kind::SCALAR])?;
/// assert_eq!(follows.run(&[&[500.0, 250.0, 250.0]]), [[0.0, 0.5, 0.75]]);
/// assert!(Bench::new::<Sawtooth>(given(None), 1000.0, &[]).is_err());
/// # Ok::<(), BuildError>(())
/// ```
#[derive(Debug)]
pub struct Fallback<K: Declared> {
    /// The input.
    pub input: Input<K, Scalar, Optional>,
    /// The setting.
    pub setting: LiveId<K::Settings>,
}

impl<K: Declared> Fallback<K> {
    /// An input of the kind, and its setting, which is an `Option`.
    pub const fn new(input: Input<K, Scalar, Optional>, setting: LiveId<K::Settings>) -> Self {
        Self { input, setting }
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
        let (port, field) = (self.input.name(), self.setting.name());
        let message = format!("`{field}` is missing, and `{port}` is not connected");
        Err(BuildError::of_node(message).help(format!("add `{field}: ...`, or connect `{port}`")))
    }

    /// A warning if the setting has no effect.
    pub fn advice(&self, setting: Option<f64>, cx: &BuildContext) -> Option<BuildError> {
        let (port, field) = (self.input.name(), self.setting.name());
        (setting.is_some() && self.is_connected(cx)).then(|| {
            let message = format!("`{field}` has no effect: `{port}` is connected");
            BuildError::at(field, message).help(format!("remove `{field}`, or disconnect `{port}`"))
        })
    }
}

/// The first frame after `from` at which one of the signals changes; `frames` if there is none.
/// A signal that is not connected never changes.
pub fn next_change(signals: &[Option<&[f64]>], from: usize, frames: usize) -> usize {
    let change = |signal: &&[f64]| {
        let first = signal.get(from)?.to_bits();
        let rest = signal.get(from + 1..frames)?;
        rest.iter().position(|x| x.to_bits() != first).map(|at| from + 1 + at)
    };
    signals.iter().flatten().filter_map(change).min().unwrap_or(frames)
}
