//! Headlines: the most important numbers of a page.

use super::figures::{self, Unit, quantity_name};
use super::record::{Content, Friction, Recorded, SPECTRAL_RATE_HZ};
use super::scale::plain;
use super::sound::Sound;
use super::svg::escape;
use super::thinning::Envelope;
use haptograph_engine::frame::Kind;
use haptograph_signal::quantity::Quantity;

/// A number with its label.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Headline {
    /// Label.
    pub label: String,
    /// Value with its unit.
    pub value: String,
    /// The reference of the value: its signal, or its conditions.
    pub of: String,
}

impl Headline {
    /// A headline from label, value and reference.
    pub fn new(label: &str, value: impl Into<String>, of: impl Into<String>) -> Self {
        Self { label: label.to_owned(), value: value.into(), of: of.into() }
    }
}

/// Headlines of the vibration (level, peak, strongest frequency, constant current), then friction, force and
/// speed.
pub(super) fn of_signals(
    sound: Option<&Sound>,
    signals: &[Recorded],
    friction: Option<&Friction>,
) -> Vec<Headline> {
    let vibrating = vibrating(sound, signals);
    let mut found = vibrating.map_or_else(Vec::new, vibration);
    found.extend(signals.iter().find_map(constant_current));
    found.extend(
        coefficient(signals, friction).map(|(mu, of)| Headline::new("Friction coefficient", plain(mu), of)),
    );
    let hand =
        signals.iter().filter(|signal| vibrating.is_none_or(|other| other.stream.name != signal.stream.name));
    let hand: Vec<&Recorded> = hand.collect();
    for (quantity, mean, largest) in
        [(Quantity::FORCE, "Mean force", Some("Largest force")), (Quantity::SPEED, "Mean speed", None)]
    {
        found.extend(sizes(&hand, quantity, mean, largest));
    }
    found
}

fn components(signal: &Recorded) -> &[Envelope] {
    match &signal.content {
        Content::Components(components, _) => components,
        _ => &[],
    }
}

/// The signal felt as a vibration: an acceleration if there is one, otherwise the sound, otherwise another
/// fast signal.
fn vibrating<'a>(sound: Option<&Sound>, signals: &'a [Recorded]) -> Option<&'a Recorded> {
    let is_heard = |signal: &Recorded| sound.is_some_and(|sound| sound.stream.name == signal.stream.name);
    let changes = |component: &Envelope| component.range().is_some_and(|(low, high)| low < high);
    let vibrates = |signal: &&Recorded| {
        [Kind::SCALAR, Kind::VECTOR].contains(&signal.stream.kind)
            && signal.stream.rate.hz() >= SPECTRAL_RATE_HZ
            && components(signal).iter().any(changes)
    };
    let fast: Vec<&Recorded> = signals.iter().filter(vibrates).collect();
    let heard = fast.iter().copied().find(|signal| is_heard(signal));
    let first = |quantity: Quantity| fast.iter().copied().find(|signal| signal.stream.quantity == quantity);
    heard
        .filter(|signal| signal.stream.quantity == Quantity::ACCELERATION)
        .or_else(|| first(Quantity::ACCELERATION))
        .or(heard)
        .or_else(|| [Quantity::CURRENT, Quantity::FORCE, Quantity::VOLTAGE].into_iter().find_map(first))
}

fn vibration(signal: &Recorded) -> Vec<Headline> {
    let (unit, name) = (Unit::of(signal.stream.quantity), signal.stream.name.as_str());
    let what = match (signal.stream.quantity, name.strip_suffix(".delivered")) {
        (Quantity::ACCELERATION, _) => "Vibration".to_owned(),
        (Quantity::CURRENT, Some(actuator)) => format!("Current to {actuator}"),
        (quantity, _) => quantity_name(quantity),
    };
    // A three-axis sensor also measures gravity, which varies slowly when the hand turns.
    let first = match (signal.stream.quantity, signal.stream.kind) {
        (Quantity::ACCELERATION, kind) if kind == Kind::VECTOR => {
            let about_mean =
                |component: &Envelope| (component.rms().powi(2) - component.mean().powi(2)).max(0.0);
            let level = components(signal).iter().map(about_mean).sum::<f64>().sqrt();
            let of = format!("{name}, including gravity as the sensor turns");
            Headline::new("Acceleration about its mean, RMS", unit.text(level), of)
        }
        _ => Headline::new(&format!("{what}, RMS"), unit.text(rms(components(signal))), name),
    };
    let mut found = vec![first];
    if let [component] = components(signal) {
        found.push(Headline::new(&format!("{what}, peak"), unit.text(component.peak()), name));
    }
    if let Content::Components(_, Some(spectra)) = &signal.content {
        let mut spectra = spectra.as_ref().clone();
        spectra.finish();
        let strongest = spectra.strongest_hz();
        found.extend(strongest.map(|hz| Headline::new("Strongest frequency", format!("{hz:.0} Hz"), name)));
    }
    found
}

/// RMS over all components.
fn rms(components: &[Envelope]) -> f64 {
    components.iter().map(|component| component.rms().powi(2)).sum::<f64>().sqrt()
}

fn constant_current(signal: &Recorded) -> Option<Headline> {
    let mean = figures::constant_current(&signal.stream, components(signal).first()?)?;
    Some(Headline::new(
        "Constant current",
        Unit::of(Quantity::CURRENT).text(mean),
        format!("of {}: it heats the coil and is not felt", signal.stream.name),
    ))
}

/// The friction coefficient of a run, and its source.
pub(super) fn coefficient(signals: &[Recorded], friction: Option<&Friction>) -> Option<(f64, String)> {
    let find = |name: &str| signals.iter().find(|signal| signal.stream.name == name);
    let (mu, of) = match friction? {
        Friction::Measured(name) => {
            let component = components(find(name)?).first()?;
            (component.mean_size(), format!("mean of {name}{}", meanwhile(component)))
        }
        Friction::Forces { tangential, normal } => {
            let (across, along) = (rms(components(find(tangential)?)), rms(components(find(normal)?)));
            (across / along, format!("{tangential} by {normal}, RMS by RMS"))
        }
    };
    (mu.is_finite() && mu > 0.0).then_some((mu, of))
}

/// Note about the share of time over which a mean is taken.
fn meanwhile(component: &Envelope) -> String {
    match 100.0 * component.presence() {
        percent if percent > 99.95 => String::new(),
        percent => format!(" when non-zero ({} % of the time)", plain(percent)),
    }
}

/// Headlines of a quantity: of its first slow scalar, or else of another scalar, the mean magnitude while it
/// is not zero and the maximum; otherwise of a vector or wrench the RMS.
fn sizes(signals: &[&Recorded], quantity: Quantity, mean: &str, largest: Option<&str>) -> Vec<Headline> {
    let unit = Unit::of(quantity);
    let of_kind = |kind: Kind| {
        let fitting = signals.iter().copied().filter(move |signal| {
            let of = match kind == Kind::WRENCH {
                true => Quantity::FORCE,
                false => signal.stream.quantity,
            };
            signal.stream.kind == kind && of == quantity
        });
        fitting.filter(|signal| components(signal).iter().any(|component| component.presence() > 0.0))
    };
    let slow = of_kind(Kind::SCALAR).find(|signal| signal.stream.rate.hz() < SPECTRAL_RATE_HZ);
    if let Some(signal) = slow.or_else(|| of_kind(Kind::SCALAR).next())
        && let [component] = components(signal)
    {
        let name = &signal.stream.name;
        let of = match component.range() {
            Some((low, _)) if low < 0.0 => format!("size of {name}{}", meanwhile(component)),
            _ => format!("{name}{}", meanwhile(component)),
        };
        let mean = Headline::new(mean, unit.text(component.mean_size()), of);
        let largest = largest.map(|label| Headline::new(label, unit.text(component.peak()), name.as_str()));
        return std::iter::once(mean).chain(largest).collect();
    }
    let vector = of_kind(Kind::VECTOR).next().or_else(|| of_kind(Kind::WRENCH).next());
    let of_vector = |signal: &Recorded| {
        let label = format!("{}, RMS", quantity_name(quantity));
        let size = rms(components(signal).get(..3).unwrap_or_default());
        Headline::new(&label, unit.text(size), signal.stream.name.as_str())
    };
    vector.map(of_vector).into_iter().collect()
}

/// The headlines as a row of cards.
pub(super) fn cards(headlines: &[Headline]) -> String {
    let card = |headline: &Headline| {
        format!(
            "<div><span>{}</span><b>{}</b><span>{}</span></div>",
            escape(&headline.label),
            escape(&headline.value),
            breakable(&escape(&headline.of))
        )
    };
    match headlines {
        [] => String::new(),
        some => format!(
            "<div class=\"heads\" style=\"--few:{};--many:{}\">{}</div>",
            columns(some.len(), 4),
            columns(some.len(), 6),
            some.iter().map(card).collect::<String>()
        ),
    }
}

/// Number of columns, at most `most`, whose last row has the fewest gaps and more than one card.
fn columns(cards: usize, most: usize) -> usize {
    let gaps = |columns: &usize| (columns - cards % columns) % columns;
    let is_alone = |columns: &usize| cards > *columns && cards % columns == 1;
    let fitting = (most / 2 + 1..=most).rev().map(|columns| columns.min(cards).max(1));
    fitting.min_by_key(|columns| (is_alone(columns), gaps(columns))).unwrap_or(1)
}

/// Allows line breaks after slashes and dots in the names of signals: `texture/filter.acceleration`.
fn breakable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        shown.push(letter);
        if matches!(letter, '/' | '.') && letters.peek().is_some_and(|next| next.is_alphabetic()) {
            shown.push_str("<wbr/>");
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Reduction;
    use haptograph_engine::node::Stream;
    use haptograph_signal::time::Rate;

    fn signal(name: &str, kind: Kind, quantity: Quantity, hz: u64, value: impl Fn(f64) -> f64) -> Recorded {
        let mut recorded = Recorded::of(Stream {
            name: name.into(),
            kind,
            quantity,
            rate: Rate::from_hz(hz).unwrap(),
            simulated: true,
        });
        let width = kind.width();
        let frames = (0..2 * hz).flat_map(|i| vec![value(i as f64 / hz as f64); width]);
        recorded.extend(&frames.collect::<Vec<_>>());
        recorded
    }

    fn value(found: &[Headline], label: &str) -> (String, String) {
        let found = found.iter().find(|headline| headline.label == label);
        found.map(|headline| (headline.value.clone(), headline.of.clone())).unwrap()
    }

    fn hum(t: f64) -> f64 {
        (std::f64::consts::TAU * 120.0 * t).sin()
    }

    #[test]
    fn an_acceleration_is_the_vibration_and_else_the_current_with_its_mean() {
        let current =
            || signal("out.delivered", Kind::SCALAR, Quantity::CURRENT, 48_000, |t| 0.5 + 0.1 * hum(t));
        let felt = signal("felt", Kind::SCALAR, Quantity::ACCELERATION, 10_000, hum);
        let found = of_signals(None, &[current(), felt], None);
        assert_eq!(value(&found, "Vibration, RMS").0, "0.707 m/s\u{b2}");
        assert_eq!(value(&found, "Strongest frequency").0, "120 Hz");
        let found = of_signals(None, &[current()], None);
        assert_eq!(value(&found, "Current to out, peak").0, "0.6 A");
        assert_eq!(value(&found, "Constant current").0, "0.5 A");
        let text = figures::over_time(&current(), crate::theme::Ink::Blue).remove(0).caption;
        assert!(text.contains("heats the coil"), "{text}");
    }

    #[test]
    fn no_card_is_left_alone_in_the_last_row() {
        for cards in 1..=12 {
            for most in [4, 6] {
                let columns = columns(cards, most);
                assert!((1..=most).contains(&columns));
                assert!(cards <= columns || cards % columns != 1, "{cards} in {columns}");
            }
        }
        assert_eq!(breakable("a/b.c of 0.5."), "a/<wbr/>b.<wbr/>c of 0.5.");
    }

    #[test]
    fn gravity_is_no_vibration() {
        let tool =
            signal("tool.acceleration", Kind::VECTOR, Quantity::ACCELERATION, 10_000, |t| 5.0 + hum(t));
        let found = of_signals(None, &[tool], None);
        // Three axes with 0.707 m/s² each.
        assert_eq!(value(&found, "Acceleration about its mean, RMS").0, "1.22 m/s\u{b2}");
    }

    #[test]
    fn a_force_is_taken_while_there_is_one_and_friction_by_what_measures_it() {
        let half = |t: f64| if t < 1.0 { 0.0 } else { 2.0 };
        let load = signal("tip.load", Kind::SCALAR, Quantity::FORCE, 1000, half);
        let drag = signal("drag", Kind::VECTOR, Quantity::FORCE, 1000, |t| 0.4 * half(t) / 3f64.sqrt());
        let mu = signal("brake.mu", Kind::SCALAR, Quantity::NUMBER, 1000, |t| 0.15 * half(t));
        let signals = [load, drag, mu];
        let forces = Friction::Forces { tangential: "drag".into(), normal: "tip.load".into() };
        let found = of_signals(None, &signals, Some(&forces));
        let (mean, of) = value(&found, "Mean force");
        assert!(mean == "2 N" && of.contains("50 %"), "{mean} {of}");
        assert_eq!(value(&found, "Friction coefficient").0, "0.4");
        let measured = Friction::Measured("brake.mu".into());
        assert_eq!(value(&of_signals(None, &signals, Some(&measured)), "Friction coefficient").0, "0.3");
        assert_eq!(coefficient(&signals, Some(&Friction::Measured("gone".into()))), None);
        let only_vector = of_signals(None, &signals[1..2], None);
        assert_eq!(value(&only_vector, "Force, RMS").0, "0.566 N");
    }
}
