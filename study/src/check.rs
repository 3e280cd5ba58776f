//! Reading and checking of a study: its names first, then its graph with each version.

use crate::analyse::REPEATED_STUDIES;
use crate::data::{DataError, Identity, Row, check_code};
use crate::document::{Arrange, Factor, Gate, Method, Phase, Presented, Question, Study, SurfaceOf, texts};
use crate::order::{Stimulus, Trial, distinct, square_rows};
use haptograph_engine::diagnostic::{Diagnostic, Diagnostics, Span};
use haptograph_engine::document::value::Name;
use haptograph_engine::document::{Document, LoadOptions, SettingsFile};
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::node::Limit;
use haptograph_engine::registry::Registry;
use haptograph_engine::settings::{Named, Setting, closest};
use haptograph_signal::files::{self, MAX_GRAPH_BYTES};
use haptograph_signal::noise::stream_seed;
use haptograph_signal::quantity::Quantity;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// Largest peaks that the actuators of the thesis gave: of a voice coil, A, and of the arm, N.
const PEAKS: [(Quantity, f64); 2] = [(Quantity::CURRENT, 0.5), (Quantity::FORCE, 3.3)];

/// Largest number of trials of a phase.
const MOST_TRIALS: usize = 10_000;

/// A study that cannot run.
#[derive(Debug, Clone, thiserror::Error)]
pub enum StudyError {
    /// The file of the study is wrong.
    #[error("{0}")]
    Study(Diagnostics),
    /// The graph is wrong with these parameters.
    #[error("the graph does not take {of}:\n{findings}")]
    Graph {
        /// What was presented.
        of: String,
        /// The graph's findings.
        findings: Diagnostics,
    },
    /// A limit of the graph is above those of the thesis.
    #[error(
        "actuator `{actuator}` may give {peak} {unit}, more than the thesis's {usual} {unit}; lower its limit, or give the reason in `stronger_because`"
    )]
    TooStrong {
        /// The sink.
        actuator: String,
        /// Its peak.
        peak: f64,
        /// The thesis's.
        usual: f64,
        /// Of both.
        unit: String,
    },
    /// A run of the graph failed.
    #[error("{0}")]
    Run(String),
    /// The folder of the data.
    #[error(transparent)]
    Data(#[from] DataError),
}

/// A study whose names are right.
#[derive(Debug, Clone)]
pub struct Checked {
    /// The study.
    pub study: Study,
    /// Its file.
    pub path: PathBuf,
    /// The graph as written.
    pub document: Document,
    file: SettingsFile<Study>,
}

/// The SHA-256 hash of some bytes.
pub(crate) fn hash(bytes: &[u8]) -> String {
    files::hex(&Sha256::digest(bytes))
}

/// The surface files of a folder.
fn surfaces_of(folder: &Path) -> Result<Named<SurfaceOf>, StudyError> {
    let files = files::list(folder).into_iter().filter(|path| path.extension().is_some_and(|of| of == "ron"));
    let surface = |path: PathBuf| {
        let name = path.file_stem()?.to_string_lossy().into_owned();
        Some((Name::from(name.as_str()), SurfaceOf { file: Some(path), sample: Some(name) }))
    };
    let surfaces: Vec<(Name, SurfaceOf)> = files.filter_map(surface).collect();
    let message = || format!("there is no surface file (.ron) in {}", folder.display());
    if surfaces.is_empty() { Err(StudyError::Run(message())) } else { Ok(Named(surfaces)) }
}

impl Checked {
    /// Reads a study and its graph, and checks all names. With a folder of surfaces, each of its files takes the place of the
    /// study's surfaces, its name that of the real sample.
    ///
    /// # Errors
    /// With every problem of the file.
    pub fn load(path: &Path, surfaces: Option<&Path>) -> Result<Self, StudyError> {
        let text = files::read_text(path, MAX_GRAPH_BYTES)
            .map_err(|error| StudyError::Run(format!("cannot read {}: {error}", path.display())))?;
        Self::parse(path, &text, surfaces)
    }

    /// The same with this text in place of the file's.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn parse(path: &Path, text: &str, surfaces: Option<&Path>) -> Result<Self, StudyError> {
        let mut file = SettingsFile::<Study>::parse(path, text, "a study").map_err(StudyError::Study)?;
        if let Some(folder) = surfaces {
            file.content.surfaces = surfaces_of(folder)?;
        }
        let wrong = Names { study: &file.content, list: Vec::new() }.check();
        if !wrong.is_empty() {
            return Err(StudyError::Study(Diagnostics { sources: file.sources, list: wrong }));
        }
        let document =
            Document::load(&file.content.graph, &LoadOptions::default()).map_err(StudyError::Study)?;
        let study = file.content.clone();
        Ok(Self { study, path: path.to_path_buf(), document, file })
    }

    /// Name of a stimulus: `canvas, real`.
    pub fn name(&self, stimulus: Stimulus) -> String {
        let surface = &self.study.surfaces.0[stimulus.surface].0.text;
        match stimulus.version {
            None => format!("{surface}, real"),
            Some(version) => format!("{surface}, {}", self.study.version_name(version)),
        }
    }

    /// The line of a trial, but for its answer.
    pub fn row(&self, trial: &Trial) -> Row {
        let rendered = [trial.second, trial.first].into_iter().flatten().find(|of| of.version.is_some());
        let file = rendered.and_then(|of| self.study.surfaces.0[of.surface].1.file.as_ref());
        let surface_sha256 = file.and_then(|file| files::read(file, u64::MAX).ok());
        let surface_sha256 = surface_sha256.map_or_else(String::new, |bytes| hash(&bytes));
        Row { surface_sha256, ..self.row_without_hash(trial) }
    }

    /// The same without reading the surface.
    pub(crate) fn row_without_hash(&self, trial: &Trial) -> Row {
        let study = &self.study;
        let surface =
            |of: Option<Stimulus>| of.map_or("", |of| &study.surfaces.0[of.surface].0.text).to_owned();
        let version = |of: Option<Stimulus>| {
            of.map_or("", |of| of.version.map_or("real", |version| study.version_name(version))).to_owned()
        };
        let (name, phase) = &study.phases.0[trial.phase];
        let question = match (phase, trial.question) {
            (Phase::Questions(phase), Some(at)) => {
                phase.questions.0.get(at).map(|(name, _)| name.text.clone())
            }
            _ => None,
        };
        let scale = trial.scale.and_then(|at| study.scales.0.get(at)).map(|(name, _)| name.text.clone());
        let x = phase.facts().has_x().then(|| format!("X is {}", ["A", "B"][usize::from(trial.is_swapped)]));
        Row {
            trial: trial.number,
            phase: name.text.clone(),
            training: trial.is_training,
            scale: scale.or(question).or(x).unwrap_or_default(),
            first_surface: surface(trial.first),
            first_version: version(trial.first),
            second_surface: surface(trial.second),
            second_version: version(trial.second),
            second_is_left_or_earlier: trial.is_swapped,
            level: trial.level,
            ..Row::default()
        }
    }

    /// The parameters of the graph with which it renders a stimulus of a phase, as RON.
    pub fn parameters(
        &self,
        phase: &Phase,
        (stimulus, level): (Option<Stimulus>, Option<f64>),
    ) -> Vec<(String, String)> {
        let mut all: Vec<(String, String)> = Vec::new();
        let mut set = |name: &str, value: String| {
            all.retain(|(known, _)| known != name);
            all.push((name.to_owned(), value));
        };
        let version = stimulus.and_then(|stimulus| self.study.versions.0.get(stimulus.version?));
        let practised = if let Phase::Practice(of) = phase { Some(&of.settings) } else { None };
        let maps = [Some(&self.study.settings), version.map(|(_, values)| values), practised];
        for (name, value) in maps.into_iter().flatten().flat_map(|values| &values.0) {
            set(&name.text, value.show());
        }
        let file = stimulus.and_then(|stimulus| self.study.surfaces.0[stimulus.surface].1.file.as_ref());
        if let Some(file) = file {
            // The graph's paths are relative to the graph.
            let file = std::path::absolute(file).unwrap_or_else(|_| file.clone());
            set(&self.study.surface_parameter, file.display().to_string());
        }
        if let (Phase::Record(_), Some(of)) = (phase, stimulus) {
            set(&self.study.surface_parameter, self.study.surfaces.0[of.surface].0.text.clone());
        }
        if let (Some(level), Some(varied)) = (level, phase.facts().varied) {
            set(&varied.parameter.text, level.show());
        }
        all
    }

    /// The graph that renders a stimulus of a phase.
    ///
    /// # Errors
    /// With the graph's findings.
    pub fn graph(
        &self,
        registry: &Registry,
        phase: &Phase,
        (stimulus, level): (Option<Stimulus>, Option<f64>),
        seed: u64,
    ) -> Result<Graph, StudyError> {
        let mut options = CheckOptions::default().endpoints(self.study.endpoints.clone()).seed(seed);
        options.set = self.parameters(phase, (stimulus, level));
        check(&self.document, registry, &options).map_err(|findings| {
            let of = stimulus.map_or_else(|| "the study's settings".to_owned(), |of| self.name(of));
            StudyError::Graph { of, findings }
        })
    }

    /// Checks the graph with each version, the ports of the study, and the actuators' limits.
    ///
    /// # Errors
    /// With the first findings.
    pub fn check_graph(&self, registry: &Registry) -> Result<(), StudyError> {
        let mut limits = Vec::new();
        let surfaces = self.study.surfaces.0.iter().enumerate();
        let rendered: Vec<usize> =
            surfaces.filter(|(_, (_, of))| of.file.is_some()).map(|(at, _)| at).collect();
        for (number, (_, phase)) in self.study.phases.0.iter().enumerate() {
            let named = phase.facts().varied.and_then(|of| self.study.surfaces.find(&of.surface.text));
            let first = named.or(rendered.first().copied());
            for version in 0..self.study.version_count() {
                let stimulus = first.map(|surface| Stimulus { surface, version: Some(version) });
                for level in phase.facts().extreme_levels() {
                    let graph = self.graph(registry, phase, (stimulus, level), 0)?;
                    self.check_ports(&graph, phase)?;
                    self.check_limits(&graph, &mut limits)?;
                }
            }
            // Every surface once.
            let others = rendered.iter().filter(|_| number == 0).filter(|surface| Some(**surface) != first);
            for surface in others {
                let stimulus = Stimulus { surface: *surface, version: Some(0) };
                let graph =
                    self.graph(registry, phase, (Some(stimulus), phase.facts().extreme_levels()[0]), 0)?;
                self.check_limits(&graph, &mut limits)?;
            }
        }
        Ok(())
    }

    fn check_ports(&self, graph: &Graph, phase: &Phase) -> Result<(), StudyError> {
        let lamp = self.study.page.as_ref().and_then(|page| page.lamp.as_ref());
        let gates = phase.facts().gates.iter();
        let plain = lamp.into_iter().chain(&self.study.measures).map(|port| (port, None));
        let ports = gates.map(|(_, gate)| (&gate.port, Some(gate))).chain(plain);
        let mut list = Vec::new();
        for (port, gate) in ports {
            let found = match graph.find_output(&port.text) {
                Ok((node, output)) => graph.nodes().get(node).and_then(|node| node.outputs.get(output)),
                Err(unknown) => {
                    let wrong = Diagnostic::error("E0203", port.span, unknown.to_string());
                    list.push(wrong.label("not an output of the graph"));
                    continue;
                }
            };
            if let (Some(found), Some(Gate { quantity, written: (field, _), .. })) = (found, gate)
                && found.quantity != *quantity
            {
                let message = format!("`{}` is a {}, not a {quantity}", port.text, found.quantity);
                let wrong = Diagnostic::error("E0404", field.span, message);
                list.push(wrong.label(format!("the unit of a {quantity}")));
            }
        }
        let sources = self.file.sources.clone();
        if list.is_empty() { Ok(()) } else { Err(StudyError::Study(Diagnostics { sources, list })) }
    }

    /// People are at the other end: nothing above what the thesis gave them without the experimenter's word, and no version with other
    /// limits than the experimenter confirms.
    fn check_limits(&self, graph: &Graph, known: &mut Vec<(String, Limit)>) -> Result<(), StudyError> {
        for (node, _, limit) in graph.actuators() {
            let quantity = node.outputs.first().map(|output| output.quantity);
            let unit = quantity.map_or_else(String::new, Quantity::unit);
            let (actuator, peak) = (node.path.clone(), limit.peak);
            match known.iter().find(|(path, _)| *path == actuator) {
                Some((_, before)) if *before != limit => {
                    let of =
                        |limit: &Limit| format!("{} {unit} and {} {unit} RMS", limit.peak, limit.continuous);
                    return Err(StudyError::Run(format!(
                        "the limits of actuator `{actuator}` differ between trials: {} and {}; give it one limit",
                        of(before),
                        of(&limit)
                    )));
                }
                Some(_) => {}
                None => known.push((actuator.clone(), limit)),
            }
            let usual = PEAKS.iter().find(|(known, _)| Some(*known) == quantity);
            if let Some((_, usual)) = usual.filter(|(_, usual)| peak > *usual)
                && self.study.stronger_because.is_none()
            {
                return Err(StudyError::TooStrong { actuator, peak, usual: *usual, unit });
            }
        }
        Ok(())
    }

    /// What a folder with data of this study belongs to; with the parameters of simulated people.
    pub fn identity(&self, simulated: Option<String>) -> Identity {
        let texts = self.document.sources().iter().map(|source| source.text.as_bytes());
        let text = self.file.sources.iter().next().map_or_else(String::new, |source| source.text.to_string());
        let surface = |(name, of): &(Name, SurfaceOf)| {
            let bytes = of.file.as_ref().and_then(|file| files::read(file, u64::MAX).ok());
            (name.text.clone(), bytes.map_or_else(String::new, |bytes| hash(&bytes)))
        };
        Identity {
            about: self.study.about.clone(),
            endpoints: self.study.endpoints.clone(),
            haptograph: env!("CARGO_PKG_VERSION"),
            study: self.path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            study_sha256: hash(text.as_bytes()),
            text,
            graph_sha256: hash(&texts.collect::<Vec<_>>().concat()),
            surface_sha256: self.study.surfaces.0.iter().map(surface).collect(),
            simulated,
        }
    }

    /// Checks the code of a participant.
    ///
    /// # Errors
    /// If it is no code, or has no number where an order takes the row of a Latin square by it.
    pub fn check_code(&self, code: &str) -> Result<(), DataError> {
        check_code(code)?;
        let is_latin = |(_, phase): &(Name, Phase)| {
            phase.facts().order.into_iter().flatten().any(|level| level.arrange == Arrange::Latin)
        };
        let has_number = code.ends_with(|c: char| c.is_ascii_digit());
        let is_lacking = !has_number && self.study.phases.0.iter().any(is_latin);
        if is_lacking { Err(DataError::NoNumber { code: code.to_owned() }) } else { Ok(()) }
    }

    /// What the study renders: the phase, the stimulus and the level of the varied parameter, once for the same parameters.
    pub fn rendered(&self) -> Vec<(usize, Stimulus, Option<f64>)> {
        let (mut all, mut seen) = (Vec::new(), Vec::new());
        for trial in (0..self.study.group_count()).flat_map(|group| self.study.trials("1", group)) {
            let phase = &self.study.phases.0[trial.phase].1;
            let stimuli = [trial.first, trial.second].into_iter().flatten().filter(|of| of.version.is_some());
            for (stimulus, level) in stimuli.flat_map(|stimulus| {
                phase.facts().extreme_levels().into_iter().map(move |level| (stimulus, level))
            }) {
                let parameters = self.parameters(phase, (Some(stimulus), level));
                if !seen.contains(&parameters) {
                    seen.push(parameters);
                    all.push((trial.phase, stimulus, level));
                }
            }
        }
        all.sort_by_key(|(phase, of, _)| (*phase, of.surface, of.version));
        all
    }

    /// Seed of the run of a trial: of the study, the participant and the trial alone. Its second and third stimulus have the next ones.
    pub fn seed_of(&self, participant: &str, trial: &Trial) -> u64 {
        stream_seed(self.study.seed, &format!("{participant}/{}", trial.number))
    }
}

/// The error of a name that a study does not have.
pub(crate) fn unknown_name(name: &Name, what: &str, known: &[&str]) -> Diagnostic {
    let message = format!("the study has no {what} `{}`", name.text);
    let wrong = Diagnostic::error("E0303", name.span, message).label(format!("unknown {what}"));
    match closest(&name.text, known.iter().copied()) {
        Some(near) => wrong.help(format!("did you mean `{near}`?")),
        None if known.is_empty() => wrong.help(format!("it has none; declare it in `{what}s`")),
        None => wrong.help(format!("it has {}", known.join(", "))),
    }
}

/// The check of names.
struct Names<'s> {
    study: &'s Study,
    list: Vec<Diagnostic>,
}

impl Names<'_> {
    fn check(mut self) -> Vec<Diagnostic> {
        let study = self.study;
        for (name, phase) in &study.phases.0 {
            self.known(phase.facts().groups, &study.groups, "group");
            self.names_of(phase);
            self.order(name, phase);
            if phase.facts().has_x() && phase.facts().presents.0.contains(&Presented::Real) {
                let message = format!("phase `{}` has a real X: which one it is can be seen", name.text);
                self.wrong("E0304", name, [&message, "of this phase", "write `stimuli: [Virtual]`"]);
            }
            // Counted, not made: there may be more than memory holds.
            let cells = || study.cells(phase).take(MOST_TRIALS + 1).count();
            let trials = cells().saturating_mul(phase.facts().repeats as usize);
            if self.list.is_empty() && !(1..=MOST_TRIALS).contains(&trials) {
                let count = if trials == 0 { "no" } else { "too many" };
                let message =
                    format!("phase `{}` has {count} trials; 1 to {MOST_TRIALS} are possible", name.text);
                let help = "a real surface needs `sample`, a virtual one `file`, and a rating a scale";
                self.wrong("E0304", name, [&message, "none, or too many", help]);
            }
        }
        if study.phases.0.is_empty() {
            let wrong = Diagnostic::error("E0304", Span::default(), "the study has no phases");
            self.list.push(wrong.help("add one: phases: { \"rating\": Rate() }"));
        }
        if let Some(number) = study.thesis.as_deref().filter(|number| !REPEATED_STUDIES.contains(number)) {
            let message = format!("`thesis`: there is no study `{number}` to repeat");
            let wrong = Diagnostic::error("E0304", Span::default(), message);
            self.list.push(wrong.help(format!("it has {}", REPEATED_STUDIES.join(", "))));
        }
        study.surfaces.0.iter().for_each(|(name, of)| self.surface(name, of));
        self.plain(&study.surfaces);
        self.plain(&study.versions);
        self.plain(&study.scales);
        self.plain(&study.groups);
        self.plain(&study.phases);
        let texts: Vec<&str> = texts().map(|(name, _)| name).collect();
        let own = study.page.iter().flat_map(|page| &page.texts.0);
        let unknown = own.filter(|(name, _)| !texts.contains(&&*name.text));
        self.list.extend(unknown.map(|(name, _)| unknown_name(name, "text", &texts)));
        if let Some((name, _)) = study.versions.0.iter().find(|(name, _)| name.text == "real") {
            let wrong = Diagnostic::error("E0211", name.span, "a version cannot be called `real`");
            self.list.push(wrong.label("so are the real surfaces in the data"));
        }
        self.list
    }

    /// Reports what is wrong with something named.
    fn wrong(&mut self, code: &'static str, at: &Name, [message, label, help]: [&str; 3]) {
        self.list.push(Diagnostic::error(code, at.span, message).label(label).help(help));
    }

    /// The surfaces, versions and scales of a phase.
    fn names_of(&mut self, phase: &Phase) {
        let study = self.study;
        let (presented, surfaces) = phase.facts().presents;
        self.known(surfaces, &study.surfaces, "surface");
        for presented in presented {
            if let Presented::Virtual(of) = presented {
                self.known(&of.version, &study.versions, "version");
            }
        }
        if let Some(varied) = phase.facts().varied {
            self.rendered(varied.surface);
        }
        match phase {
            Phase::Rate(of) => self.known(&of.scales, &study.scales, "scale"),
            Phase::Compare(of) => {
                self.known(&of.versions, &study.versions, "version");
                self.known(&of.reference, &study.versions, "version");
                self.known([&of.scale], &study.scales, "scale");
                if let Some(reference) = &of.reference
                    && !(of.versions.is_empty() || of.versions.iter().any(|name| name.text == reference.text))
                {
                    let message = format!("`{}` is none of the versions of this phase", reference.text);
                    self.list.push(Diagnostic::error("E0303", reference.span, message).label("not compared"));
                }
            }
            Phase::Pairs(of) => self.known([&of.scale], &study.scales, "scale"),
            Phase::Questions(of) => {
                self.plain(&of.questions);
                of.questions.0.iter().for_each(|(name, question)| self.question(name, question));
            }
            Phase::Staircase(of) => self.staircase(of),
            _ => {}
        }
    }

    /// Refuses a surface that cannot be read, and one that is neither virtual nor real.
    fn surface(&mut self, name: &Name, of: &SurfaceOf) {
        if let Some(file) = of.file.as_ref().filter(|file| !files::is_file(file)) {
            let message = format!("cannot read `{}`: there is no such file", file.display());
            let near = files::similar(file).map(|near| format!("did you mean `{near}`?"));
            let help = near.unwrap_or_else(|| "paths are relative to the study".to_owned());
            self.wrong("E0108", name, [&message, "of this surface", &help]);
        }
        let message = match (&of.file, &of.sample) {
            (_, Some(sample)) if sample.trim().is_empty() => "the `sample` is empty",
            (None, None) => "the surface is neither virtual nor real",
            _ => return,
        };
        let help = "give it a `file`, or a `sample` that the experimenter can lay out";
        self.wrong("E0205", name, [message, "of this surface", help]);
    }

    /// Refuses names that break the lines of a table.
    fn plain<T>(&mut self, names: &Named<T>) {
        for (name, _) in &names.0 {
            if name.text.trim().is_empty() || name.text.chars().any(char::is_control) {
                let message = format!("`{}` cannot be a name in the data", name.text.escape_debug());
                self.list.push(
                    Diagnostic::error("E0211", name.span, message).label("empty, or with control characters"),
                );
            }
        }
    }

    fn question(&mut self, name: &Name, question: &Question) {
        let wrong = match question {
            Question::Number(of) if of.from >= of.to => "`from` is not below `to`",
            Question::Choice(of) if of.of.len() < 2 => "a choice needs two answers at least",
            Question::Choice(of) if of.of.iter().any(|one| one.chars().any(char::is_control)) => {
                "an answer has control characters"
            }
            _ => return,
        };
        self.list.push(Diagnostic::error("E0304", name.span, wrong).label("of this question"));
    }

    /// A phase that varies a parameter of a surface renders it.
    fn rendered(&mut self, surface: &Name) {
        let study = self.study;
        self.known([surface], &study.surfaces, "surface");
        if study.surfaces.find(&surface.text).is_some_and(|at| study.surfaces.0[at].1.file.is_none()) {
            let message = format!("surface `{}` is only real", surface.text);
            self.wrong("E0304", surface, [&message, "cannot be rendered", "give it a `file`"]);
        }
    }

    fn staircase(&mut self, of: &crate::document::Staircase) {
        let [least, most] = of.limits;
        let is_within = |level: &f64| (least..=most).contains(level);
        let can_move = match &of.method {
            Method::UpDown(of) => {
                is_within(&of.start) && !of.steps.is_empty() && of.steps.iter().all(|step| *step > 0.0)
            }
            Method::QuestPlus => least < most,
        };
        if !is_within(&of.standard) || !can_move {
            let help = "`standard` and `start` lie within `limits`, and each of `steps` is above zero";
            self.wrong("E0304", &of.parameter, ["the staircase cannot move", "of this parameter", help]);
        }
    }

    /// Reports names that `of` does not have.
    fn known<'n, T>(&mut self, names: impl IntoIterator<Item = &'n Name>, of: &Named<T>, what: &str) {
        let mut seen: Vec<&Name> = Vec::new();
        for name in names {
            if seen.iter().any(|known| known.text == name.text) {
                let message = format!("{what} `{}` is named twice", name.text);
                self.list.push(Diagnostic::error("E0105", name.span, message).label("named again here"));
            }
            seen.push(name);
            if of.find(&name.text).is_some() {
                continue;
            }
            let known: Vec<&str> = of.0.iter().map(|(name, _)| name.text.as_str()).collect();
            self.list.push(unknown_name(name, what, &known));
        }
    }

    /// An order that names a factor twice, or one that is within another.
    fn order(&mut self, name: &Name, phase: &Phase) {
        let factors: Vec<Factor> =
            phase.facts().order.into_iter().flatten().map(|level| level.factor).collect();
        let count = |wanted: Factor| factors.iter().filter(|factor| **factor == wanted).count();
        let is_both = count(Factor::Stimulus) > 0 && count(Factor::Surface) + count(Factor::Version) > 0;
        let is_twice = factors.iter().any(|factor| count(*factor) > 1);
        if is_both || is_twice {
            let message = format!("the order of phase `{}` has a factor twice", name.text);
            let help = "`Stimulus` is surface and version together; name each factor once";
            self.wrong("E0304", name, [&message, "of this phase", help]);
        }
    }
}

impl Study {
    /// Number of participants of a group that balances every Latin square of its phases, or a multiple does; `None` without a square.
    pub fn balanced_by(&self, group: usize) -> Option<usize> {
        let mut all = None;
        let trials = self.trials("1", group);
        for (number, (_, phase)) in self.phases.0.iter().enumerate() {
            let of_phase = || trials.iter().filter(|trial| trial.phase == number);
            let squares =
                phase.facts().order.into_iter().flatten().filter(|level| level.arrange == Arrange::Latin);
            let rows = squares.map(|level| square_rows(distinct(of_phase(), level.factor).len()));
            // Squares of a phase are crossed; phases take the same number.
            if let Some(rows) = rows.reduce(usize::saturating_mul) {
                let both = |before: usize| (before / common(before, rows)).saturating_mul(rows);
                all = Some(all.map_or(rows, both));
            }
        }
        all
    }

    /// How long trials take, s: `trial_s` each, and what the conditions of each virtual stimulus ask for in seconds, one after the other.
    pub fn duration_s(&self, trials: &[Trial]) -> f64 {
        let conditions_s = |trial: &Trial| {
            let gates = self.phases.0[trial.phase].1.facts().gates.iter();
            let of_time = gates.filter(|(_, gate)| gate.quantity == Quantity::TIME);
            let stimuli = self.places(trial).into_iter().flatten().filter(|of| of.version.is_some());
            of_time.map(|(_, gate)| gate.at_least).sum::<f64>() * stimuli.count().max(1) as f64
        };
        let length_s = |trial: &Trial| match &self.phases.0[trial.phase].1 {
            Phase::Break(of) => of.at_least_s,
            phase => self.trial_s + phase.facts().length_s.unwrap_or_else(|| conditions_s(trial)),
        };
        trials.iter().map(length_s).sum()
    }

    /// The surfaces of a phase that lack what it presents of others: a `sample` for the real one, a `file` for the virtual one.
    pub fn lacking(&self, phase: &Phase) -> Vec<&str> {
        let (presented, surfaces) = phase.facts().presents;
        let lacks = |of: &SurfaceOf| {
            presented.iter().any(|presented| match presented {
                Presented::Real => of.sample.is_none(),
                Presented::Virtual(_) => of.file.is_none(),
            })
        };
        let some = Self::some(surfaces, &self.surfaces).into_iter().map(|at| &self.surfaces.0[at]);
        some.filter(|(_, of)| lacks(of)).map(|(name, _)| name.text.as_str()).collect()
    }
}

/// The greatest common divisor.
fn common(a: usize, b: usize) -> usize {
    if b == 0 { a.max(1) } else { common(b, a % b) }
}
