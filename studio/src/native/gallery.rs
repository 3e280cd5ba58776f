//! The gallery: a card and a picture of each graph, and the choice of the one that runs.

use super::lock;
use super::server::{Options, StudioError, set_up};
use crate::load::{Copies, Source};
use crate::stage::Stage;
use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{Graph, check};
use haptograph_engine::registry::Registry;
use haptograph_engine::run::{FileSinks, Probe, Session, SessionOptions};
use haptograph_report::figures;
use haptograph_report::plot::Plot;
use haptograph_report::plotted::PlottedSignals;
use haptograph_report::theme::Ink;
use haptograph_signal::files::list;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock};

/// The file that lists the cards.
pub(super) const LISTING: &str = "gallery.json";
/// Part of a run that a picture shows, s, and its size, pixels.
const SHOWN_S: f64 = 2.0;
const SIZE: (f64, f64) = (420.0, 190.0);
/// The graph that comes first.
const FIRST: &str = "texturepad";

/// The graphs of a folder and of its cookbook: those of the folder first, with the TexturePad in front.
pub fn shipped(folder: &Path) -> Vec<PathBuf> {
    let all = [folder.to_owned(), folder.join("cookbook")].into_iter().flat_map(|folder| {
        let mut paths = list(&folder);
        paths.retain(|path| path.extension().is_some_and(|ending| ending == "ron"));
        paths.sort_by_key(|path| (!path.ends_with(format!("{FIRST}.ron")), path.clone()));
        paths
    });
    all.collect()
}

/// What the gallery says of a graph.
pub(super) fn card(source: &Source) -> Result<Value, StudioError> {
    let folder = source.folder().file_name().unwrap_or_default().to_string_lossy();
    let (name, about) = (source.name(), checked(source)?.about().to_owned());
    let picture = format!("pictures/{name}.svg");
    Ok(json!({ "name": name, "about": about, "folder": folder, "picture": picture }))
}

/// The graph of a file with simulated devices.
fn checked(source: &Source) -> Result<Graph, StudioError> {
    let document = Document::load(&source.path, &LoadOptions::default()).map_err(StudioError::Graph)?;
    check(&document, &source.registry, &source.options(&document)).map_err(StudioError::Graph)
}

/// What the first actuator of a graph does in the first seconds, or else what the first plot shows, as SVG.
pub(super) fn picture(source: &Source) -> Result<String, StudioError> {
    let graph = checked(source)?;
    let mut sinks = FileSinks::new(&graph);
    let plotted = PlottedSignals::of(&graph, |watch, writer| {
        sinks.probe(Probe { node: watch.node, output: watch.output, writer });
    });
    Session::run_offline(sinks, &SessionOptions::default().seconds(SHOWN_S), &mut |_| ())
        .map_err(|error| StudioError::Other(format!("{}: {error}", source.path.display())))?;
    let delivered =
        graph.nodes().iter().find(|node| node.entry.is_actuator()).map(|node| node.path.clone() + ".");
    let requested =
        || plotted.plots().iter().find_map(|(request, _)| Some(request.signals.first()?.stream.name.clone()));
    let wanted = delivered.or_else(requested).unwrap_or_default();
    let mut signals = plotted.signals();
    signals.sort_by_key(|signal| !signal.stream.name.starts_with(&wanted));
    let plot = signals.iter().find_map(|signal| figures::over_time(signal, Ink::Blue).into_iter().next());
    Ok(Plot { size: SIZE, ..plot.unwrap_or_default() }.to_standalone_svg())
}

/// The graphs that a studio offers.
pub(super) struct Gallery {
    graphs: Vec<Source>,
    options: Options,
    copies: Copies,
    cards: OnceLock<Value>,
}

impl Gallery {
    /// The graphs of a folder, and the stage of the first.
    pub(super) fn open(
        options: &Options,
        registry: &Registry,
        copies: Copies,
    ) -> Result<(Self, Stage), StudioError> {
        let source = |path| Source::new(path, registry, Vec::new());
        let graphs: Vec<Source> = shipped(&copies.from).into_iter().map(source).collect();
        let gallery = Self { graphs, options: options.clone(), copies, cards: OnceLock::new() };
        let none = || StudioError::Other(format!("{} holds no graph", gallery.copies.from.display()));
        let stage = gallery.stage(gallery.graphs.first().ok_or_else(none)?)?;
        Ok((gallery, stage))
    }

    fn stage(&self, Source { path, registry, .. }: &Source) -> Result<Stage, StudioError> {
        let mut stage = set_up(&Options { graph: path.clone(), ..self.options.clone() }, registry)?;
        stage.source.copies = Some(self.copies.clone());
        Ok(stage)
    }

    /// The cards of all graphs.
    pub(super) fn listing(&self) -> &Value {
        self.cards.get_or_init(|| {
            let cards = self.graphs.iter().filter_map(|source| card(source).ok());
            json!({ "cards": cards.collect::<Vec<_>>(), "docs": [] })
        })
    }

    fn graph(&self, name: &str) -> Option<&Source> {
        self.graphs.iter().find(|source| source.name() == name)
    }

    /// The picture of a graph.
    pub(super) fn picture(&self, name: &str) -> Option<String> {
        picture(self.graph(name)?).ok()
    }

    /// Runs another graph, unless an actuator is armed. Its pages reconnect; after a STOP it waits to be resumed, too.
    pub(super) fn choose(&self, stage: &Mutex<Stage>, name: &str) -> Result<(), StudioError> {
        let missing = || StudioError::Other(format!("there is no graph `{name}` in the gallery"));
        let graph = self.graph(name).ok_or_else(missing)?;
        let is_armed = || {
            let running = lock(stage);
            let armed = || StudioError::Other("an actuator is armed: disarm it first".to_owned());
            if running.devices.switch.is_armed() { Err(armed()) } else { Ok(running) }
        };
        if is_armed()?.source.path == graph.path {
            return Ok(());
        }
        let mut next = self.stage(graph)?;
        let mut running = is_armed()?;
        if running.refuse_after_stop("begin").is_err() {
            next.halt();
        }
        // Messages of pages that are still leaving reach nobody.
        next.pages.next = running.pages.next;
        let before = std::mem::replace(&mut *running, next);
        drop((running, before));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_cycle::State;

    #[test]
    fn no_graph_is_chosen_while_an_actuator_is_armed_and_a_stop_stays() {
        let place = tempfile::tempdir().expect("a folder");
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").canonicalize().expect("they ship");
        let options = Options {
            graph: from.clone(),
            set: Vec::new(),
            endpoints: None,
            port: 0,
            out: place.path().to_owned(),
            surfaces: Vec::new(),
            lan: None,
            learner: None,
        };
        let copies = Copies { from, to: place.path().join("saved") };
        let opened = Gallery::open(&options, &haptograph_nodes::registry(), copies);
        let (gallery, stage) = opened.expect("they ship");
        let stage = Mutex::new(stage);
        lock(&stage).devices.switch.arm(0.1);
        assert!(gallery.choose(&stage, "click").is_err());
        assert_eq!(lock(&stage).source.name(), FIRST);
        lock(&stage).devices.switch.disarm();
        lock(&stage).pages.next = 7;
        gallery.choose(&stage, "click").expect("it ships");
        {
            let mut stage = lock(&stage);
            assert_eq!((stage.source.name(), stage.pages.next), ("click".to_owned(), 7));
            assert!(stage.cycle.state == State::Running);
            stage.halt();
        }
        gallery.choose(&stage, FIRST).expect("it ships");
        assert!(lock(&stage).cycle.state == State::Stopped);
        assert!(!place.path().join("saved").exists());
    }
}
