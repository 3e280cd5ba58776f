//! The fields of a structure while it is read.

use super::{Expected, Reading, Setting, closest, unknown_choice};
use crate::diagnostic::{Diagnostic, MAX_SHOWN, Span};
use crate::document::value::{Body, Name, Shape, Tagged, Value};
use haptograph_signal::units;
use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

/// Fields of every kind of node; messages list them last.
const OF_EVERY_NODE: [&str; 2] = ["clock", "only"];

/// The fields of a structure while it is read.
#[derive(Debug, Clone)]
pub struct Fields {
    /// Name of the structure in messages: `` `Gain` ``.
    pub owner: String,
    /// The whole structure.
    pub span: Span,
    /// Shared with the document and with copies of these fields.
    pub(super) entries: Arc<[(Name, Value)]>,
    /// Which of the first entries have been taken.
    pub(super) taken: Vec<bool>,
    known: Vec<Cow<'static, str>>,
    /// Special diagnostics for missing fields, by name; `None` if the field was reported already.
    pub(super) missing: Vec<(String, Option<Diagnostic>)>,
    /// Missing fields, reported at the end: an unknown field may be a misspelling of one.
    missed: Vec<(String, Diagnostic)>,
}

impl Fields {
    /// The fields of a structure. A name given twice is reported and its first value kept.
    pub fn new(
        owner: String,
        span: Span,
        entries: impl Into<Arc<[(Name, Value)]>>,
        reading: &mut Reading<'_>,
    ) -> Self {
        let mut entries = entries.into();
        if has_repeated(&entries) {
            entries = Self::once(&owner, &entries, reading);
        }
        let (taken, known) = (Vec::new(), Vec::new());
        Self { owner, span, entries, taken, known, missing: Vec::new(), missed: Vec::new() }
    }

    /// Reports names given twice; the first value of each.
    fn once(owner: &str, entries: &[(Name, Value)], reading: &mut Reading<'_>) -> Arc<[(Name, Value)]> {
        let mut kept: Vec<(Name, Value)> = Vec::with_capacity(entries.len());
        let mut seen: HashMap<&str, Span> = HashMap::with_capacity(entries.len());
        for (name, value) in entries {
            match seen.get(name.text.as_str()) {
                Some(first) => reading.diagnostics.push(
                    Diagnostic::error(
                        "E0105",
                        name.span,
                        format!("`{}` is given twice in {owner}", name.text),
                    )
                    .label("given again here")
                    .also(*first, "first given here")
                    .help("remove one of them"),
                ),
                None => {
                    seen.insert(&name.text, name.span);
                    kept.push((name.clone(), value.clone()));
                }
            }
        }
        kept.into()
    }

    /// Takes the field called `name`, if it was given.
    pub fn take(&mut self, name: impl Into<Cow<'static, str>>) -> Option<Value> {
        let at = self.take_at(name.into())?;
        Some(match Arc::get_mut(&mut self.entries) {
            Some(entries) => std::mem::replace(&mut entries[at].1, Shape::Unit.into()),
            None => self.entries[at].1.clone(),
        })
    }

    /// Takes the field called `name`, whose value stays at this place of the entries.
    fn take_at(&mut self, name: Cow<'static, str>) -> Option<usize> {
        let at = self.place_of(&name);
        self.known.push(name);
        self.taken.resize(self.entries.len(), false);
        self.taken[at?] = true;
        at
    }

    fn place_of(&self, name: &str) -> Option<usize> {
        let at = self.entries.iter().position(|(given, _)| given.text == name)?;
        self.is_left(at).then_some(at)
    }

    fn is_left(&self, at: usize) -> bool {
        self.taken.get(at) != Some(&true)
    }

    /// Sets the diagnostic for a missing required field; `None` if the reason has been reported already.
    pub(crate) fn if_missing(&mut self, name: &str, diagnostic: Option<Diagnostic>) {
        self.missing.push((name.to_owned(), diagnostic));
    }

    /// Defers the diagnostic of a missing field to [`finish`](Self::finish).
    pub(crate) fn miss(&mut self, name: &str, diagnostic: Diagnostic) {
        self.missed.push((name.to_owned(), diagnostic));
    }

    /// True if an error of this field has been reported.
    pub(crate) fn is_reported(&self, name: &str) -> bool {
        self.missing.iter().any(|(missing, special)| missing == name && special.is_none())
    }

    /// True if an error was reported for the value of any field.
    pub(crate) fn has_reported(&self) -> bool {
        self.missing.iter().any(|(_, special)| special.is_none())
    }

    /// The value of the field called `name`, if it was given and not taken.
    pub fn given(&self, name: &str) -> Option<&Value> {
        Some(&self.entries[self.place_of(name)?].1)
    }

    /// All fields, taken or not.
    pub(crate) fn shared(&self) -> Arc<[(Name, Value)]> {
        Arc::clone(&self.entries)
    }

    /// The fields that have not been taken.
    pub fn remaining(&self) -> impl Iterator<Item = &(Name, Value)> {
        let entries = self.entries.iter().enumerate();
        entries.filter(|(at, _)| self.is_left(*at)).map(|(_, entry)| entry)
    }

    /// Reports missing fields and fields that were not taken.
    pub fn finish(mut self, reading: &mut Reading<'_>) {
        let unknown: Vec<(Name, Value)> = self.remaining().cloned().collect();
        for (name, value) in unknown {
            let message = format!("{} has no field `{}`", self.owner, name.text);
            let diagnostic = Diagnostic::error("E0204", name.span, message).label("unknown field");
            // What is meant is looked for only where it is shown or takes another finding away.
            if self.missed.is_empty() && reading.diagnostics.len() >= MAX_SHOWN {
                reading.diagnostics.push(diagnostic);
                continue;
            }
            let (meant, help) = self.meant(&name.text, &value);
            self.missed.retain(|(missed, _)| Some(missed) != meant.as_ref());
            reading.diagnostics.push(diagnostic.help(help));
        }
        let missed = self.missed.into_iter().map(|(_, diagnostic)| diagnostic);
        reading.diagnostics.extend(missed);
    }

    /// The field that an unknown name probably means, and the help.
    fn meant(&self, name: &str, value: &Value) -> (Option<String>, String) {
        if let Shape::Number(number, _) = value.shape
            && let Some((known, factor)) =
                self.known.iter().find_map(|known| Some((known, units::between(name, known)?)))
        {
            let help = format!("did you mean `{known}: {}`?", rounded(number * factor));
            return (Some(known.clone().into_owned()), help);
        }
        // A field that is missing is the likeliest to be meant. A connection is the input that nothing else is.
        let missed = closest(name, self.missed.iter().map(|(name, _)| name.as_str()));
        let connects = matches!(value.shape, Shape::String(_) | Shape::Tagged(_) | Shape::List(_));
        let missed = missed.or_else(|| self.only_input().filter(|_| connects));
        let near = missed.or_else(|| closest(name, self.known.iter().map(AsRef::as_ref)));
        let help = match near {
            Some(near) => format!("did you mean `{near}`?"),
            None if self.known.is_empty() => "it takes no fields".to_owned(),
            None => self.list(),
        };
        (missed.map(str::to_owned), help)
    }

    /// The input that is not connected, if no other field is missing.
    fn only_input(&self) -> Option<&str> {
        match &self.missed[..] {
            [(name, missing)] if missing.code == "E0401" => Some(name),
            _ => None,
        }
    }

    /// All fields, those of the structure first.
    fn list(&self) -> String {
        let is_general = |name: &&Cow<'_, str>| OF_EVERY_NODE.contains(&name.as_ref());
        let quoted = |names: Vec<&Cow<'_, str>>| {
            let names: Vec<String> = names.into_iter().map(|name| format!("`{name}`")).collect();
            names.join(", ")
        };
        let (general, own): (Vec<_>, Vec<_>) = self.known.iter().partition(is_general);
        match (own.is_empty(), general.is_empty()) {
            (false, false) => format!("its fields are {}, and {}", quoted(own), quoted(general)),
            (true, _) => format!("its fields are {}", quoted(general)),
            (_, true) => format!("its fields are {}", quoted(own)),
        }
    }

    /// Reads one field by its spec; the workhorse of [`settings!`](crate::settings!).
    pub fn setting<T: Setting>(
        &mut self,
        name: &'static str,
        default: Option<T>,
        range: Option<(f64, f64)>,
        reading: &mut Reading<'_>,
    ) -> Option<T> {
        let Some(at) = self.take_at(name.into()) else {
            if default.is_none() {
                let special = self.missing.iter().find(|(missing, _)| missing == name);
                let diagnostic = match special {
                    Some((_, special)) => special.clone(),
                    None => {
                        let help = format!("add `{name}: ...`, {}", T::expected());
                        Some(Diagnostic::missing(self.span, &self.owner, name, help))
                    }
                };
                self.missed.extend(diagnostic.map(|diagnostic| (name.to_owned(), diagnostic)));
            }
            return default;
        };
        let value = &self.entries[at].1;
        let outer = reading.setting.replace(name);
        let read = T::read(value, reading);
        reading.setting = outer;
        let read = read?;
        if let Some((low, high)) = range
            && let Some(number) = read.numbers().into_iter().find(|number| !(low..=high).contains(number))
        {
            let message = format!("`{name}` is out of range: {number}");
            let label = format!("choose a value from {low} to {high}");
            reading.diagnostics.push(Diagnostic::error("E0302", value.span, message).label(label));
            return None;
        }
        Some(read)
    }
}

/// True if a name is given more than once.
fn has_repeated(entries: &[(Name, Value)]) -> bool {
    let mut names: Vec<&str> = entries.iter().map(|(name, _)| name.text.as_str()).collect();
    names.sort_unstable();
    names.windows(2).any(|two| two[0] == two[1])
}

/// A number without the rounding errors of its last digits.
pub(super) fn rounded(number: f64) -> f64 {
    format!("{number:.11e}").parse().unwrap_or(number)
}

/// The fields of a structure value; reports any other value.
pub fn fields_of(value: &Value, owner: &str, reading: &mut Reading<'_>) -> Option<Fields> {
    let entries = match &value.shape {
        Shape::Unit => Arc::default(),
        Shape::Tagged(Tagged { body: Body::Fields(fields), .. }) => Arc::clone(fields),
        Shape::Tagged(Tagged { body: Body::Bare, .. }) => Arc::default(),
        Shape::Tagged(Tagged { body: Body::Tuple(values), .. }) if values.is_empty() => Arc::default(),
        _ => {
            let expected = Expected::described(format!("the settings of {owner}, like (name: value)"));
            reading.mismatch(value, &expected);
            return None;
        }
    };
    Some(Fields::new(owner.to_owned(), value.span, entries, reading))
}

/// Reads the choice that a value makes, one of `choices`, with the fields that it has; reports any other value.
pub fn read_choice<T>(
    value: &Value,
    choices: &[&'static str],
    reading: &mut Reading<'_>,
    read: impl FnOnce(&str, &mut Fields, &mut Reading<'_>) -> Option<T>,
) -> Option<T> {
    let Shape::Tagged(Tagged { name: Some(name), .. }) = &value.shape else {
        reading.not_a_choice(value, choices);
        return None;
    };
    if !choices.contains(&name.text.as_str()) {
        unknown_choice(&name.text, choices, name.span, reading);
        return None;
    }
    let mut fields = fields_of(value, &format!("`{}`", name.text), reading)?;
    let read = read(&name.text, &mut fields, reading);
    fields.finish(reading);
    read
}
