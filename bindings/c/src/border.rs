//! The functions and types of the C header. Their documentation becomes the header's, so it is written for C.
//!
//! Each function converts pointers to references or copies and calls safe code inside a guard that catches panics.
#![allow(unsafe_code, reason = "C pointers and unmangled names")]

mod channel;
mod error;
mod graph;
mod live;
mod memory;
mod player;

pub(crate) use memory::fixed;
use std::ffi::c_char;

/// All C functions, for tests.
#[cfg(test)]
pub mod calls {
    pub use super::{channel::*, error::*, graph::*, live::*, player::*};
}

/// Major version of this interface. A compiled program works with every library of the same major version; before 1 the
/// minor version must match too.
pub const HAPTOGRAPH_VERSION_MAJOR: u32 = 0;
/// Minor version, for additions.
pub const HAPTOGRAPH_VERSION_MINOR: u32 = 1;
/// Patch version, for fixes.
pub const HAPTOGRAPH_VERSION_PATCH: u32 = 0;

/// The shape of a channel whose frames are one number.
pub const HAPTOGRAPH_SCALAR: u32 = 1;
/// The shape of a channel whose frames are three numbers, x y z.
pub const HAPTOGRAPH_VECTOR: u32 = 3;
/// The shape of a channel whose frames are six numbers: force x y z (N), then torque x y z (N m).
pub const HAPTOGRAPH_WRENCH: u32 = 6;
/// The shape of an input of a node `LiveModel`, whose frames are an innovation variance, then coefficients, then zeros.
pub const HAPTOGRAPH_MODEL: u32 = 33;

/// The result of a call. A call that does not return HAPTOGRAPH_STATUS_OK had no effect, unless its comment says otherwise.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Success.
    Ok = 0,
    /// The graph has errors, or it cannot replace the running one: haptograph_last_error_rendered() returns the reasons as
    /// printed on a terminal.
    Graph = 1,
    /// An argument is null, misaligned, not UTF-8, or out of range.
    Argument = 2,
    /// The handle is null, was freed, or was not created by this library.
    Handle = 3,
    /// The handle belongs to another type of object.
    Kind = 4,
    /// Another thread is using this object. Calls never wait.
    Busy = 5,
    /// No item has that name.
    Name = 6,
    /// The number of values does not match the shape of the channel.
    Shape = 7,
    /// A channel can have only one handle, and a graph one player: free the other first.
    Taken = 8,
    /// The queue is full: call haptograph_player_process().
    Full = 9,
    /// A value is NaN or infinite.
    NotFinite = 10,
    /// The run has ended and its actuators are at zero: haptograph_player_state() returns the reason.
    Ended = 11,
    /// The system refused a file, a thread or memory, or 65536 objects exist already.
    System = 12,
    /// An internal error of haptograph. The object can only be freed.
    Panic = 13,
}

/// The state of a run.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// The run is in progress.
    Running = 0,
    /// The run faded out after haptograph_player_stop().
    Stopped = 1,
    /// The run reached its end time or the end of its data.
    Finished = 2,
    /// A node panicked, which is an internal error of haptograph; the actuators went to zero through their limits.
    Panicked = 3,
}

/// How a graph replaced another.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// The graphs differ in live settings at most: the run goes on, and these ramp in 20 ms.
    Settings = 0,
    /// Both graphs run for 10 ms, in which one fades into the other.
    CrossFade = 1,
    /// The old graph fades to zero in 10 ms, then the new one fades in: an actuator changed, or the two cannot run together.
    ThroughZero = 2,
    /// Neither graph has an actuator to fade.
    AtOnce = 3,
}

/// The state of an endpoint that this program feeds.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputState {
    /// It has had no value: its actuators are at zero.
    Never = 0,
    /// Its last value is fresh.
    Heard = 1,
    /// Its last value is older than `timeout_s`.
    Silent = 2,
    /// Its values moved faster than its `fastest_mm_s`, which a `Host` does not have: its own actuators are at zero for a while.
    Jumped = 3,
}

/// A graph, read and checked. All zeros means no graph.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Graph {
    /// Not a pointer.
    pub id: u64,
}

/// The caller's end of a channel that nodes read. All zeros means no input.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Input {
    /// Not a pointer.
    pub id: u64,
}

/// The caller's end of a channel that nodes write, or of a probe. All zeros means no output.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Output {
    /// Not a pointer.
    pub id: u64,
}

/// A run of a graph that the caller clocks. All zeros means no player.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Player {
    /// Not a pointer.
    pub id: u64,
}

/// A setting of a player's node that can be changed during the run. All zeros means no setting.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Setting {
    /// Not a pointer.
    pub id: u64,
}

/// Options for checking a graph. Initialise it with HAPTOGRAPH_GRAPH_OPTIONS, the defaults.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct GraphOptions {
    /// sizeof(haptograph_graph_options).
    pub size: usize,
    /// Parameters in place of the file's, each "NAME=VALUE" as for `haptograph run --set`.
    pub set: *const *const c_char,
    /// Number of entries.
    pub set_count: usize,
    /// The set of endpoints to take devices and defaults of parameters from; null: "simulated". A set that the graph does not
    /// have is an error (HAPTOGRAPH_STATUS_GRAPH, code "E0210").
    pub endpoints: *const c_char,
    /// The endpoints that this program feeds and reads; null: all of them.
    pub hosted: *const *const c_char,
    /// Number of entries in `hosted`. If it is 0 and `hosted` is not null, the endpoints that are Host in the file.
    pub hosted_count: usize,
    /// Whether `seed` replaces the file's seed.
    pub has_seed: u32,
    /// The seed of all random streams.
    pub seed: u64,
}

/// Options for a run. Initialise it with HAPTOGRAPH_PLAY_OPTIONS, the defaults.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct PlayOptions {
    /// sizeof(haptograph_play_options).
    pub size: usize,
    /// Not 0: the actuators are cold. 0: the run assumes that they are as warm as their limits allow.
    pub rested: u32,
    /// Maximum driver frames of a block, up to 65536; 0: the default. The samples do not depend on it.
    pub block: u32,
    /// Duration of the run, s; 0: no end.
    pub seconds: f64,
    /// The folder for the graph's file sinks, which must exist; null: they write nothing.
    pub folder: *const c_char,
    /// Outputs of nodes to probe, before any limiter: "texture.output".
    pub probes: *const *const c_char,
    /// Number of entries.
    pub probe_count: usize,
}

/// A channel of a graph that this program feeds or reads.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Channel {
    /// Endpoint and channel, "stylus.position"; longer names are truncated.
    pub name: [c_char; 128],
    /// The unit of its numbers, SI.
    pub unit: [c_char; 32],
    /// HAPTOGRAPH_SCALAR, HAPTOGRAPH_VECTOR, HAPTOGRAPH_WRENCH, HAPTOGRAPH_MODEL.
    pub components: u32,
}

/// A live setting of a player.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct LiveSetting {
    /// Node and setting, "out.gain", for haptograph_player_setting(); longer names are truncated.
    pub name: [c_char; 128],
    /// The unit of the numbers, as in graph files ("mm/s", UTF-8); empty if there is none.
    pub unit: [c_char; 32],
    /// The value set last, or that of the graph.
    pub value: f64,
    /// The smallest value that can be set; -INFINITY if there is no limit.
    pub min: f64,
    /// The largest value that can be set; INFINITY if there is no limit.
    pub max: f64,
    /// Not 0: only whole numbers have a meaning, and the setting jumps to them.
    pub whole: u32,
}

/// An endpoint whose silence acts on actuators.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct LiveInput {
    /// The endpoint, "stylus"; longer names are truncated.
    pub endpoint: [c_char; 128],
    /// Whether values arrive.
    pub state: InputState,
    /// Not 0: its actuators continue while it is silent.
    pub holds: u32,
    /// Time without a new value after which it is silent, s of the run.
    pub timeout_s: f64,
    /// Number of actuators that depend on it: haptograph_player_actuators() lists them.
    pub actuators: u32,
    /// Number of them that are held at zero, or fade there, because this or another of their inputs is silent.
    pub closed: u32,
}

/// An actuator that depends on a live input.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Actuator {
    /// The node that drives it, "out"; longer names are truncated.
    pub name: [c_char; 128],
    /// The unit of `delivered`, `peak` and `continuous`, SI.
    pub unit: [c_char; 32],
    /// Largest magnitude over the axes of its last output.
    pub delivered: f64,
    /// Largest magnitude that its limit allows at any time, Euclidean for a vector.
    pub peak: f64,
    /// Largest root mean square of the magnitude that its limit allows.
    pub continuous: f64,
    /// Not 0: a silent input closes its gate: the output fades to zero in 10 ms, or is there.
    pub closed: u32,
    /// Not 0: it is closed and its output is zero.
    pub at_zero: u32,
}

/// The outcome of a run.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub struct Outcome {
    /// Number of driver frames.
    pub frames: u64,
    /// Duration in seconds.
    pub seconds: f64,
    /// Ticks at which an actuator received NaN or infinity; its output was forced to zero.
    pub not_finite_ticks: u64,
    /// Numbers missing from files because the disk was too slow.
    pub lost_numbers: u64,
    /// Number of files that could not be written; haptograph_last_error_message() names them and the reason.
    pub failed_files: u32,
    /// Whether a node panicked.
    pub panicked: u32,
}
