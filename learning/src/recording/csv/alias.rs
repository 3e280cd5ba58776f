//! Columns with other names than ours whose quantity is nevertheless certain.

use super::super::import::{Finding, ImportSettings};
use super::AXES;
use super::units::{QUANTITIES, plain_name, unit_in_file};

/// First words of names, and our words for them.
const WORDS: [(&str, &str); 8] = [
    ("acceleration", "accel"),
    ("acc", "accel"),
    ("ax", "accel_x"),
    ("ay", "accel_y"),
    ("az", "accel_z"),
    ("velocity", "speed"),
    ("pos", "position"),
    ("timestamp", "time"),
];

/// The quantity of a column by its first word, such as `force_normal` for `Force [N]`.
pub(super) fn like_ours(name: &str) -> Option<String> {
    let lower = name.to_lowercase();
    let translated = WORDS.iter().find_map(|(word, ours)| {
        let rest = lower.strip_prefix(word)?;
        let ends = rest.is_empty() || rest.starts_with(['_', ' ', '[', '(', '/']);
        ends.then(|| format!("{ours}{rest}"))
    });
    let (plain, _) = plain_name(&translated.unwrap_or(lower))?;
    let plain = if plain == "force" { "force_normal".to_owned() } else { plain };
    QUANTITIES.contains(&&*plain).then_some(plain)
}

/// True if a column of a header is recognised as a quantity by its first word and its unit.
pub(super) fn is_like_ours(name: &str) -> bool {
    like_ours(name).is_some_and(|plain| unit_in_file(name, "", &plain, false).is_ok())
}

/// Assigns quantities to columns with other names, and adds findings: if no other column has the quantity, and its unit
/// is known. A single axis of the acceleration counts as the whole acceleration.
pub(super) fn taken_as(
    names: &[String],
    units: &[String],
    plain: &mut [Option<String>],
    import: &ImportSettings,
    has_rate: bool,
    is_signal: bool,
) -> Vec<Finding> {
    let ours = plain.to_vec();
    let has = |wanted: &str| {
        ours.iter().flatten().any(|plain| plain == wanted) || import.constants.contains_key(wanted)
    };
    let is_needed = |quantity: &str| match quantity {
        "time" => !has_rate,
        "force_normal" => !has("force_x"),
        _ if quantity.starts_with("position") => !has("speed"),
        _ => true,
    };
    // Times alone are those of nothing that is learned from, such as notes.
    let is_quantity = |name: &String| {
        let known = plain_name(&name.to_lowercase()).map(|(plain, _)| plain);
        let known = known.filter(|plain| QUANTITIES.contains(&&**plain));
        known.or_else(|| like_ours(name)).is_some_and(|plain| plain != "time")
    };
    let has_quantity = is_signal || !import.columns.is_empty() || names.iter().any(is_quantity);
    let below = |index: usize| units.get(index).map_or("", String::as_str);
    let candidate = |index: usize| -> Option<String> {
        let name = &names[index];
        let is_mapped = import.columns.values().any(|column| column == name);
        let quantity = like_ours(name).filter(|_| !is_mapped && ours[index].is_none())?;
        let is_free = !has(&quantity) && !import.columns.contains_key(&quantity) && is_needed(&quantity);
        let has_unit = (quantity == "time" && has_quantity)
            || import.units.contains_key(&quantity)
            || unit_in_file(name, below(index), &quantity, false).is_ok();
        (is_free && has_unit).then_some(quantity)
    };
    let mut taken: Vec<Option<String>> = (0..names.len()).map(candidate).collect();
    // Two that could be it are none.
    let all = taken.clone();
    for quantity in &mut taken {
        let is_one = all.iter().filter(|other| *other == quantity).count() == 1;
        *quantity = quantity.take().filter(|_| is_one);
    }
    if let Some(index) = lone_axis(&ours, &taken, import) {
        taken[index] = Some("accel".to_owned());
    }
    let mut findings = vec![];
    for ((plain, quantity), column) in plain.iter_mut().zip(taken).zip(names) {
        let Some(quantity) = quantity else { continue };
        *plain = Some(quantity.clone());
        let column = column.clone();
        findings.push(Finding::TakenAs { column, quantity });
    }
    findings
}

/// The only column of an axis of the acceleration, in a table without the acceleration, force axes and orientation that raw ones have.
fn lone_axis(ours: &[Option<String>], taken: &[Option<String>], import: &ImportSettings) -> Option<usize> {
    let all: Vec<Option<&str>> =
        { ours.iter().zip(taken) }.map(|(ours, taken)| ours.as_deref().or(taken.as_deref())).collect();
    let is_raw = ["accel", "force_x", "orientation_w"]
        .iter()
        .any(|name| all.contains(&Some(*name)) || import.constants.contains_key(*name));
    let axes = AXES.map(|axis| format!("accel_{axis}"));
    let is_axis = |name: &str| axes.iter().any(|axis| axis == name);
    let mut found = (0..all.len()).filter(|index| all[*index].is_some_and(is_axis));
    let lone = found.next().filter(|_| found.next().is_none() && !is_raw)?;
    // What a person has named is what it is.
    let is_named = axes.iter().any(|axis| import.columns.contains_key(axis));
    (!is_named).then_some(lone)
}
