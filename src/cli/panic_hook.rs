//! Panic hook: a panic is a bug of the program. Its message is printed at once, or kept while actuators move.

use super::stderr::{self, eprint};
use std::panic::PanicHookInfo;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Maximum number of kept panics; the first ones are the most informative.
const MAX_KEPT: usize = 8;

/// True while actuators move. The panicking thread then writes nothing: standard error could block it.
static LIVE: AtomicBool = AtomicBool::new(false);
static UNREPORTED: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Installs the hook.
pub(super) fn install() {
    std::panic::set_hook(Box::new(|info| {
        let text = describe(info);
        if !LIVE.load(Ordering::Relaxed) {
            let trace = std::backtrace::Backtrace::capture();
            let is_wanted = trace.status() == std::backtrace::BacktraceStatus::Captured;
            stderr::write(&if is_wanted { format!("{text}{trace}\n") } else { text });
        } else if let Ok(mut unreported) = UNREPORTED.try_lock()
            && unreported.len() < MAX_KEPT
        {
            unreported.push(text);
        }
    }));
}

/// Guard of a live run: until it is dropped, panics are kept for [`take_unreported`].
pub(super) struct LiveGuard(());

impl LiveGuard {
    pub(super) fn begin() -> Self {
        LIVE.store(true, Ordering::Relaxed);
        Self(())
    }
}

impl Drop for LiveGuard {
    fn drop(&mut self) {
        LIVE.store(false, Ordering::Relaxed);
        take_unreported().iter().for_each(|text| eprint(text));
    }
}

/// Takes the panics kept since the last call.
pub(super) fn take_unreported() -> Vec<String> {
    let kept = UNREPORTED.try_lock();
    kept.map_or_else(|_| Vec::new(), |mut kept| std::mem::take(&mut *kept))
}

fn describe(info: &PanicHookInfo<'_>) -> String {
    let at = info.location().map_or_else(String::new, |at| format!(" at {at}"));
    let thread = std::thread::current();
    let thread = thread.name().unwrap_or("unnamed");
    let payload = info.payload();
    let text = payload.downcast_ref::<String>().map(String::as_str);
    let message = text.or_else(|| payload.downcast_ref::<&str>().copied());
    report_text(&at, thread, message.unwrap_or("no message"))
}

fn report_text(at: &str, thread: &str, message: &str) -> String {
    format!(
        "error: haptograph {} panicked{at}, on the thread `{thread}`: {message}\n\
         This is a bug in the code at that place. If the code belongs to haptograph, please report the bug where you got \
         haptograph, with these lines and the graph.\n",
        env!("CARGO_PKG_VERSION")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_says_what_to_report() {
        let text = report_text(" at src/x.rs:1:2", "main", "index out of bounds");
        for part in [env!("CARGO_PKG_VERSION"), "src/x.rs:1:2", "`main`", "index out of bounds", "report"] {
            assert!(text.contains(part), "{text}");
        }
    }
}
