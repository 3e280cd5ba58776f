//! The provenance of a surface. Every surface carries it, so that simulated data is never taken for measured data.

use std::collections::BTreeMap;

/// The setting of a recording whose vibration is not in m/s².
pub const VIBRATION_UNIT: &str = "vibration unit";

/// The setting of a surface whose recordings did not hold all that a hand feels: the highest frequency in it, Hz.
pub const HIGHEST_HZ: &str = "highest frequency, Hz";

/// Settings of a recording that state what touched the surface: the diameter of the tool's tip, mm; the grip of the hand;
/// `tool` or `finger`; and the licence under which others may have the recording.
pub const TOUCH: [&str; 4] = ["tip_diameter_mm", "grip", "touched_with", LICENCE];

/// The setting by which the holder of a recording's rights allows others to have it, such as `CC-BY-4.0`.
pub const LICENCE: &str = "licence";

/// The setting of a surface whose clips are of a recording of another origin than its own: that origin.
pub const CLIPS_ORIGIN: &str = "clips origin";

/// Checks a setting of [`TOUCH`].
///
/// # Errors
/// A diameter that is not a number above 0 and up to 100 mm, an empty grip, or another word than `tool` or `finger`.
pub fn check_touch(name: &str, value: &str) -> Result<(), String> {
    let (is_sound, expected) = match name {
        "tip_diameter_mm" => {
            (value.parse::<f64>().is_ok_and(|mm| mm > 0.0 && mm <= 100.0), "a number above 0, up to 100 mm")
        }
        "touched_with" => (["tool", "finger"].contains(&value), "tool or finger"),
        _ => (!value.trim().is_empty(), "some words"),
    };
    match is_sound {
        true => Ok(()),
        false => Err(format!("{name} is {value:?}; expected {expected}")),
    }
}

/// The origin of the data of a surface or a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Origin {
    /// Learned from a recording that haptograph simulated.
    Simulated,
    /// Learned from a recording of a real tool on a real material.
    Measured,
    /// Read from another program's file, such as the Penn Haptic Texture Toolkit's.
    Imported,
    /// Written by a script: a synthetic surface that imitates no material.
    Procedural,
}

impl Origin {
    /// All origins.
    pub(crate) const ALL: [Origin; 4] =
        [Origin::Simulated, Origin::Measured, Origin::Imported, Origin::Procedural];

    /// The name in files and messages, such as `simulated`.
    pub fn as_str(self) -> &'static str {
        match self {
            Origin::Simulated => "simulated",
            Origin::Measured => "measured",
            Origin::Imported => "imported",
            Origin::Procedural => "procedural",
        }
    }
}

impl std::str::FromStr for Origin {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|origin| origin.as_str() == text);
        found.ok_or_else(|| {
            format!("unknown origin {text:?}; expected one of: simulated, measured, imported, procedural")
        })
    }
}

/// The origin of a surface, with the data needed to make it again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    /// The kind of data it was made from.
    pub origin: Origin,
    /// The recording, file or script it was made from, as readable text.
    pub source: String,
    /// The settings it was made with, by name.
    pub settings: BTreeMap<String, String>,
    /// The program and version that made it.
    pub version: String,
}

impl Provenance {
    /// Provenance without settings, made by this version of haptograph.
    pub fn new(origin: Origin, source: impl Into<String>) -> Self {
        Provenance {
            origin,
            source: source.into(),
            settings: BTreeMap::new(),
            version: concat!("haptograph ", env!("CARGO_PKG_VERSION")).to_owned(),
        }
    }

    /// The highest frequency in the surface, Hz, if its recordings did not hold all that a hand feels.
    pub fn highest_hz(&self) -> Option<f64> {
        self.settings.get(HIGHEST_HZ)?.parse().ok()
    }

    /// The same provenance with one more setting.
    pub fn with_setting(mut self, name: impl Into<String>, value: impl ToString) -> Self {
        self.settings.insert(name.into(), value.to_string());
        self
    }
}
