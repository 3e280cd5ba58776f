//! Messages on standard error, and the display of a live run there.
//!
//! A command that polls ctrl-C does not block on the reader: a thread of its own writes, so that a full pipe
//! or a terminal held with ctrl-S delays no stop.

use super::screen::Screen;
use std::io::Write;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Maximum number of queued messages; further ones are counted and the count is printed.
const MAX_QUEUED: usize = 1024;
/// Time for which a stopped command waits for a blocked reader.
const PATIENCE: Duration = Duration::from_millis(500);
const POLL_PERIOD: Duration = Duration::from_millis(2);

static QUEUE: OnceLock<Queue> = OnceLock::new();

#[derive(Debug)]
struct Queue {
    messages: SyncSender<Message>,
    counts: Arc<Counts>,
    stop: Arc<AtomicBool>,
}

/// A queued message.
#[derive(Debug)]
pub(super) enum Message {
    Text(String),
    /// Lines of the status block at the lower end of the terminal; they replace the previous ones.
    Block(Vec<String>),
    /// The line being typed has changed.
    InputChanged,
    /// Removes the status block.
    RemoveBlock,
}

#[derive(Debug, Default)]
struct Counts {
    taken: AtomicU64,
    written: AtomicU64,
    lost: AtomicU64,
}

/// Prints a message on standard error.
pub(crate) fn eprint(text: &str) {
    match QUEUE.get() {
        Some(queue) => queue.put(Message::Text(text.to_owned())),
        None => write(text),
    }
}

/// Changes the display, if messages are queued.
pub(super) fn display(message: Message) {
    if let Some(queue) = QUEUE.get() {
        queue.put(message);
    }
}

/// Starts the writing thread. From then on messages are queued; [`flush`] waits for them at the end.
pub(super) fn start_queue(stop: &Arc<AtomicBool>) -> std::io::Result<()> {
    let (messages, waiting) = sync_channel(MAX_QUEUED);
    let counts = Arc::new(Counts::default());
    let thread_counts = Arc::clone(&counts);
    std::thread::Builder::new()
        .name("stderr".to_owned())
        .spawn(move || write_all(&waiting, &thread_counts))?;
    let stop = Arc::clone(stop);
    // Tests start several runs in one process; they share the first queue.
    let _ = QUEUE.set(Queue { messages, counts, stop });
    Ok(())
}

/// Waits until all queued messages are written or, after a stop, until the reader is blocked for half a
/// second.
pub(super) fn flush() {
    let Some(Queue { counts, stop, .. }) = QUEUE.get() else {
        return;
    };
    let (mut before, mut since) = (0, Instant::now());
    while let written = counts.written.load(Ordering::Acquire)
        && written < counts.taken.load(Ordering::Acquire)
    {
        if written != before {
            (before, since) = (written, Instant::now());
        } else if stop.load(Ordering::Relaxed) && since.elapsed() > PATIENCE {
            return;
        }
        std::thread::sleep(POLL_PERIOD);
    }
}

impl Queue {
    fn put(&self, message: Message) {
        self.counts.taken.fetch_add(1, Ordering::AcqRel);
        let Err(error) = self.messages.try_send(message) else {
            return;
        };
        self.counts.taken.fetch_sub(1, Ordering::AcqRel);
        match error {
            TrySendError::Full(Message::Text(_)) => {
                self.counts.lost.fetch_add(1, Ordering::AcqRel);
            }
            TrySendError::Disconnected(Message::Text(text)) => write(&text),
            // The display is refreshed soon anyway.
            TrySendError::Full(_) | TrySendError::Disconnected(_) => {}
        }
    }
}

fn write_all(waiting: &Receiver<Message>, counts: &Counts) {
    let mut screen = None;
    for message in waiting {
        write_one(message, &mut screen);
        let lost = counts.lost.swap(0, Ordering::AcqRel);
        if lost > 0 {
            let text = format!("note: {lost} messages were lost because standard error was blocked\n");
            write_one(Message::Text(text), &mut screen);
        }
        counts.written.fetch_add(1, Ordering::AcqRel);
    }
}

fn write_one(message: Message, screen: &mut Option<Screen>) {
    let mut out = std::io::stderr().lock();
    // A failed write to standard error is ignored: nobody reads it.
    let _ = match (message, &mut *screen) {
        (Message::Text(text), None) => out.write_all(text.as_bytes()),
        (Message::Text(text), Some(screen)) => screen.above(&text, &mut out),
        (Message::Block(block), screen) => screen.get_or_insert_default().show(block, &mut out),
        (Message::InputChanged, Some(screen)) => screen.redraw(&mut out),
        (Message::RemoveBlock, Some(shown)) => {
            let closed = shown.close(&mut out);
            *screen = None;
            closed
        }
        (Message::InputChanged | Message::RemoveBlock, None) => Ok(()),
    };
}

/// Prints without the queue, even if it blocks: the program may end right after a panic.
pub(super) fn write(text: &str) {
    // A failed write to standard error is ignored: nobody reads it.
    let _ = std::io::stderr().write_all(text.as_bytes());
}
