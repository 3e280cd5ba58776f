//! A live run as a whole but for its driver: what it is controlled by, the files it writes, and what is known of it at
//! the end.

use super::arrivals::{self, ArrivalLog, ArrivalWriter, SettingWriter};
use super::fleet::join;
use super::live::{Change, Control, ControlError, Live, LiveState, live};
use super::meter::Meters;
use super::outlets::{Outlets, WriteError, Written, file_ports, stream};
use super::rings::{TapRings, WriterThread};
use super::{Faults, Outcome, RingMeter, RingReport, Run};
use crate::graph::{Graph, LiveSetting, Work};
use crate::node::Stream;
use crate::plan::{Plan, PlanOptions};
use petgraph::graph::NodeIndex;
use rtrb::Consumer;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How a graph runs live.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LiveOptions {
    /// Driver frames of a block at most; 0 stands for the default.
    pub block: usize,
    /// When it ends; until it is stopped if there is none.
    pub seconds: Option<f64>,
}

/// A live run.
pub struct Session {
    /// One a driver, in the order of the graph's.
    controls: Vec<Control>,
    /// What is known of the rings between them.
    rings: Vec<Arc<RingMeter>>,
    writer: WriterThread,
    block: usize,
    /// Everything that was ever written.
    entries: Vec<Entry>,
    /// Which stream of which entry each tap of the present plan is.
    taps: Vec<(usize, usize)>,
}

struct Entry {
    what: PathBuf,
    sink: Option<PathBuf>,
    streams: Vec<Stream>,
    running: bool,
}

/// What putting another graph in place did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Changed {
    /// How the graphs differed.
    pub change: Change,
    /// What is written from now on.
    pub begun: Vec<PathBuf>,
    /// What is complete, as the new graph does not have it.
    pub ended: Vec<PathBuf>,
    /// What would have to be begun again, and is not: it holds other signals.
    pub left_out: Vec<PathBuf>,
}

/// Why another graph was not put in place.
#[derive(Debug, thiserror::Error)]
pub enum ChangeError {
    /// It does not go with what runs.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// A file of it cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// It differs in more than live settings from a graph with several drivers, or is one.
    #[error("a graph with several drivers takes over live settings only; the rest needs a new run")]
    SeveralDrivers,
}

/// What a live run did.
#[derive(Debug)]
pub struct LiveOutcome {
    /// As of an offline run.
    pub outcome: Outcome,
    /// How it kept time: all drivers together, and each by its name.
    pub meters: Meters,
    /// Of each driver by its name.
    pub drivers: Vec<(String, Meters)>,
    /// Did a node panic?
    pub panicked: bool,
    /// Devices that panicked as well when they were taken to zero: nobody knows what they do.
    pub lost_devices: Vec<String>,
    /// What could not be written; the run went on.
    pub failed: Vec<WriteError>,
    /// Numbers that the writer was too slow for.
    pub lost_numbers: u64,
    /// Callbacks at the end that a replay will not have: the writer was too slow for them.
    pub lost_arrivals: u64,
}

impl Session {
    /// Both sides of a live run of a graph with one driver; the real-time one is for that driver.
    ///
    /// # Errors
    /// What the system says where it gives no thread, or that the graph has several drivers.
    pub fn open(outlets: Outlets<'_>, options: &LiveOptions) -> std::io::Result<(Live, Self)> {
        let (mut lives, session) = Self::open_all(outlets, options, None)?;
        match (lives.pop(), lives.is_empty()) {
            (Some(live), true) => Ok((live, session)),
            _ => Err(std::io::Error::other("this graph has several drivers")),
        }
    }

    /// Both sides of a live run: of the real-time ones each is for one driver of the graph, in their order, and rings
    /// join them. What the drivers see of these, and what is set while they run, is kept in `folder`, for a replay.
    ///
    /// # Errors
    /// What the system says where it gives no thread or no file.
    pub fn open_all(
        outlets: Outlets<'_>,
        options: &LiveOptions,
        folder: Option<&Path>,
    ) -> std::io::Result<(Vec<Live>, Self)> {
        let plan_options = PlanOptions {
            block: options.block,
            taps: outlets.taps.clone(),
        };
        let mut session = Self {
            controls: Vec::new(),
            rings: Vec::new(),
            writer: WriterThread::start()?,
            block: options.block,
            entries: Vec::new(),
            taps: vec![(0, 0); outlets.taps.len()],
        };
        let mut outs: Vec<Option<Consumer<f64>>> = outlets.taps.iter().map(|_| None).collect();
        let mut lives = Vec::new();
        for plan in Plan::all(outlets.graph, &plan_options) {
            let plan = Arc::new(plan);
            let (rings, far) = TapRings::new(&plan, |_| true);
            for (place, far) in plan.tap_places.iter().zip(far) {
                outs[*place] = far;
            }
            let (mut live, control) = live(Arc::clone(&plan));
            live.send_taps_through(rings);
            if let Some(seconds) = options.seconds {
                live.end_after((seconds * plan.driver_rate().hz()).round().max(0.0) as u64);
            }
            session.controls.push(control);
            lives.push(live);
        }
        session.rings = join(&mut lives.iter_mut().map(Live::run_mut).collect::<Vec<_>>());
        if let Some(folder) = folder {
            arrivals::keep_graph(outlets.graph, folder)?;
            for (driver, live) in lives.iter_mut().enumerate() {
                session.log(driver, live, folder)?;
            }
        }
        session.write(outlets, outs);
        Ok((lives, session))
    }

    /// Keeps what a driver sees of its rings, and what is set.
    fn log(&mut self, driver: usize, live: &mut Live, folder: &Path) -> std::io::Result<()> {
        let plan = self.controls[driver].plan();
        let (log, kept) = ArrivalLog::new(plan);
        live.log_through(log);
        let what = arrivals::file(folder, driver);
        let callbacks = Written::apart(Box::new(ArrivalWriter::create(&what, plan)?), what);
        let what = arrivals::settings_file(folder, driver);
        let settings = Written::apart(Box::new(SettingWriter::create(&what, plan)?), what);
        self.writer.add(callbacks, vec![kept.callbacks]);
        self.writer.add(settings, vec![kept.settings]);
        Ok(())
    }

    /// Takes in what the real-time sides reported since; what was counted so far, by driver.
    pub fn poll(&mut self) -> Vec<(&str, &Meters)> {
        let mut all = Vec::new();
        for control in &mut self.controls {
            control.poll();
        }
        for control in &self.controls {
            all.push((control.plan().driver_name(), control.meters()));
        }
        all
    }

    /// What is known of the rings between its drivers now.
    pub fn rings(&self) -> impl Iterator<Item = RingReport> {
        self.rings.iter().map(|meter| RingReport::of(meter))
    }

    /// Fades out and stops.
    ///
    /// # Errors
    /// [`ControlError::Full`] if a real-time side does not read.
    pub fn stop(&mut self) -> Result<(), ControlError> {
        self.controls.iter_mut().try_for_each(Control::stop)
    }

    /// The live settings, as they were set last.
    pub fn settings(&self) -> impl Iterator<Item = &LiveSetting> {
        self.controls.iter().flat_map(Control::settings)
    }

    /// Sets a live setting by its name: `out.gain`.
    ///
    /// # Errors
    /// As [`Control::set`].
    pub fn set_by_name(&mut self, name: &str, value: f64) -> Result<(), ControlError> {
        let knows = |control: &&mut Control| control.settings().iter().any(|live| live.name() == name);
        let control = self.controls.iter_mut().find(knows);
        control.ok_or(ControlError::NotLive)?.set_by_name(name, value)
    }

    /// Puts another graph in place of the one that runs. Files that both write go on; new ones are opened in
    /// `folder`, and what the new graph has no more is completed.
    ///
    /// # Errors
    /// [`ChangeError`]; the graph that runs goes on.
    pub fn change(&mut self, graph: &Graph, folder: &Path) -> Result<Changed, ChangeError> {
        let mut outlets = Outlets::new(graph);
        let mut kept = Vec::new();
        let mut places = Vec::new();
        let mut ended = Vec::new();
        for (number, entry) in self.entries.iter().enumerate().filter(|(_, entry)| entry.running) {
            let Some(ports) = entry.ports_in(graph) else {
                ended.push(number);
                continue;
            };
            for (stream, port) in ports.into_iter().enumerate() {
                let old = self.taps.iter().position(|tap| *tap == (number, stream));
                kept.extend(old.map(|old| (old, outlets.taps.len())));
                outlets.taps.push(port);
                places.push((number, stream));
            }
        }
        let mut left_out = Vec::new();
        for (index, file) in files(graph) {
            match self
                .entries
                .iter()
                .position(|entry| entry.sink.as_deref() == Some(file))
            {
                None => {
                    if let Err(error) = outlets.open_file(index, folder) {
                        outlets.take_back();
                        return Err(error.into());
                    }
                }
                Some(known) if ended.contains(&known) || !self.entries[known].running => {
                    left_out.push(self.entries[known].what.clone());
                }
                Some(_) => {}
            }
        }
        let begun = outlets
            .written
            .iter()
            .map(|written| written.what.clone())
            .collect();
        let options = PlanOptions {
            block: self.block,
            taps: outlets.taps.clone(),
        };
        if self.controls.len() > 1 || graph.drivers().len() > 1 {
            let changed = self.change_settings(Plan::all(graph, &options));
            if changed.is_err() {
                outlets.take_back();
            }
            return changed;
        }
        let plan = Arc::new(Plan::new(graph, &options));
        let goes_on = |place: usize| kept.iter().any(|(_, new)| *new == place);
        let (mut rings, outs) = TapRings::new(&plan, |place| !goes_on(place));
        rings.kept.clone_from(&kept);
        let change = match self.controls[0].swap_with(plan, rings) {
            Ok(change) => change,
            Err(error) => {
                outlets.take_back();
                return Err(error.into());
            }
        };
        for number in &ended {
            self.entries[*number].running = false;
        }
        places.resize(outlets.taps.len(), (0, 0));
        self.taps = places;
        self.write(outlets, outs);
        let ended = ended.iter().map(|number| self.entries[*number].what.clone());
        Ok(Changed {
            change,
            begun,
            ended: ended.collect(),
            left_out,
        })
    }

    /// Puts plans in place that differ from those that run in live settings at most.
    fn change_settings(&mut self, plans: Vec<Plan>) -> Result<Changed, ChangeError> {
        let mut pairs = self.controls.iter().zip(&plans);
        let same = pairs.all(|(control, plan)| control.plan().is_same_as(plan));
        if !same || plans.len() != self.controls.len() {
            return Err(ChangeError::SeveralDrivers);
        }
        // All of them take it or none does.
        let mut pairs = self.controls.iter().zip(&plans);
        if !pairs.all(|(control, plan)| control.has_room_for(plan)) {
            return Err(ControlError::Full.into());
        }
        let mut settings = 0;
        for (control, plan) in self.controls.iter_mut().zip(plans) {
            if let Change::Settings(count) = control.swap_with(Arc::new(plan), TapRings::default())? {
                settings += count;
            }
        }
        Ok(Changed {
            change: Change::Settings(settings),
            begun: Vec::new(),
            ended: Vec::new(),
            left_out: Vec::new(),
        })
    }

    /// Hands writers and the far ends of their rings to the writing thread.
    fn write(&mut self, outlets: Outlets<'_>, mut rings: Vec<Option<Consumer<f64>>>) {
        for written in outlets.written {
            let number = self.entries.len();
            let mut streams = Vec::new();
            let mut ends = Vec::new();
            for (place, tap) in written.taps.iter().enumerate() {
                self.taps[*tap] = (number, place);
                streams.push(stream(outlets.graph, outlets.taps[*tap]));
                ends.extend(rings[*tap].take());
            }
            self.entries.push(Entry {
                what: written.what.clone(),
                sink: written.sink.clone(),
                streams,
                running: true,
            });
            self.writer.add(written, ends);
        }
    }

    /// Completes all files. `live` is what the driver gave back when it was done.
    pub fn finish(self, live: Live) -> LiveOutcome {
        self.finish_all(vec![live])
    }

    /// Completes all files. `lives` are what the drivers gave back when they were done, in the graph's order.
    pub fn finish_all(mut self, lives: Vec<Live>) -> LiveOutcome {
        let meters = self.poll().into_iter();
        let drivers: Vec<(String, Meters)> = meters
            .map(|(name, meters)| (name.to_owned(), meters.clone()))
            .collect();
        let mut meters = Meters::default();
        drivers.iter().for_each(|(_, one)| meters.add(one));
        let frames = lives.first().map_or(0, Live::frames);
        let rate_hz = self.controls[0].plan().driver_rate().hz();
        let outcome = Outcome {
            driver_frames: frames,
            seconds: frames as f64 / rate_hz,
            stopped: lives.iter().any(|live| live.state() != LiveState::Finished),
            faults: Faults::of(lives.iter().map(Live::faults)),
            actuators: lives.iter().flat_map(Live::actuators).collect(),
            rings: self.rings().collect(),
        };
        let lost_devices = lives
            .iter()
            .flat_map(|live| live.run().lost_devices().map(str::to_owned));
        let lost_devices = lost_devices.collect();
        let panicked = |live: &Live| live.state() == LiveState::Panicked;
        let (panicked, lost_numbers, lost_arrivals) = (
            lives.iter().any(panicked),
            lives.iter().map(Live::lost_numbers).sum(),
            lives.iter().map(Live::lost_arrivals).sum(),
        );
        // The rings end when both sides are gone: an old plan may still be on its way between them.
        drop(lives);
        drop(self.controls);
        LiveOutcome {
            outcome,
            meters,
            drivers,
            panicked,
            lost_devices,
            failed: self.writer.finish(),
            lost_numbers,
            lost_arrivals,
        }
    }
}

impl Entry {
    /// The ports of a graph that carry what is written here, if it has them all.
    fn ports_in(&self, graph: &Graph) -> Option<Vec<(NodeIndex, usize)>> {
        if let Some(sink) = &self.sink {
            let (index, _) = files(graph).find(|(_, file)| file == sink)?;
            let ports = file_ports(graph, index);
            let same = ports.len() == self.streams.len()
                && ports
                    .iter()
                    .zip(&self.streams)
                    .all(|(port, known)| carries(graph, *port, known));
            return same.then_some(ports);
        }
        self.streams.iter().map(|known| find(graph, known)).collect()
    }
}

fn files(graph: &Graph) -> impl Iterator<Item = (NodeIndex, &Path)> {
    graph
        .nodes
        .node_indices()
        .filter_map(|index| match &graph.nodes[index].work {
            Work::File(sink) => Some((index, sink.file_name())),
            _ => None,
        })
}

fn find(graph: &Graph, known: &Stream) -> Option<(NodeIndex, usize)> {
    let ports = graph
        .nodes
        .node_indices()
        .flat_map(|index| (0..graph.nodes[index].outputs.len()).map(move |output| (index, output)));
    let mut same = ports.filter(|port| carries(graph, *port, known));
    same.next()
}

fn carries(graph: &Graph, port: (NodeIndex, usize), known: &Stream) -> bool {
    let found = stream(graph, port);
    let simulated = known.simulated;
    Stream { simulated, ..found } == *known
}

impl Run {
    /// Rate of the driver whose frames it counts, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.plan.driver_rate().hz()
    }
}
