//! A cursor over the toolkit's XML, which has only nested elements and text. It builds no tree, so that memory does not
//! grow with the file, and expands no entities.

use super::HattProblem;
use crate::files::Place;
use haptograph_signal::units::decimal;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

/// Reads forward through a text.
pub(crate) struct Cursor<'a> {
    text: &'a str,
    reader: Reader<&'a [u8]>,
    comments: Vec<String>,
}

/// An element that has begun.
pub(crate) struct Element {
    pub name: String,
    /// The `texture` attribute, which only the root of a model file has.
    pub texture: Option<String>,
}

enum Item {
    Begin(Element),
    End,
    Text(String),
    Eof,
}

/// Limits on stored comments and their bytes: enough for the label of an exported surface.
const COMMENTS: (usize, usize) = (4, 4096);

impl<'a> Cursor<'a> {
    pub(crate) fn new(text: &'a str) -> Self {
        let mut reader = Reader::from_str(text);
        reader.config_mut().expand_empty_elements = true;
        Cursor { text, reader, comments: Vec::new() }
    }

    /// The current location.
    pub(crate) fn place(&self) -> Place {
        let position = self.reader.buffer_position().max(self.reader.error_position());
        let mut position = usize::try_from(position).unwrap_or(usize::MAX).min(self.text.len());
        while !self.text.is_char_boundary(position) {
            position -= 1;
        }
        Place::after(&self.text[..position])
    }

    /// Comments so far.
    pub(crate) fn comments(&self) -> impl Iterator<Item = &str> {
        self.comments.iter().map(String::as_str)
    }

    /// The root element.
    pub(crate) fn root(&mut self) -> Result<Element, HattProblem> {
        loop {
            match self.item()? {
                Item::Begin(element) => return Ok(element),
                Item::Text(text) if is_blank(&text) => {}
                Item::Eof | Item::Text(_) | Item::End => return Err(HattProblem::NoRoot),
            }
        }
    }

    /// The next element within `parent`; `None` at its end.
    pub(crate) fn child(&mut self, parent: &str) -> Result<Option<Element>, HattProblem> {
        loop {
            match self.item()? {
                Item::Begin(element) => return Ok(Some(element)),
                Item::End => return Ok(None),
                Item::Text(text) if is_blank(&text) => {}
                Item::Text(_) => {
                    return Err(HattProblem::Stray { element: parent.to_owned() });
                }
                Item::Eof => {
                    return Err(HattProblem::Ends { element: parent.to_owned() });
                }
            }
        }
    }

    /// The text of the element `name`, to its end; it may have no elements inside.
    pub(crate) fn text(&mut self, name: &str) -> Result<String, HattProblem> {
        let mut whole = String::new();
        loop {
            match self.item()? {
                // The common case is one piece, which is not copied.
                Item::Text(text) if whole.is_empty() => whole = text,
                Item::Text(text) => whole.push_str(&text),
                Item::End => return Ok(whole),
                Item::Begin(_) => {
                    return Err(HattProblem::Stray { element: name.to_owned() });
                }
                Item::Eof => {
                    return Err(HattProblem::Ends { element: name.to_owned() });
                }
            }
        }
    }

    /// The number in the element `name`.
    pub(crate) fn number(&mut self, name: &str) -> Result<f64, HattProblem> {
        let text = self.text(name)?;
        text.trim().parse().map_err(|_| not_a_number(name, &text))
    }

    /// The number in the element `name`, in mm/s or mm, as one in m/s or m.
    pub(crate) fn thousandth(&mut self, name: &str) -> Result<f64, HattProblem> {
        let text = self.text(name)?;
        decimal::parse_thousandth(&text).ok_or_else(|| not_a_number(name, &text))
    }

    /// The `<value>`s of the list `name`, at most `most`, each read by `read`.
    pub(crate) fn values(
        &mut self,
        name: &'static str,
        most: usize,
        read: fn(&mut Self, &str) -> Result<f64, HattProblem>,
    ) -> Result<Vec<f64>, HattProblem> {
        let mut values = Vec::new();
        while let Some(element) = self.child(name)? {
            if element.name != "value" {
                return Err(HattProblem::Unknown { field: element.name, parent: name });
            }
            if values.len() == most {
                return Err(HattProblem::TooMany { field: name, most });
            }
            values.push(read(self, name)?);
        }
        values.shrink_to_fit();
        Ok(values)
    }

    /// Checks that nothing follows the root element.
    pub(crate) fn end(&mut self) -> Result<(), HattProblem> {
        loop {
            match self.item()? {
                Item::Eof => return Ok(()),
                Item::Text(text) if is_blank(&text) => {}
                _ => {
                    return Err(HattProblem::Stray { element: "the root element".to_owned() });
                }
            }
        }
    }

    fn item(&mut self) -> Result<Item, HattProblem> {
        loop {
            match self.reader.read_event().map_err(malformed)? {
                Event::Start(start) => return Ok(Item::Begin(element(&start)?)),
                Event::End(_) => return Ok(Item::End),
                Event::Text(text) => return Ok(Item::Text(text.decode().map_err(malformed)?.into_owned())),
                Event::CData(text) => return Ok(Item::Text(text.decode().map_err(malformed)?.into_owned())),
                Event::GeneralRef(reference) => {
                    let name = reference.decode().map_err(malformed)?.into_owned();
                    let character = match reference.resolve_char_ref().map_err(malformed)? {
                        Some(character) => Some(character.to_string()),
                        None => quick_xml::escape::resolve_predefined_entity(&name).map(str::to_owned),
                    };
                    return character.map(Item::Text).ok_or(HattProblem::Reference { name });
                }
                Event::Comment(comment) => {
                    if self.comments.len() < COMMENTS.0 && comment.len() <= COMMENTS.1 {
                        self.comments.push(comment.decode().map_err(malformed)?.into_owned());
                    }
                }
                Event::DocType(_) => return Err(HattProblem::DocumentType),
                Event::Eof => return Ok(Item::Eof),
                // `expand_empty_elements` leaves no `Empty`.
                Event::Decl(_) | Event::PI(_) | Event::Empty(_) => {}
            }
        }
    }
}

fn element(start: &BytesStart) -> Result<Element, HattProblem> {
    let name = String::from_utf8_lossy(start.name().as_ref()).into_owned();
    let mut texture = None;
    for attribute in start.attributes() {
        let attribute = attribute.map_err(malformed)?;
        if attribute.key.as_ref() == b"texture" {
            texture = Some(String::from_utf8_lossy(&attribute.value).into_owned());
        }
    }
    Ok(Element { name, texture })
}

fn malformed(error: impl std::fmt::Display) -> HattProblem {
    HattProblem::Xml { message: error.to_string() }
}

fn not_a_number(name: &str, text: &str) -> HattProblem {
    HattProblem::Number { field: name.to_owned(), text: text.chars().take(40).collect() }
}

fn is_blank(text: &str) -> bool {
    text.chars().all(char::is_whitespace)
}
