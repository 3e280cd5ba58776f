//! Learns the parts of a surface from the available recordings.

use super::breakaway::{NoOnset, OnsetShown, learn_with_onset, static_peak};
use super::friction::{FrictionError, FrictionFit, FrictionReport, FrictionSettings, learn_friction};
use super::law::LawSettings;
use super::method::TextureMethod;
use super::segmentation::{SegmentationMethod, VarianceEstimate};
use super::stiffness::{StiffnessError, StiffnessReport, StiffnessSettings, learn_stiffness};
use super::taps::{TapError, TapReport, TapSettings, learn_taps};
use super::texture::{CoefficientFit, Fate, LearnTextureError, TextureReport, TextureSettings};
use crate::processing::{Kept, ProcessingError, ProcessingSettings, SurfaceNormal, processed_keeping};
use crate::recording::{AnyRecording, Gesture, ProcessedRecording};
use haptograph_surfaces::bounds::{FELT_HZ, FULL_BAND_HZ, LOWEST_LEARNED_HZ, carried_hz, shown};
use haptograph_surfaces::provenance::{CLIPS_ORIGIN, HIGHEST_HZ, TOUCH};
use haptograph_surfaces::{Friction, Origin, Provenance, Recorded, Stiffness, Surface};
use std::collections::BTreeMap;
use std::fmt;

/// Settings for learning a surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LearnSettings {
    /// Processing of raw recordings.
    pub processing: ProcessingSettings,
    /// Texture.
    pub texture: TextureMethod,
    /// Friction.
    pub friction: FrictionSettings,
    /// Taps.
    pub taps: TapSettings,
    /// Stiffness.
    pub stiffness: StiffnessSettings,
    /// Learns from recordings below [`LOWEST_LEARNED_HZ`] too.
    pub accept_rate: bool,
}

/// Intermediate results, by which the quality of a surface can be judged.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LearningReport {
    /// The processed drag recordings to which [`TextureReport::segments`] refer; without the onsets, if the texture has one.
    pub drags: Vec<ProcessedRecording>,
    /// Segments, models and outliers.
    pub texture: Option<TextureReport>,
    /// One stroke from rest, or why the texture has no onset.
    pub onset: Option<Result<OnsetShown, NoOnset>>,
    /// Forces and the line through them.
    pub friction: Option<FrictionReport>,
    /// Contacts.
    pub taps: Option<TapReport>,
    /// The press.
    pub stiffness: Option<StiffnessReport>,
    /// Parts that could not be learned although a recording for them exists.
    pub missing: Vec<MissingPart>,
    /// What the vibration lacks because of its rate.
    pub band: Option<NarrowBand>,
}

/// A vibration that was recorded too slowly, or is learned at too low a rate, to hold all that a hand feels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NarrowBand {
    /// Samples per second that are learned from.
    pub rate_hz: f64,
    /// Samples per second that were recorded.
    pub recorded_hz: f64,
}

impl NarrowBand {
    /// The highest frequency in it, Hz.
    pub(crate) fn highest_hz(&self) -> f64 {
        carried_hz(self.rate_hz).round()
    }
}

impl fmt::Display for NarrowBand {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(
            f,
            "the vibration has {} samples per second: above {} Hz the surface is not valid, and a hand feels up to {FELT_HZ} Hz; ",
            shown(self.rate_hz),
            self.highest_hz()
        )?;
        match self.recorded_hz < FULL_BAND_HZ {
            true => write!(f, "record at {FULL_BAND_HZ} Hz or more"),
            false => write!(f, "learn at {FULL_BAND_HZ} Hz or more"),
        }
    }
}

/// A part that could not be learned although a recording for it exists.
#[derive(Debug, Clone, PartialEq)]
pub struct MissingPart {
    /// Name of the part: friction, taps or stiffness.
    pub part: &'static str,
    /// The reason.
    pub reason: LearnError,
    /// The recording that would supply it.
    pub remedy: &'static str,
    /// The gesture of that recording.
    pub gesture: Gesture,
}

impl fmt::Display for MissingPart {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let MissingPart { part, reason, remedy, .. } = self;
        write!(f, "{reason}; the surface has no {part}; {remedy}")
    }
}

/// An error of learning a surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum LearnError {
    #[error("no recordings were given; name at least one")]
    NoRecordings,
    #[error("recording {recording} (from 0) cannot be processed: {source}")]
    Processing { recording: usize, source: ProcessingError },
    #[error(
        "recording {recording} (from 0) has {} samples per second, which hold vibration up to {} Hz; learning needs a rate of at least {LOWEST_LEARNED_HZ} Hz: check the unit of its times",
        shown(*rate_hz), shown(carried_hz(*rate_hz))
    )]
    Slow { recording: usize, rate_hz: f64 },
    #[error(
        "recording {recording} (from 0) has no vibration: its acceleration is the same in all {samples} samples; was the \
         accelerometer connected, and is this its column?"
    )]
    Still { recording: usize, samples: usize },
    #[error("cannot learn the texture: {0}")]
    Texture(#[from] LearnTextureError),
    #[error("cannot learn the friction: {0}")]
    Friction(#[from] FrictionError),
    #[error("cannot learn the taps: {0}")]
    Taps(#[from] TapError),
    #[error("cannot learn the stiffness: {0}")]
    Stiffness(#[from] StiffnessError),
    #[error(
        "cannot learn the stiffness: recording {recording} (from 0) is already processed and does not contain the tip's path; use a raw recording"
    )]
    ProcessedPress { recording: usize },
    #[error(
        "stiffness needs exactly one press, but recording {recording} (from 0) is a second one; remove one of them"
    )]
    SecondPress { recording: usize },
}

impl LearnError {
    /// The index of the recording with the error.
    pub fn recording(&self, recordings: &[AnyRecording]) -> Option<usize> {
        let (gesture, number) = match self {
            Self::Processing { recording, .. }
            | Self::Slow { recording, .. }
            | Self::Still { recording, .. }
            | Self::ProcessedPress { recording }
            | Self::SecondPress { recording } => return Some(*recording),
            Self::Texture(
                LearnTextureError::Rates { recording, .. }
                | LearnTextureError::Segmentation { recording, .. },
            ) => (Gesture::Drag, *recording),
            Self::Taps(TapError::Rates { recording, .. }) => (Gesture::Tap, *recording),
            _ => return None,
        };
        of(recordings, gesture).nth(number).map(|(index, _)| index)
    }
}

/// Learns a surface called `name`. The gesture of each recording decides what is learned from it: texture from drags (and
/// friction if there is no circle), friction from circles, taps from taps, stiffness from a press.
///
/// Parts without a recording are omitted, and so are friction, taps and stiffness that cannot be learned; the report has the
/// reason. It is an error if the texture cannot be learned or no part remains. `progress` receives the fraction done, 0 to 1.
///
/// ```
/// use haptograph_learning::learn::{LearnSettings, learn};
/// use haptograph_learning::recording::{AnyRecording, Gesture, ProcessedRecording, Signals};
/// use haptograph_surfaces::{Origin, Provenance};
///
/// // `recording::load` reads such a recording from a file.
/// let normal: Vec<f64> = (0..2000).map(|k| 1.0 + 0.5 * (k as f64 / 100.0).sin()).collect();
/// let signals = Signals {
///     rate_hz: 1000.0,
///     acceleration_m_s2: vec![0.0; 2000],
///     force_tangential_n: Some(normal.iter().map(|force| 0.3 * force).collect()),
///     force_normal_n: normal,
///     speed_m_s: vec![0.1; 2000],
///     ..Signals::default()
/// };
/// let made = Provenance::new(Origin::Procedural, "an example");
/// let circle = AnyRecording::Processed(ProcessedRecording::new(signals, Gesture::Circle, made)?);
///
/// let (surface, _report) = learn("slate", &[circle], &LearnSettings::default(), &|_| ())?;
/// assert!((surface.friction.ok_or("no friction")?.mu() - 0.3).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn learn(
    name: &str,
    recordings: &[AnyRecording],
    settings: &LearnSettings,
    progress: &dyn Fn(f64),
) -> Result<(Surface, LearningReport), LearnError> {
    if recordings.is_empty() {
        return Err(LearnError::NoRecordings);
    }
    let mut has_strokes = false;
    let mut surface = Surface::new(name, provenance(recordings, settings));
    let mut report = LearningReport { band: band(recordings, settings)?, ..LearningReport::default() };
    if let Some(band) = &report.band {
        surface.provenance = surface.provenance.with_setting(HIGHEST_HZ, band.highest_hz());
    }
    let drags = drags(recordings, settings, progress)?;
    if !drags.is_empty() {
        let learned = learn_with_onset(&settings.texture, &drags, &|part| progress(0.3 + 0.5 * part))?;
        let texture =
            learned.texture.with_recorded(recorded(&learned.report)).map_err(LearnTextureError::from)?;
        (surface.texture, report.texture) = (Some(texture), Some(learned.report));
        has_strokes = learned.onset.is_ok();
        (report.onset, report.drags) = (Some(learned.onset), learned.slides.unwrap_or(drags));
    }
    surface.provenance.settings.extend(copied_origin(recordings, &surface));
    progress(0.8);
    let missing = &mut report.missing;
    let friction = learned_friction(recordings, settings).transpose();
    (surface.friction, report.friction) = or_missing(friction, "friction", missing).unzip();
    if has_strokes {
        surface.friction = surface.friction.map(|own| with_peak(own, recordings, settings));
    }
    progress(0.9);
    let taps: Vec<_> = of(recordings, Gesture::Tap).map(|(_, tap)| tap).collect();
    if !taps.is_empty() {
        let taps = learn_taps(&taps, &settings.processing, &settings.taps);
        (surface.taps, report.taps) =
            or_missing(Some(taps.map_err(LearnError::from)), "taps", missing).unzip();
    }
    let mut presses = of(recordings, Gesture::Press);
    let press = presses.next();
    if let Some((recording, _)) = presses.next() {
        // Which of them counts?
        return Err(LearnError::SecondPress { recording });
    }
    let stiffness = press.map(|(recording, press)| learned_stiffness(recording, press, settings));
    (surface.stiffness, report.stiffness) = or_missing(stiffness, "stiffness", missing).unzip();
    for missing in &report.missing {
        let what = format!("not learned: {}", missing.part);
        surface.provenance.settings.insert(what, missing.reason.to_string());
    }
    progress(1.0);
    let empty = surface.texture.is_none()
        && surface.friction.is_none()
        && surface.taps.is_none()
        && surface.stiffness.is_none();
    match report.missing.first() {
        Some(missing) if empty => Err(missing.reason.clone()),
        _ => Ok((surface, report)),
    }
}

/// The recordings of a gesture, with their indices.
fn of(recordings: &[AnyRecording], gesture: Gesture) -> impl Iterator<Item = (usize, &AnyRecording)> {
    recordings.iter().enumerate().filter(move |(_, recording)| recording.gesture() == gesture)
}

/// The processed drags.
fn drags(
    recordings: &[AnyRecording],
    settings: &LearnSettings,
    progress: &dyn Fn(f64),
) -> Result<Vec<ProcessedRecording>, LearnError> {
    let mut drags = vec![];
    for (recording, drag) in of(recordings, Gesture::Drag) {
        let drag = processed_keeping(drag, &settings.processing, Kept::Texture)
            .map_err(|source| LearnError::Processing { recording, source })?;
        if is_still(&drag) {
            let samples = drag.samples();
            return Err(LearnError::Still { recording, samples });
        }
        drags.push(drag);
        progress(0.3 * (recording + 1) as f64 / recordings.len() as f64);
    }
    Ok(drags)
}

/// The origin of drags of which a surface has clips, where it is not the surface's: a simulated press makes no copy free.
fn copied_origin(recordings: &[AnyRecording], surface: &Surface) -> Option<(String, String)> {
    surface.texture.as_ref()?.clips()?;
    let mut origins = of(recordings, Gesture::Drag).map(|(_, drag)| drag.provenance().origin);
    let copied = origins.find(|origin| matches!(origin, Origin::Measured | Origin::Imported))?;
    let setting = || (CLIPS_ORIGIN.to_owned(), copied.as_str().to_owned());
    (copied != surface.provenance.origin).then(setting)
}

/// What the vibration of drags and taps lacks because of its rate; an error if a rate is too low and not accepted.
fn band(recordings: &[AnyRecording], settings: &LearnSettings) -> Result<Option<NarrowBand>, LearnError> {
    let mut lowest_hz = [f64::INFINITY; 2];
    for (recording, vibration) in recordings.iter().enumerate() {
        let rate_hz = vibration.vibration_hz();
        let learned_hz = match vibration.gesture() {
            Gesture::Drag => settings.processing.rate_hz.map_or(rate_hz, |lower_hz| lower_hz.min(rate_hz)),
            Gesture::Tap => rate_hz,
            // Forces and positions are learned, no vibration.
            Gesture::Circle | Gesture::Press => continue,
        };
        if rate_hz < LOWEST_LEARNED_HZ && !settings.accept_rate {
            return Err(LearnError::Slow { recording, rate_hz });
        }
        lowest_hz = [lowest_hz[0].min(learned_hz), lowest_hz[1].min(rate_hz)];
    }
    let [rate_hz, recorded_hz] = lowest_hz;
    let band = NarrowBand { rate_hz, recorded_hz };
    Ok((band.highest_hz() < FELT_HZ).then_some(band))
}

/// True if a vibration is a constant, or what a high-pass leaves of one, m/s²: no sensor resolves so little.
fn is_still(recording: &ProcessedRecording) -> bool {
    let vibration = &recording.signals().acceleration_m_s2;
    vibration.iter().all(|acceleration| (acceleration - vibration[0]).abs() < 1e-8)
}

/// Returns the learned part, or records why it is missing.
fn or_missing<T>(
    learned: Option<Result<T, LearnError>>,
    part: &'static str,
    missing: &mut Vec<MissingPart>,
) -> Option<T> {
    let reason = match learned? {
        Ok(learned) => return Some(learned),
        Err(reason) => reason,
    };
    let (gesture, remedy) = match part {
        "friction" => (Gesture::Circle, "record 10 s of smooth circles with varying force"),
        "taps" => {
            (Gesture::Tap, "record single taps at different speeds, with the tool in the air before each")
        }
        _ => (Gesture::Press, "record one slow press beyond 3 N with all sensors"),
    };
    missing.push(MissingPart { part, reason, remedy, gesture });
    None
}

/// Learns friction from circles; if there are none, from drags with tangential forces.
fn learned_friction(
    recordings: &[AnyRecording],
    settings: &LearnSettings,
) -> Result<Option<(Friction, FrictionReport)>, LearnError> {
    let [circles, drags] = [Gesture::Circle, Gesture::Drag]
        .map(|gesture| of(recordings, gesture).map(|(_, recording)| recording).collect::<Vec<_>>());
    let (from, fit) = if !circles.is_empty() {
        (circles, FrictionFit::ThroughOrigin)
    } else if !drags.is_empty() && drags.iter().all(|drag| has_tangential_force(drag)) {
        (drags, FrictionFit::RobustThroughOrigin)
    } else {
        return Ok(None);
    };
    Ok(Some(learn_friction(&from, &settings.processing, &settings.friction, fit)?))
}

/// The ranges of what was learned from.
fn recorded(report: &TextureReport) -> Option<Recorded> {
    let kept = report.segments.iter().filter(|segment| segment.fate == Fate::Kept);
    Recorded::of(kept.map(|segment| (segment.speed_m_s, segment.force_n)))
}

/// Friction with the static peak of the drags, processed anew: of raw ones the texture keeps no tangential force.
fn with_peak(friction: Friction, recordings: &[AnyRecording], settings: &LearnSettings) -> Friction {
    let drags = of(recordings, Gesture::Drag);
    let forces = |(_, drag)| processed_keeping(drag, &settings.processing, Kept::Forces).ok();
    friction.with_peak(static_peak(drags.filter_map(forces), friction.mu()))
}

fn learned_stiffness(
    recording: usize,
    press: &AnyRecording,
    settings: &LearnSettings,
) -> Result<(Stiffness, StiffnessReport), LearnError> {
    match press {
        AnyRecording::Raw(press) => Ok(learn_stiffness(press, &settings.processing, &settings.stiffness)?),
        AnyRecording::Processed(_) => Err(LearnError::ProcessedPress { recording }),
    }
}

fn has_tangential_force(recording: &AnyRecording) -> bool {
    match recording {
        AnyRecording::Raw(_) => true,
        AnyRecording::Processed(processed) => processed.signals().force_tangential_n.is_some(),
    }
}

/// Everything needed to learn the surface again: the origin of the recordings, and every setting.
fn provenance(recordings: &[AnyRecording], settings: &LearnSettings) -> Provenance {
    let origins: Vec<Origin> = recordings.iter().map(|recording| recording.provenance().origin).collect();
    // Of several origins the least trustworthy counts, so that simulated data is never taken for measured data.
    let least = [Origin::Procedural, Origin::Simulated, Origin::Imported, Origin::Measured];
    let origin = least.into_iter().find(|origin| origins.contains(origin)).unwrap_or(Origin::Imported);
    let mut sources: Vec<&str> = vec![];
    for recording in recordings {
        let source = &*recording.provenance().source;
        if !sources.contains(&source) {
            sources.push(source);
        }
    }
    let mut provenance = Provenance::new(origin, sources.join("; "));
    for (index, recording) in recordings.iter().enumerate() {
        let gesture = recording.gesture().as_str();
        provenance.settings.insert(format!("recording {} gesture", index + 1), gesture.to_owned());
        for (name, value) in &recording.provenance().settings {
            let is_common = TOUCH.contains(&&**name) && is_common(recordings, name, value);
            let name = match is_common {
                true => name.clone(),
                false => format!("recording {} {name}", index + 1),
            };
            provenance.settings.insert(name, value.clone());
        }
    }
    provenance.settings.extend(described(settings));
    provenance
}

/// True if all recordings state the same.
fn is_common(recordings: &[AnyRecording], name: &str, value: &str) -> bool {
    let states = |recording: &AnyRecording| {
        let own = recording.provenance().settings.get(name);
        own.is_some_and(|own| own == value)
    };
    recordings.iter().all(states)
}

fn described(settings: &LearnSettings) -> BTreeMap<String, String> {
    let LearnSettings { processing, texture, friction, taps, stiffness, accept_rate: _ } = settings;
    let mut all = BTreeMap::new();
    let mut note = |name: &str, value: String| all.insert(name.to_owned(), value);
    note("processing.highpass_hz", processing.highpass_hz.to_string());
    note("processing.lowpass_hz", processing.lowpass_hz.to_string());
    note("processing.velocity_lowpass_hz", processing.velocity_lowpass_hz.to_string());
    note("processing.reduction", processing.reduction.as_str().to_owned());
    if let Some(rate_hz) = processing.rate_hz {
        note("processing.rate_hz", rate_hz.to_string());
    }
    let normal = match processing.normal {
        SurfaceNormal::PlaneFit => "plane fit".to_owned(),
        SurfaceNormal::ForceDirection => "force direction".to_owned(),
        SurfaceNormal::Given(normal) => format!("{normal:?}"),
    };
    note("processing.normal", normal);
    note("texture.method", texture.as_str().to_owned());
    match texture {
        TextureMethod::Law(law) => describe_law(law, &mut note),
        TextureMethod::Thesis(texture) => describe_thesis(texture, &mut note),
    }
    let fit = match friction.fit {
        None => "by gesture",
        Some(FrictionFit::ThroughOrigin) => "through the origin",
        Some(FrictionFit::Robust) => "robust",
        Some(FrictionFit::RobustThroughOrigin) => "robust, through the origin",
    };
    note("friction.fit", fit.to_owned());
    note("friction.min_speed_mm_s", (friction.min_speed_m_s * 1000.0).to_string());
    note("friction.min_force_n", friction.min_force_n.to_string());
    note("taps.contact_n", taps.contact_n.to_string());
    note("taps.air_ms", (taps.air_s * 1000.0).to_string());
    note("taps.free_ms", (taps.free_s * 1000.0).to_string());
    note("taps.length_ms", (taps.length_s * 1000.0).to_string());
    note("taps.onset", taps.onset.to_string());
    note("taps.approach_ms", (taps.approach_s * 1000.0).to_string());
    note("taps.force_lowpass_hz", taps.force_lowpass_hz.to_string());
    note("stiffness.from_n", stiffness.from_n.to_string());
    note("stiffness.to_n", stiffness.to_n.to_string());
    all
}

type NoteSetting<'a> = &'a mut dyn FnMut(&str, String) -> Option<String>;

fn describe_law(law: &LawSettings, note: NoteSetting<'_>) {
    note("texture.order", law.order.to_string());
    let warping = law.warping.map_or("by rate".to_owned(), |warping| warping.to_string());
    note("texture.warping", warping);
    note("texture.span_ms", (law.span_s * 1000.0).to_string());
    note("texture.min_speed_mm_s", (law.min_speed_m_s * 1000.0).to_string());
    note("texture.min_force_n", law.min_force_n.to_string());
    if law.clips {
        note("texture.clips", "kept".to_owned());
    }
}

fn describe_thesis(texture: &TextureSettings, note: NoteSetting<'_>) {
    let segmentation = &texture.segmentation;
    let optional = |value: Option<f64>| value.map_or("largest found".to_owned(), |value| value.to_string());
    note("segmentation.min_span", segmentation.min_span.to_string());
    note("segmentation.max_order", segmentation.max_order.to_string());
    let variance = match segmentation.variance {
        VarianceEstimate::ConditionalLeastSquares => "conditional least squares",
        VarianceEstimate::YuleWalker => "Yule-Walker",
        VarianceEstimate::Burg => "Burg",
    };
    note("segmentation.variance", variance.to_owned());
    let method = match &segmentation.method {
        SegmentationMethod::Exact { grid: None } => "exact".to_owned(),
        SegmentationMethod::Exact { grid: Some(grid) } => format!("exact, grid {grid}"),
        #[cfg(feature = "genetic")]
        SegmentationMethod::Genetic(genetic) => {
            format!("genetic, {} islands of {}, seed {}", genetic.islands, genetic.population, genetic.seed)
        }
    };
    note("segmentation.method", method);
    note("texture.order", texture.order.map_or("median".to_owned(), |order| order.to_string()));
    let fit = match texture.fit {
        CoefficientFit::YuleWalker => "Yule-Walker",
        CoefficientFit::Burg => "Burg",
    };
    note("texture.fit", fit.to_owned());
    let outliers = match texture.outliers {
        Some(outliers) => format!("{} criteria at {}", outliers.criteria, outliers.confidence),
        None => "kept".to_owned(),
    };
    note("texture.outliers", outliers);
    note("texture.min_speed_mm_s", (texture.min_speed_m_s * 1000.0).to_string());
    note("texture.min_force_n", texture.min_force_n.to_string());
    note("hull.speed_steps", texture.hull.speed_steps.to_string());
    note("hull.force_steps", texture.hull.force_steps.to_string());
    note("hull.max_speed_mm_s", optional(texture.hull.max_speed_m_s.map(|speed| speed * 1000.0)));
    note("hull.max_force_n", optional(texture.hull.max_force_n));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::coverage;
    use crate::recording::Series;
    use crate::recording::tests::synthetic::{circle, drag, provenance};
    use std::cell::Cell;

    fn recordings() -> Vec<AnyRecording> {
        let steps: Vec<_> =
            (0..9).map(|i| (0.3, 0.05 + 0.05 * ((i * 2) % 3) as f64, 0.5 + 0.5 * (i / 3) as f64)).collect();
        let model = |speed: f64, force: f64| (vec![-1.2 - speed, 0.7], speed * force);
        vec![
            AnyRecording::Processed(drag(&steps, 0.5, 1, model)),
            AnyRecording::Raw(circle(2.0, 0.03, 1.0, 1.0, 0.35)),
        ]
    }

    #[test]
    fn each_recording_teaches_what_its_gesture_can() {
        let last = Cell::new(0.0);
        let advance = |part: f64| {
            assert!(part >= last.get() && part <= 1.0);
            last.set(part);
        };
        let (surface, report) = learn("Test", &recordings(), &LearnSettings::default(), &advance).unwrap();
        assert_eq!(last.get(), 1.0);
        assert!((surface.friction.unwrap().mu() - 0.35).abs() < 5e-3, "from the circle, not the drag");
        assert!(surface.texture.is_some() && surface.taps.is_none() && surface.stiffness.is_none());
        assert_eq!(report.drags.len(), 1);
        let (surface, _) = learn("Test", &recordings()[..1], &LearnSettings::default(), &|_| ()).unwrap();
        assert!(
            (surface.friction.unwrap().mu() - 0.5).abs() < 5e-3,
            "from the drag where there is no circle"
        );
    }

    #[test]
    fn a_surface_says_what_it_was_learned_from_and_is_learned_again_to_the_bit() {
        let (surface, report) = learn("Test", &recordings(), &LearnSettings::default(), &|_| ()).unwrap();
        assert_eq!(surface.provenance.origin, Origin::Simulated);
        assert!(surface.provenance.source.contains("made up for a test"));
        assert!(surface.provenance.version.starts_with("haptograph "));
        for (name, value) in
            [("texture.method", "law"), ("processing.reduction", "dft321"), ("recording 2 gesture", "circle")]
        {
            assert_eq!(surface.provenance.settings.get(name).map(String::as_str), Some(value));
        }
        let again = learn("Test", &recordings(), &LearnSettings::default(), &|_| ()).unwrap();
        assert!(again == (surface, report));
    }

    #[test]
    fn a_simulated_recording_among_measured_ones_makes_the_surface_simulated() {
        let AnyRecording::Raw(raw) = &recordings()[1] else { panic!() };
        let measured = crate::recording::Recording::new(
            raw.motion().clone(),
            raw.wrench().clone(),
            raw.acceleration_v().clone(),
            *raw.calibration(),
            Gesture::Circle,
            Provenance { origin: Origin::Measured, ..provenance() },
        );
        let both = [recordings()[0].clone(), AnyRecording::Raw(measured.unwrap())];
        let (surface, _) = learn("Test", &both, &LearnSettings::default(), &|_| ()).unwrap();
        assert_eq!(surface.provenance.origin, Origin::Simulated);
    }

    #[test]
    fn what_cannot_be_learned_is_said() {
        let settings = LearnSettings::default();
        assert!(matches!(learn("Test", &[], &settings, &|_| ()), Err(LearnError::NoRecordings)));
        let press = recordings()[0].clone().with_gesture(Gesture::Press);
        assert!(matches!(
            learn("Test", std::slice::from_ref(&press), &settings, &|_| ()),
            Err(LearnError::ProcessedPress { recording: 0 })
        ));
        assert!(matches!(
            learn("Test", &[press.clone(), press], &settings, &|_| ()),
            Err(LearnError::SecondPress { recording: 1 })
        ));
    }

    /// The drag above with fewer samples per second.
    fn at(rate_hz: f64) -> AnyRecording {
        let slower = ProcessingSettings { rate_hz: Some(rate_hz), ..ProcessingSettings::default() };
        AnyRecording::Processed(crate::processing::processed(&recordings()[0], &slower).unwrap())
    }

    #[test]
    fn the_rate_of_a_recording_is_refused_or_said_or_enough() {
        let accepting = LearnSettings { accept_rate: true, ..LearnSettings::default() };
        for (rate_hz, is_refused, highest) in [
            (100.0, true, Some("45")),
            (400.0, true, Some("180")),
            (1000.0, false, Some("450")),
            (5000.0, false, None),
        ] {
            let recording = at(rate_hz);
            let AnyRecording::Processed(drag) = &recording else { panic!() };
            let seconds = drag.samples() as f64 / rate_hz;
            let given = std::slice::from_ref(&recording);
            let strict = learn("Test", given, &LearnSettings::default(), &|_| ());
            let refused = Err(LearnError::Slow { recording: 0, rate_hz });
            assert_eq!(strict.clone().map(drop), if is_refused { refused } else { Ok(()) });
            let (surface, report) = learn("Test", given, &accepting, &|_| ()).unwrap();
            assert!(is_refused || strict == Ok((surface.clone(), report.clone())), "{rate_hz}");
            let marked = surface.provenance.settings.get(HIGHEST_HZ);
            assert_eq!(marked.map(String::as_str), highest);
            let band_hz = report.band.map(|band| band.highest_hz().to_string());
            assert_eq!(band_hz.as_deref(), highest);
            let used_s = coverage(&report.texture.unwrap().segments, rate_hz).used_s;
            assert!(used_s > 0.9 * seconds && used_s <= seconds, "{used_s} of {seconds} s at {rate_hz} Hz");
        }
    }

    #[test]
    fn friction_needs_no_rate_of_a_vibration() {
        let circle = circle(2.0, 0.03, 1.0, 1.0, 0.35);
        let slow = Series::new(60.0, circle.acceleration_v().iter().step_by(167).collect());
        let slow = crate::recording::Recording::new(
            circle.motion().clone(),
            circle.wrench().clone(),
            slow,
            *circle.calibration(),
            Gesture::Circle,
            provenance(),
        );
        let (surface, report) =
            learn("Test", &[AnyRecording::Raw(slow.unwrap())], &LearnSettings::default(), &|_| ()).unwrap();
        assert!((surface.friction.unwrap().mu() - 0.35).abs() < 0.02 && report.band.is_none());
    }

    #[test]
    fn a_sensor_that_was_not_connected_is_the_one_that_is_named() {
        let with = |change: &dyn Fn(&mut crate::recording::Signals)| {
            let AnyRecording::Processed(drag) = &recordings()[0] else { panic!() };
            let mut signals = drag.signals().clone();
            change(&mut signals);
            let drag = ProcessedRecording::new(signals, Gesture::Drag, provenance()).unwrap();
            let drag = [AnyRecording::Processed(drag)];
            learn("Test", &drag, &LearnSettings::default(), &|_| ()).unwrap_err()
        };
        let gravity = with(&|signals| signals.acceleration_m_s2.fill(9.81));
        assert!(matches!(gravity, LearnError::Still { .. }), "{gravity}");
        let still = with(&|signals| signals.acceleration_m_s2.fill(0.0));
        assert!(matches!(still, LearnError::Still { recording: 0, samples: 2700.. }), "{still}");
        let turned = with(&|signals| signals.force_normal_n.iter_mut().for_each(|force| *force = -*force));
        let no_force = with(&|signals| signals.force_normal_n.fill(0.0));
        let no_speed = with(&|signals| signals.speed_m_s.fill(0.0));
        for (error, suspect) in [(turned, "the sign of"), (no_force, "sensor"), (no_speed, "the speed")] {
            let is_it = matches!(error, LearnError::Texture(LearnTextureError::NothingDragged { .. }));
            assert!(is_it && error.to_string().contains(suspect), "{error}");
        }
    }

    #[test]
    fn a_force_that_was_not_measured_is_no_friction() {
        let processed = crate::processing::processed(&recordings()[0], &Default::default()).unwrap();
        let signals = crate::recording::Signals {
            force_tangential_n: Some(vec![0.0; processed.samples()]),
            ..processed.signals().clone()
        };
        let drag = crate::recording::ProcessedRecording::new(signals, Gesture::Drag, provenance()).unwrap();
        let all = [AnyRecording::Processed(drag)];
        let (surface, report) = learn("Test", &all, &LearnSettings::default(), &|_| ()).unwrap();
        assert!(surface.friction.is_none());
        assert!(matches!(
            report.missing[..],
            [MissingPart { reason: LearnError::Friction(FrictionError::Constant { force_n: 0.0 }), .. }]
        ));
    }

    #[test]
    fn a_texture_is_kept_where_other_parts_cannot_be_learned() {
        let drag = recordings()[0].clone();
        // A tool pulled along by its circle, taps that never leave the surface, a press without a path.
        let pulled = AnyRecording::Raw(circle(2.0, 0.03, 1.0, 1.0, -0.35));
        let still = AnyRecording::Raw(circle(1.0, 0.03, 1.0, 1.0, 0.3)).with_gesture(Gesture::Tap);
        let press = drag.clone().with_gesture(Gesture::Press);
        let all = [drag.clone(), pulled, still, press];
        let (surface, report) = learn("Test", &all, &LearnSettings::default(), &|_| ()).unwrap();
        let (whole, _) = learn("Test", &[drag], &LearnSettings::default(), &|_| ()).unwrap();
        assert_eq!(surface.texture, whole.texture);
        assert!(surface.friction.is_none() && surface.taps.is_none() && surface.stiffness.is_none());
        let parts: Vec<_> = report.missing.iter().map(|missing| missing.part).collect();
        assert_eq!(parts, ["friction", "taps", "stiffness"]);
        assert!(matches!(report.missing[0].reason, LearnError::Friction(FrictionError::Negative { .. })));
        let said = report.missing[0].to_string();
        assert!(said.contains("no friction") && said.contains("record 10 s of smooth circles"), "{said}");
        let kept = &surface.provenance.settings["not learned: taps"];
        assert!(kept.contains("no tap was found"), "the file says it too: {kept}");
    }
}
