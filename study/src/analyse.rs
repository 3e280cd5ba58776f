//! The analysis that a study's phases ask for, with two tests side by side: as in the thesis, with participants as replicates, and
//! with repeated measures, each participant against themselves.

// The columns of tables are named as in those of R.
#![allow(missing_docs)]

mod beside;
mod components;
mod responsiveness;
mod script;

pub(crate) use beside::REPEATED_STUDIES;
pub use beside::{BesideRow, RepeatsNone};

use crate::data::{Folder, Row, lines};
use crate::document::{End, Phase, Study};
use crate::statistics::anova::{self, Term, centred_by_person, columns};
use crate::statistics::effect::{equivalence, paired_effect};
use crate::statistics::psychometric::{Block, FitSettings, Shape, fit};
use crate::statistics::ranks::{friedman, sign_test, wilcoxon_pairs};
use crate::statistics::regression::{correlation_matrix, regress};
use crate::statistics::repeated::{self, WithinTerm};
use crate::statistics::share::{Share, abx_d_prime};
use crate::statistics::space::perceptual_space;
use crate::statistics::tukey::Comparison;
use crate::statistics::{Estimate, mean_interval};
use haptograph_engine::document::value::Name;
use haptograph_signal::statistics::{mean, standard_deviation};
use serde::Serialize;
use std::collections::BTreeMap;

/// Confidence of all intervals.
const CONFIDENCE: f64 = 0.95;
/// Below this p a difference is marked.
const SIGNIFICANT: f64 = 0.05;
/// Share of right answers without a difference: of two alternatives.
const GUESS: f64 = 0.5;
/// Dimensions of a map (thesis 3.3), and of its scree.
const DIMENSIONS: (usize, usize) = (3, 6);

/// A term of an analysis of variance.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct VarianceRow {
    pub phase: String,
    pub test: &'static str,
    /// The scale of ratings; the surface of comparisons.
    pub of: String,
    pub term: &'static str,
    pub df: f64,
    pub residual_df: Option<f64>,
    /// Chi squared in a test of ranks.
    pub f: f64,
    pub p: f64,
    pub p_greenhouse_geisser: Option<f64>,
    /// With its 90 % interval, which excludes zero just where p is below 0.05.
    pub partial_eta_squared: Option<f64>,
    pub eta_low: Option<f64>,
    pub eta_high: Option<f64>,
}

/// A comparison of two versions of a surface.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ComparisonRow {
    pub phase: String,
    pub test: &'static str,
    pub surface: String,
    pub from: String,
    pub to: String,
    pub difference: Option<f64>,
    pub low: Option<f64>,
    pub high: Option<f64>,
    pub p: f64,
    /// Cohen's d of the differences, with its 95 % interval, beside the test of repeated measures.
    pub d_z: Option<f64>,
    pub d_z_low: Option<f64>,
    pub d_z_high: Option<f64>,
}

/// The mean of a stimulus on a scale.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeanRow {
    pub phase: String,
    pub scale: String,
    pub surface: String,
    pub version: String,
    pub people: usize,
    pub mean: f64,
    pub sd: f64,
    /// Interval of the mean by t, 95 %.
    pub low: Option<f64>,
    pub high: Option<f64>,
    /// As fractions of each person's standard deviation on the scale.
    pub mean_over_sd: f64,
    /// Eq. 4.6.1: how much less similar than the reference, %.
    pub less_than_reference_percent: Option<f64>,
}

/// A correlation or a coefficient of a regression.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RelationRow {
    pub phase: String,
    pub kind: &'static str,
    pub of: String,
    pub with: String,
    pub value: f64,
    pub low: f64,
    pub high: f64,
    pub p: f64,
    pub count: usize,
    pub r_squared: Option<f64>,
}

/// A stimulus on the map of dissimilarities.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlaceRow {
    pub phase: String,
    pub stimulus: String,
    pub x: f64,
    pub y: Option<f64>,
    pub z: Option<f64>,
    /// Group at each number of groups from 2 on, joined by spaces.
    pub groups: String,
}

/// A merge of Ward's tree of the distances on a map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MergeRow {
    pub phase: String,
    /// Stimuli by their number among the places, from 0; earlier merges by the number of stimuli plus their own.
    pub first: usize,
    pub second: usize,
    pub distance: f64,
}

/// Stress of a map by its number of dimensions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScreeRow {
    pub phase: String,
    pub dimensions: usize,
    pub stress: f64,
    pub r_squared: f64,
}

/// A psychometric function.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ThresholdRow {
    pub phase: String,
    /// Empty for all participants together.
    pub participant: String,
    pub trials: u32,
    /// From which the threshold is a difference.
    pub standard: f64,
    pub threshold: f64,
    pub low: f64,
    pub high: f64,
    pub slope: f64,
    pub lapse: f64,
    pub p_of_deviance: f64,
    /// True if the answers do not determine the slope.
    pub slope_at_bound: bool,
}

/// How often one of two was chosen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChoiceRow {
    pub phase: String,
    pub first: String,
    pub second: String,
    pub answers: u64,
    /// Share of answers that chose the first one, with its 95 % interval (Wilson 1927).
    pub share_of_first: f64,
    pub low: f64,
    pub high: f64,
    /// Sign test over answers, as if each were of another person.
    pub p_of_answers: f64,
    /// Number of people, and of those who chose the first one more often.
    pub people: u64,
    pub people_for_first: u64,
    /// Sign test over people, without those who chose both as often.
    pub p_of_people: f64,
}

/// How often X was found in a pair of ABX.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AbxRow {
    pub phase: String,
    pub pair: String,
    /// Empty for all participants together.
    pub participant: String,
    pub answers: u64,
    /// Share of right answers, with its 95 % interval (Wilson 1927).
    pub share_right: f64,
    pub low: f64,
    pub high: f64,
    /// Exact binomial test against a half, two-sided.
    pub p: f64,
    /// Of the differencing model; none below a share of a half and at 1.
    pub d_prime: Option<f64>,
    pub d_prime_low: Option<f64>,
    pub d_prime_high: Option<f64>,
    /// Of all: sign test over people, without those who were as often right as wrong.
    pub p_of_people: Option<f64>,
}

/// Answers at one level.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LevelRow {
    pub phase: String,
    /// Empty for all participants together.
    pub participant: String,
    /// Difference from the standard.
    pub level: f64,
    pub trials: u32,
    pub right: u32,
}

impl ThresholdRow {
    /// The share of right answers at a difference from the standard.
    pub fn at(&self, level: f64) -> f64 {
        GUESS + (1.0 - GUESS - self.lapse) * Shape::Logistic.at(level, self.threshold, self.slope)
    }
}

/// Maps of dissimilarities.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Maps {
    pub places: Vec<PlaceRow>,
    /// Ward's trees.
    pub merges: Vec<MergeRow>,
    pub scree: Vec<ScreeRow>,
}

/// All tables of an analysis.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Analysis {
    /// True for people who do not exist.
    pub simulated: bool,
    /// Means of stimuli.
    pub means: Vec<MeanRow>,
    /// Analyses of variance.
    pub variance: Vec<VarianceRow>,
    /// Comparisons of versions.
    pub comparisons: Vec<ComparisonRow>,
    /// Choices of one of two.
    pub choices: Vec<ChoiceRow>,
    /// How often X was found in ABX.
    pub abx: Vec<AbxRow>,
    /// Correlations and regressions.
    pub relations: Vec<RelationRow>,
    /// Maps.
    #[serde(flatten)]
    pub maps: Maps,
    /// Psychometric functions.
    pub thresholds: Vec<ThresholdRow>,
    /// The answers that these fit.
    pub levels: Vec<LevelRow>,
    /// What could not be computed, and why.
    pub left_out: Vec<String>,
}

/// A stimulus by its names.
type Cell = (String, String);

/// Ratings of people: a row a person, a column a stimulus, NaN where there is none; repetitions are averaged.
#[derive(Debug, Clone)]
struct Ratings {
    cells: Vec<Cell>,
    rows: Vec<Vec<f64>>,
}

impl Ratings {
    fn of(rows: &[&Row], cell: impl Fn(&Row) -> Cell) -> Self {
        let (mut cells, mut people) = (Vec::new(), Vec::new());
        let mut sums = BTreeMap::<(usize, usize), (f64, usize)>::new();
        for row in rows {
            let Some(rating) = row.rating else { continue };
            let (cell, person) = (place(&mut cells, cell(row)), place(&mut people, row.participant.clone()));
            let sum = sums.entry((person, cell)).or_default();
            *sum = (sum.0 + rating, sum.1 + 1);
        }
        // In the order of names, so that the order of trials changes nothing.
        let mut order: Vec<usize> = (0..cells.len()).collect();
        order.sort_by_key(|cell| &cells[*cell]);
        let value =
            |person, cell| sums.get(&(person, cell)).map_or(f64::NAN, |(sum, count)| sum / *count as f64);
        let rows = (0..people.len()).map(|person| order.iter().map(|cell| value(person, *cell)).collect());
        Self { rows: rows.collect(), cells: order.iter().map(|cell| cells[*cell].clone()).collect() }
    }

    /// Divided by each person's standard deviation.
    fn over_deviation(&self) -> Self {
        let scaled = self.rows.iter().map(|row| {
            let given: Vec<f64> = row.iter().copied().filter(|value| value.is_finite()).collect();
            let deviation = standard_deviation(&given);
            row.iter().map(|value| if deviation > 0.0 { value / deviation } else { f64::NAN }).collect()
        });
        Self { cells: self.cells.clone(), rows: scaled.collect() }
    }

    /// Some of the columns.
    fn select(&self, is_wanted: impl Fn(&Cell) -> bool) -> Self {
        let wanted: Vec<usize> = (0..self.cells.len()).filter(|at| is_wanted(&self.cells[*at])).collect();
        let rows = self.rows.iter().map(|row| wanted.iter().map(|at| row[*at]).collect());
        Self { rows: rows.collect(), cells: wanted.iter().map(|at| self.cells[*at].clone()).collect() }
    }

    /// Surfaces and versions if every surface has every version: the columns are then those of the first surface first.
    fn factors(&self) -> (Vec<String>, Vec<String>) {
        let (mut surfaces, mut versions) = (Vec::new(), Vec::new());
        for (surface, version) in &self.cells {
            place(&mut surfaces, surface.clone());
            place(&mut versions, version.clone());
        }
        (surfaces, versions)
    }

    /// People without a missing cell.
    fn complete(&self) -> Vec<Vec<f64>> {
        self.rows.iter().filter(|row| row.iter().all(|value| value.is_finite())).cloned().collect()
    }

    fn column(&self, at: usize) -> Vec<f64> {
        self.rows.iter().map(|row| row[at]).filter(|value| value.is_finite()).collect()
    }
}

/// The number of a value in a list, at whose end it is put if it is new.
fn place<T: PartialEq>(list: &mut Vec<T>, value: T) -> usize {
    list.iter().position(|known| *known == value).unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    })
}

/// The values of a column, in the order in which they come.
fn distinct(rows: &[&Row], of: impl Fn(&Row) -> &String) -> Vec<String> {
    let mut values = Vec::new();
    for row in rows {
        place(&mut values, of(row).clone());
    }
    values
}

/// The answers of each person to each pair: how many chose the first one, and the other; in ABX how many were right, and wrong.
fn counted<'r>(rows: &[&'r Row], has_x: bool) -> BTreeMap<[String; 2], BTreeMap<&'r str, [u64; 2]>> {
    let mut pairs: BTreeMap<[String; 2], BTreeMap<&str, [u64; 2]>> = BTreeMap::new();
    for row in rows.iter().filter(|row| !row.choice.is_empty()) {
        let names = [(&row.first_surface, &row.first_version), (&row.second_surface, &row.second_version)];
        let mut pair = names.map(|(surface, version)| format!("{surface}, {version}"));
        let is_first = row.choice == pair[0];
        // X is either of a pair.
        if has_x {
            pair.sort();
        }
        let of = pairs.entry(pair).or_default().entry(&row.participant).or_default();
        of[usize::from(!is_first)] += 1;
    }
    pairs
}

fn sums(people: &BTreeMap<&str, [u64; 2]>) -> [u64; 2] {
    [0, 1].map(|at| people.values().map(|of| of[at]).sum())
}

/// How many people have more of the first, and more of the other.
fn majorities(people: &BTreeMap<&str, [u64; 2]>) -> [u64; 2] {
    [0, 1].map(|at| people.values().filter(|of| of[at] > of[1 - at]).count() as u64)
}

/// What a table of variance is of.
#[derive(Clone, Copy)]
struct Of<'a> {
    phase: &'a str,
    of: &'a str,
}

impl Of<'_> {
    fn empty(&self, test: &'static str, term: &'static str) -> VarianceRow {
        let (phase, of) = (self.phase.to_owned(), self.of.to_owned());
        VarianceRow { phase, test, of, term, ..VarianceRow::default() }
    }

    fn row(&self, test: &'static str, term: &'static str, effect: &Term, residual_df: f64) -> VarianceRow {
        let Term { df, f, p, partial_eta_squared, partial_eta_squared_90, .. } = *effect;
        let (eta_low, eta_high) = partial_eta_squared_90.unzip();
        let (partial_eta_squared, residual_df) = (Some(partial_eta_squared), Some(residual_df));
        let row = self.empty(test, term);
        VarianceRow { df, residual_df, f, p, partial_eta_squared, eta_low, eta_high, ..row }
    }

    fn within(&self, term: &'static str, within: &WithinTerm) -> VarianceRow {
        let row = self.row(REPEATED, term, &within.effect, within.error.df);
        VarianceRow { p_greenhouse_geisser: Some(within.p_corrected), ..row }
    }
}

impl RelationRow {
    fn new((phase, kind): (&str, &'static str), (of, with): (&str, &str), value: Estimate, p: f64) -> Self {
        let [phase, of, with] = [phase, of, with].map(str::to_owned);
        let Estimate { value, low, high } = value;
        Self { phase, kind, of, with, value, low, high, p, count: 0, r_squared: None }
    }
}

impl ComparisonRow {
    /// A row without a difference.
    fn new(of: &Of<'_>, test: &'static str, (from, to): (String, String), p: f64) -> Self {
        let (phase, surface) = (of.phase.to_owned(), of.of.to_owned());
        Self { phase, test, surface, from, to, p, ..Self::default() }
    }

    /// True for two versions in a phase, in any order.
    fn is_of(&self, phase: &str, [a, b]: [&str; 2]) -> bool {
        self.phase == phase && [[a, b], [b, a]].contains(&[&*self.from, &*self.to])
    }
}

/// The phase of ratings that explain the dissimilarities: of several the last; empty without any.
fn rated(study: &Study) -> &str {
    let is_rate = |(_, phase): &&(Name, Phase)| matches!(phase, Phase::Rate(_));
    study.phases.0.iter().rfind(is_rate).map_or("", |(name, _)| &name.text)
}

const THESIS: &str = "as in the thesis";
const RAW: &str = "as in the thesis, not centred";
const REPEATED: &str = "repeated measures";
const RANKS: &str = "ranks";

impl Analysis {
    /// Analyses the data of a study.
    ///
    /// # Errors
    /// If the data cannot be read.
    pub fn of(study: &Study, folder: &Folder) -> Result<Self, crate::data::DataError> {
        Ok(Self::of_answers(study, &folder.answers()?, FitSettings::default().resamples))
    }

    /// Analyses the answers to trials that count; the intervals of thresholds are of so many simulated data sets.
    pub(crate) fn of_answers(study: &Study, answers: &[Row], resamples: usize) -> Self {
        let simulated = answers.iter().any(|row| row.simulated);
        let mut analysis = Self { simulated, ..Self::default() };
        let rows: Vec<&Row> = answers.iter().filter(|row| !row.training).collect();
        for (name, phase) in &study.phases.0 {
            let of_phase: Vec<&Row> = rows.iter().copied().filter(|row| row.phase == name.text).collect();
            if of_phase.is_empty() {
                continue;
            }
            match phase {
                Phase::Rate(_) => analysis.rate(&name.text, &of_phase),
                Phase::Compare(compare) => {
                    analysis.compare(&name.text, (study.reference(compare), compare.same_within), &of_phase);
                }
                Phase::Pairs(pairs) => {
                    let rated = rated(study);
                    let ratings: Vec<&Row> = rows.iter().copied().filter(|row| row.phase == rated).collect();
                    analysis.pairs(&name.text, pairs.same_is == End::From, &of_phase, &ratings);
                }
                Phase::ConstantStimuli(_) | Phase::Staircase(_) => {
                    analysis.thresholds(&name.text, (phase.facts().standard(), resamples), &of_phase);
                }
                Phase::TwoAlternative(of) if of.abx => analysis.abx(&name.text, &of_phase),
                Phase::TwoAlternative(_) => analysis.choices(&name.text, &of_phase),
                _ => {}
            }
        }
        analysis
    }

    /// Keeps a result, or says why there is none.
    fn keep<T, E: std::fmt::Display>(&mut self, what: &str, result: Result<T, E>) -> Option<T> {
        result.map_err(|error| self.left_out.push(format!("{what}: {error}"))).ok()
    }

    fn means(&mut self, phase: &str, scale: &str, ratings: &Ratings, reference: Option<&str>) {
        let scaled = ratings.over_deviation();
        let place = |cell: &Cell| ratings.cells.iter().position(|known| known == cell);
        for (at, (surface, version)) in ratings.cells.iter().enumerate() {
            let values = ratings.column(at);
            let reference = reference.and_then(|name| place(&(surface.clone(), name.to_owned())));
            // Of the people who rated both.
            let less = reference.and_then(|reference| {
                let both = ratings.rows.iter().map(|row| (row[reference], row[at]));
                let both = both.filter(|(of, own)| of.is_finite() && own.is_finite());
                let (of, own): (Vec<f64>, Vec<f64>) = both.unzip();
                (mean(&of) > 0.0).then(|| 100.0 * (mean(&of) - mean(&own)) / mean(&of))
            });
            let interval = mean_interval(&values, CONFIDENCE).ok();
            self.means.push(MeanRow {
                phase: phase.to_owned(),
                scale: scale.to_owned(),
                surface: surface.clone(),
                version: version.clone(),
                people: values.len(),
                mean: mean(&values),
                sd: standard_deviation(&values),
                low: interval.map(|of| of.low),
                high: interval.map(|of| of.high),
                mean_over_sd: mean(&scaled.column(at)),
                less_than_reference_percent: less,
            });
        }
    }

    /// Ratings: surface and version, and how the scales go together.
    fn rate(&mut self, phase: &str, rows: &[&Row]) {
        let scales = distinct(rows, |row| &row.scale);
        let mut by_scale: Vec<(String, Vec<f64>)> = Vec::new();
        for scale in scales {
            let of_scale: Vec<&Row> = rows.iter().copied().filter(|row| row.scale == scale).collect();
            let ratings =
                Ratings::of(&of_scale, |row| (row.first_surface.clone(), row.first_version.clone()));
            self.means(phase, &scale, &ratings, None);
            let scaled = ratings.over_deviation();
            let constant = scaled.rows.iter().filter(|row| row.iter().all(|value| value.is_nan())).count();
            if constant > 0 {
                self.left_out.push(format!("{phase}, {scale}: {constant} people who always gave one answer"));
            }
            by_scale
                .push((scale.clone(), (0..scaled.cells.len()).map(|at| mean(&scaled.column(at))).collect()));
            let (_, versions) = scaled.factors();
            // A surface without one of the versions, such as a blank, is no part of the two factors.
            let has_all = |surface: &str| {
                versions.iter().all(|version| scaled.cells.contains(&(surface.to_owned(), version.clone())))
            };
            let crossed = scaled.select(|(surface, _)| has_all(surface));
            self.variance_of(phase, &scale, &crossed);
        }
        let (names, columns): (Vec<String>, Vec<Vec<f64>>) = by_scale.into_iter().unzip();
        if names.len() > 1 && columns.windows(2).all(|two| two[0].len() == two[1].len()) {
            let what = format!("correlations of {phase}");
            let Some(matrix) = self.keep(&what, correlation_matrix(&columns, CONFIDENCE)) else { return };
            for (a, of) in names.iter().enumerate() {
                for (b, with) in names.iter().enumerate().skip(a + 1) {
                    let Some(found) = matrix.get(a).and_then(|row| row.get(b)) else { continue };
                    let r_squared = Some(found.r.value * found.r.value);
                    let row = RelationRow::new((phase, "correlation"), (of, with), found.r, found.p);
                    self.relations.push(RelationRow { count: found.count, r_squared, ..row });
                }
            }
        }
    }

    fn variance_of(&mut self, phase: &str, scale: &str, ratings: &Ratings) {
        let (surfaces, versions) = ratings.factors();
        let table = ratings.complete();
        let of = Of { phase, of: scale };
        let what = format!("variance of {phase}, {scale}");
        match (surfaces.len(), versions.len()) {
            (2.., 2..) => {
                let each = table.iter().flat_map(|row| {
                    let levels = versions.len();
                    row.iter().enumerate().map(move |(at, value)| (at / levels, at % levels, *value))
                });
                let each: Vec<(usize, usize, f64)> = each.collect();
                let terms = ["surface", "version", "surface x version"];
                if let Some(two) = self.keep(&what, anova::two_way(&each, true)) {
                    let found = [Some(two.a), Some(two.b), two.interaction].into_iter().zip(terms);
                    let row = |(found, term): (Option<Term>, _)| {
                        Some(of.row(THESIS, term, &found?, two.residual.df))
                    };
                    self.variance.extend(found.filter_map(row));
                }
                let repeated = repeated::two_way(&table, surfaces.len(), versions.len());
                if let Some(two) = self.keep(&what, repeated) {
                    let found = [&two.a, &two.b, &two.interaction].into_iter().zip(terms);
                    self.variance.extend(found.map(|(found, term)| of.within(term, found)));
                }
            }
            (2.., 1) | (1, 2..) => {
                let term = if versions.len() == 1 { "surface" } else { "version" };
                if let Some(one) = self.keep(&what, anova::one_way(&columns(&table))) {
                    self.variance.push(of.row(THESIS, term, &one.effect, one.residual.df));
                }
                if let Some(one) = self.keep(&what, repeated::one_way(&table)) {
                    self.variance.push(of.within(term, &one.term));
                }
            }
            _ => {}
        }
    }

    /// Comparisons with the real surface: the versions of each surface against one another.
    fn compare(&mut self, phase: &str, (reference, same_within): (&str, Option<f64>), rows: &[&Row]) {
        let all = Ratings::of(rows, |row| (row.second_surface.clone(), row.second_version.clone()));
        let scale = rows.first().map_or("", |row| &row.scale);
        self.means(phase, scale, &all, Some(reference));
        for surface in all.factors().0 {
            let ratings = all.select(|(of, _)| *of == surface);
            let (table, versions) = (ratings.complete(), ratings.factors().1);
            let of = Of { phase, of: &surface };
            let what = format!("{phase}, {surface}");
            for (test, table) in [(THESIS, centred_by_person(&table)), (RAW, table.clone())] {
                let groups = columns(&table);
                let Some(one) = self.keep(&what, anova::one_way(&groups)) else { continue };
                self.variance.push(of.row(test, "version", &one.effect, one.residual.df));
                self.compared(&of, test, &versions, one.tukey(CONFIDENCE), &[]);
            }
            if let Some(one) = self.keep(&what, repeated::one_way(&table)) {
                self.variance.push(of.within("version", &one.term));
                self.compared(&of, REPEATED, &versions, one.tukey(CONFIDENCE), &table);
            }
            if let Some(ranks) = self.keep(&what, friedman(&table)) {
                let row = of.empty(RANKS, "version");
                self.variance.push(VarianceRow { df: ranks.df, f: ranks.chi_squared, p: ranks.p, ..row });
            }
            for pair in self.keep(&what, wilcoxon_pairs(&table)).unwrap_or_default() {
                let (from, to) = (versions[pair.from].clone(), versions[pair.to].clone());
                self.comparisons.push(ComparisonRow::new(&of, RANKS, (from, to), pair.p_holm));
            }
            self.equivalent(&of, &versions, &table, same_within);
        }
    }

    /// Tests that versions differ by less than a bound.
    fn equivalent(&mut self, of: &Of<'_>, versions: &[String], table: &[Vec<f64>], same_within: Option<f64>) {
        let Some(bound) = same_within else { return };
        for to in 0..versions.len() {
            for from in 0..to {
                let differences: Vec<f64> = table.iter().map(|row| row[to] - row[from]).collect();
                let names = [from, to].map(|version| format!("{}, {}", of.of, versions[version]));
                let what = format!("{}: whether {} and {} are the same", of.phase, names[0], names[1]);
                let Some(test) = self.keep(&what, equivalence(&differences, (-bound, bound), 0.05)) else {
                    continue;
                };
                let kind = "equivalence within `same_within` (two one-sided tests; interval of 90 %)";
                let row = RelationRow::new((of.phase, kind), (&names[0], &names[1]), test.mean, test.p);
                self.relations.push(RelationRow { count: differences.len(), ..row });
            }
        }
    }

    fn compared<E: std::fmt::Display>(
        &mut self,
        of: &Of<'_>,
        test: &'static str,
        versions: &[String],
        pairs: Result<Vec<Comparison>, E>,
        table: &[Vec<f64>],
    ) {
        let columns = columns(table);
        let effect = |pair: &Comparison| {
            let (from, to) = (columns.get(pair.from)?, columns.get(pair.to)?);
            paired_effect(from, to, CONFIDENCE).ok().map(|effect| effect.d_z)
        };
        let pairs = self.keep(&format!("{}, {}", of.phase, of.of), pairs).unwrap_or_default();
        self.comparisons.extend(pairs.into_iter().map(|pair| {
            let d_z = effect(&pair);
            let names = (versions[pair.from].clone(), versions[pair.to].clone());
            ComparisonRow {
                difference: Some(pair.difference),
                low: Some(pair.low),
                high: Some(pair.high),
                d_z: d_z.map(|d| d.value),
                d_z_low: d_z.map(|d| d.low),
                d_z_high: d_z.map(|d| d.high),
                ..ComparisonRow::new(of, test, names, pair.p)
            }
        }));
    }

    /// Pairs: a map, a tree, and the ratings that explain the dissimilarities (Eq. 3.3.1).
    fn pairs(&mut self, phase: &str, is_from_same: bool, rows: &[&Row], ratings: &[&Row]) {
        let name = |surface: &str, version: &str| format!("{surface}, {version}");
        let both = |row: &Row| {
            let first = name(&row.first_surface, &row.first_version);
            let second = name(&row.second_surface, &row.second_version);
            if first < second { (first, second) } else { (second, first) }
        };
        // From the same to the different.
        let turned = |row: &&Row| {
            let rating = row.rating.map(|rating| if is_from_same { rating } else { 1.0 - rating });
            Row { rating, ..(*row).clone() }
        };
        let turned: Vec<Row> = rows.iter().map(turned).collect();
        let all = Ratings::of(&turned.iter().collect::<Vec<_>>(), both).over_deviation();
        let mut stimuli: Vec<String> = Vec::new();
        for (first, second) in &all.cells {
            place(&mut stimuli, first.clone());
            place(&mut stimuli, second.clone());
        }
        stimuli.sort();
        let of_pair = |a: usize, b: usize| {
            let cell = (stimuli[a].clone(), stimuli[b].clone());
            all.cells.iter().position(|known| *known == cell).map(|at| mean(&all.column(at)))
        };
        let pairs: Vec<(usize, usize)> =
            (0..stimuli.len()).flat_map(|a| (a + 1..stimuli.len()).map(move |b| (a, b))).collect();
        let found: Option<Vec<f64>> = pairs.iter().map(|(a, b)| of_pair(*a, *b)).collect();
        let Some(dissimilarities) = found else {
            self.left_out.push(format!("map of {phase}: some pairs have no answer"));
            return;
        };
        self.map(phase, &stimuli, &dissimilarities);
        self.explained(phase, (&stimuli, &pairs), &dissimilarities, ratings);
    }

    fn map(&mut self, phase: &str, stimuli: &[String], dissimilarities: &[f64]) {
        let most = stimuli.len().saturating_sub(1);
        let (dimensions, scree) = (DIMENSIONS.0.min(most), DIMENSIONS.1.min(most));
        let space = perceptual_space(dissimilarities, stimuli.len(), dimensions, scree);
        let Some(space) = self.keep(&format!("map of {phase}"), space) else { return };
        for (at, place) in space.places.iter().enumerate() {
            let groups: Vec<String> = space.cuts.iter().map(|cut| cut[at].to_string()).collect();
            let (stimulus, groups, phase) = (stimuli[at].clone(), groups.join(" "), phase.to_owned());
            let [x, y, z] = [0, 1, 2].map(|axis| place.get(axis).copied());
            self.maps.places.push(PlaceRow { phase, stimulus, x: x.unwrap_or(0.0), y, z, groups });
        }
        self.maps.merges.extend(space.tree.iter().map(|(first, second, distance)| MergeRow {
            phase: phase.to_owned(),
            first: *first,
            second: *second,
            distance: *distance,
        }));
        let scree = space.stress.iter().zip(&space.r_squared).zip(1..);
        self.maps.scree.extend(scree.map(|((stress, r_squared), dimensions)| ScreeRow {
            phase: phase.to_owned(),
            dimensions,
            stress: *stress,
            r_squared: *r_squared,
        }));
    }

    fn explained(
        &mut self,
        phase: &str,
        (stimuli, pairs): (&[String], &[(usize, usize)]),
        dissimilarities: &[f64],
        ratings: &[&Row],
    ) {
        let (scales, mut differences) = (distinct(ratings, |row| &row.scale), Vec::new());
        for scale in &scales {
            let of_scale: Vec<&Row> = ratings.iter().copied().filter(|row| row.scale == *scale).collect();
            let of = Ratings::of(&of_scale, |row| (row.first_surface.clone(), row.first_version.clone()));
            let of = of.over_deviation();
            let names: Vec<String> =
                of.cells.iter().map(|(surface, version)| format!("{surface}, {version}")).collect();
            let value = |stimulus: &String| {
                names.iter().position(|name| name == stimulus).map(|at| mean(&of.column(at)))
            };
            let values: Option<Vec<f64>> = stimuli.iter().map(value).collect();
            let Some(values) = values else {
                let why = format!("regression of {phase}: not every stimulus was rated for {scale}");
                self.left_out.push(why);
                return;
            };
            differences
                .push(pairs.iter().map(|(a, b)| (values[*a] - values[*b]).abs()).collect::<Vec<f64>>());
        }
        if scales.is_empty() {
            return;
        }
        let found = regress(&differences, dissimilarities, false);
        let Some(found) = self.keep(&format!("regression of {phase}"), found) else { return };
        for (scale, coefficient) in scales.into_iter().zip(&found.coefficients) {
            let kind = "regression of dissimilarity on differences of ratings (Eq. 3.3.1)";
            let (names, r_squared) = (("dissimilarity", &*scale), Some(found.r_squared));
            let row = RelationRow::new((phase, kind), names, coefficient.estimate, coefficient.p);
            self.relations.push(RelationRow { count: pairs.len(), r_squared, ..row });
        }
    }

    /// Psychometric functions: how often the level was called more than the standard, for each participant and for all.
    fn thresholds(&mut self, phase: &str, (standard, resamples): (f64, usize), rows: &[&Row]) {
        let mut people = distinct(rows, |row| &row.participant);
        people.push(String::new());
        for participant in people {
            let mut blocks = BTreeMap::<u64, Block>::new();
            let own = rows.iter().filter(|row| participant.is_empty() || row.participant == participant);
            for (level, is_right) in own.filter_map(|row| Some((row.level?, row.is_right?))) {
                // Of two alternatives: right answers by the difference from the standard.
                let level = (level - standard).abs();
                let block = blocks.entry(level.to_bits()).or_insert(Block { level, trials: 0, positive: 0 });
                block.trials += 1;
                block.positive += u32::from(is_right);
            }
            let blocks: Vec<Block> = blocks.into_values().filter(|block| block.level > 0.0).collect();
            self.levels.extend(blocks.iter().map(|block| LevelRow {
                phase: phase.to_owned(),
                participant: participant.clone(),
                level: block.level,
                trials: block.trials,
                right: block.positive,
            }));
            let settings = FitSettings { guess: GUESS, resamples, ..FitSettings::default() };
            let whose = if participant.is_empty() { "all" } else { &participant };
            let what = format!("threshold of {whose} in {phase}");
            if let Some(found) = self.keep(&what, fit(&blocks, &settings)) {
                self.thresholds.push(ThresholdRow {
                    phase: phase.to_owned(),
                    participant,
                    trials: blocks.iter().map(|block| block.trials).sum(),
                    standard,
                    threshold: found.threshold.value,
                    low: found.threshold.low,
                    high: found.threshold.high,
                    slope: found.slope.value,
                    lapse: found.lapse.value,
                    p_of_deviance: found.p,
                    slope_at_bound: found.slope_at_bound,
                });
            }
        }
    }

    /// How often one of each pair was chosen.
    fn choices(&mut self, phase: &str, rows: &[&Row]) {
        for ([first, second], people) in counted(rows, false) {
            let ([count, others], [for_first, for_second]) = (sums(&people), majorities(&people));
            let share = Share::of(count as usize, (count + others) as usize);
            self.choices.push(ChoiceRow {
                phase: phase.to_owned(),
                first,
                second,
                answers: count + others,
                share_of_first: share.share,
                low: share.low,
                high: share.high,
                p_of_answers: sign_test(count, count + others),
                people: people.len() as u64,
                people_for_first: for_first,
                p_of_people: sign_test(for_first, for_first + for_second),
            });
        }
    }

    /// How often X was found in each pair, by each participant and by all.
    fn abx(&mut self, phase: &str, rows: &[&Row]) {
        for (pair, people) in counted(rows, true) {
            let [found, missed] = majorities(&people);
            let all = ("", sums(&people), Some(sign_test(found, found + missed)));
            let each = people.iter().map(|(code, counts)| (*code, *counts, None));
            self.abx.extend(each.chain([all]).map(|(code, [right, wrong], p_of_people)| {
                let share = Share::of(right as usize, (right + wrong) as usize);
                AbxRow {
                    phase: phase.to_owned(),
                    pair: pair.join(" / "),
                    participant: code.to_owned(),
                    answers: right + wrong,
                    share_right: share.share,
                    low: share.low,
                    high: share.high,
                    p: sign_test(right, right + wrong),
                    d_prime: abx_d_prime(share.share),
                    d_prime_low: abx_d_prime(share.low.max(0.5)),
                    d_prime_high: abx_d_prime(share.high),
                    p_of_people,
                }
            }));
        }
    }

    /// Marks of a version that differs from the reference by Tukey's test, p below 0.05: `*` as in the thesis, `†` with repeated
    /// measures.
    pub fn marks(&self, phase: &str, surface: &str, [version, reference]: [&str; 2]) -> String {
        let is_pair = |row: &&ComparisonRow| row.surface == surface && row.is_of(phase, [version, reference]);
        let found = self.comparisons.iter().filter(is_pair).filter(|row| row.p < SIGNIFICANT);
        let found: Vec<&ComparisonRow> = found.collect();
        let mark = |test: &str, mark| if found.iter().any(|row| row.test == test) { mark } else { "" };
        [mark(THESIS, "*"), mark(REPEATED, "†")].concat()
    }

    /// The tables that are not empty, as (name, CSV).
    ///
    /// # Errors
    /// If a table cannot be written.
    pub fn tables(&self) -> Result<Vec<(&'static str, String)>, csv::Error> {
        // The last column of each: a table may be read without its folder.
        let table = |lines: Vec<u8>| -> String {
            let (text, simulated) = (String::from_utf8_lossy(&lines), self.simulated.to_string());
            let labels = std::iter::once("simulated").chain(std::iter::repeat(simulated.as_str()));
            text.lines().zip(labels).map(|(line, label)| format!("{line},{label}\n")).collect()
        };
        let all = vec![
            ("means.csv", table(lines(&self.means, true)?)),
            ("variance.csv", table(lines(&self.variance, true)?)),
            ("comparisons.csv", table(lines(&self.comparisons, true)?)),
            ("relations.csv", table(lines(&self.relations, true)?)),
            ("places.csv", table(lines(&self.maps.places, true)?)),
            ("merges.csv", table(lines(&self.maps.merges, true)?)),
            ("scree.csv", table(lines(&self.maps.scree, true)?)),
            ("thresholds.csv", table(lines(&self.thresholds, true)?)),
            ("levels.csv", table(lines(&self.levels, true)?)),
            ("choices.csv", table(lines(&self.choices, true)?)),
            ("abx.csv", table(lines(&self.abx, true)?)),
        ];
        Ok(all.into_iter().filter(|(_, text)| !text.is_empty()).collect())
    }
}
