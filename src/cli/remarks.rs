//! What is said on standard error.
//!
//! A command that hears ctrl-C waits for no reader of it: a thread of its own writes, so that a full pipe or a terminal
//! that was held with ctrl-S holds up no stop.

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
    remarks: SyncSender<String>,
    counts: Arc<Counts>,
    stop: Arc<AtomicBool>,
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
        Some(queue) => queue.put(text),
        None => write(text),
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
    fn put(&self, text: &str) {
        self.counts.taken.fetch_add(1, Ordering::AcqRel);
        match self.remarks.try_send(text.to_owned()) {
            Ok(()) => {}
            Err(TrySendError::Full(_)) => {
                self.counts.taken.fetch_sub(1, Ordering::AcqRel);
                self.counts.lost.fetch_add(1, Ordering::AcqRel);
            }
            Err(TrySendError::Disconnected(text)) => {
                self.counts.taken.fetch_sub(1, Ordering::AcqRel);
                write(&text);
            }
        }
    }
}

fn write_all(waiting: &Receiver<String>, counts: &Counts) {
    for text in waiting {
        write(&text);
        let lost = counts.lost.swap(0, Ordering::AcqRel);
        if lost > 0 {
            write(&format!(
                "note: {lost} more messages are lost, as standard error was not read\n"
            ));
        }
        counts.written.fetch_add(1, Ordering::AcqRel);
    }
}

fn write(text: &str) {
    // A remark that nobody can read is no reason to stop.
    let _ = std::io::stderr().write_all(text.as_bytes());
}
