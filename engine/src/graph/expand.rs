//! Expansion of templates into nodes.

use super::context::{Context, Entries};
use super::declared::{Connected, Declared, Scope, Target};
use super::members;
use super::values::{Parameters, Place, is_replaced};
use crate::diagnostic::{Diagnostic, SourceId, Span};
use crate::document::Document;
use crate::document::library::{self, LibraryTemplate};
use crate::document::value::{Name, Shape, Tagged, Value};
use crate::node::{NodeEntry, Presence};
use crate::registry::Alias;
use crate::settings::{Fields, Setting};
use std::collections::{HashMap, HashSet};

/// Largest number of nodes: nested templates can expand to any number.
const MAX_NODES: usize = 1_000_000;
/// Largest nesting of templates.
const MAX_NESTING: usize = 64;

/// All nodes, templates expanded: the first form of a graph.
pub(super) struct Expanded {
    pub nodes: Vec<Connected>,
    /// The graph itself first, then every use of a template.
    pub scopes: Vec<Scope>,
}

/// Makes the nodes of the graph. Reports and omits nodes of unknown kinds; `None` if there are too many.
pub(super) fn expand(cx: &mut Context<'_>, parameters: &mut Parameters, endpoints: &str) -> Option<Expanded> {
    let document = cx.document;
    let graph = Expanded { nodes: Vec::with_capacity(document.nodes.len()), scopes: vec![Scope::default()] };
    let mut kinds = HashMap::with_capacity(cx.registry.nodes().len());
    for entry in cx.registry.nodes() {
        kinds.entry(entry.spec.name).or_insert(*entry);
    }
    let of_library = None;
    let mut expansion =
        Expansion { endpoints, kinds, of_library, templates: HashMap::new(), parameters, graph };
    for (i, template) in document.templates.iter().enumerate() {
        let name = &template.name;
        if cx.registry.node(&name.text).is_some() {
            let message = format!("a template cannot be called `{}`: that is a node kind", name.text);
            cx.report(
                Diagnostic::error("E0211", name.span, message)
                    .label("a template cannot replace it")
                    .help("give the template a name of its own"),
            );
        }
        expansion.templates.insert(name.text.clone(), i);
    }
    expansion.refuse_too_many(cx)?;
    expansion.fill(cx, 0, &document.nodes, &mut Vec::new())?;
    Some(expansion.graph)
}

/// Reports templates of the graph file that no node uses.
pub(super) fn warn_unused(cx: &mut Context<'_>, scopes: &[Scope]) {
    let used: HashSet<usize> = scopes.iter().filter_map(|scope| Some(scope.template?.0)).collect();
    for (i, template) in cx.document.templates.iter().enumerate() {
        // Templates of included files need not be used.
        if !used.contains(&i) && template.name.span.source == SourceId::default() {
            let message = format!("template `{}` is never used", template.name.text);
            cx.report(
                Diagnostic::warning("W0103", template.name.span, message)
                    .label("no node is of this kind")
                    .help("what is inside it is not checked until it is used"),
            );
        }
    }
}

struct Expansion<'a> {
    /// The set of endpoints that is selected.
    endpoints: &'a str,
    kinds: HashMap<&'static str, NodeEntry>,
    /// The templates of the library, once a message needs them.
    of_library: Option<Vec<LibraryTemplate>>,
    templates: HashMap<String, usize>,
    parameters: &'a mut Parameters,
    graph: Expanded,
}

/// What a scope declares under a name: `"name": Kind(entries)`.
#[derive(Clone, Copy)]
struct Entry<'v> {
    scope: usize,
    name: &'v Name,
    kind: &'v Name,
    entries: &'v Entries,
}

impl Expansion<'_> {
    /// Adds the nodes of a scope. `open` are the templates being expanded, outermost first. `None` after the report of too many
    /// nodes.
    fn fill(
        &mut self,
        cx: &mut Context<'_>,
        scope: usize,
        nodes: &[(Name, Value)],
        open: &mut Vec<usize>,
    ) -> Option<()> {
        self.graph.scopes[scope].names.reserve(nodes.len());
        for (name, value) in nodes {
            if self.graph.nodes.len() >= MAX_NODES || self.graph.scopes.len() >= MAX_NODES {
                return cx.fail(too_many(name));
            }
            let target = match cx.parts(value, "a node, `Kind(field: value)`") {
                Some((kind, entries)) => {
                    self.declare(cx, Entry { scope, name, kind, entries: &entries }, open)?
                }
                None => Target::Broken,
            };
            self.graph.scopes[scope].names.insert(name.text.clone(), target);
        }
        Some(())
    }

    /// Counts the nodes before any is made, so that a short file that multiplies them is refused at once.
    fn refuse_too_many(&self, cx: &mut Context<'_>) -> Option<()> {
        let document = cx.document;
        let mut counts = vec![None; document.templates.len()];
        let mut all = 0;
        for (name, value) in &document.nodes {
            all = self.count(document, value, &mut counts, 0).saturating_add(all);
            if all > MAX_NODES {
                return cx.fail(too_many(name));
            }
        }
        Some(())
    }

    /// The number of nodes that a node or a use of a template stands for, at least 1; what is refused otherwise counts as 1.
    fn count(&self, document: &Document, value: &Value, counts: &mut [Option<usize>], depth: usize) -> usize {
        let Shape::Tagged(Tagged { name: Some(kind), .. }) = &value.shape else { return 1 };
        let template = self.templates.get(&kind.text).filter(|_| depth < MAX_NESTING);
        let Some(&template) = template.filter(|_| !self.kinds.contains_key(kind.text.as_str())) else {
            return 1;
        };
        if counts[template].is_none() {
            // Of a template that uses itself.
            counts[template] = Some(1);
            let nodes = document.templates[template].nodes.iter();
            let each = nodes.map(|(_, value)| self.count(document, value, counts, depth + 1));
            counts[template] = Some(each.fold(0, usize::saturating_add).max(1));
        }
        counts[template].unwrap_or(1)
    }

    /// Adds a node or a use of a template; `None` as in [`fill`](Self::fill).
    fn declare(&mut self, cx: &mut Context<'_>, of: Entry<'_>, open: &mut Vec<usize>) -> Option<Target> {
        let (registry, kind) = (cx.registry, &of.kind.text);
        if let Some(&entry) = self.kinds.get(kind.as_str()) {
            return Some(self.node(cx, of, entry, None));
        }
        if let Some(&template) = self.templates.get(kind) {
            if !may_open(cx, of.kind, template, open) {
                return Some(Target::Broken);
            }
            open.push(template);
            let instance = self.instance(cx, of, template);
            let document = cx.document;
            self.fill(cx, instance, &document.templates[template].nodes, open)?;
            open.pop();
            return Some(Target::Instance(instance));
        }
        let former = registry.alias(kind).and_then(|alias| Some((registry.node(alias.kind)?, alias)));
        Some(match former {
            Some((entry, alias)) => self.node(cx, of, entry, Some(alias)),
            None => {
                let diagnostic = self.unknown_kind(cx, of.kind);
                cx.report(diagnostic);
                Target::Broken
            }
        })
    }

    fn unknown_kind(&mut self, cx: &Context<'_>, kind: &Name) -> Diagnostic {
        let message = format!("there is no kind of node `{}`", kind.text);
        let diagnostic = Diagnostic::error("E0201", kind.span, message).label("unknown kind or template");
        let of_library = self.of_library.get_or_insert_with(|| library::templates(cx.registry.library()));
        if let Some(known) = of_library.iter().find(|known| known.name == kind.text) {
            return diagnostic.help(format!(
                "`{}` is a template of the library: add `include: [\"{}\"]`",
                kind.text, known.file
            ));
        }
        let kinds = cx.registry.nodes().iter().map(|entry| entry.spec.name);
        let templates = cx.document.templates.iter().map(|template| template.name.text.as_str());
        let known = kinds.chain(templates).chain(of_library.iter().map(|known| known.name.as_str()));
        let near = cx.suggest(diagnostic, &kind.text, known, "there are", "no kinds are registered");
        near.help("`haptograph nodes` lists all kinds")
    }

    fn node(
        &mut self,
        cx: &mut Context<'_>,
        of: Entry<'_>,
        entry: NodeEntry,
        alias: Option<Alias>,
    ) -> Target {
        let (mut fields, uses) = self.fields(cx, of);
        if let Some(alias) = alias {
            cx.reading(|reading| (alias.rewrite)(&mut fields, reading));
        }
        let is_left_out = self.is_left_out(cx, of.scope, &mut fields);
        let before = cx.diagnostics.len();
        let (members, is_refused) = members::of(cx, &entry, &fields);
        let scope = &self.graph.scopes[of.scope];
        let node = Declared {
            path: [scope.prefix.as_str(), &of.name.text].concat(),
            name: of.name.span,
            entry,
            fields,
            scope: of.scope,
            template: scope.template,
            uses,
            members,
            is_left_out,
        };
        if is_refused {
            cx.blame(&node);
        }
        // What is left out is not checked.
        if is_left_out {
            cx.diagnostics.truncate(before);
        }
        cx.explain_node(before, &node);
        self.graph.nodes.push(node.into());
        Target::Node(self.graph.nodes.len() - 1)
    }

    /// The fields of a node with parameters and settings put in, and the places of these.
    fn fields(&mut self, cx: &mut Context<'_>, of: Entry<'_>) -> (Fields, Vec<(Span, Span)>) {
        let scope = &self.graph.scopes[of.scope];
        let place = match scope.template {
            Some(_) => Place::Template(&scope.settings),
            None => Place::Graph,
        };
        let mut uses = Vec::new();
        if !of.entries.iter().any(|(_, value)| is_replaced(value)) {
            return (cx.fields(of.kind, Entries::clone(of.entries)), uses);
        }
        let mut replaced = Vec::with_capacity(of.entries.len());
        let mut reported = Vec::new();
        for (name, value) in of.entries.iter() {
            match self.parameters.replace(cx, value, place, &mut uses) {
                Some(value) => replaced.push((name.clone(), value)),
                None => reported.push(name.text.clone()),
            }
        }
        let mut fields = cx.fields(of.kind, replaced.into());
        for name in reported {
            fields.if_missing(&name, None);
        }
        (fields, uses)
    }

    /// True if `only` leaves out a node or a use of a template.
    fn is_left_out(&self, cx: &mut Context<'_>, scope: usize, fields: &mut Fields) -> bool {
        let given = fields.take("only");
        let set = given
            .as_ref()
            .and_then(|value| Some((value.span, cx.reading(|reading| String::read(value, reading))?)));
        let Some((span, set)) = set else {
            return self.graph.scopes[scope].is_left_out;
        };
        cx.refuse_unknown_set(&set, Some(span));
        self.graph.scopes[scope].is_left_out || set != self.endpoints
    }

    /// Makes the scope of a use of a template, without its nodes.
    fn instance(&mut self, cx: &mut Context<'_>, of: Entry<'_>, template: usize) -> usize {
        let (mut fields, mut uses) = self.fields(cx, of);
        let (kind, document) = (of.kind, cx.document);
        let declared = &document.templates[template];
        let mut scope = Scope {
            prefix: format!("{}{}/", self.graph.scopes[of.scope].prefix, of.name.text),
            template: Some((template, kind.span)),
            outer: of.scope,
            ..Scope::default()
        };
        for input in &declared.inputs {
            let given = fields.take(input.text.clone());
            if given.is_none() && !fields.is_reported(&input.text) {
                let missing = missing_input(kind, &input.text, Presence::Required);
                fields.miss(&input.text, missing.also(input.span, "declared here"));
            }
            scope.inputs.insert(input.text.clone(), given);
        }
        for (setting, default) in &declared.settings {
            let given = fields.take(setting.text.clone());
            let reported = fields.is_reported(&setting.text);
            let required = library::is_required(default);
            let value = match given {
                None if required && !reported => {
                    let (owner, name) = (format!("`{}`", kind.text), &setting.text);
                    let missing = Diagnostic::missing(kind.span, &owner, name, format!("add `{name}: ...`"));
                    fields.miss(name, missing.also(setting.span, "required here"));
                    None
                }
                None if required || reported => None,
                None => self.parameters.replace(cx, default, Place::Template(&HashMap::new()), &mut uses),
                given => given,
            };
            scope.settings.insert(setting.text.clone(), value);
        }
        scope.is_left_out = self.is_left_out(cx, of.scope, &mut fields);
        cx.reading(|reading| fields.finish(reading));
        self.graph.scopes.push(scope);
        self.graph.scopes.len() - 1
    }
}

fn too_many(name: &Name) -> Diagnostic {
    let message = format!("the graph has more than {MAX_NODES} nodes");
    Diagnostic::error("E0702", name.span, message)
        .label("the count is reached here")
        .help("templates that use one another multiply the nodes; check how often they are used")
}

/// Reports a template that contains itself, and nesting that is too deep; false after a report.
fn may_open(cx: &mut Context<'_>, kind: &Name, template: usize, open: &[usize]) -> bool {
    if let Some(first) = open.iter().position(|other| *other == template) {
        let names = |index: &usize| cx.document.templates[*index].name.text.clone();
        let mut round: Vec<String> = open[first..].iter().map(names).collect();
        round.push(kind.text.clone());
        cx.report(
            Diagnostic::error("E0701", kind.span, format!("template `{}` uses itself", kind.text))
                .label(format!("`{}`", round.join("` uses `")))
                .help("a template is expanded in place, so it cannot contain itself"),
        );
        return false;
    }
    if open.len() >= MAX_NESTING {
        let message = format!("templates use templates more than {MAX_NESTING} deep");
        cx.report(Diagnostic::error("E0702", kind.span, message));
        return false;
    }
    true
}

/// Error of a required input that is not connected.
pub(super) fn missing_input(kind: &Name, input: &str, presence: Presence) -> Diagnostic {
    let (open, close) = presence.brackets();
    Diagnostic::error("E0401", kind.span, format!("input `{input}` of `{}` is not connected", kind.text))
        .label(format!("`{input}` is missing"))
        .help(format!("connect it: `{input}: {open}\"node.output\"{close}`"))
}
