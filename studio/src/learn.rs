//! Learning of a surface from a recording that is dropped on the page.

use haptograph_learning::learn::{LearnSettings, LearningReport, learn};
use haptograph_learning::recording::{
    AnyRecording, Finding, ImportSettings, QUANTITIES, csv_head, load_with, units_of,
};
use haptograph_signal::files::{self, MAX_RECORDING_BYTES};
use haptograph_surfaces::Surface;
use haptograph_surfaces::files::native;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// Maximum length of a surface's name.
const MAX_LETTERS: usize = 60;

/// A recording that was dropped on the page.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct Dropped {
    /// Name of its file.
    pub name: String,
    pub csv: String,
    #[serde(default)]
    pub mapping: Mapping,
    /// Only says what reading it finds; nothing is learned.
    #[serde(default)]
    pub reads: bool,
}

/// A recording, and the surfaces to hear along its motion, by their paths as parameters.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct Compared {
    #[serde(flatten)]
    pub dropped: Dropped,
    pub surfaces: Vec<String>,
}

/// What the columns of a recording hold, as far as their names do not say it.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mapping {
    /// Names of columns, and units, by quantity.
    columns: BTreeMap<String, String>,
    units: BTreeMap<String, String>,
    /// Rate of evenly spaced rows without times, Hz.
    rate_hz: Option<f64>,
}

impl Mapping {
    pub(crate) fn settings(&self) -> Result<ImportSettings, String> {
        let mut settings = ImportSettings { rate_hz: self.rate_hz, ..ImportSettings::default() };
        for (quantity, column) in &self.columns {
            settings = settings.with_column(quantity, column)?;
        }
        for (quantity, unit) in &self.units {
            settings = settings.with_unit(quantity, unit)?;
        }
        Ok(settings)
    }

    /// The same as flags of `haptograph learn`.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn flags(&self) -> impl Iterator<Item = String> {
        let columns = self.columns.iter().map(|(quantity, column)| format!("--column={quantity}={column}"));
        let units = self.units.iter().map(|(quantity, unit)| format!("--unit={quantity}={unit}"));
        let rate = self.rate_hz.map(|rate_hz| format!("--sample-rate={rate_hz}"));
        columns.chain(units).chain(rate)
    }
}

/// A learned surface.
#[derive(Debug)]
pub(crate) struct Learned {
    surface: Surface,
    report: LearningReport,
}

impl Learned {
    /// The text of its file.
    pub(crate) fn text(&self) -> String {
        native::write(&self.surface)
    }

    /// The report of the learning, as HTML.
    pub(crate) fn page(&self) -> String {
        haptograph_report::learning::page(&self.surface, &self.report)
    }
}

/// What reading the table in a file finds: its columns with what they probably hold, all quantities with their units, findings, and
/// why it cannot be read.
pub(crate) fn reading(table: &Path, mapping: &Mapping) -> Value {
    let head = files::read(table, MAX_RECORDING_BYTES).ok().and_then(|bytes| csv_head(&bytes));
    let columns = head.map(|head| head.columns).unwrap_or_default().into_iter();
    let columns = columns.map(|column| json!({ "name": column.name, "quantity": column.quantity }));
    let quantities = QUANTITIES.iter().map(|name| json!({ "name": name, "units": units_of(name) }));
    let read = loaded(table, mapping);
    let (findings, error) = match read {
        Ok((_, findings)) => (findings, None),
        Err(error) => (Vec::new(), Some(error)),
    };
    let finding = |finding: &Finding| json!({ "says": finding.to_string(), "consequence": finding.consequence(), "is_repair": finding.is_repair() });
    json!({
        "columns": columns.collect::<Vec<_>>(), "quantities": quantities.collect::<Vec<_>>(),
        "findings": findings.iter().map(|(_, each)| finding(each)).collect::<Vec<_>>(), "error": error,
    })
}

/// Learns the table in a file; the surface is named `stem`.
///
/// # Errors
/// A description of the error in the table, without the file's folder, or a note that the table contains no drag.
pub(crate) fn learn_table(stem: &str, table: &Path, mapping: &Mapping) -> Result<Learned, String> {
    let (recording, _) = loaded(table, mapping)?;
    let learned = learn(stem, &[recording], &LearnSettings::default(), &|_| ());
    let (surface, report) = learned.map_err(|error| without_folder(table, &error))?;
    match surface.texture {
        Some(_) => Ok(Learned { surface, report }),
        None => Err(NO_DRAG.to_owned()),
    }
}

fn loaded(table: &Path, mapping: &Mapping) -> Result<(AnyRecording, Vec<(PathBuf, Finding)>), String> {
    load_with(&[table.to_owned()], &mapping.settings()?).map_err(|error| without_folder(table, &error))
}

fn without_folder(table: &Path, error: &dyn Display) -> String {
    match &*table.parent().unwrap_or(Path::new("")).to_string_lossy() {
        "" => error.to_string(),
        folder => error.to_string().replace(&format!("{folder}/"), ""),
    }
}

/// Message if the recording teaches no texture.
pub(crate) const NO_DRAG: &str = "cannot learn a texture: the recording holds no drag with force and speed";
/// Message if no file name is free.
pub(crate) const FULL: &str = "a thousand surfaces with this name exist; remove or rename some";

/// The files that a surface may get, in the order in which they are tried.
pub(crate) fn paths(folder: &Path, stem: &str) -> impl Iterator<Item = PathBuf> {
    (0..1000).map(move |number| match number {
        0 => folder.join(format!("{stem}.ron")),
        number => folder.join(format!("{stem}-{number}.ron")),
    })
}

/// Letters, digits and hyphens of a file's name without its extension.
pub(crate) fn stem(name: &str) -> String {
    let name = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let name = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let kept = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' });
    let kept: String = kept.take(MAX_LETTERS).collect();
    let kept = kept.trim_matches('-');
    if kept.is_empty() { "recording".to_owned() } else { kept.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_names_of_files_and_nothing_more() {
        for (name, kept) in [
            ("take 3.csv", "take-3"),
            ("../../etc/passwd", "passwd"),
            ("C:\\x\\..\\..", "recording"),
            ("", "recording"),
            ("...", "recording"),
        ] {
            assert_eq!(stem(name), kept, "{name}");
        }
    }
}
