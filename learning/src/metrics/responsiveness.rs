//! Loss of variation of a vibration that does not respond to force or speed (thesis section 4.5.3).
//!
//! The control signal responds to both (condition FS), the others to one or none. The loss is that of the
//! standard deviation over time of the windowed power, and of the windowed spectral centroid.

use super::spectral::{MetricError, WindowSettings, WindowedSpectra, variation};
use haptograph_signal::statistics::standard_deviation;

/// Losses of a condition relative to the control.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VariationLoss {
    /// Loss of power variation, the signal's unit squared. Eq. 4.5.1.
    pub power: f64,
    /// Loss of spectral centroid variation, Hz. Eq. 4.5.3.
    pub centroid_hz: f64,
}

/// Compares a condition's signal with the control signal. The windows of the thesis are
/// [`WindowSettings::RESPONSIVENESS`].
pub(crate) fn variation_loss(
    control: &[f64],
    condition: &[f64],
    rate_hz: f64,
    settings: &WindowSettings,
) -> Result<VariationLoss, MetricError> {
    let control = WindowedSpectra::new(control, rate_hz, settings)?;
    let condition = WindowedSpectra::new(condition, rate_hz, settings)?;
    let centroids = |spectra: &WindowedSpectra| variation(&spectra.spectral_centroids_hz());
    Ok(VariationLoss {
        power: variation(control.power()) - variation(condition.power()),
        centroid_hz: centroids(&control) - centroids(&condition),
    })
}

/// The spectral difference SD_x of several surfaces under one condition: both losses in units of their
/// standard deviation over the surfaces. Eq. 4.5.4. A loss that is equal for all surfaces does not
/// distinguish them and counts zero.
pub(crate) fn responsiveness_differences(losses: &[VariationLoss]) -> Vec<f64> {
    let deviation =
        |value: fn(&VariationLoss) -> f64| standard_deviation(&losses.iter().map(value).collect::<Vec<_>>());
    let (power, centroid) = (deviation(|loss| loss.power), deviation(|loss| loss.centroid_hz));
    let term = |value: f64, deviation: f64| if deviation > 0.0 { value / deviation } else { 0.0 };
    losses.iter().map(|loss| term(loss.power, power) + term(loss.centroid_hz, centroid)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;

    #[test]
    fn a_signal_of_constant_loudness_loses_the_controls_variation() {
        let mut noise = Gaussian::new(1);
        let steady: Vec<f64> = (0..3200).map(|_| noise.next_sample()).collect();
        let swelling: Vec<f64> = steady.iter().enumerate().map(|(i, x)| x * (i as f64 / 800.0)).collect();
        let settings = WindowSettings::RESPONSIVENESS;
        let loss = variation_loss(&swelling, &steady, 1000.0, &settings).unwrap();
        assert!(loss.power > 3.0, "{loss:?}");
        let none = variation_loss(&steady, &steady, 1000.0, &settings).unwrap();
        assert_eq!(none, VariationLoss { power: 0.0, centroid_hz: 0.0 });
    }

    #[test]
    fn losses_are_weighed_by_their_deviation_over_surfaces() {
        let loss = |power: f64, centroid_hz: f64| VariationLoss { power, centroid_hz };
        let differences = responsiveness_differences(&[loss(1.0, 10.0), loss(3.0, 10.0)]);
        let deviation = 2.0_f64.sqrt();
        assert!(
            (differences[0] - 1.0 / deviation).abs() < 1e-12
                && (differences[1] - 3.0 / deviation).abs() < 1e-12
        );
    }
}
