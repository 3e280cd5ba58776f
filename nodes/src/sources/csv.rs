//! A source that plays one column of a CSV file.

use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{
    BuildContext, BuildError, Built, DataEnd, Io, NodeKind, Port, Processor, Tick,
};
use haptograph_signal::csv::CsvError;
use std::fmt::Display;
use std::path::PathBuf;
use std::sync::Arc;

use super::AtEnd;
use super::wav::Playback;
use crate::csv_table::{self, at_file, si_of_column};

/// The column of the times.
const TIME: &str = "time_s";

haptograph_engine::choices! {
    /// Interpolation between two rows.
    pub enum Between {
        /// The value of the earlier row holds.
        Hold,
        /// Linear interpolation.
        Linear,
    }
}

haptograph_engine::settings! {
    /// Settings of [`CsvSource`].
    pub struct CsvSourceSettings {
        /// The CSV file, relative to the graph file.
        file: PathBuf;
        /// The header of the column; its ending is the unit: `stylus.force_n`, `speed_mm_s`.
        column: String;
        /// Quantity of the column, by name; it has to match the unit in the header.
        quantity: String = "number".into();
        /// Interpolation between two rows if the file has a column `time_s`. Without that column each row is a tick.
        between: Between = Between::Linear;
        /// Output after the last row.
        at_end: AtEnd = AtEnd::Stop;
        /// Older form of `at_end: Loop`.
        repeat: bool = false;
    }
}

haptograph_engine::node! {
    /// Plays a column of a CSV file with a header. Its column `time_s` holds the times; without it each row is a tick.
    /// Cells are separated by commas, semicolons or tabs; with the last two, decimals may have a comma. A preamble above
    /// the header and lines that begin with `#` are skipped. An empty cell (a slower sensor) holds the column's last value;
    /// cells before the first value take the first value. The unit at the end of the column's name is converted to SI. The
    /// run ends with the last row, unless `at_end` states otherwise.
    /// Elsewhere: readtable, readmatrix.
    pub struct CsvSource(CsvSourceSettings) in "sources";
    example: r#""force": CsvSource(clock: "control", file: "recordings/stroke.csv", column: "force_n", quantity: "force")"#;
    out OUTPUT: Scalar = Port::of_setting("quantity", "The column.");
}

impl NodeKind for CsvSource {
    fn build(settings: CsvSourceSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let scale = si_of_column(&settings.column, &settings.quantity)?;
        let table = Table::read(&settings, scale)?;
        let at_end = settings.at_end.or_loop(settings.repeat);
        if table.time_s.is_empty() {
            return Ok(Built::new(Playback { samples: table.values, at_end }));
        }
        Ok(Built::new(Curve { frames: table.ticks(cx.rate.hz()), table, between: settings.between, at_end }))
    }
}

#[derive(Debug, Clone)]
struct Table {
    /// Ascending; empty if the file has no column `time_s`.
    time_s: Arc<[f64]>,
    values: Arc<[f64]>,
}

impl Table {
    /// Ticks from the first row to the last row, both included.
    fn ticks(&self, rate_hz: f64) -> u64 {
        let ends = self.time_s.first().zip(self.time_s.last());
        let length_s = ends.map_or(0.0, |(first, last)| last - first);
        // A row on a tick belongs to that tick, whatever the rounding of its time. No run lasts longer than the bound.
        (length_s * rate_hz + 1e-6).min(1e18) as u64 + 1
    }

    fn read(settings: &CsvSourceSettings, scale: f64) -> Result<Self, BuildError> {
        let failed = |problem: &dyn Display| at_file(&settings.file, problem);
        let unread = |error: CsvError| failed(&error);
        let mut file = csv_table::open(&settings.file, &[&settings.column, TIME])?;
        let column = csv_table::column(&file, &settings.file, ("column", &settings.column))?;
        let time = file.find(TIME);
        let (mut times, mut values) = (Vec::new(), Vec::new());
        while let Some(row) = file.next_row().map_err(unread)? {
            if let Some(time) = time {
                let time_s = row.number(time).map_err(unread)?;
                if times.last().is_some_and(|last| time_s <= *last) {
                    return Err(unread(
                        row.error(format_args!("the time {time_s} s is not after the one before")),
                    ));
                }
                times.push(time_s);
            }
            values.push(match row.is_empty_at(column) {
                true => values.last().copied().unwrap_or(f64::NAN),
                false => scale * row.number(column).map_err(unread)?,
            });
        }
        let first = values.iter().copied().find(|value| !value.is_nan());
        if !values.is_empty() && first.is_none() {
            return Err(failed(&format_args!("all cells of {} are empty", settings.column)));
        }
        // Rows before the first value.
        values.iter_mut().take_while(|value| value.is_nan()).for_each(|value| *value = first.unwrap_or(0.0));
        if values.is_empty() {
            return Err(failed(&"there are no rows"));
        }
        Ok(Self { time_s: times.into(), values: values.into() })
    }
}

/// A signal over time; time 0 is the first row.
#[derive(Debug, Clone)]
struct Curve {
    table: Table,
    between: Between,
    at_end: AtEnd,
    /// Ticks up to and including the last row.
    frames: u64,
}

impl Curve {
    fn at(&self, time_s: f64) -> f64 {
        let (times, values) = (&self.table.time_s, &self.table.values);
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            return 0.0;
        };
        let length = last - first;
        let time_s = if matches!(self.at_end, AtEnd::Loop) && length > 0.0 {
            first + time_s % length
        } else {
            first + time_s
        };
        let next = times.partition_point(|t| *t <= time_s);
        let before = next.saturating_sub(1);
        match self.between {
            Between::Linear if next > 0 && next < times.len() => {
                let part = (time_s - times[before]) / (times[next] - times[before]);
                values[before] + part * (values[next] - values[before])
            }
            _ => values[before],
        }
    }
}

impl Processor<CsvSource> for Curve {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, CsvSource>) {
        let is_silent = matches!(self.at_end, AtEnd::Silence);
        for (frame, y) in io.write(CsvSource::OUTPUT).iter_mut().enumerate() {
            let is_over = is_silent && tick.first + frame as u64 >= self.frames;
            *y = if is_over { 0.0 } else { self.at(tick.time_s(frame)) };
        }
    }

    fn data_end(&self) -> Option<DataEnd> {
        self.at_end.after(self.frames)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::testing::Bench;

    struct File {
        folder: tempfile::TempDir,
    }

    impl File {
        fn new(text: impl AsRef<[u8]>) -> Self {
            let folder = tempfile::tempdir().unwrap();
            std::fs::write(folder.path().join("x.csv"), text).unwrap();
            Self { folder }
        }

        fn settings(&self, column: &str, quantity: &str) -> CsvSourceSettings {
            CsvSourceSettings {
                file: self.folder.path().join("x.csv"),
                column: column.into(),
                quantity: quantity.into(),
                between: Between::Linear,
                at_end: AtEnd::Hold,
                repeat: false,
            }
        }
    }

    #[test]
    fn what_is_no_table_says_why() {
        let file = File::new("");
        let settings = file.settings("x_n", "force");
        let refused = Bench::new::<CsvSource>(settings, 10.0, &[]).err().unwrap();
        assert!(refused.to_string().contains("the file is empty"), "{refused}");
    }

    #[test]
    fn rows_without_time_are_ticks_and_units_are_converted() {
        let file = File::new("speed_mm_s, force_n\n100, 1\n200, 2\n300, 3\n");
        let settings = file.settings("speed_mm_s", "speed");
        let mut bench = Bench::new::<CsvSource>(settings, 10.0, &[]).unwrap();
        let y = bench.run_frames(5, &[], &[2]).remove(0);
        let wanted = [0.1, 0.2, 0.3, 0.3, 0.3];
        assert!(y.iter().zip(wanted).all(|(y, w)| (y - w).abs() < 1e-12), "{y:?}");
    }

    #[test]
    fn tables_of_spreadsheets_and_loggers_are_read() {
        let text = b"Scope 3, 12:30\nhalf past\nNote;time_s;force_n\n\xb5;0,0;1,5\n;0,1;2,5\n";
        let file = File::new(text);
        let mut bench =
            Bench::new::<CsvSource>(file.settings("force_n", "force"), 10.0, &[]).expect("a table");
        assert_eq!(bench.run_source(2)[0], [1.5, 2.5]);
    }

    #[test]
    fn notes_of_recordings_are_passed_over() {
        let file = File::new(
            "# gesture: drag\n# origin: simulated\naccel_g, speed_mm_s\n1, 100\n# a remark\n2, 200\n",
        );
        let mut bench =
            Bench::new::<CsvSource>(file.settings("speed_mm_s", "speed"), 10.0, &[]).expect("a table");
        let speeds = bench.run_source(2).remove(0);
        assert!((speeds[0] - 0.1).abs() < 1e-12 && (speeds[1] - 0.2).abs() < 1e-12, "{speeds:?}");
        let mut bench =
            Bench::new::<CsvSource>(file.settings("accel_g", "acceleration"), 10.0, &[]).expect("g");
        assert!((bench.run_source(1)[0][0] - 9.80665).abs() < 1e-12);
    }

    #[test]
    fn rows_with_time_are_joined_by_lines_or_steps() {
        let file = File::new("time_s,force_n\n5.0,1\n5.2,3\n5.3,0\n");
        let near = |y: &[f64], wanted: &[f64]| {
            assert!(y.iter().zip(wanted).all(|(y, w)| (y - w).abs() < 1e-9), "{y:?}")
        };
        let mut settings = file.settings("force_n", "force");
        let mut bench = Bench::new::<CsvSource>(settings.clone(), 10.0, &[]).unwrap();
        near(&bench.run_source(5)[0], &[1.0, 2.0, 3.0, 0.0, 0.0]);
        settings.between = Between::Hold;
        let mut bench = Bench::new::<CsvSource>(settings, 20.0, &[]).unwrap();
        near(&bench.run_source(6)[0], &[1.0, 1.0, 1.0, 1.0, 3.0, 3.0]);
    }

    #[test]
    fn times_without_bounds_do_not_overflow() {
        let file = File::new("time_s,force_n\n-1e308,1\n1e308,3\n");
        let mut bench = Bench::new::<CsvSource>(file.settings("force_n", "force"), 10.0, &[]).unwrap();
        assert_eq!(bench.run_source(1)[0], [1.0]);
    }

    #[test]
    fn what_does_not_fit_is_refused_at_its_field() {
        let file = File::new("time_s,force_n\n0,1\n0,3\n");
        let field = |settings| Bench::new::<CsvSource>(settings, 10.0, &[]).err().and_then(|e| e.field);
        assert_eq!(field(file.settings("force_n", "speed")), Some("quantity"));
        assert_eq!(field(file.settings("pull_n", "force")), Some("column"));
        assert_eq!(field(file.settings("force_n", "force")), Some("file"), "time stands still");
        let file = File::new("force_n\nmany\n");
        assert_eq!(field(file.settings("force_n", "force")), Some("file"));
        let refused = Bench::new::<CsvSource>(file.settings("force_n", "force"), 10.0, &[]).err().unwrap();
        assert!(refused.to_string().contains("\"many\" in force_n"), "{refused}");
        let file = File::new("time_s,force_n\n0,\n1,\n");
        assert_eq!(field(file.settings("force_n", "force")), Some("file"), "no value");
    }

    #[test]
    fn what_is_no_row_is_refused_at_its_line_and_column() {
        let cases: [(&[u8], &str, &str); 6] = [
            (b"x,force_n\r\n1,2\r\n3\r\n", "line 3:", "1 cell where the header has 2"),
            (b"x,force_n\n1,2\n# remark\n\n3\n", "line 5:", "1 cell where the header has 2"),
            (b"x,force_n\n1,2\n1,2,3\n", "line 3:", "3 cells where the header has 2"),
            (b"x,force_n\n1,2\n1,\xb5\n", "line 3, column 2", "in force_n"),
            (b"\xff\xfex\0", "line 1:", "UTF-8"),
            (b"x,force_n\n# remark\n1,many\n", "line 3, column 2", "\"many\" in force_n"),
        ];
        for (text, at, what) in cases {
            let file = File::new(text);
            let settings = file.settings("force_n", "force");
            let refused = Bench::new::<CsvSource>(settings, 10.0, &[]).err().unwrap();
            assert_eq!(refused.field, Some("file"));
            let said = refused.to_string();
            assert!(said.contains(at) && said.contains(what), "{said}");
        }
    }

    #[test]
    fn a_slower_column_holds_where_its_cells_are_empty() {
        let file = File::new("time_s,accel_m_s2,force_n\n0.0,1,\n0.1,2,5\n0.2,3,\n0.3,4,7\n0.4,5,\n");
        let mut bench = Bench::new::<CsvSource>(file.settings("force_n", "force"), 10.0, &[]).unwrap();
        assert_eq!(bench.run_source(5)[0], [5.0, 5.0, 5.0, 7.0, 7.0]);
        let mut bench =
            Bench::new::<CsvSource>(file.settings("accel_m_s2", "acceleration"), 10.0, &[]).unwrap();
        let read = bench.run_source(5).remove(0);
        assert!(read.iter().zip([1.0, 2.0, 3.0, 4.0, 5.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{read:?}");
    }
}
