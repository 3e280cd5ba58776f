//! `haptograph run --live`: runs a graph in real time, with changes while it runs, and writes the same files
//! as an offline run.

use super::super::keys::RawMode;
use super::super::{Failure, built, fault, remark, remarks, screen, warn};
use super::attended::{Attended, MOST_ASKED};
use super::console::{self, Asked, HELP};
use super::drivers::Drivers;
use super::facts::{facts_of, packets, warnings_of};
use super::latency;
use super::loading::{self, Job, Loader};
use super::summary::Summary;
use super::watch::Watch;
use super::{Arguments, Making, lasts_a_frame, message, stop_on_interrupt};
use crate::engine::registry::Registry;
use crate::engine::run::{LiveOptions, RingReport, Session};
use crate::nodes::network::{Connections, OscControl};
use crate::nodes::soundcard::wanted;
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
    let (graph, parameters) = (first.result.map_err(Failure::Graph)?.graph, first.parameters);
    warn(&graph);
    // Changes of the files from here on are noticed.
    let watch = arguments.watch.then(|| Watch::of(&graph));
    lasts_a_frame(&graph, arguments.duration_s)?;
    built::refuse_missing(&graph, arguments.graph.endpoints())?;
    let wanted = wanted(&graph).map_err(message)?;
    let mut network = Connections::default();
    network.connect(&graph).map_err(message)?;
    let (asking, asked) = sync_channel(MOST_ASKED);
    let osc = listen_for_settings(&arguments, &asking)?;
    let mut made = Making::begin(&arguments, &graph)?;
    let stop = stopping()?;
    let options = LiveOptions {
        block: usize::from(arguments.block),
        seconds: arguments.duration_s,
        rested: arguments.rested,
        stop: Arc::clone(&stop),
        ..LiveOptions::default()
    };
    let folder = Some(made.kept.folder.path());
    let (lives, session) = Session::open_all(made.outlets, &options, folder).map_err(message)?;
    let unrested: Vec<String> = lives
        .iter()
        .flat_map(|live| live.run().unrested().map(str::to_owned))
        .collect();
    let start = Instant::now();
    let quiet = fault::Live::begin();
    let mut driver = Drivers::start(&graph, wanted, lives, &stop)?;
    made.kept.folder.begin();
    let mut notes = driver.notes();
    notes.iter().for_each(|note| remark(&format!("note: {note}\n")));
    introduce(&arguments, &driver, &network, osc.as_ref());
    tell_unrested(&unrested);
    let keys = RawMode::begin();
    console::listen(asking.clone(), Arc::clone(&stop), keys.is_some());
    let folder = made.kept.folder.path();
    let mut attended = Attended::begin(
        &arguments,
        &graph,
        folder,
        (session, network),
        (watch, parameters, loader),
        keys.is_some(),
    );
    let attending = AssertUnwindSafe(|| attended.attend(&mut driver, &asked, (&stop, each)));
    let panicked = match catch_unwind(attending) {
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
    attended.tell_panics();
    screen::type_in(None);
    remarks::close();
    drop(keys);
    // This sender kept the channel open, so that a receive waits even without other senders.
    drop(asking);
    let mut facts = driver.facts();
    notes.extend(driver.warnings());
    notes.extend(attended.silence.warnings(
        Instant::now(),
        &attended.session.live_inputs(),
        &attended.network,
    ));
    let heard: Vec<RingReport> = driver.rings().collect();
    let output_latency = driver.output_latency();
    let latencies_at = facts.len();
    let lives = driver.join()?;
    // All devices are idle from here on.
    drop(quiet);
    facts.extend(changed(&attended));
    facts.push((
        "unrested",
        "Sinks whose actuators began as warm as their limits allow",
        json!(unrested),
    ));
    facts.extend(packets(&attended.network));
    facts.push((
        "silences",
        "Live inputs that fell silent",
        json!(attended.silence.into_events()),
    ));
    facts.push((
        "set_while_running",
        "Set while running",
        attended.history.into_json(),
    ));
    facts.extend(osc.map(|osc| {
        (
            "osc_malformed",
            "OSC packets that set nothing",
            json!(osc.malformed()),
        )
    }));
    drop(attended.network);
    let mut ended = attended.session.finish_all(lives);
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
    remark(&format!("{}\n", ended.meters));
    if !latencies.is_empty() {
        remark(&format!("{}:\n", latency::BY_WHOSE_CLOCK));
    }
    for latency in &latencies {
        remark(&format!("{}\n", latency.shown()));
    }
    let panicked = panicked || ended.panicked || !attended.panics.is_empty();
    let mut summary = Summary::of(&arguments, &graph, &ended.outcome, took_s);
    summary.set_endpoints(attended.endpoints);
    facts.extend(facts_of(&ended));
    facts.push(("panics", "Panics", json!(attended.panics)));
    notes.extend(warnings_of(&ended));
    summary.add(facts, notes);
    let completed = made.kept.complete(&arguments, &graph, &summary);
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
    remark(&format!(
        "running {} with its {} endpoints {ends}, driven by {}; type {HELP}\n",
        arguments.graph.name(),
        arguments.graph.endpoints(),
        driver.about()
    ));
    for listened in driver.listened() {
        remark(&format!("listening to {listened}\n"));
    }
    for (device, place) in network.places() {
        remark(&format!("listening for `{device}` at {place}\n"));
    }
    if let Some(osc) = osc {
        remark(&format!("settings by Open Sound Control at {}\n", osc.address()));
    }
}

/// Prints which sinks start with warm actuators.
fn tell_unrested(unrested: &[String]) {
    if !unrested.is_empty() {
        remark(&format!(
            "the actuators of `{}` start as warm as their limits allow, since their temperature is unknown; \
             give --rested if they are cold\n",
            unrested.join("`, `")
        ));
    }
}

/// Facts about graphs that were swapped in.
fn changed(attended: &Attended) -> [(&'static str, &'static str, serde_json::Value); 3] {
    [
        ("changes", "Changed while running", json!(attended.changes)),
        ("swaps", "Graphs swapped in", json!(attended.swaps)),
        (
            "saved_while_running",
            "Graphs saved while running",
            json!(attended.saved),
        ),
    ]
}

fn listen_for_settings(
    arguments: &Arguments,
    asking: &SyncSender<Asked>,
) -> Result<Option<OscControl>, Failure> {
    let Some(address) = arguments.osc else {
        return Ok(None);
    };
    let asking = asking.clone();
    OscControl::listen(address, move |told| {
        // A full queue drops the value: faders repeat theirs. A closed queue belongs to a finished run.
        let _ = asking.try_send(Asked::Told(told));
    })
    .map(Some)
    .map_err(|error| Failure::Message(format!("cannot listen for settings at {address}: {error}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::run::loading::{Loaded, Work};
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

    fn hang(_: Job, _: &Registry) -> Loaded {
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
    type Around = (Work, fn());

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
