//! The page of several runs of one graph, laid over each other.

use super::asked::{Asked, Drawn};
use super::figures::{self, shown_in};
use super::page::{Sheet, Simulation, figures_of};
use super::plot::{Axis, Mark, Plot, Style};
use super::record::{Content, Recorded};
use super::svg::escape;
use super::theme::Ink;
use haptograph_surfaces::TextureModel;

/// One run of a sweep.
#[derive(Debug)]
pub struct SweptRun<'a> {
    /// What was set for it.
    pub name: String,
    /// Its signals, the same in every run.
    pub signals: Vec<Recorded>,
    /// What it left for each plot that the graph asks for.
    pub drawn: Vec<Drawn<'a>>,
    /// What the reader should be warned of.
    pub warnings: Vec<String>,
}

/// What the page of a sweep shows.
#[derive(Debug)]
pub struct SweepPage<'a> {
    /// Name of the graph.
    pub title: String,
    /// What the graph is about, as its file tells it.
    pub about: String,
    /// What of it comes from simulated devices.
    pub simulation: Simulation,
    /// What is to be known of all runs: names and values.
    pub facts: Vec<(String, String)>,
    /// The plots that the graph asks for.
    pub asked: Vec<&'a Asked>,
    /// The runs.
    pub runs: Vec<SweptRun<'a>>,
    /// The texture that a signal on a map belongs to, by the signal's name.
    pub textures: Vec<(String, &'a TextureModel)>,
}

impl SweepPage<'_> {
    /// The page as HTML.
    pub fn to_html(&self) -> String {
        let facts: String = self
            .facts
            .iter()
            .map(|(name, value)| format!("<dt>{}</dt><dd>{}</dd>", escape(name), escape(value)))
            .collect();
        let simulated = self.simulation.remark();
        let warnings: Vec<String> = self
            .runs
            .iter()
            .flat_map(|run| run.warnings.iter().map(move |w| format!("{}: {w}", run.name)))
            .collect();
        let mut plots = self.maps();
        for (i, asked) in self.asked.iter().enumerate() {
            let runs: Vec<Drawn<'_>> = self
                .runs
                .iter()
                .filter_map(|run| {
                    let traces = run.drawn.get(i)?.traces;
                    Some(Drawn {
                        name: &run.name,
                        traces,
                    })
                })
                .collect();
            plots.extend(asked.plots(&runs));
        }
        let sections = [
            ("The runs", format!("<dl>{facts}</dl>{simulated}")),
            ("Side by side", figures_of(&plots)),
            ("Mean spectra", figures_of(&self.spectra())),
            ("How large each signal was", self.table()),
        ];
        Sheet {
            title: &self.title,
            about: &self.about,
            badge: self.simulation.badge(),
            warnings: &warnings,
            sections: &sections,
        }
        .to_html()
    }

    /// One signal in all runs.
    fn across(&self, signal: usize) -> Vec<(&str, &Recorded)> {
        let runs = self.runs.iter();
        runs.filter_map(|run| Some((run.name.as_str(), run.signals.get(signal)?)))
            .collect()
    }

    fn signals(&self) -> usize {
        self.runs.first().map_or(0, |run| run.signals.len())
    }

    fn maps(&self) -> Vec<Plot> {
        (0..self.signals())
            .filter_map(|signal| {
                let strokes = self.across(signal);
                let name = &strokes.first()?.1.stream.name;
                let texture = self.textures.iter().find(|(of, _)| of == name);
                figures::strokes_on_map(&strokes, texture.map(|(_, texture)| *texture))
            })
            .collect()
    }

    fn spectra(&self) -> Vec<Plot> {
        (0..self.signals())
            .filter_map(|signal| {
                let mut plots: Vec<Plot> = Vec::new();
                for (number, (name, recorded)) in self.across(signal).into_iter().enumerate() {
                    let mut plot = figures::mean_spectrum(recorded, Ink::number(number))?;
                    for mark in &mut plot.marks {
                        if let Mark::Line(style, _) = mark {
                            *style = Style::named(style.ink, name);
                        }
                    }
                    plots.push(plot);
                }
                // The frame that holds the loudest holds all.
                let top = |plot: &Plot| plot.y.range.map_or(0.0, |(_, high)| high);
                let loudest = plots.iter().max_by(|a, b| top(a).total_cmp(&top(b)))?;
                let mut plot = Plot {
                    marks: Vec::new(),
                    ..loudest.clone()
                };
                let (low, high) = loudest.y.range?;
                plot.y = Axis { ..plot.y }.over(low, high);
                plot.size.1 = 280.0;
                plot.marks = plots.into_iter().flat_map(|plot| plot.marks).collect();
                Some(plot)
            })
            .collect()
    }

    /// Root mean square of every scalar and vector in every run.
    fn table(&self) -> String {
        let names: String = self
            .runs
            .iter()
            .map(|run| format!("<th>{}</th>", escape(&run.name)))
            .collect();
        let rows: String = (0..self.signals())
            .filter_map(|signal| self.row(signal))
            .collect();
        format!("<table><tr><th>Root mean square</th>{names}</tr>{rows}</table>")
    }

    fn row(&self, signal: usize) -> Option<String> {
        let across = self.across(signal);
        let stream = &across.first()?.1.stream;
        let (unit, factor) = shown_in(stream.quantity);
        let cells: Option<String> = across
            .iter()
            .map(|(_, recorded)| match &recorded.content {
                Content::Lanes(lanes, _)
                    if !matches!(stream.kind, haptograph_engine::frame::Kind::Wrench) =>
                {
                    let square: f64 = lanes.iter().map(|lane| lane.rms().powi(2)).sum();
                    Some(format!("<td>{}</td>", three_digits(square.sqrt() * factor)))
                }
                _ => None,
            })
            .collect();
        let name = match unit.as_str() {
            "" => escape(&stream.name),
            unit => format!("{} ({})", escape(&stream.name), escape(unit)),
        };
        Some(format!("<tr><td>{name}</td>{}</tr>", cells?))
    }
}

/// A number with three digits that count.
fn three_digits(value: f64) -> String {
    let magnitude = value.abs().log10().floor();
    if value == 0.0 || !magnitude.is_finite() {
        return "0".to_owned();
    }
    let decimals = (2.0 - magnitude).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_digits() {
        for (value, shown) in [
            (0.0, "0"),
            (1234.5, "1234"),
            (12.345, "12.3"),
            (0.00123456, "0.00123"),
        ] {
            assert_eq!(three_digits(value), shown);
        }
    }
}
