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
    let Content::Lanes(lanes, _) = &signal.content else {
        return None;
    };
    let unit = figures::Unit::of(signal.stream.quantity);
    let values = lanes.iter().map(|lane| {
        let (low, high) = lane.range()?;
        (high - low <= 1e-12 * high.abs().max(low.abs())).then(|| unit.text(low))
    });
    let mut values = values.collect::<Option<Vec<String>>>()?;
    values.dedup();
    Some(values.join(", "))
}

fn is_same(a: &Recorded, b: &Recorded) -> bool {
    match (&a.content, &b.content) {
        (Content::Lanes(x, _), Content::Lanes(y, _)) => a.stream.quantity == b.stream.quantity && x == y,
        _ => false,
    }
}
