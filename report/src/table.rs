//! A table of text, for a terminal and for a page.

use super::svg::escape;

/// A table: a header, and rows, which may be shorter. On a page the first cell of a row is its name.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Table {
    /// Column headers.
    pub head: Vec<String>,
    /// Rows.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with these headers.
    pub fn new(head: &[&str], rows: Vec<Vec<String>>) -> Self {
        Self { head: head.iter().map(|&name| name.to_owned()).collect(), rows }
    }

    /// Text with columns as wide as needed, words left-aligned, numbers right-aligned.
    pub fn text(&self) -> String {
        let width = |text: &str| text.chars().count();
        let is_number = |text: &String| {
            text.is_empty() || text.starts_with(|c: char| c.is_ascii_digit() || "-+–∞*[".contains(c))
        };
        let column = |(column, name): (usize, &String)| {
            let cells = || self.rows.iter().filter_map(|row| row.get(column));
            (cells().map(|cell| width(cell)).fold(width(name), usize::max), cells().all(is_number))
        };
        let columns: Vec<(usize, bool)> = self.head.iter().enumerate().map(column).collect();
        let line = |cells: &Vec<String>| {
            let mut line = String::new();
            for (cell, &(wide, number)) in cells.iter().zip(&columns) {
                let gap = " ".repeat(wide - width(cell));
                line += &if number { format!("  {gap}{cell}") } else { format!("  {cell}{gap}") };
            }
            line.trim_end().to_owned() + "\n"
        };
        std::iter::once(&self.head).chain(&self.rows).map(line).collect()
    }

    /// The table of a page, with true minus signs.
    pub(super) fn to_html(&self) -> String {
        let rows = self.rows.iter().map(|row| {
            let minus = |cell: &String| escape(&cell.replace('-', "\u{2212}"));
            let name = row.first().map(|name| escape(name));
            name.into_iter().chain(row.iter().skip(1).map(minus)).collect()
        });
        grid(" class=\"grid\"", self.head.iter().map(|name| escape(name)), rows)
    }
}

/// A table of HTML cells that scrolls on narrow screens.
pub(super) fn grid(
    class: &str,
    head: impl Iterator<Item = String>,
    rows: impl Iterator<Item = Vec<String>>,
) -> String {
    let head: String = head.map(|cell| format!("<th>{cell}</th>")).collect();
    let cell = |cell: String| match cell.starts_with("<td") {
        true => cell,
        false => format!("<td>{cell}</td>"),
    };
    let row = |cells: Vec<String>| format!("<tr>{}</tr>", cells.into_iter().map(cell).collect::<String>());
    let rows: String = rows.map(row).collect();
    format!("<div class=\"scroll\"><table{class}><tr>{head}</tr>{rows}</table></div>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_under_one_another_and_are_escaped_on_a_page() {
        let rows = [["canvas", "3.81"], ["silk <a>", "-12.5"]];
        let rows = rows.map(|row| row.map(str::to_owned).to_vec()).to_vec();
        let table = Table::new(&["name", "SD"], rows);
        assert_eq!(table.text(), "  name         SD\n  canvas     3.81\n  silk <a>  -12.5\n");
        let html = table.to_html();
        assert!(html.contains("<tr><td>silk &lt;a&gt;</td><td>\u{2212}12.5</td></tr>"), "{html}");
    }
}
