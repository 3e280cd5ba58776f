//! Recordings on disk. The content of a file decides how it is read.

use super::csv::{self, ColumnSelection, Table, Taken};
use super::formats::{self, Workbook};
use super::import::{Finding, ImportSettings};
use super::{
    AnyRecording, Column, ReadError, open_archive, read_hatt, signal, write_archive, write_csv, write_hatt,
};
use crate::processing::{ProcessingSettings, process_with_world};
use haptograph_surfaces::provenance::VIBRATION_UNIT;

use haptograph_signal::files::{self, Bounded, MAX_RECORDING_BYTES, write_atomically};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Reads a recording from a file: [haptograph's archive](super::read_archive), [CSV](super::read_csv) or another table, or any
/// of the three XML files of a HaTT recording (the other two must be in the same folder).
///
/// The content decides the format. Nothing is repaired; see [`load_with`].
pub fn load(path: &Path) -> Result<AnyRecording, LoadError> {
    load_with(&[path.to_owned()], &ImportSettings::strict()).map(|(recording, _)| recording)
}

/// Reads a recording from a file, or from several tables that share a clock, and lists what was found and repaired in each.
///
/// Tables are CSV, spreadsheets (the first sheet), MATLAB files before version 7.3 and WAV files. A single WAV file is
/// joined with the table of the same name in its folder.
pub fn load_with(
    paths: &[PathBuf],
    import: &ImportSettings,
) -> Result<(AnyRecording, Vec<(PathBuf, Finding)>), LoadError> {
    let (recording, findings) = read(paths, import)?;
    Ok((recording.with_settings(&import.touch), findings))
}

fn read(
    paths: &[PathBuf],
    import: &ImportSettings,
) -> Result<(AnyRecording, Vec<(PathBuf, Finding)>), LoadError> {
    let paths = with_neighbour(paths);
    if let [path] = &paths[..] {
        match kind(path)? {
            Kind::Archive => {
                let read = open_archive(open(path)?.get_ref()).map_err(|source| read_error(path, source))?;
                return Ok((read, vec![]));
            }
            Kind::Hatt => return load_hatt(path).map(|recording| (recording, vec![])),
            _ => {}
        }
    }
    let mut tables = vec![];
    for (file, path) in paths.iter().enumerate() {
        let mut table = table(path, import, ColumnSelection::Recording)?;
        table.file = file;
        tables.push(table);
    }
    let first = &paths[0];
    csv::check_mapping(&tables, import).map_err(|source| read_error(first, source))?;
    let source: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
    let read = csv::recording(&mut tables, &source.join(" + "), import);
    let (recording, findings) = read.map_err(|fault| match (fault.error, &paths[..]) {
        (ReadError::Missing { missing, .. }, [path])
            if is_wav(path) && !missing.contains(&"accel".to_owned()) =>
        {
            let table = name_of(&path.with_extension("csv"));
            read_error(path, ReadError::NoTable { missing, table })
        }
        (error, _) => read_error(&paths[fault.file], error),
    })?;
    let of_files = findings.into_iter().map(|(file, finding)| (paths[file].clone(), finding));
    Ok((recording, of_files.collect()))
}

/// Reads a column of any table without unit conversion; see [`read_column`](super::read_column).
pub fn load_column(path: &Path, name: &str) -> Result<Vec<f64>, LoadError> {
    let import = ImportSettings::strict();
    let read = table(path, &import, ColumnSelection::Unscaled(name))?.unscaled();
    read.map_err(|source| read_error(path, source))
}

/// Reads the signal in a column of any table and repairs it as recordings are; see [`read_signal`](super::read_signal). `--unit accel=…` is its unit.
pub fn load_signal(
    path: &Path,
    name: Option<&str>,
    import: &ImportSettings,
) -> Result<(Column, Vec<Finding>), LoadError> {
    let mut table = table(path, import, ColumnSelection::Signal(name))?;
    let column = signal::signal(&mut table).map_err(|source| read_error(path, source))?;
    Ok((column, table.findings))
}

/// A recorded sweep of an actuator.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// Current, A.
    pub current_a: Vec<f64>,
    /// Acceleration, m/s².
    pub acceleration_m_s2: Vec<f64>,
    /// Samples per second.
    pub rate_hz: f64,
}

/// Reads a sweep from any table: time, current and acceleration. Units or `import` identify the columns.
pub fn load_sweep(path: &Path, import: &ImportSettings) -> Result<(Sweep, Vec<Finding>), LoadError> {
    let wrong = |source| read_error(path, source);
    let mut table = table(path, import, ColumnSelection::Sweep)?;
    csv::check_mapping(std::slice::from_ref(&table), import).map_err(wrong)?;
    let wanted = ["current", "accel"].map(str::to_owned).to_vec();
    csv::refuse_missing(std::slice::from_ref(&table), wanted).map_err(wrong)?;
    let even = table.conform(&["current", "accel"], Taken::All).map_err(|fault| wrong(fault.error))?;
    let mut columns = even.columns.into_iter();
    let sweep = Sweep {
        current_a: columns.next().unwrap_or_default(),
        acceleration_m_s2: columns.next().unwrap_or_default(),
        rate_hz: even.rate_hz,
    };
    Ok((sweep, table.findings))
}

fn is_wav(path: &Path) -> bool {
    is_named(path, "wav")
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The files of a take: a single WAV file is joined with the table beside it.
fn with_neighbour(paths: &[PathBuf]) -> Vec<PathBuf> {
    let mut all = paths.to_vec();
    if let [path] = paths {
        let tables = ["csv", "xlsx", "mat"].map(|extension| path.with_extension(extension));
        all.extend(tables.into_iter().find(|table| is_wav(path) && table.is_file()));
    }
    all
}

/// The format of a file, recognised by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Archive,
    Hatt,
    Spreadsheet,
    /// A spreadsheet format that is not supported.
    OtherSpreadsheet,
    Matlab,
    Wav,
    Csv,
}

fn kind(path: &Path) -> Result<Kind, LoadError> {
    let mut file = open(path)?;
    let start = file.fill_buf().map_err(|source| io_error(path, source))?;
    let text = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
    if start.is_empty() {
        return Err(read_error(path, ReadError::Empty));
    }
    if let Some(found) = other_document(text) {
        return Err(read_error(path, ReadError::OtherDocument { found }));
    }
    Ok(match start {
        [b'P', b'K', ..] => match formats::workbook(BufReader::new(file.get_ref().as_file())) {
            Some(Workbook::Xlsx) => Kind::Spreadsheet,
            Some(Workbook::Other) => Kind::OtherSpreadsheet,
            None => Kind::Archive,
        },
        [0xd0, 0xcf, 0x11, 0xe0, ..] => Kind::OtherSpreadsheet,
        [b'R', b'I', b'F', b'F', ..] => Kind::Wav,
        [0x89, b'H', b'D', b'F', ..] => Kind::Matlab,
        _ if start.starts_with(b"MATLAB ") => Kind::Matlab,
        _ if text.starts_with(b"<") => Kind::Hatt,
        _ => Kind::Csv,
    })
}

/// What a file of haptograph that is no recording is.
fn other_document(text: &[u8]) -> Option<&'static str> {
    let mut lines = text.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let first = lines.find(|line| !line.is_empty() && !line.starts_with(b"//"))?;
    let roots = [
        ("Surface(", "a surface"),
        ("Graph(", "a graph"),
        ("Parts(", "a part of a graph"),
        ("Batch(", "a plan of a data set"),
    ];
    let root = roots.iter().find(|(root, _)| first.starts_with(root.as_bytes()));
    root.map(|(_, found)| *found)
}

fn table(path: &Path, import: &ImportSettings, wanted: ColumnSelection<'_>) -> Result<Table, LoadError> {
    let read = match kind(path)? {
        Kind::Csv => Table::read(open(path)?, import, wanted),
        Kind::Wav => formats::wav(&all(path)?, import, wanted),
        Kind::Matlab => formats::matlab(&all(path)?, import, wanted),
        Kind::Spreadsheet => formats::spreadsheet(&all(path)?, import, wanted),
        Kind::OtherSpreadsheet => Err(ReadError::Io(
            "this spreadsheet format is not supported; save the file as .xlsx or CSV".to_owned(),
        )),
        Kind::Archive | Kind::Hatt => Err(ReadError::Io(
            "this file is a complete recording; only tables can be joined or read by column".to_owned(),
        )),
    };
    let mut table = read.map_err(|source| read_error(path, source))?;
    table.label = name_of(path);
    Ok(table)
}

fn all(path: &Path) -> Result<Vec<u8>, LoadError> {
    let mut bytes = vec![];
    open(path)?.read_to_end(&mut bytes).map_err(|source| io_error(path, source))?;
    Ok(bytes)
}

/// Writes a recording, each file atomically: the [`contents`] of its [`file_names`].
pub fn save(recording: &AnyRecording, path: &Path) -> std::io::Result<()> {
    let contents = contents(recording, path)?;
    let mut files = file_names(path)?.into_iter().zip(contents);
    files.try_for_each(|(path, bytes)| write_atomically(&path, &bytes))
}

/// The files of a recording that is written to `path`: a HaTT triple for one of its names in `.xml`, else the path alone.
///
/// # Errors
/// A name in `.xml` that is none of a triple.
pub fn file_names(path: &Path) -> std::io::Result<Vec<PathBuf>> {
    if !is_named(path, "xml") {
        return Ok(vec![path.to_owned()]);
    }
    let triple = triple(path).ok_or_else(|| std::io::Error::other(ReadError::NotATriple.to_string()))?;
    Ok(triple.to_vec())
}

/// The bytes of those files: CSV if the name ends in `.csv`, a HaTT triple if in `.xml`, else haptograph's archive. For a triple
/// a raw recording is processed, with all axes in the world.
pub fn contents(recording: &AnyRecording, path: &Path) -> std::io::Result<Vec<Vec<u8>>> {
    let is_archive = !is_named(path, "csv") && !is_named(path, "xml");
    if !is_archive && recording.provenance().settings.contains_key(VIBRATION_UNIT) {
        let why =
            "the unit of the vibration is not known, and these files are in m/s²; write an archive (.npz)";
        return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, why));
    }
    if is_named(path, "csv") {
        return Ok(vec![write_csv(recording)?]);
    }
    if !is_named(path, "xml") {
        return Ok(vec![write_archive(recording)?]);
    }
    let written = match recording {
        AnyRecording::Processed(processed) => write_hatt(processed),
        AnyRecording::Raw(raw) => {
            let processed = process_with_world(raw, &ProcessingSettings::default());
            write_hatt(&processed.map_err(std::io::Error::other)?)
        }
    };
    Ok(written.map(String::into_bytes).to_vec())
}

fn is_named(path: &Path, extension: &str) -> bool {
    let own = path.extension();
    own.is_some_and(|own| own.eq_ignore_ascii_case(extension))
}

/// The prefixes of a HaTT triple's file names.
const TRIPLE: [&str; 3] = ["Accel_", "Position_", "Force_"];

/// The files of a triple by any of their names.
fn triple(path: &Path) -> Option<[PathBuf; 3]> {
    let name = name_of(path);
    let material = TRIPLE.iter().find_map(|prefix| name.strip_prefix(prefix))?;
    Some(TRIPLE.map(|prefix| path.with_file_name(format!("{prefix}{material}"))))
}

fn load_hatt(path: &Path) -> Result<AnyRecording, LoadError> {
    let [accel, position, force] = triple(path).ok_or_else(|| read_error(path, ReadError::NotATriple))?;
    let name = name_of(&accel);
    let source = name.strip_prefix(TRIPLE[0]).unwrap_or(&name);
    let source = source.strip_suffix(".xml").unwrap_or(source);
    read_hatt(open(&accel)?, open(&position)?, open(&force)?, source)
        .map(AnyRecording::Processed)
        .map_err(|source| read_error(path, source))
}

fn open(path: &Path) -> Result<BufReader<Bounded>, LoadError> {
    let file = files::open(path, MAX_RECORDING_BYTES).map_err(|source| io_error(path, source))?;
    Ok(BufReader::with_capacity(1 << 16, file))
}

fn io_error(path: &Path, source: std::io::Error) -> LoadError {
    LoadError::Io { path: path.to_owned(), source }
}

fn read_error(path: &Path, source: ReadError) -> LoadError {
    LoadError::Read { path: path.to_owned(), source }
}

/// An error of reading a recording's file.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum LoadError {
    #[error("cannot read {}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    #[error("cannot read {}: {source}", path.display())]
    Read { path: PathBuf, source: ReadError },
}
