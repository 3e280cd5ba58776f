//! The page's files, which are part of the program.

use include_dir::{Dir, include_dir};

/// As they lie in `studio/page`.
pub static PAGE: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/page");
