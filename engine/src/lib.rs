//! The dataflow engine of haptograph: documents are read, checked into graphs, laid out as plans, and run.
//!
//! ```text
//! text -> Document -> Graph -> Plan -> Run -> sinks
//! ```
//! Each arrow is one function; each noun is one type that only the arrow before it can make. Knows nothing of touch.

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
