//! The studio: a page on which a person strokes a surface, and hears, sees and changes what it renders.
//!
//! [`Studio::open`] serves the page and runs the graph behind it. Pointers on the page are the graph's tablets; every
//! other endpoint stays simulated, so that nothing real moves, and what a sink delivers, behind its limits, is played by
//! the page. The two speak the protocol of `docs/studio-protocol.md`.

mod describe;
mod drive;
mod learn;
mod load;
mod pads;
mod pump;
mod scope;
mod server;
mod stage;
mod wire;

pub use server::{Options, Studio, StudioError};
