//! Surface files: reads and writes haptograph's RON and the XML of the Penn Haptic Texture Toolkit (HaTT).
//!
//! The content decides the format. Any bytes give a surface or an error with location and remedy, in time and memory
//! bounded by the file's size. Writing preserves every bit of every number.

pub mod hatt;
mod latest;
mod malformed;
pub mod native;

use crate::provenance::LICENCE;
use crate::{ModelError, Origin, Surface, SurfaceError, Taps, TextureError, TextureModel};
use haptograph_signal::files::{self, write_atomically};
use std::path::{Path, PathBuf};

pub use hatt::{HattProblem, HattWriteError};
pub use malformed::Malformed;

/// Most models in one texture of a file.
pub(crate) const MAX_MODELS: usize = 1024;
/// Most taps in a file.
pub(crate) const MAX_TAPS: usize = 1024;
/// Most samples in one tap of a file; 16 s at 1 kHz.
pub(crate) const MAX_TAP_SAMPLES: usize = 16_384;

/// Reads a surface from the bytes of a file in any supported format.
pub fn read_surface(bytes: &[u8]) -> Result<Surface, ReadError> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = String::from_utf8_lossy(&bytes[..error.valid_up_to()]);
        ReadError { place: Some(Place::after(&before)), problem: Problem::NotText }
    })?;
    // Windows editors write a byte order mark.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.trim_start().starts_with('<') { hatt::read(text) } else { native::read(text) }
}

/// Reads a surface from a file.
pub fn load(path: &Path) -> Result<Surface, FileError> {
    let bytes = files::read(path, files::MAX_SURFACE_BYTES)
        .map_err(|source| FileError::Io { path: path.to_owned(), source })?;
    let mut surface = latest::read(&bytes).map_err(|error| {
        let path = path.to_owned();
        match RECORDINGS.contains(&&*extension(&path)) {
            true => FileError::Recording { path },
            false => FileError::Read { path, error },
        }
    })?;
    if surface.name.is_empty() {
        // A tap file has the name of its material only in its file name.
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        surface.name = stem.strip_prefix("Taps_").unwrap_or(&stem).to_owned();
    }
    Ok(surface)
}

/// The extensions of recordings, of which none is a surface's.
const RECORDINGS: [&str; 6] = ["csv", "tsv", "npz", "wav", "mat", "xlsx"];

/// Checks that [`save`] supports the extension of a path.
pub fn check_extension(path: &Path) -> Result<(), SaveError> {
    match &*extension(path) {
        "ron" | "xml" => Ok(()),
        _ => Err(SaveError::Extension { path: path.to_owned() }),
    }
}

/// The extension in lower case.
fn extension(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_ascii_lowercase()
}

/// Writes a surface to `path`: as a toolkit file if it ends in `.xml` (models, or taps if there is no texture), as
/// haptograph's RON if it ends in `.ron`. Returns the parts of the surface that the format cannot store.
pub fn save(surface: &Surface, path: &Path) -> Result<Vec<&'static str>, SaveError> {
    let hatt = |error| SaveError::Hatt { path: path.to_owned(), error };
    let (text, left_out) = match &*extension(path) {
        "ron" => (native::write(surface), Vec::new()),
        "xml" if surface.texture.is_some() => {
            let text = hatt::write_models(surface).map_err(hatt)?;
            let layers =
                surface.texture.iter().flat_map(TextureModel::layers).map(|layer| (layer.kind().title, true));
            let fit = surface.friction.and_then(|friction| friction.r_squared());
            let fit = [("R² of friction", fit.is_some())];
            (text, present([("taps", surface.taps.is_some())].into_iter().chain(layers).chain(fit), surface))
        }
        "xml" => {
            let text = hatt::write_taps(surface).map_err(hatt)?;
            (
                text,
                present(
                    [
                        ("name", true),
                        ("friction", surface.friction.is_some()),
                        ("peak forces of taps", has_tap_forces(surface)),
                    ],
                    surface,
                ),
            )
        }
        _ => {
            return Err(SaveError::Extension { path: path.to_owned() });
        }
    };
    write_atomically(path, text.as_bytes())
        .map_err(|source| SaveError::Io { path: path.to_owned(), source })?;
    Ok(left_out)
}

fn has_tap_forces(surface: &Surface) -> bool {
    surface.taps.as_ref().is_some_and(Taps::has_forces)
}

/// The parts of a surface among these and among those that no toolkit file can store.
fn present(parts: impl IntoIterator<Item = (&'static str, bool)>, surface: &Surface) -> Vec<&'static str> {
    let parts = parts.into_iter().chain([("stiffness", surface.stiffness.is_some())]);
    parts.filter(|(_, present)| *present).map(|(part, _)| part).collect()
}

/// Merges two files of the same material, such as the toolkit's models and taps: each part comes from the file that has it.
/// The name is that of the first; sources and settings are those of both.
pub fn merge(first: Surface, second: Surface) -> Result<Surface, MergeError> {
    fn either<T>(first: Option<T>, second: Option<T>, part: &'static str) -> Result<Option<T>, MergeError> {
        match (first, second) {
            (Some(_), Some(_)) => Err(MergeError::Twice { part }),
            (first, second) => Ok(first.or(second)),
        }
    }
    if first.provenance.origin != second.provenance.origin {
        return Err(MergeError::Origins(first.provenance.origin, second.provenance.origin));
    }
    // What allows others to have the recording of one file says nothing of the other's.
    let copied = if first.texture.is_some() { &first } else { &second };
    let licence = copied.provenance.settings.get(LICENCE).cloned();
    let mut provenance = first.provenance;
    if provenance.source != second.provenance.source {
        provenance.source = format!("{}; {}", provenance.source, second.provenance.source);
    }
    for (name, value) in second.provenance.settings {
        provenance.settings.entry(name).or_insert(value);
    }
    provenance.settings.remove(LICENCE);
    provenance.settings.extend(licence.map(|licence| (LICENCE.to_owned(), licence)));
    Ok(Surface {
        name: if first.name.is_empty() { second.name } else { first.name },
        friction: either(first.friction, second.friction, "friction")?,
        taps: either(first.taps, second.taps, "taps")?,
        texture: either(first.texture, second.texture, "texture")?,
        stiffness: either(first.stiffness, second.stiffness, "stiffness")?,
        provenance,
    })
}

/// A place in a text, both counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: usize,
    /// Column, in characters.
    pub column: usize,
}

impl Place {
    /// The place after `before`.
    pub fn after(before: &str) -> Place {
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        Place {
            line: before.bytes().filter(|&byte| byte == b'\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
        }
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

/// An error in the content of a surface file, with its location.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadError {
    /// Location in the text, if the error has one.
    pub place: Option<Place>,
    /// The error.
    pub problem: Problem,
}

impl std::fmt::Display for ReadError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.place {
            Some(place) => write!(f, "{place}: {}", self.problem),
            None => write!(f, "{}", self.problem),
        }
    }
}

impl std::error::Error for ReadError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.problem)
    }
}

/// A problem in a surface file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// The file is not UTF-8.
    #[error("the file is not UTF-8 text; a surface file is haptograph's .ron or the toolkit's .xml")]
    NotText,
    /// The text does not follow the format.
    #[error(transparent)]
    Malformed(#[from] Malformed),
    /// Another version of the format.
    #[error(
        "the file has format {found}, but this version of haptograph reads format {}; use the version that wrote it, or a newer one",
        native::FORMAT
    )]
    Version {
        /// The version that the file names.
        found: u64,
    },
    /// A vertex names a filter that does not exist.
    #[error("vertex {vertex} names filter {filter}, but there are only {filters} filters, numbered from 0")]
    NoSuchFilter {
        /// The vertex's number, from 0.
        vertex: usize,
        /// The filter it names.
        filter: usize,
        /// Number of filters.
        filters: usize,
    },
    /// A filter without coefficients and without LSFs.
    #[error(
        "filter {filter} (from 0) has neither `ar` nor `ar_lsf`; give one of them (or both, if they agree)"
    )]
    EmptyFilter {
        /// The number of the filter, from 0.
        filter: usize,
    },
    /// A filter's numbers do not make a model.
    #[error("filter {filter} (from 0): {error}")]
    Filter {
        /// The number of the filter, from 0.
        filter: usize,
        /// The reason.
        error: ModelError,
    },
    /// A vertex's numbers do not make a model.
    #[error("vertex {vertex} (from 0): {error}")]
    Vertex {
        /// The number of the vertex, from 0.
        vertex: usize,
        /// The reason.
        error: ModelError,
    },
    /// A layer under its name and an earlier one.
    #[error("the texture has the layer `{layer}` twice, once under an earlier name; leave out one of them")]
    Twice {
        /// The layer's name.
        layer: &'static str,
    },
    /// The models do not make a texture.
    #[error(transparent)]
    Texture(#[from] TextureError),
    /// Another part is invalid.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// A toolkit file does not follow its format.
    #[error(transparent)]
    Hatt(#[from] HattProblem),
}

/// An error of reading a surface file.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// An error of the file system.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is a recording.
    #[error(
        "{0} is a recording, not a surface; learn one from it: haptograph learn {0} -o {1}",
        path.display(), path.with_extension("ron").display()
    )]
    Recording {
        /// The file.
        path: PathBuf,
    },
    /// The content is not a surface.
    #[error("{}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The error in the content.
        error: ReadError,
    },
}

/// An error of writing a surface file.
#[derive(Debug, thiserror::Error)]
pub enum SaveError {
    /// The extension is not that of a supported format.
    #[error("cannot write {}: the extension must be .ron (haptograph) or .xml (the toolkit)", path.display())]
    Extension {
        /// The file.
        path: PathBuf,
    },
    /// The toolkit's format cannot store it.
    #[error("{}: {error}", path.display())]
    Hatt {
        /// The file.
        path: PathBuf,
        /// The reason.
        error: HattWriteError,
    },
    /// An error of the file system.
    #[error("cannot write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// An error of merging two surfaces.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MergeError {
    /// Both have the same part.
    #[error("both surfaces have {part}; only files with different parts of one material can be merged")]
    Twice {
        /// The part.
        part: &'static str,
    },
    /// The surfaces have different origins.
    #[error("one surface is {}, the other {}; surfaces of different origins cannot be merged", _0.as_str(), _1.as_str())]
    Origins(Origin, Origin),
}
