//! The status of a call, and the last error of each thread.

use crate::border::Status;
use haptograph_engine::diagnostic::{Diagnostics, Severity};
use haptograph_engine::host::{Full, HostError};
use haptograph_engine::run::{ChangeError, ControlError};
use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CStr, CString};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The error of a failed call.
#[derive(Debug)]
pub(crate) struct Failure {
    pub status: Status,
    /// Code of a graph's first error, such as `E0204`.
    code: String,
    /// The message in one line.
    message: String,
    /// The message as printed on a terminal; the plain message if there is no graph text to show.
    rendered: String,
}

impl Failure {
    pub(crate) fn new(status: Status, message: impl Display) -> Self {
        let message = message.to_string();
        Self { status, code: String::new(), rendered: message.clone(), message }
    }

    fn panicked(panic: Box<dyn Any + Send>) -> Self {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
        // Dropping the payload can panic again.
        std::mem::forget(panic);
        let text = text.unwrap_or_default();
        Self::new(
            Status::Panic,
            format_args!("haptograph panicked, which is an internal error of haptograph: {text}"),
        )
    }
}

impl From<Status> for Failure {
    fn from(status: Status) -> Self {
        Self::new(status, text(status).to_str().unwrap_or_default())
    }
}

impl From<Diagnostics> for Failure {
    fn from(found: Diagnostics) -> Self {
        let first = found.list.iter().find(|one| one.severity == Severity::Error);
        Self {
            status: Status::Graph,
            code: first.map(|one| one.code.to_owned()).unwrap_or_default(),
            message: first.map(|one| one.message.clone()).unwrap_or_default(),
            rendered: found.to_string(),
        }
    }
}

impl From<HostError> for Failure {
    fn from(error: HostError) -> Self {
        let status = match error {
            HostError::Unknown { .. } | HostError::Several { .. } => Status::Name,
            HostError::Kind { .. } => Status::Shape,
            HostError::Taken { .. } | HostError::Playing { .. } => Status::Taken,
            HostError::Drivers { .. } | HostError::OfflineOnly(_) => Status::Graph,
            _ => Status::System,
        };
        Self::new(status, error)
    }
}

impl From<ChangeError> for Failure {
    fn from(error: ChangeError) -> Self {
        let status = match error {
            ChangeError::Control(ControlError::Full) => Status::Full,
            ChangeError::Playing { .. } | ChangeError::Taken { .. } => Status::Taken,
            ChangeError::Write(_) => Status::System,
            _ => Status::Graph,
        };
        Self::new(status, error)
    }
}

impl From<Full> for Status {
    fn from(full: Full) -> Self {
        match full {
            Full::Full => Self::Full,
            Full::NotFinite => Self::NotFinite,
            Full::Shape => Self::Shape,
        }
    }
}

impl From<ControlError> for Status {
    fn from(error: ControlError) -> Self {
        match error {
            ControlError::Full => Self::Full,
            ControlError::NotLive => Self::Name,
            ControlError::NotFinite => Self::NotFinite,
            ControlError::OutOfRange(..) | ControlError::OtherRate => Self::Argument,
            _ => Self::System,
        }
    }
}

/// The meaning of a status, for calls that do not change the last error.
pub(crate) fn text(status: Status) -> &'static CStr {
    match status {
        Status::Ok => c"no error",
        Status::Graph => c"the graph has errors, or cannot replace the running one",
        Status::Argument => c"an argument is null, misaligned, not UTF-8, or out of range",
        Status::Handle => c"the handle is null, was freed, or was not created by this library",
        Status::Kind => c"the handle belongs to another type of object",
        Status::Busy => c"another thread is using this object; the call had no effect",
        Status::Name => c"no item has that name",
        Status::Shape => c"the number of values does not match the shape of the channel",
        Status::Taken => c"a channel can have only one handle, and a graph one player: free the other first",
        Status::Full => c"the queue is full: call haptograph_player_process()",
        Status::NotFinite => c"a value is NaN or infinite",
        Status::Ended => c"the run has ended and its actuators are at zero",
        Status::System => c"the system refused a file, a thread or memory",
        Status::Panic => c"haptograph panicked, which is an internal error of haptograph",
    }
}

#[derive(Default)]
struct LastError {
    code: CString,
    message: CString,
    rendered: CString,
}

thread_local! {
    static LAST: RefCell<LastError> = RefCell::new(LastError::default());
}

/// A field of the last error.
#[derive(Clone, Copy)]
pub(crate) enum ErrorField {
    Code,
    Message,
    Rendered,
}

/// A pointer into the thread's last error, valid until its next failed call; to an empty text if no call failed.
pub(crate) fn last(field: ErrorField) -> *const std::ffi::c_char {
    let pointer = LAST.try_with(|last| {
        let last = last.borrow();
        match field {
            ErrorField::Code => last.code.as_ptr(),
            ErrorField::Message => last.message.as_ptr(),
            ErrorField::Rendered => last.rendered.as_ptr(),
        }
    });
    pointer.unwrap_or(c"".as_ptr())
}

fn store(failure: Failure) -> Status {
    let text = |text: String| CString::new(text.replace('\0', "\u{fffd}")).unwrap_or_default();
    let last = LastError {
        code: text(failure.code),
        message: text(failure.message),
        rendered: text(failure.rendered),
    };
    // A thread that is ending has no last error.
    let _ = LAST.try_with(|stored| *stored.borrow_mut() = last);
    failure.status
}

/// Converts every result of a call, panics included, to a status and the thread's last error.
pub(crate) fn guard(work: impl FnOnce() -> Result<(), Failure>) -> Status {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(failure)) => store(failure),
        Err(panic) => store(Failure::panicked(panic)),
    }
}

/// The same for real-time calls, which do not change the last error.
pub(crate) fn guard_realtime(work: impl FnOnce() -> Result<(), Status>) -> Status {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(status)) => status,
        Err(panic) => {
            // A real-time thread must not free memory.
            std::mem::forget(panic);
            Status::Panic
        }
    }
}
