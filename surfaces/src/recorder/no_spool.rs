//! Replaces spools in a web page, which has no file system: every function returns an error.

use super::{Member, RawHead};
use std::fs::File;
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

fn none() -> Error {
    Error::new(ErrorKind::Unsupported, "a web page cannot write recording archives; use CSV")
}

/// A recording in progress; never constructed in a page.
pub enum Spool {}

/// The folder of the spool.
pub fn spool_folder(path: &Path) -> PathBuf {
    path.to_owned()
}

/// Returns an error: a page has no archives.
///
/// # Errors
/// Always.
pub fn assemble(_: &Path, _: &Path) -> Result<()> {
    Err(none())
}

impl Spool {
    /// Returns an error: a page has no archives.
    ///
    /// # Errors
    /// Always.
    pub fn create(_: &Path, _: &RawHead<'_>) -> Result<Self> {
        Err(none())
    }

    /// Never called.
    ///
    /// # Errors
    /// None.
    pub fn write(&mut self, _: Member, _: &[f64]) -> Result<()> {
        match *self {}
    }

    /// Never called.
    ///
    /// # Errors
    /// None.
    pub fn flush(&mut self) -> Result<impl Iterator<Item = &File>> {
        match *self {}
        #[expect(unreachable_code, reason = "never constructed")]
        Ok(std::iter::empty())
    }

    /// Never called.
    ///
    /// # Errors
    /// None.
    pub fn finish(self, _: &Path) -> Result<()> {
        match self {}
    }
}
