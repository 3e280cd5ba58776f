//! Documents built in code, for programs without a graph file.

use super::value::{Body, Shape, Tagged, Value};
use super::write::Writer;
use super::{Document, LoadOptions, load};
use crate::diagnostic::{Diagnostics, SourceId, Sources};
use crate::settings::Setting;

/// Builds a document from Rust code.
///
/// What it makes are the values of a graph file, with the text that holds them: messages quote it, and [`Builder::text`] can be
/// saved and edited. Numbers reach the nodes with the bits that were given.
///
/// ```
/// use haptograph_engine::document::{Builder, Part, hold};
///
/// let document = Builder::new("A tone and its copy.")
///     .driver("audio", 48_000.0)
///     .derived("slow", "audio", 1000.0)
///     .node("tone", Part::new("Sine").on("audio").set("frequency_hz", 440.0))
///     .node("copy", Part::new("Gain").on("slow").wire("input", hold("tone.output")).set("gain", 0.5))
///     .build()?;
/// # Ok::<(), haptograph_engine::diagnostic::Diagnostics>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct Builder {
    about: String,
    seed: u64,
    clocks: Vec<(String, Part)>,
    nodes: Vec<(String, Part)>,
    endpoints: Vec<(String, Vec<(String, Part)>)>,
}

/// A node or device and its fields.
#[derive(Debug, Clone)]
pub struct Part {
    /// None for a group of settings.
    kind: Option<String>,
    fields: Vec<(String, Value)>,
}

/// A connection as written: a name like `"tone.output"` or a bridge like [`hold`].
#[derive(Debug, Clone)]
pub struct Wire(Value);

/// What can be written as the value of a field.
pub trait Written {
    /// The value as it stands in a graph file.
    fn written(&self) -> Value;
}

impl<T: Setting> Written for T {
    fn written(&self) -> Value {
        self.value()
    }
}

impl Written for &str {
    fn written(&self) -> Value {
        Value::text(self)
    }
}

/// A group of settings, such as a limit or a stroke.
impl Written for Part {
    fn written(&self) -> Value {
        let fields = self.fields.iter();
        let value = Value::structure(fields.map(|(name, value)| (name.as_str(), value.clone())));
        match &self.kind {
            Some(kind) => value.named(kind),
            None => value,
        }
    }
}

impl Builder {
    /// A document about something.
    pub fn new(about: &str) -> Self {
        Self { about: about.to_owned(), ..Self::default() }
    }

    /// The seed of all random streams; 0 where it is not set.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// A clock with its own crystal or timer.
    #[must_use]
    pub fn driver(mut self, name: &str, rate_hz: f64) -> Self {
        let clock = Part::new("Driver").set("rate_hz", rate_hz);
        self.clocks.push((name.to_owned(), clock));
        self
    }

    /// A clock at an exact ratio of a driver's.
    #[must_use]
    pub fn derived(mut self, name: &str, of: &str, rate_hz: f64) -> Self {
        let clock = Part::new("Derived").set("of", of).set("rate_hz", rate_hz);
        self.clocks.push((name.to_owned(), clock));
        self
    }

    /// A node.
    #[must_use]
    pub fn node(mut self, name: &str, part: Part) -> Self {
        self.nodes.push((name.to_owned(), part));
        self
    }

    /// A device of a set of endpoints, `"simulated"` or `"live"`.
    #[must_use]
    pub fn device(mut self, set: &str, name: &str, part: Part) -> Self {
        let entry = (name.to_owned(), part);
        match self.endpoints.iter_mut().find(|(known, _)| known == set) {
            Some((_, entries)) => entries.push(entry),
            None => self.endpoints.push((set.to_owned(), vec![entry])),
        }
        self
    }

    /// The text of the graph file.
    pub fn text(&self) -> String {
        self.write().1.text
    }

    /// The document, whose file is called `<graph>`.
    ///
    /// # Errors
    /// Names of kinds or fields that are no names.
    pub fn build(&self) -> Result<Document, Diagnostics> {
        let (value, Writer { text, diagnostics, .. }) = self.write();
        let mut sources = Sources::default();
        sources.add("<graph>".into(), text.into());
        match diagnostics.is_empty() {
            true => load::value(sources, value, &LoadOptions::default()),
            false => Err(Diagnostics { sources, list: diagnostics }),
        }
    }

    /// The value of the file with its places, and the text to which they point.
    fn write(&self) -> (Value, Writer) {
        let parts = |parts: &[(String, Part)]| {
            Value::map(parts.iter().map(|(name, part)| (name.as_str(), part.written())))
        };
        let sets = self.endpoints.iter();
        let mut value = Value::structure([
            ("format", load::FORMAT.value()),
            ("about", self.about.value()),
            ("seed", self.seed.value()),
            ("clocks", parts(&self.clocks)),
            ("nodes", parts(&self.nodes)),
            ("endpoints", Value::map(sets.map(|(set, devices)| (set.as_str(), parts(devices))))),
        ])
        .named("Graph");
        let mut writer = Writer::of(SourceId::default());
        writer.file(&mut value);
        (value, writer)
    }
}

impl Part {
    /// A node or device of this kind.
    pub fn new(kind: &str) -> Self {
        Self { kind: Some(kind.to_owned()), fields: Vec::new() }
    }

    /// Settings without a kind: `.set("limit", Part::group().set("peak_a", 0.5).set("continuous_a", 0.25))`.
    pub fn group() -> Self {
        Self { kind: None, fields: Vec::new() }
    }

    /// Gives the node's clock.
    #[must_use]
    pub fn on(self, clock: &str) -> Self {
        self.set("clock", clock)
    }

    /// Sets a setting.
    #[must_use]
    pub fn set(mut self, name: &str, value: impl Written) -> Self {
        self.fields.push((name.to_owned(), value.written()));
        self
    }

    /// Connects an input.
    #[must_use]
    pub fn wire(mut self, input: &str, wire: impl Into<Wire>) -> Self {
        self.fields.push((input.to_owned(), wire.into().0));
        self
    }

    /// Connects an input that takes any number of connections.
    #[must_use]
    pub fn wires<W: Into<Wire>>(mut self, input: &str, wires: impl IntoIterator<Item = W>) -> Self {
        let wires = wires.into_iter().map(|wire| wire.into().0).collect();
        self.fields.push((input.to_owned(), Shape::List(wires).into()));
        self
    }

    /// Connects an input whose connections have names.
    #[must_use]
    pub fn named_wires<'n, W: Into<Wire>>(
        mut self,
        input: &str,
        wires: impl IntoIterator<Item = (&'n str, W)>,
    ) -> Self {
        let wires = wires.into_iter().map(|(name, wire)| (name, wire.into().0));
        self.fields.push((input.to_owned(), Value::map(wires)));
        self
    }
}

impl From<&str> for Wire {
    fn from(output: &str) -> Self {
        Self(Value::text(output))
    }
}

/// A signal of another clock through a registered type of bridge.
pub fn through(bridge: &str, output: &str) -> Wire {
    let body = Body::Tuple(vec![Value::text(output)]);
    Wire(Value::from(Shape::Tagged(Tagged { name: None, body })).named(bridge))
}

/// The latest frame of a signal of another clock.
pub fn hold(output: &str) -> Wire {
    through("Hold", output)
}

/// A straight line between the frames of a slower signal.
pub fn linear(output: &str) -> Wire {
    through("Linear", output)
}

/// The mean of the frames of a faster signal.
pub fn average(output: &str) -> Wire {
    through("Average", output)
}

/// A signal of another clock, band-limited and resampled.
pub fn resample(output: &str) -> Wire {
    through("Resample", output)
}

/// A signal of a clock of another driver, `latency_ms` late.
pub fn ring(output: &str, latency_ms: f64) -> Wire {
    let fields = [("from", Value::text(output)), ("latency_ms", latency_ms.value())];
    Wire(Value::structure(fields).named("Ring"))
}

/// A signal of the same clock, `frames` frames later, 0 before that: what feedback needs.
pub fn delay(output: &str, frames: u64) -> Wire {
    let fields = [("from", Value::text(output)), ("frames", frames.value())];
    Wire(Value::structure(fields).named("Delay"))
}

#[cfg(test)]
mod tests {
    use super::*;

    crate::settings! {
        /// What a setting can hold.
        struct Inner {
            /// Numbers of both signs.
            pair: [f64; 2] = [0.0; 2];
            /// None or some.
            whole: Option<u64> = None;
        }
    }

    crate::choices! {
        /// A choice.
        enum Choice {
            /// Without settings.
            Plain,
            /// With settings.
            Nested(Inner),
        }
    }

    fn builder() -> Builder {
        let inner = |whole| Inner { pair: [-1e-300, f64::MAX], whole };
        let part = Part::new("Kind")
            .on("audio")
            .set("endpoint", "the \"first\"\\second")
            .set("number", -0.1)
            .set("huge", u64::MAX)
            .set("flag", true)
            .set("text", "Größe,\ttab\r\n\u{0}\u{7f}\u{200b}\u{301}'")
            .set("file", std::path::PathBuf::from("a b/c.csv"))
            .set("empty", Vec::<f64>::new())
            .set("none", None::<u32>)
            .set("plain", Choice::Plain)
            .set("nested", vec![Choice::Nested(inner(None)), Choice::Nested(inner(Some(7)))])
            .set("settings", inner(Some(0)))
            .wire("input", hold("a.b"))
            .wires("inputs", ["a".into(), ring("a", 12.5), delay("b", 3)])
            .named_wires("named", [("one", "a".into()), ("the other", hold("b"))]);
        Builder::new("An \"about\"\nof two lines.")
            .seed(u64::MAX)
            .driver("audio", 44_100.1)
            .derived("slow", "audio", 1e3)
            .node("all", part)
            .node("bare", Part::new("Bare"))
            .device("live", "x", Part::new("Soundcard").set("volts", 1e-7))
            .device("simulated", "x", Part::new("Coil"))
            .device("live", "y", Part::new("Soundcard"))
    }

    #[test]
    fn the_text_reads_back_as_the_document_that_was_built() {
        for builder in [builder(), Builder::new("")] {
            let built = builder.build().unwrap_or_else(|wrong| panic!("{wrong}"));
            let read = Document::parse("<graph>", &builder.text()).unwrap_or_else(|wrong| panic!("{wrong}"));
            assert_eq!(format!("{built:#?}"), format!("{read:#?}"));
            assert!(built.findings.is_empty());
        }
    }

    #[test]
    fn the_text_has_a_line_for_each_part() {
        let text = Builder::new("A tone.")
            .driver("audio", 48e3)
            .node("tone", Part::new("Sine").on("audio").set("frequency_hz", 440.0))
            .device("live", "card", Part::new("Soundcard"))
            .text();
        let wanted = r#"Graph(
    format: 1,
    about: "A tone.",
    seed: 0,
    clocks: {
        "audio": Driver(rate_hz: 48000.0),
    },
    nodes: {
        "tone": Sine(clock: "audio", frequency_hz: 440.0),
    },
    endpoints: {
        "live": {
            "card": Soundcard(),
        },
    },
)
"#;
        assert_eq!(text, wanted);
    }

    #[test]
    fn what_is_no_name_is_refused_at_its_place() {
        for part in [
            Part::new("Sine(), \"b\": Gain"),
            Part::new(""),
            Part::new("Gain").set("gain: 1, input", 1.0),
            Part::new("Gain").wire("input", through("No bridge", "a")),
        ] {
            let wrong = Builder::new("").node("a", part).build().unwrap_err();
            let codes: Vec<&str> = wrong.list.iter().map(|found| found.code).collect();
            assert_eq!(codes, ["E0101"]);
            assert_eq!(
                wrong.list[0].primary.as_ref().map(|label| wrong.sources.line_column(label.span).0),
                Some(7)
            );
        }
    }

    #[test]
    fn a_name_that_is_there_twice_is_kept_for_the_check() {
        let document =
            Builder::new("").node("a", Part::new("Sine")).node("a", Part::new("Sine")).build().unwrap();
        let codes: Vec<&str> = document.findings.iter().map(|found| found.code).collect();
        assert_eq!(codes, ["E0105"]);
    }
}
