//! People who do not exist: answers of known parameters, with motion by the graph's simulated hands, so that the conditions of a
//! trial and its numbers are real.

use crate::check::{Checked, StudyError, unknown_name};
use crate::data::{Claim, Row, Status};
use crate::document::{Phase, Question};
use crate::order::{Stimulus, Trial};
use crate::phase::Asks;
use crate::progress::next;
use crate::tally::Tally;
use haptograph_engine::diagnostic::{Diagnostic, Diagnostics};
use haptograph_engine::document::SettingsFile;
use haptograph_engine::graph::Graph;
use haptograph_engine::registry::Registry;
use haptograph_engine::run::{Player, SessionOptions};
use haptograph_engine::settings;
use haptograph_engine::settings::{Named, Setting};
use haptograph_signal::files::{self, MAX_GRAPH_BYTES};
use haptograph_signal::noise::stream_seed;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::path::Path;

settings! {
    /// People of known parameters. An answer is 0.5 + gain (value of what is presented + bias + noise), between 0 and 1.
    pub struct People {
        /// Values on each scale, by surface (`canvas`), version (`FS`, `real`) or both (`canvas, real`); those that apply are added.
        values: Named<Named<f64>> = Named::default();
        /// Places of stimuli, of which the distance is the dissimilarity.
        places: Named<Vec<f64>> = Named::default();
        /// Standard deviation of the logarithm of each person's gain.
        gain_sd: f64 = 0.0, in 0.0..=10.0;
        /// Standard deviation of each person's bias.
        bias_sd: f64 = 0.1, in 0.0..=10.0;
        /// Standard deviation of the noise of each answer.
        noise_sd: f64 = 0.1, in 0.0..=10.0;
        /// Share of answers that are anything.
        lapse: f64 = 0.0, in 0.0..=1.0;
        /// Difference from the standard at which half of the answers are known and the others guessed.
        threshold: f64 = 0.1, in 1e-9..=1e9;
    }
}

impl People {
    /// People without any preference.
    pub fn indifferent() -> Self {
        Self {
            values: Named::default(),
            places: Named::default(),
            gain_sd: 0.0,
            bias_sd: 0.1,
            noise_sd: 0.1,
            lapse: 0.0,
            threshold: 0.1,
        }
    }

    /// Reads a file that holds one `People(format: 1, ...)` for a study.
    ///
    /// # Errors
    /// With every problem of the file, names that the study does not have among them.
    pub fn load(path: &Path, study: &Checked) -> Result<Self, StudyError> {
        let text = files::read_text(path, MAX_GRAPH_BYTES)
            .map_err(|error| StudyError::Run(format!("cannot read {}: {error}", path.display())))?;
        let file = SettingsFile::<Self>::parse(path, &text, "a file of people").map_err(StudyError::Study)?;
        let (list, sources) = (file.content.unknown(study), file.sources);
        if list.is_empty() { Ok(file.content) } else { Err(StudyError::Study(Diagnostics { sources, list })) }
    }

    /// The parameters in RON.
    pub fn parameters(&self) -> String {
        self.show()
    }

    /// The names that the study does not have.
    fn unknown(&self, study: &Checked) -> Vec<Diagnostic> {
        let of = &study.study;
        let mut scales: Vec<&str> = of.scales.0.iter().map(|(name, _)| name.text.as_str()).collect();
        // The values by which one of two is chosen have the name of the phase.
        let chosen = of.phases.0.iter().filter(|(_, phase)| matches!(phase, Phase::TwoAlternative(_)));
        scales.extend(chosen.map(|(name, _)| name.text.as_str()));
        let versions = || (0..of.version_count()).map(Some).chain([None]);
        let surfaces = 0..of.surfaces.0.len();
        let stimuli =
            surfaces.flat_map(|surface| versions().map(move |version| Stimulus { surface, version }));
        let both: Vec<String> = stimuli.map(|stimulus| study.name(stimulus)).collect();
        let mut any: Vec<&str> = of.surfaces.0.iter().map(|(name, _)| name.text.as_str()).collect();
        any.extend((0..of.version_count()).map(|version| of.version_name(version)).chain(["real"]));
        any.extend(both.iter().map(String::as_str));
        let both: Vec<&str> = both.iter().map(String::as_str).collect();
        let values = self.values.0.iter().flat_map(|(_, values)| &values.0);
        let values = values.map(|(name, _)| (name, "surface, version or stimulus", &any));
        let places = self.places.0.iter().map(|(name, _)| (name, "stimulus", &both));
        let names =
            self.values.0.iter().map(|(name, _)| (name, "scale", &scales)).chain(values).chain(places);
        let unknown = names.filter(|(name, _, known)| !known.contains(&&*name.text));
        unknown.map(|(name, what, known)| unknown_name(name, what, known)).collect()
    }

    /// Value of a stimulus on a scale.
    fn value(&self, study: &Checked, scale: &str, stimulus: Stimulus) -> f64 {
        let Some(at) = self.values.find(scale) else { return 0.0 };
        let values = &self.values.0[at].1;
        let version = stimulus.version.map_or("real", |version| study.study.version_name(version));
        let surface = &study.study.surfaces.0[stimulus.surface].0.text;
        let both = format!("{surface}, {version}");
        let of = |name: &str| values.find(name).map_or(0.0, |at| values.0[at].1);
        of(surface) + of(version) + of(&both)
    }

    /// Distance of two stimuli.
    fn distance(&self, study: &Checked, first: Stimulus, second: Stimulus) -> f64 {
        let place = |of| self.places.find(&study.name(of)).map(|at| &self.places.0[at].1);
        let (Some(first), Some(second)) = (place(first), place(second)) else { return 0.0 };
        first.iter().zip(second).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    }
}

/// A person who does not exist.
struct Person<'p> {
    people: &'p People,
    random: Xoshiro256PlusPlus,
    gain: f64,
    bias: f64,
}

impl<'p> Person<'p> {
    fn new(people: &'p People, seed: u64, code: &str) -> Self {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(stream_seed(seed, &format!("{code}, simulated")));
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let (gain, bias) = ((people.gain_sd * normal()).exp(), people.bias_sd * normal());
        Self { people, random, gain, bias }
    }

    fn uniform(&mut self) -> f64 {
        self.random.random()
    }

    fn rating(&mut self, value: f64) -> f64 {
        let noise: f64 = StandardNormal.sample(&mut self.random);
        let answer = 0.5 + self.gain * (value + self.bias + self.people.noise_sd * noise);
        let anything = self.uniform();
        let is_lapse = self.uniform() < self.people.lapse;
        if is_lapse { anything } else { answer.clamp(0.0, 1.0) }
    }

    /// The answer to a trial.
    fn answer(&mut self, study: &Checked, trial: &Trial, row: &mut Row) {
        match &study.study.phases.0[trial.phase].1 {
            Phase::Questions(phase) => {
                let question = trial.question.and_then(|at| phase.questions.0.get(at));
                match question.map(|(_, question)| question) {
                    Some(Question::Number(of)) => {
                        row.rating = Some(of.from + self.uniform() * (of.to - of.from))
                    }
                    Some(Question::Choice(of)) => {
                        let at = (self.uniform() * of.of.len() as f64) as usize;
                        row.choice = of.of.get(at).cloned().unwrap_or_default();
                    }
                    _ => row.text = "simulated".to_owned(),
                }
            }
            Phase::Explore(_) => row.text = "simulated".to_owned(),
            Phase::Practice(_) | Phase::Record(_) | Phase::Break(_) => {}
            phase @ Phase::TwoAlternative(_) => {
                let value =
                    |of: Option<Stimulus>| of.map_or(0.0, |of| self.people.value(study, &row.phase, of));
                let values = [value(trial.first), value(trial.second)];
                let is_first = if phase.facts().has_x() {
                    *row.is_right.insert(self.finds_x(values))
                } else {
                    let [first, second] = values.map(|value| self.rating(value));
                    first >= second
                };
                let chosen = if is_first { trial.first } else { trial.second };
                row.choice = chosen.map_or_else(String::new, |of| study.name(of));
            }
            Phase::Rate(_) | Phase::Compare(_) => {
                let value = trial.second.or(trial.first).map(|of| self.people.value(study, &row.scale, of));
                row.rating = Some(self.rating(value.unwrap_or(0.0)));
            }
            Phase::Pairs(phase) => {
                let between = trial.first.zip(trial.second);
                let distance =
                    between.map_or(0.0, |(first, second)| self.people.distance(study, first, second));
                // Any monotone function of the distance.
                let rating = self.rating(1.0 - (-distance).exp() - 0.5);
                row.rating =
                    Some(if phase.same_is == crate::document::End::From { rating } else { 1.0 - rating });
            }
            Phase::ConstantStimuli(_) | Phase::Staircase(_) => self.choose(study, trial, row),
        }
    }

    /// True if X, which is the first one, seems nearer to that than to the other: the differencing observer, whose d' is the difference
    /// of the values over the deviation of the noise.
    fn finds_x(&mut self, [first, other]: [f64; 2]) -> bool {
        let mut felt = |value: f64| -> f64 {
            let noise: f64 = StandardNormal.sample(&mut self.random);
            value + self.people.noise_sd * noise
        };
        let (x, first, other) = (felt(first), felt(first), felt(other));
        let nearer = (x - other).abs() - (x - first).abs();
        let (guess, is_lapse) = (self.uniform() < 0.5, self.uniform() < self.people.lapse);
        if is_lapse || nearer == 0.0 { guess } else { nearer > 0.0 }
    }

    fn choose(&mut self, study: &Checked, trial: &Trial, row: &mut Row) {
        let standard = study.study.phases.0[trial.phase].1.facts().standard();
        let level = trial.level.unwrap_or(standard);
        let difference = (level - standard).abs() / self.people.threshold;
        if level == standard {
            row.choice = if self.uniform() < 0.5 { "comparison" } else { "standard" }.to_owned();
            return;
        }
        let is_known = self.uniform() >= self.people.lapse && self.uniform() >= 0.5_f64.powf(difference);
        let is_right = is_known || self.uniform() < 0.5;
        row.is_right = Some(is_right);
        row.choice = if is_right == (level >= standard) { "comparison" } else { "standard" }.to_owned();
    }
}

/// The run of a trial.
struct TrialRun {
    seconds: f64,
    is_open: bool,
    measures: Vec<(String, f64, String)>,
}

/// Runs a graph offline until the conditions of a phase are reached, or for the longest time, s.
fn run_until_open(
    study: &Checked,
    phase: &Phase,
    graph: &Graph,
    (longest_s, prefix): (f64, &str),
) -> Result<TrialRun, StudyError> {
    let mut tally = Tally::new(&study.study, phase);
    let mut options = SessionOptions::default().rested();
    options.offline = true;
    options.probes = tally.ports().map(str::to_owned).collect();
    let failed = |error: &dyn std::fmt::Display| StudyError::Run(error.to_string());
    let (mut player, mut session) = Player::open(graph, &options).map_err(|error| failed(&error))?;
    let mut probes = Vec::new();
    for name in &options.probes {
        let port = session.any_probe(name).map_err(|error| failed(&error))?;
        let unit = port.quantity().unit();
        probes.push((name, unit, vec![0.0; port.kind().width()], port));
    }
    let driver = graph.drivers().first().map(|driver| graph.clocks()[*driver].rate.hz());
    let rate_hz = driver.unwrap_or(1.0);
    let step = (rate_hz / 100.0).max(1.0) as usize;
    let least_s = if phase.facts().gates.is_empty() { 0.5 } else { 0.0 };
    let mut seconds = 0.0;
    while seconds < longest_s && (seconds < least_s || !tally.is_open()) {
        player.process(step);
        session.poll();
        for (name, unit, frame, port) in &mut probes {
            while port.take(frame) {
                tally.take(name, (frame.len(), unit), frame);
            }
        }
        seconds = player.frames() as f64 / rate_hz;
    }
    let (is_open, measures) = (tally.is_open(), tally.measures(prefix));
    Ok(TrialRun { seconds, is_open, measures })
}

impl Checked {
    /// Runs all trials of a simulated participant that are left, at most `most` of them, each for at most `longest_s`; without, no graph
    /// runs and every answer is open. Returns how many there were.
    ///
    /// # Errors
    /// If the graph fails, or the data cannot be kept.
    pub fn simulate(
        &self,
        registry: &Registry,
        (claim, group): (&mut Claim, usize),
        people: &People,
        longest_s: Option<f64>,
        most: usize,
    ) -> Result<usize, StudyError> {
        let code = claim.participant.participant.clone();
        let trials = self.study.trials(&code, group);
        let mut count = 0;
        while count < most
            && let Some(trial) = next(&self.study, &trials, claim.rows())
        {
            let run = self.run(registry, &trial, longest_s, self.seed_of(&code, &trial))?;
            let mut row = self.answered(people, &code, (&trial, self.row(&trial)));
            row.exploration_s = run.seconds;
            if !run.is_open {
                row.status = Status::Forced;
            }
            claim.keep(row, &run.measures)?;
            count += 1;
        }
        Ok(count)
    }

    /// A row with the answer of a simulated participant: the same person in every trial, who answers each by its own number.
    fn answered(&self, people: &People, code: &str, (trial, mut row): (&Trial, Row)) -> Row {
        let mut person = Person::new(people, self.study.seed, code);
        let seed = stream_seed(self.seed_of(code, trial), "answer");
        person.random = Xoshiro256PlusPlus::seed_from_u64(seed);
        person.answer(self, trial, &mut row);
        row.response_s = 1.0 + person.uniform();
        row
    }

    /// The answers of a whole study of which tests can be computed, without motion, from people in each group.
    pub(crate) fn tested_answers(&self, people: &People, sizes: &[usize]) -> Vec<Row> {
        let (mut rows, mut codes) = (Vec::new(), codes(sizes.iter().sum()));
        for (group, size) in sizes.iter().enumerate() {
            for participant in codes.by_ref().take(*size) {
                let before = rows.len();
                for trial in self.tested(&participant, group) {
                    // The level of a staircase follows from the answers so far.
                    let Some(trial) = next(&self.study, &[trial], &rows[before..]) else { continue };
                    let row = self.row_without_hash(&trial);
                    let row = Row { participant: participant.clone(), simulated: true, ..row };
                    rows.push(self.answered(people, &participant, (&trial, row)));
                }
            }
        }
        rows
    }

    /// The trials of a participant that are analysed, but for maps.
    pub(crate) fn tested(&self, participant: &str, group: usize) -> impl Iterator<Item = Trial> {
        let is_tested = |trial: &Trial| {
            let phase = &self.study.phases.0[trial.phase].1;
            let asks = phase.facts().asks;
            let has_test = matches!(asks, Asks::Line | Asks::Which(_) | Asks::WhichIsX(_) | Asks::More(_));
            has_test && !trial.is_training && !matches!(phase, Phase::Pairs(_))
        };
        self.study.trials(participant, group).into_iter().filter(is_tested)
    }

    fn run(
        &self,
        registry: &Registry,
        trial: &Trial,
        longest_s: Option<f64>,
        seed: u64,
    ) -> Result<TrialRun, StudyError> {
        let phase = &self.study.phases.0[trial.phase].1;
        let mut all = TrialRun { seconds: 0.0, is_open: true, measures: Vec::new() };
        let Some(longest_s) = longest_s else { return Ok(all) };
        let facts = phase.facts();
        let of = [(trial.first, facts.varied.map(|of| of.standard)), (trial.second, trial.level)];
        let x = facts.has_x().then_some((trial.first, None));
        let of: Vec<_> =
            of.into_iter().chain(x).filter(|(of, _)| of.is_some_and(|of| of.version.is_some())).collect();
        for (number, (stimulus, level)) in of.iter().enumerate() {
            let graph = self.graph(registry, phase, (*stimulus, *level), seed)?;
            let prefix = if of.len() > 1 { ["first: ", "second: ", "X: "][number] } else { "" };
            let run = run_until_open(self, phase, &graph, (longest_s, prefix))?;
            all.measures.extend(run.measures);
            all.seconds += run.seconds;
            all.is_open &= run.is_open;
        }
        Ok(all)
    }
}

/// Codes of so many simulated people, S001 and so on.
pub fn codes(people: usize) -> impl Iterator<Item = String> {
    (1..=people).map(|number| format!("S{number:03}"))
}
