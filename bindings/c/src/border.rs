//! What C calls and sees. The documentation here is the header's, so it speaks of C.
//!
//! Each function turns pointers into references or copies and calls safe code, inside of a guard that ends panics.
#![allow(unsafe_code, reason = "C has pointers, and its names are not mangled")]

mod channel;
mod error;
mod graph;
mod memory;
mod player;

use std::ffi::c_char;

/// All calls, for tests.
#[cfg(test)]
pub mod calls {
    pub use super::{channel::*, error::*, graph::*, player::*};
}

/// Major version of this interface. Programs that were compiled with one work with every library of the same; before 1
/// the minor version counts as well.
pub const HAPTOGRAPH_VERSION_MAJOR: u32 = 0;
/// Minor version: what was added.
pub const HAPTOGRAPH_VERSION_MINOR: u32 = 1;
/// Patch version: what was mended.
pub const HAPTOGRAPH_VERSION_PATCH: u32 = 0;

/// The shape of a channel whose frames are one number.
pub const HAPTOGRAPH_SCALAR: u32 = 1;
/// The shape of a channel whose frames are three numbers, x y z.
pub const HAPTOGRAPH_VECTOR: u32 = 3;
/// The shape of a channel whose frames are six numbers: force x y z (N), then torque x y z (N m).
pub const HAPTOGRAPH_WRENCH: u32 = 6;

/// How a call ended. A call that does not end in HAPTOGRAPH_STATUS_OK has done nothing, unless it says otherwise.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Done.
    Ok = 0,
    /// The graph has errors: haptograph_last_error_rendered() shows them as on a terminal.
    Graph = 1,
    /// An argument is null, misaligned, no UTF-8, or a value that the call does not take.
    Argument = 2,
    /// The handle is null, was freed, or was never given out by this library.
    Handle = 3,
    /// The handle is of another kind of object.
    Kind = 4,
    /// Another thread is inside this object. Nobody ever waits.
    Busy = 5,
    /// There is nothing of that name.
    Name = 6,
    /// The number of values does not fit the shape of the channel.
    Shape = 7,
    /// A channel has one handle, and a graph one player: free the other first.
    Taken = 8,
    /// The queue is full: nobody processes.
    Full = 9,
    /// A value is NaN or infinite.
    NotFinite = 10,
    /// The run has ended, its actuators are at zero: haptograph_player_state() says why.
    Ended = 11,
    /// The system refused a file, a thread or memory, or 65536 objects are there already.
    System = 12,
    /// A fault of haptograph. The object is good for nothing but to be freed.
    Panic = 13,
}

/// What a run is doing.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// It runs.
    Running = 0,
    /// It faded out after haptograph_player_stop().
    Stopped = 1,
    /// Its time, or its data, are over.
    Finished = 2,
    /// A node panicked, which is a fault of haptograph; the actuators were taken to zero through their limits.
    Panicked = 3,
}

/// A graph, read and checked. All zeros is no graph.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Graph {
    /// Not a pointer.
    pub id: u64,
}

/// The caller's end of a channel that nodes read. All zeros is no input.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Input {
    /// Not a pointer.
    pub id: u64,
}

/// The caller's end of a channel that nodes drive, or of a probe. All zeros is no output.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Output {
    /// Not a pointer.
    pub id: u64,
}

/// A run of a graph whose clock is the caller. All zeros is no player.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Player {
    /// Not a pointer.
    pub id: u64,
}

/// A setting of a node of a player that can be turned while it runs. All zeros is no setting.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Setting {
    /// Not a pointer.
    pub id: u64,
}

/// How a graph is checked. Begin with HAPTOGRAPH_GRAPH_OPTIONS, which says nothing.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct GraphOptions {
    /// sizeof(haptograph_graph_options).
    pub size: usize,
    /// Parameters in place of the file's, each "NAME=VALUE" as for `haptograph run --set`.
    pub set: *const *const c_char,
    /// How many.
    pub set_count: usize,
    /// The set of endpoints to take devices from; null: "simulated".
    pub endpoints: *const c_char,
    /// The endpoints that this program feeds and hears; null: all of them.
    pub hosted: *const *const c_char,
    /// How many. Where `hosted` is not null but this is 0, those that are written as Host in the file.
    pub hosted_count: usize,
    /// Is `seed` to take the place of the file's?
    pub has_seed: u32,
    /// The seed of all random streams.
    pub seed: u64,
}

/// How a graph is played. Begin with HAPTOGRAPH_PLAY_OPTIONS, which says nothing.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct PlayOptions {
    /// sizeof(haptograph_play_options).
    pub size: usize,
    /// Are the actuators known to be cold? Unless this is not 0, they begin as warm as their limits allow.
    pub rested: u32,
    /// Driver frames of a block at most, up to 65536; 0: the default. The samples do not depend on it.
    pub block: u32,
    /// How long the run lasts; 0: as long as it is processed.
    pub seconds: f64,
    /// The folder that the graph's file sinks write in, which has to be there; null: they write nothing.
    pub folder: *const c_char,
    /// Outputs of nodes whose frames are wanted as they are, past no limiter: "texture.output".
    pub probes: *const *const c_char,
    /// How many.
    pub probe_count: usize,
}

/// A channel of a graph that is the caller's.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Channel {
    /// Endpoint and channel, "stylus.position"; what is longer is cut.
    pub name: [c_char; 128],
    /// The unit of its numbers, SI.
    pub unit: [c_char; 32],
    /// HAPTOGRAPH_SCALAR, HAPTOGRAPH_VECTOR, HAPTOGRAPH_WRENCH.
    pub components: u32,
}

/// What a run did.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub struct Outcome {
    /// Driver frames.
    pub frames: u64,
    /// The same in seconds.
    pub seconds: f64,
    /// Ticks at which an actuator was given NaN or infinity, and got zero.
    pub not_finite_ticks: u64,
    /// Numbers for files that the disk was too slow for.
    pub lost_numbers: u64,
    /// Files that could not be written; haptograph_last_error_message() says which and why.
    pub failed_files: u32,
    /// Did a node panic?
    pub panicked: u32,
}
