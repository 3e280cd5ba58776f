//! Text tables of names and values, and numbers with few digits.

use crate::report::table::Table;

/// A table with a header. Rows may be shorter than the header.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    Table::new(header, rows.to_vec()).text()
}

/// Names and values, one pair per line.
pub fn facts(facts: &[(&str, String)]) -> String {
    let wide = facts.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    facts
        .iter()
        .map(|(name, value)| format!("{name}{}  {value}\n", " ".repeat(wide - name.chars().count())))
        .collect()
}

/// Formats a number with `digits` significant digits, without trailing zeros.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..=6).contains(&exponent) {
        return format!("{value:.*e}", digits.saturating_sub(1));
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_stand_under_one_another() {
        assert_eq!(facts(&[("a", "1".into()), ("long", "2".into())]), "a     1\nlong  2\n");
    }

    #[test]
    fn digits_that_say_nothing_are_left_out() {
        for (value, text) in [
            (0.0, "0"),
            (1.5, "1.5"),
            (1234.567, "1235"),
            (0.012344, "0.01234"),
            (2e-9, "2.000e-9"),
            (-3.0, "-3"),
        ] {
            assert_eq!(significant(value, 4), text);
        }
    }
}
