//! Files of the page, embedded in the program.

use include_dir::{Dir, include_dir};

/// The files of `studio/page`.
pub(super) static PAGE: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/page");
/// The WebAssembly engine of graphs, and the one that learns and conducts studies; empty if this program was built without them.
pub(super) static ENGINE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/engine.wasm"));
pub(super) static WHOLE_ENGINE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/whole.wasm"));
