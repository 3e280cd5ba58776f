//! Summary of a run: as JSON, as text, and on its page.

use super::endpoints::Endpoints;
use super::{Arguments, has_end};
use crate::engine::graph::Graph;
use crate::engine::run::Outcome;
use crate::live::soundcard;
use crate::report::facts::{self, Fact, Facts};
use crate::report::headlines::Headline;
use crate::report::page::{Page, Simulation};
use crate::report::plotted::PlottedSignals;
use crate::report::sound::{Sound, audible};
use serde_json::json;
use std::path::Path;

/// The facts and warnings of a run.
#[derive(Debug)]
pub(crate) struct Summary {
    name: String,
    facts: Facts,
    headlines: Vec<Headline>,
    endpoints: Endpoints,
    seconds: f64,
    took_s: f64,
    stopped: bool,
}

impl Summary {
    pub(crate) fn of(arguments: &Arguments, graph: &Graph, outcome: &Outcome, took_s: f64) -> Self {
        let path = &arguments.graph.graph;
        let set = arguments.graph.set.iter();
        let set = set.map(|(name, value)| (name.as_str(), value.as_str()));
        let mut facts = Facts::of(graph, outcome, path, set, arguments.graph.endpoints());
        let endpoints = Endpoints::of(graph, arguments.live);
        facts.extend([
            ("block", "Block (driver frames)", json!(arguments.block)),
            ("took_s", "Time taken (s)", json!((took_s * 1e4).round() / 1e4)),
            (
                "real_time_factor",
                "Times faster than real time",
                json!(((outcome.seconds / took_s) * 10.0).round() / 10.0),
            ),
        ]);
        facts.extend(endpoints.facts());
        facts.warnings.extend(cut_short(outcome).filter(|_| has_end(arguments)));
        Self {
            name: arguments.graph.name(),
            facts,
            headlines: facts::limited(outcome),
            endpoints,
            seconds: outcome.seconds,
            took_s,
            stopped: outcome.stopped,
        }
    }

    /// Adds facts and warnings of particular kinds of runs.
    pub(crate) fn add(&mut self, facts: Vec<Fact>, warnings: Vec<String>) {
        self.facts.extend(facts);
        self.facts.warnings.extend(warnings);
    }

    /// Replaces the endpoints, which swaps may have changed.
    pub(crate) fn set_endpoints(&mut self, endpoints: Endpoints) {
        self.facts.extend(endpoints.facts());
        self.endpoints = endpoints;
    }

    pub(crate) fn simulation(&self) -> Simulation {
        self.endpoints.simulation()
    }

    /// True if the run was stopped before its end.
    pub(crate) fn was_stopped(&self) -> bool {
        self.stopped
    }

    pub(crate) fn warnings(&self) -> &[String] {
        &self.facts.warnings
    }

    pub(crate) fn to_json(&self) -> String {
        self.facts.to_json()
    }

    /// Text for the terminal; the last line names the page and the sound.
    pub(crate) fn sentence(&self, target: &Path, graph: &Graph, sound: Option<&Sound>) -> String {
        let stopped = if self.stopped { "stopped after" } else { "ran" };
        let simulated = self.endpoints.in_brackets();
        let heard = match sound {
            Some(sound) => {
                let played = match soundcard::BACKEND.is_built {
                    true => "or with --play",
                    false => "(--play needs a build with soundcards)",
                };
                format!(", and listen to `{}` there {played}", sound.stream.name)
            }
            None if audible(graph).is_empty() => {
                "; nothing to listen to: no actuator or file receives an acceleration, a force, a voltage or a current at \
                 2 kHz or more"
                    .to_owned()
            }
            None => "; nothing to listen to: the signals are silent".to_owned(),
        };
        let Self { seconds, name, took_s, .. } = self;
        let (times, page) = (seconds / took_s, target.join("report.html"));
        format!(
            "{stopped} {seconds:.3} s of {name}{simulated} in {took_s:.3} s, {times:.1} times real time\nlook at {}{heard}\n",
            page.display()
        )
    }

    /// The page as HTML.
    pub(crate) fn page(&self, graph: &Graph, plotted: &PlottedSignals, sound: Option<&Sound>) -> String {
        let facts = self.facts.listed();
        // The list of endpoints already states which devices are simulated or real.
        let facts = facts.filter(|(key, ..)| !["simulated_devices", "real_devices"].contains(key));
        let facts = facts.map(|(key, name, value)| {
            let value = match key {
                "devices" => self.endpoints.listed(),
                _ => value,
            };
            (name.to_owned(), value)
        });
        Page {
            title: self.name.clone(),
            simulation: self.simulation(),
            facts: facts.collect(),
            warnings: self.facts.warnings.clone(),
            headlines: self.headlines.clone(),
            files: facts::files_beside(graph, &[("graph.svg", "the drawing of the graph")]),
            ..Page::of(graph, plotted, sound)
        }
        .to_html()
    }
}

/// Warning about a run that was stopped before its end.
fn cut_short(outcome: &Outcome) -> Option<String> {
    let seconds = outcome.seconds;
    outcome
        .stopped
        .then(|| format!("the run was stopped after {seconds:.3} s; its files are complete up to that time"))
}
