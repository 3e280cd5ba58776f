//! Where signals end: files and meters.

pub mod csv;
pub mod meter;
mod note;
pub mod plots;
pub mod recording;
pub mod wav;

use haptograph_engine::node::BuildError;
use std::path::{Component, Path, PathBuf};

/// A file name that stays inside the run's folder.
fn inside_the_run(file: &str) -> Result<PathBuf, BuildError> {
    let path = Path::new(file);
    let inside = path.components().all(|part| matches!(part, Component::Normal(_)));
    if inside && path.file_name().is_some() {
        return Ok(path.to_owned());
    }
    let message = format!("`{file}` is not a file name inside the run's folder");
    Err(BuildError::at("file", message)
        .help("give a plain name such as \"texture.wav\"; `--out` says which folder"))
}
