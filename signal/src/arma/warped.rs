//! The warped normalised lattice: an all-pole filter over all-pass sections, bounded however its coefficients change.

use super::{ArmaError, MAX_ORDER, SETTLE, are_finite, check, is_over};
use crate::prediction::{PredictionError, step_down};
use crate::warped::{MAX_WARPING, residual_share};
use pulp::{Arch, Simd, WithSimd};

/// Rows of the largest step matrix.
const ROWS: usize = MAX_ORDER;
/// Its columns: a state each, and the excitation.
const COLUMNS: usize = MAX_ORDER + 1;

/// `gain / A(D(z))` with `D` the all-pass of [`crate::warped`], as a normalised lattice.
///
/// The delays of the normalised lattice ([`super::Lattice`]) become all-pass sections, each a rotation of its state and its
/// input by the angle whose sine is `sqrt(1 - l^2)`; the loops without delay that this makes are solved stage by stage
/// (`1 - k l alpha >= 1 - l > 0`). A step from (states, excitation) to (states, last backward signal) is then orthogonal
/// **whatever the coefficients**: the energy of the states grows by no more than the excitation's, however the sets follow
/// one another, and for white excitation of variance 1 the output stays within `(1 + l) / (1 - l)` of the variance that
/// the gain gives it. Expanding `A(D)` to a polynomial in z would need more than double precision.
///
/// Because a set lasts for tens of samples, the step is written out as a matrix when the set is taken (a column a state),
/// and a sample is one product of matrix and vector: no chain from stage to stage.
#[derive(Debug, Clone)]
pub struct WarpedLattice {
    order: usize,
    /// Column by column: how each state, and last the excitation, enters the next states.
    step: Box<[[f64; ROWS]; COLUMNS]>,
    /// The output is `(next x_1 - l x_1) * out_scale`: the all-pass rotation solved for its input.
    warping: f64,
    out_scale: f64,
    state: [f64; ROWS],
    since_settled: usize,
    arch: Arch,
}

/// One set of coefficients, stage by stage.
struct Stages {
    sine: [f64; MAX_ORDER],
    cosine: [f64; MAX_ORDER],
    /// `1 / (1 - l k alpha)`, and the share alpha of a stage's forward signal in its backward one.
    delta: [f64; MAX_ORDER],
    alpha: [f64; MAX_ORDER + 1],
}

impl Stages {
    fn new(reflection: &[f64], warping: f64) -> Self {
        let mut this = Self {
            sine: [0.0; MAX_ORDER],
            cosine: [1.0; MAX_ORDER],
            delta: [1.0; MAX_ORDER],
            alpha: [1.0; MAX_ORDER + 1],
        };
        for (m, &k) in reflection.iter().enumerate() {
            let squared = (1.0 - k) * (1.0 + k);
            let below = warping * this.alpha[m];
            this.sine[m] = k;
            this.cosine[m] = squared.sqrt();
            this.delta[m] = 1.0 / (1.0 - k * below);
            this.alpha[m + 1] = k - squared * below * this.delta[m];
        }
        this
    }
}

impl Default for WarpedLattice {
    fn default() -> Self {
        Self::new()
    }
}

impl WarpedLattice {
    /// A silent filter at rest: it has no coefficients yet.
    pub fn new() -> Self {
        Self {
            order: 0,
            step: Box::new([[0.0; ROWS]; COLUMNS]),
            warping: 0.0,
            out_scale: 0.0,
            state: [0.0; ROWS],
            since_settled: 0,
            arch: Arch::new(),
        }
    }

    /// The coefficients from the next sample on: the warped polynomial `[a_1, ..., a_p]`, the warping factor in
    /// 0..=[`MAX_WARPING`], and the gain. Does not allocate.
    ///
    /// # Errors
    /// [`ArmaError`] for none, too many, not finite or unstable ones, or a factor out of range, keeping the old.
    pub fn set_coefficients(&mut self, ar: &[f64], warping: f64, gain: f64) -> Result<(), ArmaError> {
        check(ar, &[], gain)?;
        if ar.is_empty() || !(0.0..=MAX_WARPING).contains(&warping) {
            return Err(PredictionError::NotFinite.into());
        }
        let order = ar.len();
        let mut reflection = [0.0; MAX_ORDER];
        reflection[..order].copy_from_slice(ar);
        step_down(&mut reflection[..order])?;
        let stages = Stages::new(&reflection[..order], warping);
        // f_0 = prod c_m / A(D) e.
        let out_scale = gain / stages.cosine[..order].iter().product::<f64>();
        if !out_scale.is_finite() {
            return Err(PredictionError::NotFinite.into());
        }
        // Signals of stages that are gone, or were never there, must not come back with them.
        self.state[order.min(self.order)..].fill(0.0);
        (self.order, self.warping) = (order, warping);
        self.out_scale = out_scale / (1.0 - warping * warping).sqrt();
        self.arch.dispatch(Columns {
            stages: &stages,
            order,
            warping,
            step: &mut self.step,
        });
        Ok(())
    }

    /// The coefficients from the next sample on, for an output of `power` under white excitation of variance 1.
    ///
    /// # Errors
    /// As [`Self::set_coefficients`].
    pub fn set_power(&mut self, ar: &[f64], warping: f64, power: f64) -> Result<(), ArmaError> {
        check(ar, &[], power)?;
        let mut product = [0.0; MAX_ORDER + 1];
        let share = residual_share(ar, warping, &mut product[..=ar.len()])?;
        let gain = (power.max(0.0) * share / (1.0 - warping * warping)).sqrt();
        self.set_coefficients(ar, warping, gain)
    }

    /// Filters `excitation` into `out`, up to the shorter of the two.
    pub fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        let length = excitation.len().min(out.len());
        let mut done = 0;
        while done < length {
            let run = (length - done).min(SETTLE - self.since_settled);
            let arch = self.arch;
            arch.dispatch(Run {
                lattice: self,
                excitation: &excitation[done..done + run],
                out: &mut out[done..done + run],
            });
            done += run;
            self.since_settled += run;
            if self.since_settled == SETTLE {
                self.since_settled = 0;
                if is_over(&[], &self.state[..self.order]) || !are_finite(&self.state) {
                    self.reset();
                }
            }
        }
    }

    /// Goes on as another filter would: its coefficients and its state. Does not allocate.
    pub fn copy_state_from(&mut self, other: &Self) {
        (self.order, self.warping, self.out_scale) = (other.order, other.warping, other.out_scale);
        self.step.copy_from_slice(&other.step[..]);
        (self.state, self.since_settled) = (other.state, other.since_settled);
    }

    /// Puts the filter to rest; the coefficients stay.
    pub fn reset(&mut self) {
        self.state.fill(0.0);
        self.since_settled = 0;
    }
}

/// Writes the step matrix of a set of coefficients.
struct Columns<'a> {
    stages: &'a Stages,
    order: usize,
    warping: f64,
    step: &'a mut [[f64; ROWS]; COLUMNS],
}

impl WithSimd for Columns<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        match self.order {
            0..=16 => self.write::<16>(),
            17..=24 => self.write::<24>(),
            _ => self.write::<32>(),
        }
    }
}

impl Columns<'_> {
    /// Stage by stage, with `s^2 = 1 - l^2`, `q_m = s x_m - l beta_{m-1}` and
    /// `beta_m = c_m (1 + l k_m alpha_{m-1} delta_m) q_m`, upwards; then, downwards,
    /// `f_{m-1} = delta_m (c_m f_m - k_m q_m)`, `b_m = alpha_m f_m + beta_m` and `next x_m = l x_m + s b_{m-1}`.
    ///
    /// What a single `q_j` does is the sum of what it does through `f` below it and of what it does through `beta` above
    /// it, which is what `q_{j+1}` does, scaled: so each column follows from its neighbour.
    #[inline(always)]
    fn write<const PADDED: usize>(self) {
        let Self {
            stages,
            order,
            warping,
            step,
        } = self;
        let turn = 1.0 - warping * warping;
        // Per forward signal above: alpha_{i-1} f_{i-1} of each stage i.
        let mut below = [0.0; PADDED];
        for j in 0..order {
            below[j] = stages.alpha[j];
            let through = -turn * stages.delta[j] * stages.sine[j];
            let pass = stages.delta[j] * stages.cosine[j];
            for i in 0..PADDED {
                step[j][i] = through * below[i];
                below[i] *= pass;
            }
        }
        let rotation = turn.sqrt();
        for i in 0..PADDED {
            step[order][i] = rotation * below[i];
        }
        let mut above = [0.0; PADDED];
        for j in (0..order).rev() {
            let rise =
                stages.cosine[j] * (1.0 + warping * stages.sine[j] * stages.alpha[j] * stages.delta[j]);
            let carried = -warping * rise;
            for i in 0..PADDED {
                above[i] = step[j][i] + carried * above[i];
            }
            if j + 1 < order {
                above[j + 1] += turn * rise;
            }
            step[j][..PADDED].copy_from_slice(&above);
            step[j][j] += warping;
        }
    }
}

/// Filters up to [`SETTLE`] samples.
struct Run<'a> {
    lattice: &'a mut WarpedLattice,
    excitation: &'a [f64],
    out: &'a mut [f64],
}

impl WithSimd for Run<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        match self.lattice.order {
            0..=16 => self.run::<16>(),
            17..=24 => self.run::<24>(),
            _ => self.run::<32>(),
        }
    }
}

impl Run<'_> {
    #[inline(always)]
    fn run<const PADDED: usize>(self) {
        let lattice = self.lattice;
        let (order, warping, scale) = (lattice.order, lattice.warping, lattice.out_scale);
        let mut state = [0.0; PADDED];
        state.copy_from_slice(&lattice.state[..PADDED]);
        let (columns, rest) = lattice.step[..order].as_chunks::<2>();
        let drive = &lattice.step[order];
        for (e, out) in self.excitation.iter().zip(self.out) {
            // Two sums, so that neither waits for the other.
            let mut even: [f64; PADDED] = std::array::from_fn(|i| drive[i] * e);
            let mut odd = [0.0; PADDED];
            for ([left, right], x) in columns.iter().zip(state.as_chunks::<2>().0) {
                for i in 0..PADDED {
                    even[i] += left[i] * x[0];
                    odd[i] += right[i] * x[1];
                }
            }
            if let [last] = rest {
                let x = state[order - 1];
                for i in 0..PADDED {
                    even[i] += last[i] * x;
                }
            }
            let first = state[0];
            for i in 0..PADDED {
                state[i] = even[i] + odd[i];
            }
            *out = (state[0] - warping * first) * scale;
        }
        lattice.state[..PADDED].copy_from_slice(&state);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;
    use crate::prediction::reflection_to_ar;
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
    fn by_stages(reflection: &[f64], l: f64, x: &[f64], e: f64) -> (Vec<f64>, f64, f64) {
        let (order, s) = (reflection.len(), (1.0 - l * l).sqrt());
        let stages = Stages::new(reflection, l);
        let (mut q, mut beta) = (vec![0.0; order], vec![0.0; order + 1]);
        for m in 0..order {
            q[m] = s * x[m] - l * beta[m];
            let through = 1.0 + l * stages.sine[m] * stages.alpha[m] * stages.delta[m];
            beta[m + 1] = stages.cosine[m] * through * q[m];
        }
        let (mut f, mut next) = (e, vec![0.0; order]);
        let last = stages.alpha[order] * f + beta[order];
        for m in (0..order).rev() {
            f = stages.delta[m] * (stages.cosine[m] * f - stages.sine[m] * q[m]);
            next[m] = l * x[m] + s * (stages.alpha[m] * f + beta[m]);
        }
        (next, last, f)
    }

    #[test]
    fn the_matrix_is_the_step_of_the_stages_and_orthogonal() {
        let mut draw = draw(1);
        for order in [1, 2, 3, 12, 16, 17, 20, 24, 32] {
            for (l, most) in [(0.0, 0.9), (0.5, 0.99), (0.8, 0.9999), (0.95, 0.999)] {
                let reflection = draw.reflection(order, most);
                let mut lattice = WarpedLattice::new();
                let stages = Stages::new(&reflection, l);
                Columns {
                    stages: &stages,
                    order,
                    warping: l,
                    step: &mut lattice.step,
                }
                .with_simd(pulp::Scalar::new());
                let mut full = vec![vec![0.0; order + 1]; order + 1];
                for j in 0..=order {
                    let mut x = vec![0.0; order + 1];
                    x[j] = 1.0;
                    let (next, last, _) = by_stages(&reflection, l, &x[..order], x[order]);
                    for i in 0..order {
                        assert!(
                            (lattice.step[j][i] - next[i]).abs() < 1e-12,
                            "{order} {l} {i} {j}"
                        );
                        full[i][j] = lattice.step[j][i];
                    }
                    full[order][j] = last;
                }
                for a in 0..=order {
                    for b in 0..=order {
                        let dot: f64 = (0..=order).map(|i| full[i][a] * full[i][b]).sum();
                        let wanted = if a == b { 1.0 } else { 0.0 };
                        assert!((dot - wanted).abs() < 1e-12, "{order} {l} {a} {b}: {dot}");
                    }
                }
            }
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
                assert!(
                    (transform(1.0) / wanted - 1.0).abs() < 1e-6,
                    "{order} {l} {k} {}",
                    warp(w, l)
                );
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
            lattice.set_power(&ar, l, 3.0).unwrap();
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

    #[test]
    fn no_sequence_of_coefficients_raises_the_energy_of_the_states() {
        let mut draw = draw(4);
        let mut lattice = WarpedLattice::new();
        let mut noise = Gaussian::new(7);
        let (mut e, mut y, mut energy_in, mut before) = ([0.0; 1], [0.0; 1], 0.0, 0.0);
        for round in 0..20_000 {
            let order = 1 + round % 32;
            let reflection = draw.reflection(order, 0.9999);
            let l = [0.0, 0.8, 0.95][round % 3];
            if lattice
                .set_coefficients(&reflection_to_ar(&reflection), l, 1.0)
                .is_ok()
            {
                before = lattice.state.iter().map(|x| x * x).sum::<f64>().min(before);
            }
            noise.fill(&mut e);
            lattice.process(&e, &mut y);
            energy_in = e[0] * e[0];
            let energy: f64 = lattice.state.iter().map(|x| x * x).sum();
            assert!(energy <= (before + energy_in) * (1.0 + 1e-12), "{round}");
            assert!(y[0].is_finite());
            before = energy;
        }
        assert!(energy_in > 0.0);
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
        assert!(
            y.iter()
                .zip([1.0, 0.5, 0.25, 0.125])
                .all(|(y, w)| (y - w).abs() < 1e-15)
        );
    }
}
