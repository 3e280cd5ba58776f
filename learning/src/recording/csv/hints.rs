//! Suggested flags for missing columns.

use super::table::Table;
use super::units::{dimension, example_unit, is_of, unit_in_file};
use haptograph_signal::quantity::Quantity;

/// Largest number of suggestions.
const MOST: usize = 6;

/// Usual beginnings of the names of columns, by quantity.
const BEGINNINGS: [(&str, &[&str]); 6] = [
    ("time", &["t", "zeit", "stamp", "uhr", "clock"]),
    ("accel", &["a", "besch", "vib", "imu"]),
    ("force_tangential", &["tang", "frict", "shear", "reib"]),
    ("force", &["f", "kraft", "normal", "load", "druck", "press"]),
    ("speed", &["v", "geschw", "speed"]),
    ("position", &["x", "y", "z", "pos", "weg"]),
];

/// A flag for each missing quantity, with its most likely column.
pub(super) fn hints(tables: &[&Table], missing: &[String]) -> Vec<String> {
    let mut unread: Vec<(&str, &str)> = tables.iter().flat_map(|table| table.unread()).collect();
    let mut said = vec![];
    for quantity in missing.iter().take(MOST) {
        let column = likely(quantity, &unread).map(|index| unread.remove(index));
        said.push(hint(quantity, column));
    }
    said
}

fn hint(quantity: &str, column: Option<(&str, &str)>) -> String {
    let (name, below) = column.unwrap_or(("…", ""));
    let unit = match column.is_some() && unit_in_file(name, below, quantity, true).is_ok() {
        true => String::new(),
        false => format!(" --unit {quantity}={}", example_unit(quantity)),
    };
    let flag = format!("--column {quantity}=\"{name}\"{unit}");
    match quantity {
        "time" => format!("{flag} (or --sample-rate HZ, where rows follow evenly)"),
        "speed" => format!(
            "{flag} (or a position to differentiate: --column position_x=…, or --constant speed_mm_s=50)"
        ),
        _ => flag,
    }
}

/// The column whose unit is one of the quantity, or whose name has a usual beginning; preferably both.
pub(super) fn likely(quantity: &str, unread: &[(&str, &str)]) -> Option<usize> {
    let first = quantity.split('_').next().unwrap_or(quantity);
    let all =
        || BEGINNINGS.iter().flat_map(|(known, all)| all.iter().map(move |beginning| (*known, *beginning)));
    // Of "v" and "vib" the longer one is meant.
    let begins = |name: &str| {
        let lower = name.to_lowercase();
        let meant = all().filter(|(_, start)| lower.starts_with(start)).max_by_key(|(_, start)| start.len());
        meant.is_some_and(|(known, _)| known == quantity || known == first)
    };
    let of = dimension(quantity).filter(|of| *of != Quantity::NUMBER);
    let score = |(name, below): &(&str, &str)| {
        2 * u8::from(of.is_some_and(|of| is_of(name, below, of))) + u8::from(begins(name))
    };
    let best = unread.iter().map(score).max().filter(|score| *score > 0)?;
    unread.iter().position(|column| score(column) == best)
}
