//! Replacing the running graph, with its files and the rings between its drivers.

use super::super::RingMeter;
use super::super::control::{Control, ControlError, Prepared};
use super::super::file_sinks::{FileSinks, WriteError};
use super::super::ring_edges::reconnect;
use super::super::rings::TapRings;
use super::super::swap::{Change, PlanSwap};
use super::{Entry, Session};
use crate::node::{OfflineOnly, Stream};
use crate::node_id::NodeId;
use crate::plan::{Plan, PlanOptions, Planner};
use rtrb::Consumer;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A node and the index of one of its outputs.
type Port = (NodeId, usize);

/// Result of replacing the graph.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Changed {
    /// The difference of the graphs.
    pub change: Change,
    /// Files begun with the new graph.
    pub begun: Vec<PathBuf>,
    /// Files completed because the new graph does not write them.
    pub ended: Vec<PathBuf>,
    /// Files of the new graph that are not written: a file of that name already has other signals.
    pub left_out: Vec<PathBuf>,
}

/// Reason why the graph was not replaced.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChangeError {
    /// The new plan cannot replace the running one.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// A file of the new graph cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A node of the new graph is a script.
    #[error(transparent)]
    OfflineOnly(#[from] OfflineOnly),
    /// Another player runs the new graph.
    #[error("another player runs the new graph, with `{endpoint}`; check the document again for this one")]
    Playing {
        /// An endpoint of the program.
        endpoint: String,
    },
    /// The program has taken a handle of the new graph for a channel whose handle of the running graph continues.
    #[error("`{channel}` continues with its present handle; drop that of the new graph first")]
    Taken {
        /// The channel.
        channel: String,
    },
    /// The new graph has other drivers.
    #[error("the new graph needs {wanted}, but the run has {running}; start a new run")]
    OtherDrivers {
        /// Drivers of the run, with their rates.
        running: String,
        /// Drivers of the new graph.
        wanted: String,
    },
    /// A device moves to another driver: two plans would share it for a while.
    #[error("`{device}` moves to driver {driver}, which a running graph cannot do; start a new run")]
    MovedDevice {
        /// Name of the device.
        device: String,
        /// The driver in the new graph.
        driver: String,
    },
    /// A driver adds an actuator before another has released one: both may be the same hardware, which is still warm.
    #[error(
        "{driver} cannot drive `{device}` until {other} has released `{left}`: save the graph without `{device}`, and \
         with it a second later"
    )]
    NotReleased {
        /// The added device.
        device: String,
        /// The driver.
        driver: String,
        /// The device that is not released yet.
        left: String,
        /// The driver.
        other: String,
    },
}

/// Streams that continue in a new graph.
#[derive(Default)]
struct KeptStreams {
    /// (old, new) index of each tap that continues.
    kept: Vec<(usize, usize)>,
    /// (entry, stream) of each of them.
    places: Vec<(usize, usize)>,
    /// Entries that end.
    ended: Vec<usize>,
    /// The ports that the caller continues to read.
    probed: Vec<Port>,
}

/// A new graph, ready to replace the running one.
struct Ready {
    /// One for each driver.
    plans: Vec<Prepared>,
    rings: Vec<Arc<RingMeter>>,
    /// Read ends of the rings of new taps.
    outs: Vec<Option<Consumer<f64>>>,
}

impl Session {
    /// Replaces the running graph. Files that both graphs write continue; new files are opened in `folder`; files that
    /// only the old graph writes are completed. Either all drivers change over, each when it is ready, or none does.
    ///
    /// An endpoint of the program that both graphs have, with the same channels, clock and settings, continues with its
    /// [handles](crate::host): afterwards the new graph gives handles of these channels, too, where they are not taken. Those of
    /// other endpoints come from the new graph, before or after the change; handles of endpoints that it does not have are no
    /// longer read or written. The player has claimed both graphs until it is dropped.
    ///
    /// # Errors
    /// [`ChangeError`]; the running graph continues.
    pub fn change<'g>(
        &mut self,
        graph: impl Into<Planner<'g>>,
        folder: &Path,
    ) -> Result<Changed, ChangeError> {
        self.change_with(graph.into(), Some(folder), None)
    }

    /// As [`change`](Self::change), of a run without files.
    ///
    /// # Errors
    /// [`ChangeError`]; the running graph continues.
    pub fn change_without_files<'g>(
        &mut self,
        graph: impl Into<Planner<'g>>,
    ) -> Result<Changed, ChangeError> {
        self.change_with(graph.into(), None, None)
    }

    /// As [`change`](Self::change). If `probes` are given, with their names, the caller reads those outputs from now on.
    pub(crate) fn change_with(
        &mut self,
        planner: Planner<'_>,
        folder: Option<&Path>,
        probes: Option<&[(&str, Port)]>,
    ) -> Result<Changed, ChangeError> {
        planner.refuse_scripts()?;
        let endpoints = self.endpoints_of(planner)?;
        let mut sinks = FileSinks::new(planner);
        let kept_streams = self.keep_streams(&mut sinks, probes);
        let left_out = match folder {
            Some(folder) => self.open_new(&mut sinks, &kept_streams.ended, folder).map_err(ChangeError::from),
            None => Ok(Vec::new()),
        };
        let probed = probes.unwrap_or_default().iter();
        for (name, port) in probed.filter(|(_, port)| !kept_streams.probed.contains(port)) {
            sinks.hand_over(name, *port);
        }
        let ready = left_out.and_then(|left_out| Ok((left_out, self.prepare(&sinks, &kept_streams.kept)?)));
        let (left_out, ready) = match ready {
            Ok(ready) => ready,
            Err(error) => {
                sinks.take_back();
                return Err(error);
            }
        };
        let mut change = Change::Settings(0);
        for (control, plan) in self.controls.iter_mut().zip(ready.plans) {
            change = change.and(control.put(plan)?);
        }
        endpoints.take_over(&self.claim);
        self.rings = ready.rings;
        self.taps = kept_streams.places;
        self.taps.resize(sinks.taps.len(), (0, 0));
        let files = sinks.written.iter().filter(|written| written.writer.is_some());
        let begun = files.map(|written| written.what.clone()).collect();
        self.write(sinks, ready.outs);
        let mut ended = Vec::new();
        for number in kept_streams.ended {
            let entry = &mut self.entries[number];
            entry.running = false;
            ended.extend((!entry.is_handed).then(|| entry.what.clone()));
        }
        Ok(Changed { change, begun, ended, left_out })
    }

    /// Taps the streams that continue in a new graph. If `probes` are given, only those probes continue.
    fn keep_streams(&self, sinks: &mut FileSinks<'_>, probes: Option<&[(&str, Port)]>) -> KeptStreams {
        let mut kept_streams = KeptStreams::default();
        for (number, entry) in self.entries.iter().enumerate().filter(|(_, entry)| entry.running) {
            let old = |stream: usize| self.taps.iter().position(|tap| *tap == (number, stream));
            let ports = entry.ports_in(sinks.planner).filter(|ports| {
                // The ring of a stream stays with its driver.
                let stays = |(stream, port): (usize, &Port)| {
                    old(stream).is_some_and(|old| self.has_tap(sinks.planner, *port, old))
                };
                ports.iter().enumerate().all(stays)
            });
            let is_read =
                |port: &Port| probes.is_none_or(|probes| probes.iter().any(|(_, probe)| probe == port));
            let ports = ports.filter(|ports| !entry.is_handed || ports.iter().all(is_read));
            let Some(ports) = ports else {
                kept_streams.ended.push(number);
                continue;
            };
            if entry.is_handed {
                kept_streams.probed.extend(&ports);
            }
            for (stream, port) in ports.into_iter().enumerate() {
                kept_streams.kept.extend(old(stream).map(|old| (old, sinks.taps.len())));
                sinks.taps.push(port);
                kept_streams.places.push((number, stream));
            }
        }
        kept_streams
    }

    /// True if a port of the new graph has the driver that a tap of the present plans has.
    fn has_tap(&self, planner: Planner<'_>, (node, _): Port, tap: usize) -> bool {
        let tapped = |control: &&Control| control.plan().tap_places.contains(&tap);
        let (Some(control), Some(driver)) = (self.controls.iter().find(tapped), planner.driver_name(node))
        else {
            return false;
        };
        self.controls.len() == 1 || control.plan().driver_name() == driver
    }

    /// Opens the files that only the new graph writes. Returns those that cannot be begun again.
    fn open_new(
        &self,
        sinks: &mut FileSinks<'_>,
        ended: &[usize],
        folder: &Path,
    ) -> Result<Vec<PathBuf>, WriteError> {
        let mut left_out = Vec::new();
        for (node, sink) in sinks.planner.file_sinks() {
            let known = |entry: &Entry| entry.sink.as_deref() == Some(sink.file_name());
            match self.entries.iter().position(known) {
                None => sinks.open_file(node, sink, folder)?,
                Some(known) if ended.contains(&known) || !self.entries[known].running => {
                    left_out.push(self.entries[known].what.clone());
                }
                Some(_) => {}
            }
        }
        Ok(left_out)
    }

    /// Plans a new graph for all drivers, with the rings between them and to the files.
    fn prepare(&self, sinks: &FileSinks<'_>, kept: &[(usize, usize)]) -> Result<Ready, ChangeError> {
        let options = PlanOptions { block: self.block, taps: sinks.taps.clone() };
        let mut outs: Vec<_> = sinks.taps.iter().map(|_| None).collect();
        let mut plans = Vec::new();
        let all = self.by_driver(sinks.planner.plans(&options))?;
        self.check_handover(&all)?;
        for (control, mut plan) in self.controls.iter().zip(all) {
            let place = |plan: &Plan, tap: usize| plan.tap_places.iter().position(|place| *place == tap);
            let own = kept
                .iter()
                .filter_map(|(old, new)| Some((place(control.plan(), *old)?, place(&plan, *new)?)));
            let rings = TapRings::new(&plan, (&self.writer, sinks), own.collect(), &mut outs);
            self.check_devices(control, &plan)?;
            plan.keep_inputs(control.plan());
            let mut prepared = control.prepare(Arc::new(plan), rings)?;
            if let Some(switch) = &self.arm {
                prepared.next.run.arm_by(switch);
            }
            plans.push(prepared);
        }
        let before: Vec<Arc<Plan>> = self.controls.iter().map(|control| Arc::clone(control.plan())).collect();
        let mut next: Vec<&mut PlanSwap> = plans.iter_mut().map(|plan| &mut *plan.next).collect();
        let rings = reconnect(&before, &self.rings, &mut next);
        Ok(Ready { plans, rings, outs })
    }

    /// Refuses a plan that uses a device of another driver.
    fn check_devices(&self, control: &Control, plan: &Plan) -> Result<(), ChangeError> {
        let others = self.controls.iter().filter(|other| !std::ptr::eq(*other, control));
        for theirs in others.flat_map(Control::plans) {
            let mut shared = theirs.used_devices();
            if let Some(device) = shared.find(|device| plan.used_devices().any(|own| own == *device)) {
                return Err(ChangeError::MovedDevice {
                    device: device.to_owned(),
                    driver: plan.driver_name().to_owned(),
                });
            }
        }
        Ok(())
    }

    /// Refuses plans in which a driver adds an actuator while another driver may still drive one that it drops.
    fn check_handover(&self, plans: &[Plan]) -> Result<(), ChangeError> {
        let changes = || self.controls.iter().zip(plans);
        for (driver, (control, plan)) in changes().enumerate() {
            let Some(device) = plan.drives_beyond(control.plan()) else {
                continue;
            };
            let mut others = changes().enumerate().filter(|(other, _)| *other != driver);
            let left = others.find_map(|(_, (other, next))| {
                let left = other.plans().find_map(|plan| plan.drives_beyond(next))?;
                Some((left, other.plan().driver_name()))
            });
            if let Some((left, _)) = left
                && left == device
            {
                return Err(ChangeError::MovedDevice {
                    device: device.to_owned(),
                    driver: plan.driver_name().to_owned(),
                });
            }
            if let Some((left, other)) = left {
                return Err(ChangeError::NotReleased {
                    device: device.to_owned(),
                    driver: plan.driver_name().to_owned(),
                    left: left.to_owned(),
                    other: other.to_owned(),
                });
            }
        }
        Ok(())
    }

    /// The plans of a new graph in the order of the running drivers.
    fn by_driver(&self, mut plans: Vec<Plan>) -> Result<Vec<Plan>, ChangeError> {
        if let ([_], [_]) = (&self.controls[..], &plans[..]) {
            return Ok(plans);
        }
        let known = |plan: &Plan| {
            let same = |control: &Control| {
                let running = control.plan();
                (running.driver_name(), running.driver_rate()) == (plan.driver_name(), plan.driver_rate())
            };
            self.controls.iter().position(same)
        };
        if plans.len() != self.controls.len() || !plans.iter().all(|plan| known(plan).is_some()) {
            return Err(ChangeError::OtherDrivers {
                running: drivers(self.controls.iter().map(|control| &**control.plan())),
                wanted: drivers(plans.iter()),
            });
        }
        plans.sort_by_key(known);
        Ok(plans)
    }
}

/// `audio at 48000 Hz and servo at 1000 Hz`
fn drivers<'p>(plans: impl Iterator<Item = &'p Plan>) -> String {
    let each = plans.map(|plan| format!("{} at {}", plan.driver_name(), plan.driver_rate()));
    each.collect::<Vec<_>>().join(" and ")
}

impl Entry {
    /// The ports of a graph that carry the streams of this entry, if it has all of them.
    fn ports_in(&self, planner: Planner<'_>) -> Option<Vec<Port>> {
        if let Some(file) = &self.sink {
            let mut sinks = planner.file_sinks();
            let (node, _) = sinks.find(|(_, sink)| sink.file_name() == file)?;
            let ports = planner.read_by(node);
            let same = ports.len() == self.streams.len()
                && ports.iter().zip(&self.streams).all(|(port, known)| carries(planner, *port, known));
            return same.then_some(ports);
        }
        let find = |known| planner.outputs().find(|port| carries(planner, *port, known));
        self.streams.iter().map(find).collect()
    }
}

/// True if an output has this signal, be it simulated or not.
fn carries(planner: Planner<'_>, port: Port, known: &Stream) -> bool {
    let found = planner.stream(port);
    let simulated = known.simulated;
    Stream { simulated, ..found } == *known
}
