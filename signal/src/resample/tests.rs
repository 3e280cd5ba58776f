use super::*;
use crate::noise::Gaussian;
use std::f64::consts::TAU;

fn hz(rate: u64) -> Rate {
    Rate::from_hz(rate).unwrap()
}

const PAIRS: [(u64, u64); 7] = [
    (10_000, 48_000),
    (1000, 10_000),
    (48_000, 10_000),
    (10_000, 1000),
    (44_100, 48_000),
    (240, 10_000),
    (1000, 1000),
];

const QUALITIES: [Quality; 3] = [Quality::LOW_LATENCY, Quality::STANDARD, Quality::FINE];

/// Inputs before the moment `s` (in units of 1/(input output) seconds) and outputs before it.
fn resample_all(input: u64, output: u64, quality: Quality, x: &[f64]) -> (Vec<f64>, f64) {
    let mut resampler = Resampler::new(hz(input), hz(output), quality).unwrap();
    let mut y = vec![0.0; resampler.outputs_before(x.len() as u64) as usize];
    let progress = resampler.process(x, &mut y);
    assert_eq!(progress, Progress { consumed: x.len(), produced: y.len() });
    (y, resampler.latency_s())
}

#[test]
fn sines_of_the_pass_band_arrive_delayed_by_the_latency() {
    for (input, output) in PAIRS {
        for quality in QUALITIES {
            let nyquist = input.min(output) as f64 / 2.0;
            for part in [0.1, 0.6, 1.0] {
                let f = part * quality.passband * nyquist;
                let seconds = 400.0 / nyquist;
                let x: Vec<f64> = (0..(seconds * input as f64) as usize)
                    .map(|n| (TAU * f * n as f64 / input as f64 + 0.3).sin())
                    .collect();
                let (y, latency) = resample_all(input, output, quality, &x);
                for (k, y) in y.iter().enumerate() {
                    let t = k as f64 / output as f64 - latency;
                    if t > latency {
                        let want = (TAU * f * t + 0.3).sin();
                        assert!((y - want).abs() < 2.5e-5, "{input} {output} {quality:?} {f}: {y} {want}");
                    }
                }
            }
        }
    }
}

#[test]
fn what_lies_in_the_stop_band_is_gone() {
    // Going down, sines of the stop band would alias.
    for (input, output) in [(48_000, 10_000), (10_000, 1000)] {
        for quality in QUALITIES {
            for part in [1.0, 1.37, 2.2] {
                let f = part * quality.stopband * output as f64 / 2.0;
                if f > input as f64 / 2.0 {
                    continue;
                }
                let x: Vec<f64> = (0..input).map(|n| (TAU * f * n as f64 / input as f64).sin()).collect();
                let (y, latency) = resample_all(input, output, quality, &x);
                let settled = (2.0 * latency * output as f64) as usize + 1;
                let peak = y[settled..].iter().fold(0.0_f64, |peak, y| peak.max(y.abs()));
                assert!(peak < 1.6e-5, "{input} {output} {quality:?} {f}: {peak}");
            }
        }
    }
}

#[test]
fn latencies_are_as_stated() {
    let latency = |quality| Resampler::new(hz(10_000), hz(48_000), quality).unwrap().latency_frames();
    assert_eq!(QUALITIES.map(latency), [7, 17, 79]);
    let resampler = Resampler::new(hz(10_000), hz(48_000), Quality::LOW_LATENCY).unwrap();
    assert!((resampler.latency_s() - 0.0007).abs() < 1e-12);
}

#[test]
fn the_samples_do_not_depend_on_the_blocks() {
    let mut x = vec![0.0; 5000];
    Gaussian::new(1).fill(&mut x);
    for (input, output) in PAIRS {
        let (whole, _) = resample_all(input, output, Quality::STANDARD, &x);
        // Cut time, as a graph's clocks do, into quanta of so many common units.
        for quantum in [1, 7, 24, 100, 3000] {
            let mut resampler = Resampler::new(hz(input), hz(output), Quality::STANDARD).unwrap();
            let (mut consumed, mut y, mut unit) = (0, Vec::new(), 0_u64);
            let (input_period, output_period) =
                (resampler_period(input, output), resampler_period(output, input));
            while consumed < 500 {
                unit += quantum;
                let inputs = crate::time::ticks_before(unit, input_period) as usize;
                let outputs = crate::time::ticks_before(unit, output_period) as usize;
                let mut block = vec![0.0; outputs - y.len()];
                let progress = resampler.process(&x[consumed..inputs], &mut block);
                assert_eq!((progress.consumed, progress.produced), (inputs - consumed, block.len()));
                consumed = inputs;
                y.append(&mut block);
            }
            assert_eq!(y[..], whole[..y.len()]);
        }
    }
}

/// Period of a clock in the coarsest unit it shares with the other.
fn resampler_period(rate: u64, other: u64) -> u64 {
    other / crate::time::gcd(rate, other)
}

#[test]
fn each_output_is_the_sum_it_is_said_to_be() {
    let (input, output) = (10_000, 48_000);
    let mut x = vec![0.0; 300];
    Gaussian::new(3).fill(&mut x);
    let (y, _) = resample_all(input, output, Quality::STANDARD, &x);
    let kernel = kernel::Kernel::new(hz(input), hz(output), Quality::STANDARD).unwrap();
    for (k, y) in y.iter().enumerate() {
        let (newest, phase) = (k * 5 / 24, k * 5 % 24);
        let taps = kernel.taps(phase as f64 / 24.0);
        let want: f64 = (0..taps.len())
            .filter(|i| newest + 1 + i >= taps.len())
            .map(|i| taps[i] * x[newest + 1 + i - taps.len()])
            .sum();
        assert!((y - want).abs() < 1e-13);
    }
}

#[test]
fn constants_pass_unchanged() {
    for (input, output) in PAIRS {
        let (y, latency) = resample_all(input, output, Quality::LOW_LATENCY, &vec![2.0; 3000]);
        let settled = (2.0 * latency * output as f64) as usize + 1;
        assert!(y[settled..].iter().all(|y| (y - 2.0).abs() < 1e-14));
    }
}

#[test]
fn calls_stop_where_input_or_room_ends() {
    let mut resampler = Resampler::new(hz(1000), hz(10_000), Quality::LOW_LATENCY).unwrap();
    let mut y = [0.0; 25];
    assert_eq!(resampler.process(&[], &mut y), Progress { consumed: 0, produced: 0 });
    assert_eq!(resampler.process(&[1.0], &mut y), Progress { consumed: 1, produced: 10 });
    assert_eq!(resampler.process(&[1.0; 9], &mut y), Progress { consumed: 3, produced: 25 });
    assert_eq!(resampler.process(&[], &mut y), Progress { consumed: 0, produced: 5 });
}

#[test]
fn impossible_resamplers_are_refused() {
    let with = |passband, stopband, attenuation_db| {
        let quality = Quality { passband, stopband, attenuation_db };
        Resampler::new(hz(10), hz(20), quality).is_ok()
    };
    assert!(with(0.5, 1.0, 60.0) && with(0.5, 1.0, 30.0));
    assert!(
        !with(0.0, 1.0, 60.0) && !with(1.0, 1.0, 60.0) && !with(0.5, 2.1, 60.0) && !with(0.5, 1.0, 500.0)
    );
    assert!(!with(f64::NAN, 1.0, 60.0) && !with(0.5, 1.0, f64::NAN));
    let odd = Rate::new(999_999_937, 100_000).unwrap();
    for (input, output) in [(odd, hz(10_000)), (hz(10_000), odd)] {
        let made = Resampler::new(input, output, Quality::FINE);
        assert!(matches!(made, Err(ResampleError::RatioTooFine { .. })));
        assert!(SteeredResampler::new(input, output, Quality::FINE).is_ok());
    }
    let (fast, slow) = (hz(100_000_000), Rate::new(1, 1000).unwrap());
    assert!(Resampler::new(fast, slow, Quality::FINE).is_err());
    assert!(SteeredResampler::new(fast, slow, Quality::FINE).is_err());
}

#[test]
fn the_steered_resampler_without_correction_is_the_exact_one() {
    let mut x = vec![0.0; 4000];
    Gaussian::new(2).fill(&mut x);
    for (input, output) in PAIRS {
        let (want, latency) = resample_all(input, output, Quality::STANDARD, &x);
        let mut steered = SteeredResampler::new(hz(input), hz(output), Quality::STANDARD).unwrap();
        assert_eq!(steered.latency_s(), latency);
        let mut y = vec![0.0; want.len()];
        // One rounding of the step may ask for one input more at an instant where both clocks tick.
        let progress = steered.process(&x, &mut y);
        assert!(progress.produced + 1 >= want.len());
        for (y, want) in y[..progress.produced].iter().zip(&want) {
            assert!((y - want).abs() < 2e-5, "{input} {output} {y} {want}");
        }
    }
}

#[test]
fn the_steered_resampler_follows_a_drifting_clock() {
    let (rate, ppm) = (48_000.0, 300.0);
    let mut steered = SteeredResampler::new(hz(10_000), hz(48_000), Quality::STANDARD).unwrap();
    steered.set_correction_ppm(ppm);
    // The input clock runs 300 ppm fast, so that as many more samples of the same sine arrive a second.
    let f = 700.0;
    let x: Vec<f64> =
        (0..100_000).map(|n| (TAU * f * n as f64 / (10_000.0 * (1.0 + ppm * 1e-6))).sin()).collect();
    let (mut consumed, mut y) = (0, Vec::new());
    for length in [64, 1, 333, 480].into_iter().cycle() {
        let needed = steered.inputs_needed(length);
        if consumed + needed > x.len() {
            break;
        }
        let mut block = vec![0.0; length];
        let progress = steered.process(&x[consumed..], &mut block);
        assert_eq!(progress, Progress { consumed: needed, produced: length });
        consumed += needed;
        y.append(&mut block);
    }
    let latency = steered.latency_s() / (1.0 + ppm * 1e-6);
    for (k, y) in y.iter().enumerate().skip(1000) {
        let want = (TAU * f * (k as f64 / rate - latency)).sin();
        assert!((y - want).abs() < 3e-5, "{k} {y} {want}");
    }
}

#[test]
fn a_steered_sine_is_the_ideal_one_up_to_half_of_nyquist() {
    for (from, to, ppm) in [(1000.0, 48_000.0, 137.0), (48_000.0, 44_100.0, -311.0), (1000.0, 1000.0, 499.0)]
    {
        let rate = |hz: f64| Rate::from_hz(hz as u64).unwrap();
        for part in [0.05, 0.2, 0.35, 0.5] {
            let mut steered = SteeredResampler::new(rate(from), rate(to), Quality::LOW_LATENCY).unwrap();
            steered.set_correction_ppm(ppm);
            let omega = TAU * part * 0.5 * f64::min(from, to) / from;
            let x: Vec<f64> = (0..6000).map(|n| (omega * f64::from(n)).sin()).collect();
            let mut y = vec![0.0; (5900.0 * to / from) as usize];
            let produced = steered.process(&x, &mut y).produced;
            let step = from / to * (1.0 + ppm * 1e-6);
            let latency = steered.latency_s() * from;
            // Pass band and images in one.
            for (k, y) in y[..produced].iter().enumerate().skip((100.0 * to / from) as usize) {
                let want = (omega * (k as f64 * step - latency)).sin();
                assert!((y - want).abs() < 5e-5, "{from} to {to}, {part} of Nyquist: {y} for {want}");
            }
        }
    }
}

#[test]
fn steering_is_clamped_and_survives_nonsense() {
    let mut steered = SteeredResampler::new(hz(1000), hz(1000), Quality::STANDARD).unwrap();
    steered.set_correction_ppm(1e9);
    assert_eq!(steered.inputs_needed(1_000_001), 1_000_500);
    steered.set_correction_ppm(f64::NAN);
    assert_eq!(steered.inputs_needed(1_000_001), 1_000_001);
}

#[test]
fn a_whole_signal_is_resampled_in_place() {
    let tone = |rate: u64, i: usize| (TAU * 150.0 * i as f64 / rate as f64 + 0.3).sin();
    for (input, output) in PAIRS.into_iter().filter(|(input, output)| *input > 400 && *output > 400) {
        let x: Vec<f64> = (0..input as usize).map(|i| tone(input, i)).collect();
        let y = resample_whole(&x, hz(input), hz(output), Quality::FINE).unwrap();
        assert_eq!(y.len(), output as usize, "{input} to {output}");
        for (i, y) in y.iter().enumerate().take(3 * y.len() / 4).skip(y.len() / 4) {
            assert!((y - tone(output, i)).abs() < 1e-4, "{input} to {output}, sample {i}");
        }
    }
}
