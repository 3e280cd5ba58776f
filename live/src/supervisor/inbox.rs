//! The queue of requests of a live run.

use super::Request;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

/// Maximum number of queued requests.
pub const MAX_QUEUED: usize = 1024;

#[derive(Debug)]
enum Message {
    Request(Ordered<Request>),
    /// Only ends a wait.
    Wake,
}

/// A request with its position among all requests, from every route.
#[derive(Debug, Clone)]
pub(super) struct Ordered<T> {
    pub order: u64,
    pub asked: T,
}

/// Sends requests to a live run from any thread, and ends the wait of its supervisor.
#[derive(Debug, Clone)]
pub struct RequestSender {
    messages: SyncSender<Message>,
    /// The order of the latest request.
    latest: Arc<AtomicU64>,
}

/// Reason why a request was not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SendError {
    /// The queue is full.
    #[error("{MAX_QUEUED} requests are waiting")]
    Full,
    /// The run has ended.
    #[error("the run has ended")]
    Ended,
}

impl RequestSender {
    /// Queues a request. It blocks while the queue is full.
    ///
    /// # Errors
    /// [`SendError::Ended`].
    pub fn send(&self, request: Request) -> Result<(), SendError> {
        let sent = self.messages.send(Message::Request(self.ordered(request)));
        sent.map_err(|_| SendError::Ended)
    }

    /// Queues a request, unless the queue is full.
    ///
    /// # Errors
    /// [`SendError`]; the request is dropped.
    pub fn try_send(&self, request: Request) -> Result<(), SendError> {
        self.try_put(Message::Request(self.ordered(request)))
    }

    /// Gives a request its position after all earlier requests.
    pub(super) fn ordered<T>(&self, asked: T) -> Ordered<T> {
        let order = self.latest.fetch_add(1, Relaxed) + 1;
        Ordered { order, asked }
    }

    /// Ends the present or the next [`wait`](super::Supervisor::wait), for work that arrives by another route.
    pub fn wake(&self) {
        // A full queue ends the wait as well, and a run that has ended does not wait.
        let _ = self.try_put(Message::Wake);
    }

    fn try_put(&self, message: Message) -> Result<(), SendError> {
        self.messages.try_send(message).map_err(|error| match error {
            TrySendError::Full(_) => SendError::Full,
            TrySendError::Disconnected(_) => SendError::Ended,
        })
    }
}

/// The receiving end.
pub(super) struct Inbox {
    messages: Receiver<Message>,
    sender: RequestSender,
}

impl Inbox {
    pub(super) fn new() -> Self {
        let (sender, messages) = sync_channel(MAX_QUEUED);
        Self { messages, sender: RequestSender { messages: sender, latest: Arc::default() } }
    }

    /// A sender to this queue.
    pub(super) fn sender(&self) -> &RequestSender {
        &self.sender
    }

    /// Waits for a message; returns its request.
    pub(super) fn wait(&self, longest: Duration) -> Option<Ordered<Request>> {
        match self.messages.recv_timeout(longest) {
            Ok(Message::Request(request)) => Some(request),
            Ok(Message::Wake) | Err(_) => None,
        }
    }

    /// The requests among at most `room` waiting messages.
    pub(super) fn take(&self, room: usize) -> Vec<Ordered<Request>> {
        let messages = self.messages.try_iter().take(room);
        let request = |message| match message {
            Message::Request(request) => Some(request),
            Message::Wake => None,
        };
        messages.filter_map(request).collect()
    }
}
