//! Recordings as CSV: a header that names quantity and unit, one row a moment.
//!
//! | columns | kind |
//! |---|---|
//! | `time_s` (or `time_ms`), or a line `# rate_hz: 10000` above the header | either |
//! | `accel_m_s2`, or `accel_x_m_s2`, `accel_y_m_s2`, `accel_z_m_s2` (or `_g`) | either |
//! | `force_normal_n`, `force_tangential_n` (optional), `speed_mm_s` (or `_m_s`) | processed |
//! | `force_x_n` .. `force_z_n`, `torque_x_n_m` .. (or `_n_mm`; optional), `position_x_mm` .. (or `_m`), `orientation_w`, `_x`, `_y`, `_z` | raw |
//!
//! Raw forces act on the tool, in the tool's frame; positions are the tip's. Cells are empty where a slower sensor had no sample.
//! Lines `# gesture: tap`, `# origin: simulated`, `# source: ...` above the header say what the columns cannot. Other columns are ignored; [`csv_head`] tells which.

use super::file::ReadError;
use super::{
    AnyRecording, Calibration, Gesture, Pose, ProcessedRecording, Recording, Series, Signals, Wrench,
};
use crate::files::decimal::{format_thousandfold, parse_thousandth};
use crate::learning::processing;
use crate::{Origin, Provenance};
use csv::{ByteRecord, ReaderBuilder, Trim};
use std::collections::BTreeMap;

const AXES: [&str; 3] = ["x", "y", "z"];

/// The columns that are understood, by the unit that they are written with.
pub const COLUMNS: [&str; 21] = [
    "time_s",
    "accel_m_s2",
    "force_normal_n",
    "force_tangential_n",
    "speed_mm_s",
    "accel_x_m_s2",
    "accel_y_m_s2",
    "accel_z_m_s2",
    "force_x_n",
    "force_y_n",
    "force_z_n",
    "torque_x_n_mm",
    "torque_y_n_mm",
    "torque_z_n_mm",
    "position_x_mm",
    "position_y_mm",
    "position_z_mm",
    "orientation_w",
    "orientation_x",
    "orientation_y",
    "orientation_z",
];

/// What a CSV file says before its rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CsvHead {
    /// Names of the columns that are none of ours, and passed over.
    pub ignored: Vec<String>,
    /// Whether a line `# gesture: ...` says what the hand did.
    pub says_gesture: bool,
}

/// The head of a file from its first bytes; `None` where these are no CSV's.
pub fn csv_head(bytes: &[u8]) -> Option<CsvHead> {
    let bytes = without_mark(bytes);
    if bytes.starts_with(b"PK") || bytes.trim_ascii_start().starts_with(b"<") {
        return None;
    }
    let (names, _) = header(bytes).ok()?;
    let unknown = |name: &&String| !name.is_empty() && parse_name(&name.to_ascii_lowercase()).is_none();
    Some(CsvHead {
        ignored: names.iter().filter(unknown).cloned().collect(),
        says_gesture: notes(bytes).contains_key("gesture"),
    })
}

/// A recording from the bytes of a CSV file; `source` is where they came from, unless they say so themselves.
pub fn read_csv(bytes: &[u8], source: &str) -> Result<AnyRecording, ReadError> {
    let table = Table::read(without_mark(bytes))?;
    let notes = &table.notes;
    let gesture = match notes.get("gesture") {
        Some(word) => Gesture::from_word(word).ok_or_else(|| {
            table.error(
                1,
                format!("gesture {word:?} is unknown; known are drag, circle, tap, press"),
            )
        })?,
        None => Gesture::Drag,
    };
    let origin = match notes.get("origin") {
        Some(word) => {
            Origin::from_word(word).ok_or_else(|| table.error(1, format!("origin {word:?} is unknown")))?
        }
        None => Origin::Imported,
    };
    let provenance = Provenance::new(origin, notes.get("source").map_or(source, String::as_str));
    if table.has("force_x") || table.has("position_x") {
        raw(&table, gesture, provenance).map(AnyRecording::Raw)
    } else {
        processed(&table, gesture, provenance).map(AnyRecording::Processed)
    }
}

fn processed(
    table: &Table,
    gesture: Gesture,
    provenance: Provenance,
) -> Result<ProcessedRecording, ReadError> {
    let axes = AXES.iter().all(|axis| table.has(&format!("accel_{axis}")));
    let (names, rate_hz) = (
        ["accel", "force_normal", "force_tangential", "speed"],
        table.rate_hz()?,
    );
    let [combined, normal, tangential, speed] = names.map(|name| table.full(name));
    let axes: Option<Vec<[f64; 3]>> = match axes {
        true => Some(columns(
            ["accel_x", "accel_y", "accel_z"].map(|name| table.full(name)),
        )?),
        false => None,
    };
    let acceleration_m_s2 = match &axes {
        Some(axes) if !table.has("accel") => processing::combined(axes, rate_hz, &Default::default())
            .map_err(|e| table.error(table.header_line, e))?,
        _ => combined?,
    };
    let force_tangential_n = table.has("force_tangential").then_some(tangential).transpose()?;
    let signals = Signals {
        rate_hz,
        acceleration_m_s2,
        force_normal_n: normal?,
        force_tangential_n,
        speed_m_s: speed?,
        axes_m_s2: axes,
    };
    Ok(ProcessedRecording::new(signals, gesture, provenance)?)
}

fn raw(table: &Table, gesture: Gesture, provenance: Provenance) -> Result<Recording, ReadError> {
    let acceleration = table.sensor(&["accel_x", "accel_y", "accel_z"])?;
    let poses = table.sensor(&[
        "position_x",
        "position_y",
        "position_z",
        "orientation_w",
        "orientation_x",
        "orientation_y",
        "orientation_z",
    ])?;
    let mut load = vec!["force_x", "force_y", "force_z"];
    if table.has("torque_x") {
        load.extend(["torque_x", "torque_y", "torque_z"]);
    }
    let load = table.sensor(&load)?;
    let three = |row: &[f64], from: usize| std::array::from_fn(|i| row.get(from + i).copied().unwrap_or(0.0));
    let pose = |row: &Vec<f64>| Pose {
        position_m: three(row, 0),
        orientation: std::array::from_fn(|i| row[3 + i]),
    };
    let wrench = |row: &Vec<f64>| Wrench {
        force_n: three(row, 0),
        torque_n_m: three(row, 3),
    };
    Ok(Recording::new(
        series(&poses, pose),
        series(&load, wrench),
        series(&acceleration, |row| three(row, 0)),
        Calibration::default(),
        gesture,
        provenance,
    )?)
}

fn series<T>(rows: &Series<Vec<f64>>, make: impl Fn(&Vec<f64>) -> T) -> Series<T> {
    Series {
        rate_hz: rows.rate_hz,
        start_s: rows.start_s,
        samples: rows.samples.iter().map(make).collect(),
    }
}

fn columns(columns: [Result<Vec<f64>, ReadError>; 3]) -> Result<Vec<[f64; 3]>, ReadError> {
    let [x, y, z] = columns;
    Ok(x?
        .into_iter()
        .zip(y?)
        .zip(z?)
        .map(|((x, y), z)| [x, y, z])
        .collect())
}

/// What a column's unit is in SI.
#[derive(Clone, Copy)]
pub(super) enum Scale {
    One,
    Thousandth,
    StandardGravity,
}

/// What a column may hold.
struct Quantity {
    name: &'static str,
    si_unit: &'static str,
    /// The units its columns may have. An axis or component stands between name and unit.
    units: &'static [(&'static str, Scale)],
}

const fn quantity(
    name: &'static str,
    si_unit: &'static str,
    units: &'static [(&'static str, Scale)],
) -> Quantity {
    Quantity { name, si_unit, units }
}

static QUANTITIES: [Quantity; 7] = [
    quantity("time", "s", &[("s", Scale::One), ("ms", Scale::Thousandth)]),
    quantity(
        "accel",
        "m/s2",
        &[("m_s2", Scale::One), ("g", Scale::StandardGravity)],
    ),
    quantity("force", "N", &[("n", Scale::One), ("mn", Scale::Thousandth)]),
    quantity(
        "torque",
        "N m",
        &[("n_m", Scale::One), ("n_mm", Scale::Thousandth)],
    ),
    quantity("position", "m", &[("m", Scale::One), ("mm", Scale::Thousandth)]),
    quantity(
        "speed",
        "m/s",
        &[("m_s", Scale::One), ("mm_s", Scale::Thousandth)],
    ),
    quantity("orientation", "1", &[("", Scale::One)]),
];
/// What may stand between quantity and unit.
const PARTS: [&str; 6] = ["x", "y", "z", "w", "normal", "tangential"];

fn quantity_of(name: &str) -> Option<&'static Quantity> {
    QUANTITIES.iter().find(|quantity| {
        name.strip_prefix(quantity.name)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
    })
}

/// The unit that the numbers of a column of ours are read in.
pub(super) fn si_unit(name: &str) -> Option<&'static str> {
    parse_name(name)?.ok()?;
    quantity_of(name).map(|quantity| quantity.si_unit)
}

/// The name without its unit, and the unit; `None` for columns that are none of ours.
pub(super) fn parse_name(name: &str) -> Option<Result<(String, Scale), String>> {
    let Quantity {
        name: quantity,
        units,
        ..
    } = quantity_of(name)?;
    let rest = name[quantity.len()..].trim_start_matches('_');
    let part = PARTS.iter().find(|part| {
        rest.strip_prefix(**part)
            .is_some_and(|unit| unit.is_empty() || unit.starts_with('_'))
    });
    let unit = part.map_or(rest, |part| rest[part.len()..].trim_start_matches('_'));
    let plain = part.map_or_else(|| (*quantity).to_owned(), |part| format!("{quantity}_{part}"));
    Some(match units.iter().find(|(known, _)| *known == unit) {
        Some((_, scale)) => Ok((plain, *scale)),
        None => {
            let known: Vec<_> = units.iter().map(|(unit, _)| format!("{plain}_{unit}")).collect();
            Err(format!(
                "column {name:?} has no unit that is understood; name it {}",
                known.join(" or ")
            ))
        }
    })
}

/// The columns that are understood, in SI; cells that were empty are NaN.
pub(super) struct Table {
    header_line: u64,
    notes: BTreeMap<String, String>,
    columns: Vec<(String, Vec<f64>)>,
    /// Line of each row.
    lines: Vec<u64>,
}

pub(super) fn reader(bytes: &[u8]) -> csv::Reader<&[u8]> {
    ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(Trim::All)
        .delimiter(delimiter(bytes))
        .from_reader(bytes)
}

/// What stands between the cells: whichever the header has most of.
fn delimiter(bytes: &[u8]) -> u8 {
    let header = bytes
        .split(|&b| b == b'\n')
        .find(|line| !line.starts_with(b"#") && !line.trim_ascii().is_empty());
    let count = |delimiter: u8| header.map_or(0, |line| line.iter().filter(|&&b| b == delimiter).count());
    [b',', b';', b'\t']
        .into_iter()
        .max_by_key(|&d| (count(d), d == b','))
        .unwrap_or(b',')
}

/// The names of the columns and the line they stand on. Bytes that are no UTF-8, as in Latin-1 files, may stand in names that nobody asks
/// for. No name may be there twice.
pub(super) fn header(bytes: &[u8]) -> Result<(Vec<String>, u64), ReadError> {
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(ReadError::Csv {
            line: 1,
            message: "this is UTF-16 text; save it as UTF-8".to_owned(),
        });
    }
    let mut reader = reader(bytes);
    let header = reader.byte_headers().map_err(|e| csv_error(&e))?;
    let line = line_of(bytes, header.position());
    let names: Vec<String> = header
        .iter()
        .map(|name| unquoted(&String::from_utf8_lossy(name)).to_owned())
        .collect();
    for (index, name) in names.iter().enumerate() {
        let first = names[..index].iter().position(|earlier| earlier == name);
        if let Some(first) = first.filter(|_| !name.is_empty()) {
            return Err(ReadError::CsvCell {
                line,
                column: index + 1,
                message: format!(
                    "{name} is there twice, in columns {} and {}; rename or remove one",
                    first + 1,
                    index + 1
                ),
            });
        }
    }
    Ok((names, line))
}

/// Where the cell `column` (from 1) of a line begins, in characters from 1.
pub(super) fn cell_start(bytes: &[u8], line: &[u8], column: usize) -> usize {
    let delimiter = char::from(delimiter(without_mark(bytes)));
    let (mut cell, mut quoted) = (1, false);
    let line = String::from_utf8_lossy(line);
    for (index, character) in line.chars().enumerate() {
        if cell == column && !character.is_whitespace() {
            return index + 1;
        }
        quoted ^= character == '"';
        cell += usize::from(character == delimiter && !quoted);
    }
    line.chars().count().max(1)
}

impl Table {
    /// Times alone, of a file whose other columns are not ours.
    pub(super) fn of_times(times: Vec<f64>, notes: BTreeMap<String, String>, lines: Vec<u64>) -> Self {
        Self {
            header_line: 1,
            notes,
            columns: vec![("time".to_owned(), times)],
            lines,
        }
    }

    pub(super) fn read(bytes: &[u8]) -> Result<Self, ReadError> {
        let (header, header_line) = header(bytes)?;
        let mut reader = reader(bytes);
        let mut wanted = vec![];
        let mut columns: Vec<(String, Vec<f64>)> = vec![];
        for (index, name) in header.iter().enumerate() {
            let Some(parsed) = parse_name(&name.to_ascii_lowercase()) else {
                continue;
            };
            let wrong = |message| ReadError::CsvCell {
                line: header_line,
                column: index + 1,
                message,
            };
            let (plain, scale) = parsed.map_err(wrong)?;
            if columns.iter().any(|(known, _)| *known == plain) {
                return Err(wrong(format!("this is a second column of {plain}")));
            }
            wanted.push((index, scale));
            columns.push((plain, vec![]));
        }
        let mut table = Self {
            header_line,
            notes: notes(bytes),
            columns,
            lines: vec![],
        };
        let mut record = ByteRecord::new();
        while reader.read_byte_record(&mut record).map_err(|e| csv_error(&e))? {
            let line = line_of(bytes, record.position());
            table.lines.push(line);
            for (&(index, scale), (name, values)) in wanted.iter().zip(&mut table.columns) {
                let cell = record.get(index).unwrap_or_default();
                values.push(match cell {
                    b"" => f64::NAN,
                    cell => number(cell, scale).ok_or_else(|| not_a_number(line, index, name, cell))?,
                });
            }
        }
        Ok(table)
    }

    fn error(&self, line: u64, message: impl ToString) -> ReadError {
        ReadError::Csv {
            line,
            message: message.to_string(),
        }
    }

    fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns
            .iter()
            .find(|(known, _)| known == name)
            .map(|(_, values)| &values[..])
    }

    fn has(&self, name: &str) -> bool {
        self.column(name).is_some()
    }

    fn needed(&self, name: &str) -> Result<&[f64], ReadError> {
        self.column(name).ok_or_else(|| {
            let known: Vec<_> = self.columns.iter().map(|(name, _)| &name[..]).collect();
            self.error(
                self.header_line,
                format!(
                    "a column of {name} is missing; understood were: {}",
                    known.join(", ")
                ),
            )
        })
    }

    /// A column without empty cells.
    fn full(&self, name: &str) -> Result<Vec<f64>, ReadError> {
        let values = self.needed(name)?;
        match values.iter().position(|x| x.is_nan()) {
            Some(row) => Err(self.error(self.lines[row], format!("{name} is missing"))),
            None => Ok(values.to_vec()),
        }
    }

    fn noted_rate_hz(&self) -> Result<Option<f64>, ReadError> {
        let Some(text) = self.notes.get("rate_hz") else {
            return Ok(None);
        };
        match text.parse::<f64>() {
            Ok(rate) if rate.is_finite() && rate > 0.0 => Ok(Some(rate)),
            _ => Err(self.error(1, format!("the rate {text:?} is no number above 0"))),
        }
    }

    pub(super) fn rate_hz(&self) -> Result<f64, ReadError> {
        match self.noted_rate_hz()? {
            Some(rate_hz) => Ok(rate_hz),
            None => self
                .timing(&(0..self.lines.len()).collect::<Vec<_>>())
                .map(|(rate_hz, _)| rate_hz),
        }
    }

    /// The rate and start of the samples in these rows.
    fn timing(&self, rows: &[usize]) -> Result<(f64, f64), ReadError> {
        let times = self.needed("time")?;
        let (Some(&first), Some(&last)) = (rows.first(), rows.last()) else {
            return Err(self.error(self.header_line, "there are no samples"));
        };
        if let Some(&row) = rows.iter().find(|&&row| times[row].is_nan()) {
            return Err(self.error(self.lines[row], "time is missing"));
        }
        let start = times[first];
        let rate = (rows.len() - 1) as f64 / (times[last] - start);
        if !(rate.is_finite() && rate > 0.0) {
            return Err(self.error(
                self.lines[last],
                "time must ascend, and there must be two samples at least",
            ));
        }
        // Times are rounded when written, rates are round numbers.
        let round = rate.round();
        let rate = if round > 0.0 && (rate / round - 1.0).abs() < 1e-5 {
            round
        } else {
            rate
        };
        for (i, &row) in rows.iter().enumerate() {
            let expected = start + i as f64 / rate;
            if (times[row] - expected).abs() > 0.25 / rate {
                let message = format!(
                    "time jumps: {} s where {expected} s is expected at an even rate of {rate} Hz",
                    times[row]
                );
                return Err(self.error(self.lines[row], message));
            }
        }
        Ok((rate, start))
    }

    /// Samples of columns that belong together, from the rows where they are not empty.
    fn sensor(&self, names: &[&str]) -> Result<Series<Vec<f64>>, ReadError> {
        let columns: Vec<&[f64]> = names
            .iter()
            .map(|name| self.needed(name))
            .collect::<Result<_, _>>()?;
        let mut rows = vec![];
        for row in 0..self.lines.len() {
            let there = columns.iter().filter(|column| !column[row].is_nan()).count();
            if there == names.len() {
                rows.push(row);
            } else if there > 0 {
                let message = format!("{} must all be there or all be empty", names.join(", "));
                return Err(self.error(self.lines[row], message));
            }
        }
        let (rate_hz, start_s) = match self.noted_rate_hz()? {
            Some(rate_hz) if !self.has("time") => (rate_hz, 0.0),
            _ => self.timing(&rows)?,
        };
        let samples = rows
            .iter()
            .map(|&row| columns.iter().map(|column| column[row]).collect())
            .collect();
        Ok(Series {
            rate_hz,
            start_s,
            samples,
        })
    }
}

/// Lines `# key: value`.
pub(super) fn notes(bytes: &[u8]) -> BTreeMap<String, String> {
    let lines = bytes
        .split(|&b| b == b'\n')
        .take_while(|line| line.starts_with(b"#"));
    lines
        .filter_map(|line| {
            let text = String::from_utf8_lossy(&line[1..]);
            let (key, value) = text.split_once(':')?;
            Some((key.trim().to_owned(), value.trim().to_owned()))
        })
        .collect()
}

/// The number in a cell. Quotes behind a space are none to the parser of rows, and are taken off here.
pub(super) fn number(cell: &[u8], scale: Scale) -> Option<f64> {
    let text = unquoted(std::str::from_utf8(cell).ok()?);
    let value = match scale {
        Scale::One => text.parse().ok()?,
        Scale::Thousandth => parse_thousandth(text)?,
        Scale::StandardGravity => text.parse::<f64>().ok()? * 9.80665,
    };
    value.is_finite().then_some(value)
}

/// The line that a row stands on. The parser's own count is of where it began to look: before the line feed of a Windows line end, empty
/// lines and comments.
pub(super) fn line_of(bytes: &[u8], position: Option<&csv::Position>) -> u64 {
    let Some(position) = position else { return 1 };
    let start = usize::try_from(position.byte()).unwrap_or(usize::MAX);
    let mut rest = bytes.get(start..).unwrap_or_default();
    let mut line = position.line();
    loop {
        let end = rest.iter().position(|&byte| byte == b'\n');
        let passed_over = |row: &[u8]| row.starts_with(b"#") || row.trim_ascii().is_empty();
        match end.filter(|&end| passed_over(&rest[..end])) {
            Some(end) => {
                rest = &rest[end + 1..];
                line += 1;
            }
            None => return line,
        }
    }
}

/// A name or number without the quotes around it.
pub(super) fn unquoted(text: &str) -> &str {
    let inner = text.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
    inner.unwrap_or(text).trim()
}

/// Text without the byte order mark that Windows programs put first.
pub(super) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// `column` counts from 0.
pub(super) fn not_a_number(line: u64, column: usize, name: &str, cell: &[u8]) -> ReadError {
    let start: String = String::from_utf8_lossy(cell).chars().take(20).collect();
    let message = match start.is_empty() {
        true => format!("the cell of {name} is empty"),
        false => format!("{start:?} in {name} is no finite number"),
    };
    ReadError::CsvCell {
        line,
        column: column + 1,
        message,
    }
}

pub(super) fn csv_error(error: &csv::Error) -> ReadError {
    ReadError::Csv {
        line: error.position().map_or(1, csv::Position::line),
        message: match error.kind() {
            csv::ErrorKind::UnequalLengths {
                expected_len, len, ..
            } => {
                format!("the row has {len} cells where the header has {expected_len}")
            }
            _ => error.to_string(),
        },
    }
}

/// The bytes of a CSV file. A raw recording comes out calibrated: acceleration in m/s² and forces in the tool's frame, positions of
/// the tip.
pub fn write_csv(recording: &AnyRecording) -> std::io::Result<Vec<u8>> {
    let provenance = recording.provenance();
    let one_line = |text: &str| text.replace(['\n', '\r'], " ");
    let mut bytes = format!(
        "# gesture: {}\n# origin: {}\n# source: {}\n",
        recording.gesture().word(),
        provenance.origin.word(),
        one_line(&provenance.source)
    )
    .into_bytes();
    let mut writer = csv::Writer::from_writer(&mut bytes);
    match recording {
        AnyRecording::Processed(processed) => write_processed(processed, &mut writer)?,
        AnyRecording::Raw(raw) => write_raw(raw, &mut writer)?,
    }
    writer.flush()?;
    drop(writer);
    Ok(bytes)
}

type Writer<'a> = csv::Writer<&'a mut Vec<u8>>;

fn write_processed(processed: &ProcessedRecording, writer: &mut Writer) -> std::io::Result<()> {
    let signals = processed.signals();
    let mut header = vec!["time_s", "accel_m_s2"];
    if signals.axes_m_s2.is_some() {
        header.extend(["accel_x_m_s2", "accel_y_m_s2", "accel_z_m_s2"]);
    }
    header.push("force_normal_n");
    if signals.force_tangential_n.is_some() {
        header.push("force_tangential_n");
    }
    header.push("speed_mm_s");
    writer.write_record(&header)?;
    for i in 0..processed.samples() {
        writer.write_field(format!("{}", i as f64 / signals.rate_hz))?;
        writer.write_field(format!("{:?}", signals.acceleration_m_s2[i]))?;
        for value in signals.axes_m_s2.iter().flat_map(|axes| axes[i]) {
            writer.write_field(format!("{value:?}"))?;
        }
        writer.write_field(format!("{:?}", signals.force_normal_n[i]))?;
        if let Some(tangential) = &signals.force_tangential_n {
            writer.write_field(format!("{:?}", tangential[i]))?;
        }
        writer.write_field(format_thousandfold(signals.speed_m_s[i]))?;
        writer.write_record(None::<&[u8]>)?;
    }
    Ok(())
}

fn write_raw(raw: &Recording, writer: &mut Writer) -> std::io::Result<()> {
    let mut header = vec!["time_s".to_owned()];
    header.extend(AXES.map(|axis| format!("accel_{axis}_m_s2")));
    header.extend(AXES.map(|axis| format!("force_{axis}_n")));
    header.extend(AXES.map(|axis| format!("torque_{axis}_n_mm")));
    header.extend(AXES.map(|axis| format!("position_{axis}_mm")));
    header.extend(["w", "x", "y", "z"].map(|part| format!("orientation_{part}")));
    writer.write_record(&header)?;
    let plain = |value: f64| format!("{value:?}");
    let acceleration = processing::acceleration_axes(raw);
    let load = processing::tool_wrench(raw);
    let tips = processing::tip_positions(raw);
    let mut next = [0; 3];
    loop {
        let times = [
            (next[0] < acceleration.len()).then(|| raw.acceleration_v().time_s(next[0])),
            (next[1] < load.len()).then(|| raw.wrench().time_s(next[1])),
            (next[2] < tips.len()).then(|| raw.motion().time_s(next[2])),
        ];
        let Some(now) = times.into_iter().flatten().min_by(f64::total_cmp) else {
            return Ok(());
        };
        let due = times.map(|time| time == Some(now));
        let mut row = vec![format!("{now}")];
        let mut put = |due: bool, width: usize, cells: &mut dyn Iterator<Item = String>| {
            if due {
                row.extend(cells);
            } else {
                row.extend(std::iter::repeat_n(String::new(), width));
            }
        };
        put(
            due[0],
            3,
            &mut acceleration.get(next[0]).into_iter().flatten().map(|&a| plain(a)),
        );
        put(
            due[1],
            3,
            &mut load.get(next[1]).into_iter().flat_map(|w| w.force_n).map(plain),
        );
        put(
            due[1],
            3,
            &mut load
                .get(next[1])
                .into_iter()
                .flat_map(|w| w.torque_n_m)
                .map(format_thousandfold),
        );
        put(
            due[2],
            3,
            &mut tips
                .get(next[2])
                .into_iter()
                .flatten()
                .map(|&p| format_thousandfold(p)),
        );
        let pose = raw.motion().samples.get(next[2]);
        put(
            due[2],
            4,
            &mut pose.into_iter().flat_map(|pose| pose.orientation).map(plain),
        );
        writer.write_record(&row)?;
        for (next, due) in next.iter_mut().zip(due) {
            *next += usize::from(due);
        }
    }
}
