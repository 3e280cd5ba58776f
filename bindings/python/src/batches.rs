//! Data sets: rendered from a plan, in parts, and merged.

use crate::errors::Failure;
use crate::work::apart;
use haptograph::learning::batch::{self as library, Batch, Processors, RenderSettings, Shard};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Renders a plan, or a part of it, into a folder. Ctrl-C ends it; a later call continues there.
#[pyfunction]
pub(crate) fn batch<'py>(
    py: Python<'py>,
    plan: PathBuf,
    folder: PathBuf,
    shard: Option<(u64, u64)>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let shard = shard.map(|(number, of)| {
        let missing =
            || Failure::Message(format!("there is no part {number} of {of}: give (1, {of}) to ({of}, {of})"));
        Shard::new(number, of).ok_or_else(|| missing().raise(py))
    });
    let usual = RenderSettings::default();
    let settings = RenderSettings { shard: shard.transpose()?, threads: threads.unwrap_or(usual.threads) };
    let done = apart(py, (progress, true), move |progress| {
        let batch = Batch::load(&plan).map_err(Failure::of)?;
        let stop = &progress.stop;
        library::render(&batch, &folder, &settings, &|part| progress.at(part), stop).map_err(Failure::of)
    })?;
    let replaced: Vec<PathBuf> = done.replaced.into_iter().map(|(path, _)| path).collect();
    let (chunks, rendered, kept, complete) = (done.chunks, done.rendered, done.kept, done.is_complete);
    Ok(dict!(py; chunks: chunks, rendered: rendered, kept: kept, replaced: replaced, complete: complete))
}

/// Merges parts into one folder; returns the numbers of chunks and jobs. Ctrl-C ends it; a later call continues there.
#[pyfunction]
pub(crate) fn merge(
    py: Python<'_>,
    parts: Vec<PathBuf>,
    folder: PathBuf,
    any_processor: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(u64, u64)> {
    let allowed = if any_processor { Processors::Any } else { Processors::OneFamily };
    let merged = apart(py, (progress, true), move |progress| {
        library::merge(&parts, &folder, allowed, &|part| progress.at_or_end(part)).map_err(Failure::of)
    })?;
    Ok((merged.chunks, merged.jobs))
}

/// The checked manifest of a data set as JSON.
#[pyfunction]
pub(crate) fn manifest(py: Python<'_>, folder: PathBuf) -> PyResult<String> {
    library::read_manifest(&folder).map_err(|error| Failure::of(error).raise(py))
}
