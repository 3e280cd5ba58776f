//! Endpoints that the calling program feeds and hears: a graph inside another program, with no device and no file.
//!
//! A graph that is checked with [`CheckOptions::hosted`](crate::graph::CheckOptions::hosted) has its endpoints bound to
//! the caller's buffers. [`Graph::input`](crate::graph::Graph::input) and [`Graph::output`](crate::graph::Graph::output)
//! give typed handles to their channels, [`Player`] runs the graph in the caller's own callback.
//!
//! # How frames are counted
//! Every channel ticks on the clock of the nodes that read or drive it. A call of [`Player::process`] for n frames of the
//! driver ticks a channel whose clock has 1/384 of the driver's rate in every 384th frame, however the frames are cut into
//! calls. At each tick an input takes what is due: everything that was [set](Input::set) since, or one frame of those
//! [pushed](Input::push), or what was set for [a time](Input::set_at) that has come. Where nothing is due, the last value
//! holds. An output gets one frame a tick.
//!
//! # Silence
//! An endpoint of which no channel took anything for its `timeout_ms` is silent, as any live input: the actuators that
//! depend on it ramp to zero unless `on_silence` is `Hold`, and back when it is heard again. Before it is heard for the
//! first time they stay at zero; an endpoint that was fed before the first call is heard from the first frame on.
//!
//! # Threads
//! Handles and player can each live on a thread of their own. [`Player::process`], [`Input::set`], [`Input::push`] and
//! [`Output::read`] are real-time code: they do not allocate, lock, wait or call the system.

mod any;
mod endpoint;
mod handles;
mod player;
mod queue;

pub use any::{AnyInput, AnyOutput};
pub use endpoint::{Host, HostSettings};
pub use handles::{Full, HostError, HostFrame, Input, Output, Scalar, Vector, Wrench};
pub use player::{PlayOptions, Player, Probes};
