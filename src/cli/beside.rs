//! `--beside thesis`: numbers that the thesis prints, beside one's own.

use super::Failure;
use super::result::{CommandResult, show};
use super::table::significant;
use crate::report::table::Table;
use clap::ValueEnum;
use haptograph_study::analyse::BesideRow;
use haptograph_study::thesis::{is_same_name, published};
use serde::Serialize;
use serde_json::Value;

/// The flag.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub(super) struct Beside {
    /// Lay the numbers of this work beside one's own, where both mean the same
    #[arg(long)]
    pub beside: Option<Work>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum Work {
    /// Those that the thesis prints
    Thesis,
}

impl Beside {
    /// The rows that `of` gives, if the flag is given.
    pub(super) fn rows(
        self,
        of: impl FnOnce() -> Result<Vec<BesideRow>, Failure>,
    ) -> Result<Vec<BesideRow>, Failure> {
        self.beside.map_or(Ok(Vec::new()), |_| of())
    }
}

/// Rows to be filled.
#[derive(Debug, Default)]
pub(super) struct Rows(pub Vec<BesideRow>);

impl Rows {
    /// Adds a number, if both have it.
    pub(super) fn add(&mut self, source: &'static str, what: &str, own: impl Into<Value>, thesis: &Value) {
        let (phase, what, own, thesis) = (String::new(), what.to_owned(), own.into(), thesis.clone());
        if !own.is_null() && !thesis.is_null() {
            self.0.push(BesideRow { phase, what, own, thesis, source });
        }
    }

    /// Adds a constant of the thesis by its name in the data, with its unit and its section.
    pub(super) fn constant(&mut self, name: &str, own: impl Into<Value>) {
        let constants = published()["constants"].as_array().into_iter().flatten();
        let Some(constant) = constants.into_iter().find(|of| of["name"] == *name) else { return };
        let [unit, section] = ["unit", "section"].map(|key| constant[key].as_str().unwrap_or_default());
        let what = if unit == "1" { name.to_owned() } else { format!("{name}, {unit}") };
        self.add(section, &what, own, &constant["value"]);
    }
}

/// The fifteen surfaces of section 4.4, as the thesis names them.
pub(super) fn chosen_surfaces() -> impl Iterator<Item = &'static str> {
    published()["studies"]["4.4"]["surfaces"].as_array().into_iter().flatten().filter_map(Value::as_str)
}

/// True if `own` names a material of chapters 2 and 3, printed as `T2 Canvas`, by its number, its name or both.
pub(super) fn is_material(own: &str, printed: &str) -> bool {
    let (number, name) = printed.split_once(' ').unwrap_or_default();
    [printed, number, name].iter().any(|of| is_same_name(of, own))
}

/// A table of such rows, with the digits that are printed.
pub(super) fn table(rows: &[BesideRow]) -> Table {
    let has_phases = rows.iter().any(|row| !row.phase.is_empty());
    let header = ["number", "own", "thesis", "printed in", "own phase"];
    let cells = |row: &BesideRow| {
        let own = match (&row.own, row.own.as_f64()) {
            (Value::String(text), _) => text.clone(),
            (_, own) => own.map_or_else(String::new, |own| significant(own, 3)),
        };
        let thesis = match (&row.thesis, row.thesis.as_f64()) {
            (Value::String(text), _) => text.clone(),
            (_, Some(small)) if small.abs() < 1e-3 => format!("{small:e}"),
            (value, _) => value.to_string(),
        };
        let phase = has_phases.then(|| row.phase.clone());
        [row.what.clone(), own, thesis, row.source.to_owned()].into_iter().chain(phase).collect()
    };
    Table::new(&header[..4 + usize::from(has_phases)], rows.iter().map(cells).collect())
}

/// A result with such rows.
#[derive(Serialize)]
struct WithRows<'a, R> {
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    beside: &'a [BesideRow],
    #[serde(flatten)]
    result: &'a R,
}

impl<R: CommandResult> CommandResult for WithRows<'_, R> {
    fn text(&self) -> String {
        let rows =
            if self.beside.is_empty() { String::new() } else { format!("\n{}", table(self.beside).text()) };
        self.result.text() + &rows
    }
}

/// Prints a result, then the rows.
pub(super) fn show_with<R: CommandResult>(
    result: &R,
    beside: &[BesideRow],
    json: bool,
) -> Result<(), Failure> {
    show(&WithRows { beside, result }, json)
}
