//! The gallery: a card and a picture of each graph, and the choice of the one that runs.

use super::export::{open, plain};
use super::lock;
use super::server::{Options, StudioError, set_up};
use crate::describe;
use crate::load::{Copies, Source};
use crate::stage::Stage;
use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{Graph, check};
use haptograph_engine::registry::Registry;
use haptograph_engine::run::{FileSinks, Probe, Session, SessionOptions};
use haptograph_report::figures;
use haptograph_report::plotted::PlottedSignals;
use haptograph_report::theme::Ink;
use haptograph_surfaces::files::load;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};

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
        let mut paths = haptograph_signal::files::list(&folder);
        paths.retain(|path| path.extension().is_some_and(|ending| ending == "ron"));
        paths.sort_by_key(|path| (!path.ends_with(format!("{FIRST}.ron")), path.clone()));
        paths
    });
    all.collect()
}

/// What the gallery says of a graph.
#[derive(Debug, Clone)]
pub(super) struct Card {
    pub name: String,
    about: String,
    /// Name of the folder that holds the graph.
    folder: String,
    /// Why no studio runs it.
    pub why: Option<String>,
}

impl Card {
    pub(super) fn of(
        path: &Path,
        set: &[(String, String)],
        registry: &Registry,
    ) -> Result<Self, StudioError> {
        let text = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
        let folder = plain(path)?.parent().and_then(Path::file_name).map(ToOwned::to_owned);
        let about = checked(path, set, registry)?.about().to_owned();
        Ok(Self { name: text(path.file_stem()), about, folder: text(folder.as_deref()), why: None })
    }
}

/// The cards and the pages of the documentation as a page reads them.
pub(super) fn listing<'a>(cards: impl Iterator<Item = &'a Card>, docs: &[String]) -> Value {
    let card = |card: &Card| {
        json!({
            "name": card.name, "about": card.about, "folder": card.folder, "why": card.why,
            "picture": picture_path(&card.name),
        })
    };
    json!({ "docs": docs, "cards": cards.map(card).collect::<Vec<_>>() })
}

/// The address of a picture.
pub(super) fn picture_path(name: &str) -> String {
    format!("pictures/{name}.svg")
}

/// The graph of a file with simulated devices.
fn checked(path: &Path, set: &[(String, String)], registry: &Registry) -> Result<Graph, StudioError> {
    let document = Document::load(path, &LoadOptions::default()).map_err(StudioError::Graph)?;
    let source = Source::new(path.to_owned(), registry, set.to_vec());
    check(&document, registry, &source.options(&document)).map_err(StudioError::Graph)
}

/// What the first actuator of a graph does in the first seconds, or else what the first plot shows, as SVG.
pub(super) fn picture(
    path: &Path,
    set: &[(String, String)],
    registry: &Registry,
) -> Result<String, StudioError> {
    let graph = checked(path, set, registry)?;
    let mut sinks = FileSinks::new(&graph);
    let plotted = PlottedSignals::of(&graph, |watch, writer| {
        sinks.probe(Probe { node: watch.node, output: watch.output, writer });
    });
    Session::run_offline(sinks, &SessionOptions::default().seconds(SHOWN_S), &mut |_| ())
        .map_err(|error| StudioError::Other(format!("{}: {error}", path.display())))?;
    let actuator = graph.nodes().iter().find(|node| node.entry.is_actuator());
    let delivered = actuator.map(|node| format!("{}.", node.path));
    let requested = plotted.plots().first().map(|(request, _)| request.signals[0].stream.name.clone());
    let wanted = delivered.or(requested).unwrap_or_default();
    let mut signals = plotted.signals();
    signals.sort_by_key(|signal| !signal.stream.name.starts_with(&wanted));
    let plot = signals.iter().find_map(|signal| figures::over_time(signal, Ink::Blue).into_iter().next());
    let plot = plot.map(|plot| haptograph_report::plot::Plot { size: SIZE, ..plot });
    Ok(plot.unwrap_or_default().to_standalone_svg())
}

/// The files that a graph needs: its own, and those that its nodes name.
pub(super) fn needed(graph: &Graph) -> impl Iterator<Item = PathBuf> {
    let sources = graph.sources().iter().filter(|source| source.is_file);
    let sources = sources.map(|source| source.path.clone());
    sources.chain(graph.nodes().iter().flat_map(|node| node.files.clone()))
}

/// The surfaces in a graph's folder.
pub(super) fn beside(folder: &Path) -> impl Iterator<Item = PathBuf> {
    describe::surface_files(folder).into_iter().filter(|path| load(path).is_ok())
}

/// The graphs that a studio offers, and the pictures drawn so far.
pub(super) struct Gallery {
    graphs: Vec<PathBuf>,
    options: Options,
    registry: Registry,
    copies: Copies,
    cards: OnceLock<Value>,
    pictures: Mutex<BTreeMap<String, String>>,
}

impl Gallery {
    /// The graphs of a folder, and the stage of the first.
    pub(super) fn open(
        options: &Options,
        registry: &Registry,
        copies: Copies,
    ) -> Result<(Self, Stage), StudioError> {
        let (cards, pictures) = <_>::default();
        let graphs = shipped(&copies.from);
        let first = graphs.first().cloned().unwrap_or_default();
        let (options, registry) = (options.clone(), registry.clone());
        let gallery = Self { graphs, options, registry, copies, cards, pictures };
        let stage = gallery.stage(first)?;
        Ok((gallery, stage))
    }

    fn stage(&self, graph: PathBuf) -> Result<Stage, StudioError> {
        let mut stage = set_up(&Options { graph, ..self.options.clone() }, &self.registry)?;
        stage.source.copies = Some(self.copies.clone());
        Ok(stage)
    }

    /// The cards of all graphs, with the reason for each that cannot run here.
    pub(super) fn listing(&self) -> &Value {
        self.cards.get_or_init(|| {
            let card = |path: &PathBuf| {
                let why = open(path, &[], &self.registry).err().map(|error| error.to_string());
                Some(Card { why, ..Card::of(path, &[], &self.registry).ok()? })
            };
            let cards: Vec<Card> = self.graphs.iter().filter_map(card).collect();
            listing(cards.iter(), &[])
        })
    }

    fn path(&self, name: &str) -> Option<&PathBuf> {
        self.graphs.iter().find(|path| path.file_stem().is_some_and(|stem| stem == name))
    }

    /// The picture of a graph.
    pub(super) fn picture(&self, name: &str) -> Option<String> {
        let path = self.path(name)?;
        let mut pictures = self.pictures.lock().unwrap_or_else(PoisonError::into_inner);
        if !pictures.contains_key(name) {
            pictures.insert(name.to_owned(), picture(path, &[], &self.registry).ok()?);
        }
        pictures.get(name).cloned()
    }

    /// Runs another graph, unless an actuator is armed. Its pages reconnect; after a STOP it waits to be resumed, too.
    pub(super) fn choose(&self, stage: &Mutex<Stage>, name: &str) -> Result<(), StudioError> {
        let missing = || StudioError::Other(format!("there is no graph `{name}` in the gallery"));
        let path = self.path(name).ok_or_else(missing)?;
        let is_armed = || {
            let running = lock(stage);
            match running.devices.switch.is_armed() {
                true => Err(StudioError::Other("an actuator is armed: disarm it first".to_owned())),
                false => Ok(running),
            }
        };
        if is_armed()?.source.path == *path {
            return Ok(());
        }
        let mut next = self.stage(path.clone())?;
        let mut running = is_armed()?;
        if running.refuse_after_stop("begin").is_err() {
            next.halt();
        }
        // Messages of pages that are still leaving reach nobody.
        next.pages.next = running.pages.next;
        let before = std::mem::replace(&mut *running, next);
        drop(running);
        drop(before);
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
        assert_eq!((lock(&stage).source.name(), lock(&stage).pages.next), ("click".to_owned(), 7));
        assert!(lock(&stage).cycle.state == State::Running);
        lock(&stage).halt();
        gallery.choose(&stage, FIRST).expect("it ships");
        assert!(lock(&stage).cycle.state == State::Stopped);
        assert!(!place.path().join("saved").exists());
    }
}
