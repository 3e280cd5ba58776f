//! Values into text: RON that reads back as the same values, at the places that writing gives them.

use super::text::{MAX_DEPTH, is_name};
use super::value::{Body, Name, Shape, Tagged, Value};
use crate::diagnostic::{Diagnostic, SourceId, Span};

/// The layout of the items of a list or structure.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Layout {
    Row,
    Lines,
}

/// Writes values one after the other into a text.
#[derive(Default)]
pub(super) struct Writer {
    /// The text so far.
    pub text: String,
    /// Names that are no names, and brackets nested too deeply: the text does not read back as what was written.
    pub diagnostics: Vec<Diagnostic>,
    source: SourceId,
    depth: usize,
}

impl Writer {
    /// A writer of the source of this number.
    pub(super) fn of(source: SourceId) -> Self {
        Self { source, ..Self::default() }
    }

    /// Writes a file: one structure, each field on its lines.
    pub(super) fn file(&mut self, value: &mut Value) {
        self.value_as(value, Layout::Lines);
        self.text.push('\n');
    }

    /// Writes a value. Maps have a line for each entry.
    pub(super) fn value(&mut self, value: &mut Value) {
        self.value_as(value, Layout::Row);
    }

    fn value_as(&mut self, value: &mut Value, layout: Layout) {
        let start = self.text.len();
        match &mut value.shape {
            Shape::Unit => self.text += "()",
            Shape::Bool(true) => self.text += "true",
            Shape::Bool(false) => self.text += "false",
            Shape::Number(number, text) => {
                // A program's own values may have been given another text.
                if text.parse::<f64>().map(f64::to_bits) != Ok(number.to_bits()) {
                    *text = format!("{number:?}");
                }
                self.text += text;
            }
            // Rust's escapes are RON's.
            Shape::String(text) => self.text += &format!("{text:?}"),
            Shape::List(values) => self.items(["[", "]"], layout, values, Self::value),
            Shape::Map(pairs) => self.items(["{", "}"], Layout::Lines, pairs, |writer, (key, value)| {
                writer.value(key);
                writer.text += ": ";
                writer.value(value);
            }),
            Shape::Tagged(Tagged { name, body }) => {
                if let Some(name) = name {
                    self.name(name);
                }
                match body {
                    Body::Bare => {}
                    Body::Tuple(values) => self.items(["(", ")"], layout, values, Self::value),
                    Body::Fields(fields) => {
                        let mut written = fields.to_vec();
                        self.items(["(", ")"], layout, &mut written, |writer, (name, value)| {
                            writer.name(name);
                            writer.text += ": ";
                            writer.value(value);
                        });
                        *fields = written.into();
                    }
                }
            }
        }
        value.span = self.since(start);
    }

    fn items<T>(
        &mut self,
        [open, close]: [&str; 2],
        layout: Layout,
        items: &mut [T],
        mut write: impl FnMut(&mut Self, &mut T),
    ) {
        let start = self.text.len();
        self.text += open;
        if self.depth < MAX_DEPTH {
            self.depth += 1;
            for (index, item) in items.iter_mut().enumerate() {
                match layout {
                    Layout::Lines => self.line(),
                    Layout::Row if index > 0 => self.text += ", ",
                    Layout::Row => {}
                }
                write(self, item);
                if layout == Layout::Lines {
                    self.text.push(',');
                }
            }
            self.depth -= 1;
            if layout == Layout::Lines && !items.is_empty() {
                self.line();
            }
        } else {
            let message = "brackets are nested too deeply";
            let diagnostic = Diagnostic::error("E0104", self.since(start), message);
            self.diagnostics.push(diagnostic.help(format!("at most {MAX_DEPTH} levels are read")));
        }
        self.text += close;
    }

    fn line(&mut self) {
        self.text.push('\n');
        self.text.extend(std::iter::repeat_n("    ", self.depth));
    }

    fn name(&mut self, name: &mut Name) {
        let start = self.text.len();
        self.text += &name.text;
        name.span = self.since(start);
        if !is_name(&name.text) {
            let message = format!("`{}` is not a name", name.text.escape_debug());
            self.diagnostics.push(
                Diagnostic::error("E0101", name.span, message)
                    .label("not a name")
                    .help("a name begins with a letter or `_` and has letters, digits and `_`"),
            );
        }
    }

    fn since(&self, start: usize) -> Span {
        Span { source: self.source, start, end: self.text.len() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Setting;
    use proptest::prelude::*;

    /// Values of every shape, as they are read: without fields or values, a structure without a name is `()`.
    fn values() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Shape::Unit.into()),
            any::<bool>().prop_map(|flag| flag.value()),
            any::<f64>()
                .prop_filter("NaN equals nothing", |number| !number.is_nan())
                .prop_map(|number| number.value()),
            any::<u64>().prop_map(|number| number.value()),
            any::<String>().prop_map(|text| text.value()),
            names().prop_map(|name| Value::name(&name)),
        ];
        leaf.prop_recursive(4, 40, 5, |inner| {
            let many = || prop::collection::vec(inner.clone(), 0..4);
            let fields = || prop::collection::vec((names(), inner.clone()), 0..4);
            prop_oneof![
                many().prop_map(|values| Shape::List(values).into()),
                prop::collection::vec((inner.clone(), inner.clone()), 0..4)
                    .prop_map(|pairs| Shape::Map(pairs).into()),
                fields().prop_map(Value::structure),
                (names(), fields()).prop_map(|(name, fields)| Value::structure(fields).named(&name)),
                (names(), many()).prop_map(|(name, values)| {
                    let body = Body::Tuple(values);
                    Value::from(Shape::Tagged(Tagged { name: None, body })).named(&name)
                }),
            ]
        })
    }

    fn names() -> impl Strategy<Value = String> {
        "[A-Za-z_é][A-Za-z0-9_é]{0,6}".prop_filter("a word of RON", |name| is_name(name))
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

        #[test]
        fn what_is_written_reads_back_at_its_places(value in values()) {
            let (mut value, mut writer) = (value, Writer::default());
            writer.value(&mut value);
            prop_assert!(writer.diagnostics.is_empty(), "{:?}", writer.diagnostics);
            // A text that begins with two names is taken for prose.
            let text = format!("[{}]", writer.text);
            let Ok(read) = Value::parse(&text) else {
                return Err(TestCaseError::fail(text));
            };
            let Shape::List(read) = &read.shape else { unreachable!() };
            let mut moved = Writer { text: "[".into(), ..Writer::default() };
            moved.value(&mut value);
            prop_assert_eq!(read.as_slice(), std::slice::from_ref(&value), "{}", text);
        }
    }

    #[test]
    fn numbers_keep_their_bits() {
        for number in [0.1 + 0.2, -0.0, 5e-324, -f64::MIN_POSITIVE, f64::MAX, 1e300 / 3.0, f64::NEG_INFINITY]
        {
            let Ok(Value { shape: Shape::Number(read, text), .. }) = Value::parse(&number.show()) else {
                panic!("{number:?}")
            };
            assert_eq!((read.to_bits(), text), (number.to_bits(), number.show()));
        }
        assert_eq!(u64::MAX.show(), "18446744073709551615");
    }

    #[test]
    fn what_would_not_read_back_is_reported() {
        let mut deep = 1_u32.value();
        for _ in 0..=MAX_DEPTH {
            deep = Shape::List(vec![deep]).into();
        }
        for (mut value, code) in [
            (Value::name("two words"), "E0101"),
            (Value::name("true"), "E0101"),
            (Value::structure([("a.b", 1_u32.value())]), "E0101"),
            (deep, "E0104"),
        ] {
            let mut writer = Writer::default();
            writer.value(&mut value);
            let codes: Vec<&str> = writer.diagnostics.iter().map(|found| found.code).collect();
            assert_eq!(codes, [code]);
        }
    }
}
