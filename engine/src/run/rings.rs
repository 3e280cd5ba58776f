//! How tapped frames leave the real-time thread: a ring for each tap, and a thread that writes what comes out.

use super::Run;
use super::file_sinks::{WriteError, WrittenFile};
use crate::io::touched_ring;
use crate::node::FrameWriter;
use crate::plan::Plan;
use rtrb::{Consumer, Producer};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// What a ring holds, in seconds of its signal: the writer may be away for so long.
const RING_S: f64 = 1.0;
/// How often the writer looks.
const PAUSE: Duration = Duration::from_millis(5);

/// The real-time ends of the rings, in the order of the plan's taps.
#[derive(Default)]
pub(super) struct TapRings {
    taps: Vec<TapRing>,
    /// Places in the old plan and in this one of the taps that go on after a swap.
    pub kept: Vec<(usize, usize)>,
}

#[derive(Default)]
struct TapRing {
    /// None where it is still with the old plan.
    ring: Option<Producer<f64>>,
    /// Numbers that found no room.
    lost: u64,
}

impl TapRings {
    /// Rings for the taps of a plan for which `wanted` says so; the others will come with a swap.
    pub fn new(plan: &Plan, wanted: impl Fn(usize) -> bool) -> (Self, Vec<Option<Consumer<f64>>>) {
        let (mut taps, mut outs) = (Vec::new(), Vec::new());
        for (place, stream) in plan.tap_streams().enumerate() {
            let (ring, out) = wanted(place)
                .then(|| {
                    // Whole frames, so that none is torn where the ring ends.
                    let frames = (RING_S * stream.rate.hz()).ceil() as usize + plan.block();
                    touched_ring(frames * stream.kind.width())
                })
                .unzip();
            taps.push(TapRing { ring, lost: 0 });
            outs.push(out);
        }
        let kept = Vec::new();
        (Self { taps, kept }, outs)
    }

    /// Sends the frames of the block that was run last. A block that finds no room is lost and counted.
    pub fn send(&mut self, run: &Run) {
        for (place, tap) in self.taps.iter_mut().enumerate() {
            let frames = run.tap(place);
            let Some(ring) = &mut tap.ring else { continue };
            if ring.push_entire_slice(frames).is_err() {
                tap.lost += frames.len() as u64;
            }
        }
    }

    /// Changes places with the rings of the old plan; what goes on goes on.
    pub fn take_over(&mut self, running: &mut Self) {
        for (from, to) in &self.kept {
            std::mem::swap(&mut running.taps[*from], &mut self.taps[*to]);
        }
        std::mem::swap(self, running);
    }

    /// Numbers that found no room.
    pub fn lost(&self) -> u64 {
        self.taps.iter().map(|tap| tap.lost).sum()
    }
}

/// The thread that writes files, beside the real-time threads; there is none while there is nothing to write.
#[derive(Default)]
pub(super) struct WriterThread {
    running: Option<RunningWriter>,
    /// What there was no thread for.
    failed: Vec<WriteError>,
}

struct RunningWriter {
    jobs: Sender<Job>,
    thread: JoinHandle<Vec<WriteError>>,
    failing: Receiver<String>,
}

/// A writer and the rings of its streams; it is finished when they have been let go of.
struct Job {
    writer: Option<Box<dyn FrameWriter>>,
    what: PathBuf,
    rings: Vec<Consumer<f64>>,
    failed: Option<WriteError>,
}

impl RunningWriter {
    fn start() -> std::io::Result<Self> {
        let (jobs, receiver) = channel();
        let (failed, failing) = channel();
        let thread = std::thread::Builder::new().name("haptograph-files".into());
        let thread = thread.spawn(move || write_all(&receiver, &failed))?;
        Ok(Self {
            jobs,
            thread,
            failing,
        })
    }
}

impl WriterThread {
    /// Starts it before there is anything to write.
    ///
    /// # Errors
    /// What the system says where it gives no thread.
    pub fn start(&mut self) -> std::io::Result<()> {
        if self.running.is_none() {
            self.running = Some(RunningWriter::start()?);
        }
        Ok(())
    }

    /// The files that could not be written on since this was asked last, each with the reason.
    pub fn failing(&self) -> impl Iterator<Item = String> {
        self.running.iter().flat_map(|running| running.failing.try_iter())
    }

    /// Also writes this.
    pub fn add(&mut self, written: WrittenFile, rings: Vec<Consumer<f64>>) {
        let path = written.what.clone();
        if let Err(error) = self.start() {
            return self.failed.push(WriteError { path, error });
        }
        if let Some(running) = &self.running {
            // It only stops listening when this end is dropped.
            let _ = running.jobs.send(Job {
                writer: written.writer,
                what: written.what,
                rings,
                failed: None,
            });
        }
    }

    /// Waits until everything is written. The real-time ends of all rings have to be gone.
    pub fn finish(mut self) -> Vec<WriteError> {
        let Some(RunningWriter { jobs, thread, .. }) = self.running else {
            return self.failed;
        };
        drop(jobs);
        let written = thread.join().unwrap_or_else(|_| {
            let error = std::io::Error::other("the thread that writes files panicked");
            vec![WriteError {
                path: PathBuf::from("the files of the run"),
                error,
            }]
        });
        self.failed.extend(written);
        self.failed
    }
}

fn write_all(jobs: &Receiver<Job>, failing: &Sender<String>) -> Vec<WriteError> {
    let (mut open, mut failed, mut more) = (Vec::new(), Vec::new(), true);
    while more || !open.is_empty() {
        loop {
            match jobs.try_recv() {
                Ok(job) => open.push(job),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => {
                    more = false;
                    break;
                }
            }
        }
        open.retain_mut(|job: &mut Job| {
            // Asked first: what is pushed before a ring is let go of is then seen.
            let ended = job.rings.iter().all(Consumer::is_abandoned);
            let failed_before = job.failed.is_some();
            job.drain();
            if let (false, Some(error)) = (failed_before, &job.failed) {
                // Nobody may listen any more.
                let _ = failing.send(error.to_string());
            }
            if ended {
                failed.extend(job.finish());
            }
            !ended
        });
        std::thread::sleep(PAUSE);
    }
    failed
}

impl Job {
    fn drain(&mut self) {
        for (stream, ring) in self.rings.iter_mut().enumerate() {
            let Ok(chunk) = ring.read_chunk(ring.slots()) else {
                continue;
            };
            let (first, second) = chunk.as_slices();
            if let Some(writer) = &mut self.writer {
                let result = writer
                    .write(stream, first)
                    .and_then(|()| writer.write(stream, second));
                if let Err(error) = result {
                    let path = self.what.clone();
                    self.failed = Some(WriteError { path, error });
                    self.writer = None;
                }
            }
            chunk.commit_all();
        }
    }

    fn finish(&mut self) -> Option<WriteError> {
        let Some(writer) = self.writer.take() else {
            return self.failed.take();
        };
        let path = self.what.clone();
        writer.finish().err().map(|error| WriteError { path, error })
    }
}
