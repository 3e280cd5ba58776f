//! `haptograph run --live`: runs a graph in real time, with changes while it runs, and writes the same files
//! as an offline run.

use super::super::keys::RawMode;
use super::super::{Failure, built, eprint, panic_hook, screen, stderr, warn};
use super::console::{self, HELP, RunRequest};
use super::drivers::Drivers;
use super::facts::{facts_of, packets, warnings_of};
use super::latency;
use super::loading::{self, Job, Loader};
use super::summary::Summary;
use super::supervisor::{MAX_QUEUED, Supervisor};
use super::watch::FileWatch;
use super::{Arguments, RunSetup, lasts_a_frame, message, stop_on_interrupt};
use crate::engine::registry::Registry;
use crate::engine::run::{LiveOptions, RingReport, Session};
use crate::live::osc::OscControl;
use crate::live::{Connections, soundcard};
use serde_json::json;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::Instant;

pub fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    run_with(
        arguments,
        stop_on_interrupt,
        (Loader::new(loading::load, registry), || ()),
    )
}

/// Runs until the flag of `stopping` is set. Graphs are loaded by `loader`, and `each` is called in every
/// round of the supervisor; tests replace both.
fn run_with(
    arguments: &Arguments,
    stopping: impl FnOnce() -> Result<Arc<AtomicBool>, Failure>,
    (loader, each): (Loader, fn()),
) -> Result<(), Failure> {
    let arguments = Arguments {
        graph: arguments.graph.for_live()?,
        ..arguments.clone()
    };
    let first = loading::load(Job::first(&arguments), loader.registry());
    let (mut graph, parameters) = (first.result.map_err(Failure::Graph)?.graph, first.parameters);
    warn(&graph);
    // Changes of the files from here on are noticed.
    let watch = arguments.watch.then(|| FileWatch::of(&graph));
    lasts_a_frame(&graph, arguments.duration_s)?;
    built::refuse_missing(&graph, arguments.graph.endpoints())?;
    let card_requests = soundcard::card_requests(&graph).map_err(message)?;
    let mut network = Connections::default();
    network.connect(&mut graph).map_err(message)?;
    let (sender, requests) = sync_channel(MAX_QUEUED);
    let osc = listen_for_settings(&arguments, &sender)?;
    let mut setup = RunSetup::begin(&arguments, &graph)?;
    let stop = stopping()?;
    let options = LiveOptions {
        block: usize::from(arguments.block),
        seconds: arguments.duration_s,
        rested: arguments.rested,
        stop: Arc::clone(&stop),
        ..LiveOptions::default()
    };
    let folder = Some(setup.completion.folder.path());
    let (lives, session) = Session::open_all(setup.file_sinks, &options, folder).map_err(message)?;
    let unrested: Vec<String> = lives
        .iter()
        .flat_map(|live| live.run().unrested().map(str::to_owned))
        .collect();
    let start = Instant::now();
    let live_guard = panic_hook::LiveGuard::begin();
    let mut driver = Drivers::start(&graph, card_requests, lives, &stop)?;
    setup.completion.folder.begin();
    let mut notes = driver.notes();
    notes.iter().for_each(|note| eprint(&format!("note: {note}\n")));
    introduce(&arguments, &driver, &network, osc.as_ref());
    print_warm_starts(&unrested);
    let keys = RawMode::begin();
    console::read_commands(sender.clone(), Arc::clone(&stop), keys.is_some());
    let folder = setup.completion.folder.path();
    let mut supervisor = Supervisor::begin(
        &arguments,
        &graph,
        folder,
        (session, network),
        (watch, parameters, loader),
        keys.is_some(),
    );
    let supervision = AssertUnwindSafe(|| supervisor.run(&mut driver, &requests, (&stop, each)));
    let panicked = match catch_unwind(supervision) {
        Ok(said) => {
            notes.extend(said);
            false
        }
        Err(_) => {
            driver.stop();
            notes.push("haptograph panicked; the run was stopped".to_owned());
            true
        }
    };
    supervisor.report_panics();
    screen::type_in(None);
    stderr::remove_block();
    drop(keys);
    // This sender kept the channel open, so that a receive waits even without other senders.
    drop(sender);
    let mut facts = driver.facts();
    notes.extend(driver.warnings());
    notes.extend(supervisor.silence.warnings(
        Instant::now(),
        &supervisor.session.live_inputs(),
        &supervisor.network,
    ));
    let heard: Vec<RingReport> = driver.rings().collect();
    let output_latency = driver.output_latency();
    let latencies_at = facts.len();
    let lives = driver.join()?;
    // All devices are idle from here on.
    drop(live_guard);
    facts.extend(changed(&supervisor));
    facts.push((
        "unrested",
        "Sinks whose actuators began as warm as their limits allow",
        json!(unrested),
    ));
    facts.extend(packets(&supervisor.network));
    facts.push((
        "silences",
        "Live inputs that fell silent",
        json!(supervisor.silence.into_events()),
    ));
    facts.push((
        "set_while_running",
        "Set while running",
        supervisor.history.into_json(),
    ));
    facts.extend(osc.map(|osc| {
        (
            "osc_malformed",
            "OSC packets that set nothing",
            json!(osc.malformed()),
        )
    }));
    drop(supervisor.network);
    let mut ended = supervisor.session.finish_all(lives);
    ended.outcome.rings.extend(heard);
    let took_s = start.elapsed().as_secs_f64();
    // Computed after the files are complete, since it takes long for a large graph.
    let latencies = latency::measured(&graph, output_latency.as_ref());
    facts.insert(
        latencies_at,
        (
            "latencies_ms",
            "Latencies, measured (ms)",
            latency::to_json(&latencies),
        ),
    );
    eprint(&format!("{}\n", ended.meters));
    if !latencies.is_empty() {
        eprint(&format!("{}:\n", latency::BY_WHOSE_CLOCK));
    }
    for latency in &latencies {
        eprint(&format!("{}\n", latency.shown()));
    }
    let panicked = panicked || ended.panicked || !supervisor.panics.is_empty();
    let mut summary = Summary::of(&arguments, &graph, &ended.outcome, took_s);
    summary.set_endpoints(supervisor.endpoints);
    facts.extend(facts_of(&ended));
    facts.push(("panics", "Panics", json!(supervisor.panics)));
    notes.extend(warnings_of(&ended));
    summary.add(facts, notes);
    let completed = setup.completion.complete(&arguments, &graph, &summary);
    match completed {
        Ok(_) | Err(Failure::Interrupted) if panicked => Err(Failure::Message(
            "haptograph panicked during the run, with the message above; the files of the run are complete up to the panic".to_owned(),
        )
        .after_facts(arguments.json)),
        completed => completed.map(drop),
    }
}

/// Prints what runs and which inputs are open.
fn introduce(arguments: &Arguments, driver: &Drivers, network: &Connections, osc: Option<&OscControl>) {
    let ends = match arguments.duration_s {
        Some(seconds) => format!("for {seconds} s"),
        None => "until ctrl-C".to_owned(),
    };
    eprint(&format!(
        "running {} with its {} endpoints {ends}, driven by {}; type {HELP}\n",
        arguments.graph.name(),
        arguments.graph.endpoints(),
        driver.description()
    ));
    for listened in driver.listened() {
        eprint(&format!("listening to {listened}\n"));
    }
    for link in network.status() {
        eprint(&format!(
            "listening for `{}` at {}\n",
            link.names.concat(),
            link.place
        ));
    }
    if let Some(osc) = osc {
        eprint(&format!("settings by Open Sound Control at {}\n", osc.address()));
    }
}

/// Prints which sinks start with warm actuators.
fn print_warm_starts(unrested: &[String]) {
    if !unrested.is_empty() {
        eprint(&format!(
            "the actuators of `{}` start as warm as their limits allow, since their temperature is unknown; \
             give --rested if they are cold\n",
            unrested.join("`, `")
        ));
    }
}

/// Facts about graphs that were swapped in.
fn changed(supervisor: &Supervisor) -> [(&'static str, &'static str, serde_json::Value); 3] {
    [
        ("changes", "Changed while running", json!(supervisor.changes)),
        ("swaps", "Graphs swapped in", json!(supervisor.swaps)),
        (
            "saved_while_running",
            "Graphs saved while running",
            json!(supervisor.saved),
        ),
    ]
}

fn listen_for_settings(
    arguments: &Arguments,
    sender: &SyncSender<RunRequest>,
) -> Result<Option<OscControl>, Failure> {
    let Some(address) = arguments.osc else {
        return Ok(None);
    };
    let sender = sender.clone();
    OscControl::listen(address, move |setting| {
        // A full queue drops the value: faders repeat theirs. A closed queue belongs to a finished run.
        let _ = sender.try_send(RunRequest::Osc(setting));
    })
    .map(Some)
    .map_err(|error| Failure::Message(format!("cannot listen for settings at {address}: {error}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::run::loading::{LoadFn, LoadOutcome};
    use clap::Parser;
    use std::fs;
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::time::Duration;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        run: Arguments,
    }

    const GRAPH: &str = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000) }, nodes: {
        "one": Constant(clock: "servo", value: 1, quantity: "current"),
        "out": ActuatorSink(current: "one", endpoint: "a", limit: (peak_a: 1.5, continuous_a: 1.5)),
        "file": CsvSink(inputs: ["out.delivered"], file: "given.csv"),
    }, endpoints: { "simulated": { "a": SimulatedHaptuator() } })"#;

    static LOADS: AtomicBool = AtomicBool::new(false);

    fn hang(_: Job, _: &Registry) -> LoadOutcome {
        LOADS.store(true, Ordering::Relaxed);
        loop {
            std::thread::park();
        }
    }

    /// Result of a run, the values delivered to the actuator, and the facts.
    struct Ended {
        result: Result<(), Failure>,
        given: Vec<f64>,
        facts: serde_json::Value,
    }

    impl Ended {
        /// Asserts that the actuator ramped to zero over 10 ms, and that the files end with the ramp.
        fn assert_ramped_down(&self) {
            let given = &self.given;
            let fall = &given[given.len().saturating_sub(20)..];
            let steps = fall.windows(2).map(|pair| (pair[1] - pair[0]).abs());
            assert!(steps.fold(0.0, f64::max) <= 0.11 && fall[0] == 1.0, "{fall:?}");
            assert!(fall[fall.len() - 1] <= 0.11, "{fall:?}");
            assert_eq!(self.facts["driver_frames"], given.len());
            assert!(self.facts["stopped"] == true && self.facts["seconds"].as_f64().unwrap() < 30.0);
        }
    }

    /// A loader, and a function for every round of the supervisor.
    type Around = (LoadFn, fn());

    /// Runs with a loader that does `work` and with `each`, and saves the graph until `until` is true; then
    /// stops the run.
    fn run_with_saves((work, each): Around, until: impl Fn() -> bool + Send + 'static) -> Ended {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("g.ron"), GRAPH).unwrap();
        let (graph, out) = (at("g.ron").display().to_string(), at("out").display().to_string());
        let line = ["run", &graph, "--live", "--watch", "--for", "60", "--out", &out];
        let stop = Arc::new(AtomicBool::new(false));
        let (stops, saved) = (Arc::clone(&stop), at("g.ron"));
        let saver = std::thread::spawn(move || {
            for more in 1..200 {
                std::thread::sleep(Duration::from_millis(100));
                if until() || stops.load(Ordering::Relaxed) {
                    break;
                }
                if more % 5 == 0 {
                    fs::write(&saved, GRAPH.to_owned() + &" ".repeat(more)).unwrap();
                }
            }
            stops.store(true, Ordering::Relaxed);
        });
        let around = (Loader::new(work, &crate::nodes::registry()), each);
        let result = run_with(&Line::parse_from(line).run, || Ok(stop), around);
        saver.join().unwrap();
        let given = fs::read_to_string(at("out/given.csv")).unwrap();
        let cells = given.lines().skip(1).map(|line| line.rsplit(',').next().unwrap());
        let facts = fs::read_to_string(at("out/run.json")).unwrap();
        Ended {
            result,
            given: cells.map(|cell| cell.parse().unwrap()).collect(),
            facts: serde_json::from_str(&facts).unwrap(),
        }
    }

    #[test]
    fn a_graph_that_loads_for_ever_holds_up_no_stop() {
        let ended = run_with_saves((hang, || ()), || LOADS.load(Ordering::Relaxed));
        assert!(matches!(ended.result, Err(Failure::Interrupted)));
        assert!(LOADS.load(Ordering::Relaxed));
        ended.assert_ramped_down();
    }

    #[test]
    fn a_panic_while_a_graph_loads_stops_the_actuators_and_keeps_the_files() {
        let ended = run_with_saves((|_, _| panic!("on purpose"), || ()), || false);
        assert!(matches!(ended.result, Err(Failure::Message(_))));
        ended.assert_ramped_down();
    }

    /// Rounds of the supervisor, counted by one test only.
    static ROUNDS: AtomicU32 = AtomicU32::new(0);

    fn panic_later() {
        if ROUNDS.fetch_add(1, Ordering::Relaxed) == 10 {
            panic!("on purpose");
        }
    }

    #[test]
    fn a_panic_of_what_looks_after_the_run_stops_the_actuators_and_keeps_the_files() {
        let ended = run_with_saves((loading::load, panic_later), || false);
        assert!(ROUNDS.load(Ordering::Relaxed) > 10);
        let Err(Failure::Message(said)) = &ended.result else {
            panic!("it succeeded");
        };
        assert!(said.contains("panicked"), "{said}");
        let warnings = ended.facts["warnings"].as_array().unwrap();
        let is_said = |warning: &serde_json::Value| warning.as_str().unwrap().contains("haptograph panicked");
        assert!(warnings.iter().any(is_said), "{warnings:?}");
        ended.assert_ramped_down();
    }
}
