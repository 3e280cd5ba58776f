//! Quantities and units in the names of columns.

use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{self, Scale};

/// The quantities of a recording's columns, as in `--column` and `--unit`.
pub const QUANTITIES: [&str; 21] = [
    "time",
    "accel",
    "force_normal",
    "force_tangential",
    "speed",
    "accel_x",
    "accel_y",
    "accel_z",
    "force_x",
    "force_y",
    "force_z",
    "torque_x",
    "torque_y",
    "torque_z",
    "position_x",
    "position_y",
    "position_z",
    "orientation_w",
    "orientation_x",
    "orientation_y",
    "orientation_z",
];

static DIMENSIONS: [(&str, Quantity); 8] = [
    ("time", Quantity::TIME),
    ("accel", Quantity::ACCELERATION),
    ("force", Quantity::FORCE),
    ("torque", Quantity::TORQUE),
    ("position", Quantity::LENGTH),
    ("speed", Quantity::SPEED),
    ("orientation", Quantity::NUMBER),
    // For sweeps of actuators.
    ("current", Quantity::CURRENT),
];
/// The parts of a name between quantity and unit.
const PARTS: [&str; 6] = ["x", "y", "z", "w", "normal", "tangential"];

/// Splits a name with a unit in brackets, such as `speed (mm/s)`, `v/(mm/s)` or `accel [g]`.
fn bracketed(name: &str) -> Option<(&str, &str)> {
    let (before, unit) = match name.strip_suffix(']') {
        Some(rest) => rest.rsplit_once('[')?,
        None => name.strip_suffix(')')?.rsplit_once('(')?,
    };
    let before = before.trim_end_matches(|c: char| c.is_whitespace() || c == '/');
    (!before.is_empty()).then_some((before, unit.trim()))
}

/// Splits a lower-case name with a unit after a slash, such as `t/ms` or `a/m/s²`; not where the slash may be one of the unit, as in
/// `speed m/s`, `samples/s` or `accel_mv/g`.
fn slashed(name: &str) -> Option<(&str, &str)> {
    let (before, unit) = name.split_once('/').map(|(before, unit)| (before.trim_end(), unit.trim()))?;
    let (suffix, end) = (units::suffix_of(unit), units::at_end_of(&units::suffix_of(name))?);
    let is_whole = end.0 == suffix.len() && units::at_end_of(before).is_none() && !before.contains(' ');
    (is_whole && name != "n/a" && (unit != "s" || before.starts_with('t'))).then_some((before, unit))
}

/// Splits a column's name into quantity, name without unit, and the rest; `None` for unknown columns.
fn parts(name: &str) -> Option<(Quantity, String, &str)> {
    if let Some((before, unit)) = bracketed(name) {
        let (quantity, plain, rest) = parts(before)?;
        return rest.is_empty().then_some((quantity, plain, unit));
    }
    if let Some((before, unit)) = slashed(name)
        && let Some((quantity, plain, "")) = parts(before)
    {
        return Some((quantity, plain, unit));
    }
    let (quantity_name, quantity) = DIMENSIONS.iter().find(|(quantity, _)| {
        name.strip_prefix(quantity).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
    })?;
    let rest = name[quantity_name.len()..].trim_start_matches('_');
    let part = PARTS
        .iter()
        .find(|part| rest.strip_prefix(**part).is_some_and(|unit| unit.is_empty() || unit.starts_with('_')));
    let unit = part.map_or(rest, |part| rest[part.len()..].trim_start_matches('_'));
    let plain = part.map_or_else(|| (*quantity_name).to_owned(), |part| format!("{quantity_name}_{part}"));
    Some((*quantity, plain, unit))
}

/// The unit of the numbers in a known column.
pub(in crate::recording) fn si_unit(name: &str) -> Option<&'static str> {
    parse_name(name)?.ok()?;
    let (quantity, ..) = parts(name)?;
    Quantity::NAMED.iter().find(|(known, ..)| *known == quantity).map(|(.., unit)| *unit)
}

/// The name without its unit, and the unit; `None` for unknown columns.
pub(in crate::recording) fn parse_name(name: &str) -> Option<Result<(String, Scale), String>> {
    let (quantity, plain, unit) = parts(name)?;
    Some(match scale_of(unit, quantity) {
        Some(scale) => Ok((plain, scale)),
        None => Err(no_unit(name, &plain, quantity)),
    })
}

fn no_unit(name: &str, plain: &str, quantity: Quantity) -> String {
    let known: Vec<_> = units::of_quantity(quantity).map(|unit| format!("{plain}_{unit}")).collect();
    format!(
        "the unit of column {name:?} is unknown; rename it to {}, or give the unit with --unit {plain}={}",
        known.join(" or "),
        example_unit(plain)
    )
}

/// The unit of a quantity from its column: in brackets, at the end of the name, or in a row below the header.
///
/// # Errors
/// The message.
pub(in crate::recording) fn unit_in_file(
    header: &str,
    below: &str,
    plain: &str,
    is_mapped: bool,
) -> Result<Scale, String> {
    let Some((quantity, ..)) = parts(plain) else {
        return Err(format!("unknown quantity {plain}; a recording has no such quantity"));
    };
    let lower = header.to_lowercase();
    let own = match (bracketed(&lower).or_else(|| slashed(&lower)), parts(&lower)) {
        (Some((_, unit)), _) => scale_of(unit, quantity),
        (None, Some((_, _, unit))) if !is_mapped => scale_of(unit, quantity),
        _ => unit_at_end(&lower, plain),
    };
    let below = below.trim_matches(|c: char| c.is_whitespace() || "[]()".contains(c));
    if let Some(scale) = own.or_else(|| scale_of(below, quantity)) {
        return Ok(scale);
    }
    if !below.is_empty() {
        return Err(format!("{below:?} below the header is not a unit of {plain}; {}", say_unit(plain)));
    }
    match is_mapped {
        true => Err(format!("the unit of {plain} in column {header:?} is unknown; {}", say_unit(plain))),
        false => Err(no_unit(header, plain, quantity)),
    }
}

fn say_unit(plain: &str) -> String {
    format!("give it with --unit {plain}={}", example_unit(plain))
}

/// A unit that a logger may have written.
pub(in crate::recording) fn example_unit(plain: &str) -> &'static str {
    match plain.split('_').next() {
        Some("time") => "ms",
        Some("accel") => "g",
        Some("force") => "N",
        Some("speed") => "mm/s",
        Some("position") => "mm",
        Some("torque") => "N_mm",
        Some("current") => "mA",
        _ => "1",
    }
}

/// The physical quantity of one of our quantities.
pub(in crate::recording) fn dimension(plain: &str) -> Option<Quantity> {
    parts(plain).map(|(quantity, ..)| quantity)
}

/// True if a text, in brackets or not, is a unit of anything.
pub(in crate::recording) fn is_unit(text: &str) -> bool {
    unit_of_anything(text).is_some()
}

/// Parses a unit: SI per unit, and the unit in SI.
pub(in crate::recording) fn unit_of_anything(text: &str) -> Option<(Scale, &'static str)> {
    let unit = text.trim_matches(|c: char| c.is_whitespace() || "[]()".contains(c));
    // Of two quantities with one unit, g, vibrations have the first.
    let first = Quantity::NAMED.iter().filter(|(q, ..)| *q == Quantity::ACCELERATION);
    let mut all = first.chain(Quantity::NAMED).filter(|(q, ..)| *q != Quantity::NUMBER);
    all.find_map(|(quantity, _, si)| Some((scale_of(unit, *quantity)?, *si)))
}

/// The same for a column's name (its brackets or its end) or for the cell below it.
pub(in crate::recording) fn unit_of_column(header: &str, below: &str) -> Option<(Scale, &'static str)> {
    let lower = header.to_lowercase();
    if let Some(Ok((_, scale))) = parse_name(&lower) {
        return si_unit(&lower).map(|unit| (scale, unit));
    }
    unit_of_anything(bracketed(&lower).or_else(|| slashed(&lower)).map_or(below, |(_, unit)| unit))
}

/// True if a column is of this quantity, by its unit alone.
pub(in crate::recording) fn is_of(header: &str, below: &str, quantity: Quantity) -> bool {
    let lower = header.to_lowercase();
    match bracketed(&lower).or_else(|| slashed(&lower)) {
        Some((_, unit)) => scale_of(unit, quantity).is_some(),
        None if units::of_header(&lower).0 == Quantity::NUMBER => {
            scale_of(below.trim_matches(|c: char| "[]()".contains(c)), quantity).is_some()
        }
        None => units::of_header(&lower).0 == quantity,
    }
}

/// Parses a unit that the user gave for a quantity such as `accel` or `force_normal`; `1` is an unknown unit.
pub(in crate::recording) fn parse_unit(plain: &str, unit: &str) -> Result<Scale, String> {
    let Some((quantity, _, "")) = parts(plain) else {
        return Err(format!("unknown quantity {plain}; a recording has no such quantity"));
    };
    if unit.trim() == "1" {
        return Ok(Scale::One);
    }
    scale_of(unit, quantity).ok_or_else(|| {
        let known: Vec<_> = units::of_quantity(quantity).collect();
        format!(
            "{unit:?} is not a unit of {plain}; expected one of: {}, or 1 for an unknown unit",
            known.join(", ")
        )
    })
}

/// The unit at the end of any column's name, where it is one of the quantity's.
fn unit_at_end(name: &str, plain: &str) -> Option<Scale> {
    let (quantity, ..) = parts(plain)?;
    match quantity {
        Quantity::NUMBER => Some(Scale::One),
        _ => units::of_header_as(name, quantity).map(Scale::of),
    }
}

/// The known quantity without unit, such as `force_normal`, with which a name begins.
pub(in crate::recording) fn plain_name(name: &str) -> Option<(String, &str)> {
    parts(name).map(|(_, plain, unit)| (plain, unit))
}

fn scale_of(unit: &str, quantity: Quantity) -> Option<Scale> {
    match (quantity, unit) {
        (Quantity::NUMBER, "") => Some(Scale::One),
        (Quantity::NUMBER, _) | (_, "") => None,
        _ => units::si_per(unit, quantity).map(Scale::of),
    }
}
