//! Drivers of a live run, one per driver clock of the graph, and its soundcard inputs.

use super::super::Failure;
use super::driver::{self, Driver};
use super::message;
use crate::engine::graph::Graph;
use crate::engine::run::{Histogram, Live, RingReport};
use crate::live::BackendEvent;
use crate::live::soundcard::{CardRequests, Inputs, played};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Maximum time between the ends of the drivers of one run, which differ by their last buffers.
const MAX_END_DELAY: Duration = Duration::from_secs(1);
/// Maximum duration of a stop. Outputs fall to zero in 10 ms, or more slowly if their slew limits require it.
const STOP_TIMEOUT: Duration = Duration::from_secs(5);
/// Polling period of a stop.
const POLL_PERIOD: Duration = Duration::from_millis(5);

/// The drivers of a run with the names of their clocks.
pub struct Drivers {
    list: Vec<(String, Driver)>,
    inputs: Inputs,
    /// The soundcard streams that the graph needs.
    requests: CardRequests,
    /// When the first driver was found to have ended.
    first_end: Option<Instant>,
    /// Stops all drivers.
    stop: Arc<AtomicBool>,
}

impl Drivers {
    /// Starts a driver for each of `lives`: the soundcard if the graph needs it, timers otherwise. `stop`
    /// stops them.
    pub fn start(
        graph: &Graph,
        requests: CardRequests,
        mut lives: Vec<Live>,
        stop: &Arc<AtomicBool>,
    ) -> Result<Self, Failure> {
        let inputs = Inputs::open(graph, &mut lives).map_err(message)?;
        let played = played(graph);
        let card = played.first().and_then(|played| graph.driver_of(played.sink));
        let mut waiting: Vec<(usize, Live)> = graph.drivers().into_iter().zip(lives).collect();
        // The soundcard first, so that a missing card is found before any actuator moves.
        waiting.sort_by_key(|(clock, _)| card != Some(*clock));
        let mut drivers = Self {
            list: Vec::new(),
            inputs,
            requests,
            first_end: None,
            stop: Arc::clone(stop),
        };
        let mut clocks = Vec::new();
        for (clock, live) in waiting {
            let output = drivers.requests.output.as_ref().filter(|_| card == Some(clock));
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

    /// Why the running streams do not fit another graph; `None` if they do.
    pub fn mismatch(&self, requests: &CardRequests) -> Option<&'static str> {
        match () {
            () if self.requests.output != requests.output => Some("another soundcard"),
            () if self.requests.inputs != requests.inputs => Some("another soundcard input"),
            () => None,
        }
    }

    /// Description for the user.
    pub fn description(&self) -> String {
        match &self.list[..] {
            [(_, one)] => one.description(),
            several => {
                let each = several
                    .iter()
                    .map(|(name, one)| format!("{name} by {}", one.description()));
                each.collect::<Vec<_>>().join("; ")
            }
        }
    }

    /// Description of each input stream.
    pub fn listened(&self) -> impl Iterator<Item = String> {
        let streams = self.inputs.streams();
        streams.map(|(endpoints, request, got, _)| {
            let names: Vec<String> = endpoints.iter().map(|name| format!("`{name}`")).collect();
            format!("{} by {}", names.join(" and "), driver::stream(got, request))
        })
    }

    /// The rings from soundcard inputs to the graph.
    pub fn rings(&self) -> impl Iterator<Item = RingReport> {
        self.inputs.rings().map(RingReport::of)
    }

    /// The output latency stated by the system.
    pub fn output_latency(&self) -> Option<Histogram> {
        self.all().find_map(Driver::output_latency)
    }

    /// Scheduling requests that the system refused at the start, without repetition.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for note in self.all().flat_map(Driver::notes) {
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        notes
    }

    /// Polls all drivers; returns notes for the user.
    pub fn poll(&mut self) -> Vec<BackendEvent> {
        let drivers = self.list.iter_mut();
        let mut said: Vec<BackendEvent> = drivers.flat_map(|(_, driver)| driver.poll()).collect();
        said.extend(self.inputs.poll());
        said
    }

    /// True if the run is over or, with `stopping`, if nothing can end it.
    pub fn is_finished(&self, stopping: bool) -> bool {
        self.all().all(|driver| driver.is_finished(stopping))
    }

    /// True if one driver has ended while others still run; they must then be stopped.
    pub fn is_partly_finished(&mut self) -> bool {
        if self.first_end.is_none() && self.all().any(|driver| driver.is_finished(false)) {
            self.first_end = Some(Instant::now());
        }
        self.first_end
            .is_some_and(|since| since.elapsed() > MAX_END_DELAY)
    }

    /// Waits for the end of the run.
    pub fn join(mut self) -> Result<Vec<Live>, Failure> {
        let list = std::mem::take(&mut self.list);
        list.into_iter().map(|(_, driver)| driver.join()).collect()
    }

    /// Stops all drivers and waits until none drives any device.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
        let since = Instant::now();
        while !self.is_finished(true) && since.elapsed() < STOP_TIMEOUT {
            std::thread::sleep(POLL_PERIOD);
        }
    }

    /// Driver-specific part of the status line.
    pub fn status(&self) -> String {
        let drivers = self.all().map(Driver::status);
        let inputs = self.inputs.streams();
        let heard =
            inputs.map(|(names, .., counts)| format!(", {} xruns at {}", counts.xruns, names.join(" and ")));
        drivers.chain(heard).collect()
    }

    /// Facts about the finished drivers for `run.json`.
    pub fn facts(&self) -> Vec<(&'static str, &'static str, Value)> {
        let mut facts = vec![("driver", "Driver", json!(self.description()))];
        let more = self.all().flat_map(Driver::facts);
        facts.extend(more.filter(|(key, ..)| *key != "driver"));
        let inputs = self.inputs.streams().map(|(names, request, got, counts)| {
            let kept = json!({
                "stream": driver::stream(got, request), "xruns": driver::xruns(&counts),
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

    /// Warnings for the summary.
    pub fn warnings(&self) -> Vec<String> {
        let mut list: Vec<String> = self.all().flat_map(Driver::warnings).collect();
        for (names, .., counts) in self.inputs.streams() {
            let whose = format!("the input of {}", names.join(" and "));
            list.extend(driver::troubles(&whose, "ran over", &counts));
        }
        list
    }
}

/// Stops the drivers on every path, including errors and panics.
impl Drop for Drivers {
    fn drop(&mut self) {
        if !self.list.is_empty() {
            self.stop();
        }
    }
}
