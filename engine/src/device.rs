//! Devices: bodies with state, real or simulated, that sources read and sinks drive.
//!
//! A device ticks on one clock. Tick k is read, compute, write, advance: a source at tick k sees what the sinks
//! delivered up to tick k - 1, so that a loop through a body always has one device tick of delay.

use crate::frame::Kind;
use crate::histogram::AgeMeter;
use crate::node::{BuildContext, BuildError};
use crate::settings::{SettingSpec, Settings};
use crate::silence::LiveInput;
use haptograph_signal::quantity::Quantity;
use std::any::Any;
use std::sync::Arc;
use std::time::Instant;

/// Everything that is known of a device kind before one is built.
#[derive(Debug, Clone, Copy)]
pub struct DeviceSpec {
    /// As written in a graph file.
    pub name: &'static str,
    /// What it is.
    pub doc: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// Is it a simulation? Then every result that depends on it says so.
    pub simulated: bool,
    /// What sources can read.
    pub senses: &'static [Channel],
    /// What sinks can drive.
    pub drives: &'static [Channel],
    /// A line of RON that declares it.
    pub example: &'static str,
}

/// One signal of a device.
#[derive(Debug, Clone, Copy)]
pub struct Channel {
    /// Matches the port of the source or sink.
    pub name: &'static str,
    /// Shape of a frame.
    pub kind: Kind,
    /// What its numbers are.
    pub quantity: Quantity,
    /// What it is.
    pub doc: &'static str,
}

/// The state of a device. All methods run in ticks, like [`Processor::process`](crate::node::Processor::process).
pub trait Device: CloneDevice + Send + Sync {
    /// Told once, when the graph is checked, which channels nodes are bound to, where the device has those that its graph
    /// asks for ([`DeviceEntry::host`]). From then on a channel's place in these lists is its number.
    fn connect(&mut self, senses: &[Channel], drives: &[Channel]) {
        let _ = (senses, drives);
    }
    /// Moves the body by one tick under what was last written. Called before `read`, except at tick 0.
    fn advance(&mut self);
    /// Fills one frame of a sensed channel.
    fn read(&mut self, channel: usize, frame: &mut [f64]);
    /// Takes one frame of a driven channel, already limited.
    fn write(&mut self, channel: usize, frame: &[f64]);
    /// Called before the first frame of a live run: what was queued before counts as heard.
    fn begin(&mut self) {}
    /// Called when a driver of a live run wakes, before the frames that are due. What has arrived from outside by `now`
    /// is what they go by.
    fn poll(&mut self, now: Instant) {
        let _ = now;
    }
    /// How long what is sensed takes to be read, and what is written to leave it: its buffers.
    fn latency(&self) -> DeviceLatency {
        DeviceLatency::default()
    }
    /// Group delay of the filters behind a sensed channel, s.
    fn group_delay_s(&self, channel: usize) -> f64 {
        let _ = channel;
        0.0
    }
    /// The largest magnitude that a driven channel can be given, in the unit of its drive, if it knows one. No sink may
    /// ask for more.
    fn max_output_bound(&self, channel: usize) -> Option<f64> {
        let _ = channel;
        None
    }
    /// How old what it senses is when it is read, if somebody measures that.
    fn ages(&self) -> Option<Arc<AgeMeter>> {
        None
    }
    /// Whether it is still heard, of a device that can fall silent. It sets its cell in [`advance`](Self::advance).
    fn live_input(&self) -> Option<LiveInput> {
        None
    }
}

/// What the buffers of a device hold back.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DeviceLatency {
    /// From what happens to what is read, s.
    pub sensing_s: f64,
    /// From what is written to what is driven, s.
    pub driving_s: f64,
}

/// Cloning and downcasting of devices; implemented for every `Clone` device.
pub trait CloneDevice {
    /// A copy with the same state.
    fn clone_box(&self) -> Box<dyn Device>;
    /// For the driver that the device belongs to.
    fn as_any(&self) -> &dyn Any;
    /// For the driver that the device belongs to.
    fn as_any_mut(&mut self) -> &mut dyn Any;
}

impl<T: Device + Clone + 'static> CloneDevice for T {
    fn clone_box(&self) -> Box<dyn Device> {
        Box::new(self.clone())
    }
    fn as_any(&self) -> &dyn Any {
        self
    }
    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

/// A kind of device.
pub trait DeviceKind: 'static {
    /// What can be set.
    type Settings: Settings;
    /// Channels and documentation.
    const SPEC: DeviceSpec;
    /// Builds the body in its initial state. `cx.path` is the endpoint's name, `cx.rate` its clock's.
    ///
    /// # Errors
    /// [`BuildError`] where the settings do not fit each other, the rate, or the files they name.
    fn build(settings: Self::Settings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError>;
}

/// A device kind as registered, its types erased.
#[derive(Clone, Copy)]
pub struct DeviceEntry {
    /// Channels and documentation.
    pub spec: &'static DeviceSpec,
    settings: fn() -> Vec<SettingSpec>,
    pub(crate) build: DeviceBuild,
    /// Has it the channels that its graph asks for?
    is_host: bool,
}

pub(crate) type DeviceBuild = crate::node::Read<BuildContext, Box<dyn Device>>;

impl DeviceEntry {
    /// Erases the types of a device kind.
    pub fn of<K: DeviceKind>() -> Self {
        Self {
            spec: &const { K::SPEC },
            settings: K::Settings::specs,
            build: |fields, reading| {
                let settings = K::Settings::take_from(fields, reading)?;
                Some(Box::new(|cx| K::build(settings, cx)))
            },
            is_host: false,
        }
    }

    /// The endpoints of a program that embeds the graph.
    pub fn host() -> Self {
        let is_host = true;
        Self {
            is_host,
            ..Self::of::<crate::host::Host>()
        }
    }

    /// Has it the channels that its graph asks for, and is it fed by the program that embeds the graph?
    pub fn is_host(&self) -> bool {
        self.is_host
    }

    /// Its settings.
    pub fn settings(&self) -> Vec<SettingSpec> {
        (self.settings)()
    }
}

impl std::fmt::Debug for DeviceEntry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "DeviceEntry({})", self.spec.name)
    }
}
