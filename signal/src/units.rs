//! Units: as suffixes of the names of columns and settings (`stylus.force_n`, `speed_mm_s`), and as displayed symbols.

use crate::quantity::Quantity;

use std::borrow::Cow;

/// The unit of a setting, by the suffix of its name.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// The displayed symbol: `mm/s`.
    pub symbol: Cow<'static, str>,
    /// The quantity, and the SI value of one unit; `None` for °C and dB, which no factor converts.
    pub scale: Option<(Quantity, f64)>,
}

struct Row {
    /// The end of a name with this unit.
    suffix: &'static str,
    /// The symbol that people write.
    symbol: &'static str,
    quantity: Quantity,
    /// SI per unit.
    si: f64,
}

const fn unit(suffix: &'static str, symbol: &'static str, quantity: Quantity, si: f64) -> Row {
    Row {
        suffix,
        symbol,
        quantity,
        si,
    }
}

/// All units. The first of a quantity is the one that is written into files.
const UNITS: &[Row] = &[
    unit("_m", "m", Quantity::LENGTH, 1.0),
    unit("_mm", "mm", Quantity::LENGTH, 1e-3),
    unit("_cm", "cm", Quantity::LENGTH, 1e-2),
    unit("_um", "µm", Quantity::LENGTH, 1e-6),
    // Of two quantities with the same suffix the last is the default.
    unit("_g", "g", Quantity::ACCELERATION, 9.80665),
    unit("_kg", "kg", Quantity::MASS, 1.0),
    unit("_g", "g", Quantity::MASS, 1e-3),
    unit("_s", "s", Quantity::TIME, 1.0),
    unit("_ms", "ms", Quantity::TIME, 1e-3),
    unit("_a", "A", Quantity::CURRENT, 1.0),
    unit("_ma", "mA", Quantity::CURRENT, 1e-3),
    unit("_k", "K", Quantity::TEMPERATURE, 1.0),
    unit("_rad", "rad", Quantity::ANGLE, 1.0),
    unit("_deg", "°", Quantity::ANGLE, std::f64::consts::PI / 180.0),
    unit("_m_s", "m/s", Quantity::SPEED, 1.0),
    unit("_mm_s", "mm/s", Quantity::SPEED, 1e-3),
    unit("_m_s2", "m/s²", Quantity::ACCELERATION, 1.0),
    unit("_mm_s2", "mm/s²", Quantity::ACCELERATION, 1e-3),
    unit("_n", "N", Quantity::FORCE, 1.0),
    unit("_mn", "mN", Quantity::FORCE, 1e-3),
    unit("_n_m", "N m", Quantity::TORQUE, 1.0),
    unit("_n_mm", "N mm", Quantity::TORQUE, 1e-3),
    unit("_v", "V", Quantity::VOLTAGE, 1.0),
    unit("_mv", "mV", Quantity::VOLTAGE, 1e-3),
    unit("_w", "W", Quantity::POWER, 1.0),
    unit("_hz", "Hz", Quantity::FREQUENCY, 1.0),
    unit("_khz", "kHz", Quantity::FREQUENCY, 1e3),
    unit("_rad_s", "rad/s", Quantity::ANGULAR_SPEED, 1.0),
    unit("_n_per_m", "N/m", Quantity::STIFFNESS, 1.0),
    unit("_n_per_mm", "N/mm", Quantity::STIFFNESS, 1e3),
    unit("_n_s_per_m", "N s/m", Quantity::DAMPING, 1.0),
    unit("_n_per_a", "N/A", Quantity::FORCE.per(Quantity::CURRENT), 1.0),
    unit(
        "_n_per_a2",
        "N/A²",
        Quantity::FORCE.per(Quantity::CURRENT).per(Quantity::CURRENT),
        1.0,
    ),
    unit("_ohm", "Ω", Quantity::VOLTAGE.per(Quantity::CURRENT), 1.0),
    unit(
        "_j_per_k",
        "J/K",
        Quantity::FORCE.times(Quantity::LENGTH).per(Quantity::TEMPERATURE),
        1.0,
    ),
];

/// Units that no factor converts: the ends of their names, and their symbols.
const WITHOUT_A_FACTOR: [(&str, &str); 2] = [("_db", "dB"), ("_c", "°C")];

/// Units that are displayed in place of SI units.
const SHOWN: [&str; 4] = ["_mm", "_mm_s", "_n_mm", "_n_per_mm"];

/// The suffix of a column of this quantity in SI; none for a plain number.
pub fn suffix(quantity: Quantity) -> String {
    if quantity == Quantity::NUMBER {
        return String::new();
    }
    match of(quantity).find(|unit| unit.si == 1.0) {
        Some(unit) => unit.suffix.to_owned(),
        None => format!(
            "_{}",
            quantity.unit().replace([' ', '^'], "_").replace('-', "minus")
        ),
    }
}

/// The symbol of the unit in which a quantity is displayed, and the SI value of one unit: N/mm, 1000.
pub fn shown(quantity: Quantity) -> (String, f64) {
    let shown = of(quantity).find(|unit| SHOWN.contains(&unit.suffix));
    match shown.or_else(|| of(quantity).find(|unit| unit.si == 1.0)) {
        Some(unit) => (unit.symbol.to_owned(), unit.si),
        None => (quantity.unit(), 1.0),
    }
}

fn of(quantity: Quantity) -> impl Iterator<Item = &'static Row> {
    UNITS.iter().filter(move |unit| unit.quantity == quantity)
}

/// The units with which a name ends, of one suffix: the longest.
fn at_end(name: &str) -> impl Iterator<Item = &'static Row> {
    let lower = name.to_lowercase();
    let fitting = UNITS.iter().filter(|unit| lower.ends_with(unit.suffix));
    let longest = fitting.map(|unit| unit.suffix).max_by_key(|suffix| suffix.len());
    UNITS.iter().filter(move |unit| Some(unit.suffix) == longest)
}

/// Quantity of a column by the suffix of its name, and SI per unit; a plain number without a known suffix.
pub fn of_header(name: &str) -> (Quantity, f64) {
    let unit = at_end(name).last();
    unit.map_or((Quantity::NUMBER, 1.0), |unit| (unit.quantity, unit.si))
}

/// SI per unit of a column of `quantity`, by the suffix of its name.
pub fn of_header_as(name: &str, quantity: Quantity) -> Option<f64> {
    let unit = at_end(name).find(|unit| unit.quantity == quantity);
    unit.map(|unit| unit.si)
}

/// The unit at the end of a setting's name, which may be the quotient of two: `most_a_per_m_s2`. None where only a part
/// of its unit is known, as in `counts_per_mm`.
pub fn of_name(name: &str) -> Option<Unit> {
    if let Some((_, symbol)) = WITHOUT_A_FACTOR.iter().find(|(suffix, _)| name.ends_with(suffix)) {
        return Some(Unit {
            symbol: (*symbol).into(),
            scale: None,
        });
    }
    let unit = at_end(name).last()?;
    let before = name.get(..name.len().checked_sub(unit.suffix.len())?)?;
    let Some(dividend) = before.strip_suffix("_per") else {
        return Some(Unit {
            symbol: unit.symbol.into(),
            scale: Some((unit.quantity, unit.si)),
        });
    };
    // It may be all of the name: `m_s2_per_v`.
    let dividend = at_end(&format!("_{dividend}")).last()?;
    let is_simple = |symbol: &str| !symbol.contains(['/', ' ']);
    let sign = match is_simple(dividend.symbol) && is_simple(unit.symbol) {
        true => "/",
        false => " per ",
    };
    Some(Unit {
        symbol: format!("{}{sign}{}", dividend.symbol, unit.symbol).into(),
        scale: Some((dividend.quantity.per(unit.quantity), dividend.si / unit.si)),
    })
}

/// SI per `unit` of a quantity, written as in names (`mm_s`) or as usual (`mm/s`, `m/s²`, `N m`).
pub fn si_per(unit: &str, quantity: Quantity) -> Option<f64> {
    let plain = unit.trim().to_lowercase().replace(['/', ' ', '·'], "_");
    let suffix = format!("_{}", plain.replace('²', "2").replace('^', "").replace('µ', "u"));
    let known = of(quantity).find(|unit| unit.suffix == suffix);
    known.map(|unit| unit.si)
}

/// SI per unit of a symbol, such as `mm`, if the symbol has one meaning.
pub fn si_of(symbol: &str) -> Option<f64> {
    let mut known = UNITS.iter().filter(|unit| unit.symbol == symbol);
    let unit = known.next()?;
    known.next().is_none().then_some(unit.si)
}

/// Factor that converts a number under `name` to one under `other`, if the names differ in their units only.
pub fn between(name: &str, other: &str) -> Option<f64> {
    let lower = name.to_lowercase();
    UNITS.iter().find_map(|from| {
        let rest = other.strip_prefix(lower.strip_suffix(from.suffix)?)?;
        let to = of(from.quantity).find(|to| to.suffix == rest)?;
        Some(from.si / to.si)
    })
}

/// The units of a quantity, as suffixes of names.
pub fn of_quantity(quantity: Quantity) -> impl Iterator<Item = &'static str> {
    of(quantity).map(|unit| &unit.suffix[1..])
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
    fn symbols_are_what_they_say() {
        for (quantity, _, si) in Quantity::NAMED {
            let unit = of_name(&format!("signal{}", suffix(*quantity)));
            let symbol = unit.map(|unit| unit.symbol.replace('²', "2"));
            assert_eq!(symbol.as_deref().unwrap_or("1"), *si);
        }
        for (name, symbol_of_it) in [
            ("stiffness_n_per_mm", Some("N/mm")),
            ("force_n_per_a", Some("N/A")),
            ("gain_m_s2_per_v", Some("m/s² per V")),
            ("m_s2_per_v", Some("m/s² per V")),
            ("most_a_per_m_s2", Some("A per m/s²")),
            ("slew_a_per_s", Some("A/s")),
            ("level_db", Some("dB")),
            ("ambient_c", Some("°C")),
            ("counts_per_mm", None),
            ("level", None),
        ] {
            let symbol = of_name(name).map(|unit| unit.symbol);
            assert_eq!(symbol.as_deref(), symbol_of_it, "{name}");
        }
        for (name, scale) in [
            ("mass_g", Some((Quantity::MASS, 1e-3))),
            (
                "slope_s_per_mm",
                Some((Quantity::TIME.per(Quantity::LENGTH), 1e3)),
            ),
            ("level_db", None),
        ] {
            assert_eq!(of_name(name).and_then(|unit| unit.scale), scale, "{name}");
        }
        for (quantity, symbol, si) in [
            (Quantity::STIFFNESS, "N/mm", 1e3),
            (Quantity::SPEED, "mm/s", 1e-3),
            (Quantity::ACCELERATION, "m/s²", 1.0),
            (
                Quantity::FORCE.per(Quantity::LENGTH).per(Quantity::LENGTH),
                "m^-1 kg s^-2",
                1.0,
            ),
        ] {
            assert_eq!(shown(quantity), (symbol.to_owned(), si));
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
        assert_eq!([si_of("kHz"), si_of("g"), si_of("khz")], [Some(1e3), None, None]);
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
