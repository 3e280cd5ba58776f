//! The last zeros: what devices are sent where a process does not end in order.
//!
//! A process that is about to end by force sends them itself ([`send_last_zeros`]), an aborting one too. For one that is
//! killed, each socket of a device has a guard: a process of the same program that holds the socket too and waits for the
//! end of a pipe, which comes with the end of the process however it ends. It then sends zeros for 100 ms and ends,
//! and with it the port is free: until then no other run can listen there, so no guard ever speaks beside a run. A run that
//! ends in order ends its guards after its own last zeros.
//!
//! Only a program that calls [`install`] has guards; that is the command, on Unix.

#[cfg(unix)]
mod abort;
#[cfg(unix)]
mod process;

#[cfg(unix)]
pub(crate) use process::Guard;
#[cfg(unix)]
pub use process::{is_guard, serve};

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How long a guard sends zeros.
pub(crate) const GUARDED: Duration = Duration::from_millis(100);
/// Time for the threads of all devices to send zeros: they wake every 5 ms at least.
const SENDING: Duration = Duration::from_millis(20);

/// Where a device receives its commands, and in which form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Target {
    /// The device protocol.
    Protocol(SocketAddr),
    /// Open Sound Control.
    #[cfg(feature = "osc")]
    Osc(SocketAddr),
}

/// Other systems have no guards.
#[cfg(not(unix))]
#[derive(Debug)]
pub(crate) enum Guard {}

#[cfg(not(unix))]
impl Guard {
    pub fn start(_: &std::net::UdpSocket) -> io::Result<Option<Self>> {
        Ok(None)
    }

    pub(crate) fn aim(&mut self, _: Option<Target>) {
        match *self {}
    }

    pub(crate) fn end(self) {
        match self {}
    }
}

/// The program that runs, to be started again; on Linux also where its file was replaced since.
///
/// # Errors
/// Those of the system that does not say which program runs.
pub fn program() -> io::Result<PathBuf> {
    let own = PathBuf::from("/proc/self/exe");
    match cfg!(target_os = "linux") && own.exists() {
        true => Ok(own),
        false => std::env::current_exe(),
    }
}

/// True once the process ends by force.
static ENDS: AtomicBool = AtomicBool::new(false);

/// Gives this program's sockets of devices guards, which are processes of it: its `main` has to call [`serve`] where
/// [`is_guard`]. Where the process aborts, it sends the last zeros itself.
#[cfg(unix)]
pub fn install() -> io::Result<()> {
    abort::install()?;
    process::install()
}

/// Sends zeros to the devices of all connections, which then accept nothing more. For a process that is about to end without
/// dropping them.
pub fn send_last_zeros() {
    ENDS.store(true, Ordering::Relaxed);
    std::thread::sleep(SENDING);
}

/// True if the process ends by force: the thread of a device then sends it zeros and ends.
pub(crate) fn ends() -> bool {
    ENDS.load(Ordering::Relaxed)
}
