//! A live run without its drivers: its controls, its files and its outcome.

mod change;

pub use change::{ChangeError, Changed};

use super::arm::ArmSwitch;
use super::arrivals::{self, ArrivalLog, Input, InputLog, LogWriter};
use super::control::{Control, ControlError};
use super::cost;
use super::file_sinks::{FileSinks, WriteError, WrittenFile};
use super::live::{Live, LiveState, live_until};
use super::meter::Meters;
use super::rings::{TapRings, WriterThread};
use super::runner::connect;
use super::silence::{self, ActuatorLevel, InputStatus};
use super::{Faults, Outcome, RingMeter, RingReport, Run};
use crate::node::Stream;
use crate::node_id::NodeId;
use crate::plan::{Plan, PlanOptions};
use crate::settings::{LiveSetting, SettingId};
use rtrb::Consumer;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Options of a live run: `LiveOptions::default().block(64).rested()`.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct LiveOptions {
    /// Largest block in driver frames; 0 means the default.
    pub block: usize,
    /// Duration, s; `None` runs until it is stopped. A source whose data end earlier can end the run.
    pub seconds: Option<f64>,
    /// True if the actuators are known to be cold. Otherwise real actuators start without heat reserve.
    pub rested: bool,
    /// True if the caller runs the graph as fast as possible and not in real time. Only then may it have scripted
    /// nodes.
    pub offline: bool,
    /// When set, the outputs fade out and the run stops. The real-time sides poll it.
    pub stop: Arc<AtomicBool>,
    /// With a switch, real devices get zeros until it is armed; without one they are driven from the start.
    pub arm: Option<Arc<ArmSwitch>>,
}

impl LiveOptions {
    /// Sets the largest block in driver frames.
    #[must_use]
    pub fn block(mut self, frames: usize) -> Self {
        self.block = frames;
        self
    }

    /// Ends the run after `seconds` seconds.
    #[must_use]
    pub fn seconds(mut self, seconds: f64) -> Self {
        self.seconds = Some(seconds);
        self
    }

    /// Declares the actuators cold.
    #[must_use]
    pub fn rested(mut self) -> Self {
        self.rested = true;
        self
    }
}

/// The side of a live run for threads that are not real-time: settings, swaps and reports. Its other side is a
/// [`Live`] for the callback of each driver.
///
/// ```
/// use haptograph_engine::document::Document;
/// use haptograph_engine::graph::{CheckOptions, check};
/// use haptograph_engine::registry::Registry;
/// use haptograph_engine::run::{Change, FileSinks, LiveOptions, Session};
/// # use haptograph_engine::frame::Scalar;
/// # use haptograph_engine::node::*;
/// # use haptograph_signal::quantity::Quantity;
/// # haptograph_engine::settings! { /** Settings of the example. */ pub struct LevelSettings { /** What it gives. */ [live] value: f64 = 1.0; } }
/// # haptograph_engine::node! {
/// #     /// Gives a number.
/// #     struct Level(LevelSettings) in "mine";
/// #     example: "";
/// #     out OUTPUT: Scalar = Port::of(Quantity::NUMBER, "The number.");
/// # }
/// # #[derive(Clone)] struct Given(f64);
/// # impl NodeKind for Level {
/// #     fn build(settings: LevelSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { Ok(Built::new(Given(settings.value))) }
/// # }
/// # impl Processor<Level> for Given {
/// #     fn process(&mut self, _: &Tick, io: &mut Io<'_, Level>) { io.write(Level::OUTPUT).fill(self.0); }
/// #     fn set(&mut self, _: LiveId<LevelSettings>, value: f64) { self.0 = value; }
/// # }
/// # let mut registry = Registry::new();
/// # registry.add(NodeEntry::processor::<Level>());
/// # let graph = |more: &str| {
/// #     let text = format!(r#"Graph(format: 1, clocks: {{ "servo": Driver(rate_hz: 1000) }},
/// #         nodes: {{ "level": Level(clock: "servo"), {more} }})"#);
/// #     check(&Document::parse("level.ron", &text)?, &registry, &CheckOptions::default())
/// # };
/// # let (before, after) = (graph("")?, graph(r#""more": Level(clock: "servo")"#)?);
///
/// let (mut live, mut session) = Session::open(FileSinks::new(&before), &LiveOptions::default())?;
/// live.callback(48, |_run, _frames| {}); // In the driver's callback.
///
/// session.set_by_name("level.value", 0.5)?;
/// let changed = session.change_without_files(&after)?;
/// assert_eq!(changed.change, Change::AtOnce); // Neither graph has an actuator to fade.
/// live.callback(48, |_run, _frames| {});
///
/// let outcome = session.finish(live);
/// assert!(outcome.failed.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Session {
    stop: Arc<AtomicBool>,
    arm: Option<Arc<ArmSwitch>>,
    /// One for each driver, in the order of the graph.
    controls: Vec<Control>,
    /// Meters of the rings between the drivers.
    rings: Vec<Arc<RingMeter>>,
    writer: WriterThread,
    block: usize,
    /// All files and probes of the run, ended ones included.
    entries: Vec<Entry>,
    /// (entry, stream) of each tap of the present plan.
    taps: Vec<(usize, usize)>,
    /// Probe rings for the caller, in the order of the requests, until [`handed`](Self::handed) returns them.
    handed: Vec<Consumer<f64>>,
}

struct Entry {
    what: PathBuf,
    sink: Option<PathBuf>,
    streams: Vec<Stream>,
    /// True if the caller reads it.
    is_handed: bool,
    running: bool,
}

/// Outcome of a live run.
#[derive(Debug)]
#[non_exhaustive]
pub struct LiveOutcome {
    /// The part that offline runs also have.
    pub outcome: Outcome,
    /// Timing of all drivers together.
    pub meters: Meters,
    /// Timing of each driver, by name.
    pub drivers: Vec<(String, Meters)>,
    /// True if a node panicked.
    pub panicked: bool,
    /// Devices that also panicked during the ramp to zero: their output is unknown.
    pub lost_devices: Vec<String>,
    /// Files that could not be written; the run continued.
    pub failed: Vec<WriteError>,
    /// Numbers lost because the writer thread was too slow.
    pub lost_numbers: u64,
    /// Callbacks missing at the end of the replay log because the writer thread was too slow.
    pub lost_arrivals: u64,
}

impl Session {
    /// Opens a live run of a graph with one driver and returns both sides.
    ///
    /// # Errors
    /// System errors if no thread can be started; an error if the graph has several drivers.
    pub fn open(sinks: FileSinks<'_>, options: &LiveOptions) -> std::io::Result<(Live, Self)> {
        let (mut lives, session) = Self::open_all(sinks, options, None)?;
        match (lives.pop(), lives.is_empty()) {
            (Some(live), true) => Ok((live, session)),
            _ => Err(std::io::Error::other("this graph has several drivers")),
        }
    }

    /// Opens a live run and returns its real-time sides, one for each driver in the order of the graph, and the
    /// session.
    ///
    /// With a `folder`, the run writes its replay log there.
    ///
    /// # Errors
    /// System errors if a thread cannot be started or a file cannot be written; [`OfflineOnly`](crate::node::OfflineOnly).
    pub fn open_all(
        sinks: FileSinks<'_>,
        options: &LiveOptions,
        folder: Option<&Path>,
    ) -> std::io::Result<(Vec<Live>, Self)> {
        if !options.offline {
            sinks.planner.refuse_scripts().map_err(std::io::Error::other)?;
        }
        let plan_options = PlanOptions { block: options.block, taps: sinks.taps.clone() };
        let mut session = Self {
            stop: Arc::clone(&options.stop),
            arm: options.arm.clone(),
            controls: Vec::new(),
            rings: Vec::new(),
            writer: WriterThread::default(),
            block: options.block,
            entries: Vec::new(),
            taps: vec![(0, 0); sinks.taps.len()],
            handed: Vec::new(),
        };
        if folder.is_some() || sinks.written.iter().any(|written| written.writer.is_some()) {
            session.writer.start()?;
        }
        let mut outs: Vec<_> = sinks.taps.iter().map(|_| None).collect();
        let mut lives = Vec::new();
        let hottest = Arc::default();
        for plan in sinks.planner.plans(&plan_options) {
            let plan = Arc::new(plan);
            let rings = tap_rings(&plan, Vec::new(), &mut outs);
            let (mut live, control) = live_until(Arc::clone(&plan), Arc::clone(&options.stop));
            live.send_taps_through(rings);
            live.share_heat(Arc::clone(&hottest));
            if !options.rested {
                live.run_mut().assume_thermally_saturated();
            }
            if let Some(switch) = &options.arm {
                live.run_mut().arm_by(switch);
            }
            let frames = |seconds: f64| (seconds * plan.driver_rate().hz()).round().max(0.0) as u64;
            if let Some(frames) = options.seconds.map(frames).into_iter().chain(plan.data_frames).min() {
                live.end_after(frames);
            }
            session.controls.push(control);
            lives.push(live);
        }
        session.rings = connect(&mut lives.iter_mut().map(Live::run_mut).collect::<Vec<_>>());
        if let Some(folder) = folder {
            arrivals::keep_graph(sinks.planner, options.rested, folder)?;
            for (driver, live) in lives.iter_mut().enumerate() {
                session.log(driver, live, folder)?;
                session.log_inputs((driver, live), folder)?;
            }
        }
        session.write(sinks, outs);
        Ok((lives, session))
    }

    /// Logs a driver's callbacks and setting changes for a replay.
    fn log(&mut self, driver: usize, live: &mut Live, folder: &Path) -> std::io::Result<()> {
        let plan = self.controls[driver].plan();
        let (log, kept) = ArrivalLog::new(plan);
        live.log_through(log);
        let what = arrivals::file(folder, driver);
        let callbacks = WrittenFile::apart(Box::new(LogWriter::callbacks(&what, plan)?), what);
        let what = arrivals::settings_file(folder, driver);
        let settings = WrittenFile::apart(Box::new(LogWriter::settings(&what, plan)?), what);
        self.writer.add(callbacks, vec![kept.callbacks]);
        self.writer.add(settings, vec![kept.settings]);
        Ok(())
    }

    /// Logs the live inputs that a driver reads for a replay.
    fn log_inputs(&mut self, (driver, live): (usize, &mut Live), folder: &Path) -> std::io::Result<()> {
        for input in Input::all(self.controls[driver].plan()) {
            let (log, kept) = InputLog::new(&input);
            live.run_mut().log_input(input.place, log);
            let what = arrivals::input_file(folder, driver, input.place);
            let sensed = WrittenFile::apart(Box::new(input.writer(&what)?), what);
            self.writer.add(sensed, vec![kept]);
        }
        Ok(())
    }

    /// Receives the reports of the real-time sides and returns the meters of each driver.
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

    /// Messages about files that failed since the last call. The run continues.
    pub fn failing_files(&self) -> impl Iterator<Item = String> {
        self.writer.failing()
    }

    /// Number of replaced plans that have been freed.
    pub fn freed(&self) -> u64 {
        self.controls.iter().map(Control::freed).sum()
    }

    /// Present state of the rings between its drivers.
    pub fn rings(&self) -> impl Iterator<Item = RingReport> {
        self.rings.iter().map(|meter| RingReport::of(meter))
    }

    /// Present state of the live inputs and of the actuators that depend on them.
    pub fn live_inputs(&self) -> Vec<InputStatus> {
        silence::statuses(self.controls.iter().map(|control| &**control.plan()))
    }

    /// Present level of each actuator, and its peak since the last call.
    pub fn actuator_levels(&self) -> Vec<ActuatorLevel> {
        let plans = self.controls.iter().map(|control| &**control.plan());
        plans.flat_map(silence::levels).collect()
    }

    /// Time that each node took so far, ns, in the blocks that were timed since its graph took over; empty if none were
    /// ([`PlayOptions::sample_costs`](crate::host::PlayOptions::sample_costs)). The shares are those of all blocks.
    pub fn node_costs(&self) -> Vec<(NodeId, f64)> {
        let plans = self.controls.iter().map(|control| &**control.plan());
        plans.flat_map(cost::of_nodes).collect()
    }

    /// Fades out and stops, also during a swap.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// The live settings with their last set values.
    pub fn settings(&self) -> impl Iterator<Item = &LiveSetting> {
        self.controls.iter().flat_map(Control::settings)
    }

    /// Sets a live setting by node and handle, as in [`LiveSetting`]. Real-time safe, unlike [`Session::set_by_name`].
    ///
    /// # Errors
    /// As [`Control::set`].
    pub fn set(&mut self, node: NodeId, setting: SettingId, value: f64) -> Result<(), ControlError> {
        let is_it = |live: &LiveSetting| (live.node, live.setting) == (node, setting);
        let has_it = |control: &&mut Control| control.settings().iter().any(is_it);
        let control = self.controls.iter_mut().find(has_it);
        control.ok_or(ControlError::NotLive)?.set(node, setting, value)
    }

    /// Sets a live setting by its name: `out.gain`.
    ///
    /// # Errors
    /// As [`Control::set`].
    pub fn set_by_name(&mut self, name: &str, value: f64) -> Result<(), ControlError> {
        let has_it = |control: &&mut Control| control.settings().iter().any(|live| live.name() == name);
        let control = self.controls.iter_mut().find(has_it);
        control.ok_or(ControlError::NotLive)?.set_by_name(name, value)
    }

    /// Passes the writers and the read ends of their rings to the writer thread.
    fn write(&mut self, sinks: FileSinks<'_>, mut rings: Vec<Option<Consumer<f64>>>) {
        for written in sinks.written {
            let number = self.entries.len();
            let mut streams = Vec::new();
            let mut ends = Vec::new();
            for (place, tap) in written.taps.iter().enumerate() {
                self.taps[*tap] = (number, place);
                streams.push(sinks.planner.stream(sinks.taps[*tap]));
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

    /// Takes the probe rings for the caller.
    pub(crate) fn handed(&mut self) -> Vec<Consumer<f64>> {
        std::mem::take(&mut self.handed)
    }

    /// Completes all files. `live` is the real-time side that the driver returned.
    pub fn finish(self, live: Live) -> LiveOutcome {
        self.finish_all(vec![live])
    }

    /// Completes all files. `lives` are the real-time sides that the drivers returned, in the order of the graph.
    pub fn finish_all(mut self, lives: Vec<Live>) -> LiveOutcome {
        let meters = self.poll().into_iter();
        let drivers: Vec<(String, Meters)> =
            meters.map(|(name, meters)| (name.to_owned(), meters.clone())).collect();
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
        let lost_devices = lives.iter().flat_map(|live| live.run().lost_devices().map(str::to_owned));
        let lost_devices = lost_devices.collect();
        let panicked = |live: &Live| live.state() == LiveState::Panicked;
        let (panicked, lost_numbers, lost_arrivals) = (
            lives.iter().any(panicked),
            lives.iter().map(Live::lost_numbers).sum(),
            lives.iter().map(Live::lost_arrivals).sum(),
        );
        // A replaced plan may still be in the report ring: the tap rings end when both sides are dropped.
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

/// Makes the rings of a plan's taps, except those kept from the old plan. Puts their read ends into `outs` by tap
/// index.
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

    /// Rate of its driver, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.plan.driver_rate().hz()
    }
}
