//! Tables that are not CSV: spreadsheets, MATLAB's files, WAV files.

mod matlab;
#[cfg(all(feature = "spreadsheets", not(target_family = "wasm")))]
mod spreadsheet;
mod wav;

use std::io::{Read, Seek};

pub(super) use matlab::matlab;
pub(super) use wav::wav;

#[cfg(all(feature = "spreadsheets", not(target_family = "wasm")))]
pub(super) use spreadsheet::spreadsheet;

#[cfg(not(all(feature = "spreadsheets", not(target_family = "wasm"))))]
pub(super) fn spreadsheet(
    _: &[u8],
    _: &super::ImportSettings,
    _: super::csv::ColumnSelection<'_>,
) -> Result<super::csv::Table, super::ReadError> {
    let message = "this build cannot read spreadsheets; save the file as CSV";
    Err(super::ReadError::Io(message.to_owned()))
}

/// The kind of a ZIP archive that is not a recording.
#[cfg_attr(target_family = "wasm", expect(dead_code, reason = "a page has no archives"))]
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Workbook {
    /// The supported kind.
    Xlsx,
    Other,
}

/// The kind of workbook in a ZIP archive, if it is one.
#[cfg(not(target_family = "wasm"))]
pub(super) fn workbook(archive: impl Read + Seek) -> Option<Workbook> {
    let archive = zip::ZipArchive::new(archive).ok()?;
    let has = |name: &str| archive.index_for_name(name).is_some();
    match () {
        () if has("xl/workbook.xml") => Some(Workbook::Xlsx),
        () if has("xl/workbook.bin") || has("content.xml") => Some(Workbook::Other),
        () => None,
    }
}

#[cfg(target_family = "wasm")]
pub(super) fn workbook(_: impl Read + Seek) -> Option<Workbook> {
    None
}
