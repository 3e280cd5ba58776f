//! What is drawn in the frame of a plot.

use super::super::raster::Grid;
use super::super::scale::{Scale, Spread};
use super::super::svg::{Anchor, Path, Rect, Svg, escape};
use super::{Image, Mark, Weight};

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
        Mark::Band(style, points) => {
            let upper = points.iter().map(|(a, _, high)| at((*a, *high)));
            let lower = points.iter().rev().map(|(a, low, _)| at((*a, *low)));
            let outline: Vec<_> = upper
                .chain(lower)
                .filter(|p| p.0.is_finite() && p.1.is_finite())
                .collect();
            let mut path = Path::through(&outline);
            path.close();
            svg.path(&format!("band s{0} f{0} hair", style.ink.class()), &path);
        }
        Mark::Dots(style, points) => {
            let size = match style.weight {
                Weight::Hair => "small-dot veil",
                Weight::Bold => "large-dot",
                Weight::Normal | Weight::Dashed => "dot solid",
            };
            let finite = points
                .iter()
                .map(|p| at(*p))
                .filter(|p| p.0.is_finite() && p.1.is_finite());
            svg.path(&format!("{size} s{}", style.ink.class()), &Path::dots(finite));
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
        Mark::Words(_) => {}
    }
}

/// The words of a mark; `at` leads to where they stand.
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
pub(super) fn draw_colours(svg: &mut Svg, frame: Rect, image: &Image) {
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
