//! What comes next for a participant: a pure function of the study, the plan and what was answered.

use crate::data::{Row, Status};
use crate::document::{Phase, Staircase, Study};
use crate::order::Trial;

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
    ///
    /// Weighted up and down (Kaernbach 1991): a right answer brings the level nearer to the standard by
    /// (1 - share) / share of the step by which a wrong one takes it away, so that it settles where right answers have that share.
    pub fn next_level(&self, answers: &[bool]) -> Option<f64> {
        let mut level = self.start;
        let (mut reversals, mut last) = (0_usize, None);
        // Away from the standard.
        let away = if self.start >= self.standard { 1.0 } else { -1.0 };
        for &is_right in answers {
            if last.is_some_and(|last| last != is_right) {
                reversals += 1;
            }
            last = Some(is_right);
            let step = self.steps.get(reversals).or(self.steps.last()).copied().unwrap_or(0.0);
            let step = if is_right { -step * (1.0 - self.share) / self.share } else { step };
            let moved = level + away * step;
            // The other side of the standard is another question.
            let nearest = if away > 0.0 { moved.max(self.standard) } else { moved.min(self.standard) };
            level = nearest.clamp(self.limits[0], self.limits[1]);
        }
        let is_over = reversals >= self.reversals as usize || answers.len() >= self.at_most as usize;
        (!is_over).then_some(level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::statistics::mean;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn a_staircase_settles_where_its_share_of_answers_is_right() {
        let staircase = Staircase {
            groups: Vec::new(),
            text: String::new(),
            ask: String::new(),
            surface: "a".into(),
            parameter: "gain".into(),
            standard: 1.0,
            start: 3.0,
            limits: [0.0, 4.0],
            steps: vec![0.4, 0.2, 0.05],
            share: 0.75,
            reversals: 400,
            at_most: 1000,
        };
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
}
