//! What was done on the pads and to the settings from the first frame of a run on, kept so that it can be done again.
//!
//! Each move and turn is kept with the frame of the driver before which it was made. Done again before the same frames it
//! gives the same samples, as everything else in a run comes from the graph and its seed. What hands do is kept in whole
//! numbers, which any text keeps as they are.

use super::load::Source;
use super::wire::{MOST_DEG, MOST_M, MOST_N, Pointer};
use serde::{Deserialize, Serialize};

/// The version of the format.
pub const FORMAT: u32 = 1;
/// Moves and turns that are kept at most: more than half an hour of a pen.
pub const MOST_EVENTS: usize = 500_000;
/// The longest that is done again, s.
const LONGEST_S: f64 = 36_000.0;

/// What a pointer did, in whole numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Written", into = "Written")]
pub struct Move {
    /// Of the driver: it was made before this one was run.
    pub frame: u64,
    pub pad: usize,
    /// Of the run.
    pub due_us: u64,
    pub at_nm: [i64; 2],
    pub force_un: u64,
    pub tilt_udeg: [i64; 2],
}

/// A move in a file: without the tilt of an upright pen.
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

/// Frame of the driver, live setting, value.
pub type Turn = (u64, String, f64);

/// A stroke, and what it was done to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recording {
    pub format: u32,
    /// The version that recorded it.
    pub haptograph: String,
    /// The name of the graph's file, its text, and parameters in place of its defaults.
    pub graph: String,
    pub text: String,
    pub set: Vec<(String, String)>,
    /// Frames of the driver in a second, Hz, and how many were run.
    pub rate_hz: f64,
    pub frames: u64,
    pub moves: Vec<Move>,
    pub turns: Vec<Turn>,
}

/// What a pointer does, as it is kept: before that frame, and due at that time of the run.
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

/// When a move is due, s, and what it is.
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

/// Why a recording cannot be done again.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RecordingError {
    /// By a version to come.
    #[error("it has format {0}, and this haptograph reads {FORMAT}: update haptograph")]
    Format(u32),
    /// Of a graph with another driver.
    #[error("it was made at {made} Hz, and this graph runs at {runs} Hz: open the graph `{graph}`")]
    Rate { made: f64, runs: f64, graph: String },
    /// Not what a recorder writes.
    #[error("it is damaged: {0}; record it again")]
    Damaged(&'static str),
}

impl Recording {
    /// An empty one of what begins to run.
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

    /// Keeps a turn that is made before this frame.
    pub fn turned(&mut self, frame: u64, name: &str, value: f64) {
        self.turns.push((frame, name.to_owned(), value));
    }

    /// Is there no room for more?
    pub fn is_full(&self) -> bool {
        self.moves.len() + self.turns.len() >= MOST_EVENTS
    }

    /// Was it done to this?
    pub fn is_of(&self, source: &Source, text: &str) -> bool {
        (&*self.graph, &*self.text, &self.set) == (&*source.name(), text, &source.set)
    }

    /// How long it takes, s.
    pub fn seconds(&self) -> f64 {
        self.frames as f64 / self.rate_hz
    }

    /// Can it be done again by a graph at this rate?
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
            return Err(RecordingError::Damaged("its moves are not in their order"));
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
                "a move is beyond what a pointer can be, or there are too many",
            )),
        }
    }
}

/// A recording that is done again.
#[derive(Debug)]
pub struct Replay {
    recording: Recording,
    moves: usize,
    turns: usize,
}

/// What is to be done next.
pub enum Again<'a> {
    Move(&'a Move),
    Turn(&'a Turn),
    /// Nothing before this frame.
    Until(u64),
    /// It is over.
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

    /// What is to be done before `frame` is run.
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

    /// The part that is done, 0 to 1.
    pub fn part(&self, frame: u64) -> f64 {
        (frame as f64 / self.recording.frames.max(1) as f64).min(1.0)
    }
}
