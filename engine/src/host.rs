//! Host endpoints: a graph embedded in another program, without devices and files.
//!
//! [`CheckOptions::hosted`](crate::graph::CheckOptions::hosted) binds the endpoints of a graph to queues of the
//! caller. [`Graph::input`](crate::graph::Graph::input) and [`Graph::output`](crate::graph::Graph::output) give typed
//! handles to their channels; [`Player`](crate::run::Player) runs the graph in the caller's callback.
//!
//! # How frames are counted
//! Every channel ticks on the clock of the nodes that read or drive it. A channel whose clock has 1/384 of the
//! driver's rate ticks in every 384th frame of the driver, however the frames are split into calls of
//! [`Player::process`](crate::run::Player::process). At each tick an input takes the values that are due: all values that were [set](Input::set)
//! since the last tick, or one [pushed](Input::push) frame, or a value set for [a time](Input::set_at) that has come.
//! Otherwise it holds its last value. An output gets one frame per tick.
//!
//! # Silence
//! An endpoint whose channels took no value for `timeout_ms` is silent, like any live input: the actuators that
//! depend on it ramp to zero unless `on_silence` is `Hold`, and back when values arrive. Before the first value they
//! stay at zero. Values queued before the first call count from the first frame on.
//!
//! # Lent endpoints
//! The program may replace what a device senses, channel by channel, for as long as it wants: an endpoint in
//! [`CheckOptions::lent`](crate::graph::CheckOptions::lent) has the values of its device before the first value of the
//! program and after [`AnyInput::release_at`].
//!
//! # Threads
//! Handles and player can be used on different threads. [`Player::process`](crate::run::Player::process), [`Input::set`], [`Input::push`] and
//! [`Output::read`] are real-time code: they do not allocate, lock, wait or make system calls.

//!
//! # Example
//! ```
//! use haptograph_engine::device::DeviceEntry;
//! use haptograph_engine::document::Document;
//! use haptograph_engine::graph::{CheckOptions, check};
//! use haptograph_engine::host::Scalar;
//! use haptograph_engine::run::{Player, SessionOptions};
//! use haptograph_engine::frame;
//! use haptograph_engine::node::{NodeEntry, Port};
//! use haptograph_engine::registry::Registry;
//! use haptograph_engine::settings::NoSettings;
//! use haptograph_signal::quantity::Quantity;
//!
//! haptograph_engine::node! {
//!     /// Reads a pad.
//!     struct Pad(NoSettings) in "mine";
//!     example: r#""finger": Pad(clock: "servo", endpoint: "pad")"#;
//!     out POSITION: frame::Scalar = Port::of(Quantity::LENGTH, "Of the finger, m.");
//! }
//! let mut registry = Registry::new();
//! registry.add(NodeEntry::source::<Pad>()).add_device(DeviceEntry::host());
//!
//! let document = Document::parse("pad.ron", r#"Graph(
//!     format: 1,
//!     clocks: { "servo": Driver(rate_hz: 1000) },
//!     nodes: { "finger": Pad(clock: "servo", endpoint: "pad") },
//!     endpoints: { "simulated": { "pad": Host() } },
//! )"#)?;
//! let graph = check(&document, &registry, &CheckOptions::default())?;
//!
//! let mut position = graph.input::<Scalar>("pad.position")?;
//! let (mut player, mut session) = Player::open(&graph, &SessionOptions::default().probe("finger.position"))?;
//! let mut probe = session.probe::<Scalar>("finger.position")?;
//!
//! position.push(0.01)?;
//! position.push(0.02)?;
//! player.process(3); // In the caller's callback.
//!
//! let mut frames = [0.0; 3];
//! assert_eq!(probe.read(&mut frames), 3);
//! assert_eq!(frames, [0.01, 0.02, 0.02]);
//! session.finish(player);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod any;
mod endpoint;
mod handles;
mod open;
mod queue;

pub use crate::frame::{Scalar, Vector, Wrench};
pub use any::{AnyInput, AnyOutput};
pub(crate) use endpoint::HostEndpoint;
pub use endpoint::{Host, HostSettings};
pub use handles::{Full, HostError, HostFrame, Input, Output};
