//! Putting another graph in the place of the one that runs, with its files and the rings between its drivers.

use super::super::RingMeter;
use super::super::control::{Control, ControlError, Prepared};
use super::super::file_sinks::{FileSinks, WriteError, file_ports, stream};
use super::super::runner::reconnect;
use super::super::swap::{Change, PlanSwap};
use super::{Entry, Session, tap_rings};
use crate::graph::{Graph, NodeId};
use crate::node::Stream;
use crate::plan::{Plan, PlanOptions};
use rtrb::Consumer;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A node and the index of one of its outputs.
type Port = (NodeId, usize);

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
    /// Its drivers are not those that run.
    #[error("its drivers are {wanted} now, and {running} run; that needs a new run")]
    OtherDrivers {
        /// Those that run, with their rates.
        running: String,
        /// Its own.
        wanted: String,
    },
    /// A device would be in two plans for a while.
    #[error("`{device}` is driven by {driver} now, and was not; that needs a new run")]
    MovedDevice {
        /// Its name.
        device: String,
        /// The driver that it hangs from in the new graph.
        driver: String,
    },
    /// One driver gets an actuator before another has let go of one: by another name it may be the same, and still warm.
    #[error(
        "`{device}` would be driven by {driver} before {other} has let go of `{left}`: save the graph without \
         `{device}` first, and with it a second later"
    )]
    NotReleased {
        /// The device that is new.
        device: String,
        /// Its driver.
        driver: String,
        /// The device that is not let go of yet.
        left: String,
        /// Its driver.
        other: String,
    },
}

/// What goes on in a new graph: places of taps in the old list and the new one, which stream of which entry each of the
/// new ones is, and the entries that do not.
#[derive(Default)]
struct KeptStreams {
    kept: Vec<(usize, usize)>,
    places: Vec<(usize, usize)>,
    ended: Vec<usize>,
    /// The ports that the caller goes on reading.
    probed: Vec<Port>,
}

/// A new graph, ready to take over.
struct Ready {
    /// By driver.
    plans: Vec<Prepared>,
    rings: Vec<Arc<RingMeter>>,
    /// Far ends of the rings of taps that are new.
    outs: Vec<Option<Consumer<f64>>>,
}

impl Session {
    /// Puts another graph in place of the one that runs. Files that both write go on; new ones are opened in
    /// `folder`, and what the new graph has no more is completed. All drivers take it, each when it is ready, or none does.
    ///
    /// # Errors
    /// [`ChangeError`]; the graph that runs goes on.
    pub fn change(&mut self, graph: &Graph, folder: &Path) -> Result<Changed, ChangeError> {
        self.change_with(graph, Some(folder), None)
            .map(|(changed, _)| changed)
    }

    /// As [`change`](Self::change); where `probes` are given, those are the outputs that the caller reads from now on.
    /// The streams of those that are new are returned in the order of their rings.
    pub(crate) fn change_with(
        &mut self,
        graph: &Graph,
        folder: Option<&Path>,
        probes: Option<&[Port]>,
    ) -> Result<(Changed, Vec<(Port, Stream)>), ChangeError> {
        let mut file_sinks = FileSinks::new(graph);
        let kept_streams = self.keep_streams(&mut file_sinks, probes);
        let left_out = match folder {
            Some(folder) => self
                .open_new(&mut file_sinks, &kept_streams.ended, folder)
                .map_err(ChangeError::from),
            None => Ok(Vec::new()),
        };
        let more = probes.unwrap_or_default().iter().copied();
        let more: Vec<Port> = more.filter(|port| !kept_streams.probed.contains(port)).collect();
        let begun_probes: Vec<(Port, Stream)> = more
            .into_iter()
            .map(|port| (port, file_sinks.hand_over(port.0, port.1)))
            .collect();
        let ready =
            left_out.and_then(|left_out| Ok((left_out, self.prepare(&file_sinks, &kept_streams.kept)?)));
        let (left_out, ready) = match ready {
            Ok(ready) => ready,
            Err(error) => {
                file_sinks.take_back();
                return Err(error);
            }
        };
        let mut change = Change::Settings(0);
        for (control, plan) in self.controls.iter_mut().zip(ready.plans) {
            change = change.and(control.put(plan)?);
        }
        self.rings = ready.rings;
        self.taps = kept_streams.places;
        self.taps.resize(file_sinks.taps.len(), (0, 0));
        let files = file_sinks
            .written
            .iter()
            .filter(|written| written.writer.is_some());
        let begun = files.map(|written| written.what.clone()).collect();
        self.write(file_sinks, ready.outs);
        let mut ended = Vec::new();
        for number in kept_streams.ended {
            let entry = &mut self.entries[number];
            entry.running = false;
            ended.extend((!entry.is_handed).then(|| entry.what.clone()));
        }
        let changed = Changed {
            change,
            begun,
            ended,
            left_out,
        };
        Ok((changed, begun_probes))
    }

    /// Taps what goes on in a new graph; of what the caller reads, where `probes` are given, those alone.
    fn keep_streams(&self, file_sinks: &mut FileSinks<'_>, probes: Option<&[Port]>) -> KeptStreams {
        let mut kept_streams = KeptStreams::default();
        for (number, entry) in self.entries.iter().enumerate().filter(|(_, entry)| entry.running) {
            let old = |stream: usize| self.taps.iter().position(|tap| *tap == (number, stream));
            let ports = entry.ports_in(file_sinks.graph).filter(|ports| {
                // The ring of a stream stays with its driver.
                let stays = |(stream, port): (usize, &(NodeId, usize))| {
                    old(stream).is_some_and(|old| self.has_tap(file_sinks.graph, *port, old))
                };
                ports.iter().enumerate().all(stays)
            });
            let is_read = |port: &Port| probes.is_none_or(|probes| probes.contains(port));
            let ports = ports.filter(|ports| !entry.is_handed || ports.iter().all(is_read));
            let Some(ports) = ports else {
                kept_streams.ended.push(number);
                continue;
            };
            if entry.is_handed {
                kept_streams.probed.extend(&ports);
            }
            for (stream, port) in ports.into_iter().enumerate() {
                kept_streams
                    .kept
                    .extend(old(stream).map(|old| (old, file_sinks.taps.len())));
                file_sinks.taps.push(port);
                kept_streams.places.push((number, stream));
            }
        }
        kept_streams
    }

    /// Does a new graph's port hang from the driver that has a tap of the present plans?
    fn has_tap(&self, graph: &Graph, port: (NodeId, usize), tap: usize) -> bool {
        let tapped = |control: &&Control| control.plan().tap_places.contains(&tap);
        let (Some(control), Some(driver)) = (self.controls.iter().find(tapped), graph.driver_of(port.0))
        else {
            return false;
        };
        self.controls.len() == 1 || control.plan().driver_name() == graph.clocks()[driver].name
    }

    /// Opens the files that a new graph has more; returns those that would have to be begun again.
    fn open_new(
        &self,
        file_sinks: &mut FileSinks<'_>,
        ended: &[usize],
        folder: &Path,
    ) -> Result<Vec<PathBuf>, WriteError> {
        let mut left_out = Vec::new();
        for (index, file) in file_sinks.graph.written_files() {
            let known = |entry: &Entry| entry.sink.as_deref() == Some(file);
            match self.entries.iter().position(known) {
                None => file_sinks.open_file(index, folder)?,
                Some(known) if ended.contains(&known) || !self.entries[known].running => {
                    left_out.push(self.entries[known].what.clone());
                }
                Some(_) => {}
            }
        }
        Ok(left_out)
    }

    /// Lays out a new graph for all drivers, with the rings between them and to the files.
    fn prepare(&self, file_sinks: &FileSinks<'_>, kept: &[(usize, usize)]) -> Result<Ready, ChangeError> {
        let options = PlanOptions {
            block: self.block,
            taps: file_sinks.taps.clone(),
        };
        let mut outs: Vec<_> = file_sinks.taps.iter().map(|_| None).collect();
        let mut plans = Vec::new();
        let all = self.by_driver(Plan::of(file_sinks.graph, &options))?;
        self.check_handover(&all)?;
        for (control, mut plan) in self.controls.iter().zip(all) {
            let place = |plan: &Plan, tap: usize| plan.tap_places.iter().position(|place| *place == tap);
            let own = kept
                .iter()
                .filter_map(|(old, new)| Some((place(control.plan(), *old)?, place(&plan, *new)?)));
            let rings = tap_rings(&plan, own.collect(), &mut outs);
            self.check_devices(control, &plan)?;
            plan.keep_inputs(control.plan());
            plans.push(control.prepare(Arc::new(plan), rings)?);
        }
        let before: Vec<Arc<Plan>> = self
            .controls
            .iter()
            .map(|control| Arc::clone(control.plan()))
            .collect();
        let mut next: Vec<&mut PlanSwap> = plans.iter_mut().map(|plan| &mut *plan.next).collect();
        let rings = reconnect(&before, &self.rings, &mut next);
        Ok(Ready { plans, rings, outs })
    }

    /// Refuses a plan that has a device of another driver's.
    fn check_devices(&self, control: &Control, plan: &Plan) -> Result<(), ChangeError> {
        let others = self
            .controls
            .iter()
            .filter(|other| !std::ptr::eq(*other, control));
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

    /// Refuses plans of which one drives something new while something that another driver drove may still be driven.
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

    /// The plans of a new graph in the order of the drivers that run.
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
    /// The ports of a graph that carry what is written here, if it has them all.
    fn ports_in(&self, graph: &Graph) -> Option<Vec<(NodeId, usize)>> {
        if let Some(sink) = &self.sink {
            let (index, _) = graph.written_files().find(|(_, file)| file == sink)?;
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

fn find(graph: &Graph, known: &Stream) -> Option<(NodeId, usize)> {
    let nodes = graph.nodes();
    let ports = nodes
        .ids()
        .flat_map(|id| (0..nodes[id].outputs.len()).map(move |output| (id, output)));
    let mut same = ports.filter(|port| carries(graph, *port, known));
    same.next()
}

fn carries(graph: &Graph, port: (NodeId, usize), known: &Stream) -> bool {
    let found = stream(graph, port);
    let simulated = known.simulated;
    Stream { simulated, ..found } == *known
}
