//! The page of a sweep: several runs of one graph in common plots.

use super::figures::{self, Unit};
use super::headlines::coefficient;
use super::inks::Inks;
use super::page::signals::is_same;
use super::page::{Sheet, Simulation, address, facts, figures_of, line_up};
use super::plot::{Mark, Plot, Style};
use super::plot_request::{PlotRequest, RunTraces};
use super::record::{Content, Friction, Recorded};
use super::scale::plain;
use super::svg::escape;
use super::table::grid;
use super::theme::Ink;
use haptograph_surfaces::TextureModel;

/// One run of a sweep.
#[derive(Debug)]
pub struct SweptRun<'a> {
    /// Name of the run, from its settings.
    pub name: String,
    /// Header of its column: only the value if the runs differ in one parameter.
    pub head: String,
    /// URL of its own page, relative to this one.
    pub page: Option<String>,
    /// The signals of the run; every run has the same.
    pub signals: Vec<Recorded>,
    /// The traces of the run for each plot that the graph requests.
    pub drawn: Vec<RunTraces<'a>>,
    /// Warnings.
    pub warnings: Vec<String>,
}

/// Content of the page of a sweep.
#[derive(Debug)]
pub struct SweepPage<'a> {
    /// Name of the graph.
    pub title: String,
    /// The description in the graph's file.
    pub about: String,
    /// The parameter in which the runs differ, if there is only one.
    pub over: Option<String>,
    /// The simulated part of the runs.
    pub simulation: Simulation,
    /// The signals that yield the friction coefficient.
    pub friction: Option<Friction>,
    /// The facts common to all runs: names and values.
    pub facts: Vec<(String, String)>,
    /// The plots requested by the graph.
    pub requests: Vec<&'a PlotRequest>,
    /// The runs.
    pub runs: Vec<SweptRun<'a>>,
    /// The texture of a signal on a map, by the signal's name.
    pub textures: Vec<(String, TextureModel)>,
}

impl SweepPage<'_> {
    /// The page as HTML.
    pub fn to_html(&self) -> String {
        let warnings = self.warnings();
        let (mut differing, same) = self.plots();
        let (spectra, same_spectra): (Vec<_>, Vec<_>) =
            self.spectra().into_iter().partition(|(_, same)| !same);
        let mut same: Vec<Plot> = same.into_iter().chain(plots_of(same_spectra)).collect();
        let mut spectra = plots_of(spectra);
        for plots in [&mut differing, &mut same] {
            line_up(plots, self.runs.iter().flat_map(|run| &run.signals));
        }
        [&mut spectra, &mut same].into_iter().for_each(|plots| figures::explain_once(plots));
        let sections = [
            ("How the runs differ", self.links() + &self.table() + &self.simulation.remark()),
            ("Side by side", figures_of(&differing)),
            ("Mean spectra", figures_of(&spectra)),
            ("", folded(&same)),
            ("The runs", facts(&self.facts)),
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

    /// Every warning once, with the runs to which it applies.
    fn warnings(&self) -> Vec<String> {
        let mut found: Vec<(&str, Vec<&str>)> = Vec::new();
        for run in &self.runs {
            for warning in &run.warnings {
                match found.iter_mut().find(|(known, _)| *known == warning.as_str()) {
                    Some((_, runs)) => runs.push(&run.name),
                    None => found.push((warning.as_str(), vec![run.name.as_str()])),
                }
            }
        }
        let shown = |(warning, runs): (&str, Vec<&str>)| match runs.len() == self.runs.len() {
            true if runs.len() > 1 => format!("in all runs: {warning}"),
            _ => format!("{}: {warning}", runs.join("; ")),
        };
        found.into_iter().map(shown).collect()
    }

    /// The requested plots and the maps: those that differ between runs, and the others.
    fn plots(&self) -> (Vec<Plot>, Vec<Plot>) {
        let (mut differing, mut same) = (Vec::new(), Vec::new());
        let mut inks = Inks::default();
        for (i, request) in self.requests.iter().enumerate() {
            let runs: Vec<RunTraces<'_>> = self
                .runs
                .iter()
                .filter_map(|run| Some(RunTraces { name: &run.name, traces: run.drawn.get(i)?.traces }))
                .collect();
            let into = if request.is_same(&runs) { &mut same } else { &mut differing };
            into.extend(request.plots(&runs, &mut inks));
        }
        for signal in 0..self.signals() {
            let strokes = self.across(signal);
            let is_same = strokes.len() > 1 && all_alike(&strokes, have_same_stroke);
            match is_same {
                true => same.extend(self.map(&[("all runs", strokes[0].1)])),
                false => differing.extend(self.map(&strokes)),
            }
        }
        (differing, same)
    }

    /// A line with links to the pages of the runs.
    fn links(&self) -> String {
        let links = self.runs.iter().filter_map(|run| {
            let page = address(run.page.as_deref()?);
            Some(format!("<a href=\"{page}\">{}</a>", escape(&run.name)))
        });
        let links: Vec<String> = links.collect();
        match links.as_slice() {
            [] => String::new(),
            links => format!("<p>Each run has a page of its own, with its sound: {}.</p>", links.join(", ")),
        }
    }

    /// The distinct signals: a signal is omitted if an earlier one is equal to it in every run.
    fn distinct(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.signals()).filter(|signal| !(0..*signal).any(|other| self.are_same(other, *signal)))
    }

    /// True if two signals are equal in every run.
    fn are_same(&self, a: usize, b: usize) -> bool {
        self.runs.iter().all(|run| match (run.signals.get(a), run.signals.get(b)) {
            (Some(a), Some(b)) => is_same(a, b),
            _ => false,
        })
    }

    /// One signal in all runs.
    fn across(&self, signal: usize) -> Vec<(&str, &Recorded)> {
        let runs = self.runs.iter();
        runs.filter_map(|run| Some((run.name.as_str(), run.signals.get(signal)?))).collect()
    }

    fn signals(&self) -> usize {
        self.runs.first().map_or(0, |run| run.signals.len())
    }

    fn map(&self, strokes: &[(&str, &Recorded)]) -> Option<Plot> {
        let name = &strokes.first()?.1.stream.name;
        let texture = self.textures.iter().find(|(of, _)| of == name);
        figures::strokes_on_map(strokes, texture.map(|(_, texture)| texture))
    }

    /// The spectra of the runs, one frame per signal, and whether they are equal in all runs.
    fn spectra(&self) -> Vec<(Plot, bool)> {
        self.distinct().filter_map(|signal| self.spectra_of(signal)).collect()
    }

    fn spectra_of(&self, signal: usize) -> Option<(Plot, bool)> {
        let across = self.across(signal);
        let same = across.len() > 1 && all_alike(&across, is_same);
        let mut plots: Vec<Plot> = Vec::new();
        for (number, (name, recorded)) in across.into_iter().enumerate() {
            let (name, ink) = match same {
                true if number > 0 => break,
                true => ("all runs", Ink::Grey),
                false => (name, Ink::of_run(number)),
            };
            let mut plot = figures::mean_spectrum(recorded, ink)?;
            for mark in &mut plot.marks {
                if let Mark::Line(style, _) = mark {
                    *style = Style::named(style.ink, name);
                }
            }
            plots.push(plot);
        }
        // All spectra get the frame of the loudest.
        let top = |plot: &Plot| plot.y.range.map_or(0.0, |(_, high)| high);
        let loudest = plots.iter().max_by(|a, b| top(a).total_cmp(&top(b)))?;
        let is_curve = |mark: &Mark| matches!(mark, Mark::Line(..));
        let mut plot = loudest.clone();
        plot.size.1 = 280.0;
        plot.caption = format!("Over each whole run. {}", figures::EXPLAINED[1]);
        // The receptors of the loudest are those of all.
        plot.marks.retain(|mark| !is_curve(mark));
        let curves = plots.into_iter().flat_map(|plot| plot.marks);
        plot.marks.extend(curves.filter(is_curve));
        Some((plot, same))
    }

    /// Root mean square of every scalar and vector in every run, the largest differences first; signals that
    /// are equal in all runs are only named.
    fn table(&self) -> String {
        let heads = self.runs.iter().enumerate().map(|(number, run)| {
            let ink = Ink::of_run(number).class();
            format!("<i class=\"swatch b{ink}\"></i>{}", escape(&run.head))
        });
        let rows = self.distinct().filter_map(|signal| self.row(signal));
        let (mut differing, same): (Vec<Row>, Vec<Row>) = rows.partition(|row| row.spread > SAME);
        differing.sort_by(|a, b| b.spread.total_cmp(&a.spread));
        let friction = self.friction_row();
        let rows: Vec<Vec<String>> = friction.iter().chain(&differing).map(Row::cells).collect();
        let same: Vec<&str> = same.iter().map(|row| row.name.as_str()).collect();
        let same = match same.as_slice() {
            [] => String::new(),
            names => format!("<p class=\"remark\">The same in all runs: {}.</p>", escape(&names.join(", "))),
        };
        let over = self.over.as_ref();
        let over = over.map_or_else(String::new, |name| format!(", {} =", escape(name)));
        let heads = [format!("Root mean square{over}")].into_iter().chain(heads);
        let table = match rows.is_empty() {
            true => "<p>No signal differs between the runs.</p>".to_owned(),
            false => grid("", heads.chain(["largest by smallest".to_owned()]), rows.into_iter()),
        };
        table + &same
    }

    /// The friction coefficient in every run.
    fn friction_row(&self) -> Option<Row> {
        let of_run = |run: &SweptRun<'_>| coefficient(&run.signals, self.friction.as_ref());
        let found: Vec<(f64, String)> = self.runs.iter().map(of_run).collect::<Option<_>>()?;
        let of = match self.friction.as_ref()? {
            Friction::Measured(name) => format!("mean of {name} when non-zero"),
            Friction::Forces { tangential, normal } => format!("{tangential} by {normal}"),
        };
        let levels: Vec<f64> = found.iter().map(|(mu, _)| *mu).collect();
        Some(Row {
            name: format!("Friction coefficient, {of}"),
            cells: levels.iter().map(|mu| plain(*mu)).collect(),
            spread: spread(&levels),
        })
    }

    fn row(&self, signal: usize) -> Option<Row> {
        let across = self.across(signal);
        let stream = &across.first()?.1.stream;
        let unit = Unit::of(stream.quantity);
        let level = |recorded: &Recorded| match &recorded.content {
            Content::Components(lanes, _) if stream.kind != haptograph_engine::frame::Kind::WRENCH => {
                let square: f64 = lanes.iter().map(|lane| lane.rms().powi(2)).sum();
                Some(square.sqrt())
            }
            _ => None,
        };
        let levels: Vec<f64> = across.iter().map(|(_, recorded)| level(recorded)).collect::<Option<_>>()?;
        let copies = (signal + 1..self.signals()).filter(|other| self.are_same(signal, *other));
        let copies = copies.filter_map(|other| self.runs.first()?.signals.get(other));
        let name = std::iter::once(stream.name.as_str())
            .chain(copies.map(|copy| copy.stream.name.as_str()))
            .collect::<Vec<_>>()
            .join(", ");
        Some(Row {
            name: match unit.symbol.as_str() {
                "" => name,
                symbol => format!("{name} ({symbol})"),
            },
            cells: levels.iter().map(|level| plain(unit.show(*level))).collect(),
            spread: spread(&levels),
        })
    }
}

/// True if all recordings are like the first.
fn all_alike(across: &[(&str, &Recorded)], are_alike: impl Fn(&Recorded, &Recorded) -> bool) -> bool {
    match across {
        [(_, first), rest @ ..] => rest.iter().all(|(_, other)| are_alike(first, other)),
        [] => true,
    }
}

fn have_same_stroke(a: &Recorded, b: &Recorded) -> bool {
    matches!((&a.content, &b.content), (Content::Map(x), Content::Map(y)) if x == y)
}

fn plots_of(of: Vec<(Plot, bool)>) -> Vec<Plot> {
    of.into_iter().map(|(plot, _)| plot).collect()
}

/// Figures in a folded section.
fn folded(same: &[Plot]) -> String {
    match same {
        [] => String::new(),
        same => format!(
            "<details><summary>The same in all runs ({})</summary>{}</details>",
            same.len(),
            figures_of(same)
        ),
    }
}

/// Ratio of the largest level to the smallest.
fn spread(levels: &[f64]) -> f64 {
    let most = levels.iter().copied().fold(0.0, f64::max);
    let least = levels.iter().copied().fold(f64::INFINITY, f64::min);
    if most > least { most / least } else { 1.0 }
}

/// Levels within this ratio count as equal.
const SAME: f64 = 1.0005;

/// One signal in all runs.
struct Row {
    name: String,
    cells: Vec<String>,
    /// Ratio of the largest level to the smallest.
    spread: f64,
}

impl Row {
    fn cells(&self) -> Vec<String> {
        let spread = match self.spread.is_finite() {
            true => plain(self.spread),
            false => "only in some".to_owned(),
        };
        std::iter::once(&self.name).chain(&self.cells).chain([&spread]).map(|cell| escape(cell)).collect()
    }
}
