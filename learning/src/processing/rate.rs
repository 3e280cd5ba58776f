//! Resamples processed signals to a lower rate, at which models of the same order span more time.

use super::ProcessingError;
use crate::signals::{Series, Signals};
use haptograph_signal::resample::{Quality, resample_whole};
use haptograph_signal::time::Rate;

/// Lowest rate of a vibration, Hz.
pub const LOWEST_RATE_HZ: f64 = 100.0;

/// The same signals at `rate_hz`, band-limited.
pub(super) fn lowered(signals: &Signals, rate_hz: f64) -> Result<Signals, ProcessingError> {
    let own_hz = signals.rate_hz;
    if !(LOWEST_RATE_HZ..=own_hz).contains(&rate_hz) {
        return Err(ProcessingError::Rate { rate_hz, own_hz });
    }
    let odd = |hz: f64| Rate::parse(&hz.to_string()).map_err(|_| ProcessingError::Rate { rate_hz, own_hz });
    let (from, to) = (odd(own_hz)?, odd(rate_hz)?);
    let vibration =
        |x: &[f64]| resample_whole(x, from, to, Quality::FINE).map_err(ProcessingError::Resampling);
    let acceleration_m_s2 = vibration(&signals.acceleration_m_s2)?;
    let samples = acceleration_m_s2.len();
    // Forces and speed are smooth, and do not end in silence as vibrations may be taken to.
    let smooth = |x: &[f64]| {
        let series = Series::new(own_hz, x.to_vec());
        (0..samples).map(|k| series.at(k as f64 / rate_hz)).collect()
    };
    let axes_m_s2 = match &signals.axes_m_s2 {
        None => None,
        Some(axes) => {
            let axis = |axis: usize| vibration(&axes.iter().map(|a| a[axis]).collect::<Vec<_>>());
            let (x, y, z) = (axis(0)?, axis(1)?, axis(2)?);
            Some((0..samples).map(|k| [x[k], y[k], z[k]]).collect())
        }
    };
    Ok(Signals {
        rate_hz,
        acceleration_m_s2,
        force_normal_n: smooth(&signals.force_normal_n),
        force_tangential_n: signals.force_tangential_n.as_deref().map(smooth),
        speed_m_s: smooth(&signals.speed_m_s),
        axes_m_s2,
    })
}
