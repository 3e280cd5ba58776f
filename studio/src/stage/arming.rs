//! Arming of real actuators, which receive zeros until the page that owns the graph arms them. The gate is part of the
//! engine ([`ArmSwitch`](haptograph_engine::run::ArmSwitch)) and acts where the device is driven.

use super::super::actuators::driven;
use super::super::error::StageError;
use super::super::run_cycle::State;
use super::Stage;
use haptograph_engine::run::Session;
use haptograph_live::soundcard::output_sinks;
use haptograph_live::{Connected, Role};

/// The gain behind the limits with which arming begins: -20 dB.
pub(crate) const FIRST_GAIN: f64 = 0.1;

impl Stage {
    /// Arms the real actuators, with [`FIRST_GAIN`].
    ///
    /// # Errors
    /// [`StageError`] if the graph drives no real device.
    pub(crate) fn arm(&mut self) -> Result<(), StageError> {
        let refused = |why: &str| Err(StageError::Other(format!("cannot arm: {why}")));
        if !self.host.can_drive || driven(&self.loaded.graph).is_empty() {
            return refused("the graph drives no real device");
        }
        if self.cycle.state != State::Running {
            return refused("the run is stopped; resume it first");
        }
        if self.cycle.replay.is_some() {
            return refused("a replay is running; stop it first");
        }
        if self.clock.as_ref().is_some_and(|clock| clock.drivers.is_waiting()) {
            return refused("the soundcard is not there; plug it in first");
        }
        self.devices.note = None;
        self.devices.switch.arm(FIRST_GAIN);
        Ok(())
    }

    /// The place at which a real device of the run is reached: an address, or the name that the system reports.
    pub(crate) fn place_of(&self, device: &str) -> Option<String> {
        let is_played = output_sinks(&self.loaded.graph).iter().any(|output| output.endpoint == device);
        let reaches = |known: &Connected| match known.role {
            Role::Driver => is_played,
            _ => known.names.iter().any(|name| name == device),
        };
        let status = self.clock.as_ref()?.drivers.status();
        status.into_iter().find(reaches).map(|known| known.hardware)
    }

    /// Takes the real actuators to zero until they are armed again.
    pub(crate) fn disarm(&self) {
        self.devices.switch.disarm();
    }

    /// Disarms if a driven device that sent data falls silent, because the next device at its address may be another
    /// one.
    pub(crate) fn disarm_if_silent(&mut self) {
        let driven = driven(&self.loaded.graph);
        let is_driven = |device: &str| driven.iter().any(|(name, _)| *name == device);
        let inputs = self.session.as_ref().map(Session::live_inputs).unwrap_or_default();
        let heard = inputs
            .into_iter()
            .filter(|input| input.state.is_heard() && is_driven(&input.device))
            .map(|input| input.device);
        let heard: Vec<String> = heard.collect();
        let lost = self.devices.heard.iter().find(|device| !heard.contains(device));
        if let Some(lost) = lost.filter(|_| self.devices.switch.is_armed()) {
            self.devices.note =
                Some(format!("`{lost}` fell silent and was disarmed; arm it again when it answers"));
            self.devices.switch.disarm();
        }
        self.devices.heard = heard;
    }
}
