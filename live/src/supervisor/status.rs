//! The present state of a live run.

use super::Supervisor;
use crate::backend::{Connected, Counts, Role};
use haptograph_engine::run::{ActuatorLevel, InputStatus, Meters, RingReport};
use haptograph_nodes::network::link::Counts as PacketCounts;
use std::time::Instant;

/// The present state of a live run.
#[derive(Debug)]
#[non_exhaustive]
pub struct Status {
    /// Time since the start, s.
    pub seconds: f64,
    /// Timing of each driver, by name.
    pub drivers: Vec<(String, Meters)>,
    /// Soundcard streams that drive the graph or are listened to, and their counts.
    pub streams: Vec<(Connected, Counts)>,
    /// Rings between drivers, and from soundcard inputs to the graph.
    pub rings: Vec<RingReport>,
    /// Level of each actuator, and its peak since the last call.
    pub actuators: Vec<ActuatorLevel>,
    /// Live inputs.
    pub inputs: Vec<InputNow>,
    /// The inputs whose silence was reported and lasts.
    pub silent: Vec<String>,
    /// The last setting, and who set it.
    pub last_set: Option<String>,
}

/// The present state of a live input.
#[derive(Debug)]
#[non_exhaustive]
pub struct InputNow {
    /// State of the input, and the actuators that depend on it.
    pub status: InputStatus,
    /// Duration of its silence beyond its timeout, s.
    pub silent_s: f64,
    /// Address, path or port at which the input is read.
    pub place: Option<String>,
    /// Counts of its packets or events.
    pub packets: Option<PacketCounts>,
    /// OSC addresses of messages that no device listens to, with the number of messages.
    pub unclaimed: Vec<(String, u64)>,
}

impl Supervisor {
    /// The present state of the run.
    pub fn status(&mut self) -> Status {
        let now = Instant::now();
        let drivers = self.session.poll().into_iter();
        let drivers = drivers.map(|(name, meters)| (name.to_owned(), meters.clone())).collect();
        let roles = [Role::Driver, Role::Input].into_iter();
        let mut packets: Vec<_> = self.drivers.packets().collect();
        let input = |status: InputStatus| {
            let counted = packets.iter().position(|(device, ..)| *device == status.device);
            let counted = counted.map(|place| packets.swap_remove(place));
            let silent = self.record.silence.silent_for(&status.device, now);
            InputNow {
                silent_s: silent.map_or(0.0, |lasts| lasts.as_secs_f64()),
                place: self.drivers.place(&status.device),
                packets: counted.as_ref().map(|(_, packets, _)| *packets),
                unclaimed: counted.map_or_else(Vec::new, |(.., unclaimed)| unclaimed),
                status,
            }
        };
        Status {
            seconds: now.saturating_duration_since(self.record.start).as_secs_f64(),
            drivers,
            streams: roles.flat_map(|role| self.drivers.counted(role)).collect(),
            rings: self.session.rings().chain(self.drivers.rings()).collect(),
            actuators: self.session.actuator_levels(),
            inputs: self.session.live_inputs().into_iter().map(input).collect(),
            silent: self.record.silence.silent().map(str::to_owned).collect(),
            last_set: self.record.history.last(),
        }
    }
}
