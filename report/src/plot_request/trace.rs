//! Reduction of one signal, during a run, to the data that a plot shows.

use super::Form;
use crate::figures::Unit;
use crate::thinning::{Decimated, Envelope};
use haptograph_engine::frame::{Event, Kind, OneKind, Record};
use haptograph_engine::node::{FrameWriter, Stream};
use haptograph_nodes::contact::Contact;
use haptograph_signal::quantity::Quantity;
use std::sync::{Arc, Mutex, PoisonError};

/// The reduced signal.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum TraceContent {
    /// Extremes over time.
    Signal(Envelope),
    /// (time in s, value), or (x, y) of a path.
    Points(Decimated<(f64, f64)>),
}

/// Writer that reduces a signal.
#[derive(Debug)]
pub struct Tracer {
    kind: Kind,
    form: Form,
    period_s: f64,
    frames: u64,
    shared: Arc<Mutex<TraceContent>>,
}

/// Access to the data that a [`Tracer`] keeps.
#[derive(Debug)]
pub struct Trace {
    pub(super) stream: Stream,
    shared: Arc<Mutex<TraceContent>>,
}

/// Maximum number of kept points.
const MAX_POINTS: usize = 4000;

/// Creates the writer of a signal for a plot of this form, and the access to its result.
pub fn tracer(stream: &Stream, form: Form) -> (Tracer, Trace) {
    let kept = if form == Form::OverTime && stream.kind != Kind::EVENT {
        TraceContent::Signal(Envelope::new(stream.rate.hz()))
    } else {
        TraceContent::Points(Decimated::new(MAX_POINTS))
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
                TraceContent::Signal(envelope) => envelope.extend([size(frame)]),
                TraceContent::Points(points) => {
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
    pub(super) fn kept(&self) -> TraceContent {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The extremes of a signal over time.
    pub(crate) fn envelope(&self) -> Option<Envelope> {
        match self.kept() {
            TraceContent::Signal(envelope) => Some(envelope),
            TraceContent::Points(_) => None,
        }
    }

    pub(super) fn points(&self) -> Vec<(f64, f64)> {
        match &*self.shared.lock().unwrap_or_else(PoisonError::into_inner) {
            TraceContent::Points(points) => points.kept().to_vec(),
            TraceContent::Signal(_) => Vec::new(),
        }
    }

    /// Text about a signal that never changes.
    pub(super) fn constant(&self) -> Option<String> {
        match &*self.shared.lock().unwrap_or_else(PoisonError::into_inner) {
            TraceContent::Signal(envelope) => {
                let value = Unit::of(self.stream.quantity).text(envelope.constant()?);
                Some(format!("constant {value}"))
            }
            TraceContent::Points(events) => {
                let never = self.stream.kind == Kind::EVENT && events.kept().is_empty();
                never.then(|| "never".to_owned())
            }
        }
    }

    /// True if the signal is zero, or without events, all the time.
    pub(super) fn is_zero(&self) -> bool {
        match &*self.shared.lock().unwrap_or_else(PoisonError::into_inner) {
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
