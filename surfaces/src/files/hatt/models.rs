//! Reads model files.

use super::cursor::{Cursor, Element};
use super::{HattProblem, KEPT, kinds};
use crate::files::{MAX_MODELS, Problem};
use crate::model::{ArmaModel, ModelError, StoredModel};
use crate::{Friction, MAX_ORDER, ModelAt, Origin, Provenance, Surface, TextureModel, VertexKind};

/// The fields of a model set, each at most once.
#[derive(Default)]
struct ModelSet {
    material: Option<String>,
    rate_hz: Option<f64>,
    mu: Option<f64>,
    model_count: Option<f64>,
    triangle_count: Option<f64>,
    max_speed_m_s: Option<f64>,
    max_force_n: Option<f64>,
    speeds_m_s: Option<Vec<f64>>,
    forces_n: Option<Vec<f64>>,
    triangles: Vec<[u32; 3]>,
    ar_count: Option<f64>,
    ma_count: Option<f64>,
    models: Vec<(f64, f64, ArmaModel)>,
    kept: Vec<(&'static str, String)>,
    units: [bool; 3],
}

const UNITS: [(&str, &str); 3] = [("AccelUnits", "m/s^2"), ("SpeedUnits", "mm/s"), ("ForceUnits", "N")];
const SET: &str = "modelSet";

/// Reads a model set after the start of its root element.
pub(super) fn read(cursor: &mut Cursor, root: &Element) -> Result<Surface, Problem> {
    let mut set = ModelSet::default();
    let mut filters = Vec::new();
    while let Some(element) = cursor.child(SET)? {
        read_field(cursor, &element.name, &mut set, &mut filters)?;
    }
    finish(set, root)
}

fn read_field(
    cursor: &mut Cursor,
    name: &str,
    set: &mut ModelSet,
    filters: &mut Vec<ArmaModel>,
) -> Result<(), Problem> {
    match name {
        "material" => once(&mut set.material, cursor.text(name)?, "material", SET)?,
        "SampleRate" => once(&mut set.rate_hz, cursor.number(name)?, "SampleRate", SET)?,
        "mu" => once(&mut set.mu, cursor.number(name)?, "mu", SET)?,
        "numMod" => once(&mut set.model_count, cursor.number(name)?, "numMod", SET)?,
        "numTri" => once(&mut set.triangle_count, cursor.number(name)?, "numTri", SET)?,
        "maxSpeed" => once(&mut set.max_speed_m_s, cursor.thousandth(name)?, "maxSpeed", SET)?,
        "maxForce" => once(&mut set.max_force_n, cursor.number(name)?, "maxForce", SET)?,
        "speedList" => {
            let speeds = cursor.values("speedList", MAX_MODELS, Cursor::thousandth)?;
            once(&mut set.speeds_m_s, speeds, "speedList", SET)?;
        }
        "forceList" => {
            let forces = cursor.values("forceList", MAX_MODELS, Cursor::number)?;
            once(&mut set.forces_n, forces, "forceList", SET)?;
        }
        "tri" => {
            if set.triangles.len() == 2 * MAX_MODELS {
                return Err(HattProblem::TooMany { field: "tri", most: 2 * MAX_MODELS }.into());
            }
            set.triangles.push(triangle(&cursor.values("tri", 3, Cursor::number)?)?);
        }
        "numARCoeff" => once(&mut set.ar_count, cursor.number(name)?, "numARCoeff", SET)?,
        "numMACoeff" => once(&mut set.ma_count, cursor.number(name)?, "numMACoeff", SET)?,
        "model" => {
            if set.models.len() == MAX_MODELS {
                return Err(HattProblem::TooMany { field: "model", most: MAX_MODELS }.into());
            }
            set.models.push(read_model(cursor, set.models.len(), filters)?);
        }
        _ => return read_label(cursor, name, set),
    }
    Ok(())
}

/// Units and pictures.
fn read_label(cursor: &mut Cursor, name: &str, set: &mut ModelSet) -> Result<(), Problem> {
    if let Some(index) = UNITS.iter().position(|(field, _)| *field == name) {
        let (field, expected) = UNITS[index];
        let found = cursor.text(name)?;
        if set.units[index] {
            return Err(HattProblem::Repeated { field, parent: SET }.into());
        }
        if found.trim() != expected {
            return Err(HattProblem::Units { field, found, expected }.into());
        }
        set.units[index] = true;
        return Ok(());
    }
    let Some(&field) = KEPT.iter().find(|field| **field == name) else {
        return Err(HattProblem::Unknown { field: name.to_owned(), parent: SET }.into());
    };
    if set.kept.iter().any(|(kept, _)| *kept == field) {
        return Err(HattProblem::Repeated { field, parent: SET }.into());
    }
    set.kept.push((field, cursor.text(name)?));
    Ok(())
}

fn triangle(values: &[f64]) -> Result<[u32; 3], HattProblem> {
    let wrong = || HattProblem::Mismatch { field: "tri", stated: values.len() as f64, actual: 3.0 };
    let [a, b, c] = *values else { return Err(wrong()) };
    let mut triangle = [0; 3];
    for (vertex, number) in triangle.iter_mut().zip([a, b, c]) {
        if !(number.fract() == 0.0 && (1.0..=MAX_MODELS as f64).contains(&number)) {
            return Err(HattProblem::Number { field: "tri".to_owned(), text: number.to_string() });
        }
        // From 1 in the file.
        *vertex = number as u32 - 1;
    }
    Ok(triangle)
}

/// The fields of one model, each at most once.
#[derive(Default)]
struct Model {
    number: Option<f64>,
    ar: Option<Vec<f64>>,
    ar_lsf: Option<Vec<f64>>,
    ma: Option<Vec<f64>>,
    ma_lsf: Option<Vec<f64>>,
    variance: Option<f64>,
    gain: Option<f64>,
    speed_m_s: Option<f64>,
    force_n: Option<f64>,
}

const MODEL: &str = "model";

fn read_model(
    cursor: &mut Cursor,
    vertex: usize,
    filters: &mut Vec<ArmaModel>,
) -> Result<(f64, f64, ArmaModel), Problem> {
    let mut model = Model::default();
    // With the leading 1.
    let terms = MAX_ORDER + 1;
    while let Some(element) = cursor.child(MODEL)? {
        let name = element.name.as_str();
        match name {
            "modNum" => once(&mut model.number, cursor.number(name)?, "modNum", MODEL)?,
            "ARcoeff" => {
                once(&mut model.ar, cursor.values("ARcoeff", terms, Cursor::number)?, "ARcoeff", MODEL)?
            }
            "ARlsf" => {
                once(&mut model.ar_lsf, cursor.values("ARlsf", MAX_ORDER, Cursor::number)?, "ARlsf", MODEL)?
            }
            "MAcoeff" => {
                once(&mut model.ma, cursor.values("MAcoeff", terms, Cursor::number)?, "MAcoeff", MODEL)?
            }
            "MAlsf" => {
                once(&mut model.ma_lsf, cursor.values("MAlsf", MAX_ORDER, Cursor::number)?, "MAlsf", MODEL)?
            }
            "var" => once(&mut model.variance, cursor.number(name)?, "var", MODEL)?,
            "gain" => once(&mut model.gain, cursor.number(name)?, "gain", MODEL)?,
            "speedMod" => once(&mut model.speed_m_s, cursor.thousandth(name)?, "speedMod", MODEL)?,
            "forceMod" => once(&mut model.force_n, cursor.number(name)?, "forceMod", MODEL)?,
            _ => {
                return Err(HattProblem::Unknown { field: element.name, parent: MODEL }.into());
            }
        }
    }
    same("modNum", need(model.number, "modNum", MODEL)?, (vertex + 1) as f64)?;
    let stored = StoredModel {
        ar: monic(need(model.ar, "ARcoeff", MODEL)?, "ARcoeff")?,
        ar_lsf: need(model.ar_lsf, "ARlsf", MODEL)?,
        ma: monic(need(model.ma, "MAcoeff", MODEL)?, "MAcoeff")?,
        ma_lsf: need(model.ma_lsf, "MAlsf", MODEL)?,
        gain: model.gain.unwrap_or(1.0),
        variance: need(model.variance, "var", MODEL)?,
    };
    let arma = shared(filters, stored).map_err(|error| Problem::Vertex { vertex, error })?;
    Ok((need(model.speed_m_s, "speedMod", MODEL)?, need(model.force_n, "forceMod", MODEL)?, arma))
}

fn monic(mut polynomial: Vec<f64>, field: &'static str) -> Result<Vec<f64>, HattProblem> {
    if polynomial.first() != Some(&1.0) {
        return Err(HattProblem::Monic { field });
    }
    polynomial.remove(0);
    polynomial.shrink_to_fit();
    Ok(polynomial)
}

/// The model. It shares the filter of an earlier model with an equal one, because a file repeats filters along the border.
fn shared(filters: &mut Vec<ArmaModel>, stored: StoredModel) -> Result<ArmaModel, ModelError> {
    let model = ArmaModel::from_stored(stored)?;
    match filters.iter().find(|filter| filter.same_filter(&model)) {
        Some(filter) => filter.clone().with_variance(model.variance()),
        None => {
            filters.push(model.clone());
            Ok(model)
        }
    }
}

fn finish(set: ModelSet, root: &Element) -> Result<Surface, Problem> {
    let count = set.models.len() as f64;
    same("numMod", need(set.model_count, "numMod", SET)?, count)?;
    same("numTri", need(set.triangle_count, "numTri", SET)?, set.triangles.len() as f64)?;
    let speeds = need(set.speeds_m_s, "speedList", SET)?;
    let forces = need(set.forces_n, "forceList", SET)?;
    same("numMod", count, speeds.len() as f64)?;
    same("numMod", count, forces.len() as f64)?;
    for ((speed, force, _), (listed_speed, listed_force)) in set.models.iter().zip(speeds.iter().zip(&forces))
    {
        same("speedMod", 1000.0 * speed, 1000.0 * listed_speed)?;
        same("forceMod", *force, *listed_force)?;
    }
    let largest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    same("maxSpeed", 1000.0 * need(set.max_speed_m_s, "maxSpeed", SET)?, 1000.0 * largest(&speeds))?;
    same("maxForce", need(set.max_force_n, "maxForce", SET)?, largest(&forces))?;
    let orders =
        set.models.first().map(|(_, _, model)| (model.ar().len(), model.ma().len())).unwrap_or_default();
    same("numARCoeff", need(set.ar_count, "numARCoeff", SET)?, orders.0 as f64)?;
    same("numMACoeff", need(set.ma_count, "numMACoeff", SET)?, orders.1 as f64)?;
    for (index, (field, _)) in UNITS.into_iter().enumerate() {
        need(set.units[index].then_some(()), field, SET)?;
    }
    let mut provenance = Provenance::new(Origin::Imported, "Penn Haptic Texture Toolkit model file");
    let texture_number = root.texture.iter().map(|number| ("texture", number.clone()));
    for (field, value) in set.kept.into_iter().chain(texture_number) {
        provenance = provenance.with_setting(format!("hatt.{field}"), value);
    }
    let mut surface = Surface::new(need(set.material, "material", SET)?, provenance);
    surface.friction = Some(Friction::new(need(set.mu, "mu", SET)?, None)?);
    let mut models: Vec<ModelAt> = set
        .models
        .into_iter()
        .map(|(speed_m_s, force_n, model)| ModelAt { speed_m_s, force_n, model, kind: VertexKind::Edge })
        .collect();
    kinds::infer(&mut models);
    let rate_hz = need(set.rate_hz, "SampleRate", SET)?;
    surface.texture = Some(TextureModel::new(rate_hz, models, set.triangles)?);
    Ok(surface)
}

pub(super) fn once<T>(
    place: &mut Option<T>,
    value: T,
    field: &'static str,
    parent: &'static str,
) -> Result<(), HattProblem> {
    if place.replace(value).is_some() { Err(HattProblem::Repeated { field, parent }) } else { Ok(()) }
}

pub(super) fn need<T>(value: Option<T>, field: &'static str, parent: &'static str) -> Result<T, HattProblem> {
    value.ok_or(HattProblem::Missing { field, parent })
}

pub(super) fn same(field: &'static str, stated: f64, actual: f64) -> Result<(), HattProblem> {
    if stated == actual { Ok(()) } else { Err(HattProblem::Mismatch { field, stated, actual }) }
}
