//! The numbers that a page begins with.

use super::figures::Unit;
use super::record::{Content, Recorded};
use super::scale::plain;
use super::sound::Sound;
use super::svg::escape;
use haptograph_engine::frame::Kind;
use haptograph_signal::quantity::Quantity;

/// A number to read first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Headline {
    /// What it is.
    pub label: String,
    /// With its unit.
    pub value: String,
    /// Of what.
    pub of: String,
}

impl Headline {
    /// A number, of what.
    pub fn new(label: &str, value: impl Into<String>, of: impl Into<String>) -> Self {
        Self {
            label: label.to_owned(),
            value: value.into(),
            of: of.into(),
        }
    }
}

/// Frequencies below this are motion, not vibration.
const LOWEST_HZ: f64 = 10.0;
/// Signals below this rate are measured of a hand, not played to it.
const SLOW_HZ: f64 = 2000.0;

/// Of the vibration: its level, its peak, where it is strongest; of the hand: how hard and how fast on average.
pub(super) fn of_signals(sound: Option<&Sound>, signals: &[Recorded]) -> Vec<Headline> {
    let heard = sound.and_then(|sound| {
        signals
            .iter()
            .find(|signal| signal.stream.name == sound.stream.name)
    });
    let mut found = heard.map_or_else(Vec::new, vibration);
    for (quantity, label) in [(Quantity::FORCE, "Mean force"), (Quantity::SPEED, "Mean speed")] {
        found.extend(mean(signals, quantity, label));
    }
    found
}

fn vibration(signal: &Recorded) -> Vec<Headline> {
    let Content::Lanes(lanes, spectra) = &signal.content else {
        return Vec::new();
    };
    let (unit, name) = (Unit::of(signal.stream.quantity), signal.stream.name.as_str());
    let levels = lanes.first().map(|lane| {
        [
            Headline::new("RMS", unit.text(lane.rms()), name),
            Headline::new("Peak", unit.text(lane.peak()), name),
        ]
    });
    let strongest = spectra.as_ref().and_then(|spectra| {
        let mut spectra = spectra.as_ref().clone();
        spectra.finish();
        let (bin_hz, mean) = (spectra.bin_hz(), spectra.mean());
        let above = mean
            .iter()
            .enumerate()
            .map(|(i, density)| (i as f64 * bin_hz, *density));
        let above = above.filter(|(hz, density)| *hz >= LOWEST_HZ && *density > 0.0);
        above.max_by(|a, b| a.1.total_cmp(&b.1))
    });
    let strongest =
        strongest.map(|(hz, _)| Headline::new("Strongest frequency", format!("{} Hz", plain(hz)), name));
    levels.into_iter().flatten().chain(strongest).collect()
}

/// The mean of the first slow scalar of a quantity.
fn mean(signals: &[Recorded], quantity: Quantity, label: &str) -> Option<Headline> {
    let signal = signals.iter().find(|signal| {
        let stream = &signal.stream;
        stream.quantity == quantity && stream.kind == Kind::Scalar && stream.rate.hz() < SLOW_HZ
    })?;
    let Content::Lanes(lanes, _) = &signal.content else {
        return None;
    };
    let text = Unit::of(quantity).text(lanes.first()?.mean());
    Some(Headline::new(label, text, signal.stream.name.as_str()))
}

/// The numbers as a row of cards.
pub(super) fn cards(headlines: &[Headline]) -> String {
    let card = |headline: &Headline| {
        format!(
            "<div><span>{}</span><b>{}</b><span>{}</span></div>",
            escape(&headline.label),
            escape(&headline.value),
            escape(&headline.of)
        )
    };
    match headlines {
        [] => String::new(),
        some => format!(
            "<div class=\"heads\">{}</div>",
            some.iter().map(card).collect::<String>()
        ),
    }
}
