//! The drivers of a live run, one per driver clock of the graph, and the devices around it.

use crate::backend::{BackendError, Connected, Lives, State};
use crate::connections::Connections;
use haptograph_engine::graph::Graph;
use haptograph_engine::run::Player;
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
/// panics. A graph whose time is the caller's has connections only.
pub struct Drivers {
    connections: Connections,
    /// When the first driver was found to have ended.
    first_end: Option<Instant>,
    /// Stops all drivers.
    stop: Arc<AtomicBool>,
    is_closed: bool,
}

impl Drivers {
    /// Starts a driver for each of `lives`, which are in the order of the graph; none if the caller runs them. The connections
    /// are [`with_drivers`](Connections::with_drivers); `stop` stops the drivers.
    ///
    /// # Errors
    /// [`BackendError`] if one cannot be started, or a clock has none.
    pub fn start(
        connections: Connections,
        graph: &Graph,
        lives: Vec<Player>,
        stop: &Arc<AtomicBool>,
    ) -> Result<Self, BackendError> {
        let mut drivers = Self { connections, first_end: None, stop: Arc::clone(stop), is_closed: false };
        let lives: Lives = graph.drivers().into_iter().zip(lives).collect();
        if !lives.is_empty() {
            drivers.connections.drive(graph, lives)?;
        }
        Ok(drivers)
    }

    fn all(&self) -> impl Iterator<Item = Connected> {
        self.connections.drivers()
    }

    /// What the system refused at the start, without repetition.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for note in self.connections.status().into_iter().flat_map(|known| known.refused) {
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        notes
    }

    /// True if the run is over or, with `stopping`, if nothing can end it: its soundcard is gone.
    pub fn is_finished(&self, stopping: bool) -> bool {
        self.all().all(|driver| match driver.state {
            State::Finished => true,
            State::Waiting => stopping,
            State::Running => false,
        })
    }

    /// True if one driver has ended while others still run; they must then be stopped.
    pub fn is_partly_finished(&mut self) -> bool {
        if self.first_end.is_none() && self.all().any(|driver| driver.state == State::Finished) {
            self.first_end = Some(Instant::now());
        }
        self.first_end.is_some_and(|since| since.elapsed() > MAX_END_DELAY)
    }

    /// True if the soundcard of a driver is gone and may come back.
    pub fn is_waiting(&self) -> bool {
        self.all().any(|driver| driver.state == State::Waiting)
    }

    /// Waits for the end of the run. Returns its real-time sides in the order of the graph.
    ///
    /// # Errors
    /// [`BackendError::Lost`] if a driver's thread panicked.
    pub fn join(&mut self) -> Result<Vec<Player>, BackendError> {
        self.is_closed = true;
        let lives = self.connections.close()?;
        Ok(lives.into_iter().map(|(_, live)| live).collect())
    }

    /// Stops all drivers and waits until none drives any device.
    pub fn stop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // A browser has no drivers, and no system clock.
        let mut since = None;
        while !self.is_finished(true) && since.get_or_insert_with(Instant::now).elapsed() < STOP_TIMEOUT {
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
