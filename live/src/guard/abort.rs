//! The handler of SIGABRT: failed allocations, panics while panicking, overflowing stacks and failed assertions of C libraries
//! end there.
#![expect(unsafe_code, reason = "signal handlers are unsafe to install")]

use nix::sys::signal::{SaFlags, SigAction, SigHandler, SigSet, Signal, raise, sigaction};

extern "C" fn on_abort(_: std::ffi::c_int) {
    super::send_last_zeros();
    // Delivered when this returns, by then to no handler.
    let _ = raise(Signal::SIGABRT);
}

/// Installs the handler, which ends the process as without it.
pub(super) fn install() -> std::io::Result<()> {
    let action = SigAction::new(SigHandler::Handler(on_abort), SaFlags::SA_RESETHAND, SigSet::empty());
    // SAFETY: `on_abort` does only what may be done in a handler, whatever the interrupted thread held: it stores an atomic,
    // sleeps by `nanosleep` and raises a signal. It neither allocates, locks nor unwinds.
    unsafe { sigaction(Signal::SIGABRT, &action) }?;
    Ok(())
}
