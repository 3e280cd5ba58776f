//! What the caller holds: typed ends of an endpoint's channels.

use super::any::{About, AnyInput, AnyOutput};
use super::endpoint::{HostChannel, HostEndpoint};
use super::queue::Queue;
use crate::device::Channel;
use crate::frame::Kind;
use crate::graph::{Graph, GraphDevice};
use crate::settings::closest;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::Rate;
use std::marker::PhantomData;
use std::sync::Arc;

/// A frame as the caller has it: numbers in SI units.
pub trait HostFrame: Copy + Default + Send + 'static {
    /// Its shape.
    const KIND: Kind;
    /// Its components.
    fn components(&self) -> &[f64];
    /// Its components, to be filled.
    fn components_mut(&mut self) -> &mut [f64];
}

/// One number.
pub type Scalar = f64;
/// Three numbers, x y z.
pub type Vector = [f64; 3];
/// Force x y z (N), then torque x y z (N m).
pub type Wrench = [f64; 6];

impl HostFrame for Scalar {
    const KIND: Kind = Kind::Scalar;
    fn components(&self) -> &[f64] {
        std::slice::from_ref(self)
    }
    fn components_mut(&mut self) -> &mut [f64] {
        std::slice::from_mut(self)
    }
}

impl HostFrame for Vector {
    const KIND: Kind = Kind::Vector;
    fn components(&self) -> &[f64] {
        self
    }
    fn components_mut(&mut self) -> &mut [f64] {
        self
    }
}

impl HostFrame for Wrench {
    const KIND: Kind = Kind::Wrench;
    fn components(&self) -> &[f64] {
        self
    }
    fn components_mut(&mut self) -> &mut [f64] {
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
    #[error("`{name}` has several channels; choose one: `{name}.{}`", channels.join(&format!("`, `{name}.")))]
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
    /// The handle has been taken.
    #[error("`{name}` has been taken: a channel has one handle; drop it first")]
    Taken {
        /// The channel.
        name: String,
    },
    /// Another player runs the graph.
    #[error(
        "another player runs this graph: the queues of `{name}` serve one player; check the document again for a second one"
    )]
    Playing {
        /// An endpoint.
        name: String,
    },
    /// A player needs a graph with one driver.
    #[error("the graph has {count} drivers ({}); a player can drive only one", drivers.join(", "))]
    Drivers {
        /// How many.
        count: usize,
        /// Their names.
        drivers: Vec<String>,
    },
    /// No thread for the files.
    #[error("cannot make a player: {reason}")]
    System {
        /// What the system says.
        reason: String,
    },
}

/// Why a frame was not queued.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Full {
    /// The queue holds a second of frames: [`Player::process`](super::Player::process) is not called.
    #[error("the queue is full: `Player::process` is not called")]
    Full,
    /// A component or the time is NaN or infinite.
    #[error("a component or its time is NaN or infinite")]
    NotFinite,
    /// The number of components is not that of the channel's kind.
    #[error("a frame of this channel has another number of components")]
    Shape,
}

/// The caller's end of a channel that nodes read.
#[derive(Debug)]
pub struct Input<V> {
    any: AnyInput,
    frame: PhantomData<fn(V)>,
}

/// The caller's end of a channel that nodes drive, or of a probe.
#[derive(Debug)]
pub struct Output<V> {
    any: AnyOutput,
    frame: PhantomData<fn() -> V>,
}

impl<V: HostFrame> Input<V> {
    /// From the next tick on the channel has this value. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] where it cannot be queued.
    pub fn set(&mut self, value: V) -> Result<(), Full> {
        self.any.set(value.components())
    }

    /// From `seconds` of the run on the channel has this value. Values come in the order of their times. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] where it cannot be queued.
    pub fn set_at(&mut self, seconds: f64, value: V) -> Result<(), Full> {
        self.any.set_at(seconds, value.components())
    }

    /// The frame of the next tick that has none yet: a signal, frame by frame. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] where it cannot be queued.
    pub fn push(&mut self, value: V) -> Result<(), Full> {
        self.any.push(value.components())
    }

    /// The same without its shape.
    pub fn into_any(self) -> AnyInput {
        self.any
    }

    /// Frames that wait for their tick.
    pub fn waiting(&self) -> usize {
        self.any.waiting()
    }

    /// Rate of the channel's ticks.
    pub fn rate(&self) -> Rate {
        self.any.rate()
    }

    /// What its numbers are.
    pub fn quantity(&self) -> Quantity {
        self.any.quantity()
    }

    /// Endpoint and channel.
    pub fn name(&self) -> &str {
        self.any.name()
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
        self.any.take(frame.components_mut()).then_some(frame)
    }

    /// The same without its shape.
    pub fn into_any(self) -> AnyOutput {
        self.any
    }

    /// Frames that wait to be read; what comes while a second's worth waits is lost.
    pub fn waiting(&self) -> usize {
        self.any.waiting()
    }

    /// Rate of its frames.
    pub fn rate(&self) -> Rate {
        self.any.rate()
    }

    /// What its numbers are.
    pub fn quantity(&self) -> Quantity {
        self.any.quantity()
    }

    /// Endpoint and channel, or the probed output.
    pub fn name(&self) -> &str {
        self.any.name()
    }

    pub(super) fn of(any: AnyOutput) -> Self {
        Self {
            any,
            frame: PhantomData,
        }
    }
}

impl Graph {
    /// The caller's end of a channel that nodes read from a host endpoint: `"stylus.position"`, or `"hand"` where the
    /// endpoint has one channel.
    ///
    /// # Errors
    /// [`HostError`]: there is no such channel, its frames are of another shape, or its handle has been taken.
    pub fn input<V: HostFrame>(&self, name: &str) -> Result<Input<V>, HostError> {
        let (about, queue) = self.host_input(name)?;
        about.expect(V::KIND)?;
        Ok(Input {
            any: AnyInput::new(about, &queue)?,
            frame: PhantomData,
        })
    }

    /// The same for a channel of any shape.
    ///
    /// # Errors
    /// [`HostError`]: there is no such channel, or its handle has been taken.
    pub fn any_input(&self, name: &str) -> Result<AnyInput, HostError> {
        let (about, queue) = self.host_input(name)?;
        AnyInput::new(about, &queue)
    }

    /// The caller's end of a channel that nodes drive: what it gets has passed the sink's limits.
    ///
    /// # Errors
    /// As [`Self::input`].
    pub fn output<V: HostFrame>(&self, name: &str) -> Result<Output<V>, HostError> {
        let (about, queue) = self.host_output(name)?;
        about.expect(V::KIND)?;
        AnyOutput::of_queue(about, &queue).map(Output::of)
    }

    /// The same for a channel of any shape.
    ///
    /// # Errors
    /// As [`Self::any_input`].
    pub fn any_output(&self, name: &str) -> Result<AnyOutput, HostError> {
        let (about, queue) = self.host_output(name)?;
        AnyOutput::of_queue(about, &queue)
    }

    fn host_input(&self, name: &str) -> Result<(About, Arc<Queue>), HostError> {
        let senses =
            |endpoint: &HostEndpoint| endpoint.senses.iter().map(|(known, _)| known.clone()).collect();
        self.host_end("host input", name, &senses)
    }

    fn host_output(&self, name: &str) -> Result<(About, Arc<Queue>), HostError> {
        self.host_end("host output", name, &|endpoint| endpoint.drives.clone())
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

    fn host_end(
        &self,
        what: &'static str,
        name: &str,
        channels: &dyn Fn(&HostEndpoint) -> Vec<HostChannel>,
    ) -> Result<(About, Arc<Queue>), HostError> {
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
        let about = About {
            name: format!("{endpoint}.{}", channel.name),
            kind: channel.kind,
            quantity: channel.quantity,
            rate,
        };
        Ok((about, Arc::clone(queue)))
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
