//! Texture rendering (thesis 2.4): locate, interpolate, excite, filter.

pub mod excitation;
pub mod filter;
pub mod force;
pub mod frames;
pub mod interpolator;
pub mod locator;
pub(crate) mod steering;

pub use frames::Model;

use haptograph_engine::node::BuildError;
use haptograph_surfaces::{Surface, TextureModel, files};
use std::path::Path;

/// The surface in a file named by the setting `surface`.
pub(crate) fn load_surface(path: &Path) -> Result<Surface, BuildError> {
    files::load(path).map_err(|error| {
        BuildError::at("surface", error.to_string())
            .help("give the path of a surface file, relative to the graph file")
    })
}

/// The texture of a surface, or an error if it has none.
pub(crate) fn load_texture(path: &Path) -> Result<TextureModel, BuildError> {
    let surface = load_surface(path)?;
    surface.texture.ok_or_else(|| {
        let message = format!("the surface {} has no texture", surface.name);
        BuildError::at("surface", message).help("choose a surface with one, or remove the texture nodes")
    })
}

/// One of the shipped surfaces, for tests.
#[cfg(test)]
pub(crate) fn tile() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/surfaces/t3-tile.ron")
}

/// A surface of the thesis's method, for tests.
#[cfg(test)]
pub(crate) fn plain() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/canvas-thesis.ron")
}
