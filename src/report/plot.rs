//! Plots: a frame with two axes and marks in it. A plot is data; [`Plot::to_svg`] draws it.

use super::raster::Grid;
use super::scale::{Scale, padded};
use super::svg::{Anchor, Path, Rect, Svg, num, text_width};
use super::theme::{self, Ink};
use super::thinning::Envelope;

pub use super::raster::Grid as Cells;
pub use super::scale::Spread;

/// A plot.
#[derive(Debug, Clone, Default)]
pub struct Plot {
    /// What is seen, above the frame.
    pub title: String,
    /// A remark beside the title; `simulated` goes here.
    pub note: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// What is drawn, the first at the bottom.
    pub marks: Vec<Mark>,
    /// Width and height in pixels; 0: the usual.
    pub size: (f64, f64),
}

/// An axis.
#[derive(Debug, Clone, Default)]
pub struct Axis {
    /// What it shows, with its unit: `Force (N)`.
    pub label: String,
    /// Smallest and largest value; `None`: as the marks need.
    pub range: Option<(f64, f64)>,
    /// Linear or logarithmic.
    pub spread: Spread,
    /// Names at values, in place of numbers.
    pub names: Vec<(f64, String)>,
}

/// Something drawn in the frame.
#[derive(Debug, Clone)]
pub enum Mark {
    /// A curve through points; a point that is not finite interrupts it.
    Line(Style, Vec<(f64, f64)>),
    /// The area between two curves: (x, low, high).
    Band(Style, Vec<(f64, f64, f64)>),
    /// A dot at each point.
    Dots(Style, Vec<(f64, f64)>),
    /// A bar from zero at each point, this wide in units of x.
    Bars(Style, Vec<(f64, f64)>, f64),
    /// Separate straight lines.
    Segments(Style, Vec<[(f64, f64); 2]>),
    /// Closed shapes, filled with the tint.
    Areas(Style, Vec<Vec<(f64, f64)>>),
    /// A picture of cells over (x from, x to), (y from, y to), with a scale of colours beside the frame.
    Image(Image),
    /// A word at each point.
    Words(Vec<(f64, f64, String)>),
}

/// Cells as colours.
#[derive(Debug, Clone)]
pub struct Image {
    /// The values.
    pub cells: Grid,
    /// What they span horizontally.
    pub x: (f64, f64),
    /// What they span vertically.
    pub y: (f64, f64),
    /// Values of the darkest and the brightest colour.
    pub colours: (f64, f64),
    /// What the values are, with their unit.
    pub label: String,
}

/// How a mark looks.
#[derive(Debug, Clone, PartialEq)]
pub struct Style {
    /// Its colour.
    pub ink: Ink,
    /// Its name in the legend; empty: not in it.
    pub name: String,
    /// Its weight.
    pub weight: Weight,
}

/// How strongly a mark shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weight {
    /// Thin or small.
    Hair,
    /// The usual.
    #[default]
    Normal,
    /// Thick or large.
    Bold,
    /// Dashed.
    Dashed,
}

impl Style {
    /// A nameless mark.
    pub fn of(ink: Ink) -> Self {
        Self {
            ink,
            name: String::new(),
            weight: Weight::Normal,
        }
    }
    /// A mark with its name in the legend.
    pub fn named(ink: Ink, name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            ..Self::of(ink)
        }
    }
    /// The same with another weight.
    #[must_use]
    pub fn weight(self, weight: Weight) -> Self {
        Self { weight, ..self }
    }

    fn curve_class(&self) -> String {
        let weight = match self.weight {
            Weight::Hair => " hair",
            Weight::Normal => "",
            Weight::Bold => " bold",
            Weight::Dashed => " dash",
        };
        format!("curve s{}{weight}", self.ink.class())
    }
}

impl Axis {
    /// An axis as wide as the marks need.
    pub fn of(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            ..Self::default()
        }
    }
    /// The same over a fixed range.
    #[must_use]
    pub fn over(self, low: f64, high: f64) -> Self {
        Self {
            range: Some((low, high)),
            ..self
        }
    }
    /// The same with a logarithmic spread.
    #[must_use]
    pub fn log(self) -> Self {
        Self {
            spread: Spread::Log,
            ..self
        }
    }
    /// The same with names in place of numbers.
    #[must_use]
    pub fn named(self, names: impl IntoIterator<Item = (f64, String)>) -> Self {
        Self {
            names: names.into_iter().collect(),
            ..self
        }
    }
}

impl Mark {
    /// A signal over time: its samples where it is short, the area between its extremes where it is long. Values are
    /// multiplied by `factor`, the way from SI to the axis.
    pub fn signal(style: Style, envelope: &Envelope, factor: f64) -> Self {
        if envelope.is_exact() {
            Self::Line(
                style,
                envelope.points().map(|(t, v, _)| (t, v * factor)).collect(),
            )
        } else {
            Self::Band(
                style,
                envelope
                    .points()
                    .map(|(t, l, h)| (t, l * factor, h * factor))
                    .collect(),
            )
        }
    }

    fn style(&self) -> Option<&Style> {
        match self {
            Self::Line(style, _) | Self::Band(style, _) | Self::Dots(style, _) => Some(style),
            Self::Bars(style, ..) | Self::Segments(style, _) | Self::Areas(style, _) => Some(style),
            Self::Image(_) | Self::Words(_) => None,
        }
    }

    /// The points that the axes have to hold.
    fn extent(&self) -> Box<dyn Iterator<Item = (f64, f64)> + '_> {
        match self {
            Self::Line(_, points) | Self::Dots(_, points) => Box::new(points.iter().copied()),
            Self::Band(_, points) => Box::new(points.iter().flat_map(|(x, l, h)| [(*x, *l), (*x, *h)])),
            Self::Bars(_, points, width) => {
                let half = width / 2.0;
                Box::new(
                    points
                        .iter()
                        .flat_map(move |(x, y)| [(x - half, 0.0), (x + half, *y)]),
                )
            }
            Self::Segments(_, segments) => Box::new(segments.iter().flatten().copied()),
            Self::Areas(_, areas) => Box::new(areas.iter().flatten().copied()),
            Self::Image(image) => Box::new([(image.x.0, image.y.0), (image.x.1, image.y.1)].into_iter()),
            Self::Words(words) => Box::new(words.iter().map(|(x, y, _)| (*x, *y))),
        }
    }
}

const USUAL_SIZE: (f64, f64) = (760.0, 210.0);

impl Plot {
    /// The plot as an SVG element for a page that has the style sheet.
    pub fn to_svg(&self) -> String {
        self.draw("")
    }

    /// The plot as a picture of its own.
    pub fn to_standalone_svg(&self) -> String {
        self.draw(&theme::css())
    }

    fn size(&self) -> (f64, f64) {
        let or = |given: f64, usual: f64| if given > 0.0 { given } else { usual };
        (or(self.size.0, USUAL_SIZE.0), or(self.size.1, USUAL_SIZE.1))
    }

    fn draw(&self, style: &str) -> String {
        let size = self.size();
        let image = self.marks.iter().find_map(|mark| match mark {
            Mark::Image(image) => Some(image),
            _ => None,
        });
        let right = if image.is_some() { 86.0 } else { 18.0 };
        let bottom = if self.x.label.is_empty() { 26.0 } else { 44.0 };
        // How high the frame is has little to do with how wide the names at its side are.
        let room = size.0 - self.left_margin(size.1 - 34.0 - bottom) - right;
        let crowded = heading_width(&self.title, &self.note) + self.legend_width() > room;
        let top = match (self.title.is_empty(), crowded) {
            (true, _) => 14.0,
            (false, false) => 34.0,
            (false, true) => 52.0,
        };
        let left = self.left_margin(size.1 - top - bottom);
        let frame = Rect {
            x: left,
            y: top,
            width: size.0 - left - right,
            height: size.1 - top - bottom,
        };
        let (x, y) = self.scales(frame);
        let mut svg = Svg::default();
        svg.rect(
            "paper",
            Rect {
                x: 0.0,
                y: 0.0,
                width: size.0,
                height: size.1,
            },
            0.0,
        );
        self.draw_head(&mut svg, frame);
        draw_grid(
            &mut svg,
            frame,
            &Self::ticks(&self.x, &x, frame.width),
            &Self::ticks(&self.y, &y, frame.height),
            (&x, &y),
        );
        svg.clipped(frame, |svg| {
            for mark in &self.marks {
                draw_mark(svg, mark, &x, &y);
            }
        });
        self.draw_axes(&mut svg, frame, &x, &y);
        if let Some(image) = image {
            draw_colours(&mut svg, frame, image);
        }
        svg.finish(size, &self.title, style)
    }

    /// Room for the vertical axis: its longest tick and its label.
    fn left_margin(&self, height: f64) -> f64 {
        let (low, high) = self.range(&self.y, 1);
        let scale = Scale {
            low,
            high,
            from: height,
            to: 0.0,
            spread: self.y.spread,
        };
        let ticks = Self::ticks(&self.y, &scale, height);
        let widest = ticks
            .iter()
            .map(|(_, text)| text_width(text, 10.0))
            .fold(0.0, f64::max);
        let label = if self.y.label.is_empty() { 0.0 } else { 20.0 };
        // Plots under one another share their left edge unless a number needs more.
        (widest + 12.0 + label).max(if self.y.label.is_empty() { 40.0 } else { 66.0 })
    }

    fn range(&self, axis: &Axis, which: usize) -> (f64, f64) {
        let usable = |(low, high): &(f64, f64)| {
            low < high && low.is_finite() && high.is_finite() && (axis.spread == Spread::Linear || *low > 0.0)
        };
        if let Some(range) = axis.range.filter(usable) {
            return range;
        }
        let values = self
            .marks
            .iter()
            .flat_map(Mark::extent)
            .map(|p| if which == 0 { p.0 } else { p.1 });
        if which == 0 && axis.spread == Spread::Linear {
            // Time and the like fill the frame to its edges.
            let (low, high) = values
                .filter(|v| v.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
                    (l.min(v), h.max(v))
                });
            if low < high {
                return (low, high);
            }
            return padded([low].into_iter(), axis.spread);
        }
        padded(values, axis.spread)
    }

    fn scales(&self, frame: Rect) -> (Scale, Scale) {
        let ((x_low, x_high), (y_low, y_high)) = (self.range(&self.x, 0), self.range(&self.y, 1));
        let x = Scale {
            low: x_low,
            high: x_high,
            from: frame.x,
            to: frame.right(),
            spread: self.x.spread,
        };
        let y = Scale {
            low: y_low,
            high: y_high,
            from: frame.bottom(),
            to: frame.y,
            spread: self.y.spread,
        };
        (x, y)
    }

    fn ticks(axis: &Axis, scale: &Scale, pixels: f64) -> Vec<(f64, String)> {
        if !axis.names.is_empty() {
            return axis.names.clone();
        }
        // The horizontal axis runs with the pixels, the vertical one against them.
        let room = if scale.from < scale.to { 80.0 } else { 28.0 };
        let most = ((pixels / room) as usize).clamp(2, 12);
        scale
            .ticks(most)
            .into_iter()
            .map(|tick| (tick.value, tick.text))
            .collect()
    }

    /// The marks that have a name.
    fn named(&self) -> impl DoubleEndedIterator<Item = (&Mark, &Style)> {
        let named = |mark| Some((mark, Mark::style(mark)?)).filter(|(_, style)| !style.name.is_empty());
        self.marks.iter().filter_map(named)
    }

    fn legend_width(&self) -> f64 {
        self.named()
            .map(|(_, style)| text_width(&style.name, 10.0) + 30.0)
            .sum()
    }

    /// The heading, and the legend beside it, or under it where both do not fit in a line.
    fn draw_head(&self, svg: &mut Svg, frame: Rect) {
        svg.heading((frame.x, 18.0), &self.title, &self.note);
        let line = (frame.y - 16.0).max(14.0);
        let mut x = frame.right();
        for (mark, style) in self.named().rev() {
            x -= text_width(&style.name, 10.0);
            svg.text("small soft", (x, line), Anchor::Start, &style.name);
            x -= 18.0;
            if matches!(mark, Mark::Dots(..)) {
                svg.circle(&format!("f{}", style.ink.class()), (x + 7.0, line - 3.5), 3.5);
            } else {
                let class = style.curve_class().replace(" hair", "");
                svg.line(&class, (x, line - 3.5), (x + 13.0, line - 3.5));
            }
            x -= 12.0;
        }
    }

    fn draw_axes(&self, svg: &mut Svg, frame: Rect, x: &Scale, y: &Scale) {
        svg.rect("axis", frame, 0.0);
        for (value, text) in Self::ticks(&self.x, x, frame.width) {
            svg.text(
                "small soft",
                (x.pixel(value), frame.bottom() + 15.0),
                Anchor::Middle,
                &text,
            );
        }
        for (value, text) in Self::ticks(&self.y, y, frame.height) {
            svg.text(
                "small soft",
                (frame.x - 7.0, y.pixel(value) + 3.5),
                Anchor::End,
                &text,
            );
        }
        if !self.x.label.is_empty() {
            let at = (frame.x + frame.width / 2.0, frame.bottom() + 34.0);
            svg.text("soft", at, Anchor::Middle, &self.x.label);
        }
        if !self.y.label.is_empty() {
            svg.text_upwards("soft", (14.0, frame.y + frame.height / 2.0), &self.y.label);
        }
    }
}

fn heading_width(title: &str, note: &str) -> f64 {
    text_width(title, 13.0) * 1.06 + text_width(note, 10.0) + 10.0
}

fn draw_grid(
    svg: &mut Svg,
    frame: Rect,
    xs: &[(f64, String)],
    ys: &[(f64, String)],
    (x, y): (&Scale, &Scale),
) {
    for (value, _) in xs {
        let at = x.pixel(*value);
        svg.line("grid", (at, frame.y), (at, frame.bottom()));
    }
    for (value, _) in ys {
        let at = y.pixel(*value);
        svg.line("grid", (frame.x, at), (frame.right(), at));
    }
}

fn draw_mark(svg: &mut Svg, mark: &Mark, x: &Scale, y: &Scale) {
    let at = |(a, b): (f64, f64)| (x.pixel(a), y.pixel(b));
    match mark {
        Mark::Line(style, points) => {
            let points: Vec<_> = points.iter().map(|p| at(*p)).collect();
            svg.path(&style.curve_class(), &curve(&points));
        }
        Mark::Band(style, points) => {
            let upper = points.iter().map(|(a, _, high)| at((*a, *high)));
            let lower = points.iter().rev().map(|(a, low, _)| at((*a, *low)));
            let outline: Vec<_> = upper
                .chain(lower)
                .filter(|p| p.0.is_finite() && p.1.is_finite())
                .collect();
            let mut path = Path::through(&outline);
            path.close();
            svg.path(&format!("s{0} f{0} hair", style.ink.class()), &path);
        }
        Mark::Dots(style, points) => {
            let (radius, veil) = match style.weight {
                Weight::Hair => (1.4, " veil"),
                Weight::Bold => (4.5, ""),
                Weight::Normal | Weight::Dashed => (2.6, " solid"),
            };
            svg.group(&format!("f{}{veil}", style.ink.class()), |svg| {
                for point in points
                    .iter()
                    .map(|p| at(*p))
                    .filter(|p| p.0.is_finite() && p.1.is_finite())
                {
                    let (cx, cy, r) = (num(point.0), num(point.1), num(radius));
                    svg.raw(format_args!("<circle cx=\"{cx}\" cy=\"{cy}\" r=\"{r}\"/>"));
                }
            });
        }
        Mark::Bars(style, points, width) => {
            for (a, b) in points {
                let (corner, foot) = (
                    at((a - width / 2.0, b.max(0.0))),
                    at((a + width / 2.0, b.min(0.0))),
                );
                let bar = Rect {
                    x: corner.0,
                    y: corner.1,
                    width: foot.0 - corner.0,
                    height: foot.1 - corner.1,
                };
                svg.rect(&format!("f{} solid", style.ink.class()), bar, 1.5);
            }
        }
        Mark::Segments(style, segments) => {
            let mut path = Path::default();
            for [a, b] in segments {
                path.move_to(at(*a));
                path.line_to(at(*b));
            }
            svg.path(&style.curve_class(), &path);
        }
        Mark::Areas(style, areas) => {
            let mut path = Path::default();
            for area in areas {
                let points: Vec<_> = area.iter().map(|p| at(*p)).collect();
                path.append(&Path::through(&points));
                path.close();
            }
            svg.path(&format!("t{0} s{0} hair", style.ink.class()), &path);
        }
        Mark::Image(image) => {
            let (low, high) = (at((image.x.0, image.y.0)), at((image.x.1, image.y.1)));
            let area = Rect {
                x: low.0,
                y: high.1,
                width: high.0 - low.0,
                height: low.1 - high.1,
            };
            svg.image(area, &image.cells.to_address(image.colours.0, image.colours.1));
        }
        Mark::Words(words) => {
            for (a, b, word) in words {
                let (px, py) = at((*a, *b));
                svg.text("small ink halo", (px, py + 3.5), Anchor::Middle, word);
            }
        }
    }
}

/// A curve that is interrupted where a point is not finite, without points that nobody would see.
fn curve(points: &[(f64, f64)]) -> Path {
    let mut path = Path::default();
    let mut previous: Option<(f64, f64)> = None;
    for (i, point) in points.iter().enumerate() {
        if !(point.0.is_finite() && point.1.is_finite()) {
            previous = None;
            continue;
        }
        match previous {
            None => path.move_to(*point),
            Some(last) => {
                let near = (point.0 - last.0).abs() < 0.25 && (point.1 - last.1).abs() < 0.25;
                if near && i + 1 < points.len() {
                    continue;
                }
                path.line_to(*point);
            }
        }
        previous = Some(*point);
    }
    path
}

/// The colours of an image with their values, right of the frame.
fn draw_colours(svg: &mut Svg, frame: Rect, image: &Image) {
    let bar = Rect {
        x: frame.right() + 12.0,
        y: frame.y,
        width: 10.0,
        height: frame.height,
    };
    let steps: Vec<f64> = (0..64).map(f64::from).collect();
    let cells = Grid {
        width: 1,
        height: steps.len(),
        values: steps,
    };
    svg.image(bar, &cells.to_address(0.0, 63.0));
    let (low, high) = image.colours;
    let scale = Scale {
        low,
        high,
        from: bar.bottom(),
        to: bar.y,
        spread: Spread::Linear,
    };
    for tick in scale.ticks(((frame.height / 34.0) as usize).max(2)) {
        svg.text(
            "small soft",
            (bar.right() + 5.0, scale.pixel(tick.value) + 3.5),
            Anchor::Start,
            &tick.text,
        );
    }
    svg.text_upwards(
        "small soft",
        (frame.right() + 76.0, frame.y + frame.height / 2.0),
        &image.label,
    );
}

/// A matrix of numbers as a map of colours, the smallest of every row framed.
#[derive(Debug, Clone, Default)]
pub struct Matrix {
    /// What is seen.
    pub title: String,
    /// A remark beside the title.
    pub note: String,
    /// Names of the rows, and what they are.
    pub rows: (Vec<String>, String),
    /// Names of the columns, and what they are.
    pub columns: (Vec<String>, String),
    /// Row by row.
    pub values: Vec<Vec<f64>>,
    /// Digits after the point.
    pub digits: usize,
}

impl Matrix {
    /// The matrix as an SVG element for a page that has the style sheet.
    pub fn to_svg(&self) -> String {
        self.draw("")
    }

    /// The matrix as a picture of its own.
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
        let size = (
            (left + columns * cell_width + 16.0).max(head),
            top + rows * cell_height + 14.0,
        );
        let mut svg = Svg::default();
        svg.rect(
            "paper",
            Rect {
                x: 0.0,
                y: 0.0,
                width: size.0,
                height: size.1,
            },
            0.0,
        );
        svg.heading((left, 18.0), &self.title, &self.note);
        svg.text(
            "soft",
            (left + columns * cell_width / 2.0, top - 30.0),
            Anchor::Middle,
            &self.columns.1,
        );
        svg.text_upwards("soft", (14.0, top + rows * cell_height / 2.0), &self.rows.1);
        for (j, name) in self.columns.0.iter().enumerate() {
            svg.text(
                "ink",
                (left + (j as f64 + 0.5) * cell_width, top - 9.0),
                Anchor::Middle,
                name,
            );
        }
        let finite = self.values.iter().flatten().copied().filter(|v| v.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
        for (i, (name, row)) in self.rows.0.iter().zip(&self.values).enumerate() {
            let y = top + i as f64 * cell_height;
            svg.text(
                "ink",
                (left - 9.0, y + cell_height / 2.0 + 4.0),
                Anchor::End,
                name,
            );
            let least = row.iter().copied().fold(f64::INFINITY, f64::min);
            for (j, value) in row.iter().enumerate() {
                let cell = Rect {
                    x: left + j as f64 * cell_width,
                    y,
                    width: cell_width,
                    height: cell_height,
                };
                draw_cell(
                    &mut svg,
                    cell,
                    *value,
                    (value - low) / (high - low),
                    self.digits,
                    *value == least,
                );
            }
        }
        svg.finish(size, &self.title, style)
    }
}

fn draw_cell(svg: &mut Svg, cell: Rect, value: f64, part: f64, digits: usize, framed: bool) {
    // Small is good and light; the darkest colours are left out, so that all numbers can be read.
    let [r, g, b] = theme::heat(0.94 - 0.62 * if part.is_finite() { part } else { 0.0 });
    let inner = cell.inflated(-1.0);
    svg.raw(format_args!(
        "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"3\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>",
        num(inner.x),
        num(inner.y),
        num(inner.width),
        num(inner.height)
    ));
    let text_colour = if part < 0.55 || !part.is_finite() {
        "#1c1230"
    } else {
        "#fff"
    };
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
    fn every_plot_is_well_formed_whatever_is_in_it() {
        let wild = vec![(0.0, f64::NAN), (f64::INFINITY, 1.0), (1.0, -1e300), (2.0, 1e300)];
        for marks in [
            vec![],
            vec![Mark::Line(Style::named(Ink::Blue, "<&>"), wild.clone())],
            vec![
                Mark::Dots(Style::of(Ink::Rose), wild.clone()),
                Mark::Bars(Style::of(Ink::Teal), wild.clone(), 0.5),
            ],
            vec![Mark::Band(Style::of(Ink::Grey), vec![(0.0, f64::NAN, 1.0)])],
        ] {
            for spread in [Spread::Linear, Spread::Log] {
                let x = Axis {
                    spread,
                    ..Axis::of("x & y")
                };
                let plot = Plot {
                    title: "a < b".into(),
                    x: x.clone(),
                    y: x,
                    marks: marks.clone(),
                    ..Plot::default()
                };
                let text = plot.to_standalone_svg();
                assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
                roxmltree::Document::parse(&text).unwrap();
            }
        }
    }

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
