//! The page that a run leaves behind: one HTML file, everything in it, nothing fetched.

use super::figures;
use super::plot::Plot;
use super::record::{Content, Recorded};
use super::svg::escape;
use super::theme::{self, Ink};
use haptograph_surfaces::TextureModel;

/// What a page shows.
#[derive(Debug, Default)]
pub struct Page<'a> {
    /// Name of the graph.
    pub title: String,
    /// What the graph is about, as its file tells it.
    pub about: String,
    /// What of it comes from simulated devices.
    pub simulation: Simulation,
    /// What is to be known of the run: names and values.
    pub facts: Vec<(String, String)>,
    /// What the reader should be warned of: limits that held back, faults, a run cut short.
    pub warnings: Vec<String>,
    /// The plots that the graph asks for.
    pub asked: Vec<Plot>,
    /// The signals.
    pub signals: Vec<Recorded>,
    /// The texture that a signal on a map belongs to, by the signal's name.
    pub textures: Vec<(String, &'a TextureModel)>,
    /// The drawing of the graph.
    pub drawing: String,
}

/// What of a run comes from simulated devices.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Simulation {
    /// Nothing.
    #[default]
    None,
    /// All of its devices are.
    All,
    /// Some of its devices: which, in whole sentences.
    Some(String),
}

impl Simulation {
    /// Beside the title.
    pub(super) fn badge(&self) -> &'static str {
        match self {
            Self::None => "",
            Self::All => "simulated",
            Self::Some(_) => "partly simulated",
        }
    }

    /// Below the facts, as HTML.
    pub(super) fn remark(&self) -> String {
        let text = match self {
            Self::None => return String::new(),
            Self::All => ALL_SIMULATED,
            Self::Some(text) => text,
        };
        format!("<p class=\"remark\">{}</p>", escape(text))
    }
}

/// What is said where all devices are simulated.
const ALL_SIMULATED: &str = "All devices in this run were simulated: what is shown is what the models of them did, not a \
    measurement.";

impl Page<'_> {
    /// The page as HTML.
    pub fn to_html(&self) -> String {
        let facts: String = self
            .facts
            .iter()
            .map(|(name, value)| format!("<dt>{}</dt><dd>{}</dd>", escape(name), escape(value)))
            .collect();
        let simulated = self.simulation.remark();
        let (main, rest) = self.plots();
        let mut sections = vec![("The run", format!("<dl>{facts}</dl>{simulated}"))];
        sections.extend(
            [("What happened", main), ("Signals", rest)].map(|(name, plots)| (name, figures_of(&plots))),
        );
        sections.push((
            "The graph",
            format!("<figure class=\"wide\">{}</figure>", self.drawing),
        ));
        Sheet {
            title: &self.title,
            about: &self.about,
            badge: self.simulation.badge(),
            warnings: &self.warnings,
            sections: &sections,
        }
        .to_html()
    }

    /// What tells what the rest means: the plots that were asked for and the map; then signals in the order of the graph.
    /// Where nothing was asked for, all are one.
    fn plots(&self) -> (Vec<Plot>, Vec<Plot>) {
        let mut main = Vec::new();
        for signal in &self.signals {
            let texture = self.textures.iter().find(|(name, _)| *name == signal.stream.name);
            let texture = texture.map(|(_, texture)| *texture);
            main.extend(figures::strokes_on_map(&[("stroke", signal)], texture));
        }
        let mut rest = Vec::new();
        let mut number = 0;
        for signal in &self.signals {
            let ink = Ink::number(number);
            rest.extend(figures::over_time(signal, ink));
            rest.extend(figures::mean_spectrum(signal, ink));
            rest.extend(figures::contact_path(signal));
            number += usize::from(matches!(signal.content, Content::Lanes(..) | Content::Events(..)));
        }
        if self.asked.is_empty() {
            main.append(&mut rest);
        }
        (self.asked.iter().cloned().chain(main).collect(), rest)
    }
}

/// Plots as figures of a sheet.
pub(super) fn figures_of(plots: &[Plot]) -> String {
    let figures = plots
        .iter()
        .map(|plot| format!("<figure>{}</figure>\n", plot.to_svg()));
    figures.collect()
}

/// An HTML file: a head, and sections of a heading and HTML; empty ones are left out.
pub(super) struct Sheet<'a> {
    pub title: &'a str,
    pub about: &'a str,
    /// Beside the title; nothing where it is empty.
    pub badge: &'a str,
    pub warnings: &'a [String],
    pub sections: &'a [(&'a str, String)],
}

impl Sheet<'_> {
    pub fn to_html(&self) -> String {
        let title = escape(self.title);
        let badge = match self.badge {
            "" => String::new(),
            badge => format!("<span class=\"badge\">{badge}</span>"),
        };
        let warnings: String = self
            .warnings
            .iter()
            .map(|w| format!("<p class=\"warning\">{}</p>", escape(w)))
            .collect();
        let sections: String = self
            .sections
            .iter()
            .filter(|(_, content)| !content.is_empty())
            .map(|(name, content)| format!("<section><h2>{}</h2>\n{content}</section>\n", escape(name)))
            .collect();
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width\">\n<meta name=\"color-scheme\" content=\"light dark\">\n\
             <title>{title}</title>\n<style>{}{PAGE_CSS}</style>\n</head>\n<body>\n<main>\n\
             <header><h1>{title} {badge}</h1>{}</header>\n{warnings}\n{sections}\
             <footer>Made by haptograph {}</footer>\n</main>\n</body>\n</html>\n",
            theme::css(),
            paragraphs(self.about),
            env!("CARGO_PKG_VERSION"),
        )
    }
}

fn paragraphs(text: &str) -> String {
    let parts = text.split("\n\n").map(str::trim).filter(|part| !part.is_empty());
    parts.map(|part| format!("<p>{}</p>", escape(part))).collect()
}

const PAGE_CSS: &str = "\
:root{color-scheme:light dark}\
body{margin:0;background:#fff;color:#1c242c;font:15px/1.55 system-ui,-apple-system,'Segoe UI','DejaVu Sans',sans-serif}\
main{max-width:792px;margin:0 auto;padding:28px 16px 60px}\
h1{font-size:26px;margin:0 0 6px;letter-spacing:-.01em}h2{font-size:17px;margin:34px 0 10px}\
p{margin:6px 0;max-width:68ch}\
.badge{font-size:12px;font-weight:600;letter-spacing:.03em;vertical-align:5px;padding:2px 9px;border-radius:10px;\
background:#faeadd;color:#9a4310}\
.warning{border-left:3px solid #c85a17;padding:4px 12px;background:#faeadd;color:#5b2a0c;max-width:none}\
.remark,footer{color:#59636e;font-size:13px}footer{margin-top:40px}\
dl{display:grid;grid-template-columns:max-content 1fr;gap:3px 22px;margin:0;font-size:14px}\
dt{color:#59636e}dd{margin:0;font-variant-numeric:tabular-nums;overflow-wrap:anywhere}\
table{border-collapse:collapse;font-size:13.5px;font-variant-numeric:tabular-nums}\
th,td{padding:3px 14px 3px 0;text-align:right;border-bottom:1px solid #8883}th:first-child,td:first-child{text-align:left}\
th{font-weight:600;color:#59636e}\
figure{margin:0 0 14px}figure svg{display:block}\
.pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(340px,1fr));gap:8px}\
table{margin:8px 0 14px}.grid td,.grid th{padding:4px 10px}h3{font-size:15px;margin:22px 0 8px}\
details{border-top:1px solid #8883;padding:8px 0}summary{cursor:pointer;font-weight:600}\
.wide{overflow-x:auto;width:min(96vw,1500px);position:relative;left:50%;transform:translateX(-50%)}\
.wide svg.figure{min-width:1000px;margin:0 auto}\
@media (prefers-color-scheme:dark){body{background:#14181d;color:#e8edf2}.badge{background:#412c1e;color:#f0a066}\
.warning{background:#412c1e;color:#f3cfae}.remark,footer,dt,th{color:#a3aeb9}}\
@media print{.wide{width:100%}.wide svg.figure{max-width:100%}}";

#[cfg(test)]
mod tests;
