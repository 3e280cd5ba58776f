use super::*;
use haptograph_signal::noise::Gaussian;
use std::f64::consts::TAU;

fn noise(samples: usize, seed: u64) -> Vec<f64> {
    let mut source = Gaussian::new(seed);
    (0..samples).map(|_| source.next_sample()).collect()
}

fn spectra(signal: &[f64]) -> WindowedSpectra {
    WindowedSpectra::new(signal, 10_000.0, &WindowSettings::COMPARISON).unwrap()
}

#[test]
fn ten_seconds_make_780_windows() {
    assert_eq!(spectra(&noise(100_000, 1)).windows(), 780);
}

#[test]
fn equal_signals_do_not_differ() {
    let signal = noise(4000, 1);
    let same = compare(&signal, &signal, 10_000.0, &WindowSettings::COMPARISON).unwrap();
    assert_eq!((same.nse, same.pe, same.sd), (0.0, 0.0, 0.0));
    let silence = vec![0.0; 4000];
    let same = compare(&silence, &silence, 10_000.0, &WindowSettings::COMPARISON).unwrap();
    assert_eq!((same.nse, same.pe, same.sd), (0.0, 0.0, 0.0));
}

#[test]
fn shape_does_not_depend_on_scale_and_power_does() {
    let a = noise(8000, 1);
    let louder: Vec<f64> = a.iter().map(|x| 3.0 * x).collect();
    let comparison = compare(&a, &louder, 10_000.0, &WindowSettings::COMPARISON).unwrap();
    assert!(comparison.nse < 1e-15);
    assert!((comparison.pe - 2.0 * 8.0 / 10.0).abs() < 1e-12, "|9-1| over their mean of 5");
    assert_eq!(comparison.sd, f64::INFINITY, "an error that never varies, for all that is rounding");
    assert_eq!(comparison.unvarying, (false, true));
}

#[test]
fn the_metric_is_symmetric() {
    let (a, b) = (noise(8000, 1), noise(8000, 2));
    let forth = compare(&a, &b, 10_000.0, &WindowSettings::COMPARISON).unwrap();
    assert_eq!(compare(&b, &a, 10_000.0, &WindowSettings::COMPARISON).unwrap(), forth);
}

#[test]
fn a_silent_window_has_power_error_two() {
    let mut half = noise(5120, 1);
    half[2560..].fill(0.0);
    let errors = PairErrors::new(&spectra(&noise(5120, 2)), &spectra(&half)).unwrap();
    assert_eq!(errors.pe[30], 2.0);
    assert!(errors.pe[3] < 1.0);
}

#[test]
fn errors_are_those_of_the_definition() {
    let (a, b) = (noise(1000, 1), noise(1000, 2));
    let errors = PairErrors::new(&spectra(&a), &spectra(&b)).unwrap();
    let window = |x: &[f64], j: usize| {
        let taper = |n: usize| 0.54 - 0.46 * (TAU * n as f64 / 255.0).cos();
        let x: Vec<f64> = (0..256).map(|n| taper(n) * x[128 * j + n]).collect();
        let amplitude = |k: usize| {
            let angle = |n: usize| -TAU * (k * n) as f64 / 256.0;
            let re: f64 = (0..256).map(|n| x[n] * angle(n).cos()).sum();
            let im: f64 = (0..256).map(|n| x[n] * angle(n).sin()).sum();
            re.hypot(im)
        };
        let amplitudes: Vec<f64> = (0..129).map(amplitude).collect();
        let root = amplitudes.iter().map(|a| a * a).sum::<f64>().sqrt();
        let energy: f64 = x.iter().map(|x| x * x).sum();
        (amplitudes.iter().map(|a| a / root).collect::<Vec<_>>(), energy)
    };
    for j in [0, 3, 5] {
        let ((x, p), (y, q)) = (window(&a, j), window(&b, j));
        let nse = x.iter().zip(&y).map(|(x, y)| (x - y).abs()).sum::<f64>() / 129.0;
        let pe = (p - q).abs() / (0.5 * (p + q));
        assert!((errors.nse[j] - nse).abs() < 1e-12 && (errors.pe[j] - pe).abs() < 1e-12);
    }
    let statistics = errors.statistics();
    let deviations = Deviations { nse: standard_deviation(&errors.nse), pe: standard_deviation(&errors.pe) };
    let terms = errors.nse.iter().zip(&errors.pe).map(|(n, p)| n / deviations.nse + p / deviations.pe);
    let sd = terms.sum::<f64>() / errors.nse.len() as f64;
    assert!((statistics.spectral_difference(&statistics.deviations()) / sd - 1.0).abs() < 1e-12);
}

#[test]
fn merged_statistics_are_those_of_all_windows() {
    let errors = PairErrors::new(&spectra(&noise(30_000, 1)), &spectra(&noise(30_000, 2))).unwrap();
    let part = |range: std::ops::Range<usize>| {
        PairErrors { nse: errors.nse[range.clone()].to_vec(), pe: errors.pe[range].to_vec() }.statistics()
    };
    let (merged, whole) = (part(0..50).merged(&part(50..errors.nse.len())), errors.statistics());
    assert_eq!(merged.windows, whole.windows);
    assert!((merged.nse / whole.nse - 1.0).abs() < 1e-12);
    assert!((merged.deviations().pe / whole.deviations().pe - 1.0).abs() < 1e-12);
    assert_eq!(ErrorStatistics::default().merged(&ErrorStatistics::default()), ErrorStatistics::default());
}

#[test]
fn a_tone_has_its_centroid_at_its_frequency_and_its_power() {
    let tone: Vec<f64> = (0..5000).map(|i| 2.0 * (TAU * 0.1 * i as f64).sin()).collect();
    let spectra = spectra(&tone);
    assert!(spectra.spectral_centroids_hz().iter().all(|f| (f - 1000.0).abs() < 2.0));
    assert!(spectra.power().iter().all(|p| (p - 2.0).abs() < 0.02));
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let settings = WindowSettings::COMPARISON;
    let error = |signal: &[f64], settings| WindowedSpectra::new(signal, 10_000.0, settings).unwrap_err();
    assert!(matches!(error(&[0.0; 255], &settings), MetricError::TooShort { .. }));
    assert!(matches!(error(&[f64::NAN; 300], &settings), MetricError::NotFinite { sample: 0 }));
    let overlapping = WindowSettings { overlap: 256, ..settings };
    assert!(matches!(error(&[0.0; 300], &overlapping), MetricError::Windows { .. }));
    let slow = WindowedSpectra::new(&noise(1000, 1), 1000.0, &settings).unwrap();
    assert!(matches!(PairErrors::new(&slow, &spectra(&noise(1000, 1))), Err(MetricError::Different { .. })));
    for beyond in [1e300, 1e-300] {
        let signal: Vec<f64> = noise(1000, 1).iter().map(|x| beyond * x).collect();
        let error = WindowedSpectra::new(&signal, 1000.0, &settings);
        assert!(matches!(error, Err(MetricError::Magnitude { .. })), "no power of {beyond}");
    }
    assert!(matches!(
        compare(&noise(300, 1), &noise(300, 2), 1000.0, &settings),
        Err(MetricError::TooFewWindows { windows: 1 })
    ));
}
