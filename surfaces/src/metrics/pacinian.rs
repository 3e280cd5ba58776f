//! How small a vibration the hand feels, by frequency.

use std::f64::consts::TAU;

/// Thresholds of the Pacinian channel after Verrillo (J. Acoust. Soc. Am. 35, 1962-1966, 1963) and Bolanowski, Gescheider,
/// Verrillo and Checkosky (J. Acoust. Soc. Am. 84, 1680-1694, 1988), thenar eminence, contactor of 2.9 cm²: frequency in Hz,
/// peak displacement in dB above 1 µm. It falls by 12 dB an octave to its least at 250 Hz; the values are rounded, those
/// above 250 Hz good to some 3 dB.
pub const PACINIAN_THRESHOLDS: [(f64, f64); 9] = [
    (20.0, 24.0),
    (40.0, 12.0),
    (80.0, 0.0),
    (160.0, -12.0),
    (250.0, -20.0),
    (320.0, -19.0),
    (500.0, -8.0),
    (700.0, 6.0),
    (1000.0, 24.0),
];

/// The least peak acceleration that the Pacinian channel feels, dB above 1 m/s²: the displacement of
/// [`PACINIAN_THRESHOLDS`], linear in the logarithm of frequency and held beyond the table, times (2 pi f)².
pub fn acceleration_threshold_db(frequency_hz: f64) -> f64 {
    let table = &PACINIAN_THRESHOLDS;
    let last = table.len() - 1;
    let next = table.iter().position(|(f, _)| *f > frequency_hz).unwrap_or(last);
    let ((low_hz, low_db), (high_hz, high_db)) = (table[next.max(1) - 1], table[next.max(1)]);
    let part = ((frequency_hz / low_hz).ln() / (high_hz / low_hz).ln()).clamp(0.0, 1.0);
    // Micrometres to metres: 120 dB.
    low_db + part * (high_db - low_db) - 120.0 + 40.0 * (TAU * frequency_hz).log10()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn below_250_hz_the_threshold_is_one_acceleration() {
        // 12 dB an octave are just what the second derivative adds.
        for frequency_hz in [20.0, 35.0, 63.0, 140.0, 240.0] {
            let off_db = acceleration_threshold_db(frequency_hz) - acceleration_threshold_db(80.0);
            assert!(off_db.abs() < 0.5, "{frequency_hz} Hz: {off_db}");
        }
        // 1 µm at 80 Hz is 0.25 m/s².
        assert!((acceleration_threshold_db(80.0) - 20.0 * 0.2527_f64.log10()).abs() < 0.01);
        assert!(acceleration_threshold_db(1000.0) > acceleration_threshold_db(250.0) + 60.0);
        assert!(acceleration_threshold_db(5.0).is_finite() && acceleration_threshold_db(4000.0).is_finite());
    }
}
