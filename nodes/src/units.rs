//! Units at the end of column names: `stylus.force_n`, `speed_mm_s`.

use haptograph_signal::quantity::Quantity;

/// Endings, what they are, and SI per unit. The first of a quantity is the one that is written.
const ENDINGS: &[(&str, Quantity, f64)] = &[
    ("_m", Quantity::LENGTH, 1.0),
    ("_mm", Quantity::LENGTH, 1e-3),
    ("_um", Quantity::LENGTH, 1e-6),
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
    ("_rad_s", Quantity::ANGULAR_SPEED, 1.0),
    ("_n_per_m", Quantity::STIFFNESS, 1.0),
    ("_n_per_mm", Quantity::STIFFNESS, 1e3),
    ("_n_s_per_m", Quantity::DAMPING, 1.0),
];

/// The ending of a column of this quantity in SI; none for a plain number.
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

/// What a column is by the ending of its name, and SI per its unit; a plain number where it has no such ending.
pub fn of_header(name: &str) -> (Quantity, f64) {
    let lower = name.to_lowercase();
    let fitting = ENDINGS.iter().filter(|(ending, ..)| lower.ends_with(ending));
    fitting
        .max_by_key(|(ending, ..)| ending.len())
        .map_or((Quantity::NUMBER, 1.0), |(_, quantity, scale)| {
            (*quantity, *scale)
        })
}

/// Why a header is none of a table: nothing is there, or its cells are not separated by commas.
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
    fn the_longest_ending_counts() {
        assert_eq!(of_header("speed_mm_s"), (Quantity::SPEED, 1e-3));
        assert_eq!(of_header("stylus.force_N"), (Quantity::FORCE, 1.0));
        assert_eq!(of_header("k_n_per_mm"), (Quantity::STIFFNESS, 1e3));
        assert_eq!(of_header("ratio"), (Quantity::NUMBER, 1.0));
    }
}
