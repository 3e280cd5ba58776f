//! Units at the end of column names: `stylus.force_n`, `speed_mm_s`.

use crate::quantity::Quantity;

/// Suffixes, their quantities, and SI per unit. The first suffix of a quantity is the one that is written.
const ENDINGS: &[(&str, Quantity, f64)] = &[
    ("_m", Quantity::LENGTH, 1.0),
    ("_mm", Quantity::LENGTH, 1e-3),
    ("_cm", Quantity::LENGTH, 1e-2),
    ("_um", Quantity::LENGTH, 1e-6),
    // Of two quantities with the same suffix the last is the default.
    ("_g", Quantity::ACCELERATION, 9.80665),
    ("_kg", Quantity::MASS, 1.0),
    ("_g", Quantity::MASS, 1e-3),
    ("_s", Quantity::TIME, 1.0),
    ("_ms", Quantity::TIME, 1e-3),
    ("_a", Quantity::CURRENT, 1.0),
    ("_ma", Quantity::CURRENT, 1e-3),
    ("_k", Quantity::TEMPERATURE, 1.0),
    ("_rad", Quantity::ANGLE, 1.0),
    ("_deg", Quantity::ANGLE, std::f64::consts::PI / 180.0),
    ("_m_s", Quantity::SPEED, 1.0),
    ("_mm_s", Quantity::SPEED, 1e-3),
    ("_m_s2", Quantity::ACCELERATION, 1.0),
    ("_mm_s2", Quantity::ACCELERATION, 1e-3),
    ("_n", Quantity::FORCE, 1.0),
    ("_mn", Quantity::FORCE, 1e-3),
    ("_n_m", Quantity::TORQUE, 1.0),
    ("_n_mm", Quantity::TORQUE, 1e-3),
    ("_v", Quantity::VOLTAGE, 1.0),
    ("_mv", Quantity::VOLTAGE, 1e-3),
    ("_w", Quantity::POWER, 1.0),
    ("_hz", Quantity::FREQUENCY, 1.0),
    ("_khz", Quantity::FREQUENCY, 1e3),
    ("_rad_s", Quantity::ANGULAR_SPEED, 1.0),
    ("_n_per_m", Quantity::STIFFNESS, 1.0),
    ("_n_per_mm", Quantity::STIFFNESS, 1e3),
    ("_n_s_per_m", Quantity::DAMPING, 1.0),
];

/// The suffix of a column of this quantity in SI; none for a plain number.
pub fn suffix(quantity: Quantity) -> String {
    if quantity == Quantity::NUMBER {
        return String::new();
    }
    match ENDINGS
        .iter()
        .find(|(_, known, scale)| *known == quantity && *scale == 1.0)
    {
        Some((ending, ..)) => (*ending).to_owned(),
        None => format!(
            "_{}",
            quantity.unit().replace([' ', '^'], "_").replace('-', "minus")
        ),
    }
}

/// Quantity of a column by the suffix of its name, and SI per unit; a plain number without a known suffix.
pub fn of_header(name: &str) -> (Quantity, f64) {
    let lower = name.to_lowercase();
    let fitting = ENDINGS.iter().filter(|(ending, ..)| lower.ends_with(ending));
    fitting
        .max_by_key(|(ending, ..)| ending.len())
        .map_or((Quantity::NUMBER, 1.0), |(_, quantity, scale)| {
            (*quantity, *scale)
        })
}

/// SI per unit of a column of `quantity`, by the suffix of its name.
pub fn of_header_as(name: &str, quantity: Quantity) -> Option<f64> {
    let lower = name.to_lowercase();
    let fitting = ENDINGS.iter().filter(|(ending, ..)| lower.ends_with(ending));
    let longest = fitting.clone().map(|(ending, ..)| ending.len()).max()?;
    fitting
        .filter(|(ending, ..)| ending.len() == longest)
        .find(|(_, known, _)| *known == quantity)
        .map(|(.., scale)| *scale)
}

/// SI per `unit` of a quantity, written as in names (`mm_s`) or as usual (`mm/s`, `m/s²`, `N m`).
pub fn si_per(unit: &str, quantity: Quantity) -> Option<f64> {
    let plain = unit.trim().to_lowercase().replace(['/', ' ', '·'], "_");
    let ending = format!("_{}", plain.replace('²', "2").replace('^', "").replace('µ', "u"));
    ENDINGS
        .iter()
        .find(|(known, of, _)| *known == ending && *of == quantity)
        .map(|(.., scale)| *scale)
}

/// Factor that converts a number under `name` to one under `other`, if the names differ in their units only.
pub fn between(name: &str, other: &str) -> Option<f64> {
    let lower = name.to_lowercase();
    ENDINGS.iter().find_map(|(ending, quantity, scale)| {
        let rest = other.strip_prefix(lower.strip_suffix(ending)?)?;
        let (.., to) = ENDINGS
            .iter()
            .find(|(known, of, _)| *known == rest && of == quantity)?;
        Some(scale / to)
    })
}

/// The units of a quantity, as suffixes of names.
pub fn of_quantity(quantity: Quantity) -> impl Iterator<Item = &'static str> {
    ENDINGS
        .iter()
        .filter(move |(_, known, _)| *known == quantity)
        .map(|(ending, ..)| &ending[1..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_named_quantity_is_read_as_it_is_written() {
        for (quantity, name, _) in Quantity::NAMED {
            let header = format!("signal{}", suffix(*quantity));
            assert_eq!(of_header(&header), (*quantity, 1.0), "{name}");
        }
    }

    #[test]
    fn a_known_quantity_decides_between_equal_endings() {
        assert_eq!(of_header("accel_g"), (Quantity::MASS, 1e-3));
        assert_eq!(of_header_as("accel_g", Quantity::ACCELERATION), Some(9.80665));
        assert_eq!(of_header_as("speed_mm_s", Quantity::TIME), None);
        assert_eq!(si_per("m/s^2", Quantity::ACCELERATION), Some(1.0));
        assert_eq!(si_per("N mm", Quantity::TORQUE), Some(1e-3));
        assert_eq!(si_per("furlong", Quantity::LENGTH), None);
        assert_eq!(of_quantity(Quantity::SPEED).collect::<Vec<_>>(), ["m_s", "mm_s"]);
    }

    #[test]
    fn names_that_differ_in_their_units_are_converted() {
        assert_eq!(between("high_kHz", "high_hz"), Some(1e3));
        assert_eq!(between("speed_m_s", "speed_mm_s"), Some(1e3));
        assert_eq!(between("low_khz", "high_hz"), None);
        assert_eq!(between("width_mm", "width_ms"), None);
    }

    #[test]
    fn the_longest_ending_counts() {
        assert_eq!(of_header("speed_mm_s"), (Quantity::SPEED, 1e-3));
        assert_eq!(of_header("stylus.force_N"), (Quantity::FORCE, 1.0));
        assert_eq!(of_header("k_n_per_mm"), (Quantity::STIFFNESS, 1e3));
        assert_eq!(of_header("ratio"), (Quantity::NUMBER, 1.0));
    }
}
