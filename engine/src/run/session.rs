//! A run of a graph, whatever its clock: its controls, its files, its probes and its outcome.

mod change;

pub use change::{ChangeError, Changed};

use super::arm::ArmSwitch;
use super::arrivals::{self, ArrivalLog, Input, InputLog, LogWriter};
use super::control::{Control, ControlError, SetError, UnknownSetting};
use super::cost;
use super::file_sinks::{FileSinks, WriteError, WrittenFile};
use super::meter::Meters;
use super::player::{Claim, Player, PlayerState, player_until};
use super::ring_edges::connect;
use super::rings::{TapRings, Writer};
use super::silence::{self, ActuatorLevel, InputStatus};
use super::{Faults, Outcome, RingMeter, RingReport, Run};
use crate::node::Stream;
use crate::node_id::NodeId;
use crate::plan::{Plan, PlanOptions};
use crate::settings::{LiveSetting, SettingId, choices};
use rtrb::Consumer;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};

/// Options of a run: `SessionOptions::default().block(64).rested()`.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct SessionOptions {
    /// Largest block in driver frames; 0 means the default.
    pub block: usize,
    /// Duration, s; `None` runs until it is stopped. A source whose data end earlier can end the run.
    pub seconds: Option<f64>,
    /// True if the actuators are known to be cold. Otherwise real actuators start without heat reserve.
    pub rested: bool,
    /// True if the caller runs the graph as fast as possible and not in real time. Only then may it have scripted nodes, and
    /// its calls wait for its files; otherwise frames that are not written within one second are lost, and counted.
    pub offline: bool,
    /// When set, the outputs fade out and the run stops. The real-time sides poll it.
    pub stop: Arc<AtomicBool>,
    /// With a switch, real devices get zeros until it is armed; without one they are driven from the start.
    pub arm: Option<Arc<ArmSwitch>>,
    /// Outputs of nodes whose frames the caller reads, without a limiter: `"texture.output"`.
    /// [`Player::open`](crate::run::Player::open) makes them.
    pub probes: Vec<String>,
    /// Folder of the graph's file sinks of [`Player::open`](crate::run::Player::open); without one they write nothing.
    pub folder: Option<PathBuf>,
    /// Times about one block in sixteen, step by step, for [`Session::node_costs`]. It has no effect in a browser,
    /// whose clock is too coarse.
    pub sample_costs: bool,
}

impl SessionOptions {
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

    /// Adds a probe.
    #[must_use]
    pub fn probe(mut self, output: &str) -> Self {
        self.probes.push(output.to_owned());
        self
    }

    /// Declares the actuators cold.
    #[must_use]
    pub fn rested(mut self) -> Self {
        self.rested = true;
        self
    }
}

/// The half of a run for threads that are not real-time: settings, swaps, probes, files and reports. Its real-time half
/// is a [`Player`] for each driver, which a clock runs: a device's callback, a timer, the caller, or virtual time.
///
/// ```
/// use haptograph_engine::document::Document;
/// use haptograph_engine::graph::{CheckOptions, check};
/// use haptograph_engine::registry::Registry;
/// use haptograph_engine::run::{Change, FileSinks, SessionOptions, Session};
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
/// let (mut player, mut session) = Session::open(FileSinks::new(&before), &SessionOptions::default())?;
/// player.process(48); // In the driver's callback.
///
/// session.set_by_name("level.value", 0.5)?;
/// let changed = session.change_without_files(&after)?;
/// assert_eq!(changed.change, Change::AtOnce); // Neither graph has an actuator to fade.
/// player.process(48);
///
/// let outcome = session.finish(player);
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
    writer: Writer,
    block: usize,
    /// All files and probes of the run, ended ones included.
    entries: Vec<Entry>,
    /// (entry, stream) of each tap of the present plan.
    taps: Vec<(usize, usize)>,
    pub(crate) probes: Vec<HandedProbe>,
    /// The endpoints of the calling program that its player has claimed.
    pub(crate) claim: Weak<Claim>,
}

/// An output that the caller reads.
pub(crate) struct HandedProbe {
    pub name: String,
    pub stream: Stream,
    /// `None` when its handle has been taken.
    pub ring: Option<Consumer<f64>>,
}

struct Entry {
    what: PathBuf,
    sink: Option<PathBuf>,
    streams: Vec<Stream>,
    /// True if the caller reads it.
    is_handed: bool,
    running: bool,
}

/// Outcome of a run.
#[derive(Debug)]
#[non_exhaustive]
pub struct SessionOutcome {
    /// The part that does not depend on the clock.
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
    /// Opens a run of a graph with one driver and returns both halves.
    ///
    /// # Errors
    /// System errors if no thread can be started; an error if the graph has several drivers.
    pub fn open(sinks: FileSinks<'_>, options: &SessionOptions) -> std::io::Result<(Player, Self)> {
        let (mut players, session) = Self::open_all(sinks, options, None)?;
        match (players.pop(), players.is_empty()) {
            (Some(player), true) => Ok((player, session)),
            _ => Err(std::io::Error::other("this graph has several drivers")),
        }
    }

    /// Opens a run and returns its real-time halves, one for each driver in the order of the graph, and the session.
    ///
    /// With a `folder`, the run writes its replay log there.
    ///
    /// # Errors
    /// System errors if a thread cannot be started or a file cannot be written; [`OfflineOnly`](crate::node::OfflineOnly).
    pub fn open_all(
        sinks: FileSinks<'_>,
        options: &SessionOptions,
        folder: Option<&Path>,
    ) -> std::io::Result<(Vec<Player>, Self)> {
        let mut writer = Writer::of_a_thread(options.offline);
        if folder.is_some() || sinks.written.iter().any(|written| written.writer.is_some()) {
            writer.start()?;
        }
        let planner = sinks.planner;
        let (mut players, mut session) = Self::open_with(sinks, options, writer)?;
        if let Some(folder) = folder {
            arrivals::keep_graph(planner, options.rested, folder)?;
            for (driver, player) in players.iter_mut().enumerate() {
                session.log(driver, player, folder)?;
                session.log_inputs((driver, player), folder)?;
            }
        }
        Ok((players, session))
    }

    /// Opens a run whose files `writer` writes.
    pub(super) fn open_with(
        sinks: FileSinks<'_>,
        options: &SessionOptions,
        writer: Writer,
    ) -> std::io::Result<(Vec<Player>, Self)> {
        if !options.offline {
            sinks.planner.refuse_scripts().map_err(std::io::Error::other)?;
        }
        let plan_options = PlanOptions { block: options.block, taps: sinks.taps.clone() };
        let mut outs: Vec<_> = sinks.taps.iter().map(|_| None).collect();
        let (mut players, mut controls) = (Vec::new(), Vec::new());
        let hottest = Arc::default();
        for plan in sinks.planner.plans(&plan_options) {
            let plan = Arc::new(plan);
            let rings = TapRings::new(&plan, (&writer, &sinks), Vec::new(), &mut outs);
            let (mut player, control) = player_until(Arc::clone(&plan), Arc::clone(&options.stop));
            player.send_taps_through(rings);
            player.share_heat(Arc::clone(&hottest));
            if !options.rested {
                player.run_mut().assume_thermally_saturated();
            }
            if let Some(switch) = &options.arm {
                player.run_mut().arm_by(switch);
            }
            if let Some(seconds) = options.seconds {
                player.end_after_seconds(seconds);
            }
            if let Some(frames) = player.end().into_iter().chain(plan.data_frames).min() {
                player.end_after(frames);
            }
            controls.push(control);
            players.push(player);
        }
        let mut session = Self {
            stop: Arc::clone(&options.stop),
            arm: options.arm.clone(),
            controls,
            rings: connect(&mut players.iter_mut().map(Player::run_mut).collect::<Vec<_>>()),
            writer,
            block: options.block,
            entries: Vec::new(),
            taps: vec![(0, 0); sinks.taps.len()],
            probes: Vec::new(),
            claim: Weak::new(),
        };
        session.write(sinks, outs);
        Ok((players, session))
    }

    /// The plans of its drivers.
    pub(crate) fn plans(&self) -> Vec<Arc<Plan>> {
        self.controls.iter().map(|control| Arc::clone(control.plan())).collect()
    }

    pub(super) fn ring_meters(&self) -> Vec<Arc<RingMeter>> {
        self.rings.clone()
    }

    /// Writes the frames of a block, if the caller writes the files.
    pub(super) fn write_block(&mut self) {
        self.writer.write_block();
    }

    /// True unless a file that the caller writes has failed.
    pub(super) fn writes(&self) -> bool {
        self.writer.writes()
    }

    /// Logs a driver's callbacks and setting changes for a replay.
    fn log(&mut self, driver: usize, player: &mut Player, folder: &Path) -> std::io::Result<()> {
        let plan = self.controls[driver].plan();
        let (log, kept) = ArrivalLog::new(plan);
        player.log_through(log);
        let what = arrivals::file(folder, driver);
        let callbacks = WrittenFile::apart(Box::new(LogWriter::callbacks(&what, plan)?), what);
        let what = arrivals::settings_file(folder, driver);
        let settings = WrittenFile::apart(Box::new(LogWriter::settings(&what, plan)?), what);
        self.writer.add(callbacks, vec![kept.callbacks]);
        self.writer.add(settings, vec![kept.settings]);
        Ok(())
    }

    /// Logs the live inputs that a driver reads for a replay.
    fn log_inputs(&mut self, (driver, player): (usize, &mut Player), folder: &Path) -> std::io::Result<()> {
        for input in Input::all(self.controls[driver].plan()) {
            let (log, kept) = InputLog::new(&input);
            player.run_mut().log_input(input.place, log);
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

    /// Frames that the first driver has run by now.
    pub fn frames(&self) -> u64 {
        self.controls.first().map_or(0, |control| control.progress().frames())
    }

    /// Time of each driver by its own frames, s, by name.
    pub fn times_s(&self) -> impl Iterator<Item = (&str, f64)> {
        let time = |control: &Control| control.progress().frames() as f64 / control.plan().driver_rate().hz();
        self.controls.iter().map(move |control| (control.plan().driver_name(), time(control)))
    }

    /// NaN and infinity at actuators by now.
    pub fn faults(&self) -> Faults {
        Faults::of(self.controls.iter().map(|control| control.progress().faults()))
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
    /// ([`SessionOptions::sample_costs`]). The shares are those of all blocks.
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

    /// Finds a live setting by its name: `out.gain`.
    ///
    /// # Errors
    /// [`UnknownSetting`] with the closest name or all names.
    pub fn find_setting(&self, name: &str) -> Result<(NodeId, SettingId), UnknownSetting> {
        let found = self.settings().find(|live| live.name() == name);
        found.map(|live| (live.node, live.setting)).ok_or_else(|| self.unknown_setting(name))
    }

    /// The error for a name that no live setting has.
    pub fn unknown_setting(&self, name: &str) -> UnknownSetting {
        let names: Vec<String> = self.settings().map(LiveSetting::name).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        UnknownSetting { name: name.to_owned(), help: choices(name, &names, "the live settings are") }
    }

    /// Sets a live setting by its name: `out.gain`.
    ///
    /// # Errors
    /// [`SetError`] as of [`find_setting`](Self::find_setting) and [`set`](Self::set).
    pub fn set_by_name(&mut self, name: &str, value: f64) -> Result<(), SetError> {
        let (node, setting) = self.find_setting(name)?;
        Ok(self.set(node, setting, value)?)
    }

    /// Passes the writers and the read ends of their rings to the writer, and those without a writer to the probes.
    fn write(&mut self, sinks: FileSinks<'_>, mut rings: Vec<Option<Consumer<f64>>>) {
        for written in sinks.written {
            let number = self.entries.len();
            let mut streams: Vec<Stream> = Vec::new();
            let mut ends = Vec::new();
            for (place, tap) in written.taps.iter().enumerate() {
                self.taps[*tap] = (number, place);
                streams.push(sinks.planner.stream(sinks.taps[*tap]));
                ends.extend(rings[*tap].take());
            }
            if written.writer.is_none() {
                let name = written.what.to_string_lossy().into_owned();
                // It replaces an ended one of that name.
                self.probes.retain(|probe| probe.name != name);
                let mut probes = streams.iter().cloned().zip(ends.drain(..));
                self.probes.extend(probes.next().map(|(stream, ring)| HandedProbe {
                    name,
                    stream,
                    ring: Some(ring),
                }));
            }
            self.entries.push(Entry {
                what: written.what.clone(),
                sink: written.sink.clone(),
                streams,
                is_handed: written.writer.is_none(),
                running: true,
            });
            if written.writer.is_some() {
                self.writer.add(written, ends);
            }
        }
    }

    /// Ends the run and completes all files. `player` is the real-time half that the driver returned.
    pub fn finish(self, player: Player) -> SessionOutcome {
        self.finish_all(vec![player])
    }

    /// As [`finish`](Self::finish). `players` are the real-time halves that the drivers returned, in the order of the
    /// graph.
    pub fn finish_all(mut self, players: Vec<Player>) -> SessionOutcome {
        let meters = self.poll().into_iter();
        let drivers: Vec<(String, Meters)> =
            meters.map(|(name, meters)| (name.to_owned(), meters.clone())).collect();
        let mut meters = Meters::default();
        drivers.iter().for_each(|(_, one)| meters.add(one));
        let frames = players.first().map_or(0, Player::frames);
        let rate_hz = self.controls[0].plan().driver_rate().hz();
        let outcome = Outcome {
            driver_frames: frames,
            seconds: frames as f64 / rate_hz,
            stopped: players.iter().any(|player| player.state() != PlayerState::Finished),
            faults: Faults::of(players.iter().map(Player::faults)),
            actuators: players.iter().flat_map(Player::actuators).collect(),
            rings: self.rings().collect(),
        };
        let lost_devices = players.iter().flat_map(|player| player.run().lost_devices().map(str::to_owned));
        let lost_devices = lost_devices.collect();
        let panicked = |player: &Player| player.state() == PlayerState::Panicked;
        let (panicked, lost_numbers, lost_arrivals) = (
            players.iter().any(panicked),
            players.iter().map(Player::lost_numbers).sum(),
            players.iter().map(Player::lost_arrivals).sum(),
        );
        self.writer.write_block();
        // A replaced plan may still be in the report ring: the tap rings end when both sides are dropped.
        drop(players);
        drop(self.controls);
        SessionOutcome {
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

impl Run {
    fn log_input(&mut self, device: usize, log: InputLog) {
        self.state.devices[device].log = Some(log);
    }

    /// Rate of its driver, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.plan.driver_rate().hz()
    }
}
