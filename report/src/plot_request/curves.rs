//! The curves of a frame: names, colours and levels.

use super::trace::{Trace, TraceContent};
use super::{PlotRequest, RunTraces};
use crate::figures::{self, Unit, capitalised};
use crate::inks::Inks;
use crate::plot::{Mark, Style, Weight};
use crate::theme::Ink;
use haptograph_engine::node::Stream;
use std::collections::HashMap;

pub(super) struct Curve<'a> {
    pub name: String,
    pub ink: Ink,
    pub is_dashed: bool,
    pub run: usize,
    pub trace: &'a Trace,
}

/// The curves of these traces for every run. The colour identifies the signal or, with several runs, the run,
/// whose second and further signals are dashed. With `share`, a signal that is the same in all runs becomes
/// one grey curve.
pub(super) fn curves<'a>(
    request: &PlotRequest,
    runs: &[RunTraces<'a>],
    share: bool,
    inks: &mut Inks,
    traces: impl Fn(&RunTraces<'a>) -> Vec<&'a Trace>,
) -> Vec<Curve<'a>> {
    let by_run: Vec<Vec<&'a Trace>> = runs.iter().map(traces).collect();
    let most = by_run.iter().map(Vec::len).max().unwrap_or(0);
    let several = runs.len() > 1;
    let is_shared = |number: usize| {
        several && share && all_equal(by_run.iter().map(|traces| traces.get(number).copied()))
    };
    let shared: Vec<bool> = (0..most).map(is_shared).collect();
    let mut found: Vec<Curve<'a>> = Vec::new();
    for (run, (drawn, traces)) in runs.iter().zip(&by_run).enumerate() {
        for (number, trace) in traces.iter().enumerate() {
            let signal = request.short_name(&trace.stream);
            let (name, ink) = match (shared[number], drawn.name) {
                (true, _) if run > 0 => continue,
                (true, _) => (format!("{signal}, all runs"), Ink::Grey),
                (false, "") => {
                    let beside: Vec<Ink> = found.iter().map(|curve| curve.ink).collect();
                    let ink = inks.of(&trace.stream.name, trace.envelope(), &beside);
                    (signal.to_owned(), ink)
                }
                (false, name) if traces.len() == 1 => (name.to_owned(), Ink::of_run(run)),
                (false, name) => (format!("{name}: {signal}"), Ink::of_run(run)),
            };
            let is_dashed = several && !shared[number] && number > 0;
            found.push(Curve { name, ink, is_dashed, run, trace });
        }
    }
    found
}

/// True if all runs have the same trace.
pub(super) fn all_equal<'a>(mut traces: impl Iterator<Item = Option<&'a Trace>>) -> bool {
    let first = traces.next().flatten().map(|trace| &trace.content);
    traces.all(|trace| trace.map(|trace| &trace.content) == first)
}

/// Sentence about curves that are all constant; `None` otherwise.
pub(super) fn constant(curves: &[Curve<'_>]) -> Option<String> {
    let values: Vec<String> = curves.iter().map(|curve| curve.trace.constant()).collect::<Option<_>>()?;
    let (first, rest) = values.split_first()?;
    if rest.iter().all(|value| value == first) {
        return Some(format!("{first}."));
    }
    let named = curves.iter().zip(&values);
    let named: Vec<String> = named.map(|(curve, value)| format!("{} {value}", curve.name)).collect();
    Some(named.join(", ") + ".")
}

/// Number of runs up to which all levels are printed; of more, the smallest and the largest are.
const FEW: usize = 2;

/// Sentence about the levels of the signals in a frame.
pub(super) fn levels(curves: &[Curve<'_>], is_of_runs: bool) -> String {
    if is_of_runs && curves.len() > FEW {
        return extremes(curves).unwrap_or_default();
    }
    let level = |curve: &Curve<'_>| figures::level(&curve.trace.stream, curve.trace.envelope()?);
    let found = curves.iter().filter_map(|curve| Some((curve, level(curve)?)));
    let levels: Vec<String> = found
        .map(|(curve, level)| match curves {
            [_] => capitalised(&level),
            _ => format!("{}: {level}", curve.name),
        })
        .collect();
    match levels.as_slice() {
        [] => String::new(),
        levels => levels.join("; ") + ".",
    }
}

/// The curves with the smallest and the largest level.
fn extremes(curves: &[Curve<'_>]) -> Option<String> {
    let unit = Unit::of(curves.first()?.trace.stream.quantity);
    let mut levels = Vec::new();
    for curve in curves {
        let envelope = curve.trace.envelope()?;
        levels.push((envelope.rms(), curve.name.as_str()));
    }
    levels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ((low, least), (high, most)) = (levels.first()?, levels.last()?);
    Some(format!("RMS from {} ({least}) to {} ({most}).", unit.text(*low), unit.text(*high)))
}

/// Label of the vertical axis: the quantity, or for plain numbers their names.
pub(super) fn label(request: &PlotRequest, curves: &[Curve<'_>]) -> String {
    let Some(first) = curves.first() else {
        return String::new();
    };
    let name = match curves.iter().all(|curve| curve.trace.stream.name == first.trace.stream.name) {
        true => request.short_name(&first.trace.stream),
        false => request.title.as_str(),
    };
    let mut envelopes = curves.iter().map(|curve| curve.trace.envelope());
    match envelopes.all(|envelope| envelope.is_some_and(|envelope| envelope.is_switch())) {
        true => figures::switch_label(name),
        false => figures::axis_label(&Stream {
            name: name.to_owned(),
            // A vector is drawn by its magnitude.
            kind: haptograph_engine::frame::Kind::SCALAR,
            ..first.trace.stream.clone()
        }),
    }
}

impl Curve<'_> {
    pub(super) fn style(&self) -> Style {
        let style = Style::named(self.ink, self.name.as_str());
        match self.is_dashed {
            true => style.weight(Weight::Dashed),
            false => style,
        }
    }

    pub(super) fn over_time(&self) -> Vec<Mark> {
        let unit = Unit::of(self.trace.stream.quantity);
        let style = self.style();
        match &self.trace.content {
            TraceContent::Signal(envelope) => vec![Mark::signal(style, envelope, |si| unit.show(si))],
            TraceContent::Points(events) => {
                let heads: Vec<_> = events.kept().iter().map(|(t, v)| (*t, unit.show(*v))).collect();
                let foot = unit.show(0.0);
                let stems = heads.iter().map(|(t, v)| [(*t, foot), (*t, *v)]).collect();
                vec![Mark::Segments(Style::of(self.ink), stems), Mark::Dots(style, heads)]
            }
        }
    }
}

/// The dots of a curve: isolated ones large and opaque, dense ones small and translucent.
pub(super) fn dots(curve: &Curve<'_>, points: Vec<(f64, f64)>) -> Vec<Mark> {
    let (few, many) = by_density(points);
    let small = curve.style().weight(Weight::Hair);
    match (few.is_empty(), many.is_empty()) {
        (_, true) => vec![Mark::Dots(curve.style(), few)],
        (true, _) => vec![Mark::Dots(small, many)],
        _ => vec![Mark::Dots(small, many), Mark::Dots(Style::of(curve.ink), few)],
    }
}

/// (x, y).
type Point = (f64, f64);

/// Isolated points and dense points, each in their order.
fn by_density(points: Vec<Point>) -> (Vec<Point>, Vec<Point>) {
    /// Grid of cells across and up, each about the size of a dot, and the largest count of an isolated cell.
    const PLACES: (f64, f64) = (150.0, 50.0);
    const FEW: usize = 4;
    let span = |of: fn(&(f64, f64)) -> f64| {
        let finite = points.iter().map(of).filter(|x| x.is_finite());
        let (low, high) =
            finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        (low, (high - low).max(f64::MIN_POSITIVE))
    };
    let ((x_low, width), (y_low, height)) = (span(|p| p.0), span(|p| p.1));
    let place = |p: &(f64, f64)| {
        let part = |x: f64, low: f64, span: f64, places: f64| ((x - low) / span * places) as i64;
        (part(p.0, x_low, width, PLACES.0), part(p.1, y_low, height, PLACES.1))
    };
    let mut counts: HashMap<(i64, i64), usize> = HashMap::new();
    for point in &points {
        *counts.entry(place(point)).or_default() += 1;
    }
    points.into_iter().partition(|point| counts.get(&place(point)).is_none_or(|count| *count <= FEW))
}

/// A range around the values of all curves, with a margin.
pub(super) fn common_range(curves: &[Curve<'_>]) -> Option<(f64, f64)> {
    let mut range = (f64::INFINITY, f64::NEG_INFINITY);
    for curve in curves {
        let unit = Unit::of(curve.trace.stream.quantity);
        let of = curve.trace.envelope().and_then(|envelope| envelope.range());
        if let Some((low, high)) = of {
            range = (range.0.min(unit.show(low)), range.1.max(unit.show(high)));
        }
    }
    let room = 0.05 * (range.1 - range.0);
    (room > 0.0).then_some((range.0 - room, range.1 + room))
}
