//! Exponents of the power of textures over speed and force, used as the prior of a law.

use crate::learn::spectral_law::{Observation, POWER_SLOPES};
use haptograph_signal::statistics::{mean, standard_deviation};
use nalgebra::{Matrix2, Vector2};

/// Minimum number of other textures for a prior.
const LEAST_TEXTURES: usize = 5;

/// Exponents of speed and force in the power of textures.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PowerExponents {
    /// Standard deviation of the regressions of single textures over textures.
    pub deviation: [f64; 2],
    /// Mean of the regressions of single textures.
    pub mean: [f64; 2],
    /// One regression over all models, with a level per texture.
    pub pooled: [f64; 2],
    /// Number of textures with a regression of their own.
    pub textures: usize,
}

/// Sums of one texture for regressions of ln power on ln speed and ln force about its own centre.
pub(super) struct Moments {
    information: Matrix2<f64>,
    slopes: Vector2<f64>,
}

impl Moments {
    pub(super) fn of(seen: &[Observation]) -> Self {
        let centred = |value: fn(&Observation) -> f64| {
            let logs: Vec<f64> = seen.iter().map(|at| value(at).ln()).collect();
            let middle = mean(&logs);
            logs.into_iter().map(move |x| x - middle)
        };
        let places = centred(|at| at.speed_m_s).zip(centred(|at| at.force_n));
        let mut moments = Self { information: Matrix2::zeros(), slopes: Vector2::zeros() };
        for ((speed, force), power) in places.zip(centred(|at| at.power)) {
            let place = Vector2::new(speed, force);
            moments.information += place * place.transpose();
            moments.slopes += place * power;
        }
        moments
    }

    /// The slopes; `None` if the points lie on a line.
    fn solved(&self) -> Option<[f64; 2]> {
        let scale = self.information.trace();
        if self.information.determinant() < 1e-6 * scale * scale {
            return None;
        }
        self.information.cholesky().map(|factors| factors.solve(&self.slopes).into())
    }

    fn sum<'m>(all: impl Iterator<Item = &'m Self>) -> Self {
        let zero = Self { information: Matrix2::zeros(), slopes: Vector2::zeros() };
        all.fold(zero, |sum, one| Self {
            information: sum.information + one.information,
            slopes: sum.slopes + one.slopes,
        })
    }
}

/// The exponents of all textures but one; the defaults of `learn` if too few remain.
pub(super) fn without(textures: &[Moments], one: usize) -> [f64; 2] {
    let others = textures.iter().enumerate().filter(|(number, _)| *number != one);
    if textures.len() <= LEAST_TEXTURES {
        return POWER_SLOPES;
    }
    Moments::sum(others.map(|(_, moments)| moments)).solved().unwrap_or(POWER_SLOPES)
}

impl PowerExponents {
    pub(super) fn of(textures: &[Moments]) -> Option<Self> {
        let pooled = Moments::sum(textures.iter()).solved()?;
        let alone: Vec<[f64; 2]> = textures.iter().filter_map(Moments::solved).collect();
        let each = |k: usize| -> Vec<f64> { alone.iter().map(|slopes| slopes[k]).collect() };
        let deviation = |k: usize| standard_deviation(&each(k));
        Some(Self {
            pooled,
            mean: [mean(&each(0)), mean(&each(1))],
            deviation: [deviation(0), deviation(1)],
            textures: alone.len(),
        })
    }
}
