//! What is said on standard error, and what is shown there of a run that goes on.
//!
//! A command that hears ctrl-C waits for no reader of it: a thread of its own writes, so that a full pipe or a terminal
//! that was held with ctrl-S holds up no stop.

use super::screen::Screen;
use std::io::Write;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Remarks that wait; those that find no room are counted, and that is said.
const MOST_WAITING: usize = 1024;
/// How long a command that was told to stop waits for a reader who takes nothing.
const PATIENCE: Duration = Duration::from_millis(500);
const LOOK: Duration = Duration::from_millis(2);

static QUEUE: OnceLock<Queue> = OnceLock::new();

#[derive(Debug)]
struct Queue {
    remarks: SyncSender<Said>,
    counts: Arc<Counts>,
    stop: Arc<AtomicBool>,
}

/// What waits to be written.
#[derive(Debug)]
enum Said {
    Text(String),
    /// Lines that stay at the lower end of the terminal, in place of those before.
    Block(Vec<String>),
    /// What is typed has changed.
    Typed,
    /// Nothing stays there any more.
    Close,
}

#[derive(Debug, Default)]
struct Counts {
    taken: AtomicU64,
    written: AtomicU64,
    lost: AtomicU64,
}

/// Says something on standard error that is no failure.
pub fn remark(text: &str) {
    match QUEUE.get() {
        Some(queue) => queue.put(Said::Text(text.to_owned())),
        None => write(text),
    }
}

/// Shows lines at the lower end of the terminal, in place of those before.
pub fn show(block: Vec<String>) {
    put(Said::Block(block));
}

/// Shows what is typed now.
pub fn typed() {
    put(Said::Typed);
}

/// Takes away what is shown at the lower end of the terminal.
pub fn close() {
    put(Said::Close);
}

fn put(said: Said) {
    if let Some(queue) = QUEUE.get() {
        queue.put(said);
    }
}

/// Says it before anything else happens, whoever waits: what panics is said before the program ends.
pub fn at_once(text: &str) {
    write(text);
}

/// From now on no remark waits for its reader; at the end they do, until `stop` is set.
pub fn queue(stop: &Arc<AtomicBool>) -> std::io::Result<()> {
    let (remarks, waiting) = sync_channel(MOST_WAITING);
    let counts = Arc::new(Counts::default());
    let theirs = Arc::clone(&counts);
    std::thread::Builder::new()
        .name("remarks".to_owned())
        .spawn(move || write_all(&waiting, &theirs))?;
    let stop = Arc::clone(stop);
    // Tests of one process begin several runs: the first queue is as good.
    let _ = QUEUE.set(Queue {
        remarks,
        counts,
        stop,
    });
    Ok(())
}

/// Waits until all remarks are written, or after a stop until nobody takes them.
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
            // What is shown is soon shown again.
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
            let text = format!("note: {lost} more messages are lost, as standard error was not read\n");
            write_one(Said::Text(text), &mut screen);
        }
        counts.written.fetch_add(1, Ordering::AcqRel);
    }
}

fn write_one(said: Said, screen: &mut Option<Screen>) {
    let mut out = std::io::stderr().lock();
    // A remark that nobody can read is no reason to stop.
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
    // A remark that nobody can read is no reason to stop.
    let _ = std::io::stderr().write_all(text.as_bytes());
}
