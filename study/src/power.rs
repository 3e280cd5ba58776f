//! The power of a study: how often its analysis finds each effect in whole studies of people who do not exist.

use crate::analyse::Analysis;
use crate::check::{Checked, StudyError};
use crate::people::People;
use crate::statistics::share::Share;
use haptograph_signal::noise::stream_seed;
use haptograph_signal::parallel;
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// How near a threshold comes to that of the people, as a part of it.
const NEAR: [(&str, f64); 2] = [("within 10 %", 0.1), ("within 25 %", 0.25)];
/// An effect counts as found below this p.
const ALPHA: f64 = 0.05;
/// Largest number of answers of all simulated studies together, and of one.
const MOST_ANSWERS: [usize; 2] = [50_000_000, 100_000];

/// An effect, and how often it was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectPower {
    /// The phase.
    pub phase: String,
    /// The scale of ratings; the surface of comparisons.
    pub of: String,
    /// The test.
    pub test: String,
    /// The term of a variance, or two versions.
    pub term: String,
    /// For each number of people.
    pub shares: Vec<Share>,
}

/// The numbers of the phase and the kind of table, by which effects are sorted; then phase, scale or surface, test and term.
type Effect = (usize, u8, [String; 4]);

/// The effects of an analysis, and whether it finds them: by p, of repeated measures Greenhouse and Geisser's, and a threshold if it is
/// near that of the people.
fn effects(study: &Checked, people: &People, analysis: &Analysis) -> Vec<(Effect, bool)> {
    let number = |phase: &str| study.study.phases.find(phase).unwrap_or(0);
    let of =
        |table, names: [&str; 4], found: bool| ((number(names[0]), table, names.map(str::to_owned)), found);
    let variance = analysis.variance.iter().map(|row| {
        let p = row.p_greenhouse_geisser.unwrap_or(row.p);
        of(0, [&row.phase, &row.of, row.test, row.term], p < ALPHA)
    });
    let compared = analysis.comparisons.iter().map(|row| {
        let term = format!("{} to {}", row.from, row.to);
        of(1, [&row.phase, &row.surface, row.test, &term], row.p < ALPHA)
    });
    let chosen = analysis.choices.iter().map(|row| {
        (&row.phase, format!("{} / {}", row.first, row.second), row.p_of_answers, row.p_of_people)
    });
    let found = analysis.abx.iter();
    let found = found.filter_map(|row| Some((&row.phase, row.pair.clone(), row.p, row.p_of_people?)));
    let pairs = chosen.chain(found).flat_map(|(phase, pair, p, p_of_people)| {
        [("sign test of answers", p), ("sign test of people", p_of_people)]
            .map(|(test, p)| of(2, [phase, &pair, test, ""], p < ALPHA))
    });
    let thresholds = analysis.thresholds.iter().filter(|row| row.participant.is_empty());
    let thresholds = thresholds.flat_map(|row| {
        let error = (row.threshold / people.threshold - 1.0).abs();
        NEAR.map(|(term, near)| of(3, [&row.phase, "threshold", "of all people", term], error <= near))
    });
    variance.chain(compared).chain(pairs).chain(thresholds).collect()
}

impl Checked {
    /// Simulates whole studies without motion, `repeat` for each of `sizes` (people in each group), and counts how often the
    /// analysis finds each effect at p < 0.05, and a threshold near that of the people. Where a test cannot be computed, it finds
    /// nothing. The seed of a study follows from this study's and the number of the repetition, so that a larger study begins with the
    /// people of a smaller one.
    ///
    /// # Errors
    /// If nothing is tested, if there are too many answers, or if `stop` is set meanwhile.
    pub fn power(
        &self,
        people: &People,
        (sizes, repeat): (&[Vec<usize>], usize),
        progress: &(dyn Fn(f64) + Sync),
        stop: &AtomicBool,
    ) -> Result<Vec<EffectPower>, StudyError> {
        self.check_size(sizes, repeat)?;
        let counts = Mutex::new(BTreeMap::<Effect, Vec<usize>>::new());
        let studies = (0..repeat * sizes.len()).map(|at| (at / sizes.len(), at % sizes.len()));
        let studies: Vec<(usize, usize)> = studies.collect();
        parallel::try_map(parallel::cores(), studies, progress, |(repetition, size)| {
            if stop.load(Ordering::Relaxed) {
                return Err(StudyError::Run("the simulation was stopped".to_owned()));
            }
            let mut one = self.clone();
            one.study.seed = stream_seed(self.study.seed, &format!("study {repetition}"));
            let answers = one.tested_answers(people, &sizes[size]);
            let analysis = Analysis::of_answers(&one.study, &answers, 0);
            let mut counts = counts.lock().unwrap_or_else(PoisonError::into_inner);
            for (effect, is_found) in effects(self, people, &analysis) {
                let found = counts.entry(effect).or_insert_with(|| vec![0; sizes.len()]);
                found[size] += usize::from(is_found);
            }
            Ok(())
        })?;
        let counts = counts.into_inner().unwrap_or_else(PoisonError::into_inner);
        if counts.is_empty() {
            let message = "no test can be computed of so few people or stimuli: give more";
            return Err(StudyError::Run(message.to_owned()));
        }
        let effect = |((.., names), found): (Effect, Vec<usize>)| {
            let [phase, of, test, term] = names;
            let shares = found.into_iter().map(|found| Share::of(found, repeat)).collect();
            EffectPower { phase, of, test, term, shares }
        };
        Ok(counts.into_iter().map(effect).collect())
    }

    /// Refuses a study without tests, and more answers than can be computed in reasonable time.
    fn check_size(&self, sizes: &[Vec<usize>], repeat: usize) -> Result<(), StudyError> {
        let rated: Vec<usize> =
            (0..self.study.group_count()).map(|group| self.tested("1", group).count()).collect();
        if rated.iter().sum::<usize>() == 0 {
            let message = "no phase of the study has a test whose power could be simulated: add one whose answers are ratings, choices or thresholds";
            return Err(StudyError::Run(message.to_owned()));
        }
        let answers = |(people, rated): (&usize, &usize)| people.saturating_mul(*rated);
        let of_size = sizes.iter().map(|sizes| sizes.iter().zip(&rated).map(answers).sum());
        let of_size: Vec<usize> = of_size.collect();
        let (one, all) = (of_size.iter().max(), of_size.iter().sum::<usize>().saturating_mul(repeat));
        let one = one.copied().unwrap_or_default();
        let most = [
            (one, "a study", MOST_ANSWERS[1], "--people"),
            (all, "all studies", MOST_ANSWERS[0], "--people or --repeat"),
        ];
        let over = most.into_iter().find(|(answers, _, most, _)| answers > most);
        over.map_or(Ok(()), |(answers, what, most, lower)| {
            let message =
                format!("{what} would have {answers} answers; at most {most} are possible: lower {lower}");
            Err(StudyError::Run(message))
        })
    }
}
