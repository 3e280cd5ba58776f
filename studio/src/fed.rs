//! The settings that take their values from the parameters of a graph.

use haptograph_engine::document::value::{Body, Shape, Tagged, Value};
use haptograph_engine::registry::Registry;
use haptograph_engine::settings::SettingSpec;
use std::collections::HashMap;

/// The setting of each parameter that is used once in a graph's own text, as the value of a setting; or that is used for
/// the same choices everywhere.
pub(crate) fn settings(text: &str, registry: &Registry) -> HashMap<String, SettingSpec> {
    let Ok(graph) = Value::parse(text) else {
        return HashMap::new();
    };
    let mut uses = Uses { registry, found: HashMap::new() };
    uses.walk(&graph, None);
    let once = uses.found.into_iter();
    let once = once.filter_map(|(name, (count, spec))| {
        Some((name, spec.filter(|spec| count == 1 || !choices(spec).is_empty())?))
    });
    once.collect()
}

/// The choices of a setting that has no more to say than which.
pub(crate) fn choices(spec: &SettingSpec) -> Vec<&str> {
    match spec.parts.iter().all(|part| part.fields.is_empty()) {
        true => spec.parts.iter().filter_map(|part| part.choice).collect(),
        false => Vec::new(),
    }
}

struct Uses<'a> {
    registry: &'a Registry,
    /// The number of uses of a parameter, and the setting of the last.
    found: HashMap<String, (usize, Option<SettingSpec>)>,
}

impl Uses<'_> {
    /// Adds the uses in a value, which `spec` describes if it is the value of a setting.
    fn walk(&mut self, value: &Value, spec: Option<&SettingSpec>) {
        match &value.shape {
            Shape::List(values) => values.iter().for_each(|value| self.walk(value, None)),
            Shape::Map(pairs) => pairs.iter().for_each(|(_, value)| self.walk(value, None)),
            Shape::Tagged(tagged) => self.tagged(tagged, spec),
            _ => {}
        }
    }

    fn tagged(&mut self, Tagged { name, body }: &Tagged, spec: Option<&SettingSpec>) {
        let name = name.as_ref().map(|name| name.text.as_str());
        match (name, body) {
            (Some("Param"), Body::Tuple(values)) => {
                for parameter in values.iter().filter_map(text) {
                    self.add(parameter, spec);
                }
            }
            // A formula of parameters is none of them alone.
            (Some("Expr"), Body::Tuple(values)) => {
                let is_part = |letter: char| letter.is_alphanumeric() || letter == '_';
                for formula in values.iter().filter_map(text) {
                    for word in formula.split(|letter| !is_part(letter)).filter(|word| !word.is_empty()) {
                        self.add(word, None);
                    }
                }
            }
            (Some("Some"), Body::Tuple(values)) => values.iter().for_each(|value| self.walk(value, spec)),
            (_, Body::Tuple(values)) => values.iter().for_each(|value| self.walk(value, None)),
            (_, Body::Fields(entries)) => {
                let fields = self.fields(name, spec);
                for (name, value) in entries.iter() {
                    let field = fields.iter().find(|field| field.name == name.text);
                    self.walk(value, field);
                }
            }
            (_, Body::Bare) => {}
        }
    }

    /// The fields of a structure: of a setting's value, else of a kind of node or device.
    fn fields(&self, name: Option<&str>, spec: Option<&SettingSpec>) -> Vec<SettingSpec> {
        let part = spec.and_then(|spec| spec.parts.iter().find(|part| part.choice == name));
        if let Some(part) = part {
            return part.fields.clone();
        }
        let Some(name) = name else { return Vec::new() };
        let node = self.registry.node(name).map(|entry| entry.settings());
        let device = || self.registry.device(name).map(|entry| entry.settings());
        node.or_else(device).unwrap_or_default()
    }

    fn add(&mut self, parameter: &str, spec: Option<&SettingSpec>) {
        let (count, known) = self.found.entry(parameter.to_owned()).or_default();
        *count += 1;
        if *count == 1 || known.as_ref().map(choices) != spec.map(choices) {
            *known = spec.filter(|_| *count == 1).cloned();
        }
    }
}

fn text(value: &Value) -> Option<&str> {
    match &value.shape {
        Shape::String(text) => Some(text),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A parameter, the setting that it feeds, and the range of that.
    type Fed = (String, &'static str, Option<(f64, f64)>);

    fn fed(nodes: &str) -> Vec<Fed> {
        let text = format!("Graph(format: 1, nodes: {{ {nodes} }})");
        let found = settings(&text, &haptograph_nodes::registry());
        let mut found: Vec<_> = found.into_iter().map(|(name, spec)| (name, spec.name, spec.range)).collect();
        found.sort_by(|a, b| a.0.cmp(&b.0));
        found
    }

    #[test]
    fn a_parameter_has_the_unit_and_the_range_of_the_one_setting_that_it_feeds() {
        let cutoff = r#""speed": SpeedEstimator(position: "a", touching: "b", cutoff_hz: Param("soft")),"#;
        let found = fed(cutoff);
        assert_eq!((found[0].0.as_str(), found[0].1), ("soft", "cutoff_hz"));
        assert!(found[0].2.is_some());
        let nested = r#""out": ActuatorSink(current: "a", endpoint: "e", limit: (peak_a: Param("peak"), continuous_a: 1)),"#;
        assert_eq!(fed(nested)[0].1, "peak_a");
        // Of two settings, of a formula, of a list and of an input.
        assert_eq!(fed(&format!("{cutoff} {cutoff}")), []);
        assert_eq!(fed(r#""a": Gain(input: Param("x"), gain: Expr("2 * soft"))"#), []);
        assert_eq!(fed(&format!(r#"{cutoff} "a": Gain(input: "b", gain: Expr("2 * soft"))"#)), []);
        assert_eq!(fed(r#""a": Sum(inputs: [Param("x")])"#), []);
    }
}
