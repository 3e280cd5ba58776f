//! The dataflow engine of haptograph: it reads documents, checks them into graphs, lays graphs out as plans and runs
//! plans.
//!
//! ```text
//! text -> Document -> Graph -> Plan -> Run -> sinks
//! ```
//! Each arrow is one function. Each noun is one type that only the arrow before it can make. The engine contains no
//! haptics: `haptograph-nodes` registers the kinds of nodes, devices and frames.

#![cfg_attr(not(test), warn(unreachable_pub))]

pub mod bridges;
pub mod device;
pub mod diagnostic;
pub mod document;
pub mod formula;
pub mod frame;
pub mod graph;
pub(crate) mod histogram;
pub mod host;
mod io;
pub mod limiter;
pub mod node;
mod node_id;
pub mod plan;
pub mod registry;
pub mod run;
mod scripted;
pub mod settings;
pub mod silence;
pub mod testing;
