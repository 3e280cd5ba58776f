//! Swap of the running graph for a saved or changed one.

use super::super::super::{eprint, warnings};
use super::super::drivers::Drivers;
use super::super::history::History;
use super::super::loading::{LoadOutcome, LoadedGraph, Loading};
use super::super::watch::FileWatch;
use super::{CHANGES, PendingChange, Supervisor, Verbosity, show};
use crate::engine::graph::Graph;
use crate::engine::run::{Change, Changed};
use serde_json::json;
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::time::Duration;

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
        driver: &Drivers,
        change: PendingChange,
        loaded: LoadOutcome,
        loading: &Loading,
        verbosity: Verbosity,
    ) {
        self.known = loaded.known;
        let swapped = match loaded.result {
            Ok(ready) => self.swap_in(driver, ready, loading, (verbosity, &change)),
            Err(wrong) => {
                show(&wrong, verbosity);
                verbosity.refusal("the running graph is unchanged\n");
                None
            }
        };
        let Some(swapped) = swapped else {
            return self.reject(change);
        };
        self.arguments.set = loaded.set;
        self.typed = loaded.typed.unwrap_or_else(|| std::mem::take(&mut self.typed));
        self.parameters = loaded.parameters;
        match change {
            PendingChange::Set { name, value, origin } => {
                let default = self.parameters.iter().find(|(known, _)| *known == name);
                let default = default.and_then(|(_, text)| text.clone());
                self.typed.retain(|(known, _)| *known != name);
                self.typed.push((name.clone(), default));
                // A file saved just before still triggers the watch, which may find that this graph already
                // runs.
                if swapped.is_saved || !matches!(swapped.change, Change::Settings(_)) {
                    self.keep(&swapped);
                }
                if let Some(watch) = &mut self.watch {
                    watch.also(swapped.watch);
                }
                self.note(true, name, &value, origin);
            }
            PendingChange::Saved => {
                if swapped.change != Change::Settings(0) {
                    self.keep(&swapped);
                    let at_s = self.start.elapsed().as_secs_f64();
                    self.history.saved(at_s, swapped.change, &swapped.set);
                }
                // A changed graph may read other files.
                if let Some(watch) = &mut self.watch {
                    watch.turn_to(swapped.watch);
                }
            }
        }
    }

    /// Copies the files of a saved graph into the run's folder for later reference.
    fn keep(&mut self, swapped: &SwappedGraph) {
        // Bounded: a fader may change the graph a hundred times per second.
        if self.saved.len() >= History::MAX {
            return;
        }
        let place = Path::new(CHANGES).join((self.saved.len() + 1).to_string());
        let folder = self.folder.join(&place);
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
            eprint(&format!(
                "cannot copy the saved graph to {}: {error}\n",
                place.display()
            ));
        }
        let at_s = (self.start.elapsed().as_secs_f64() * 100.0).round() / 100.0;
        let set: Vec<String> = swapped
            .set
            .iter()
            .map(|(name, value)| format!("{name}={value}"))
            .collect();
        self.saved.push(json!({
            "at_s": at_s, "what": swapped.change.to_string(), "set": set, "graph": place.to_string_lossy(),
        }));
    }

    /// Swaps a graph in; on failure nothing changes.
    fn swap_in(
        &mut self,
        driver: &Drivers,
        ready: LoadedGraph,
        loading: &Loading,
        (verbosity, change): (Verbosity, &PendingChange),
    ) -> Option<SwappedGraph> {
        let mut graph = ready.graph;
        if verbosity == Verbosity::All {
            show(&warnings(&graph), verbosity);
        }
        let unfit = ready
            .card_requests
            .and_then(|requests| match driver.mismatch(&requests) {
                Some(what) => Err(format!("it needs {what}; start a new run for it")),
                None => ready.own_files,
            });
        let guarded = match verbosity < Verbosity::All && ready.protected != self.protected {
            true => Err("limits and devices can only be changed in the file or from the terminal".to_owned()),
            false => Ok(()),
        };
        let changed = unfit.and(guarded).and_then(|()| self.change(&mut graph));
        let Difference { changed, set } = match changed {
            Ok(difference) => difference,
            Err(why) => {
                verbosity.refusal(&format!("the running graph is unchanged: {why}\n"));
                return None;
            }
        };
        // The file may have been edited meanwhile, so a swap is always reported.
        if verbosity == Verbosity::All || !matches!(changed.change, Change::Settings(_)) {
            let by = if matches!(change, PendingChange::Saved) {
                "saved"
            } else {
                "set"
            };
            eprint(&describe(&changed, &set, by, loading.elapsed()));
        }
        for change in ready.protected.changes(&self.protected) {
            eprint(&format!("{change}\n"));
        }
        self.protected = ready.protected;
        let before = std::mem::replace(&mut self.texts, ready.texts);
        Some(SwappedGraph {
            is_saved: before != self.texts,
            graph,
            change: changed.change,
            set,
            watch: ready.watch,
        })
    }

    /// Connects the network devices of a graph and hands the graph to the drivers.
    fn change(&mut self, graph: &mut Graph) -> Result<Difference, String> {
        self.network.connect(graph).map_err(|error| error.to_string())?;
        let before: HashMap<String, f64> = self
            .session
            .settings()
            .map(|live| (live.name(), live.value))
            .collect();
        match self.session.change(graph, &self.folder) {
            Ok(changed) => {
                let now = graph.live_settings().into_iter();
                let now = now.map(|live| (live.name(), live.value));
                let set = now.filter(|(name, value)| before.get(name).is_some_and(|then| then != value));
                let set = set.collect();
                self.network.keep(graph);
                self.endpoints.add(graph);
                self.changes += 1;
                self.swaps += u32::from(!matches!(changed.change, Change::Settings(_)));
                Ok(Difference { changed, set })
            }
            Err(error) => {
                self.network.undo();
                Err(error.to_string())
            }
        }
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
    text + &format!(" ({does}{:.0} ms)\n", took.as_secs_f64() * 1e3)
}

/// The first few settings as `name=value`.
pub fn settings_text(set: &[(String, f64)]) -> String {
    const SHOWN: usize = 4;
    let first = set.iter().take(SHOWN);
    let first: Vec<String> = first.map(|(name, value)| format!("{name}={value}")).collect();
    let more = match set.len().saturating_sub(SHOWN) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    first.join(", ") + &more
}
