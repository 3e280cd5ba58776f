//! What a plot keeps of one signal while a run goes on.

use super::Form;
use crate::figures::Unit;
use crate::thinning::{Decimated, Envelope};
use haptograph_engine::frame::{Contact, Event, Kind};
use haptograph_engine::node::{FrameWriter, Stream};
use haptograph_signal::quantity::Quantity;
use std::sync::{Arc, Mutex, PoisonError};

/// What a plot keeps of one signal.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Kept {
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
    pub(super) stream: Stream,
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
            let event = frame.as_chunks().0.first().map(Event::from_components)?;
            event.fired.then_some((time_s, event.value))
        }
        (Kind::Contact, _) => {
            let contact = frame.as_chunks().0.first().map(Contact::from_components)?;
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

impl Trace {
    pub(super) fn kept(&self) -> Kept {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Of a signal over time, its extremes.
    pub(crate) fn envelope(&self) -> Option<Envelope> {
        match self.kept() {
            Kept::Signal(envelope) => Some(envelope),
            Kept::Points(_) => None,
        }
    }

    pub(super) fn points(&self) -> Vec<(f64, f64)> {
        match &*self.shared.lock().unwrap_or_else(PoisonError::into_inner) {
            Kept::Points(points) => points.kept().to_vec(),
            Kept::Signal(_) => Vec::new(),
        }
    }

    /// What a signal is that never changes, in words.
    pub(super) fn constant(&self) -> Option<String> {
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
    pub(super) fn is_zero(&self) -> bool {
        match &*self.shared.lock().unwrap_or_else(PoisonError::into_inner) {
            Kept::Signal(envelope) => envelope.constant() == Some(0.0),
            Kept::Points(events) => self.stream.kind == Kind::Event && events.kept().is_empty(),
        }
    }

    /// Of a way on a surface: a contact says where it is in metres.
    pub(super) fn way_quantity(&self) -> Quantity {
        match self.stream.kind {
            Kind::Contact => Quantity::LENGTH,
            _ => self.stream.quantity,
        }
    }
}
