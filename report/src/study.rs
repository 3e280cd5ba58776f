//! The page of a study's analysis: means with their intervals, maps with names, trees, psychometric functions.

use super::map_figures::{self, ASPECT, materials};
use super::page::Sheet;
use super::plot::{Axis, Mark, Plot, Style, Weight};
use super::svg::{Rect, escape, text_width};
use super::table::Table;
use super::theme::Ink;
use haptograph_learning::evaluate::Merge;

/// A section of the page.
#[derive(Debug, Clone, Default)]
pub struct Section {
    /// Title; empty for none.
    pub title: String,
    /// A sentence above the figures.
    pub text: String,
    /// Figures.
    pub plots: Vec<Plot>,
    /// A table below them.
    pub table: Option<Table>,
}

/// The page as HTML. Every figure says `simulated` where the people are.
pub fn page(
    title: &str,
    about: &str,
    simulated: bool,
    warnings: &[String],
    sections: Vec<Section>,
) -> String {
    let badge = super::learning::badge(simulated);
    let content = |section: Section| {
        let text = match section.text.as_str() {
            "" => String::new(),
            text => format!("<p>{}</p>", escape(text)),
        };
        // A map keeps the width at which its names are apart.
        let figure = |plot: Plot| match plot.aspect {
            None => plot.to_figure(),
            Some(_) => format!(
                "<div class=\"scroll\"><div style=\"min-width:{}px\">{}</div></div>",
                MAP_PX + 62.0,
                plot.to_figure()
            ),
        };
        let plots = section.plots.into_iter().map(|plot| Plot { note: badge.to_owned(), ..plot });
        let figures: String = plots.map(figure).collect();
        let table = section.table.map_or_else(String::new, |table| table.to_html());
        (section.title, text + &figures + &table)
    };
    let sections: Vec<(String, String)> = sections.into_iter().map(content).collect();
    let sections: Vec<(&str, String)> =
        sections.iter().map(|(title, content)| (&**title, content.clone())).collect();
    Sheet { title, about, badge, warnings, sections: &sections }.to_html()
}

/// A mean and its interval.
#[derive(Debug, Clone, Default)]
pub struct Interval {
    /// Row of the figure.
    pub row: String,
    /// Series, by which the colour goes.
    pub series: String,
    /// The mean.
    pub mean: f64,
    /// Ends of its interval.
    pub ends: Option<(f64, f64)>,
    /// Text beside it, such as an asterisk.
    pub mark: String,
}

/// Height of a mean with its interval, and the gap between two rows, px.
const STEP_PX: (f64, f64) = (11.0, 10.0);

/// The values of a list without repetition, in their order.
fn distinct<'a>(values: impl Iterator<Item = &'a String>) -> Vec<&'a String> {
    let mut all = Vec::new();
    values.for_each(|value| {
        if !all.contains(&value) {
            all.push(value)
        }
    });
    all
}

/// Means with their intervals: a name a row, so that no names overlap, and in it a line a series.
pub fn intervals(title: &str, label: &str, means: &[Interval]) -> Plot {
    let rows = distinct(means.iter().map(|of| &of.row));
    let series = distinct(means.iter().map(|of| &of.series));
    let row_px = STEP_PX.0 * series.len() as f64 + STEP_PX.1;
    let place =
        |known: &[&String], name: &String| known.iter().position(|of| *of == name).unwrap_or(0) as f64;
    let at = |of: &Interval| {
        let within = place(&series, &of.series) - 0.5 * (series.len() as f64 - 1.0);
        rows.len() as f64 - place(&rows, &of.row) - within * STEP_PX.0 / row_px
    };
    let ends =
        means.iter().flat_map(|of| [of.ends.map_or(of.mean, |e| e.0), of.ends.map_or(of.mean, |e| e.1)]);
    let (low, high) = ends.fold((0.0_f64, 1.0_f64), |(low, high), end| (low.min(end), high.max(end)));
    let mut marks = Vec::new();
    for (number, name) in series.iter().enumerate() {
        let own = || means.iter().filter(|of| of.series == **name);
        let lines = own().filter_map(|of| of.ends.map(|(low, high)| [(low, at(of)), (high, at(of))]));
        marks.push(Mark::Segments(Style::of(Ink::number(number)), lines.collect()));
        let name = if series.len() > 1 { name.as_str() } else { "" };
        marks.push(Mark::Dots(
            Style::named(Ink::number(number), name),
            own().map(|of| (of.mean, at(of))).collect(),
        ));
    }
    let words = means
        .iter()
        .filter(|of| !of.mark.is_empty())
        .map(|of| (of.ends.map_or(of.mean, |ends| ends.1) + 0.02 * (high - low), at(of), of.mark.clone()));
    marks.push(Mark::Words(words.collect()));
    Plot {
        title: title.to_owned(),
        x: Axis::of(label).over(low, high + 0.04 * (high - low)),
        y: Axis::default()
            .over(0.5, rows.len() as f64 + 0.5)
            .named(rows.iter().enumerate().map(|(row, name)| ((rows.len() - row) as f64, (*name).clone()))),
        marks,
        size: (0.0, 78.0 + row_px * rows.len() as f64),
        ..Plot::default()
    }
}

/// Width at which names on a map are kept apart, px; a wider page only moves them further apart.
const MAP_PX: f64 = 680.0;
/// Height of a name, px.
const NAME_PX: f64 = 13.0;

fn overlap(a: &Rect, b: &Rect) -> f64 {
    let along = |from: f64, to: f64, other: f64, end: f64| (to.min(end) - from.max(other)).max(0.0);
    along(a.x, a.right(), b.x, b.right()) * along(a.y, a.bottom(), b.y, b.bottom())
}

/// A place for the middle of each name near its point, px: of several the one that covers least of what is there.
fn placed(points: &[(f64, f64)], names: &[&str], frame: &Rect) -> Vec<(f64, f64)> {
    let around = |(x, y): (f64, f64), (width, height): (f64, f64)| Rect {
        x: x - width / 2.0,
        y: y - height / 2.0,
        width,
        height,
    };
    let mut taken: Vec<Rect> = points.iter().map(|point| around(*point, (9.0, 9.0))).collect();
    let mut places = Vec::new();
    for ((x, y), name) in points.iter().zip(names) {
        let size = (text_width(name, 11.0) + 4.0, NAME_PX);
        let near = (0..4).flat_map(|ring| {
            let gap = 9.0 + 13.0 * f64::from(ring);
            let (aside, above) = (size.0 / 2.0 + gap, gap + 2.0);
            let far = [
                (1.0, 0.0),
                (-1.0, 0.0),
                (0.0, -1.0),
                (0.0, 1.0),
                (0.8, -1.0),
                (-0.8, -1.0),
                (0.8, 1.0),
                (-0.8, 1.0),
            ];
            far.map(|(across, down)| (x + across * aside, y + down * above))
        });
        let cost = |place: &(f64, f64)| {
            let own = around(*place, size);
            let outside = size.0 * size.1 - overlap(&own, frame);
            outside + taken.iter().map(|other| overlap(&own, other)).sum::<f64>()
        };
        // The first of the best.
        let best = near.reduce(|best, next| if cost(&next) < cost(&best) - 1e-9 { next } else { best });
        let place = best.unwrap_or((*x, *y));
        taken.push(around(place, size));
        places.push(place);
    }
    places
}

/// Stimuli on a map, with their names; one scale on both axes. Stimuli are (name, series); a line leads to a name that is
/// not beside its point.
pub fn map(stimuli: &[(String, String)], points: &[(f64, f64)], labels: [&str; 2]) -> Plot {
    let half =
        points.iter().fold(1e-9_f64, |half, (x, y)| half.max(y.abs() * 1.1).max(x.abs() * 1.25 / ASPECT));
    let height = MAP_PX / ASPECT;
    let scale = height / (2.0 * half);
    let in_px = |(x, y): &(f64, f64)| (MAP_PX / 2.0 + x * scale, height / 2.0 - y * scale);
    let back = |(x, y): &(f64, f64)| ((x - MAP_PX / 2.0) / scale, (height / 2.0 - y) / scale);
    let pixels: Vec<(f64, f64)> = points.iter().map(in_px).collect();
    let names: Vec<&str> = stimuli.iter().map(|(name, _)| name.as_str()).collect();
    let places = placed(&pixels, &names, &Rect { x: 0.0, y: 0.0, width: MAP_PX, height });
    let mut marks = Vec::new();
    let leads = pixels.iter().zip(&places).zip(&names).filter(|((from, to), name)| {
        (from.1 - to.1).abs() > 16.0 || (from.0 - to.0).abs() > text_width(name, 11.0) / 2.0 + 14.0
    });
    let leads = leads.map(|((from, to), _)| [back(from), back(to)]);
    marks.push(Mark::Segments(Style::of(Ink::Grey).weight(Weight::Hair), leads.collect()));
    for (number, series) in materials(stimuli).into_iter().enumerate() {
        let own = points.iter().zip(stimuli).filter(|(_, (_, of))| of == series).map(|(point, _)| *point);
        marks.push(Mark::Dots(Style::named(Ink::number(number), series).weight(Weight::Bold), own.collect()));
    }
    let words = places.iter().zip(&names).map(|(place, name)| {
        let (x, y) = back(place);
        (x, y, (*name).to_owned())
    });
    marks.push(Mark::Words(words.collect()));
    Plot {
        title: format!("Map, {} and {}", labels[0].to_lowercase(), labels[1].to_lowercase()),
        x: Axis::of(labels[0]).over(-half * ASPECT, half * ASPECT),
        y: Axis::of(labels[1]).over(-half, half),
        marks,
        size: (0.0, 520.0),
        aspect: Some(ASPECT),
        ..Plot::default()
    }
}

/// The tree of stimuli, (name, series).
pub fn tree(stimuli: &[(String, String)], merges: &[Merge]) -> Plot {
    Plot {
        title: "Tree, Ward's criterion".into(),
        caption: "The farther to the left two branches join, the more alike they were judged.".into(),
        ..map_figures::tree(stimuli, merges)
    }
}

/// Stress of a map in 1, 2, ... dimensions.
pub fn scree(stress: &[f64]) -> Plot {
    map_figures::scree(stress)
}

/// A psychometric function with the shares of right answers that it fits: those of single people are thin.
#[derive(Debug, Clone, Default)]
pub struct Psychometric {
    /// Level and share of right answers.
    pub points: Vec<(f64, f64)>,
    /// The function of all people together.
    pub curve: Vec<(f64, f64)>,
    /// Those of single people.
    pub of_people: Vec<Vec<(f64, f64)>>,
    /// Lower end, threshold and upper end.
    pub threshold: (f64, f64, f64),
    /// Share of right answers there.
    pub share: f64,
}

impl Psychometric {
    /// The figure.
    pub fn plot(&self, title: &str) -> Plot {
        let (low, at, high) = self.threshold;
        let thin = Style::of(Ink::Grey).weight(Weight::Hair);
        let single = self.of_people.iter().map(|curve| Mark::Line(thin.clone(), curve.clone()));
        let interval = [[(low, self.share), (high, self.share)], [(at, 0.0), (at, self.share)]];
        let end = self.curve.last().map_or(1.0, |(level, _)| *level).max(high * 1.05);
        let marks = single.chain([
            Mark::Line(Style::named(Ink::Blue, "all").weight(Weight::Bold), self.curve.clone()),
            Mark::Segments(
                Style::named(Ink::Orange, "threshold, 95 %").weight(Weight::Bold),
                interval.to_vec(),
            ),
            Mark::Dots(
                Style::named(Ink::Blue, "share of right answers").weight(Weight::Bold),
                self.points.clone(),
            ),
        ]);
        Plot {
            title: title.to_owned(),
            x: Axis::of("Difference from the standard").over(0.0, end),
            y: Axis::of("Share of right answers").over(0.4, 1.02),
            marks: marks.collect(),
            size: (0.0, 300.0),
            caption: "Half of the answers are right without a difference. Neighbouring levels are pooled where they are many. Thin: single people.".into(),
            ..Plot::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_on_a_map_do_not_overlap() {
        // Thirty stimuli, in pairs that nearly coincide.
        let points: Vec<(f64, f64)> = (0..30_i32)
            .map(|i| {
                let angle = 2.4 * f64::from(i / 2);
                let (from, near) = (0.25 * f64::from(i / 2).sqrt(), 0.01 * f64::from(i % 2));
                (from * angle.cos() + near, from * angle.sin())
            })
            .collect();
        let names: Vec<String> =
            (0..30).map(|i| format!("Paper Plate {}, {}", i / 2, ["real", "virtual"][i % 2])).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let pixels: Vec<(f64, f64)> =
            points.iter().map(|(x, y)| (340.0 + 300.0 * x, 207.0 + 190.0 * y)).collect();
        let places =
            placed(&pixels, &names, &Rect { x: 0.0, y: 0.0, width: MAP_PX, height: MAP_PX / ASPECT });
        for (at, (x, y)) in places.iter().enumerate() {
            for (other, (x2, y2)) in places.iter().enumerate().take(at) {
                let width = 0.5 * (text_width(names[at], 11.0) + text_width(names[other], 11.0));
                assert!((x - x2).abs() >= width || (y - y2).abs() >= 11.0, "{} {}", names[at], names[other]);
            }
        }
    }

    #[test]
    fn a_page_of_simulated_people_says_so_in_every_figure() {
        let mean = |row: &str, mean| Interval {
            row: row.into(),
            mean,
            ends: Some((0.1, 0.9)),
            mark: "*†".into(),
            ..Interval::default()
        };
        let plots = vec![
            intervals("similarity", "Rating", &[mean("tile", 0.4), mean("silk", 0.5)]),
            scree(&[0.2, 0.1]),
        ];
        let section = Section { title: "similarity".into(), plots, ..Section::default() };
        let html = page("study", "", true, &[], vec![section.clone()]);
        assert_eq!(html.matches("<span class=\"note\">simulated</span>").count(), 2);
        assert!(html.contains("tile") && html.contains("*†"), "{html}");
        assert!(!page("study", "", false, &[], vec![section]).contains("simulated"));
    }
}
