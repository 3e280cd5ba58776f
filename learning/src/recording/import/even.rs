//! Converts a logger's times to samples at an even rate.

use super::{Finding, shown};

/// More missing rows than this in a stretch are a gap, which cannot be filled.
const LONGEST_GAP: f64 = 5.0;
/// Times within this part of the interval are even.
const EVEN: f64 = 0.02;
/// The same part before anything is repaired.
const STRICTLY_EVEN: f64 = 0.25;
/// A rate this close to a whole number is rounded to it: for even but rounded times, and for uneven times.
const ROUND_EVEN: f64 = 1e-5;
const ROUND_UNEVEN: f64 = 1e-2;

/// The rate and the spacing of rows.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::recording) struct Timing {
    pub rate_hz: f64,
    pub start_s: f64,
    /// True if the rows have to be resampled.
    pub is_uneven: bool,
    pub finding: Option<Finding>,
}

/// An error in the times: the row and the message.
pub(in crate::recording) type TimeFault = (usize, String);

/// The rate of rows at these times.
pub(in crate::recording) fn timing(times: &[f64], strict: bool) -> Result<Timing, TimeFault> {
    let (Some(&start_s), Some(&last)) = (times.first(), times.last()) else {
        return Err((0, "there are no times".to_owned()));
    };
    let rate = (times.len() - 1) as f64 / (last - start_s);
    if !(rate.is_finite() && rate > 0.0) {
        let message = match times.len() {
            1 => "there is one row only; a recording needs at least two".to_owned(),
            rows => format!(
                "the time has to rise, but is {} s in the first of {rows} rows and {} s in the last",
                shown(start_s),
                shown(last)
            ),
        };
        return Err((times.len() - 1, message));
    }
    let resolution_s = resolution(times);
    let rate_hz = rounded(rate, ROUND_EVEN.max(resolution_s / (last - start_s)));
    let expected = |i: usize| start_s + i as f64 / rate_hz;
    let tolerance = match strict {
        true => STRICTLY_EVEN / rate_hz,
        false => (EVEN / rate_hz).max(0.6 * resolution_s),
    };
    let Some(first_off) = (0..times.len()).find(|&i| (times[i] - expected(i)).abs() > tolerance) else {
        return Ok(Timing {
            rate_hz,
            start_s,
            is_uneven: false,
            finding: (resolution_s > 1.0 / rate_hz).then_some(Finding::CoarseTimes { resolution_s, rate_hz }),
        });
    };
    if strict {
        let message = format!(
            "time jumps: {} s where {} s is expected at an even rate of {} Hz; cut the file here, or leave out --strict",
            shown(times[first_off]),
            shown(expected(first_off)),
            shown(rate_hz)
        );
        return Err((first_off, message));
    }
    if let Some(row) = (1..times.len()).find(|&i| times[i] < times[i - 1]) {
        let message = format!("time goes back, from {} s to {} s", shown(times[row - 1]), shown(times[row]));
        return Err((row, message));
    }
    if times.windows(2).any(|pair| pair[0] == pair[1]) {
        return coarse(times, rate_hz);
    }
    uneven(times)
}

/// Several rows share a time: the clock was read too coarsely.
fn coarse(times: &[f64], rate_hz: f64) -> Result<Timing, TimeFault> {
    let steps = times.windows(2).map(|pair| pair[1] - pair[0]);
    let resolution_s = steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
    for (row, time) in times.iter().enumerate() {
        let expected = times[0] + row as f64 / rate_hz;
        if (time - expected).abs() > 2.0 * resolution_s {
            let message = format!(
                "time jumps: {} s where {} s is expected at {} Hz; cut the file here",
                shown(*time),
                shown(expected),
                shown(rate_hz)
            );
            return Err((row, message));
        }
    }
    Ok(Timing {
        rate_hz,
        start_s: times[0],
        is_uneven: false,
        finding: Some(Finding::CoarseTimes { resolution_s, rate_hz }),
    })
}

fn uneven(times: &[f64]) -> Result<Timing, TimeFault> {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = steps.len() / 2;
    let usual = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let mut missing_rows = 0;
    for (row, pair) in times.windows(2).enumerate() {
        let step = pair[1] - pair[0];
        if step > (LONGEST_GAP + 0.5) * usual {
            let message = format!(
                "there is a gap of {} s, from {} s to {} s, where rows are {} s apart; split the file into two here",
                shown(step),
                shown(pair[0]),
                shown(pair[1]),
                shown(usual)
            );
            return Err((row + 1, message));
        }
        missing_rows += missing_after(times, row, usual);
    }
    let span_s = times[times.len() - 1] - times[0];
    let rate_hz = rounded((times.len() - 1 + missing_rows) as f64 / span_s, ROUND_UNEVEN);
    let interval_s = 1.0 / rate_hz;
    let single = times.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step < 1.5 * usual);
    let (square, count) = single
        .fold((0.0, 0.0), |(square, count), step| (square + (step - interval_s).powi(2), count + 1.0_f64));
    let finding =
        Finding::Jitter { rms_s: (square / count.max(1.0)).sqrt(), interval_s, rate_hz, missing_rows };
    Ok(Timing { rate_hz, start_s: times[0], is_uneven: true, finding: Some(finding) })
}

/// Rows that are missing between `row` and the next: a late row alone makes one step longer, but not three together.
fn missing_after(times: &[f64], row: usize, usual: f64) -> usize {
    let missing = |from: usize, to: usize| {
        let steps = ((times[to] - times[from]) / usual).round() as usize;
        steps.saturating_sub(to - from)
    };
    let around = missing(row.saturating_sub(1), (row + 2).min(times.len() - 1));
    missing(row, row + 1).min(around)
}

fn rounded(rate_hz: f64, within: f64) -> f64 {
    let round = rate_hz.round();
    match round > 0.0 && (rate_hz / round - 1.0).abs() < within {
        true => round,
        false => rate_hz,
    }
}

/// The resolution of the times as written, s.
fn resolution(times: &[f64]) -> f64 {
    let mut decimals = (0..9).map(|digits| 10_f64.powi(-digits));
    let is_multiple = |unit: f64| {
        let mut some = times.iter().take(1000);
        some.all(|time| (time / unit - (time / unit).round()).abs() < 1e-3)
    };
    decimals.find(|unit| is_multiple(*unit)).unwrap_or(0.0)
}

/// Values at the moments of `timing`, up to the last time: by the cubic through the four nearest rows, or the line through two.
pub(in crate::recording) fn resampled(
    times: &[f64],
    values: &[f64],
    timing: &Timing,
    cubic: bool,
) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
        return vec![];
    };
    let count = ((last - first) * timing.rate_hz + 1e-6) as usize + 1;
    let mut row = 0;
    (0..count)
        .map(|i| {
            let time = first + i as f64 / timing.rate_hz;
            while row + 2 < times.len() && times[row + 1] <= time {
                row += 1;
            }
            let from = if cubic { row.saturating_sub(1) } else { row };
            let to = (row + if cubic { 3 } else { 2 }).min(times.len());
            lagrange(&times[from..to], &values[from..to], time)
        })
        .collect()
}

/// The polynomial through all points.
fn lagrange(times: &[f64], values: &[f64], time: f64) -> f64 {
    let weight = |i: usize| -> f64 {
        let others = (0..times.len()).filter(|&j| j != i);
        others.map(|j| (time - times[j]) / (times[i] - times[j])).product()
    };
    values.iter().enumerate().map(|(i, value)| weight(i) * value).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;

    fn jittered(rows: usize, rate_hz: f64, part: f64) -> Vec<f64> {
        let mut noise = Gaussian::new(3);
        (0..rows).map(|i| (i as f64 + part * noise.next_sample().clamp(-3.0, 3.0)) / rate_hz).collect()
    }

    #[test]
    fn jittered_times_are_resampled_to_what_was_there() {
        let mut times = jittered(4000, 1000.0, 0.1);
        // One late row is no missing one.
        times[2000] += 0.45e-3;
        let signal = |time: f64| (std::f64::consts::TAU * 50.0 * time).sin();
        let values: Vec<f64> = times.iter().map(|time| signal(*time)).collect();
        let found = timing(&times, false).expect("no gap");
        assert_eq!((found.rate_hz, found.is_uneven), (1000.0, true));
        let Some(Finding::Jitter { rms_s, missing_rows, .. }) = found.finding else { panic!("{found:?}") };
        // The difference of two independent offsets.
        assert!((rms_s - 0.1e-3 * 2_f64.sqrt()).abs() < 0.01e-3, "{rms_s}");
        assert_eq!(missing_rows, 0);
        let even = resampled(&times, &values, &found, true);
        let off = even.iter().enumerate().map(|(i, x)| (x - signal(times[0] + i as f64 / 1000.0)).abs());
        assert!(off.fold(0.0, f64::max) < 5e-3);
    }

    #[test]
    fn missing_rows_are_counted_and_gaps_refused_where_they_are() {
        let mut times: Vec<f64> = (0..1000).map(|i| f64::from(i) / 1000.0).collect();
        times.drain(500..502);
        let found = timing(&times, false).expect("two rows are no gap");
        assert!(matches!(found.finding, Some(Finding::Jitter { missing_rows: 2, .. })), "{found:?}");
        times.drain(700..720);
        assert_eq!(timing(&times, false).expect_err("a gap").0, 700);
        times.swap(100, 101);
        assert_eq!(timing(&times, false).expect_err("time goes back").0, 101);
        assert!(timing(&times, true).is_err());
    }

    #[test]
    fn rounded_and_coarse_times_are_even() {
        let rounded: Vec<f64> = (0..3000).map(|i| (f64::from(i) / 3.0).round() / 1000.0).collect();
        let coarse = timing(&rounded, false).expect("coarse");
        assert!(
            matches!(coarse.finding, Some(Finding::CoarseTimes { .. })) && !coarse.is_uneven,
            "{coarse:?}"
        );
        assert!((coarse.rate_hz - 3000.0).abs() < 2.0);
        let written: Vec<f64> = (0..3000).map(|i| (f64::from(i) / 0.3).round() / 10_000.0).collect();
        let even = timing(&written, false).expect("even");
        assert_eq!((even.finding.clone(), even.is_uneven), (None, false), "{even:?}");
    }
}
