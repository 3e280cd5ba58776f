//! Ctrl-C: it ends a command that looks out for it in good order, and any other at once.

use super::{Failure, keys};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The code to exit with after ctrl-C: 128 and the number of the signal.
pub const INTERRUPTED: u8 = 130;

/// What a command looks at to see whether it should end; none while no command does.
static STOP: Mutex<Option<Arc<AtomicBool>>> = Mutex::new(None);

/// From now on ctrl-C ends the process with its code, and not as the signal does. Where somebody else cares for a signal,
/// as `nohup` does for the end of a terminal, all stay as they are.
pub fn listen() {
    let _ = ctrlc::try_set_handler(interrupted);
}

/// What the first ctrl-C sets from now on; the second ends the process.
pub fn flag() -> Result<Arc<AtomicBool>, Failure> {
    match ctrlc::set_handler(interrupted) {
        Ok(()) | Err(ctrlc::Error::MultipleHandlers) => {}
        Err(error) => return Err(Failure::Message(format!("cannot listen for ctrl-C: {error}"))),
    }
    let stop = Arc::new(AtomicBool::new(false));
    *FIRST.lock().unwrap_or_else(PoisonError::into_inner) = None;
    *STOP.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&stop));
    Ok(stop)
}

/// When the first ctrl-C came that the command looks out for.
static FIRST: Mutex<Option<Instant>> = Mutex::new(None);
/// Signals that come as close as this are one: some who end a program signal it and then its group.
const TWICE: Duration = Duration::from_millis(300);

/// On a thread of its own.
fn interrupted() {
    let stop = STOP.lock().unwrap_or_else(PoisonError::into_inner).clone();
    if let Some(stop) = stop {
        // It may have been set by a typed stop: then this is the first all the same.
        stop.store(true, Ordering::Relaxed);
        let mut first = FIRST.lock().unwrap_or_else(PoisonError::into_inner);
        if first.get_or_insert_with(Instant::now).elapsed() < TWICE {
            return;
        }
    }
    keys::restore();
    std::process::exit(i32::from(INTERRUPTED));
}
