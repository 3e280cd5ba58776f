//! Reads a surface from RON.

use super::FORMAT;
use super::document::{
    FilterDocument, FrictionDocument, Head, KindDocument, Places, RecordedDocument, SurfaceDocument,
    TapsDocument, TextureDocument,
};
use crate::files::{Malformed, Place, Problem, ReadError};
use crate::layers::{BuiltIn, LayerKind, LayerSet, ParsedLayer};
use crate::lsf;
use crate::model::{ArmaModel, ModelError, StoredModel};
use crate::{
    Friction, ModelAt, Provenance, Recorded, StaticPeak, Stiffness, Surface, SurfaceError, Tap, Taps,
    TextureModel, VertexKind, texture::TextureError,
};
use ron::error::SpannedError;
use ron::extensions::Extensions;
use ron::value::RawValue;

/// Reads a surface from the text of a `.ron` file.
pub fn read(text: &str) -> Result<Surface, ReadError> {
    read_with::<BuiltIn>(text)
}

/// Like [`read`], with the layers of a program's own set.
///
/// # Errors
/// Those of [`read`].
pub fn read_with<S: LayerSet>(text: &str) -> Result<Surface, ReadError> {
    let mut document = parse::<S>(text)?;
    let raw = document.texture.as_mut().map(|texture| std::mem::take(&mut texture.layers));
    let layers = raw.unwrap_or_default().into_iter().map(|(kind, raw)| parse_layer(kind, raw, text));
    let layers = layers.collect::<Result<Vec<_>, _>>()?;
    surface(document, layers).map_err(|problem| ReadError { place: place_of(&problem, text), problem })
}

pub(crate) fn options() -> ron::Options {
    ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME).with_recursion_limit(32)
}

fn parse<S: LayerSet>(text: &str) -> Result<SurfaceDocument<'_, S>, ReadError> {
    let document = options().from_str::<SurfaceDocument<'_, S>>(text);
    let version = match &document {
        Ok(document) => Some(document.format),
        // A file of another version may have unknown fields; the message about the version is the more useful one.
        Err(_) => options().from_str::<Head>(text).ok().map(|head| head.format),
    };
    if let Some(found) = version.filter(|&found| found != FORMAT) {
        return Err(ReadError { place: None, problem: Problem::Version { found } });
    }
    document.map_err(|error| malformed(text, error))
}

fn malformed(text: &str, error: SpannedError) -> ReadError {
    let (place, reason) = Malformed::of(text, "Surface", error);
    ReadError { place: Some(place), problem: reason.into() }
}

/// Parses a layer's value, which is a part of `text`.
fn parse_layer(kind: &LayerKind, raw: &RawValue, text: &str) -> Result<ParsedLayer, ReadError> {
    (kind.parse)(raw.get_ron()).map_err(|mut error| {
        let before = offset_of(raw, text).and_then(|offset| text.get(..offset)).unwrap_or_default();
        let (start, place) = (&mut error.span.start, Place::after(before));
        if start.line == 1 {
            start.col += place.column - 1;
        }
        start.line += place.line - 1;
        malformed(text, error)
    })
}

fn surface<S>(document: SurfaceDocument<'_, S>, layers: Vec<ParsedLayer>) -> Result<Surface, Problem> {
    let provenance = Provenance {
        origin: document.provenance.origin.into(),
        source: document.provenance.source,
        settings: document.provenance.settings.0,
        version: document.provenance.made_by,
    };
    let mut surface = Surface::new(document.name, provenance);
    surface.friction = document.friction.map(friction).transpose()?;
    surface.stiffness = document
        .stiffness
        .map(|stiffness| Stiffness::new(stiffness.n_per_mm, stiffness.r_squared))
        .transpose()?;
    surface.taps = document.taps.map(taps).transpose()?;
    surface.texture = document.texture.map(|layered| texture(layered.texture, layers)).transpose()?;
    Ok(surface)
}

fn taps(document: TapsDocument) -> Result<Taps, Problem> {
    let taps = document.taps.0.into_iter();
    let taps = taps
        .map(|tap| Tap {
            speed_m_s: tap.speed_mm_s.si,
            acceleration_m_s2: tap.acceleration_m_s2.0,
            peak_force_n: tap.peak_force_n,
        })
        .collect();
    Ok(Taps::new(document.rate_hz, taps)?)
}

/// Half a static peak is as wrong as one of no speed.
fn friction(document: FrictionDocument) -> Result<Friction, SurfaceError> {
    let FrictionDocument { mu, r_squared, static_ratio, stribeck_mm_s } = document;
    let peak = (static_ratio.is_some() || stribeck_mm_s.is_some())
        .then(|| StaticPeak::new(static_ratio.unwrap_or(0.0), stribeck_mm_s.map_or(0.0, |speed| speed.si)));
    Ok(Friction::new(mu, r_squared)?.with_peak(peak.transpose()?))
}

fn texture(document: TextureDocument, layers: Vec<ParsedLayer>) -> Result<TextureModel, Problem> {
    let filters = document
        .filters
        .0
        .into_iter()
        .enumerate()
        .map(|(number, file)| filter(number, file, document.warping))
        .collect::<Result<Vec<_>, _>>()?;
    let mut models = Vec::with_capacity(document.vertices.0.len());
    for (vertex, document) in document.vertices.0.into_iter().enumerate() {
        let no_such = Problem::NoSuchFilter { vertex, filter: document.filter, filters: filters.len() };
        let filter: &ArmaModel = filters.get(document.filter).ok_or(no_such)?;
        let level = |model: ArmaModel| match (document.variance, document.power_m2_s4) {
            (Some(variance), None) => model.with_variance(variance),
            (None, Some(power)) => model.with_power(power),
            _ => Err(ModelError::Level),
        };
        let model = level(filter.clone()).map_err(|error| Problem::Vertex { vertex, error })?;
        let kind = match document.kind {
            KindDocument::Measured => VertexKind::Measured,
            KindDocument::Fitted => VertexKind::Fitted,
            KindDocument::Edge => VertexKind::Edge,
        };
        models.push(ModelAt { speed_m_s: document.speed_mm_s.si, force_n: document.force_n, model, kind });
    }
    let texture = match document.triangles {
        Some(triangles) => TextureModel::new(document.rate_hz, models, triangles.0)?,
        None => TextureModel::triangulated(document.rate_hz, models)?,
    };
    let recorded = document.recorded.map(|RecordedDocument { speed_mm_s: (slow, fast), force_n }| Recorded {
        speed_m_s: (slow.si, fast.si),
        force_n,
    });
    let mut texture = texture.with_highpass_hz(document.highpass_hz)?.with_recorded(recorded)?;
    for layer in layers {
        if let Some(layer) = layer().map_err(TextureError::from)? {
            let name = layer.kind().name;
            if texture.layers().any(|own| own.kind().name == name) {
                return Err(Problem::Twice { layer: name });
            }
            texture = texture.with_layer(layer)?;
        }
    }
    Ok(texture)
}

/// A filter; computes coefficients from LSFs, or LSFs from coefficients, if the file has only one of them.
fn filter(number: usize, document: FilterDocument, warping: Option<f64>) -> Result<ArmaModel, Problem> {
    let failed = |error: ModelError| Problem::Filter { filter: number, error };
    let list = |list: Option<super::document::Coefficients>| list.map(|list| list.0);
    let (ar, ar_lsf) = both(list(document.ar), list(document.ar_lsf), crate::model::Polynomial::Ar)
        .ok_or(Problem::EmptyFilter { filter: number })?
        .map_err(failed)?;
    let (ma, ma_lsf) = both(list(document.ma), list(document.ma_lsf), crate::model::Polynomial::Ma)
        .unwrap_or(Ok((Vec::new(), Vec::new())))
        .map_err(failed)?;
    if let Some(warping) = warping {
        if !ma.is_empty() || document.gain.is_some() {
            return Err(failed(ModelError::WarpedMovingAverage));
        }
        return ArmaModel::warped_from_stored(ar, ar_lsf, warping).map_err(failed);
    }
    let gain = document.gain.unwrap_or(1.0);
    ArmaModel::from_stored(StoredModel { ar, ar_lsf, ma, ma_lsf, gain, variance: 0.0 }).map_err(failed)
}

type Both = (Vec<f64>, Vec<f64>);

fn both(
    coefficients: Option<Vec<f64>>,
    frequencies: Option<Vec<f64>>,
    polynomial: crate::model::Polynomial,
) -> Option<Result<Both, ModelError>> {
    match (coefficients, frequencies) {
        (Some(coefficients), Some(frequencies)) => Some(Ok((coefficients, frequencies))),
        (Some(coefficients), None) => {
            let mut frequencies = vec![0.0; coefficients.len()];
            Some(match lsf::ar_to_lsf(&coefficients, &mut frequencies) {
                Ok(()) => Ok((coefficients, frequencies)),
                Err(_) => Err(ModelError::Unstable { polynomial }),
            })
        }
        (None, Some(frequencies)) => {
            let mut coefficients = vec![0.0; frequencies.len()];
            lsf::lsf_into_ar(&frequencies, &mut coefficients);
            Some(Ok((coefficients, frequencies)))
        }
        (None, None) => None,
    }
}

/// The location in the text of the filter or vertex of a problem.
fn place_of(problem: &Problem, text: &str) -> Option<Place> {
    enum At {
        Filter(usize),
        Vertex(usize),
    }
    let at = match *problem {
        Problem::Filter { filter, .. } | Problem::EmptyFilter { filter } => At::Filter(filter),
        Problem::NoSuchFilter { vertex, .. } | Problem::Vertex { vertex, .. } => At::Vertex(vertex),
        Problem::Texture(
            TextureError::Orders { vertex, .. }
            | TextureError::LoudAtRest { vertex, .. }
            | TextureError::Triangulation(
                crate::triangulation::TriangulationError::Position { vertex, .. }
                | crate::triangulation::TriangulationError::SamePlace { second: vertex, .. },
            ),
        ) => At::Vertex(vertex),
        _ => return None,
    };
    let texture = options().from_str::<Places>(text).ok()?.texture?;
    let raw = match at {
        At::Filter(filter) => texture.filters.get(filter)?,
        At::Vertex(vertex) => texture.vertices.get(vertex)?,
    };
    let blank = raw.get_ron().len() - raw.get_ron().trim_start().len();
    text.get(..offset_of(raw, text)? + blank).map(Place::after)
}

/// Where a raw value begins in its text, the whitespace before it included.
fn offset_of(raw: &RawValue, text: &str) -> Option<usize> {
    (raw.get_ron().as_ptr() as usize).checked_sub(text.as_ptr() as usize)
}
