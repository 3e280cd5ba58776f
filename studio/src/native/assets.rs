//! The page's files, which are part of the program.

use include_dir::{Dir, include_dir};

/// As they lie in `studio/page`.
pub static PAGE: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/page");
/// The engine for pages; empty where this program was built without.
pub static ENGINE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/engine.wasm"));
