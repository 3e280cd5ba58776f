//! `haptograph run --live`: the graph runs against the clock, can be changed while it runs, and leaves what an
//! offline run leaves.

use super::super::{Failure, GraphArguments, remark, warnings};
use super::console::{self, Asked, HELP, Typed};
use super::drivers::Drivers;
use super::latency;
use super::summary::Summary;
use super::watch::Watch;
use super::{Arguments, Making, lasts_a_frame, message, stop_on_interrupt};
use haptograph::engine::diagnostic::{Diagnostics, render};
use haptograph::engine::document::{Document, LoadOptions};
use haptograph::engine::graph::Graph;
use haptograph::engine::node::Limit;
use haptograph::engine::run::{
    Change, Changed, Histogram, LiveOptions, LiveOutcome, Meters, RingReport, Session,
};
use haptograph::engine::settings::closest;
use haptograph::nodes::network::{Connections, Counts, OscControl, Told};
use haptograph::nodes::soundcard::wanted;
use serde_json::{Value, json};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
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
    // What is saved from here on is seen.
    let watch = arguments.watch.then(|| Watch::of(&graph));
    lasts_a_frame(&graph, arguments.duration_s)?;
    let wanted = wanted(&graph).map_err(message)?;
    let mut network = Connections::default();
    network.connect(&graph).map_err(message)?;
    let (asking, asked) = sync_channel(MOST_ASKED);
    let osc = listen_for_settings(&arguments, &asking)?;
    let made = Making::begin(&arguments, &graph)?;
    let options = LiveOptions {
        block: usize::from(arguments.block),
        seconds: arguments.duration_s,
    };
    let stop = stop_on_interrupt()?;
    let folder = Some(made.kept.folder.path());
    let (lives, session) = Session::open_all(made.outlets, &options, folder).map_err(message)?;
    let start = Instant::now();
    let mut driver = Drivers::start(&graph, wanted, lives)?;
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
    for listened in driver.listened() {
        remark(&format!("listening to {listened}\n"));
    }
    for (device, place) in network.places() {
        remark(&format!("listening for `{device}` at {place}\n"));
    }
    if let Some(osc) = &osc {
        remark(&format!("settings by Open Sound Control at {}\n", osc.address()));
    }
    console::listen(asking.clone());
    let mut attended = Attended {
        given: arguments.graph.set.clone(),
        typed: Vec::new(),
        arguments: arguments.graph.clone(),
        seed: arguments.seed,
        folder: made.kept.folder.path().to_owned(),
        watch,
        session,
        network,
        changes: 0,
        swaps: 0,
        history: History::default(),
        refused: Vec::new(),
        guards: Guards::of(&graph),
    };
    notes.extend(attended.attend(&mut driver, &asked, &stop));
    // Until here somebody asks, if only this one, so that waiting for it is waiting.
    drop(asking);
    let mut facts = driver.facts();
    notes.extend(driver.warnings());
    notes.extend(attended.network.warnings());
    let heard: Vec<RingReport> = driver.rings().collect();
    let latencies = latency::measured(&graph, &driver);
    facts.push((
        "latencies_ms",
        "Latencies, measured (ms)",
        latency::to_json(&latencies),
    ));
    let lives = driver.join()?;
    facts.push(("changes", "Changed while running", json!(attended.changes)));
    facts.push(("swaps", "Other graphs that took over", json!(attended.swaps)));
    facts.extend(packets(&attended.network));
    facts.push((
        "set_while_running",
        "Set while running",
        attended.history.into_json(),
    ));
    facts.extend(osc.map(|osc| {
        (
            "osc_malformed",
            "OSC packets that were no settings",
            json!(osc.malformed()),
        )
    }));
    drop(attended.network);
    let mut ended = attended.session.finish_all(lives);
    ended.outcome.rings.extend(heard);
    let took_s = start.elapsed().as_secs_f64();
    remark(&format!("{}\n", ended.meters));
    if !latencies.is_empty() {
        remark(&format!("{}:\n", latency::BY_WHOSE_CLOCK));
    }
    for latency in &latencies {
        remark(&format!("{}\n", latency.shown()));
    }
    let mut summary = Summary::of(&arguments, &graph, &ended.outcome, took_s);
    facts.extend(facts_of(&ended));
    notes.extend(warnings_of(&ended));
    summary.add(facts, notes);
    made.kept.complete(&arguments, &graph, &summary)
}

/// Wishes that wait, and those that are heard between two looks at whether the run should stop.
const MOST_ASKED: usize = 1024;
const MOST_HEARD: usize = 64;

/// How much is said of a change. A fader is moved a hundred times a second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Says {
    Nothing,
    /// Why it is refused.
    Refusals,
    Everything,
}

impl Says {
    fn refusal(self, text: &str) {
        if self >= Self::Refusals {
            remark(text);
        }
    }

    fn success(self, text: &str) {
        if self >= Self::Everything {
            remark(text);
        }
    }
}

/// A run and what may happen to it.
struct Attended {
    /// With the parameters as they are now.
    arguments: GraphArguments,
    /// Parameters as the command line gave them.
    given: Vec<(String, String)>,
    /// Parameters that were typed or told since, with the default that the file had for each.
    typed: Vec<(String, Option<String>)>,
    seed: Option<u64>,
    folder: PathBuf,
    watch: Option<Watch>,
    session: Session,
    network: Connections,
    /// Graphs that were put in place, and those of them that differed in more than live settings.
    changes: u32,
    swaps: u32,
    history: History,
    /// Names that were told by Open Sound Control and refused; said once each.
    refused: Vec<String>,
    guards: Guards,
}

/// What nobody may change from afar: what each actuator may be given, and what the devices that are driven are set to.
#[derive(Debug, PartialEq)]
struct Guards {
    limits: Vec<(String, Limit)>,
    driven: Vec<(String, u64)>,
}

impl Guards {
    fn of(graph: &Graph) -> Self {
        let limits = graph.limits().map(|(sink, limit)| (sink.to_owned(), limit));
        let driven = graph.driven_devices();
        Self {
            limits: limits.collect(),
            driven: driven
                .map(|device| (device.name.clone(), device.fingerprint))
                .collect(),
        }
    }

    /// The limits that differ from those before.
    fn changes(&self, before: &Self) -> Vec<String> {
        let known = |sink: &str| before.limits.iter().find(|(known, _)| known == sink);
        let mut changes = Vec::new();
        for (sink, now) in &self.limits {
            let Some((_, was)) = known(sink) else { continue };
            for (name, was, now) in [
                ("peak", was.peak, now.peak),
                ("continuous", was.continuous, now.continuous),
                ("window_s", was.window_s, now.window_s),
                (
                    "slew",
                    was.slew_per_s.unwrap_or(f64::INFINITY),
                    now.slew_per_s.unwrap_or(f64::INFINITY),
                ),
            ] {
                if was != now {
                    changes.push(format!("limit of `{sink}`: {name} {was} -> {now}"));
                }
            }
        }
        changes
    }
}

/// What was set while it ran.
#[derive(Debug, Default)]
struct History {
    list: Vec<String>,
    more: u64,
}

impl History {
    /// A fader can be moved for hours.
    const MOST: usize = 200;

    fn note(&mut self, at_s: f64, name: &str, value: &str, by: &str) {
        if self.list.len() < Self::MOST {
            self.list.push(format!("{at_s:.2} s {name}={value} ({by})"));
        } else {
            self.more += 1;
        }
    }

    fn into_json(mut self) -> Value {
        if self.more > 0 {
            self.list.push(format!("and {} more", self.more));
        }
        json!(self.list)
    }
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
        // One that finds no room is lost: faders tell again. A run that is over needs none.
        let _ = asking.try_send(Asked::Told(told));
    })
    .map(Some)
    .map_err(|error| Failure::Message(format!("cannot listen for settings at {address}: {error}")))
}

impl Attended {
    /// Looks after the run until it is over. Returns what the driver had to say.
    fn attend(&mut self, driver: &mut Drivers, asked: &Receiver<Asked>, stop: &AtomicBool) -> Vec<String> {
        let start = Instant::now();
        let (mut shown, mut stopping, mut said) = (start, false, Vec::<(String, u64)>::new());
        while !driver.is_finished(stopping) {
            let first = asked.recv_timeout(PAUSE).ok();
            for note in driver.tend().into_iter().chain(self.network.tend()) {
                // A card in trouble says the same a thousand times.
                if let Some((_, times)) = said.iter_mut().find(|(known, _)| *known == note) {
                    *times += 1;
                } else {
                    remark(&format!("note: {note}\n"));
                    said.push((note, 1));
                }
            }
            let status = status(&mut self.session, driver.rings());
            if shown.elapsed() >= STATUS {
                shown += STATUS;
                let seconds = start.elapsed().as_secs_f64();
                let (driver, network) = (driver.status(), self.network.status());
                remark(&format!("{seconds:.0} s: {status}{driver}{network}\n"));
            }
            if driver.is_torn() {
                stop.store(true, Ordering::Relaxed);
            }
            if stop.load(Ordering::Relaxed) && !stopping {
                // Asked again where the real-time side has not read its commands for a while.
                stopping = self.session.stop().is_ok();
            }
            let mut told = Vec::new();
            for asked in first.into_iter().chain(asked.try_iter()).take(MOST_HEARD) {
                match asked {
                    Asked::Typed(Typed::Set { name, value }) => {
                        if self.set(driver, &name, &value, Says::Everything) {
                            self.history
                                .note(start.elapsed().as_secs_f64(), &name, &value, "typed");
                        }
                    }
                    Asked::Typed(Typed::List) => self.list(),
                    Asked::Typed(Typed::Stop) => stop.store(true, Ordering::Relaxed),
                    Asked::Typed(Typed::Unknown(line)) => {
                        remark(&format!("`{line}` is not known; type {HELP}\n"));
                    }
                    Asked::Told(Told { name, value }) => {
                        // A fader that moves fast is where it is now.
                        told.retain(|(known, _)| *known != name);
                        told.push((name, value));
                    }
                }
            }
            for (name, value) in told {
                let full = self.refused.len() >= History::MOST;
                if full && !name.contains('.') && !self.arguments.set.iter().any(|(known, _)| *known == name)
                {
                    // To see whether there is such a parameter the graph would be loaded, each time.
                    continue;
                }
                let known = full || self.refused.contains(&name);
                let says = if known { Says::Nothing } else { Says::Refusals };
                if self.set(driver, &name, &value, says) {
                    self.history
                        .note(start.elapsed().as_secs_f64(), &name, &value, "OSC");
                } else if !known {
                    self.refused.push(name);
                }
            }
            if self.watch.as_mut().is_some_and(Watch::has_changed) {
                self.reload_saved(driver);
            }
        }
        let counted = said.into_iter().map(|(note, times)| match times {
            1 => note,
            _ => format!("{note} ({times} times)"),
        });
        counted.collect()
    }

    /// A parameter of the graph, or a live setting of a node. Was it set?
    fn set(&mut self, driver: &Drivers, name: &str, value: &str, says: Says) -> bool {
        if name.contains('.') {
            return self.set_directly(name, value, says);
        }
        let before = self.arguments.set.clone();
        self.arguments.set.retain(|(known, _)| known != name);
        self.arguments.set.push((name.to_owned(), value.to_owned()));
        let set = self.reload(driver, says);
        if set {
            self.typed.retain(|(known, _)| known != name);
            self.typed.push((name.to_owned(), self.default_of(name)));
        } else {
            self.arguments.set = before;
        }
        set
    }

    /// The default that the file has for a parameter now, as it is written.
    fn default_of(&self, name: &str) -> Option<String> {
        let document = Document::load(&self.arguments.graph, &LoadOptions::default()).ok()?;
        let mut parameters = document.parameters();
        parameters
            .find(|(known, _)| *known == name)
            .map(|(_, text)| text.to_owned())
    }

    /// After a save: a parameter whose default is another now is the file's again, whatever was typed before.
    fn reload_saved(&mut self, driver: &Drivers) {
        let before = self.arguments.set.clone();
        let (same, other): (Vec<_>, Vec<_>) = std::mem::take(&mut self.typed)
            .into_iter()
            .partition(|(name, default)| self.default_of(name) == *default);
        for (name, _) in &other {
            self.arguments.set.retain(|(known, _)| known != name);
            let given = self.given.iter().find(|(known, _)| known == name);
            self.arguments.set.extend(given.cloned());
        }
        self.typed = same;
        if !self.reload(driver, Says::Everything) {
            self.arguments.set = before;
            self.typed.extend(other);
        }
    }

    fn set_directly(&mut self, name: &str, value: &str, says: Says) -> bool {
        let Ok(number) = value.parse::<f64>() else {
            says.refusal(&format!("`{value}` is not a number\n"));
            return false;
        };
        match self.session.set_by_name(name, number) {
            Ok(()) => {
                says.success(&format!("{name} is {number}\n"));
                true
            }
            Err(error) => {
                let names: Vec<String> = self.session.settings().map(|live| live.name()).collect();
                let near = closest(name, names.iter().map(String::as_str));
                let help = near
                    .filter(|near| *near != name)
                    .map(|near| format!("; did you mean `{near}`?"));
                says.refusal(&format!("`{name}` stays: {error}{}\n", help.unwrap_or_default()));
                false
            }
        }
    }

    fn list(&mut self) {
        for live in self.session.settings() {
            remark(&format!("{} = {}\n", live.name(), live.value));
        }
    }

    /// Loads the graph again and puts it in place of the one that runs; a wrong one is shown and changes nothing.
    fn reload(&mut self, driver: &Drivers, says: Says) -> bool {
        let began = Instant::now();
        let graph = match self.arguments.load(self.seed) {
            Ok(graph) => graph,
            Err(wrong) => {
                show(&wrong, says);
                says.refusal("the graph stays as it was\n");
                return false;
            }
        };
        let watch = self.watch.as_ref().map(|_| Watch::of(&graph));
        if says == Says::Everything {
            show(&warnings(&graph), says);
        }
        if !wanted(&graph).is_ok_and(|wanted| driver.suits(&wanted)) {
            says.refusal(
                "the graph stays as it was: it asks for another soundcard now, and that needs a new run\n",
            );
            return false;
        }
        let guards = Guards::of(&graph);
        if says < Says::Everything && guards != self.guards {
            says.refusal(
                "the graph stays as it was: an actuator's limit or device would change, and that is not done from afar\n",
            );
            return false;
        }
        if let Err(error) = self.network.connect(&graph) {
            says.refusal(&format!("the graph stays as it was: {error}\n"));
            return false;
        }
        match self.session.change(&graph, &self.folder) {
            Ok(changed) => {
                self.changes += 1;
                self.swaps += u32::from(!matches!(changed.change, Change::Settings(_)));
                // The file may have been edited meanwhile, so another graph is always told of.
                if says == Says::Everything || !matches!(changed.change, Change::Settings(_)) {
                    remark(&told(&changed, began.elapsed()));
                }
                // A changed graph may read other files.
                self.watch = watch;
                for change in guards.changes(&self.guards) {
                    remark(&format!("{change}\n"));
                }
                self.guards = guards;
                true
            }
            Err(error) => {
                says.refusal(&format!("the graph stays as it was: {error}\n"));
                false
            }
        }
    }
}

/// How time is kept, by driver where there are several, and how the rings between them are.
fn status(session: &mut Session, heard: impl Iterator<Item = RingReport>) -> String {
    let mut parts: Vec<String> = match &session.poll()[..] {
        [(_, meters)] => vec![meters.to_string()],
        several => several
            .iter()
            .map(|(name, meters)| format!("{name}: {meters}"))
            .collect(),
    };
    parts.extend(session.rings().chain(heard).map(|ring| {
        let counts = ring.counts;
        let fill = counts
            .fill_s
            .map_or_else(|| "empty".to_owned(), |fill_s| format!("{:.2} ms", fill_s * 1e3));
        format!(
            "ring {}: {fill}, {:+.0} ppm, {} underruns, {} overruns",
            ring.name, counts.correction_ppm, counts.underruns, counts.overruns
        )
    }));
    parts.join("; ")
}

fn show(findings: &Diagnostics, says: Says) {
    if !findings.list.is_empty() {
        says.refusal(&render(findings, std::io::stderr().is_terminal()));
    }
}

fn told(changed: &Changed, took: Duration) -> String {
    let mut text = match changed.change {
        Change::Settings(0) => "nothing changed".to_owned(),
        Change::Settings(1) => "a setting changed".to_owned(),
        Change::Settings(count) => format!("{count} settings changed"),
        Change::CrossFade => "the graph changed, cross-faded".to_owned(),
        Change::AtOnce => "the graph changed".to_owned(),
        Change::AtZero(reason) => format!("the graph changed, through zero as {reason}"),
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

fn facts_of(ended: &LiveOutcome) -> Vec<(&'static str, &'static str, Value)> {
    let meters = &ended.meters;
    let mut facts = vec![
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
    ];
    if let [_, _, ..] = ended.drivers[..] {
        let each = ended.drivers.iter().map(|(name, meters)| {
            let kept = json!({
                "late_us": quantiles(&meters.lateness), "work_us": quantiles(&meters.work), "wakes": meters.wakes,
                "overruns": meters.overruns, "stalls": meters.stalls, "lost_wakes": meters.lost_wakes,
            });
            (name.clone(), kept)
        });
        facts.push(("drivers", "Each driver", Value::Object(each.collect())));
    }
    facts
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
            too_large,
            strangers,
            jumps,
        } = counts;
        let counts = json!({
            "accepted": accepted, "missing": missing, "outdated": outdated, "malformed": malformed,
            "not_numbers": not_numbers, "too_large": too_large, "strangers": strangers, "jumps": jumps,
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
    for device in &ended.lost_devices {
        list.push(format!(
            "`{device}` panicked when it was taken to zero: it was left as it was, switch it off"
        ));
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
    if ended.lost_arrivals > 0 {
        list.push(format!(
            "a replay ends {} callbacks early: the disk was too slow for what it goes by",
            ended.lost_arrivals
        ));
    }
    list.extend(ended.failed.iter().map(ToString::to_string));
    list
}
