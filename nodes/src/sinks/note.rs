//! The note beside a signal file, `<file>.ron`: quantities and units, and whether the signals were simulated.

use haptograph_engine::node::Stream;
use std::io;
use std::path::Path;

/// Writes the note of the file at `path`: `about` in words, then `facts`, each `name: value` in RON.
pub(super) fn write(path: &Path, about: &str, facts: &[String]) -> io::Result<()> {
    let facts: String = facts.iter().map(|fact| format!("    {fact},\n")).collect();
    std::fs::write(path.with_added_extension("ron"), format!("// {about}\nRecording(\n{facts})\n"))
}

/// Quantity and unit of a signal.
pub(super) fn meaning(stream: &Stream) -> [String; 2] {
    let quantity = stream.quantity.name().unwrap_or("unnamed");
    [format!("quantity: {quantity:?}"), format!("unit: {:?}", stream.quantity.unit())]
}

/// Rate, and whether any of the signals was simulated.
pub(super) fn origin(streams: &[Stream]) -> [String; 2] {
    let rate_hz = streams.first().map_or(0.0, |stream| stream.rate.hz());
    let simulated = streams.iter().any(|stream| stream.simulated);
    [format!("rate_hz: {rate_hz}"), format!("simulated: {simulated}")]
}
