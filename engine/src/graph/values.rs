//! Replacement of parameters and template settings by their values.

use super::build::part_of_text;
use super::check::CheckOptions;
use super::draft::Context;
use super::expand::refuse_unknown_set;
use crate::diagnostic::{Diagnostic, Span};
use crate::document::text;
use crate::document::value::{Body, Shape, Tagged, Value};
use crate::formula::{Formula, names, reserved};
use crate::settings::{Expected, closest};
use std::collections::HashMap;
use std::sync::Arc;

/// Largest total number of replaced values: nested replacement could grow without bound.
const MAX_REPLACED: usize = 1_000_000;
/// Largest formula, bytes.
const MAX_FORMULA: usize = 16_384;
/// Largest nesting of brackets after replacement.
const MAX_DEPTH: usize = 128;

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

/// Reports a parameter that the graph does not have.
fn unknown(cx: &mut Context<'_>, name: &str, span: Span) {
    let message = format!("the graph has no parameter `{name}`");
    let known = cx.document.parameters.iter().map(|(name, _)| name.text.as_str());
    let diagnostic = Diagnostic::error("E0209", span, message).label("unknown parameter");
    let diagnostic = suggest(cx, diagnostic, name, known, "its parameters are", "it has no parameters");
    cx.report(diagnostic);
}

impl Parameters {
    /// Reads the defaults; those of the set of endpoints and then the given values override them.
    pub fn read(cx: &mut Context<'_>, options: &CheckOptions) -> Self {
        let endpoints = options.endpoints.as_str();
        let mut values: HashMap<String, Parameter> = HashMap::new();
        for (name, value) in &cx.document.parameters {
            let value = value.clone();
            values.insert(name.text.clone(), Parameter { value, used: false });
        }
        let document = cx.document;
        for (of, defaults) in &document.defaults {
            refuse_unknown_set(cx, &of.text, of.span);
            for (name, value) in defaults {
                match values.get_mut(&name.text) {
                    Some(parameter) if of.text == endpoints => parameter.value = value.clone(),
                    Some(_) => {}
                    None => unknown(cx, &name.text, name.span),
                }
            }
        }
        for (name, written) in &options.set {
            let line = format!("{name}={written}");
            let id = cx.sources.add_text(options.set_as, Arc::from(line.as_str()));
            let at = |start, end| Span { source: id, start, end };
            let Some(parameter) = values.get_mut(name) else {
                unknown(cx, name, at(0, name.len()));
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
    pub fn warn_unused(&self, cx: &mut Context<'_>) {
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
    pub fn replace(
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
        let mut each = |value: &Value| self.replace_at(cx, value, place, uses, depth + 1);
        let shape = match &value.shape {
            Shape::List(values) => Shape::List(all(values, &mut each)?),
            Shape::Map(pairs) => {
                let replaced: Vec<Option<Value>> = pairs.iter().map(|(_, value)| each(value)).collect();
                let keys = pairs.iter().map(|(key, _)| key.clone());
                Shape::Map(keys.zip(replaced).map(|(key, value)| Some((key, value?))).collect::<Option<_>>()?)
            }
            Shape::Tagged(Tagged { name: Some(name), body })
                if matches!(name.text.as_str(), "Param" | "Setting" | "Expr") =>
            {
                let Some((asked, at)) = only_text(body) else {
                    return malformed(cx, value, &name.text);
                };
                let found = match name.text.as_str() {
                    "Expr" => return self.computed(cx, value, asked, at, place),
                    "Param" => self.parameter(cx, value, asked, place)?,
                    _ => setting(cx, value, asked, place)?,
                };
                return self.put(cx, found, value.span, uses, depth);
            }
            Shape::Tagged(Tagged { name, body }) => {
                let body = match body {
                    Body::Bare => Body::Bare,
                    Body::Tuple(values) => Body::Tuple(all(values, &mut each)?),
                    Body::Fields(fields) => {
                        let replaced: Vec<Option<Value>> =
                            fields.iter().map(|(_, value)| each(value)).collect();
                        let names = fields.iter().map(|(name, _)| name.clone());
                        Body::Fields(
                            names
                                .zip(replaced)
                                .map(|(name, value)| Some((name, value?)))
                                .collect::<Option<_>>()?,
                        )
                    }
                };
                let name = name.clone();
                Shape::Tagged(Tagged { name, body })
            }
            plain => plain.clone(),
        };
        let span = value.span;
        Some(Value { span, shape })
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
        let wrong =
            |span, message: String| Diagnostic::error("E0306", span, message).label("in this formula");
        let names = names(formula);
        self.replaced += names.len();
        if self.replaced > MAX_REPLACED || formula.len() > MAX_FORMULA {
            cx.report(wrong(
                at,
                format!(
                    "formulas have at most {MAX_FORMULA} bytes, and use at most {MAX_REPLACED} names in all"
                ),
            ));
            return None;
        }
        let is_declared = |name: &str| match place {
            Place::Graph => self.values.contains_key(name),
            Place::Template(settings) => settings.contains_key(name),
        };
        if let Some(word) = reserved(formula).find(|word| is_declared(word)) {
            let message = format!("`{word}` is a reserved name in formulas");
            cx.report(
                wrong(at, message).help(format!("give the parameter or setting `{word}` another name")),
            );
            return None;
        }
        let mut numbers = Vec::new();
        for name in &names {
            let found = match place {
                Place::Graph => self.values.get_mut(*name).map(|parameter| {
                    parameter.used = true;
                    Some(&parameter.value)
                }),
                Place::Template(settings) => settings.get(*name).map(Option::as_ref),
            };
            match found {
                Some(Some(Value { shape: Shape::Number(number, _), .. })) => numbers.push(*number),
                Some(Some(other)) => {
                    cx.report(wrong(at, format!("`{name}` is not a number")).also(other.span, "its value"));
                    return None;
                }
                // Reported where it is given.
                Some(None) => return None,
                // Reports the unknown name.
                None => {
                    match place {
                        Place::Graph => self.parameter(cx, value, name, place),
                        Place::Template(_) => setting(cx, value, name, place),
                    };
                    return None;
                }
            }
        }
        let parsed = match Formula::parse(formula, &names) {
            Ok(parsed) if !parsed.is_timed() => parsed,
            Ok(_) => {
                let help = "a value that changes with time is a signal: use the node `Expression`";
                cx.report(wrong(at, "`t` cannot be used in a value".into()).help(help));
                return None;
            }
            Err(error) => {
                let span = part_of_text(&cx.sources, at, error.characters(formula));
                cx.report(wrong(span.unwrap_or(at), error.message));
                return None;
            }
        };
        let result = parsed.value(&numbers);
        if !result.is_finite() {
            let message = format!("the value of the formula is `{result}`, not a finite number");
            cx.report(wrong(at, message));
            return None;
        }
        Some(Value { span: value.span, shape: Shape::Number(result, result.to_string()) })
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
            let message = "settings handed through templates grow without bound";
            cx.report(
                Diagnostic::error("E0702", at, message)
                    .label("this replacement is too large")
                    .help(format!("at most {MAX_REPLACED} values, {MAX_DEPTH} levels deep, are replaced")),
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
            cx.report(diagnostic);
            return None;
        }
        if let Some(parameter) = self.values.get_mut(asked) {
            parameter.used = true;
            return Some(parameter.value.clone());
        }
        let message = format!("the graph has no parameter `{asked}`");
        let diagnostic = Diagnostic::error("E0209", value.span, message).label("unknown parameter");
        let known = cx.document.parameters.iter().map(|(name, _)| name.text.as_str());
        let none = format!("declare it: `parameters: {{ \"{asked}\": ... }}`");
        let diagnostic = suggest(cx, diagnostic, asked, known, "its parameters are", &none);
        cx.report(diagnostic);
        None
    }
}

fn setting(cx: &mut Context<'_>, value: &Value, asked: &str, place: Place<'_>) -> Option<Value> {
    let Place::Template(settings) = place else {
        cx.report(
            Diagnostic::error("E0704", value.span, "`Setting` can only be used inside a template")
                .label("not in a template")
                .help(format!("a parameter of the graph is written `Param(\"{asked}\")`")),
        );
        return None;
    };
    if let Some(found) = settings.get(asked) {
        return found.clone();
    }
    let message = format!("the template has no setting `{asked}`");
    let diagnostic = Diagnostic::error("E0209", value.span, message).label("unknown setting");
    let known = in_order(cx, settings);
    let none = format!("declare it: `settings: {{ \"{asked}\": Required }}`");
    let diagnostic = suggest(cx, diagnostic, asked, known.into_iter(), "its settings are", &none);
    cx.report(diagnostic);
    None
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
    cx.reading(|reading| reading.mismatch(value, &Expected::described(format!("`{name}(\"{inside}\")`"))));
    None
}

/// Every element is replaced, so that all errors are seen at once.
fn all(values: &[Value], each: &mut impl FnMut(&Value) -> Option<Value>) -> Option<Vec<Value>> {
    let replaced: Vec<Option<Value>> = values.iter().map(each).collect();
    replaced.into_iter().collect()
}

/// Values within a value, and its levels.
fn measure(value: &Value) -> (usize, usize) {
    let inner: Vec<&Value> = match &value.shape {
        Shape::List(values) => values.iter().collect(),
        Shape::Map(pairs) => pairs.iter().map(|(_, value)| value).collect(),
        Shape::Tagged(Tagged { body, .. }) => match body {
            Body::Bare => Vec::new(),
            Body::Tuple(values) => values.iter().collect(),
            Body::Fields(fields) => fields.iter().map(|(_, value)| value).collect(),
        },
        _ => Vec::new(),
    };
    inner.into_iter().map(measure).fold((1, 1), |(values, levels), (v, l)| (values + v, levels.max(l + 1)))
}

/// Largest number of names compared with an unknown one; with 20,000 of each it would take a minute.
const MAX_COMPARED_NAMES: usize = 500;

/// The names in order, as long as [`suggest`] still needs them.
pub(super) fn in_order<'a, T>(cx: &Context<'_>, known: &'a HashMap<String, T>) -> Vec<&'a str> {
    if !cx.is_suggesting() {
        return Vec::new();
    }
    let mut names: Vec<&str> = known.keys().map(String::as_str).collect();
    names.sort_unstable();
    names
}

/// Adds "did you mean", or what there is to choose from, to findings that can still be shown.
pub(super) fn suggest<'a>(
    cx: &Context<'_>,
    diagnostic: Diagnostic,
    word: &str,
    known: impl Iterator<Item = &'a str> + Clone,
    choices: &str,
    none: &str,
) -> Diagnostic {
    if !cx.is_suggesting() {
        return diagnostic;
    }
    if let Some(near) = closest(word, known.clone().take(MAX_COMPARED_NAMES)) {
        return diagnostic.help(format!("did you mean `{near}`?"));
    }
    const SHOWN: usize = 12;
    let total = known.clone().count();
    if total == 0 {
        return diagnostic.help(none);
    }
    let mut list = known.take(SHOWN).collect::<Vec<_>>().join(", ");
    if total > SHOWN {
        list += &format!(" and {} more", total - SHOWN);
    }
    diagnostic.help(format!("{choices} {list}"))
}
