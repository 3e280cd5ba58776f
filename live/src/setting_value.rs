//! Values of settings, in the type that their origin has.

use std::fmt;

/// A value of a parameter or of a live setting, in the type that its origin has.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SettingValue {
    /// A number. A live setting gets exactly these bits.
    Number(f64),
    /// A value as it stands in a graph file: `true`, `soft`, `a.ron`.
    Text(String),
}

impl SettingValue {
    /// A value that arrives as text. The number of a live setting (`out.gain`) is parsed here; the value of a parameter
    /// (`gain`) stays text, because the reader of the graph file parses it.
    pub fn from_text(name: &str, text: &str) -> Self {
        let number = text.parse().ok().filter(|_| name.contains('.'));
        number.map_or_else(|| Self::Text(text.to_owned()), Self::Number)
    }
}

/// As in a graph file: reading the text of a number gives the same bits.
impl fmt::Display for SettingValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => match number.abs() {
                0.0 | 1e-5..1e16 => number.fmt(f),
                size if size.is_finite() => fmt::LowerExp::fmt(number, f),
                _ => number.fmt(f),
            },
            Self::Text(text) => f.write_str(text),
        }
    }
}

macro_rules! from_numbers {
    ($($number:ty),*) => {$(
        impl From<$number> for SettingValue {
            fn from(number: $number) -> Self {
                Self::Number(number.into())
            }
        }
    )*};
}

from_numbers!(f64, i32, u32);

/// The decimal number that it stands for: 0.1 as in a graph file, not the binary number next to it, which may lie outside a
/// range that ends there.
impl From<f32> for SettingValue {
    fn from(number: f32) -> Self {
        Self::Number(number.to_string().parse().unwrap_or(f64::from(number)))
    }
}

impl From<bool> for SettingValue {
    fn from(is_true: bool) -> Self {
        Self::Text(is_true.to_string())
    }
}

impl From<&str> for SettingValue {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for SettingValue {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn only_the_text_of_a_live_setting_is_parsed() {
        let number = SettingValue::Number(0.5);
        assert_eq!(SettingValue::from_text("out.gain", "0.5"), number);
        for (name, text) in [("gain", "0.5"), ("out.gain", "soft"), ("surface", "007")] {
            assert_eq!(SettingValue::from_text(name, text), SettingValue::from(text));
        }
    }

    proptest! {
        #[test]
        fn the_text_of_a_number_has_its_bits(number in prop::num::f64::ANY.prop_filter("a number", |x| !x.is_nan())) {
            let text = SettingValue::Number(number).to_string();
            prop_assert_eq!(text.parse::<f64>().unwrap().to_bits(), number.to_bits(), "{}", text);
        }
    }
}
