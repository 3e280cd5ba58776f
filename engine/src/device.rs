//! Devices: real or simulated bodies with state, which sources read and sinks drive.
//!
//! A device ticks on one clock. Tick k is read, compute, write, advance: a source at tick k reads the effect of the
//! outputs up to tick k - 1, so that a loop through a body has one device tick of delay.

use crate::frame::Kind;
use crate::histogram::AgeMeter;
use crate::node::{BuildContext, BuildError};
use crate::settings::{SettingSpec, Settings};
use crate::silence::LiveInput;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::Rate;
use std::any::Any;
use std::sync::Arc;
use std::time::Instant;

/// Specification of a device kind.
#[derive(Debug, Clone, Copy)]
pub struct DeviceSpec {
    /// Name in graph files.
    pub name: &'static str,
    /// Description.
    pub doc: &'static str,
    /// Reference; empty if there is none.
    pub source: &'static str,
    /// True if the device is a simulation. Every result that depends on it is marked.
    pub simulated: bool,
    /// Channels that sources can read.
    pub senses: &'static [Channel],
    /// Channels that sinks can drive.
    pub drives: &'static [Channel],
    /// Example of its declaration, one line of RON.
    pub example: &'static str,
}

/// A signal of a device.
#[derive(Debug, Clone, Copy)]
pub struct Channel {
    /// Name, equal to that of the port of the source or sink.
    pub name: &'static str,
    /// Shape of a frame.
    pub kind: Kind,
    /// Quantity of the components.
    pub quantity: Quantity,
    /// Description.
    pub doc: &'static str,
}

impl Channel {
    /// Makes a channel.
    pub const fn new(name: &'static str, kind: Kind, quantity: Quantity, doc: &'static str) -> Self {
        Self { name, kind, quantity, doc }
    }
}

/// The state of a device. All methods run in ticks, like [`Processor::process`](crate::node::Processor::process).
pub trait Device: CloneDevice + Send + Sync {
    /// Sets the channels that nodes use. Called once, by the check, for host devices ([`DeviceEntry::host`]) only. A
    /// channel's index in these lists is its number.
    fn connect(&mut self, senses: &[Channel], drives: &[Channel]) {
        let _ = (senses, drives);
    }
    /// Advances the body by one tick with the frames written last. Called before `read`, except at tick 0.
    fn advance(&mut self);
    /// Fills one frame of a sensed channel.
    fn read(&mut self, channel: usize, frame: &mut [f64]);
    /// Receives one limited frame of a driven channel.
    fn write(&mut self, channel: usize, frame: &[f64]);
    /// Called before the first frame of a live run: values queued before it count as received.
    fn begin(&mut self) {}
    /// Polls external input. Called when a driver of a live run wakes, before the frames that are due; they use what
    /// has arrived by `now`.
    fn poll(&mut self, now: Instant) {
        let _ = now;
    }
    /// True once after what drives the hardware gave it zeros meanwhile, as after a stall of the ticks: the outputs then begin
    /// from zero again. Called after [`poll`](Self::poll).
    fn take_interruption(&mut self) -> bool {
        false
    }
    /// Delay of its buffers.
    fn latency(&self) -> DeviceLatency {
        DeviceLatency::default()
    }
    /// Group delay of the filters behind a sensed channel, s.
    fn group_delay_s(&self, channel: usize) -> f64 {
        let _ = channel;
        0.0
    }
    /// The device under an endpoint that is lent to the calling program.
    fn body(&self) -> Option<&dyn Device> {
        None
    }
    /// The same, to connect it.
    fn body_mut(&mut self) -> Option<&mut (dyn Device + 'static)> {
        None
    }
    /// Range of the components of a sensed channel, if the device keeps them in one.
    fn range(&self, channel: usize) -> Option<[f64; 2]> {
        let _ = channel;
        None
    }
    /// Largest magnitude that a driven channel can output, in the channel's unit, if it is known. The check lowers
    /// higher limits to it.
    fn max_output_bound(&self, channel: usize) -> Option<f64> {
        let _ = channel;
        None
    }
    /// The samples, if the clock of its hardware drives the run.
    fn playback(&mut self) -> Option<&mut Playback> {
        None
    }
    /// Meter of the age of sensed values when they are read, if it has one.
    fn ages(&self) -> Option<Arc<AgeMeter>> {
        None
    }
    /// State of a device that can fall silent. The device sets its cell in [`advance`](Self::advance).
    fn live_input(&self) -> Option<LiveInput> {
        None
    }
}

/// Samples that wait for the driver whose clock is that of a device's hardware.
#[derive(Debug, Clone)]
pub struct Playback {
    /// Value of a full-scale sample, in the unit of the sink.
    pub full_scale: f64,
    /// Channels of the hardware, counted from 1.
    channels: Box<[u32]>,
    /// Samples relative to full scale; the first `waiting` are new.
    samples: Box<[f64]>,
    waiting: usize,
}

impl Playback {
    /// Makes a buffer for `room` samples for these channels of the hardware, counted from 1.
    pub fn new(full_scale: f64, channels: Vec<u32>, room: usize) -> Self {
        Self {
            full_scale,
            channels: channels.into_boxed_slice(),
            samples: vec![0.0; room].into_boxed_slice(),
            waiting: 0,
        }
    }

    /// The channels, counted from 1.
    pub fn channels(&self) -> &[u32] {
        &self.channels
    }

    /// Adds a sample in the unit of the sink.
    pub fn play(&mut self, given: f64) {
        if self.waiting == self.samples.len() {
            // In an offline run nothing takes the samples.
            self.waiting = 0;
        }
        self.samples[self.waiting] = given * (1.0 / self.full_scale);
        self.waiting += 1;
    }

    /// The oldest untaken samples, at most `most`, relative to full scale, and their channels.
    pub fn waiting(&self, most: usize) -> (&[f64], &[u32]) {
        (&self.samples[..self.waiting.min(most)], &self.channels)
    }

    /// Drops the oldest samples.
    pub fn taken(&mut self, count: usize) {
        self.samples.copy_within(count..self.waiting, 0);
        self.waiting -= count;
    }
}

/// Delay of a device's buffers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DeviceLatency {
    /// From the physical input to the value that is read, s.
    pub sensing_s: f64,
    /// From the value that is written to the physical output, s.
    pub driving_s: f64,
}

/// Cloning and downcasting of devices; implemented for every `Clone` device.
pub trait CloneDevice {
    /// A copy with the same state.
    fn clone_box(&self) -> Box<dyn Device>;
    /// The device for downcasting, by the driver that it belongs to.
    fn as_any(&self) -> &dyn Any;
    /// The device for downcasting, by the driver that it belongs to.
    fn as_any_mut(&mut self) -> &mut dyn Any;
}

impl Clone for Box<dyn Device> {
    fn clone(&self) -> Self {
        (**self).clone_box()
    }
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
    /// Settings of the kind.
    type Settings: Settings + Clone + Send + Sync;
    /// Channels and documentation.
    const SPEC: DeviceSpec;
    /// Builds the body in its initial state. `cx.path` is the endpoint's name, `cx.rate` its clock's.
    ///
    /// # Errors
    /// [`BuildError`] if the settings do not fit each other, the rate, or the files they name.
    fn build(settings: Self::Settings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError>;
}

/// A registered device kind, its types erased.
#[derive(Clone, Copy)]
pub struct DeviceEntry {
    /// Channels and documentation.
    pub spec: &'static DeviceSpec,
    settings: fn() -> &'static [SettingSpec],
    pub(crate) build: DeviceBuild,
    /// True if its channels are those that the graph uses.
    is_host: bool,
}

pub(crate) type DeviceBuild = crate::node::Read<BuildContext, BuiltDevice>;

/// A body and the settings that it was built with.
pub(crate) struct BuiltDevice {
    pub body: Box<dyn Device>,
    pub settings: Arc<dyn Any + Send + Sync>,
}

impl DeviceEntry {
    /// Erases the types of a device kind.
    pub fn of<K: DeviceKind>() -> Self {
        Self {
            spec: &const { K::SPEC },
            settings: K::Settings::specs,
            build: |fields, reading| {
                let settings = K::Settings::take_from(fields, reading)?;
                Some(Box::new(|cx| {
                    Ok(BuiltDevice { settings: Arc::new(settings.clone()), body: K::build(settings, cx)? })
                }))
            },
            is_host: false,
        }
    }

    /// Entry of the endpoints of a program that embeds the graph.
    pub fn host() -> Self {
        let is_host = true;
        Self { is_host, ..Self::of::<crate::host::Host>() }
    }

    /// Lends a device to the calling program: its channels have the program's values while there are some.
    pub(crate) fn lent(body: Box<dyn Device>, rate: Rate) -> Box<dyn Device> {
        crate::host::HostEndpoint::over(body, rate)
    }

    /// True if the device is an endpoint of the program that embeds the graph; its channels are those that the graph
    /// uses.
    pub fn is_host(&self) -> bool {
        self.is_host
    }

    /// The settings.
    pub fn settings(&self) -> Vec<SettingSpec> {
        (self.settings)().to_vec()
    }
}

impl std::fmt::Debug for DeviceEntry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "DeviceEntry({})", self.spec.name)
    }
}
