//! The quantities and units that a column's name may say.

use haptograph_signal::quantity::Quantity;
use haptograph_signal::units;

/// What a column's unit is in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::recording) enum Scale {
    One,
    /// Exact: in decimal, it only moves the point.
    Thousandth,
    Factor(f64),
}

impl Scale {
    fn of(si_per_unit: f64) -> Self {
        match si_per_unit {
            1.0 => Self::One,
            1e-3 => Self::Thousandth,
            factor => Self::Factor(factor),
        }
    }

    /// A number in SI.
    pub fn si(self, value: f64) -> f64 {
        match self {
            Self::One => value,
            Self::Thousandth => value / 1000.0,
            Self::Factor(factor) => value * factor,
        }
    }
}

static QUANTITIES: [(&str, Quantity); 7] = [
    ("time", Quantity::TIME),
    ("accel", Quantity::ACCELERATION),
    ("force", Quantity::FORCE),
    ("torque", Quantity::TORQUE),
    ("position", Quantity::LENGTH),
    ("speed", Quantity::SPEED),
    ("orientation", Quantity::NUMBER),
];
/// What may stand between quantity and unit.
const PARTS: [&str; 6] = ["x", "y", "z", "w", "normal", "tangential"];

/// Quantity, name without unit, and what is left of a column's name; `None` for columns that are none of ours.
fn parts(name: &str) -> Option<(Quantity, String, &str)> {
    let (quantity_name, quantity) = QUANTITIES.iter().find(|(quantity, _)| {
        name.strip_prefix(quantity)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
    })?;
    let rest = name[quantity_name.len()..].trim_start_matches('_');
    let part = PARTS.iter().find(|part| {
        rest.strip_prefix(**part)
            .is_some_and(|unit| unit.is_empty() || unit.starts_with('_'))
    });
    let unit = part.map_or(rest, |part| rest[part.len()..].trim_start_matches('_'));
    let plain = part.map_or_else(
        || (*quantity_name).to_owned(),
        |part| format!("{quantity_name}_{part}"),
    );
    Some((*quantity, plain, unit))
}

/// The unit that the numbers of a column of ours are read in.
pub(in crate::recording) fn si_unit(name: &str) -> Option<&'static str> {
    parse_name(name)?.ok()?;
    let (quantity, ..) = parts(name)?;
    let named = Quantity::NAMED.iter().find(|(known, ..)| *known == quantity);
    named.map(|(.., unit)| *unit)
}

/// The name without its unit, and the unit; `None` for columns that are none of ours.
pub(in crate::recording) fn parse_name(name: &str) -> Option<Result<(String, Scale), String>> {
    let (quantity, plain, unit) = parts(name)?;
    Some(match scale_of(unit, quantity) {
        Some(scale) => Ok((plain, scale)),
        None => {
            let known: Vec<_> = units::of_quantity(quantity)
                .map(|unit| format!("{plain}_{unit}"))
                .collect();
            Err(format!(
                "column {name:?} has no unit that is understood; name it {}, or say its unit (--unit)",
                known.join(" or ")
            ))
        }
    })
}

/// The unit of a quantity of ours, such as `accel` or `force_normal`, that a person says; `1` stands for a unit that is not known.
pub(in crate::recording) fn parse_unit(plain: &str, unit: &str) -> Result<Scale, String> {
    let Some((quantity, _, "")) = parts(plain) else {
        return Err(format!("{plain} is none of a recording's quantities"));
    };
    if unit.trim() == "1" {
        return Ok(Scale::One);
    }
    scale_of(unit, quantity).ok_or_else(|| {
        let known: Vec<_> = units::of_quantity(quantity).collect();
        format!(
            "{unit:?} is no unit of {plain}; known are {}, and 1 for one that is not known",
            known.join(", ")
        )
    })
}

/// The unit at the end of any column's name, where it is one of the quantity's.
pub(in crate::recording) fn unit_at_end(name: &str, plain: &str) -> Option<Scale> {
    let (quantity, ..) = parts(plain)?;
    match quantity {
        Quantity::NUMBER => Some(Scale::One),
        _ => units::of_header_as(name, quantity).map(Scale::of),
    }
}

/// The quantity of ours without unit, such as `force_normal`, that a name begins with.
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
