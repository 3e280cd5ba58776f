//! The signals of a page: a figure for each that changes and is not shown already; of the others only what is to be known.

use super::super::figures;
use super::super::plot::Plot;
use super::super::record::{Content, Recorded};
use super::super::svg::escape;
use super::super::theme::Ink;

/// Figures of the signals; `shown` names those that another plot shows over time.
pub(super) fn section(signals: &[Recorded], shown: &[String]) -> String {
    let (mut constant, mut same, mut above) = (Vec::new(), Vec::new(), Vec::new());
    let mut plots: Vec<Plot> = Vec::new();
    for (number, signal) in signals.iter().enumerate() {
        let name = &signal.stream.name;
        if let Some(value) = constant_value(signal) {
            constant.push(format!("{name} ({value})"));
        } else if let Some(other) = signals[..number].iter().find(|other| is_same(other, signal)) {
            same.push(format!("{name} as {}", other.stream.name));
        } else if let Some(other) = signals.iter().find(|other| is_slower(signal, other)) {
            same.push(format!(
                "{name} at {} as {} at {}",
                signal.stream.rate, other.stream.name, other.stream.rate
            ));
        } else {
            let ink = Ink::number(plots.len());
            let mut over_time = figures::over_time(signal, ink);
            if shown.contains(name) {
                // What is left of it is its spectrogram.
                over_time.drain(..over_time.len().min(figures::components_of(signal)));
                above.push(name.clone());
            }
            plots.extend(over_time);
            plots.extend(figures::mean_spectrum(signal, ink));
            plots.extend(figures::contact_path(signal));
        }
    }
    let note = |what: &str, names: &[String]| match names {
        [] => String::new(),
        names => format!("<p class=\"remark\">{what}: {}.</p>", escape(&names.join(", "))),
    };
    [
        super::figures_of(&plots),
        note("Shown above over time", &above),
        note("The same", &same),
        note("Constant", &constant),
    ]
    .concat()
}

/// The value of a signal that never changes.
fn constant_value(signal: &Recorded) -> Option<String> {
    let unit = figures::Unit::of(signal.stream.quantity);
    let lanes = match &signal.content {
        Content::Lanes(lanes, _) => lanes,
        Content::Events(_, 0) => return Some("no event".to_owned()),
        Content::Contact(depth, _) if depth.constant() == Some(0.0) => return Some("no contact".to_owned()),
        _ => return None,
    };
    let values = lanes
        .iter()
        .map(|lane| lane.constant().map(|value| unit.text(value)));
    let mut values = values.collect::<Option<Vec<String>>>()?;
    values.dedup();
    Some(values.join(", "))
}

/// Is the other the same signal at a higher rate?
fn is_slower(signal: &Recorded, other: &Recorded) -> bool {
    let alike = signal.stream.quantity == other.stream.quantity && signal.stream.kind == other.stream.kind;
    if !alike || signal.stream.rate.hz() >= other.stream.rate.hz() {
        return false;
    }
    match (&signal.content, &other.content) {
        (Content::Lanes(slow, _), Content::Lanes(fast, _)) => {
            slow.iter().zip(fast).all(|(a, b)| a.resembles(b))
        }
        _ => false,
    }
}

pub(crate) fn is_same(a: &Recorded, b: &Recorded) -> bool {
    match (&a.content, &b.content) {
        (Content::Lanes(x, _), Content::Lanes(y, _)) => a.stream.quantity == b.stream.quantity && x == y,
        _ => false,
    }
}
