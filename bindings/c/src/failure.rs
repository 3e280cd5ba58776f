//! How a call ended, and what the last one that failed on a thread has to say.

use crate::border::Status;
use haptograph_engine::diagnostic::{Diagnostics, Severity};
use haptograph_engine::host::{Full, HostError};
use haptograph_engine::run::ControlError;
use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CStr, CString};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Why a call failed.
#[derive(Debug)]
pub struct Failure {
    pub status: Status,
    /// Of a graph's first error: `E0204`.
    code: String,
    /// One line.
    message: String,
    /// As on a terminal; the message where there is no text to show.
    rendered: String,
}

impl Failure {
    pub fn new(status: Status, message: impl Display) -> Self {
        let message = message.to_string();
        Self {
            status,
            code: String::new(),
            rendered: message.clone(),
            message,
        }
    }

    fn panicked(panic: Box<dyn Any + Send>) -> Self {
        let said = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let said = said.or_else(|| panic.downcast_ref::<String>().cloned());
        // Whoever drops it may panic again.
        std::mem::forget(panic);
        let said = said.unwrap_or_default();
        Self::new(
            Status::Panic,
            format_args!("haptograph panicked, which is a fault of haptograph: {said}"),
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
            HostError::Drivers { .. } => Status::Graph,
            _ => Status::System,
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
        }
    }
}

/// What a status means, for calls that leave the last error alone.
pub fn text(status: Status) -> &'static CStr {
    match status {
        Status::Ok => c"no error",
        Status::Graph => c"the graph has errors",
        Status::Argument => c"an argument is null, misaligned, no UTF-8, or not one that the call takes",
        Status::Handle => c"the handle is null, was freed, or was never given out",
        Status::Kind => c"the handle is of another kind of object",
        Status::Busy => c"another thread is inside this object: nothing was done",
        Status::Name => c"there is nothing of that name",
        Status::Shape => c"the number of values does not fit the shape of the channel",
        Status::Taken => c"a channel has one handle, and a graph one player: free the other first",
        Status::Full => c"the queue is full: nobody processes",
        Status::NotFinite => c"a value is NaN or infinite",
        Status::Ended => c"the run has ended: its actuators are at zero",
        Status::System => c"the system refused a file, a thread or memory",
        Status::Panic => c"haptograph panicked, which is a fault of haptograph",
    }
}

#[derive(Default)]
struct Last {
    code: CString,
    message: CString,
    rendered: CString,
}

thread_local! {
    static LAST: RefCell<Last> = RefCell::new(Last::default());
}

/// What is asked of the last error.
#[derive(Clone, Copy)]
pub enum Part {
    Code,
    Message,
    Rendered,
}

/// Points into the thread's last error, until the next call that fails there; to an empty text while there was none.
pub fn last(part: Part) -> *const std::ffi::c_char {
    let pointer = LAST.try_with(|last| {
        let last = last.borrow();
        match part {
            Part::Code => last.code.as_ptr(),
            Part::Message => last.message.as_ptr(),
            Part::Rendered => last.rendered.as_ptr(),
        }
    });
    pointer.unwrap_or(c"".as_ptr())
}

fn keep(failure: Failure) -> Status {
    let text = |text: String| CString::new(text.replace('\0', "\u{fffd}")).unwrap_or_default();
    let last = Last {
        code: text(failure.code),
        message: text(failure.message),
        rendered: text(failure.rendered),
    };
    // A thread that is ending has no last error any more.
    let _ = LAST.try_with(|kept| *kept.borrow_mut() = last);
    failure.status
}

/// Ends every way out of a call in a status and the thread's last error.
pub fn guard(work: impl FnOnce() -> Result<(), Failure>) -> Status {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(failure)) => keep(failure),
        Err(panic) => keep(Failure::panicked(panic)),
    }
}

/// The same for real-time calls, which leave the last error alone.
pub fn guard_realtime(work: impl FnOnce() -> Result<(), Status>) -> Status {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(status)) => status,
        Err(panic) => {
            // Freeing is not for this thread.
            std::mem::forget(panic);
            Status::Panic
        }
    }
}
