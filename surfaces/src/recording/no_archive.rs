//! In place of archives where there are no files, in a page: each says so.

use super::{AnyRecording, Member, RawHead, ReadError};
use std::fs::File;
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

fn none() -> Error {
    Error::new(
        ErrorKind::Unsupported,
        "a page keeps no archives of recordings; use CSV",
    )
}

/// Would write a recording.
///
/// # Errors
/// Always.
pub fn write_archive(_: &AnyRecording) -> Result<Vec<u8>> {
    Err(none())
}

/// Would read one.
///
/// # Errors
/// Always.
pub fn read_archive(_: &[u8]) -> std::result::Result<AnyRecording, ReadError> {
    Err(ReadError::Archive(none().to_string()))
}

/// Would be a recording that is being made: there is none.
pub enum Spool {}

/// Where it would be made.
pub fn spool_folder(path: &Path) -> PathBuf {
    path.to_owned()
}

/// Would make an archive of it.
///
/// # Errors
/// Always.
pub fn assemble(_: &Path, _: &Path) -> Result<()> {
    Err(none())
}

impl Spool {
    /// Would begin one.
    ///
    /// # Errors
    /// Always.
    pub fn create(_: &Path, _: &RawHead<'_>) -> Result<Self> {
        Err(none())
    }

    /// Is never called.
    ///
    /// # Errors
    /// None.
    pub fn write(&mut self, _: Member, _: &[f64]) -> Result<()> {
        match *self {}
    }

    /// Is never called.
    ///
    /// # Errors
    /// None.
    pub fn flush(&mut self) -> Result<impl Iterator<Item = &File>> {
        match *self {}
        #[expect(unreachable_code, reason = "says what it would be")]
        Ok(std::iter::empty())
    }

    /// Is never called.
    ///
    /// # Errors
    /// None.
    pub fn finish(self, _: &Path) -> Result<()> {
        match self {}
    }
}
