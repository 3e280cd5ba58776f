//! `haptograph lsp`: a server for editors that speaks the Language Server Protocol on standard input and
//! output. Findings, completion and explanations come from the same checks and declarations as every other
//! command.

mod text;
mod wire;

use super::Failure;
use crate::engine::diagnostic::{Diagnostic, Diagnostics, Severity, Span};
use crate::engine::document::Document;
use crate::engine::graph::{CheckOptions, Graph, check};
use crate::engine::registry::Registry;
use crate::engine::settings::{Part, SettingSpec, Settings};
use crate::report::reference::{self, Listed};
use haptograph_study::check::{Checked, StudyError};
use haptograph_study::document::Study;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::io::{BufRead, Write};
use std::path::{Path, PathBuf};
use text::{Context, Positions, context, word_at};

/// Serve an editor: findings during typing, completion and explanations of graphs
///
/// Speaks the Language Server Protocol on standard input and output; docs/editors.md describes the set-up of
/// VS Code and Helix.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {}

pub(super) fn run(_: &Arguments, registry: &Registry) -> Result<(), Failure> {
    let mut server = Server { registry, texts: HashMap::new(), is_shut: false };
    let (mut input, mut output) = (std::io::stdin().lock(), std::io::stdout().lock());
    server
        .serve(&mut input, &mut output)
        .map_err(|error| Failure::Message(format!("cannot read the editor's messages: {error}")))
}

/// The documents that an editor has open.
struct Server<'r> {
    registry: &'r Registry,
    texts: HashMap<String, Open>,
    is_shut: bool,
}

/// An open document.
#[derive(Default)]
struct Open {
    text: String,
    /// The outputs that can be connected, with kind and quantity, from the last text without errors.
    outputs: Vec<(String, String)>,
}

/// Constants of the protocol.
const METHOD_NOT_FOUND: i32 = -32601;
const INVALID_REQUEST: i32 = -32600;
const ERROR: u8 = 1;
const WARNING: u8 = 2;
const FULL_TEXT: u8 = 1;
const KIND_CLASS: u8 = 7;
const KIND_FIELD: u8 = 5;
const KIND_VALUE: u8 = 12;
const SNIPPET: u8 = 2;

impl Server<'_> {
    /// Serves until the editor sends `exit` or closes the pipe.
    fn serve(&mut self, input: &mut impl BufRead, output: &mut impl Write) -> std::io::Result<()> {
        while let Some(message) = wire::read(input)? {
            let method = message["method"].as_str().unwrap_or_default();
            if method == "exit" {
                return Ok(());
            }
            for answer in self.answer(method, &message) {
                wire::write(output, &answer)?;
            }
        }
        Ok(())
    }

    fn answer(&mut self, method: &str, message: &Value) -> Vec<Value> {
        let (id, params) = (&message["id"], &message["params"]);
        let document = &params["textDocument"];
        let address = document["uri"].as_str().unwrap_or_default();
        let reply = |result: Value| vec![json!({ "jsonrpc": "2.0", "id": id, "result": result })];
        let refuse = |code: i32, why: &str| {
            vec![json!({ "jsonrpc": "2.0", "id": id, "error": { "code": code, "message": why } })]
        };
        match method {
            "initialize" => reply(capabilities()),
            "shutdown" => {
                self.is_shut = true;
                reply(Value::Null)
            }
            _ if self.is_shut && !id.is_null() => refuse(INVALID_REQUEST, "the server was shut down"),
            "textDocument/didOpen" => self.take(address, document["text"].as_str()),
            "textDocument/didChange" => {
                let changes = params["contentChanges"].as_array();
                let last = changes.and_then(|changes| changes.last());
                self.take(address, last.and_then(|change| change["text"].as_str()))
            }
            "textDocument/didClose" => {
                self.texts.remove(address);
                vec![published(address, Vec::new())]
            }
            "textDocument/completion" => reply(self.complete(address, &params["position"])),
            "textDocument/hover" => reply(self.hover(address, &params["position"])),
            // Notifications get no response.
            _ if id.is_null() => Vec::new(),
            other => refuse(METHOD_NOT_FOUND, &format!("unsupported method `{other}`")),
        }
    }

    /// Stores the present text of a document; returns its findings.
    fn take(&mut self, address: &str, text: Option<&str>) -> Vec<Value> {
        let Some(text) = text else { return Vec::new() };
        let open = self.texts.entry(address.to_owned()).or_default();
        text.clone_into(&mut open.text);
        let path = path_of(address);
        let parsed = (!is_study(text)).then(|| Document::parse(&path, text));
        let findings = match parsed {
            None => study_findings(&path, text, self.registry),
            Some(Err(findings)) => findings,
            Some(Ok(document)) => match check(&document, self.registry, &CheckOptions::default()) {
                Err(findings) => findings,
                Ok(graph) => {
                    open.outputs = connectable(&graph);
                    super::warnings(&graph)
                }
            },
        };
        let positions = Positions::of(text);
        let shown = findings.list.iter().map(|finding| shown(finding, &findings, &path, &positions));
        vec![published(address, shown.collect())]
    }

    /// Completions at a position.
    fn complete(&self, address: &str, position: &Value) -> Value {
        let Some((text, at)) = self.place(address, position) else {
            return json!([]);
        };
        match context(text, at) {
            Context::Connection => self.connections(address, text, at),
            Context::Fields(kind) if is_study(text) => {
                study_part(&kind).iter().flat_map(|part| part.fields.iter().map(completion)).collect()
            }
            Context::Fields(kind) => self.fields(&kind),
            Context::Other if is_study(text) => study_choices(),
            Context::Other => self.kinds(),
        }
    }

    /// Outputs of nodes, then other quoted names; each replaces what is between the quote and the position.
    fn connections(&self, address: &str, text: &str, at: usize) -> Value {
        let known = self.texts.get(address).map_or(&[][..], |open| &open.outputs);
        let begun = text[..at].rfind('"').map_or(at, |quote| quote + 1);
        let range = Positions::of(text).range(begun, at);
        let item = |name: &str, detail: &str| {
            json!({
                "label": name, "kind": KIND_VALUE, "detail": detail, "filterText": name,
                "textEdit": { "range": range, "newText": name },
            })
        };
        let node = |output: &str| output.split('.').next().unwrap_or_default().to_owned();
        let nodes: Vec<String> = known.iter().map(|(output, _)| node(output)).collect();
        let others = names(text).into_iter().filter(|name| !nodes.iter().any(|node| node == name));
        let outputs = known.iter().map(|(output, detail)| item(output, detail));
        outputs.chain(others.map(|name| item(name, ""))).collect()
    }

    /// The kinds of nodes and devices.
    fn kinds(&self) -> Value {
        let item = |kind: Listed| {
            let insert = format!("{}($0)", kind.name);
            // Names in other programs find it, too.
            let filter =
                kind.name.to_owned() + kind.doc.split_once("Elsewhere:").map_or("", |(_, names)| names);
            json!({
                "label": kind.name, "kind": KIND_CLASS, "detail": kind.group, "documentation": kind.doc,
                "filterText": filter, "insertText": insert, "insertTextFormat": SNIPPET,
            })
        };
        let nodes = self.registry.nodes().iter().map(Listed::from);
        nodes.chain(self.registry.devices().iter().map(Listed::from)).map(item).collect()
    }

    /// The inputs and settings of a kind.
    fn fields(&self, kind: &str) -> Value {
        if let Some(entry) = self.registry.node(kind) {
            let inputs = entry.spec.inputs.iter().map(|port| {
                let detail = format!("input: {}", reference::quantity_rule(port.quantity));
                field(port.name, detail, port.doc)
            });
            return inputs.chain(entry.settings().iter().map(completion)).collect();
        }
        let device = self.registry.device(kind);
        device.map_or_else(|| json!([]), |entry| entry.settings().iter().map(completion).collect())
    }

    /// Explains the word at a position: a kind, or a field of the enclosing kind.
    fn hover(&self, address: &str, position: &Value) -> Value {
        let said = self.place(address, position).and_then(|(text, at)| {
            let word = word_at(text, at)?;
            if is_study(text) {
                return study_word(word, context(text, at));
            }
            let kind = reference::kind(self.registry, word);
            kind.or_else(|| match context(text, at) {
                Context::Fields(kind) => self.field(&kind, word),
                _ => None,
            })
        });
        said.map_or(Value::Null, |markdown| json!({ "contents": { "kind": "markdown", "value": markdown } }))
    }

    fn field(&self, kind: &str, name: &str) -> Option<String> {
        let node = self.registry.node(kind);
        let ports = node.as_ref().map_or(&[][..], |entry| entry.spec.inputs);
        if let Some(port) = ports.iter().find(|port| port.name == name) {
            let quantity = reference::quantity_rule(port.quantity);
            return Some(format!("`{name}`, an input of {kind} ({quantity}): {}", port.doc));
        }
        let settings = match node {
            Some(entry) => entry.settings(),
            None => self.registry.device(kind)?.settings(),
        };
        let setting = settings.iter().find(|setting| setting.name == name)?;
        Some(format!("`{name}` of {kind} ({}): {}", detail(setting), setting.doc))
    }

    /// The text of an open document, and the byte at a position in it.
    fn place(&self, address: &str, position: &Value) -> Option<(&str, usize)> {
        let text = self.texts.get(address)?.text.as_str();
        let number = |name: &str| usize::try_from(position[name].as_u64()?).ok();
        let at = Positions::of(text).byte(text, number("line")?, number("character")?);
        Some((text, at))
    }
}

/// A field to be completed.
fn field(name: &str, detail: String, doc: &str) -> Value {
    json!({
        "label": name, "kind": KIND_FIELD, "detail": detail, "documentation": doc, "insertText": format!("{name}: "),
    })
}

fn completion(setting: &SettingSpec) -> Value {
    field(setting.name, detail(setting), &setting.doc)
}

/// True for a file that holds a study.
fn is_study(text: &str) -> bool {
    let first = text.lines().map(str::trim).find(|line| !line.is_empty() && !line.starts_with("//"));
    first.is_some_and(|line| line.starts_with("Study"))
}

fn study_findings(path: &Path, text: &str, registry: &Registry) -> Diagnostics {
    let checked = Checked::parse(path, text, None).and_then(|study| study.check_graph(registry));
    match checked {
        Err(StudyError::Study(findings)) => findings,
        Err(other) => Diagnostics {
            list: vec![Diagnostic::error("E0304", Span::default(), other.to_string())],
            ..Diagnostics::default()
        },
        Ok(()) => Diagnostics::default(),
    }
}

/// The parts of a study's file, choices within choices among them.
fn study_parts() -> Vec<Part> {
    let mut all = vec![Part::of_choice(Study::NAME, Study::DOC, Study::specs().to_vec())];
    let mut at = 0;
    while let Some(part) = all.get(at) {
        let inner: Vec<Part> = part.fields.iter().flat_map(|field| field.parts.clone()).collect();
        let new: Vec<Part> = inner.into_iter().filter(|part| !all.contains(part)).collect();
        all.extend(new);
        at += 1;
    }
    all
}

fn study_part(name: &str) -> Option<Part> {
    study_parts().into_iter().find(|part| part.choice == Some(name))
}

fn study_choices() -> Value {
    let choices = study_parts().into_iter().filter_map(|part| {
        let name = part.choice?;
        let insert = if part.fields.is_empty() { name.to_owned() } else { format!("{name}($0)") };
        Some(json!({
            "label": name, "kind": KIND_CLASS, "detail": "study", "documentation": part.doc, "insertText": insert,
            "insertTextFormat": SNIPPET,
        }))
    });
    choices.collect()
}

/// Explains a word of a study.
fn study_word(word: &str, context: Context) -> Option<String> {
    if let Some(part) = study_part(word) {
        return Some(format!("`{word}`: {}", part.doc));
    }
    let Context::Fields(kind) = context else { return None };
    let part = study_part(&kind)?;
    let setting = part.fields.iter().find(|setting| setting.name == word)?;
    Some(format!("`{word}` of {kind} ({}): {}", detail(setting), setting.doc))
}

fn detail(setting: &SettingSpec) -> String {
    let range = setting.range.map_or_else(String::new, |(low, high)| format!(", {low} to {high}"));
    let rate = if setting.below_nyquist { ", below half the rate" } else { "" };
    let unit = setting.unit.as_ref();
    let unit = unit.map_or_else(String::new, |unit| format!(", in {}", unit.symbol));
    match &setting.default {
        Some(default) => format!("{}{unit}{range}{rate}, default {default}", setting.expected),
        None => format!("{}{unit}{range}{rate}, required", setting.expected),
    }
}

fn capabilities() -> Value {
    json!({
        "capabilities": {
            "textDocumentSync": { "openClose": true, "change": FULL_TEXT },
            "completionProvider": { "triggerCharacters": ["(", ",", "\""] },
            "hoverProvider": true,
        },
        "serverInfo": { "name": "haptograph", "version": env!("CARGO_PKG_VERSION") },
    })
}

fn published(address: &str, findings: Vec<Value>) -> Value {
    json!({
        "jsonrpc": "2.0", "method": "textDocument/publishDiagnostics",
        "params": { "uri": address, "diagnostics": findings },
    })
}

/// A finding as the protocol's `Diagnostic`. A finding in an included file is placed at the start of this one
/// and names that file.
fn shown(finding: &Diagnostic, all: &Diagnostics, path: &Path, positions: &Positions) -> Value {
    let place = finding.primary.as_ref().map(|label| (label.span, label.text.as_str()));
    let file = place.and_then(|(span, _)| Some(all.sources.get(span.source)?.path.as_path()));
    let (span, elsewhere) = match (place, file) {
        (Some((span, _)), Some(file)) if file == path => (span, String::new()),
        (Some((span, _)), Some(file)) => {
            let (line, column) = all.sources.line_column(span);
            (Span::default(), format!("{}:{line}:{column}: ", file.display()))
        }
        _ => (Span::default(), String::new()),
    };
    let label = place.map_or("", |(_, text)| text);
    let help = finding.help.iter().map(|help| format!("\nhelp: {help}"));
    let mut message = format!("{elsewhere}{}", finding.message);
    if !label.is_empty() {
        message += &format!("\n{label}");
    }
    message.extend(help);
    json!({
        "range": positions.range(span.start, span.end), "source": "haptograph", "code": finding.code,
        "severity": match finding.severity { Severity::Error => ERROR, Severity::Warning => WARNING },
        "message": message,
    })
}

/// The outputs that a graph's own nodes have, as a connection names them.
fn connectable(graph: &Graph) -> Vec<(String, String)> {
    let own = graph.nodes().iter().filter(|node| !node.path.contains('/'));
    let outputs = own.flat_map(|node| {
        let is_only = node.outputs.len() == 1;
        node.outputs.iter().map(move |output| {
            let name = match is_only {
                true => node.path.clone(),
                false => format!("{}.{}", node.path, output.name),
            };
            (name, format!("{}, {}", output.kind, output.quantity))
        })
    });
    outputs.collect()
}

/// Names in a text, of nodes among others: quoted words before a colon.
fn names(text: &str) -> Vec<&str> {
    let mut names: Vec<&str> = text
        .split('"')
        .collect::<Vec<_>>()
        .windows(2)
        .skip(1)
        .step_by(2)
        .filter(|pair| pair[1].trim_start().starts_with(':'))
        .map(|pair| pair[0])
        .collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// The path of a `file://` URI.
fn path_of(address: &str) -> PathBuf {
    let written = address.strip_prefix("file://").unwrap_or(address).as_bytes();
    let (mut bytes, mut rest) = (Vec::with_capacity(written.len()), written);
    while let [byte, after @ ..] = rest {
        let digits = after.get(..2).and_then(|two| std::str::from_utf8(two).ok());
        let escaped = digits.and_then(|two| u8::from_str_radix(two, 16).ok()).filter(|_| *byte == b'%');
        bytes.push(escaped.unwrap_or(*byte));
        rest = if escaped.is_some() { &after[2..] } else { after };
    }
    PathBuf::from(String::from_utf8_lossy(&bytes).into_owned())
}

#[cfg(test)]
mod tests;
