//! Text tables of names and values, and numbers with few digits.

use crate::report::table::Table;

pub(super) use crate::signal::units::decimal::significant;

/// A table with a header. Rows may be shorter than the header.
pub(super) fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    Table::new(header, rows.to_vec()).text()
}

/// Names and values, one pair per line.
pub(super) fn facts(facts: &[(&str, String)]) -> String {
    let wide = facts.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    facts
        .iter()
        .map(|(name, value)| format!("{name}{}  {value}\n", " ".repeat(wide - name.chars().count())))
        .collect()
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
