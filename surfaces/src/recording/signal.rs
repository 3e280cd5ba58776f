//! One signal from any CSV file with a header: a column of numbers, and how fast they follow one another where the file says so.

use super::ReadError;
use super::csv::{Lines, Scale, not_a_number, noted_rate_hz, number, parse_name, si_unit, unequal};
use super::import::timing;
use super::rows::{Head, Rows};
use crate::learning::processing;
use std::io::BufRead;

/// A signal from a CSV file.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Its name in the header; for combined axes, all three.
    pub name: String,
    /// Its numbers, in SI where the name says the unit as in [`read_csv`](super::read_csv).
    pub values: Vec<f64>,
    /// Their unit, such as `m/s2`, where the name says it.
    pub unit: Option<&'static str>,
    /// Samples a second, by a column `time_s` (or `time_ms`) or a line `# rate_hz: 10000` above the header.
    pub rate_hz: Option<f64>,
}

/// The numbers of the column called `name` as they stand, whatever their unit. In the table of a raw recording, where slower sensors leave
/// cells empty, these are passed over; elsewhere an empty cell is an error.
pub fn read_column(source: impl BufRead, name: &str) -> Result<Vec<f64>, ReadError> {
    let (rows, head) = Rows::new(source)?;
    let index = find(&head.names, head.line, name)?;
    Ok(columns(rows, &head.names, &[(index, Scale::One)], None)?
        .values
        .remove(0))
}

/// The signal in the column called `name`. Without a name: the acceleration (three axes are high-passed and combined as in learning), or
/// the only column that is not time.
pub fn read_signal(source: impl BufRead, name: Option<&str>) -> Result<Column, ReadError> {
    let (rows, Head { names, line, notes }) = Rows::new(source)?;
    let indices = match name {
        Some(name) => vec![find(&names, line, name)?],
        None => choose(&names, line)?,
    };
    let wanted: Vec<_> = indices
        .iter()
        .map(|&index| (index, scale(&names[index])))
        .collect();
    let time = names
        .iter()
        .position(|name| quantity(name).as_deref() == Some("time"));
    let rows = columns(rows, &names, &wanted, time)?;
    let rate_hz = match (noted_rate_hz(&notes)?, time) {
        (None, Some(_)) => {
            let found = timing(&rows.times, true);
            let wrong = |(row, message)| ReadError::Csv {
                line: rows.lines.of(row),
                message,
            };
            Some(found.map_err(wrong)?.rate_hz)
        }
        (noted, _) => noted,
    };
    let values = match <[Vec<f64>; 3]>::try_from(rows.values) {
        Ok([x, y, z]) => {
            let axes: Vec<[f64; 3]> = x.into_iter().zip(y).zip(z).map(|((x, y), z)| [x, y, z]).collect();
            let rate_hz = rate_hz.ok_or_else(|| ReadError::Csv {
                line: 1,
                message: "axes are combined above 20 Hz, which takes their rate: add a column time_s, or a line `# rate_hz: \
                          10000` above the header"
                    .to_owned(),
            })?;
            let combined = processing::combined(&axes, rate_hz, &Default::default());
            combined.map_err(|error| ReadError::Csv {
                line: 1,
                message: error.to_string(),
            })?
        }
        Err(values) => values.into_iter().next().unwrap_or_default(),
    };
    let name = indices
        .iter()
        .map(|&index| &*names[index])
        .collect::<Vec<_>>()
        .join(", ");
    let unit = indices
        .first()
        .and_then(|&index| si_unit(&names[index].to_ascii_lowercase()));
    Ok(Column {
        name,
        values,
        unit,
        rate_hz,
    })
}

/// The column of that name; in other letter case if none has it exactly.
fn find(names: &[String], line: u64, name: &str) -> Result<usize, ReadError> {
    let exact = names.iter().position(|known| known == name.trim());
    let found = exact.or_else(|| {
        names
            .iter()
            .position(|known| known.eq_ignore_ascii_case(name.trim()))
    });
    found.ok_or_else(|| ReadError::Csv {
        line,
        message: format!("there is no column {name:?}; there are {}", names.join(", ")),
    })
}

/// The quantity of a column such as `accel_x`, where the name follows the convention.
fn quantity(name: &str) -> Option<String> {
    parse_name(&name.to_ascii_lowercase())?
        .ok()
        .map(|(quantity, _)| quantity)
}

fn scale(name: &str) -> Scale {
    match parse_name(&name.to_ascii_lowercase()) {
        Some(Ok((_, scale))) => scale,
        _ => Scale::One,
    }
}

/// The columns to take where none is named: one, or three axes.
fn choose(names: &[String], line: u64) -> Result<Vec<usize>, ReadError> {
    let position = |wanted: &str| {
        names
            .iter()
            .position(|name| quantity(name).as_deref() == Some(wanted))
    };
    if let Some(index) = position("accel") {
        return Ok(vec![index]);
    }
    let axes: Option<Vec<usize>> = ["accel_x", "accel_y", "accel_z"]
        .into_iter()
        .map(position)
        .collect();
    if let Some(axes) = axes {
        return Ok(axes);
    }
    let signals = (0..names.len()).filter(|&index| quantity(&names[index]).as_deref() != Some("time"));
    match signals.collect::<Vec<_>>()[..] {
        [index] => Ok(vec![index]),
        _ => Err(ReadError::Csv {
            line,
            message: format!("which column is the signal? There are {}", names.join(", ")),
        }),
    }
}

/// Rows of chosen columns.
struct Values {
    values: Vec<Vec<f64>>,
    /// Empty unless asked for.
    times: Vec<f64>,
    lines: Lines,
}

/// Columns by their index, with that of time where it is asked for.
fn columns(
    mut rows: Rows<impl BufRead>,
    names: &[String],
    wanted: &[(usize, Scale)],
    time: Option<usize>,
) -> Result<Values, ReadError> {
    let has = |wanted: &str| names.iter().any(|name| quantity(name).as_deref() == Some(wanted));
    let is_raw = has("accel_x") && (has("force_x") || has("position_x"));
    let mut read = Values {
        values: vec![vec![]; wanted.len()],
        times: vec![],
        lines: Lines::default(),
    };
    let time = time.map(|index| (index, scale(&names[index])));
    while let Some(row) = rows.next()? {
        if row.cells() != names.len() {
            return Err(unequal(&row, names.len()));
        }
        if is_raw && wanted.iter().all(|&(index, _)| row.cell(index).is_empty()) {
            continue;
        }
        read.lines.push(row.line);
        let value = |index: usize, scale: Scale| {
            let cell = row.cell(index);
            number(cell, scale).ok_or_else(|| not_a_number(row.line, index, &names[index], cell))
        };
        for (&(index, scale), values) in wanted.iter().zip(&mut read.values) {
            values.push(value(index, scale)?);
        }
        if let Some((index, scale)) = time {
            read.times.push(value(index, scale)?);
        }
    }
    Ok(read)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spaces_quotes_marks_and_line_ends_do_not_matter() {
        let text =
            b"\xef\xbb\xbf# rate_hz: 500\r\n\"t\" , \"signal\"\r\n 1 , \" 2.5\" \r\n\"3\",\t-4e-1\r\n\r\n";
        assert_eq!(read_column(&text[..], "signal").unwrap(), [2.5, -0.4]);
        assert_eq!(read_column(&text[..], "Signal").unwrap(), [2.5, -0.4]);
        assert_eq!(read_column(&b"a;b\n1;2\n"[..], "b").unwrap(), [2.0]);
        assert_eq!(
            read_signal(&text[..], Some("t")).unwrap(),
            Column {
                name: "t".into(),
                values: vec![1.0, 3.0],
                unit: None,
                rate_hz: Some(500.0)
            }
        );
    }

    #[test]
    fn errors_name_line_and_column() {
        let error = |text: &[u8]| read_column(text, "b").unwrap_err().to_string();
        assert_eq!(
            error(b"a,b\n1,2\n3,x\n"),
            "line 3, column 2: \"x\" in b is no finite number"
        );
        assert_eq!(error(b"a,b\n1,\n"), "line 2, column 2: the cell of b is empty");
        assert_eq!(
            error(b"a,b\n1,nan\n"),
            "line 2, column 2: \"nan\" in b is no finite number"
        );
        assert_eq!(
            error(b"a,b\n1,2\n3\n"),
            "line 3: the row has 1 cells where the header has 2"
        );
        assert_eq!(
            error(b"# note\r\na,b\r\n\r\n1,2\r\n# note\r\n3,x\r\n"),
            "line 6, column 2: \"x\" in b is no finite number"
        );
        assert_eq!(
            error(b"# note\na,c\n1,2\n"),
            "line 2: there is no column \"b\"; there are a, c"
        );
        for nothing in [&b""[..], b"\n", b"# a note\n"] {
            let told = error(nothing);
            assert!(told.ends_with("the file is empty"), "{told}");
        }
    }

    #[test]
    fn a_name_that_is_there_twice_is_wrong_at_its_place() {
        let text = b"# a note\na, b,\"a\",c\n1,2,3,4\n";
        let error = read_column(&text[..], "c").unwrap_err();
        assert_eq!(
            error.to_string(),
            "line 2, column 3: a is there twice, in columns 1 and 3; rename or remove one"
        );
        let place = error.place(text).unwrap();
        assert_eq!((place.line, place.column), (2, 6));
        assert!(read_signal(&text[..], Some("b")).is_err());
        assert_eq!(
            read_column(&b"a,,\n1,,\n"[..], "a").unwrap(),
            [1.0],
            "nameless columns are no pair"
        );
    }

    #[test]
    fn letters_of_another_encoding_do_no_harm_where_nobody_asks_for_them() {
        let latin = b"# source: B\xfccher\nx,gr\xf6\xdfe\n1,2\n";
        assert_eq!(read_column(&latin[..], "x").unwrap(), [1.0]);
        let error = read_column(&b"\xff\xfex\0\n\0"[..], "x").unwrap_err().to_string();
        assert!(error.contains("save it as UTF-8"), "{error}");
    }

    #[test]
    fn empty_cells_of_slower_sensors_are_passed_over() {
        let raw = b"time_s,accel_x_m_s2,position_x_mm\n0,1,2\n0.1,3,\n0.15,,4\n0.2,5,\n";
        assert_eq!(read_column(&raw[..], "accel_x_m_s2").unwrap(), [1.0, 3.0, 5.0]);
        assert_eq!(read_column(&raw[..], "position_x_mm").unwrap(), [2.0, 4.0]);
        let accel = read_signal(&raw[..], Some("accel_x_m_s2")).unwrap();
        assert_eq!((accel.values, accel.rate_hz), (vec![1.0, 3.0, 5.0], Some(10.0)));
    }

    #[test]
    fn the_signal_is_chosen_where_there_is_no_doubt() {
        let one = read_signal(&b"time_ms,level\n0,1\n1,2\n2,3\n"[..], None).unwrap();
        assert_eq!(
            one,
            Column {
                name: "level".into(),
                values: vec![1.0, 2.0, 3.0],
                unit: None,
                rate_hz: Some(1000.0)
            }
        );
        let accel = read_signal(&b"force,accel_g,x\n1,1,1\n"[..], None).unwrap();
        assert_eq!(
            (accel.values, accel.rate_hz, accel.unit),
            (vec![9.80665], None, Some("m/s2"))
        );
        let error = read_signal(&b"a,b\n1,2\n"[..], None).unwrap_err().to_string();
        assert_eq!(error, "line 1: which column is the signal? There are a, b");
    }

    #[test]
    fn three_axes_are_combined_where_their_rate_is_known() {
        let rows: String = (0..400)
            .map(|i| format!("{0},{0},{0}\n", (f64::from(i) * 0.7).sin()))
            .collect();
        let axes = format!("accel_x_m_s2,accel_y_m_s2,accel_z_m_s2\n{rows}");
        let error = read_signal(axes.as_bytes(), None).unwrap_err().to_string();
        assert!(error.contains("rate"), "{error}");
        let combined = read_signal(format!("# rate_hz: 10000\n{axes}").as_bytes(), None).unwrap();
        let power = combined.values.iter().map(|a| a * a).sum::<f64>() / 400.0;
        assert!(
            (power - 1.5).abs() < 0.05,
            "the power of all axes together: {power}"
        );
    }
}
