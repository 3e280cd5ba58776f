//! The page that a run leaves behind: one HTML file, everything in it, nothing fetched.

pub(super) mod signals;

use super::asked::{Asked, Drawn, Trace};
use super::figures;
use super::headlines::{Headline, cards, of_signals};
use super::inks::Inks;
use super::player;
use super::plot::Plot;
use super::record::{Friction, Recorded};
use super::sound::Sound;
use super::svg::escape;
use super::theme;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use haptograph_surfaces::TextureModel;
use sha2::{Digest, Sha256};

/// What a page shows.
#[derive(Debug, Default)]
pub struct Page<'a> {
    /// Name of the graph.
    pub title: String,
    /// What the graph is about, as its file tells it.
    pub about: String,
    /// What of it comes from simulated devices.
    pub simulation: Simulation,
    /// The numbers to read first, before those of the sound.
    pub headlines: Vec<Headline>,
    /// What tells the friction, of the signals.
    pub friction: Option<Friction>,
    /// What is to be known of the run: names and values.
    pub facts: Vec<(String, String)>,
    /// What the reader should be warned of: limits that held back, faults, a run cut short.
    pub warnings: Vec<String>,
    /// The files beside the page: names, and what they hold.
    pub files: Vec<(String, String)>,
    /// What there is to hear.
    pub sound: Option<&'a Sound>,
    /// The plots that the graph asks for, each with a trace for each of its signals.
    pub asked: Vec<(&'a Asked, &'a [Trace])>,
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
    /// All that it is of, in whole sentences.
    Whole(String),
}

impl Simulation {
    /// Beside the title.
    pub(super) fn badge(&self) -> &'static str {
        match self {
            Self::None => "",
            Self::All | Self::Whole(_) => "simulated",
            Self::Some(_) => "partly simulated",
        }
    }

    /// Below the facts, as HTML.
    pub(super) fn remark(&self) -> String {
        let text = match self {
            Self::None => return String::new(),
            Self::All => ALL_SIMULATED,
            Self::Some(text) | Self::Whole(text) => text,
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
        let mut headlines = of_signals(self.sound, &self.signals, self.friction.as_ref());
        headlines.extend(self.headlines.iter().cloned());
        let heads = cards(&headlines) + &self.simulation.remark();
        let mut inks = Inks::default();
        let mut main: Vec<Plot> = Vec::new();
        for (asked, traces) in &self.asked {
            let run = Drawn { name: "", traces };
            main.extend(asked.plots(&[run], &mut inks));
        }
        main.extend(self.maps());
        line_up(&mut main, &self.signals);
        let signals = signals::section(&self.signals, &self.asked, &mut inks);
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
            let texture = texture.map(|(_, texture)| *texture);
            figures::strokes_on_map(&[("stroke", signal)], texture)
        })
    }

    fn list_files(&self) -> String {
        let entry = |(name, holds): &(String, String)| {
            let (address, name) = (address(name), escape(name));
            format!(
                "<dt><a href=\"{address}\">{name}</a></dt><dd>{}</dd>",
                escape(holds)
            )
        };
        match self.files.as_slice() {
            [] => String::new(),
            files => format!("<dl>{}</dl>", files.iter().map(entry).collect::<String>()),
        }
    }
}

/// Lets plots over time show the whole run, so that moments lie under one another.
pub(super) fn line_up<'a>(plots: &mut [Plot], signals: impl IntoIterator<Item = &'a Recorded>) {
    let end_s = signals.into_iter().map(Recorded::duration_s).fold(0.0, f64::max);
    for plot in plots.iter_mut().filter(|plot| plot.x.is_time && end_s > 0.0) {
        plot.x.range = plot.x.range.or(Some((0.0, end_s)));
    }
}

/// Names and values.
pub(super) fn facts(facts: &[(String, String)]) -> String {
    let fact =
        |(name, value): &(String, String)| format!("<dt>{}</dt><dd>{}</dd>", escape(name), escape(value));
    match facts {
        [] => String::new(),
        facts => format!("<dl>{}</dl>", facts.iter().map(fact).collect::<String>()),
    }
}

/// A file's name as an address relative to the page: whatever has a meaning there is written as its bytes.
pub(super) fn address(name: &str) -> String {
    let letter = |byte: u8| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'/' => char::from(byte).to_string(),
        other => format!("%{other:02X}"),
    };
    let address: String = name.bytes().map(letter).collect();
    // A first part with a colon would be a scheme; here it cannot, and no name begins with a slash.
    format!("./{}", address.trim_start_matches('/'))
}

/// Plots as figures of a sheet.
pub(super) fn figures_of(plots: &[Plot]) -> String {
    plots.iter().map(Plot::to_figure).collect()
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
             <div class=\"tools\" hidden=\"\"><span class=\"fine\">Drag over a plot to zoom, double-click for the whole.</span></div>\n\
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
    parts.map(|part| format!("<p>{}</p>", escape(part))).collect()
}

const STYLE: &str = include_str!("page/style.css");
const SCRIPT: &str = include_str!("page/script.js");

/// What a browser may do with a page: show what is in it and run its own script, and fetch nothing.
fn policy() -> String {
    let hash = STANDARD.encode(Sha256::digest(SCRIPT));
    format!(
        "default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'; script-src 'sha256-{hash}'"
    )
}

#[cfg(test)]
mod tests;
