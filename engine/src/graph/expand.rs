//! Expansion of templates into nodes.

use super::build::explain;
use super::draft::{Context, Draft, DraftNode, Scope, Target};
use super::members;
use super::values::{Parameters, Place, suggest};
use crate::diagnostic::{Diagnostic, SourceId, Span};
use crate::document::library;
use crate::document::value::{Body, Name, Shape, Tagged, Value};
use crate::node::{NodeEntry, Presence};
use crate::registry::Alias;
use crate::settings::{Expected, Fields, Setting};
use std::collections::{HashMap, HashSet};

/// Largest number of nodes: nested templates can expand to any number.
const MAX_NODES: usize = 100_000;
/// Largest nesting of templates.
const MAX_NESTING: usize = 64;

/// Makes the nodes of the graph. Reports and omits nodes of unknown kinds.
pub(super) fn expand(cx: &mut Context<'_>, parameters: &mut Parameters, endpoints: &str) -> Draft {
    let mut expansion = Expansion {
        endpoints,
        templates: HashMap::new(),
        parameters,
        draft: Draft {
            nodes: Vec::with_capacity(cx.document.nodes.len()),
            scopes: vec![Scope::default()],
            cut: false,
        },
    };
    for (i, template) in cx.document.templates.iter().enumerate() {
        let name = &template.name;
        if cx.registry.node(&name.text).is_some() {
            let message = format!("`{}` is the name of a kind of node", name.text);
            cx.diagnostics.push(
                Diagnostic::error("E0211", name.span, message)
                    .label("a template cannot replace it")
                    .help("give the template a name of its own"),
            );
        }
        expansion.templates.insert(name.text.clone(), i);
    }
    let document = cx.document;
    expansion.fill(cx, 0, &document.nodes, &mut Vec::new());
    expansion.draft
}

/// Reports templates of the graph file that no node uses.
pub(super) fn warn_unused(cx: &mut Context<'_>, draft: &Draft) {
    let used: HashSet<usize> = draft.scopes.iter().filter_map(|scope| Some(scope.template?.0)).collect();
    for (i, template) in cx.document.templates.iter().enumerate() {
        // Templates of included files need not be used.
        if !used.contains(&i) && template.name.span.source == SourceId::default() {
            let message = format!("template `{}` is never used", template.name.text);
            cx.diagnostics.push(
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
    templates: HashMap<String, usize>,
    parameters: &'a mut Parameters,
    draft: Draft,
}

impl Expansion<'_> {
    /// Adds the nodes of a scope. `open` are the templates being expanded, outermost first.
    fn fill(&mut self, cx: &mut Context<'_>, scope: usize, nodes: &[(Name, Value)], open: &mut Vec<usize>) {
        for (name, value) in nodes {
            if self.draft.cut {
                return;
            }
            if self.draft.nodes.len() >= MAX_NODES || self.draft.scopes.len() >= MAX_NODES {
                self.draft.cut = true;
                let message = format!("the graph has more than {MAX_NODES} nodes");
                cx.report(
                    Diagnostic::error("E0702", name.span, message).label("the count is reached here").help(
                        "templates that use one another multiply the nodes; check how often they are used",
                    ),
                );
                return;
            }
            let target = self.declare(cx, scope, name, value, open);
            let target = target.unwrap_or(Target::Broken);
            self.draft.scopes[scope].names.insert(name.text.clone(), target);
        }
    }

    fn declare(
        &mut self,
        cx: &mut Context<'_>,
        scope: usize,
        name: &Name,
        value: &Value,
        open: &mut Vec<usize>,
    ) -> Option<Target> {
        let (kind, entries) = parts(cx, value, "a node, `Kind(field: value)`")?;
        if let Some(entry) = cx.registry.node(&kind.text) {
            return Some(self.node(cx, scope, name, kind, entries, entry, None));
        }
        let Some(&template) = self.templates.get(&kind.text) else {
            let alias = cx.registry.alias(&kind.text);
            if let Some((alias, entry)) = alias.and_then(|alias| Some((alias, cx.registry.node(alias.kind)?)))
            {
                return Some(self.node(cx, scope, name, kind, entries, entry, Some(alias)));
            }
            let message = format!("there is no kind of node `{}`", kind.text);
            let kinds = cx.registry.nodes().iter().map(|entry| entry.spec.name);
            let templates = cx.document.templates.iter().map(|template| template.name.text.as_str());
            let diagnostic = Diagnostic::error("E0201", kind.span, message).label("unknown kind or template");
            let of_library = library::templates(cx.registry.library());
            if let Some(known) = of_library.iter().find(|known| known.name == kind.text) {
                let file = known.file;
                let help =
                    format!("`{}` is a template of the library: add `include: [\"{file}\"]`", kind.text);
                cx.report(diagnostic.help(help));
                return None;
            }
            let shelved = of_library.iter().map(|known| known.name.as_str());
            let near = suggest(
                cx,
                diagnostic,
                &kind.text,
                kinds.chain(templates).chain(shelved),
                "there are",
                "no kinds are registered",
            );
            let near = near.help("`haptograph nodes` lists all kinds");
            cx.report(near);
            return None;
        };
        if let Some(first) = open.iter().position(|other| *other == template) {
            let names = |index: &usize| cx.document.templates[*index].name.text.clone();
            let mut round: Vec<String> = open[first..].iter().map(names).collect();
            round.push(kind.text.clone());
            cx.report(
                Diagnostic::error("E0701", kind.span, format!("template `{}` uses itself", kind.text))
                    .label(format!("`{}`", round.join("` uses `")))
                    .help("a template is expanded in place, so it cannot contain itself"),
            );
            return None;
        }
        if open.len() >= MAX_NESTING {
            let message = format!("templates use templates more than {MAX_NESTING} deep");
            cx.report(Diagnostic::error("E0702", kind.span, message));
            return None;
        }
        open.push(template);
        let instance = self.instance(cx, scope, name, kind, entries, template);
        let document = cx.document;
        self.fill(cx, instance, &document.templates[template].nodes, open);
        open.pop();
        Some(Target::Instance(instance))
    }

    #[expect(clippy::too_many_arguments, reason = "all of what is written, and what it is")]
    fn node(
        &mut self,
        cx: &mut Context<'_>,
        scope: usize,
        name: &Name,
        kind: &Name,
        entries: &[(Name, Value)],
        entry: NodeEntry,
        alias: Option<Alias>,
    ) -> Target {
        let mut uses = Vec::new();
        let mut fields = self.fields(cx, scope, kind, entries, &mut uses);
        if let Some(alias) = alias {
            cx.reading(|reading| (alias.rewrite)(&mut fields, reading));
        }
        let is_left_out = self.is_left_out(cx, scope, &mut fields);
        let before = cx.diagnostics.len();
        let (members, broken) = members::of(cx, &entry, &fields);
        let outputs = match (entry.spec.family(), &members) {
            (Some(family), Some(members)) => family + members.len(),
            _ => entry.spec.outputs.len(),
        };
        let path = format!("{}{}", self.draft.scopes[scope].prefix, name.text);
        self.draft.nodes.push(DraftNode {
            path,
            name: name.span,
            entry,
            fields,
            scope,
            uses,
            inputs: Vec::new(),
            outputs: vec![Default::default(); outputs],
            members,
            clock: None,
            device: None,
            is_left_out,
            broken,
        });
        let node = self.draft.nodes.len() - 1;
        // What is left out is not checked.
        if is_left_out {
            cx.diagnostics.truncate(before);
        }
        explain(cx, before, &self.draft.nodes[node].uses);
        for i in before..cx.diagnostics.len() {
            cx.diagnostics[i] = self.draft.in_use(node, cx.diagnostics[i].clone(), cx);
        }
        Target::Node(node)
    }

    /// The fields of a node with parameters and settings put in.
    fn fields(
        &mut self,
        cx: &mut Context<'_>,
        scope: usize,
        kind: &Name,
        entries: &[(Name, Value)],
        uses: &mut Vec<(Span, Span)>,
    ) -> Fields {
        let scope = &self.draft.scopes[scope];
        let place = match scope.template {
            Some(_) => Place::Template(&scope.settings),
            None => Place::Graph,
        };
        let mut replaced = Vec::with_capacity(entries.len());
        let mut reported = Vec::new();
        for (name, value) in entries {
            match self.parameters.replace(cx, value, place, uses) {
                Some(value) => replaced.push((name.clone(), value)),
                None => reported.push(name.text.clone()),
            }
        }
        let owner = format!("`{}`", kind.text);
        let mut fields = cx.reading(|reading| Fields::new(owner, kind.span, replaced, reading));
        for name in reported {
            fields.if_missing(&name, None);
        }
        fields
    }

    /// True if `only` leaves out a node or a use of a template.
    fn is_left_out(&self, cx: &mut Context<'_>, scope: usize, fields: &mut Fields) -> bool {
        let given = fields.take("only");
        let set = given
            .as_ref()
            .and_then(|value| Some((value.span, cx.reading(|reading| String::read(value, reading))?)));
        let Some((span, set)) = set else {
            return self.draft.scopes[scope].is_left_out;
        };
        refuse_unknown_set(cx, &set, span);
        self.draft.scopes[scope].is_left_out || set != self.endpoints
    }

    /// Makes the scope of a use of a template, without its nodes.
    fn instance(
        &mut self,
        cx: &mut Context<'_>,
        outer: usize,
        name: &Name,
        kind: &Name,
        entries: &[(Name, Value)],
        template: usize,
    ) -> usize {
        let mut uses = Vec::new();
        let mut fields = self.fields(cx, outer, kind, entries, &mut uses);
        let document = cx.document;
        let declared = &document.templates[template];
        let mut scope = Scope {
            prefix: format!("{}{}/", self.draft.scopes[outer].prefix, name.text),
            template: Some((template, kind.span)),
            outer,
            ..Scope::default()
        };
        for input in &declared.inputs {
            let given = fields.take(&input.text);
            if given.is_none() && !fields.is_reported(&input.text) {
                let missing = missing_input(kind, &input.text, Presence::Required, input.span);
                fields.miss(&input.text, missing);
            }
            scope.inputs.insert(input.text.clone(), given);
        }
        for (setting, default) in &declared.settings {
            let given = fields.take(&setting.text);
            let reported = fields.is_reported(&setting.text);
            let required = library::is_required(default);
            let value = match given {
                None if required && !reported => {
                    let message = format!("`{}` needs `{}`", kind.text, setting.text);
                    let diagnostic = Diagnostic::error("E0205", kind.span, message)
                        .label(format!("`{}` is missing", setting.text))
                        .also(setting.span, "required here")
                        .help(format!("add `{}: ...`", setting.text));
                    fields.miss(&setting.text, diagnostic);
                    None
                }
                None if required || reported => None,
                None => self.parameters.replace(cx, default, Place::Template(&HashMap::new()), &mut uses),
                given => given,
            };
            scope.settings.insert(setting.text.clone(), value);
        }
        scope.is_left_out = self.is_left_out(cx, outer, &mut fields);
        cx.reading(|reading| fields.finish(reading));
        self.draft.scopes.push(scope);
        self.draft.scopes.len() - 1
    }
}

/// Reports a set of endpoints that the graph does not have.
pub(super) fn refuse_unknown_set(cx: &mut Context<'_>, set: &str, span: Span) {
    let document = cx.document;
    let declared = || document.endpoints.iter().map(|(name, _)| name.text.as_str());
    if declared().all(|known| known != set) {
        let message = format!("the graph has no set of endpoints `{set}`");
        let diagnostic = Diagnostic::error("E0210", span, message).label("unknown set of endpoints");
        let diagnostic = suggest(cx, diagnostic, set, declared(), "its sets are", "it has none");
        cx.report(diagnostic);
    }
}

/// Error of a required input that is not connected.
pub(super) fn missing_input(kind: &Name, input: &str, presence: Presence, declared: Span) -> Diagnostic {
    let (open, close) = presence.brackets();
    Diagnostic::error("E0401", kind.span, format!("input `{input}` of `{}` is not connected", kind.text))
        .label(format!("`{input}` is missing"))
        .also(declared, "declared here")
        .help(format!("connect it: `{input}: {open}\"node.output\"{close}`"))
}

/// Name and fields of `Kind(field: value)`; reports any other value.
pub(super) fn parts<'v>(
    cx: &mut Context<'_>,
    value: &'v Value,
    expected: &'static str,
) -> Option<(&'v Name, &'v [(Name, Value)])> {
    if let Shape::Tagged(Tagged { name: Some(name), body }) = &value.shape {
        match body {
            Body::Bare => return Some((name, &[])),
            Body::Fields(fields) => return Some((name, fields)),
            Body::Tuple(values) if values.is_empty() => return Some((name, &[])),
            Body::Tuple(values) => {
                let at = &values[0];
                let expected = Expected::described(format!("fields of `{}`, `name: value`", name.text));
                let first = cx.registry.node_meant(&name.text).and_then(|entry| entry.spec.inputs.first());
                let before = cx.diagnostics.len();
                cx.reading(|reading| reading.mismatch(at, &expected));
                if let (Some(input), Shape::String(node), Some(diagnostic)) =
                    (first, &at.shape, cx.diagnostics.get_mut(before))
                {
                    let (open, close) = input.presence.brackets();
                    let help = format!("inputs are named: `{}: {open}\"{node}\"{close}`", input.name);
                    diagnostic.help.push(help);
                }
                return None;
            }
        }
    }
    cx.reading(|reading| reading.mismatch(value, &Expected::described(expected)));
    None
}
