//! Plots that a graph asks for by its nodes `TimePlot`, `XyPlot` and `PathPlot`, of one run or of several laid over
//! each other.

use super::figures::{self, Unit, axis_label};
use super::plot::{Axis, Mark, Plot, Style, Weight};
use super::record::{Watch, watch};
use super::theme::Ink;
use super::thinning::{Decimated, Envelope};
use haptograph_engine::frame::{Contact, Event, Kind};
use haptograph_engine::graph::Graph;
use haptograph_engine::node::{FrameWriter, Stream};
use haptograph_nodes::sinks::plots::GROUP;
use haptograph_signal::quantity::Quantity;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// A plot that a graph asks for.
#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// The name of its node.
    pub title: String,
    /// What it shows.
    pub form: Form,
    /// Its signals, in the order of the inputs.
    pub signals: Vec<Watch>,
}

/// What a plot shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Signals over time.
    OverTime,
    /// Signals against the first.
    Against,
    /// Ways from above.
    Path,
}

/// The plots that a graph asks for, in its order.
pub fn asked(graph: &Graph) -> Vec<Asked> {
    let nodes = graph.nodes();
    let plots = nodes
        .ids()
        .filter(|index| nodes[*index].entry.spec.group == GROUP);
    plots
        .map(|index| Asked {
            title: sentence_case(&nodes[index].path),
            form: match nodes[index].entry.spec.name {
                "XyPlot" => Form::Against,
                "PathPlot" => Form::Path,
                _ => Form::OverTime,
            },
            signals: nodes
                .incoming(index)
                .into_iter()
                .filter_map(|read| {
                    let mut watch = watch(graph, read.from, read.edge.output)?;
                    let source = &nodes[read.from];
                    if source.outputs.len() == 1 {
                        watch.stream.name.clone_from(&source.path);
                    }
                    Some(watch)
                })
                .collect(),
        })
        .collect()
}

fn sentence_case(name: &str) -> String {
    let mut letters = name.chars();
    letters
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// What a plot keeps of one signal.
#[derive(Debug, Clone, PartialEq)]
enum Kept {
    /// Extremes over time.
    Signal(Envelope),
    /// (time in s, value), or (x, y) of a way.
    Points(Decimated<(f64, f64)>),
}

/// One signal of a plot on its way there.
#[derive(Debug)]
pub struct Tracer {
    kind: Kind,
    form: Form,
    period_s: f64,
    frames: u64,
    shared: Arc<Mutex<Kept>>,
}

/// Where a [`Tracer`] leaves what it kept.
#[derive(Debug)]
pub struct Trace {
    stream: Stream,
    shared: Arc<Mutex<Kept>>,
}

/// Points of a signal that are kept at most.
const MOST_POINTS: usize = 4000;

/// Keeps of a signal what a plot of this form shows.
pub fn tracer(stream: &Stream, form: Form) -> (Tracer, Trace) {
    let kept = if form == Form::OverTime && stream.kind != Kind::Event {
        Kept::Signal(Envelope::new(stream.rate.hz()))
    } else {
        Kept::Points(Decimated::new(MOST_POINTS))
    };
    let shared = Arc::new(Mutex::new(kept));
    let tracer = Tracer {
        kind: stream.kind,
        form,
        period_s: stream.rate.period_s(),
        frames: 0,
        shared: Arc::clone(&shared),
    };
    let stream = stream.clone();
    (tracer, Trace { stream, shared })
}

impl FrameWriter for Tracer {
    fn write(&mut self, _: usize, frames: &[f64]) -> std::io::Result<()> {
        let mut kept = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        for frame in frames.chunks_exact(self.kind.width()) {
            let time_s = self.frames as f64 * self.period_s;
            self.frames += 1;
            match &mut *kept {
                Kept::Signal(envelope) => envelope.extend([size(frame)]),
                Kept::Points(points) => {
                    if let Some(point) = point(self.form, self.kind, time_s, frame) {
                        points.push(point);
                    }
                }
            }
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> std::io::Result<()> {
        Ok(())
    }
}

/// A scalar, or the length of a vector.
fn size(frame: &[f64]) -> f64 {
    match frame {
        [scalar] => *scalar,
        lanes => lanes.iter().map(|x| x * x).sum::<f64>().sqrt(),
    }
}

/// What a frame adds to a cloud of points. A way is interrupted where nothing touches.
fn point(form: Form, kind: Kind, time_s: f64, frame: &[f64]) -> Option<(f64, f64)> {
    match (kind, form) {
        (Kind::Event, _) => {
            let event = frame.as_chunks().0.first().map(Event::from_lanes)?;
            event.fired.then_some((time_s, event.value))
        }
        (Kind::Contact, _) => {
            let contact = frame.as_chunks().0.first().map(Contact::from_lanes)?;
            let [x, y, _] = if contact.touching {
                contact.ihip_m
            } else {
                [f64::NAN; 3]
            };
            Some((x, y))
        }
        (_, Form::Path) => Some((frame[0], *frame.get(1)?)),
        _ => Some((time_s, size(frame))),
    }
}

/// What one run left for a plot, under the run's name.
#[derive(Debug)]
pub struct Drawn<'a> {
    /// Empty where there is one run only.
    pub name: &'a str,
    /// A trace for each signal.
    pub traces: &'a [Trace],
}

impl Drawn<'_> {
    fn equals(&self, other: &Self) -> bool {
        let mut pairs = self.traces.iter().zip(other.traces);
        self.traces.len() == other.traces.len() && pairs.all(|(a, b)| a.kept() == b.kept())
    }
}

impl Asked {
    /// The plot of one run, or of several in one frame. Fast signals of several runs, which would cover each other,
    /// come one under another.
    pub fn plots(&self, runs: &[Drawn<'_>]) -> Vec<Plot> {
        if let [first, rest @ ..] = runs
            && !rest.is_empty()
            && rest.iter().all(|run| run.equals(first))
        {
            let mut plots = self.plots(&[Drawn {
                name: "",
                traces: first.traces,
            }]);
            for plot in &mut plots {
                let separator = if plot.note.is_empty() { "" } else { ", " };
                plot.note += &format!("{separator}the same in all runs");
            }
            return plots;
        }
        match self.form {
            Form::OverTime => self.over_time(runs),
            Form::Against => self.against(runs),
            Form::Path => self.path(runs),
        }
    }

    fn over_time(&self, runs: &[Drawn<'_>]) -> Vec<Plot> {
        let (mut plots, mut rest): (Vec<Plot>, Vec<usize>) = (Vec::new(), (0..self.signals.len()).collect());
        while let Some(first) = rest.first().copied() {
            // One run: signals of a quantity share a frame. Several: runs do.
            let quantity = self.signals[first].stream.quantity;
            let alike = |i: &usize| match runs {
                [_] => self.signals[*i].stream.quantity == quantity,
                _ => *i == first,
            };
            let group: Vec<usize> = rest.iter().copied().filter(alike).collect();
            rest.retain(|i| !group.contains(i));
            let fast = self.signals[first].stream.rate.hz() >= FAST_HZ;
            let mut curves: Vec<Curve<'_>> = curves(runs, true, |run| {
                group.iter().filter_map(|i| run.traces.get(*i)).collect()
            });
            if let Some(text) = constant(&curves) {
                plots.push(Plot {
                    caption: text,
                    ..self.frame_of(&plots, &curves, runs.len() > 1, quantity)
                });
                continue;
            }
            let mut zeros = String::new();
            if runs.len() == 1 {
                curves.retain(|curve| {
                    let is_zero = curve.trace.is_zero();
                    if is_zero {
                        zeros += &format!(" {}: {}.", curve.name, curve.trace.constant().unwrap_or_default());
                    }
                    !is_zero
                });
            }
            let frames: Vec<&[Curve<'_>]> = match fast && curves.len() > 1 {
                true => curves.chunks(1).collect(),
                false => vec![&curves[..]],
            };
            let range = if frames.len() > 1 {
                common_range(&curves)
            } else {
                None
            };
            for frame in frames {
                let mut plot = self.frame_of(&plots, frame, range.is_some() || runs.len() > 1, quantity);
                plot.x = Axis::time();
                plot.y = Axis::of(axis_label(quantity));
                if let Some((low, high)) = range {
                    plot.y = plot.y.over(low, high);
                    plot.size = (0.0, 160.0);
                }
                plot.marks = frame.iter().flat_map(Curve::over_time).collect();
                plot.caption = levels(frame, quantity) + &zeros;
                plots.push(plot);
            }
        }
        plots
    }

    fn against(&self, runs: &[Drawn<'_>]) -> Vec<Plot> {
        let Some((across, _)) = self.signals.split_first() else {
            return Vec::new();
        };
        // One y of all runs is one curve only where the x is the same as well.
        let share = all_equal(runs.iter().map(|run| run.traces.first()));
        let curves: Vec<Curve<'_>> = curves(runs, share, |run| run.traces.iter().skip(1).collect());
        let Some(first) = curves.first() else {
            return Vec::new();
        };
        let (x, y) = (across.stream.quantity, first.trace.stream.quantity);
        let mut plot = self.frame();
        let (x_unit, y_unit) = (Unit::of(x), Unit::of(y));
        plot.x = Axis::of(match x_unit.symbol.as_str() {
            "" => across.stream.name.clone(),
            unit => format!("{} ({unit})", across.stream.name),
        });
        plot.y = Axis::of(axis_label(y));
        plot.size = (0.0, 300.0);
        let others: Vec<&str> = (self.signals.iter().skip(1))
            .map(|signal| signal.stream.name.as_str())
            .collect();
        plot.caption = format!(
            "Each dot is one moment: {} (side) at the {} (below) of that moment.",
            others.join(" or "),
            across.stream.name
        );
        plot.marks = curves
            .iter()
            .filter_map(|curve| {
                let x_trace = runs.get(curve.run)?.traces.first()?;
                let points = paired(&x_trace.points(), &curve.trace.points());
                let shown = points.into_iter().map(|(x, y)| (x_unit.show(x), y_unit.show(y)));
                Some(dots(curve, shown.collect()))
            })
            .flatten()
            .collect();
        vec![plot]
    }

    fn path(&self, runs: &[Drawn<'_>]) -> Vec<Plot> {
        let mut plot = self.frame();
        let curves = curves(runs, true, |run| run.traces.iter().collect());
        let line = |curve: &Curve<'_>| {
            let unit = Unit::of(curve.trace.way_quantity());
            let points = curve.trace.points().into_iter();
            let shown = points.map(|(x, y)| (unit.show(x), unit.show(y)));
            let style = match curve.is_dashed {
                true => curve.style(),
                false => curve.style().weight(Weight::Hair),
            };
            Mark::Line(style, shown.collect())
        };
        plot.marks = curves.iter().map(line).collect();
        let unit = runs
            .first()
            .and_then(|run| run.traces.first())
            .map_or_else(String::new, |trace| Unit::of(trace.way_quantity()).symbol);
        plot.size = PATH_SIZE;
        plot.aspect = Some(PATH_FRAME.0 / PATH_FRAME.1);
        plot.caption = match self
            .signals
            .iter()
            .all(|signal| signal.stream.kind == Kind::Contact)
        {
            true => "Seen from above, both axes in one scale; a line is broken where nothing touches.",
            false => "Seen from above, both axes in one scale.",
        }
        .to_owned();
        let ((x_low, x_high), (y_low, y_high)) = square(&plot.marks);
        plot.x = Axis::of(format!("x ({unit})")).over(x_low, x_high);
        plot.y = Axis::of(format!("y ({unit})")).over(y_low, y_high);
        vec![plot]
    }

    /// An empty plot of these curves, after the others of the same node: with the signal's name in its title where there
    /// is a frame for each, with the quantity's from the second on.
    fn frame_of(&self, before: &[Plot], curves: &[Curve<'_>], one_each: bool, quantity: Quantity) -> Plot {
        let title = match curves.first() {
            Some(one) if one_each => format!("{}, {}", self.title, one.trace.stream.name),
            _ if !before.is_empty() => format!("{}: {}", self.title, quantity.name().unwrap_or("value")),
            _ => self.title.clone(),
        };
        Plot {
            title,
            ..self.frame()
        }
    }

    fn frame(&self) -> Plot {
        let simulated = self.signals.iter().any(|signal| signal.stream.simulated);
        Plot {
            title: self.title.clone(),
            note: if simulated { "simulated" } else { "" }.to_owned(),
            ..Plot::default()
        }
    }
}

/// Signals of this rate or more fill the space between their extremes.
const FAST_HZ: f64 = 2000.0;
/// Of plots of ways; and of the frame in it, over which both axes have one scale.
const PATH_SIZE: (f64, f64) = (0.0, 420.0);
const PATH_FRAME: (f64, f64) = (676.0, 342.0);

struct Curve<'a> {
    name: String,
    ink: Ink,
    is_dashed: bool,
    run: usize,
    trace: &'a Trace,
}

/// The curves of these traces of every run. A colour is that of a signal, or where there are several runs that of a run,
/// whose second signal and those after it are dashed; a signal that is the same in all runs is one grey curve where `share`.
fn curves<'a>(
    runs: &[Drawn<'a>],
    share: bool,
    traces: impl Fn(&Drawn<'a>) -> Vec<&'a Trace>,
) -> Vec<Curve<'a>> {
    let by_run: Vec<Vec<&'a Trace>> = runs.iter().map(traces).collect();
    let most = by_run.iter().map(Vec::len).max().unwrap_or(0);
    let several = runs.len() > 1;
    let is_shared = |number: usize| {
        several && share && all_equal(by_run.iter().map(|traces| traces.get(number).copied()))
    };
    let shared: Vec<bool> = (0..most).map(is_shared).collect();
    let mut found = Vec::new();
    for (run, (drawn, traces)) in runs.iter().zip(&by_run).enumerate() {
        for (number, trace) in traces.iter().enumerate() {
            let signal = &trace.stream.name;
            let (name, ink) = match (shared[number], drawn.name) {
                (true, _) if run > 0 => continue,
                (true, _) => (format!("{signal}, all runs"), Ink::Grey),
                (false, "") => (signal.clone(), Ink::number(number)),
                (false, name) if traces.len() == 1 => (name.to_owned(), Ink::of_run(run)),
                (false, name) => (format!("{name}: {signal}"), Ink::of_run(run)),
            };
            let is_dashed = several && !shared[number] && number > 0;
            found.push(Curve {
                name,
                ink,
                is_dashed,
                run,
                trace,
            });
        }
    }
    found
}

/// Did all runs leave the same?
fn all_equal<'a>(mut traces: impl Iterator<Item = Option<&'a Trace>>) -> bool {
    let first = traces.next().flatten().map(Trace::kept);
    traces.all(|trace| trace.map(Trace::kept) == first)
}

/// What there is to say of curves none of which ever changes.
fn constant(curves: &[Curve<'_>]) -> Option<String> {
    let values: Vec<String> = curves
        .iter()
        .map(|curve| curve.trace.constant())
        .collect::<Option<_>>()?;
    let (first, rest) = values.split_first()?;
    if rest.iter().all(|value| value == first) {
        return Some(format!("{first}."));
    }
    let named = curves.iter().zip(&values);
    let named: Vec<String> = named
        .map(|(curve, value)| format!("{} {value}", curve.name))
        .collect();
    Some(named.join(", ") + ".")
}

/// How large the signals of a frame are: the root mean square of one that goes both ways, the mean of another.
fn levels(curves: &[Curve<'_>], quantity: Quantity) -> String {
    let unit = Unit::of(quantity);
    let level = |curve: &Curve<'_>| match &*curve.trace.shared.lock().unwrap_or_else(PoisonError::into_inner)
    {
        Kept::Signal(envelope) => {
            let (low, high) = envelope.range()?;
            let level = match low < 0.0 && high > 0.0 {
                true => format!("RMS {}", unit.text(envelope.rms())),
                false => format!("mean {}", unit.text(envelope.mean())),
            };
            let of = if curves.len() > 1 {
                format!("{}: ", curve.name)
            } else {
                String::new()
            };
            let heating = figures::heating(&curve.trace.stream, envelope);
            Some(format!(
                "{of}{level}, from {} to {}{heating}",
                unit.text(low),
                unit.text(high)
            ))
        }
        Kept::Points(_) => None,
    };
    let levels: Vec<String> = curves.iter().filter_map(level).collect();
    let text = levels.join("; ");
    let mut letters = text.chars();
    match letters.next() {
        Some(first) if curves.len() == 1 => format!("{}{}.", first.to_uppercase(), letters.as_str()),
        Some(_) => text + ".",
        None => String::new(),
    }
}

impl Curve<'_> {
    fn style(&self) -> Style {
        let style = Style::named(self.ink, self.name.as_str());
        match self.is_dashed {
            true => style.weight(Weight::Dashed),
            false => style,
        }
    }

    fn over_time(&self) -> Vec<Mark> {
        let unit = Unit::of(self.trace.stream.quantity);
        let style = self.style();
        match &*self.trace.shared.lock().unwrap_or_else(PoisonError::into_inner) {
            Kept::Signal(envelope) => vec![Mark::signal(style, envelope, |si| unit.show(si))],
            Kept::Points(events) => {
                let heads: Vec<_> = events.kept().iter().map(|(t, v)| (*t, unit.show(*v))).collect();
                let foot = unit.show(0.0);
                let stems = heads.iter().map(|(t, v)| [(*t, foot), (*t, *v)]).collect();
                vec![
                    Mark::Segments(Style::of(self.ink), stems),
                    Mark::Dots(style, heads),
                ]
            }
        }
    }
}

impl Trace {
    fn kept(&self) -> Kept {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn points(&self) -> Vec<(f64, f64)> {
        match &*self.shared.lock().unwrap_or_else(PoisonError::into_inner) {
            Kept::Points(points) => points.kept().to_vec(),
            Kept::Signal(_) => Vec::new(),
        }
    }

    /// What a signal is that never changes, in words.
    fn constant(&self) -> Option<String> {
        match &*self.shared.lock().unwrap_or_else(PoisonError::into_inner) {
            Kept::Signal(envelope) => {
                let value = Unit::of(self.stream.quantity).text(envelope.constant()?);
                Some(format!("constant {value}"))
            }
            Kept::Points(events) => {
                let never = self.stream.kind == Kind::Event && events.kept().is_empty();
                never.then(|| "never".to_owned())
            }
        }
    }

    /// Is it zero, or without an event, all the time?
    fn is_zero(&self) -> bool {
        match &*self.shared.lock().unwrap_or_else(PoisonError::into_inner) {
            Kept::Signal(envelope) => envelope.constant() == Some(0.0),
            Kept::Points(events) => self.stream.kind == Kind::Event && events.kept().is_empty(),
        }
    }

    /// Of a way on a surface: a contact says where it is in metres.
    fn way_quantity(&self) -> Quantity {
        match self.stream.kind {
            Kind::Contact => Quantity::LENGTH,
            _ => self.stream.quantity,
        }
    }
}

/// The dots of a curve: where few lie together each is large and opaque, where many do they are small and shine through.
fn dots(curve: &Curve<'_>, points: Vec<(f64, f64)>) -> Vec<Mark> {
    let (few, many) = by_density(points);
    let small = curve.style().weight(Weight::Hair);
    match (few.is_empty(), many.is_empty()) {
        (_, true) => vec![Mark::Dots(curve.style(), few)],
        (true, _) => vec![Mark::Dots(small, many)],
        _ => vec![Mark::Dots(small, many), Mark::Dots(Style::of(curve.ink), few)],
    }
}

/// Points of which few lie together, and the others, both in their order.
fn by_density(points: Vec<(f64, f64)>) -> (Vec<(f64, f64)>, Vec<(f64, f64)>) {
    /// Places across and up, each about as large as a dot; points in one that are few.
    const PLACES: (f64, f64) = (150.0, 50.0);
    const FEW: usize = 4;
    let span = |of: fn(&(f64, f64)) -> f64| {
        let finite = points.iter().map(of).filter(|x| x.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        (low, (high - low).max(f64::MIN_POSITIVE))
    };
    let ((x_low, width), (y_low, height)) = (span(|p| p.0), span(|p| p.1));
    let place = |p: &(f64, f64)| {
        let part = |x: f64, low: f64, span: f64, places: f64| ((x - low) / span * places) as i64;
        (
            part(p.0, x_low, width, PLACES.0),
            part(p.1, y_low, height, PLACES.1),
        )
    };
    let mut counts: HashMap<(i64, i64), usize> = HashMap::new();
    for point in &points {
        *counts.entry(place(point)).or_default() += 1;
    }
    points
        .into_iter()
        .partition(|point| counts.get(&place(point)).is_none_or(|count| *count <= FEW))
}

/// A range that holds the values of all curves, with a little room.
fn common_range(curves: &[Curve<'_>]) -> Option<(f64, f64)> {
    let mut range = (f64::INFINITY, f64::NEG_INFINITY);
    for curve in curves {
        let unit = Unit::of(curve.trace.stream.quantity);
        if let Kept::Signal(envelope) = &*curve.trace.shared.lock().unwrap_or_else(PoisonError::into_inner) {
            for (_, low, high) in envelope.points() {
                range = (range.0.min(unit.show(low)), range.1.max(unit.show(high)));
            }
        }
    }
    let room = 0.05 * (range.1 - range.0);
    (room > 0.0).then_some((range.0 - room, range.1 + room))
}

/// (x, y) by time: each y with the latest x of its time.
fn paired(x: &[(f64, f64)], y: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut next = 0;
    y.iter()
        .filter_map(|(time_s, y)| {
            while x.get(next).is_some_and(|(at_s, _)| *at_s <= time_s + 1e-9) {
                next += 1;
            }
            let (_, x) = x.get(next.checked_sub(1)?)?;
            Some((*x, *y))
        })
        .collect()
}

/// Ranges around all points of lines, a unit as long across as upwards.
fn square(marks: &[Mark]) -> ((f64, f64), (f64, f64)) {
    let points = marks.iter().flat_map(|mark| match mark {
        Mark::Line(_, points) => points.as_slice(),
        _ => &[],
    });
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for (x, y) in points.filter(|(x, y)| x.is_finite() && y.is_finite()) {
        low = [low[0].min(*x), low[1].min(*y)];
        high = [high[0].max(*x), high[1].max(*y)];
    }
    if low[0] > high[0] {
        return ((-1.0, 1.0), (-1.0, 1.0));
    }
    let per_pixel = ((high[0] - low[0]) / PATH_FRAME.0).max((high[1] - low[1]) / PATH_FRAME.1);
    let per_pixel = 1.06 * per_pixel.max(1e-9);
    let around = |i: usize, pixels: f64| {
        let middle = 0.5 * (low[i] + high[i]);
        (
            middle - 0.5 * pixels * per_pixel,
            middle + 0.5 * pixels * per_pixel,
        )
    };
    (around(0, PATH_FRAME.0), around(1, PATH_FRAME.1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::graph::NodeId;
    use haptograph_signal::time::Rate;

    fn trace(name: &str, kind: Kind, hz: u64, form: Form, frames: &[f64]) -> (Watch, Trace) {
        let stream = Stream {
            name: name.into(),
            kind,
            quantity: Quantity::FORCE,
            rate: Rate::from_hz(hz).unwrap(),
            simulated: true,
        };
        let (mut tracer, trace) = tracer(&stream, form);
        tracer.write(0, frames).unwrap();
        let (node, output) = (NodeId::default(), 0);
        (Watch { node, output, stream }, trace)
    }

    #[test]
    fn signals_of_different_rates_are_paired_by_time() {
        let ramp = |n: u32, step: f64| (0..n).map(|k| f64::from(k) * step).collect::<Vec<_>>();
        let (x, slow) = trace("x", Kind::Scalar, 100, Form::Against, &ramp(10, 0.01));
        let (y, fast) = trace("y", Kind::Scalar, 1000, Form::Against, &ramp(100, 0.001));
        let asked = Asked {
            title: "t".into(),
            form: Form::Against,
            signals: vec![x, y],
        };
        let plots = asked.plots(&[Drawn {
            name: "",
            traces: &[slow, fast],
        }]);
        let Mark::Dots(_, points) = &plots[0].marks[0] else {
            panic!("{plots:?}")
        };
        assert_eq!(points.len(), 100);
        assert!(points.iter().all(|(x, y)| y - x > -1e-12 && y - x < 0.01));
    }

    #[test]
    fn a_way_keeps_its_shape_and_is_interrupted_in_the_air() {
        let touching = |x: f64, y: f64, yes: bool| {
            let contact = Contact {
                touching: yes,
                ihip_m: [x, y, 0.0],
                ..Contact::default()
            };
            contact.to_lanes()
        };
        let frames = [
            touching(0.0, 0.0, true),
            touching(9.0, 9.0, false),
            touching(0.01, 0.02, true),
        ];
        let (watch, trace) = trace("touch.contact", Kind::Contact, 1000, Form::Path, &frames.concat());
        let asked = Asked {
            title: "way".into(),
            form: Form::Path,
            signals: vec![watch],
        };
        let plot = asked
            .plots(&[Drawn {
                name: "",
                traces: &[trace],
            }])
            .remove(0);
        let (Some((x0, x1)), Some((y0, y1))) = (plot.x.range, plot.y.range) else {
            panic!("{plot:?}")
        };
        let (per_x, per_y) = ((x1 - x0) / PATH_FRAME.0, (y1 - y0) / PATH_FRAME.1);
        assert!((per_x / per_y - 1.0).abs() < 1e-9 && x1 < 50.0);
        assert!(matches!(&plot.marks[0], Mark::Line(_, points) if points[1].0.is_nan()));
    }

    #[test]
    fn a_way_that_all_runs_share_is_one_curve_and_the_second_of_a_run_is_dashed() {
        let way = |name: &str, x: f64| {
            trace(
                name,
                Kind::Vector,
                1000,
                Form::Path,
                &[0.0, 0.0, 0.0, x, 1.0, 0.0],
            )
        };
        let asked = Asked {
            title: "Where".into(),
            form: Form::Path,
            signals: vec![way("hand", 1.0).0, way("found", 1.0).0],
        };
        let runs = [2.0, 3.0].map(|x| [way("hand", 1.0).1, way("found", x).1]);
        let drawn = ["a", "b"].iter().zip(&runs);
        let drawn: Vec<Drawn<'_>> = drawn.map(|(name, traces)| Drawn { name, traces }).collect();
        let plots = asked.plots(&drawn);
        let styles = plots[0].marks.iter().map(|mark| match mark {
            Mark::Line(style, _) => (style.name.as_str(), style.weight),
            other => panic!("{other:?}"),
        });
        let expected = [
            ("hand, all runs", Weight::Hair),
            ("a: found", Weight::Dashed),
            ("b: found", Weight::Dashed),
        ];
        assert_eq!(styles.collect::<Vec<_>>(), expected);
        assert!(!plots[0].caption.contains("touches"));
    }

    #[test]
    fn what_never_changes_is_said_and_not_drawn() {
        let (moving, first) = trace("load", Kind::Scalar, 1000, Form::OverTime, &[1.0, 2.0, 3.0]);
        let (silent, second) = trace("shake", Kind::Scalar, 1000, Form::OverTime, &[0.0; 3]);
        let (event, never) = trace("too hard", Kind::Event, 1000, Form::OverTime, &[0.0; 6]);
        let asked = |signals: Vec<Watch>| Asked {
            title: "Forces".into(),
            form: Form::OverTime,
            signals,
        };
        let drawn = |traces| Drawn { name: "", traces };
        let both = [first, second];
        let plots = asked(vec![moving, silent.clone()]).plots(&[drawn(&both)]);
        assert_eq!((plots.len(), plots[0].marks.len()), (1, 1));
        assert!(
            plots[0].caption.ends_with("shake: constant 0 N."),
            "{}",
            plots[0].caption
        );
        for (signal, trace, text) in [(silent, &both[1], "constant 0 N."), (event, &never, "never.")] {
            let plots = asked(vec![signal]).plots(&[drawn(std::slice::from_ref(trace))]);
            assert_eq!((plots.len(), plots[0].caption.as_str()), (1, text));
            assert!(!plots[0].to_figure().contains("<svg"), "{}", plots[0].to_figure());
        }
    }

    #[test]
    fn several_runs_share_a_frame_and_are_named() {
        let frames = [1.0, 2.0, 3.0];
        let (watch, first) = trace("load", Kind::Scalar, 1000, Form::OverTime, &frames);
        let (_, second) = trace("load", Kind::Scalar, 1000, Form::OverTime, &[1.0, 2.0, 4.0]);
        let asked = Asked {
            title: "force".into(),
            form: Form::OverTime,
            signals: vec![watch],
        };
        let runs = |other| {
            [("soft", &first), ("hard", other)].map(|(name, trace)| Drawn {
                name,
                traces: std::slice::from_ref(trace),
            })
        };
        let plots = asked.plots(&runs(&second));
        assert_eq!((plots.len(), plots[0].marks.len()), (1, 2));
        assert!(plots[0].to_figure().contains("hard"));
        let plots = asked.plots(&runs(&first));
        assert_eq!((plots.len(), plots[0].marks.len()), (1, 1));
        assert!(plots[0].note.contains("same in all runs"));
    }
}
