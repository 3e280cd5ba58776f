//! Curves of few points through values at even times, and their values between the points.

use std::collections::BinaryHeap;

/// Time between two values, s.
pub(super) const STEP_S: f64 = 0.005;
/// Error of a curve below which it gets no further point: of an amplitude relative to itself, of a frequency relative to the range.
const TOLERANCE: f64 = 0.1;
/// Errors of an amplitude are relative to its mean over this many values before and after.
const NEAR: usize = 8;
/// What is added to an amplitude in relative errors: what is 46 dB below the largest counts little.
const FLOOR: f64 = 0.005;

/// Rounds of factors, after which they are near 1.
const ROUNDS: usize = 10;

/// Time, s, and value.
pub(super) type Point = [f64; 2];

/// The curve of at most `most` points of an amplitude from 0 to 1, whose power is the value to this power.
pub(super) fn amplitude(values: &[f64], power: i32, most: usize) -> Vec<Point> {
    let around = |at: usize| {
        let near = &values[at.saturating_sub(NEAR)..(at + NEAR + 1).min(values.len())];
        1.0 / (FLOOR + near.iter().sum::<f64>() / near.len() as f64)
    };
    let errors: Vec<f64> = (0..values.len()).map(around).collect();
    let curve = fit(values, [&errors, &vec![1.0; values.len()]], power, most);
    curve.into_iter().map(|[time_s, value]| [time_s, value.min(1.0)]).collect()
}

/// The curve of at most `most` points of a frequency from 0 to 1, which counts where the amplitude is large.
pub(super) fn frequency(values: &[f64], amplitudes: &[f64], most: usize) -> Vec<Point> {
    let weights: Vec<f64> = amplitudes.iter().map(|amplitude| amplitude.max(1e-3)).collect();
    // Above zero, for the factors.
    let raised: Vec<f64> = values.iter().map(|value| 1.0 + value).collect();
    let curve = fit(&raised, [&weights, &weights], 1, most);
    curve.into_iter().map(|[time_s, value]| [time_s, (value - 1.0).clamp(0.0, 1.0)]).collect()
}

/// A curve through at least two values. A point is added where the error times its weight is largest, until that is within
/// [`TOLERANCE`]; then the values at all points change by factors until the power around each, in shares, is that of the values.
fn fit(values: &[f64], [errors, shares]: [&[f64]; 2], power: i32, most: usize) -> Vec<Point> {
    let worst = |from: usize, to: usize| {
        let error = |at: usize| {
            let part = (at - from) as f64 / (to - from) as f64;
            errors[at] * (values[from] + part * (values[to] - values[from]) - values[at]).abs()
        };
        // The bits of positive numbers are in their order.
        (from + 1..to).map(|at| (error(at).to_bits(), from, at, to)).max()
    };
    let last = values.len() - 1;
    let mut knots = vec![0, last];
    let mut open: BinaryHeap<_> = worst(0, last).into_iter().collect();
    while let Some((error, from, at, to)) = open.pop()
        && knots.len() < most
        && f64::from_bits(error) > TOLERANCE
    {
        knots.push(at);
        open.extend([worst(from, at), worst(at, to)].into_iter().flatten());
    }
    knots.sort_unstable();
    let mut levels: Vec<f64> = knots.iter().map(|knot| values[*knot].max(f64::EPSILON)).collect();
    for _ in 0..ROUNDS {
        let powers = powers([values, shares], &knots, &levels, power);
        for (level, [wanted, found]) in levels.iter_mut().zip(powers) {
            if found > 0.0 {
                *level *= (wanted / found).powf(1.0 / f64::from(power));
            }
        }
    }
    knots.iter().zip(levels).map(|(knot, level)| [STEP_S * *knot as f64, level]).collect()
}

/// The powers around each knot, of the values and of the curve with these levels.
fn powers([values, shares]: [&[f64]; 2], knots: &[usize], levels: &[f64], power: i32) -> Vec<[f64; 2]> {
    let mut powers = vec![[0.0; 2]; knots.len()];
    for (segment, ends) in knots.windows(2).enumerate() {
        // The first value of a segment is the last one of the segment before.
        for at in ends[0] + usize::from(segment > 0)..=ends[1] {
            let right = (at - ends[0]) as f64 / (ends[1] - ends[0]) as f64;
            let curve = levels[segment] + right * (levels[segment + 1] - levels[segment]);
            for (which, value) in [values[at], curve].into_iter().enumerate() {
                let of = shares[at] * value.powi(power);
                powers[segment][which] += (1.0 - right) * of;
                powers[segment + 1][which] += right * of;
            }
        }
    }
    powers
}

/// The value of a curve at a time: between two points by `shape`, which maps 0 to 1 onto itself, outside them constant.
pub(super) fn at(curve: &[Point], time_s: f64, shape: fn(f64) -> f64) -> f64 {
    let (before, after) = curve.split_at(curve.partition_point(|point| point[0] <= time_s));
    match (before.last(), after.first()) {
        (Some([from_s, from]), Some([to_s, to])) => {
            from + shape((time_s - from_s) / (to_s - from_s)) * (to - from)
        }
        (Some([_, value]), None) | (None, Some([_, value])) => *value,
        (None, None) => 0.0,
    }
}

/// The values of a curve at samples.
pub(super) fn at_samples(curve: &[Point], rate_hz: f64, samples: usize, shape: fn(f64) -> f64) -> Vec<f64> {
    (0..samples).map(|sample| at(curve, sample as f64 / rate_hz, shape)).collect()
}

/// Straight lines between points.
pub(super) fn linear(part: f64) -> f64 {
    part
}

/// A value or time as a file has it, with this part of 1 as its last digit, such as 1000.
pub(super) fn rounded(value: f64, part: f64) -> f64 {
    // Without the sign of zero.
    (value * part).round() / part + 0.0
}
