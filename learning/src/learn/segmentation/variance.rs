//! Innovation variances of a segment at every order, for eight segments at once, from second moments alone.
//!
//! Each estimator costs of the order of `order²` to `order³/3` operations a segment, whatever its length. The arithmetic is plain
//! IEEE (no fused operations), so that every machine and vector width gives the same bits.

use super::moments::{LongSum, Moments};
use std::array::from_fn;
use std::ops::{Add, Div, Mul, Sub};

/// Segments handled side by side.
pub(super) const LANES: usize = 8;

/// One number for each of [`LANES`] segments.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub(super) struct Lanes(pub [f64; LANES]);

impl Lanes {
    #[inline(always)]
    pub(super) fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    /// `numerator / self`, or zero where `self` does not exceed `least`.
    #[inline(always)]
    fn guarded_quotient(self, numerator: Self, least: Self) -> Self {
        Self(from_fn(|l| if self.0[l] > least.0[l] { numerator.0[l] / self.0[l] } else { 0.0 }))
    }

    #[inline(always)]
    fn max(self, least: f64) -> Self {
        Self(from_fn(|l| if self.0[l] > least { self.0[l] } else { least }))
    }
}

macro_rules! lanewise {
    ($trait:ident $method:ident $op:tt) => {
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(from_fn(|l| self.0[l] $op other.0[l]))
            }
        }
    };
}
lanewise!(Add add +);
lanewise!(Sub sub -);
lanewise!(Mul mul *);
lanewise!(Div div /);

/// Length of the description of one end of a segment, `3 order + 2` numbers: the long sums (their high parts, then
/// their low parts, by lag) and `order` samples near the end.
pub(super) fn end_size(order: usize) -> usize {
    3 * order + 2
}

/// Buffers that the estimators write before they read.
pub(super) struct Scratch {
    lagged: Vec<Lanes>,
    square: Vec<Lanes>,
}

impl Scratch {
    pub(super) fn new(order: usize) -> Self {
        Self {
            lagged: vec![Lanes::default(); 5 * (order + 2)],
            square: vec![Lanes::default(); (order + 1) * (order + 2) / 2],
        }
    }
}

/// An estimate of innovation variances.
pub(super) trait Estimator {
    /// True if splitting a segment never raises its sum of squared residuals at a fixed order. Then a start can be dropped from the exact
    /// search for good.
    const SUPERADDITIVE: bool;

    /// Describes the start of a segment at `position`. By default samples before it are unknown: its products of lag k
    /// begin k samples later.
    fn describe_start(moments: &Moments, position: usize, out: &mut [f64]) {
        let order = moments.order;
        let mut sums = [LongSum::default(); haptograph_surfaces::MAX_ORDER + 1];
        moments.up_to(position, &mut sums[..=order]);
        for (lag, sum) in sums.iter_mut().enumerate().take(order + 1) {
            for u in position..(position + lag).min(moments.signal.len()) {
                sum.add(moments.sample(u as isize) * moments.sample(u as isize - lag as isize));
            }
        }
        write_sums(&sums[..=order], out);
        for (i, sample) in out[2 * (order + 1)..].iter_mut().enumerate() {
            *sample = moments.sample((position + i) as isize);
        }
    }

    /// Describes the end of a segment before `position`.
    fn describe_end(moments: &Moments, position: usize, out: &mut [f64]) {
        let order = moments.order;
        let mut sums = [LongSum::default(); haptograph_surfaces::MAX_ORDER + 1];
        moments.up_to(position, &mut sums[..=order]);
        write_sums(&sums[..=order], out);
        for (i, sample) in out[2 * (order + 1)..].iter_mut().enumerate() {
            *sample = moments.sample(position as isize - 1 - i as isize);
        }
    }

    /// The innovation variances at order 0, 1, ... of eight segments, into `variances` (its length less one is the highest order).
    /// Past an order at which a segment has become predictable they stay as they are.
    fn estimate(
        starts: &[Lanes],
        ends: &[Lanes],
        spans: Lanes,
        scratch: &mut Scratch,
        variances: &mut [Lanes],
    );
}

fn write_sums(sums: &[LongSum], out: &mut [f64]) {
    let (high, rest) = out.split_at_mut(sums.len());
    for (i, sum) in sums.iter().enumerate() {
        high[i] = sum.high;
        rest[i] = sum.low;
    }
}

/// Sums at the end less those at the start, with nothing lost to cancellation.
#[inline(always)]
fn lagged_products(starts: &[Lanes], ends: &[Lanes], out: &mut [Lanes]) {
    let lags = out.len();
    for (lag, product) in out.iter_mut().enumerate() {
        *product = (ends[lag] - starts[lag]) + (ends[lags + lag] - starts[lags + lag]);
    }
}

/// Least squares given the true past (the covariance method), residuals counted at every sample of the segment.
pub(super) struct ConditionalLeastSquares;

impl Estimator for ConditionalLeastSquares {
    const SUPERADDITIVE: bool = true;

    fn describe_start(moments: &Moments, position: usize, out: &mut [f64]) {
        Self::describe_end(moments, position, out);
    }

    /// Eliminates the regressors x[u-1], x[u-2], ... one by one from their matrix of products, bordered by the target
    /// x[u]: the rest of the target's own product after k of them is the residual sum of squares at order k.
    #[inline(always)]
    fn estimate(
        starts: &[Lanes],
        ends: &[Lanes],
        spans: Lanes,
        scratch: &mut Scratch,
        variances: &mut [Lanes],
    ) {
        let order = variances.len() - 1;
        let columns = &mut scratch.square[..(order + 1) * (order + 2) / 2];
        let products = &mut scratch.lagged[..=order];
        lagged_products(starts, ends, products);
        let (before, last) = (&starts[2 * (order + 1)..][..order], &ends[2 * (order + 1)..][..order]);
        // Lower triangle by columns: column j holds rows j..=order; the target is the last row.
        let column = |j: usize| j * (order + 1) - j * (j + 1) / 2 + j;
        for lag in 0..=order {
            let mut product = products[lag];
            if lag > 0 {
                columns[column(lag - 1) + order - (lag - 1)] = product;
            }
            // Shifting both regressors by one sample takes one product in at the start and one out at the end.
            for k in 0..order - lag {
                product = (product + before[k + lag] * before[k]) - last[k + lag] * last[k];
                columns[column(k) + lag] = product;
            }
        }
        let energy = products[0];
        columns[column(order)] = energy;
        variances[0] = energy.max(0.0) / spans;
        // Two regressors at a time, which halves the traffic to memory. A pivot within rounding of zero is a regressor that
        // the earlier ones predict: it explains nothing more.
        let least = energy * Lanes::splat(1e-14);
        let mut k = 0;
        while k + 1 < order {
            let (first, rest) = columns[column(k)..].split_at_mut(order + 1 - k);
            let (second, rest) = rest.split_at_mut(order - k);
            let first_scale = first[0].guarded_quotient(Lanes::splat(1.0), least);
            let factor = first[1] * first_scale;
            for (cell, &pivot) in second.iter_mut().zip(&first[1..]) {
                *cell = *cell - factor * pivot;
            }
            let second_scale = second[0].guarded_quotient(Lanes::splat(1.0), least);
            let target = order - k;
            let after_first = columns_target(rest) - first[target] * first_scale * first[target];
            let mut cells = rest;
            for j in 2..=target {
                let (first_factor, second_factor) = (first[j] * first_scale, second[j - 1] * second_scale);
                let (now, later) = cells.split_at_mut(target + 1 - j);
                for ((cell, &a), &b) in now.iter_mut().zip(&first[j..]).zip(&second[j - 1..]) {
                    *cell = (*cell - first_factor * a) - second_factor * b;
                }
                cells = later;
            }
            variances[k + 1] = after_first.max(0.0) / spans;
            variances[k + 2] = columns[column(order)].max(0.0) / spans;
            k += 2;
        }
        if k < order {
            let (pivot, target) = (columns[column(k)], columns[column(k) + 1]);
            let explained = target * pivot.guarded_quotient(Lanes::splat(1.0), least) * target;
            variances[order] = (columns[column(order)] - explained).max(0.0) / spans;
        }
    }
}

/// The target's own product: the last cell of the triangle.
#[inline(always)]
fn columns_target(columns: &[Lanes]) -> Lanes {
    columns[columns.len() - 1]
}

/// Yule-Walker: the biased autocovariance of the segment alone, by the Schur recursion.
pub(super) struct YuleWalker;

impl Estimator for YuleWalker {
    const SUPERADDITIVE: bool = false;

    #[inline(always)]
    fn estimate(
        starts: &[Lanes],
        ends: &[Lanes],
        spans: Lanes,
        scratch: &mut Scratch,
        variances: &mut [Lanes],
    ) {
        let order = variances.len() - 1;
        let (forward, backward) = scratch.lagged.split_at_mut(order + 1);
        lagged_products(starts, ends, forward);
        backward[..=order].copy_from_slice(forward);
        let least = forward[0] * Lanes::splat(1e-14);
        variances[0] = forward[0].max(0.0) / spans;
        for m in 1..=order {
            let reflection = backward[m - 1].guarded_quotient(Lanes::splat(0.0) - forward[m], least);
            for j in (m..=order).rev() {
                let (u, v) = (forward[j], backward[j - 1]);
                forward[j] = u + reflection * v;
                backward[j] = v + reflection * u;
            }
            variances[m] = backward[m].max(0.0) / spans;
        }
    }
}

/// Burg's method from lagged products and the samples at both ends: K. Vos, "A fast implementation of Burg's method" (2013).
pub(super) struct Burg;

impl Estimator for Burg {
    const SUPERADDITIVE: bool = false;

    #[inline(always)]
    fn estimate(
        starts: &[Lanes],
        ends: &[Lanes],
        spans: Lanes,
        scratch: &mut Scratch,
        variances: &mut [Lanes],
    ) {
        let order = variances.len() - 1;
        let two = Lanes::splat(2.0);
        let (products, rest) = scratch.lagged.split_at_mut(order + 1);
        let (a, rest) = rest.split_at_mut(order + 1);
        let (r, rest) = rest.split_at_mut(order + 1);
        let (g, old) = rest.split_at_mut(order + 2);
        lagged_products(starts, ends, products);
        let (first, last) = (&starts[2 * (order + 1)..][..order], &ends[2 * (order + 1)..][..order]);
        variances[0] = products[0].max(0.0) / spans;
        let least = products[0] * Lanes::splat(1e-14);
        a.fill(Lanes::splat(0.0));
        a[0] = Lanes::splat(1.0);
        g[0] = two * products[0] - first[0] * first[0] - last[0] * last[0];
        g[1] = two * products[1];
        r[0] = g[1];
        for i in 0..order {
            let mut across = Lanes::splat(0.0);
            let mut energy = Lanes::splat(0.0);
            for j in 0..=i {
                across = across + a[j] * g[i + 1 - j];
                energy = energy + a[j] * g[j];
            }
            // |k| <= 1 holds in exact arithmetic.
            let k = energy.guarded_quotient(Lanes::splat(0.0) - across, least);
            let k = Lanes(from_fn(|l| k.0[l].clamp(-1.0, 1.0)));
            variances[i + 1] = variances[i] * (Lanes::splat(1.0) - k * k);
            if i + 1 == order {
                break;
            }
            old[..=i].copy_from_slice(&a[..=i]);
            for j in 1..=i {
                a[j] = old[j] + k * old[i + 1 - j];
            }
            a[i + 1] = k;
            for j in (0..=i).rev() {
                r[j + 1] = r[j] - first[j] * first[i + 1] - last[j] * last[i + 1];
            }
            r[0] = two * products[i + 2];
            let (mut at_first, mut at_last, mut next) =
                (Lanes::splat(0.0), Lanes::splat(0.0), Lanes::splat(0.0));
            for j in 0..=i + 1 {
                at_first = at_first + first[i + 1 - j] * a[j];
                at_last = at_last + last[i + 1 - j] * a[j];
                next = next + r[j] * a[j];
            }
            old[..=i + 1].copy_from_slice(&g[..=i + 1]);
            for j in 0..=i + 1 {
                let turned = old[j] + k * old[i + 1 - j];
                g[j] = turned - first[i + 1 - j] * at_first - last[i + 1 - j] * at_last;
            }
            g[i + 2] = next;
        }
    }
}
