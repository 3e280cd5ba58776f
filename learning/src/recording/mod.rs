//! Recordings of a tool on a surface, and their files. Most public data is already processed.

#[cfg(not(target_family = "wasm"))]
mod archive;
mod csv;
mod error;
mod file;
mod formats;
mod hatt;
mod import;
#[cfg(target_family = "wasm")]
mod no_archive;
mod signal;

pub use crate::signals::{
    AnyRecording, Calibration, Gesture, Pose, ProcessedRecording, Recording, RecordingError, Sensor, Series,
    Signals, WorldAxes, Wrench,
};
#[cfg(not(target_family = "wasm"))]
use archive::open_archive;
#[cfg(not(target_family = "wasm"))]
pub use archive::{read_archive, write_archive};
pub use csv::{COLUMNS, CsvHead, LikelyColumn, QUANTITIES, csv_head, read_csv, units_of, write_csv};
pub use error::ReadError;
pub use file::{
    LoadError, Sweep, contents, file_names, load, load_column, load_signal, load_sweep, load_with, save,
};
pub use hatt::{read_hatt, write_hatt};
pub(crate) use import::clipped;
pub use import::{BadCell, Finding, ImportSettings, remove_offset};
#[cfg(target_family = "wasm")]
use no_archive::open_archive;
#[cfg(target_family = "wasm")]
pub use no_archive::{read_archive, write_archive};
pub use signal::{Column, read_column, read_signal};

#[cfg(test)]
pub(crate) mod tests;
