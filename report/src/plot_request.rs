//! Plots requested by a graph's nodes `TimePlot`, `XyPlot` and `PathPlot`, of one run or of several in one
//! frame.

mod curves;
mod trace;

use super::figures::{Unit, capitalised};
use super::inks::Inks;
use super::plot::{Axis, Mark, Plot, Weight};
use super::record::{WatchedOutput, watch};
use curves::{Curve, all_equal, common_range, constant, curves, dots, label, levels};
use haptograph_engine::frame::OneKind;
use haptograph_engine::graph::Graph;
use haptograph_engine::node::Stream;
use haptograph_nodes::contact::Contact;
use haptograph_nodes::sinks::plots::GROUP;
use haptograph_signal::quantity::Quantity;
pub use trace::Trace;

/// A plot requested by a graph.
#[derive(Debug, Clone, PartialEq)]
pub struct PlotRequest {
    /// Name of its node.
    pub title: String,
    /// Form of the plot.
    pub form: Form,
    /// The signals, in the order of the inputs.
    pub signals: Vec<WatchedOutput>,
    /// Names of the signals in the plot: the node alone if it has a single output.
    pub names: Vec<String>,
}

/// Form of a plot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Signals over time.
    OverTime,
    /// Signals against the first one.
    Against,
    /// Paths seen from above.
    Path,
}

/// The plots requested by a graph, in its order.
pub fn plot_requests(graph: &Graph) -> Vec<PlotRequest> {
    let nodes = graph.nodes();
    let plots = nodes.ids().filter(|index| nodes[*index].entry.spec.group == GROUP);
    plots
        .map(|index| {
            let name = |signal: &WatchedOutput| match &nodes[signal.node] {
                source if source.outputs.len() == 1 => source.path.clone(),
                _ => signal.stream.name.clone(),
            };
            let signals: Vec<WatchedOutput> = nodes
                .incoming(index)
                .into_iter()
                .filter_map(|read| watch(graph, read.from, read.edge.output))
                .collect();
            PlotRequest {
                title: capitalised(&nodes[index].path),
                form: match nodes[index].entry.spec.name {
                    "XyPlot" => Form::Against,
                    "PathPlot" => Form::Path,
                    _ => Form::OverTime,
                },
                names: signals.iter().map(name).collect(),
                signals,
            }
        })
        .collect()
}

/// The traces of one run for a plot.
#[derive(Debug)]
pub struct RunTraces<'a> {
    /// Name of the run; empty if there is only one run.
    pub name: &'a str,
    /// A trace per signal.
    pub traces: &'a [Trace],
}

impl RunTraces<'_> {
    fn equals(&self, other: &Self) -> bool {
        let mut pairs = self.traces.iter().zip(other.traces);
        self.traces.len() == other.traces.len() && pairs.all(|(a, b)| a.content == b.content)
    }
}

impl PlotRequest {
    /// Name of one of its signals in the plot.
    fn short_name<'n>(&'n self, stream: &'n Stream) -> &'n str {
        let mut named = self.signals.iter().zip(&self.names);
        let found = named.find(|(signal, _)| signal.stream.name == stream.name);
        found.map_or(&stream.name, |(_, name)| name)
    }

    /// True if all runs have the same traces.
    pub(crate) fn is_same(&self, runs: &[RunTraces<'_>]) -> bool {
        match runs {
            [first, rest @ ..] => !rest.is_empty() && rest.iter().all(|run| run.equals(first)),
            [] => false,
        }
    }

    /// The plot of one run, or of several in one frame. Fast signals of several runs, which would hide each
    /// other, get one frame each.
    pub(crate) fn plots(&self, runs: &[RunTraces<'_>], inks: &mut Inks) -> Vec<Plot> {
        if let [first, ..] = runs
            && self.is_same(runs)
        {
            let one = RunTraces { name: "", traces: first.traces };
            let mut plots = self.plots(&[one], inks);
            for plot in &mut plots {
                let separator = if plot.note.is_empty() { "" } else { ", " };
                plot.note += &format!("{separator}the same in all runs");
            }
            return plots;
        }
        match self.form {
            Form::OverTime => self.over_time(runs, inks),
            Form::Against => self.against(runs, inks),
            Form::Path => self.path(runs, inks),
        }
    }

    fn over_time(&self, runs: &[RunTraces<'_>], inks: &mut Inks) -> Vec<Plot> {
        let (mut plots, mut rest): (Vec<Plot>, Vec<usize>) = (Vec::new(), (0..self.signals.len()).collect());
        while let Some(first) = rest.first().copied() {
            // One run: signals of a quantity share a frame. Several runs: the runs of a signal share one.
            let quantity = self.signals[first].stream.quantity;
            let alike = |i: &usize| match runs {
                [_] => self.signals[*i].stream.quantity == quantity,
                _ => *i == first,
            };
            let group: Vec<usize> = rest.iter().copied().filter(alike).collect();
            rest.retain(|i| !group.contains(i));
            let fast = self.signals[first].stream.rate.hz() >= FAST_HZ;
            let mut curves: Vec<Curve<'_>> = curves(self, runs, true, inks, |run| {
                group.iter().filter_map(|i| run.traces.get(*i)).collect()
            });
            if let Some(text) = constant(&curves) {
                plots.push(Plot { caption: text, ..self.frame_of(&plots, &curves, runs.len() > 1) });
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
            let range = if frames.len() > 1 { common_range(&curves) } else { None };
            for frame in frames {
                let mut plot = self.frame_of(&plots, frame, range.is_some() || runs.len() > 1);
                plot.x = Axis::time();
                plot.y = Axis::of(label(self, frame));
                if let Some((low, high)) = range {
                    plot.y = plot.y.over(low, high);
                    plot.size = (0.0, 160.0);
                }
                plot.marks = frame.iter().flat_map(Curve::over_time).collect();
                plot.caption = levels(frame, runs.len() > 1) + &zeros;
                plots.push(plot);
            }
        }
        plots
    }

    fn against(&self, runs: &[RunTraces<'_>], inks: &mut Inks) -> Vec<Plot> {
        let Some((across, _)) = self.signals.split_first() else {
            return Vec::new();
        };
        // The y of all runs is drawn as one curve only if the x is the same too.
        let share = all_equal(runs.iter().map(|run| run.traces.first()));
        let curves: Vec<Curve<'_>> =
            curves(self, runs, share, inks, |run| run.traces.iter().skip(1).collect());
        let Some(first) = curves.first() else {
            return Vec::new();
        };
        let (x, y) = (across.stream.quantity, first.trace.stream.quantity);
        let mut plot = self.frame();
        let (x_unit, y_unit) = (Unit::of(x), Unit::of(y));
        let across_name = self.short_name(&across.stream);
        plot.x = Axis::of(match x_unit.symbol.as_str() {
            "" => format!("{across_name} (1)"),
            unit => format!("{across_name} ({unit})"),
        });
        plot.y = Axis::of(label(self, &curves));
        plot.size = (0.0, 300.0);
        let others: Vec<&str> = self.names.iter().skip(1).map(String::as_str).collect();
        plot.caption = format!(
            "Each dot is one moment: {} (side) at the {} (below) of that moment.",
            others.join(" or "),
            across_name
        );
        plot.marks = curves
            .iter()
            .filter_map(|curve| {
                let x_trace = runs.get(curve.run)?.traces.first()?;
                let points = paired(x_trace.points(), curve.trace.points());
                let shown = points.into_iter().map(|(x, y)| (x_unit.show(x), y_unit.show(y)));
                Some(dots(curve, shown.collect()))
            })
            .flatten()
            .collect();
        vec![plot]
    }

    fn path(&self, runs: &[RunTraces<'_>], inks: &mut Inks) -> Vec<Plot> {
        let mut plot = self.frame();
        let curves = curves(self, runs, true, inks, |run| run.traces.iter().collect());
        let line = |curve: &Curve<'_>| {
            let unit = Unit::of(curve.trace.way_quantity());
            let points = curve.trace.points().iter();
            let shown = points.map(|(x, y)| (unit.show(*x), unit.show(*y)));
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
        plot.caption = match self.signals.iter().all(|signal| signal.stream.kind == Contact::KIND) {
            true => "Seen from above, both axes in one scale; the line is interrupted without contact.",
            false => "Seen from above, both axes in one scale.",
        }
        .to_owned();
        let ((x_low, x_high), (y_low, y_high)) = square(&plot.marks);
        plot.x = Axis::of(format!("x ({unit})")).over(x_low, x_high);
        plot.y = Axis::of(format!("y ({unit})")).over(y_low, y_high);
        vec![plot]
    }

    /// An empty plot for these curves, placed after the node's other plots. Its title names the signal if
    /// each frame shows one signal, or the quantity from the second frame on; for plain numbers it names the
    /// signals.
    fn frame_of(&self, before: &[Plot], curves: &[Curve<'_>], one_each: bool) -> Plot {
        let title = match curves {
            [one, ..] if one_each => format!("{}, {}", self.title, self.short_name(&one.trace.stream)),
            [one, ..] if !before.is_empty() => {
                let named = match one.trace.stream.quantity {
                    Quantity::NUMBER => None,
                    quantity => quantity.name().map(str::to_owned),
                };
                let names: Vec<&str> = curves.iter().map(|curve| curve.name.as_str()).collect();
                format!("{}: {}", self.title, named.unwrap_or_else(|| names.join(", ")))
            }
            _ => self.title.clone(),
        };
        Plot { title, ..self.frame() }
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

/// Signals at this rate or above are filled between their extremes.
const FAST_HZ: f64 = 2000.0;
/// Size of a path plot, and of its frame, in which both axes have one scale.
const PATH_SIZE: (f64, f64) = (0.0, 420.0);
const PATH_FRAME: (f64, f64) = (676.0, 342.0);

/// Pairs (x, y): each y with the latest x of its time.
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

/// Ranges around all points of the marks, with equal scales on both axes.
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
        (middle - 0.5 * pixels * per_pixel, middle + 0.5 * pixels * per_pixel)
    };
    (around(0, PATH_FRAME.0), around(1, PATH_FRAME.1))
}

#[cfg(test)]
mod tests;
