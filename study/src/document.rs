//! The file of a study.

use haptograph_engine::choices;
use haptograph_engine::diagnostic::Diagnostic;
use haptograph_engine::document::value::{Body, Name, Shape, Tagged, Value};
use haptograph_engine::settings;
use haptograph_engine::settings::{Expected, Named, Reading, Setting, fields_of, unknown_choice};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units;
use std::path::PathBuf;

settings! {
    /// A study: what is felt, what is asked, and in which order.
    pub struct Study {
        /// What the study asks, in a sentence. The participant does not see it.
        about: String = String::new();
        /// The study of the thesis that it repeats, `4.5`: its numbers can then stand beside one's own.
        thesis: Option<String> = None;
        /// The graph that renders.
        graph: PathBuf;
        /// The set of endpoints of the graph.
        endpoints: String = "simulated".to_owned();
        /// Parameters of the graph that hold for the whole study.
        settings: Named<Value> = Named::default();
        /// The parameter of the graph that takes the file of a surface.
        surface_parameter: String = "surface".to_owned();
        /// Of the orders of all participants, together with their codes.
        seed: u64 = 0;
        /// Seconds from one answer to the next, without those that conditions ask for: by these `check` says how long a participant takes.
        trial_s: f64 = 15.0, in 0.0..=3600.0;
        /// Groups of participants, and the size of each.
        groups: Named<u32> = Named::default(), in 1..=10_000;
        /// The surfaces.
        surfaces: Named<SurfaceOf>;
        /// Versions of a virtual surface: parameters of the graph. Without any there is one, `virtual`.
        versions: Named<Named<Value>> = Named::default();
        /// Lines on which a participant marks an answer: 0 at the left end, 1 at the right one.
        scales: Named<Line> = Named::default();
        /// The phases, in their order.
        phases: Named<Phase>;
        /// Ports of the graph whose mean, deviation and largest magnitude are kept of each trial.
        measures: Vec<Name> = Vec::new();
        /// Why an actuator may give more than those of the thesis gave (0.5 A, 3.3 N): the experimenter's word.
        stronger_because: Option<String> = None;
        /// The participant's page.
        page: Option<Page> = None;
    }
}

settings! {
    /// A surface, virtual, real or both.
    pub struct SurfaceOf {
        /// Surface file; without it the surface is only real.
        file: Option<PathBuf> = None;
        /// What the experimenter lays out where a trial needs the real one; without it the surface is only virtual.
        sample: Option<String> = None;
    }
}

settings! {
    /// A line on which a participant marks an answer.
    pub struct Line {
        /// The question.
        ask: String;
        /// Its left end, 0.
        from: String;
        /// Its right end, 1.
        to: String;
    }
}

settings! {
    /// The participant's page.
    pub struct Page {
        /// The language of the texts, as in `de`, for programs that read them aloud.
        language: String = "en".to_owned();
        /// What differs from the English texts, by their names.
        texts: Named<String> = Named::default();
        /// A port of the graph that lights the lamp while it is not zero, such as a warning of too much force.
        lamp: Option<Name> = None;
        /// Noise on headphones while a trial is open.
        masking: Masking = Masking::Silence;
    }
}

/// The English texts of the participant's page, by their names.
pub(crate) fn texts() -> impl Iterator<Item = (&'static str, &'static str)> {
    include_str!("texts.txt").lines().filter_map(|line| line.split_once(": "))
}

choices! {
    /// Noise on headphones.
    pub enum Masking {
        /// None.
        Silence,
        /// Equal power in each octave.
        Pink,
        /// Equal power in each hertz.
        White,
    }
}

choices! {
    /// A phase of a study.
    pub enum Phase {
        /// Something to try, without an answer.
        Practice(Practice),
        /// Free exploration, with a description in words.
        Explore(Explore),
        /// One stimulus, one scale.
        Rate(Rate),
        /// A real surface beside a version of its virtual one.
        Compare(Compare),
        /// Two stimuli, every pair once.
        Pairs(Pairs),
        /// Two stimuli, of which one is chosen.
        TwoAlternative(TwoAlternative),
        /// A rest.
        Break(Break),
        /// A recording of a real surface, from which its virtual one is learned.
        Record(Record),
        /// Questions about the participant or the study.
        Questions(Questions),
        /// Which of two is more: levels of one parameter against a standard, each as often.
        ConstantStimuli(ConstantStimuli),
        /// Which of two is more: levels of one parameter against a standard, by the answers.
        Staircase(Staircase),
    }
}

settings! {
    /// A phase of practice.
    pub struct Practice {
        /// The groups that take part; all if empty.
        groups: Vec<Name> = Vec::new();
        /// The instruction.
        text: String = String::new();
        /// What is tried; with none, the graph as `settings` make it.
        stimuli: Vec<Presented> = Vec::new();
        /// Of these surfaces; all if empty.
        surfaces: Vec<Name> = Vec::new();
        /// Parameters of the graph in this phase.
        settings: Named<Value> = Named::default();
    }
}

settings! {
    /// A phase of free exploration.
    pub struct Explore {
        /// The groups that take part; all if empty.
        groups: Vec<Name> = Vec::new();
        /// The instruction.
        text: String = String::new();
        /// What is explored.
        stimuli: Vec<Presented> = vec![Presented::Real, Presented::Virtual(Version { version: None })];
        /// Of these surfaces; all if empty.
        surfaces: Vec<Name> = Vec::new();
        /// The question to be answered in words.
        ask: String = String::new();
        /// The order of trials, outermost first.
        order: Vec<Level> = vec![Level { arrange: Arrange::Shuffle, factor: Factor::Stimulus }];
        /// What has to be reached before the answer opens.
        opens_when: Named<Gate> = Named::default();
    }
}

settings! {
    /// A phase of ratings.
    pub struct Rate {
        /// The groups that take part; all if empty.
        groups: Vec<Name> = Vec::new();
        /// The instruction.
        text: String = String::new();
        /// What is rated.
        stimuli: Vec<Presented> = vec![Presented::Virtual(Version { version: None })];
        /// Of these surfaces; all if empty.
        surfaces: Vec<Name> = Vec::new();
        /// The scales; all if empty.
        scales: Vec<Name> = Vec::new();
        /// How often each is rated.
        repeats: u32 = 1, in 1..=1000;
        /// The order of trials, outermost first.
        order: Vec<Level> = vec![
            Level { arrange: Arrange::Shuffle, factor: Factor::Scale },
            Level { arrange: Arrange::Shuffle, factor: Factor::Stimulus },
        ];
        /// What has to be reached before the answer opens.
        opens_when: Named<Gate> = Named::default();
        /// Trials before, drawn from the phase's own, which are not analysed.
        training: u32 = 0, in 0..=1000;
    }
}

settings! {
    /// A phase of comparisons with the real surface.
    pub struct Compare {
        /// The groups that take part; all if empty.
        groups: Vec<Name> = Vec::new();
        /// The instruction.
        text: String = String::new();
        /// The scale.
        scale: Name;
        /// The versions; all if empty.
        versions: Vec<Name> = Vec::new();
        /// Of these surfaces; all that are real and virtual if empty.
        surfaces: Vec<Name> = Vec::new();
        /// The version with which the others are compared in the analysis; the first if none is named.
        reference: Option<Name> = None;
        /// Versions whose mean ratings differ by less count as the same: the bound of a test of equivalence.
        same_within: Option<f64> = None, in 1e-6..=1.0;
        /// How often each is compared.
        repeats: u32 = 1, in 1..=1000;
        /// The order of trials, outermost first.
        order: Vec<Level> = vec![
            Level { arrange: Arrange::Shuffle, factor: Factor::Surface },
            Level { arrange: Arrange::Shuffle, factor: Factor::Version },
        ];
        /// What has to be reached before the answer opens.
        opens_when: Named<Gate> = Named::default();
        /// Trials before, drawn from the phase's own, which are not analysed.
        training: u32 = 0, in 0..=1000;
    }
}

settings! {
    /// A phase of pairs: how different two stimuli are.
    pub struct Pairs {
        /// The groups that take part; all if empty.
        groups: Vec<Name> = Vec::new();
        /// The instruction.
        text: String = String::new();
        /// The scale.
        scale: Name;
        /// The end of the scale at which two stimuli are the same.
        same_is: End = End::From;
        /// What is compared.
        stimuli: Vec<Presented> = vec![Presented::Real, Presented::Virtual(Version { version: None })];
        /// Of these surfaces; all if empty.
        surfaces: Vec<Name> = Vec::new();
        /// What has to be reached before the answer opens.
        opens_when: Named<Gate> = Named::default();
        /// Trials before, drawn from the phase's own, which are not analysed.
        training: u32 = 0, in 0..=1000;
    }
}

settings! {
    /// A phase of choices between two stimuli.
    pub struct TwoAlternative {
        /// The groups that take part; all if empty.
        groups: Vec<Name> = Vec::new();
        /// The instruction.
        text: String = String::new();
        /// The question, which is answered by one of the two.
        ask: String;
        /// A third stimulus, X, is one of the two, A and B: which one is X?
        abx: bool = false;
        /// What is compared: every pair of a surface's stimuli.
        stimuli: Vec<Presented> = vec![Presented::Virtual(Version { version: None })];
        /// Of these surfaces; all if empty.
        surfaces: Vec<Name> = Vec::new();
        /// Pairs of different surfaces, too.
        across_surfaces: bool = false;
        /// How often each pair is compared.
        repeats: u32 = 1, in 1..=1000;
        /// What has to be reached before the answer opens.
        opens_when: Named<Gate> = Named::default();
        /// Trials before, drawn from the phase's own, which are not analysed.
        training: u32 = 0, in 0..=1000;
    }
}

settings! {
    /// A rest of the participant.
    pub struct Break {
        /// The groups that take part; all if empty.
        groups: Vec<Name> = Vec::new();
        /// What the participant reads.
        text: String = String::new();
        /// Its shortest length.
        at_least_s: f64 = 60.0, in 0.0..=7200.0;
    }
}

settings! {
    /// A phase of recordings (thesis 2.5.3): real surfaces, which a person explores with a recording tool.
    pub struct Record {
        /// The groups that take part; all if empty.
        groups: Vec<Name> = Vec::new();
        /// The instruction.
        text: String = String::new();
        /// Of these surfaces; all that have a sample if empty. `surface_parameter` gets the name of the surface.
        surfaces: Vec<Name> = Vec::new();
        /// Length of a take.
        seconds: f64 = 10.0, in 0.1..=3600.0;
        /// How often each surface is recorded.
        takes: u32 = 1, in 1..=1000;
        /// The order of trials, outermost first.
        order: Vec<Level> = vec![Level { arrange: Arrange::Shuffle, factor: Factor::Surface }];
    }
}

settings! {
    /// A phase of questions, on one screen.
    pub struct Questions {
        /// The groups that take part; all if empty.
        groups: Vec<Name> = Vec::new();
        /// The instruction.
        text: String = String::new();
        /// The questions; the name of each is the name of its answer in the data.
        questions: Named<Question>;
    }
}

choices! {
    /// A question.
    pub enum Question {
        /// An answer in words.
        Text(TextQuestion),
        /// A number.
        Number(NumberQuestion),
        /// One of several answers.
        Choice(ChoiceQuestion),
    }
}

settings! {
    /// A question that is answered in words.
    pub struct TextQuestion {
        /// The question.
        ask: String;
        /// True if it may stay empty.
        optional: bool = true;
    }
}

settings! {
    /// A question that is answered by a number.
    pub struct NumberQuestion {
        /// The question.
        ask: String;
        /// The smallest answer.
        from: f64;
        /// The largest answer.
        to: f64;
    }
}

settings! {
    /// A question with several answers.
    pub struct ChoiceQuestion {
        /// The question.
        ask: String;
        /// The answers.
        of: Vec<String>;
    }
}

settings! {
    /// A phase by the method of constant stimuli.
    pub struct ConstantStimuli {
        /// The groups that take part; all if empty.
        groups: Vec<Name> = Vec::new();
        /// The instruction.
        text: String = String::new();
        /// The question, which is answered by one of the two.
        ask: String;
        /// The surface.
        surface: Name;
        /// The parameter of the graph that differs between the two.
        parameter: Name;
        /// Its value in the standard.
        standard: f64;
        /// Its values in what is compared with it.
        levels: Vec<f64>;
        /// How often each level is compared.
        repeats: u32 = 10, in 1..=1000;
        /// What has to be reached before the answer opens.
        opens_when: Named<Gate> = Named::default();
        /// Trials before, drawn from the phase's own, which are not analysed.
        training: u32 = 0, in 0..=1000;
    }
}

settings! {
    /// A phase in which the level follows the answers.
    pub struct Staircase {
        /// The groups that take part; all if empty.
        groups: Vec<Name> = Vec::new();
        /// The instruction.
        text: String = String::new();
        /// The question, which is answered by one of the two.
        ask: String;
        /// The surface.
        surface: Name;
        /// The parameter of the graph that differs between the two.
        parameter: Name;
        /// Its value in the standard.
        standard: f64;
        /// The smallest and the largest level.
        limits: [f64; 2];
        /// How the level follows from the answers.
        method: Method;
        /// Largest number of trials.
        at_most: u32 = 60, in 1..=1000;
    }
}

choices! {
    /// How the level of a staircase follows from the answers.
    pub enum Method {
        /// Weighted up and down (Kaernbach 1991).
        UpDown(UpDown),
        /// The level whose answer is expected to tell most about threshold and slope (QUEST+, Watson 2017).
        QuestPlus,
    }
}

settings! {
    /// A staircase that moves by steps.
    pub struct UpDown {
        /// The first level.
        start: f64;
        /// The step upwards after a wrong answer, in the parameter, at each reversal the next; the last one stays.
        steps: Vec<f64>;
        /// The share of right answers at which the level settles: downwards the step is smaller by (1 - share) / share.
        share: f64 = 0.75, in 0.5..=0.95;
        /// It ends after so many reversals.
        reversals: u32 = 8, in 2..=100;
    }
}

choices! {
    /// What is presented of a surface.
    pub enum Presented {
        /// The real one.
        Real,
        /// The virtual one: one version, or all.
        Virtual(Version),
    }
}

settings! {
    /// A version of a virtual surface.
    pub struct Version {
        /// Its name; all versions if none is named.
        version: Option<Name> = None;
    }
}

choices! {
    /// An end of a scale.
    pub enum End {
        /// The left one.
        From,
        /// The right one.
        To,
    }
}

/// How the values of a factor are arranged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrange {
    /// At random.
    Shuffle,
    /// By a row of a Williams square, in which each value follows each other equally often.
    Latin,
    /// As in the file.
    Fixed,
}

/// What differs between trials.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Factor {
    /// The scale.
    Scale,
    /// The surface.
    Surface,
    /// The version, `Real` among them.
    Version,
    /// Surface and version.
    Stimulus,
}

/// One level of an order: `Shuffle(Surface)`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Level {
    /// How.
    pub arrange: Arrange,
    /// What.
    pub factor: Factor,
}

const ARRANGE: [(&str, Arrange); 3] =
    [("Shuffle", Arrange::Shuffle), ("Latin", Arrange::Latin), ("Fixed", Arrange::Fixed)];
const FACTORS: [(&str, Factor); 4] = [
    ("Scale", Factor::Scale),
    ("Surface", Factor::Surface),
    ("Version", Factor::Version),
    ("Stimulus", Factor::Stimulus),
];

/// The choice that a name makes; reports any other name.
fn chosen<T: Copy>(name: &Name, of: &[(&'static str, T)], reading: &mut Reading<'_>) -> Option<T> {
    let found = of.iter().find(|(known, _)| *known == name.text).map(|(_, choice)| *choice);
    if found.is_none() {
        let names: Vec<&'static str> = of.iter().map(|(known, _)| *known).collect();
        unknown_choice(&name.text, &names, name.span, reading);
    }
    found
}

impl Setting for Level {
    fn expected() -> Expected {
        Expected::described("an order such as `Shuffle(Surface)`".to_owned())
    }
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        if let Shape::Tagged(Tagged { name: Some(name), body: Body::Tuple(inner) }) = &value.shape
            && let [Value { shape: Shape::Tagged(Tagged { name: Some(of), body: Body::Bare }), .. }] =
                &inner[..]
        {
            let (arrange, factor) = (chosen(name, &ARRANGE, reading), chosen(of, &FACTORS, reading));
            return Some(Self { arrange: arrange?, factor: factor? });
        }
        reading.mismatch(value, &Self::expected());
        None
    }
    fn value(&self) -> Value {
        let arrange = ARRANGE.iter().find(|(_, known)| *known == self.arrange).map_or("", |(name, _)| name);
        let factor = FACTORS.iter().find(|(_, known)| *known == self.factor).map_or("", |(name, _)| name);
        let body = Body::Tuple(vec![Value::name(factor)]);
        Shape::Tagged(Tagged { name: Some(arrange.into()), body }).into()
    }
}

/// What has to be reached before an answer opens: `(port: "dwell.slow_light", at_least_s: 5)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Gate {
    /// The port of the graph; what it gains during the trial counts.
    pub port: Name,
    /// How much, SI.
    pub at_least: f64,
    /// In this quantity.
    pub quantity: Quantity,
    /// The field as written, `at_least_cm`, and its number.
    pub written: (Name, f64),
}

impl Setting for Gate {
    fn expected() -> Expected {
        Expected::described("a port and a number, (port: \"node.output\", at_least_s: 5)".to_owned())
    }
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        let mut fields = fields_of(value, "a condition", reading)?;
        let port: Option<Name> = fields.setting("port", None, None, reading);
        let least = fields.remaining().find(|(name, _)| name.text.starts_with("at_least")).cloned();
        let Some((name, number)) = least else {
            fields.setting::<f64>("at_least", None, None, reading);
            fields.finish(reading);
            return None;
        };
        fields.take(name.text.clone());
        fields.finish(reading);
        let number = f64::read(&number, reading)?;
        let unit = match name.text.strip_prefix("at_least") {
            Some("") => Some((Quantity::NUMBER, 1.0)),
            _ => units::of_name(&name.text).and_then(|unit| unit.scale),
        };
        let Some((quantity, si)) = unit else {
            let wrong = Diagnostic::error("E0204", name.span, format!("`{}` has no known unit", name.text));
            let help = "write `at_least_s`, `at_least_mm`, `at_least_n`, or `at_least` for what is counted";
            reading.diagnostics.push(wrong.label("no known unit").help(help));
            return None;
        };
        Some(Self { port: port?, at_least: number * si, quantity, written: (name, number) })
    }
    fn value(&self) -> Value {
        let (name, number) = &self.written;
        let fields = [("port".into(), self.port.value()), (name.clone(), number.value())];
        Shape::Tagged(Tagged { name: None, body: Body::Fields(fields.into()) }).into()
    }
}
