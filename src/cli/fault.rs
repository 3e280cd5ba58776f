//! A panic is a fault of haptograph: what it said is kept, and told where that holds up nothing.

use super::remarks::{at_once, remark};
use std::panic::PanicHookInfo;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Panics that are kept at most; the first ones say the most.
const MOST: usize = 8;

/// Do actuators move? Then nothing is written by the thread that panics: standard error may keep it waiting.
static LIVE: AtomicBool = AtomicBool::new(false);
static UNTOLD: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// From now on panics are told as faults to report.
pub fn listen() {
    std::panic::set_hook(Box::new(|info| {
        let text = describe(info);
        if !LIVE.load(Ordering::Relaxed) {
            let trace = std::backtrace::Backtrace::capture();
            let is_wanted = trace.status() == std::backtrace::BacktraceStatus::Captured;
            at_once(&if is_wanted {
                format!("{text}{trace}\n")
            } else {
                text
            });
        } else if let Ok(mut untold) = UNTOLD.try_lock()
            && untold.len() < MOST
        {
            untold.push(text);
        }
    }));
}

/// Until it is dropped, panics are kept for [`untold`].
pub struct Live(());

impl Live {
    pub fn begin() -> Self {
        LIVE.store(true, Ordering::Relaxed);
        Self(())
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        LIVE.store(false, Ordering::Relaxed);
        untold().iter().for_each(|text| remark(text));
    }
}

/// What was kept since this was asked last.
pub fn untold() -> Vec<String> {
    let kept = UNTOLD.try_lock();
    kept.map_or_else(|_| Vec::new(), |mut kept| std::mem::take(&mut *kept))
}

fn describe(info: &PanicHookInfo<'_>) -> String {
    let at = info.location().map_or_else(String::new, |at| format!(" at {at}"));
    let thread = std::thread::current();
    let thread = thread.name().unwrap_or("unnamed");
    let payload = info.payload();
    let text = payload.downcast_ref::<String>().map(String::as_str);
    let message = text.or_else(|| payload.downcast_ref::<&str>().copied());
    words(&at, thread, message.unwrap_or("no message"))
}

fn words(at: &str, thread: &str, message: &str) -> String {
    format!(
        "error: haptograph {} panicked{at}, on the thread `{thread}`: {message}\n\
         This is a fault of the code that stands there. Where that is haptograph's, please report it where you have \
         haptograph from, with these lines and the graph.\n",
        env!("CARGO_PKG_VERSION")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_says_what_to_report() {
        let text = words(" at src/x.rs:1:2", "main", "index out of bounds");
        for part in [
            env!("CARGO_PKG_VERSION"),
            "src/x.rs:1:2",
            "`main`",
            "index out of bounds",
            "report",
        ] {
            assert!(text.contains(part), "{text}");
        }
    }
}
