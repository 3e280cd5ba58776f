//! The folder of a study: tables that grow by a line a trial, on disk before the next trial.

// The codebook and the messages say what they are.
#![allow(missing_docs)]

use crate::document::Study;
use haptograph_engine::document::SettingsFile;
use haptograph_signal::files::{self, Lock, MAX_GRAPH_BYTES, MAX_RECORDING_BYTES, write_atomically};
use haptograph_signal::time::since_1970;
use jiff::Timestamp;
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

/// A line of `trials.csv`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Row {
    pub participant: String,
    pub group: String,
    pub trial: u32,
    pub attempt: u32,
    pub status: Status,
    pub phase: String,
    #[serde(deserialize_with = "flag")]
    pub training: bool,
    /// The scale, or the question.
    pub scale: String,
    pub first_surface: String,
    pub first_version: String,
    pub second_surface: String,
    pub second_version: String,
    #[serde(deserialize_with = "flag")]
    pub second_is_left_or_earlier: bool,
    pub level: Option<f64>,
    pub rating: Option<f64>,
    pub choice: String,
    #[serde(deserialize_with = "maybe_flag")]
    pub is_right: Option<bool>,
    pub text: String,
    pub exploration_s: f64,
    pub response_s: f64,
    #[serde(deserialize_with = "flag")]
    pub simulated: bool,
    pub session: String,
    pub time_utc: String,
    pub surface_sha256: String,
}

/// How a trial ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// With an answer.
    #[default]
    Answered,
    /// With an answer that the experimenter opened before its conditions were reached.
    Forced,
    /// Without an answer.
    Skipped,
}

/// A line of `measures.csv`: a number of a trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measure {
    pub participant: String,
    pub trial: u32,
    pub attempt: u32,
    pub name: String,
    pub value: f64,
    pub unit: String,
}

/// A line of `participants.csv`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Participant {
    pub participant: String,
    pub group: String,
    pub consent_utc: String,
    pub withdrawn_utc: String,
    #[serde(deserialize_with = "flag")]
    pub simulated: bool,
}

/// A line of `notes.csv`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Note {
    pub participant: String,
    /// 0 between trials.
    pub trial: u32,
    pub time_utc: String,
    pub text: String,
}

/// What each column means, as `codebook.md`.
const CODEBOOK: &str = include_str!("codebook.md");

/// Why data cannot be read or kept.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DataError {
    #[error("{}: {message}", path.display())]
    File { path: PathBuf, message: String },
    #[error("{} holds data of another version of the study, or of other endpoints; finish with that one, or give another folder", path.display())]
    OtherStudy { path: PathBuf },
    #[error("{} holds data of {there} participants; give another folder", path.display())]
    Mixed { path: PathBuf, there: &'static str },
    #[error("{} holds answers of simulated people with other parameters (`simulated` in study.json); give another folder", path.display())]
    OtherPeople { path: PathBuf },
    #[error("there is no data of a study in {}{help}", path.display())]
    NoStudy { path: PathBuf, help: String },
    #[error("participant {code} is of group `{before}`; a participant keeps to a group")]
    OtherGroup { code: String, before: String },
    #[error("participant {code} is being run by another program")]
    Busy { code: String },
    #[error("participant {code} was continued elsewhere after this session began: this answer is not kept")]
    OtherSession { code: String },
    #[error("`{}` cannot be a code: use up to 32 letters, digits, `-` and `_`", code.escape_debug())]
    Code { code: String },
    #[error(
        "`{code}` does not end in a number, by which the study's Latin orders take their rows: P01, P02, ..."
    )]
    NoNumber { code: String },
    #[error("participant {code} has withdrawn; take another code")]
    Withdrawn { code: String },
    #[error("there is no participant {code} in {}", path.display())]
    Unknown { code: String, path: PathBuf },
}

/// What a folder of data belongs to, as in `study.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identity {
    /// What the study asks.
    pub about: String,
    /// The set of endpoints: `simulated` unless devices are real.
    pub endpoints: String,
    /// Version of the program.
    pub haptograph: &'static str,
    /// Name of the study's file.
    pub study: String,
    /// Its text.
    #[serde(skip)]
    pub text: String,
    /// Hash of that.
    pub study_sha256: String,
    /// Hash of the graph and the files that it includes.
    pub graph_sha256: String,
    /// Hashes of the surfaces' files, by the names of the surfaces.
    pub surface_sha256: BTreeMap<String, String>,
    /// The parameters of simulated people; none of real ones.
    pub simulated: Option<String>,
}

/// A study's folder.
#[derive(Debug, Clone)]
pub struct Folder {
    path: PathBuf,
}

/// A participant whose trials this program alone adds to.
#[derive(Debug)]
pub struct Claim {
    folder: Folder,
    /// The participant.
    pub participant: Participant,
    session: String,
    /// The participant's attempts so far.
    rows: Vec<Row>,
    _lock: Lock,
}

fn file_error(path: &Path, message: impl std::fmt::Display) -> DataError {
    DataError::File { path: path.to_path_buf(), message: message.to_string() }
}

/// The time, as `2031-07-04T12:30:00Z`.
fn now_utc() -> String {
    Timestamp::from_second(since_1970().as_secs() as i64).unwrap_or_default().to_string()
}

/// A text without line breaks: a trial is a line.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The content of a file; nothing if it is missing.
fn content(path: &Path) -> Result<Vec<u8>, DataError> {
    match files::read(path, MAX_RECORDING_BYTES) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        read => read.map_err(|error| file_error(path, error)),
    }
}

fn parsed<T: DeserializeOwned>(path: &Path, text: &[u8]) -> Result<Vec<T>, DataError> {
    let rows = csv::Reader::from_reader(text).deserialize().collect::<Result<Vec<T>, _>>();
    rows.map_err(|error| file_error(path, error))
}

/// The lines of a table. A last one without its end was never confirmed, and is left out.
fn read<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, DataError> {
    let text = content(path)?;
    parsed(path, &text[..complete_length(&text)])
}

/// `true` or `false`, also in the capitals in which spreadsheets write them; nothing if empty.
fn maybe_flag<'d, D: Deserializer<'d>>(from: D) -> Result<Option<bool>, D::Error> {
    let text = String::deserialize(from)?;
    match text.to_ascii_lowercase().as_str() {
        "" => Ok(None),
        "true" => Ok(Some(true)),
        "false" => Ok(Some(false)),
        _ => Err(D::Error::custom(format!("`{text}` is neither true nor false"))),
    }
}

fn flag<'d, D: Deserializer<'d>>(from: D) -> Result<bool, D::Error> {
    maybe_flag(from)?.ok_or_else(|| D::Error::custom("neither true nor false"))
}

/// The lines of a table.
pub(crate) fn lines<T: Serialize>(rows: &[T], has_header: bool) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::WriterBuilder::new().has_headers(has_header).from_writer(Vec::new());
    rows.iter().try_for_each(|row| writer.serialize(row))?;
    writer.into_inner().map_err(|error| error.into_error().into())
}

/// Adds lines to a table and waits until they are on disk. What an interrupted writer left of a line goes to a file beside it.
/// `may` gets the table as it is.
fn append<T: Serialize>(
    path: &Path,
    rows: &[T],
    may: impl FnOnce(&[u8]) -> Result<(), DataError>,
) -> Result<(), DataError> {
    let text = content(path)?;
    let complete = complete_length(&text);
    may(&text[..complete])?;
    let added = lines(rows, complete == 0).map_err(|error| file_error(path, error))?;
    if complete < text.len() {
        let beside = path.with_extension("interrupted");
        let before = content(&beside)?;
        let cut = [&text[complete..], b"\n"].concat();
        files::append_at(&beside, before.len() as u64, &cut).map_err(|error| file_error(&beside, error))?;
    }
    files::append_at(path, complete as u64, &added).map_err(|error| file_error(path, error))
}

/// Length of the lines that have their end.
fn complete_length(text: &[u8]) -> usize {
    text.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1)
}

/// Replaces a table; one without lines is removed.
fn replace<T: Serialize>(path: &Path, rows: &[T]) -> Result<(), DataError> {
    let replaced = match rows {
        [] => files::remove(path),
        rows => lines(rows, true).map_err(io::Error::other).and_then(|text| write_atomically(path, &text)),
    };
    replaced.map_err(|error| file_error(path, error))
}

/// An error unless a text can be a participant's code.
pub(crate) fn check_code(code: &str) -> Result<(), DataError> {
    let is_code = (1..=32).contains(&code.len())
        && code.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_'));
    if is_code { Ok(()) } else { Err(DataError::Code { code: code.to_owned() }) }
}

impl Folder {
    /// Opens a study's folder, or begins one.
    ///
    /// # Errors
    /// If it holds data of another study, or if simulated and other participants would be mixed.
    pub fn open(path: &Path, study: &Identity) -> Result<Self, DataError> {
        let folder = Self { path: path.to_path_buf() };
        files::create_folder(path).map_err(|error| file_error(path, error))?;
        let own = path.join("study.json");
        let about = serde_json::json!(study);
        match files::read(&own, MAX_GRAPH_BYTES) {
            Ok(text) => {
                let before: serde_json::Value =
                    serde_json::from_slice(&text).map_err(|error| file_error(&own, error))?;
                let same = ["study_sha256", "graph_sha256", "surface_sha256", "endpoints"];
                if same.iter().any(|key| before[key] != about[key]) {
                    return Err(DataError::OtherStudy { path: folder.path });
                }
                match (&before["simulated"], &about["simulated"]) {
                    (before, own) if before == own => {}
                    (before, own) if before.is_null() || own.is_null() => {
                        let there = if before.is_null() { "real" } else { "simulated" };
                        return Err(DataError::Mixed { path: folder.path, there });
                    }
                    _ => return Err(DataError::OtherPeople { path: folder.path }),
                }
            }
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(file_error(&own, error)),
            Err(_)
                if ["trials.csv", "participants.csv"].iter().any(|name| files::is_file(&path.join(name))) =>
            {
                return Err(DataError::OtherStudy { path: folder.path });
            }
            Err(_) => {
                let text = serde_json::to_vec_pretty(&about).map_err(|error| file_error(&own, error))?;
                let book = path.join("codebook.md");
                write_atomically(&book, CODEBOOK.as_bytes()).map_err(|error| file_error(&book, error))?;
                let copy = path.join("study.ron");
                write_atomically(&copy, study.text.as_bytes()).map_err(|error| file_error(&copy, error))?;
                // Last: with this file the folder is a study's.
                write_atomically(&own, &text).map_err(|error| file_error(&own, error))?;
            }
        }
        Ok(folder)
    }

    /// A folder with data.
    ///
    /// # Errors
    /// If it has none.
    pub fn existing(path: &Path) -> Result<Self, DataError> {
        if files::is_file(&path.join("study.json")) {
            return Ok(Self { path: path.to_path_buf() });
        }
        let help = files::similar(path).map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
        Err(DataError::NoStudy { path: path.to_path_buf(), help })
    }

    /// The study as it was when the first participant came.
    ///
    /// # Errors
    /// If its copy cannot be read.
    pub fn study(&self) -> Result<Study, DataError> {
        let path = self.path.join("study.ron");
        let text = files::read_text(&path, MAX_GRAPH_BYTES).map_err(|error| file_error(&path, error))?;
        let file = SettingsFile::<Study>::parse(&path, &text, "a study")
            .map_err(|error| file_error(&path, error))?;
        Ok(file.content)
    }

    /// An error unless its study has this text.
    pub(crate) fn check_text(&self, text: &str) -> Result<(), DataError> {
        let path = self.path.join("study.ron");
        let own = files::read_text(&path, MAX_GRAPH_BYTES).map_err(|error| file_error(&path, error))?;
        if own == text { Ok(()) } else { Err(DataError::OtherStudy { path: self.path.clone() }) }
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn table(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// All attempts, in the order in which they were made.
    ///
    /// # Errors
    /// If the table cannot be read.
    pub fn rows(&self) -> Result<Vec<Row>, DataError> {
        read(&self.table("trials.csv"))
    }

    /// The trials that count: of several attempts the last. Those that were skipped are not among them.
    ///
    /// # Errors
    /// If the table cannot be read.
    pub fn answers(&self) -> Result<Vec<Row>, DataError> {
        let mut rows = self.rows()?;
        let mut seen = BTreeSet::new();
        rows.reverse();
        rows.retain(|row| seen.insert((row.participant.clone(), row.trial)));
        rows.reverse();
        let withdrawn = self.withdrawn()?;
        rows.retain(|row| row.status != Status::Skipped && !withdrawn.contains(&row.participant));
        Ok(rows)
    }

    fn withdrawn(&self) -> Result<BTreeSet<String>, DataError> {
        let all = self.participants()?.into_iter().filter(|known| !known.withdrawn_utc.is_empty());
        Ok(all.map(|known| known.participant).collect())
    }

    /// Copies the recording of the newest run whose name begins so to `recordings/SURFACE.PARTICIPANT.TAKE`, as `evaluate` reads it.
    ///
    /// # Errors
    /// If the run has none, or it cannot be copied.
    pub(crate) fn keep_take(
        &self,
        code: &str,
        run: &str,
        (surface, take): (&str, usize),
    ) -> Result<(), DataError> {
        let (signals, takes) = (self.path.join("signals").join(code), self.path.join("recordings"));
        let number = |path: &PathBuf| {
            let name = path.file_name()?.to_str()?;
            name.strip_prefix(run)?.parse::<u32>().ok()
        };
        let runs = files::folders(&signals).into_iter();
        let newest = runs.filter_map(|path| Some((number(&path)?, path))).max();
        let files = newest.iter().flat_map(|(_, run)| files::list(run));
        let recording =
            files.into_iter().find(|file| file.file_stem().is_some_and(|stem| stem == "recording"));
        let none = "the graph wrote no file `recording.npz` or `recording.csv`";
        let recording = recording.ok_or_else(|| file_error(&signals, none))?;
        let plain = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_' | ' ') { c } else { '-' };
        let surface: String = surface.chars().map(plain).collect();
        let end = recording.extension().unwrap_or_default().to_string_lossy();
        let copy = takes.join(format!("{surface}.{code}.{take}.{end}"));
        let copied = files::create_folder(&takes).and_then(|()| files::read(&recording, MAX_RECORDING_BYTES));
        let copied = copied.and_then(|bytes| write_atomically(&copy, &bytes));
        copied.map_err(|error| file_error(&copy, error))
    }

    /// The lock under which tables change: a table itself may be replaced.
    fn lock(&self) -> Result<Lock, DataError> {
        let path = self.path.join("locks").join(".tables");
        files::lock(&path, true).map_err(|error| file_error(&path, error))
    }

    /// Takes a code for this program alone.
    fn reserve(&self, code: &str) -> Result<Lock, DataError> {
        check_code(code)?;
        let locks = self.path.join("locks");
        files::create_folder(&locks).map_err(|error| file_error(&locks, error))?;
        let path = locks.join(code);
        files::lock(&path, false).map_err(|error| match error.kind() {
            io::ErrorKind::WouldBlock => DataError::Busy { code: code.to_owned() },
            _ => file_error(&path, error),
        })
    }

    /// The numbers of all trials.
    ///
    /// # Errors
    /// If the table cannot be read.
    pub fn measures(&self) -> Result<Vec<Measure>, DataError> {
        read(&self.table("measures.csv"))
    }

    /// The participants.
    ///
    /// # Errors
    /// If the table cannot be read.
    pub fn participants(&self) -> Result<Vec<Participant>, DataError> {
        read(&self.table("participants.csv"))
    }

    /// Takes a participant for this program alone: one who came before, or a new one of this group who has agreed.
    ///
    /// # Errors
    /// If the code is not one, the participant has withdrawn, or another program runs it.
    pub fn claim(&self, code: &str, group: &str, is_simulated: bool) -> Result<Claim, DataError> {
        let lock = self.reserve(code)?;
        let _tables = self.lock()?;
        let before = self.participants()?.into_iter().find(|known| known.participant == code);
        let participant = match before {
            Some(known) if !known.withdrawn_utc.is_empty() => {
                return Err(DataError::Withdrawn { code: code.to_owned() });
            }
            Some(known) if known.group != group => {
                let (code, before) = (code.to_owned(), known.group);
                return Err(DataError::OtherGroup { code, before });
            }
            Some(known) => known,
            None => {
                let new = Participant {
                    participant: code.to_owned(),
                    group: group.to_owned(),
                    consent_utc: now_utc(),
                    withdrawn_utc: String::new(),
                    simulated: is_simulated,
                };
                append(&self.table("participants.csv"), std::slice::from_ref(&new), |_| Ok(()))?;
                new
            }
        };
        let mut rows = self.rows()?;
        rows.retain(|row| row.participant == code);
        self.remove_orphans(code, &rows)?;
        // A page has no number of a process.
        let process = if cfg!(target_family = "wasm") { 0 } else { std::process::id() };
        let session = format!("{}-{process}", now_utc());
        Ok(Claim { folder: self.clone(), participant, session, rows, _lock: lock })
    }

    /// Removes the numbers that an interrupted trial of a participant left: the next attempt has its own.
    fn remove_orphans(&self, code: &str, rows: &[Row]) -> Result<(), DataError> {
        let table = self.table("measures.csv");
        let mut measures = read::<Measure>(&table)?;
        let before = measures.len();
        let is_kept =
            |of: &Measure| rows.iter().any(|row| (row.trial, row.attempt) == (of.trial, of.attempt));
        measures.retain(|of| of.participant != code || is_kept(of));
        if measures.len() < before { replace(&table, &measures) } else { Ok(()) }
    }

    /// Removes what a participant left, but for a line that says so; what was removed, in words. It can be repeated, should
    /// it be interrupted.
    ///
    /// # Errors
    /// If there is no such participant, or a file cannot be changed.
    pub fn remove(&self, code: &str) -> Result<String, DataError> {
        let unknown = || DataError::Unknown { code: code.to_owned(), path: self.path.clone() };
        if !self.participants()?.iter().any(|known| known.participant == code) {
            return Err(unknown());
        }
        let _reserved = self.reserve(code)?;
        let _tables = self.lock()?;
        // All is read before anything is changed.
        let mut participants = self.participants()?;
        let known = participants.iter_mut().find(|known| known.participant == code).ok_or_else(unknown)?;
        let (mut rows, mut measures) = (self.rows()?, read::<Measure>(&self.table("measures.csv"))?);
        let before = (rows.len(), measures.len());
        let mut notes = read::<Note>(&self.table("notes.csv"))?;
        notes.retain(|note| note.participant != code);
        rows.retain(|row| row.participant != code);
        measures.retain(|measure| measure.participant != code);
        let (trials, numbers) = (before.0 - rows.len(), before.1 - measures.len());
        if known.withdrawn_utc.is_empty() {
            known.withdrawn_utc = now_utc();
        }
        (known.consent_utc, known.group) = (String::new(), String::new());
        replace(&self.table("participants.csv"), &participants)?;
        replace(&self.table("trials.csv"), &rows)?;
        replace(&self.table("measures.csv"), &measures)?;
        replace(&self.table("notes.csv"), &notes)?;
        let signals = self.path.join("signals").join(code);
        let runs = files::folders(&signals).len();
        // What was computed with the participant, or left of an interrupted line, is theirs too.
        files::remove(&signals).map_err(|error| file_error(&signals, error))?;
        let left =
            ["trials.interrupted", "measures.interrupted", "notes.interrupted"].map(|name| self.table(name));
        let computed = files::list(&self.path.join("analysis"));
        let computed = computed
            .into_iter()
            .filter(|file| file.extension().is_some_and(|of| of == "csv" || of == "html"));
        let takes = files::list(&self.path.join("recordings")).into_iter();
        let takes = takes.filter(|take| take.to_string_lossy().rsplit('.').nth(2) == Some(code));
        let lock = self.path.join("locks").join(code);
        for file in computed.chain(left).chain(takes).chain([lock]) {
            files::remove(&file).map_err(|error| file_error(&file, error))?;
        }
        Ok(format!(
            "removed {trials} trials, {numbers} measures and {runs} recordings of participant {code}, and the analysis"
        ))
    }
}

impl Claim {
    /// Keeps a note about a trial; 0 between trials.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn note(&self, trial: u32, text: &str) -> Result<(), DataError> {
        let participant = self.participant.participant.clone();
        let note = Note { participant, trial, time_utc: now_utc(), text: one_line(text) };
        let _tables = self.folder.lock()?;
        append(&self.folder.table("notes.csv"), &[note], |_| Ok(()))
    }

    /// The participant's attempts so far.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Keeps a trial: when this returns, it is on disk.
    ///
    /// # Errors
    /// If a file cannot be written, or another program continued the participant.
    pub fn keep(&mut self, row: Row, measures: &[(String, f64, String)]) -> Result<(), DataError> {
        let code = &self.participant.participant;
        let attempt = self.rows.iter().filter(|known| known.trial == row.trial).count() as u32 + 1;
        let row = Row {
            participant: code.clone(),
            group: self.participant.group.clone(),
            attempt,
            simulated: self.participant.simulated,
            session: self.session.clone(),
            time_utc: now_utc(),
            text: one_line(&row.text),
            ..row
        };
        let measure = |(name, value, unit): &(String, f64, String)| Measure {
            participant: code.clone(),
            trial: row.trial,
            attempt,
            name: name.clone(),
            value: *value,
            unit: unit.clone(),
        };
        let measures: Vec<Measure> = measures.iter().map(measure).collect();
        let _tables = self.folder.lock()?;
        // Of a try that failed half-way.
        self.folder.remove_orphans(code, &self.rows)?;
        if !measures.is_empty() {
            append(&self.folder.table("measures.csv"), &measures, |_| Ok(()))?;
        }
        // Last: with this line the trial is complete.
        let start = format!("{code},");
        let is_free = |table: &[u8]| {
            let there = table.split(|byte| *byte == b'\n').filter(|line| line.starts_with(start.as_bytes()));
            let is_same = there.count() == self.rows.len();
            if is_same { Ok(()) } else { Err(DataError::OtherSession { code: code.clone() }) }
        };
        append(&self.folder.table("trials.csv"), std::slice::from_ref(&row), is_free)?;
        self.rows.push(row);
        Ok(())
    }
}
