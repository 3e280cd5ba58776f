//! Versions and errors.

use super::{
    HAPTOGRAPH_VERSION_MAJOR as MAJOR, HAPTOGRAPH_VERSION_MINOR as MINOR, HAPTOGRAPH_VERSION_PATCH as PATCH,
};
use crate::failure::{self, ErrorField};
use std::ffi::c_char;

/// Returns the version of the loaded library, `major << 16 | minor << 8 | patch`. HAPTOGRAPH_VERSION is the version at
/// compile time. Any thread; real-time.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_version() -> u32 {
    MAJOR << 16 | MINOR << 8 | PATCH
}

/// Returns the meaning of a status in one line; the text is never freed. Any thread; real-time.
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
    known.map_or(c"not a status of haptograph", failure::text).as_ptr()
}

/// Returns the code of the first error in the graph that this thread last failed to open, such as "E0204" (see
/// docs/diagnostics.md); empty after any other failure. The text is valid until this thread's next failed call.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_last_error_code() -> *const c_char {
    failure::last(ErrorField::Code)
}

/// Returns the message of this thread's last failed call in one line; empty if none failed. Real-time calls do not change
/// it: see haptograph_status_text(). The text is valid until this thread's next failed call.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_last_error_message() -> *const c_char {
    failure::last(ErrorField::Message)
}

/// Returns the message as printed on a terminal: every error of a graph with its location and the remedy. The text is
/// valid until this thread's next failed call.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_last_error_rendered() -> *const c_char {
    failure::last(ErrorField::Rendered)
}
