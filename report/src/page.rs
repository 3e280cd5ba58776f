//! The page of a run: one HTML file without external resources.

pub(super) mod signals;

use super::headlines::{Headline, cards, of_signals};
use super::inks::Inks;
use super::player;
use super::plot::Plot;
use super::plot_request::{PlotRequest, RunTraces, Trace};
use super::plotted::{PlottedSignals, textures};
use super::record::{Friction, Recorded, friction};
use super::sound::Sound;
use super::svg::escape;
use super::theme;
use super::{drawing, figures};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use haptograph_engine::graph::Graph;
use haptograph_surfaces::TextureModel;
use sha2::{Digest, Sha256};

/// Content of a page.
#[derive(Debug, Default)]
pub struct Page<'a> {
    /// Name of the graph.
    pub title: String,
    /// The description in the graph's file.
    pub about: String,
    /// The simulated part of the run.
    pub simulation: Simulation,
    /// Headlines, shown before those of the sound.
    pub headlines: Vec<Headline>,
    /// The signals that yield the friction coefficient.
    pub friction: Option<Friction>,
    /// The facts of the run: names and values.
    pub facts: Vec<(String, String)>,
    /// Warnings: active limits, NaN or infinity, an interrupted run.
    pub warnings: Vec<String>,
    /// The files beside the page: names and contents.
    pub files: Vec<(String, String)>,
    /// The sound to play.
    pub sound: Option<&'a Sound>,
    /// The plots requested by the graph, each with a trace per signal.
    pub requests: Vec<(&'a PlotRequest, Vec<Trace>)>,
    /// The signals.
    pub signals: Vec<Recorded>,
    /// The texture of a signal on a map, by the signal's name.
    pub textures: Vec<(String, TextureModel)>,
    /// The drawing of the graph.
    pub drawing: String,
}

/// The simulated part of a run.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Simulation {
    /// Nothing.
    #[default]
    None,
    /// All devices.
    All,
    /// Some devices, named in whole sentences.
    Some(String),
    /// All data, described in whole sentences.
    Whole(String),
}

impl Simulation {
    /// Badge beside the title.
    pub(super) fn badge(&self) -> &'static str {
        match self {
            Self::None => "",
            Self::All | Self::Whole(_) => "simulated",
            Self::Some(_) => "partly simulated",
        }
    }

    /// Remark below the facts, as HTML.
    pub(super) fn remark(&self) -> String {
        let text = match self {
            Self::None => return String::new(),
            Self::All => ALL_SIMULATED,
            Self::Some(text) | Self::Whole(text) => text,
        };
        format!("<p class=\"remark\">{}</p>", escape(text))
    }
}

/// Remark if all devices are simulated.
const ALL_SIMULATED: &str = "All devices in this run were simulated: the results show the behaviour of their models, not a \
    measurement.";

impl<'a> Page<'a> {
    /// The page of a run with its signals, plots and sound, without facts, headlines and files.
    pub fn of(graph: &Graph, plotted: &'a PlottedSignals, sound: Option<&'a Sound>) -> Self {
        Self {
            about: graph.about().to_owned(),
            friction: friction(graph),
            sound,
            requests: plotted.plots(),
            signals: plotted.signals(),
            textures: textures(graph),
            drawing: drawing::svg(graph, ""),
            ..Self::default()
        }
    }

    /// The page as HTML.
    pub fn to_html(&self) -> String {
        let mut headlines = of_signals(self.sound, &self.signals, self.friction.as_ref());
        headlines.extend(self.headlines.iter().cloned());
        let heads = cards(&headlines) + &self.simulation.remark();
        let mut inks = Inks::default();
        let mut main: Vec<Plot> = Vec::new();
        for (request, traces) in &self.requests {
            let run = RunTraces { name: "", traces };
            main.extend(request.plots(&[run], &mut inks));
        }
        main.extend(self.maps());
        line_up(&mut main, &self.signals);
        let signals = signals::section(&self.signals, &self.requests, &mut inks);
        let drawing = match self.drawing.as_str() {
            "" => String::new(),
            drawing => format!("<figure class=\"wide\">{drawing}</figure>"),
        };
        let sections = [
            ("", heads),
            ("Listen", self.sound.map_or_else(String::new, player::section)),
            ("The graph", drawing),
            ("What happened", figures_of(&main)),
            ("Signals", signals),
            ("Files", self.list_files()),
            ("The run", facts(&self.facts)),
        ];
        Sheet {
            title: &self.title,
            about: &self.about,
            badge: self.simulation.badge(),
            warnings: &self.warnings,
            sections: &sections,
        }
        .to_html()
    }

    fn maps(&self) -> impl Iterator<Item = Plot> {
        self.signals.iter().filter_map(|signal| {
            let texture = self.textures.iter().find(|(name, _)| *name == signal.stream.name);
            figures::strokes_on_map(&[("stroke", signal)], texture.map(|(_, texture)| texture))
        })
    }

    fn list_files(&self) -> String {
        let entry = |(name, holds): &(String, String)| {
            let (address, name) = (address(name), escape(name));
            format!("<dt><a href=\"{address}\">{name}</a></dt><dd>{}</dd>", prose(holds))
        };
        match self.files.as_slice() {
            [] => String::new(),
            files => format!("<dl>{}</dl>", files.iter().map(entry).collect::<String>()),
        }
    }
}

/// Extends plots over time to the whole run, so that equal times are aligned.
pub(super) fn line_up<'a>(plots: &mut [Plot], signals: impl IntoIterator<Item = &'a Recorded>) {
    let end_s = signals.into_iter().map(Recorded::duration_s).fold(0.0, f64::max);
    for plot in plots.iter_mut().filter(|plot| plot.x.is_time && end_s > 0.0) {
        plot.x.range = plot.x.range.or(Some((0.0, end_s)));
    }
}

/// A list of names and values.
pub(super) fn facts(facts: &[(String, String)]) -> String {
    let fact =
        |(name, value): &(String, String)| format!("<dt>{}</dt><dd>{}</dd>", escape(name), prose(value));
    match facts {
        [] => String::new(),
        facts => format!("<dl>{}</dl>", facts.iter().map(fact).collect::<String>()),
    }
}

/// A file name as a URL relative to the page; reserved characters are percent-encoded.
pub(super) fn address(name: &str) -> String {
    let letter = |byte: u8| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'/' => char::from(byte).to_string(),
        other => format!("%{other:02X}"),
    };
    let address: String = name.bytes().map(letter).collect();
    // The prefix keeps a name with a colon from being read as a scheme.
    format!("./{}", address.trim_start_matches('/'))
}

/// Plots as figures of a page.
pub(super) fn figures_of(plots: &[Plot]) -> String {
    plots.iter().map(Plot::to_figure).collect()
}

/// An HTML file with a header and titled sections; empty sections are omitted.
pub(super) struct Sheet<'a> {
    pub title: &'a str,
    pub about: &'a str,
    /// Badge beside the title; omitted if empty.
    pub badge: &'a str,
    pub warnings: &'a [String],
    pub sections: &'a [(&'a str, String)],
}

impl Sheet<'_> {
    pub(crate) fn to_html(&self) -> String {
        let title = escape(self.title);
        let badge = match self.badge {
            "" => String::new(),
            badge => format!("<span class=\"badge\">{badge}</span>"),
        };
        let warnings: String =
            self.warnings.iter().map(|w| format!("<p class=\"warning\">{}</p>", prose(w))).collect();
        let sections: String = self
            .sections
            .iter()
            .filter(|(_, content)| !content.is_empty())
            .map(|(name, content)| match *name {
                "" => format!("<section>{content}</section>\n"),
                name => format!("<section><h2>{}</h2>\n{content}</section>\n", escape(name)),
            })
            .collect();
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"{}\">\n\
             <meta name=\"viewport\" content=\"width=device-width\">\n<meta name=\"color-scheme\" content=\"light dark\">\n\
             <title>{title}</title>\n<style>{}{}{}{STYLE}</style>\n</head>\n<body>\n<main>\n\
             <header><h1>{title} {badge}</h1>{}</header>\n{warnings}\n\
             <div class=\"tools\" hidden=\"\"><span class=\"fine\">Drag over a plot to zoom, double-click to reset.</span></div>\n\
             {sections}<footer>Made by haptograph {}</footer>\n</main>\n<script>{SCRIPT}</script>\n</body>\n</html>\n",
            policy(),
            theme::css(),
            theme::DOTS,
            theme::grounds(),
            paragraphs(self.about),
            env!("CARGO_PKG_VERSION"),
        )
    }
}

fn paragraphs(text: &str) -> String {
    let parts = text.split("\n\n").map(str::trim).filter(|part| !part.is_empty());
    parts.map(|part| format!("<p>{}</p>", prose(part))).collect()
}

/// Text as HTML, with names between backticks as code.
fn prose(text: &str) -> String {
    let escaped = escape(text);
    if escaped.matches('`').count() % 2 == 1 {
        return escaped;
    }
    let parts = escaped.split('`').enumerate();
    let shown = parts.map(|(i, part)| match i % 2 {
        0 => part.to_owned(),
        _ => format!("<code>{part}</code>"),
    });
    shown.collect()
}

const STYLE: &str = include_str!("page/style.css");
const SCRIPT: &str = include_str!("page/script.js");

/// Content security policy of a page: its own content and script only, no requests.
fn policy() -> String {
    let hash = STANDARD.encode(Sha256::digest(SCRIPT));
    format!(
        "default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'; script-src 'sha256-{hash}'"
    )
}

#[cfg(test)]
mod tests;
