//! Connections to the studio's sockets. Until one is a page it has shown no token: their number and their time are bounded.
//! Of all pages one at a time may send a long message, since the messages of a page are held in memory.

use crate::wire::MAX_BYTES;
use axum::extract::connect_info::Connected;
use axum::serve::{IncomingStream, Listener};
use std::collections::VecDeque;
use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};
use tokio::time::{Instant, Sleep, sleep, timeout};

/// Maximum number of connections of a socket that are no pages. One more ends the oldest.
const MAX_VISITS: usize = 64;
/// Maximum time of such a connection until the header of its request is complete, and between two parts of an answer.
const IDLE: Duration = Duration::from_secs(10);
/// Maximum time that a long message takes.
const SENDING: Duration = Duration::from_secs(20);
/// Maximum time for which a long message waits for that of another page, and with it what the page sends after it.
const WAITING: Duration = Duration::from_secs(5);
/// Time between two attempts to accept a connection when the system cannot give one.
const PAUSE: Duration = Duration::from_secs(1);
/// Length beyond which a message is long, bytes: what was read ahead counts.
const LONG_BYTES: usize = 2 * MAX_BYTES;

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// State shared by all sockets of a studio.
#[derive(Debug, Clone)]
pub(super) struct Visits {
    /// The latest reason why no connection can be accepted; `None` once one was.
    pub trouble: Arc<Mutex<Option<String>>>,
    long: Arc<Semaphore>,
}

impl Default for Visits {
    fn default() -> Self {
        Self { trouble: Arc::default(), long: Arc::new(Semaphore::new(1)) }
    }
}

/// A listening socket with its connections that are no pages, the oldest first.
pub(super) struct Reception {
    listener: TcpListener,
    visits: Visits,
    waiting: VecDeque<oneshot::Sender<()>>,
}

impl Reception {
    pub(super) fn of(listener: TcpListener, visits: Visits) -> Self {
        Self { listener, visits, waiting: VecDeque::new() }
    }

    fn admit(&mut self, stream: TcpStream) -> Visit {
        self.waiting.retain(|visit| !visit.is_closed());
        if self.waiting.len() >= MAX_VISITS {
            self.waiting.pop_front();
        }
        let (evict, evicted) = oneshot::channel();
        self.waiting.push_back(evict);
        Visit {
            stream,
            pass: Pass::default(),
            limits: Some(Limits { evicted: Some(evicted), end: Box::pin(sleep(IDLE)) }),
            long: Arc::clone(&self.visits.long),
            turn: None,
        }
    }
}

impl Listener for Reception {
    type Io = Visit;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Visit, SocketAddr) {
        loop {
            let error = match self.listener.accept().await {
                Ok((stream, address)) => {
                    *lock(&self.visits.trouble) = None;
                    return (self.admit(stream), address);
                }
                Err(error) => error,
            };
            // Errors of one connection concern no other.
            if !matches!(
                error.kind(),
                io::ErrorKind::ConnectionAborted
                    | io::ErrorKind::ConnectionRefused
                    | io::ErrorKind::ConnectionReset
            ) {
                *lock(&self.visits.trouble) = Some(error.to_string());
                sleep(PAUSE).await;
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A handle of a connection for the code that answers it.
#[derive(Debug, Clone, Default)]
pub(super) struct Pass(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    is_page: AtomicBool,
    /// The request has shown the token; its answer may take as long as the run does.
    is_known: AtomicBool,
    /// Bytes that were read since the last complete message.
    unheard: AtomicUsize,
    /// The turn of a message that is long.
    turn: Mutex<Option<OwnedSemaphorePermit>>,
}

impl Pass {
    /// Ends the limit of time: who asks has shown the token.
    pub(super) fn know(&self) {
        self.0.is_known.store(true, Relaxed);
    }

    /// Makes the connection a page, which may be idle.
    pub(super) fn let_in(&self) {
        self.0.unheard.store(0, Relaxed);
        self.0.is_page.store(true, Relaxed);
    }

    /// Ends a message; if it was long, no other begins until the returned turn is dropped.
    pub(super) fn heard(&self) -> Option<OwnedSemaphorePermit> {
        self.0.unheard.store(0, Relaxed);
        lock(&self.0.turn).take()
    }
}

impl Connected<IncomingStream<'_, Reception>> for Pass {
    fn connect_info(stream: IncomingStream<'_, Reception>) -> Self {
        stream.io().pass.clone()
    }
}

type Turn = Pin<Box<dyn Future<Output = Option<OwnedSemaphorePermit>> + Send>>;

/// A connection.
pub(super) struct Visit {
    stream: TcpStream,
    pass: Pass,
    /// While it is no page, and during a long message.
    limits: Option<Limits>,
    long: Arc<Semaphore>,
    /// Waits for the turn of a long message.
    turn: Option<Turn>,
}

struct Limits {
    /// Its eviction, while it is no page.
    evicted: Option<oneshot::Receiver<()>>,
    end: Pin<Box<Sleep>>,
}

impl Visit {
    /// An error once the connection has taken too long, or was evicted.
    fn limit(&mut self, cx: &mut Context<'_>) -> io::Result<()> {
        let shared = &self.pass.0;
        if shared.is_page.load(Relaxed) && lock(&shared.turn).is_none() {
            // Its place is free for another.
            self.limits = None;
        }
        let Some(Limits { evicted, end }) = &mut self.limits else {
            return Ok(());
        };
        let is_evicted = evicted.as_mut().is_some_and(|evicted| Pin::new(evicted).poll(cx).is_ready());
        let may_wait = shared.is_known.load(Relaxed) && evicted.is_some();
        match is_evicted || (!may_wait && end.as_mut().poll(cx).is_ready()) {
            true => {
                self.limits = None;
                Err(io::ErrorKind::TimedOut.into())
            }
            false => Ok(()),
        }
    }

    /// Waits before a long message goes on, until no other is held; an error if that takes too long.
    fn wait_for_turn(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let shared = &self.pass.0;
        let is_long = shared.is_page.load(Relaxed) && shared.unheard.load(Relaxed) > LONG_BYTES;
        if !is_long || lock(&shared.turn).is_some() {
            return Poll::Ready(Ok(()));
        }
        let long = &self.long;
        let turn = self.turn.get_or_insert_with(|| {
            let long = Arc::clone(long);
            Box::pin(async move { timeout(WAITING, long.acquire_owned()).await.ok()?.ok() })
        });
        let taken = ready!(turn.as_mut().poll(cx));
        self.turn = None;
        if taken.is_none() {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        *lock(&shared.turn) = taken;
        self.limits = Some(Limits { evicted: None, end: Box::pin(sleep(SENDING)) });
        Poll::Ready(Ok(()))
    }
}

impl AsyncRead for Visit {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        into: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let this = &mut *self;
        ready!(this.wait_for_turn(cx))?;
        let before = into.filled().len();
        let read = Pin::new(&mut this.stream).poll_read(cx, into);
        this.pass.0.unheard.fetch_add(into.filled().len() - before, Relaxed);
        match read.is_pending() {
            true => this.limit(cx).map_or_else(|error| Poll::Ready(Err(error)), |()| Poll::Pending),
            false => read,
        }
    }
}

impl AsyncWrite for Visit {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let this = &mut *self;
        let written = Pin::new(&mut this.stream).poll_write(cx, bytes);
        match (&written, &mut this.limits) {
            (Poll::Pending, _) => {
                this.limit(cx).map_or_else(|error| Poll::Ready(Err(error)), |()| Poll::Pending)
            }
            (_, Some(limits)) if limits.evicted.is_some() => {
                limits.end.as_mut().reset(Instant::now() + IDLE);
                written
            }
            _ => written,
        }
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
