//! Conversion of fields of a former format to the present one.

use super::Fields;
use crate::document::value::{Body, Name, Shape, Tagged, Value};

impl Fields {
    /// Moves all fields except `stays` into a structure: `size_mm: ...` into `solids: Box(size_mm: ...)`. The place of
    /// the structure is that of all fields, so that missing fields are reported there.
    pub fn nest(&mut self, into: &str, structure: &str, stays: &[&str]) {
        let is_inner = |name: &str| !stays.contains(&name);
        let (inner, outer): (Vec<_>, Vec<_>) =
            self.remaining().cloned().partition(|(name, _)| is_inner(&name.text));
        self.entries = outer.into();
        self.taken.clear();
        // With an error in one of them, others would only follow from it.
        if self.missing.iter().any(|(name, special)| special.is_none() && is_inner(name)) {
            return self.if_missing(into, None);
        }
        let structure = Tagged { name: Some(self.name(structure)), body: Body::Fields(inner.into()) };
        self.put(into, Shape::Tagged(structure));
    }

    /// Adds a number if the field is missing.
    pub fn put_default(&mut self, name: &str, value: f64) {
        if self.given(name).is_none() && !self.is_reported(name) {
            self.put(name, Shape::Number(value, value.to_string()));
        }
    }

    fn put(&mut self, name: &str, shape: Shape) {
        let added = (self.name(name), Value { span: self.span, shape });
        self.entries = self.remaining().cloned().chain([added]).collect();
        self.taken.clear();
    }

    fn name(&self, text: &str) -> Name {
        Name { span: self.span, text: text.to_owned() }
    }
}
