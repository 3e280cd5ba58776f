//! Reading and checking of a study: its names first, then its graph with each version.

use crate::document::{Arrange, Factor, Gate, Phase, Presented, Question, Study, SurfaceOf};
use crate::order::{Stimulus, Trial, square_rows};
use haptograph_engine::diagnostic::{Diagnostic, Diagnostics, Span};
use haptograph_engine::document::value::Name;
use haptograph_engine::document::{Document, LoadOptions, SettingsFile};
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::registry::Registry;
use haptograph_engine::settings::{Named, Setting, closest};
use haptograph_signal::files::{self, MAX_GRAPH_BYTES};
use haptograph_signal::noise::stream_seed;
use haptograph_signal::quantity::Quantity;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Largest peaks that the actuators of the thesis gave (A for a voice coil, 3.3 N for the arm).
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
    Data(#[from] crate::data::DataError),
}

/// A study whose names are right.
#[derive(Debug, Clone)]
pub struct Checked {
    /// The study.
    pub study: Study,
    /// Its file.
    pub path: PathBuf,
    /// SHA-256 of the text.
    pub sha256: String,
    /// The graph as written.
    pub document: Document,
    file: SettingsFile<Study>,
}

/// SHA-256 in hexadecimal digits.
pub(crate) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// The surface files of a folder.
fn surfaces_of(folder: &Path) -> Result<Named<SurfaceOf>, StudyError> {
    let files = files::list(folder).into_iter().filter(|path| path.extension().is_some_and(|of| of == "ron"));
    let surface = |path: PathBuf| {
        let name = path.file_stem()?.to_string_lossy().into_owned();
        Some((Name::from(name.as_str()), SurfaceOf { file: Some(path), sample: Some(name) }))
    };
    let surfaces: Vec<(Name, SurfaceOf)> = files.filter_map(surface).collect();
    match surfaces.is_empty() {
        true => Err(StudyError::Run(format!("there is no surface file (.ron) in {}", folder.display()))),
        false => Ok(Named(surfaces)),
    }
}

impl Checked {
    /// Reads a study and its graph, and checks all names. With a folder of surfaces, each of its files takes the place of the
    /// study's surfaces, its name that of the real sample.
    ///
    /// # Errors
    /// With every problem of the file.
    pub fn load(path: &Path, surfaces: Option<&Path>) -> Result<Self, StudyError> {
        let mut text = files::read_text(path, MAX_GRAPH_BYTES)
            .map_err(|error| StudyError::Run(format!("cannot read {}: {error}", path.display())))?;
        let mut file = SettingsFile::<Study>::parse(path, &text, "a study").map_err(StudyError::Study)?;
        if let Some(folder) = surfaces {
            file.content.surfaces = surfaces_of(folder)?;
            text += &file.content.surfaces.show();
        }
        let wrong = Names { study: &file.content, list: Vec::new() }.check();
        if !wrong.is_empty() {
            return Err(StudyError::Study(Diagnostics { sources: file.sources, list: wrong }));
        }
        let document = Document::load(&file.content.graph, &LoadOptions::default())
            .map_err(|findings| StudyError::Graph { of: "any parameter".to_owned(), findings })?;
        let study = file.content.clone();
        Ok(Self { study, path: path.to_path_buf(), sha256: sha256(text.as_bytes()), document, file })
    }

    /// The text of the file.
    pub fn text(&self) -> &str {
        self.file.sources.iter().next().map_or("", |source| &source.text)
    }

    /// Name of a stimulus: `canvas, real`.
    pub fn name(&self, stimulus: Stimulus) -> String {
        let surface = &self.study.surfaces.0[stimulus.surface].0.text;
        match stimulus.version {
            None => format!("{surface}, real"),
            Some(version) => format!("{surface}, {}", self.study.version_name(version)),
        }
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
        let mut set = |values: &Named<haptograph_engine::document::value::Value>| {
            for (name, value) in &values.0 {
                options.set.retain(|(known, _)| *known != name.text);
                options.set.push((name.text.clone(), value.show()));
            }
        };
        set(&self.study.settings);
        let version = stimulus.and_then(|stimulus| self.study.versions.0.get(stimulus.version?));
        version.iter().for_each(|(_, values)| set(values));
        if let Phase::Practice(practice) = phase {
            set(&practice.settings);
        }
        let file = stimulus.and_then(|stimulus| self.study.surfaces.0[stimulus.surface].1.file.as_ref());
        if let Some(file) = file {
            // The graph's paths are relative to the graph.
            let file = std::path::absolute(file).unwrap_or_else(|_| file.clone());
            options = options.set(self.study.surface_parameter.clone(), file.display().to_string());
        }
        if let (Some(level), Phase::ConstantStimuli(_) | Phase::Staircase(_)) = (level, phase) {
            let parameter = phase.parameter().map_or("", |name| &name.text);
            options = options.set(parameter, level.show());
        }
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
        let surfaces = self.study.surfaces.0.iter().enumerate();
        let rendered: Vec<usize> =
            surfaces.filter(|(_, (_, of))| of.file.is_some()).map(|(at, _)| at).collect();
        for (number, (_, phase)) in self.study.phases.0.iter().enumerate() {
            let named = phase.rendered_surface().and_then(|name| self.study.surfaces.find(&name.text));
            let first = named.or(rendered.first().copied());
            for version in 0..self.study.version_count() {
                let stimulus = first.map(|surface| Stimulus { surface, version: Some(version) });
                for level in phase.extreme_levels() {
                    let graph = self.graph(registry, phase, (stimulus, level), 0)?;
                    self.check_ports(&graph, phase)?;
                    self.check_limits(&graph)?;
                }
            }
            // Every surface once.
            let others = rendered.iter().filter(|_| number == 0).filter(|surface| Some(**surface) != first);
            for surface in others {
                let stimulus = Stimulus { surface: *surface, version: Some(0) };
                self.graph(registry, phase, (Some(stimulus), phase.extreme_levels()[0]), 0)?;
            }
        }
        Ok(())
    }

    fn check_ports(&self, graph: &Graph, phase: &Phase) -> Result<(), StudyError> {
        let lamp = self.study.page.as_ref().and_then(|page| page.lamp.as_ref());
        let gates = phase.gates().into_iter().flat_map(|gates| &gates.0);
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
        match list.is_empty() {
            true => Ok(()),
            false => Err(StudyError::Study(Diagnostics { sources: self.file.sources.clone(), list })),
        }
    }

    /// People are at the other end: nothing above what the thesis gave them without the experimenter's word.
    fn check_limits(&self, graph: &Graph) -> Result<(), StudyError> {
        for (node, _, limit) in graph.actuators() {
            let quantity = node.outputs.first().map(|output| output.quantity);
            let usual = PEAKS.iter().find(|(known, _)| Some(*known) == quantity);
            if let Some((of, usual)) = usual.filter(|(_, usual)| limit.peak > *usual)
                && self.study.stronger_because.is_none()
            {
                let (actuator, peak, unit) = (node.path.clone(), limit.peak, of.unit());
                return Err(StudyError::TooStrong { actuator, peak, usual: *usual, unit });
            }
        }
        Ok(())
    }

    /// SHA-256 of the graph and the files that it includes.
    pub fn graph_sha256(&self) -> String {
        let texts = self.document.sources().iter().map(|source| source.text.as_bytes());
        sha256(&texts.collect::<Vec<_>>().concat())
    }

    /// SHA-256 of the file of each surface, by its name; empty of one that is only real or cannot be read.
    pub(crate) fn surface_hashes(&self) -> serde_json::Map<String, serde_json::Value> {
        let hash = |(name, of): &(Name, SurfaceOf)| {
            let bytes = of.file.as_ref().and_then(|file| files::read(file, u64::MAX).ok());
            (name.text.clone(), bytes.map_or_else(String::new, |bytes| sha256(&bytes)).into())
        };
        self.study.surfaces.0.iter().map(hash).collect()
    }

    /// Seed of the run of a trial: of the study, the participant and the trial alone.
    pub fn seed_of(&self, participant: &str, trial: &Trial) -> u64 {
        stream_seed(self.study.seed, &format!("{participant}/{}", trial.number))
    }
}

impl Phase {
    /// What has to be reached before an answer opens.
    pub fn gates(&self) -> Option<&Named<Gate>> {
        match self {
            Self::Explore(phase) => Some(&phase.opens_when),
            Self::Rate(phase) => Some(&phase.opens_when),
            Self::Compare(phase) => Some(&phase.opens_when),
            Self::Pairs(phase) => Some(&phase.opens_when),
            Self::ConstantStimuli(phase) => Some(&phase.opens_when),
            _ => None,
        }
    }

    /// The parameter that differs between two stimuli.
    pub(crate) fn parameter(&self) -> Option<&Name> {
        match self {
            Self::ConstantStimuli(phase) => Some(&phase.parameter),
            Self::Staircase(phase) => Some(&phase.parameter),
            _ => None,
        }
    }

    /// Its value in the standard.
    pub fn standard(&self) -> Option<f64> {
        match self {
            Self::ConstantStimuli(phase) => Some(phase.standard),
            Self::Staircase(phase) => Some(phase.standard),
            _ => None,
        }
    }

    /// The surface of which that parameter is varied.
    fn rendered_surface(&self) -> Option<&Name> {
        match self {
            Self::ConstantStimuli(phase) => Some(&phase.surface),
            Self::Staircase(phase) => Some(&phase.surface),
            _ => None,
        }
    }

    /// The extreme values of that parameter; `None` where there is none.
    fn extreme_levels(&self) -> Vec<Option<f64>> {
        let levels = match self {
            Self::ConstantStimuli(phase) => [&phase.levels[..], &[phase.standard]].concat(),
            Self::Staircase(phase) => [phase.limits[0], phase.limits[1]].to_vec(),
            _ => return vec![None],
        };
        let least = levels.iter().copied().fold(f64::INFINITY, f64::min);
        let most = levels.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        vec![Some(least), Some(most)]
    }

    /// The order of its trials.
    pub(crate) fn order(&self) -> &[crate::document::Level] {
        match self {
            Self::Explore(phase) => &phase.order,
            Self::Rate(phase) => &phase.order,
            Self::Compare(phase) => &phase.order,
            _ => &[],
        }
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
            self.known(phase.groups(), &study.groups, "group");
            self.names_of(phase);
            self.order(phase);
            let trials = study.count(phase);
            if self.list.is_empty() && !(1..=MOST_TRIALS).contains(&trials) {
                let message =
                    format!("phase `{}` has {trials} trials; at most {MOST_TRIALS} are possible", name.text);
                let wrong = Diagnostic::error("E0304", name.span, message).label("none, or too many");
                self.list.push(
                    wrong.help("a real surface needs `sample`, a virtual one `file`, and a rating a scale"),
                );
            }
        }
        if study.phases.0.is_empty() {
            let wrong = Diagnostic::error("E0304", Span::default(), "the study has no phases");
            self.list.push(wrong.help("add one: phases: { \"rating\": Rate() }"));
        }
        self.plain(&study.surfaces);
        self.plain(&study.versions);
        self.plain(&study.scales);
        self.plain(&study.groups);
        self.plain(&study.phases);
        if let Some((name, _)) = study.versions.0.iter().find(|(name, _)| name.text == "real") {
            let wrong = Diagnostic::error("E0211", name.span, "a version cannot be called `real`");
            self.list.push(wrong.label("so are the real surfaces in the data"));
        }
        self.list
    }

    /// The surfaces, versions and scales of a phase.
    fn names_of(&mut self, phase: &Phase) {
        let study = self.study;
        match phase {
            Phase::Practice(of) => self.presented(&of.stimuli, &of.surfaces),
            Phase::Explore(of) => self.presented(&of.stimuli, &of.surfaces),
            Phase::Rate(of) => {
                self.presented(&of.stimuli, &of.surfaces);
                self.known(&of.scales, &study.scales, "scale");
            }
            Phase::Compare(of) => {
                self.known(&of.surfaces, &study.surfaces, "surface");
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
            Phase::Pairs(of) => {
                self.presented(&of.stimuli, &of.surfaces);
                self.known([&of.scale], &study.scales, "scale");
            }
            Phase::Questions(of) => {
                self.plain(&of.questions);
                of.questions.0.iter().for_each(|(name, question)| self.question(name, question));
            }
            Phase::ConstantStimuli(of) => self.varied(&of.surface),
            Phase::Staircase(of) => self.staircase(of),
        }
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
    fn varied(&mut self, surface: &Name) {
        let study = self.study;
        self.known([surface], &study.surfaces, "surface");
        if study.surfaces.find(&surface.text).is_some_and(|at| study.surfaces.0[at].1.file.is_none()) {
            let message = format!("surface `{}` is only real", surface.text);
            let wrong = Diagnostic::error("E0304", surface.span, message).label("cannot be rendered");
            self.list.push(wrong.help("give it a `file`"));
        }
    }

    fn staircase(&mut self, of: &crate::document::Staircase) {
        self.varied(&of.surface);
        let [least, most] = of.limits;
        let is_within = [of.start, of.standard].iter().all(|level| (least..=most).contains(level));
        let are_steps = !of.steps.is_empty() && of.steps.iter().all(|step| *step > 0.0);
        if !is_within || !are_steps {
            let message = "the staircase cannot move".to_owned();
            let wrong = Diagnostic::error("E0304", of.parameter.span, message).label("of this parameter");
            let help = "`start` and `standard` lie within `limits`, and each of `steps` is above zero";
            self.list.push(wrong.help(help));
        }
    }

    fn presented(&mut self, stimuli: &[Presented], surfaces: &[Name]) {
        self.known(surfaces, &self.study.surfaces, "surface");
        for presented in stimuli {
            if let Presented::Virtual(of) = presented {
                self.known(&of.version, &self.study.versions, "version");
            }
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
            let known = || of.0.iter().map(|(name, _)| name.text.as_str());
            let message = format!("the study has no {what} `{}`", name.text);
            let wrong = Diagnostic::error("E0303", name.span, message).label(format!("unknown {what}"));
            self.list.push(match (closest(&name.text, known()), of.0.is_empty()) {
                (Some(near), _) => wrong.help(format!("did you mean `{near}`?")),
                (None, true) => wrong.help(format!("it has none; declare it in `{what}s`")),
                (None, false) => wrong.help(format!("it has {}", known().collect::<Vec<_>>().join(", "))),
            });
        }
    }

    /// An order that names a factor twice, or one that is within another.
    fn order(&mut self, phase: &Phase) {
        let factors: Vec<Factor> = phase.order().iter().map(|level| level.factor).collect();
        let count = |wanted: Factor| factors.iter().filter(|factor| **factor == wanted).count();
        let is_both = count(Factor::Stimulus) > 0 && count(Factor::Surface) + count(Factor::Version) > 0;
        let is_twice = factors.iter().any(|factor| count(*factor) > 1);
        if (is_both || is_twice)
            && let Some((name, _)) = self.study.phases.0.iter().find(|(_, known)| std::ptr::eq(known, phase))
        {
            let message = format!("the order of phase `{}` has a factor twice", name.text);
            let wrong = Diagnostic::error("E0304", name.span, message).label("of this phase");
            self.list.push(wrong.help("`Stimulus` is surface and version together; name each factor once"));
        }
    }
}

impl Study {
    /// Number of participants of a group that balances every Latin square of its phases, or a multiple does; `None` without a square.
    pub fn balanced_by(&self, group: usize) -> Option<usize> {
        let mut all = None;
        let trials = self.trials("1", group);
        for (number, (_, phase)) in self.phases.0.iter().enumerate() {
            let of_phase: Vec<&Trial> = trials.iter().filter(|trial| trial.phase == number).collect();
            let squares = phase.order().iter().filter(|level| level.arrange == Arrange::Latin);
            let rows = squares.map(|level| square_rows(crate::order::count(&of_phase, level.factor)));
            // Squares of a phase are crossed; phases take the same number.
            if let Some(rows) = rows.reduce(usize::saturating_mul) {
                all = Some(
                    all.map_or(rows, |before: usize| (before / common(before, rows)).saturating_mul(rows)),
                );
            }
        }
        all
    }

    /// Number of trials of a phase, without training, by arithmetic.
    fn count(&self, phase: &Phase) -> usize {
        let scales = |names: &[Name]| if names.is_empty() { self.scales.0.len() } else { names.len() };
        match phase {
            Phase::Practice(of) if of.stimuli.is_empty() => 1,
            Phase::Practice(of) => self.stimuli(&of.stimuli, &of.surfaces).len(),
            Phase::Explore(of) => self.stimuli(&of.stimuli, &of.surfaces).len(),
            Phase::Rate(of) => {
                let stimuli = self.stimuli(&of.stimuli, &of.surfaces).len();
                stimuli.saturating_mul(scales(&of.scales)).saturating_mul(of.repeats as usize)
            }
            Phase::Compare(of) => self.compared(of).len().saturating_mul(of.repeats as usize),
            Phase::Pairs(of) => {
                let stimuli = self.stimuli(&of.stimuli, &of.surfaces).len();
                stimuli.saturating_mul(stimuli.saturating_sub(1)) / 2
            }
            Phase::Questions(of) => of.questions.0.len(),
            Phase::ConstantStimuli(of) => of.levels.len().saturating_mul(of.repeats as usize),
            Phase::Staircase(of) => of.at_most as usize,
        }
    }
}

/// The greatest common divisor.
fn common(a: usize, b: usize) -> usize {
    if b == 0 { a.max(1) } else { common(b, a % b) }
}
