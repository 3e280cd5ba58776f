//! The signals of a page: a figure for each that changes and is not shown already; of the others only what is to be known.

use super::super::asked::{Asked, Form, Trace};
use super::super::figures;
use super::super::inks::Inks;
use super::super::plot::Plot;
use super::super::record::{Content, Recorded};
use super::super::svg::escape;
use super::super::theme::Ink;
use super::super::thinning::{Envelope, are_nearly_same};
use haptograph_engine::frame::Kind;
use haptograph_engine::node::Stream;

/// What becomes of a signal on the page.
enum Place<'a> {
    Drawn,
    /// It never changes: its value.
    Constant(String),
    /// Another plot shows it over time, under this name where it is another.
    Above(Option<&'a str>),
    /// Another signal of the page has the same samples.
    Same(&'a Recorded),
    /// The same but for noise and rate.
    Nearly(&'a str),
}

/// Figures of the signals that the plots which are asked for do not show.
pub(super) fn section(signals: &[Recorded], asked: &[(&Asked, &[Trace])], inks: &mut Inks) -> String {
    let above = Above::of(asked);
    let (mut constant, mut same, mut nearly, mut shown) = (vec![], vec![], vec![], vec![]);
    let mut plots: Vec<Plot> = Vec::new();
    for (number, signal) in signals.iter().enumerate() {
        let name = &signal.stream.name;
        match place(signals, number, &above) {
            Place::Constant(value) => constant.push(format!("{name} ({value})")),
            Place::Same(other) => same.push(format!("{name} as {}", other.stream.name)),
            Place::Nearly(other) => nearly.push(format!("{name} as {other}")),
            Place::Above(Some(other)) => same.push(format!("{name} as {other}")),
            Place::Above(None) => {
                shown.push(name.clone());
                plots.extend(figures_of(signal, true, &above, inks));
            }
            Place::Drawn => plots.extend(figures_of(signal, false, &above, inks)),
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

/// The plots of a signal; of one that another plot shows over time its spectra only.
fn figures_of(signal: &Recorded, is_above: bool, above: &Above<'_>, inks: &mut Inks) -> Vec<Plot> {
    let name = &signal.stream.name;
    let samples = match lanes(signal) {
        [lane] => Some(lane),
        _ => None,
    };
    // Components have colours of their own, and a place on a map is drawn elsewhere.
    let ink = match signal.stream.kind {
        Kind::Vector | Kind::Wrench | Kind::Weights | Kind::Coefficients => Ink::Blue,
        Kind::Scalar | Kind::Contact | Kind::Event => inks.of(name, samples, &[]),
    };
    let mut plots = figures::over_time(signal, ink);
    if is_above {
        plots.drain(..plots.len().min(figures::components_of(signal)));
    }
    plots.extend(figures::mean_spectrum(signal, ink));
    if !above.ways.contains(&name.as_str()) {
        plots.extend(figures::contact_path(signal));
    }
    plots
}

/// What the plots that are asked for show.
#[derive(Default)]
struct Above<'a> {
    /// Signals over time with their extremes; events have none.
    over_time: Vec<(&'a Stream, Option<Envelope>)>,
    /// Contacts and positions seen from above.
    ways: Vec<&'a str>,
}

impl<'a> Above<'a> {
    fn of(asked: &[(&'a Asked, &[Trace])]) -> Self {
        let mut above = Self::default();
        for (asked, traces) in asked {
            for (signal, trace) in asked.signals.iter().zip(*traces) {
                match asked.form {
                    Form::OverTime => above.over_time.push((&signal.stream, trace.envelope())),
                    Form::Path => above.ways.push(&signal.stream.name),
                    Form::Against => {}
                }
            }
        }
        above
    }

    /// The signal that has the same samples; of a vector only its length is drawn, so its own name counts.
    fn same(&self, signal: &Recorded) -> Option<&'a str> {
        let own = self
            .over_time
            .iter()
            .find(|(of, _)| of.name == signal.stream.name);
        own.map(|(of, _)| of.name.as_str())
            .or_else(|| self.find(signal, |lane, samples| lane == samples))
    }

    fn nearly(&self, signal: &Recorded) -> Option<&'a str> {
        use std::slice::from_ref;
        self.find(signal, |lane, samples| {
            are_nearly_same(from_ref(lane), from_ref(samples))
        })
    }

    /// The first scalar of the signal's quantity whose samples fit.
    fn find(&self, signal: &Recorded, fits: impl Fn(&Envelope, &Envelope) -> bool) -> Option<&'a str> {
        let [lane] = lanes(signal) else { return None };
        let mut alike = self
            .over_time
            .iter()
            .filter(|(of, _)| of.quantity == signal.stream.quantity && of.kind == signal.stream.kind);
        let found = alike.find(|(_, samples)| samples.as_ref().is_some_and(|samples| fits(lane, samples)));
        found.map(|(of, _)| of.name.as_str())
    }
}

fn place<'a>(signals: &'a [Recorded], number: usize, above: &Above<'a>) -> Place<'a> {
    let signal = &signals[number];
    if let Some(value) = constant_value(signal) {
        return Place::Constant(value);
    }
    if let Some(name) = above.same(signal) {
        return Place::Above((name != signal.stream.name).then_some(name));
    }
    if let Some(other) = signals[..number].iter().find(|other| is_same(other, signal)) {
        return Place::Same(other);
    }
    // Spectra are of fast signals: these are kept for them, and their slower likes are left out.
    if !has_spectra(signal)
        && let Some(name) = above.nearly(signal)
    {
        return Place::Nearly(name);
    }
    let before = |other: usize| {
        let (own_hz, other_hz) = (signal.stream.rate.hz(), signals[other].stream.rate.hz());
        other_hz > own_hz || other_hz == own_hz && other < number
    };
    let leader = (0..signals.len()).find(|other| before(*other) && is_nearly(signal, &signals[*other]));
    leader.map_or(Place::Drawn, |other| Place::Nearly(&signals[other].stream.name))
}

fn lanes(signal: &Recorded) -> &[Envelope] {
    match &signal.content {
        Content::Lanes(lanes, _) => lanes,
        _ => &[],
    }
}

fn has_spectra(signal: &Recorded) -> bool {
    matches!(&signal.content, Content::Lanes(_, Some(_)))
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

/// Is the other the same signal, but for noise and rate?
fn is_nearly(signal: &Recorded, other: &Recorded) -> bool {
    let alike = signal.stream.quantity == other.stream.quantity && signal.stream.kind == other.stream.kind;
    alike && !lanes(signal).is_empty() && are_nearly_same(lanes(signal), lanes(other))
}

pub(crate) fn is_same(a: &Recorded, b: &Recorded) -> bool {
    match (&a.content, &b.content) {
        (Content::Lanes(x, _), Content::Lanes(y, _)) => a.stream.quantity == b.stream.quantity && x == y,
        _ => false,
    }
}
