//! A bounded queue of frames between two threads, without locks or waiting.

use std::ops::Deref;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// A part of an endpoint that its handles share with the copy that runs. All copies of an endpoint have one cell for it, which
/// [`join`](Self::join) changes; a copy keeps what it found there when it was made, so that running it takes no lock.
#[derive(Debug)]
pub(super) struct Shared<T> {
    own: Arc<T>,
    cell: Arc<Mutex<Arc<T>>>,
}

impl<T> Shared<T> {
    pub(super) fn new(part: T) -> Self {
        let own = Arc::new(part);
        Self { cell: Arc::new(Mutex::new(Arc::clone(&own))), own }
    }

    /// What handles and copies made from now on have.
    pub(super) fn get(&self) -> Arc<T> {
        Arc::clone(&self.cell.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Gives handles and copies made from now on the part of another endpoint.
    pub(super) fn join(&self, part: Arc<T>) {
        *self.cell.lock().unwrap_or_else(PoisonError::into_inner) = part;
    }
}

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        Self { own: self.get(), cell: Arc::clone(&self.cell) }
    }
}

impl<T> Deref for Shared<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.own
    }
}

/// Time at which a queued frame takes effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Due {
    /// At the next tick, with all other frames that are due then.
    Now,
    /// At the next tick that has no frame yet.
    Next,
    /// At this tick or the first one after it.
    Tick(u64),
}

impl Due {
    fn to_bits(self) -> u64 {
        match self {
            Self::Now => 0,
            Self::Next => u64::MAX,
            Self::Tick(tick) => tick.saturating_add(1).min(u64::MAX - 1),
        }
    }

    fn from_bits(bits: u64) -> Self {
        match bits {
            0 => Self::Now,
            u64::MAX => Self::Next,
            tick => Self::Tick(tick - 1),
        }
    }
}

/// A bounded queue of frames of `width` components between two threads.
///
/// Only the producer increments `put` and only the consumer increments `taken`. The words of a frame are written before
/// `put` covers them, and not overwritten before `taken` does.
#[derive(Debug)]
pub(super) struct Queue {
    width: usize,
    /// For each frame its due time, then its components.
    words: Box<[AtomicU64]>,
    put: AtomicU64,
    taken: AtomicU64,
    /// True if a handle has claimed the caller's end.
    pub held: AtomicBool,
}

impl Queue {
    pub(super) fn new(width: usize, frames: usize) -> Self {
        let words = (0..frames * (width + 1)).map(|_| AtomicU64::new(0)).collect();
        Self { width, words, put: AtomicU64::new(0), taken: AtomicU64::new(0), held: AtomicBool::new(false) }
    }

    pub(super) fn capacity(&self) -> usize {
        self.words.len() / (self.width + 1)
    }

    pub(super) fn is_held(&self) -> bool {
        self.held.load(Ordering::Acquire)
    }

    pub(super) fn len(&self) -> usize {
        let taken = self.taken.load(Ordering::Acquire);
        (self.put.load(Ordering::Acquire) - taken) as usize
    }

    fn place(&self, number: u64) -> &[AtomicU64] {
        let at = (number % self.capacity() as u64) as usize * (self.width + 1);
        &self.words[at..at + self.width + 1]
    }

    /// Adds a frame, if there is room. Only the producer calls it.
    pub(super) fn put(&self, due: Due, components: &[f64]) -> bool {
        let number = self.put.load(Ordering::Relaxed);
        if number - self.taken.load(Ordering::Acquire) >= self.capacity() as u64 {
            return false;
        }
        if let [stamp, words @ ..] = self.place(number) {
            stamp.store(due.to_bits(), Ordering::Relaxed);
            for (word, component) in words.iter().zip(components) {
                word.store(component.to_bits(), Ordering::Relaxed);
            }
        }
        self.put.store(number + 1, Ordering::Release);
        true
    }

    /// Takes the oldest frame if `wanted` holds for its due time. Only the consumer calls it.
    pub(super) fn take_if(&self, wanted: impl FnOnce(Due) -> bool, components: &mut [f64]) -> Option<Due> {
        let number = self.taken.load(Ordering::Relaxed);
        if number == self.put.load(Ordering::Acquire) {
            return None;
        }
        let [stamp, words @ ..] = self.place(number) else {
            return None;
        };
        let due = Due::from_bits(stamp.load(Ordering::Relaxed));
        if !wanted(due) {
            return None;
        }
        for (component, word) in components.iter_mut().zip(words) {
            *component = f64::from_bits(word.load(Ordering::Relaxed));
        }
        self.taken.store(number + 1, Ordering::Release);
        Some(due)
    }

    /// Takes all frames that are due at a tick into `components`, which keeps the last. Returns whether there was one.
    pub(super) fn take_due(&self, tick: u64, components: &mut [f64]) -> bool {
        let mut came = false;
        let is_due = |due| match due {
            Due::Now | Due::Next => true,
            Due::Tick(at) => at <= tick,
        };
        while let Some(due) = self.take_if(is_due, components) {
            came = true;
            if due == Due::Next {
                break;
            }
        }
        came
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn frames_arrive_whole_and_in_order_and_what_found_no_room_was_refused() {
        let queue = Arc::new(Queue::new(3, 16));
        let putter = Arc::clone(&queue);
        let putting = std::thread::spawn(move || {
            (0..20_000).filter(|k| putter.put(Due::Next, &[f64::from(*k); 3])).count()
        });
        let (mut got, mut last) = (0, -1.0);
        loop {
            let done = putting.is_finished();
            let mut components = [0.0; 3];
            if queue.take_if(|_| true, &mut components).is_none() {
                if done {
                    break;
                }
                continue;
            }
            assert!(components[0] > last && components == [components[0]; 3], "{components:?} after {last}");
            (last, got) = (components[0], got + 1);
        }
        assert_eq!(putting.join().expect("puts"), got);
    }

    #[test]
    fn a_tick_takes_all_that_was_set_and_one_that_was_pushed() {
        let queue = Queue::new(1, 8);
        let mut component = [0.0];
        for k in 1..=3 {
            queue.put(Due::Now, &[f64::from(k)]);
        }
        assert!(queue.take_due(0, &mut component) && component == [3.0] && queue.len() == 0);
        queue.put(Due::Next, &[4.0]);
        queue.put(Due::Next, &[5.0]);
        assert!(queue.take_due(1, &mut component) && component == [4.0]);
        assert!(queue.take_due(2, &mut component) && component == [5.0]);
        assert!(!queue.take_due(3, &mut component) && component == [5.0]);
        queue.put(Due::Tick(5), &[6.0]);
        queue.put(Due::Tick(6), &[7.0]);
        assert!(!queue.take_due(4, &mut component));
        assert!(queue.take_due(7, &mut component) && component == [7.0]);
    }
}
