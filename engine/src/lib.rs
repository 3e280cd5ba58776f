//! The dataflow engine of haptograph: it reads documents, checks them into graphs, lays graphs out as plans and runs
//! plans.
//!
//! ```text
//! text -> Document -> Graph -> Plan -> Run -> sinks
//! ```
//! Each arrow is one function. Each noun is one type that only the arrow before it can make. The engine contains no
//! haptics: `haptograph-nodes` registers the node and device kinds.

pub mod device;
pub mod diagnostic;
pub mod document;
pub mod formula;
pub mod frame;
pub mod graph;
pub mod histogram;
pub mod host;
mod io;
mod joining;
pub mod limiter;
pub mod node;
pub mod plan;
pub mod registry;
pub mod run;
pub mod settings;
pub mod silence;
pub mod testing;
