//! A writer of SVG elements that rounds numbers and escapes text.

use std::fmt::Write as _;

/// An SVG fragment.
#[derive(Debug, Clone, Default)]
pub(crate) struct Svg {
    out: String,
}

/// Horizontal anchor of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// A rectangle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Rect {
    pub x: f64,
    pub y: f64,
    pub width: f64,
    pub height: f64,
}

impl Rect {
    pub(crate) fn right(&self) -> f64 {
        self.x + self.width
    }
    pub(crate) fn bottom(&self) -> f64 {
        self.y + self.height
    }
    /// The rectangle enlarged by `by` on every side.
    pub(crate) fn inflated(&self, by: f64) -> Self {
        Self { x: self.x - by, y: self.y - by, width: self.width + 2.0 * by, height: self.height + 2.0 * by }
    }
}

impl Svg {
    /// A drawing of this width and height with a background.
    pub(crate) fn on_paper((width, height): (f64, f64)) -> Self {
        let mut svg = Self::default();
        let (x, y) = (0.0, 0.0);
        svg.rect("paper", Rect { x, y, width, height }, 0.0);
        svg
    }

    /// The text written so far.
    pub(crate) fn into_text(self) -> String {
        self.out
    }

    /// Writes formatted text without escaping.
    pub(crate) fn raw(&mut self, text: std::fmt::Arguments<'_>) {
        // Writing into a string cannot fail.
        let _ = self.out.write_fmt(text);
        self.out.push('\n');
    }

    /// Writes the output of `draw` as a group with these classes; names and values become data attributes for
    /// programs.
    pub(crate) fn group_of(&mut self, class: &str, what: &[(&str, &str)], draw: impl FnOnce(&mut Self)) {
        self.raw(format_args!("<g class=\"{class}\"{}>", attributes(what)));
        draw(self);
        self.raw(format_args!("</g>"));
    }

    /// Writes the output of `draw` clipped to `to`, in the outer coordinates.
    pub(crate) fn clipped(&mut self, to: Rect, draw: impl FnOnce(&mut Self)) {
        let (x, y, w, h) = (num(to.x), num(to.y), num(to.width), num(to.height));
        self.raw(format_args!(
            "<svg x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" viewBox=\"{x} {y} {w} {h}\">"
        ));
        draw(self);
        self.raw(format_args!("</svg>"));
    }

    pub(crate) fn rect(&mut self, class: &str, at: Rect, radius: f64) {
        let (x, y, w, h, r) = (num(at.x), num(at.y), num(at.width), num(at.height), num(radius));
        self.raw(format_args!(
            "<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" rx=\"{r}\"/>"
        ));
    }

    pub(crate) fn circle(&mut self, class: &str, (x, y): (f64, f64), radius: f64) {
        self.raw(format_args!(
            "<circle class=\"{class}\" cx=\"{}\" cy=\"{}\" r=\"{}\"/>",
            num(x),
            num(y),
            num(radius)
        ));
    }

    pub(crate) fn line(&mut self, class: &str, from: (f64, f64), to: (f64, f64)) {
        let (x1, y1, x2, y2) = (num(from.0), num(from.1), num(to.0), num(to.1));
        self.raw(format_args!("<line class=\"{class}\" x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"/>"));
    }

    pub(crate) fn path(&mut self, class: &str, path: &Path) {
        self.path_of(class, &[], path, "");
    }

    /// A path with data attributes for programs and a tooltip.
    pub(crate) fn path_of(&mut self, class: &str, what: &[(&str, &str)], path: &Path, tooltip: &str) {
        let (what, d) = (attributes(what), path.d.trim_end());
        match tooltip {
            "" => self.raw(format_args!("<path class=\"{class}\"{what} d=\"{d}\"/>")),
            tooltip => self.raw(format_args!(
                "<path class=\"{class}\"{what} d=\"{d}\"><title>{}</title></path>",
                escape(tooltip)
            )),
        }
    }

    pub(crate) fn text(&mut self, class: &str, (x, y): (f64, f64), anchor: Anchor, text: &str) {
        self.raw(format_args!(
            "<text class=\"{class}\" x=\"{}\" y=\"{}\"{}>{}</text>",
            num(x),
            num(y),
            anchor.attribute(),
            escape(text)
        ));
    }

    /// A title followed by a remark.
    pub(crate) fn heading(&mut self, (x, y): (f64, f64), title: &str, remark: &str) {
        let (x, y) = (num(x), num(y));
        let remark = match remark {
            "" => String::new(),
            remark => format!("<tspan class=\"remark-text\" dx=\"10\">{}</tspan>", escape(remark)),
        };
        self.raw(format_args!(
            "<text class=\"title ink\" x=\"{x}\" y=\"{y}\">{}{remark}</text>",
            escape(title)
        ));
    }

    /// Text rotated upwards, centred on a point.
    pub(crate) fn text_upwards(&mut self, class: &str, (x, y): (f64, f64), text: &str) {
        let (x, y) = (num(x), num(y));
        self.raw(format_args!(
            "<text class=\"{class}\" transform=\"translate({x} {y}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            escape(text)
        ));
    }

    /// An image by its URL (here a data URL), stretched over `at`.
    pub(crate) fn image(&mut self, at: Rect, address: &str) {
        let (x, y, w, h) = (num(at.x), num(at.y), num(at.width), num(at.height));
        self.raw(format_args!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" preserveAspectRatio=\"none\" href=\"{address}\"/>"
        ));
    }

    /// Tooltip of the enclosing group.
    pub(crate) fn tooltip(&mut self, text: &str) {
        self.raw(format_args!("<title>{}</title>", escape(text)));
    }

    /// The fragment as an SVG element of this size. `title` is the accessible name; `style` is CSS for a
    /// standalone file and empty within a page.
    pub(crate) fn finish(self, (width, height): (f64, f64), title: &str, style: &str) -> String {
        let (w, h) = (num(width), num(height));
        let style = if style.is_empty() { String::new() } else { format!("<style>{style}</style>\n") };
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"figure\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" \
             height=\"{h}\" role=\"img\">\n<title>{}</title>\n{style}{}</svg>\n",
            escape(title),
            self.out
        )
    }
}

impl Anchor {
    fn attribute(self) -> &'static str {
        match self {
            Self::Start => "",
            Self::Middle => " text-anchor=\"middle\"",
            Self::End => " text-anchor=\"end\"",
        }
    }
}

/// The `d` attribute of a path.
#[derive(Debug, Clone, Default)]
pub(crate) struct Path {
    d: String,
}

impl Path {
    fn push(&mut self, command: char, points: &[(f64, f64)]) {
        self.d.push(command);
        for (x, y) in points {
            let _ = write!(self.d, "{} {} ", num(*x), num(*y));
        }
    }
    pub(crate) fn move_to(&mut self, to: (f64, f64)) {
        self.push('M', &[to]);
    }
    pub(crate) fn line_to(&mut self, to: (f64, f64)) {
        self.push('L', &[to]);
    }
    pub(crate) fn cubic_to(&mut self, first: (f64, f64), second: (f64, f64), to: (f64, f64)) {
        self.push('C', &[first, second, to]);
    }
    pub(crate) fn close(&mut self) {
        self.d.push('Z');
    }
    pub(crate) fn append(&mut self, other: &Self) {
        self.d.push_str(&other.d);
    }
    /// A line of zero length at each point, which a round cap renders as a dot.
    pub(crate) fn dots(points: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut path = Self::default();
        for point in points {
            path.move_to(point);
            path.d.push_str("h0");
        }
        path
    }
    /// Like [`Self::through`] in fewer characters: points after a move are lines.
    pub(crate) fn polyline(points: &[(f64, f64)]) -> Self {
        let mut path = Self::default();
        if !points.is_empty() {
            path.push('M', points);
        }
        path
    }
    /// Straight lines through all points.
    pub(crate) fn through(points: &[(f64, f64)]) -> Self {
        let mut path = Self::default();
        for (i, point) in points.iter().enumerate() {
            if i == 0 { path.move_to(*point) } else { path.line_to(*point) }
        }
        path
    }
}

/// A coordinate with at most two decimals.
pub(crate) fn num(x: f64) -> String {
    if !x.is_finite() {
        return "0".to_owned();
    }
    let text = format!("{x:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn attributes(what: &[(&str, &str)]) -> String {
    let one = |(name, value): &(&str, &str)| format!(" {name}=\"{}\"", escape(value));
    what.iter().map(one).collect()
}

/// Escapes text for XML and HTML and drops control characters.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\n' | '\t' => out.push(c),
            c if c.is_control() => {}
            c => out.push(c),
        }
    }
    out
}

/// Approximate width of text in a proportional font, by classes of letters.
pub(crate) fn text_width(text: &str, size_px: f64) -> f64 {
    let em = |c: char| match c {
        'i' | 'j' | 'l' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' | ' ' => 0.32,
        'f' | 't' | 'r' | '(' | ')' | '/' | '-' => 0.40,
        'm' | 'w' | 'M' | 'W' | '%' | '@' => 0.92,
        c if c.is_ascii_uppercase() => 0.70,
        _ => 0.61,
    };
    text.chars().map(em).sum::<f64>() * size_px
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short_and_always_numbers() {
        assert_eq!(num(1.0), "1");
        assert_eq!(num(-0.001), "0");
        assert_eq!(num(2.504), "2.5");
        assert_eq!(num(f64::NAN), "0");
    }

    #[test]
    fn no_text_can_break_out_of_its_element() {
        assert_eq!(escape("a<b>&\"\u{1b}[0m"), "a&lt;b&gt;&amp;&quot;[0m");
    }
}
