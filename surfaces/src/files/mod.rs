//! Surface files: haptograph's own RON and the Penn Haptic Texture Toolkit's (HaTT) XML, in and out.
//!
//! Files are told apart by content. Reading is total: any bytes give a surface or an error that says where and what
//! to do, in time and memory bounded by the file's size. Writing keeps every bit of every number.

pub mod decimal;
pub mod hatt;
pub mod native;
mod write;

use crate::{ModelError, Origin, Surface, SurfaceError, Taps, TextureError};
use haptograph_signal::files;
use std::path::{Path, PathBuf};

pub use hatt::{HattProblem, HattWriteError};
pub use write::write_atomically;
pub(crate) use write::{TEMPORARY, write_atomically_by};

/// More models than this in one texture, or samples in one tap, are refused when reading a file.
pub const MAX_MODELS: usize = 1024;
/// See [`MAX_MODELS`].
pub const MAX_TAPS: usize = 1024;
/// See [`MAX_MODELS`]; 16 s at 1 kHz.
pub const MAX_TAP_SAMPLES: usize = 16_384;
/// Larger files are not read, bytes.
pub const MAX_FILE_BYTES: u64 = 64 << 20;

/// A surface from the bytes of any file that haptograph reads.
pub fn read_surface(bytes: &[u8]) -> Result<Surface, ReadError> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = String::from_utf8_lossy(&bytes[..error.valid_up_to()]);
        ReadError {
            place: Some(Place::after(&before)),
            problem: Problem::NotText,
        }
    })?;
    // A byte order mark is what Windows editors put first.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.trim_start().starts_with('<') {
        hatt::read(text)
    } else {
        native::read(text)
    }
}

/// A surface from a file.
pub fn load(path: &Path) -> Result<Surface, FileError> {
    let bytes = files::read(path, MAX_FILE_BYTES).map_err(|source| FileError::Io {
        path: path.to_owned(),
        source,
    })?;
    let read = read_surface(&bytes);
    let mut surface = read.map_err(|error| FileError::Read {
        path: path.to_owned(),
        error,
    })?;
    if surface.name.is_empty() {
        // A tap file names its material in its own name alone.
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        surface.name = stem.strip_prefix("Taps_").unwrap_or(&stem).to_owned();
    }
    Ok(surface)
}

/// Whether [`save`] knows the format that a path's extension stands for.
pub fn check_extension(path: &Path) -> Result<(), SaveError> {
    match &*extension(path) {
        "ron" | "xml" => Ok(()),
        _ => Err(SaveError::Extension {
            path: path.to_owned(),
        }),
    }
}

/// In lower case.
fn extension(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_ascii_lowercase()
}

/// Writes a surface to `path`: as a toolkit file if it ends in `.xml` (models, or taps if there is no texture), as
/// haptograph's own if in `.ron`. Returns the parts of the surface that the format has no place for.
pub fn save(surface: &Surface, path: &Path) -> Result<Vec<&'static str>, SaveError> {
    let hatt = |error| SaveError::Hatt {
        path: path.to_owned(),
        error,
    };
    let (text, left_out) = match &*extension(path) {
        "ron" => (native::write(surface), Vec::new()),
        "xml" if surface.texture.is_some() => {
            let text = hatt::write_models(surface).map_err(hatt)?;
            let fit = surface.friction.and_then(|friction| friction.r_squared());
            let crackles = surface
                .texture
                .as_ref()
                .is_some_and(|texture| texture.crackle().is_some());
            let has_lines = surface
                .texture
                .as_ref()
                .is_some_and(|texture| !texture.lines().is_empty());
            (
                text,
                present(
                    [
                        ("taps", surface.taps.is_some()),
                        ("crackle", crackles),
                        ("lines fixed in space", has_lines),
                        ("R² of friction", fit.is_some()),
                    ],
                    surface,
                ),
            )
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
            return Err(SaveError::Extension {
                path: path.to_owned(),
            });
        }
    };
    write_atomically(path, text.as_bytes()).map_err(|source| SaveError::Io {
        path: path.to_owned(),
        source,
    })?;
    Ok(left_out)
}

fn has_tap_forces(surface: &Surface) -> bool {
    surface.taps.as_ref().is_some_and(Taps::has_forces)
}

/// Which parts a surface has of these and of those that no toolkit file holds.
fn present<const N: usize>(parts: [(&'static str, bool); N], surface: &Surface) -> Vec<&'static str> {
    let parts = parts
        .into_iter()
        .chain([("stiffness", surface.stiffness.is_some())]);
    parts
        .filter(|(_, present)| *present)
        .map(|(part, _)| part)
        .collect()
}

/// One surface of two files of the same material, such as the toolkit's models and taps: each part from the file that
/// has it. The name is the first's, the sources and settings are both's.
pub fn merge(first: Surface, second: Surface) -> Result<Surface, MergeError> {
    fn either<T>(first: Option<T>, second: Option<T>, part: &'static str) -> Result<Option<T>, MergeError> {
        match (first, second) {
            (Some(_), Some(_)) => Err(MergeError::Twice { part }),
            (first, second) => Ok(first.or(second)),
        }
    }
    if first.provenance.origin != second.provenance.origin {
        return Err(MergeError::Origins(
            first.provenance.origin,
            second.provenance.origin,
        ));
    }
    let mut provenance = first.provenance;
    if provenance.source != second.provenance.source {
        provenance.source = format!("{}; {}", provenance.source, second.provenance.source);
    }
    for (name, value) in second.provenance.settings {
        provenance.settings.entry(name).or_insert(value);
    }
    Ok(Surface {
        name: if first.name.is_empty() {
            second.name
        } else {
            first.name
        },
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
    /// The place that follows `before`.
    pub(crate) fn after(before: &str) -> Place {
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

/// Why bytes are not a surface, and where.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadError {
    /// Where in the text, if it is about one place.
    pub place: Option<Place>,
    /// What is wrong.
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

/// What may be wrong with a surface file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// Not UTF-8.
    #[error("this is not UTF-8 text; a surface is haptograph's .ron or the toolkit's .xml")]
    NotText,
    /// The text does not follow the format.
    #[error("{message}")]
    Syntax {
        /// What the parser found and what it expected.
        message: String,
    },
    /// A graph file in the place of a surface file.
    #[error("this file is a graph; a surface begins with `Surface(`")]
    Graph,
    /// Another version of the format.
    #[error(
        "the file is of format {found}, this haptograph reads format {}; use the haptograph that wrote it, or a newer one",
        native::FORMAT
    )]
    Version {
        /// The version that the file names.
        found: u64,
    },
    /// A vertex names a filter that does not exist.
    #[error("vertex {vertex} names filter {filter}, but there are {filters}, numbered from 0")]
    NoSuchFilter {
        /// The vertex's number, from 0.
        vertex: usize,
        /// The filter it names.
        filter: usize,
        /// How many there are.
        filters: usize,
    },
    /// A filter without coefficients and without LSFs.
    #[error(
        "filter {filter} (from 0) has neither `ar` nor `ar_lsf`; give one of them (or both, if they agree)"
    )]
    EmptyFilter {
        /// Its number, from 0.
        filter: usize,
    },
    /// A filter's numbers do not make a model.
    #[error("filter {filter} (from 0): {error}")]
    Filter {
        /// Its number, from 0.
        filter: usize,
        /// Why.
        error: ModelError,
    },
    /// A vertex's numbers do not make a model.
    #[error("vertex {vertex} (from 0): {error}")]
    Vertex {
        /// Its number, from 0.
        vertex: usize,
        /// Why.
        error: ModelError,
    },
    /// The models do not make a texture.
    #[error(transparent)]
    Texture(#[from] TextureError),
    /// Another part is not sound.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// A toolkit file does not follow its format.
    #[error(transparent)]
    Hatt(#[from] HattProblem),
}

/// Why a surface file could not be read.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file system refuses.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Its content is not a surface.
    #[error("{}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What is wrong in it.
        error: ReadError,
    },
}

/// Why a surface could not be written.
#[derive(Debug, thiserror::Error)]
pub enum SaveError {
    /// The extension tells the format.
    #[error("{}: a surface is written as .ron (haptograph) or .xml (the toolkit); name the file so", path.display())]
    Extension {
        /// The file asked for.
        path: PathBuf,
    },
    /// The toolkit's format cannot hold it.
    #[error("{}: {error}", path.display())]
    Hatt {
        /// The file asked for.
        path: PathBuf,
        /// Why.
        error: HattWriteError,
    },
    /// The file system refuses.
    #[error("cannot write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// Why two surfaces are not parts of one.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MergeError {
    /// Both have the same part.
    #[error("both surfaces have {part}; merge files with different parts of one material")]
    Twice {
        /// The part.
        part: &'static str,
    },
    /// One surface has one kind of data behind it.
    #[error("one surface is {}, the other {}; they do not make one", _0.word(), _1.word())]
    Origins(Origin, Origin),
}
