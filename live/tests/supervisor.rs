//! Player runs by the library alone: the requests of an embedding program, the events and the report.
#![allow(clippy::unwrap_used)]

use haptograph_engine::document::Document;
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::registry::Registry;
use haptograph_engine::run::{FileSinks, Player, Session, SessionOptions, Wake};
use haptograph_live::supervisor::{
    Ended, Event, Origin, Request, RunOptions, RunReport, SendError, SettingError, StartError, Supervisor,
    replay,
};
use haptograph_live::{
    BACKENDS, Backend, BackendEntry, BackendError, Connected, Counts, Lives, SettingValue, State, add_backend,
};
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

const GRAPH: &str = r#"Graph(format: 1, parameters: { "level": 0.5 },
    clocks: { "servo": Driver(rate_hz: 1000) },
    nodes: {
        "one": Constant(clock: "servo", value: Param("level"), quantity: "current"),
        "out": ActuatorSink(current: "one", endpoint: "coil", limit: (peak_a: 1.5, continuous_a: 1.5)),
        "file": CsvSink(inputs: ["out.delivered"], file: "given.csv"),
    },
    endpoints: { "simulated": { "coil": SimulatedHaptuator() } })"#;

fn registry() -> Registry {
    haptograph_nodes::registry()
}

/// Options of a graph in a folder.
fn options(folder: &Path, text: &str) -> RunOptions {
    let path = folder.join("g.ron");
    fs::write(&path, text).unwrap();
    let mut options = RunOptions::of(path);
    options.rested = true;
    options
}

/// Polls until an event is found or the run is over, then stops the run. Returns all events.
fn serve(run: &mut Supervisor, is_last: impl Fn(&Event) -> bool) -> Vec<Event> {
    let mut events = Vec::new();
    while !run.is_finished() {
        run.wait();
        let new = run.poll();
        if new.iter().any(&is_last) {
            run.stop();
        }
        events.extend(new);
    }
    events
}

fn ended(mut run: Supervisor, is_last: impl Fn(&Event) -> bool) -> (Ended, Vec<Event>) {
    let events = serve(&mut run, is_last);
    (run.finish().unwrap(), events)
}

#[test]
fn a_setting_and_a_parameter_are_set_and_reported() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    fs::create_dir(&out).unwrap();
    let options = options(folder.path(), GRAPH);
    let mut run = Supervisor::start(options, &registry(), Some(&out)).unwrap();
    assert_eq!(run.settings()[0], ("level".to_owned(), Some("0.5".into())));
    run.set("out.gain", 0.5);
    run.set("nonsense", 1);
    let sender = run.sender();
    sender.send(Request::new("level", "1.0")).unwrap();
    let (ended, events) = ended(run, |event| matches!(event, Event::Changed(..)));
    let is_set =
        |event: &Event| matches!(event, Event::Set(name, value) if name == "out.gain" && *value == 0.5);
    assert!(events.iter().any(is_set), "{events:?}");
    assert!(events.iter().any(|event| matches!(event, Event::Refused(_))));
    let report = &ended.report;
    assert!(report.live && report.driver.contains("timer") && report.panics.is_empty());
    assert_eq!((report.changes, report.set_while_running.len()), (1, 2));
    assert!(report.timing.wakes > 0 && ended.outcome.outcome.stopped);
    assert_eq!(ended.devices.len(), 1);
    // What the actuator was given: half of 0.5 A, then of 1 A, then zero.
    let given = fs::read_to_string(out.join("given.csv")).unwrap();
    let given: Vec<f64> = given.lines().skip(1).map(last_cell).collect();
    let highest = given.iter().fold(0.0, |most: f64, value| most.max(*value));
    assert!(highest <= 0.5 + 1e-9 && given.last().unwrap().abs() < 0.06, "{highest}");
    let value = serde_json::to_value(report).unwrap();
    assert_eq!(serde_json::from_value::<RunReport>(value).unwrap(), *report);
}

/// The value of a live setting.
fn number(run: &Supervisor, name: &str) -> f64 {
    let settings = run.settings();
    match settings.iter().find(|(known, _)| known == name) {
        Some((_, Some(SettingValue::Number(number)))) => *number,
        other => panic!("{other:?}"),
    }
}

/// By a handle, by name, and from another thread; none of them loads the graph.
#[test]
fn a_live_setting_gets_exactly_the_bits_that_were_set() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    fs::create_dir(&out).unwrap();
    let mut run = Supervisor::start(options(folder.path(), GRAPH), &registry(), Some(&out)).unwrap();
    let handle = run.setting("out.gain").unwrap();
    let sender = run.sender();
    let values = [0.1 + 0.2, 1e-300, f64::MIN_POSITIVE, 5e-324, 0.7];
    for value in values {
        for way in 0..3 {
            run.set("out.gain", 0.25);
            run.poll();
            match way {
                0 => handle.set(value).unwrap(),
                1 => run.set("out.gain", value),
                _ => {
                    let request = Request::from_origin(Origin::Osc, "out.gain", value);
                    sender.send(request).unwrap();
                }
            }
            run.poll();
            assert_eq!(number(&run, "out.gain").to_bits(), value.to_bits(), "{value:e}");
        }
    }
    // The latest counts.
    handle.set(0.125).unwrap();
    handle.set(0.5).unwrap();
    run.poll();
    assert_eq!(number(&run, "out.gain"), 0.5);
    run.stop();
    let (ended, _) = ended(run, |_| false);
    assert_eq!((ended.report.changes, ended.report.set_while_running.len()), (0, 31));
    assert_eq!(handle.set(0.5), Err(SendError::Ended));
    // What the real-time side got, as its replay log has it.
    let log = fs::read_to_string(out.join("arrivals/0.settings.csv")).unwrap();
    for value in values {
        let is_it = |cell: &str| cell.parse::<f64>().is_ok_and(|x| x.to_bits() == value.to_bits());
        assert!(log.split([',', '\n']).any(is_it), "{value:e}: {log}");
    }
}

#[test]
fn of_all_ways_to_set_a_value_the_latest_counts() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Supervisor::start(options(folder.path(), GRAPH), &registry(), None).unwrap();
    let (first, second) = (run.setting("out.gain").unwrap(), run.setting("out.gain").unwrap());
    let sender = run.sender();
    let by_sender = |value: f64| {
        let request = Request::from_origin(Origin::Osc, "out.gain", value);
        sender.send(request).unwrap();
    };
    first.set(1.0).unwrap();
    run.set("out.gain", 0.0);
    run.poll();
    assert_eq!(number(&run, "out.gain"), 0.0);
    run.set("out.gain", 1.0);
    by_sender(0.5);
    first.set(0.25).unwrap();
    run.poll();
    assert_eq!(number(&run, "out.gain"), 0.25);
    second.set(1.0).unwrap();
    first.set(0.125).unwrap();
    run.poll();
    assert_eq!(number(&run, "out.gain"), 0.125);
    // More requests than one poll handles, all older than the handle's value.
    (0..200).for_each(|_| sender.send(Request::new("out.gain", 1.0)).unwrap());
    first.set(0.0).unwrap();
    for _ in 0..10 {
        run.poll();
    }
    assert_eq!(number(&run, "out.gain"), 0.0);
    run.stop();
    ended(run, |_| false);
}

#[test]
fn a_handle_is_refused_once_and_follows_its_name_to_another_graph() {
    let folder = tempfile::tempdir().unwrap();
    let mut options = options(folder.path(), GRAPH);
    options.watch = true;
    let mut run = Supervisor::start(options, &registry(), None).unwrap();
    assert_eq!(run.setting("level").unwrap_err(), SettingError::Parameter("level".to_owned()));
    let unknown = run.setting("out.gian").unwrap_err();
    assert!(
        matches!(&unknown, SettingError::Unknown(unknown) if unknown.name == "out.gian" && unknown.help.contains("out.gain"))
    );
    let handle = run.setting("out.gain").unwrap();
    let refusals = |run: &mut Supervisor, value| {
        handle.set(value).unwrap();
        run.poll().iter().filter(|event| matches!(event, Event::Refused(_))).count()
    };
    for (value, refused) in [(f64::NAN, 1), (f64::INFINITY, 0), (0.5, 0), (f64::NAN, 1)] {
        assert_eq!(refusals(&mut run, value), refused, "{value}");
    }
    assert_eq!(number(&run, "out.gain"), 0.5);
    let other = r#""aaa": Gain(input: "one", gain: 0.5), "out": ActuatorSink(current: "aaa""#;
    let text = GRAPH.replace(r#""out": ActuatorSink(current: "one""#, other);
    fs::write(folder.path().join("g.ron"), text + " ").unwrap();
    while !run.poll().iter().any(|event| matches!(event, Event::Changed(..))) {
        run.wait();
    }
    handle.set(0.75).unwrap();
    run.poll();
    assert_eq!((number(&run, "out.gain"), number(&run, "aaa.gain")), (0.75, 0.5));
}

/// Far less than the wait takes without it.
#[test]
fn a_request_ends_a_wait() {
    const WAIT: Duration = Duration::from_secs(60);
    let folder = tempfile::tempdir().unwrap();
    let mut run = Supervisor::start(options(folder.path(), GRAPH), &registry(), None).unwrap();
    let (handle, sender) = (run.setting("out.gain").unwrap(), run.sender());
    let start = Instant::now();
    let request = || Request::new("out.gain", 0.25);
    for way in 0..4 {
        std::thread::scope(|scope| {
            scope.spawn(|| match way {
                0 => handle.set(0.5).unwrap(),
                1 => sender.send(request()).unwrap(),
                2 => sender.try_send(request()).unwrap(),
                _ => sender.wake(),
            });
            run.wait_at_most(WAIT);
        });
        run.poll();
        assert_eq!(number(&run, "out.gain"), if way == 0 { 0.5 } else { 0.25 });
    }
    run.set("out.gain", 0.75);
    run.wait_at_most(WAIT);
    assert!(start.elapsed() < WAIT / 2);
}

fn last_cell(line: &str) -> f64 {
    line.rsplit(',').next().unwrap().parse().unwrap()
}

#[test]
fn a_saved_file_is_swapped_in_unless_it_is_not_accepted() {
    let other = r#""other": Gain(input: "one", gain: 0.5), "out": ActuatorSink(current: "other""#;
    for is_accepted in [true, false] {
        let text = GRAPH.replace(r#""out": ActuatorSink(current: "one""#, other);
        let folder = tempfile::tempdir().unwrap();
        let mut options = options(folder.path(), GRAPH);
        options.watch = true;
        options.accept = Arc::new(move |graph| match graph.nodes().find("other") {
            Some(_) if !is_accepted => Err("it is not wanted".to_owned()),
            _ => Ok(()),
        });
        let run = Supervisor::start(options, &registry(), None).unwrap();
        fs::write(folder.path().join("g.ron"), text + " ").unwrap();
        let (ended, events) = ended(run, |event| matches!(event, Event::Changed(..) | Event::Refused(_)));
        let refused = |event: &Event| matches!(event, Event::Refused(why) if why.contains("not wanted"));
        assert_eq!(events.iter().any(refused), !is_accepted, "{events:?}");
        assert_eq!(ended.report.swaps, u32::from(is_accepted));
        // Without a folder nothing is kept.
        assert!(ended.report.saved_while_running.is_empty());
    }
}

#[test]
fn a_saved_file_that_gains_live_endpoints_moves_nothing_real() {
    let folder = tempfile::tempdir().unwrap();
    let mut options = options(folder.path(), GRAPH);
    options.watch = true;
    let run = Supervisor::start(options, &registry(), None).unwrap();
    let live = r#"endpoints: { "live": { "coil": UdpDevice(listen: "127.0.0.1:0") }, "simulated""#;
    let text = GRAPH.replace(r#"endpoints: { "simulated""#, live);
    fs::write(folder.path().join("g.ron"), text.replace("0.5 }", "0.25 }")).unwrap();
    let (ended, events) =
        ended(run, |event| matches!(event, Event::Changed(..) | Event::Set(..) | Event::Refused(_)));
    assert!(!events.iter().any(|event| matches!(event, Event::Refused(_))), "{events:?}");
    assert!(
        !ended.devices.is_empty() && ended.devices.iter().all(|device| device.is_simulated),
        "{:?}",
        ended.devices
    );
}

#[test]
fn a_graph_with_errors_and_a_device_that_is_taken_do_not_start() {
    let folder = tempfile::tempdir().unwrap();
    let start = |text: &str| Supervisor::start(options(folder.path(), text), &registry(), None).map(drop);
    assert!(matches!(start("Graph("), Err(StartError::Graph(_))));
    let taken = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let device = format!("UdpDevice(listen: \"{}\")", taken.local_addr().unwrap());
    let refused = start(&GRAPH.replace("SimulatedHaptuator()", &device));
    assert!(matches!(refused, Err(StartError::Backend(BackendError::Bind { .. }))), "{refused:?}");
}

#[test]
fn a_run_of_a_given_time_ends_there_and_can_be_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let mut options = options(folder.path(), GRAPH);
    options.seconds = Some(0.1);
    let run = Supervisor::start(options, &registry(), None).unwrap();
    let (ended, _) = ended(run, |_| false);
    let outcome = &ended.outcome.outcome;
    assert!(!outcome.stopped && (outcome.seconds - 0.1).abs() < 1e-9);
    let report = serde_json::to_value(&ended.report).unwrap();
    assert_eq!(replay::differences(&report), [""; 0]);
}

/// The report alone bounds a replay, and the replay of the run's folder gives its bytes.
#[test]
fn a_run_is_replayed_from_its_report() {
    let folder = tempfile::tempdir().unwrap();
    let [live, again] = ["live", "again"].map(|name| folder.path().join(name));
    fs::create_dir(&live).unwrap();
    fs::create_dir(&again).unwrap();
    let mut options = options(folder.path(), GRAPH);
    options.seconds = Some(0.2);
    let mut run = Supervisor::start(options, &registry(), Some(&live)).unwrap();
    run.set("out.gain", 0.1 + 0.2);
    let (ended, _) = ended(run, |_| false);
    assert_eq!((ended.report.driver_frames, &*ended.report.clocks), (200, &["servo 1000 Hz".to_owned()][..]));
    let document = Document::load(folder.path().join("g.ron"), &Default::default()).unwrap();
    let graph = check(&document, &registry(), &CheckOptions::default()).unwrap();
    let report = serde_json::to_value(&ended.report).unwrap();
    let bounds = replay::bounds(&graph, &report).unwrap();
    assert_eq!(bounds.frames, Some((200, true)));
    let mut sinks = FileSinks::new(&graph);
    sinks.open_files(&again).unwrap();
    Session::replay(sinks, (&live, &bounds), &SessionOptions::default().block(64), &mut |_| {}).unwrap();
    let of = |folder: &Path| fs::read(folder.join("given.csv")).unwrap();
    assert!(of(&live) == of(&again) && of(&live).len() > 200);
    // A file that cannot be written is named by the error and has a cause.
    let refused = Supervisor::start(
        RunOptions::of(folder.path().join("g.ron")),
        &registry(),
        Some(&folder.path().join("missing")),
    );
    let Err(StartError::File(error)) = refused else {
        panic!("it started");
    };
    assert_eq!((error.error.kind(), error.path.ends_with("given.csv")), (std::io::ErrorKind::NotFound, true));
}

#[test]
fn a_run_that_is_finished_early_or_dropped_stops_its_actuators() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Supervisor::start(options(folder.path(), GRAPH), &registry(), None).unwrap();
    run.wait();
    run.poll();
    assert!(run.finish().unwrap().outcome.outcome.stopped);
    let run = Supervisor::start(options(folder.path(), GRAPH), &registry(), None).unwrap();
    assert!(!run.is_finished());
    drop(run);
}

const WAKE: Wake = Wake { late_ns: 0, work_ns: 0, frames: 10, lost: 0, overrun: false };

/// Drives a whole graph from a thread of its own, as a program's own hardware would.
#[derive(Default)]
struct OwnClock<const REPORTS: bool>(Vec<(usize, thread::JoinHandle<Player>)>);

impl<const REPORTS: bool> Backend for OwnClock<REPORTS> {
    fn open(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
        match graph.seed() {
            13 => Err(BackendError::Stream("an unlucky number")),
            _ => Ok(()),
        }
    }

    fn drive(&mut self, _: &Graph, lives: &mut Lives) -> Result<(), BackendError> {
        self.0.extend(lives.drain(..).map(|(clock, mut live)| {
            let run = move || {
                while !live.is_idle() {
                    live.process(10);
                    live.report(WAKE);
                }
                live
            };
            (clock, thread::spawn(run))
        }));
        Ok(())
    }

    fn status(&self) -> Vec<Connected> {
        let of = |(clock, thread): &(usize, thread::JoinHandle<Player>)| {
            let mut driver = Connected::driver("servo", *clock, "the oscillator of the experiment");
            if thread.is_finished() {
                driver.state = State::Finished;
            }
            driver
        };
        self.0.iter().filter(|_| REPORTS).map(of).collect()
    }

    fn counts(&self) -> Vec<Counts> {
        self.status().iter().map(|_| Counts::None).collect()
    }

    fn close(&mut self) -> Result<Lives, BackendError> {
        let ended = |(clock, thread): (usize, thread::JoinHandle<Player>)| Some((clock, thread.join().ok()?));
        let all = self.0.drain(..).map(|driver| ended(driver).ok_or(BackendError::Lost));
        all.collect()
    }
}

/// The outcome of half a second with a backend of the program's own, and a seed.
fn with_backend(entry: BackendEntry, seed: u64) -> Result<Ended, StartError> {
    let folder = tempfile::tempdir().unwrap();
    let mut registry = registry();
    add_backend(&mut registry, entry);
    let mut options = options(folder.path(), GRAPH);
    options.source.seed = Some(seed);
    options.seconds = Some(0.5);
    Supervisor::start(options, &registry, None).map(|run| ended(run, |_| false).0)
}

#[test]
fn a_programs_own_backend_opens_drives_and_is_reported() {
    let entry = BackendEntry::new("oscillators", &[], || Box::new(OwnClock::<true>::default()));
    let refused = with_backend(entry.driving(), 13).err();
    assert!(matches!(refused, Some(StartError::Backend(BackendError::Stream(_)))), "{refused:?}");
    let driven_by = |entry| {
        let ended = with_backend(entry, 1).unwrap();
        assert_eq!(ended.outcome.outcome.driver_frames, 500);
        ended.report.driver
    };
    assert!(driven_by(entry.driving()).contains("the oscillator of the experiment"));
    assert!(driven_by(entry).contains("timer"), "it did not declare that it drives");
}

#[test]
fn a_backend_that_cannot_be_supervised_is_refused() {
    let silent = BackendEntry::new("oscillators", &[], || Box::new(OwnClock::<false>::default()));
    let refused = with_backend(silent.driving(), 1).err();
    assert!(
        matches!(&refused, Some(StartError::Backend(BackendError::Unreported { clock, .. })) if clock == "servo"),
        "{refused:?}"
    );
    let of_simulation =
        BackendEntry::new("coils", &["SimulatedHaptuator"], || Box::new(OwnClock::<true>::default()));
    let refused = with_backend(of_simulation, 1).err();
    assert!(
        matches!(&refused, Some(StartError::Backend(BackendError::Simulated { device, .. })) if device == "coil"),
        "{refused:?}"
    );
}

#[test]
fn every_device_kind_without_a_simulation_has_one_backend() {
    let registry = registry();
    let real = registry.devices().iter().filter(|entry| !entry.spec.simulated && !entry.is_host());
    for entry in real {
        let reaching = BACKENDS.iter().filter(|backend| backend.kinds.contains(&entry.spec.name));
        assert_eq!(reaching.count(), 1, "{}", entry.spec.name);
    }
    let kinds: Vec<&str> = BACKENDS.iter().flat_map(|backend| backend.kinds).copied().collect();
    assert!(kinds.len() >= 10 && kinds.iter().all(|kind| registry.device(kind).is_some()));
}
