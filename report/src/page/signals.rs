//! The signals of a page: a figure for each that changes and is not yet shown; the others are only named.

use super::super::figures;
use super::super::inks::Inks;
use super::super::plot::Plot;
use super::super::plot_request::{Form, PlotRequest, Trace};
use super::super::record::{Content, Recorded};
use super::super::svg::escape;
use super::super::theme::Ink;
use super::super::thinning::{Envelope, are_nearly_same};
use haptograph_engine::node::Stream;

/// Presentation of a signal.
enum Treatment<'a> {
    /// Shown in a figure of its own.
    Figure,
    /// Constant, with its value.
    Constant(String),
    /// Shown over time by another plot, under another name if given.
    Plotted(Option<&'a str>),
    /// Equal to another signal of the page.
    Same(&'a Recorded),
    /// Equal except for noise and rate.
    Nearly(&'a str),
}

/// Figures of the signals that the requested plots do not show.
pub(super) fn section(
    signals: &[Recorded],
    requests: &[(&PlotRequest, Vec<Trace>)],
    inks: &mut Inks,
) -> String {
    let above = PlottedSignals::of(requests);
    let (mut constant, mut same, mut nearly, mut shown) = (vec![], vec![], vec![], vec![]);
    let mut plots: Vec<Plot> = Vec::new();
    for (number, signal) in signals.iter().enumerate() {
        let name = &signal.stream.name;
        match place(signals, number, &above) {
            Treatment::Constant(value) => constant.push(format!("{name} ({value})")),
            Treatment::Same(other) => same.push(format!("{name} as {}", other.stream.name)),
            Treatment::Nearly(other) => nearly.push(format!("{name} as {other}")),
            Treatment::Plotted(Some(other)) => same.push(format!("{name} as {other}")),
            Treatment::Plotted(None) => {
                shown.push(name.clone());
                plots.extend(figures_of(signal, true, &above, inks));
            }
            Treatment::Figure => plots.extend(figures_of(signal, false, &above, inks)),
        }
    }
    figures::explain_once(&mut plots);
    let note = |what: &str, names: &[String]| match names {
        [] => String::new(),
        names => format!("<p class=\"remark\">{what}: {}.</p>", escape(&names.join(", "))),
    };
    [
        super::figures_of(&plots),
        note("Shown above over time", &shown),
        note("The same", &same),
        note("Nearly the same, but for noise and rate", &nearly),
        note("Constant", &constant),
    ]
    .concat()
}

/// The plots of a signal; only its spectra if another plot already shows it over time.
fn figures_of(signal: &Recorded, is_above: bool, above: &PlottedSignals<'_>, inks: &mut Inks) -> Vec<Plot> {
    let name = &signal.stream.name;
    let samples = match components(signal) {
        [component] => Some(component),
        _ => None,
    };
    // Components have their own colours, and map positions are drawn elsewhere.
    let ink = match &signal.content {
        Content::Components(several, _) if several.len() > 1 => Ink::Blue,
        Content::Map(_) | Content::Nothing => Ink::Blue,
        _ => inks.of(name, samples, &[]),
    };
    let mut plots = figures::over_time(signal, ink);
    if is_above {
        plots.drain(..plots.len().min(figures::components_of(signal)));
    }
    plots.extend(figures::mean_spectrum(signal, ink));
    if !above.paths.contains(&name.as_str()) {
        plots.extend(figures::contact_path(signal));
    }
    plots
}

/// The signals shown by the requested plots.
#[derive(Default)]
struct PlottedSignals<'a> {
    /// Signals over time with their extremes; events have none.
    over_time: Vec<(&'a Stream, Option<&'a Envelope>)>,
    /// Names of contacts and positions seen from above.
    paths: Vec<&'a str>,
}

impl<'a> PlottedSignals<'a> {
    fn of(requests: &'a [(&PlotRequest, Vec<Trace>)]) -> Self {
        let mut above = Self::default();
        for (request, traces) in requests {
            for (signal, trace) in request.signals.iter().zip(traces) {
                match request.form {
                    Form::OverTime => above.over_time.push((&signal.stream, trace.envelope())),
                    Form::Path => above.paths.push(&signal.stream.name),
                    Form::Against => {}
                }
            }
        }
        above
    }

    /// The signal with the same samples; a vector is drawn by its magnitude only, so it must have the same
    /// name.
    fn same(&self, signal: &Recorded) -> Option<&'a str> {
        let own = self.over_time.iter().find(|(of, _)| of.name == signal.stream.name);
        own.map(|(of, _)| of.name.as_str())
            .or_else(|| self.find(signal, |component, samples| component == samples))
    }

    fn nearly(&self, signal: &Recorded) -> Option<&'a str> {
        use std::slice::from_ref;
        self.find(signal, |component, samples| are_nearly_same(from_ref(component), from_ref(samples)))
    }

    /// The first scalar of the signal's quantity whose samples satisfy `fits`.
    fn find(&self, signal: &Recorded, fits: impl Fn(&Envelope, &Envelope) -> bool) -> Option<&'a str> {
        let [component] = components(signal) else {
            return None;
        };
        let mut alike = self
            .over_time
            .iter()
            .filter(|(of, _)| of.quantity == signal.stream.quantity && of.kind == signal.stream.kind);
        let found = alike.find(|(_, samples)| samples.is_some_and(|samples| fits(component, samples)));
        found.map(|(of, _)| of.name.as_str())
    }
}

fn place<'a>(signals: &'a [Recorded], number: usize, above: &PlottedSignals<'a>) -> Treatment<'a> {
    let signal = &signals[number];
    if let Some(value) = constant_value(signal) {
        return Treatment::Constant(value);
    }
    if let Some(name) = above.same(signal) {
        return Treatment::Plotted((name != signal.stream.name).then_some(name));
    }
    if let Some(other) = signals[..number].iter().find(|other| is_same(other, signal)) {
        return Treatment::Same(other);
    }
    // Fast signals are kept for their spectra; slower duplicates are omitted.
    if !has_spectra(signal)
        && let Some(name) = above.nearly(signal)
    {
        return Treatment::Nearly(name);
    }
    let before = |other: usize| {
        let (own_hz, other_hz) = (signal.stream.rate.hz(), signals[other].stream.rate.hz());
        other_hz > own_hz || other_hz == own_hz && other < number
    };
    let leader = (0..signals.len()).find(|other| before(*other) && is_nearly(signal, &signals[*other]));
    leader.map_or(Treatment::Figure, |other| Treatment::Nearly(&signals[other].stream.name))
}

fn components(signal: &Recorded) -> &[Envelope] {
    match &signal.content {
        Content::Components(components, _) => components,
        _ => &[],
    }
}

fn has_spectra(signal: &Recorded) -> bool {
    matches!(&signal.content, Content::Components(_, Some(_)))
}

/// The value of a constant signal.
fn constant_value(signal: &Recorded) -> Option<String> {
    let unit = figures::Unit::of(signal.stream.quantity);
    let components = match &signal.content {
        Content::Components(components, _) => components,
        Content::Events(_, 0) => return Some("no event".to_owned()),
        Content::Contact(depth, _) if depth.constant() == Some(0.0) => return Some("no contact".to_owned()),
        _ => return None,
    };
    let values = components.iter().map(|component| component.constant().map(|value| unit.text(value)));
    let mut values = values.collect::<Option<Vec<String>>>()?;
    values.dedup();
    Some(values.join(", "))
}

/// True if the other signal differs only in noise and rate.
fn is_nearly(signal: &Recorded, other: &Recorded) -> bool {
    let alike = signal.stream.quantity == other.stream.quantity && signal.stream.kind == other.stream.kind;
    alike && !components(signal).is_empty() && are_nearly_same(components(signal), components(other))
}

pub(crate) fn is_same(a: &Recorded, b: &Recorded) -> bool {
    match (&a.content, &b.content) {
        (Content::Components(x, _), Content::Components(y, _)) => {
            a.stream.quantity == b.stream.quantity && x == y
        }
        _ => false,
    }
}
