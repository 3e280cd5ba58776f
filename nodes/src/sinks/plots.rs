//! Plots that a graph requests, drawn on the page of a run. Like file sinks they take every signal at its own
//! rate; the page is their file, so they write none of their own.

use crate::contact::Contact;
use haptograph_engine::frame::{AnyKind, Kind, OneKind, Scalar};
use haptograph_engine::node::{BuildError, FileContext, FileKind, FileSink, FrameWriter, Many, Port, Stream};
use haptograph_engine::settings::NoSettings;
use std::io;
use std::path::{Path, PathBuf};

/// The group of the nodes of this file.
pub const GROUP: &str = "plots";

haptograph_engine::node! {
    /// Requests a plot of signals over time on the page of a run, under the name of this node: signals of one quantity in
    /// one frame. For a vector, its length is drawn.
    /// Elsewhere: plot, scope~, Scope.
    pub struct TimePlot(NoSettings) in GROUP;
    example: r#""forces": TimePlot(inputs: ["stylus.force", "speed.speed"])"#;
    in INPUTS: AnyKind, Many = Port::any("Scalars, 3-vectors or events of any quantities and rates.");
}

impl FileKind for TimePlot {
    fn build(_: NoSettings, cx: &FileContext) -> Result<Box<dyn FileSink>, BuildError> {
        require(&cx.streams, &[Kind::SCALAR, Kind::VECTOR, Kind::EVENT])
    }
}

haptograph_engine::node! {
    /// Requests a plot of signals against another on the page of a run, under the name of this node.
    pub struct XyPlot(NoSettings) in GROUP;
    example: r#""force by speed": XyPlot(x: "speed.speed", y: ["stylus.force"])"#;
    in X: Scalar = Port::any("Across.");
    in Y: AnyKind, Many = Port::any("Upwards: scalars, or lengths of 3-vectors.");
}

impl FileKind for XyPlot {
    fn build(_: NoSettings, cx: &FileContext) -> Result<Box<dyn FileSink>, BuildError> {
        require(&cx.streams, &[Kind::SCALAR, Kind::VECTOR])
    }
}

haptograph_engine::node! {
    /// Requests a plot of paths seen from above (x to the right, y upwards) on the page of a run, under the name of this
    /// node. For a contact, the path of its proxy is drawn while it touches.
    pub struct PathPlot(NoSettings) in GROUP;
    example: r#""strokes": PathPlot(inputs: ["stylus.position"])"#;
    in INPUTS: AnyKind, Many = Port::any("3-vectors of one quantity, or contacts.");
}

impl FileKind for PathPlot {
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
