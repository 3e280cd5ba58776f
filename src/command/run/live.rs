//! `haptograph run --live`: the graph runs against the clock, can be changed while it runs, and leaves what an
//! offline run leaves.

use super::super::{Failure, GraphArguments, remark, warnings};
use super::console::{self, HELP, Typed};
use super::driver::{Driver, wanted};
use super::summary::Summary;
use super::watch::Watch;
use super::{Arguments, Making, message, stop_on_interrupt};
use haptograph::engine::diagnostic::{Diagnostics, render};
use haptograph::engine::graph::Graph;
use haptograph::engine::run::{Change, Changed, Histogram, LiveOptions, LiveOutcome, Meters, Session};
use haptograph::engine::settings::closest;
use haptograph::nodes::network::{Connections, Counts};
use serde_json::{Value, json};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How often the run is looked after, and how often its status is shown.
const PAUSE: Duration = Duration::from_millis(50);
const STATUS: Duration = Duration::from_secs(1);

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let arguments = Arguments {
        graph: arguments.graph.for_live()?,
        ..arguments.clone()
    };
    let graph = arguments.graph.load_and_warn(arguments.seed)?;
    let asked = wanted(&graph)?;
    let mut network = Connections::default();
    network.connect(&graph).map_err(message)?;
    let made = Making::begin(&arguments, &graph)?;
    let options = LiveOptions {
        block: usize::from(arguments.block),
        seconds: arguments.duration_s,
    };
    let stop = stop_on_interrupt()?;
    let (live, session) = Session::open(made.outlets, &options).map_err(message)?;
    let start = Instant::now();
    let mut driver = Driver::start(asked, live)?;
    let mut notes = driver.notes();
    notes.iter().for_each(|note| remark(&format!("note: {note}\n")));
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
    for (device, address) in network.addresses() {
        remark(&format!("listening for `{device}` at {address}\n"));
    }
    let mut attended = Attended {
        arguments: arguments.graph.clone(),
        seed: arguments.seed,
        folder: made.kept.folder.path().to_owned(),
        watch: arguments.watch.then(|| Watch::of(&graph)),
        session,
        network,
        changes: 0,
    };
    notes.extend(attended.attend(&mut driver, &stop));
    let mut facts = driver.facts();
    notes.extend(driver.warnings());
    let live = driver.join()?;
    let changes = attended.changes;
    facts.extend(packets(&attended.network));
    drop(attended.network);
    let ended = attended.session.finish(live);
    let took_s = start.elapsed().as_secs_f64();
    remark(&format!("{}\n", ended.meters));
    let mut summary = Summary::of(&arguments, &graph, &ended.outcome, took_s);
    facts.extend(facts_of(&ended, changes));
    notes.extend(warnings_of(&ended));
    summary.add(facts, notes);
    made.kept.complete(&arguments, &graph, &summary)
}

/// A run and what may happen to it.
struct Attended {
    arguments: GraphArguments,
    seed: Option<u64>,
    folder: PathBuf,
    watch: Option<Watch>,
    session: Session,
    network: Connections,
    /// Other graphs that were put in place.
    changes: u32,
}

impl Attended {
    /// Looks after the run until it is over. Returns what the driver had to say.
    fn attend(&mut self, driver: &mut Driver, stop: &AtomicBool) -> Vec<String> {
        let typed = console::listen();
        let start = Instant::now();
        let (mut shown, mut stopping, mut said) = (start, false, Vec::new());
        while !driver.is_finished(stopping) {
            std::thread::sleep(PAUSE);
            for note in driver.tend() {
                remark(&format!("note: {note}\n"));
                said.push(note);
            }
            let meters = self.session.control().poll();
            if shown.elapsed() >= STATUS {
                shown += STATUS;
                let seconds = start.elapsed().as_secs_f64();
                remark(&format!("{seconds:.0} s: {meters}{}\n", driver.status()));
            }
            for typed in typed.try_iter() {
                match typed {
                    Typed::Set { name, value } => self.set(driver, &name, &value),
                    Typed::List => self.list(),
                    Typed::Stop => stop.store(true, Ordering::Relaxed),
                    Typed::Unknown(line) => remark(&format!("`{line}` is not known; type {HELP}\n")),
                }
            }
            if self.watch.as_mut().is_some_and(Watch::has_changed) {
                self.reload(driver);
            }
            if stop.load(Ordering::Relaxed) && !stopping {
                // Asked again where the real-time side has not read its commands for a while.
                stopping = self.session.control().stop().is_ok();
            }
        }
        said
    }

    /// A parameter of the graph, or a live setting of a node.
    fn set(&mut self, driver: &Driver, name: &str, value: &str) {
        if name.contains('.') {
            self.set_directly(name, value);
            return;
        }
        let before = self.arguments.set.clone();
        self.arguments.set.retain(|(known, _)| known != name);
        self.arguments.set.push((name.to_owned(), value.to_owned()));
        if !self.reload(driver) {
            self.arguments.set = before;
        }
    }

    fn set_directly(&mut self, name: &str, value: &str) {
        let control = self.session.control();
        let Ok(number) = value.parse::<f64>() else {
            remark(&format!("`{value}` is not a number\n"));
            return;
        };
        match control.set_by_name(name, number) {
            Ok(()) => remark(&format!("{name} is {number}\n")),
            Err(error) => {
                let names: Vec<String> = control.settings().iter().map(|live| live.name()).collect();
                let near = closest(name, names.iter().map(String::as_str));
                let help = near
                    .filter(|near| *near != name)
                    .map(|near| format!("; did you mean `{near}`?"));
                remark(&format!("`{name}` stays: {error}{}\n", help.unwrap_or_default()));
            }
        }
    }

    fn list(&mut self) {
        for live in self.session.control().settings() {
            remark(&format!("{} = {}\n", live.name(), live.value));
        }
    }

    /// Loads the graph again and puts it in place of the one that runs; a wrong one is shown and changes nothing.
    fn reload(&mut self, driver: &Driver) -> bool {
        let began = Instant::now();
        let graph = match self.arguments.load(self.seed) {
            Ok(graph) => graph,
            Err(wrong) => {
                show(&wrong);
                remark("the graph stays as it was\n");
                return false;
            }
        };
        show(&warnings(&graph));
        if !wanted(&graph).is_ok_and(|wanted| driver.suits(wanted.as_ref())) {
            remark(
                "the graph stays as it was: it asks for another soundcard now, and that needs a new run\n",
            );
            return false;
        }
        if let Err(error) = self.network.connect(&graph) {
            remark(&format!("the graph stays as it was: {error}\n"));
            return false;
        }
        match self.session.change(&graph, &self.folder) {
            Ok(changed) => {
                self.changes += 1;
                remark(&told(&changed, began.elapsed()));
                self.look_at(&graph);
                true
            }
            Err(error) => {
                remark(&format!("the graph stays as it was: {error}\n"));
                false
            }
        }
    }

    /// A changed graph may read other files.
    fn look_at(&mut self, graph: &Graph) {
        if let Some(watch) = &mut self.watch {
            *watch = Watch::of(graph);
        }
    }
}

fn show(findings: &Diagnostics) {
    if !findings.list.is_empty() {
        remark(&render(findings, std::io::stderr().is_terminal()));
    }
}

fn told(changed: &Changed, took: Duration) -> String {
    let mut text = match changed.change {
        Change::Settings(0) => "nothing changed".to_owned(),
        Change::Settings(1) => "a setting changed".to_owned(),
        Change::Settings(count) => format!("{count} settings changed"),
        Change::Swap => "the graph changed".to_owned(),
    };
    for (paths, what) in [
        (&changed.begun, "begins"),
        (&changed.ended, "is complete"),
        (&changed.left_out, "holds other signals and is not begun again"),
    ] {
        for path in paths {
            let name = path.file_name().unwrap_or(path.as_os_str()).display();
            text += &format!("; {name} {what}");
        }
    }
    text + &format!(" ({:.0} ms)\n", took.as_secs_f64() * 1e3)
}

fn facts_of(ended: &LiveOutcome, changes: u32) -> Vec<(&'static str, &'static str, Value)> {
    let meters = &ended.meters;
    vec![
        ("live", "Live", json!(true)),
        ("late_us", "Lateness (us)", quantiles(&meters.lateness)),
        ("work_us", "Execution time (us)", quantiles(&meters.work)),
        ("wakes", "Wake-ups", json!(meters.wakes)),
        ("overruns", "Overruns", json!(meters.overruns)),
        ("stalls", "Stalls of the machine", json!(meters.stalls)),
        ("lost_wakes", "Wake-ups lost in stalls", json!(meters.lost_wakes)),
        (
            "lost_numbers",
            "Numbers lost on the way to files",
            json!(ended.lost_numbers),
        ),
        ("changes", "Changed while running", json!(changes)),
    ]
}

/// What was seen of the packets of each network device.
fn packets(network: &Connections) -> Option<(&'static str, &'static str, Value)> {
    let counted = |(device, counts): (&str, Counts)| {
        let Counts {
            accepted,
            missing,
            outdated,
            malformed,
            not_numbers,
            strangers,
        } = counts;
        let counts = json!({
            "accepted": accepted, "missing": missing, "outdated": outdated, "malformed": malformed,
            "not_numbers": not_numbers, "strangers": strangers,
        });
        (device.to_owned(), counts)
    };
    let devices: serde_json::Map<String, Value> = network.counts().map(counted).collect();
    (!devices.is_empty()).then_some(("packets", "Packets", Value::Object(devices)))
}

fn quantiles(histogram: &Histogram) -> Value {
    let us = |ns: u64| (ns as f64 / 100.0).round() / 10.0;
    let at = |fraction: f64| us(histogram.quantile_ns(fraction));
    json!({ "p50": at(0.5), "p99": at(0.99), "p99.9": at(0.999), "max": us(histogram.max_ns()) })
}

fn warnings_of(ended: &LiveOutcome) -> Vec<String> {
    let Meters {
        overruns,
        stalls,
        lost_wakes,
        ..
    } = ended.meters;
    let mut list = Vec::new();
    if ended.panicked {
        list.push("a node panicked; the actuators were taken to zero and the run ended there".to_owned());
    }
    if overruns > 0 {
        list.push(format!(
            "{overruns} ticks took longer than the time there was for them"
        ));
    }
    if stalls > 0 {
        list.push(format!(
            "the machine stalled {stalls} times, {lost_wakes} wake-ups in all; time went on from there"
        ));
    }
    if ended.lost_numbers > 0 {
        list.push(format!(
            "{} numbers were lost on the way to the files: they have gaps",
            ended.lost_numbers
        ));
    }
    list.extend(ended.failed.iter().map(ToString::to_string));
    list
}
