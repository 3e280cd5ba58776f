//! A sink that writes signals to a CSV file.

use haptograph_engine::frame::{AnyKind, Kind};
use haptograph_engine::node::{BuildError, FileContext, FileKind, FileSink, FrameWriter, Many, Port, Stream};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::{inside_the_run, note, sync};
use haptograph_signal::units;

haptograph_engine::settings! {
    /// Settings of [`CsvSink`].
    pub struct CsvSinkSettings {
        /// Name of the file in the run's folder.
        [output_file] file: String;
    }
}

haptograph_engine::node! {
    /// Writes signals of one rate to a CSV file: a column `time_s`, then one for each component of each signal, named after
    /// its port with its SI unit: `stylus.force_n`. Numbers have full precision. Beside it, `<file>.ron` states what the
    /// columns are and whether they were simulated.
    /// Elsewhere: writetable, writematrix.
    pub struct CsvSink(CsvSinkSettings) in "sinks";
    example: r#""table": CsvSink(inputs: ["stylus.position", "stylus.force"], file: "stylus.csv")"#;
    in INPUTS: AnyKind, Many = Port::any("Signals of any kinds and quantities, all of one rate.");
}

impl FileKind for CsvSink {
    fn build(settings: CsvSinkSettings, cx: &FileContext) -> Result<Box<dyn FileSink>, BuildError> {
        let streams = &cx.streams;
        if let Some(other) = streams.iter().find(|stream| stream.rate != streams[0].rate) {
            let message = format!(
                "{} has {} but {} has {}; all columns of a CSV file need one rate",
                streams[0].name, streams[0].rate, other.name, other.rate
            );
            return Err(BuildError::at("inputs", message).help("use one `CsvSink` for each rate"));
        }
        Ok(Box::new(Table { file: inside_the_run(&settings.file, &["csv"])? }))
    }
}

#[derive(Debug)]
struct Table {
    file: PathBuf,
}

impl FileSink for Table {
    fn file_name(&self) -> &Path {
        &self.file
    }

    fn open(&self, path: &Path, streams: &[Stream]) -> io::Result<Box<dyn FrameWriter>> {
        let columns = streams.iter().flat_map(columns_of);
        let header = std::iter::once("time_s".to_owned()).chain(columns);
        let header: Vec<String> = header.map(quoted).collect();
        let text = format!("{}\n", header.join(",")).into_bytes();
        note::write(path, "The columns of the CSV file of this name.", &facts(streams))?;
        let mut rows = Rows {
            file: File::create(path)?,
            text,
            whole_bytes: 0,
            waiting: streams.iter().map(|stream| (stream.kind.width(), VecDeque::new())).collect(),
            period_s: streams.first().map_or(0.0, |stream| stream.rate.period_s()),
            row: 0,
            flushed_row: 0,
            flushed_at: Instant::now(),
        };
        rows.flush()?;
        Ok(Box::new(rows))
    }
}

/// Facts of the note: rate and origin, then every column.
fn facts(streams: &[Stream]) -> Vec<String> {
    let described = streams.iter().flat_map(|stream| {
        let meaning = note::meaning(stream).join(", ");
        let simulated = stream.simulated;
        let described = move |name| format!("        (name: {name:?}, {meaning}, simulated: {simulated}),\n");
        columns_of(stream).into_iter().map(described)
    });
    let columns = format!("columns: [\n{}    ]", described.collect::<String>());
    note::origin(streams).into_iter().chain([columns]).collect()
}

/// `stylus.force_n`, `stylus.position_x_m`, `contact.ihip_x`: components of a linear kind carry its unit.
fn columns_of(stream: &Stream) -> Vec<String> {
    let is_wrench = stream.kind == Kind::WRENCH;
    let unit =
        if stream.kind.is_linear() && !is_wrench { units::suffix(stream.quantity) } else { String::new() };
    let named = |component: &&str| match *component {
        "" => format!("{}{unit}", stream.name),
        force if is_wrench && force.starts_with("force") => format!("{}_{force}_n", stream.name),
        torque if is_wrench => format!("{}_{torque}_n_m", stream.name),
        component => format!("{}_{component}{unit}", stream.name),
    };
    stream.kind.spec().components.iter().map(named).collect()
}

/// A name as it stands in a header: in quotes if it would not end with its cell.
fn quoted(name: String) -> String {
    match name.contains([',', ';', '"']) || name.trim() != name {
        true => format!("\"{}\"", name.replace('"', "\"\"")),
        false => name,
    }
}

struct Rows {
    file: File,
    /// Complete rows that are not written yet.
    text: Vec<u8>,
    /// Bytes of the file, which always ends with a complete row.
    whole_bytes: u64,
    /// Width of each stream, and its samples that wait for those of the others.
    waiting: Vec<(usize, VecDeque<f64>)>,
    period_s: f64,
    row: u64,
    /// Time of the last write.
    flushed_row: u64,
    flushed_at: Instant,
}

/// Longest time between writes, both of the writer's clock and of the signal.
const PACE: Duration = Duration::from_secs(1);
/// Buffered bytes that cause a write.
const BUFFER_BYTES: usize = 1 << 16;

impl Rows {
    fn flush(&mut self) -> io::Result<()> {
        self.flushed_row = self.row;
        self.flushed_at = Instant::now();
        let result = self.file.write_all(&self.text);
        match result {
            Ok(()) => self.whole_bytes += self.text.len() as u64,
            // After an error (a full disk) a partial row would be misread: cut it off. Report the first error.
            Err(_) => _ = self.file.set_len(self.whole_bytes),
        }
        self.text.clear();
        result
    }

    fn is_due(&self) -> bool {
        let signal_s = (self.row - self.flushed_row) as f64 * self.period_s;
        signal_s >= PACE.as_secs_f64() || self.row > self.flushed_row && self.flushed_at.elapsed() >= PACE
    }
}

impl FrameWriter for Rows {
    fn write(&mut self, stream: usize, frames: &[f64]) -> io::Result<()> {
        if let Some((_, lanes)) = self.waiting.get_mut(stream) {
            lanes.extend(frames);
        }
        while self.waiting.iter().all(|(width, lanes)| lanes.len() >= *width) {
            write!(self.text, "{}", self.row as f64 * self.period_s)?;
            self.row += 1;
            for (width, lanes) in &mut self.waiting {
                for lane in lanes.drain(..*width) {
                    write!(self.text, ",{lane}")?;
                }
            }
            self.text.push(b'\n');
            if self.text.len() >= BUFFER_BYTES {
                self.flush()?;
            }
        }
        if self.is_due() {
            self.flush()?;
            sync::request(&self.file);
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::quantity::Quantity;
    use haptograph_signal::time::Rate;

    fn context(streams: &[Stream]) -> FileContext {
        FileContext { streams: streams.to_vec(), graph_seed: 1 }
    }

    fn stream(name: &str, kind: Kind, quantity: Quantity, rate: &str) -> Stream {
        Stream {
            name: name.into(),
            kind,
            quantity,
            rate: Rate::parse(rate).unwrap(),
            simulated: name.starts_with("stylus"),
        }
    }

    #[test]
    fn rows_wait_until_every_signal_has_come() {
        let folder = tempfile::tempdir().unwrap();
        let streams = [
            stream("stylus.position", Kind::VECTOR, Quantity::LENGTH, "125"),
            stream("stylus.force", Kind::SCALAR, Quantity::FORCE, "125"),
        ];
        let sink = CsvSink::build(CsvSinkSettings { file: "x.csv".into() }, &context(&streams)).unwrap();
        let path = folder.path().join(sink.file_name());
        let mut writer = sink.open(&path, &streams).unwrap();
        writer.write(0, &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]).unwrap();
        writer.write(1, &[1.5]).unwrap();
        writer.write(1, &[1e-7]).unwrap();
        writer.finish().unwrap();
        let note = std::fs::read_to_string(folder.path().join("x.csv.ron")).unwrap();
        let force = r#"(name: "stylus.force_n", quantity: "force", unit: "N", simulated: true)"#;
        assert!(note.contains("    simulated: true,\n") && note.contains(force), "{note}");
        let text = std::fs::read_to_string(path).unwrap();
        assert_eq!(
            text,
            "time_s,stylus.position_x_m,stylus.position_y_m,stylus.position_z_m,stylus.force_n\n\
             0,0.1,0.2,0.3,1.5\n0.008,0.4,0.5,0.6,0.0000001\n"
        );
    }

    #[test]
    fn names_of_any_characters_are_read_back_from_the_header() {
        let names = ["a, b; c; d.force_n", "the \"first\".force_n", " plain.force_n"];
        let header: Vec<String> = names.iter().map(|name| quoted((*name).to_owned())).collect();
        let text = format!("{}\n1,2,3\n", header.join(","));
        let mut table = haptograph_signal::csv::CsvTable::new(text.as_bytes(), &[]).unwrap();
        let read = table.head().names.clone();
        assert_eq!(read, names.map(str::trim));
        assert!(table.next_row().is_ok_and(|row| row.is_some()));
    }

    #[test]
    fn whole_rows_are_in_the_file_every_second() {
        let folder = tempfile::tempdir().unwrap();
        let streams = [stream("stylus.force", Kind::SCALAR, Quantity::FORCE, "125")];
        let sink = CsvSink::build(CsvSinkSettings { file: "x.csv".into() }, &context(&streams)).unwrap();
        let path = folder.path().join("x.csv");
        let mut writer = sink.open(&path, &streams).unwrap();
        for second in 1..=3 {
            for _ in 0..25 {
                writer.write(0, &[0.5; 5]).unwrap();
            }
            let text = std::fs::read_to_string(&path).unwrap();
            assert_eq!(text.lines().count(), 1 + 125 * second);
            assert!(text.ends_with(",0.5\n"));
        }
    }

    #[test]
    fn a_full_disk_is_said_when_rows_are_written() {
        // A device that takes nothing stands for a full disk.
        let Ok(full) = File::options().write(true).open("/dev/full") else {
            return;
        };
        let mut rows = Rows {
            file: full,
            text: Vec::new(),
            whole_bytes: 0,
            waiting: vec![(1, VecDeque::new())],
            period_s: 0.01,
            row: 0,
            flushed_row: 0,
            flushed_at: Instant::now(),
        };
        assert!(rows.write(0, &[1.0; 10]).is_ok(), "nothing is due yet");
        let failed = rows.write(0, &[1.0; 95]).unwrap_err();
        assert_eq!(failed.kind(), io::ErrorKind::StorageFull);
    }

    #[test]
    fn one_table_has_one_rate() {
        let streams = [
            stream("a.x", Kind::SCALAR, Quantity::FORCE, "125"),
            stream("b.x", Kind::SCALAR, Quantity::FORCE, "240"),
        ];
        let refused = CsvSink::build(CsvSinkSettings { file: "x.csv".into() }, &context(&streams)).err();
        assert_eq!(refused.and_then(|e| e.field), Some("inputs"));
    }
}
