use super::*;
use crate::noise::Gaussian;
use std::f64::consts::{PI, TAU};

fn decibels(filter: &Sections, frequency_hz: f64, rate_hz: f64) -> f64 {
    20.0 * filter.response(frequency_hz, rate_hz).norm().log10()
}

/// `tan(pi f / rate)`: the analog frequency behind a digital one.
fn warped(frequency_hz: f64, rate_hz: f64) -> f64 {
    (PI * frequency_hz / rate_hz).tan()
}

/// True if every pole lies inside the unit circle.
fn is_stable(filter: &Sections) -> bool {
    filter.sections.iter().all(Biquad::is_stable)
}

#[test]
fn butterworth_magnitudes_are_the_closed_form() {
    for order in 1..=MAX_ORDER {
        for (cutoff, rate) in [(20.0, 1000.0), (1000.0, 10_000.0), (4000.0, 10_000.0), (20.0, 10_000.0)] {
            let low = butterworth_lowpass(order, cutoff, rate).unwrap();
            let high = butterworth_highpass(order, cutoff, rate).unwrap();
            assert!(is_stable(&low) && is_stable(&high));
            for f in [0.3, 0.7, 1.0, 1.1].map(|part| part * cutoff) {
                let ratio = (warped(f, rate) / warped(cutoff, rate)).powi(2 * order as i32);
                let got = low.response(f, rate).norm_sqr();
                assert!((got * (1.0 + ratio) - 1.0).abs() < 1e-6, "low {order} {cutoff} {f}");
                let got = high.response(f, rate).norm_sqr();
                assert!((got * (1.0 + 1.0 / ratio) - 1.0).abs() < 1e-6, "high {order} {cutoff} {f}");
            }
        }
    }
}

#[test]
fn butterworth_bandpass_magnitude_is_the_closed_form() {
    for order in 1..=8 {
        let (low, high, rate) = (20.0, 1000.0, 10_000.0);
        let filter = butterworth_bandpass(order, low, high, rate).unwrap();
        assert!(is_stable(&filter));
        let (wl, wh) = (warped(low, rate), warped(high, rate));
        for f in [5.0, 20.0, 60.0, 140.0, 800.0, 1000.0, 3000.0] {
            let w = warped(f, rate);
            let deviation = (w * w - wl * wh) / (w * (wh - wl));
            let want = 1.0 / (1.0 + deviation.powi(2 * order as i32));
            let got = filter.response(f, rate).norm_sqr();
            assert!((got / want - 1.0).abs() < 1e-5, "{order} {f}: {got} {want}");
        }
    }
}

#[test]
fn a_known_design_has_its_published_coefficients() {
    // Order 2, cut-off a quarter of the rate: (1 + z^-1)^2 / (2 + sqrt 2 + (2 - sqrt 2) z^-2).
    let filter = butterworth_lowpass(2, 250.0, 1000.0).unwrap();
    let [section] = filter.sections[..] else { panic!() };
    let scale = 1.0 / (2.0 + 2_f64.sqrt());
    for (got, want) in section.b.iter().zip([scale, 2.0 * scale, scale]) {
        assert!((got - want).abs() < 1e-15);
    }
    assert!(section.a[0].abs() < 1e-15 && (section.a[1] - (2.0 - 2_f64.sqrt()) * scale).abs() < 1e-15);
}

#[test]
fn bessel_poles_are_the_published_ones() {
    // At a rate far above the cut-off the poles are exp(s T). Published positions for -3 dB at 1 rad/s, order 5.
    let published =
        [(-1.502_316_271_4, 0.0), (-1.380_877_329_0, 0.717_909_587_6), (-0.957_676_548_6, 1.471_124_320_7)];
    let rate = 1e5;
    let filter = bessel_lowpass(5, 1.0 / TAU, rate).unwrap();
    let mut poles = Vec::new();
    for section in &filter.sections {
        let [a1, a2] = section.a;
        if a2 == 0.0 {
            poles.push(Complex64::new(-a1, 0.0));
        } else {
            let root = Complex64::new(a1 * a1 / 4.0 - a2, 0.0).sqrt();
            poles.push(-a1 / 2.0 + root);
        }
    }
    assert_eq!(poles.len(), 3);
    for (re, im) in published {
        let want = Complex64::new(re, im);
        let nearest =
            poles.iter().map(|z| (2.0 * rate * (z - 1.0) / (z + 1.0) - want).norm()).fold(9.0, f64::min);
        assert!(nearest < 1e-4, "{want}: {nearest}");
    }
}

#[test]
fn bessel_filters_lose_3_db_at_the_cutoff_and_delay_evenly() {
    for order in 1..=MAX_ORDER {
        let filter = bessel_lowpass(order, 1000.0, 10_000.0).unwrap();
        assert!(is_stable(&filter));
        assert!((decibels(&filter, 1000.0, 10_000.0) + 10.0 * 2_f64.log10()).abs() < 1e-6, "{order}");
        assert!((filter.response(0.0, 10_000.0).norm() - 1.0).abs() < 1e-9);
    }
    let filter = bessel_lowpass(5, 100.0, 10_000.0).unwrap();
    let at_dc = filter.group_delay_s(0.0, 10_000.0);
    for f in [10.0, 50.0, 100.0] {
        assert!((filter.group_delay_s(f, 10_000.0) / at_dc - 1.0).abs() < 0.01);
    }
    // Order 5 has a delay of 2.4274 / (2 pi f_3dB).
    assert!((at_dc * TAU * 100.0 - 2.4274).abs() < 2e-3, "{}", at_dc * TAU * 100.0);
}

#[test]
fn the_toolkits_double_pole_is_6_db_down_at_20_hz() {
    // Backward differences sharpen it: at 1 kHz it loses 6.5 dB there, at 10 kHz what the analog filter loses.
    for (rate, tolerance) in [(1000.0, 0.6), (10_000.0, 0.06), (100_000.0, 0.006)] {
        let filter = double_pole(125.0, rate).unwrap();
        assert!((filter.response(0.0, rate).norm() - 1.0).abs() < 1e-9);
        let lambda_hz = 125.0 / TAU;
        assert!((decibels(&filter, lambda_hz, rate) + 20.0 * 2_f64.log10()).abs() < tolerance);
        let half_power_hz = lambda_hz * (2_f64.sqrt() - 1.0).sqrt();
        assert!((decibels(&filter, half_power_hz, rate) + 10.0 * 2_f64.log10()).abs() < tolerance);
        assert!((filter.group_delay_s(0.0, rate) - 0.016).abs() < 1e-9);
    }
}

#[test]
fn group_delay_is_the_slope_of_the_phase() {
    let rate = 10_000.0;
    let filters = [
        butterworth_lowpass(5, 900.0, rate),
        butterworth_highpass(4, 50.0, rate),
        butterworth_bandpass(3, 50.0, 800.0, rate),
        bessel_lowpass(6, 700.0, rate),
    ];
    for filter in filters.map(Result::unwrap) {
        for f in [30.0, 200.0, 850.0, 2500.0] {
            let step = 1e-3;
            let turn = filter.response(f + step, rate) / filter.response(f - step, rate);
            let slope = -turn.arg() / (TAU * 2.0 * step);
            assert!((filter.group_delay_s(f, rate) - slope).abs() < 1e-8);
        }
        assert!(
            filter.group_delay_s(0.0, rate).is_finite() && filter.group_delay_s(rate / 2.0, rate).is_finite()
        );
    }
}

#[test]
fn what_runs_is_what_was_designed() {
    let rate = 10_000.0;
    let filter = butterworth_bandpass(4, 50.0, 1500.0, rate).unwrap();
    let mut impulse = vec![0.0; 1 << 14];
    impulse[0] = 1.0;
    let mut h = vec![0.0; impulse.len()];
    SectionsState::new(&filter).process(&impulse, &mut h);
    for f in [0.0, 50.0, 300.0, 1500.0, 4000.0] {
        let sum: Complex64 =
            (0..h.len()).map(|n| Complex64::from_polar(h[n], -TAU * f / rate * n as f64)).sum();
        assert!((sum - filter.response(f, rate)).norm() < 1e-9);
    }
}

#[test]
fn the_output_does_not_depend_on_the_blocks() {
    let filter = butterworth_lowpass(5, 100.0, 10_000.0).unwrap();
    let mut x = vec![0.0; 3000];
    Gaussian::new(2).fill(&mut x);
    let mut whole = vec![0.0; 3000];
    SectionsState::new(&filter).process(&x, &mut whole);
    for length in [1, 7, 64, 1000] {
        let mut state = SectionsState::new(&filter);
        let mut y = vec![0.0; 3000];
        for (x, y) in x.chunks(length).zip(y.chunks_mut(length)) {
            state.process(x, y);
        }
        assert_eq!(y, whole);
    }
}

#[test]
fn silence_becomes_exact_silence_and_a_bad_sample_is_forgotten() {
    let filter = butterworth_lowpass(4, 20.0, 1000.0).unwrap();
    let mut state = SectionsState::new(&filter);
    let mut y = vec![1.0; 100];
    state.process_in_place(&mut y);
    let mut y = vec![0.0; 4000];
    state.process_in_place(&mut y);
    assert!(y[3900..].iter().all(|y| *y == 0.0));
    let mut y = vec![f64::NAN];
    state.process_in_place(&mut y);
    let mut y = vec![1.0; 1000];
    state.process_in_place(&mut y);
    assert!((y[999] - 1.0).abs() < 1e-6);
}

#[test]
fn a_settled_filter_starts_without_a_jump() {
    let filter = bessel_lowpass(5, 100.0, 10_000.0).unwrap();
    let mut state = SectionsState::new(&filter);
    state.settle_at(3.5);
    let mut y = vec![3.5; 500];
    state.process_in_place(&mut y);
    assert!(y.iter().all(|y| (y - 3.5).abs() < 1e-12));
}

#[test]
fn filtfilt_leaves_lines_alone_and_shifts_no_phase() {
    let filter = butterworth_lowpass(4, 100.0, 10_000.0).unwrap();
    let line: Vec<f64> = (0..2000).map(|n| 3.0 + 0.01 * f64::from(n)).collect();
    for (got, want) in filtfilt(&filter, line.clone()).iter().zip(&line) {
        assert!((got - want).abs() < 1e-5, "{got} {want}");
    }
    let rate = 10_000.0;
    let gain = filter.response(50.0, rate).norm_sqr();
    let sine: Vec<f64> = (0..20_000).map(|n| (TAU * 50.0 / rate * f64::from(n)).sin()).collect();
    let out = filtfilt(&filter, sine.clone());
    for n in 5000..15_000 {
        assert!((out[n] - gain * sine[n]).abs() < 1e-6);
    }
    assert!(filtfilt(&filter, vec![]).is_empty());
    assert!((filtfilt(&filter, vec![2.0])[0] - 2.0).abs() < 1e-12);
}

#[test]
fn impossible_designs_are_refused() {
    assert!(matches!(butterworth_lowpass(0, 1.0, 10.0), Err(DesignError::Order { order: 0 })));
    assert!(matches!(bessel_lowpass(99, 1.0, 10.0), Err(DesignError::Order { .. })));
    for cutoff in [0.0, -1.0, 5.0, 7.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(butterworth_highpass(2, cutoff, 10.0), Err(DesignError::Cutoff { .. })));
    }
    assert!(matches!(butterworth_lowpass(2, 1.0, f64::NAN), Err(DesignError::Rate { .. })));
    assert!(matches!(butterworth_bandpass(2, 3.0, 3.0, 10.0), Err(DesignError::EmptyBand { .. })));
    assert!(double_pole(0.0, 1000.0).is_err() && double_pole(1.0, 0.0).is_err());
}

#[test]
fn extreme_frequencies_give_filters_that_are_right_or_an_error() {
    type Design = fn(usize, f64, f64) -> Result<Sections, DesignError>;
    let rate_hz = 48_000.0;
    let designs: [(Design, bool); 3] =
        [(butterworth_lowpass, true), (butterworth_highpass, false), (bessel_lowpass, true)];
    let mut refused = 0;
    for exponent in -12..=4 {
        for below in [true, false] {
            let from_end_hz = 10_f64.powi(exponent);
            let cutoff_hz = if below { from_end_hz } else { 0.5 * rate_hz - from_end_hz };
            for order in 1..=16 {
                for (design, low) in designs {
                    let Ok(filter) = design(order, cutoff_hz, rate_hz) else {
                        refused += 1;
                        continue;
                    };
                    let passed_hz = if low { 0.0 } else { 0.5 * rate_hz };
                    let name = format!("order {order}, {cutoff_hz} Hz, low {low}");
                    assert!(is_stable(&filter), "{name}");
                    assert!((filter.response(passed_hz, rate_hz).norm() - 1.0).abs() < 1e-6, "{name}");
                    assert!(filter.group_delay_s(0.01 * cutoff_hz, rate_hz).is_finite(), "{name}");
                }
            }
        }
    }
    assert!(refused > 100);
    assert!(matches!(bessel_lowpass(2, 1e-5, rate_hz), Err(DesignError::Extreme { .. })));
    assert!(butterworth_lowpass(2, 0.01, rate_hz).is_ok());
    assert!(matches!(double_pole(1e-5, rate_hz), Err(DesignError::Extreme { .. })));
    let narrow = butterworth_bandpass(2, 100.0, 100.0_f64.next_up(), rate_hz);
    assert!(matches!(narrow, Err(DesignError::NarrowBand { .. })));
}

#[test]
fn a_turned_filter_goes_on_from_what_it_holds() {
    let rate = 1000.0;
    let prototypes = [
        Prototype::butterworth_lowpass(1).unwrap(),
        Prototype::butterworth_lowpass(5).unwrap(),
        Prototype::bessel_lowpass(4).unwrap(),
        Prototype::double_pole(),
    ];
    for prototype in prototypes {
        let sections = |hz: f64| prototype.at([hz; 2], rate).unwrap();
        let mut state = SectionsState::new(&sections(20.0).into());
        state.settle_at(3.0);
        for hz in [150.0, 400.0, 1.0, 60.0] {
            state.turn(&sections(hz));
            let mut y = [3.0; 50];
            state.process_in_place(&mut y);
            assert!(y.iter().all(|y| (y - 3.0).abs() < 1e-7), "{hz}: {y:?}");
        }
    }
}

#[test]
fn turning_to_the_same_frequency_changes_nothing_that_can_be_heard() {
    let rate = 1000.0;
    for (prototype, hz) in [
        (Prototype::butterworth_highpass(3).unwrap(), [40.0, 0.0]),
        (Prototype::butterworth_bandpass(4).unwrap(), [40.0, 90.0]),
        (Prototype::bessel_lowpass(5).unwrap(), [80.0, 0.0]),
        (Prototype::double_pole(), [125.0, 0.0]),
    ] {
        let sections = prototype.at(hz, rate).unwrap();
        let mut noise = Gaussian::new(3);
        let mut x = [0.0; 400];
        noise.fill(&mut x);
        let mut plain = SectionsState::new(&sections.into());
        let mut turned = plain.clone();
        let (mut wanted, mut got) = (x, x);
        plain.process_in_place(&mut wanted);
        for part in got.chunks_mut(7) {
            turned.turn(&sections);
            turned.process_in_place(part);
        }
        let apart = wanted.iter().zip(&got).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-9, "{hz:?}");
    }
}

#[test]
fn sections_side_by_side_have_the_bits_of_each_by_itself() {
    // What vector instructions would treat otherwise: zeros with a sign, numbers without one, and what becomes silent.
    let input: Vec<f64> = (0..400)
        .map(|i| match i {
            7 | 40 => -0.0,
            90 => f64::NAN,
            91..150 => 0.0,
            200 => f64::INFINITY,
            _ => (f64::from(i) * 0.37).sin() * 1e-3,
        })
        .collect();
    let designs =
        |count: usize| (0..count).map(|k| butterworth_highpass(1 + k % 5, 30.0 + k as f64, 8000.0).unwrap());
    // As this processor does it, and others do.
    let mut archs = vec![pulp::Arch::new(), pulp::Arch::Scalar];
    #[cfg(target_arch = "x86_64")]
    archs.extend(pulp::x86::V3::try_new().map(pulp::Arch::V3));
    for (count, arch) in (1..=24).flat_map(|count| archs.iter().map(move |arch| (count, *arch))) {
        for block in [1, 5, 13, 16, 17, 23, 48, 64, 400] {
            let mut filters: Vec<SectionsState> =
                designs(count).map(|filter| SectionsState::new(&filter)).collect();
            let (mut alone, mut chained) = (input.clone(), input.clone());
            // They are not checked for silence at the same samples.
            let ahead = if count % 2 == 0 { 9 } else { 0 };
            filters[0].process_in_place(&mut vec![0.25; ahead]);
            for filter in &mut filters.clone() {
                alone.iter_mut().for_each(|y| *y = filter.sample(*y));
            }
            for block in chained.chunks_mut(block) {
                SectionsState::process_chain_by(arch, filters.iter_mut(), block);
            }
            let bits = |y: &[f64]| -> Vec<u64> {
                y.iter().map(|y| if y.is_nan() { f64::NAN.to_bits() } else { y.to_bits() }).collect()
            };
            assert_eq!(bits(&chained), bits(&alone), "{count} filters, blocks of {block}");
            assert!(alone[399].is_finite());
        }
    }
}
