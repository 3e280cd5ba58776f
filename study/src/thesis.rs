//! What the thesis prints: its tables, the numbers of its studies and its constants, as data.

use serde_json::Value;
use std::sync::LazyLock;

static PUBLISHED: LazyLock<Value> =
    LazyLock::new(|| serde_json::from_str(include_str!("thesis-tables.json")).unwrap_or_default());

/// All of it. `tables`, `studies` and `figures` are maps by number, `constants` a list. Keys that begin with `derived_` are not
/// in the thesis: they follow from its numbers.
pub fn published() -> &'static Value {
    &PUBLISHED
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_studies_and_constants_are_there() {
        let count = |key: &str| published()[key].as_object().map_or(0, |map| map.len());
        assert_eq!((count("tables"), count("studies")), (13, 6));
        assert_eq!(published()["constants"].as_array().map(Vec::len), Some(53));
        assert_eq!(published()["tables"]["4.3"]["values"][0][2], -0.91);
    }
}
