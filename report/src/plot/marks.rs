//! Rendering of the marks of a plot.

use super::super::raster::Grid;
use super::super::scale::{Scale, Spread};
use super::super::svg::{Anchor, Path, Rect, Svg, escape};
use super::{Image, Mark, Style, Weight};

pub(super) fn draw_grid(
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

pub(super) fn draw_mark(svg: &mut Svg, mark: &Mark, x: &Scale, y: &Scale) {
    let at = |(a, b): (f64, f64)| (x.pixel(a), y.pixel(b));
    match mark {
        Mark::Line(style, points) => {
            let points: Vec<_> = points.iter().map(|p| at(*p)).collect();
            svg.path(&style.curve_class(), &curve(&points));
        }
        Mark::Band(style, points) => band(svg, style, points, &at),
        Mark::Dots(style, points) => {
            let size = match style.weight {
                Weight::Hair => "small-dot veil",
                Weight::Bold => "large-dot",
                Weight::Normal | Weight::Dashed => "dot solid",
            };
            let finite = points.iter().map(|p| at(*p)).filter(|p| p.0.is_finite() && p.1.is_finite());
            let mut dots: Vec<(f64, f64)> = finite.map(tenths).collect();
            dots.dedup();
            let dots = Path::dots(dots.into_iter());
            svg.path(&format!("{size} s{}", style.ink.class()), &dots);
        }
        Mark::Bars(style, points, width) => {
            for (a, b) in points {
                let (corner, foot) = (at((a - width / 2.0, b.max(0.0))), at((a + width / 2.0, b.min(0.0))));
                let bar =
                    Rect { x: corner.0, y: corner.1, width: foot.0 - corner.0, height: foot.1 - corner.1 };
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
            let area = Rect { x: low.0, y: high.1, width: high.0 - low.0, height: low.1 - high.1 };
            svg.image(area, &image.cells.to_address(image.colours.0, image.colours.1));
        }
        Mark::Words(_) => {}
    }
}

/// The texts of a mark; `at` maps their positions.
pub(super) fn draw_words(svg: &mut Svg, mark: &Mark, at: &dyn Fn(f64, f64) -> (String, String)) {
    let Mark::Words(words) = mark else { return };
    for (a, b, word) in words {
        let (x, y) = at(*a, *b);
        svg.raw(format_args!(
            "<text class=\"small ink halo\" x=\"{x}\" y=\"{y}\" dy=\"3.5\" text-anchor=\"middle\">{}</text>",
            escape(word)
        ));
    }
}

/// The area between two edges, drawn as a curve if they coincide everywhere.
fn band(svg: &mut Svg, style: &Style, points: &[(f64, f64, f64)], at: &dyn Fn((f64, f64)) -> (f64, f64)) {
    let edge = |of: &dyn Fn(&(f64, f64, f64)) -> f64| -> Vec<(f64, f64)> {
        let edge = points.iter().map(|point| at((point.0, of(point))));
        edge.filter(|p| p.0.is_finite() && p.1.is_finite()).collect()
    };
    let (upper, lower) = (edge(&|point| point.2), edge(&|point| point.1));
    let apart = upper.iter().zip(&lower).map(|(a, b)| (a.1 - b.1).abs());
    if upper.len() == lower.len() && apart.fold(0.0, f64::max) < THIN {
        let middle = upper.iter().zip(&lower).map(|(a, b)| (a.0, 0.5 * (a.1 + b.1)));
        let middle: Vec<_> = middle.collect();
        return svg.path(&style.curve_class(), &Path::polyline(&straightened(&middle)));
    }
    let mut back = straightened(&lower);
    back.reverse();
    let outline: Vec<_> = straightened(&upper).into_iter().chain(back).collect();
    let mut path = Path::polyline(&outline);
    path.close();
    svg.path(&format!("band s{0} f{0} hair", style.ink.class()), &path);
}

/// Bands thinner than this are drawn as curves; points closer than this to the line between their neighbours
/// are omitted. Pixels.
const THIN: f64 = 0.4;
const STRAIGHT: f64 = 0.12;

/// A curve, interrupted at points that are not finite, without redundant points.
fn curve(points: &[(f64, f64)]) -> Path {
    let mut path = Path::default();
    for part in points.split(|point| !(point.0.is_finite() && point.1.is_finite())) {
        if !part.is_empty() {
            path.append(&Path::polyline(&straightened(part)));
        }
    }
    path
}

/// A curve without the points on straight lines between others, to tenths of a pixel. For a curve that
/// advances to the right, the algorithm keeps the cone from the last kept point that contains all omitted
/// ones; for other curves it keeps points at a minimum distance.
fn straightened(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    let (mut from, mut cone) = ((0.0, 0.0), (f64::NEG_INFINITY, f64::INFINITY));
    let rises = points.windows(2).all(|pair| pair[0].0 < pair[1].0);
    for (i, &point) in points.iter().enumerate() {
        let is_last = i + 1 == points.len();
        let keep = match (i, rises) {
            (0, _) => true,
            (_, true) => {
                let run = point.0 - from.0;
                let slope = |y: f64| (y - from.1) / run;
                cone = (cone.0.max(slope(point.1 - STRAIGHT)), cone.1.min(slope(point.1 + STRAIGHT)));
                let next = points.get(i + 1).map(|next| (next.1 - from.1) / (next.0 - from.0));
                next.is_none_or(|next| next < cone.0 || next > cone.1)
            }
            (_, false) => (point.0 - from.0).abs() >= 0.25 || (point.1 - from.1).abs() >= 0.25,
        };
        if keep || is_last {
            kept.push(tenths(point));
            (from, cone) = (point, (f64::NEG_INFINITY, f64::INFINITY));
        }
    }
    kept
}

fn tenths((x, y): (f64, f64)) -> (f64, f64) {
    ((10.0 * x).round() / 10.0, (10.0 * y).round() / 10.0)
}

/// The colour scale of an image, right of the frame.
pub(super) fn draw_colours(svg: &mut Svg, frame: Rect, image: &Image) {
    let bar = Rect { x: frame.right() + 12.0, y: frame.y, width: 10.0, height: frame.height };
    let steps: Vec<f64> = (0..64).map(f64::from).collect();
    let cells = Grid { width: 1, height: steps.len(), values: steps };
    svg.image(bar, &cells.to_address(0.0, 63.0));
    let (low, high) = image.colours;
    let scale = Scale { low, high, from: bar.bottom(), to: bar.y, spread: Spread::Linear };
    for tick in scale.ticks(((frame.height / 34.0) as usize).max(2)) {
        svg.text("small soft", (bar.right() + 5.0, scale.pixel(tick.value) + 3.5), Anchor::Start, &tick.text);
    }
    svg.text_upwards("small soft", (frame.right() + 76.0, frame.y + frame.height / 2.0), &image.label);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_of_a_curve_lies_on_it() {
        let wave: Vec<(f64, f64)> =
            (0..4000).map(|i| (f64::from(i) * 0.25, 60.0 + 50.0 * (f64::from(i) * 0.01).sin())).collect();
        let kept = straightened(&wave);
        assert!(kept.len() < wave.len() / 10, "{}", kept.len());
        assert_eq!((kept[0], kept[kept.len() - 1].0), ((0.0, 60.0), 999.8));
        for (x, y) in wave {
            let next = kept.partition_point(|point| point.0 <= x).clamp(1, kept.len() - 1);
            let ((x0, y0), (x1, y1)) = (kept[next - 1], kept[next]);
            let on_line = y0 + (x - x0) / (x1 - x0) * (y1 - y0);
            assert!((on_line - y).abs() < 3.0 * STRAIGHT, "{on_line} {y}");
        }
        let spike = [(0.0, 0.0), (1.0, 0.0), (2.0, 9.0), (3.0, 0.0), (4.0, 0.0)];
        assert_eq!(straightened(&spike).len(), 5);
        let circle = [(0.0, 0.0), (0.1, 0.1), (5.0, 5.0), (0.0, 9.0)];
        assert_eq!(straightened(&circle), [(0.0, 0.0), (5.0, 5.0), (0.0, 9.0)]);
    }
}
