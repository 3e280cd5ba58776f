//! The values of live settings, as written or by default.

use crate::document::value::{Body, Shape, Tagged, Value};
use crate::settings::{Fields, MAX_LIVE_ITEMS, SettingSpec};

/// Value of a live setting.
pub(super) enum LiveValue {
    /// One number.
    Number(f64),
    /// The numbers of a list, each of which is live.
    Items(Vec<f64>),
}

/// The value or default of a setting, if it is live and has numbers: not of `None`, nor of a list that is too long.
pub(super) fn value(fields: &Fields, spec: &SettingSpec) -> Option<LiveValue> {
    if !spec.live {
        return None;
    }
    match (fields.given(spec.name), &spec.default) {
        (Some(given), _) => of(given),
        (None, Some(default)) => match default.parse() {
            Ok(number) => Some(LiveValue::Number(number)),
            Err(_) => of(&Value::parse(default).ok()?),
        },
        (None, None) => None,
    }
}

fn of(value: &Value) -> Option<LiveValue> {
    let items = match &value.shape {
        Shape::Number(number, _) => return Some(LiveValue::Number(*number)),
        Shape::Tagged(Tagged { name: Some(name), body: Body::Tuple(inner) })
            if name.text == "Some" && inner.len() == 1 =>
        {
            return of(&inner[0]);
        }
        Shape::List(items) | Shape::Tagged(Tagged { name: None, body: Body::Tuple(items) })
            if items.len() <= MAX_LIVE_ITEMS =>
        {
            items
        }
        _ => return None,
    };
    let numbers = items.iter().map(|item| match item.shape {
        Shape::Number(number, _) => Some(number),
        _ => None,
    });
    numbers.collect::<Option<_>>().map(LiveValue::Items)
}
