//! What a graph asks of soundcards: what it plays there and what it hears.

use super::SoundcardError;
use super::card::{Card, CardFormat, Output};
use haptograph_engine::graph::{Graph, GraphDevice, NodeId};

/// A stream to a card or from it, as endpoints ask for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// The card's name; none: the default.
    pub device: Option<String>,
    /// Rate, Hz.
    pub rate_hz: u32,
    /// Frames of a buffer.
    pub buffer_frames: u32,
    /// Form of the samples.
    pub format: CardFormat,
    /// Channels at least.
    pub channels: u16,
}

impl Request {
    /// How long a buffer lasts, s.
    pub(super) fn buffer_s(&self) -> f64 {
        f64::from(self.buffer_frames) / f64::from(self.rate_hz)
    }

    /// What, but for their channels, keeps the two from being one stream.
    pub(super) fn differs_from(&self, other: &Self) -> Option<&'static str> {
        match () {
            () if self.device != other.device => Some("`device`"),
            () if self.rate_hz != other.rate_hz => Some("their rates"),
            () if self.buffer_frames != other.buffer_frames => Some("`buffer_frames`"),
            () if self.format != other.format => Some("`format`"),
            () => None,
        }
    }
}

/// All that a graph asks of soundcards. A run that has it can take over any graph that asks for the same.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// The stream that drives the graph; none where no endpoint plays.
    pub output: Option<Request>,
    /// What it hears.
    pub inputs: Vec<Heard>,
}

/// What an endpoint hears.
#[derive(Debug, Clone, PartialEq)]
pub struct Heard {
    endpoint: String,
    /// Of its settings as they are written: a run carries a device over to another graph by it, and with the device the
    /// end of the ring from the card.
    fingerprint: u64,
}

/// What an endpoint plays: the output that drives it, and what a sample of 1 stands for.
#[derive(Debug, Clone, PartialEq)]
pub struct Played {
    /// Name of the endpoint.
    pub endpoint: String,
    /// The sink that drives it.
    pub sink: NodeId,
    /// In the unit of the sink.
    pub full_scale: f64,
}

/// What the endpoints of a graph ask of soundcards.
///
/// # Errors
/// [`SoundcardError`] where those that play do not go together.
pub fn wanted(graph: &Graph) -> Result<Wanted, SoundcardError> {
    let inputs = cards(graph).filter(|(_, card)| card.input.is_some());
    let heard = |(device, _): (&GraphDevice, &Card)| Heard {
        endpoint: device.name.clone(),
        fingerprint: device.fingerprint,
    };
    Ok(Wanted {
        output: output(graph)?,
        inputs: inputs.map(heard).collect(),
    })
}

fn output(graph: &Graph) -> Result<Option<Request>, SoundcardError> {
    let mut found: Vec<(&str, &Output)> = Vec::new();
    for (device, card) in cards(graph) {
        let Some(output) = &card.output else { continue };
        if graph.clocks()[device.clock].driver != device.clock {
            return Err(SoundcardError::Derived(device.name.clone()));
        }
        let name = || device.name.clone();
        if let Some((first, other)) = found.first()
            && let Some(what) = output.stream.differs_from(&other.stream)
        {
            return Err(SoundcardError::Differ((*first).to_owned(), name(), what));
        }
        for channel in &output.channels {
            if let Some((other, _)) = found.iter().find(|(_, other)| other.channels.contains(channel)) {
                return Err(SoundcardError::Shared((*other).to_owned(), name(), *channel));
            }
        }
        found.push((&device.name, output));
    }
    let streams = found.iter().map(|(_, output)| &output.stream);
    Ok(streams.max_by_key(|stream| stream.channels).cloned())
}

fn cards(graph: &Graph) -> impl Iterator<Item = (&GraphDevice, &Card)> {
    let devices = graph.devices().iter();
    devices.filter_map(|device| Some((device, device.device().as_any().downcast_ref::<Card>()?)))
}

/// What the soundcard endpoints of a graph play.
pub fn played(graph: &Graph) -> Vec<Played> {
    let nodes = graph.nodes();
    let driven = nodes.ids().filter(|node| nodes[*node].entry.is_actuator());
    driven
        .filter_map(|sink| {
            let device = graph.devices().get(nodes[sink].device()?)?;
            let card = device.device().as_any().downcast_ref::<Card>()?;
            Some(Played {
                endpoint: device.name.clone(),
                sink,
                full_scale: card.output.as_ref()?.full_scale,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::document::Document;
    use haptograph_engine::graph::{CheckOptions, check};

    fn asked(endpoints: &str, gain: f64) -> Result<Wanted, SoundcardError> {
        let text = format!(
            r#"Graph(format: 1, clocks: {{ "audio": Driver(rate_hz: 48000) }},
            nodes: {{
                "felt": Accelerometer(clock: "audio", endpoint: "tool"),
                "echo": Calibrate(input: "felt", from: "acceleration", to: "current", factor: {gain}),
                "a": ActuatorSink(current: "echo", endpoint: "tool", limit: (peak_a: 1, continuous_a: 1)),
                "b": ActuatorSink(current: "echo", endpoint: "other", limit: (peak_a: 1, continuous_a: 1)),
            }},
            endpoints: {{ "simulated": {{ {endpoints} }} }})"#
        );
        let document = Document::parse("g.ron", &text).unwrap();
        let graph = check(&document, &crate::registry(), &CheckOptions::default());
        wanted(&graph.unwrap_or_else(|wrong| panic!("{wrong}")))
    }

    const BOTH: &str = r#"
        "tool": SoundcardHaptuator(amperes_full_scale: 1, channels: [3], accelerometer: (m_s2_full_scale: 50)),
        "other": Soundcard(amperes_full_scale: 1, channels: [1])"#;

    #[test]
    fn a_run_goes_on_with_graphs_that_ask_for_the_same_streams_only() {
        let first = asked(BOTH, 0.1).unwrap();
        assert_eq!(first.output.as_ref().unwrap().channels, 3);
        assert_eq!(first.inputs.len(), 1);
        assert_eq!(asked(BOTH, 0.2).unwrap(), first);
        for (from, to) in [
            ("m_s2_full_scale: 50", "m_s2_full_scale: 40"),
            ("m_s2_full_scale: 50", "m_s2_full_scale: 50, channel: 2"),
            ("m_s2_full_scale: 50", "m_s2_full_scale: 50, latency_ms: 9"),
            ("channels: [3]", "channels: [4]"),
            // What is heard stays as it is here, but the device would be another, that nobody speaks to.
            (
                "Haptuator(amperes_full_scale: 1,",
                "Haptuator(amperes_full_scale: 2,",
            ),
            ("m_s2_full_scale: 50", "m_s2_full_scale: 50, channel: 1"),
        ] {
            assert_ne!(asked(&BOTH.replace(from, to), 0.1).unwrap(), first, "{to}");
        }
    }

    #[test]
    fn one_stream_drives_a_graph_and_no_channel_is_driven_twice() {
        let unlike = BOTH.replace("channels: [1]", "channels: [1], buffer_frames: 128");
        let shared = BOTH.replace("channels: [1]", "channels: [3, 1]");
        assert!(matches!(
            asked(&unlike, 0.1),
            Err(SoundcardError::Differ(_, _, "`buffer_frames`"))
        ));
        assert!(matches!(
            asked(&shared, 0.1),
            Err(SoundcardError::Shared(_, _, 3))
        ));
    }
}
