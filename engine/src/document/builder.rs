//! Documents built in code, for programs without a graph file.

use super::Document;
use crate::diagnostic::Diagnostics;
use crate::settings::Setting;
use std::fmt;

/// Writes a document from Rust code.
///
/// What it makes is the text of a graph file: messages quote it, and [`Builder::text`] can be saved and edited.
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
    clocks: String,
    nodes: String,
    endpoints: Vec<(String, String)>,
}

/// A node or device and its fields.
#[derive(Debug, Clone)]
pub struct Part {
    kind: String,
    fields: Vec<String>,
}

/// A connection as written: a name like `"tone.output"` or a bridge like [`hold`].
#[derive(Debug, Clone)]
pub struct Wire(String);

/// What can be written as the value of a field.
pub trait Written {
    /// As it stands in RON.
    fn written(&self) -> String;
}

impl<T: Setting> Written for T {
    fn written(&self) -> String {
        self.show()
    }
}

impl Written for &str {
    fn written(&self) -> String {
        quoted(self)
    }
}

impl Builder {
    /// A document about something.
    pub fn new(about: &str) -> Self {
        Self {
            about: about.to_owned(),
            ..Self::default()
        }
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
        let name = quoted(name);
        self.clocks += &format!("        {name}: Driver(rate_hz: {rate_hz:?}),\n");
        self
    }

    /// A clock at an exact ratio of a driver's.
    #[must_use]
    pub fn derived(mut self, name: &str, of: &str, rate_hz: f64) -> Self {
        let (name, of) = (quoted(name), quoted(of));
        self.clocks += &format!("        {name}: Derived(of: {of}, rate_hz: {rate_hz:?}),\n");
        self
    }

    /// A node.
    #[must_use]
    pub fn node(mut self, name: &str, part: Part) -> Self {
        let name = quoted(name);
        self.nodes += &format!("        {name}: {part},\n");
        self
    }

    /// A device of a set of endpoints, `"simulated"` or `"live"`.
    #[must_use]
    pub fn device(mut self, set: &str, name: &str, part: Part) -> Self {
        let entry = format!("            {}: {part},\n", quoted(name));
        match self.endpoints.iter_mut().find(|(known, _)| known == set) {
            Some((_, entries)) => *entries += &entry,
            None => self.endpoints.push((set.to_owned(), entry)),
        }
        self
    }

    /// The text of the graph file.
    pub fn text(&self) -> String {
        let sets = self.endpoints.iter();
        let endpoints: String = sets
            .map(|(set, entries)| format!("        {}: {{\n{entries}        }},\n", quoted(set)))
            .collect();
        format!(
            "Graph(\n    format: 1,\n    about: {},\n    seed: {},\n    clocks: {{\n{}    }},\n    nodes: {{\n{}    }},\n    \
             endpoints: {{\n{endpoints}    }},\n)\n",
            quoted(&self.about),
            self.seed,
            self.clocks,
            self.nodes,
        )
    }

    /// The document, whose file is called `<graph>`.
    ///
    /// # Errors
    /// Names of kinds or fields that are no names.
    pub fn build(&self) -> Result<Document, Diagnostics> {
        Document::parse("<graph>", &self.text())
    }
}

impl Part {
    /// A node or device of this kind.
    pub fn new(kind: &str) -> Self {
        Self {
            kind: kind.to_owned(),
            fields: Vec::new(),
        }
    }

    /// Gives the node's clock.
    #[must_use]
    pub fn on(self, clock: &str) -> Self {
        self.set("clock", clock)
    }

    /// Binds the node to a device.
    #[must_use]
    pub fn endpoint(self, device: &str) -> Self {
        self.set("endpoint", device)
    }

    /// Sets a setting.
    #[must_use]
    pub fn set(self, name: &str, value: impl Written) -> Self {
        let written = value.written();
        self.field(name, &written)
    }

    /// Connects an input.
    #[must_use]
    pub fn wire(self, input: &str, wire: impl Into<Wire>) -> Self {
        let Wire(written) = wire.into();
        self.field(input, &written)
    }

    /// Connects an input that takes any number of connections.
    #[must_use]
    pub fn wires<W: Into<Wire>>(self, input: &str, wires: impl IntoIterator<Item = W>) -> Self {
        let written: Vec<String> = wires.into_iter().map(|wire| wire.into().0).collect();
        self.field(input, &format!("[{}]", written.join(", ")))
    }

    fn field(mut self, name: &str, written: &str) -> Self {
        self.fields.push(format!("{name}: {written}"));
        self
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}({})", self.kind, self.fields.join(", "))
    }
}

impl From<&str> for Wire {
    fn from(output: &str) -> Self {
        Self(quoted(output))
    }
}

/// A signal of another clock through a registered type of bridge.
pub fn through(bridge: &str, output: &str) -> Wire {
    Wire(format!("{bridge}({})", quoted(output)))
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
    Wire(format!(
        "Ring(from: {}, latency_ms: {latency_ms:?})",
        quoted(output)
    ))
}

/// A signal of the same clock, `frames` frames later, 0 before that: what feedback needs.
pub fn delay(output: &str, frames: u64) -> Wire {
    Wire(format!("Delay(from: {}, frames: {frames})", quoted(output)))
}

fn quoted(text: &str) -> String {
    let mut quoted = String::with_capacity(text.len() + 2);
    quoted.push('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            '\n' => quoted.push_str("\\n"),
            '\r' => quoted.push_str("\\r"),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}
