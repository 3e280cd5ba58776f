//! The quantities and units that a column's name may say.

/// What a column's unit is in SI.
#[derive(Clone, Copy)]
pub(in crate::recording) enum Scale {
    One,
    Thousandth,
    StandardGravity,
}

/// What a column may hold.
struct Quantity {
    name: &'static str,
    si_unit: &'static str,
    /// The units its columns may have. An axis or component stands between name and unit.
    units: &'static [(&'static str, Scale)],
}

const fn quantity(
    name: &'static str,
    si_unit: &'static str,
    units: &'static [(&'static str, Scale)],
) -> Quantity {
    Quantity { name, si_unit, units }
}

static QUANTITIES: [Quantity; 7] = [
    quantity("time", "s", &[("s", Scale::One), ("ms", Scale::Thousandth)]),
    quantity(
        "accel",
        "m/s2",
        &[("m_s2", Scale::One), ("g", Scale::StandardGravity)],
    ),
    quantity("force", "N", &[("n", Scale::One), ("mn", Scale::Thousandth)]),
    quantity(
        "torque",
        "N m",
        &[("n_m", Scale::One), ("n_mm", Scale::Thousandth)],
    ),
    quantity("position", "m", &[("m", Scale::One), ("mm", Scale::Thousandth)]),
    quantity(
        "speed",
        "m/s",
        &[("m_s", Scale::One), ("mm_s", Scale::Thousandth)],
    ),
    quantity("orientation", "1", &[("", Scale::One)]),
];
/// What may stand between quantity and unit.
const PARTS: [&str; 6] = ["x", "y", "z", "w", "normal", "tangential"];

fn quantity_of(name: &str) -> Option<&'static Quantity> {
    QUANTITIES.iter().find(|quantity| {
        name.strip_prefix(quantity.name)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
    })
}

/// The unit that the numbers of a column of ours are read in.
pub(in crate::recording) fn si_unit(name: &str) -> Option<&'static str> {
    parse_name(name)?.ok()?;
    quantity_of(name).map(|quantity| quantity.si_unit)
}

/// The name without its unit, and the unit; `None` for columns that are none of ours.
pub(in crate::recording) fn parse_name(name: &str) -> Option<Result<(String, Scale), String>> {
    let Quantity {
        name: quantity,
        units,
        ..
    } = quantity_of(name)?;
    let rest = name[quantity.len()..].trim_start_matches('_');
    let part = PARTS.iter().find(|part| {
        rest.strip_prefix(**part)
            .is_some_and(|unit| unit.is_empty() || unit.starts_with('_'))
    });
    let unit = part.map_or(rest, |part| rest[part.len()..].trim_start_matches('_'));
    let plain = part.map_or_else(|| (*quantity).to_owned(), |part| format!("{quantity}_{part}"));
    Some(match units.iter().find(|(known, _)| *known == unit) {
        Some((_, scale)) => Ok((plain, *scale)),
        None => {
            let known: Vec<_> = units.iter().map(|(unit, _)| format!("{plain}_{unit}")).collect();
            Err(format!(
                "column {name:?} has no unit that is understood; name it {}",
                known.join(" or ")
            ))
        }
    })
}
