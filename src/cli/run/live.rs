//! `haptograph run --live`: runs a graph in real time, with changes while it runs, and writes the same files
//! as an offline run.

use super::super::keys::RawMode;
use super::super::stderr::{self, Message};
use super::super::terminal::is_coloured;
use super::super::{Failure, built, eprint, panic_hook, screen, warn};
use super::console::{self, ConsoleCommand, HELP, HELP_LINES};
use super::endpoints::Endpoints;
use super::facts::facts_of;
use super::status::StatusDisplay;
use super::summary::Summary;
use super::{Arguments, RunSetup, lasts_a_frame, refuse_own_files, stop_on_interrupt};
use crate::engine::diagnostic::render;
use crate::engine::registry::Registry;
use crate::live::soundcard::card_requests;
use crate::live::supervisor::{
    self, Ended, Event, LoadFn, MAX_QUEUED, Origin, PreparedRun, Request, RunOptions, Supervisor,
};
use crate::live::{Connected, Role, SettingValue};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, sync_channel};

/// Heading of the latencies.
const BY_WHOSE_CLOCK: &str =
    "latencies by the clock of this computer, without those of converters, amplifiers and mechanics";

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    run_with(arguments, registry, stop_on_interrupt, (supervisor::load, || ()))
}

/// Runs until the flag of `stopping` is set. Changed graphs are loaded by `load`, and `each` is called in every
/// round; tests replace both.
fn run_with(
    arguments: &Arguments,
    registry: &Registry,
    stopping: impl FnOnce() -> Result<Arc<AtomicBool>, Failure>,
    (load, each): (LoadFn, fn()),
) -> Result<(), Failure> {
    let arguments = Arguments { graph: arguments.graph.for_live()?, ..arguments.clone() };
    let run = PreparedRun::load(options(&arguments, load), registry).map_err(Failure::Graph)?;
    warn(run.graph());
    lasts_a_frame(run.graph(), arguments.duration_s)?;
    built::refuse_missing(run.graph(), arguments.graph.endpoints())?;
    let run = run.connect().map_err(Failure::message)?;
    let graph = Arc::clone(run.graph());
    let mut setup = RunSetup::begin(&arguments, &graph)?;
    let stop = stopping()?;
    let live_guard = panic_hook::LiveGuard::begin();
    let folder = Some(setup.completion.folder.path());
    let started = run.start(setup.file_sinks, folder, Arc::clone(&stop));
    let mut supervisor = started.map_err(Failure::message)?;
    setup.completion.folder.begin();
    introduce(&arguments, &supervisor);
    if card_requests(&graph).is_ok_and(|cards| cards.output.is_some()) {
        eprint(
            "note: if this program is killed, the soundcard may repeat its last buffer: keep the amplifier's mute within reach\n",
        );
    }
    let keys = RawMode::begin();
    let (sender, commands) = sync_channel(MAX_QUEUED);
    console::read_commands(sender, stop, supervisor.sender(), keys.is_some());
    let mut terminal =
        Terminal { commands, status: StatusDisplay::new(&graph, keys.is_some()), panics: Vec::new() };
    let supervision = AssertUnwindSafe(|| terminal.supervise(&mut supervisor, each));
    let panicked = catch_unwind(supervision).is_err();
    if panicked {
        supervisor.stop_now();
    }
    terminal.report_panics();
    screen::type_in(None);
    stderr::display(Message::RemoveBlock);
    drop(keys);
    let mut ended = supervisor.finish().map_err(Failure::message)?;
    // All devices are idle from here on.
    drop(live_guard);
    if panicked {
        ended.warnings.push("haptograph panicked; the run was stopped".to_owned());
    }
    let panicked = panicked || ended.outcome.panicked || !terminal.panics.is_empty();
    if !terminal.panics.is_empty() {
        ended.report.panics = terminal.panics;
    }
    print_timing(&ended);
    let mut summary = Summary::of(&arguments, &graph, &ended.outcome.outcome, ended.took_s);
    summary.set_endpoints(Endpoints::live(ended.devices));
    summary.add(facts_of(&ended.report), ended.warnings);
    let completed = setup.completion.complete(&arguments, &graph, summary);
    match completed {
        Ok(_) | Err(Failure::Interrupted) if panicked => Err(Failure::Message(
            "haptograph panicked during the run, with the message above; the files of the run are complete up to the panic".to_owned(),
        )
        .after_facts(arguments.json)),
        completed => completed.map(drop),
    }
}

/// The options of the live run, from the arguments.
fn options(arguments: &Arguments, load: LoadFn) -> RunOptions {
    let record = arguments.record;
    let mut options = RunOptions::of(&arguments.graph.graph);
    options.source.set = arguments.graph.set.clone();
    options.source.endpoints = Some(arguments.graph.endpoints().to_owned());
    options.source.seed = arguments.seed;
    options.watch = arguments.watch;
    options.seconds = arguments.duration_s;
    options.block = usize::from(arguments.block);
    options.rested = arguments.rested;
    options.osc = arguments.osc;
    options.accept = Arc::new(move |graph| refuse_own_files(graph, record));
    options.load = load;
    options
}

/// The person at the terminal: commands, status, messages.
struct Terminal {
    commands: Receiver<ConsoleCommand>,
    status: StatusDisplay,
    /// Panics reported so far.
    panics: Vec<String>,
}

impl Terminal {
    /// Serves a run to its end, and calls `each` in every round.
    fn supervise(&mut self, supervisor: &mut Supervisor, each: fn()) {
        while !supervisor.is_finished() {
            each();
            supervisor.wait();
            self.report_panics();
            for command in self.commands.try_iter().take(supervisor.room()) {
                obey(command, supervisor);
            }
            supervisor.poll().iter().for_each(print_event);
            self.status.show(|| supervisor.status());
        }
    }

    /// Reports panics since the last call.
    fn report_panics(&mut self) {
        for text in panic_hook::take_unreported() {
            eprint(&text);
            self.panics.push(text);
        }
    }
}

fn obey(command: ConsoleCommand, supervisor: &mut Supervisor) {
    match command {
        ConsoleCommand::Set { name, value } => {
            let value = SettingValue::from_text(&name, &value);
            supervisor.request(Request::from_origin(Origin::Keyboard, name, value));
        }
        ConsoleCommand::List => {
            for (name, value) in supervisor.settings() {
                let value = value.map_or_else(|| "?".to_owned(), |value| value.to_string());
                eprint(&format!("{name} = {value}\n"));
            }
        }
        ConsoleCommand::History => eprint(&supervisor.history()),
        ConsoleCommand::Help => eprint(HELP_LINES),
        // The reading thread has already set the stop flag.
        ConsoleCommand::Stop => {}
        ConsoleCommand::Unknown(line) => {
            let help = ConsoleCommand::suggestion(&line)
                .map_or_else(|| format!("type {HELP}"), |near| format!("did you mean `{near}`?"));
            eprint(&format!("unknown command `{line}`; {help}\n"));
        }
    }
}

fn print_event(event: &Event) {
    match event {
        Event::Findings(findings) if findings.list.is_empty() => {}
        Event::Findings(findings) => eprint(&render(findings, is_coloured(&std::io::stderr()))),
        event => eprint(&format!("{event}\n")),
    }
}

/// Prints the refused privileges, the drivers, the open inputs, and the sinks that start with warm actuators.
fn introduce(arguments: &Arguments, supervisor: &Supervisor) {
    for note in supervisor.refused_at_start() {
        eprint(&format!("note: {note}\n"));
    }
    let ends = match arguments.duration_s {
        Some(seconds) => format!("for {seconds} s"),
        None => "until ctrl-C".to_owned(),
    };
    let (name, endpoints) = (arguments.graph.name(), arguments.graph.endpoints());
    let driver = supervisor.description();
    eprint(&format!(
        "running {name} with its {endpoints} endpoints {ends}, driven by {driver}; type {HELP}\n"
    ));
    for Connected { names, role, place, .. } in supervisor.connections() {
        let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        match role {
            Role::Input => eprint(&format!("listening to {} by {place}\n", names.join(" and "))),
            Role::Link => eprint(&format!("listening for {} at {place}\n", names.concat())),
            // The first line names the drivers.
            _ => {}
        }
    }
    if let Some(address) = supervisor.osc_address() {
        eprint(&format!("listening for settings by Open Sound Control at {address}\n"));
    }
    let unrested = supervisor.unrested();
    if !unrested.is_empty() {
        eprint(&format!(
            "the actuators of `{}` start as warm as their limits allow, since their temperature is unknown; \
             give --rested if they are cold\n",
            unrested.join("`, `")
        ));
    }
}

/// Prints the timing of the run and its latencies.
fn print_timing(ended: &Ended) {
    eprint(&format!("{}\n", ended.outcome.meters));
    if !ended.latencies.is_empty() {
        eprint(&format!("{BY_WHOSE_CLOCK}:\n"));
    }
    for latency in &ended.latencies {
        eprint(&format!("{latency}\n"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::supervisor::{Job, LoadOutcome};
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
        let registry = crate::nodes::registry();
        let result = run_with(&Line::parse_from(line).run, &registry, || Ok(stop), (work, each));
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
        let ended = run_with_saves((supervisor::load, panic_later), || false);
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
