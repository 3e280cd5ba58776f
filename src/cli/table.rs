//! Text tables: columns as wide as needed, words left-aligned, numbers right-aligned.

/// A table with a header. Rows may be shorter than the header.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let width = |text: &str| text.chars().count();
    let is_number = |text: &String| {
        text.is_empty() || text.starts_with(|c: char| c.is_ascii_digit() || "-+–∞*[".contains(c))
    };
    let columns: Vec<(usize, bool)> = header
        .iter()
        .enumerate()
        .map(|(column, name)| {
            let cells = || rows.iter().filter_map(|row| row.get(column));
            (cells().map(|cell| width(cell)).fold(width(name), usize::max), cells().all(is_number))
        })
        .collect();
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let mut line = String::new();
        for (cell, &(wide, number)) in cells.zip(&columns) {
            let gap = " ".repeat(wide - width(cell));
            line += &if number { format!("  {gap}{cell}") } else { format!("  {cell}{gap}") };
        }
        line.trim_end().to_owned() + "\n"
    };
    let head = line(&mut header.iter().copied());
    let body = rows.iter().map(|row| line(&mut row.iter().map(String::as_str)));
    head + &body.collect::<String>()
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
    fn numbers_stand_under_one_another() {
        let rows = [vec!["canvas".to_owned(), "3.81".to_owned()], vec!["silk".to_owned(), "12.5".to_owned()]];
        assert_eq!(table(&["name", "SD"], &rows), "  name      SD\n  canvas  3.81\n  silk    12.5\n");
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
