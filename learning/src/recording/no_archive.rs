//! Replaces archives in a web page, which has no file system: every function returns an error.

use super::{AnyRecording, ReadError};
use haptograph_signal::files::Bounded;
use std::io::{Error, ErrorKind, Result};

fn none() -> Error {
    Error::new(ErrorKind::Unsupported, "a web page cannot read or write recording archives; use CSV")
}

/// Returns an error: a page has no archives.
///
/// # Errors
/// Always.
pub fn write_archive(_: &AnyRecording) -> Result<Vec<u8>> {
    Err(none())
}

/// Returns an error: a page has no archives.
///
/// # Errors
/// Always.
pub fn read_archive(_: &[u8]) -> std::result::Result<AnyRecording, ReadError> {
    Err(ReadError::Io(none().to_string()))
}

/// Returns an error: a page has no archives.
pub(super) fn open_archive(_: &Bounded) -> std::result::Result<AnyRecording, ReadError> {
    read_archive(&[])
}
