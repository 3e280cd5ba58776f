//! What each kind of phase is: a new kind adds its facts and, unless it takes trials of another, its cells here.

use crate::document::{Gate, Level, Phase, Presented, Question, Study, Version};
use crate::order::{Stimulus, Trial};
use haptograph_engine::document::value::Name;
use haptograph_engine::settings::Named;
use std::iter::once;

/// All versions of a virtual surface.
pub(crate) const ALL_VERSIONS: Presented = Presented::Virtual(Version { version: None });

/// What a trial asks for.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) enum Asks<'p> {
    /// Nothing.
    #[default]
    Nothing,
    /// A take, which ends by the clock.
    Take,
    /// Words.
    Words(&'p str),
    /// A mark on the scale of the trial.
    Line,
    /// Which of two stimuli is chosen.
    Which(&'p str),
    /// Which of two stimuli a third one, X, is: the first of the trial.
    WhichIsX(&'p str),
    /// Which of two has more of the varied parameter.
    More(&'p str),
    /// An answer to the question of the trial.
    Question(&'p Named<Question>),
}

/// The parameter that differs between two stimuli.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Varied<'p> {
    pub(crate) surface: &'p Name,
    pub(crate) parameter: &'p Name,
    /// Its value in the first of the two.
    pub(crate) standard: f64,
    /// Its values in the second; of a staircase the extreme ones.
    pub(crate) levels: &'p [f64],
}

/// What is known of every phase.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Facts<'p> {
    pub(crate) kind: &'static str,
    pub(crate) asks: Asks<'p>,
    /// The groups that take part; all if empty.
    pub(crate) groups: &'p [Name],
    /// The instruction.
    pub(crate) text: &'p str,
    /// What is presented of which surfaces, all if none is named.
    pub(crate) presents: (&'p [Presented], &'p [Name]),
    /// What has to be reached before an answer opens.
    pub(crate) gates: &'p [(Name, Gate)],
    /// Number of training trials.
    pub(crate) training: u32,
    /// How often each cell is presented.
    pub(crate) repeats: u32,
    /// The order of the cells, outermost first; of two stimuli with sides, `None`: they are shuffled.
    pub(crate) order: Option<&'p [Level]>,
    /// Length of a trial that ends by the clock, s.
    pub(crate) length_s: Option<f64>,
    pub(crate) varied: Option<Varied<'p>>,
}

impl<'p> Facts<'p> {
    fn new(kind: &'static str, asks: Asks<'p>, groups: &'p [Name], text: &'p str) -> Self {
        Self { kind, asks, groups, text, repeats: 1, order: Some(&[]), ..Self::default() }
    }

    fn of(self, stimuli: &'p [Presented], surfaces: &'p [Name]) -> Self {
        Self { presents: (stimuli, surfaces), ..self }
    }

    fn gated(self, gates: &'p Named<Gate>, training: u32) -> Self {
        Self { gates: &gates.0, training, ..self }
    }

    fn ordered(self, order: Option<&'p [Level]>, repeats: u32) -> Self {
        Self { order, repeats, ..self }
    }

    fn varies(self, (surface, parameter): (&'p Name, &'p Name), standard: f64, levels: &'p [f64]) -> Self {
        Self { varied: Some(Varied { surface, parameter, standard, levels }), ..self }
    }

    /// True if a third stimulus, X, is one of the two.
    pub(crate) fn has_x(&self) -> bool {
        matches!(self.asks, Asks::WhichIsX(_))
    }

    /// Its value in the standard; 0 where nothing is varied.
    pub(crate) fn standard(&self) -> f64 {
        self.varied.map_or(0.0, |varied| varied.standard)
    }

    /// The extreme values of the varied parameter; `None` where there is none.
    pub(crate) fn extreme_levels(&self) -> Vec<Option<f64>> {
        let Some(Varied { standard, levels, .. }) = self.varied else { return vec![None] };
        let all = || levels.iter().copied().chain([standard]);
        vec![Some(all().fold(f64::INFINITY, f64::min)), Some(all().fold(f64::NEG_INFINITY, f64::max))]
    }
}

impl Phase {
    /// Name of its kind.
    pub fn kind(&self) -> &'static str {
        self.facts().kind
    }

    pub(crate) fn facts(&self) -> Facts<'_> {
        match self {
            Self::Practice(of) => {
                Facts::new("practice", Asks::Nothing, &of.groups, &of.text).of(&of.stimuli, &of.surfaces)
            }
            Self::Explore(of) => Facts::new("free exploration", Asks::Words(&of.ask), &of.groups, &of.text)
                .of(&of.stimuli, &of.surfaces)
                .gated(&of.opens_when, 0)
                .ordered(Some(&of.order), 1),
            Self::Rate(of) => Facts::new("ratings", Asks::Line, &of.groups, &of.text)
                .of(&of.stimuli, &of.surfaces)
                .gated(&of.opens_when, of.training)
                .ordered(Some(&of.order), of.repeats),
            Self::Compare(of) => {
                Facts::new("comparisons with the real surface", Asks::Line, &of.groups, &of.text)
                    .of(&[Presented::Real, ALL_VERSIONS], &of.surfaces)
                    .gated(&of.opens_when, of.training)
                    .ordered(Some(&of.order), of.repeats)
            }
            Self::Pairs(of) => Facts::new("pairs", Asks::Line, &of.groups, &of.text)
                .of(&of.stimuli, &of.surfaces)
                .gated(&of.opens_when, of.training)
                .ordered(None, 1),
            Self::TwoAlternative(of) => {
                let (kind, asks) =
                    if of.abx { ("ABX", Asks::WhichIsX(&of.ask)) } else { ("choices", Asks::Which(&of.ask)) };
                Facts::new(kind, asks, &of.groups, &of.text)
                    .of(&of.stimuli, &of.surfaces)
                    .gated(&of.opens_when, of.training)
                    .ordered(None, of.repeats)
            }
            Self::Break(of) => {
                let length_s = Some(of.at_least_s);
                Facts { length_s, ..Facts::new("break", Asks::Nothing, &of.groups, &of.text) }
            }
            Self::Record(of) => {
                let facts = Facts::new("recordings", Asks::Take, &of.groups, &of.text)
                    .of(&[Presented::Real], &of.surfaces)
                    .ordered(Some(&of.order), of.takes);
                Facts { length_s: Some(of.seconds), ..facts }
            }
            Self::Questions(of) => {
                Facts::new("questions", Asks::Question(&of.questions), &of.groups, &of.text)
            }
            Self::ConstantStimuli(of) => {
                Facts::new("constant stimuli", Asks::More(&of.ask), &of.groups, &of.text)
                    .gated(&of.opens_when, of.training)
                    .ordered(None, of.repeats)
                    .varies((&of.surface, &of.parameter), of.standard, &of.levels)
            }
            Self::Staircase(of) => Facts::new("staircase", Asks::More(&of.ask), &of.groups, &of.text)
                .ordered(None, of.at_most)
                .varies((&of.surface, &of.parameter), of.standard, &of.limits),
        }
    }
}

impl Study {
    /// What a phase presents, once each, in the order of the file.
    pub(crate) fn cells<'s>(&'s self, phase: &'s Phase) -> Box<dyn Iterator<Item = Trial> + 's> {
        let facts = phase.facts();
        let stimuli = self.stimuli(facts.presents.0, facts.presents.1);
        let one = |first| Trial { first: Some(first), ..Trial::default() };
        match phase {
            Phase::Questions(of) => {
                let question = |question| Trial { question: Some(question), ..Trial::default() };
                Box::new((0..of.questions.0.len()).map(question))
            }
            Phase::Practice(of) if of.stimuli.is_empty() => Box::new(once(Trial::default())),
            Phase::Break(_) => Box::new(once(Trial::default())),
            Phase::Practice(_) | Phase::Explore(_) | Phase::Record(_) => {
                Box::new(stimuli.into_iter().map(one))
            }
            Phase::Rate(of) => {
                let scales = Self::some(&of.scales, &self.scales).into_iter();
                Box::new(scales.flat_map(move |scale| {
                    let trial = move |stimulus| Trial { scale: Some(scale), ..one(stimulus) };
                    stimuli.clone().into_iter().map(trial)
                }))
            }
            Phase::Compare(of) => {
                let (scale, versions) = (self.scales.find(&of.scale.text), self.some_versions(&of.versions));
                let is_compared = move |of: &Stimulus| {
                    let is_real = self.surfaces.0[of.surface].1.sample.is_some();
                    is_real && of.version.is_some_and(|version| versions.contains(&version))
                };
                let real = |of| Some(Stimulus { version: None, ..of });
                let trial = move |of| Trial { scale, first: real(of), second: Some(of), ..Trial::default() };
                Box::new(stimuli.into_iter().filter(is_compared).map(trial))
            }
            Phase::Pairs(of) => {
                let scale = self.scales.find(&of.scale.text);
                Box::new(pairs_of(stimuli, true).map(move |trial| Trial { scale, ..trial }))
            }
            Phase::TwoAlternative(of) => Box::new(pairs_of(stimuli, of.across_surfaces)),
            Phase::ConstantStimuli(of) => {
                let trial = self.varied(&of.surface);
                Box::new(of.levels.iter().map(move |level| Trial { level: Some(*level), ..trial.clone() }))
            }
            Phase::Staircase(of) => Box::new(once(self.varied(&of.surface))),
        }
    }

    /// What is felt in a trial by its place: the left or earlier one, or A, first; X last.
    pub(crate) fn places(&self, trial: &Trial) -> Vec<Option<Stimulus>> {
        let mut places = vec![trial.first];
        places.extend(trial.second.map(Some));
        if trial.is_swapped {
            places.reverse();
        }
        places.extend(self.phases.0[trial.phase].1.facts().has_x().then_some(trial.first));
        places
    }

    /// A trial with the first version of a virtual surface twice.
    fn varied(&self, surface: &Name) -> Trial {
        let stimulus =
            self.surfaces.find(&surface.text).map(|surface| Stimulus { surface, version: Some(0) });
        Trial { first: stimulus, second: stimulus, ..Trial::default() }
    }
}

/// Every pair of some stimuli; those of different surfaces, too, or not.
fn pairs_of(stimuli: Vec<Stimulus>, across_surfaces: bool) -> impl Iterator<Item = Trial> {
    let count = stimuli.len();
    let pairs = (0..count).flat_map(move |first| (first + 1..count).map(move |second| (first, second)));
    let pairs = pairs.map(move |(first, second)| (stimuli[first], stimuli[second]));
    let pairs = pairs.filter(move |(first, second)| across_surfaces || first.surface == second.surface);
    pairs.map(|(first, second)| Trial { first: Some(first), second: Some(second), ..Trial::default() })
}
