//! Where a surface comes from, carried with it wherever it goes, so that nothing simulated can pass for measured.

use std::collections::BTreeMap;

/// The setting that says of a recording that its vibration is in another unit than m/s².
pub(crate) const VIBRATION_UNIT: &str = "vibration unit";

/// Where the data behind a surface or a recording came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Origin {
    /// Learned from a recording that haptograph simulated.
    Simulated,
    /// Learned from a recording of a real tool on a real material.
    Measured,
    /// Read from another program's file, such as the Penn Haptic Texture Toolkit's.
    Imported,
    /// Written down by a script: a made-up surface that imitates no material.
    Procedural,
}

impl Origin {
    /// All origins.
    pub const ALL: [Origin; 4] = [
        Origin::Simulated,
        Origin::Measured,
        Origin::Imported,
        Origin::Procedural,
    ];

    /// The origin of that word.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|origin| origin.word() == word)
    }

    /// The word for people and files, such as `simulated`.
    pub fn word(self) -> &'static str {
        match self {
            Origin::Simulated => "simulated",
            Origin::Measured => "measured",
            Origin::Imported => "imported",
            Origin::Procedural => "procedural",
        }
    }
}

/// Where a surface comes from and how it was made: enough to make it again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    /// What kind of data stands behind it.
    pub origin: Origin,
    /// The recording, file or script it was made from, in words a person can follow.
    pub source: String,
    /// The settings it was made with, by name.
    pub settings: BTreeMap<String, String>,
    /// The program and version that made it.
    pub version: String,
}

impl Provenance {
    /// Provenance with no settings yet, made by this version of haptograph.
    pub fn new(origin: Origin, source: impl Into<String>) -> Self {
        Provenance {
            origin,
            source: source.into(),
            settings: BTreeMap::new(),
            version: concat!("haptograph ", env!("CARGO_PKG_VERSION")).to_owned(),
        }
    }

    /// The same provenance with one more setting.
    pub fn with_setting(mut self, name: impl Into<String>, value: impl ToString) -> Self {
        self.settings.insert(name.into(), value.to_string());
        self
    }
}
