//! All that a live run is driven by: a driver for each of the graph's, and the soundcards that it listens to.

use super::super::Failure;
use super::driver::{self, Driver};
use super::message;
use crate::engine::graph::Graph;
use crate::engine::run::{Histogram, Live, RingReport};
use crate::nodes::soundcard::{CardNote, Inputs, Wanted, played};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Drivers of one run end together, but for their last buffers.
const APART: Duration = Duration::from_secs(1);
/// How long a stop may take: outputs fall in a hundredth of a second, or as slowly as their limits want it.
const STOPPING: Duration = Duration::from_secs(5);
/// How often that is looked at.
const LOOK: Duration = Duration::from_millis(5);

/// The drivers of a run, by their clocks' names.
pub struct Drivers {
    list: Vec<(String, Driver)>,
    inputs: Inputs,
    /// What the graph asks of soundcards.
    wanted: Wanted,
    /// When the first of them was seen to have ended.
    first_end: Option<Instant>,
    /// Stops them.
    stop: Arc<AtomicBool>,
}

impl Drivers {
    /// Starts a driver for each of `lives`, which `stop` stops: the soundcard where the graph wants it, timers else.
    pub fn start(
        graph: &Graph,
        wanted: Wanted,
        mut lives: Vec<Live>,
        stop: &Arc<AtomicBool>,
    ) -> Result<Self, Failure> {
        let inputs = Inputs::open(graph, &mut lives).map_err(message)?;
        let played = played(graph);
        let card = played.first().and_then(|played| graph.driver_of(played.sink));
        let mut waiting: Vec<(usize, Live)> = graph.drivers().into_iter().zip(lives).collect();
        // A card that is not there is found before anything else moves.
        waiting.sort_by_key(|(clock, _)| card != Some(*clock));
        let mut drivers = Self {
            list: Vec::new(),
            inputs,
            wanted,
            first_end: None,
            stop: Arc::clone(stop),
        };
        let mut clocks = Vec::new();
        for (clock, live) in waiting {
            let output = drivers.wanted.output.as_ref().filter(|_| card == Some(clock));
            let driver = Driver::start(output.cloned(), live)?;
            let place = clocks.partition_point(|known| *known < clock);
            clocks.insert(place, clock);
            drivers
                .list
                .insert(place, (graph.clocks()[clock].name.clone(), driver));
        }
        Ok(drivers)
    }

    fn all(&self) -> impl Iterator<Item = &Driver> {
        self.list.iter().map(|(_, driver)| driver)
    }

    /// What keeps them from driving this graph too.
    pub fn lack(&self, wanted: &Wanted) -> Option<&'static str> {
        match () {
            () if self.wanted.output != wanted.output => Some("another soundcard"),
            () if self.wanted.inputs != wanted.inputs => Some("another soundcard input"),
            () => None,
        }
    }

    /// What they are, in words.
    pub fn about(&self) -> String {
        match &self.list[..] {
            [(_, one)] => one.about(),
            several => {
                let each = several
                    .iter()
                    .map(|(name, one)| format!("{name} by {}", one.about()));
                each.collect::<Vec<_>>().join("; ")
            }
        }
    }

    /// What is listened to, in words: a line for each stream.
    pub fn listened(&self) -> impl Iterator<Item = String> {
        let streams = self.inputs.streams();
        streams.map(|(endpoints, asked, got, _)| {
            let names: Vec<String> = endpoints.iter().map(|name| format!("`{name}`")).collect();
            format!("{} by {}", names.join(" and "), driver::stream(got, asked))
        })
    }

    /// The rings that lead from soundcards to the graph.
    pub fn rings(&self) -> impl Iterator<Item = RingReport> {
        self.inputs.rings().map(RingReport::of)
    }

    /// The latency that the system states of what the soundcard plays.
    pub fn output_latency(&self) -> Option<Histogram> {
        self.all().find_map(Driver::output_latency)
    }

    /// What the system did not allow at the start, said once.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for note in self.all().flat_map(Driver::notes) {
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        notes
    }

    /// Looks after them; returns what there is to say.
    pub fn tend(&mut self) -> Vec<CardNote> {
        let drivers = self.list.iter_mut();
        let mut said: Vec<CardNote> = drivers.flat_map(|(_, driver)| driver.tend()).collect();
        said.extend(self.inputs.poll());
        said
    }

    /// Is the run over, or with `stopping` is nobody there to end it?
    pub fn is_finished(&self, stopping: bool) -> bool {
        self.all().all(|driver| driver.is_finished(stopping))
    }

    /// Has one ended while the others go on? Then they have to be stopped.
    pub fn is_torn(&mut self) -> bool {
        if self.first_end.is_none() && self.all().any(|driver| driver.is_finished(false)) {
            self.first_end = Some(Instant::now());
        }
        self.first_end.is_some_and(|since| since.elapsed() > APART)
    }

    /// Waits for the end.
    pub fn join(mut self) -> Result<Vec<Live>, Failure> {
        let list = std::mem::take(&mut self.list);
        list.into_iter().map(|(_, driver)| driver.join()).collect()
    }

    /// Stops them, and waits until nothing is driven any more.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
        let since = Instant::now();
        while !self.is_finished(true) && since.elapsed() < STOPPING {
            std::thread::sleep(LOOK);
        }
    }

    /// What is shown of them every second, besides the time they keep.
    pub fn status(&self) -> String {
        let drivers = self.all().map(Driver::status);
        let inputs = self.inputs.streams();
        let heard =
            inputs.map(|(names, .., counts)| format!(", {} xruns at {}", counts.xruns, names.join(" and ")));
        drivers.chain(heard).collect()
    }

    /// What is to be known of them when it is over.
    pub fn facts(&self) -> Vec<(&'static str, &'static str, Value)> {
        let mut facts = vec![("driver", "Driver", json!(self.about()))];
        let more = self.all().flat_map(Driver::facts);
        facts.extend(more.filter(|(key, ..)| *key != "driver"));
        let inputs = self.inputs.streams().map(|(names, asked, got, counts)| {
            let kept = json!({
                "stream": driver::stream(got, asked), "xruns": driver::xruns(&counts),
                "clipped_samples": counts.clipped, "vanished": counts.vanished,
                "input_latency_ms": driver::quantiles_ms(&counts.latency),
            });
            (names.join(", "), kept)
        });
        let inputs: serde_json::Map<String, Value> = inputs.collect();
        if !inputs.is_empty() {
            facts.push(("inputs", "Inputs of soundcards", Value::Object(inputs)));
        }
        facts
    }

    /// What went wrong, for the summary.
    pub fn warnings(&self) -> Vec<String> {
        let mut list: Vec<String> = self.all().flat_map(Driver::warnings).collect();
        for (names, .., counts) in self.inputs.streams() {
            let whose = format!("the input of {}", names.join(" and "));
            list.extend(driver::troubles(&whose, "ran over", &counts));
        }
        list
    }
}

/// Whatever happens on the way, nothing is left driven.
impl Drop for Drivers {
    fn drop(&mut self) {
        if !self.list.is_empty() {
            self.stop();
        }
    }
}
