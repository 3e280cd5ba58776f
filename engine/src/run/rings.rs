//! Tap rings carry tapped frames from the real-time half to the writer of the files.

use super::Run;
use super::file_sinks::{FileSinks, WriteError, WrittenFile};
use crate::io::touched_ring;
use crate::node::FrameWriter;
use crate::plan::Plan;
use rtrb::{Consumer, Producer};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Capacity of a ring, s: the writer thread may stall for so long.
const RING_S: f64 = 1.0;
/// Interval at which the writer thread polls the rings.
const PAUSE: Duration = Duration::from_millis(5);

/// The real-time ends of the rings, in the order of the plan's taps.
#[derive(Default)]
pub(super) struct TapRings {
    taps: Vec<TapRing>,
    /// (old, new) index of the taps that continue after a swap.
    pub kept: Vec<(usize, usize)>,
}

#[derive(Default)]
struct TapRing {
    /// `None` while the old plan has it.
    ring: Option<Producer<f64>>,
    /// True if a full ring is waited for.
    waits: bool,
    /// Numbers lost because the ring was full.
    lost: u64,
}

impl TapRings {
    /// Makes rings for the taps of a plan, except `kept` ones of the old plan, which a swap brings. Puts their read ends into
    /// `outs` by tap index.
    pub(super) fn new(
        plan: &Plan,
        (writer, sinks): (&Writer, &FileSinks<'_>),
        kept: Vec<(usize, usize)>,
        outs: &mut [Option<Consumer<f64>>],
    ) -> Self {
        let (mut taps, waits) = (Vec::new(), matches!(writer, Writer::Thread(.., true)));
        for (place, (stream, tap)) in plan.tap_streams().zip(&plan.tap_places).enumerate() {
            let wanted = kept.iter().all(|(_, new)| *new != place);
            let ring = wanted.then(|| {
                // A multiple of the frame size: a frame never wraps around.
                let block_s = plan.block() as f64 / plan.driver_rate().hz();
                let frames = ((writer.ring_s() + block_s) * stream.rate.hz()).ceil() as usize + 1;
                let (ring, out) = touched_ring(frames * stream.kind.width());
                outs[*tap] = Some(out);
                ring
            });
            taps.push(TapRing { ring, waits: waits && sinks.is_written(*tap), lost: 0 });
        }
        Self { taps, kept }
    }

    /// Pushes the frames of the last block. A block that does not fit is waited for, or lost and counted.
    pub(super) fn send(&mut self, run: &Run) {
        for (place, tap) in self.taps.iter_mut().enumerate() {
            let frames = run.tap(place);
            let Some(ring) = &mut tap.ring else { continue };
            while ring.push_entire_slice(frames).is_err() {
                if !tap.waits || ring.is_abandoned() {
                    tap.lost += frames.len() as u64;
                    break;
                }
                std::thread::sleep(PAUSE);
            }
        }
    }

    /// Swaps with the rings of the old plan; rings of taps that continue are moved.
    pub(super) fn take_over(&mut self, running: &mut Self) {
        for (from, to) in &self.kept {
            std::mem::swap(&mut running.taps[*from], &mut self.taps[*to]);
        }
        std::mem::swap(self, running);
    }

    /// Numbers lost because a ring was full.
    pub(super) fn lost(&self) -> u64 {
        self.taps.iter().map(|tap| tap.lost).sum()
    }
}

/// The writer of a session's files.
pub(super) enum Writer {
    /// A thread, which starts with the first file, the files for which none could be started, and whether the run waits for
    /// it.
    Thread(Option<RunningWriter>, Vec<WriteError>, bool),
    /// The caller, after every block.
    Caller(Vec<Job>),
}

pub(super) struct RunningWriter {
    jobs: Sender<Job>,
    thread: JoinHandle<Vec<WriteError>>,
    failing: Receiver<String>,
}

/// A writer and the rings of its streams. It is finished when the write ends of all rings are dropped.
pub(super) struct Job {
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
        Ok(Self { jobs, thread, failing })
    }
}

impl Writer {
    /// A thread writes; `is_waited_for`: where it is too slow, the run waits and loses nothing.
    pub(super) fn of_a_thread(is_waited_for: bool) -> Self {
        Self::Thread(None, Vec::new(), is_waited_for)
    }

    /// The caller writes.
    pub(super) fn of_the_caller() -> Self {
        Self::Caller(Vec::new())
    }

    /// Capacity of the rings of its files, s.
    fn ring_s(&self) -> f64 {
        match self {
            Self::Thread(..) => RING_S,
            Self::Caller(_) => 0.0,
        }
    }

    /// Starts the thread, if there is one and it does not run.
    ///
    /// # Errors
    /// System errors if no thread can be started.
    pub(super) fn start(&mut self) -> std::io::Result<()> {
        if let Self::Thread(running @ None, ..) = self {
            *running = Some(RunningWriter::start()?);
        }
        Ok(())
    }

    /// Messages about files that failed since the last call.
    pub(super) fn failing(&self) -> impl Iterator<Item = String> {
        let running = match self {
            Self::Thread(running, ..) => running.as_ref(),
            Self::Caller(_) => None,
        };
        running.into_iter().flat_map(|running| running.failing.try_iter())
    }

    /// Adds a file.
    pub(super) fn add(&mut self, written: WrittenFile, rings: Vec<Consumer<f64>>) {
        let started = self.start();
        let job = Job { writer: written.writer, what: written.what, rings, failed: None };
        match (self, started) {
            (Self::Caller(jobs), _) => jobs.push(job),
            (Self::Thread(_, failed, _), Err(error)) => failed.push(WriteError { path: job.what, error }),
            (Self::Thread(running, ..), Ok(())) => {
                // Cannot fail: the thread receives until this end is dropped.
                if let Some(running) = running {
                    let _ = running.jobs.send(job);
                }
            }
        }
    }

    /// Writes what the rings hold, if the caller writes.
    pub(super) fn write_block(&mut self) {
        if let Self::Caller(jobs) = self {
            jobs.iter_mut().for_each(Job::drain);
        }
    }

    /// True unless a file that the caller writes has failed.
    pub(super) fn writes(&self) -> bool {
        match self {
            Self::Thread(..) => true,
            Self::Caller(jobs) => jobs.iter().all(|job| job.failed.is_none()),
        }
    }

    /// Waits until everything is written. The write ends of all rings must be dropped before.
    pub(super) fn finish(self) -> Vec<WriteError> {
        match self {
            Self::Caller(mut jobs) => jobs.iter_mut().filter_map(Job::finish).collect(),
            Self::Thread(None, failed, _) => failed,
            Self::Thread(Some(RunningWriter { jobs, thread, .. }), mut failed, _) => {
                drop(jobs);
                let written = thread.join().unwrap_or_else(|_| {
                    let error = std::io::Error::other("the thread that writes files panicked");
                    vec![WriteError { path: PathBuf::from("the files of the run"), error }]
                });
                failed.extend(written);
                failed
            }
        }
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
            // Read before draining: frames pushed before the write end was dropped are then drained.
            let ended = job.rings.iter().all(Consumer::is_abandoned);
            let failed_before = job.failed.is_some();
            job.drain();
            if let (false, Some(error)) = (failed_before, &job.failed) {
                // The receiver may be gone.
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
                let result = writer.write(stream, first).and_then(|()| writer.write(stream, second));
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
