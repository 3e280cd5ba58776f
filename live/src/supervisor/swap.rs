//! Swap of the running graph for a saved or changed one.

use super::history::History;
use super::loading::{LoadOutcome, LoadedGraph, Loading};
use super::requests::{PendingChange, Verbosity};
use super::{DeviceUse, Event, Origin, Request, SavedGraph, Supervisor};
use crate::watch::FileWatch;
use haptograph_engine::diagnostic::Diagnostics;
use haptograph_engine::graph::Graph;
use haptograph_engine::run::{Change, Changed};
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Subfolder of the run's folder for graphs saved during the run.
pub const CHANGES: &str = "changes";

/// A graph that was swapped in.
struct SwappedGraph {
    graph: Graph,
    change: Change,
    /// Watches its files, from their state when it was loaded.
    watch: FileWatch,
    /// True if its texts differ from those of the previous graph.
    is_saved: bool,
    /// The live settings with new values.
    set: Vec<(String, f64)>,
}

/// The effect of a swap.
struct Difference {
    changed: Changed,
    set: Vec<(String, f64)>,
}

impl Supervisor {
    /// Swaps a loaded graph in, if possible.
    pub(super) fn swap_loaded(
        &mut self,
        change: PendingChange,
        loaded: LoadOutcome,
        loading: &Loading,
        verbosity: Verbosity,
    ) {
        self.edits.known = loaded.known;
        let swapped = match loaded.result {
            Ok(ready) => self.swap_in(ready, loading, (verbosity, &change)),
            Err(wrong) => {
                if verbosity >= Verbosity::Refusals {
                    self.events.push(Event::Findings(wrong));
                }
                self.refuse(verbosity, "the running graph is unchanged".to_owned());
                None
            }
        };
        let Some(swapped) = swapped else {
            return self.reject(change);
        };
        self.parameters.source.set = loaded.set;
        self.parameters.typed = loaded.typed.unwrap_or_else(|| std::mem::take(&mut self.parameters.typed));
        self.parameters.known = loaded.parameters;
        match change {
            PendingChange::Set(request) => {
                let name = &request.name;
                let default = self.parameters.known.iter().find(|(known, _)| known == name);
                let default = default.and_then(|(_, text)| text.clone());
                self.parameters.typed.retain(|(known, _)| known != name);
                self.parameters.typed.push((name.clone(), default));
                // A file saved just before still triggers the watch, which may find that this graph already
                // runs.
                if swapped.is_saved || !matches!(swapped.change, Change::Settings(_)) {
                    self.keep(&swapped);
                }
                if let Some(watch) = &mut self.edits.watch {
                    watch.also(swapped.watch);
                }
                self.note(true, request);
            }
            PendingChange::Saved => {
                if swapped.change != Change::Settings(0) {
                    self.keep(&swapped);
                    let at_s = self.record.start.elapsed().as_secs_f64();
                    self.record.history.saved(at_s, swapped.change, &swapped.set);
                }
                // A changed graph may read other files.
                if let Some(watch) = &mut self.edits.watch {
                    watch.turn_to(swapped.watch);
                }
            }
        }
    }

    /// Copies the files of a saved graph into the run's folder for later reference.
    fn keep(&mut self, swapped: &SwappedGraph) {
        // Bounded: a fader may change the graph a hundred times per second.
        let Some(folder) = self.folder.as_ref().filter(|_| self.record.saved.len() < History::MAX) else {
            return;
        };
        let place = Path::new(CHANGES).join((self.record.saved.len() + 1).to_string());
        let folder = folder.join(&place);
        let written = fs::create_dir_all(&folder).and_then(|()| {
            let sources = swapped.graph.sources().iter();
            for (number, source) in sources.filter(|source| source.is_file).enumerate() {
                let name = source.path.file_name().unwrap_or_default().to_string_lossy();
                let file = match folder.join(&*name) {
                    file if file.exists() => folder.join(format!("{number}-{name}")),
                    file => file,
                };
                fs::write(file, source.text.as_bytes())?;
            }
            Ok(())
        });
        if let Err(error) = written {
            let place = place.display();
            let text = format!("cannot copy the saved graph to {place}: {error}");
            self.events.push(Event::NotKept(text));
        }
        let set = swapped.set.iter();
        self.record.saved.push(SavedGraph {
            at_s: (self.record.start.elapsed().as_secs_f64() * 100.0).round() / 100.0,
            what: swapped.change.to_string(),
            change: swapped.change.code().to_owned(),
            set: set.map(|(name, value)| format!("{name}={value}")).collect(),
            graph: place.to_string_lossy().into_owned(),
        });
    }

    /// Swaps a graph in; on failure nothing changes.
    fn swap_in(
        &mut self,
        ready: LoadedGraph,
        loading: &Loading,
        (verbosity, change): (Verbosity, &PendingChange),
    ) -> Option<SwappedGraph> {
        let mut graph = ready.graph;
        if verbosity == Verbosity::All && !graph.warnings().is_empty() {
            self.events.push(Event::Findings(Diagnostics {
                sources: graph.sources().clone(),
                list: graph.warnings().to_vec(),
            }));
        }
        let is_remote = matches!(change, PendingChange::Set(Request { origin: Origin::Osc, .. }));
        let guarded = match is_remote && ready.protected != self.edits.protected {
            true => Err("limits and devices can only be changed in the file or from the terminal".to_owned()),
            false => Ok(()),
        };
        let accepted = (self.edits.accept)(&graph).and(guarded);
        let changed = accepted.and_then(|()| self.change(&mut graph));
        let Difference { changed, set } = match changed {
            Ok(difference) => difference,
            Err(why) => {
                self.refuse(verbosity, format!("the running graph is unchanged: {why}"));
                return None;
            }
        };
        // The file may have been edited meanwhile, so a swap is always reported.
        if verbosity == Verbosity::All || !matches!(changed.change, Change::Settings(_)) {
            let by = if matches!(change, PendingChange::Saved) { "saved" } else { "set" };
            let text = describe(&changed, &set, by, loading.elapsed());
            self.events.push(Event::Changed(changed.change, text));
        }
        let limits = ready.protected.changes(&self.edits.protected);
        self.events.extend(limits.into_iter().map(Event::Limit));
        self.edits.protected = ready.protected;
        let before = std::mem::replace(&mut self.edits.texts, ready.texts);
        Some(SwappedGraph {
            is_saved: before != self.edits.texts,
            graph,
            change: changed.change,
            set,
            watch: ready.watch,
        })
    }

    /// Connects the devices of a graph and hands the graph to the drivers.
    fn change(&mut self, graph: &mut Graph) -> Result<Difference, String> {
        let before: HashMap<String, f64> =
            self.session.settings().map(|live| (live.name(), live.value)).collect();
        let changed = self.drivers.replace(graph, |graph| match &self.folder {
            Some(folder) => self.session.change(graph, folder),
            None => self.session.change_without_files(graph),
        })?;
        let now = graph.live_settings().into_iter();
        let now = now.map(|live| (live.name(), live.value));
        let set = now.filter(|(name, value)| before.get(name).is_some_and(|then| then != value));
        let set = set.collect();
        self.requests.settings.rebind(self.session.settings());
        for device in DeviceUse::of(graph) {
            if !self.record.devices.contains(&device) {
                self.record.devices.push(device);
            }
        }
        self.record.changes += 1;
        self.record.swaps += u32::from(!matches!(changed.change, Change::Settings(_)));
        Ok(Difference { changed, set })
    }
}

/// Message about a change; `by` is its origin.
fn describe(changed: &Changed, set: &[(String, f64)], by: &str, took: Duration) -> String {
    let mut text = match (changed.change, set) {
        (Change::Settings(_), [_, ..]) => format!("{by}: {}", settings_text(set)),
        (change, _) => change.to_string(),
    };
    for (paths, what) in [
        (&changed.begun, "begins"),
        (&changed.ended, "is complete"),
        (&changed.left_out, "has other signals now and is not restarted"),
    ] {
        for path in paths {
            let name = path.file_name().unwrap_or(path.as_os_str()).display();
            text += &format!("; {name} {what}");
        }
    }
    let does = match changed.change {
        Change::Settings(0) => "",
        _ => "taken over in ",
    };
    text + &format!(" ({does}{:.0} ms)", took.as_secs_f64() * 1e3)
}

/// The first few settings as `name=value`.
pub(super) fn settings_text(set: &[(String, f64)]) -> String {
    const SHOWN: usize = 4;
    let first = set.iter().take(SHOWN);
    let first: Vec<String> = first.map(|(name, value)| format!("{name}={value}")).collect();
    let more = match set.len().saturating_sub(SHOWN) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    first.join(", ") + &more
}
