//! Reads one signal from any CSV file with a header: a column of numbers, and its rate if the file states it.

use super::csv::{ColumnSelection, SignalColumns, Table, missing_columns};
use super::{ImportSettings, ReadError};
use crate::processing;
use std::io::BufRead;

/// A signal from a CSV file.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// The name in the header; for combined axes, all three.
    pub name: String,
    /// The samples, in SI if the name contains the unit, as in [`read_csv`](super::read_csv).
    pub values: Vec<f64>,
    /// The unit, such as `m/s2`, if the name contains it.
    pub unit: Option<&'static str>,
    /// Samples per second, from a column `time_s` (or `time_ms`) or a line `# rate_hz: 10000` above the header.
    pub rate_hz: Option<f64>,
}

/// Reads the column called `name` without unit conversion. In the table of a raw recording, where slower sensors leave
/// cells empty, empty cells are skipped; elsewhere an empty cell is an error.
pub fn read_column(source: impl BufRead, name: &str) -> Result<Vec<f64>, ReadError> {
    Table::read(source, &ImportSettings::strict(), ColumnSelection::Unscaled(name))?.unscaled()
}

/// Reads the signal in the column called `name`. Without a name it reads the acceleration (three axes are high-passed and
/// combined as in learning), or the only column that is not time. Nothing is repaired; see [`load_signal`](super::load_signal).
pub fn read_signal(source: impl BufRead, name: Option<&str>) -> Result<Column, ReadError> {
    signal(&mut Table::read(source, &ImportSettings::strict(), ColumnSelection::Signal(name))?)
}

/// The signal of a table that was read with a `Signal` selection.
pub(super) fn signal(table: &mut Table) -> Result<Column, ReadError> {
    let SignalColumns { name, unit, rate_hz, values } = table.signal()?;
    let values = match <[Vec<f64>; 3]>::try_from(values) {
        Ok([x, y, z]) => {
            let axes: Vec<[f64; 3]> = x.into_iter().zip(y).zip(z).map(|((x, y), z)| [x, y, z]).collect();
            let rate_hz = rate_hz.ok_or_else(|| missing_columns(&[table], vec!["time".to_owned()]))?;
            let combined = processing::combined(&axes, rate_hz, &Default::default());
            combined.map_err(|error| ReadError::Io(error.to_string()))?
        }
        Err(values) => {
            let mut values = values.into_iter().next().unwrap_or_default();
            let is_vibration = unit == Some("m/s2") || !table.knows_unit();
            if let (true, Some(rate_hz)) = (is_vibration, rate_hz) {
                table.take_offset(&name, unit.is_some(), &mut values, rate_hz)?;
            }
            values
        }
    };
    Ok(Column { name, values, unit, rate_hz })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    #[test]
    fn spaces_quotes_marks_and_line_ends_do_not_matter() {
        let text =
            b"\xef\xbb\xbf# rate_hz: 500\r\n\"t\" , \"signal\"\r\n 1 , \" 2.5\" \r\n\"3\",\t-4e-1\r\n\r\n";
        assert_eq!(read_column(&text[..], "signal").unwrap(), [2.5, -0.4]);
        assert_eq!(read_column(&text[..], "Signal").unwrap(), [2.5, -0.4]);
        assert_eq!(read_column(&b"a;b\n1;2\n"[..], "b").unwrap(), [2.0]);
        assert_eq!(
            read_signal(&text[..], Some("t")).unwrap(),
            Column { name: "t".into(), values: vec![1.0, 3.0], unit: None, rate_hz: Some(500.0) }
        );
    }

    #[test]
    fn errors_name_line_and_column() {
        let error = |text: &[u8]| read_column(text, "b").unwrap_err().to_string();
        assert_eq!(error(b"a,b\n1,2\n3,x\n"), "line 3, column 2: \"x\" in b is not a finite number");
        assert_eq!(error(b"a,b\n1,\n"), "line 2, column 2: the cell of b is empty");
        assert_eq!(error(b"a,b\n1,nan\n"), "line 2, column 2: \"nan\" in b is not a finite number");
        assert_eq!(error(b"a,b\n1,2\n3\n"), "line 3: the row has 1 cell where the header has 2");
        assert_eq!(
            error(b"# note\r\na,b\r\n\r\n1,2\r\n# note\r\n3,x\r\n"),
            "line 6, column 2: \"x\" in b is not a finite number"
        );
        assert_eq!(error(b"# note\na,c\n1,2\n"), "line 2: there is no column \"b\"; the columns are a, c");
        for empty in [&b""[..], b"\n", b"# a note\n"] {
            let message = error(empty);
            assert!(message.contains("the file is empty"), "{message}");
        }
    }

    #[test]
    fn a_source_without_end_is_read_no_further_than_its_fault() {
        let endless = || std::io::BufReader::new(b"accel_m_s2,b\n1,1\n".chain(std::io::repeat(0)));
        let error = read_signal(endless(), None).unwrap_err();
        let (place, line) = error.place(endless()).unwrap();
        assert_eq!((place.line, line.len()), (3, 64 << 10));
    }

    #[test]
    fn a_name_that_is_there_twice_is_wrong_at_its_place() {
        let text = b"# a note\na, b,\"a\",c\n1,2,3,4\n";
        let error = read_column(&text[..], "c").unwrap_err();
        assert_eq!(
            error.to_string(),
            "line 2, column 3: column name a occurs twice, in columns 1 and 3; rename or remove one"
        );
        let (place, _) = error.place(&text[..]).unwrap();
        assert_eq!((place.line, place.column), (2, 6));
        assert!(read_signal(&text[..], Some("b")).is_err());
        assert_eq!(read_column(&b"a,,\n1,,\n"[..], "a").unwrap(), [1.0], "nameless columns are no pair");
    }

    #[test]
    fn letters_of_another_encoding_do_no_harm_where_nobody_asks_for_them() {
        let latin = b"# source: B\xfccher\nx,gr\xf6\xdfe\n1,2\n";
        assert_eq!(read_column(&latin[..], "x").unwrap(), [1.0]);
        assert_eq!(read_column(&latin[..], "größe").unwrap(), [2.0]);
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
            Column { name: "level".into(), values: vec![1.0, 2.0, 3.0], unit: None, rate_hz: Some(1000.0) }
        );
        let accel = read_signal(&b"force,accel_g,x\n1,1,1\n"[..], None).unwrap();
        assert_eq!((accel.values, accel.rate_hz, accel.unit), (vec![9.80665], None, Some("m/s2")));
        let error = read_signal(&b"a,b\n1,2\n"[..], None).unwrap_err().to_string();
        assert_eq!(error, "line 1: cannot choose the signal; select a column with --column: a, b");
    }

    #[test]
    fn three_axes_are_combined_where_their_rate_is_known() {
        let rows: String = (0..400).map(|i| format!("{0},{0},{0}\n", (f64::from(i) * 0.7).sin())).collect();
        let axes = format!("accel_x_m_s2,accel_y_m_s2,accel_z_m_s2\n{rows}");
        let error = read_signal(axes.as_bytes(), None).unwrap_err().to_string();
        assert!(error.contains("rate"), "{error}");
        let combined = read_signal(format!("# rate_hz: 10000\n{axes}").as_bytes(), None).unwrap();
        let power = combined.values.iter().map(|a| a * a).sum::<f64>() / 400.0;
        assert!((power - 1.5).abs() < 0.05, "the power of all axes together: {power}");
    }
}
