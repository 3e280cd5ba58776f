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
const MOST_WAITING: usize = 1024;
/// How long a stopped command waits for a blocked reader.
const PATIENCE: Duration = Duration::from_millis(500);
const LOOK: Duration = Duration::from_millis(2);

static QUEUE: OnceLock<Queue> = OnceLock::new();

#[derive(Debug)]
struct Queue {
    remarks: SyncSender<Said>,
    counts: Arc<Counts>,
    stop: Arc<AtomicBool>,
}

/// A queued message.
#[derive(Debug)]
enum Said {
    Text(String),
    /// Lines of the status block at the lower end of the terminal; they replace the previous ones.
    Block(Vec<String>),
    /// The line being typed has changed.
    Typed,
    /// Removes the status block.
    Close,
}

#[derive(Debug, Default)]
struct Counts {
    taken: AtomicU64,
    written: AtomicU64,
    lost: AtomicU64,
}

/// Prints a message on standard error.
pub fn remark(text: &str) {
    match QUEUE.get() {
        Some(queue) => queue.put(Said::Text(text.to_owned())),
        None => write(text),
    }
}

/// Displays lines at the lower end of the terminal, in place of the previous ones.
pub fn show(block: Vec<String>) {
    put(Said::Block(block));
}

/// Redraws the line being typed.
pub fn typed() {
    put(Said::Typed);
}

/// Removes the lines at the lower end of the terminal.
pub fn close() {
    put(Said::Close);
}

fn put(said: Said) {
    if let Some(queue) = QUEUE.get() {
        queue.put(said);
    }
}

/// Prints without the queue, even if it blocks: the program may end right after a panic.
pub fn at_once(text: &str) {
    write(text);
}

/// Starts the writing thread. From then on messages are queued; [`settle`] waits for them at the end.
pub fn queue(stop: &Arc<AtomicBool>) -> std::io::Result<()> {
    let (remarks, waiting) = sync_channel(MOST_WAITING);
    let counts = Arc::new(Counts::default());
    let theirs = Arc::clone(&counts);
    std::thread::Builder::new()
        .name("remarks".to_owned())
        .spawn(move || write_all(&waiting, &theirs))?;
    let stop = Arc::clone(stop);
    // Tests start several runs in one process; they share the first queue.
    let _ = QUEUE.set(Queue {
        remarks,
        counts,
        stop,
    });
    Ok(())
}

/// Waits until all queued messages are written or, after a stop, until the reader is blocked for half a
/// second.
pub fn settle() {
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
        std::thread::sleep(LOOK);
    }
}

impl Queue {
    fn put(&self, said: Said) {
        self.counts.taken.fetch_add(1, Ordering::AcqRel);
        let Err(error) = self.remarks.try_send(said) else {
            return;
        };
        self.counts.taken.fetch_sub(1, Ordering::AcqRel);
        match error {
            TrySendError::Full(Said::Text(_)) => {
                self.counts.lost.fetch_add(1, Ordering::AcqRel);
            }
            TrySendError::Disconnected(Said::Text(text)) => write(&text),
            // The display is refreshed soon anyway.
            TrySendError::Full(_) | TrySendError::Disconnected(_) => {}
        }
    }
}

fn write_all(waiting: &Receiver<Said>, counts: &Counts) {
    let mut screen = None;
    for said in waiting {
        write_one(said, &mut screen);
        let lost = counts.lost.swap(0, Ordering::AcqRel);
        if lost > 0 {
            let text = format!("note: {lost} messages were lost because standard error was blocked\n");
            write_one(Said::Text(text), &mut screen);
        }
        counts.written.fetch_add(1, Ordering::AcqRel);
    }
}

fn write_one(said: Said, screen: &mut Option<Screen>) {
    let mut out = std::io::stderr().lock();
    // A failed write to standard error is ignored: nobody reads it.
    let _ = match (said, &mut *screen) {
        (Said::Text(text), None) => out.write_all(text.as_bytes()),
        (Said::Text(text), Some(screen)) => screen.above(&text, &mut out),
        (Said::Block(block), screen) => screen.get_or_insert_default().show(block, &mut out),
        (Said::Typed, Some(screen)) => screen.redraw(&mut out),
        (Said::Close, Some(shown)) => {
            let closed = shown.close(&mut out);
            *screen = None;
            closed
        }
        (Said::Typed | Said::Close, None) => Ok(()),
    };
}

fn write(text: &str) {
    // A failed write to standard error is ignored: nobody reads it.
    let _ = std::io::stderr().write_all(text.as_bytes());
}
