//! Signals. Ctrl-C: a command that polls [`flag`] ends in good order, any other command ends at once. A limit of the size of
//! files is an error of writing, as a full disk is. Before an abort devices are sent zeros.

#[cfg(unix)]
use super::eprint;
use super::{Failure, keys};
use crate::live::guard;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Exit code after ctrl-C: 128 plus the number of the signal.
pub(super) const INTERRUPTED: u8 = 130;

/// Stop flag of the running command, if it polls one.
static STOP: Mutex<Option<Arc<AtomicBool>>> = Mutex::new(None);

/// Installs the handlers, before any thread is started. Ctrl-C then ends the process with the exit code and not by the signal.
/// Signals that the parent process ignores, for example under `nohup`, stay ignored.
pub(super) fn listen() {
    #[cfg(unix)]
    {
        use nix::sys::signal::{SigSet, Signal};
        // Blocked in this thread and those that it starts: a write beyond the limit fails.
        let _ = SigSet::from(Signal::SIGXFSZ).thread_block();
        if let Err(error) = guard::install() {
            eprint(&format!("note: no device is sent zeros if this program is killed ({error})\n"));
        }
    }
    let _ = ctrlc::try_set_handler(interrupted);
}

/// The flag that the first ctrl-C sets; the second ctrl-C ends the process.
pub(super) fn flag() -> Result<Arc<AtomicBool>, Failure> {
    match ctrlc::set_handler(interrupted) {
        Ok(()) | Err(ctrlc::Error::MultipleHandlers) => {}
        Err(error) => return Err(Failure::Message(format!("cannot listen for ctrl-C: {error}"))),
    }
    let stop = Arc::new(AtomicBool::new(false));
    *FIRST.lock().unwrap_or_else(PoisonError::into_inner) = None;
    *STOP.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&stop));
    Ok(stop)
}

/// Time of the first ctrl-C seen by the command.
static FIRST: Mutex<Option<Instant>> = Mutex::new(None);
/// Signals closer together than this count as one: some callers signal a program and then its process group.
const TWICE: Duration = Duration::from_millis(300);

/// Runs on its own thread.
fn interrupted() {
    let held = STOP.lock().unwrap_or_else(PoisonError::into_inner);
    // Held to the end of the process where no command polls a flag: none begins meanwhile, and leaves a folder.
    if let Some(stop) = &*held {
        // The flag may already be set by a typed `stop`; this ctrl-C still counts as the first.
        stop.store(true, Ordering::Relaxed);
        let mut first = FIRST.lock().unwrap_or_else(PoisonError::into_inner);
        if first.get_or_insert_with(Instant::now).elapsed() < TWICE {
            return;
        }
        guard::send_last_zeros();
    }
    keys::restore();
    std::process::exit(i32::from(INTERRUPTED));
}
