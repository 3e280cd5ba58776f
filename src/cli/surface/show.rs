//! `haptograph surface show`: prints the content of a surface file.

use super::{Failure, load};
use crate::cli::result::{CommandResult, show};
use crate::cli::table::{facts, significant, table};
use crate::signal::units::decimal::format_thousandfold;
use crate::surfaces::layers::LAYERS;
use crate::surfaces::provenance::LICENCE;
use crate::surfaces::{Friction, Provenance, Surface, Taps, TextureModel, VertexKind};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Show the content of a surface file
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The surface file
    file: PathBuf,
    /// Print all of it as JSON, including the coefficients of every model
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let surface = load(&arguments.file)?;
    show(&Shown(surface), arguments.json)
}

/// Metres to millimetres per second, with the decimals that a file would have.
pub(super) fn mm_s(speed_m_s: f64) -> f64 {
    format_thousandfold(speed_m_s).parse().unwrap_or(speed_m_s * 1000.0)
}

fn kind(kind: VertexKind) -> &'static str {
    match kind {
        VertexKind::Measured => "measured",
        VertexKind::Fitted => "fitted",
        VertexKind::Edge => "edge",
    }
}

/// The content of a surface.
struct Shown(Surface);

impl Serialize for Shown {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let surface = &self.0;
        let Provenance { origin, source, settings, version } = &surface.provenance;
        json!({
            "name": surface.name,
            "friction": surface.friction.map(|friction| json!({
                "mu": friction.mu(), "r_squared": friction.r_squared(), "static_ratio": friction.peak().map(|peak| peak.ratio()),
                "stribeck_mm_s": friction.peak().map(|peak| 1000.0 * peak.stribeck_m_s()),
            })),

            "stiffness": surface.stiffness.map(|s| json!({ "n_per_mm": s.n_per_mm(), "r_squared": s.r_squared() })),
            "highest_hz": surface.provenance.highest_hz(), "taps": surface.taps.as_ref().map(taps_json),
            "texture": surface.texture.as_ref().map(texture_json),
            "provenance": { "origin": origin.as_str(), "source": source, "settings": settings, "version": version },
        })
        .serialize(serializer)
    }
}

fn taps_json(taps: &Taps) -> Value {
    let speeds: Vec<f64> = taps.taps().iter().map(|tap| mm_s(tap.speed_m_s)).collect();
    json!({ "rate_hz": taps.rate_hz(), "samples": taps.length(), "speeds_mm_s": speeds, "response_n_s_per_m": taps.response().map(|line| line.slope), "spectral_centroid_hz": taps.spectral_centroid_hz() })
}

fn texture_json(texture: &TextureModel) -> Value {
    let models = texture.models().iter().map(|at| {
        json!({
            "speed_mm_s": mm_s(at.speed_m_s), "force_n": at.force_n, "kind": kind(at.kind),
            "ar": at.model.ar(), "ar_lsf": at.model.ar_lsf(), "ma": at.model.ma(),
            "ma_lsf": at.model.ma_lsf(), "gain": at.model.gain(), "variance": at.model.variance(),
            "power_m2_s4": at.model.power(),
        })
    });
    let mut all = json!({
        "warping": texture.warping(), "highpass_hz": texture.highpass_hz(), "rate_hz": texture.rate_hz(),
        "ar_order": texture.ar_order(), "ma_order": texture.ma_order(),
        "max_speed_mm_s": mm_s(texture.max_speed_m_s()), "max_force_n": texture.max_force_n(),
        "models": models.collect::<Vec<_>>(), "triangles": texture.triangles(),
    });
    for kind in LAYERS {
        let own = texture.layers().find(|layer| layer.kind().name == kind.name);
        all[kind.name] = own.map_or_else(kind.absent, |layer| layer.json());
    }
    all
}

impl CommandResult for Shown {
    fn text(&self) -> String {
        let surface = &self.0;
        let Provenance { origin, source, settings, version } = &surface.provenance;
        let name = if surface.name.is_empty() { "(no name)" } else { &surface.name };
        let fit = |r_squared: Option<f64>| {
            r_squared.map_or_else(String::new, |r| format!(" (R² {})", significant(r, 3)))
        };
        let none = || "none".to_owned();
        let friction = surface.friction;
        let peak = |friction: Friction| {
            friction.peak().map_or_else(String::new, |peak| {
                format!(", {} times that at rest", significant(peak.ratio(), 3))
            })
        };
        let friction =
            friction.map(|f| format!("mu {}{}{}", significant(f.mu(), 4), fit(f.r_squared()), peak(f)));
        let stiffness = surface.stiffness;
        let stiffness =
            stiffness.map(|s| format!("{} N/mm{}", significant(s.n_per_mm(), 4), fit(s.r_squared())));
        let texture = surface.texture.as_ref();
        let parts = [
            ("origin", origin.as_str().to_owned()),
            ("source", source.clone()),
            ("made by", version.clone()),
            ("friction", friction.unwrap_or_else(none)),
            ("stiffness", stiffness.unwrap_or_else(none)),
            ("taps", surface.taps.as_ref().map_or_else(none, describe_taps)),
            ("texture", texture.map_or_else(none, describe_texture)),
        ];
        let clips = clips_of(surface).map(|clips| ("clips", clips));
        let band = surface.provenance.highest_hz();
        let band =
            band.map(|hz| ("recorded", format!("up to {hz} Hz, at the lowest rate of its drags and taps")));
        let parts: Vec<_> = parts.into_iter().chain(clips).chain(band).collect();
        let mut text = format!("{name}\n\n{}", facts(&parts));
        if let Some(texture) = texture {
            text += &format!("\n{}", models(texture));
        }
        if !settings.is_empty() {
            let settings: Vec<(&str, String)> =
                settings.iter().map(|(name, value)| (name.as_str(), value.clone())).collect();
            text += &format!("\nMade with\n\n{}", facts(&settings));
        }
        text
    }
}

/// The clips of a surface, and whether others may have them.
pub(in crate::cli) fn clips_of(surface: &Surface) -> Option<String> {
    let texture = surface.texture.as_ref()?;
    let clips_s = significant(texture.clips()?.samples() as f64 / texture.rate_hz(), 3);
    let origin = surface.provenance.origin.as_str();
    let licence = match surface.provenance.settings.get(LICENCE) {
        Some(licence) => format!("licence: {licence}"),
        None if surface.has_unlicensed_clips() => {
            "no licence stated (--licence), so that no site can contain them".to_owned()
        }
        None => "no licence needed".to_owned(),
    };
    Some(format!("{clips_s} s of the recording ({origin}); {licence}"))
}

fn describe_taps(taps: &Taps) -> String {
    let (first, last) = (&taps.taps()[0], &taps.taps()[taps.taps().len() - 1]);
    let response = taps
        .response()
        .map_or_else(String::new, |line| format!(", {} N per m/s", significant(line.slope, 3)));
    let centroid = taps.spectral_centroid_hz().map_or_else(String::new, |hz| {
        format!(", spectral centroid {} Hz (mean at 50 to 100 mm/s)", significant(hz, 3))
    });
    let (count, rate_hz) = (taps.taps().len(), taps.rate_hz());
    let length_ms = significant(1000.0 * taps.length() as f64 / rate_hz, 4);
    let [first, last] = [first, last].map(|tap| significant(mm_s(tap.speed_m_s), 4));
    format!("{count} of {length_ms} ms at {rate_hz} Hz, {first} to {last} mm/s{response}{centroid}")
}

fn describe_texture(texture: &TextureModel) -> String {
    let order = match texture.ma_order() {
        0 => format!("AR({})", texture.ar_order()),
        ma => format!("ARMA({}, {ma})", texture.ar_order()),
    };
    let order = match texture.warping() {
        0.0 => order,
        warping => format!("warped {order} (factor {})", significant(warping, 3)),
    };
    let (models, triangles) = (texture.models().len(), texture.triangles().len());
    let rate_hz = texture.rate_hz();
    let layers: String = texture.layers().map(|layer| format!("; {}", layer.summary(rate_hz))).collect();
    let [speed, force] =
        [mm_s(texture.max_speed_m_s()), texture.max_force_n()].map(|most| significant(most, 4));
    format!(
        "{models} models {order} at {rate_hz} Hz in {triangles} triangles, to {speed} mm/s and {force} N{layers}"
    )
}

/// Table of the models inside the map.
fn models(texture: &TextureModel) -> String {
    let rows: Vec<Vec<String>> = texture
        .models()
        .iter()
        .enumerate()
        .filter(|(_, at)| at.kind != VertexKind::Edge)
        .map(|(number, at)| {
            vec![
                number.to_string(),
                significant(mm_s(at.speed_m_s), 4),
                significant(at.force_n, 3),
                significant(at.model.variance(), 3),
                significant(at.model.power(), 3),
            ]
        })
        .collect();
    let header = ["model", "speed (mm/s)", "force (N)", "variance ((m/s²)²)", "power ((m/s²)²)"];
    table(&header, &rows)
}
