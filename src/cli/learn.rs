//! `haptograph learn`: learns a surface from recordings (thesis chapters 2 and 4).

mod folder;
mod summary;

use super::beside::{Beside, show_with};
use super::import::{Choices, Import, Touch, choice, positive};
use super::placing::{Force, Output};
use super::progress::Progress;
use super::recording::Loaded;
use super::result::{CommandResult, look_at};
use super::segment::VARIANCES;
use super::table::facts;
use super::{Failure, eprint, recording, refuse_overwrite, surface};
use crate::engine::registry::Registry;
use crate::learning::learn::law::LawSettings;
use crate::learning::learn::segmentation::{SegmentationSettings, VarianceEstimate};
use crate::learning::learn::texture::{CoefficientFit, TextureSettings};
use crate::learning::learn::{LearnError, LearnSettings, TextureMethod, learn};
use crate::learning::processing::{AxisReduction, ProcessingSettings};
use crate::learning::recording::{AnyRecording, Gesture, ImportSettings};
use crate::surfaces::Surface;
use clap::ValueEnum;
use serde::Serialize;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Learn a surface from recordings
///
/// Each gesture teaches one part: a drag the texture (and friction if there is no circle), a circle friction,
/// a tap the tap responses, a press stiffness. A recording is one of haptograph's own archives, a table with
/// a header (CSV, spreadsheet, MATLAB up to -v7), a WAV file beside a table, or one of the toolkit's (HaTT)
/// XML triples, named by any of its files; docs/learning.md describes their contents. Files that share a
/// clock form one recording if their names are joined: force.csv+accel.csv. A file that does not state its
/// gesture is a drag, unless given by --circle, --tap or --press.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Recordings of one material; or a folder of recordings, each learned into the folder of --output
    #[arg(value_name = "RECORDING", required_unless_present_any = ["circle", "tap", "press"])]
    recordings: Vec<PathBuf>,
    /// A recording of circles, whatever gesture it states; can be repeated
    #[arg(long, value_name = "RECORDING")]
    circle: Vec<PathBuf>,
    /// A recording of taps, whatever gesture it states; can be repeated
    #[arg(long, value_name = "RECORDING")]
    tap: Vec<PathBuf>,
    /// The recording of a press, whatever gesture it states
    #[arg(long, value_name = "RECORDING")]
    press: Option<PathBuf>,
    /// The surface to write: .ron (all of it) or .xml (the parts that the toolkit's format holds); for a
    /// folder of recordings, a folder
    #[arg(short, long, value_name = "SURFACE.ron")]
    output: PathBuf,
    /// Also write a page with figures into this folder
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Name of the surface; default: the name of the output
    #[arg(long, value_parser = name)]
    name: Option<String>,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
    /// Learn from drags and taps below 500 Hz too, in which little of what a hand feels is left
    #[arg(long)]
    accept_rate: bool,
    #[command(flatten)]
    beside: Beside,
    #[command(flatten)]
    folder: folder::Folder,
    #[command(flatten)]
    settings: Settings,
    #[command(flatten)]
    touch: Touch,
    #[command(flatten)]
    import: Import,
}

impl Arguments {
    fn import(&self) -> Result<ImportSettings, Failure> {
        self.settings.import(&self.import).map(|import| self.touch.added_to(import))
    }

    /// True if a flag is given that applies to one surface only.
    fn has_single(&self) -> bool {
        let gestures = self.circle.len() + self.tap.len() + usize::from(self.press.is_some());
        gestures > 0 || self.name.is_some() || self.report.is_some() || self.beside.beside.is_some()
    }

    fn learning(&self) -> LearnSettings {
        LearnSettings {
            processing: self.settings.processing(),
            texture: self.settings.texture(),
            accept_rate: self.accept_rate,
            ..LearnSettings::default()
        }
    }
}

/// Flags of learning textures.
#[derive(Debug, clap::Args)]
pub(super) struct Settings {
    /// The reduction of the three axes of acceleration to one
    #[arg(long, value_parser = choice(REDUCTIONS), default_value = "dft321")]
    reduction: AxisReduction,
    /// Resample vibrations to this rate first; default: their own rate. At a lower rate models of the same
    /// order resolve lower frequencies
    #[arg(long = "rate", value_name = "HZ")]
    rate_hz: Option<f64>,
    /// The low-pass of the velocity from positions, before its length is taken as the speed; default: 20. At
    /// most 0.45 of the tracker's rate is used, so that 1000 is nearly none, as in the thesis
    #[arg(long, value_name = "HZ", value_parser = positive)]
    velocity_lowpass: Option<f64>,
    /// The learning method of textures
    #[arg(long, value_enum, default_value_t = Method::Law)]
    method: Method,
    /// The order of all models; default: 20, or with the thesis's method the median of the segments' orders
    #[arg(long, value_name = "P")]
    order: Option<usize>,
    /// The fewest samples a segment may have (thesis's method)
    #[arg(long, value_name = "N", default_value_t = 50)]
    min_span: usize,
    /// The highest order of a segment's model (thesis's method)
    #[arg(long, value_name = "P", default_value_t = 20)]
    max_order: usize,
    /// The estimator of a segment's innovation variance during the search for breaks (thesis's method)
    #[arg(long, value_parser = choice(VARIANCES), default_value = "least-squares")]
    variance: VarianceEstimate,
    /// The estimator of a segment's coefficients (thesis's method)
    #[arg(long, value_parser = choice(FITS), default_value = "yule-walker")]
    fit: CoefficientFit,
    /// Keep outlier models (thesis's method)
    #[arg(long)]
    keep_outliers: bool,
    /// Keep no clips of the recording: noise whose level fluctuates as recorded is the excitation
    #[arg(long)]
    no_clips: bool,
}

const REDUCTIONS: Choices<AxisReduction> = &[
    (
        "dft321",
        AxisReduction::Dft321,
        "Spectral: the energy of all axes, the phase of their sum; the thesis's method",
    ),
    ("sum", AxisReduction::Sum, "The sum of the axes"),
    ("x", AxisReduction::SingleAxis(0), "The first axis"),
    ("y", AxisReduction::SingleAxis(1), "The second axis"),
    ("z", AxisReduction::SingleAxis(2), "The third axis"),
    (
        "principal-component",
        AxisReduction::PrincipalComponent,
        "The projection on the direction of greatest variance",
    ),
    ("vector-magnitude", AxisReduction::VectorMagnitude, "The magnitude of the vector at each instant"),
];
const FITS: Choices<CoefficientFit> = &[
    (
        "yule-walker",
        CoefficientFit::YuleWalker,
        "Autocovariance and Levinson-Durbin recursion, as in the thesis",
    ),
    ("burg", CoefficientFit::Burg, "Burg's lattice: resolves sharper resonances in short segments"),
];

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Method {
    /// One law of the spectrum over speed and force, with models on a warped frequency axis
    Law,
    /// The thesis's method: a model for each stationary segment, triangulated
    Thesis,
}

impl Settings {
    pub(super) fn processing(&self) -> ProcessingSettings {
        let usual = ProcessingSettings::default();
        ProcessingSettings {
            reduction: self.reduction,
            rate_hz: self.rate_hz,
            velocity_lowpass_hz: self.velocity_lowpass.unwrap_or(usual.velocity_lowpass_hz),
            ..usual
        }
    }

    /// The import settings, with the low-pass of velocities from the positions of tables.
    pub(super) fn import(&self, import: &Import) -> Result<ImportSettings, Failure> {
        let settings = import.settings().map_err(Failure::Message)?;
        Ok(ImportSettings { velocity_lowpass_hz: self.velocity_lowpass, ..settings })
    }

    pub(super) fn texture(&self) -> TextureMethod {
        match self.method {
            Method::Law => {
                let usual = LawSettings::default();
                let order = self.order.unwrap_or(usual.order);
                TextureMethod::Law(LawSettings { order, clips: !self.no_clips, ..usual })
            }
            Method::Thesis => TextureMethod::Thesis(self.thesis()),
        }
    }

    fn thesis(&self) -> TextureSettings {
        let usual = TextureSettings::default();
        TextureSettings {
            segmentation: SegmentationSettings {
                min_span: self.min_span,
                max_order: self.max_order,
                variance: self.variance,
                ..SegmentationSettings::default()
            },
            order: self.order,
            fit: self.fit,
            outliers: usual.outliers.filter(|_| !self.keep_outliers),
            ..usual
        }
    }
}

fn name(text: &str) -> Result<String, String> {
    match text.trim() {
        "" => Err("the name is empty; give a name, or omit --name to use that of the output".to_owned()),
        name => Ok(name.to_owned()),
    }
}

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    if let [dir] = &arguments.recordings[..]
        && dir.is_dir()
    {
        refuse_one_surface(dir, &arguments.output)?;
        return folder::run_on(arguments, dir);
    }
    folder::refuse_of_files(&arguments.folder)?;
    let files = files(arguments);
    refuse_overwrite(files.iter().flat_map(|(path, _)| recording::parts(path)), &arguments.output)?;
    let import = arguments.import()?;
    let output = surface::claim(&arguments.output, arguments.force)?;
    let page = Output::claim_page(arguments.report.as_deref(), arguments.force)?;
    let (mut recordings, mut warnings, mut is_implausible) = (vec![], vec![], false);
    for (path, gesture) in &files {
        let loaded = read(path, *gesture, &import)?;
        recordings.push(loaded.recording);
        warnings.extend(loaded.warnings);
        is_implausible |= loaded.is_implausible;
    }
    refuse_twins(&files, &recordings)?;
    let settings = arguments.learning();
    let stem = arguments.output.file_stem().unwrap_or_default().to_string_lossy();
    let name = arguments.name.as_deref().unwrap_or(&stem);
    let learned = Progress::during("learning", |at| learn(name, &recordings, &settings, at));
    let (mut learned, report) = learned
        .map_err(|error| Failure::Message(by_file(&error.to_string(), &error, &files, &recordings)))?;
    note_files(&mut learned, &files);
    let output = surface::save(&learned, &output)?;
    let missing = report.missing.iter();
    let missing = missing.map(|missing| {
        let said = format!("{missing} (--{})", missing.gesture.as_str());
        by_file(&said, &missing.reason, &files, &recordings)
    });
    let band = report.band.iter().map(ToString::to_string);
    for said in band.chain(summary::shortness(&learned, &report)).chain(missing) {
        eprint(&format!("warning: {said}\n"));
        warnings.push(said);
    }
    let page = page.map(|page| page.write(crate::report::learning::page(&learned, &report))).transpose()?;
    let beside = arguments.beside.rows(|| Ok(summary::beside(&learned, &report, &settings).0))?;
    let learned = Learned {
        coverage: summary::coverage(&learned, &report, is_implausible),
        name,
        page,
        recordings: recordings.len(),
        warnings,
        facts: summary::facts_of(&learned, &report, is_implausible),
        written: [output],
    };
    show_with(&learned, &beside, arguments.json)
}

/// A surface learned from recordings.
#[derive(Serialize)]
struct Learned<'a> {
    coverage: Option<Value>,
    name: &'a str,
    page: Option<PathBuf>,
    recordings: usize,
    warnings: Vec<String>,
    written: [PathBuf; 1],
    #[serde(skip)]
    facts: Vec<(&'static str, String)>,
}

impl CommandResult for Learned<'_> {
    fn text(&self) -> String {
        let facts = facts(&self.facts);
        format!("wrote {}\n{facts}{}", self.written[0].display(), look_at(self.page.as_ref()))
    }
}

/// States the files of the recordings in a surface, without their folder: the same recordings give the same surface
/// wherever they lie.
fn note_files(surface: &mut Surface, files: &[(&Path, Option<Gesture>)]) {
    for (index, (path, _)) in files.iter().enumerate() {
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        let name = format!("recording {} file", index + 1);
        surface.provenance = surface.provenance.clone().with_setting(name, file);
    }
}

/// Refuses one surface of a folder, whose recordings are learned into a folder.
fn refuse_one_surface(dir: &Path, output: &Path) -> Result<(), Failure> {
    if output.is_dir() || surface::check_extension(output).is_err() {
        return Ok(());
    }
    let (dir, output) = (dir.display(), output.display());
    Err(Failure::Message(format!(
        "{dir} is a folder, and {output} is one surface: give `-o FOLDER` for a surface of each recording (`--by material`: of \
         each material), or name the recordings of {output} instead of {dir}"
    )))
}

/// Replaces `recording N` in a message by the name of that recording's file, and names the flag that accepts it.
fn by_file(
    said: &str,
    error: &LearnError,
    files: &[(&Path, Option<Gesture>)],
    recordings: &[AnyRecording],
) -> String {
    let named = error.recording(recordings).and_then(|recording| {
        let (before, rest) = said.split_once("recording ")?;
        let (_, after) = rest.split_once(" (from 0)")?;
        let (path, _) = files.get(recording)?;
        Some(format!("{before}{}{after}", path.display()))
    });
    let said = named.unwrap_or_else(|| said.to_owned());
    match error {
        LearnError::Slow { .. } => format!("{said}; --accept-rate learns from it as it is"),
        _ => said,
    }
}

/// All recordings, with the gestures given on the command line.
fn files(arguments: &Arguments) -> Vec<(&Path, Option<Gesture>)> {
    fn of(paths: &[PathBuf], gesture: Option<Gesture>) -> impl Iterator<Item = (&Path, Option<Gesture>)> {
        paths.iter().map(move |path| (path.as_path(), gesture))
    }
    let Arguments { recordings, circle, tap, press, .. } = arguments;
    of(recordings, None)
        .chain(of(circle, Some(Gesture::Circle)))
        .chain(of(tap, Some(Gesture::Tap)))
        .chain(of(press.as_slice(), Some(Gesture::Press)))
        .collect()
}

fn read(path: &Path, gesture: Option<Gesture>, import: &ImportSettings) -> Result<Loaded, Failure> {
    let mut loaded = recording::load_with(path, import)?;
    let own = loaded.recording.gesture();
    let Some(gesture) = gesture else {
        return Ok(loaded);
    };
    if loaded.says_gesture && own != gesture {
        let said = format!(
            "{} states that it is a {}; it is read as a {}, as requested",
            path.display(),
            own.as_str(),
            gesture.as_str()
        );
        eprint(&format!("warning: {said}\n"));
        loaded.warnings.push(said);
    }
    loaded.recording = loaded.recording.with_gesture(gesture);
    Ok(loaded)
}

/// Refuses a recording that is given twice, since it would count twice.
fn refuse_twins(files: &[(&Path, Option<Gesture>)], recordings: &[AnyRecording]) -> Result<(), Failure> {
    for (index, recording) in recordings.iter().enumerate() {
        if let Some(first) = recordings[..index].iter().position(|earlier| earlier == recording) {
            return Err(Failure::Message(format!(
                "{} and {} are the same recording and would count twice; give it once",
                files[first].0.display(),
                files[index].0.display()
            )));
        }
    }
    Ok(())
}
