//! What comes next for a participant: a pure function of the study, the plan and what was answered.

use crate::data::{Row, Status};
use crate::document::{Method, Phase, Staircase, Study, UpDown};
use crate::order::Trial;
use crate::statistics::psychometric::Shape;

/// Number of distances from the standard that QUEST+ chooses from, and the ratio of the largest to the smallest.
const GRID: usize = 24;
const WIDEST: f64 = 50.0;
/// The slopes of Weibull functions, and the share of lapses, that it takes for possible.
const SLOPES: [f64; 3] = [1.5, 3.0, 5.0];
const LAPSE: f64 = 0.02;

/// The next trial: the first without an attempt. In a staircase its level follows from the answers before; the trials that a
/// finished staircase does not need are passed over.
pub fn next(study: &Study, trials: &[Trial], rows: &[Row]) -> Option<Trial> {
    let is_done = |trial: &Trial| rows.iter().any(|row| row.trial == trial.number);
    trials.iter().filter(|trial| !is_done(trial)).find_map(|trial| {
        let (name, phase) = &study.phases.0[trial.phase];
        let Phase::Staircase(staircase) = phase else {
            return Some(trial.clone());
        };
        // Of several attempts the last one counts.
        let is_last = |at: usize, row: &Row| !rows[at + 1..].iter().any(|later| later.trial == row.trial);
        let last = rows.iter().enumerate().filter(|(at, row)| is_last(*at, row)).map(|(_, row)| row);
        let answers = last.filter(|row| row.phase == name.text && row.status != Status::Skipped);
        let answers: Vec<bool> = answers.filter_map(|row| row.is_right).collect();
        let level = Some(staircase.next_level(&answers)?);
        Some(Trial { level, ..trial.clone() })
    })
}

impl Staircase {
    /// The level after these answers, true for right ones; `None` when the staircase has ended.
    pub fn next_level(&self, answers: &[bool]) -> Option<f64> {
        match &self.method {
            _ if answers.len() >= self.at_most as usize => None,
            Method::UpDown(steps) => self.stepped(steps, answers),
            Method::QuestPlus => Some(self.most_telling(answers)),
        }
    }

    /// QUEST+ (Watson 2017): the distance from the standard for which the entropy over threshold and slope is expected to be least after
    /// the answer. Distances and thresholds are on one grid, equal in ratio; at first all are as likely.
    fn most_telling(&self, answers: &[bool]) -> f64 {
        let side = |limit: f64| limit - self.standard;
        let [low, high] = self.limits.map(side);
        let farthest = if high.abs() >= low.abs() { high } else { low };
        let grid: Vec<f64> = (0..GRID).map(|n| WIDEST.powf(n as f64 / (GRID - 1) as f64 - 1.0)).collect();
        let functions: Vec<(f64, f64)> =
            grid.iter().flat_map(|threshold| SLOPES.map(|slope| (*threshold, slope))).collect();
        let right: Vec<Vec<f64>> = grid
            .iter()
            .map(|at| {
                let rises =
                    functions.iter().map(|(threshold, slope)| Shape::Weibull.at(*at, *threshold, *slope));
                rises.map(|rise| 0.5 + (0.5 - LAPSE) * rise).collect()
            })
            .collect();
        let mut likely = vec![1.0 / functions.len() as f64; functions.len()];
        let mut best = Self::best(&right, &likely);
        for is_right in answers {
            likely = after(&right[best], &likely, *is_right).0;
            best = Self::best(&right, &likely);
        }
        self.standard + farthest * grid[best]
    }

    fn best(right: &[Vec<f64>], likely: &[f64]) -> usize {
        let expected = right.iter().map(|right| {
            let outcomes = [true, false].map(|answer| after(right, likely, answer));
            let entropy =
                |likely: &[f64]| -> f64 { likely.iter().filter(|p| **p > 0.0).map(|p| -p * p.ln()).sum() };
            outcomes.iter().map(|(likely, share)| share * entropy(likely)).sum::<f64>()
        });
        let least = expected.enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b));
        least.map_or(0, |(at, _)| at)
    }

    /// Weighted up and down (Kaernbach 1991): a right answer brings the level nearer to the standard by
    /// (1 - share) / share of the step by which a wrong one takes it away, so that it settles where right answers have that share.
    fn stepped(&self, of: &UpDown, answers: &[bool]) -> Option<f64> {
        let mut level = of.start;
        let (mut reversals, mut last) = (0_usize, None);
        // Away from the standard.
        let away = if of.start >= self.standard { 1.0 } else { -1.0 };
        for &is_right in answers {
            if last.is_some_and(|last| last != is_right) {
                reversals += 1;
            }
            last = Some(is_right);
            let step = of.steps.get(reversals).or(of.steps.last()).copied().unwrap_or(0.0);
            let step = if is_right { -step * (1.0 - of.share) / of.share } else { step };
            let moved = level + away * step;
            // The other side of the standard is another question.
            let nearest = if away > 0.0 { moved.max(self.standard) } else { moved.min(self.standard) };
            level = nearest.clamp(self.limits[0], self.limits[1]);
        }
        (reversals < of.reversals as usize).then_some(level)
    }
}

/// How likely each function is after an answer, and the share of that answer.
fn after(right: &[f64], likely: &[f64], is_right: bool) -> (Vec<f64>, f64) {
    let joint = right.iter().zip(likely).map(
        |(right, likely)| {
            if is_right { right * likely } else { (1.0 - right) * likely }
        },
    );
    let joint: Vec<f64> = joint.collect();
    let share: f64 = joint.iter().sum();
    (joint.into_iter().map(|one| one / share).collect(), share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::psychometric::{Block, FitSettings, fit};
    use haptograph_signal::statistics::mean;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    fn staircase(method: Method, at_most: u32) -> Staircase {
        Staircase {
            groups: Vec::new(),
            text: String::new(),
            ask: String::new(),
            surface: "a".into(),
            parameter: "gain".into(),
            standard: 1.0,
            limits: [0.0, 4.0],
            method,
            at_most,
        }
    }

    fn up_down(steps: &[f64], reversals: u32) -> Method {
        Method::UpDown(UpDown { start: 3.0, steps: steps.to_vec(), share: 0.75, reversals })
    }

    #[test]
    fn a_staircase_settles_where_its_share_of_answers_is_right() {
        let staircase = staircase(up_down(&[0.4, 0.2, 0.05], 400), 1000);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
        let (mut answers, mut levels) = (Vec::new(), Vec::new());
        while let Some(level) = staircase.next_level(&answers) {
            // Right in 75 % where the level is 1.5: 0.5 + 0.5 (1 - 2^-(d / 0.5)).
            let is_right = random.random::<f64>() < 1.0 - 0.5 * 0.5_f64.powf((level - 1.0) / 0.5);
            answers.push(is_right);
            levels.push(level);
        }
        assert!(levels.len() > 400, "{}", levels.len());
        // From where it began it comes down by 1/60 a trial.
        let settled = mean(&levels[levels.len() / 2..]);
        assert!((settled - 1.5).abs() < 0.1, "{settled}");
    }

    #[test]
    fn quest_plus_finds_a_threshold_with_fewer_trials_than_up_and_down() {
        // The median error of the fitted threshold over people whose own is 0.2 to 0.8.
        let error = |method: &dyn Fn() -> Method| {
            let errors = (0..60_u32).filter_map(|person| {
                let mut random = Xoshiro256PlusPlus::seed_from_u64(u64::from(person));
                let threshold = 0.2 + 0.01 * f64::from(person);
                let (staircase, mut answers) = (staircase(method(), 40), Vec::new());
                let mut blocks: Vec<Block> = Vec::new();
                while let Some(level) = staircase.next_level(&answers) {
                    let distance = level - 1.0;
                    let rise = Shape::Weibull.at(distance, threshold, 2.0);
                    let is_right = random.random::<f64>() < 0.5 + 0.49 * rise;
                    answers.push(is_right);
                    blocks.push(Block { level: distance, trials: 1, positive: u32::from(is_right) });
                }
                let settings =
                    FitSettings { guess: 0.5, shape: Shape::Weibull, resamples: 0, ..FitSettings::default() };
                let found = fit(&blocks, &settings).ok()?;
                Some((found.threshold.value / threshold).ln().abs())
            });
            let errors: Vec<f64> = errors.collect();
            assert!(errors.len() > 50);
            haptograph_signal::statistics::median(&errors)
        };
        let (quest, stepped) = (error(&|| Method::QuestPlus), error(&|| up_down(&[0.4, 0.2, 0.1], 1000)));
        assert!(quest < 0.8 * stepped && quest < 0.25, "{quest} {stepped}");
    }
}
