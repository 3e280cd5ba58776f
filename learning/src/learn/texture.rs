//! Learns a texture from drag recordings: a map of autoregressive models (thesis 2.3.3 and 2.3.4).
//!
//! Each recording is segmented. Each segment becomes a model of one common order (the median of the segments' orders),
//! labelled with its median speed and force. Outliers are dropped. The rest are extended to rest and to the largest speed
//! and force, and triangulated.

use super::outliers::{OutlierSettings, residual_bound, studentized_residuals};
use super::segmentation::{Segmentation, SegmentationError, SegmentationSettings, segment};
use crate::recording::ProcessedRecording;
use haptograph_signal::prediction::{autocovariance, burg, levinson};
use haptograph_signal::spectrum::{spectral_centroid, welch};
use haptograph_signal::statistics::{mean, median};
use haptograph_signal::window::Window;
use haptograph_surfaces::hull::Hull;
use haptograph_surfaces::{
    ArmaModel, MAX_ORDER, ModelAt, ModelError, TextureError, TextureModel, VertexKind,
};
use std::ops::Range;

/// Settings for learning a texture; the defaults are the thesis's if it states them.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureSettings {
    /// Segmentation of recordings.
    pub segmentation: SegmentationSettings,
    /// The common order; if `None`, the median of the segments' orders.
    pub order: Option<usize>,
    /// Estimation of the coefficients, given segments and order.
    pub fit: CoefficientFit,
    /// Detection of outliers; `None` keeps all models.
    pub outliers: Option<OutlierSettings>,
    /// Extension of the map.
    pub hull: Hull,
    /// Segments with a lower median speed count as a tool at rest, m/s.
    pub min_speed_m_s: f64,
    /// Segments with a lower median force count as a tool in the air, N.
    pub min_force_n: f64,
}

impl Default for TextureSettings {
    fn default() -> Self {
        Self {
            segmentation: SegmentationSettings::default(),
            order: None,
            fit: CoefficientFit::YuleWalker,
            outliers: Some(OutlierSettings::default()),
            hull: Hull::default(),
            min_speed_m_s: 0.001,
            min_force_n: 0.05,
        }
    }
}

/// Estimation of a segment's coefficients. Both methods give stable models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CoefficientFit {
    /// The biased autocovariance and the Levinson-Durbin recursion, as in the thesis.
    #[default]
    YuleWalker,
    /// Burg's lattice: sharper resonances from short segments.
    Burg,
}

/// The five criteria by which models are compared, in the order of [`SegmentReport::features`].
pub(crate) const CRITERIA: [&str; 5] =
    ["residual variance", "power", "spectral centroid", "skewness", "kurtosis"];

/// The report of learning a texture.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureReport {
    /// The common order.
    pub order: usize,
    /// The segmentation of each recording.
    pub segmentations: Vec<Segmentation>,
    /// All segments of all recordings in order.
    pub segments: Vec<SegmentReport>,
    /// Bound of studentized residuals; a segment beyond it fails a criterion.
    pub residual_bound: f64,
}

/// A segment, and its use in the texture.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmentReport {
    /// Index of its recording.
    pub recording: usize,
    /// The samples.
    pub samples: Range<usize>,
    /// The order by minimum description length.
    pub order: usize,
    /// Median speed, m/s.
    pub speed_m_s: f64,
    /// Median normal force, N.
    pub force_n: f64,
    /// Residual variance and power in (m/s²)², spectral centroid in Hz, skewness and kurtosis; see `CRITERIA`.
    pub features: [f64; 5],
    /// Studentized residuals of the features, if a plane could be fitted.
    pub residuals: [Option<f64>; 5],
    /// Use of the segment.
    pub fate: Fate,
}

/// Use of a segment in a texture.
#[derive(Debug, Clone, PartialEq)]
pub enum Fate {
    /// The segment is a model of the texture.
    Kept,
    /// The tool was at rest or in the air.
    NotDragged,
    /// The segment failed too many criteria.
    Outlier {
        /// Number of failed criteria.
        criteria: usize,
    },
    /// A longer segment has exactly the same speed and force.
    Duplicate,
    /// The segment has no usable model.
    Unusable {
        /// The reason.
        reason: String,
    },
}

/// An error of learning a texture.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum LearnTextureError {
    #[error("no drag recording was given, and a texture needs one: add a recording of dragging")]
    NoRecordings,
    #[error(
        "recording {recording} (from 0) has a rate of {rate_hz} Hz, but the first has {expected_hz} Hz; all rates must be equal"
    )]
    Rates { recording: usize, rate_hz: f64, expected_hz: f64 },
    #[error("recording {recording} (from 0) cannot be segmented: {source}")]
    Segmentation { recording: usize, source: SegmentationError },
    #[error(
        "no segment is a drag (normal force above {min_force_n} N, speed above {min_speed_mm_s} mm/s): the medians of \
         {segments} segments are {force_n:.3} N and {speed_mm_s:.1} mm/s; check {}",
        suspect([*force_n, *min_force_n])
    )]
    NothingDragged { segments: usize, force_n: f64, speed_mm_s: f64, min_force_n: f64, min_speed_mm_s: f64 },
    #[error("the order is {order}; it must be from 1 to {MAX_ORDER}")]
    Order { order: usize },
    #[error("no segment gave a usable model; the error of the first is: {reason}")]
    NoModels { reason: String },
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Texture(#[from] TextureError),
}

/// The quantity that lies below the bounds of a drag.
fn suspect([force_n, min_force_n]: [f64; 2]) -> &'static str {
    match force_n {
        _ if force_n > min_force_n => "the unit of the speed, and that the tool moved",
        _ if force_n < -min_force_n => "the sign of the normal force",
        _ => "the unit of the normal force, and that its sensor was connected",
    }
}

/// Learns a texture from drag recordings. `progress` receives the fraction done, 0 to 1.
pub fn learn_texture(
    recordings: &[ProcessedRecording],
    settings: &TextureSettings,
    progress: &dyn Fn(f64),
) -> Result<(TextureModel, TextureReport), LearnTextureError> {
    let rate_hz = common_rate(recordings)?;
    let mut segmentations = vec![];
    let mut segments = vec![];
    for (index, recording) in recordings.iter().enumerate() {
        let signals = recording.signals();
        let found = segment(&signals.acceleration_m_s2, &settings.segmentation)
            .map_err(|source| LearnTextureError::Segmentation { recording: index, source })?;
        for (samples, &order) in found.segments(recording.samples()).zip(&found.orders) {
            segments.push(describe(index, recording, samples, order, settings));
        }
        segmentations.push(found);
        progress(0.9 * (index + 1) as f64 / recordings.len() as f64);
    }
    let order = common_order(&segments, settings)?;
    let models = fit_models(recordings, &mut segments, order, settings);
    drop_duplicates(&mut segments);
    let residual_bound = judge(&mut segments, settings.outliers);
    let measured: Vec<ModelAt> = segments
        .iter()
        .zip(models)
        .filter(|(segment, _)| segment.fate == Fate::Kept)
        .filter_map(|(segment, model)| {
            let (speed_m_s, force_n) = (segment.speed_m_s, segment.force_n);
            Some(ModelAt { speed_m_s, force_n, model: model?, kind: VertexKind::Measured })
        })
        .collect();
    if measured.is_empty() {
        let reason = unusable(&segments).unwrap_or_default();
        return Err(LearnTextureError::NoModels { reason });
    }
    let texture = TextureModel::from_measured(rate_hz, measured, &settings.hull)?;
    progress(1.0);
    Ok((texture, TextureReport { order, segmentations, segments, residual_bound }))
}

pub(super) fn common_rate(recordings: &[ProcessedRecording]) -> Result<f64, LearnTextureError> {
    let expected_hz = recordings.first().ok_or(LearnTextureError::NoRecordings)?.rate_hz();
    match recordings.iter().position(|recording| recording.rate_hz() != expected_hz) {
        Some(recording) => {
            Err(LearnTextureError::Rates { recording, rate_hz: recordings[recording].rate_hz(), expected_hz })
        }
        None => Ok(expected_hz),
    }
}

fn describe(
    recording: usize,
    signals: &ProcessedRecording,
    samples: Range<usize>,
    order: usize,
    settings: &TextureSettings,
) -> SegmentReport {
    let rate_hz = signals.rate_hz();
    let signals = signals.signals();
    let speed_m_s = median(&signals.speed_m_s[samples.clone()]);
    let force_n = median(&signals.force_normal_n[samples.clone()]);
    let dragged = speed_m_s > settings.min_speed_m_s && force_n > settings.min_force_n;
    let features = features(&signals.acceleration_m_s2[samples.clone()], rate_hz);
    SegmentReport {
        recording,
        samples,
        order,
        speed_m_s,
        force_n,
        features,
        residuals: [None; 5],
        fate: if dragged { Fate::Kept } else { Fate::NotDragged },
    }
}

/// The features of [`CRITERIA`] without the first.
pub(super) fn features(signal: &[f64], rate_hz: f64) -> [f64; 5] {
    let mean = mean(signal);
    let moment =
        |power: i32| signal.iter().map(|x| (x - mean).powi(power)).sum::<f64>() / signal.len() as f64;
    let variance = moment(2);
    let shape = |power: i32| {
        if variance > 0.0 { moment(power) / variance.powf(f64::from(power) / 2.0) } else { 0.0 }
    };
    let power = signal.iter().map(|x| x * x).sum::<f64>() / signal.len() as f64;
    let window = signal.len().min(256);
    let centroid = welch(signal, rate_hz, window, window / 2, Window::Hamming)
        .map_or(0.0, |psd| spectral_centroid(&psd.frequency_hz, &psd.density));
    [0.0, power, centroid, shape(3), shape(4)]
}

fn common_order(segments: &[SegmentReport], settings: &TextureSettings) -> Result<usize, LearnTextureError> {
    let dragged: Vec<f64> =
        segments.iter().filter(|s| s.fate == Fate::Kept).map(|segment| segment.order as f64).collect();
    if dragged.is_empty() {
        return Err(nothing_dragged(segments, settings.min_force_n, settings.min_speed_m_s));
    }
    let order = settings.order.unwrap_or(median(&dragged).round() as usize);
    if (1..=MAX_ORDER).contains(&order) { Ok(order) } else { Err(LearnTextureError::Order { order }) }
}

/// Why the first segment without a usable model has none.
fn unusable(segments: &[SegmentReport]) -> Option<String> {
    segments.iter().find_map(|segment| match &segment.fate {
        Fate::Unusable { reason } => Some(reason.clone()),
        _ => None,
    })
}

pub(super) fn nothing_dragged(
    segments: &[SegmentReport],
    min_force_n: f64,
    min_speed_m_s: f64,
) -> LearnTextureError {
    let of = |value: fn(&SegmentReport) -> f64| median(&segments.iter().map(value).collect::<Vec<_>>());
    if let Some(reason) = unusable(segments) {
        return LearnTextureError::NoModels { reason };
    }
    LearnTextureError::NothingDragged {
        segments: segments.len(),
        force_n: of(|segment| segment.force_n),
        speed_mm_s: of(|segment| segment.speed_m_s) * 1000.0,
        min_force_n,
        min_speed_mm_s: min_speed_m_s * 1000.0,
    }
}

/// A model for each dragged segment, at the common order.
fn fit_models(
    recordings: &[ProcessedRecording],
    segments: &mut [SegmentReport],
    order: usize,
    settings: &TextureSettings,
) -> Vec<Option<ArmaModel>> {
    let fit = |segment: &mut SegmentReport| {
        if segment.fate != Fate::Kept {
            return None;
        }
        let signal = &recordings[segment.recording].signals().acceleration_m_s2[segment.samples.clone()];
        let prediction = match settings.fit {
            CoefficientFit::YuleWalker => levinson(&autocovariance(signal, order), order),
            CoefficientFit::Burg => burg(signal, order),
        };
        let model = prediction
            .map_err(|e| e.to_string())
            .and_then(|p| ArmaModel::from_ar(&p.ar, p.variance).map_err(|e| e.to_string()));
        match model {
            Ok(model) => {
                segment.features[0] = model.variance();
                Some(model)
            }
            Err(reason) => {
                segment.fate = Fate::Unusable { reason };
                None
            }
        }
    };
    segments.iter_mut().map(fit).collect()
}

/// Keeps only the longest of segments at the same position on the map.
fn drop_duplicates(segments: &mut [SegmentReport]) {
    for i in 0..segments.len() {
        let same = |other: &SegmentReport| {
            other.fate == Fate::Kept
                && other.speed_m_s == segments[i].speed_m_s
                && other.force_n == segments[i].force_n
        };
        let longer = |(j, other): (usize, &SegmentReport)| {
            j != i && same(other) && (other.samples.len(), j) > (segments[i].samples.len(), i)
        };
        if segments[i].fate == Fate::Kept && segments.iter().enumerate().any(longer) {
            segments[i].fate = Fate::Duplicate;
        }
    }
}

/// Drops outliers; returns the bound of the residuals.
fn judge(segments: &mut [SegmentReport], settings: Option<OutlierSettings>) -> f64 {
    let mut kept: Vec<&mut SegmentReport> = segments.iter_mut().filter(|s| s.fate == Fate::Kept).collect();
    let Some(settings) = settings else {
        return f64::INFINITY;
    };
    let bound = residual_bound(kept.len(), settings.confidence);
    let positions: Vec<(f64, f64)> = kept.iter().map(|s| (s.speed_m_s, s.force_n)).collect();
    for criterion in 0..CRITERIA.len() {
        let values: Vec<f64> = kept.iter().map(|s| s.features[criterion]).collect();
        if let Some(residuals) = studentized_residuals(&positions, &values) {
            for (segment, residual) in kept.iter_mut().zip(residuals) {
                segment.residuals[criterion] = Some(residual);
            }
        }
    }
    for segment in kept {
        let failed = segment.residuals.iter().flatten().filter(|residual| residual.abs() > bound).count();
        if failed >= settings.criteria.max(1) {
            segment.fate = Fate::Outlier { criteria: failed };
        }
    }
    bound
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::tests::synthetic::drag;

    /// Three speeds at each of three forces, half a second each; louder and brighter the faster and harder.
    fn nine() -> Vec<(f64, f64, f64)> {
        (0..9).map(|i| (0.5, 0.05 + 0.05 * ((i * 2) % 3) as f64, 0.5 + 0.5 * (i / 3) as f64)).collect()
    }

    fn model(speed: f64, force: f64) -> (Vec<f64>, f64) {
        let (radius, angle) = (0.93_f64, 0.4 + 3.0 * speed);
        (vec![-2.0 * radius * angle.cos(), radius * radius], 1.0 + 10.0 * speed * force)
    }

    fn learned(settings: &TextureSettings) -> (TextureModel, TextureReport) {
        learn_texture(&[drag(&nine(), 0.3, 1, model)], settings, &|_| ()).unwrap()
    }

    #[test]
    fn every_step_of_a_drag_becomes_a_model_at_its_speed_and_force() {
        let (texture, report) = learned(&TextureSettings { outliers: None, ..Default::default() });
        assert_eq!((report.order, report.segments.len()), (2, 9));
        for (i, (segment, (_, speed, force))) in report.segments.iter().zip(nine()).enumerate() {
            assert!(segment.samples.start.abs_diff(5000 * i) < 60, "{:?}", segment.samples);
            assert!((segment.speed_m_s - speed).abs() < 1e-3 && (segment.force_n - force).abs() < 1e-2);
        }
        let measured = texture.models().iter().filter(|at| at.kind == VertexKind::Measured);
        for (at, (_, speed, force)) in measured.zip(nine()) {
            let (a, variance) = model(speed, force);
            for (found, true_value) in at.model.ar().iter().zip(&a) {
                assert!((found - true_value).abs() < 0.05, "{found} for {true_value}");
            }
            assert!(
                (at.model.variance() / variance - 1.0).abs() < 0.1,
                "{} for {variance}",
                at.model.variance()
            );
        }
        assert_eq!(texture.rate_hz(), 10_000.0);
    }

    #[test]
    fn burg_and_yule_walker_agree_on_long_segments() {
        let by = |fit| learned(&TextureSettings { fit, outliers: None, ..Default::default() }).0;
        let (yule_walker, burg) = (by(CoefficientFit::YuleWalker), by(CoefficientFit::Burg));
        for (a, b) in yule_walker.models().iter().zip(burg.models()) {
            assert!(a.model.ar().iter().zip(b.model.ar()).all(|(a, b)| (a - b).abs() < 5e-3));
        }
    }

    #[test]
    fn learning_twice_gives_the_same_bits() {
        let settings = TextureSettings::default();
        assert_eq!(learned(&settings), learned(&settings));
    }

    #[test]
    fn a_slip_is_dropped_and_the_rest_stays() {
        let steps: Vec<_> =
            (0..25).map(|i| (0.3, 0.05 + 0.03 * ((i * 2) % 5) as f64, 0.5 + 0.3 * (i / 5) as f64)).collect();
        let slip = steps[12];
        let with_slip = |speed: f64, force: f64| {
            let (a, variance) = model(speed, force);
            // The same step, but thirty times the energy.
            if (speed, force) == (slip.1, slip.2) { (a, 30.0 * variance) } else { (a, variance) }
        };
        let (_, report) =
            learn_texture(&[drag(&steps, 0.3, 2, with_slip)], &TextureSettings::default(), &|_| ()).unwrap();
        assert_eq!(report.segments.len(), 25);
        assert!(
            matches!(report.segments[12].fate, Fate::Outlier { criteria: 2.. }),
            "{:?}",
            report.segments[12]
        );
        let kept = report.segments.iter().filter(|s| s.fate == Fate::Kept).count();
        assert!(kept >= 22, "{kept} of 24 good ones kept");
    }

    #[test]
    fn a_tool_at_rest_or_in_the_air_teaches_nothing() {
        let mut steps = nine();
        steps.push((0.5, 0.0, 1.0));
        steps.push((0.5, 0.1, 0.01));
        let quiet = |speed: f64, force: f64| match (speed, force) {
            (0.0, _) => (vec![0.5, 0.2], 0.01),
            (_, 0.01) => (vec![-0.2, 0.3], 0.3),
            _ => model(speed, force),
        };
        let settings = TextureSettings { outliers: None, ..Default::default() };
        let (texture, report) = learn_texture(&[drag(&steps, 0.3, 3, quiet)], &settings, &|_| ()).unwrap();
        let idle = report.segments.iter().filter(|s| s.fate == Fate::NotDragged).count();
        assert_eq!(idle, 2);
        assert_eq!(texture.models().iter().filter(|at| at.kind == VertexKind::Measured).count(), 9);
        let nothing = drag(&[(0.5, 0.1, 0.01)], 0.3, 4, model);
        let error = learn_texture(&[nothing], &settings, &|_| ()).unwrap_err();
        assert!(matches!(error, LearnTextureError::NothingDragged { .. }), "{error}");
        assert_eq!(learn_texture(&[], &settings, &|_| ()), Err(LearnTextureError::NoRecordings));
    }

    #[test]
    fn features_of_a_square_wave_are_its_closed_form() {
        let signal: Vec<f64> = (0..1024).map(|i| if i % 8 < 4 { 2.0 } else { -2.0 }).collect();
        let [_, power, centroid, skewness, kurtosis] = features(&signal, 8000.0);
        assert!((power - 4.0).abs() < 1e-12 && skewness.abs() < 1e-12 && (kurtosis - 1.0).abs() < 1e-12);
        // Sampled eight times a period it has harmonics 1 and 3, with powers as 1/sin² of their half angles.
        let harmonic = |k: f64| 1.0 / (std::f64::consts::PI * k / 8.0).sin().powi(2);
        let expected = 1000.0 * (harmonic(1.0) + 3.0 * harmonic(3.0)) / (harmonic(1.0) + harmonic(3.0));
        assert!((centroid / expected - 1.0).abs() < 0.01, "{centroid} for {expected}");
    }
}
