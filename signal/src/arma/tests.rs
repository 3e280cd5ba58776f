use super::*;
use crate::noise::{Gaussian, Uniform};
use crate::prediction::power_gain;
use crate::prediction::tests::arma_autocovariance;
use crate::spectrum::{expected_welch, welch};
use crate::window::Window;
use std::f64::consts::TAU;

const FORMS: [Form; 2] = [Form::Direct, Form::Lattice];

fn noise(seed: u64, n: usize) -> Vec<f64> {
    let mut x = vec![0.0; n];
    Gaussian::new(seed).fill(&mut x);
    x
}

/// `A(z)` with these conjugate pole pairs, (radius, frequency in cycles a sample).
fn resonances(pairs: &[(f64, f64)]) -> Vec<f64> {
    let mut a = vec![1.0];
    for (radius, frequency) in pairs {
        let factor = [1.0, -2.0 * radius * (TAU * frequency).cos(), radius * radius];
        let mut product = vec![0.0; a.len() + 2];
        for (i, x) in a.iter().enumerate() {
            for (j, y) in factor.iter().enumerate() {
                product[i + j] += x * y;
            }
        }
        a = product;
    }
    a.split_off(1)
}

/// A model as lively as a rough surface's: order 20, five resonances and damped rest.
fn surface() -> Vec<f64> {
    resonances(&[
        (0.995, 0.012),
        (0.98, 0.04),
        (0.97, 0.07),
        (0.95, 0.11),
        (0.9, 0.16),
        (0.85, 0.21),
        (0.8, 0.27),
        (0.8, 0.33),
        (0.75, 0.39),
        (0.7, 0.46),
    ])
}

const MA: [f64; 4] = [0.6, -0.3, 0.2, 0.1];

/// The definition, in the order of Eq. 2.4.2's program: newest first.
fn naive(ar: &[f64], ma: &[f64], gain: f64, e: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; e.len()];
    for n in 0..e.len() {
        let mut w = e[n];
        for k in 1..=ma.len().min(n) {
            w += ma[k - 1] * e[n - k];
        }
        y[n] = gain * w;
        for k in 1..=ar.len().min(n) {
            y[n] -= ar[k - 1] * y[n - k];
        }
    }
    y
}

fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt()
}

fn run(form: Form, ar: &[f64], ma: &[f64], gain: f64, e: &[f64]) -> Vec<f64> {
    let mut filter = ArmaFilter::new(form);
    filter.set_coefficients(ar, ma, gain).unwrap();
    let mut y = vec![0.0; e.len()];
    filter.process(e, &mut y);
    y
}

#[test]
fn with_frozen_coefficients_both_forms_are_the_definition() {
    let e = noise(1, 20_000);
    let models = [
        (surface(), MA.to_vec(), 2.5),
        (surface(), vec![], 1.0),
        (vec![], MA.to_vec(), -1.0),
        (vec![-0.5], vec![], 1.0),
        (vec![], vec![], 3.0),
        (vec![0.3], vec![0.1, 0.2, 0.3], 1.0),
    ];
    for (ar, ma, gain) in models {
        let want = naive(&ar, &ma, gain, &e);
        for form in FORMS {
            let got = run(form, &ar, &ma, gain, &e);
            let error: Vec<f64> = got.iter().zip(&want).map(|(a, b)| a - b).collect();
            assert!(rms(&error) < 1e-9 * rms(&want), "{form:?} {} {}", rms(&error), rms(&want));
        }
    }
}

#[test]
fn the_output_does_not_depend_on_the_blocks() {
    let e = noise(2, 4100);
    let (one, other) = (surface(), resonances(&[(0.99, 0.1), (0.9, 0.3)]));
    for form in FORMS {
        let render = |length: usize| {
            let mut filter = ArmaFilter::new(form);
            let mut y = Vec::new();
            for (frame, e) in e.chunks(41).enumerate() {
                let ar = if frame % 2 == 0 { &one } else { &other };
                filter.set_coefficients(ar, &MA, 1.0).unwrap();
                for e in e.chunks(length) {
                    let mut out = vec![0.0; e.len()];
                    filter.process(e, &mut out);
                    y.append(&mut out);
                }
            }
            y
        };
        let whole = render(1024);
        for length in [1, 2, 3, 4, 5, 7, 8, 15, 16, 17, 40] {
            assert_eq!(render(length), whole, "{form:?} {length}");
        }
    }
}

#[test]
fn a_bank_gives_each_voice_what_it_gives_alone() {
    for form in FORMS {
        let (voices, frames) = (11, 500);
        let mut bank = VoiceBank::new(form, voices);
        let mut alone = vec![ArmaFilter::new(form); voices];
        let e = noise(3, voices * frames);
        let mut out = vec![0.0; e.len()];
        let mut want = vec![0.0; e.len()];
        let mut start = 0;
        for (turn, frames) in [37, 1, 64, 100, 5, 293].into_iter().enumerate() {
            for (v, filter) in alone.iter_mut().enumerate() {
                let radius = 0.9 + 0.009 * v as f64;
                let ar = resonances(
                    &[(radius, 0.01 * (1 + v + turn) as f64), (0.5, 0.2), (0.4, 0.3)][..1 + v % 3],
                );
                let ma = &MA[..v % 4];
                bank.set_coefficients(v, &ar, ma, 1.0 + v as f64).unwrap();
                filter.set_coefficients(&ar, ma, 1.0 + v as f64).unwrap();
                let mine: Vec<f64> = (0..frames).map(|n| e[(start + n) * voices + v]).collect();
                let mut y = vec![0.0; frames];
                filter.process(&mine, &mut y);
                for n in 0..frames {
                    want[(start + n) * voices + v] = y[n];
                }
            }
            let part = start * voices..(start + frames) * voices;
            bank.process(&e[part.clone()], &mut out[part]);
            start += frames;
        }
        assert_eq!(out, want);
    }
}

#[test]
fn the_lattice_stays_bounded_where_the_direct_form_grows() {
    // Pole radius 0.9986 at 50 and 920 Hz (10 kHz), changing every 41 samples, after one impulse.
    let sets = [resonances(&[(0.9986, 0.005)]), resonances(&[(0.9986, 0.092)])];
    let energy_growth = |form: Form| {
        let mut filter = ArmaFilter::new(form);
        let mut e = vec![0.0; 41];
        e[0] = 1.0;
        let mut out = vec![0.0; 41];
        let mut peaks = Vec::new();
        for turn in 0..40 {
            filter.set_coefficients(&sets[turn % 2], &[], 1.0).unwrap();
            filter.process(&e, &mut out);
            e[0] = 0.0;
            peaks.push(out.iter().fold(0.0_f64, |peak, y| peak.max(y.abs())));
        }
        peaks
    };
    let direct = energy_growth(Form::Direct);
    assert!(direct[39] > 1e20, "{direct:?}");
    // The state's energy starts at 1; the output is at most the largest output gain of a set times its root.
    let bound = sets.iter().map(|a| power_gain(a, &[]).unwrap().sqrt()).fold(0.0, f64::max);
    assert!(energy_growth(Form::Lattice).iter().all(|peak| *peak <= bound * (1.0 + 1e-9)));
}

#[test]
fn random_alternations_of_barely_stable_sets_stay_bounded() {
    let mut random = Uniform::new(7);
    let mut filter = Lattice::new();
    let mut largest_ratio = 0.0_f64;
    let mut e = vec![0.0; 64];
    e[0] = 1.0;
    let mut out = vec![0.0; 64];
    for turn in 0..4000 {
        let pairs: Vec<(f64, f64)> = (0..1 + turn % 10)
            .map(|_| {
                let radius = if random.next_sample() < 0.3 { 0.9999 } else { 0.999 * random.next_sample() };
                (radius, 0.01 + 0.48 * random.next_sample())
            })
            .collect();
        let ar = resonances(&pairs);
        // A set that rounding has made unstable is refused and the old one kept: bounded all the same.
        if filter.set_coefficients(&ar, &[], 1.0).is_err() {
            continue;
        }
        let length = 1 + (random.next_sample() * 63.0) as usize;
        filter.process(&e[..length], &mut out[..length]);
        e[0] = 0.0;
        let bound = power_gain(&ar, &[]).unwrap().sqrt();
        let peak = out[..length].iter().fold(0.0_f64, |peak, y| peak.max(y.abs()));
        largest_ratio = largest_ratio.max(peak / bound);
    }
    assert!(largest_ratio > 0.0 && largest_ratio <= 1.0 + 1e-9, "{largest_ratio}");
}

#[test]
fn without_excitation_the_output_decays_to_exactly_zero() {
    for form in FORMS {
        let mut filter = ArmaFilter::new(form);
        filter.set_coefficients(&resonances(&[(0.9986, 0.005), (0.99, 0.1)]), &MA, 3.0).unwrap();
        let mut y = vec![0.0; 1000];
        filter.process(&noise(4, 1000), &mut y);
        assert!(rms(&y) > 1.0);
        let silence = vec![0.0; 60_000];
        let mut y = vec![1.0; silence.len()];
        filter.process(&silence, &mut y);
        let last = y.iter().rposition(|y| *y != 0.0).unwrap();
        assert!(last < 50_000, "{form:?} {last}");
        assert!(y[last].abs() < 1e-15);
    }
}

#[test]
fn a_bad_sample_is_forgotten() {
    for form in FORMS {
        for bad in [f64::NAN, f64::INFINITY] {
            let mut filter = ArmaFilter::new(form);
            filter.set_coefficients(&surface(), &MA, 1.0).unwrap();
            let mut y = vec![0.0; 600];
            let mut e = noise(5, 600);
            e[3] = bad;
            filter.process(&e, &mut y);
            assert!(y[3].is_nan() || y[3].is_infinite());
            assert!(y[256..].iter().all(|y| y.is_finite()), "{form:?}");
        }
    }
}

#[test]
fn unusable_coefficients_are_refused_and_the_old_ones_kept() {
    for form in FORMS {
        let mut filter = ArmaFilter::new(form);
        filter.set_coefficients(&[-0.5], &[], 2.0).unwrap();
        assert_eq!(filter.set_coefficients(&[0.0; 33], &[], 1.0), Err(ArmaError::TooLong { order: 33 }));
        assert!(filter.set_coefficients(&[f64::NAN], &[], 1.0).is_err());
        assert!(filter.set_coefficients(&[0.1], &[f64::INFINITY], 1.0).is_err());
        assert!(filter.set_coefficients(&[0.1], &[], f64::NAN).is_err());
        assert_eq!(filter.set_coefficients(&[-1.5], &[], 1.0).is_err(), form == Form::Lattice);
        if form == Form::Lattice {
            let mut y = [0.0; 3];
            filter.process(&[1.0, 0.0, 0.0], &mut y);
            for (got, want) in y.iter().zip([2.0, 1.0, 0.5]) {
                assert!((got - want).abs() < 1e-15);
            }
        }
    }
}

#[test]
fn power_is_the_models_within_four_standard_deviations() {
    let (ar, variance) = (surface(), 0.045_f64);
    let n = 400_000;
    let r = arma_autocovariance(&ar, &MA, variance, 20_000).unwrap();
    // Variance of the sample power of a Gaussian process: (2/n) sum over all lags of r^2.
    let sum: f64 = r[0] * r[0] + 2.0 * r[1..].iter().map(|r| r * r).sum::<f64>();
    let deviation = (2.0 / n as f64 * sum).sqrt();
    let want = variance * power_gain(&ar, &MA).unwrap();
    let mut e = noise(6, n + 4000);
    e.iter_mut().for_each(|e| *e *= variance.sqrt());
    for form in FORMS {
        let y = run(form, &ar, &MA, 1.0, &e);
        let power = y[4000..].iter().map(|y| y * y).sum::<f64>() / n as f64;
        assert!((power - want).abs() < 4.0 * deviation, "{form:?}: {power}, {want} +- {deviation}");
    }
}

#[test]
fn the_spectrum_is_the_models_seen_through_the_window() {
    let (ar, rate_hz, segment) = (surface(), 10_000.0, 256);
    let segments = 4000;
    // Segments far enough apart to be independent: each bin is then a mean of exponentials.
    let apart = 1024;
    let r = arma_autocovariance(&ar, &MA, 1.0, segment).unwrap();
    let want = expected_welch(&r, rate_hz, segment, Window::Hamming).unwrap();
    let e = noise(7, segments * apart + 4000);
    for form in FORMS {
        let y = run(form, &ar, &MA, 1.0, &e);
        let mut got = vec![0.0; want.density.len()];
        for s in 0..segments {
            let start = 4000 + s * apart - (apart - segment) * usize::from(s == segments - 1);
            let psd = welch(&y[start..start + segment], rate_hz, segment, 0, Window::Hamming).unwrap();
            for (sum, d) in got.iter_mut().zip(&psd.density) {
                *sum += d / segments as f64;
            }
        }
        for (bin, (got, want)) in got.iter().zip(&want.density).enumerate().take(segment / 2).skip(1) {
            let off = (got / want - 1.0) * (segments as f64).sqrt();
            assert!(off.abs() < 4.0, "{form:?}: bin {bin} is {off} standard deviations off");
        }
    }
}
