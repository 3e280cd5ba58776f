//! The C interface of haptograph. `include/haptograph.h` is generated from `border`.
//!
//! - `border`: the functions that C calls, and the only module with `unsafe`. No panic leaves it.
//! - `table`: handles are slot numbers with generations. A freed or invented handle finds no object.
//! - `graphs`, `players`, `channels`, `listing`: safe implementations of the calls.
//! - `failure`: statuses, and the last error of each thread.
//!
//! Architecture invariant: a call that the header marks as real-time does not wait for a lock, does not allocate and does
//! not change the last error.

#![cfg_attr(not(test), warn(unreachable_pub))]

/// Public, although nobody in Rust reaches it: the header is generated from its public items.
#[allow(unreachable_pub)]
mod border;
mod channels;
mod failure;
mod graphs;
mod listing;
mod players;
mod table;

/// Counts allocations of real-time calls, which must be none.
#[cfg(test)]
#[expect(unsafe_code, reason = "a counting allocator")]
#[path = "../../../nodes/tests/realtime/mod.rs"]
mod realtime;

#[cfg(test)]
#[expect(unsafe_code, reason = "the tests call the C functions")]
mod tests;
