//! Reduction of one signal, during a run, to the data that a plot shows.

use super::Form;
use crate::figures::Unit;
use crate::record::Reduction;
use crate::thinning::{Decimated, Envelope};
use haptograph_engine::frame::{Event, Kind, OneKind, Record};
use haptograph_engine::node::Stream;
use haptograph_nodes::contact::Contact;
use haptograph_signal::quantity::Quantity;

/// The reduced signal.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum TraceContent {
    /// Extremes over time.
    Signal(Envelope),
    /// (time in s, value), or (x, y) of a path.
    Points(Decimated<(f64, f64)>),
}

/// A signal of a plot, reduced.
#[derive(Debug, Clone)]
pub struct Trace {
    pub(super) stream: Stream,
    form: Form,
    frames: u64,
    pub(super) content: TraceContent,
}

/// Maximum number of kept points.
const MAX_POINTS: usize = 4000;

impl Reduction for Trace {
    fn extend(&mut self, frames: &[f64]) {
        let kind = self.stream.kind;
        for frame in frames.chunks_exact(kind.width()) {
            let time_s = self.frames as f64 * self.stream.rate.period_s();
            self.frames += 1;
            match &mut self.content {
                TraceContent::Signal(envelope) => envelope.extend([size(frame)]),
                TraceContent::Points(points) => {
                    if let Some(point) = point(self.form, kind, time_s, frame) {
                        points.push(point);
                    }
                }
            }
        }
    }
}

/// The value of a scalar, or the magnitude of a vector.
fn size(frame: &[f64]) -> f64 {
    match frame {
        [scalar] => *scalar,
        lanes => lanes.iter().map(|x| x * x).sum::<f64>().sqrt(),
    }
}

/// The point that a frame adds. A path is interrupted without contact.
fn point(form: Form, kind: Kind, time_s: f64, frame: &[f64]) -> Option<(f64, f64)> {
    match form {
        _ if kind == Kind::EVENT => {
            let event = frame.as_chunks().0.first().map(Event::from_components)?;
            event.fired.then_some((time_s, event.value))
        }
        _ if kind == Contact::KIND => {
            let contact = frame.as_chunks().0.first().map(Contact::from_components)?;
            let [x, y, _] = if contact.touching { contact.ihip_m } else { [f64::NAN; 3] };
            Some((x, y))
        }
        Form::Path => Some((frame[0], *frame.get(1)?)),
        _ => Some((time_s, size(frame))),
    }
}

impl Trace {
    /// The empty trace of a signal for a plot of this form.
    pub(crate) fn of(stream: Stream, form: Form) -> Self {
        let content = match form == Form::OverTime && stream.kind != Kind::EVENT {
            true => TraceContent::Signal(Envelope::new(stream.rate.hz())),
            false => TraceContent::Points(Decimated::new(MAX_POINTS)),
        };
        Self { stream, form, frames: 0, content }
    }

    /// The extremes of a signal over time.
    pub(crate) fn envelope(&self) -> Option<&Envelope> {
        match &self.content {
            TraceContent::Signal(envelope) => Some(envelope),
            TraceContent::Points(_) => None,
        }
    }

    pub(super) fn points(&self) -> &[(f64, f64)] {
        match &self.content {
            TraceContent::Points(points) => points.kept(),
            TraceContent::Signal(_) => &[],
        }
    }

    /// Text about a signal that never changes.
    pub(super) fn constant(&self) -> Option<String> {
        match &self.content {
            TraceContent::Signal(envelope) => {
                let value = Unit::of(self.stream.quantity).text(envelope.constant()?);
                Some(format!("constant {value}"))
            }
            TraceContent::Points(_) => self.is_zero().then(|| "never".to_owned()),
        }
    }

    /// True if the signal is zero, or without events, all the time.
    pub(super) fn is_zero(&self) -> bool {
        match &self.content {
            TraceContent::Signal(envelope) => envelope.constant() == Some(0.0),
            TraceContent::Points(events) => self.stream.kind == Kind::EVENT && events.kept().is_empty(),
        }
    }

    /// Quantity of a path on a surface: the position of a contact is in metres.
    pub(super) fn way_quantity(&self) -> Quantity {
        match self.stream.kind == Contact::KIND {
            true => Quantity::LENGTH,
            false => self.stream.quantity,
        }
    }
}
