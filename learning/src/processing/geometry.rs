//! Directions: the surface's normal, the tool's orientation.

use super::ProcessingError;
use crate::signals::{Pose, Recording, Series};
pub(super) use haptograph_surfaces::recorder::vector::{along, dot, rotate};
use nalgebra::{Matrix3, SymmetricEigen};

pub(super) type Vector = [f64; 3];

/// Source of the surface's outward normal. Its sign is such that the mean force pushes the tool away.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum SurfaceNormal {
    /// The plane fitted to the tip's path in contact, as in the thesis.
    #[default]
    PlaneFit,
    /// The mean force in contact: for tapping and pressing, whose paths do not define a plane.
    ForceDirection,
    /// A direction in the world.
    Given([f64; 3]),
}

/// Force above which the tool is in contact, N.
const CONTACT_N: f64 = 0.1;

pub(super) fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// The orientation at a time, interpolated along the shorter arc between samples.
pub(super) fn interpolated_orientation(motion: &Series<Pose>, time_s: f64) -> [f64; 4] {
    let (before, part) = motion.place(time_s);
    let a = motion.samples[before].orientation;
    let b = motion.samples[(before + 1).min(motion.samples.len() - 1)].orientation;
    let sign = if a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
    let mixed: [f64; 4] = std::array::from_fn(|i| a[i] + part * (sign * b[i] - a[i]));
    let length = mixed.iter().map(|q| q * q).sum::<f64>().sqrt();
    if length > 0.0 { mixed.map(|q| q / length) } else { a }
}

/// Loads that are turned at once.
const STRETCH: usize = 1 << 14;

/// Forces on the tool in the world, N, sample by sample of the force sensor. Of a long recording a stretch is held.
pub(super) struct WorldForces<'a> {
    recording: &'a Recording,
    first: usize,
    stretch: Vec<Vector>,
}

impl<'a> WorldForces<'a> {
    pub(super) fn new(recording: &'a Recording) -> Self {
        Self { recording, first: 0, stretch: vec![] }
    }

    fn sample(&mut self, index: usize) -> Vector {
        if let Some(force) = index.checked_sub(self.first).and_then(|at| self.stretch.get(at)) {
            return *force;
        }
        let Self { recording, first, stretch } = self;
        let wrench = recording.wrench();
        // With the one before, because forces between two samples need both.
        *first = index.saturating_sub(1);
        let loads = wrench.stretch(*first..(*first + STRETCH).min(wrench.count()));
        let turned = loads.iter().enumerate().map(|(at, load)| {
            let turn = interpolated_orientation(recording.motion(), wrench.time_s(*first + at));
            rotate(turn, recording.calibration().load_on_tool(load).force_n)
        });
        *stretch = turned.collect();
        stretch[index - *first]
    }

    /// The force at a time: linear between samples, the first or last value outside.
    pub(super) fn at(&mut self, time_s: f64) -> Vector {
        let wrench = self.recording.wrench();
        let (before, part) = wrench.place(time_s);
        let after = (before + 1).min(wrench.count() - 1);
        let (a, b) = (self.sample(before), self.sample(after));
        std::array::from_fn(|i| a[i] + part * (b[i] - a[i]))
    }

    fn all(&mut self) -> impl Iterator<Item = Vector> {
        (0..self.recording.wrench().count()).map(|index| self.sample(index))
    }
}

/// The unit outward normal of the surface.
pub(super) fn surface_normal(
    recording: &Recording,
    forces: &mut WorldForces<'_>,
    tips: &[Vector],
    source: SurfaceNormal,
) -> Result<Vector, ProcessingError> {
    let mut sum = |least_n: f64| {
        let pushing = forces.all().filter(|f| norm(*f) > least_n);
        pushing.fold([0.0; 3], |sum, f| along(sum, 1.0, f))
    };
    let mut push = sum(CONTACT_N);
    if norm(push) == 0.0 {
        push = sum(f64::NEG_INFINITY);
    }
    let normal = match source {
        SurfaceNormal::Given(normal) => normal,
        SurfaceNormal::ForceDirection => push,
        SurfaceNormal::PlaneFit => {
            let touches =
                |(i, _): &(usize, &Vector)| norm(forces.at(recording.motion().time_s(*i))) > CONTACT_N;
            let touching: Vec<Vector> =
                tips.iter().enumerate().filter(touches).map(|(_, &tip)| tip).collect();
            // A recording with almost no force counts as in contact all the time.
            fit_plane(if touching.len() * 10 > tips.len() { &touching } else { tips })?
        }
    };
    let length = norm(normal);
    if !(length.is_finite() && length > 0.0) {
        return Err(ProcessingError::NoForce);
    }
    let sign = if dot(normal, push) < 0.0 && !matches!(source, SurfaceNormal::Given(_)) { -1.0 } else { 1.0 };
    Ok(normal.map(|x| sign * x / length))
}

/// The direction in which points spread least.
fn fit_plane(points: &[Vector]) -> Result<Vector, ProcessingError> {
    let count = points.len() as f64;
    let mean = points.iter().fold([0.0; 3], |sum, &p| along(sum, 1.0 / count, p));
    let mut spread = Matrix3::<f64>::zeros();
    for &point in points {
        let offset = along(point, -1.0, mean);
        for i in 0..3 {
            for j in 0..3 {
                spread[(i, j)] += offset[i] * offset[j] / count;
            }
        }
    }
    let eigen = SymmetricEigen::new(spread);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let [thickness, second] = [order[0], order[1]].map(|i| eigen.eigenvalues[i].max(0.0).sqrt());
    // Twice as wide as thick, and wider than the tracker's grain.
    if !(second > 1e-3 && second > 2.0 * thickness) {
        return Err(ProcessingError::NoPlane {
            spread_mm: second * 1000.0,
            thickness_mm: thickness * 1000.0,
        });
    }
    let normal = eigen.eigenvectors.column(order[0]);
    Ok([normal[0], normal[1], normal[2]])
}
