//! Work on a separate thread, while Python's other threads continue and ctrl-C is noticed.

use crate::errors::Failure;
use crate::prototypes::Scripts;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

/// Period of checking for ctrl-C and reporting the progress.
const LOOK: Duration = Duration::from_millis(50);

/// Progress and stop flag of a worker.
#[derive(Clone, Default)]
pub(crate) struct Progress {
    /// Set when the result is no longer needed.
    pub stop: Arc<AtomicBool>,
    done: Arc<AtomicU64>,
}

/// Panic payload that ends work which does not check `stop`.
struct Stopped;

impl Progress {
    /// Reports the fraction done, 0 to 1.
    pub(crate) fn at(&self, part: f64) {
        self.done.store(part.to_bits(), Ordering::Relaxed);
    }

    /// Reports the fraction done, and returns whether to continue.
    pub(crate) fn goes_on(&self, part: f64) -> ControlFlow<()> {
        self.at(part);
        match self.stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    /// Reports the fraction done, for work that does not check `stop`: the work ends here once `stop` is set.
    pub(crate) fn at_or_end(&self, part: f64) {
        if self.goes_on(part).is_break() {
            resume_unwind(Box::new(Stopped));
        }
    }
}

/// Runs `work` on another thread, and calls `show` from time to time with the fraction done. At ctrl-C, or if `show`
/// raises, `stop` is set and the call returns; with `waits` it waits for the work, so that written files are complete.
pub(crate) fn apart<R: Send + 'static>(
    py: Python<'_>,
    (show, waits): (Option<&Bound<'_, PyAny>>, bool),
    work: impl FnOnce(&Progress) -> Result<R, Failure> + Send + 'static,
) -> PyResult<R> {
    apart_with(py, (show, waits), &Scripts::default(), work)
}

/// Runs work like [`apart`]; also interrupts its nodes in Python.
pub(crate) fn apart_with<R: Send + 'static>(
    py: Python<'_>,
    (show, waits): (Option<&Bound<'_, PyAny>>, bool),
    scripts: &Scripts,
    work: impl FnOnce(&Progress) -> Result<R, Failure> + Send + 'static,
) -> PyResult<R> {
    let progress = Progress::default();
    let (sender, receiver) = sync_channel(1);
    let theirs = progress.clone();
    let worker = std::thread::Builder::new().name("haptograph".to_owned());
    let worker = worker.spawn(move || {
        // Where nobody waits any more, the result is dropped here.
        let _ = sender.send(work(&theirs));
    })?;
    let done = attend(py, show, &progress, receiver);
    while waits && progress.stop.load(Ordering::Relaxed) && !worker.is_finished() {
        scripts.interrupt(py);
        py.detach(|| std::thread::sleep(LOOK));
    }
    done?.ok_or_else(|| {
        let _ = worker.join();
        panicked()
    })
}

/// Runs `work` on another thread like [`apart`], and waits for it in any case, so that it may borrow. The work must end
/// soon after `stop` is set.
pub(crate) fn apart_within<R: Send>(
    py: Python<'_>,
    show: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Progress) -> Result<R, Failure> + Send,
) -> PyResult<R> {
    let progress = Progress::default();
    let (sender, receiver) = sync_channel(1);
    std::thread::scope(|scope| {
        let theirs = &progress;
        let worker = std::thread::Builder::new().name("haptograph".to_owned());
        let worker = worker.spawn_scoped(scope, move || {
            // Where it was told to stop, the result is dropped here.
            let _ = sender.send(work(theirs));
        })?;
        let done = attend(py, show, &progress, receiver);
        // A panic was printed where it happened.
        let _ = py.detach(|| worker.join());
        done?.ok_or_else(panicked)
    })
}

/// Waits for the result of a worker; `None` if it panicked. Calls `show` from time to time with the fraction done. At
/// ctrl-C, or if `show` raises, sets `stop` and returns that exception.
fn attend<R: Send>(
    py: Python<'_>,
    show: Option<&Bound<'_, PyAny>>,
    progress: &Progress,
    mut receiver: Receiver<Result<R, Failure>>,
) -> PyResult<Option<R>> {
    let mut shown = f64::NAN;
    loop {
        let (back, received) = py.detach(move || {
            let received = receiver.recv_timeout(LOOK);
            (receiver, received)
        });
        receiver = back;
        match received {
            Ok(done) => return done.map(Some).map_err(|failure| failure.raise(py)),
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
            Err(RecvTimeoutError::Timeout) => {}
        }
        let part = f64::from_bits(progress.done.load(Ordering::Relaxed));
        let mut asked = py.check_signals();
        if let (Some(show), true) = (show, part != shown) {
            shown = part;
            asked = asked.and_then(|()| show.call1((part,)).map(drop));
        }
        if let Err(interrupt) = asked {
            progress.stop.store(true, Ordering::Relaxed);
            return Err(interrupt);
        }
    }
}

/// The exception for a worker that has no result.
fn panicked() -> PyErr {
    PyRuntimeError::new_err(
        "haptograph panicked, which is an internal error of haptograph: its message is on standard error",
    )
}
