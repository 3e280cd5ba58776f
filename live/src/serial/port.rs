//! A serial port of this machine, and the thread that reads it.

use super::lines::{Column, Lines, publish_line};
use crate::numbers::{NumberSource, Readers};
use haptograph_nodes::network::inputs::{SERIAL_RATES as RATES, SerialInput, SerialInputSettings};
use haptograph_signal::files;
use nix::sys::termios::{self, BaudRate, ControlFlags, FlushArg, SetArg, SpecialCharacterIndices};
use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;

/// Time between polls of a port.
const PAUSE: Duration = Duration::from_millis(1);
/// Time between attempts to reopen a port.
const RETRY: Duration = Duration::from_millis(500);

/// The system's names of [`RATES`].
const NAMES: [BaudRate; RATES.len()] = [
    BaudRate::B2400,
    BaudRate::B4800,
    BaudRate::B9600,
    BaudRate::B19200,
    BaudRate::B38400,
    BaudRate::B57600,
    BaudRate::B115200,
    BaudRate::B230400,
];

/// Opens a port in raw mode at a rate.
fn open(path: &Path, baud: u32) -> Result<File> {
    let port = files::open_terminal(path)?;
    let rate = RATES.iter().position(|rate| *rate == baud).map(|place| NAMES[place]);
    let mut settings = termios::tcgetattr(&port)?;
    termios::cfmakeraw(&mut settings);
    settings.control_flags |= ControlFlags::CLOCAL | ControlFlags::CREAD;
    settings.control_chars[SpecialCharacterIndices::VMIN as usize] = 1;
    settings.control_chars[SpecialCharacterIndices::VTIME as usize] = 0;
    termios::cfsetspeed(&mut settings, rate.ok_or(ErrorKind::InvalidInput)?)?;
    termios::tcsetattr(&port, SetArg::TCSANOW, &settings)?;
    termios::tcflush(&port, FlushArg::TCIFLUSH)?;
    Ok(port)
}

/// A port at a rate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Line {
    path: PathBuf,
    /// bit/s.
    baud: u32,
}

impl std::fmt::Display for Line {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.path.display().fmt(f)
    }
}

/// The system's serial ports.
pub(super) struct SerialPort;

impl NumberSource for SerialPort {
    type Kind = SerialInput;
    type Address = Line;
    type Field = Column;

    fn locate(settings: &SerialInputSettings) -> Result<(Line, Column)> {
        let line = Line { path: PathBuf::from(&settings.port), baud: settings.baud };
        Ok((line, Column(settings.column as usize)))
    }

    fn is_same(one: &Line, other: &Line) -> bool {
        one.path == other.path
    }

    fn listen(line: &Line, readers: Readers<Column>, stop: Arc<AtomicBool>) -> Result<JoinHandle<()>> {
        listen(&line.path, line.baud, readers, stop)
    }
}

/// Reads a port until `stop`, on a separate thread, and reopens one that was unplugged.
fn listen(path: &Path, baud: u32, readers: Readers<Column>, stop: Arc<AtomicBool>) -> Result<JoinHandle<()>> {
    let mut port = Some((open(path, baud)?, Lines::new()));
    let path = path.to_owned();
    std::thread::Builder::new().name(format!("input {}", path.display())).spawn(move || {
        while !stop.load(Relaxed) {
            let Some((file, lines)) = &mut port else {
                std::thread::sleep(RETRY);
                port = open(&path, baud).ok().map(|file| (file, Lines::new()));
                continue;
            };
            match read(file, lines, &readers) {
                Ok(true) => {}
                Ok(false) => std::thread::sleep(PAUSE),
                Err(_) => port = None,
            }
        }
    })
}

/// Processes received bytes. Returns whether there were any.
fn read(port: &mut File, lines: &mut Lines, readers: &Readers<Column>) -> Result<bool> {
    let mut bytes = [0; 4096];
    match port.read(&mut bytes) {
        // The other end hung up.
        Ok(0) => Err(Error::from(ErrorKind::UnexpectedEof)),
        Ok(count) => {
            lines.take(&bytes[..count], |line| publish_line(line, readers));
            Ok(true)
        }
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(false),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::{Column, Line, SerialPort};
    use crate::numbers::Listener;
    use haptograph_nodes::network::link::Link;
    use nix::pty::{OpenptyResult, openpty};
    use std::fs::File;
    use std::io::Write;
    use std::path::PathBuf;
    use std::time::Duration;

    /// A pseudo terminal: what is written to the first is read at the path.
    fn terminal() -> (File, File, PathBuf) {
        let OpenptyResult { master, slave } = openpty(None, None).unwrap();
        let path = nix::unistd::ttyname(&slave).unwrap();
        (File::from(master), File::from(slave), path)
    }

    /// Waits until a number arrives.
    fn receives(link: &Link, number: f64) -> bool {
        (0..5000).any(|_| {
            std::thread::sleep(Duration::from_millis(1));
            link.sensed.look().is_some_and(|(version, sensed)| version > 0 && sensed[0] == number)
        })
    }

    #[test]
    fn a_port_is_read_and_read_again_after_it_was_gone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let (mut far, near, device) = terminal();
        std::os::unix::fs::symlink(&device, &path).unwrap();
        let place = Line { path: path.clone(), baud: 9600 };
        let listener = Listener::<SerialPort>::open(&place).unwrap();
        let link = listener.link("squeeze", Column(2), Duration::from_secs(1));
        far.write_all(b"\n1 2\n").unwrap();
        assert!(receives(&link, 2.0));

        // Unplugged, and another time plugged in.
        drop((far, near));
        let (mut far, _near, device) = terminal();
        std::fs::remove_file(&path).unwrap();
        std::os::unix::fs::symlink(&device, &path).unwrap();
        let is_reopened = (0..100).any(|_| {
            far.write_all(b"\n3 4\n").unwrap();
            std::thread::sleep(Duration::from_millis(50));
            link.sensed.look().is_some_and(|(_, sensed)| sensed[0] == 4.0)
        });
        assert!(is_reopened);
    }

    #[test]
    fn a_file_that_is_not_a_port_is_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let place = Line { path: file.path().to_owned(), baud: 9600 };
        assert!(Listener::<SerialPort>::open(&place).is_err());
    }
}
