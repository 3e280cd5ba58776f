//! The device of a host endpoint: it reads the caller's queues and queues driven frames for the caller. Of a lent endpoint
//! it is laid over the device, whose values pass where the caller gives none.

use super::queue::{Due, Queue, Shared};
use crate::device::{Channel, Device, DeviceKind, DeviceLatency, DeviceSpec};
use crate::histogram::AgeMeter;
use crate::node::{BuildContext, BuildError};
use crate::silence::{InputCell, InputState, LiveInput, OnSilence};
use haptograph_signal::time::Rate;
use haptograph_signal::units::Milliseconds;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Capacity of a queue, s.
const QUEUE_S: f64 = 1.0;
/// Smallest capacity of a queue, frames.
const LEAST_FRAMES: usize = 1024;
/// Time without a new value after which a lent endpoint that the program holds is silent, s.
const LENT_TIMEOUT_S: f64 = 0.1;

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
        let timeout_s = input.timeout_s;
        Ok(Box::new(HostEndpoint::new(input, timeout_s, cx.rate, None)))
    }
}

/// A channel and its queue, shared with the caller's handle.
#[derive(Debug, Clone)]
pub(super) struct HostChannel {
    pub channel: Channel,
    pub queue: Shared<Queue>,
}

/// The device of a host endpoint. Copies share their queues: only one of them runs.
#[derive(Clone)]
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
    pub(super) playing: Shared<AtomicBool>,
    /// The device of a lent endpoint.
    body: Option<Box<dyn Device>>,
}

/// True for the value of a channel that the device of a lent endpoint gives: no program queues NaN.
fn is_of_body(value: &[f64]) -> bool {
    value.first().is_some_and(|x| x.is_nan())
}

impl HostEndpoint {
    fn new(input: LiveInput, timeout_s: f64, rate: Rate, body: Option<Box<dyn Device>>) -> Self {
        Self {
            rate,
            timeout_ticks: (timeout_s * rate.hz()).ceil() as u64,
            input,
            senses: Vec::new(),
            drives: Vec::new(),
            tick: 0,
            age: 0,
            is_heard: false,
            playing: Shared::new(AtomicBool::new(false)),
            body,
        }
    }

    /// Lays an endpoint of the calling program over a device.
    pub(crate) fn over(body: Box<dyn Device>, rate: Rate) -> Box<dyn Device> {
        let own = || {
            let cell = InputCell::default();
            cell.set(InputState::Heard);
            LiveInput { cell: Arc::new(cell), holds: false, timeout_s: LENT_TIMEOUT_S }
        };
        let input = body.live_input().unwrap_or_else(own);
        Box::new(Self::new(input, LENT_TIMEOUT_S, rate, Some(body)))
    }

    /// The queues of its channels, in order.
    pub(super) fn queues(&self) -> impl Iterator<Item = &HostChannel> {
        self.senses.iter().map(|(sensed, _)| sensed).chain(&self.drives)
    }

    fn take(&mut self) {
        let mut came = false;
        for (sensed, value) in &mut self.senses {
            came |= sensed.queue.take_due(self.tick, value);
        }
        self.is_heard |= came;
        self.age = if came { 0 } else { self.age.saturating_add(1) };
        let is_lent = self.body.is_some();
        let is_taken = || self.senses.iter().any(|(_, value)| !is_of_body(value));
        if is_lent && !is_taken() {
            // A live device has set its own state.
            if self.body.as_ref().is_some_and(|body| body.live_input().is_none()) {
                self.input.cell.set(InputState::Heard);
            }
            return;
        }
        self.input.cell.set(match () {
            () if !self.is_heard => InputState::Never,
            // What the program holds ends with the program, whatever the device does.
            () if self.age > self.timeout_ticks && is_lent && self.input.holds => InputState::Never,
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
            queue: Shared::new(Queue::new(channel.kind.width(), frames)),
        };
        let is_lent = self.body.is_some();
        let first = |x: f64| if is_lent { f64::NAN } else { x };
        let sensed = |channel: &Channel| (queued(channel), channel.kind.neutral().map(first).collect());
        self.senses = senses.iter().map(sensed).collect();
        self.drives = drives.iter().map(queued).collect();
    }

    fn advance(&mut self) {
        self.tick += 1;
        if let Some(body) = &mut self.body {
            body.advance();
        }
        self.take();
    }

    fn begin(&mut self) {
        if let Some(body) = &mut self.body {
            body.begin();
        }
        // `advance` is not called for tick 0: values queued before it are taken here.
        if !self.is_heard {
            self.take();
        }
    }

    fn read(&mut self, channel: usize, frame: &mut [f64]) {
        let Some((_, value)) = self.senses.get(channel) else { return };
        match &mut self.body {
            Some(body) if is_of_body(value) => body.read(channel, frame),
            // Released where there is no device: nothing.
            _ if is_of_body(value) => frame.fill(0.0),
            _ => frame.iter_mut().zip(value).for_each(|(component, value)| *component = *value),
        }
    }

    fn write(&mut self, channel: usize, frame: &[f64]) {
        if let Some(driven) = self.drives.get(channel)
            && driven.queue.is_held()
        {
            driven.queue.put(Due::Next, frame);
        }
    }

    fn live_input(&self) -> Option<LiveInput> {
        (!self.senses.is_empty()).then(|| self.input.clone())
    }

    fn body(&self) -> Option<&dyn Device> {
        self.body.as_deref()
    }

    fn body_mut(&mut self) -> Option<&mut (dyn Device + 'static)> {
        self.body.as_deref_mut()
    }

    fn poll(&mut self, now: Instant) {
        if let Some(body) = &mut self.body {
            body.poll(now);
        }
    }

    fn latency(&self) -> DeviceLatency {
        self.body().map(Device::latency).unwrap_or_default()
    }

    fn group_delay_s(&self, channel: usize) -> f64 {
        self.body().map_or(0.0, |body| body.group_delay_s(channel))
    }

    fn range(&self, channel: usize) -> Option<[f64; 2]> {
        self.body()?.range(channel)
    }

    fn ages(&self) -> Option<Arc<AgeMeter>> {
        self.body()?.ages()
    }
}
