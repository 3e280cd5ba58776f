//! The files that a graph needs.

use crate::describe;
use haptograph_engine::graph::Graph;
use haptograph_surfaces::files::load;
use std::path::{Path, PathBuf};

/// The files that a graph needs: its own, and those that its nodes name.
pub(super) fn needed(graph: &Graph) -> impl Iterator<Item = PathBuf> {
    let sources = graph.sources().iter().filter(|source| source.is_file);
    let sources = sources.map(|source| source.path.clone());
    sources.chain(graph.nodes().iter().flat_map(|node| node.files.clone()))
}

/// The surfaces in a graph's folder.
pub(super) fn beside(folder: &Path) -> impl Iterator<Item = PathBuf> {
    describe::surface_files(folder).into_iter().filter(|path| load(path).is_ok())
}
