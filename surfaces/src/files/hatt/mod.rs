//! The Penn Haptic Texture Toolkit's (HaTT) XML files: models and taps, in and out.
//!
//! A model file stores each filter twice, its coefficients with twenty decimals and its line spectral frequencies with
//! six, so that they agree to about 2e-5 only. Both are kept; rendering goes through the frequencies, as in the
//! toolkit ([`crate::ArmaModel`]). Which vertices were measured the file does not say; it follows from which filters
//! are repeated along the border of the map.
//!
//! Reading is strict: fields that are unknown, missing or given twice, counts that do not match and units other than
//! the toolkit's are errors. Writing obeys the toolkit's rules (order of fields, triangles numbered from 1,
//! `type="array"`) and gives each number the shortest decimal that reads back to the same bits. What the toolkit has no
//! field for, the kind of data behind the surface, is written as a comment, and read back from it.

mod cursor;
mod kinds;
mod models;
mod taps;
mod write;

pub(crate) use cursor::Cursor;
pub use write::{write_models, write_taps};

use super::{Problem, ReadError};
use crate::{Origin, Provenance, Surface};

/// The rate of the toolkit's taps.
pub const TAP_RATE_HZ: f64 = 1000.0;
/// Samples of each of the toolkit's taps.
pub const TAP_SAMPLES: usize = 100;

/// Fields of a model file that no surface needs, but its toolkit does: kept among the settings of the provenance.
const KEPT: [&str; 5] = [
    "htmlPicture",
    "htmlLinuxPicture",
    "renderPicture",
    "DTpicture",
    "LinuxDTpicture",
];

/// Begins the comment that says where a surface comes from.
const LABEL: &str = "haptograph surface: ";

/// A surface from the text of a model or tap file.
pub fn read(text: &str) -> Result<Surface, ReadError> {
    let mut cursor = Cursor::new(text);
    let surface = read_root(&mut cursor);
    surface.map_err(|problem| ReadError {
        place: Some(cursor.place()),
        problem,
    })
}

fn read_root(cursor: &mut Cursor) -> Result<Surface, Problem> {
    let root = cursor.root()?;
    let mut surface = match root.name.as_str() {
        "modelSet" => models::read(cursor, &root)?,
        "tapSet" => taps::read(cursor)?,
        _ => return Err(HattProblem::Root { found: root.name }.into()),
    };
    cursor.end()?;
    if let Some((origin, source, made_by)) = cursor.comments().find_map(parse_label) {
        surface.provenance = Provenance {
            origin,
            source,
            version: made_by,
            ..surface.provenance
        };
    }
    Ok(surface)
}

/// The comment that labels an exported surface; dashes that would end it are bent.
fn label(provenance: &Provenance) -> String {
    let origin = provenance.origin.as_str();
    let label = format!(
        "{LABEL}{origin}; made by {}; from {}",
        provenance.version, provenance.source
    );
    label.replace("--", "-\u{2010}").replace(char::is_control, " ")
}

fn parse_label(comment: &str) -> Option<(Origin, String, String)> {
    let (origin, rest) = comment.trim().strip_prefix(LABEL)?.split_once("; made by ")?;
    let (made_by, source) = rest.split_once("; from ")?;
    Some((
        origin.parse::<Origin>().ok()?,
        source.to_owned(),
        made_by.to_owned(),
    ))
}

/// What may be wrong with a toolkit file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HattProblem {
    /// Not well-formed XML.
    #[error("this is not well-formed XML: {message}")]
    Xml {
        /// What the parser says.
        message: String,
    },
    /// The file ends too early.
    #[error("the file ends inside <{element}>")]
    Ends {
        /// The element that is open.
        element: String,
    },
    /// A document type, whose entities could grow without bound.
    #[error("the file declares a document type; the toolkit's files have none, remove the <!DOCTYPE ...>")]
    DocumentType,
    /// A reference other than the predefined ones.
    #[error("&{name}; is not one of XML's own references")]
    Reference {
        /// The reference's name.
        name: String,
    },
    /// XML of another kind.
    #[error("the root element is <{found}>; surfaces are in <modelSet> or <tapSet> files")]
    Root {
        /// Its name.
        found: String,
    },
    /// Something after the root element, or text where only elements belong.
    #[error("text or an element where none belongs, in or after <{element}>")]
    Stray {
        /// The element around or before it.
        element: String,
    },
    /// An element that the format does not have there.
    #[error("<{parent}> has no field <{field}>")]
    Unknown {
        /// The element.
        field: String,
        /// The element it stands in.
        parent: &'static str,
    },
    /// An element given twice.
    #[error("<{field}> is given twice in the same <{parent}>")]
    Repeated {
        /// The element.
        field: &'static str,
        /// The element it stands in.
        parent: &'static str,
    },
    /// An element that is missing.
    #[error("this <{parent}> has no <{field}>")]
    Missing {
        /// The element.
        field: &'static str,
        /// The element it should stand in.
        parent: &'static str,
    },
    /// Text that is not a number.
    #[error("<{field}> has \"{text}\" where a number belongs")]
    Number {
        /// The element.
        field: String,
        /// Its text, shortened.
        text: String,
    },
    /// Too many entries.
    #[error("<{field}> occurs, or has values, more than {most} times")]
    TooMany {
        /// The element.
        field: &'static str,
        /// The most there may be.
        most: usize,
    },
    /// A number that does not match what it describes.
    #[error("<{field}> is {says}, but the file has {has}")]
    Mismatch {
        /// The element.
        field: &'static str,
        /// What it says.
        says: f64,
        /// What is so.
        has: f64,
    },
    /// Units other than the toolkit's.
    #[error("<{field}> is \"{found}\"; only \"{expected}\" is read")]
    Units {
        /// The element.
        field: &'static str,
        /// Its text.
        found: String,
        /// The toolkit's unit.
        expected: &'static str,
    },
    /// A polynomial that does not begin with 1.
    #[error("the first <{field}> must be 1, as the polynomial is monic")]
    Monic {
        /// The element.
        field: &'static str,
    },
}

/// Why a surface cannot be written as a toolkit file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HattWriteError {
    /// A model file needs a texture.
    #[error("the surface has no texture, and a toolkit model file is nothing else; write a .ron")]
    NoTexture,
    /// The toolkit knows plain delays only.
    #[error(
        "a toolkit model file has no place for a warped texture; write a .ron, or learn with the thesis's method"
    )]
    Warped,
    /// A model file needs a friction coefficient.
    #[error("a toolkit model file needs a friction coefficient, and the surface has none; write a .ron")]
    NoFriction,
    /// A tap file needs taps.
    #[error("the surface has no taps, and a toolkit tap file is nothing else; write a .ron")]
    NoTaps,
    /// The toolkit's taps have one rate and length.
    #[error(
        "toolkit taps have {TAP_SAMPLES} samples at {TAP_RATE_HZ} Hz, these have {samples} at {rate_hz} Hz; write a .ron"
    )]
    TapShape {
        /// Samples of each tap.
        samples: usize,
        /// Their rate.
        rate_hz: f64,
    },
    /// XML cannot hold some control characters.
    #[error("the name {name:?} has characters that XML cannot hold; rename the surface")]
    Name {
        /// The name.
        name: String,
    },
}

#[cfg(test)]
pub(crate) mod real_files;
#[cfg(test)]
mod tests;
