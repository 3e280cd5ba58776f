use super::*;
use crate::arma::MAX_ORDER;
use crate::noise::Gaussian;
use crate::prediction::tests::reflection_to_ar;
use crate::warped::{power_gain, warp};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::f64::consts::PI;

struct Draw(Xoshiro256PlusPlus);

impl Draw {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn reflection(&mut self, order: usize, most: f64) -> Vec<f64> {
        (0..order).map(|_| self.between(-most, most)).collect()
    }
}

/// A polynomial whose roots are within 0.9 of the centre, so that it decays within the tests' time.
fn tame(reflection: &[f64]) -> Vec<f64> {
    let ar = reflection_to_ar(reflection);
    ar.iter().zip(1..).map(|(a, k)| a * 0.9_f64.powi(k)).collect()
}

fn draw(seed: u64) -> Draw {
    Draw(Xoshiro256PlusPlus::seed_from_u64(seed))
}

/// The step stage by stage, as the formulas have it: the next states and the last backward signal.
fn by_stages(reflection: &[f64], l: f64, x: &[f64], e: f64) -> (Vec<f64>, f64) {
    let (order, s) = (reflection.len(), (1.0 - l * l).sqrt());
    let cosine: Vec<f64> = reflection.iter().map(|k| ((1.0 - k) * (1.0 + k)).sqrt()).collect();
    let (mut delta, mut alpha) = (vec![0.0; order], vec![1.0; order + 1]);
    let (mut q, mut beta) = (vec![0.0; order], vec![0.0; order + 1]);
    for (m, k) in reflection.iter().enumerate() {
        delta[m] = 1.0 / (1.0 - l * k * alpha[m]);
        alpha[m + 1] = k - l * cosine[m] * cosine[m] * alpha[m] * delta[m];
        q[m] = s * x[m] - l * beta[m];
        beta[m + 1] = cosine[m] * (1.0 + l * k * alpha[m] * delta[m]) * q[m];
    }
    let (mut f, mut next) = (e, vec![0.0; order]);
    let last = alpha[order] * f + beta[order];
    for m in (0..order).rev() {
        f = delta[m] * (cosine[m] * f - reflection[m] * q[m]);
        next[m] = l * x[m] + s * (alpha[m] * f + beta[m]);
    }
    (next, last)
}

/// A filter of these reflection coefficients themselves: by way of the polynomial those near 1 would be rounded.
fn with_reflection(reflection: &[f64], l: f64) -> WarpedLattice {
    let mut lattice = WarpedLattice::new();
    set_reflection(&mut lattice, reflection, l);
    lattice
}

fn set_reflection(lattice: &mut WarpedLattice, reflection: &[f64], l: f64) {
    let stages = Stages::of_reflection(lattice.arch, reflection, l, 1.0);
    assert!(stages.out_scale.is_finite());
    lattice.step.set(lattice.arch, &stages);
}

/// How far the step matrix is from the stages' and from an orthogonal one.
fn distances(reflection: &[f64], l: f64) -> (f64, f64) {
    let order = reflection.len();
    let step = with_reflection(reflection, l).step;
    let mut full = vec![vec![0.0; order + 1]; order + 1];
    let mut apart = 0.0_f64;
    for (j, column) in step.columns[..order].iter().chain([&step.drive]).enumerate() {
        let mut x = vec![0.0; order + 1];
        x[j] = 1.0;
        let (next, last) = by_stages(reflection, l, &x[..order], x[order]);
        for i in 0..order {
            apart = apart.max((column[i] - next[i]).abs());
            full[i][j] = column[i];
        }
        full[order][j] = last;
    }
    let mut askew = 0.0_f64;
    for a in 0..=order {
        for b in 0..=order {
            let dot: f64 = (0..=order).map(|i| full[i][a] * full[i][b]).sum();
            askew = askew.max((dot - if a == b { 1.0 } else { 0.0 }).abs());
        }
    }
    (apart, askew)
}

#[test]
fn the_matrix_is_the_step_of_the_stages_and_orthogonal() {
    let mut draw = draw(1);
    for order in [1, 2, 3, 12, 16, 17, 20, 24, 25, 32] {
        for l in [0.0, 0.5, 0.8, 0.95] {
            for most in [0.9, 0.999, 0.9999] {
                let (apart, askew) = distances(&draw.reflection(order, most), l);
                assert!(apart < 1e-12 && askew < 1e-12, "{order} {l} {most}: {apart} {askew}");
            }
        }
    }
}

#[test]
fn it_is_orthogonal_with_every_angle_nearly_a_right_one() {
    let mut draw = draw(8);
    for round in 0..400 {
        let reflection: Vec<f64> =
            (0..20).map(|_| if draw.between(-1.0, 1.0) < 0.0 { -0.9999 } else { 0.9999 }).collect();
        let (_, askew) = distances(&reflection, [0.8, 0.95][round % 2]);
        assert!(askew < 1e-12, "{round}: {askew}");
    }
}

#[test]
fn the_response_is_that_of_the_warped_polynomial() {
    let mut draw = draw(2);
    for (order, l) in [(3, 0.5), (16, 0.8), (20, 0.8), (20, 0.0)] {
        let ar = tame(&draw.reflection(order, 0.9));
        let mut lattice = WarpedLattice::new();
        lattice.set_coefficients(&ar, l, 2.0).unwrap();
        let mut e = vec![0.0; 20_000];
        e[0] = 1.0;
        let mut y = e.clone();
        lattice.process(&e, &mut y);
        for k in 1..20 {
            let w = PI * f64::from(k) / 20.0;
            let transform = |scale: f64| -> f64 {
                let (re, im) = y.iter().enumerate().fold((0.0, 0.0), |(re, im), (n, y)| {
                    let (sin, cos) = (w * n as f64).sin_cos();
                    (re + y * cos, im - y * sin)
                });
                scale * (re * re + im * im)
            };
            let wanted = 4.0 * crate::warped::squared_response(&ar, l, w);
            assert!((transform(1.0) / wanted - 1.0).abs() < 1e-6, "{order} {l} {k} {}", warp(w, l));
        }
    }
}

#[test]
fn the_power_is_the_one_asked_for_in_a_thousand_models() {
    let mut draw = draw(3);
    for round in 0..1000 {
        let order = 4 + round % 17;
        let l = [0.0, 0.5, 0.8, 0.9][round % 4];
        let ar = tame(&draw.reflection(order, 0.9));
        let mut lattice = WarpedLattice::new();
        lattice.set_coefficients(&ar, l, (3.0 / power_gain(&ar, l).unwrap()).sqrt()).unwrap();
        // The power of the impulse response is that of the output under white noise.
        let mut e = vec![0.0; 10_000];
        e[0] = 1.0;
        let mut y = e.clone();
        lattice.process(&e, &mut y);
        let power: f64 = y.iter().map(|y| y * y).sum();
        assert!((power / 3.0 - 1.0).abs() < 1e-6, "{order} {l}: {power}");
        assert!((power_gain(&ar, l).unwrap()).is_finite());
    }
}

fn energy(lattice: &WarpedLattice) -> f64 {
    lattice.state.iter().map(|x| x * x).sum()
}

/// New coefficients and one sample, so many times over: the largest growth of the states' energy beyond the input's, as a
/// part of what it may be.
fn largest_growth(points: usize, seed: u64) -> f64 {
    let (mut draw, mut noise) = (draw(seed), Gaussian::new(seed));
    let mut lattice = WarpedLattice::new();
    let (mut reflection, mut e, mut y) = ([0.0; MAX_ORDER], [0.0], [0.0]);
    let mut largest = 0.0_f64;
    for point in 0..points {
        let order = 1 + point % MAX_ORDER;
        let most = [0.5, 0.99, 0.9999][point % 3];
        let l = [0.0, 0.5, 0.8, 0.95][point / 3 % 4];
        reflection[..order].fill_with(|| draw.between(-most, most));
        if point % 5 == 0 {
            reflection[..order].fill_with(|| most);
        }
        set_reflection(&mut lattice, &reflection[..order], l);
        lattice.state[order..].fill(0.0);
        noise.fill(&mut e);
        let before = energy(&lattice);
        lattice.process(&e, &mut y);
        assert!(y[0].is_finite());
        largest = largest.max(energy(&lattice) / (before + e[0] * e[0]));
    }
    largest
}

#[test]
fn no_sequence_of_coefficients_raises_the_energy_of_the_states() {
    let largest = largest_growth(100_000, 4);
    assert!(largest > 0.99 && largest <= 1.0 + 1e-12, "{largest}");
}

#[test]
#[ignore = "takes a minute"]
fn no_sequence_of_coefficients_raises_the_energy_of_the_states_in_ten_million_points() {
    let largest = largest_growth(10_000_000, 5);
    assert!(largest > 0.99 && largest <= 1.0 + 1e-12, "{largest}");
}

/// The excitation of magnitude 1 and the coefficients are chosen for the largest output at every sample.
#[test]
fn an_adversary_gains_no_more_energy_than_the_input_brings() {
    let mut draw = draw(6);
    let mut choices: Vec<WarpedLattice> = (0..40)
        .map(|round| {
            let most = [0.9, 0.999, 0.9999][round % 3];
            with_reflection(&draw.reflection(20, most), [0.8, 0.95][round % 2])
        })
        .collect();
    let (mut brought, mut largest) = (0.0, 0.0_f64);
    for _ in 0..5000 {
        let mut best = (-1.0, 0, 0.0);
        for (at, choice) in choices.iter_mut().enumerate() {
            let step = &choice.step;
            let free: f64 = (0..20).map(|j| step.columns[j][0] * choice.state[j]).sum::<f64>()
                - step.warping * choice.state[0];
            // The output without its scale: the bound is that of the states.
            let reached = free.abs() + step.drive[0].abs();
            if reached > best.0 {
                best = (reached, at, (free * step.drive[0]).signum());
            }
        }
        let (_, at, e) = best;
        let mut y = [0.0];
        choices[at].process(&[e], &mut y);
        brought += e * e;
        let state = choices[at].state;
        choices.iter_mut().for_each(|choice| choice.state = state);
        let energy = energy(&choices[at]);
        assert!(energy <= brought * (1.0 + 1e-12), "{energy} of {brought}");
        largest = largest.max(energy);
    }
    // It does get far above what a single sample brings.
    assert!(largest > 10.0, "{largest}");
}

/// Updates belong to sample numbers, not to blocks.
#[test]
fn updates_at_the_same_samples_give_the_same_bits_in_any_blocks() {
    let mut e = vec![0.0; 41 * 40];
    Gaussian::new(9).fill(&mut e);
    let render = |blocks: &[usize]| {
        let (mut draw, mut lattice) = (draw(10), WarpedLattice::new());
        let (mut y, mut blocks) = (Vec::new(), blocks.iter().cycle());
        for (frame, e) in e.chunks(41).enumerate() {
            let order = [20, 17, 3, 32, 16][frame % 5];
            let ar = tame(&draw.reflection(order, 0.9));
            lattice.set_coefficients(&ar, 0.8, 1.0).unwrap();
            let mut rest = e;
            while !rest.is_empty() {
                let (now, later) = rest.split_at(rest.len().min(*blocks.next().unwrap()));
                let mut out = vec![0.0; now.len()];
                lattice.process(now, &mut out);
                y.append(&mut out);
                rest = later;
            }
        }
        y
    };
    let whole = render(&[41]);
    for blocks in [&[1][..], &[2], &[7, 1], &[40, 3], &[13, 14, 13]] {
        assert_eq!(render(blocks), whole, "{blocks:?}");
    }
}

#[test]
fn every_processor_gives_the_same_bits() {
    let mut draw = draw(12);
    let mut e = vec![0.0; 500];
    Gaussian::new(3).fill(&mut e);
    for order in [5, 20, 32] {
        let ar = tame(&draw.reflection(order, 0.9));
        let (mut here, mut plain) = (WarpedLattice::new(), WarpedLattice::new());
        plain.arch = Arch::Scalar;
        let (mut x, mut y) = (e.clone(), e.clone());
        for (lattice, out) in [(&mut here, &mut x), (&mut plain, &mut y)] {
            lattice.set_coefficients(&ar, 0.8, 1.0).unwrap();
            lattice.process(&e, out);
        }
        assert_eq!(x, y);
    }
}

#[test]
fn blocks_change_no_bit_and_silence_is_exact() {
    let ar = tame(&draw(5).reflection(20, 0.9));
    let (mut whole, mut cut) = (WarpedLattice::new(), WarpedLattice::new());
    for lattice in [&mut whole, &mut cut] {
        lattice.set_coefficients(&ar, 0.8, 1.0).unwrap();
    }
    let mut e = vec![0.0; 40_000];
    Gaussian::new(1).fill(&mut e[..1000]);
    let (mut a, mut b) = (e.clone(), e.clone());
    whole.process(&e, &mut a);
    for (e, b) in e.chunks(7).zip(b.chunks_mut(7)) {
        cut.process(e, b);
    }
    assert_eq!(a, b);
    assert!(a[900].abs() > 0.0 && a[39_000..].iter().all(|y| *y == 0.0));
}

#[test]
fn unusable_coefficients_leave_the_old_ones_at_work() {
    let mut lattice = WarpedLattice::new();
    lattice.set_coefficients(&[-0.5], 0.0, 1.0).unwrap();
    for (ar, l, gain) in [
        (vec![-2.0], 0.5, 1.0),
        (vec![f64::NAN], 0.5, 1.0),
        (vec![0.1], 0.99, 1.0),
        (vec![0.1], -0.1, 1.0),
        (vec![0.1], f64::NAN, 1.0),
        (vec![0.1], 0.5, f64::INFINITY),
        (vec![0.0; 33], 0.5, 1.0),
        (vec![], 0.5, 1.0),
    ] {
        assert!(lattice.set_coefficients(&ar, l, gain).is_err());
    }
    let mut y = [0.0; 4];
    lattice.process(&[1.0, 0.0, 0.0, 0.0], &mut y);
    assert!(y.iter().zip([1.0, 0.5, 0.25, 0.125]).all(|(y, w)| (y - w).abs() < 1e-15));
}
