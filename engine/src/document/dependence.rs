//! The parameters, settings and formulas on which the limits and endpoints of a graph file depend.

use super::value::{Body, Shape, Tagged, Value};
use super::{Document, Name};
use crate::diagnostic::Span;
use crate::formula::names;
use crate::registry::Registry;
use crate::settings::SettingRole;
use std::collections::BTreeMap;

impl Document {
    /// The limits of nodes and the endpoints that are computed or taken from parameters and settings, with all formulas
    /// and uses of templates on which they depend: place and text of each. Two documents that agree in these and in the
    /// resulting values agree for all parameters.
    pub fn dependent_safety(&self, registry: &Registry) -> BTreeMap<String, String> {
        let mut found = BTreeMap::new();
        let mut parameters = Vec::new();
        let templates = self.templates.iter();
        let inner = templates.flat_map(|template| {
            let nodes = template.nodes.iter();
            nodes.map(move |(name, value)| (format!("{}/{}", template.name.text, name.text), value))
        });
        let nodes = self.nodes.iter().map(|(name, value)| (name.text.clone(), value));
        let endpoints = self.endpoints.iter().flat_map(|(set, devices)| {
            let devices = devices.iter();
            devices.map(move |(name, value)| (format!("endpoint {} of {}", name.text, set.text), value))
        });
        for (place, value) in nodes.chain(inner) {
            match self.uses_template(value) {
                // What it hands in may be a limit inside.
                true => self.note(place, value, &mut found, &mut parameters),
                false => {
                    for limit in limits(value, registry) {
                        // Each part by itself: another that is plain may be lowered.
                        for (part, value) in fields(limit) {
                            let place = format!("{} of the limit of {place}", part.text);
                            self.note(place, value, &mut found, &mut parameters);
                        }
                        if fields(limit).is_empty() {
                            self.note(format!("the limit of {place}"), limit, &mut found, &mut parameters);
                        }
                    }
                }
            }
        }
        for (place, value) in endpoints {
            self.note(place, value, &mut found, &mut parameters);
        }
        // Parameters that are computed from others.
        while let Some(name) = parameters.pop() {
            let declared = self.parameters.iter().find(|(known, _)| known.text == name);
            let place = format!("parameter {name}");
            if let Some((_, value)) = declared
                && !found.contains_key(&place)
            {
                self.note(place, value, &mut found, &mut parameters);
            }
        }
        found
    }

    /// Records a value that depends on names, and these names.
    fn note(
        &self,
        place: String,
        value: &Value,
        found: &mut BTreeMap<String, String>,
        parameters: &mut Vec<String>,
    ) {
        let mut depends = false;
        walk(value, &mut |name, text| {
            depends = true;
            match name {
                "Expr" => parameters.extend(names(text).into_iter().map(str::to_owned)),
                _ => parameters.push(text.to_owned()),
            }
        });
        if depends {
            found.insert(place, self.text_of(value.span));
        }
    }

    fn uses_template(&self, value: &Value) -> bool {
        match &value.shape {
            Shape::Tagged(Tagged { name: Some(kind), .. }) => {
                self.templates.iter().any(|template| template.name.text == kind.text)
            }
            _ => false,
        }
    }

    fn text_of(&self, span: Span) -> String {
        let source = self.sources.get(span.source);
        let text = source.and_then(|source| source.text.get(span.start..span.end));
        text.unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ")
    }
}

/// The limits of a node, if it is an actuator sink.
fn limits<'v>(value: &'v Value, registry: &Registry) -> impl Iterator<Item = &'v Value> {
    let kind = match &value.shape {
        Shape::Tagged(Tagged { name: Some(kind), .. }) => registry.node_meant(&kind.text),
        _ => None,
    };
    let limit = kind.and_then(|kind| kind.setting_for(SettingRole::Limit));
    let written = fields(value).iter();
    written
        .filter(move |(name, _)| limit.as_ref().is_some_and(|limit| limit.name == name.text))
        .map(|(_, value)| value)
}

fn fields(value: &Value) -> &[(Name, Value)] {
    match &value.shape {
        Shape::Tagged(Tagged { body: Body::Fields(fields), .. }) => fields,
        _ => &[],
    }
}

/// Calls `found` with every `Param("...")`, `Setting("...")` and `Expr("...")` within a value.
fn walk(value: &Value, found: &mut impl FnMut(&str, &str)) {
    if let Shape::Tagged(Tagged { name: Some(name), body: Body::Tuple(values) }) = &value.shape
        && let [Value { shape: Shape::String(text), .. }] = &values[..]
        && matches!(name.text.as_str(), "Param" | "Setting" | "Expr")
    {
        found(&name.text, text);
    }
    value.inner().for_each(|value| walk(value, found));
}
