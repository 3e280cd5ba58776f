//! Plots that a graph requests, drawn on the page of a run. Like file sinks they take every signal at its own
//! rate; the page is their file, so they write none of their own.

use crate::contact::Contact;
use haptograph_engine::frame::{Kind, OneKind};
use haptograph_engine::node::{
    BuildError, FileContext, FileKind, FileSink, Flow, FrameWriter, InputSpec, KindRule, NodeSpec, Presence,
    QuantityRule, Stream,
};
use haptograph_engine::settings::NoSettings;
use std::io;
use std::path::{Path, PathBuf};

/// The group of the nodes of this file.
pub const GROUP: &str = "plots";

const fn any(name: &'static str, kind: KindRule, presence: Presence, doc: &'static str) -> InputSpec {
    InputSpec { name, kind, quantity: QuantityRule::Any, flow: Flow::Sampled, presence, doc }
}

/// Signals over time.
pub struct TimePlot;

impl FileKind for TimePlot {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "TimePlot",
        group: GROUP,
        doc: "Requests a plot of signals over time on the page of a run, under the name of this node: signals of one \
              quantity in one frame. For a vector, its length is drawn.",
        source: "",
        inputs: &[any(
            "inputs",
            KindRule::Any,
            Presence::Many,
            "Scalars, 3-vectors or events of any quantities and rates.",
        )],
        outputs: &[],
        example: r#""forces": TimePlot(inputs: ["stylus.force", "speed.speed"])"#,
    };

    fn build(_: NoSettings, cx: &FileContext) -> Result<Box<dyn FileSink>, BuildError> {
        require(&cx.streams, &[Kind::SCALAR, Kind::VECTOR, Kind::EVENT])
    }
}

/// One signal against another.
pub struct XyPlot;

impl FileKind for XyPlot {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "XyPlot",
        group: GROUP,
        doc: "Requests a plot of signals against another on the page of a run, under the name of this node.",
        source: "",
        inputs: &[
            any("x", KindRule::Is(Kind::SCALAR), Presence::Required, "Across."),
            any("y", KindRule::Any, Presence::Many, "Upwards: scalars, or lengths of 3-vectors."),
        ],
        outputs: &[],
        example: r#""force by speed": XyPlot(x: "speed.speed", y: ["stylus.force"])"#,
    };

    fn build(_: NoSettings, cx: &FileContext) -> Result<Box<dyn FileSink>, BuildError> {
        require(&cx.streams, &[Kind::SCALAR, Kind::VECTOR])
    }
}

/// Paths seen from above.
pub struct PathPlot;

impl FileKind for PathPlot {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "PathPlot",
        group: GROUP,
        doc: "Requests a plot of paths seen from above (x to the right, y upwards) on the page of a run, under the \
              name of this node. For a contact, the path of its proxy is drawn while it touches.",
        source: "",
        inputs: &[any("inputs", KindRule::Any, Presence::Many, "3-vectors of one quantity, or contacts.")],
        outputs: &[],
        example: r#""strokes": PathPlot(inputs: ["stylus.position"])"#,
    };

    fn build(_: NoSettings, cx: &FileContext) -> Result<Box<dyn FileSink>, BuildError> {
        require(&cx.streams, &[Kind::VECTOR, Contact::KIND])
    }
}

fn require(streams: &[Stream], kinds: &[Kind]) -> Result<Box<dyn FileSink>, BuildError> {
    if let Some(other) = streams.iter().find(|stream| !kinds.contains(&stream.kind)) {
        let message = format!("{} is a {}, which this plot cannot draw", other.name, other.kind);
        let names: Vec<String> = kinds.iter().map(ToString::to_string).collect();
        return Err(BuildError::at("inputs", message).help(format!("it draws a {}", names.join(" or a "))));
    }
    let names: Vec<&str> = streams.iter().map(|stream| stream.name.as_str()).collect();
    Ok(Box::new(OnThePage { name: format!("plot of {}", names.join(", ")).into() }))
}

/// A plot on the page, which reads the signals itself: nothing is written here.
#[derive(Debug, Clone)]
struct OnThePage {
    /// Distinguishes plots; no file has this name.
    name: PathBuf,
}

impl FileSink for OnThePage {
    fn file_name(&self) -> &Path {
        &self.name
    }

    fn open(&self, _: &Path, _: &[Stream]) -> io::Result<Box<dyn FrameWriter>> {
        Ok(Box::new(self.clone()))
    }
}

impl FrameWriter for OnThePage {
    fn write(&mut self, _: usize, _: &[f64]) -> io::Result<()> {
        Ok(())
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::frames::Weights;
    use haptograph_signal::quantity::Quantity;
    use haptograph_signal::time::Rate;

    #[test]
    fn what_cannot_be_drawn_is_refused_by_name() {
        let stream = |kind| Stream {
            name: "locate.weights".into(),
            kind,
            quantity: Quantity::NUMBER,
            rate: Rate::from_hz(1000).unwrap(),
            simulated: false,
        };
        let cx = |kinds: &[Kind]| FileContext {
            streams: kinds.iter().copied().map(stream).collect(),
            ..FileContext::default()
        };
        let refused = TimePlot::build(NoSettings {}, &cx(&[Weights::KIND])).err();
        assert!(refused.is_some_and(|e| e.message.contains("locate.weights")));
        assert!(XyPlot::build(NoSettings {}, &cx(&[Kind::SCALAR, Kind::VECTOR])).is_ok());
        assert!(PathPlot::build(NoSettings {}, &cx(&[Kind::SCALAR])).is_err());
    }
}
