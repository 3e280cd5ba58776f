//! Answers of a session: what a trial asks for, and what is kept of it.

use super::{
    Answer, Conduct, Conductor, Current, LONGEST, Row, Seat, State, Status, Step, Stepped, attempted,
};
use crate::document::{Phase, Question};
use crate::order::Trial;
use crate::phase::Asks;
use std::collections::BTreeSet;

impl Conductor {
    /// Keeps an answer; when this returns without an error, it is on disk.
    pub(super) fn answer(&mut self, answer: &Answer, now_s: f64) -> Stepped {
        let Some(current) = self.felt() else { return Ok(Step::None) };
        // A second press of the button belongs to the trial that it saw.
        if answer.trial != current.trial.number {
            return Ok(Step::None);
        }
        let opened_s = current.opened_s.ok_or("the conditions are not reached yet")?;
        if self.is_record(&current.trial) {
            return Err("a take ends by itself".to_owned());
        }
        let mut row = self.checked.row(&current.trial);
        self.fill(&current.trial, answer, &mut row)?;
        row.status = if current.is_forced { Status::Forced } else { Status::Answered };
        row.exploration_s = to_ms(current.explored_s(now_s));
        row.response_s = to_ms((now_s - opened_s).max(0.0));
        let feedback = row.is_right.filter(|_| row.training);
        let kept = self.keep(row);
        if let Some(seat) = &mut self.seat {
            seat.feedback = feedback;
        }
        kept
    }

    fn is_record(&self, trial: &Trial) -> bool {
        matches!(self.checked.study.phases.0[trial.phase].1, Phase::Record(_))
    }

    pub(super) fn open_answer(&mut self, now_s: f64) -> Stepped {
        if self.felt().is_some_and(|current| self.is_record(&current.trial)) {
            return Err("a take ends by itself; pause it, or skip the trial".to_owned());
        }
        if let Some(current) = self.felt_mut().filter(|current| current.opened_s.is_none()) {
            (current.opened_s, current.is_forced) = (Some(now_s), true);
        }
        Ok(Step::None)
    }

    pub(super) fn skip(&mut self, now_s: f64) -> Stepped {
        let current = match self.seat.as_ref().map(|seat| &seat.state) {
            Some(State::Preparing(current) | State::Prepared(current) | State::Felt(current)) => current,
            _ => return Ok(Step::None),
        };
        let mut row = self.checked.row(&current.trial);
        (row.status, row.exploration_s) = (Status::Skipped, to_ms(current.explored_s(now_s)));
        self.keep(row)
    }

    pub(super) fn repeat(&mut self) -> Stepped {
        let seat = self.seat.as_mut().ok_or("no participant is there")?;
        let last = seat.claim.as_ref().and_then(|claim| claim.rows().last());
        seat.again = Some(last.ok_or("no trial was answered yet")?.trial);
        self.advance(Some("the trial before again"))
    }

    /// Keeps a take beside the others, named as `evaluate` reads them, and goes on.
    pub(super) fn keep_recording(&mut self) -> Stepped {
        let Some(Seat { code, claim: Some(claim), state: State::Felt(current), .. }) = &self.seat else {
            return Ok(Step::None);
        };
        let mut row = self.checked.row(&current.trial);
        let takes = claim.rows().iter().filter(|before| {
            before.phase == row.phase && before.first_surface == row.first_surface && before.trial < row.trial
        });
        let attempt = claim.rows().iter().filter(|before| before.trial == row.trial).count() + 1;
        let run = format!("{:03}-{attempt}-", row.trial);
        let numbers: BTreeSet<u32> = takes.map(|before| before.trial).collect();
        let take = (&*row.first_surface, numbers.len() + 1);
        row.exploration_s = to_ms(current.explored_s(0.0));
        if let Err(why) = self.folder.keep_take(code, &run, take) {
            self.interrupt("there is no recording", 0.0);
            return Err(why.to_string());
        }
        self.keep(row)
    }

    fn keep(&mut self, row: Row) -> Stepped {
        let Some(seat) = &mut self.seat else { return Ok(Step::None) };
        let (Some(claim), State::Preparing(current) | State::Prepared(current) | State::Felt(current)) =
            (&mut seat.claim, &seat.state)
        else {
            return Ok(Step::None);
        };
        claim.keep(row, &current.measures()).map_err(|error| error.to_string())?;
        if let Some(known) = self.known.iter_mut().find(|known| known.code == seat.code) {
            known.done = attempted(claim.rows());
        }
        self.advance(None)
    }

    /// Fills in what the trial asks for.
    fn fill(&self, trial: &Trial, answer: &Answer, row: &mut Row) -> Result<(), String> {
        let rating = |from: f64, to: f64| {
            let within = answer.rating.filter(|rating| (from..=to).contains(rating));
            within.ok_or_else(|| format!("the answer is not between {from} and {to}"))
        };
        let words = |is_optional: bool| {
            let text = answer.text.clone().unwrap_or_default();
            match (text.trim().is_empty() && !is_optional, text.len() > LONGEST) {
                (true, _) => Err("the answer is empty".to_owned()),
                (_, true) => Err(format!("the answer has more than {LONGEST} bytes")),
                _ => Ok(text),
            }
        };
        let is_second = || {
            let place = answer.choice.filter(|place| *place < 2).ok_or("none of the two is chosen")?;
            Ok::<_, String>((place == 1) != trial.is_swapped)
        };
        let facts = self.checked.study.phases.0[trial.phase].1.facts();
        match facts.asks {
            Asks::Nothing | Asks::Take => {}
            Asks::Words(_) => row.text = words(false)?,
            Asks::Line => row.rating = Some(rating(0.0, 1.0)?),
            Asks::Which(_) | Asks::WhichIsX(_) => {
                let is_second = is_second()?;
                let chosen = if is_second { trial.second } else { trial.first };
                row.choice = chosen.map_or_else(String::new, |of| self.checked.name(of));
                row.is_right = facts.has_x().then_some(!is_second);
            }
            Asks::More(_) => {
                let is_second = is_second()?;
                row.choice = if is_second { "comparison" } else { "standard" }.to_owned();
                let standard = facts.standard();
                let level = trial.level.unwrap_or(standard);
                row.is_right = (level != standard).then_some(is_second == (level > standard));
            }
            Asks::Question(of) => match trial.question.and_then(|at| of.0.get(at)) {
                Some((_, Question::Number(of))) => row.rating = Some(rating(of.from, of.to)?),
                Some((_, Question::Choice(of))) => {
                    let chosen = answer.choice.and_then(|at| of.of.get(at));
                    row.choice = chosen.ok_or("no answer is chosen")?.clone();
                }
                Some((_, Question::Text(of))) => row.text = words(of.optional)?,
                None => {}
            },
        }
        Ok(())
    }
}

/// A time in s, to the millisecond.
fn to_ms(time_s: f64) -> f64 {
    (time_s * 1e3).round() / 1e3
}

impl Current {
    /// The numbers that are kept of it.
    fn measures(&self) -> Vec<(String, f64, String)> {
        let mut names = ["first: ", "second: ", "X: "];
        if self.trial.is_swapped {
            names.swap(0, 1);
        }
        let has_turns = self.has_turns();
        let mut all = Vec::new();
        for (place, tally) in self.tallies.iter().enumerate() {
            let tally = tally.iter().filter(|_| self.is_virtual(place) && self.felt[place]);
            all.extend(tally.flat_map(|tally| tally.measures(if has_turns { names[place] } else { "" })));
        }
        all
    }
}
