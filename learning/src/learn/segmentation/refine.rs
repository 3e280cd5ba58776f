//! From breaks on a grid to breaks at single samples: moves, merges and replacements of neighbouring breaks, each taken only if it lowers the
//! objective, until none does.

use super::objective::Objective;
use super::variance::Estimator;
use std::collections::HashSet;

/// Breaks that no single move within `reach` samples, no removal and no replacement of two close neighbours by one improves.
pub(super) fn refined<E: Estimator>(
    objective: &mut Objective<'_, E>,
    mut breaks: Vec<usize>,
    reach: usize,
) -> Vec<usize> {
    // Breaks that stay where they are between the same neighbours; shifting costs most.
    let mut settled = HashSet::new();
    loop {
        let mut improved = false;
        let mut i = 0;
        while i < breaks.len() {
            let (before, after) = neighbours(objective, &breaks, i);
            let place = (before, breaks[i], after);
            if !settled.contains(&place) {
                match shift(objective, &mut breaks, i, reach) {
                    true => improved = true,
                    false => _ = settled.insert(place),
                }
            }
            if merge(objective, &mut breaks, i) || replace_pair(objective, &mut breaks, i, reach) {
                improved = true;
            } else {
                i += 1;
            }
        }
        if !improved {
            return breaks;
        }
    }
}

/// The end of the segment before break `i` and of the one after it.
fn neighbours<E: Estimator>(objective: &Objective<'_, E>, breaks: &[usize], i: usize) -> (usize, usize) {
    let before = if i == 0 { 0 } else { breaks[i - 1] };
    (before, breaks.get(i + 1).copied().unwrap_or(objective.samples()))
}

/// Gains below this are rounding.
fn worthwhile(gain: f64, cost: f64) -> bool {
    gain > 1e-10 * (1.0 + cost.abs())
}

/// The best single break in `least..=most` between `before` and `after`, and the cost of the two segments.
fn best_break<E: Estimator>(
    objective: &mut Objective<'_, E>,
    (before, after): (usize, usize),
    (least, most): (usize, usize),
) -> Option<(usize, f64)> {
    let least = least.max(before + objective.min_span);
    let most = most.min(after.checked_sub(objective.min_span)?);
    let candidates: Vec<usize> = (least..=most).collect();
    let lefts = objective.rated(&candidates.iter().map(|&b| (before, b)).collect::<Vec<_>>());
    let rights = objective.rated(&candidates.iter().map(|&b| (b, after)).collect::<Vec<_>>());
    let costs = lefts.iter().zip(&rights).map(|(l, r)| l.cost + r.cost);
    candidates.into_iter().zip(costs).min_by(|a, b| a.1.total_cmp(&b.1))
}

fn shift<E: Estimator>(
    objective: &mut Objective<'_, E>,
    breaks: &mut [usize],
    i: usize,
    reach: usize,
) -> bool {
    let (before, after) = neighbours(objective, breaks, i);
    let now = breaks[i];
    let current: f64 = objective.rated(&[(before, now), (now, after)]).iter().map(|r| r.cost).sum();
    let window = (now.saturating_sub(reach), now + reach);
    match best_break(objective, (before, after), window) {
        Some((best, cost)) if worthwhile(current - cost, current) => {
            breaks[i] = best;
            true
        }
        _ => false,
    }
}

fn merge<E: Estimator>(objective: &mut Objective<'_, E>, breaks: &mut Vec<usize>, i: usize) -> bool {
    let (before, after) = neighbours(objective, breaks, i);
    let rated = objective.rated(&[(before, breaks[i]), (breaks[i], after), (before, after)]);
    let current = rated[0].cost + rated[1].cost + Objective::<E>::break_penalty(breaks.len());
    let merged = rated[2].cost + Objective::<E>::break_penalty(breaks.len() - 1);
    let take = worthwhile(current - merged, current);
    if take {
        breaks.remove(i);
    }
    take
}

/// Breaks `i` and `i+1` become one. On a grid a sharp change between two points is fenced in by both of them.
fn replace_pair<E: Estimator>(
    objective: &mut Objective<'_, E>,
    breaks: &mut Vec<usize>,
    i: usize,
    reach: usize,
) -> bool {
    let Some(&next) = breaks.get(i + 1) else {
        return false;
    };
    let this = breaks[i];
    if next - this > 4 * reach.max(objective.min_span) {
        return false;
    }
    let (before, _) = neighbours(objective, breaks, i);
    let (_, after) = neighbours(objective, breaks, i + 1);
    let current =
        objective.rated(&[(before, this), (this, next), (next, after)]).iter().map(|r| r.cost).sum::<f64>()
            + Objective::<E>::break_penalty(breaks.len());
    match best_break(objective, (before, after), (this, next)) {
        Some((best, cost))
            if worthwhile(current - cost - Objective::<E>::break_penalty(breaks.len() - 1), current) =>
        {
            breaks[i] = best;
            breaks.remove(i + 1);
            true
        }
        _ => false,
    }
}
