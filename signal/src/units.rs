//! Units: as suffixes of the names of columns and settings (`stylus.force_n`, `speed_mm_s`), and as displayed symbols.

pub mod decimal;

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

/// The conversion of numbers in a unit to SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// SI.
    One,
    /// Thousandths of SI. It is exact, because it only moves the decimal point.
    Thousandth,
    /// SI per unit.
    Factor(f64),
}

impl Scale {
    /// The conversion of a unit.
    pub fn of(si_per_unit: f64) -> Self {
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

    /// The number of a text in SI, correctly rounded but for a factor.
    pub fn read(self, text: &str) -> Option<f64> {
        match self {
            Self::One => text.parse().ok(),
            Self::Thousandth => decimal::parse_thousandth(text),
            Self::Factor(factor) => Some(text.parse::<f64>().ok()? * factor),
        }
    }
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
    Row { suffix, symbol, quantity, si }
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
    unit("_us", "µs", Quantity::TIME, 1e-6),
    unit("_a", "A", Quantity::CURRENT, 1.0),
    unit("_ma", "mA", Quantity::CURRENT, 1e-3),
    unit("_k", "K", Quantity::TEMPERATURE, 1.0),
    unit("_rad", "rad", Quantity::ANGLE, 1.0),
    unit("_deg", "°", Quantity::ANGLE, std::f64::consts::PI / 180.0),
    unit("_m_s", "m/s", Quantity::SPEED, 1.0),
    unit("_mm_s", "mm/s", Quantity::SPEED, 1e-3),
    unit("_cm_s", "cm/s", Quantity::SPEED, 1e-2),
    unit("_m_s2", "m/s²", Quantity::ACCELERATION, 1.0),
    unit("_mm_s2", "mm/s²", Quantity::ACCELERATION, 1e-3),
    unit("_n", "N", Quantity::FORCE, 1.0),
    unit("_mn", "mN", Quantity::FORCE, 1e-3),
    unit("_gf", "gf", Quantity::FORCE, 9.80665e-3),
    unit("_lbf", "lbf", Quantity::FORCE, 4.448_221_615_260_5),
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
    unit("_n_per_a2", "N/A²", Quantity::FORCE.per(Quantity::CURRENT).per(Quantity::CURRENT), 1.0),
    unit("_ohm", "Ω", Quantity::VOLTAGE.per(Quantity::CURRENT), 1.0),
    unit("_j_per_k", "J/K", Quantity::FORCE.times(Quantity::LENGTH).per(Quantity::TEMPERATURE), 1.0),
];

/// The unit at the end of a setting's name, in constants too: the length of its suffix, and SI per unit. The dividend of a
/// quotient may be anything that is counted, as in `counts_per_mm`, whose suffix is `_per_mm`.
pub const fn at_end_of(name: &str) -> Option<(usize, f64)> {
    const PER: &[u8] = b"_per";
    let name = name.as_bytes();
    let Some(unit) = longest(name, name.len(), false) else {
        return None;
    };
    let before = name.len() - unit.suffix.len();
    if !ends_with(name, before, PER, false) {
        return Some((unit.suffix.len(), unit.si));
    }
    let quotient = PER.len() + unit.suffix.len();
    match longest(name, before - PER.len(), true) {
        Some(dividend) => Some((dividend.suffix.len() + quotient, dividend.si / unit.si)),
        None => Some((quotient, 1.0 / unit.si)),
    }
}

/// The unit with the longest suffix at the end of the first `end` bytes of a name; the last of several.
const fn longest(name: &[u8], end: usize, may_be_all: bool) -> Option<&'static Row> {
    let (mut found, mut at) = (None::<&Row>, 0);
    while at < UNITS.len() {
        let row = &UNITS[at];
        let is_longer = match found {
            Some(found) => row.suffix.len() >= found.suffix.len(),
            None => true,
        };
        if is_longer && ends_with(name, end, row.suffix.as_bytes(), may_be_all) {
            found = Some(row);
        }
        at += 1;
    }
    found
}

/// True if the first `end` bytes of a name end with a suffix, or are all of it without its underscore.
const fn ends_with(name: &[u8], end: usize, suffix: &[u8], may_be_all: bool) -> bool {
    let mut left = suffix.len();
    while left > 0 {
        left -= 1;
        let behind = suffix.len() - left;
        if behind > end {
            return may_be_all && left == 0;
        }
        if name[end - behind] != suffix[left] {
            return false;
        }
    }
    true
}

/// SI per unit of a suffix, for the types of [`unit_types!`](crate::unit_types!).
///
/// # Panics
/// If the table of units does not have the suffix or its parts; in a constant that is a compile error.
#[doc(hidden)]
pub const fn si_of_suffix(suffix: &str) -> f64 {
    match at_end_of(suffix) {
        Some((length, si)) if length == suffix.len() => si,
        _ => panic!("no unit has this suffix"),
    }
}

/// Declares the types of units by the suffixes of names. Symbol, quantity and factor are those of the table of units.
///
/// ```
/// haptograph_signal::unit_types! {
///     /// Millivolts per newton.
///     pub struct MillivoltsPerNewton("_mv_per_n");
/// }
/// assert_eq!(MillivoltsPerNewton(2.0).si(), 0.002);
/// ```
/// A suffix that the table does not have does not compile:
///
/// ```compile_fail,E0080
/// haptograph_signal::unit_types! {
///     /// Furlongs.
///     pub struct Furlongs("_furlong");
/// }
/// assert_eq!(Furlongs(1.0).si(), 201.168);
/// ```
#[macro_export]
macro_rules! unit_types {
    ($($(#[doc = $doc:expr])* $vis:vis struct $name:ident($suffix:literal);)*) => {$(
        $(#[doc = $doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
        $vis struct $name(pub f64);

        impl $name {
            /// End of the names of settings in this unit.
            pub const SUFFIX: &'static str = $suffix;
            /// SI per unit.
            pub const SI_PER_UNIT: f64 = $crate::units::si_of_suffix($suffix);

            /// The value in SI.
            pub const fn si(self) -> f64 {
                self.0 * Self::SI_PER_UNIT
            }

            /// A value in SI, in this unit.
            pub const fn of_si(si: f64) -> Self {
                Self(si * (1.0 / Self::SI_PER_UNIT))
            }
        }
    )*};
}

unit_types! {
    /// Millimetres.
    pub struct Millimetres("_mm");
    /// Centimetres.
    pub struct Centimetres("_cm");
    /// Micrometres.
    pub struct Micrometres("_um");
    /// Grams.
    pub struct Grams("_g");
    /// Milliseconds.
    pub struct Milliseconds("_ms");
    /// Milliamperes.
    pub struct Milliamperes("_ma");
    /// Degrees.
    pub struct Degrees("_deg");
    /// Millimetres per second.
    pub struct MillimetresPerSecond("_mm_s");
    /// Millimetres per second squared.
    pub struct MillimetresPerSecondSquared("_mm_s2");
    /// Millinewtons.
    pub struct Millinewtons("_mn");
    /// Newton millimetres.
    pub struct NewtonMillimetres("_n_mm");
    /// Millivolts.
    pub struct Millivolts("_mv");
    /// Kilohertz.
    pub struct Kilohertz("_khz");
    /// Newtons per millimetre.
    pub struct NewtonsPerMillimetre("_n_per_mm");
    /// Seconds per millimetre.
    pub struct SecondsPerMillimetre("_s_per_mm");
    /// A count per millimetre.
    pub struct PerMillimetre("_per_mm");
}

impl Degrees {
    /// The angle in turns.
    pub const fn turns(self) -> f64 {
        self.0 / 360.0
    }
}

/// Units that no factor converts: the ends of their names, and their symbols.
const WITHOUT_A_FACTOR: [(&str, &str); 2] = [("_db", "dB"), ("_c", "°C")];

/// Units that are displayed in place of SI units.
const SHOWN: [&str; 4] = ["_mm", "_mm_s", "_n_mm", "_n_per_mm"];

/// The suffix of a column of this quantity in SI; none for a plain number.
pub fn suffix(quantity: Quantity) -> String {
    match of(quantity).find(|unit| unit.si == 1.0) {
        _ if quantity == Quantity::NUMBER => String::new(),
        Some(unit) => unit.suffix.to_owned(),
        None => format!("_{}", quantity.unit().replace([' ', '^'], "_").replace('-', "minus")),
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
    at_end(name).last().map_or((Quantity::NUMBER, 1.0), |unit| (unit.quantity, unit.si))
}

/// SI per unit of a column of `quantity`, by the suffix of its name.
pub fn of_header_as(name: &str, quantity: Quantity) -> Option<f64> {
    at_end(name).find(|unit| unit.quantity == quantity).map(|unit| unit.si)
}

/// The unit at the end of a setting's name, which may be the quotient of two: `most_a_per_m_s2`. None where only a part
/// of its unit is known, as in `counts_per_mm`.
pub fn of_name(name: &str) -> Option<Unit> {
    if let Some((_, symbol)) = WITHOUT_A_FACTOR.iter().find(|(suffix, _)| name.ends_with(suffix)) {
        return Some(Unit { symbol: (*symbol).into(), scale: None });
    }
    let unit = at_end(name).last()?;
    let before = name.get(..name.len().checked_sub(unit.suffix.len())?)?;
    let Some(dividend) = before.strip_suffix("_per") else {
        return Some(Unit { symbol: unit.symbol.into(), scale: Some((unit.quantity, unit.si)) });
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

/// The end of a name that has a unit, written as in names (`mm_s`) or as usual (`mm/s`, `m/s²`, `N m`); or all of the name.
pub fn suffix_of(unit: &str) -> String {
    let plain = unit.trim().to_lowercase().replace(['/', ' ', '·'], "_");
    format!("_{}", plain.replace('²', "2").replace('^', "").replace(['µ', 'μ'], "u"))
}

/// SI per `unit` of a quantity, as [`suffix_of`] reads it.
pub fn si_per(unit: &str, quantity: Quantity) -> Option<f64> {
    let suffix = suffix_of(unit);
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
            ("slope_s_per_mm", Some((Quantity::TIME.per(Quantity::LENGTH), 1e3))),
            ("level_db", None),
        ] {
            assert_eq!(of_name(name).and_then(|unit| unit.scale), scale, "{name}");
        }
        for (quantity, symbol, si) in [
            (Quantity::STIFFNESS, "N/mm", 1e3),
            (Quantity::SPEED, "mm/s", 1e-3),
            (Quantity::ACCELERATION, "m/s²", 1.0),
            (Quantity::FORCE.per(Quantity::LENGTH).per(Quantity::LENGTH), "m^-1 kg s^-2", 1.0),
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
        assert_eq!(of_quantity(Quantity::SPEED).collect::<Vec<_>>(), ["m_s", "mm_s", "cm_s"]);
    }

    #[test]
    fn names_that_differ_in_their_units_are_converted() {
        assert_eq!(between("high_kHz", "high_hz"), Some(1e3));
        assert_eq!(between("speed_m_s", "speed_mm_s"), Some(1e3));
        assert_eq!(between("low_khz", "high_hz"), None);
        assert_eq!(between("width_mm", "width_ms"), None);
    }

    #[test]
    fn a_type_gives_the_bits_of_its_factor() {
        for x in [0.1, 30.0, 25.4, 1.0 / 3.0, 8191.7] {
            assert_eq!(Millimetres(x).si().to_bits(), (x * 1e-3).to_bits());
            assert_eq!(Degrees(x).si().to_bits(), x.to_radians().to_bits());
            assert_eq!(NewtonsPerMillimetre(x).si().to_bits(), (x * 1e3).to_bits());
            assert_eq!(SecondsPerMillimetre(x).si().to_bits(), (x * 1e3).to_bits());
            assert_eq!(PerMillimetre(x).si().to_bits(), (x * 1e3).to_bits());
            assert_eq!(Grams::of_si(x).0.to_bits(), (x * 1e3).to_bits());
            assert_eq!(NewtonsPerMillimetre::of_si(x).0.to_bits(), (x * 1e-3).to_bits());
            assert_eq!(Degrees(x).turns().to_bits(), (x / 360.0).to_bits());
        }
    }

    #[test]
    fn the_end_of_a_name_in_a_constant_is_that_at_run_time() {
        let scaled = UNITS.iter().map(|unit| format!("x{}", unit.suffix));
        let more = ["slope_s_per_mm", "m_s2_per_v", "most_a_per_m_s2", "slew_a_per_s"];
        for name in scaled.chain(more.map(str::to_owned)) {
            let scale = of_name(&name).and_then(|unit| unit.scale);
            assert_eq!(at_end_of(&name).map(|(_, si)| si), scale.map(|(_, si)| si), "{name}");
        }
        assert_eq!(at_end_of("counts_per_mm"), Some(("_per_mm".len(), 1e3)));
        assert_eq!(at_end_of("slope_s_per_mm"), Some(("_s_per_mm".len(), 1e3)));
        for name in ["level", "mm", "", "per_mm"] {
            let known = at_end_of(name).is_some();
            assert_eq!(known, name == "per_mm", "{name}");
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
