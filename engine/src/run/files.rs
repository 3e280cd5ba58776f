//! The files of an offline run.

use super::Run;
use super::file_sinks::{WriteError, WrittenFile};
use crate::plan::Plan;

/// The writers of a run and the taps of their streams.
pub(super) struct Files {
    written: Vec<WrittenFile>,
    /// By driver and tap: index of the tap in that driver's plan.
    places: Vec<Vec<Option<usize>>>,
}

impl Files {
    pub(super) fn new<'p>(written: Vec<WrittenFile>, plans: impl Iterator<Item = &'p Plan>) -> Self {
        let taps = written.iter().flat_map(|written| &written.taps).max();
        let count = taps.map_or(0, |last| last + 1);
        let place = |plan: &Plan, tap: usize| plan.tap_places.iter().position(|place| *place == tap);
        let places = plans.map(|plan| (0..count).map(|tap| place(plan, tap)).collect());
        Self { places: places.collect(), written }
    }

    /// Writes the last block of a driver.
    pub(super) fn write(&mut self, driver: usize, run: &Run) -> Result<(), WriteError> {
        for written in &mut self.written {
            let Some(writer) = &mut written.writer else {
                continue;
            };
            for (stream, tap) in written.taps.iter().enumerate() {
                let Some(place) = self.places[driver][*tap] else {
                    continue;
                };
                let result = writer.write(stream, run.tap(place));
                let path = || written.what.clone();
                result.map_err(|error| WriteError { path: path(), error })?;
            }
        }
        Ok(())
    }

    /// Completes every file; returns the first failure.
    pub(super) fn finish(self) -> Result<(), WriteError> {
        let mut first = Ok(());
        for written in self.written {
            let path = written.what;
            let Some(writer) = written.writer else { continue };
            let result = writer.finish();
            first = first.and(result.map_err(|error| WriteError { path, error }));
        }
        first
    }
}
