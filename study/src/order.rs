//! The trials of a participant, drawn from the study's seed and the participant's code alone.

use crate::document::{Arrange, Compare, Factor, Level, Phase, Presented, Study};
use haptograph_engine::document::value::Name;
use haptograph_engine::settings::Named;
use haptograph_signal::noise::stream_seed;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// What is presented: a surface, real or in one of the versions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stimulus {
    /// Number of the surface.
    pub surface: usize,
    /// Number of the version; `None` for the real one.
    pub version: Option<usize>,
}

/// A trial.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trial {
    /// Its number in the participant's plan, from 1.
    pub number: u32,
    /// Number of the phase.
    pub phase: usize,
    /// True before the phase's own trials; it is not analysed.
    pub is_training: bool,
    /// Number of the question.
    pub question: Option<usize>,
    /// Number of the scale.
    pub scale: Option<usize>,
    /// What is presented; in a comparison the real surface or the standard, in ABX what X is.
    pub first: Option<Stimulus>,
    /// What is presented beside it or after it.
    pub second: Option<Stimulus>,
    /// True if the second one is on the left, comes first, or is A.
    pub is_swapped: bool,
    /// The parameter's value in the second one. In a staircase it follows from the answers.
    pub level: Option<f64>,
}

impl Study {
    /// Number of versions; a study without any has one.
    pub(crate) fn version_count(&self) -> usize {
        self.versions.0.len().max(1)
    }

    /// Name of a version.
    pub(crate) fn version_name(&self, version: usize) -> &str {
        self.versions.0.get(version).map_or("virtual", |(name, _)| &name.text)
    }

    /// Number of groups; a study without any has one.
    pub fn group_count(&self) -> usize {
        self.groups.0.len().max(1)
    }

    /// Name of a group; of a study without groups, `all`.
    pub fn group_name(&self, group: usize) -> &str {
        self.groups.0.get(group).map_or("all", |(name, _)| &name.text)
    }

    /// True if a phase belongs to a group.
    pub(crate) fn is_of_group(&self, phase: usize, group: usize) -> bool {
        let groups = self.phases.0[phase].1.facts().groups;
        groups.is_empty() || groups.iter().any(|name| name.text == self.group_name(group))
    }

    /// The numbers of some entries, or of all.
    pub(crate) fn some<T>(names: &[Name], of: &Named<T>) -> Vec<usize> {
        match names.is_empty() {
            true => (0..of.0.len()).collect(),
            false => names.iter().filter_map(|name| of.find(&name.text)).collect(),
        }
    }

    /// Some versions, or all.
    pub(crate) fn some_versions(&self, names: &[Name]) -> Vec<usize> {
        if names.is_empty() { (0..self.version_count()).collect() } else { Self::some(names, &self.versions) }
    }

    /// The version with which a phase compares its others.
    pub fn reference<'s>(&'s self, compare: &'s Compare) -> &'s str {
        let first =
            self.some_versions(&compare.versions).first().map_or("", |version| self.version_name(*version));
        compare.reference.as_ref().map_or(first, |name| &name.text)
    }

    /// The stimuli that are presented of some surfaces, or of all. A surface without a file has no virtual one, one without a
    /// sample no real one.
    pub(crate) fn stimuli(&self, presented: &[Presented], surfaces: &[Name]) -> Vec<Stimulus> {
        let mut all = Vec::new();
        for surface in Self::some(surfaces, &self.surfaces) {
            let of = &self.surfaces.0[surface].1;
            for presented in presented {
                let versions = match presented {
                    Presented::Real => of.sample.iter().map(|_| None).collect(),
                    Presented::Virtual(_) if of.file.is_none() => Vec::new(),
                    Presented::Virtual(version) => {
                        let names: Vec<Name> = version.version.iter().cloned().collect();
                        self.some_versions(&names).into_iter().map(Some).collect::<Vec<_>>()
                    }
                };
                all.extend(versions.into_iter().map(|version| Stimulus { surface, version }));
            }
        }
        all
    }

    /// The trials of a participant of a group. Those of a staircase are as many as there can be.
    pub fn trials(&self, participant: &str, group: usize) -> Vec<Trial> {
        let mut trials = Vec::new();
        for (number, (name, phase)) in self.phases.0.iter().enumerate() {
            if !self.is_of_group(number, group) {
                continue;
            }
            let mut draw = Draw::new(self.seed, participant, &name.text);
            let mut own = self.trials_of(phase, &mut draw);
            let training = draw.some_of(&own, phase.facts().training);
            own.splice(0..0, training.into_iter().map(|trial| Trial { is_training: true, ..trial }));
            trials.extend(own.into_iter().map(|trial| Trial { phase: number, ..trial }));
        }
        for (number, trial) in (1..).zip(&mut trials) {
            trial.number = number;
        }
        trials
    }

    /// The trials of a phase, without training.
    fn trials_of(&self, phase: &Phase, draw: &mut Draw) -> Vec<Trial> {
        let (facts, cells) = (phase.facts(), self.cells(phase).collect::<Vec<_>>());
        match facts.order {
            Some(order) => draw.repeated(facts.repeats, &cells, order),
            None => {
                let blocks = (0..facts.repeats).flat_map(|_| draw.shuffled(cells.clone())).collect();
                let trials = draw.with_sides(blocks);
                if facts.has_x() { draw.with_x(trials, &cells) } else { trials }
            }
        }
    }
}

/// Random orders of one participant in one phase.
struct Draw {
    random: Xoshiro256PlusPlus,
    /// The number in the participant's code, of which Latin squares take their rows.
    number: usize,
}

impl Draw {
    fn new(seed: u64, participant: &str, phase: &str) -> Self {
        let stream = stream_seed(seed, &format!("{participant}/{phase}"));
        let random = Xoshiro256PlusPlus::seed_from_u64(stream);
        let digits = participant.bytes().rev().take(9).take_while(u8::is_ascii_digit).count();
        let number = participant[participant.len() - digits..].parse().unwrap_or(0);
        Self { random, number }
    }

    /// A number below `end`, each equally likely: the part of the range that would favour some is drawn again.
    fn below(&mut self, end: usize) -> usize {
        let end = end.max(1) as u64;
        let fair = u64::MAX - u64::MAX % end;
        loop {
            let drawn = self.random.next_u64();
            if drawn < fair {
                return (drawn % end) as usize;
            }
        }
    }

    /// Fisher and Yates' shuffle, here and not of a library whose next version may draw another order.
    fn shuffled<T>(&mut self, mut values: Vec<T>) -> Vec<T> {
        for last in (1..values.len()).rev() {
            let other = self.below(last + 1);
            values.swap(last, other);
        }
        values
    }

    /// Some of the trials, at random.
    fn some_of(&mut self, trials: &[Trial], count: u32) -> Vec<Trial> {
        let mut some = Vec::new();
        while some.len() < count as usize && !trials.is_empty() {
            let drawn = self.shuffled(trials.to_vec());
            some.extend(drawn.into_iter().take(count as usize - some.len()));
        }
        some
    }

    /// The second stimulus on the left, or before the other, in half of the trials; of an odd one by lot.
    fn with_sides(&mut self, mut trials: Vec<Trial>) -> Vec<Trial> {
        let sides = self.even(trials.len());
        trials.iter_mut().zip(sides).for_each(|(trial, side)| trial.is_swapped = side);
        trials
    }

    /// As often true as false, shuffled; an odd one by lot.
    fn even(&mut self, count: usize) -> Vec<bool> {
        let odd = self.below(2);
        self.shuffled((0..count).map(|at| (at + odd) % 2 == 1).collect())
    }

    /// X is each of a pair in half of its trials; of an odd one by lot. It is the first of a trial.
    fn with_x(&mut self, mut trials: Vec<Trial>, pairs: &[Trial]) -> Vec<Trial> {
        for pair in pairs {
            let is_of_pair = |trial: &&mut Trial| (trial.first, trial.second) == (pair.first, pair.second);
            let own: Vec<&mut Trial> = trials.iter_mut().filter(is_of_pair).collect();
            // Which of the two X is, crossed with the place of the first.
            let cells = [[0, 3, 1, 2], [3, 0, 2, 1]][self.below(2)];
            let from = 2 * self.below(2);
            let cells = self.shuffled((0..own.len()).map(|at| cells[(at + from) % 4]).collect());
            for (trial, cell) in own.into_iter().zip(cells) {
                trial.is_swapped = cell >= 2;
                if cell % 2 == 1 {
                    std::mem::swap(&mut trial.first, &mut trial.second);
                }
            }
        }
        trials
    }

    /// The trials so many times, each time in an order of its own.
    fn repeated(&mut self, repeats: u32, trials: &[Trial], levels: &[Level]) -> Vec<Trial> {
        (0..repeats as usize).flat_map(|time| self.arranged(trials.to_vec(), levels, time)).collect()
    }

    /// The trials in the order of these levels, outermost first; the squares begin at the row of `time`.
    fn arranged(&mut self, trials: Vec<Trial>, levels: &[Level], time: usize) -> Vec<Trial> {
        let mut rows = vec![time; levels.len()];
        // The squares of several levels are crossed: each takes its own digit of the number.
        let (mut digit, mut left) = (Vec::new(), self.number);
        for level in levels {
            let values = distinct(&trials, level.factor).len();
            let rows = if level.arrange == Arrange::Latin { square_rows(values) } else { 1 };
            digit.push(left % rows);
            left /= rows;
        }
        self.nested(trials, levels, &digit, &mut rows)
    }

    fn nested(
        &mut self,
        trials: Vec<Trial>,
        levels: &[Level],
        digits: &[usize],
        used: &mut [usize],
    ) -> Vec<Trial> {
        let (Some((level, inner)), Some((digit, digits)), Some((row, used))) =
            (levels.split_first(), digits.split_first(), used.split_first_mut())
        else {
            return trials;
        };
        let values = distinct(&trials, level.factor);
        let values = match level.arrange {
            Arrange::Fixed => values,
            Arrange::Shuffle => self.shuffled(values),
            Arrange::Latin => {
                // Within another level each time the next row.
                let order = williams(values.len(), digit + *row);
                *row += 1;
                order.into_iter().map(|at| values[at]).collect()
            }
        };
        let mut all = Vec::with_capacity(trials.len());
        for value in values {
            let of_value = trials.iter().filter(|trial| key(trial, level.factor) == value).cloned().collect();
            all.extend(self.nested(of_value, inner, digits, used));
        }
        all
    }
}

/// What distinguishes trials by a factor.
pub(crate) type Key = (Option<usize>, Option<Option<usize>>);

fn key(trial: &Trial, factor: Factor) -> Key {
    let stimulus = trial.second.or(trial.first);
    let (surface, version) = (stimulus.map(|of| of.surface), stimulus.map(|of| of.version));
    match factor {
        Factor::Scale => (trial.scale, None),
        Factor::Surface => (surface, None),
        Factor::Version => (None, version),
        Factor::Stimulus => (surface, version),
    }
}

/// The values of a factor, in the order of the trials.
pub(crate) fn distinct<'t>(trials: impl IntoIterator<Item = &'t Trial>, factor: Factor) -> Vec<Key> {
    let mut values = Vec::new();
    for trial in trials {
        let key = key(trial, factor);
        if !values.contains(&key) {
            values.push(key);
        }
    }
    values
}

/// Number of rows of a Williams square: as many participants, or a multiple, are balanced.
pub(crate) fn square_rows(values: usize) -> usize {
    if values < 2 { 1 } else { values * (1 + values % 2) }
}

/// A row of a Williams square (Williams 1949): over all rows each value follows each other equally often.
fn williams(values: usize, row: usize) -> Vec<usize> {
    let row = row % square_rows(values);
    let zigzag = (0..values).map(|at| if at % 2 == 1 { at.div_ceil(2) } else { (values - at / 2) % values });
    let order = zigzag.map(|at| (at + row) % values);
    if row < values { order.collect() } else { order.rev().collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn each_value_follows_each_other_equally_often() {
        for values in 2..=9 {
            let mut follows = BTreeMap::<(usize, usize), usize>::new();
            let mut places = BTreeMap::<(usize, usize), usize>::new();
            for row in 0..square_rows(values) {
                let order = williams(values, row);
                for pair in order.windows(2) {
                    *follows.entry((pair[0], pair[1])).or_default() += 1;
                }
                for (place, value) in order.into_iter().enumerate() {
                    *places.entry((place, value)).or_default() += 1;
                }
            }
            let times = square_rows(values) / values;
            assert_eq!(follows.len(), values * (values - 1), "{values}");
            assert!(follows.values().all(|count| *count == times), "{values}: {follows:?}");
            assert_eq!(places.len(), values * values, "{values}");
            assert!(places.values().all(|count| *count == times), "{values}");
        }
    }
}
