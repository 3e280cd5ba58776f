//! The folder of a study: tables that grow by a line a trial, on disk before the next trial.

use crate::check::Checked;
use crate::document::Study;
use haptograph_engine::document::SettingsFile;
use haptograph_signal::files::{self, MAX_GRAPH_BYTES, write_atomically};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// A line of `trials.csv`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[allow(missing_docs)] // see CODEBOOK
pub struct Row {
    pub participant: String,
    pub group: String,
    pub trial: u32,
    pub attempt: u32,
    pub status: Status,
    pub phase: String,
    pub training: bool,
    /// The scale, or the question.
    pub scale: String,
    pub first_surface: String,
    pub first_version: String,
    pub second_surface: String,
    pub second_version: String,
    pub second_is_left_or_earlier: bool,
    pub level: Option<f64>,
    pub rating: Option<f64>,
    pub choice: String,
    pub is_right: Option<bool>,
    pub text: String,
    pub exploration_s: f64,
    pub response_s: f64,
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
#[allow(missing_docs)] // see CODEBOOK
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
#[allow(missing_docs)] // see CODEBOOK
pub struct Participant {
    pub participant: String,
    pub group: String,
    pub consent_utc: String,
    pub withdrawn_utc: String,
    pub simulated: bool,
}

/// What each column means, as `codebook.md`.
const CODEBOOK: &str = "\
# Codebook

UTF-8, comma separated, one header line, empty where there is no value, `true` and `false`.

## participants.csv: a line for each participant

| column | meaning |
|---|---|
| participant | code; only the experimenter's own list says who it is |
| group | group of the study |
| consent_utc | when the participant agreed |
| withdrawn_utc | when the participant's data were removed; then nothing else is kept |
| simulated | true for a participant who does not exist |

## trials.csv: a line for each attempt at a trial; of several attempts the last counts

| column | meaning |
|---|---|
| participant, group, simulated | as above |
| trial | number in the participant's plan, from 1 |
| attempt | from 1; more than one if the experimenter repeated the trial |
| status | answered, forced (opened by the experimenter before its conditions were reached), skipped |
| phase | name of the phase |
| training | true for a training trial, which is not analysed |
| scale | scale, or question |
| first_surface, first_version | what was presented; `real`, or the version of the virtual surface |
| second_surface, second_version | what it was compared with |
| second_is_left_or_earlier | true if the second one was on the left, or came first |
| level | value of the varied parameter in the second one |
| rating | 0 at the left end of the scale, 1 at the right one; the number of an answer |
| choice | the chosen one (first, second), or the chosen answer |
| is_right | true if the higher level was chosen |
| text | answer in words |
| exploration_s | from the beginning of the trial until the answer opened, s |
| response_s | from then on until the answer was confirmed, s |
| session | run of the program that wrote the line |
| time_utc | when it was written |
| surface_sha256 | hash of the surface's file |

## measures.csv: a number of a trial, in the unit of its line

Conditions (what was gained during the trial) by their names.
";

/// Why data cannot be read or kept.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum DataError {
    #[error("{}: {message}", path.display())]
    File { path: PathBuf, message: String },
    #[error("{} holds data of another version of the study; finish with that one, or give another folder", path.display())]
    OtherStudy { path: PathBuf },
    #[error("{} holds data of {there} participants; give another folder", path.display())]
    Mixed { path: PathBuf, there: &'static str },
    #[error("participant {code} is of group `{before}`; a participant keeps to a group")]
    OtherGroup { code: String, before: String },
    #[error("participant {code} is being run by another program")]
    Busy { code: String },
    #[error("participant {code} was continued elsewhere after this session began: this answer is not kept")]
    OtherSession { code: String },
    #[error("`{code}` cannot be a code: use up to 32 letters, digits, `-` and `_`")]
    Code { code: String },
    #[error("participant {code} has withdrawn; take another code")]
    Withdrawn { code: String },
    #[error("there is no participant {code} in {}", path.display())]
    Unknown { code: String, path: PathBuf },
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
    _lock: File,
}

fn wrong(path: &Path, message: impl std::fmt::Display) -> DataError {
    DataError::File { path: path.to_path_buf(), message: message.to_string() }
}

/// The time, as `2031-07-04T12:30:00Z`.
fn now_utc() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |passed| passed.as_secs());
    let (days, rest) = (seconds / 86_400, seconds % 86_400);
    // The civil calendar from days: Hinnant, "chrono-compatible low-level date algorithms".
    let from_march = days + 719_468;
    let (era, of_era) = (from_march / 146_097, from_march % 146_097);
    let year = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year + era * 400 + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}T{:02}:{:02}:{:02}Z", rest / 3600, rest / 60 % 60, rest % 60)
}

/// The text of a table. A last line without its end was never confirmed, and is left out.
fn whole_lines(path: &Path) -> Result<Vec<u8>, DataError> {
    let mut text = match fs::read(path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(wrong(path, error)),
    };
    text.truncate(whole(&text));
    Ok(text)
}

fn parsed<T: DeserializeOwned>(path: &Path, text: &[u8]) -> Result<Vec<T>, DataError> {
    let rows = csv::Reader::from_reader(text).deserialize().collect::<Result<Vec<T>, _>>();
    rows.map_err(|error| wrong(path, error))
}

fn read<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, DataError> {
    parsed(path, &whole_lines(path)?)
}

fn lines<T: Serialize>(rows: &[T], has_header: bool) -> Result<Vec<u8>, csv::Error> {
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
    let of = |error: io::Error| wrong(path, error);
    let file = OpenOptions::new().read(true).append(true).create(true).open(path);
    let mut file = file.map_err(of)?;
    let mut text = Vec::new();
    file.read_to_end(&mut text).map_err(of)?;
    let whole = whole(&text);
    may(&text[..whole])?;
    let added = lines(rows, whole == 0).map_err(|error| wrong(path, error))?;
    if whole < text.len() {
        let beside = path.with_extension("interrupted");
        let kept = OpenOptions::new().append(true).create(true).open(&beside);
        let end = kept.and_then(|mut kept| kept.write_all(&[&text[whole..], b"\n"].concat()));
        end.and_then(|()| file.set_len(whole as u64)).map_err(of)?;
    }
    file.write_all(&added).and_then(|()| file.sync_data()).map_err(of)
}

/// Length of the lines that have their end.
fn whole(text: &[u8]) -> usize {
    text.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1)
}

/// Replaces a table; one without lines is removed.
fn replace<T: Serialize>(path: &Path, rows: &[T]) -> Result<(), DataError> {
    if rows.is_empty() {
        return gone(fs::remove_file(path), path);
    }
    let text = lines(rows, true).map_err(|error| wrong(path, error))?;
    write_atomically(path, &text).map_err(|error| wrong(path, error))
}

/// Nothing to remove is no error.
fn gone(removed: io::Result<()>, path: &Path) -> Result<(), DataError> {
    match removed {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(wrong(path, error)),
        _ => Ok(()),
    }
}

impl Folder {
    /// Opens a study's folder, or begins one.
    ///
    /// # Errors
    /// If it holds data of another study, or if simulated and other participants would be mixed.
    pub fn open(path: &Path, study: &Checked, is_simulated: bool) -> Result<Self, DataError> {
        let folder = Self { path: path.to_path_buf() };
        fs::create_dir_all(path).map_err(|error| wrong(path, error))?;
        let own = path.join("study.json");
        let about = serde_json::json!({
            "study": study.path.file_name().map(|name| name.to_string_lossy()),
            "study_sha256": study.sha256,
            "about": study.study.about,
            "simulated": is_simulated,
            "haptograph": env!("CARGO_PKG_VERSION"),
            "graph_sha256": study.graph_sha256(),
            "surface_sha256": study.surface_hashes(),
        });
        match fs::read(&own) {
            Ok(text) => {
                let before: serde_json::Value =
                    serde_json::from_slice(&text).map_err(|error| wrong(&own, error))?;
                let same = ["study_sha256", "graph_sha256", "surface_sha256"];
                if same.iter().any(|key| before[key] != about[key]) {
                    return Err(DataError::OtherStudy { path: folder.path });
                }
                if before["simulated"] != about["simulated"] {
                    let there = if is_simulated { "real" } else { "simulated" };
                    return Err(DataError::Mixed { path: folder.path, there });
                }
            }
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(wrong(&own, error)),
            Err(_) if ["trials.csv", "participants.csv"].iter().any(|name| path.join(name).exists()) => {
                return Err(DataError::OtherStudy { path: folder.path });
            }
            Err(_) => {
                let text = serde_json::to_vec_pretty(&about).map_err(|error| wrong(&own, error))?;
                let book = path.join("codebook.md");
                write_atomically(&book, CODEBOOK.as_bytes()).map_err(|error| wrong(&book, error))?;
                let copy = path.join("study.ron");
                write_atomically(&copy, study.text().as_bytes()).map_err(|error| wrong(&copy, error))?;
                // Last: with this file the folder is a study's.
                write_atomically(&own, &text).map_err(|error| wrong(&own, error))?;
            }
        }
        Ok(folder)
    }

    /// A folder that exists.
    ///
    /// # Errors
    /// If it is not of a study.
    pub fn existing(path: &Path) -> Result<Self, DataError> {
        let own = path.join("study.json");
        fs::metadata(&own).map_err(|error| wrong(&own, error))?;
        Ok(Self { path: path.to_path_buf() })
    }

    /// The study as it was when the first participant came.
    ///
    /// # Errors
    /// If its copy cannot be read.
    pub fn study(&self) -> Result<Study, DataError> {
        let path = self.path.join("study.ron");
        let text = files::read_text(&path, MAX_GRAPH_BYTES).map_err(|error| wrong(&path, error))?;
        let file =
            SettingsFile::<Study>::parse(&path, &text, "a study").map_err(|error| wrong(&path, error))?;
        Ok(file.content)
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

    /// The lock under which tables change: a table itself may be replaced.
    fn lock(&self) -> Result<File, DataError> {
        let path = self.path.join("locks").join(".tables");
        let file = OpenOptions::new().write(true).create(true).truncate(false).open(&path);
        let locked = file.and_then(|file| file.lock().map(|()| file));
        locked.map_err(|error| wrong(&path, error))
    }

    /// Takes a code for this program alone.
    fn reserve(&self, code: &str) -> Result<File, DataError> {
        let is_code = (1..=32).contains(&code.len())
            && code.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_'));
        if !is_code {
            return Err(DataError::Code { code: code.to_owned() });
        }
        let locks = self.path.join("locks");
        fs::create_dir_all(&locks).map_err(|error| wrong(&locks, error))?;
        let path = locks.join(code);
        let lock = OpenOptions::new().write(true).create(true).truncate(false).open(&path);
        let lock = lock.map_err(|error| wrong(&path, error))?;
        lock.try_lock().map_err(|_| DataError::Busy { code: code.to_owned() })?;
        Ok(lock)
    }

    /// The numbers of the trials that are kept.
    ///
    /// # Errors
    /// If a table cannot be read.
    pub fn measures(&self) -> Result<Vec<Measure>, DataError> {
        let kept: BTreeSet<(String, u32, u32)> =
            self.rows()?.into_iter().map(|row| (row.participant, row.trial, row.attempt)).collect();
        let mut measures: Vec<Measure> = read(&self.table("measures.csv"))?;
        // An interrupted trial leaves numbers, but no line of its own.
        measures.retain(|of| kept.contains(&(of.participant.clone(), of.trial, of.attempt)));
        Ok(measures)
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
        let session = format!("{}-{}", now_utc(), std::process::id());
        Ok(Claim { folder: self.clone(), participant, session, rows, _lock: lock })
    }

    /// Removes what a participant left, but for a line that says so; what was removed, in words. It can be repeated, should
    /// it be interrupted.
    ///
    /// # Errors
    /// If there is no such participant, or a file cannot be changed.
    pub fn remove(&self, code: &str) -> Result<String, DataError> {
        let mut participants = self.participants()?;
        let Some(known) = participants.iter_mut().find(|known| known.participant == code) else {
            return Err(DataError::Unknown { code: code.to_owned(), path: self.path.clone() });
        };
        let _reserved = self.reserve(code)?;
        let _tables = self.lock()?;
        // All is read before anything is changed.
        let (mut rows, mut measures) = (self.rows()?, read::<Measure>(&self.table("measures.csv"))?);
        let before = (rows.len(), measures.len());
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
        let signals = self.path.join("signals").join(code);
        let runs = fs::read_dir(&signals).map_or(0, Iterator::count);
        // What was computed with the participant, or left of an interrupted line, is theirs too.
        for folder in [signals, self.path.join("analysis")] {
            gone(fs::remove_dir_all(&folder), &folder)?;
        }
        for file in ["trials.interrupted", "measures.interrupted"].map(|name| self.table(name)) {
            gone(fs::remove_file(&file), &file)?;
        }
        let lock = self.path.join("locks").join(code);
        gone(fs::remove_file(&lock), &lock)?;
        Ok(format!(
            "removed {trials} trials, {numbers} measures and {runs} recordings of participant {code}, and the analysis"
        ))
    }
}

impl Claim {
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
            // A trial is a line.
            text: row.text.split_whitespace().collect::<Vec<_>>().join(" "),
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
        if !measures.is_empty() {
            append(&self.folder.table("measures.csv"), &measures, |_| Ok(()))?;
        }
        // Last: with this line the trial is complete.
        let start = format!("{code},");
        let is_free = |table: &[u8]| {
            let there = table.split(|byte| *byte == b'\n').filter(|line| line.starts_with(start.as_bytes()));
            match there.count() == self.rows.len() {
                true => Ok(()),
                false => Err(DataError::OtherSession { code: code.clone() }),
            }
        };
        append(&self.folder.table("trials.csv"), std::slice::from_ref(&row), is_free)?;
        self.rows.push(row);
        Ok(())
    }
}
