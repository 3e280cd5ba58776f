//! What a graph asks of a soundcard, and what it plays there.

use super::SoundcardError;
use super::card::{Card, CardFormat};
use haptograph_engine::graph::{Graph, NodeIndex};

/// The stream that a graph's soundcard endpoints ask for together.
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

/// What an endpoint plays: the output that drives it, and what a sample of 1 stands for.
#[derive(Debug, Clone, PartialEq)]
pub struct Played {
    /// Name of the endpoint.
    pub endpoint: String,
    /// The sink that drives it.
    pub sink: NodeIndex,
    /// In the unit of the sink.
    pub full_scale: f64,
}

/// What the endpoints of a graph ask of a soundcard; none if none of them is one.
///
/// # Errors
/// [`SoundcardError`] where they do not go together.
pub fn request(graph: &Graph) -> Result<Option<Request>, SoundcardError> {
    let mut found: Vec<(&str, &Card)> = Vec::new();
    for device in graph.devices() {
        let Some(card) = device.device().as_any().downcast_ref::<Card>() else {
            continue;
        };
        if graph.clocks()[device.clock].driver != device.clock {
            return Err(SoundcardError::Derived(device.name.clone()));
        }
        if let Some((first, other)) = found.first()
            && let Some(what) = differ(card, other)
        {
            return Err(SoundcardError::Differ(
                (*first).to_owned(),
                device.name.clone(),
                what,
            ));
        }
        for channel in &card.channels {
            if let Some((name, _)) = found.iter().find(|(_, other)| other.channels.contains(channel)) {
                return Err(SoundcardError::Shared(
                    (*name).to_owned(),
                    device.name.clone(),
                    *channel,
                ));
            }
        }
        found.push((&device.name, card));
    }
    let channels = found.iter().flat_map(|(_, card)| &card.channels).max();
    Ok(found.first().map(|(_, card)| Request {
        device: card.device.clone(),
        rate_hz: card.rate_hz,
        buffer_frames: card.buffer_frames,
        format: card.format.clone(),
        channels: channels.map_or(1, |channel| *channel as u16),
    }))
}

fn differ(a: &Card, b: &Card) -> Option<&'static str> {
    match () {
        () if a.device != b.device => Some("`device`"),
        () if a.rate_hz != b.rate_hz => Some("their rates"),
        () if a.buffer_frames != b.buffer_frames => Some("`buffer_frames`"),
        () if a.format != b.format => Some("`format`"),
        () => None,
    }
}

/// What the soundcard endpoints of a graph play.
pub fn played(graph: &Graph) -> Vec<Played> {
    let nodes = graph.nodes();
    let driven = nodes
        .node_indices()
        .filter(|node| nodes[*node].entry.is_actuator());
    driven
        .filter_map(|sink| {
            let device = graph.devices().get(nodes[sink].device()?)?;
            let card = device.device().as_any().downcast_ref::<Card>()?;
            Some(Played {
                endpoint: device.name.clone(),
                sink,
                full_scale: card.full_scale,
            })
        })
        .collect()
}
