//! Tables that are not CSV: spreadsheets, MATLAB's files, WAV files.

mod matlab;
#[cfg(feature = "spreadsheets")]
mod spreadsheet;
mod wav;

pub(super) use matlab::matlab;
pub(super) use wav::wav;

#[cfg(feature = "spreadsheets")]
pub(super) use spreadsheet::spreadsheet;

#[cfg(not(feature = "spreadsheets"))]
pub(super) fn spreadsheet(
    _: &[u8],
    _: &super::ImportSettings,
) -> Result<super::csv::Table, super::ReadError> {
    let message = "this is a spreadsheet, which this build does not read: save it as CSV";
    Err(super::ReadError::Io(message.to_owned()))
}

/// Whether a ZIP archive is a spreadsheet: names of members stand in it as they are.
pub(super) fn is_spreadsheet(bytes: &[u8]) -> bool {
    let has = |name: &[u8]| bytes.windows(name.len()).any(|window| window == name);
    has(b"xl/workbook") || has(b"opendocument.spreadsheet")
}
