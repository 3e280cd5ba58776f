//! Repairs single cells that are missing or wrong.

use std::ops::Range;

/// Replaces numbers that are not finite by the line between their neighbours (at the ends by the nearest), where at most `longest`
/// follow one another; returns how many.
///
/// # Errors
/// The first longer stretch.
pub(in crate::recording) fn interpolate_missing(
    values: &mut [f64],
    longest: usize,
) -> Result<usize, Range<usize>> {
    let (mut index, mut count) = (0, 0);
    while let Some(start) = (index..values.len()).find(|&i| !values[i].is_finite()) {
        let end = (start..values.len()).find(|&i| values[i].is_finite()).unwrap_or(values.len());
        if end - start > longest || end - start == values.len() {
            return Err(start..end);
        }
        let after = values.get(end).copied();
        let before = start.checked_sub(1).map(|before| values[before]);
        let (from, to) = (before.or(after).unwrap_or(0.0), after.or(before).unwrap_or(0.0));
        let steps = (end - start + 1) as f64;
        for (step, value) in values[start..end].iter_mut().enumerate() {
            *value = from + (to - from) * (step + 1) as f64 / steps;
        }
        count += end - start;
        index = end;
    }
    Ok(count)
}

/// A sample is an outlier if it exceeds what all but one in a thousand reach by this factor, ...
const BEYOND: f64 = 10.0;
/// ... and its neighbours are nearer to one another than this part of its distance from them. No vibration below half the rate does so.
const AGREEMENT: f64 = 0.1;
/// Number of samples from which the usual level is estimated.
const SAMPLED: usize = 100_000;

/// Replaces single samples that are far from both neighbours by the neighbours' mean; returns their indices.
pub(in crate::recording) fn remove_outliers(values: &mut [f64]) -> Vec<usize> {
    if values.len() < 20 {
        return vec![];
    }
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let step = values.len().div_ceil(SAMPLED);
    let mut usual: Vec<f64> = values.iter().step_by(step).map(|x| (x - mean).abs()).collect();
    let rank = usual.len() - 2 - usual.len() / 1000;
    let (_, usual, _) = usual.select_nth_unstable_by(rank, f64::total_cmp);
    // If a quantity never changes, every difference would be an outlier.
    let bound = BEYOND * *usual;
    let mut found = vec![];
    for index in 1..values.len() - 1 {
        let (before, here, after) = (values[index - 1], values[index], values[index + 1]);
        let middle = 0.5 * (before + after);
        let off = (here - middle).abs();
        if off > bound && bound > 0.0 && (before - after).abs() < AGREEMENT * off {
            values[index] = middle;
            found.push(index);
        }
    }
    found
}

/// At least this many samples at an extreme value mean clipping.
const CLIPPED: usize = 10;

/// Samples that are, with a neighbour, at the largest or smallest value; none if they are few.
pub(crate) fn clipped(values: &[f64]) -> Vec<usize> {
    let finite = || values.iter().copied().filter(|x| x.is_finite());
    let (least, most) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    if least >= most {
        return vec![];
    }
    let is_extreme = |x: f64| x == least || x == most;
    let stays = |i: usize| {
        let here = values[i];
        let is_like = |other: Option<&f64>| other.is_some_and(|other| *other == here);
        is_extreme(here) && (is_like(values.get(i + 1)) || i > 0 && is_like(values.get(i - 1)))
    };
    let found: Vec<usize> = (0..values.len()).filter(|&i| stays(i)).collect();
    if found.len() < CLIPPED { vec![] } else { found }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_lies_on_the_line_between_its_neighbours() {
        let (none, bad) = (f64::NAN, f64::INFINITY);
        let mut values = [none, 1.0, bad, none, 4.0, none];
        assert_eq!(interpolate_missing(&mut values, 2), Ok(4));
        assert_eq!(values, [1.0, 1.0, 2.0, 3.0, 4.0, 4.0]);
        assert_eq!(interpolate_missing(&mut [1.0, none, none, none, 2.0], 2), Err(1..4));
        assert_eq!(interpolate_missing(&mut [none], 2), Err(0..1));
    }

    #[test]
    fn samples_that_stay_at_an_extreme_are_counted() {
        let wave = |i: i32| (f64::from(i) * 0.1).sin();
        let whole: Vec<f64> = (0..2000).map(wave).collect();
        assert!(clipped(&whole).is_empty());
        let cut: Vec<f64> = whole.iter().map(|x| x.clamp(-0.9, 0.9)).collect();
        let beyond = whole.iter().filter(|x| x.abs() >= 0.9).count();
        assert_eq!(clipped(&cut).len(), beyond);
        assert!(clipped(&[1.0; 100]).is_empty(), "a constant is not clipped");
    }

    #[test]
    fn a_spike_of_one_sample_is_replaced_and_vibration_is_not() {
        let clean: Vec<f64> = (0..5000).map(|i| (f64::from(i) * 0.7).sin()).collect();
        let mut values = clean.clone();
        values[700] = 500.0;
        values[4000] = -300.0;
        assert_eq!(remove_outliers(&mut values), [700, 4000]);
        assert!(values[700].abs() < 1.0 && values[4000].abs() < 1.0);
        let mut knock = clean.clone();
        // A knock rings: neighbours are as far off.
        for (i, x) in knock[2000..2050].iter_mut().enumerate() {
            *x += 100.0 * (-(i as f64) / 10.0).exp() * (i as f64 * 0.5).cos();
        }
        assert_eq!(remove_outliers(&mut knock), [] as [usize; 0]);
    }
}
