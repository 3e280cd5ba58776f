//! Writes toolkit files.

use super::{HattWriteError, KEPT, TAP_RATE_HZ, TAP_SAMPLES, label};
use crate::{ArmaModel, ModelAt, Provenance, Surface, TextureModel};
use haptograph_signal::units::decimal::format_thousandfold;
use quick_xml::escape::escape;
use std::fmt::Write;

/// The text of a model file. It cannot store stiffness, taps and the R² of friction. The toolkit's renderer reads beyond
/// its arrays if a file has fewer than 16 triangles.
pub fn write_models(surface: &Surface) -> Result<String, HattWriteError> {
    let texture = surface.texture.as_ref().ok_or(HattWriteError::NoTexture)?;
    if texture.warping() != 0.0 {
        return Err(HattWriteError::Warped);
    }
    let mu = surface.friction.as_ref().ok_or(HattWriteError::NoFriction)?.mu();
    let name = checked_name(surface)?;
    let mut out = Xml::new("surface", &surface.provenance);
    let kept = |field: &str| surface.provenance.settings.get(&format!("hatt.{field}")).map(String::as_str);
    out.line(0, &format!("<modelSet texture=\"{}\">", escape(kept("texture").unwrap_or("1"))));
    out.field(1, "material", name);
    out.field(1, "AccelUnits", "m/s^2");
    out.field(1, "SpeedUnits", "mm/s");
    out.field(1, "ForceUnits", "N");
    out.field(1, "SampleRate", &texture.rate_hz().to_string());
    out.field(1, "mu", &mu.to_string());
    let picture = |field: &str| kept(field).map_or_else(|| default_picture(field, name), str::to_owned);
    for field in &KEPT[..3] {
        out.field(1, field, &picture(field));
    }
    out.field(1, "numMod", &texture.models().len().to_string());
    out.field(1, "numTri", &texture.triangles().len().to_string());
    out.field(1, "maxSpeed", &format_thousandfold(texture.max_speed_m_s()));
    out.field(1, "maxForce", &texture.max_force_n().to_string());
    let models = texture.models();
    out.list(1, "speedList", true, models.iter().map(|at| format_thousandfold(at.speed_m_s)));
    out.list(1, "forceList", true, models.iter().map(|at| at.force_n.to_string()));
    for triangle in texture.triangles() {
        out.list(1, "tri", true, triangle.iter().map(|vertex| (vertex + 1).to_string()));
    }
    for field in &KEPT[3..] {
        out.field(1, field, &picture(field));
    }
    out.field(1, "numARCoeff", &texture.ar_order().to_string());
    out.field(1, "numMACoeff", &texture.ma_order().to_string());
    for (number, at) in models.iter().enumerate() {
        write_model(&mut out, number + 1, at, has_gain(texture));
    }
    out.line(0, "</modelSet>");
    Ok(out.text)
}

/// The toolkit's models have a gain at 1 kHz, and none at 10 kHz, where it is 1.
fn has_gain(texture: &TextureModel) -> bool {
    let plain = |model: &ArmaModel| model.ma().is_empty() && model.gain() == 1.0;
    texture.rate_hz() != 10_000.0 || !texture.models().iter().all(|at| plain(&at.model))
}

fn write_model(out: &mut Xml, number: usize, at: &ModelAt, has_gain: bool) {
    let model = &at.model;
    let monic = |rest: &[f64]| [1.0].iter().chain(rest).map(f64::to_string).collect::<Vec<_>>();
    out.line(1, "<model>");
    out.field(2, "modNum", &number.to_string());
    out.list(2, "ARcoeff", false, monic(model.ar()).into_iter());
    out.list(2, "ARlsf", false, model.ar_lsf().iter().map(f64::to_string));
    out.list(2, "MAcoeff", false, monic(model.ma()).into_iter());
    out.list(2, "MAlsf", false, model.ma_lsf().iter().map(f64::to_string));
    out.field(2, "var", &model.variance().to_string());
    if has_gain {
        out.field(2, "gain", &model.gain().to_string());
    }
    out.field(2, "speedMod", &format_thousandfold(at.speed_m_s));
    out.field(2, "forceMod", &at.force_n.to_string());
    out.line(1, "</model>");
}

/// The text of a tap file, which has only taps and no name.
pub fn write_taps(surface: &Surface) -> Result<String, HattWriteError> {
    let taps = surface.taps.as_ref().ok_or(HattWriteError::NoTaps)?;
    if taps.rate_hz() != TAP_RATE_HZ || taps.length() != TAP_SAMPLES {
        return Err(HattWriteError::TapShape { samples: taps.length(), rate_hz: taps.rate_hz() });
    }
    let mut out = Xml::new("surface", &surface.provenance);
    out.line(0, "<tapSet>");
    out.field(1, "numTap", &taps.taps().len().to_string());
    out.list(1, "speedList", true, taps.taps().iter().map(|tap| format_thousandfold(tap.speed_m_s)));
    for tap in taps.taps() {
        out.line(1, "<tap>");
        out.field(2, "tapSpeed", &format_thousandfold(tap.speed_m_s));
        out.list(2, "tapAccel", false, tap.acceleration_m_s2.iter().map(f64::to_string));
        out.line(1, "</tap>");
    }
    out.line(0, "</tapSet>");
    Ok(out.text)
}

fn checked_name(surface: &Surface) -> Result<&str, HattWriteError> {
    let name = surface.name.as_str();
    // XML trims and joins some white space; names with it are refused, because they would change.
    let unfit = |c: char| c.is_control() || c == '\u{fffe}' || c == '\u{ffff}';
    if name.contains(unfit) { Err(HattWriteError::Name { name: name.to_owned() }) } else { Ok(name) }
}

/// The toolkit's path of a material's picture.
fn default_picture(field: &str, name: &str) -> String {
    match field {
        "htmlPicture" => format!("..\\..\\..\\TextureImages\\{name}_square.bmp"),
        "htmlLinuxPicture" => format!("../../../TextureImages/{name}_square.bmp"),
        "renderPicture" => format!("./images/{name}_square.bmp"),
        "DTpicture" => format!("..\\..\\DelaunayTriangulationImages\\DT_{name}.png"),
        _ => format!("../../DelaunayTriangulationImages/DT_{name}.png"),
    }
}

/// Indented lines of XML.
pub struct Xml {
    /// The lines so far.
    pub text: String,
}

impl Xml {
    /// A file of a `kind` with its provenance.
    pub fn new(kind: &str, provenance: &Provenance) -> Self {
        let label = label(kind, provenance);
        Xml { text: format!("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!-- {label} -->\n") }
    }

    /// Adds a line.
    pub fn line(&mut self, depth: usize, line: &str) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, "{:indent$}{line}", "", indent = 3 * depth);
    }

    /// Adds a field with one value.
    pub fn field(&mut self, depth: usize, name: &str, value: &str) {
        self.line(depth, &format!("<{name}>{}</{name}>", escape(value)));
    }

    /// Adds a field with a list of values.
    pub fn list(&mut self, depth: usize, name: &str, is_array: bool, values: impl Iterator<Item = String>) {
        let mut values = values.peekable();
        let attribute = if is_array { " type=\"array\"" } else { "" };
        if values.peek().is_none() {
            return self.line(depth, &format!("<{name}{attribute}/>"));
        }
        self.line(depth, &format!("<{name}{attribute}>"));
        values.for_each(|value| self.field(depth + 1, "value", &value));
        self.line(depth, &format!("</{name}>"));
    }
}
