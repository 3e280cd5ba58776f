//! The drivers of a live run, one per driver clock of the graph, and the devices around it.

use crate::backend::{BackendError, Connected, Counts, Role, State};
use crate::connections::Connections;
use crate::soundcard::CardCounts;
use haptograph_engine::graph::Graph;
use haptograph_engine::run::{Histogram, Player};
use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Maximum time between the ends of the drivers of one run, which differ by their last buffers.
const MAX_END_DELAY: Duration = Duration::from_secs(1);
/// Maximum duration of a stop. Outputs fall to zero in 10 ms, or more slowly if their slew limits require it.
const STOP_TIMEOUT: Duration = Duration::from_secs(5);
/// Polling period of a stop.
const POLL_PERIOD: Duration = Duration::from_millis(5);

/// Running drivers, and the connections that they are part of. Dropping it stops them on every path, including errors and
/// panics.
pub(super) struct Drivers {
    connections: Connections,
    /// When the first driver was found to have ended.
    first_end: Option<Instant>,
    /// Stops all drivers.
    stop: Arc<AtomicBool>,
    is_closed: bool,
}

impl Drivers {
    /// Starts a driver for each of `lives`, which are in the order of the graph. `stop` stops them.
    pub(super) fn start(
        connections: Connections,
        graph: &Graph,
        lives: Vec<Player>,
        stop: &Arc<AtomicBool>,
    ) -> Result<Self, BackendError> {
        let mut drivers = Self { connections, first_end: None, stop: Arc::clone(stop), is_closed: false };
        let lives = graph.drivers().into_iter().zip(lives).collect();
        drivers.connections.drive(graph, lives)?;
        Ok(drivers)
    }

    fn all(&self) -> impl Iterator<Item = Connected> {
        self.connections.drivers()
    }

    /// What the system refused at the start, without repetition.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for note in self.connections.status().into_iter().flat_map(|known| known.refused) {
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        notes
    }

    /// True if the run is over or, with `stopping`, if nothing can end it: its soundcard is gone.
    pub(super) fn is_finished(&self, stopping: bool) -> bool {
        self.all().all(|driver| match driver.state {
            State::Finished => true,
            State::Waiting => stopping,
            State::Running => false,
        })
    }

    /// True if one driver has ended while others still run; they must then be stopped.
    pub(super) fn is_partly_finished(&mut self) -> bool {
        if self.first_end.is_none() && self.all().any(|driver| driver.state == State::Finished) {
            self.first_end = Some(Instant::now());
        }
        self.first_end.is_some_and(|since| since.elapsed() > MAX_END_DELAY)
    }

    /// Waits for the end of the run. Returns its real-time sides in the order of the graph.
    pub(super) fn join(&mut self) -> Result<Vec<Player>, BackendError> {
        self.is_closed = true;
        let lives = self.connections.close()?;
        Ok(lives.into_iter().map(|(_, live)| live).collect())
    }

    /// Stops all drivers and waits until none drives any device.
    pub(super) fn stop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let since = Instant::now();
        while !self.is_finished(true) && since.elapsed() < STOP_TIMEOUT {
            std::thread::sleep(POLL_PERIOD);
            // A soundcard is found to be at rest here.
            self.connections.poll();
        }
    }
}

impl Deref for Drivers {
    type Target = Connections;

    fn deref(&self) -> &Connections {
        &self.connections
    }
}

impl DerefMut for Drivers {
    fn deref_mut(&mut self) -> &mut Connections {
        &mut self.connections
    }
}

impl Drop for Drivers {
    fn drop(&mut self) {
        if !self.is_closed {
            self.stop();
        }
    }
}

/// Description of the drivers of a run.
pub(super) fn description(connections: &Connections) -> String {
    let all = connections.counted(Role::Driver).map(|(driver, _)| driver);
    let mut all: Vec<Connected> = all.collect();
    all.sort_by_key(|driver| driver.clock);
    match &all[..] {
        [one] => one.place.clone(),
        several => {
            let each = several.iter().map(|driver| format!("{} by {}", driver.names.concat(), driver.place));
            each.collect::<Vec<_>>().join("; ")
        }
    }
}

/// The output latency that the system stated.
pub(super) fn output_latency(connections: &Connections) -> Option<Histogram> {
    connections.counted(Role::Driver).find_map(|(_, counts)| match counts {
        Counts::Stream(counts) => Some(counts.latency),
        Counts::None | Counts::Packets(..) => None,
    })
}

/// Warnings about the streams of a run.
pub(super) fn warnings(connections: &Connections) -> Vec<String> {
    let mut list = Vec::new();
    for (connected, counts) in
        [Role::Driver, Role::Input].into_iter().flat_map(|role| connections.counted(role))
    {
        let (whose, xrun) = match connected.role {
            Role::Input => (format!("the input of {}", connected.names.join(" and ")), "ran over"),
            Role::Driver | Role::Link => ("the soundcard".to_owned(), "ran dry"),
        };
        if let Counts::Stream(counts) = counts {
            list.extend(troubles(&whose, xrun, &counts));
        }
    }
    list
}

/// Warnings about a stream; `xrun` describes an xrun of it.
fn troubles(whose: &str, xrun: &str, counts: &CardCounts) -> Vec<String> {
    let mut list = Vec::new();
    if counts.xruns > 0 {
        list.push(format!("{whose} {xrun} {} times: the signal has gaps", counts.xruns));
    }
    if counts.clipped > 0 {
        list.push(format!(
            "{} samples were beyond the full scale of {whose} and were cut off",
            counts.clipped
        ));
    }
    list
}
