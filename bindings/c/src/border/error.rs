//! Versions and errors.

use super::{
    HAPTOGRAPH_VERSION_MAJOR as MAJOR, HAPTOGRAPH_VERSION_MINOR as MINOR, HAPTOGRAPH_VERSION_PATCH as PATCH,
};
use crate::failure::{self, Part};
use std::ffi::c_char;

/// The version of the library that runs, `major << 16 | minor << 8 | patch`; compare it with HAPTOGRAPH_VERSION, which is
/// the one that was compiled with. Any thread; real-time.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_version() -> u32 {
    MAJOR << 16 | MINOR << 8 | PATCH
}

/// What a status means, in one line, for ever. Any thread; real-time.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_status_text(status: i32) -> *const c_char {
    use super::Status;
    let all = [
        Status::Ok,
        Status::Graph,
        Status::Argument,
        Status::Handle,
        Status::Kind,
        Status::Busy,
        Status::Name,
        Status::Shape,
        Status::Taken,
        Status::Full,
        Status::NotFinite,
        Status::Ended,
        Status::System,
        Status::Panic,
    ];
    let known = all.into_iter().find(|known| *known as i32 == status);
    known
        .map_or(c"this is no status of haptograph", failure::text)
        .as_ptr()
}

/// The code of the first error in the graph that this thread failed to open last, "E0204", as docs/diagnostics.md lists
/// them; empty after any other failure. The text is the thread's until its next call that fails.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_last_error_code() -> *const c_char {
    failure::last(Part::Code)
}

/// Why this thread's last call that failed did so, in one line; empty where none did. Real-time calls leave it alone: see
/// haptograph_status_text(). The text is the thread's until its next call that fails.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_last_error_message() -> *const c_char {
    failure::last(Part::Message)
}

/// The same as on a terminal: every error of a graph with its place in the text and what to do. The text is the thread's
/// until its next call that fails.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_last_error_rendered() -> *const c_char {
    failure::last(Part::Rendered)
}
