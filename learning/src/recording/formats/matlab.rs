//! Numeric variables of MATLAB's files of level 5 (`-v6` and `-v7`), as columns: vectors by their names, columns of matrices by name and
//! number, fields of structures by their own names. A scalar `rate_hz` or `fs` is the rate.

use super::super::csv::{Cells, ColumnSelection, Table};
use super::super::{ImportSettings, ReadError};
use flate2::read::ZlibDecoder;
use haptograph_signal::files::MAX_RECORDING_BYTES;
use std::io::Read;

const HEADER_BYTES: usize = 128;
/// Deepest nesting of structures that is read.
const DEEPEST: usize = 4;

const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
const STRUCTURE: u32 = 2;
const COMPLEX: u32 = 0x800;

/// A variable: its values by columns.
struct Variable {
    name: String,
    rows: usize,
    values: Vec<f64>,
}

pub(in crate::recording) fn matlab(
    bytes: &[u8],
    import: &ImportSettings,
    wanted: ColumnSelection<'_>,
) -> Result<Table, ReadError> {
    let wrong = |message: &str| ReadError::Io(message.to_owned());
    if bytes.starts_with(b"\x89HDF") || bytes.starts_with(b"MATLAB 7.3") {
        return Err(wrong("MATLAB format 7.3 is not supported; save the variables with -v7"));
    }
    match bytes.get(126..HEADER_BYTES) {
        Some(b"IM") => {}
        Some(b"MI") => {
            return Err(wrong("the MATLAB file is big-endian; save it with -v7 on a little-endian machine"));
        }
        _ => {
            return Err(wrong(
                "the MATLAB file is older than level 5, or damaged; save the variables with -v7",
            ));
        }
    }
    let mut variables = vec![];
    elements(&bytes[HEADER_BYTES..], &mut variables, 0)
        .ok_or_else(|| wrong("the MATLAB file is damaged or cut off"))?;
    if variables.is_empty() {
        return Err(wrong("the MATLAB file has no variable of numbers; save each signal as a vector"));
    }
    let mut import = import.clone();
    let is_rate = |variable: &&Variable| {
        variable.values.len() == 1
            && ["rate_hz", "fs", "sample_rate"].contains(&&*variable.name.to_lowercase())
    };
    let rate = variables.iter().find(is_rate).map(|variable| variable.values[0]);
    import.rate_hz = import.rate_hz.or(rate.filter(|rate| rate.is_finite() && *rate > 0.0));
    Table::of_cells(cells(variables), &import, wanted)
}

/// The variables as columns of the longest length. Scalars are not columns: they may be settings of the logger.
fn cells(variables: Vec<Variable>) -> Cells {
    let length = |v: &Variable| v.rows.max(v.values.len() / v.rows.max(1));
    let samples = variables.iter().map(length).max().unwrap_or(0);
    let mut cells = Cells::default();
    for variable in variables {
        if length(&variable) != samples || samples < 2 {
            cells.others.push((variable.name.clone(), length(&variable)));
            continue;
        }
        let across = variable.values.len() / samples;
        for column in 0..across {
            let name = match across {
                1 => variable.name.clone(),
                _ => format!("{}_{}", variable.name, column + 1),
            };
            if cells.names.contains(&name) {
                continue;
            }
            let by_columns = variable.rows == samples;
            let value = |i: usize| {
                variable.values[if by_columns { column * samples + i } else { i * across + column }]
            };
            let finite = |x: f64| if x.is_finite() { x } else { f64::NAN };
            cells.columns.push((0..samples).map(|i| finite(value(i))).collect());
            cells.names.push(name);
        }
    }
    for row in 0..samples {
        cells.lines.push(row as u64 + 1);
    }
    cells
}

/// Reads all variables; `None` if the bytes end too early or are not in the format.
fn elements(mut bytes: &[u8], variables: &mut Vec<Variable>, depth: usize) -> Option<()> {
    while !bytes.is_empty() {
        let (kind, data, rest) = element(bytes, depth == 0)?;
        match kind {
            COMPRESSED if depth == 0 => {
                let mut inflated = vec![];
                ZlibDecoder::new(data).take(MAX_RECORDING_BYTES).read_to_end(&mut inflated).ok()?;
                elements(&inflated, variables, 1)?;
            }
            MATRIX => matrix(data, None, variables, depth)?,
            _ => {}
        }
        bytes = rest;
    }
    Some(())
}

/// The first element: its type, its bytes, and the remaining bytes. Compressed elements are not padded.
fn element(bytes: &[u8], may_be_compressed: bool) -> Option<(u32, &[u8], &[u8])> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    let kind = word(0)?;
    if kind >> 16 != 0 {
        let data = bytes.get(4..4 + (kind >> 16) as usize)?;
        return Some((kind & 0xffff, data, bytes.get(8..).unwrap_or_default()));
    }
    let size = word(4)? as usize;
    let data = bytes.get(8..8_usize.checked_add(size)?)?;
    let padded = match kind {
        COMPRESSED if may_be_compressed => size,
        _ => size.next_multiple_of(8),
    };
    Some((kind, data, bytes.get(8 + padded..).unwrap_or_default()))
}

/// A variable, or the fields of a structure; `field` is the name of a field, whose own is empty.
fn matrix(bytes: &[u8], field: Option<&str>, variables: &mut Vec<Variable>, depth: usize) -> Option<()> {
    if bytes.is_empty() {
        return Some(());
    }
    let (_, flags, rest) = element(bytes, false)?;
    let flags = u32::from_le_bytes(flags.get(..4)?.try_into().ok()?);
    let (_, dimensions, rest) = element(rest, false)?;
    let dimensions: Vec<usize> = dimensions
        .chunks_exact(4)
        .filter_map(|d| Some(i32::from_le_bytes(d.try_into().ok()?).max(0) as usize))
        .collect();
    let (_, name, rest) = element(rest, false)?;
    let name = field.map_or_else(|| String::from_utf8_lossy(name).into_owned(), str::to_owned);
    match flags & 0xff {
        STRUCTURE if dimensions.iter().all(|d| *d == 1) && depth < DEEPEST => fields(rest, variables, depth),
        6..=15 if flags & COMPLEX == 0 => {
            let (kind, data, _) = element(rest, false)?;
            let values = numbers(kind, data)?;
            let rows = *dimensions.first()?;
            let expected = dimensions.iter().try_fold(1_usize, |product, d| product.checked_mul(*d));
            if dimensions.len() == 2 && expected == Some(values.len()) && !values.is_empty() {
                variables.push(Variable { name, rows, values });
            }
            Some(())
        }
        _ => Some(()),
    }
}

fn fields(bytes: &[u8], variables: &mut Vec<Variable>, depth: usize) -> Option<()> {
    let (_, length, rest) = element(bytes, false)?;
    let length = i32::from_le_bytes(length.get(..4)?.try_into().ok()?).max(1) as usize;
    let (_, names, mut rest) = element(rest, false)?;
    for name in names.chunks(length) {
        let name = name.split(|byte| *byte == 0).next().unwrap_or_default();
        let (_, data, after) = element(rest, false)?;
        matrix(data, Some(&String::from_utf8_lossy(name)), variables, depth + 1)?;
        rest = after;
    }
    Some(())
}

/// The numbers of an element, which may be stored in a smaller type than the variable's.
fn numbers(kind: u32, data: &[u8]) -> Option<Vec<f64>> {
    fn all<const N: usize>(data: &[u8], number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
        data.as_chunks::<N>().0.iter().map(|bytes| number(*bytes)).collect()
    }
    Some(match kind {
        1 => all(data, |b| f64::from(i8::from_le_bytes(b))),
        2 => all(data, |b| f64::from(u8::from_le_bytes(b))),
        3 => all(data, |b| f64::from(i16::from_le_bytes(b))),
        4 => all(data, |b| f64::from(u16::from_le_bytes(b))),
        5 => all(data, |b| f64::from(i32::from_le_bytes(b))),
        6 => all(data, |b| f64::from(u32::from_le_bytes(b))),
        7 => all(data, |b| f64::from(f32::from_le_bytes(b))),
        9 => all(data, f64::from_le_bytes),
        12 => all(data, |b| i64::from_le_bytes(b) as f64),
        13 => all(data, |b| u64::from_le_bytes(b) as f64),
        _ => return None,
    })
}
