//! Recording of the pointer events and settings of a run from its first frame on, for replay.
//!
//! Each event is stored with the number of the driver frame before which it happened. A replay before the
//! same frames gives the same samples, since everything else in a run follows from the graph and its seed.
//! Pointer events are stored as integers, which any text format preserves.

use super::load::Source;
use super::pointer::{MAX_DEG, MAX_M, MAX_N, Pointer};
use super::run_page::PageSignals;
#[cfg(not(target_family = "wasm"))]
use haptograph_signal::files;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fs::File;
#[cfg(not(target_family = "wasm"))]
use std::io::BufReader;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// File in a run's folder with the recording.
pub(crate) const STROKES: &str = "strokes.json";
/// File in which the recording of a run that goes on is kept: a line with its graph, then one for each part.
pub const APPENDED: &str = "strokes.part";
/// Maximum length of such a line, bytes: a graph's text as JSON.
#[cfg(not(target_family = "wasm"))]
const MAX_LINE_BYTES: usize = 6 * files::MAX_GRAPH_BYTES as usize;
/// Version of the format.
pub(crate) const FORMAT: u32 = 1;
/// Maximum number of events: more than half an hour of a pen.
pub(crate) const MAX_EVENTS: usize = 500_000;
/// Maximum duration of a replay, s.
const MAX_REPLAY_S: f64 = 36_000.0;

/// A pointer event, in integers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Written", into = "Written")]
pub(crate) struct Move {
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
        Self { frame, pad, due_us, at_nm, force_un, tilt_udeg }
    }
}

impl From<Move> for Written {
    fn from(made: Move) -> Self {
        Self(made.frame, made.pad, made.due_us, made.at_nm, made.force_un, made.tilt_udeg)
    }
}

/// A changed setting: driver frame, live setting, value.
pub(crate) type SettingChange = (u64, String, f64);

/// A recording with the graph that it was made with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Recording {
    pub format: u32,
    /// Version that made the recording.
    pub haptograph: String,
    /// Name of the graph's file, its text, and parameters that override the defaults.
    pub graph: String,
    pub text: String,
    pub set: Vec<(String, String)>,
    /// Seed in place of the graph's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Rate of the driver, Hz, and number of frames.
    pub rate_hz: f64,
    pub frames: u64,
    pub moves: Vec<Move>,
    #[serde(rename = "turns")]
    pub settings: Vec<SettingChange>,
}

impl Move {
    /// The stored form of a pointer event of a pad, before `frame` and due at a time of the run.
    pub(crate) fn new(frame: u64, pad: usize, due_s: f64, point: &Pointer) -> Self {
        Self {
            frame,
            pad,
            due_us: (due_s * 1e6).round() as u64,
            at_nm: point.position_m.map(|x| (x * 1e9).round() as i64),
            force_un: (point.force_n * 1e6).round() as u64,
            tilt_udeg: point.tilt_deg.map(|x| (x * 1e6).round() as i64),
        }
    }

    /// Time, s, and pointer of the event.
    pub(crate) fn pointer(&self) -> (f64, Pointer) {
        let due_s = self.due_us as f64 * 1e-6;
        let pointer = Pointer {
            at_s: due_s,
            position_m: self.at_nm.map(|x| x as f64 * 1e-9),
            force_n: self.force_un as f64 * 1e-6,
            tilt_deg: self.tilt_udeg.map(|x| x as f64 * 1e-6),
        };
        (due_s, pointer)
    }
}

/// What was recorded since the part before.
#[derive(Serialize, Deserialize)]
struct Part<'a> {
    /// Frames of the run so far.
    frames: u64,
    moves: Cow<'a, [Move]>,
    turns: Cow<'a, [SettingChange]>,
}

/// Longest time without a line in that file, s: where nothing happens only the duration is to be kept.
const APPEND_S: f64 = 5.0;

/// The file to which a recording is appended.
#[derive(Debug)]
pub(crate) struct Appended {
    /// Locked while the recording goes on.
    file: File,
    /// Length of its whole lines, bytes.
    length: u64,
    frames: u64,
    moves: usize,
    settings: usize,
}

impl Appended {
    /// Creates the file in a folder.
    pub(crate) fn begin(folder: &Path, recording: &Recording) -> io::Result<Self> {
        let file = File::create_new(folder.join(APPENDED))?;
        file.try_lock().map_err(io::Error::from)?;
        let mut appended = Self { file, length: 0, frames: 0, moves: 0, settings: 0 };
        appended.write(recording)?;
        Ok(appended)
    }

    fn write(&mut self, part: &impl Serialize) -> io::Result<()> {
        let mut line = serde_json::to_vec(part).map_err(io::Error::other)?;
        line.push(b'\n');
        // A line of which only a part was written, as on a full disk, is overwritten.
        self.file.seek(SeekFrom::Start(self.length))?;
        self.file.write_all(&line)?;
        self.length += line.len() as u64;
        Ok(())
    }

    pub(crate) fn append(&mut self, recording: &Recording, frames: u64) -> io::Result<()> {
        let is_idle = (self.moves, self.settings) == (recording.moves.len(), recording.settings.len());
        if is_idle && (frames.saturating_sub(self.frames) as f64) < APPEND_S * recording.rate_hz {
            return Ok(());
        }
        self.write(&Part {
            frames,
            moves: Cow::Borrowed(&recording.moves[self.moves..]),
            turns: Cow::Borrowed(&recording.settings[self.settings..]),
        })?;
        (self.frames, self.moves, self.settings) = (frames, recording.moves.len(), recording.settings.len());
        Ok(())
    }
}

/// Makes the recording of a run that was killed out of what it had appended, and writes it into the run's folder.
/// Returns its duration, s.
///
/// # Errors
/// Those of the file system; of kind [`io::ErrorKind::InvalidData`] if the file holds no recording, and of kind
/// [`io::ErrorKind::AlreadyExists`] if the recording is there.
#[cfg(not(target_family = "wasm"))]
pub fn recover(folder: &Path) -> io::Result<f64> {
    let path = folder.join(STROKES);
    if std::fs::symlink_metadata(&path).is_ok() {
        return Err(io::ErrorKind::AlreadyExists.into());
    }
    let file = files::open(&folder.join(APPENDED), files::MAX_RECORDING_BYTES)?;
    let mut lines = files::lines(BufReader::new(file), MAX_LINE_BYTES);
    let none = || io::Error::new(io::ErrorKind::InvalidData, "it holds no recording");
    let first = lines.next().ok_or_else(none)??;
    let mut recording: Recording = serde_json::from_slice(&first).map_err(|_| none())?;
    for line in lines {
        // The last one may be cut.
        let Ok(part) = serde_json::from_slice::<Part<'_>>(&line?) else {
            break;
        };
        recording.frames = part.frames;
        recording.moves.extend_from_slice(&part.moves);
        recording.settings.extend_from_slice(&part.turns);
        if recording.is_full() {
            break;
        }
    }
    let text = serde_json::to_vec(&recording).map_err(io::Error::other)?;
    files::write_atomically(&path, &text)?;
    Ok(recording.seconds())
}

/// Reason why a recording cannot be replayed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum RecordingError {
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
    pub(crate) fn begin(source: &Source, text: &str, rate_hz: f64) -> Self {
        Self {
            format: FORMAT,
            haptograph: env!("CARGO_PKG_VERSION").to_owned(),
            graph: source.name(),
            text: text.to_owned(),
            set: source.set.clone(),
            seed: source.seed,
            rate_hz,
            frames: 0,
            moves: Vec::new(),
            settings: Vec::new(),
        }
    }

    /// Adds a setting changed before this frame.
    pub(crate) fn add_setting_change(&mut self, frame: u64, name: &str, value: f64) {
        self.settings.push((frame, name.to_owned(), value));
    }

    /// True if the maximum number of events is reached.
    pub(crate) fn is_full(&self) -> bool {
        self.moves.len() + self.settings.len() >= MAX_EVENTS
    }

    /// True if the recording was made with this graph.
    pub(crate) fn is_of(&self, source: &Source, text: &str) -> bool {
        (&*self.graph, &*self.text, &self.set) == (&*source.name(), text, &source.set)
    }

    /// Duration, s.
    pub(crate) fn seconds(&self) -> f64 {
        self.frames as f64 / self.rate_hz
    }

    /// Checks that a graph at this rate can replay the recording.
    pub(crate) fn check(&self, rate_hz: f64) -> Result<(), RecordingError> {
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
            || !in_order(&mut self.settings.iter().map(|made| made.0))
        {
            return Err(RecordingError::Damaged("its moves are out of order"));
        }
        let is_right = |made: &Move| {
            let (due_s, point) = made.pointer();
            let is_near = point.position_m.iter().all(|x| x.abs() <= MAX_M);
            let is_upright = point.tilt_deg.iter().all(|tilt| tilt.abs() <= MAX_DEG);
            due_s <= MAX_REPLAY_S && is_near && is_upright && point.force_n <= MAX_N
        };
        match self.moves.iter().all(is_right)
            && self.seconds() <= MAX_REPLAY_S
            && self.moves.len() + self.settings.len() <= 2 * MAX_EVENTS
        {
            true => Ok(()),
            false => Err(RecordingError::Damaged("a move is out of range, or there are too many moves")),
        }
    }
}

/// The recording of a run, and where it is kept.
#[derive(Default)]
pub(crate) struct Recorder {
    /// The folder for recorded runs, and the folder of this run.
    pub out: Option<PathBuf>,
    pub folder: Option<PathBuf>,
    /// Name of the next folder, in which no page is written; one of the graph if there is none.
    pub name: Option<String>,
    /// The folders that were made there, whose pages may be seen.
    pub made: Vec<PathBuf>,
    pub recording: Option<Recording>,
    /// The file that keeps the recording meanwhile.
    pub appended: Option<Appended>,
    /// Signals recorded for the page in that folder.
    pub signals: Option<PageSignals>,
    /// Error of writing that page.
    pub page_error: Option<String>,
}
