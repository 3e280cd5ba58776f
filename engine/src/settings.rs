//! Settings of nodes and devices: typed structs whose declaration gives the reader with its messages, the tables of
//! `haptograph nodes`, and the defaults.

#[macro_use]
mod declare;
mod declared;
mod expected;
mod fields;
mod live;
mod rated;
mod rewrite;
mod unit;
mod values;

pub(crate) use declared::count;
#[doc(hidden)]
pub use declared::declared;
pub use declared::{DeclaredField, EachField, Flag};
use declared::{Specs, Take};
pub(crate) use expected::written;
pub use expected::{Expected, Form};
pub use fields::{Fields, fields_of, read_choice};
pub use haptograph_signal::spelling::{choices, closest};
pub(crate) use live::same;
pub use live::{LiveId, LiveSetting, MAX_LIVE_ITEMS, SettingId, TypedId};
pub(crate) use rated::check_at;
pub use unit::{Scale, check_unit};
pub use values::Named;
pub(crate) use values::{named_values, twice};

use crate::diagnostic::{Diagnostic, Span};
use crate::document::value::{Shape, Tagged, Value};
use haptograph_signal::units::{self, Unit};
use std::path::{Path, PathBuf};

/// Specification of a setting.
#[derive(Debug, Clone, PartialEq)]
pub struct SettingSpec {
    /// The name, with its unit: `cutoff_hz`.
    pub name: &'static str,
    /// Description, from the doc comment.
    pub doc: String,
    /// The values that the setting accepts.
    pub expected: Expected,
    /// The unit of its numbers, of its type or, for a plain number, from its name.
    pub unit: Option<Unit>,
    /// SI per unit of its numbers, by which the engine multiplies what a live setting is set to; 1 for a plain number.
    pub si_per_unit: f64,
    /// Default in RON; `None` if the setting is required.
    pub default: Option<String>,
    /// Smallest and largest value, of each number of a list.
    pub range: Option<(f64, f64)>,
    /// True if the setting can change while the graph runs; of a list, each number, if there are at most
    /// [`MAX_LIVE_ITEMS`].
    pub live: bool,
    /// True if the value is a whole number. Such a setting jumps to a new value.
    pub whole: bool,
    /// True if the value is a frequency that must stay below half the rate of its node.
    pub below_nyquist: bool,
    /// Role of the setting in the engine.
    pub role: SettingRole,
    /// The fields or choices, if it is a structure or an enum.
    pub parts: Vec<Part>,
}

/// Role of a setting in the engine, independent of its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SettingRole {
    /// A setting of the node alone.
    #[default]
    Plain,
    /// The limit of an actuator sink, which a remote edit must not raise.
    Limit,
    /// The file in the run's folder that a sink writes.
    OutputFile,
}

impl SettingSpec {
    /// Makes a setting of type `T` that is not live; `default` as in [`settings!`](crate::settings!).
    pub fn new<T: Setting>(
        name: &'static str,
        doc: String,
        default: Option<&T>,
        range: Option<(f64, f64)>,
    ) -> Self {
        let expected = T::expected();
        Self {
            name,
            doc,
            default: default.map(T::show),
            range,
            live: false,
            whole: expected.is_whole(),
            below_nyquist: false,
            role: SettingRole::Plain,
            parts: T::parts(),
            unit: T::SCALE.unit(name).filter(|_| expected.is_numeric()),
            si_per_unit: T::SCALE.si_per_unit(),
            expected,
        }
    }
}

/// The fields of a structure, or one of the choices of an enum with the fields of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Name of the choice; none for a structure.
    pub choice: Option<&'static str>,
    /// Description, from the doc comment.
    pub doc: String,
    /// The fields, in the order of declaration.
    pub fields: Vec<SettingSpec>,
}

impl Part {
    /// A choice of an enum, with its doc comment and its fields.
    pub fn of_choice(choice: &'static str, doc: &str, fields: Vec<SettingSpec>) -> Self {
        Self { choice: Some(choice), doc: doc.trim().to_owned(), fields }
    }
}

/// A set of named settings; declared by [`settings!`](crate::settings!).
pub trait Settings: Sized + 'static {
    /// Name of the type.
    const NAME: &'static str;
    /// Description, from the doc comment.
    const DOC: &'static str;
    /// The fields, in the order of declaration.
    const FIELDS: &'static [DeclaredField];
    /// Visits each field, in the order of declaration, and all of them before it gives up, so that all errors are reported.
    /// `None` if the visitor gives no value for one of them.
    fn each<V: EachField>(visitor: &mut V) -> Option<Self>;
    /// The names and values of the fields, in the order of declaration.
    fn fields(&self) -> Vec<(&'static str, Value)>;
    /// The specifications of the fields, in the order of declaration: [`list`](Self::list), made once.
    fn specs() -> &'static [SettingSpec];
    /// Makes the specifications of the fields.
    fn list() -> Vec<SettingSpec> {
        let mut specs = Specs::default();
        let _ = Self::each(&mut specs);
        specs.0
    }
    /// Takes its fields out of `fields`. `None` after at least one reported diagnostic.
    fn take_from(fields: &mut Fields, reading: &mut Reading<'_>) -> Option<Self> {
        Self::each(&mut Take { fields, reading })
    }
}

/// Settings are a setting of others: a structure of their fields.
impl<S: Settings> Setting for S {
    fn expected() -> Expected {
        Expected::Structure(S::FIELDS.iter().map(|field| field.name).collect())
    }
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        let mut fields = fields_of(value, &reading.owner(S::NAME), reading)?;
        let read = S::take_from(&mut fields, reading);
        fields.finish(reading);
        read
    }
    fn value(&self) -> Value {
        Value::structure(self.fields())
    }
    fn parts() -> Vec<Part> {
        vec![Part { choice: None, doc: S::DOC.trim().to_owned(), fields: S::specs().to_vec() }]
    }
}

/// A type that a setting can have.
pub trait Setting: Sized {
    /// What its numbers are in SI.
    const SCALE: Scale = Scale::Other;
    /// The values that the type accepts.
    fn expected() -> Expected;
    /// Reads a value. `None` after at least one reported diagnostic.
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self>;
    /// The value as it stands in a graph file, without a place; [`read`](Self::read) gives it back.
    fn value(&self) -> Value;
    /// The value in RON.
    fn show(&self) -> String {
        self.value().into_text()
    }
    /// The fields or choices, for the reference.
    fn parts() -> Vec<Part> {
        Vec::new()
    }
    /// Its numbers, for the check of the range.
    fn numbers(&self) -> Vec<f64> {
        Vec::new()
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
    /// The first source that is not a file but was given on the command line.
    pub first_given: u32,
}

impl Reading<'_> {
    /// Reports that `value` is not of the expected type.
    pub fn mismatch(&mut self, value: &Value, expected: &Expected) {
        let found = match &value.shape {
            Shape::Number(_, text) => text.clone(),
            Shape::Tagged(Tagged { name: Some(name), .. }) => format!("`{}`", name.text),
            _ => value.describe().to_owned(),
        };
        let mut diagnostic = self.wrong(value, &expected.in_message(), &found);
        let is_written = value.span.source.0 < self.first_given;
        diagnostic.help.extend(correction(value, expected.form(), self.setting, is_written));
        self.diagnostics.push(diagnostic);
    }

    /// Reports that `value` is none of `choices`, which are written without quotes.
    pub fn not_a_choice(&mut self, value: &Value, choices: &[&'static str]) {
        let expected = Expected::Choice(choices.to_vec());
        match &value.shape {
            Shape::String(text) if choices.contains(&text.as_str()) => {
                let diagnostic = self.wrong(value, &expected.in_message(), value.describe());
                self.diagnostics.push(diagnostic.help(format!("write `{text}` without quotes")));
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
fn correction(value: &Value, expected: Form, setting: Option<&str>, is_written: bool) -> Option<String> {
    let wants_number = matches!(expected, Form::Number | Form::NumberList);
    match (&value.shape, value.bare_name()) {
        (Shape::String(_), _) if matches!(expected, Form::List | Form::NumberList) => {
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
                () => without_unit(text, setting?),
            }
        }
        (_, Some("pi" | "PI")) if wants_number => {
            Some(format!("write the number: `{}`", std::f64::consts::PI))
        }
        (_, Some(_)) if wants_number && !is_written => Some("write a number".to_owned()),
        (_, Some(name)) if wants_number => {
            Some(format!("write a number; in a graph the value of a parameter is `Param(\"{name}\")`"))
        }
        (_, Some(name)) if expected == Form::Quoted => Some(format!("write `\"{name}\"`")),
        _ => None,
    }
}

/// Help for a number that was written with its unit: `"80 Hz"` for `low_hz`.
fn without_unit(text: &str, setting: &str) -> Option<String> {
    let end = text.find(|c: char| !(c.is_ascii_digit() || "+-.".contains(c)))?;
    let (number, unit) = text.split_at(end);
    let (quantity, si) = units::of_name(setting)?.scale?;
    let factor = units::si_per(unit, quantity)? / si;
    let number = fields::rounded(number.parse::<f64>().ok()? * factor);
    Some(format!("units are in the setting's name; write `{setting}: {number}`"))
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
    reading.diagnostics.push(match closest(word, choices.iter().copied()) {
        Some(near) => diagnostic.help(format!("did you mean `{near}`?")),
        None => diagnostic.help(format!("choose one of {}", choices.join(", "))),
    });
}

settings! {
    /// No settings.
    pub struct NoSettings {}
}
