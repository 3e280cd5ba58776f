//! Recording of the pointer events and settings of a run from its first frame on, for replay.
//!
//! Each event is stored with the number of the driver frame before which it happened. A replay before the
//! same frames gives the same samples, since everything else in a run follows from the graph and its seed.
//! Pointer events are stored as integers, which any text format preserves.

use super::load::Source;
use super::wire::{MOST_DEG, MOST_M, MOST_N, Pointer};
use serde::{Deserialize, Serialize};

/// Version of the format.
pub const FORMAT: u32 = 1;
/// Maximum number of events: more than half an hour of a pen.
pub const MOST_EVENTS: usize = 500_000;
/// Maximum duration of a replay, s.
const LONGEST_S: f64 = 36_000.0;

/// A pointer event, in integers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Written", into = "Written")]
pub struct Move {
    /// Driver frame before which it happened.
    pub frame: u64,
    pub pad: usize,
    /// Time of the run.
    pub due_us: u64,
    pub at_nm: [i64; 2],
    pub force_un: u64,
    pub tilt_udeg: [i64; 2],
}

/// A pointer event in a file: the last field is omitted for an upright pen.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Written(
    u64,
    usize,
    u64,
    [i64; 2],
    u64,
    #[serde(default, skip_serializing_if = "is_upright")] [i64; 2],
);

fn is_upright(tilt_udeg: &[i64; 2]) -> bool {
    *tilt_udeg == [0, 0]
}

impl From<Written> for Move {
    fn from(Written(frame, pad, due_us, at_nm, force_un, tilt_udeg): Written) -> Self {
        Self {
            frame,
            pad,
            due_us,
            at_nm,
            force_un,
            tilt_udeg,
        }
    }
}

impl From<Move> for Written {
    fn from(made: Move) -> Self {
        Self(
            made.frame,
            made.pad,
            made.due_us,
            made.at_nm,
            made.force_un,
            made.tilt_udeg,
        )
    }
}

/// A changed setting: driver frame, live setting, value.
pub type Turn = (u64, String, f64);

/// A recording with the graph that it was made with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recording {
    pub format: u32,
    /// Version that made the recording.
    pub haptograph: String,
    /// Name of the graph's file, its text, and parameters that override the defaults.
    pub graph: String,
    pub text: String,
    pub set: Vec<(String, String)>,
    /// Rate of the driver, Hz, and number of frames.
    pub rate_hz: f64,
    pub frames: u64,
    pub moves: Vec<Move>,
    pub turns: Vec<Turn>,
}

/// The stored form of a pointer event, before `frame` and due at a time of the run.
pub fn moved(frame: u64, pad: usize, due_s: f64, point: &Pointer) -> Move {
    Move {
        frame,
        pad,
        due_us: (due_s * 1e6).round() as u64,
        at_nm: point.position_m.map(|x| (x * 1e9).round() as i64),
        force_un: (point.force_n * 1e6).round() as u64,
        tilt_udeg: point.tilt_deg.map(|x| (x * 1e6).round() as i64),
    }
}

/// Time, s, and pointer of a stored event.
pub fn meant(made: &Move) -> (f64, Pointer) {
    let due_s = made.due_us as f64 * 1e-6;
    let pointer = Pointer {
        at_s: due_s,
        position_m: made.at_nm.map(|x| x as f64 * 1e-9),
        force_n: made.force_un as f64 * 1e-6,
        tilt_deg: made.tilt_udeg.map(|x| x as f64 * 1e-6),
    };
    (due_s, pointer)
}

/// Why a recording cannot be replayed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RecordingError {
    /// The format is newer than this version.
    #[error("the recording has format {0}, this version reads {FORMAT}; update haptograph")]
    Format(u32),
    /// The driver rates differ.
    #[error("the recording was made at {made} Hz, this graph runs at {runs} Hz; open the graph `{graph}`")]
    Rate { made: f64, runs: f64, graph: String },
    /// The content is invalid.
    #[error("the recording is damaged: {0}; make a new one")]
    Damaged(&'static str),
}

impl Recording {
    /// An empty recording of a run that starts.
    pub fn begin(source: &Source, text: &str, rate_hz: f64) -> Self {
        Self {
            format: FORMAT,
            haptograph: env!("CARGO_PKG_VERSION").to_owned(),
            graph: source.name(),
            text: text.to_owned(),
            set: source.set.clone(),
            rate_hz,
            frames: 0,
            moves: Vec::new(),
            turns: Vec::new(),
        }
    }

    /// Adds a setting changed before this frame.
    pub fn turned(&mut self, frame: u64, name: &str, value: f64) {
        self.turns.push((frame, name.to_owned(), value));
    }

    /// True if the maximum number of events is reached.
    pub fn is_full(&self) -> bool {
        self.moves.len() + self.turns.len() >= MOST_EVENTS
    }

    /// True if the recording was made with this graph.
    pub fn is_of(&self, source: &Source, text: &str) -> bool {
        (&*self.graph, &*self.text, &self.set) == (&*source.name(), text, &source.set)
    }

    /// Duration, s.
    pub fn seconds(&self) -> f64 {
        self.frames as f64 / self.rate_hz
    }

    /// Checks that a graph at this rate can replay it.
    pub fn check(&self, rate_hz: f64) -> Result<(), RecordingError> {
        if self.format != FORMAT {
            return Err(RecordingError::Format(self.format));
        }
        if self.rate_hz != rate_hz {
            let graph = self.graph.clone();
            let (made, runs) = (self.rate_hz, rate_hz);
            return Err(RecordingError::Rate { made, runs, graph });
        }
        let in_order = |frames: &mut dyn Iterator<Item = u64>| frames.is_sorted();
        if !in_order(&mut self.moves.iter().map(|made| made.frame))
            || !in_order(&mut self.turns.iter().map(|made| made.0))
        {
            return Err(RecordingError::Damaged("its moves are out of order"));
        }
        let is_right = |made: &Move| {
            let (due_s, point) = meant(made);
            let is_near = point.position_m.iter().all(|x| x.abs() <= MOST_M);
            let is_upright = point.tilt_deg.iter().all(|tilt| tilt.abs() <= MOST_DEG);
            due_s <= LONGEST_S && is_near && is_upright && point.force_n <= MOST_N
        };
        match self.moves.iter().all(is_right)
            && self.seconds() <= LONGEST_S
            && self.moves.len() + self.turns.len() <= 2 * MOST_EVENTS
        {
            true => Ok(()),
            false => Err(RecordingError::Damaged(
                "a move is out of range, or there are too many moves",
            )),
        }
    }
}

/// A replay in progress.
#[derive(Debug)]
pub struct Replay {
    recording: Recording,
    moves: usize,
    turns: usize,
}

/// The next step of a replay.
pub enum Again<'a> {
    Move(&'a Move),
    Turn(&'a Turn),
    /// No event before this frame.
    Until(u64),
    /// The replay is over.
    Over,
}

impl Replay {
    pub fn of(recording: Recording) -> Self {
        Self {
            recording,
            moves: 0,
            turns: 0,
        }
    }

    /// The next step before `frame` is run.
    pub fn next(&mut self, frame: u64) -> Again<'_> {
        let Recording {
            moves, turns, frames, ..
        } = &self.recording;
        let (next_move, next_turn) = (moves.get(self.moves), turns.get(self.turns));
        if let Some(made) = next_move.filter(|made| made.frame <= frame) {
            self.moves += 1;
            return Again::Move(made);
        }
        if let Some(made) = next_turn.filter(|made| made.0 <= frame) {
            self.turns += 1;
            return Again::Turn(made);
        }
        if frame >= *frames {
            return Again::Over;
        }
        let next = next_move
            .map(|made| made.frame)
            .into_iter()
            .chain(next_turn.map(|made| made.0));
        Again::Until(next.chain([*frames]).min().unwrap_or(*frames))
    }

    /// Fraction of the replay that is done, 0 to 1.
    pub fn part(&self, frame: u64) -> f64 {
        (frame as f64 / self.recording.frames.max(1) as f64).min(1.0)
    }
}
