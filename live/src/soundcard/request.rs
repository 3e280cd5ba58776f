//! The soundcard streams that a graph requests.

use super::{BACKEND, SoundcardError};
use haptograph_engine::graph::{Graph, GraphDevice, NodeId};
use haptograph_nodes::soundcard::{Card, CardOutput, Request};

/// All streams that a graph requests. A run can take over any graph with the same requests.
#[derive(Debug, Clone, PartialEq)]
pub struct CardRequests {
    /// The stream that drives the graph; none if no endpoint plays.
    pub output: Option<Request>,
    /// The inputs.
    pub inputs: Vec<InputRequest>,
}

/// A request for the input of an endpoint.
#[derive(Debug, Clone, PartialEq)]
pub struct InputRequest {
    endpoint: String,
    /// Fingerprint of its settings. It decides whether a swap keeps the device, and with the device the reader
    /// of its ring.
    fingerprint: u64,
}

/// The output of an endpoint: the sink that drives it, and its full scale.
#[derive(Debug, Clone, PartialEq)]
pub struct CardOutputSink {
    /// Name of the endpoint.
    pub endpoint: String,
    /// The sink that drives the endpoint.
    pub sink: NodeId,
    /// Value of a full-scale sample, in the unit of the sink.
    pub full_scale: f64,
}

/// The streams that the endpoints of a graph request.
///
/// # Errors
/// [`SoundcardError`] if its outputs contradict each other.
pub fn card_requests(graph: &Graph) -> Result<CardRequests, SoundcardError> {
    let inputs = cards(graph).filter(|(_, card)| card.input.is_some());
    let request = |(device, _): (&GraphDevice, &Card)| InputRequest {
        endpoint: device.name.clone(),
        fingerprint: device.fingerprint,
    };
    Ok(CardRequests { output: output(graph)?, inputs: inputs.map(request).collect() })
}

fn output(graph: &Graph) -> Result<Option<Request>, SoundcardError> {
    let mut found: Vec<(&str, &CardOutput)> = Vec::new();
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
        for channel in output.playback.channels() {
            if let Some((other, _)) =
                found.iter().find(|(_, other)| other.playback.channels().contains(channel))
            {
                return Err(SoundcardError::Shared((*other).to_owned(), name(), *channel));
            }
        }
        found.push((&device.name, output));
    }
    let streams = found.iter().map(|(_, output)| &output.stream);
    Ok(streams.max_by_key(|stream| stream.channels).cloned())
}

fn cards(graph: &Graph) -> impl Iterator<Item = (&GraphDevice, &Card)> {
    let own = graph.devices().iter().filter(|device| BACKEND.reaches(device));
    own.filter_map(|device| Some((device, device.body::<Card>()?)))
}

/// The outputs of a graph's soundcard endpoints.
pub fn output_sinks(graph: &Graph) -> Vec<CardOutputSink> {
    let nodes = graph.nodes();
    let driven = nodes.ids().filter(|node| nodes[*node].entry.is_actuator());
    driven
        .filter_map(|sink| {
            let device = graph.devices().get(nodes[sink].device()?)?;
            let card = device.body::<Card>()?;
            Some(CardOutputSink {
                endpoint: device.name.clone(),
                sink,
                full_scale: card.output.as_ref()?.playback.full_scale,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::document::Document;
    use haptograph_engine::graph::{CheckOptions, check};

    fn requests_of(endpoints: &str, gain: f64) -> Result<CardRequests, SoundcardError> {
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
        let graph = check(&document, &haptograph_nodes::registry(), &CheckOptions::default());
        card_requests(&graph.unwrap_or_else(|wrong| panic!("{wrong}")))
    }

    const BOTH: &str = r#"
        "tool": SoundcardHaptuator(amperes_full_scale: 1, channels: [3], accelerometer: (m_s2_full_scale: 50)),
        "other": Soundcard(amperes_full_scale: 1, channels: [1])"#;

    #[test]
    fn a_run_takes_over_only_graphs_with_the_same_streams() {
        let first = requests_of(BOTH, 0.1).unwrap();
        assert_eq!(first.output.as_ref().unwrap().channels, 3);
        assert_eq!(first.inputs.len(), 1);
        assert_eq!(requests_of(BOTH, 0.2).unwrap(), first);
        for (from, to) in [
            ("m_s2_full_scale: 50", "m_s2_full_scale: 40"),
            ("m_s2_full_scale: 50", "m_s2_full_scale: 50, channel: 2"),
            ("m_s2_full_scale: 50", "m_s2_full_scale: 50, latency_ms: 9"),
            ("channels: [3]", "channels: [4]"),
            // The input is the same, but the swap would replace the device and leave its ring without a writer.
            ("Haptuator(amperes_full_scale: 1,", "Haptuator(amperes_full_scale: 2,"),
            ("m_s2_full_scale: 50", "m_s2_full_scale: 50, channel: 1"),
        ] {
            assert_ne!(requests_of(&BOTH.replace(from, to), 0.1).unwrap(), first, "{to}");
        }
    }

    #[test]
    fn one_stream_drives_a_graph_and_no_channel_is_driven_twice() {
        let unlike = BOTH.replace("channels: [1]", "channels: [1], buffer_frames: 128");
        let shared = BOTH.replace("channels: [1]", "channels: [3, 1]");
        assert!(matches!(requests_of(&unlike, 0.1), Err(SoundcardError::Differ(_, _, "`buffer_frames`"))));
        assert!(matches!(requests_of(&shared, 0.1), Err(SoundcardError::Shared(_, _, 3))));
    }
}
