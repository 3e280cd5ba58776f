//! The step of a warped lattice as a matrix.

use crate::arma::{ArmaError, MAX_ORDER, check};
use crate::elementwise::mul_add;
use crate::prediction::{PredictionError, step_down};
use crate::warped::MAX_WARPING;
use pulp::{Arch, Simd, WithSimd};

/// Rows of the largest step matrix.
pub(super) const ROWS: usize = MAX_ORDER;
/// Sums that a product of matrix and state is split into, so that none waits for the other: column j goes to sum j % 2.
pub(super) const SUMS: usize = 2;

/// A column of a step matrix.
type Column = [f64; ROWS];

/// The step of a warped lattice: the gains from each state and from the excitation to the next states and to the
/// output.
///
/// Rows and columns from the order on are 0, as far as the next whole vector. Columns lie on whole cache lines: a vector
/// across two of them would take twice as long to load.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(super) struct Step {
    pub columns: [Column; MAX_ORDER],
    pub drive: Column,
    pub order: usize,
    /// The output is `(next x_1 - l x_1) * out_scale`: the all-pass rotation solved for its input.
    pub warping: f64,
    pub out_scale: f64,
}

impl Step {
    pub(super) const SILENT: Self = Self {
        columns: [[0.0; ROWS]; MAX_ORDER],
        drive: [0.0; ROWS],
        order: 0,
        warping: 0.0,
        out_scale: 0.0,
    };

    /// Takes other stages.
    pub(super) fn set(&mut self, arch: Arch, stages: &Stages) {
        (self.order, self.warping, self.out_scale) = (stages.order, stages.warping, stages.out_scale);
        arch.dispatch(Write { stages, step: self });
        // What is beyond the order may be left from before.
        for column in &mut self.columns[stages.order..stages.order.next_multiple_of(SUMS)] {
            column.fill(0.0);
        }
    }
}

/// The stages of a warped lattice; the step takes the sines `k_m` and cosines `c_m` of their angles into what the formulas below need
/// of them. Beyond the order they pass on and turn nothing.
pub(crate) struct Stages {
    pub order: usize,
    pub warping: f64,
    /// `c_m delta_m`: what goes on upwards as `beta_m` and downwards as `f_{m-1}`.
    pub pass: [f64; MAX_ORDER],
    /// `-k_m delta_m`: what is turned from `q_m` into `f_{m-1}`.
    pub turned: [f64; MAX_ORDER],
    /// `alpha_{m-1}`: the share of a forward signal in the backward signal below the stage.
    pub alpha: [f64; MAX_ORDER],
    /// See [`Step::out_scale`].
    pub out_scale: f64,
}

impl Stages {
    /// See [`WarpedLattice::set_coefficients`](super::WarpedLattice::set_coefficients).
    pub(crate) fn new(arch: Arch, ar: &[f64], warping: f64, gain: f64) -> Result<Self, ArmaError> {
        check(ar, &[], gain)?;
        if ar.is_empty() || !(0.0..=MAX_WARPING).contains(&warping) {
            return Err(PredictionError::NotFinite.into());
        }
        let mut reflection = [0.0; MAX_ORDER];
        let reflection = &mut reflection[..ar.len()];
        reflection.copy_from_slice(ar);
        step_down(reflection)?;
        let stages = Self::of_reflection(arch, reflection, warping, gain);
        if stages.out_scale.is_finite() { Ok(stages) } else { Err(PredictionError::NotFinite.into()) }
    }

    /// Builds the step from up to [`MAX_ORDER`] reflection coefficients between -1 and 1.
    pub(crate) fn of_reflection(arch: Arch, reflection: &[f64], warping: f64, gain: f64) -> Self {
        arch.dispatch(Solve { reflection, warping, gain })
    }
}

/// See [`Stages::of_reflection`].
struct Solve<'a> {
    reflection: &'a [f64],
    warping: f64,
    gain: f64,
}

impl WithSimd for Solve<'_> {
    type Output = Stages;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Stages {
        match self.reflection.len() {
            0..=16 => self.solve::<16>(),
            17..=24 => self.solve::<24>(),
            _ => self.solve::<32>(),
        }
    }
}

impl Solve<'_> {
    /// `alpha_m = (k_m - l alpha_{m-1}) delta_m` with `delta_m = 1 / (1 - l k_m alpha_{m-1})`, from `alpha_0 = 1`: as a
    /// quotient `above / below`, so that the chain of the stages has no division.
    #[inline(always)]
    fn solve<const PADDED: usize>(self) -> Stages {
        let Self { reflection, warping, gain } = self;
        let mut sine = [0.0; PADDED];
        for (sine, k) in sine.iter_mut().zip(reflection) {
            *sine = *k;
        }
        let cosine: [f64; PADDED] = std::array::from_fn(|m| ((1.0 - sine[m]) * (1.0 + sine[m])).sqrt());
        let (mut above, mut below, mut next_below) = ([0.0; PADDED], [1.0; PADDED], [1.0; PADDED]);
        let mut quotient = (1.0, 1.0_f64);
        for (m, k) in reflection.iter().enumerate().take(PADDED) {
            (above[m], below[m]) = quotient;
            let (a, b) = quotient;
            quotient = (mul_add(*k, b, -(warping * a)), mul_add(-(warping * k), a, b));
            next_below[m] = quotient.1;
        }
        let mut stages = Stages {
            order: reflection.len(),
            warping,
            pass: [1.0; MAX_ORDER],
            turned: [0.0; MAX_ORDER],
            alpha: [0.0; MAX_ORDER],
            // f_0 = prod c_m / A(D) e.
            out_scale: gain / product(&cosine) / (1.0 - warping * warping).sqrt(),
        };
        for m in 0..PADDED {
            // One division for both quotients.
            let inverse = 1.0 / (below[m] * next_below[m]);
            let delta = below[m] * below[m] * inverse;
            stages.pass[m] = cosine[m] * delta;
            stages.turned[m] = -(sine[m] * delta);
            stages.alpha[m] = above[m] * next_below[m] * inverse;
        }
        stages
    }
}

/// Writes the stages as the matrix of a step.
struct Write<'a> {
    stages: &'a Stages,
    step: &'a mut Step,
}

impl WithSimd for Write<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        match self.stages.order {
            0..=16 => self.write::<16>(),
            17..=24 => self.write::<24>(),
            _ => self.write::<32>(),
        }
    }
}

impl Write<'_> {
    /// Stage by stage the step is, with `s^2 = 1 - l^2`, `q_m = s x_m - l beta_{m-1}` and
    /// `beta_m = c_m delta_m q_m`, upwards; then, downwards, `f_{m-1} = delta_m (c_m f_m - k_m q_m)`,
    /// `b_m = alpha_m f_m + beta_m` and `next x_m = l x_m + s b_{m-1}`.
    ///
    /// The effect of a single `q_j` is the sum of its effect through `f` below it and of its effect through `beta`
    /// above it; the latter is the scaled effect of `q_{j+1}`: so each column follows from its neighbour.
    #[inline(always)]
    fn write<const PADDED: usize>(self) {
        let Self { stages, step } = self;
        let (order, warping) = (stages.order, stages.warping);
        let turn = 1.0 - warping * warping;
        // What the forward signal below stage j does below it, times s.
        let (mut below, mut pass) = ([0.0_f64; PADDED], 0.0);
        for (j, column) in step.columns[..order].iter_mut().enumerate() {
            let (here, share) = (unit::<PADDED>(j), turn * stages.alpha[j]);
            for i in 0..PADDED {
                below[i] = mul_add(below[i], pass, here[i] * share);
            }
            for i in 0..PADDED {
                column[i] = stages.turned[j] * below[i];
            }
            pass = stages.pass[j];
        }
        let drive = pass / turn.sqrt();
        for (place, below) in step.drive.iter_mut().zip(&below) {
            *place = drive * below;
        }
        // What q_{j+1} does; above the highest stage there is none.
        let (mut through, mut entering) = ([0.0; PADDED], 0.0);
        for (j, column) in step.columns[..order].iter_mut().enumerate().rev() {
            let (above, onwards) = (unit::<PADDED>(j + 1), -warping * stages.pass[j]);
            let entered = entering * stages.pass[j];
            for i in 0..PADDED {
                through[i] = mul_add(onwards, through[i], mul_add(entered, above[i], column[i]));
            }
            column[..PADDED].copy_from_slice(&through);
            column[j] += warping;
            entering = turn;
        }
    }
}

/// The product, in lanes.
#[inline(always)]
fn product<const PADDED: usize>(values: &[f64; PADDED]) -> f64 {
    let mut lanes = [1.0; 8];
    for row in values.as_chunks::<8>().0 {
        for (lane, value) in lanes.iter_mut().zip(row) {
            *lane *= value;
        }
    }
    lanes.iter().product()
}

/// The unit vector along an axis; none for an axis that there is not.
#[inline(always)]
fn unit<const PADDED: usize>(axis: usize) -> &'static [f64; PADDED] {
    const LONGEST: usize = 2 * MAX_ORDER + 1;
    static ONE: [f64; LONGEST] = {
        let mut one = [0.0; LONGEST];
        one[MAX_ORDER] = 1.0;
        one
    };
    static NONE: [f64; LONGEST] = [0.0; LONGEST];
    let window = ONE[MAX_ORDER - axis.min(MAX_ORDER)..].first_chunk();
    window.or(NONE.first_chunk()).unwrap_or(&[0.0; PADDED])
}
