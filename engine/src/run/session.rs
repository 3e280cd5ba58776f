//! A live run as a whole but for its driver: what it is controlled by, the files it writes, and what is known of it at
//! the end.

mod change;

pub use change::{ChangeError, Changed};

use super::arrivals::{self, ArrivalLog, ArrivalWriter, Input, InputLog, InputWriter, SettingWriter};
use super::control::{Control, ControlError};
use super::cost;
use super::fleet::join;
use super::live::{Live, LiveState, live_until};
use super::meter::Meters;
use super::outlets::{Outlets, WriteError, Written, stream};
use super::rings::{TapRings, WriterThread};
use super::silence::{self, ActuatorLevel, InputStatus};
use super::{Faults, Outcome, RingMeter, RingReport, Run};
use crate::graph::{Graph, LiveSetting, NodeId};
use crate::node::Stream;
use crate::plan::{Plan, PlanOptions};
use rtrb::Consumer;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// How a graph runs live.
#[derive(Debug, Clone, Default)]
pub struct LiveOptions {
    /// Driver frames of a block at most; 0 stands for the default.
    pub block: usize,
    /// When it ends; if there is none, when it is stopped. Where the data of a source end before, as that source says.
    pub seconds: Option<f64>,
    /// Are the actuators known to be cold? Unless they are, those that are not simulated begin as warm as their limits
    /// allow.
    pub rested: bool,
    /// Once it is set, the outputs fade out and the run stops. The real-time sides look at it themselves.
    pub stop: Arc<AtomicBool>,
}

/// A live run.
pub struct Session {
    stop: Arc<AtomicBool>,
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
    /// Rings that the caller reads, in the order in which they were asked for, until they are taken.
    handed: Vec<Consumer<f64>>,
}

struct Entry {
    what: PathBuf,
    sink: Option<PathBuf>,
    streams: Vec<Stream>,
    /// Does the caller read it?
    is_handed: bool,
    running: bool,
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
            stop: Arc::clone(&options.stop),
            controls: Vec::new(),
            rings: Vec::new(),
            writer: WriterThread::default(),
            block: options.block,
            entries: Vec::new(),
            taps: vec![(0, 0); outlets.taps.len()],
            handed: Vec::new(),
        };
        if folder.is_some() || outlets.written.iter().any(|written| written.writer.is_some()) {
            session.writer.start()?;
        }
        let mut outs: Vec<_> = outlets.taps.iter().map(|_| None).collect();
        let mut lives = Vec::new();
        let hottest = Arc::default();
        for plan in Plan::of(outlets.graph, &plan_options) {
            let plan = Arc::new(plan);
            let rings = tap_rings(&plan, Vec::new(), &mut outs);
            let (mut live, control) = live_until(Arc::clone(&plan), Arc::clone(&options.stop));
            live.send_taps_through(rings);
            live.share_heat(Arc::clone(&hottest));
            if !options.rested {
                live.run_mut().begin_unrested();
            }
            let frames = |seconds: f64| (seconds * plan.driver_rate().hz()).round().max(0.0) as u64;
            let data = outlets.graph.frames_of_data(plan.driver_rate());
            if let Some(frames) = options.seconds.map(frames).into_iter().chain(data).min() {
                live.end_after(frames);
            }
            session.controls.push(control);
            lives.push(live);
        }
        session.rings = join(&mut lives.iter_mut().map(Live::run_mut).collect::<Vec<_>>());
        if let Some(folder) = folder {
            arrivals::keep_graph(outlets.graph, options.rested, folder)?;
            for (driver, live) in lives.iter_mut().enumerate() {
                session.log(driver, live, folder)?;
                session.log_inputs(outlets.graph, (driver, live), folder)?;
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

    /// Keeps what the live inputs sense that a driver reads.
    fn log_inputs(
        &mut self,
        graph: &Graph,
        (driver, live): (usize, &mut Live),
        folder: &Path,
    ) -> std::io::Result<()> {
        for input in Input::all(graph, self.controls[driver].plan()) {
            let (log, kept) = InputLog::new(&input);
            live.run_mut().log_input(input.place, log);
            let what = arrivals::input_file(folder, driver, input.place);
            let sensed = Written::apart(Box::new(InputWriter::create(&what, &input)?), what);
            self.writer.add(sensed, vec![kept]);
        }
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

    /// The files that could not be written on since this was asked last, each with the reason. The run goes on.
    pub fn failing_files(&self) -> impl Iterator<Item = String> {
        self.writer.failing()
    }

    /// Old plans that came home to be freed.
    pub fn freed(&self) -> u64 {
        self.controls.iter().map(Control::freed).sum()
    }

    /// What is known of the rings between its drivers now.
    pub fn rings(&self) -> impl Iterator<Item = RingReport> {
        self.rings.iter().map(|meter| RingReport::of(meter))
    }

    /// The live inputs and the actuators that depend on them, as they are now.
    pub fn live_inputs(&self) -> Vec<InputStatus> {
        silence::statuses(self.controls.iter().map(|control| &**control.plan()))
    }

    /// How much each actuator is given now, and at most since this was asked before.
    pub fn actuator_levels(&self) -> Vec<ActuatorLevel> {
        let plans = self.controls.iter().map(|control| &**control.plan());
        plans.flat_map(silence::levels).collect()
    }

    /// What each node took so far, ns, in the blocks that were timed since its graph took over; nothing where none are
    /// ([`PlayOptions::sample_costs`](crate::host::PlayOptions::sample_costs)). Their shares are those of all blocks.
    pub fn node_costs(&self) -> Vec<(NodeId, f64)> {
        let plans = self.controls.iter().map(|control| &**control.plan());
        plans.flat_map(cost::of_nodes).collect()
    }

    /// Fades out and stops, whatever else is under way.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// The live settings, as they were set last.
    pub fn settings(&self) -> impl Iterator<Item = &LiveSetting> {
        self.controls.iter().flat_map(Control::settings)
    }

    /// Sets a live setting of a node, as [`LiveSetting`] has both. Real-time safe, unlike [`Session::set_by_name`].
    ///
    /// # Errors
    /// As [`Control::set`].
    pub fn set(&mut self, node: NodeId, setting: usize, value: f64) -> Result<(), ControlError> {
        let is_it = |live: &LiveSetting| (live.node, live.setting) == (node, setting);
        let knows = |control: &&mut Control| control.settings().iter().any(is_it);
        let control = self.controls.iter_mut().find(knows);
        control.ok_or(ControlError::NotLive)?.set(node, setting, value)
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
                is_handed: written.writer.is_none(),
                running: true,
            });
            match written.writer {
                Some(_) => self.writer.add(written, ends),
                None => self.handed.extend(ends),
            }
        }
    }

    /// The rings that the caller reads.
    pub(crate) fn handed(&mut self) -> Vec<Consumer<f64>> {
        std::mem::take(&mut self.handed)
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

/// The rings of a plan's taps, but for those that are kept from an old one; their far ends go to `outs`, by the place of
/// each tap among all drivers' taps.
fn tap_rings(plan: &Plan, kept: Vec<(usize, usize)>, outs: &mut [Option<Consumer<f64>>]) -> TapRings {
    let (mut rings, far) = TapRings::new(plan, |place| kept.iter().all(|(_, new)| *new != place));
    for (place, far) in plan.tap_places.iter().zip(far) {
        outs[*place] = far;
    }
    rings.kept = kept;
    rings
}

impl Run {
    fn log_input(&mut self, device: usize, log: InputLog) {
        self.state.devices[device].log = Some(log);
    }

    /// Rate of the driver whose frames it counts, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.plan.driver_rate().hz()
    }
}
