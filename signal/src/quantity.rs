//! Physical quantities as exponents of SI base units. They prevent connecting a speed to a force and give the
//! quantity of a derivative.

use std::fmt;

/// A physical quantity: the exponents of metre, kilogram, second, ampere, kelvin and radian.
///
/// Wires carry plain SI values; the quantity belongs to the port. The radian counts as a dimension, so that an
/// angle is not a plain number by accident.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Quantity {
    exponents: [i8; 6],
}

/// Symbols of the base units, in the order of [`Quantity`]'s exponents.
const BASE_UNITS: [&str; 6] = ["m", "kg", "s", "A", "K", "rad"];

const fn quantity(m: i8, kg: i8, s: i8, a: i8, k: i8, rad: i8) -> Quantity {
    Quantity { exponents: [m, kg, s, a, k, rad] }
}

impl Quantity {
    /// A plain number, unit 1.
    pub const NUMBER: Self = quantity(0, 0, 0, 0, 0, 0);
    /// Length, m.
    pub const LENGTH: Self = quantity(1, 0, 0, 0, 0, 0);
    /// Mass, kg.
    pub const MASS: Self = quantity(0, 1, 0, 0, 0, 0);
    /// Time, s.
    pub const TIME: Self = quantity(0, 0, 1, 0, 0, 0);
    /// Electric current, A.
    pub const CURRENT: Self = quantity(0, 0, 0, 1, 0, 0);
    /// Temperature, K.
    pub const TEMPERATURE: Self = quantity(0, 0, 0, 0, 1, 0);
    /// Angle, rad.
    pub const ANGLE: Self = quantity(0, 0, 0, 0, 0, 1);
    /// Speed and velocity, m/s.
    pub const SPEED: Self = quantity(1, 0, -1, 0, 0, 0);
    /// Acceleration, m/s2.
    pub const ACCELERATION: Self = quantity(1, 0, -2, 0, 0, 0);
    /// Force, N.
    pub const FORCE: Self = quantity(1, 1, -2, 0, 0, 0);
    /// Torque, N m.
    pub const TORQUE: Self = quantity(2, 1, -2, 0, 0, 0);
    /// Voltage, V.
    pub const VOLTAGE: Self = quantity(2, 1, -3, -1, 0, 0);
    /// Power, W.
    pub(crate) const POWER: Self = quantity(2, 1, -3, 0, 0, 0);
    /// Frequency, Hz.
    pub const FREQUENCY: Self = quantity(0, 0, -1, 0, 0, 0);
    /// Angular velocity, rad/s.
    pub(crate) const ANGULAR_SPEED: Self = quantity(0, 0, -1, 0, 0, 1);
    /// Stiffness, N/m.
    pub(crate) const STIFFNESS: Self = quantity(0, 1, -2, 0, 0, 0);
    /// Damping, N s/m.
    pub(crate) const DAMPING: Self = quantity(0, 1, -1, 0, 0, 0);

    /// The quantities with a name of their own: (quantity, name, unit).
    pub const NAMED: &'static [(Self, &'static str, &'static str)] = &[
        (Self::NUMBER, "number", "1"),
        (Self::LENGTH, "length", "m"),
        (Self::MASS, "mass", "kg"),
        (Self::TIME, "time", "s"),
        (Self::CURRENT, "current", "A"),
        (Self::TEMPERATURE, "temperature", "K"),
        (Self::ANGLE, "angle", "rad"),
        (Self::SPEED, "speed", "m/s"),
        (Self::ACCELERATION, "acceleration", "m/s2"),
        (Self::FORCE, "force", "N"),
        (Self::TORQUE, "torque", "N m"),
        (Self::VOLTAGE, "voltage", "V"),
        (Self::POWER, "power", "W"),
        (Self::FREQUENCY, "frequency", "Hz"),
        (Self::ANGULAR_SPEED, "angular speed", "rad/s"),
        (Self::STIFFNESS, "stiffness", "N/m"),
        (Self::DAMPING, "damping", "N s/m"),
    ];

    /// The named quantity called `name`, if there is one.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::NAMED.iter().find(|(_, known, _)| *known == name).map(|(quantity, ..)| *quantity)
    }

    /// The name of the quantity, if it has one.
    pub fn name(self) -> Option<&'static str> {
        Self::NAMED.iter().find(|(known, ..)| *known == self).map(|(_, name, _)| *name)
    }

    /// The SI unit of the quantity: the usual symbol, or the product of base units.
    pub fn unit(self) -> String {
        if let Some((.., unit)) = Self::NAMED.iter().find(|(known, ..)| *known == self) {
            return (*unit).to_owned();
        }
        let parts = BASE_UNITS.iter().zip(self.exponents).filter(|(_, exponent)| *exponent != 0);
        let parts: Vec<String> =
            parts.map(|(unit, e)| if e == 1 { (*unit).to_owned() } else { format!("{unit}^{e}") }).collect();
        parts.join(" ")
    }

    /// The quantity of a product.
    pub const fn times(self, other: Self) -> Self {
        self.combine(other, 1)
    }

    /// The quantity of a quotient.
    pub const fn per(self, other: Self) -> Self {
        self.combine(other, -1)
    }

    const fn combine(self, other: Self, sign: i8) -> Self {
        let mut exponents = self.exponents;
        let mut i = 0;
        while i < exponents.len() {
            exponents[i] = exponents[i].saturating_add(other.exponents[i].saturating_mul(sign));
            i += 1;
        }
        Self { exponents }
    }
}

impl fmt::Display for Quantity {
    /// `force (N)`, or the bare unit where the quantity has no name.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => write!(f, "{name} ({})", self.unit()),
            None => f.write_str(&self.unit()),
        }
    }
}

impl fmt::Debug for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_and_products_find_their_own_quantity() {
        assert_eq!(Quantity::LENGTH.per(Quantity::TIME), Quantity::SPEED);
        assert_eq!(Quantity::SPEED.per(Quantity::TIME), Quantity::ACCELERATION);
        assert_eq!(Quantity::MASS.times(Quantity::ACCELERATION), Quantity::FORCE);
        assert_eq!(Quantity::LENGTH.times(Quantity::FORCE), Quantity::TORQUE);
        assert_eq!(Quantity::VOLTAGE.times(Quantity::CURRENT), Quantity::POWER);
        assert_ne!(Quantity::ANGLE, Quantity::NUMBER);
    }

    #[test]
    fn names_and_units_read_as_a_person_writes_them() {
        assert_eq!(Quantity::FORCE.to_string(), "force (N)");
        assert_eq!(Quantity::FORCE.per(Quantity::CURRENT).to_string(), "m kg s^-2 A^-1");
        for (quantity, name, _) in Quantity::NAMED {
            assert_eq!(Quantity::by_name(name), Some(*quantity));
        }
    }
}
