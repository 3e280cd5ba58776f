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

/// True if two names have the same letters and digits: the toolkit's files write some names in other ways.
pub fn is_same_name(a: &str, b: &str) -> bool {
    let plain = |name: &str| name.to_ascii_lowercase().replace(|c: char| !c.is_ascii_alphanumeric(), "");
    plain(a) == plain(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_the_same_by_their_letters_and_digits() {
        assert!(is_same_name("Brick 1", "brick-1") && !is_same_name("Brick 1", "Brick 2"));
        assert!(is_same_name("Poly- ethylene Foam", "Polyethylene Foam"));
    }

    #[test]
    fn tables_studies_and_constants_are_there() {
        let count = |key: &str| published()[key].as_object().map_or(0, |map| map.len());
        assert_eq!((count("tables"), count("studies")), (13, 6));
        assert_eq!(published()["constants"].as_array().map(Vec::len), Some(54));
        assert_eq!(published()["tables"]["4.3"]["values"][0][2], -0.91);
    }
}
