//! A matrix of numbers.

use super::super::svg::{Anchor, Rect, Svg, num, text_width};
use super::super::theme;
use super::heading_width;

/// A matrix of numbers as a heat map, with the smallest value of every row framed.
#[derive(Debug, Clone, Default)]
pub struct Matrix {
    /// Title.
    pub title: String,
    /// Remark beside the title.
    pub note: String,
    /// Names of the rows, and their label.
    pub rows: (Vec<String>, String),
    /// Names of the columns, and their label.
    pub columns: (Vec<String>, String),
    /// Values by row.
    pub values: Vec<Vec<f64>>,
    /// Decimals.
    pub digits: usize,
}

impl Matrix {
    /// The matrix as an SVG element for a page with the style sheet.
    pub fn to_svg(&self) -> String {
        self.draw("")
    }

    /// The matrix as a standalone SVG file.
    pub fn to_standalone_svg(&self) -> String {
        self.draw(&theme::css())
    }

    fn draw(&self, style: &str) -> String {
        let widest = |names: &[String]| names.iter().map(|n| text_width(n, 11.0)).fold(0.0, f64::max);
        let left = widest(&self.rows.0) + if self.rows.1.is_empty() { 16.0 } else { 38.0 };
        let (cell_width, cell_height) = (widest(&self.columns.0).max(48.0) + 8.0, 30.0);
        let top = if self.columns.1.is_empty() { 54.0 } else { 74.0 };
        let (rows, columns) = (self.rows.0.len() as f64, self.columns.0.len() as f64);
        let head = left + heading_width(&self.title, &self.note) + 20.0;
        let size = ((left + columns * cell_width + 16.0).max(head), top + rows * cell_height + 14.0);
        let mut svg = Svg::on_paper(size);
        svg.heading((left, 18.0), &self.title, &self.note);
        svg.text("soft", (left + columns * cell_width / 2.0, top - 30.0), Anchor::Middle, &self.columns.1);
        svg.text_upwards("soft", (14.0, top + rows * cell_height / 2.0), &self.rows.1);
        for (j, name) in self.columns.0.iter().enumerate() {
            svg.text("ink", (left + (j as f64 + 0.5) * cell_width, top - 9.0), Anchor::Middle, name);
        }
        let finite = self.values.iter().flatten().copied().filter(|v| v.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        for (i, (name, row)) in self.rows.0.iter().zip(&self.values).enumerate() {
            let y = top + i as f64 * cell_height;
            svg.text("ink", (left - 9.0, y + cell_height / 2.0 + 4.0), Anchor::End, name);
            let least = row.iter().copied().fold(f64::INFINITY, f64::min);
            for (j, value) in row.iter().enumerate() {
                let cell =
                    Rect { x: left + j as f64 * cell_width, y, width: cell_width, height: cell_height };
                draw_cell(&mut svg, cell, *value, (value - low) / (high - low), self.digits, *value == least);
            }
        }
        svg.finish(size, &self.title, style)
    }
}

fn draw_cell(svg: &mut Svg, cell: Rect, value: f64, part: f64, digits: usize, framed: bool) {
    // Small values are good and light; the darkest colours are not used, so that all numbers are legible.
    let [r, g, b] = theme::heat(0.94 - 0.62 * if part.is_finite() { part } else { 0.0 });
    let inner = cell.inflated(-1.0);
    svg.raw(format_args!(
        "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"3\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>",
        num(inner.x),
        num(inner.y),
        num(inner.width),
        num(inner.height)
    ));
    let text_colour = if part < 0.55 || !part.is_finite() { "#1c1230" } else { "#fff" };
    let strength = if framed { " font-weight=\"700\"" } else { "" };
    svg.raw(format_args!(
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" fill=\"{text_colour}\"{strength}>{value:.digits$}</text>",
        num(cell.x + cell.width / 2.0),
        num(cell.y + cell.height / 2.0 + 4.0)
    ));
    if framed {
        let mark = cell.inflated(-2.0);
        svg.raw(format_args!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"2.5\" fill=\"none\" stroke=\"#1c1230\" \
             stroke-width=\"1.6\"/>",
            num(mark.x),
            num(mark.y),
            num(mark.width),
            num(mark.height)
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_of_a_row_is_framed() {
        let names = || vec!["a".to_owned(), "b".to_owned()];
        let matrix = Matrix {
            rows: (names(), "test".into()),
            columns: (names(), "model".into()),
            values: vec![vec![1.0, 2.0], vec![4.0, 3.0]],
            digits: 1,
            ..Matrix::default()
        };
        assert_eq!(matrix.to_svg().matches("stroke-width=\"1.6\"").count(), 2);
    }
}
