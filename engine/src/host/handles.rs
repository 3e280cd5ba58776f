//! Typed handles of the channels of host endpoints.

use super::any::{About, AnyInput, AnyOutput};
use super::endpoint::{HostChannel, HostEndpoint};
use super::queue::Queue;
use crate::device::Channel;
use crate::frame::{Kind, Scalar, Vector, Wrench};
use crate::graph::{Graph, GraphDevice};
use crate::node::OfflineOnly;
use crate::settings::closest;
use std::marker::PhantomData;
use std::ops::Deref;
use std::sync::Arc;

/// A frame of the caller, in SI units.
pub trait HostFrame: Copy + Default + Send + 'static {
    /// Kind of the frame.
    const KIND: Kind;
    /// The components.
    fn components(&self) -> &[f64];
    /// The components, mutable.
    fn components_mut(&mut self) -> &mut [f64];
}

impl HostFrame for Scalar {
    const KIND: Kind = Kind::SCALAR;
    fn components(&self) -> &[f64] {
        std::slice::from_ref(self)
    }
    fn components_mut(&mut self) -> &mut [f64] {
        std::slice::from_mut(self)
    }
}

impl HostFrame for Vector {
    const KIND: Kind = Kind::VECTOR;
    fn components(&self) -> &[f64] {
        self
    }
    fn components_mut(&mut self) -> &mut [f64] {
        self
    }
}

impl HostFrame for Wrench {
    const KIND: Kind = Kind::WRENCH;
    fn components(&self) -> &[f64] {
        self
    }
    fn components_mut(&mut self) -> &mut [f64] {
        self
    }
}

/// Error of a handle or player.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum HostError {
    /// The graph has no such channel.
    #[error("the graph has no {what} `{name}`: {known}")]
    Unknown {
        /// `host input`, `host output`, `probe` or `output`.
        what: &'static str,
        /// The unknown name.
        name: String,
        /// The existing names, or the closest one.
        known: String,
    },
    /// The name does not select a channel of the endpoint.
    #[error("`{name}` has several channels; choose one: `{name}.{}`", channels.join(&format!("`, `{name}.")))]
    Several {
        /// The endpoint.
        name: String,
        /// The channels.
        channels: Vec<&'static str>,
    },
    /// The channel's frames are of another kind.
    #[error("a frame of `{name}` is a {kind}, not a {asked}")]
    Kind {
        /// The channel.
        name: String,
        /// The kind.
        kind: Kind,
        /// The requested kind.
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
        /// A host endpoint of the graph.
        name: String,
    },
    /// A player needs a graph with one driver.
    #[error("the graph has {count} drivers ({}); a player can drive only one", drivers.join(", "))]
    Drivers {
        /// Number of drivers.
        count: usize,
        /// The names.
        drivers: Vec<String>,
    },
    /// A node is a script.
    #[error(transparent)]
    OfflineOnly(#[from] OfflineOnly),
    /// A file or the writer thread could not be opened.
    #[error("cannot make a player: {reason}")]
    System {
        /// Error of the system.
        reason: String,
    },
}

/// Reason why a frame was not queued.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Full {
    /// The queue holds a second of frames: [`Player::process`](crate::run::Player::process) is not called.
    #[error("the queue is full: `Player::process` is not called")]
    Full,
    /// A component or the time is NaN or infinite.
    #[error("a component or its time is NaN or infinite")]
    NotFinite,
    /// The number of components is not that of the channel's kind.
    #[error("a frame of this channel has another number of components")]
    Shape,
}

/// Handle of a channel that nodes read.
#[derive(Debug)]
pub struct Input<V> {
    any: AnyInput,
    frame: PhantomData<fn(V)>,
}

/// Handle of a channel that nodes drive, or of a probe.
#[derive(Debug)]
pub struct Output<V> {
    any: AnyOutput,
    frame: PhantomData<fn() -> V>,
}

impl<V: HostFrame> Input<V> {
    /// Sets the value of the channel from the next tick on. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] if it cannot be queued.
    pub fn set(&mut self, value: V) -> Result<(), Full> {
        self.any.set(value.components())
    }

    /// Sets the value from `seconds` of the run on. Call it in the order of times. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] if it cannot be queued.
    pub fn set_at(&mut self, seconds: f64, value: V) -> Result<(), Full> {
        self.any.set_at(seconds, value.components())
    }

    /// Queues the frame of the next tick that has none yet. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] if it cannot be queued.
    pub fn push(&mut self, value: V) -> Result<(), Full> {
        self.any.push(value.components())
    }

    /// Converts it to an untyped handle.
    pub fn into_any(self) -> AnyInput {
        self.any
    }
}

/// Its name, kind, quantity, rate and number of waiting frames.
impl<V> Deref for Input<V> {
    type Target = AnyInput;

    fn deref(&self) -> &AnyInput {
        &self.any
    }
}

impl<V: HostFrame> Output<V> {
    /// Fills `frames` with the oldest unread frames, and the rest with zeros. Returns the number of unread frames.
    /// Real-time safe.
    pub fn read(&mut self, frames: &mut [V]) -> usize {
        let mut count = 0;
        for frame in frames {
            let next = self.take();
            count += usize::from(next.is_some());
            *frame = next.unwrap_or_default();
        }
        count
    }

    /// Takes the oldest unread frame. Real-time safe.
    pub fn take(&mut self) -> Option<V> {
        let mut frame = V::default();
        self.any.take(frame.components_mut()).then_some(frame)
    }

    /// Converts it to an untyped handle.
    pub fn into_any(self) -> AnyOutput {
        self.any
    }

    pub(super) fn of(any: AnyOutput) -> Self {
        Self { any, frame: PhantomData }
    }
}

/// Its name, kind, quantity, rate and number of unread frames.
impl<V> Deref for Output<V> {
    type Target = AnyOutput;

    fn deref(&self) -> &AnyOutput {
        &self.any
    }
}

impl Graph {
    /// Takes the handle of a channel that nodes read: `"stylus.position"`, or `"hand"` if the endpoint has one channel.
    ///
    /// # Errors
    /// [`HostError`] if there is no such channel, its frames are of another kind, or its handle has been taken.
    pub fn input<V: HostFrame>(&self, name: &str) -> Result<Input<V>, HostError> {
        let (about, queue) = self.host_input(name)?;
        about.expect(V::KIND)?;
        Ok(Input { any: AnyInput::new(about, &queue)?, frame: PhantomData })
    }

    /// As [`input`](Self::input), for a channel of any kind.
    ///
    /// # Errors
    /// [`HostError`] if there is no such channel, or its handle has been taken.
    pub fn any_input(&self, name: &str) -> Result<AnyInput, HostError> {
        let (about, queue) = self.host_input(name)?;
        AnyInput::new(about, &queue)
    }

    /// Takes the handle of a channel that nodes drive. Its frames have passed the sink's limiter.
    ///
    /// # Errors
    /// As [`Self::input`].
    pub fn output<V: HostFrame>(&self, name: &str) -> Result<Output<V>, HostError> {
        let (about, queue) = self.host_output(name)?;
        about.expect(V::KIND)?;
        AnyOutput::of_queue(about, &queue).map(Output::of)
    }

    /// As [`output`](Self::output), for a channel of any kind.
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

    /// The channels that [`Self::input`] accepts, by full name.
    pub fn host_inputs(&self) -> impl Iterator<Item = (String, Channel)> {
        self.host_channels(|endpoint| endpoint.senses.iter().map(|(known, _)| known.channel).collect())
    }

    /// The channels that [`Self::output`] accepts, by full name.
    pub fn host_outputs(&self) -> impl Iterator<Item = (String, Channel)> {
        self.host_channels(|endpoint| endpoint.drives.iter().map(|known| known.channel).collect())
    }

    fn host_channels(
        &self,
        of: impl Fn(&HostEndpoint) -> Vec<Channel>,
    ) -> impl Iterator<Item = (String, Channel)> {
        let endpoints = self.devices().iter().filter_map(move |device| Some((device, of(host(device)?))));
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
        let mut hosts = self.devices().iter().filter_map(|device| Some((device, host(device)?)));
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
        Ok((about, queue.get()))
    }
}

/// Error for an unknown name, with the closest name or all names.
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
