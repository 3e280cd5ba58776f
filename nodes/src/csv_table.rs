//! CSV files of numbers, as nodes open them: their errors name the file and the setting.

use haptograph_engine::node::BuildError;
use haptograph_signal::csv::CsvTable;
use haptograph_signal::files::{self, Bounded, MAX_TABLE_BYTES};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Opens a file and reads its header, which is the line with most of the `wanted` names.
///
/// # Errors
/// An error at the setting `file`, if it cannot be read or has no header.
pub(crate) fn open(path: &Path, wanted: &[&str]) -> Result<CsvTable<BufReader<Bounded>>, BuildError> {
    let source = files::open(path, MAX_TABLE_BYTES).map_err(|error| {
        BuildError::at("file", format!("cannot read {}: {error}", path.display()))
            .help("give the path of a CSV file, relative to the graph file")
    })?;
    CsvTable::new(BufReader::new(source), wanted).map_err(|error| at_file(path, error))
}

/// Index of the column with this header, which a setting names.
pub(crate) fn column<R: BufRead>(
    table: &CsvTable<R>,
    path: &Path,
    (setting, header): (&'static str, &str),
) -> Result<usize, BuildError> {
    table.find(header).ok_or_else(|| {
        let message = format!("{} has no column `{header}`", path.display());
        let known = table.head().names.join(", ");
        BuildError::at(setting, message).help(format!("its columns are {known}"))
    })
}

/// An error about a file, at the setting `file`.
pub(crate) fn at_file(path: &Path, problem: impl std::fmt::Display) -> BuildError {
    BuildError::at("file", format!("{}: {problem}", path.display()))
}

/// Factor from the unit at the end of a header to SI. The unit has to be one of the quantity that the setting
/// `quantity` names.
pub(crate) fn si_of_column(header: &str, quantity: &str) -> Result<f64, BuildError> {
    let (unit, scale) = units::of_header(header);
    let Some(wanted) = Quantity::by_name(quantity) else {
        return Err(BuildError::at("quantity", format!("unknown quantity {quantity}")));
    };
    if unit == wanted {
        return Ok(scale);
    }
    if let Some(scale) = units::of_header_as(header, wanted) {
        return Ok(scale);
    }
    let message = format!("the name of column {header} has unit {unit}; {wanted} was expected");
    let help = format!("set `quantity` to what the column is, or rename it: ..{}", units::suffix(wanted));
    Err(BuildError::at("quantity", message).help(help))
}
