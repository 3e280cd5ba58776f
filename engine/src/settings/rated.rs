//! The ranges of settings that depend on the rate of their node.

use super::{Flag, SettingSpec, Settings, count};
use crate::document::value::Shape;
use crate::node::BuildError;

impl SettingSpec {
    /// The range at a rate of the node, Hz: a setting that is marked `[below_nyquist]` ends below half of it.
    pub fn range_at(&self, rate_hz: f64) -> Option<(f64, f64)> {
        let Some(nyquist) = self.nyquist(rate_hz) else { return self.range };
        let (low, high) = self.range.unwrap_or((0.0, f64::MAX));
        Some((low, high.min(nyquist.next_down())))
    }

    /// Half the rate in the setting's unit, if the setting has to stay below it.
    fn nyquist(&self, rate_hz: f64) -> Option<f64> {
        self.below_nyquist.then(|| 0.5 * rate_hz / self.si_per_unit)
    }
}

/// Checks the settings that depend on the rate of the node, whose other bounds were checked when they were read.
pub(crate) fn check_at<S: Settings>(settings: &S, rate_hz: f64) -> Result<(), BuildError> {
    if const { count(S::FIELDS, Flag::below_nyquist) == 0 } {
        return Ok(());
    }
    for (spec, (name, value)) in S::specs().iter().zip(settings.fields()) {
        let (Some(nyquist), Shape::Number(number, _)) = (spec.nyquist(rate_hz), value.shape) else {
            continue;
        };
        if number.is_nan() || number >= nyquist {
            let unit = spec.unit.as_ref().map_or_else(String::new, |unit| format!(" {}", unit.symbol));
            let message = format!("{number}{unit} is not below half the rate, {nyquist}{unit}");
            return Err(BuildError::at(name, message).help("lower it, or run the node on a faster clock"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::units::Millimetres;

    crate::settings! {
        /// Some end below half the rate.
        struct Toy {
            /// Of no rate.
            free: f64 = 100.0, in 0.0..=100.0;
            /// Not given.
            open_hz: Option<f64> = None, in 1e-6..=1e9;
            /// Given.
            [live, below_nyquist] cutoff_hz: Option<f64> = None, in 1e-6..=40.0;
            /// In another unit than SI.
            [live, below_nyquist] wave_mm: Millimetres = Millimetres(1.0);
        }
    }

    fn toy(cutoff_hz: f64, wave_mm: f64) -> Toy {
        Toy { free: 100.0, open_hz: None, cutoff_hz: Some(cutoff_hz), wave_mm: Millimetres(wave_mm) }
    }

    #[test]
    fn a_range_ends_below_half_the_rate_and_the_check_agrees() {
        let specs = Toy::specs();
        let ranges = |rate_hz| specs.iter().map(|spec| spec.range_at(rate_hz)).collect::<Vec<_>>();
        let below = |end: f64| end.next_down();
        assert_eq!(ranges(20.0)[0], Some((0.0, 100.0)));
        assert_eq!(ranges(20.0)[2..], [Some((1e-6, below(10.0))), Some((0.0, below(10_000.0)))]);
        assert_eq!(ranges(1e3)[2], Some((1e-6, 40.0)));
        let refused =
            |toy: Toy| check_at(&toy, 20.0).err().map(|error| (error.field.unwrap(), error.message));
        assert_eq!(refused(toy(below(10.0), below(10_000.0))), None);
        let message = "10 Hz is not below half the rate, 10 Hz".to_owned();
        assert_eq!(refused(toy(10.0, 1.0)), Some(("cutoff_hz", message)));
        let message = "10000 mm is not below half the rate, 10000 mm".to_owned();
        assert_eq!(refused(toy(1.0, 10_000.0)), Some(("wave_mm", message)));
        assert!(refused(toy(f64::NAN, 1.0)).is_some());
        assert_eq!(refused(Toy { cutoff_hz: None, ..toy(1.0, 1.0) }), None);
    }
}
