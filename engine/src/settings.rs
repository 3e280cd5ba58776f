//! Settings of nodes and devices: typed structs whose declaration gives the reader with its messages, the tables of
//! `haptograph nodes`, and the defaults.

mod spelling;
mod values;

pub use spelling::closest;

use crate::diagnostic::{Diagnostic, Span};
use crate::document::value::{Body, Name, Shape, Tagged, Value};
use haptograph_signal::units;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Specification of a setting.
#[derive(Debug, Clone, PartialEq)]
pub struct SettingSpec {
    /// Field name, with its unit: `cutoff_hz`.
    pub name: &'static str,
    /// From the doc comment.
    pub doc: String,
    /// Description of valid values: `a number`, `one of Direct, Lattice`.
    pub expected: String,
    /// Default in RON; `None` if it has to be given.
    pub default: Option<String>,
    /// Smallest and largest value.
    pub range: Option<(f64, f64)>,
    /// Whether it can change while the graph runs.
    pub live: bool,
    /// Whether it is a whole number. Such a setting jumps to a new value.
    pub whole: bool,
    /// Whether it is a frequency that must stay below half the rate of its node.
    pub below_nyquist: bool,
    /// Its fields or choices, if it is a structure or an enum.
    pub parts: Vec<Part>,
}

/// The fields of a structure, or one of the choices of an enum with the fields of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Name of the choice; none for a structure.
    pub choice: Option<&'static str>,
    /// From the doc comment.
    pub doc: String,
    /// Its fields, in the order of declaration.
    pub fields: Vec<SettingSpec>,
}

/// A set of named settings; declared by [`settings!`](crate::settings!).
pub trait Settings: Sized + 'static {
    /// Its fields, in the order of declaration.
    fn specs() -> Vec<SettingSpec>;
    /// Takes its fields out of `fields`. `None` after at least one reported diagnostic.
    fn take_from(fields: &mut Fields, reading: &mut Reading<'_>) -> Option<Self>;
}

/// A type that a setting can have.
pub trait Setting: Sized {
    /// Description of valid values, for messages.
    fn expected() -> String;
    /// Reads a value. `None` after at least one reported diagnostic.
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self>;
    /// The value in RON.
    fn show(&self) -> String;
    /// Its fields or choices, for the reference.
    fn parts() -> Vec<Part> {
        Vec::new()
    }
    /// Whether it is a whole number.
    fn is_whole() -> bool {
        false
    }
    /// Its value as a number, for the check of the range.
    fn number(&self) -> Option<f64> {
        None
    }
}

/// Context of reading: receives diagnostics and resolves paths.
pub struct Reading<'a> {
    /// Diagnostics so far.
    pub diagnostics: &'a mut Vec<Diagnostic>,
    /// The folder to which paths at a span are relative.
    pub folder: &'a dyn Fn(Span) -> PathBuf,
    /// Paths read so far.
    pub files: &'a mut Vec<PathBuf>,
    /// The setting that is being read.
    pub setting: Option<&'static str>,
    /// The first source that is no file: what was given on the command line.
    pub first_given: u32,
}

impl Reading<'_> {
    /// Reports that `value` is not what was expected there.
    pub fn mismatch(&mut self, value: &Value, expected: &str) {
        let found = match &value.shape {
            Shape::Number(_, text) => text.clone(),
            Shape::Tagged(Tagged { name: Some(name), .. }) => format!("`{}`", name.text),
            _ => value.describe().to_owned(),
        };
        let mut diagnostic = self.wrong(value, expected, &found);
        let is_written = value.span.source.0 < self.first_given;
        diagnostic.help.extend(correction(value, expected, is_written));
        self.diagnostics.push(diagnostic);
    }

    /// Reports that `value` is none of `choices`, which are written without quotes.
    pub fn not_a_choice(&mut self, value: &Value, choices: &[&str]) {
        let expected = format!("one of {}", choices.join(", "));
        match &value.shape {
            Shape::String(text) if choices.contains(&text.as_str()) => {
                let diagnostic = self.wrong(value, &expected, value.describe());
                self.diagnostics
                    .push(diagnostic.help(format!("write `{text}` without quotes")));
            }
            _ => self.mismatch(value, &expected),
        }
    }

    /// Reports that `value` has `found` values instead of the expected number.
    pub fn miscounted(&mut self, value: &Value, expected: &str, found: usize) {
        let plural = if found == 1 { "" } else { "s" };
        let diagnostic = self.wrong(value, expected, &format!("{found} value{plural}"));
        self.diagnostics.push(diagnostic);
    }

    /// Name of a structure in messages: the present setting, or `kind` if there is none.
    pub fn owner(&self, kind: &str) -> String {
        format!("`{}`", self.setting.unwrap_or(kind))
    }

    fn wrong(&self, value: &Value, expected: &str, found: &str) -> Diagnostic {
        Diagnostic::error("E0301", value.span, format!("expected {expected}, found {found}"))
            .label(format!("expected {expected}"))
    }

    /// Resolves a path relative to the file that contains it.
    pub fn resolve(&self, span: Span, written: &str) -> PathBuf {
        (self.folder)(span).join(Path::new(written))
    }
}

/// Help for a value of the wrong type, if the correct form can be inferred; `is_written` if it stands in a file.
fn correction(value: &Value, expected: &str, is_written: bool) -> Option<String> {
    let wants_number = expected.contains("number");
    match (&value.shape, value.bare_name()) {
        (Shape::String(_), _) if expected.starts_with("a list") => {
            Some("its values are written into the graph: `[...]`".to_owned())
        }
        (Shape::String(text), _) if wants_number => {
            let text = text.trim();
            let with_point = text.replacen(',', ".", 1);
            match () {
                () if text.parse::<f64>().is_ok() => Some(format!("remove the quotes: `{text}`")),
                () if with_point.parse::<f64>().is_ok() => {
                    Some(format!("a decimal point is `.`: write `{with_point}`"))
                }
                () => None,
            }
        }
        (_, Some("pi" | "PI")) if wants_number => {
            Some(format!("write the number: `{}`", std::f64::consts::PI))
        }
        (_, Some(_)) if wants_number && !is_written => Some("write a number".to_owned()),
        (_, Some(name)) if wants_number => Some(format!(
            "write a number; in a graph the value of a parameter is `Param(\"{name}\")`"
        )),
        (_, Some(name)) if expected.contains("in quotes") => Some(format!("write `\"{name}\"`")),
        _ => None,
    }
}

/// Fields of every kind of node; messages list them last.
const OF_EVERY_NODE: [&str; 2] = ["clock", "only"];

/// The fields of a structure while it is read.
#[derive(Debug, Clone)]
pub struct Fields {
    /// Name of the structure in messages: `` `Gain` ``.
    pub owner: String,
    /// The whole structure.
    pub span: Span,
    entries: Vec<(Name, Value)>,
    known: Vec<String>,
    /// Special diagnostics for missing fields, by name; `None` if the field was reported already.
    missing: Vec<(String, Option<Diagnostic>)>,
    /// Missing fields, reported at the end: an unknown field may be a misspelling of one.
    missed: Vec<(String, Diagnostic)>,
}

impl Fields {
    /// The fields of a structure. A name given twice is reported and its first value kept.
    pub fn new(owner: String, span: Span, entries: Vec<(Name, Value)>, reading: &mut Reading<'_>) -> Self {
        let mut kept: Vec<(Name, Value)> = Vec::with_capacity(entries.len());
        let mut seen: HashMap<String, Span> = HashMap::with_capacity(entries.len());
        for (name, value) in entries {
            match seen.get(&name.text) {
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
                    seen.insert(name.text.clone(), name.span);
                    kept.push((name, value));
                }
            }
        }
        Self {
            owner,
            span,
            entries: kept,
            known: Vec::new(),
            missing: Vec::new(),
            missed: Vec::new(),
        }
    }

    /// Takes the field called `name`, if it was given.
    pub fn take(&mut self, name: &str) -> Option<Value> {
        self.know(name);
        let at = self.entries.iter().position(|(given, _)| given.text == name)?;
        Some(self.entries.remove(at).1)
    }

    /// Declares a known field name without taking the field; for "did you mean".
    pub fn know(&mut self, name: &str) {
        self.known.push(name.to_owned());
    }

    /// Sets the diagnostic for a missing required field; `None` if the reason has been reported already.
    pub(crate) fn if_missing(&mut self, name: &str, diagnostic: Option<Diagnostic>) {
        self.missing.push((name.to_owned(), diagnostic));
    }

    /// Defers the diagnostic of a missing field to [`finish`](Self::finish).
    pub(crate) fn miss(&mut self, name: &str, diagnostic: Diagnostic) {
        self.missed.push((name.to_owned(), diagnostic));
    }

    /// Whether an error of this field has been reported.
    pub(crate) fn is_reported(&self, name: &str) -> bool {
        self.missing
            .iter()
            .any(|(missing, special)| missing == name && special.is_none())
    }

    /// Whether an error was reported for the value of any field.
    pub(crate) fn has_reported(&self) -> bool {
        self.missing.iter().any(|(_, special)| special.is_none())
    }

    /// The fields that have not been taken.
    pub fn remaining(&self) -> &[(Name, Value)] {
        &self.entries
    }

    /// Reports missing fields and fields that were not taken.
    pub fn finish(mut self, reading: &mut Reading<'_>) {
        for (name, value) in std::mem::take(&mut self.entries) {
            let message = format!("{} has no field `{}`", self.owner, name.text);
            let diagnostic = Diagnostic::error("E0204", name.span, message).label("unknown field");
            let (meant, help) = self.meant(&name.text, &value);
            self.missed.retain(|(missed, _)| Some(missed) != meant.as_ref());
            reading.diagnostics.push(diagnostic.help(help));
        }
        let missed = self.missed.into_iter().map(|(_, diagnostic)| diagnostic);
        reading.diagnostics.extend(missed);
    }

    /// Which field was meant by a name that is none, and what to do.
    fn meant(&self, name: &str, value: &Value) -> (Option<String>, String) {
        if let Shape::Number(number, _) = value.shape
            && let Some((known, factor)) = self
                .known
                .iter()
                .find_map(|known| Some((known, units::between(name, known)?)))
        {
            let help = format!("did you mean `{known}: {}`?", spelling::rounded(number * factor));
            return (Some(known.clone()), help);
        }
        // A field that is missing is the likeliest to be meant.
        let missed = closest(name, self.missed.iter().map(|(name, _)| name.as_str()));
        let near = missed.or_else(|| closest(name, self.known.iter().map(String::as_str)));
        let help = match near {
            Some(near) => format!("did you mean `{near}`?"),
            None if self.known.is_empty() => "it takes no fields".to_owned(),
            None => self.list(),
        };
        (missed.map(str::to_owned), help)
    }

    /// All fields that there are, those of its own first.
    fn list(&self) -> String {
        let is_general = |name: &&String| OF_EVERY_NODE.contains(&name.as_str());
        let quoted = |names: Vec<&String>| {
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
        let Some(value) = self.take(name) else {
            if default.is_none() {
                let special = self.missing.iter().find(|(missing, _)| missing == name);
                let diagnostic = match special {
                    Some((_, special)) => special.clone(),
                    None => Some(
                        Diagnostic::error("E0205", self.span, format!("{} needs `{name}`", self.owner))
                            .label(format!("`{name}` is missing"))
                            .help(format!("add `{name}: ...`, {}", T::expected())),
                    ),
                };
                self.missed
                    .extend(diagnostic.map(|diagnostic| (name.to_owned(), diagnostic)));
            }
            return default;
        };
        let outer = reading.setting.replace(name);
        let read = T::read(&value, reading);
        reading.setting = outer;
        let read = read?;
        if let (Some((low, high)), Some(number)) = (range, read.number())
            && !(low..=high).contains(&number)
        {
            let message = format!("`{name}` is out of range: {number}");
            let label = format!("choose a value from {low} to {high}");
            reading
                .diagnostics
                .push(Diagnostic::error("E0302", value.span, message).label(label));
            return None;
        }
        Some(read)
    }
}

/// The fields of a structure value; reports any other value.
pub fn fields_of(value: &Value, owner: &str, reading: &mut Reading<'_>) -> Option<Fields> {
    let entries = match &value.shape {
        Shape::Unit => Vec::new(),
        Shape::Tagged(Tagged {
            body: Body::Fields(fields),
            ..
        }) => fields.clone(),
        Shape::Tagged(Tagged { body: Body::Bare, .. }) => Vec::new(),
        Shape::Tagged(Tagged {
            body: Body::Tuple(values),
            ..
        }) if values.is_empty() => Vec::new(),
        _ => {
            reading.mismatch(value, &format!("the settings of {owner}, like (name: value)"));
            return None;
        }
    };
    Some(Fields::new(owner.to_owned(), value.span, entries, reading))
}

/// Declares a struct of settings with its documentation, defaults and ranges in one place.
///
/// ```
/// haptograph_engine::settings! {
///     /// Settings of a low-pass.
///     pub struct LowPassSettings {
///         /// Where the response has fallen by 3 dB.
///         [live] cutoff_hz: f64 = 20.0, in 0.01..=20_000.0;
///         /// Poles.
///         order: u32 = 2, in 1..=10;
///     }
/// }
/// ```
/// A field without `= default` has to be given. `[live]` marks what may change while the graph runs, and
/// `[live, below_nyquist]` a frequency that has to stay below half of the node's rate when it does. There are no other
/// flags, and a misspelt one does not compile:
///
/// ```compile_fail
/// haptograph_engine::settings! {
///     /// Settings of a low-pass.
///     pub struct LowPassSettings {
///         /// Where the response has fallen by 3 dB.
///         [liev] cutoff_hz: f64 = 20.0;
///     }
/// }
/// ```
#[macro_export]
macro_rules! settings {
    (@live live) => { true };
    (@live below_nyquist) => { false };
    (@live $other:ident) => {
        compile_error!(concat!(
            "unknown flag `", stringify!($other), "` of a setting; the flags are `live` and `below_nyquist`"
        ))
    };
    (@below_nyquist below_nyquist) => { true };
    (@below_nyquist $other:ident) => { false };
    ($(#[doc = $summary:expr])* $vis:vis struct $name:ident {
        $($(#[doc = $doc:expr])* $([$($flag:ident),+])? $field:ident : $type:ty $(= $default:expr)? $(, in $range:expr)? ;)*
    }) => {
        $(#[doc = $summary])*
        #[derive(Debug, Clone, PartialEq)]
        $vis struct $name { $($(#[doc = $doc])* pub $field: $type,)* }

        impl $crate::settings::Settings for $name {
            fn specs() -> Vec<$crate::settings::SettingSpec> {
                vec![$($crate::settings::SettingSpec {
                    name: stringify!($field),
                    doc: [$($doc),*].concat().trim().to_owned(),
                    expected: <$type as $crate::settings::Setting>::expected(),
                    default: {
                        #[allow(unused_mut, unused_assignments)]
                        let mut default: Option<$type> = None;
                        $(default = Some($default);)?
                        default.map(|value| $crate::settings::Setting::show(&value))
                    },
                    range: {
                        #[allow(unused_mut, unused_assignments)]
                        let mut range = None;
                        $(range = Some((f64::from(*($range).start()), f64::from(*($range).end())));)?
                        range
                    },
                    live: [$($($crate::settings!(@live $flag)),+)?].contains(&true),
                    whole: <$type as $crate::settings::Setting>::is_whole(),
                    below_nyquist: [$($($crate::settings!(@below_nyquist $flag)),+)?].contains(&true),
                    parts: <$type as $crate::settings::Setting>::parts(),
                }),*]
            }

            #[allow(unused_variables, unused_mut, unused_assignments)]
            fn take_from(
                fields: &mut $crate::settings::Fields,
                reading: &mut $crate::settings::Reading<'_>,
            ) -> Option<Self> {
                // All fields are read before the first `?`, so that all errors are reported.
                $(let $field = {
                    let mut default: Option<$type> = None;
                    $(default = Some($default);)?
                    let mut range = None;
                    $(range = Some((f64::from(*($range).start()), f64::from(*($range).end())));)?
                    fields.setting(stringify!($field), default, range, reading)
                };)*
                Some(Self { $($field: $field?,)* })
            }
        }

        impl $crate::settings::Setting for $name {
            fn expected() -> String {
                let fields: Vec<&str> = vec![$(stringify!($field)),*];
                format!("a structure ({})", fields.join(": ..., ") + ": ...")
            }
            fn parts() -> Vec<$crate::settings::Part> {
                let doc: &[&str] = &[$($summary),*];
                vec![$crate::settings::Part {
                    choice: None,
                    doc: doc.concat().trim().to_owned(),
                    fields: <Self as $crate::settings::Settings>::specs(),
                }]
            }
            fn read(
                value: &$crate::document::value::Value,
                reading: &mut $crate::settings::Reading<'_>,
            ) -> Option<Self> {
                let owner = reading.owner(stringify!($name));
                let mut fields = $crate::settings::fields_of(value, &owner, reading)?;
                let read = <Self as $crate::settings::Settings>::take_from(&mut fields, reading);
                fields.finish(reading);
                read
            }
            fn show(&self) -> String {
                let fields: Vec<String> = vec![
                    $(format!("{}: {}", stringify!($field), $crate::settings::Setting::show(&self.$field))),*
                ];
                format!("({})", fields.join(", "))
            }
        }
    };
}

/// Declares an enum that a setting chooses from: bare names, or names with settings of their own.
///
/// ```
/// haptograph_engine::settings! {
///     /// A circle.
///     pub struct CircleSettings {
///         /// Its radius.
///         radius_mm: f64 = 30.0;
///     }
/// }
/// haptograph_engine::choices! {
///     /// A path to follow.
///     pub enum Stroke {
///         /// Stay where you are.
///         Still,
///         /// Round and round.
///         Circles(CircleSettings),
///     }
/// }
/// ```
#[macro_export]
macro_rules! choices {
    ($(#[doc = $summary:expr])* $vis:vis enum $name:ident {
        $($(#[doc = $doc:expr])* $variant:ident $(($payload:ty))? ,)*
    }) => {
        $(#[doc = $summary])*
        #[derive(Debug, Clone, PartialEq)]
        $vis enum $name { $($(#[doc = $doc])* $variant $(($payload))?,)* }

        impl $crate::settings::Setting for $name {
            fn expected() -> String {
                let names: Vec<&str> = vec![$(stringify!($variant)),*];
                format!("one of {}", names.join(", "))
            }
            fn parts() -> Vec<$crate::settings::Part> {
                vec![$($crate::settings::Part {
                    choice: Some(stringify!($variant)),
                    doc: [$($doc),*].concat().trim().to_owned(),
                    fields: $crate::choices!(@fields $($payload)?),
                }),*]
            }
            fn read(
                value: &$crate::document::value::Value,
                reading: &mut $crate::settings::Reading<'_>,
            ) -> Option<Self> {
                // Full paths: the enum itself may be called `Shape`.
                let $crate::document::value::Shape::Tagged($crate::document::value::Tagged {
                    name: Some(name), ..
                }) = &value.shape else {
                    reading.not_a_choice(value, &[$(stringify!($variant)),*]);
                    return None;
                };
                match name.text.as_str() {
                    $(stringify!($variant) => $crate::choices!(@read $name $variant value reading $($payload)?),)*
                    unknown => {
                        $crate::settings::unknown_choice(unknown, &[$(stringify!($variant)),*], name.span, reading);
                        None
                    }
                }
            }
            fn show(&self) -> String {
                match self { $($crate::choices!(@pattern $variant shown $($payload)?) =>
                    $crate::choices!(@show $variant shown $($payload)?),)* }
            }
        }
    };
    (@fields) => { Vec::new() };
    (@fields $payload:ty) => { <$payload as $crate::settings::Settings>::specs() };
    (@read $name:ident $variant:ident $value:ident $reading:ident) => {{
        let fields = $crate::settings::fields_of($value, concat!("`", stringify!($variant), "`"), $reading)?;
        fields.finish($reading);
        Some($name::$variant)
    }};
    (@read $name:ident $variant:ident $value:ident $reading:ident $payload:ty) => {{
        let mut fields =
            $crate::settings::fields_of($value, concat!("`", stringify!($variant), "`"), $reading)?;
        let read = <$payload as $crate::settings::Settings>::take_from(&mut fields, $reading);
        fields.finish($reading);
        read.map($name::$variant)
    }};
    (@pattern $variant:ident $shown:ident) => { Self::$variant };
    (@pattern $variant:ident $shown:ident $payload:ty) => { Self::$variant($shown) };
    (@show $variant:ident $shown:ident) => { stringify!($variant).to_owned() };
    (@show $variant:ident $shown:ident $payload:ty) => {
        format!("{}{}", stringify!($variant), $crate::settings::Setting::show($shown))
    };
}

/// Reports a name that is not in `choices`.
pub fn unknown_choice(word: &str, choices: &[&'static str], span: Span, reading: &mut Reading<'_>) {
    let diagnostic = Diagnostic::error(
        "E0303",
        span,
        format!(
            "unknown {} `{word}`; expected one of: {}",
            reading.setting.unwrap_or("value"),
            choices.join(", ")
        ),
    );
    reading
        .diagnostics
        .push(match closest(word, choices.iter().copied()) {
            Some(near) => diagnostic.help(format!("did you mean `{near}`?")),
            None => diagnostic.help(format!("choose one of {}", choices.join(", "))),
        });
}

settings! {
    /// No settings.
    pub struct NoSettings {}
}
