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
    /// Does anything on the page come from a simulated device?
    pub simulated: bool,
    /// What is to be known of the run: names and values.
    pub facts: Vec<(String, String)>,
    /// What the reader should be warned of: limits that held back, faults, a run cut short.
    pub warnings: Vec<String>,
    /// The signals.
    pub signals: Vec<Recorded>,
    /// The texture that a signal on a map belongs to, by the signal's name.
    pub textures: Vec<(String, &'a TextureModel)>,
    /// The drawing of the graph.
    pub drawing: String,
}

impl Page<'_> {
    /// The page as HTML.
    pub fn to_html(&self) -> String {
        let title = escape(&self.title);
        let badge = if self.simulated {
            "<span class=\"badge\">simulated</span>"
        } else {
            ""
        };
        let about: String = paragraphs(&self.about);
        let warnings: String = self
            .warnings
            .iter()
            .map(|w| format!("<p class=\"warning\">{}</p>", escape(w)))
            .collect();
        let facts: String = self
            .facts
            .iter()
            .map(|(name, value)| format!("<dt>{}</dt><dd>{}</dd>", escape(name), escape(value)))
            .collect();
        let figures = self.plots();
        let signals: String = figures
            .iter()
            .map(|plot| format!("<figure>{}</figure>\n", plot.to_svg()))
            .collect();
        let simulated = if self.simulated {
            "<p class=\"remark\">Devices in this run were simulated: what is shown is what the models of them did, \
             not a measurement.</p>"
        } else {
            ""
        };
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width\">\n<meta name=\"color-scheme\" content=\"light dark\">\n\
             <title>{title}</title>\n<style>{}{PAGE_CSS}</style>\n</head>\n<body>\n<main>\n\
             <header><h1>{title} {badge}</h1>{about}</header>\n{warnings}\n\
             <section><h2>The run</h2><dl>{facts}</dl>{simulated}</section>\n\
             <section><h2>What happened</h2>\n{signals}</section>\n\
             <section><h2>The graph</h2>\n<figure class=\"wide\">{}</figure></section>\n\
             <footer>Made by haptograph {}</footer>\n</main>\n</body>\n</html>\n",
            theme::css(),
            self.drawing,
            env!("CARGO_PKG_VERSION"),
        )
    }

    /// The map first, as it tells what the rest means; then signals in the order of the graph.
    fn plots(&self) -> Vec<Plot> {
        let mut plots = Vec::new();
        for signal in &self.signals {
            let texture = self.textures.iter().find(|(name, _)| *name == signal.stream.name);
            plots.extend(figures::stroke_on_map(
                signal,
                texture.map(|(_, texture)| *texture),
            ));
        }
        let mut number = 0;
        for signal in &self.signals {
            let ink = Ink::number(number);
            plots.extend(figures::over_time(signal, ink));
            plots.extend(figures::mean_spectrum(signal, ink));
            plots.extend(figures::contact_path(signal));
            number += usize::from(matches!(signal.content, Content::Lanes(..) | Content::Events(..)));
        }
        plots
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
figure{margin:0 0 14px}figure svg{display:block}\
.wide{overflow-x:auto;width:min(96vw,1500px);position:relative;left:50%;transform:translateX(-50%)}\
.wide svg.figure{min-width:1000px;margin:0 auto}\
@media (prefers-color-scheme:dark){body{background:#14181d;color:#e8edf2}.badge{background:#412c1e;color:#f0a066}\
.warning{background:#412c1e;color:#f3cfae}.remark,footer,dt{color:#a3aeb9}}\
@media print{.wide{width:100%}.wide svg.figure{max-width:100%}}";

#[cfg(test)]
mod tests;
