//! The studio: a page on which a person strokes a surface, and hears, sees and changes what it renders.
//!
//! [`Studio::open`] serves the page and runs the graph behind it; [`page`] is the same engine for WebAssembly, where the
//! page's own audio thread runs it. Pointers on the page are the graph's tablets; every other endpoint is simulated,
//! unless the server is asked for another set: then what is real is opened, and gets zeros until it is armed from the page.
//! What a sink delivers, behind its limits, is played by the page. Both speak the protocol of `docs/studio-protocol.md`.

// Of what both hosts share a page leaves some out.
#![cfg_attr(target_family = "wasm", allow(dead_code))]

mod actuators;
mod again;
mod arming;
mod channels;
mod describe;
mod drive;
mod envelope;
mod levels;
mod load;
#[cfg(not(target_family = "wasm"))]
mod native;
mod pads;
pub mod page;
mod page_clock;
mod pages;
mod publish;
mod record;
mod run_page;
mod scope;
mod stage;
mod talk;
mod wire;

#[cfg(not(target_family = "wasm"))]
pub use native::{Export, Exported, Options, Studio, StudioError, export, lan_address};
