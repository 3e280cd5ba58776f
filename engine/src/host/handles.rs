//! What the caller holds: typed ends of an endpoint's channels.

use super::endpoint::{HostChannel, HostEndpoint};
use super::queue::{Due, Queue};
use crate::device::Channel;
use crate::frame::Kind;
use crate::graph::{Graph, GraphDevice};
use crate::node::Stream;
use crate::settings::closest;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::Rate;
use rtrb::Consumer;
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A frame as the caller has it: numbers in SI units.
pub trait HostFrame: Copy + Default + Send + 'static {
    /// Its shape.
    const KIND: Kind;
    /// Its lanes.
    fn lanes(&self) -> &[f64];
    /// Its lanes, to be filled.
    fn lanes_mut(&mut self) -> &mut [f64];
}

/// One number.
pub type Scalar = f64;
/// Three numbers, x y z.
pub type Vector = [f64; 3];
/// Force x y z (N), then torque x y z (N m).
pub type Wrench = [f64; 6];

impl HostFrame for Scalar {
    const KIND: Kind = Kind::Scalar;
    fn lanes(&self) -> &[f64] {
        std::slice::from_ref(self)
    }
    fn lanes_mut(&mut self) -> &mut [f64] {
        std::slice::from_mut(self)
    }
}

impl HostFrame for Vector {
    const KIND: Kind = Kind::Vector;
    fn lanes(&self) -> &[f64] {
        self
    }
    fn lanes_mut(&mut self) -> &mut [f64] {
        self
    }
}

impl HostFrame for Wrench {
    const KIND: Kind = Kind::Wrench;
    fn lanes(&self) -> &[f64] {
        self
    }
    fn lanes_mut(&mut self) -> &mut [f64] {
        self
    }
}

/// Why there is no such handle, or no player.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum HostError {
    /// The graph has no such channel.
    #[error("the graph has no {what} `{name}`: {known}")]
    Unknown {
        /// What was looked for.
        what: &'static str,
        /// By which name.
        name: String,
        /// What there is, or what was probably meant.
        known: String,
    },
    /// An endpoint has several channels.
    #[error("`{name}` has several channels: say which, `{name}.{}`", channels.join(&format!("`, `{name}.")))]
    Several {
        /// The endpoint.
        name: String,
        /// Its channels.
        channels: Vec<&'static str>,
    },
    /// The channel's frames have another shape.
    #[error("a frame of `{name}` is a {kind}, not a {asked}")]
    Kind {
        /// The channel.
        name: String,
        /// Its shape.
        kind: Kind,
        /// The shape that was asked for.
        asked: Kind,
    },
    /// Somebody has that handle already.
    #[error("`{name}` has been taken: a channel has one handle; drop the other first")]
    Taken {
        /// The channel.
        name: String,
    },
    /// Another player runs the graph.
    #[error(
        "the graph is being played: the queues of `{name}` are for one player; check the document again for another"
    )]
    Playing {
        /// An endpoint.
        name: String,
    },
    /// A player needs a graph with one driver.
    #[error("the graph has {count} drivers ({}), a player is the driver of one", drivers.join(", "))]
    Drivers {
        /// How many.
        count: usize,
        /// Their names.
        drivers: Vec<String>,
    },
    /// No thread for the files.
    #[error("a player cannot be made: {reason}")]
    System {
        /// What the system says.
        reason: String,
    },
}

/// What was given found no room, or was no number; nothing was queued.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Full {
    /// A second's worth of frames waits already: nobody calls [`Player::process`](super::Player::process).
    #[error("the queue is full: nobody processes")]
    Full,
    /// A lane, or the time that it was set for, was infinite or no number.
    #[error("a lane or its time is infinite or no number")]
    NotFinite,
}

/// The caller's end of a channel that nodes read.
#[derive(Debug)]
pub struct Input<V> {
    end: End<V>,
}

/// The caller's end of a channel that nodes drive, or of a probe.
#[derive(Debug)]
pub struct Output<V> {
    name: String,
    quantity: Quantity,
    rate: Rate,
    from: From,
    frame: PhantomData<fn() -> V>,
}

#[derive(Debug)]
enum From {
    Queue(Held),
    Ring(Consumer<f64>),
}

#[derive(Debug)]
struct End<V> {
    name: String,
    quantity: Quantity,
    rate: Rate,
    queue: Held,
    frame: PhantomData<fn() -> V>,
}

/// A queue while its handle is out.
#[derive(Debug)]
struct Held(Arc<Queue>);

impl Drop for Held {
    fn drop(&mut self) {
        self.0.held.store(false, Ordering::Release);
    }
}

impl<V: HostFrame> End<V> {
    fn of(
        name: String,
        (kind, quantity): (Kind, Quantity),
        rate: Rate,
        queue: &Arc<Queue>,
    ) -> Result<Self, HostError> {
        if kind != V::KIND {
            let asked = V::KIND;
            return Err(HostError::Kind { name, kind, asked });
        }
        if queue.held.swap(true, Ordering::AcqRel) {
            return Err(HostError::Taken { name });
        }
        Ok(Self {
            name,
            quantity,
            rate,
            queue: Held(Arc::clone(queue)),
            frame: PhantomData,
        })
    }
}

impl<V: HostFrame> Input<V> {
    /// From the next tick on the channel has this value. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] where it cannot be queued.
    pub fn set(&mut self, value: V) -> Result<(), Full> {
        self.put(Due::Now, value)
    }

    /// From `seconds` of the run on the channel has this value. Values come in the order of their times. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] where it cannot be queued.
    pub fn set_at(&mut self, seconds: f64, value: V) -> Result<(), Full> {
        if !seconds.is_finite() {
            return Err(Full::NotFinite);
        }
        // A time that falls on a tick is that tick's, in spite of the last bit.
        let tick = (seconds.max(0.0) * self.end.rate.hz() - 1e-6).ceil().max(0.0);
        self.put(Due::Tick(tick as u64), value)
    }

    /// The frame of the next tick that has none yet: a signal, frame by frame. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] where it cannot be queued.
    pub fn push(&mut self, value: V) -> Result<(), Full> {
        self.put(Due::Next, value)
    }

    fn put(&mut self, due: Due, value: V) -> Result<(), Full> {
        if !value.lanes().iter().all(|lane| lane.is_finite()) {
            return Err(Full::NotFinite);
        }
        match self.end.queue.0.put(due, value.lanes()) {
            true => Ok(()),
            false => Err(Full::Full),
        }
    }

    /// Frames that wait for their tick.
    pub fn waiting(&self) -> usize {
        self.end.queue.0.len()
    }

    /// Rate of the channel's ticks.
    pub fn rate(&self) -> Rate {
        self.end.rate
    }

    /// What its numbers are.
    pub fn quantity(&self) -> Quantity {
        self.end.quantity
    }

    /// Endpoint and channel.
    pub fn name(&self) -> &str {
        &self.end.name
    }
}

impl<V: HostFrame> Output<V> {
    /// Fills `frames` with the oldest frames that have not been read, and with neutral ones where there are no more; says
    /// how many there were. Real-time safe.
    pub fn read(&mut self, frames: &mut [V]) -> usize {
        let mut count = 0;
        for frame in frames {
            let next = self.take();
            count += usize::from(next.is_some());
            *frame = next.unwrap_or_default();
        }
        count
    }

    /// The next frame that has not been read. Real-time safe.
    pub fn take(&mut self) -> Option<V> {
        let mut frame = V::default();
        match &mut self.from {
            From::Queue(queue) => queue.0.take_if(|_| true, frame.lanes_mut()).map(|_| frame),
            // Whole frames were put in.
            From::Ring(ring) => ring.pop_entire_slice(frame.lanes_mut()).ok().map(|()| frame),
        }
    }

    /// Frames that wait to be read; what comes while a second's worth waits is lost.
    pub fn waiting(&self) -> usize {
        match &self.from {
            From::Queue(queue) => queue.0.len(),
            From::Ring(ring) => ring.slots() / V::KIND.width(),
        }
    }

    /// Rate of its frames.
    pub fn rate(&self) -> Rate {
        self.rate
    }

    /// What its numbers are.
    pub fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// Endpoint and channel, or the probed output.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn of_ring(
        name: &str,
        stream: &Stream,
        ring: &mut Option<Consumer<f64>>,
    ) -> Result<Self, HostError> {
        let name = name.to_owned();
        if stream.kind != V::KIND {
            let (kind, asked) = (stream.kind, V::KIND);
            return Err(HostError::Kind { name, kind, asked });
        }
        let Some(ring) = ring.take() else {
            return Err(HostError::Taken { name });
        };
        Ok(Self {
            name,
            quantity: stream.quantity,
            rate: stream.rate,
            from: From::Ring(ring),
            frame: PhantomData,
        })
    }
}

impl Graph {
    /// The caller's end of a channel that nodes read from a host endpoint: `"stylus.position"`, or `"hand"` where the
    /// endpoint has one channel.
    ///
    /// # Errors
    /// [`HostError`]: there is no such channel, its frames are of another shape, or its handle has been taken.
    pub fn input<V: HostFrame>(&self, name: &str) -> Result<Input<V>, HostError> {
        let senses =
            |endpoint: &HostEndpoint| endpoint.senses.iter().map(|(known, _)| known.clone()).collect();
        let end = self.host_end("host input", name, &senses)?;
        Ok(Input { end })
    }

    /// The caller's end of a channel that nodes drive: what it gets has passed the sink's limits.
    ///
    /// # Errors
    /// As [`Self::input`].
    pub fn output<V: HostFrame>(&self, name: &str) -> Result<Output<V>, HostError> {
        let end: End<V> = self.host_end("host output", name, &|endpoint| endpoint.drives.clone())?;
        // What nobody read is of the handle before.
        while end.queue.0.take_if(|_| true, &mut []).is_some() {}
        Ok(Output {
            name: end.name,
            quantity: end.quantity,
            rate: end.rate,
            from: From::Queue(end.queue),
            frame: PhantomData,
        })
    }

    /// The channels that [`Self::input`] finds, by their full names.
    pub fn host_inputs(&self) -> impl Iterator<Item = (String, Channel)> {
        self.host_channels(|endpoint| endpoint.senses.iter().map(|(known, _)| known.channel).collect())
    }

    /// The channels that [`Self::output`] finds, by their full names.
    pub fn host_outputs(&self) -> impl Iterator<Item = (String, Channel)> {
        self.host_channels(|endpoint| endpoint.drives.iter().map(|known| known.channel).collect())
    }

    fn host_channels(
        &self,
        of: impl Fn(&HostEndpoint) -> Vec<Channel>,
    ) -> impl Iterator<Item = (String, Channel)> {
        let endpoints = self
            .devices()
            .iter()
            .filter_map(move |device| Some((device, of(host(device)?))));
        endpoints.flat_map(|(device, channels)| {
            let named = |channel: Channel| (format!("{}.{}", device.name, channel.name), channel);
            channels.into_iter().map(named)
        })
    }

    fn host_end<V: HostFrame>(
        &self,
        what: &'static str,
        name: &str,
        channels: &dyn Fn(&HostEndpoint) -> Vec<HostChannel>,
    ) -> Result<End<V>, HostError> {
        let (endpoint, channel) = name.split_once('.').map_or((name, None), |(e, c)| (e, Some(c)));
        let mut hosts = self
            .devices()
            .iter()
            .filter_map(|device| Some((device, host(device)?)));
        let found = hosts.find(|(device, _)| device.name == endpoint);
        let known = found.map(|(_, host)| (host.rate, channels(host)));
        let (rate, known) = known.unwrap_or((self.clocks()[0].rate, Vec::new()));
        let chosen = match (channel, known.as_slice()) {
            (Some(channel), known) => known.iter().find(|one| one.channel.name == channel),
            (None, [one]) => Some(one),
            (None, []) => None,
            (None, several) => {
                return Err(HostError::Several {
                    name: name.to_owned(),
                    channels: several.iter().map(|one| one.channel.name).collect(),
                });
            }
        };
        let Some(HostChannel { channel, queue }) = chosen else {
            let all: Vec<String> = match what {
                "host input" => self.host_inputs().map(|(name, _)| name).collect(),
                _ => self.host_outputs().map(|(name, _)| name).collect(),
            };
            return Err(unknown(what, name, &all));
        };
        let full = format!("{endpoint}.{}", channel.name);
        End::of(full, (channel.kind, channel.quantity), rate, queue)
    }
}

/// There is none of this name: what there is.
pub(super) fn unknown(what: &'static str, name: &str, all: &[String]) -> HostError {
    let known = match (closest(name, all.iter().map(String::as_str)), all) {
        (Some(near), _) => format!("did you mean `{near}`?"),
        (None, []) => "it has none; check the graph with `CheckOptions::hosted`".to_owned(),
        (None, all) => format!("it has {}", all.join(", ")),
    };
    let name = name.to_owned();
    HostError::Unknown { what, name, known }
}

pub(super) fn host(device: &GraphDevice) -> Option<&HostEndpoint> {
    device.device().as_any().downcast_ref()
}
