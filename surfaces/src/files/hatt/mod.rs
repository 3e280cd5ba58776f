//! Reads and writes the XML files of the Penn Haptic Texture Toolkit (HaTT): models and taps.
//!
//! A model file stores each filter twice, its coefficients with twenty decimals and its line spectral frequencies with
//! six, so that they agree only to about 2e-5. Both are stored; rendering uses the frequencies, as in the toolkit
//! ([`crate::ArmaModel`]). The file does not state which vertices were measured; it follows from the filters that are
//! repeated along the border of the map.
//!
//! Reading is strict: unknown, missing and duplicate fields, wrong counts and units other than the toolkit's are errors.
//! Writing follows the toolkit's rules (order of fields, triangles numbered from 1, `type="array"`) and writes each number
//! as the shortest decimal that reads back to the same bits. The origin of the surface, for which the toolkit has no field,
//! is stored in a comment.

mod cursor;
mod kinds;
mod models;
mod taps;
mod write;

pub(crate) use cursor::Cursor;
pub use write::{Xml, write_models, write_taps};

use super::{Problem, ReadError};
use crate::{Origin, Provenance, Surface};

/// The rate of the toolkit's taps, Hz.
pub(crate) const TAP_RATE_HZ: f64 = 1000.0;
/// Samples of each of the toolkit's taps.
pub(crate) const TAP_SAMPLES: usize = 100;

/// Fields of a model file that only the toolkit needs; they are stored in the settings of the provenance.
const KEPT: [&str; 5] = ["htmlPicture", "htmlLinuxPicture", "renderPicture", "DTpicture", "LinuxDTpicture"];

/// The start of the comment with the origin.
const LABEL: &str = "haptograph ";

/// Reads a surface from the text of a model or tap file.
pub fn read(text: &str) -> Result<Surface, ReadError> {
    let mut cursor = Cursor::new(text);
    let surface = read_root(&mut cursor);
    surface.map_err(|problem| ReadError { place: Some(cursor.place()), problem })
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
        surface.provenance = Provenance { origin, source, version: made_by, ..surface.provenance };
    }
    Ok(surface)
}

/// The comment that labels an exported surface or recording; double dashes, which would end it, are replaced.
fn label(kind: &str, provenance: &Provenance) -> String {
    let origin = provenance.origin.as_str();
    let label =
        format!("{LABEL}{kind}: {origin}; made by {}; from {}", provenance.version, provenance.source);
    label.replace("--", "-\u{2010}").replace(char::is_control, " ")
}

/// The origin, the source and the maker by such a comment.
pub fn parse_label(comment: &str) -> Option<(Origin, String, String)> {
    let (_kind, rest) = comment.trim().strip_prefix(LABEL)?.split_once(": ")?;
    let (origin, rest) = rest.split_once("; made by ")?;
    let (made_by, source) = rest.split_once("; from ")?;
    Some((origin.parse::<Origin>().ok()?, source.to_owned(), made_by.to_owned()))
}

/// A problem in a toolkit file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HattProblem {
    /// The file is not well-formed XML.
    #[error("the file is not well-formed XML: {message}")]
    Xml {
        /// The parser's message.
        message: String,
    },
    /// No element, or something else before it.
    #[error("the file does not begin with an element; surfaces are in <modelSet> or <tapSet> files")]
    NoRoot,
    /// The file ends too early.
    #[error("the file is incomplete: it ends inside <{element}>; copy it again")]
    Ends {
        /// The element that is open.
        element: String,
    },
    /// A document type, whose entities could grow without bound.
    #[error("the file declares a document type, which toolkit files do not have; remove the <!DOCTYPE ...>")]
    DocumentType,
    /// A reference other than the predefined ones.
    #[error("&{name}; is not one of XML's predefined references")]
    Reference {
        /// The reference's name.
        name: String,
    },
    /// XML of another kind.
    #[error("the root element is <{found}>; surfaces are in <modelSet> or <tapSet> files")]
    Root {
        /// The name.
        found: String,
    },
    /// Content after the root element, or text between elements.
    #[error("unexpected text or element in or after <{element}>")]
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
    #[error("<{field}> is \"{text}\"; expected a number")]
    Number {
        /// The element.
        field: String,
        /// The text, shortened.
        text: String,
    },
    /// Too many entries.
    #[error("<{field}> occurs, or has values, more than {most} times")]
    TooMany {
        /// The element.
        field: &'static str,
        /// The limit.
        most: usize,
    },
    /// A number that does not match what it describes.
    #[error("<{field}> is {stated}, but the file has {actual}")]
    Mismatch {
        /// The element.
        field: &'static str,
        /// The number in the element.
        stated: f64,
        /// The number in the file.
        actual: f64,
    },
    /// Units other than the toolkit's.
    #[error("<{field}> is \"{found}\"; expected \"{expected}\"")]
    Units {
        /// The element.
        field: &'static str,
        /// The text.
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

/// An error of writing a surface as a toolkit file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HattWriteError {
    /// A model file needs a texture.
    #[error("the surface has no texture, which a toolkit model file requires; write a .ron file")]
    NoTexture,
    /// The toolkit supports only plain delays.
    #[error(
        "a toolkit model file cannot store a warped texture; write a .ron file, or learn the texture by the method of the thesis"
    )]
    Warped,
    /// A model file needs a friction coefficient.
    #[error(
        "the surface has no friction coefficient, which a toolkit model file requires; write a .ron file"
    )]
    NoFriction,
    /// A tap file needs taps.
    #[error("the surface has no taps, which a toolkit tap file requires; write a .ron file")]
    NoTaps,
    /// The toolkit's taps have one rate and length.
    #[error(
        "the taps have {samples} samples at {rate_hz} Hz, but a toolkit file requires {TAP_SAMPLES} at {TAP_RATE_HZ} Hz; write a .ron file"
    )]
    TapShape {
        /// Samples of each tap.
        samples: usize,
        /// The rate.
        rate_hz: f64,
    },
    /// XML cannot store some control characters.
    #[error("the name {name:?} has characters that XML cannot store; rename the surface")]
    Name {
        /// The name.
        name: String,
    },
}

#[cfg(test)]
pub(crate) mod tests;
