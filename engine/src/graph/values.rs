//! Replacement of parameters and template settings by their values.

use super::context::Context;
use super::findings::part_of_text;
use super::options::CheckOptions;
use crate::diagnostic::{Diagnostic, Span};
use crate::document::text;
use crate::document::value::{Body, Shape, Tagged, Value};
use crate::formula::{Formula, names, reserved};
use crate::settings::Expected;
use std::collections::HashMap;
use std::sync::Arc;

/// Largest total number of replaced values: nested replacement could grow without bound.
const MAX_REPLACED: usize = 1_000_000;
/// Largest formula, bytes.
const MAX_FORMULA: usize = 16_384;
/// Largest nesting of brackets after replacement.
const MAX_DEPTH: usize = 128;

/// Structures in whose place a value is put.
const REPLACED: [&str; 3] = ["Param", "Setting", "Expr"];

/// The graph's parameters.
pub(super) struct Parameters {
    values: HashMap<String, Parameter>,
    replaced: usize,
}

struct Parameter {
    value: Value,
    used: bool,
}

/// Place of a value, which determines the names that it can use.
#[derive(Clone, Copy)]
pub(super) enum Place<'a> {
    /// In the graph: `Param("name")`.
    Graph,
    /// In a template: `Setting("name")`; `None` is a setting with a reported error.
    Template(&'a HashMap<String, Option<Value>>),
}

/// The error of a parameter that the graph does not have.
fn unknown(cx: &Context<'_>, name: &str, span: Span, none: &str) -> Diagnostic {
    let message = format!("the graph has no parameter `{name}`");
    let known = cx.document.parameters.iter().map(|(name, _)| name.text.as_str());
    let diagnostic = Diagnostic::error("E0209", span, message).label("unknown parameter");
    cx.suggest(diagnostic, name, known, "its parameters are", none)
}

const NO_PARAMETERS: &str = "it has no parameters";

impl Parameters {
    /// Reads the defaults; those of the set of endpoints and then the given values override them.
    pub(super) fn read(cx: &mut Context<'_>, options: &CheckOptions) -> Self {
        let endpoints = options.endpoints.as_str();
        let mut values: HashMap<String, Parameter> = HashMap::new();
        for (name, value) in &cx.document.parameters {
            let value = value.clone();
            values.insert(name.text.clone(), Parameter { value, used: false });
        }
        let document = cx.document;
        for (of, defaults) in &document.defaults {
            cx.refuse_unknown_set(&of.text, Some(of.span));
            for (name, value) in defaults {
                match values.get_mut(&name.text) {
                    Some(parameter) if of.text == endpoints => parameter.value = value.clone(),
                    Some(_) => {}
                    None => cx.report(unknown(cx, &name.text, name.span, NO_PARAMETERS)),
                }
            }
        }
        for (name, written) in &options.set {
            let line = format!("{name}={written}");
            let id = cx.sources.add_text(options.set_as, Arc::from(line.as_str()));
            let at = |start, end| Span { source: id, start, end };
            let Some(parameter) = values.get_mut(name) else {
                cx.report(unknown(cx, name, at(0, name.len()), NO_PARAMETERS));
                continue;
            };
            // Blanks instead of the name keep the places of the value.
            let blanked = " ".repeat(name.len() + 1) + written;
            let mut findings = Vec::new();
            let value = text::read(id, &blanked, &mut findings);
            if value.is_none() && matches!(parameter.value.shape, Shape::Number(..)) {
                // No text stands for a number: why it is none is known.
                cx.diagnostics.append(&mut findings);
                continue;
            }
            let wants_text = matches!(parameter.value.shape, Shape::String(_));
            parameter.value = match value {
                Some(value) if !wants_text || matches!(value.shape, Shape::String(_)) => value,
                _ => Value { span: at(name.len() + 1, line.len()), shape: Shape::String(written.clone()) },
            };
        }
        let mut this = Self { values, replaced: 0 };
        this.compute_defaults(cx);
        this
    }

    /// Computes parameters that are formulas over earlier ones.
    fn compute_defaults(&mut self, cx: &mut Context<'_>) {
        for (name, _) in &cx.document.parameters {
            let Some(value) = self.values.get(&name.text).map(|parameter| parameter.value.clone()) else {
                continue;
            };
            let Shape::Tagged(Tagged { name: Some(tag), body }) = &value.shape else {
                continue;
            };
            if tag.text != "Expr" {
                continue;
            }
            let computed = match only_text(body) {
                Some((formula, at)) => self.computed(cx, &value, formula, at, Place::Graph),
                None => malformed(cx, &value, &tag.text),
            };
            // A placeholder avoids further errors at the uses.
            let one = Shape::Number(1.0, "1".into());
            let computed = computed.unwrap_or(Value { span: value.span, shape: one });
            if let Some(parameter) = self.values.get_mut(&name.text) {
                parameter.value = computed;
            }
        }
    }

    /// Reports unused parameters.
    pub(super) fn warn_unused(&self, cx: &mut Context<'_>) {
        for (name, _) in &cx.document.parameters {
            if self.values.get(&name.text).is_some_and(|parameter| !parameter.used) {
                let message = format!("parameter `{}` is never used", name.text);
                cx.diagnostics.push(
                    Diagnostic::warning("W0102", name.span, message)
                        .label("nothing uses it")
                        .help(format!("use it as `Param(\"{}\")`, or remove it", name.text)),
                );
            }
        }
    }

    /// The value with every name replaced; `None` after a reported error. Adds to `uses` the places of replaced values.
    pub(super) fn replace(
        &mut self,
        cx: &mut Context<'_>,
        value: &Value,
        place: Place<'_>,
        uses: &mut Vec<(Span, Span)>,
    ) -> Option<Value> {
        self.replace_at(cx, value, place, uses, 0)
    }

    fn replace_at(
        &mut self,
        cx: &mut Context<'_>,
        value: &Value,
        place: Place<'_>,
        uses: &mut Vec<(Span, Span)>,
        depth: usize,
    ) -> Option<Value> {
        let Shape::Tagged(Tagged { name: Some(name), body }) = &value.shape else {
            return value.map_inner(&mut |inner| self.replace_at(cx, inner, place, uses, depth + 1));
        };
        let name = name.text.as_str();
        if !REPLACED.contains(&name) {
            return value.map_inner(&mut |inner| self.replace_at(cx, inner, place, uses, depth + 1));
        }
        let Some((asked, at)) = only_text(body) else {
            return malformed(cx, value, name);
        };
        let found = match name {
            "Expr" => return self.computed(cx, value, asked, at, place),
            "Param" => self.parameter(cx, value, asked, place)?,
            _ => setting(cx, value, asked, place)?,
        };
        self.put(cx, found, value.span, uses, depth)
    }

    /// Computes a formula over parameters in the graph or settings in a template.
    fn computed(
        &mut self,
        cx: &mut Context<'_>,
        value: &Value,
        formula: &str,
        at: Span,
        place: Place<'_>,
    ) -> Option<Value> {
        let names = names(formula);
        self.replaced += names.len();
        if self.replaced > MAX_REPLACED || formula.len() > MAX_FORMULA {
            let message = format!(
                "formulas have at most {MAX_FORMULA} bytes, and use at most {MAX_REPLACED} names in all"
            );
            return cx.fail(in_formula(at, message));
        }
        let is_declared = |name: &str| match place {
            Place::Graph => self.values.contains_key(name),
            Place::Template(settings) => settings.contains_key(name),
        };
        if let Some(word) = reserved(formula).find(|word| is_declared(word)) {
            let help = format!("give the parameter or setting `{word}` another name");
            return cx.fail(in_formula(at, format!("`{word}` is a reserved name in formulas")).help(help));
        }
        let numbers =
            names.iter().map(|name| self.number(cx, value, name, at, place)).collect::<Option<Vec<_>>>()?;
        let result = match Formula::parse(formula, &names) {
            Ok(parsed) if !parsed.is_timed() => parsed.value(&numbers),
            Ok(_) => {
                let help = "a value that changes with time is a signal: use the node `Expression`";
                return cx.fail(in_formula(at, "`t` cannot be used in a value".into()).help(help));
            }
            Err(error) => {
                let span = part_of_text(&cx.sources, at, error.characters(formula));
                return cx.fail(in_formula(span.unwrap_or(at), error.message));
            }
        };
        if !result.is_finite() {
            let message = format!("the formula gives `{result}`, not a finite number");
            return cx.fail(in_formula(at, message).help("is a divisor zero?"));
        }
        Some(Value { span: value.span, shape: Shape::Number(result, result.to_string()) })
    }

    /// The number of a parameter or setting that a formula uses.
    fn number(
        &mut self,
        cx: &mut Context<'_>,
        value: &Value,
        name: &str,
        at: Span,
        place: Place<'_>,
    ) -> Option<f64> {
        let found = match place {
            Place::Graph => self.values.get_mut(name).map(|parameter| {
                parameter.used = true;
                Some(&parameter.value)
            }),
            Place::Template(settings) => settings.get(name).map(Option::as_ref),
        };
        match found {
            Some(Some(Value { shape: Shape::Number(number, _), .. })) => Some(*number),
            Some(Some(other)) => {
                cx.fail(in_formula(at, format!("`{name}` is not a number")).also(other.span, "its value"))
            }
            // Reported where it is given.
            Some(None) => None,
            // Reports the unknown name.
            None => {
                match place {
                    Place::Graph => self.parameter(cx, value, name, place),
                    Place::Template(_) => setting(cx, value, name, place),
                };
                None
            }
        }
    }

    fn put(
        &mut self,
        cx: &mut Context<'_>,
        found: Value,
        at: Span,
        uses: &mut Vec<(Span, Span)>,
        depth: usize,
    ) -> Option<Value> {
        let (values, levels) = measure(&found);
        self.replaced += values;
        if self.replaced > MAX_REPLACED || depth + levels > MAX_DEPTH {
            let message = "the settings passed from template to template become too large";
            cx.report(
                Diagnostic::error("E0702", at, message)
                    .label("this replacement is too large")
                    .help(format!(
                        "the limit is {MAX_REPLACED} values and {MAX_DEPTH} levels; does a setting contain itself?"
                    )),
            );
            return None;
        }
        uses.push((found.span, at));
        Some(found)
    }

    fn parameter(
        &mut self,
        cx: &mut Context<'_>,
        value: &Value,
        asked: &str,
        place: Place<'_>,
    ) -> Option<Value> {
        if let Place::Template(settings) = place {
            let message = format!("a template cannot use the graph's parameter `{asked}`");
            let mut diagnostic =
                Diagnostic::error("E0209", value.span, message).label("not available in a template");
            diagnostic = match settings.contains_key(asked) {
                true => diagnostic.help(format!("`{asked}` is a setting: write `Setting(\"{asked}\")`")),
                false => diagnostic.help(format!(
                    "declare a setting `\"{asked}\": Required`, use `Setting(\"{asked}\")`, and give it `Param(\"{asked}\")` where the template is used"
                )),
            };
            return cx.fail(diagnostic);
        }
        if let Some(parameter) = self.values.get_mut(asked) {
            parameter.used = true;
            return Some(parameter.value.clone());
        }
        let none = format!("declare it: `parameters: {{ \"{asked}\": ... }}`");
        cx.fail(unknown(cx, asked, value.span, &none))
    }
}

/// True if a value has names that are replaced.
pub(super) fn is_replaced(value: &Value) -> bool {
    match &value.shape {
        Shape::Tagged(Tagged { name: Some(name), .. }) if REPLACED.contains(&name.text.as_str()) => true,
        _ => value.inner().any(is_replaced),
    }
}

/// An error of a formula.
fn in_formula(span: Span, message: String) -> Diagnostic {
    Diagnostic::error("E0306", span, message).label("in this formula")
}

fn setting(cx: &mut Context<'_>, value: &Value, asked: &str, place: Place<'_>) -> Option<Value> {
    let Place::Template(settings) = place else {
        return cx.fail(
            Diagnostic::error("E0704", value.span, "`Setting` can only be used inside a template")
                .label("not in a template")
                .help(format!("a parameter of the graph is written `Param(\"{asked}\")`")),
        );
    };
    if let Some(found) = settings.get(asked) {
        return found.clone();
    }
    let message = format!("the template has no setting `{asked}`");
    let diagnostic = Diagnostic::error("E0209", value.span, message).label("unknown setting");
    let none = format!("declare it: `settings: {{ \"{asked}\": Required }}`");
    cx.fail(cx.suggest(diagnostic, asked, cx.in_order(settings), "its settings are", &none))
}

/// The text between brackets that contain nothing else, and its place.
fn only_text(body: &Body) -> Option<(&str, Span)> {
    match body {
        Body::Tuple(values) => match values.as_slice() {
            [Value { shape: Shape::String(text), span }] => Some((text, *span)),
            _ => None,
        },
        _ => None,
    }
}

fn malformed<T>(cx: &mut Context<'_>, value: &Value, name: &str) -> Option<T> {
    let inside = if name == "Expr" { "2 * 40" } else { "name" };
    cx.mismatch(value, &Expected::described(format!("`{name}(\"{inside}\")`")))
}

/// Values within a value, and its levels.
fn measure(value: &Value) -> (usize, usize) {
    value.inner().map(measure).fold((1, 1), |(values, levels), (v, l)| (values + v, levels.max(l + 1)))
}
