//! Files into documents: inclusion, and the structure of `Graph(...)`, `Parts(...)` and `Template(...)`.

use super::value::{Body, Name, Shape, Tagged, Value};
use super::{Document, LoadOptions, SettingsFile, Template, folder, text as ron_text};
use crate::diagnostic::{Diagnostic, Diagnostics, MAX_SHOWN, SourceId, Sources, Span};
use crate::settings::{Expected, Fields, Form, Reading, Setting, Settings, closest, named_values, twice};
use haptograph_signal::files::{self, Refusal};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The version of the format that is read.
pub(super) const FORMAT: u64 = 1;
/// Prefix of the names of parts of the library; a folder of this name is written `./std/`.
const LIBRARY: &str = "std/";
/// Largest depth of files that include files.
const MAX_INCLUDE_DEPTH: usize = 32;

pub(super) fn file(path: &Path, options: &LoadOptions) -> Result<Document, Diagnostics> {
    match files::read_text(path, options.max_bytes) {
        Ok(text) => self::text(path, text.into(), options),
        Err(error) => {
            let diagnostic = Diagnostic::error(
                "E0108",
                Span::default(),
                format!("cannot read `{}`: {error}", path.display()),
            )
            .of_no_place();
            // It has no text, but a name.
            let mut sources = Sources::default();
            sources.add(path.to_path_buf(), Arc::from(""));
            let list = vec![diagnostic];
            Err(Diagnostics { sources, list })
        }
    }
}

/// A file that holds one `S(format: 1, ...)` and is no graph; `file` is its name in messages.
pub(super) fn settings<S: Settings>(
    path: &Path,
    text: Arc<str>,
    file: &str,
) -> Result<SettingsFile<S>, Diagnostics> {
    let mut sources = Sources::default();
    let id = sources.add(path.to_path_buf(), Arc::clone(&text));
    let mut loader = Loader::of(empty(sources));
    let content = ron_text::read(id, &text, &mut loader.document.findings).and_then(|value| {
        let mut fields = loader.structure(value, S::NAME, file)?;
        loader.format(&mut fields, S::NAME)?;
        loader.reading(|reading| {
            let content = S::take_from(&mut fields, reading);
            fields.finish(reading);
            content
        })
    });
    let Document { sources, findings, .. } = loader.document;
    match content.filter(|_| findings.is_empty()) {
        Some(content) => Ok(SettingsFile { sources, content }),
        None => Err(Diagnostics { sources, list: findings }),
    }
}

pub(super) fn text(path: &Path, text: Arc<str>, options: &LoadOptions) -> Result<Document, Diagnostics> {
    let (mut sources, mut list) = (Sources::default(), Vec::new());
    let id = sources.add(path.to_path_buf(), Arc::clone(&text));
    match ron_text::read(id, &text, &mut list) {
        Some(value) => self::value(sources, value, options),
        None => Err(Diagnostics { sources, list }),
    }
}

/// The document of the value of a graph file, whose text is the only source.
pub(super) fn value(sources: Sources, value: Value, options: &LoadOptions) -> Result<Document, Diagnostics> {
    let bytes: usize = sources.iter().map(|source| source.text.len()).sum();
    let open = sources.iter().map(|source| canonical(&source.path)).collect();
    let left_bytes = options.max_bytes.saturating_sub(bytes as u64);
    let mut loader = Loader { max_bytes: options.max_bytes, left_bytes, open, ..Loader::of(empty(sources)) };
    if loader.graph(value).is_none() {
        return Err(Diagnostics { sources: loader.document.sources, list: loader.document.findings });
    }
    Ok(loader.document)
}

/// A document with nothing in it yet.
fn empty(sources: Sources) -> Document {
    Document {
        sources,
        span: Span::default(),
        about: String::new(),
        seed: 0,
        parameters: Vec::new(),
        defaults: Vec::new(),
        clocks: Vec::new(),
        nodes: Vec::new(),
        endpoints: Vec::new(),
        templates: Vec::new(),
        library: Vec::new(),
        findings: Vec::new(),
    }
}

/// The templates of one file of the library, without those that it includes.
pub(super) fn parts_alone(name: &str, text: &str) -> Document {
    let mut sources = Sources::default();
    let id = sources.add_text(name, Arc::from(text));
    let mut loader = Loader::of(empty(sources));
    if let Some(value) = ron_text::read(id, text, &mut loader.document.findings) {
        loader.parts(value);
    }
    loader.document
}

/// Reads the parts of the library that a document includes, and those that they include.
pub(super) fn library(document: Document, library: &[(&'static str, &'static str)]) -> Document {
    let mut loader = Loader::of(document);
    let mut read = 0;
    while let Some(Name { text: name, span }) = loader.document.library.get(read).cloned() {
        read += 1;
        let Some((_, text)) = library.iter().find(|(known, _)| *known == name) else {
            let message = format!("the library has no parts `{name}`");
            let diagnostic = Diagnostic::error("E0108", span, message).label("included here");
            let known = library.iter().map(|(name, _)| *name);
            loader.report(match closest(&name, known.clone()) {
                Some(near) => diagnostic.help(format!("did you mean `{near}`?")),
                None => diagnostic.help(format!("it has {}", known.collect::<Vec<_>>().join(", "))),
            });
            continue;
        };
        let id = loader.document.sources.add_text(&name, Arc::from(*text));
        if let Some(value) = ron_text::read(id, text, &mut loader.document.findings) {
            loader.parts(value);
        }
    }
    loader.document
}

fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}

struct Loader {
    max_bytes: u64,
    /// Largest total size of the files still to be included.
    left_bytes: u64,
    document: Document,
    /// Files being read, outermost first.
    open: Vec<PathBuf>,
    /// Files that have been read, and parts of the library.
    loaded: HashSet<PathBuf>,
    /// The places of the names of the document's templates.
    templates: HashMap<String, Span>,
}

impl Loader {
    /// A loader that includes no files.
    fn of(document: Document) -> Self {
        let templates = document.templates.iter().map(|known| (known.name.text.clone(), known.name.span));
        let templates = templates.collect();
        let loaded = document.library.iter().map(|known| PathBuf::from(&known.text)).collect();
        Self { max_bytes: 0, left_bytes: 0, document, open: Vec::new(), loaded, templates }
    }

    fn report(&mut self, diagnostic: Diagnostic) {
        self.document.findings.push(diagnostic);
    }

    /// Calls `read` with a reader of settings that reports to the document's findings.
    fn reading<T>(&mut self, read: impl FnOnce(&mut Reading<'_>) -> T) -> T {
        let mut diagnostics = std::mem::take(&mut self.document.findings);
        let sources = &self.document.sources;
        let read = read(&mut Reading {
            diagnostics: &mut diagnostics,
            folder: &|span| folder(sources, span.source),
            files: &mut Vec::new(),
            setting: None,
            first_given: u32::MAX,
        });
        self.document.findings = diagnostics;
        read
    }

    /// Reports a value that is not of the expected type.
    fn mismatch<T>(&mut self, value: &Value, expected: &Expected) -> Option<T> {
        self.reading(|reading| reading.mismatch(value, expected));
        None
    }

    fn graph(&mut self, value: Value) -> Option<()> {
        if let Shape::Tagged(Tagged { name: Some(name), .. }) = &value.shape {
            self.document.span = name.span;
        }
        let mut fields = self.structure(value, "Graph", "a graph file")?;
        self.format(&mut fields, "Graph")?;
        if let Some(about) = self.field::<String>(&mut fields, "about") {
            self.document.about = about;
        }
        if let Some(seed) = self.field::<u64>(&mut fields, "seed") {
            self.document.seed = seed;
        }
        self.document.parameters = self.entries(&mut fields, "parameters", "parameter");
        for (set, value) in self.entries(&mut fields, "defaults", "set of endpoints") {
            let values = self.map(value, "parameter");
            self.document.defaults.push((set, values));
        }
        self.includes(&mut fields);
        self.document.clocks = self.entries(&mut fields, "clocks", "clock");
        self.document.nodes = self.entries(&mut fields, "nodes", "node");
        check_names(&self.document.nodes, "node", &mut self.document.findings);
        for (set, value) in self.entries(&mut fields, "endpoints", "set of endpoints") {
            let devices = self.map(value, "endpoint");
            self.document.endpoints.push((set, devices));
        }
        self.templates(&mut fields);
        self.reading(|reading| fields.finish(reading));
        Some(())
    }

    /// An included file: templates and further includes.
    fn parts(&mut self, value: Value) {
        let Some(mut fields) = self.structure(value, "Parts", "an included file") else {
            return;
        };
        if self.format(&mut fields, "Parts").is_none() {
            return;
        }
        let _: Option<String> = self.field(&mut fields, "about");
        self.includes(&mut fields);
        self.templates(&mut fields);
        self.reading(|reading| fields.finish(reading));
    }

    fn structure(&mut self, value: Value, name: &str, file: &str) -> Option<Fields> {
        let value = match value.shape {
            Shape::Tagged(Tagged { name: Some(written), body: Body::Fields(entries) })
                if written.text == name =>
            {
                let owner = format!("`{name}`");
                return Some(self.reading(|reading| Fields::new(owner, written.span, entries, reading)));
            }
            shape => Value { span: value.span, shape },
        };
        let mut at = value.span;
        let mut found = value.describe().to_owned();
        if let Shape::Tagged(Tagged { name: Some(written), .. }) = &value.shape {
            at = written.span;
            found = format!("`{}`", written.text);
        }
        let mut diagnostic =
            Diagnostic::error("E0110", at, format!("{file} holds one `{name}(...)`, found {found}"))
                .label(format!("expected `{name}(format: {FORMAT}, ...)`"));
        if found == "`Parts`" {
            diagnostic = diagnostic.help("parts are checked with a graph that includes them");
        }
        self.report(diagnostic);
        None
    }

    fn format(&mut self, fields: &mut Fields, owner: &str) -> Option<()> {
        let Some(value) = fields.take("format") else {
            self.report(
                Diagnostic::error("E0107", fields.span, "the version of the format is missing")
                    .label("`format` is missing")
                    .help(format!("begin with `{owner}(format: {FORMAT}, ...`")),
            );
            return Some(());
        };
        let version = self.reading(|reading| u64::read(&value, reading))?;
        if version != FORMAT {
            let message = format!("format {version} is not known");
            self.report(
                Diagnostic::error("E0107", value.span, message)
                    .label(format!("expected {FORMAT}"))
                    .help(format!("this program reads format {FORMAT}; is the file from a newer one?")),
            );
            // What follows would be judged by rules it was not written for.
            return None;
        }
        Some(())
    }

    fn field<T: Setting>(&mut self, fields: &mut Fields, name: &'static str) -> Option<T> {
        let value = fields.take(name)?;
        self.reading(|reading| T::read(&value, reading))
    }

    /// A field that is a map from names.
    fn entries(&mut self, fields: &mut Fields, name: &'static str, what: &str) -> Vec<(Name, Value)> {
        match fields.take(name) {
            Some(value) => self.map(value, what),
            None => Vec::new(),
        }
    }

    fn map(&mut self, value: Value, what: &str) -> Vec<(Name, Value)> {
        self.reading(|reading| named_values(value, what, reading))
    }

    fn includes(&mut self, fields: &mut Fields) {
        let Some(value) = fields.take("include") else {
            return;
        };
        let Shape::List(files) = &value.shape else {
            let expected = Expected::Described(Form::List, "a list of paths, [\"parts.ron\"]".into());
            self.mismatch::<()>(&value, &expected);
            return;
        };
        for file in files {
            // What is not shown is not looked for: a list of files that are not there must not take long.
            if self.document.findings.len() > MAX_SHOWN {
                return;
            }
            if let Shape::String(text) = &file.shape
                && text.starts_with(LIBRARY)
            {
                let (text, span) = (text.clone(), file.span);
                if self.loaded.insert(PathBuf::from(&text)) {
                    self.document.library.push(Name { span, text });
                }
                continue;
            }
            if let Some(path) = self.reading(|reading| PathBuf::read(file, reading)) {
                self.include(&path, file.span);
            }
        }
    }

    fn include(&mut self, path: &Path, span: Span) {
        let shown = path.display();
        let key = canonical(path);
        if self.open.contains(&key) {
            self.report(
                Diagnostic::error("E0109", span, format!("`{shown}` includes itself"))
                    .label("this file is being read")
                    .help("move what both need into a third file"),
            );
            return;
        }
        if self.open.len() >= MAX_INCLUDE_DEPTH {
            let message = format!("files include files more than {MAX_INCLUDE_DEPTH} deep");
            self.report(Diagnostic::error("E0109", span, message));
            return;
        }
        if !self.loaded.insert(key.clone()) {
            return;
        }
        let text = match files::read_text(path, self.left_bytes) {
            Ok(text) => text,
            Err(error) => return self.not_included(path, span, &error),
        };
        self.left_bytes -= text.len() as u64;
        let id: SourceId = self.document.sources.add(path.to_path_buf(), Arc::from(text.as_str()));
        if let Some(value) = ron_text::read(id, &text, &mut self.document.findings) {
            self.open.push(key);
            self.parts(value);
            self.open.pop();
        }
    }

    fn not_included(&mut self, path: &Path, span: Span, error: &std::io::Error) {
        let shown = path.display();
        let diagnostic = match Refusal::of(error) {
            Some(Refusal::TooLong { .. }) => {
                let most = self.max_bytes;
                let message = format!("with `{shown}`, the graph and its included files exceed {most} bytes");
                Diagnostic::error("E0108", span, message).help("include less, or split the graph")
            }
            _ => Diagnostic::error("E0108", span, format!("cannot read `{shown}`: {error}"))
                .help("paths are relative to the file in which they are written"),
        };
        self.report(diagnostic.label("included here"));
    }

    fn templates(&mut self, fields: &mut Fields) {
        for (name, value) in self.entries(fields, "templates", "template") {
            if let Some(known) = self.templates.get(&name.text) {
                self.report(twice(name.span, "template", &name.text, *known));
                continue;
            }
            let (text, span) = (name.text.clone(), name.span);
            if let Some(template) = self.template(name, &value) {
                self.templates.insert(text, span);
                self.document.templates.push(template);
            }
        }
    }

    fn template(&mut self, name: Name, value: &Value) -> Option<Template> {
        let mut fields = self.structure_named(value, "Template")?;
        let about = self.field(&mut fields, "about").unwrap_or_default();
        let inputs = match fields.take("inputs") {
            Some(value) => self.names(&value),
            None => Vec::new(),
        };
        let template = Template {
            name,
            about,
            inputs,
            settings: self.entries(&mut fields, "settings", "setting"),
            nodes: self.entries(&mut fields, "nodes", "node"),
            outputs: self.entries(&mut fields, "outputs", "output"),
        };
        self.reading(|reading| fields.finish(reading));
        check_names(&template.nodes, "node", &mut self.document.findings);
        check_names(&template.outputs, "output", &mut self.document.findings);
        for input in &template.inputs {
            if let Some((twice, _)) = template.settings.iter().find(|(name, _)| name.text == input.text) {
                let message = format!("`{}` is an input and a setting", input.text);
                let help = "rename one of them: both are fields of the template's uses";
                self.report(Diagnostic::declared_twice(twice.span, message, input.span).help(help));
            }
        }
        Some(template)
    }

    fn structure_named(&mut self, value: &Value, name: &str) -> Option<Fields> {
        match &value.shape {
            Shape::Tagged(Tagged { name: Some(written), body: Body::Fields(entries) })
                if written.text == name =>
            {
                let (span, entries) = (written.span, entries.clone());
                Some(self.reading(|reading| Fields::new(format!("`{name}`"), span, entries, reading)))
            }
            Shape::Tagged(Tagged { name: Some(written), .. }) if closest(&written.text, [name]).is_some() => {
                let expected = Expected::described(format!("`{name}(...)` with fields"));
                let at = Value { span: written.span, shape: value.shape.clone() };
                self.mismatch(&at, &expected)
            }
            _ => {
                let words = format!("`{name}(inputs: [...], nodes: {{...}}, outputs: {{...}})`");
                self.mismatch(value, &Expected::described(words))
            }
        }
    }

    /// A list of names, without repetition.
    fn names(&mut self, value: &Value) -> Vec<Name> {
        let Shape::List(items) = &value.shape else {
            let words = "a list of names, [\"force\", \"speed\"]";
            let expected = Expected::Described(Form::List, words.into());
            self.reading(|reading| reading.mismatch(value, &expected));
            return Vec::new();
        };
        let mut names: Vec<Name> = Vec::new();
        for item in items {
            let Some(text) = self.reading(|reading| String::read(item, reading)) else {
                continue;
            };
            if let Some(first) = names.iter().find(|name| name.text == text) {
                let message = format!("there are two inputs `{text}`");
                self.report(Diagnostic::declared_twice(item.span, message, first.span));
                continue;
            }
            names.push(Name { span: item.span, text });
        }
        names
    }
}

fn check_names(entries: &[(Name, Value)], what: &str, findings: &mut Vec<Diagnostic>) {
    findings.extend(entries.iter().filter_map(|(name, _)| refused_name(name, what)));
}

/// The error of a name that cannot be written in a connection, if it is one.
pub(crate) fn refused_name(name: &Name, what: &str) -> Option<Diagnostic> {
    let bad = |c: char| matches!(c, '.' | '/') || c.is_control();
    if !name.text.trim().is_empty() && !name.text.contains(bad) {
        return None;
    }
    let article = if what.starts_with('o') { "an" } else { "a" };
    let message = match name.text.trim() {
        "" => format!("{article} {what} needs a name"),
        text => format!("`{}` cannot be the name of {article} {what}", text.escape_debug()),
    };
    Some(
        Diagnostic::error("E0211", name.span, message)
            .label("not a name")
            .help("`.` separates node and port, `/` the parts of a path; use letters, digits, `_` or `-`"),
    )
}
