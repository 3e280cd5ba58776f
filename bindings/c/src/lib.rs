//! The C interface of haptograph. `include/haptograph.h` is made from `border`, which C calls; the rest is safe Rust.
//!
//! - `border`: what C calls, and the only place with `unsafe`. Nothing unwinds out of it.
//! - `table`: handles are numbers of places in a table, with generations: one that was freed, or made up, finds nothing.
//! - `graphs`, `players`: what the calls do. `channels`: handles of channels whose shape is known when they are made.
//! - `failure`: statuses, and the last error of a thread.
//!
//! Architecture invariant: a call that the header marks as real-time takes no lock that it could wait for, does not
//! allocate and does not touch the last error.

mod border;
mod channels;
mod failure;
mod graphs;
mod players;
mod table;

/// Counts what real-time calls must not allocate.
#[cfg(test)]
#[expect(unsafe_code, reason = "an allocator that counts")]
#[path = "../../../nodes/tests/realtime/mod.rs"]
mod realtime;

#[cfg(test)]
#[expect(unsafe_code, reason = "the tests call what C calls")]
mod tests;
