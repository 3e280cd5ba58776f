//! Untyped handles, whose kind of frame is checked at run time: the base of typed handles and of language bindings.

use super::handles::{Full, HostError};
use super::queue::{Due, Queue};
use crate::frame::Kind;
use crate::node::Stream;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::Rate;
use rtrb::Consumer;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Largest width of a channel that is lent.
const MAX_WIDTH: usize = 6;

/// Handle of a channel that nodes read, of any kind.
#[derive(Debug)]
pub struct AnyInput {
    about: About,
    queue: ClaimedQueue,
}

/// Handle of a channel that nodes drive, or of a probe, of any kind.
#[derive(Debug)]
pub struct AnyOutput {
    about: About,
    from: From,
}

/// Description of a channel.
#[derive(Debug)]
pub(super) struct About {
    pub name: String,
    pub kind: Kind,
    pub quantity: Quantity,
    pub rate: Rate,
}

#[derive(Debug)]
enum From {
    Queue(ClaimedQueue),
    Ring(Consumer<f64>),
}

/// A queue claimed by a handle.
#[derive(Debug)]
struct ClaimedQueue(Arc<Queue>);

impl ClaimedQueue {
    fn of(about: &About, queue: &Arc<Queue>) -> Result<Self, HostError> {
        if queue.held.swap(true, Ordering::AcqRel) {
            let name = about.name.clone();
            return Err(HostError::Taken { name });
        }
        Ok(Self(Arc::clone(queue)))
    }
}

impl Drop for ClaimedQueue {
    fn drop(&mut self) {
        self.0.held.store(false, Ordering::Release);
    }
}

impl About {
    pub(super) fn expect(&self, asked: Kind) -> Result<(), HostError> {
        let (name, kind) = (self.name.clone(), self.kind);
        match kind == asked {
            true => Ok(()),
            false => Err(HostError::Kind { name, kind, asked }),
        }
    }
}

impl AnyInput {
    pub(super) fn new(about: About, queue: &Arc<Queue>) -> Result<Self, HostError> {
        let queue = ClaimedQueue::of(&about, queue)?;
        Ok(Self { about, queue })
    }

    /// Sets the value of the channel from the next tick on. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] if it cannot be queued.
    pub fn set(&mut self, components: &[f64]) -> Result<(), Full> {
        self.put(Due::Now, components)
    }

    /// Sets the value from `seconds` of the run on. Call it in the order of times. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] if it cannot be queued.
    pub fn set_at(&mut self, seconds: f64, components: &[f64]) -> Result<(), Full> {
        self.put(self.due_at(seconds)?, components)
    }

    fn due_at(&self, seconds: f64) -> Result<Due, Full> {
        if !seconds.is_finite() {
            return Err(Full::NotFinite);
        }
        // A time on a tick belongs to that tick, despite rounding.
        let tick = (seconds.max(0.0) * self.about.rate.hz() - 1e-6).ceil().max(0.0);
        Ok(Due::Tick(tick as u64))
    }

    /// Gives a channel of a [lent](crate::graph::CheckOptions::lent) endpoint back to its device, from `seconds` of the run
    /// on. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] if it cannot be queued.
    pub fn release_at(&mut self, seconds: f64) -> Result<(), Full> {
        let components = [f64::NAN; MAX_WIDTH];
        self.put_checked(self.due_at(seconds)?, &components[..self.about.kind.width().min(MAX_WIDTH)])
    }

    /// Queues the frame of the next tick that has none yet. Real-time safe.
    ///
    /// # Errors
    /// [`Full`] if it cannot be queued.
    pub fn push(&mut self, components: &[f64]) -> Result<(), Full> {
        self.put(Due::Next, components)
    }

    fn put(&mut self, due: Due, components: &[f64]) -> Result<(), Full> {
        if components.len() != self.about.kind.width() {
            return Err(Full::Shape);
        }
        if !components.iter().all(|component| component.is_finite()) {
            return Err(Full::NotFinite);
        }
        self.put_checked(due, components)
    }

    fn put_checked(&mut self, due: Due, components: &[f64]) -> Result<(), Full> {
        match self.queue.0.put(due, components) {
            true => Ok(()),
            false => Err(Full::Full),
        }
    }

    /// Number of frames that wait for their tick.
    pub fn waiting(&self) -> usize {
        self.queue.0.len()
    }

    /// Kind of its frames.
    pub fn kind(&self) -> Kind {
        self.about.kind
    }

    /// Rate of the channel's ticks.
    pub fn rate(&self) -> Rate {
        self.about.rate
    }

    /// Quantity of the components.
    pub fn quantity(&self) -> Quantity {
        self.about.quantity
    }

    /// Name of endpoint and channel.
    pub fn name(&self) -> &str {
        &self.about.name
    }
}

impl AnyOutput {
    /// Makes the handle of a queue and drops the frames of an earlier handle.
    pub(super) fn of_queue(about: About, queue: &Arc<Queue>) -> Result<Self, HostError> {
        let from = From::Queue(ClaimedQueue::of(&about, queue)?);
        while queue.take_if(|_| true, &mut []).is_some() {}
        Ok(Self { about, from })
    }

    pub(super) fn of_ring(name: &str, stream: &Stream, ring: Consumer<f64>) -> Self {
        let about =
            About { name: name.to_owned(), kind: stream.kind, quantity: stream.quantity, rate: stream.rate };
        let from = From::Ring(ring);
        Self { about, from }
    }

    /// Fills `components` with the oldest unread frame. Returns whether there was one. Real-time safe.
    pub fn take(&mut self, components: &mut [f64]) -> bool {
        if components.len() != self.about.kind.width() {
            return false;
        }
        match &mut self.from {
            From::Queue(queue) => queue.0.take_if(|_| true, components).is_some(),
            // The ring has whole frames only.
            From::Ring(ring) => ring.pop_entire_slice(components).is_ok(),
        }
    }

    /// Number of unread frames. Frames beyond a second are lost.
    pub fn waiting(&self) -> usize {
        match &self.from {
            From::Queue(queue) => queue.0.len(),
            From::Ring(ring) => ring.slots() / self.about.kind.width(),
        }
    }

    /// Kind of its frames.
    pub fn kind(&self) -> Kind {
        self.about.kind
    }

    /// Rate of its frames.
    pub fn rate(&self) -> Rate {
        self.about.rate
    }

    /// Quantity of the components.
    pub fn quantity(&self) -> Quantity {
        self.about.quantity
    }

    /// Name of endpoint and channel, or of the probed output.
    pub fn name(&self) -> &str {
        &self.about.name
    }
}
