//! The guard process of a device's socket.

use super::{GUARDED, Target};
#[cfg(feature = "osc")]
use crate::osc::send_driven;
use crate::udp::WAIT;
use crate::udp::protocol::{Command as Zeros, STATE_BYTES, State};
#[cfg(feature = "osc")]
use haptograph_nodes::network::link::DRIVEN;
use haptograph_signal::files;
use nix::sys::signal::{SigSet, Signal};
use std::io::{self, Write};
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::Instant;

/// The argument of a guard.
const WORD: &str = "guard-of-a-live-run";

/// The program to start as a guard.
static PROGRAM: OnceLock<PathBuf> = OnceLock::new();

pub(super) fn install() -> io::Result<()> {
    let program = super::program()?;
    PROGRAM.get_or_init(|| program);
    Ok(())
}

impl Target {
    /// Reads a line of the pipe.
    fn from_line(line: &str) -> Option<Self> {
        match line.split_once(' ')? {
            ("protocol", address) => Some(Self::Protocol(address.parse().ok()?)),
            #[cfg(feature = "osc")]
            ("osc", address) => Some(Self::Osc(address.parse().ok()?)),
            _ => None,
        }
    }
}

/// The guard of a socket. Where it is dropped and not [ended](Self::end), it sends zeros.
#[derive(Debug)]
pub(crate) struct Guard(Child);

impl Guard {
    /// Starts a guard; `None` in a program without guards.
    pub(crate) fn start(socket: &UdpSocket) -> io::Result<Option<Self>> {
        let Some(program) = PROGRAM.get() else {
            return Ok(None);
        };
        let socket = OwnedFd::from(socket.try_clone()?);
        // A group of its own: no key of the terminal reaches it.
        let mut command = Command::new(program);
        command.arg0("haptograph").arg(WORD).current_dir("/").process_group(0);
        command.stdin(Stdio::piped()).stdout(socket).stderr(Stdio::null());
        command.spawn().map(|child| Some(Self(child)))
    }

    /// Says where the device is now.
    pub(crate) fn aim(&mut self, target: Option<Target>) {
        let line = match target {
            Some(Target::Protocol(address)) => format!("protocol {address}\n"),
            #[cfg(feature = "osc")]
            Some(Target::Osc(address)) => format!("osc {address}\n"),
            None => "none\n".to_owned(),
        };
        if let Some(pipe) = &mut self.0.stdin {
            // A guard that was killed guards no more; the run goes on.
            let _ = pipe.write_all(line.as_bytes());
        }
    }

    /// Ends the guard at once.
    pub(crate) fn end(mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// True in a process that was started as a guard.
pub fn is_guard() -> bool {
    std::env::args_os().nth(1).is_some_and(|argument| argument == WORD)
}

/// Guards a socket: waits for the end of the process that started this one, then sends zeros.
///
/// # Errors
/// If this process was not started by a run.
pub fn serve() -> io::Result<()> {
    let socket = UdpSocket::from(io::stdout().as_fd().try_clone_to_owned()?);
    socket.set_read_timeout(Some(WAIT))?;
    // Who ends the run so ends the guard too soon; it ends after the run in any case.
    let ends = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP, Signal::SIGQUIT, Signal::SIGTSTP];
    ends.into_iter().collect::<SigSet>().thread_block()?;
    let lines = files::lines(io::stdin().lock(), files::MAX_LINE_BYTES);
    let last = lines.map_while(Result::ok).last();
    let last = last.and_then(|line| Target::from_line(std::str::from_utf8(&line).ok()?));
    match last {
        Some(Target::Protocol(device)) => answer_with_zeros(&socket, device),
        #[cfg(feature = "osc")]
        Some(Target::Osc(device)) => {
            let end = Instant::now() + GUARDED;
            while Instant::now() < end {
                send_driven(&socket, device, &[0.0; DRIVEN]);
                std::thread::sleep(WAIT);
            }
        }
        None => {}
    }
    Ok(())
}

/// Sends the device zeros as answers to its states, and unasked where none comes. Nobody else moves the guard's aim.
fn answer_with_zeros(socket: &UdpSocket, device: SocketAddr) {
    let end = Instant::now() + GUARDED;
    let (mut zeros, mut bytes) = (Zeros::default(), [0; STATE_BYTES + 1]);
    while Instant::now() < end {
        zeros.sequence += 1;
        let _ = socket.send_to(&zeros.to_bytes(), device);
        if let Ok((length, from)) = socket.recv_from(&mut bytes)
            && from == device
            && let Ok(state) = State::from_bytes(&bytes[..length])
        {
            (zeros.answers, zeros.timestamp_ns) = (state.sequence, state.timestamp_ns);
        }
    }
}
