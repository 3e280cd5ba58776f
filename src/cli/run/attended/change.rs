//! Swap of the running graph for a saved or changed one.

use super::super::super::{remark, warnings};
use super::super::drivers::Drivers;
use super::super::history::History;
use super::super::loading::{Loaded, Loading, Ready};
use super::super::watch::Watch;
use super::{Attended, CHANGES, Says, Wish, show};
use crate::engine::graph::Graph;
use crate::engine::run::{Change, Changed};
use serde_json::json;
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// A graph that was swapped in.
struct Taken {
    graph: Graph,
    change: Change,
    /// Watches its files, from their state when it was loaded.
    watch: Watch,
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

impl Attended {
    /// Swaps a loaded graph in, if possible.
    pub(super) fn take(
        &mut self,
        driver: &Drivers,
        wish: Wish,
        loaded: Loaded,
        loading: &Loading,
        says: Says,
    ) {
        self.known = loaded.known;
        let taken = match loaded.result {
            Ok(ready) => self.put(driver, ready, loading, (says, &wish)),
            Err(wrong) => {
                show(&wrong, says);
                says.refusal("the running graph is unchanged\n");
                None
            }
        };
        let Some(taken) = taken else {
            return self.give_up(wish);
        };
        self.arguments.set = loaded.set;
        self.typed = loaded.typed.unwrap_or_else(|| std::mem::take(&mut self.typed));
        self.parameters = loaded.parameters;
        match wish {
            Wish::Set { name, value, by } => {
                let default = self.parameters.iter().find(|(known, _)| *known == name);
                let default = default.and_then(|(_, text)| text.clone());
                self.typed.retain(|(known, _)| *known != name);
                self.typed.push((name.clone(), default));
                // A file saved just before still triggers the watch, which may find that this graph already
                // runs.
                if taken.is_saved || !matches!(taken.change, Change::Settings(_)) {
                    self.keep(&taken);
                }
                if let Some(watch) = &mut self.watch {
                    watch.also(taken.watch);
                }
                self.note(true, name, &value, by);
            }
            Wish::Saved => {
                if taken.change != Change::Settings(0) {
                    self.keep(&taken);
                    let at_s = self.start.elapsed().as_secs_f64();
                    self.history.saved(at_s, taken.change, &taken.set);
                }
                // A changed graph may read other files.
                if let Some(watch) = &mut self.watch {
                    watch.turn_to(taken.watch);
                }
            }
        }
    }

    /// Copies the files of a saved graph into the run's folder for later reference.
    fn keep(&mut self, taken: &Taken) {
        // Bounded: a fader may change the graph a hundred times per second.
        if self.saved.len() >= History::MOST {
            return;
        }
        let place = Path::new(CHANGES).join((self.saved.len() + 1).to_string());
        let folder = self.folder.join(&place);
        let written = fs::create_dir_all(&folder).and_then(|()| {
            let sources = taken.graph.sources().iter();
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
            remark(&format!(
                "cannot copy the saved graph to {}: {error}\n",
                place.display()
            ));
        }
        let at_s = (self.start.elapsed().as_secs_f64() * 100.0).round() / 100.0;
        let set: Vec<String> = taken
            .set
            .iter()
            .map(|(name, value)| format!("{name}={value}"))
            .collect();
        self.saved.push(json!({
            "at_s": at_s, "what": taken.change.to_string(), "set": set, "graph": place.to_string_lossy(),
        }));
    }

    /// Swaps a graph in; on failure nothing changes.
    fn put(
        &mut self,
        driver: &Drivers,
        ready: Ready,
        loading: &Loading,
        (says, wish): (Says, &Wish),
    ) -> Option<Taken> {
        let graph = ready.graph;
        if says == Says::Everything {
            show(&warnings(&graph), says);
        }
        let lack = ready.wanted.and_then(|wanted| match driver.lack(&wanted) {
            Some(what) => Err(format!("it needs {what}; start a new run for it")),
            None => ready.own_files,
        });
        let guarded = match says < Says::Everything && ready.guards != self.guards {
            true => Err("limits and devices can only be changed in the file or from the terminal".to_owned()),
            false => Ok(()),
        };
        let changed = lack.and(guarded).and_then(|()| self.change(&graph));
        let Difference { changed, set } = match changed {
            Ok(difference) => difference,
            Err(why) => {
                says.refusal(&format!("the running graph is unchanged: {why}\n"));
                return None;
            }
        };
        // The file may have been edited meanwhile, so a swap is always reported.
        if says == Says::Everything || !matches!(changed.change, Change::Settings(_)) {
            let by = if matches!(wish, Wish::Saved) {
                "saved"
            } else {
                "set"
            };
            remark(&told(&changed, &set, by, loading.took()));
        }
        for change in ready.guards.changes(&self.guards) {
            remark(&format!("{change}\n"));
        }
        self.guards = ready.guards;
        let before = std::mem::replace(&mut self.texts, ready.texts);
        Some(Taken {
            is_saved: before != self.texts,
            graph,
            change: changed.change,
            set,
            watch: ready.watch,
        })
    }

    /// Connects the network devices of a graph and hands the graph to the drivers.
    fn change(&mut self, graph: &Graph) -> Result<Difference, String> {
        let connected = self.network.connect(graph).map_err(|error| error.to_string())?;
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
                self.network.follow(graph);
                self.endpoints.add(graph);
                self.changes += 1;
                self.swaps += u32::from(!matches!(changed.change, Change::Settings(_)));
                Ok(Difference { changed, set })
            }
            Err(error) => {
                self.network.let_go(connected);
                Err(error.to_string())
            }
        }
    }
}

/// Message about a change; `by` is its origin.
fn told(changed: &Changed, set: &[(String, f64)], by: &str, took: Duration) -> String {
    let mut text = match (changed.change, set) {
        (Change::Settings(_), [_, ..]) => format!("{by}: {}", shown(set)),
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
pub fn shown(set: &[(String, f64)]) -> String {
    const SHOWN: usize = 4;
    let first = set.iter().take(SHOWN);
    let first: Vec<String> = first.map(|(name, value)| format!("{name}={value}")).collect();
    let more = match set.len().saturating_sub(SHOWN) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    first.join(", ") + &more
}
