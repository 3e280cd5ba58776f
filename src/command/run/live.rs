//! `haptograph run --live`: the graph runs against the clock, can be changed while it runs, and leaves what an
//! offline run leaves.

use super::super::{Failure, remark};
use super::attended::{Attended, MOST_ASKED};
use super::console::{self, Asked, HELP};
use super::drivers::Drivers;
use super::facts::{facts_of, packets, warnings_of};
use super::latency;
use super::summary::Summary;
use super::watch::Watch;
use super::{Arguments, Making, lasts_a_frame, message, stop_on_interrupt};
use haptograph::engine::run::{LiveOptions, RingReport, Session};
use haptograph::nodes::network::{Connections, OscControl};
use haptograph::nodes::soundcard::wanted;
use serde_json::json;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::Instant;

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
    let mut made = Making::begin(&arguments, &graph)?;
    let options = LiveOptions {
        block: usize::from(arguments.block),
        seconds: arguments.duration_s,
        rested: arguments.rested,
    };
    let stop = stop_on_interrupt()?;
    let folder = Some(made.kept.folder.path());
    let (lives, session) = Session::open_all(made.outlets, &options, folder).map_err(message)?;
    let unrested: Vec<String> = lives
        .iter()
        .flat_map(|live| live.run().unrested().map(str::to_owned))
        .collect();
    let start = Instant::now();
    let mut driver = Drivers::start(&graph, wanted, lives)?;
    made.kept.folder.begin();
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
    if !unrested.is_empty() {
        remark(&format!(
            "the actuators of `{}` begin as warm as their limits allow, as it is not known how long they have rested; \
             --rested says that they are cold\n",
            unrested.join("`, `")
        ));
    }
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
    let folder = made.kept.folder.path();
    let mut attended = Attended::begin(&arguments, &graph, folder, watch, session, network);
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
    facts.push((
        "unrested",
        "Sinks whose actuators began as warm as their limits allow",
        json!(unrested),
    ));
    facts.push(("changes", "Changed while running", json!(attended.changes)));
    facts.push(("swaps", "Other graphs that took over", json!(attended.swaps)));
    facts.push((
        "saved_while_running",
        "Graphs that were saved while it ran",
        json!(attended.saved),
    ));
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
