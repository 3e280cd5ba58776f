//! Headers of CSV files, and the units at the end of column names.

pub use haptograph_signal::units::{of_header, of_header_as, suffix};

/// The error of a header that is empty, or whose cells are not separated by commas.
pub fn no_header(header: &csv::StringRecord) -> Option<&'static str> {
    let mut cells = header.iter();
    match (cells.next().unwrap_or_default(), cells.next()) {
        ("", None) => Some("the file is empty: it needs a header, and rows below it"),
        (one, None) if one.contains(';') => {
            Some("the header has semicolons: separate the columns by commas, and write decimals with a point")
        }
        _ => None,
    }
}
