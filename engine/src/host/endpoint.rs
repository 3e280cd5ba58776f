//! The device of a host endpoint: it reads the caller's queues and queues driven frames for the caller.

use super::queue::{Due, Queue};
use crate::device::{Channel, Device, DeviceKind, DeviceSpec};
use crate::node::{BuildContext, BuildError};
use crate::silence::{InputCell, InputState, LiveInput, OnSilence};
use haptograph_signal::time::Rate;
use haptograph_signal::units::Milliseconds;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Capacity of a queue, s.
const QUEUE_S: f64 = 1.0;
/// Smallest capacity of a queue, frames.
const LEAST_FRAMES: usize = 1024;

crate::settings! {
    /// An endpoint whose inputs the calling program writes and whose outputs it reads.
    pub struct HostSettings {
        /// Time without a new value after which the endpoint counts as silent, ms.
        timeout_ms: Milliseconds = Milliseconds(100.0), in 1.0..=1e9;
        /// Effect of its silence on the actuators that depend on it.
        on_silence: OnSilence = OnSilence::Zero;
    }
}

/// An endpoint of the calling program.
pub struct Host;

impl DeviceKind for Host {
    type Settings = HostSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "Host",
        doc: "The program that embeds the graph. It writes the channels that nodes read and reads the channels that nodes drive. Has the channels of \
              the nodes that are bound to it.",
        source: "",
        simulated: false,
        senses: &[],
        drives: &[],
        example: r#""stylus": Host(timeout_ms: 100)"#,
    };

    fn build(settings: HostSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        let input = LiveInput {
            cell: Arc::new(InputCell::default()),
            holds: settings.on_silence == OnSilence::Hold,
            timeout_s: settings.timeout_ms.si(),
        };
        Ok(Box::new(HostEndpoint {
            rate: cx.rate,
            timeout_ticks: (input.timeout_s * cx.rate.hz()).ceil() as u64,
            input,
            senses: Vec::new(),
            drives: Vec::new(),
            tick: 0,
            age: 0,
            is_heard: false,
            playing: Arc::default(),
        }))
    }
}

/// A channel and its queue, shared with the caller's handle.
#[derive(Debug, Clone)]
pub(super) struct HostChannel {
    pub channel: Channel,
    pub queue: Arc<Queue>,
}

/// The device of a host endpoint. Copies share their queues: only one of them runs.
#[derive(Debug, Clone)]
pub(crate) struct HostEndpoint {
    pub(super) rate: Rate,
    timeout_ticks: u64,
    input: LiveInput,
    /// Each sensed channel and its present value.
    pub(super) senses: Vec<(HostChannel, Box<[f64]>)>,
    pub(super) drives: Vec<HostChannel>,
    tick: u64,
    /// Ticks since the last new value.
    age: u64,
    is_heard: bool,
    /// True while a player runs it.
    pub(super) playing: Arc<AtomicBool>,
}

impl HostEndpoint {
    fn take(&mut self) {
        let mut came = false;
        for (sensed, value) in &mut self.senses {
            came |= sensed.queue.take_due(self.tick, value);
        }
        self.is_heard |= came;
        self.age = if came { 0 } else { self.age.saturating_add(1) };
        self.input.cell.set(match () {
            () if !self.is_heard => InputState::Never,
            () if self.age > self.timeout_ticks => InputState::Silent,
            () => InputState::Heard,
        });
    }
}

impl Device for HostEndpoint {
    fn connect(&mut self, senses: &[Channel], drives: &[Channel]) {
        let frames = ((QUEUE_S * self.rate.hz()) as usize).max(LEAST_FRAMES);
        let queued = |channel: &Channel| HostChannel {
            channel: *channel,
            queue: Arc::new(Queue::new(channel.kind.width(), frames)),
        };
        let sensed = |channel: &Channel| (queued(channel), channel.kind.neutral().collect());
        self.senses = senses.iter().map(sensed).collect();
        self.drives = drives.iter().map(queued).collect();
    }

    fn advance(&mut self) {
        self.tick += 1;
        self.take();
    }

    fn begin(&mut self) {
        // `advance` is not called for tick 0: values queued before it are taken here.
        if !self.is_heard {
            self.take();
        }
    }

    fn read(&mut self, channel: usize, frame: &mut [f64]) {
        if let Some((_, value)) = self.senses.get(channel) {
            frame.iter_mut().zip(value).for_each(|(component, value)| *component = *value);
        }
    }

    fn write(&mut self, channel: usize, frame: &[f64]) {
        if let Some(driven) = self.drives.get(channel)
            && driven.queue.held.load(Ordering::Relaxed)
        {
            driven.queue.put(Due::Next, frame);
        }
    }

    fn live_input(&self) -> Option<LiveInput> {
        (!self.senses.is_empty()).then(|| self.input.clone())
    }
}
