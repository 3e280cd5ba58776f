//! The studio: a web page on which a person strokes a surface, and hears, sees and changes its rendering.
//!
//! [`Studio::open`] serves the page and runs the graph behind it; [`page`] is the same engine for
//! WebAssembly, driven by the page's own audio thread. Pointers on the page replace the graph's tablets. All
//! other endpoints are simulated unless the server is asked for another set; real devices of that set receive
//! zeros until they are armed from the page. The page plays the delivered signal of a sink, after its limits.
//! Both use the protocol of `docs/studio-protocol.md`.

#![cfg_attr(not(any(test, target_family = "wasm")), warn(unreachable_pub))]
// A page does not use all code shared by both hosts.
#![cfg_attr(target_family = "wasm", allow(dead_code))]

mod actuators;
mod bundle;
mod channels;
mod clock;
mod describe;
mod devices;
mod envelope;
mod error;
mod fed;
mod frames;
mod learn;
mod levels;
mod listen;
mod load;
#[cfg(not(target_family = "wasm"))]
mod native;
mod pads;
pub mod page;
mod page_clock;
mod pages;
mod pattern;
mod pointer;
mod publish;
mod record;
mod replay;
mod run_cycle;
mod run_page;
mod scene;
mod scope;
mod stage;
mod study;
mod talk;
mod wire;

#[cfg(not(target_family = "wasm"))]
pub use record::{APPENDED, recover};

#[cfg(not(target_family = "wasm"))]
pub use native::{
    Export, Exported, Learner, Options, Studio, StudioError, export, export_study, lan_address, shipped,
};
