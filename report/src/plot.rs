//! Plots: a frame with two axes and marks. A plot is data; `Plot::to_figure` renders it for a page.

mod figure;
mod marks;

use super::scale::{Scale, padded};
use super::svg::{Anchor, Rect, Svg, num, text_width};
use super::theme::{self, Ink};
use super::thinning::Envelope;
use marks::{draw_colours, draw_grid, draw_mark, draw_words};

pub use super::raster::Grid as Cells;
pub use super::scale::Spread;

/// A plot.
///
/// ```
/// use haptograph_report::plot::{Axis, Mark, Plot, Style};
/// use haptograph_report::theme::Ink;
///
/// let points = (0..100).map(|k| (f64::from(k), f64::from(k * k))).collect();
/// let plot = Plot {
///     title: "Growth".to_owned(),
///     x: Axis::of("Time (s)"),
///     y: Axis::of("Distance (m)").over(0.0, 10_000.0),
///     marks: vec![Mark::Line(Style::named(Ink::Blue, "square"), points)],
///     ..Plot::default()
/// };
/// assert!(plot.to_standalone_svg().starts_with("<svg"));
/// ```
#[derive(Debug, Clone, Default)]
pub struct Plot {
    /// Title above the frame.
    pub title: String,
    /// Remark beside the title, for example `simulated`.
    pub note: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// The marks, drawn in this order.
    pub marks: Vec<Mark>,
    /// Width and height in pixels; 0 selects the default. On a page the width is that of the page.
    pub size: (f64, f64),
    /// Width of the frame by its height, on a page, for plots with one scale on both axes.
    pub aspect: Option<f64>,
    /// Caption below the frame on a page.
    pub caption: String,
}

/// An axis.
#[derive(Debug, Clone, Default)]
pub struct Axis {
    /// Label with unit: `Force (N)`.
    pub label: String,
    /// Smallest and largest value; `None` fits the marks.
    pub range: Option<(f64, f64)>,
    /// Linear or logarithmic.
    pub spread: Spread,
    /// Names at values, in place of numbers.
    pub names: Vec<(f64, String)>,
    /// True for the time of the run.
    pub is_time: bool,
}

/// A drawn element.
#[derive(Debug, Clone)]
pub enum Mark {
    /// A curve through points, interrupted at points that are not finite.
    Line(Style, Vec<(f64, f64)>),
    /// The area between two curves: (x, low, high).
    Band(Style, Vec<(f64, f64, f64)>),
    /// A dot at each point.
    Dots(Style, Vec<(f64, f64)>),
    /// A bar from zero at each point, with this width in units of x.
    Bars(Style, Vec<(f64, f64)>, f64),
    /// Separate straight lines.
    Segments(Style, Vec<[(f64, f64); 2]>),
    /// Closed shapes, filled with the tint.
    Areas(Style, Vec<Vec<(f64, f64)>>),
    /// An image of cells with a colour scale beside the frame.
    Image(Image),
    /// A text at each point.
    Words(Vec<(f64, f64, String)>),
}

/// Cells shown as colours.
#[derive(Debug, Clone)]
pub struct Image {
    /// The values.
    pub cells: Cells,
    /// Horizontal range.
    pub x: (f64, f64),
    /// Vertical range.
    pub y: (f64, f64),
    /// Values of the darkest and the brightest colour.
    pub colours: (f64, f64),
    /// Label of the values, with unit.
    pub label: String,
}

/// Style of a mark.
#[derive(Debug, Clone, PartialEq)]
pub struct Style {
    /// The colour.
    pub ink: Ink,
    /// Name in the legend; empty to omit it.
    pub name: String,
    /// The weight.
    pub weight: Weight,
}

/// Line weight or dot size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weight {
    /// Thin or small.
    Hair,
    /// Default.
    #[default]
    Normal,
    /// Thick or large.
    Bold,
    /// Dashed.
    Dashed,
}

impl Style {
    /// A mark without a name.
    pub fn of(ink: Ink) -> Self {
        Self { ink, name: String::new(), weight: Weight::Normal }
    }
    /// A mark with a name in the legend.
    pub fn named(ink: Ink, name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::of(ink) }
    }
    /// Sets the weight.
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
    /// An axis that fits the marks.
    pub fn of(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }
    /// Sets a fixed range.
    #[must_use]
    pub fn over(self, low: f64, high: f64) -> Self {
        Self { range: Some((low, high)), ..self }
    }
    /// Makes the axis logarithmic.
    #[must_use]
    pub fn log(self) -> Self {
        Self { spread: Spread::Log, ..self }
    }
    /// Sets names in place of numbers.
    #[must_use]
    pub fn named(self, names: impl IntoIterator<Item = (f64, String)>) -> Self {
        Self { names: names.into_iter().collect(), ..self }
    }
}

impl Mark {
    /// A signal over time: its samples if it is short, the area between its extremes if it is long. `show`
    /// converts SI values to the axis.
    pub fn signal(style: Style, envelope: &Envelope, show: impl Fn(f64) -> f64) -> Self {
        let points = envelope.points();
        if envelope.is_exact() {
            Self::Line(style, points.map(|(t, v, _)| (t, show(v))).collect())
        } else {
            Self::Band(style, points.map(|(t, l, h)| (t, show(l), show(h))).collect())
        }
    }

    /// The same for samples at a rate.
    pub fn samples(style: Style, rate_hz: f64, samples: &[f64], factor: f64) -> Self {
        let mut envelope = Envelope::new(rate_hz);
        envelope.extend(samples.iter().copied());
        Self::signal(style, &envelope, |value| value * factor)
    }

    fn style(&self) -> Option<&Style> {
        match self {
            Self::Line(style, _) | Self::Band(style, _) | Self::Dots(style, _) => Some(style),
            Self::Bars(style, ..) | Self::Segments(style, _) | Self::Areas(style, _) => Some(style),
            Self::Image(_) | Self::Words(_) => None,
        }
    }

    /// The points that the axes must contain.
    fn extent(&self) -> Box<dyn Iterator<Item = (f64, f64)> + '_> {
        match self {
            Self::Line(_, points) | Self::Dots(_, points) => Box::new(points.iter().copied()),
            Self::Band(_, points) => Box::new(points.iter().flat_map(|(x, l, h)| [(*x, *l), (*x, *h)])),
            Self::Bars(_, points, width) => {
                let half = width / 2.0;
                Box::new(points.iter().flat_map(move |(x, y)| [(x - half, 0.0), (x + half, *y)]))
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
    /// The plot as a standalone SVG file.
    pub fn to_standalone_svg(&self) -> String {
        self.draw(&(theme::css() + theme::DOTS))
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
        // The height of the frame hardly depends on the width of the labels beside it.
        let room = size.0 - self.left_margin(size.1 - 34.0 - bottom) - right;
        let crowded = heading_width(&self.title, &self.note) + self.legend_width() > room;
        let top = match (self.title.is_empty(), crowded) {
            (true, _) => 14.0,
            (false, false) => 34.0,
            (false, true) => 52.0,
        };
        let left = self.left_margin(size.1 - top - bottom);
        let frame = Rect { x: left, y: top, width: size.0 - left - right, height: size.1 - top - bottom };
        let (x, y) = self.scales(frame);
        let mut svg = Svg::on_paper(size);
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
                draw_words(svg, mark, &|a, b| (num(x.pixel(a)), num(y.pixel(b))));
            }
        });
        self.draw_axes(&mut svg, frame, &x, &y);
        if let Some(image) = image {
            draw_colours(&mut svg, frame, image);
        }
        svg.finish(size, &self.title, style)
    }

    /// Width of the vertical axis: its longest tick and its label.
    fn left_margin(&self, height: f64) -> f64 {
        let label = if self.y.label.is_empty() { 0.0 } else { 20.0 };
        // Plots below each other share their left edge unless a tick label is wider.
        (self.widest_tick(height) + 12.0 + label).max(if self.y.label.is_empty() { 40.0 } else { 66.0 })
    }

    /// Width of the longest tick label of the vertical axis.
    fn widest_tick(&self, height: f64) -> f64 {
        let (low, high) = self.range(&self.y, 1);
        let scale = Scale { low, high, from: height, to: 0.0, spread: self.y.spread };
        let ticks = Self::ticks(&self.y, &scale, height);
        let widths = ticks.iter().map(|(_, text)| text_width(text, 10.0));
        widths.fold(0.0, f64::max)
    }

    fn range(&self, axis: &Axis, which: usize) -> (f64, f64) {
        let usable = |(low, high): &(f64, f64)| {
            low < high && low.is_finite() && high.is_finite() && (axis.spread == Spread::Linear || *low > 0.0)
        };
        if let Some(range) = axis.range.filter(usable) {
            return range;
        }
        let values = self.marks.iter().flat_map(Mark::extent).map(|p| if which == 0 { p.0 } else { p.1 });
        if which == 0 && axis.spread == Spread::Linear {
            // Time and similar quantities fill the frame to its edges.
            let (low, high) = values
                .filter(|v| v.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            if low < high {
                return (low, high);
            }
            return padded([low].into_iter(), axis.spread);
        }
        padded(values, axis.spread)
    }

    fn scales(&self, frame: Rect) -> (Scale, Scale) {
        let ((x_low, x_high), (y_low, y_high)) = (self.range(&self.x, 0), self.range(&self.y, 1));
        let x = Scale { low: x_low, high: x_high, from: frame.x, to: frame.right(), spread: self.x.spread };
        let y = Scale { low: y_low, high: y_high, from: frame.bottom(), to: frame.y, spread: self.y.spread };
        (x, y)
    }

    fn ticks(axis: &Axis, scale: &Scale, pixels: f64) -> Vec<(f64, String)> {
        if !axis.names.is_empty() {
            return axis.names.clone();
        }
        // The horizontal axis has the direction of the pixels, the vertical one the opposite.
        let room = if scale.from < scale.to { 80.0 } else { 28.0 };
        let most = ((pixels / room) as usize).clamp(2, 12);
        scale.ticks(most).into_iter().map(|tick| (tick.value, tick.text)).collect()
    }

    /// The marks with a name.
    fn named(&self) -> impl DoubleEndedIterator<Item = (&Mark, &Style)> {
        let named = |mark| Some((mark, Mark::style(mark)?)).filter(|(_, style)| !style.name.is_empty());
        self.marks.iter().filter_map(named)
    }

    fn legend_width(&self) -> f64 {
        self.named().map(|(_, style)| text_width(&style.name, 10.0) + 30.0).sum()
    }

    /// The title with the legend beside it, or below it if both do not fit in a line.
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
            svg.text("small soft", (x.pixel(value), frame.bottom() + 15.0), Anchor::Middle, &text);
        }
        for (value, text) in Self::ticks(&self.y, y, frame.height) {
            svg.text("small soft", (frame.x - 7.0, y.pixel(value) + 3.5), Anchor::End, &text);
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

pub(super) fn heading_width(title: &str, note: &str) -> f64 {
    text_width(title, 13.0) * 1.06 + text_width(note, 10.0) + 10.0
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
                let x = Axis { spread, ..Axis::of("x & y") };
                let plot = Plot {
                    title: "a < b".into(),
                    x: x.clone(),
                    y: x,
                    marks: marks.clone(),
                    ..Plot::default()
                };
                for text in [plot.to_standalone_svg(), plot.to_figure()] {
                    assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
                    roxmltree::Document::parse(&text).unwrap();
                }
            }
        }
    }
}
