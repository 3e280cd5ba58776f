//! The latest command of a graph to a device, as the thread that reaches the device sends it.

use haptograph_nodes::network::link::{DRIVEN, Link};
use std::time::{Duration, Instant};

/// The latest command, or zeros where the ticks do not renew it.
#[derive(Debug)]
pub(crate) struct LatestCommand {
    /// Force (N), currents of the actuator and of the brake (A).
    pub values: [f64; DRIVEN],
    /// Version of the command, and when it was first seen.
    version: (u64, Option<Instant>),
}

impl LatestCommand {
    /// Commands newer than `version`: a link may hold the last one of an earlier run.
    pub(crate) fn after(version: u64) -> Self {
        Self { values: [0.0; DRIVEN], version: (version, None) }
    }

    /// Takes the latest command; zeros from when the ticks that compute it have stopped for `timeout` until they begin from
    /// zero.
    pub(crate) fn update(&mut self, link: &Link, timeout: Duration) {
        // Read first: a command that is read after an interruption has ended is of zeros, or newer.
        let is_interrupted = link.is_interrupted();
        if let Some((version, values)) = link.driven.look() {
            if version != self.version.0 {
                self.version = (version, Some(Instant::now()));
            }
            self.values = values;
        }
        let (_, since) = self.version;
        let is_late = since.is_none_or(|since| since.elapsed() > timeout);
        if is_late && since.is_some() && self.values != [0.0; DRIVEN] {
            link.interrupt();
        }
        if is_late || is_interrupted {
            self.values = [0.0; DRIVEN];
        }
    }
}
