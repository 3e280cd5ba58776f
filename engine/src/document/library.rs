//! The templates of a library, for listings.

use super::{Document, Template, load};
use crate::diagnostic::Span;
use crate::document::value::{Body, Shape, Tagged, Value};

/// A template that any graph can include.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LibraryTemplate {
    /// Name, used like that of a kind of node.
    pub name: String,
    /// The file to include: `std/texture.ron`.
    pub file: &'static str,
    /// Purpose of the template.
    pub about: String,
    /// Names of its inputs; all of them have to be connected.
    pub inputs: Vec<String>,
    /// Names of its settings, and their defaults as written; `None` for a setting that must be given.
    pub settings: Vec<(String, Option<String>)>,
    /// Names of its outputs.
    pub outputs: Vec<String>,
}

/// All templates of a library: files by name, each with its text.
pub fn templates(library: &[(&'static str, &'static str)]) -> Vec<LibraryTemplate> {
    let of_file = |(file, text): &(&'static str, &'static str)| {
        let document = load::parts_alone(file, text);
        let templates = document.templates.iter();
        templates.map(|template| described(&document, template, file)).collect::<Vec<_>>()
    };
    library.iter().flat_map(of_file).collect()
}

fn described(document: &Document, template: &Template, file: &'static str) -> LibraryTemplate {
    let settings = template.settings.iter();
    LibraryTemplate {
        name: template.name.text.clone(),
        file,
        about: template.about.clone(),
        inputs: template.inputs.iter().map(|input| input.text.clone()).collect(),
        settings: settings
            .map(|(name, default)| {
                let default = (!is_required(default)).then(|| written(document, default.span));
                (name.text.clone(), default)
            })
            .collect(),
        outputs: template.outputs.iter().map(|(name, _)| name.text.clone()).collect(),
    }
}

/// True if the value is the `Required` of a setting without a default.
pub(crate) fn is_required(default: &Value) -> bool {
    matches!(
        &default.shape,
        Shape::Tagged(Tagged { name: Some(name), body: Body::Bare }) if name.text == "Required"
    )
}

fn written(document: &Document, span: Span) -> String {
    let source = document.sources.get(span.source);
    let text = source.and_then(|source| source.text.get(span.start..span.end));
    text.unwrap_or_default().to_owned()
}
