//! Files as other people's loggers write them.

use super::*;
use std::io::Write;
use std::path::PathBuf;

pub(super) struct Folder(tempfile::TempDir);

impl Folder {
    pub(super) fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    pub(super) fn with(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).expect("a file");
        path
    }
}

pub(super) fn read(
    paths: &[PathBuf],
    import: &ImportSettings,
) -> Result<(ProcessedRecording, Vec<Finding>), LoadError> {
    load_with(paths, import).map(|(recording, findings)| match recording {
        AnyRecording::Processed(processed) => (
            processed,
            findings.into_iter().map(|(_, finding)| finding).collect(),
        ),
        AnyRecording::Raw(_) => panic!("a raw recording"),
    })
}

pub(super) fn line_of(error: LoadError) -> (u64, usize) {
    match error {
        LoadError::Read {
            source: ReadError::CsvCell { line, column, .. },
            ..
        } => (line, column),
        LoadError::Read {
            source: ReadError::Csv { line, .. },
            ..
        } => (line, 0),
        error => panic!("{error}"),
    }
}

/// Rows of a drag at 1 kHz, as (time s, vibration m/s², force N, speed mm/s).
pub(super) fn rows(count: usize) -> impl Iterator<Item = (f64, f64, f64, f64)> {
    (0..count).map(|i| {
        (
            i as f64 / 1000.0,
            (i as f64 * 0.7).sin(),
            1.0 + (i as f64 * 0.01).sin() * 0.1,
            80.0,
        )
    })
}

const HEAD: &str = "time_s,accel_m_s2,force_normal_n,speed_mm_s\n";

fn table(count: usize) -> Vec<String> {
    rows(count)
        .map(|(t, a, f, v)| format!("{t:.4},{a},{f},{v}\n"))
        .collect()
}

#[test]
fn columns_and_units_are_said_where_the_file_does_not() {
    let folder = Folder::new();
    let path = folder.with(
        "x.csv",
        "t;acc;Fz;v;note\n0;0,5;1;100;a\n1;1,0;2;200;b\n2;-0,5;2;200;c\n",
    );
    let import = ImportSettings::default()
        .with_column("time", "t")
        .and_then(|s| s.with_unit("time", "ms"))
        .and_then(|s| s.with_column("accel", "acc"))
        .and_then(|s| s.with_unit("accel", "g"))
        .and_then(|s| s.with_column("force_normal", "Fz"))
        .and_then(|s| s.with_unit("force", "N"))
        .and_then(|s| s.with_column("speed", "v"))
        .and_then(|s| s.with_unit("speed", "mm/s"))
        .expect("known names and units");
    let (recording, findings) = read(std::slice::from_ref(&path), &import).expect("a recording");
    let signals = recording.signals();
    assert_eq!(signals.rate_hz, 1000.0);
    assert_eq!(signals.acceleration_m_s2, [4.903325, 9.80665, -4.903325]);
    assert_eq!(signals.speed_m_s, [0.1, 0.2, 0.2]);
    let columns = vec!["note".to_owned()];
    assert_eq!(findings, [Finding::NotUsed { columns }]);
    // Without a unit, at the header's cell.
    let unsaid = ImportSettings::default()
        .with_column("accel", "acc")
        .expect("a quantity");
    assert_eq!(
        line_of(read(std::slice::from_ref(&path), &unsaid).expect_err("no unit")),
        (1, 2)
    );
    let nowhere = import.with_column("speed", "w").expect("a quantity");
    assert_eq!(line_of(read(&[path], &nowhere).expect_err("no column")), (1, 0));
    assert!(ImportSettings::default().with_unit("accel", "N").is_err());
    assert!(ImportSettings::default().with_column("colour", "x").is_err());
}

#[test]
fn rates_and_constants_are_said_where_the_file_does_not() {
    let folder = Folder::new();
    let path = folder.with("taxels.csv", "channel7\n10\n20\n10\n");
    let import = ImportSettings {
        rate_hz: Some(500.0),
        ..ImportSettings::default()
    };
    let import = import
        .with_column("accel", "channel7")
        .and_then(|s| s.with_unit("accel", "1"))
        .and_then(|s| s.with_constant("speed_mm_s", "10"))
        .and_then(|s| s.with_constant("force_normal_n", "1.2"))
        .expect("known names and units");
    let (recording, findings) = read(&[path], &import).expect("a recording");
    let signals = recording.signals();
    assert_eq!((signals.rate_hz, &signals.speed_m_s[..]), (500.0, &[0.01; 3][..]));
    assert_eq!(
        (&signals.force_normal_n[..], &signals.acceleration_m_s2[..]),
        (&[1.2; 3][..], &[10.0, 20.0, 10.0][..])
    );
    assert_eq!(findings, [Finding::UnknownUnit]);
    assert!(recording.provenance().settings.contains_key("vibration unit"));
}

#[test]
fn single_cells_and_outliers_are_repaired_and_counted_or_refused() {
    let folder = Folder::new();
    let mut lines = table(500);
    lines[100] = "0.1000,?,1,80\n".to_owned();
    lines[200] = "0.2000,0.1,,80\n".to_owned();
    lines[300] = "0.3000,9000,1,80\n".to_owned();
    // A logger that lost power.
    lines[499] = "0.4990,0.1\n".to_owned();
    let path = folder.with("x.csv", format!("{HEAD}{}", lines.concat()));
    let (recording, findings) =
        read(std::slice::from_ref(&path), &ImportSettings::default()).expect("a recording");
    assert_eq!(recording.samples(), 500);
    assert!(
        recording
            .signals()
            .acceleration_m_s2
            .iter()
            .all(|a| a.abs() < 1.1)
    );
    let interpolated = |quantity: &str, unreadable, empty| Finding::Interpolated {
        quantity: quantity.to_owned(),
        unreadable,
        empty,
        of: 500,
        first: (unreadable > 0).then(|| BadCell {
            line: 102,
            column: 2,
            text: Some("?".to_owned()),
        }),
    };
    let spike = Finding::Outliers {
        quantity: "accel".to_owned(),
        count: 1,
    };
    let expected = [
        interpolated("accel", 1, 0),
        spike,
        interpolated("force_normal", 0, 2),
        interpolated("speed", 0, 1),
    ];
    assert_eq!(findings, expected);
    assert_eq!(
        line_of(read(&[path], &ImportSettings::strict()).expect_err("strict")),
        (501, 0)
    );
    // One in ten is no accident.
    for row in (0..500).step_by(10) {
        lines[row] = "0.1,?,1,80\n".to_owned();
    }
    let path = folder.with("y.csv", format!("{HEAD}{}", lines.concat()));
    assert_eq!(
        line_of(read(&[path], &ImportSettings::default()).expect_err("unreadable")),
        (2, 2)
    );
}

#[test]
fn gaps_are_refused_where_they_are_and_jitter_is_not() {
    let folder = Folder::new();
    let mut lines = table(1000);
    lines.drain(500..600);
    let gap = folder.with("gap.csv", format!("{HEAD}{}", lines.concat()));
    assert_eq!(
        line_of(read(&[gap], &ImportSettings::default()).expect_err("a gap")),
        (502, 0)
    );
    let jittered: String = rows(1000)
        .enumerate()
        .map(|(i, (t, a, f, v))| format!("{:.6},{a},{f},{v}\n", t + if i % 2 == 1 { 0.0002 } else { 0.0 }))
        .collect();
    let path = folder.with("jitter.csv", format!("{HEAD}{jittered}"));
    let (recording, findings) =
        read(std::slice::from_ref(&path), &ImportSettings::default()).expect("a recording");
    assert_eq!(recording.rate_hz(), 1000.0);
    assert!(
        matches!(findings[..], [Finding::Jitter { missing_rows: 0, .. }]),
        "{findings:?}"
    );
    // By the flag, times do not count.
    let import = ImportSettings {
        rate_hz: Some(2000.0),
        ..ImportSettings::default()
    };
    let (recording, findings) = read(&[path], &import).expect("a recording");
    assert_eq!(
        (recording.rate_hz(), recording.samples(), findings),
        (
            2000.0,
            1000,
            vec![Finding::TimesNotUsed {
                column: "time_s".to_owned()
            }]
        )
    );
}

#[test]
fn a_speed_of_200_m_s_is_implausible() {
    let folder = Folder::new();
    let lines: String = rows(100)
        .map(|(t, a, f, _)| format!("{t},{a},{f},200\n"))
        .collect();
    let path = folder.with(
        "x.csv",
        format!("time_s,accel_m_s2,force_normal_n,speed_m_s\n{lines}"),
    );
    let (_, findings) = read(&[path], &ImportSettings::default()).expect("a recording");
    assert!(
        matches!(
            findings[..],
            [Finding::Implausible {
                quantity: "speed",
                ..
            }]
        ),
        "{findings:?}"
    );
}

#[test]
fn files_of_a_take_are_joined_by_time_or_by_name() {
    let folder = Folder::new();
    let fast: String = rows(1000).map(|(t, a, ..)| format!("{t},{a}\n")).collect();
    let slow: String = (0..80)
        .map(|i| {
            format!(
                "{},{},{}\n",
                0.1 + f64::from(i) / 100.0,
                1.0 + f64::from(i) / 100.0,
                50
            )
        })
        .collect();
    let accel = folder.with("accel.csv", format!("time_s,accel_m_s2\n{fast}"));
    let motion = folder.with("motion.csv", format!("time_s,force_normal_n,speed_mm_s\n{slow}"));
    let (recording, _) = read(&[motion, accel], &ImportSettings::default()).expect("a recording");
    let signals = recording.signals();
    // From 0.1 s to 0.89 s, at the rate of the vibration.
    assert_eq!((signals.rate_hz, recording.samples()), (1000.0, 791));
    assert!((signals.acceleration_m_s2[0] - (100.0 * 0.7_f64).sin()).abs() < 1e-9);
    assert!((signals.force_normal_n[5] - 1.005).abs() < 1e-9);

    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 1000,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let wav = folder.0.path().join("take.wav");
    let mut writer = hound::WavWriter::create(&wav, spec).expect("a file");
    rows(900).for_each(|(_, a, ..)| writer.write_sample(a as f32 / 50.0).expect("a sample"));
    writer.finalize().expect("a file");
    folder.with("take.csv", format!("time_s,force_normal_n,speed_mm_s\n{slow}"));
    assert!(
        read(std::slice::from_ref(&wav), &ImportSettings::default()).is_err(),
        "no full scale"
    );
    let import = ImportSettings {
        full_scale_m_s2: Some(50.0),
        ..ImportSettings::default()
    };
    let (recording, _) = read(&[wav], &import).expect("a recording");
    assert_eq!((recording.rate_hz(), recording.samples()), (1000.0, 791));
    assert!((recording.signals().acceleration_m_s2[0] - (100.0 * 0.7_f64).sin()).abs() < 1e-5);
}

#[test]
fn what_is_wrong_with_a_take_is_told_of_the_file_it_is_in() {
    let folder = Folder::new();
    let fast: String = rows(1000).map(|(t, a, ..)| format!("{t},{a}\n")).collect();
    let accel = folder.with("accel.csv", format!("time_s,accel_m_s2\n{fast}"));
    let place = |name: &str, text: String| {
        let motion = folder.with(name, text);
        match read(&[accel.clone(), motion.clone()], &ImportSettings::default()).expect_err(name) {
            LoadError::Read { path, source } => {
                assert_eq!(path, motion, "{source}");
                line_of(LoadError::Read { path, source }).0
            }
            error => panic!("{error}"),
        }
    };
    let slow: Vec<String> = (0..80)
        .map(|i| format!("{},1,50\n", f64::from(i) / 100.0))
        .collect();
    let head = "time_s,force_normal_n,speed_mm_s\n";
    let gap = format!("{head}{}{}", slow[..30].concat(), slow[50..].concat());
    assert_eq!(place("gap.csv", gap), 32);
    let worse: String = (0..80)
        .map(|i| format!("{},x,50\n", f64::from(i) / 100.0))
        .collect();
    assert_eq!(place("cells.csv", format!("{head}{worse}")), 2);
    let wrong_gesture = format!("# gesture: wave\n{head}{}", slow.concat());
    assert_eq!(place("gesture.csv", wrong_gesture), 1);
}

/// An element of a MATLAB file.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut bytes = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
    bytes.extend(data);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

fn variable(name: &str, rows: i32, columns: i32, values: &[f64]) -> Vec<u8> {
    let flags = [6_u32.to_le_bytes(), [0; 4]].concat();
    let size = [rows.to_le_bytes(), columns.to_le_bytes()].concat();
    let values: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
    let parts = [
        element(6, &flags),
        element(5, &size),
        element(1, name.as_bytes()),
        element(9, &values),
    ];
    element(14, &parts.concat())
}

fn matlab_file(variables: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = b"MATLAB 5.0 MAT-file".to_vec();
    bytes.resize(124, b' ');
    bytes.extend([0, 1, b'I', b'M']);
    for (index, variable) in variables.iter().enumerate() {
        if index % 2 == 0 {
            bytes.extend(variable);
            continue;
        }
        let mut encoder = flate2::write::ZlibEncoder::new(vec![], flate2::Compression::default());
        encoder.write_all(variable).expect("memory");
        let packed = encoder.finish().expect("memory");
        bytes.extend([15_u32.to_le_bytes(), (packed.len() as u32).to_le_bytes()].concat());
        bytes.extend(packed);
    }
    bytes
}

#[test]
fn matlab_variables_are_columns() {
    let folder = Folder::new();
    let column = |of: fn((f64, f64, f64, f64)) -> f64| rows(200).map(of).collect::<Vec<_>>();
    let (accel, force, speed) = (column(|r| r.1), column(|r| r.2), column(|r| r.3));
    let file = matlab_file(&[
        variable("accel_m_s2", 200, 1, &accel),
        variable("force_normal_n", 1, 200, &force),
        variable("speed_mm_s", 200, 1, &speed),
        variable("fs", 1, 1, &[1000.0]),
    ]);
    let path = folder.with("x.mat", &file);
    let (recording, _) = read(&[path], &ImportSettings::default()).expect("a recording");
    assert_eq!(
        (recording.rate_hz(), &recording.signals().acceleration_m_s2),
        (1000.0, &accel)
    );
    assert_eq!(recording.signals().force_normal_n, force);
    for end in [130, 500, file.len() - 3] {
        let path = folder.with("cut.mat", &file[..end]);
        assert!(read(&[path], &ImportSettings::default()).is_err(), "{end}");
    }
    let newer = folder.with("new.mat", b"MATLAB 7.3 MAT-file, and HDF5 from here on");
    let error = read(&[newer], &ImportSettings::default())
        .expect_err("HDF5")
        .to_string();
    assert_eq!(error.matches("7.3").count(), 1, "{error}");
}

/// A workbook whose last cell of acceleration is `last`, with `more` rows.
#[cfg(feature = "spreadsheets")]
fn workbook(last: &str, more: &str) -> Vec<u8> {
    let cells = |row: usize, cells: &[String]| {
        let cells: String = cells.concat();
        format!("<row r=\"{row}\">{cells}</row>")
    };
    let text = |at: &str, text: &str| format!("<c r=\"{at}\" t=\"inlineStr\"><is><t>{text}</t></is></c>");
    let number = |at: String, x: f64| format!("<c r=\"{at}\"><v>{x}</v></c>");
    let mut sheet = cells(1, &[text("A1", "# rate_hz: 1000")]);
    sheet += &cells(
        2,
        &[
            text("A2", "accel_m_s2"),
            text("B2", "force_normal_n"),
            text("C2", "speed_mm_s"),
        ],
    );
    for (i, (_, a, f, v)) in rows(30).enumerate() {
        let row = i + 3;
        sheet += &cells(
            row,
            &[
                number(format!("A{row}"), a),
                number(format!("B{row}"), f),
                number(format!("C{row}"), v),
            ],
        );
    }
    sheet += &cells(
        33,
        &[
            text("A33", last),
            number("B33".into(), 1.0),
            number("C33".into(), 80.0),
        ],
    );
    let main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main";
    let relations = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
    let package = "http://schemas.openxmlformats.org/package/2006";
    let members = [
        (
            "[Content_Types].xml",
            format!("<Types xmlns=\"{package}/content-types\"/>"),
        ),
        (
            "_rels/.rels",
            format!(
                "<Relationships xmlns=\"{package}/relationships\"><Relationship Id=\"rId1\" Type=\"{relations}/officeDocument\" Target=\"xl/workbook.xml\"/></Relationships>"
            ),
        ),
        (
            "xl/workbook.xml",
            format!(
                "<workbook xmlns=\"{main}\" xmlns:r=\"{relations}\"><sheets><sheet name=\"s\" sheetId=\"1\" r:id=\"rId1\"/></sheets></workbook>"
            ),
        ),
        (
            "xl/_rels/workbook.xml.rels",
            format!(
                "<Relationships xmlns=\"{package}/relationships\"><Relationship Id=\"rId1\" Type=\"{relations}/worksheet\" Target=\"worksheets/sheet1.xml\"/></Relationships>"
            ),
        ),
        (
            "xl/worksheets/sheet1.xml",
            format!("<worksheet xmlns=\"{main}\"><sheetData>{sheet}{more}</sheetData></worksheet>"),
        ),
    ];
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(vec![]));
    for (name, text) in members {
        let stored =
            zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        archive.start_file(name, stored).expect("memory");
        archive.write_all(text.as_bytes()).expect("memory");
    }
    archive.finish().expect("memory").into_inner()
}

#[cfg(feature = "spreadsheets")]
#[test]
fn a_spreadsheet_is_a_table_and_its_errors_name_the_cell() {
    let folder = Folder::new();
    let path = folder.with("x.xlsx", workbook("0.5", ""));
    let (recording, _) = read(&[path], &ImportSettings::default()).expect("a recording");
    let expected: Vec<f64> = rows(30).map(|row| row.1).chain([0.5]).collect();
    assert_eq!(
        (recording.rate_hz(), &recording.signals().acceleration_m_s2),
        (1000.0, &expected)
    );
    let path = folder.with("y.xlsx", workbook("broken", ""));
    assert_eq!(
        line_of(read(&[path], &ImportSettings::strict()).expect_err("no number")),
        (33, 1)
    );
}

#[cfg(feature = "spreadsheets")]
#[test]
fn a_damaged_spreadsheet_is_refused_at_the_last_cell_that_was_read() {
    let folder = Folder::new();
    let unknown = "<row r=\"34\"><c r=\"A34\"><v>1</v></c><c r=\"B34\" t=\"tea\"><v>1</v></c></row>";
    let path = folder.with("x.xlsx", workbook("0.5", unknown));
    let Err(LoadError::Read {
        source: ReadError::Sheet { sheet, after, .. },
        ..
    }) = read(&[path], &ImportSettings::default())
    else {
        panic!("the sheet is damaged");
    };
    assert_eq!((sheet.as_str(), after), ("s", Some((34, 1))));
    // A member that is not what its checksum says.
    let mut bytes = workbook("0.5", "");
    let at = bytes.windows(4).position(|four| four == b"<row").expect("a row");
    bytes[at] = b' ';
    let path = folder.with("y.xlsx", bytes);
    let error = read(&[path], &ImportSettings::default()).expect_err("damaged");
    assert!(
        error.to_string().contains("`xl/worksheets/sheet1.xml`"),
        "{error}"
    );
}

#[test]
fn other_spreadsheets_are_refused_with_what_to_do() {
    let folder = Folder::new();
    let old = folder.with("old.xls", [&[0xd0, 0xcf, 0x11, 0xe0][..], &[0; 600]].concat());
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(vec![]));
    archive
        .start_file("content.xml", zip::write::SimpleFileOptions::default())
        .expect("memory");
    let open = folder.with("open.ods", archive.finish().expect("memory").into_inner());
    for path in [old, open] {
        let error = read(&[path], &ImportSettings::default()).expect_err("it is not read");
        assert!(error.to_string().contains("save the file as"), "{error}");
    }
}

pub(super) fn import(columns: &[(&str, &str)], units: &[(&str, &str)]) -> ImportSettings {
    let import = columns
        .iter()
        .fold(ImportSettings::default(), |import, (quantity, column)| {
            import.with_column(quantity, column).expect("a quantity")
        });
    units.iter().fold(import, |import, (quantity, unit)| {
        import.with_unit(quantity, unit).expect("a unit")
    })
}

#[test]
fn a_preamble_and_a_row_of_units_are_no_data() {
    let folder = Folder::new();
    let lines = "0;0,5;1;100\n1;1,0;2;200\n2;-0,5;2;200\n";
    let table = format!("Logger 7;\nDatum: 3.4.2024;12\n\nt;Beschl\u{e4};Kraft;v\nms;g;N;mm/s\n{lines}");
    let latin: Vec<u8> = table
        .chars()
        .map(|c| u8::try_from(u32::from(c)).expect("Latin-1"))
        .collect();
    let mapped = import(
        &[
            ("time", "t"),
            ("accel", "Beschl\u{e4}"),
            ("force_normal", "Kraft"),
            ("speed", "v"),
        ],
        &[],
    );
    for (name, bytes) in [("utf8.csv", table.clone().into_bytes()), ("latin.csv", latin)] {
        let path = folder.with(name, bytes);
        let (recording, findings) = read(&[path], &mapped).expect("a recording");
        let signals = recording.signals();
        assert_eq!(signals.acceleration_m_s2, [4.903325, 9.80665, -4.903325]);
        assert_eq!(
            (signals.rate_hz, &signals.speed_m_s[..]),
            (1000.0, &[0.1, 0.2, 0.2][..])
        );
        assert_eq!(findings, []);
    }
    // Without a mapping the header is told by its shape, and all that is missing at once.
    let path = folder.with("unsaid.csv", &table);
    let Err(LoadError::Read {
        source: ReadError::Missing {
            missing,
            columns,
            hints,
        },
        ..
    }) = read(&[path], &ImportSettings::default())
    else {
        panic!("columns are missing")
    };
    assert_eq!(missing, ["accel", "force_normal", "speed", "time"]);
    assert_eq!(columns, ["t", "Beschl\u{e4}", "Kraft", "v"]);
    // Each with its column, and without a unit, as the row below the header says it.
    let filled = [
        "accel=\"Beschl\u{e4}\"",
        "force_normal=\"Kraft\"",
        "speed=\"v\"",
        "time=\"t\"",
    ];
    for (hint, filled) in hints.iter().zip(filled) {
        assert!(
            hint.starts_with(&format!("--column {filled}")) && !hint.contains("--unit"),
            "{hint}"
        );
    }
    let twice = folder.with("twice.csv", "x\ntime_s,accel_g\n1,2\ntime_s,accel_g\n1,2\n");
    assert_eq!(
        line_of(read(&[twice], &ImportSettings::default()).expect_err("two headers")),
        (2, 0)
    );
    let words = folder.with(
        "words.csv",
        format!("t;Beschl\u{e4};Kraft;v\nsec;Gs;Newton;kmh\n{lines}"),
    );
    assert_eq!(
        line_of(read(&[words], &mapped).expect_err("unknown units")),
        (2, 0)
    );
    let half = folder.with(
        "half.csv",
        format!("t;Beschl\u{e4};Kraft;v\nms;Gs;N;mm/s\n{lines}"),
    );
    assert_eq!(
        line_of(read(&[half], &mapped).expect_err("an unknown unit")),
        (1, 2)
    );
}

#[test]
fn units_in_brackets_are_understood_and_contradictions_said() {
    let folder = Folder::new();
    let rows = "0,0.5,1,100\n0.001,1,2,200\n0.002,-0.5,2,200\n";
    let ours = folder.with(
        "ours.csv",
        format!("time [s],accel [g],force_normal [N],speed (mm/s)\n{rows}"),
    );
    let (recording, findings) = read(std::slice::from_ref(&ours), &ImportSettings::default()).expect("units");
    assert_eq!(recording.signals().acceleration_m_s2[0], 4.903325);
    assert_eq!((recording.signals().speed_m_s[0], findings), (0.1, vec![]));
    let theirs = folder.with(
        "theirs.csv",
        format!("Zeit [s],Beschleunigung [g],Kraft [N],v [mm/s]\n{rows}"),
    );
    let columns = [
        ("time", "Zeit [s]"),
        ("accel", "Beschleunigung [g]"),
        ("force_normal", "Kraft [N]"),
        ("speed", "v [mm/s]"),
    ];
    let (mapped, _) = read(&[theirs], &import(&columns, &[])).expect("units in brackets");
    assert_eq!(mapped.signals(), recording.signals());
    let (other, findings) = read(&[ours], &import(&[], &[("speed", "m/s")])).expect("the given unit counts");
    assert_eq!(other.signals().speed_m_s[0], 100.0);
    assert!(findings.contains(&Finding::OtherUnit {
        column: "speed (mm/s)".to_owned(),
        given: "speed=m/s".to_owned()
    }));
    assert!(findings.iter().any(|finding| matches!(
        finding,
        Finding::Implausible { column, largest: 200.0, .. } if column == "speed (mm/s)"
    )));
}

#[test]
fn strange_rates_and_clipped_samples_are_noticed() {
    let folder = Folder::new();
    let lines: String = rows(200)
        .map(|(t, a, f, v)| format!("{},{},{f},{v}\n", t * 100.0, a.clamp(-0.8, 0.8)))
        .collect();
    let path = folder.with("leder.csv", format!("{HEAD}{lines}"));
    let (recording, findings) = read(&[path], &ImportSettings::default()).expect("a recording");
    assert!(
        matches!(&findings[0], Finding::StrangeRate { column, rate_hz: 10.0 } if column == "time_s"),
        "{findings:?}"
    );
    let cut = recording
        .signals()
        .acceleration_m_s2
        .iter()
        .filter(|a| a.abs() == 0.8)
        .count();
    let Some(Finding::Clipped { count, of: 200, .. }) = findings.get(1) else {
        panic!("{findings:?}")
    };
    assert!(*count > 10 && *count <= cut, "{count} of {cut}");
}

#[test]
fn what_cannot_be_read_is_counted_and_located() {
    let folder = Folder::new();
    let mut lines = table(1000);
    for row in (5..1000).step_by(95) {
        lines[row] = format!("{:.4},oops,1,80\n", row as f64 / 1000.0);
    }
    let path = folder.with("x.csv", format!("{HEAD}{}", lines.concat()));
    let error = read(&[path], &ImportSettings::default()).expect_err("11 of 1000");
    let LoadError::Read {
        source:
            ReadError::CsvCell {
                line: 7,
                column: 2,
                message,
            },
        ..
    } = error
    else {
        panic!("{error}")
    };
    assert!(
        message.contains("\"oops\"") && message.contains("11 of 1000") && message.contains("1 in 100"),
        "{message}"
    );
}

#[test]
fn what_one_file_has_beyond_another_is_said_and_a_lone_wav_asks_for_its_table() {
    let folder = Folder::new();
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 1000,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let wav = folder.0.path().join("w3.wav");
    let mut writer = hound::WavWriter::create(&wav, spec).expect("a file");
    rows(10_001).for_each(|(_, a, ..)| writer.write_sample(a as f32).expect("a sample"));
    writer.finalize().expect("a file");
    let import = ImportSettings {
        full_scale_m_s2: Some(50.0),
        ..ImportSettings::default()
    };
    let alone = read(std::slice::from_ref(&wav), &import).expect_err("no table");
    let LoadError::Read {
        source: ReadError::NoTable { missing, table },
        ..
    } = alone
    else {
        panic!("{alone}")
    };
    assert_eq!(
        (&missing[..], &*table),
        (&["force_normal".to_owned(), "speed".to_owned()][..], "w3.csv")
    );
    let slow: String = (0..201)
        .map(|i| format!("{},1,50\n", f64::from(i) / 100.0))
        .collect();
    folder.with("w3.csv", format!("time_s,force_normal_n,speed_mm_s\n{slow}"));
    let (recording, findings) = read(&[wav], &import).expect("a recording");
    assert_eq!(recording.samples(), 2001);
    let cut = Finding::Cut {
        begins: false,
        short: "w3.csv".to_owned(),
        short_s: 2.0,
        long: "w3.wav".to_owned(),
        long_s: 10.0,
    };
    assert_eq!(findings, std::slice::from_ref(&cut));
    assert_eq!(
        cut.to_string(),
        "w3.csv ends at 2 s, w3.wav at 10 s: 8 s of w3.wav are not used"
    );
}

#[test]
fn variables_of_other_lengths_are_named_and_have_no_lines() {
    let folder = Folder::new();
    let file = matlab_file(&[
        variable("acc", 200, 1, &[0.5; 200]),
        variable("Fz", 20, 1, &[1.0; 20]),
        variable("v", 200, 1, &[80.0; 200]),
    ]);
    let path = folder.with("x.mat", &file);
    let said = |import: &ImportSettings| {
        read(std::slice::from_ref(&path), import)
            .expect_err("not all is there")
            .to_string()
    };
    let unsaid = said(&ImportSettings::default());
    assert!(
        unsaid.contains("acc, v, Fz (20 values)") && !unsaid.contains("line"),
        "{unsaid}"
    );
    let columns = [("accel", "acc"), ("force_normal", "Fz"), ("speed", "v")];
    let mapped = said(&import(
        &columns,
        &[("accel", "g"), ("force", "N"), ("speed", "mm/s")],
    ));
    assert!(
        mapped.contains("variable Fz has 20 values, acc has 200; all need the same length"),
        "{mapped}"
    );
    // One column as it stands, and what is not text is not shown.
    assert_eq!(load_column(&path, "v").expect("a column"), [80.0; 200]);
    let binary = folder.with("x.bin", [7_u8; 3000]);
    let error = load_column(&binary, "v").expect_err("no table").to_string();
    assert!(error.contains("not text") && error.len() < 300, "{error}");
}

#[test]
fn a_signal_is_read_from_the_same_tables_and_repaired() {
    let folder = Folder::new();
    let mut lines: Vec<String> = rows(500)
        .map(|(t, a, ..)| format!("{};{a}\n", t * 1000.0))
        .collect();
    lines[100] = "100;?\n".to_owned();
    let path = folder.with("x.csv", format!("t;acc\nms;g\n{}", lines.concat()));
    let (signal, findings) =
        load_signal(&path, Some("acc"), &import(&[("time", "t")], &[])).expect("a signal");
    assert_eq!(
        (signal.unit, signal.rate_hz, signal.values.len()),
        (Some("m/s2"), Some(1000.0), 500)
    );
    assert!((signal.values[1] - 9.80665 * 0.7_f64.sin()).abs() < 1e-9);
    assert!(
        matches!(&findings[..], [Finding::Interpolated { unreadable: 1, first: Some(cell), .. }] if cell.line == 103),
        "{findings:?}"
    );
    let strict = ImportSettings {
        strict: true,
        ..import(&[("time", "t")], &[])
    };
    assert_eq!(
        line_of(load_signal(&path, Some("acc"), &strict).expect_err("strict")),
        (103, 2)
    );
}

#[test]
fn sweeps_are_found_by_units_or_by_what_is_said() {
    let folder = Folder::new();
    let sweep = |text: &str, import: &ImportSettings| load_sweep(&folder.with("sweep.csv", text), import);
    let plain = ImportSettings::default();
    let by_unit = "time_s,felt_mm_s2,out.delivered_ma\n0,1000,250\n0.001,2000,500\n0.002,0,0\n";
    let (found, _) = sweep(by_unit, &plain).expect("units");
    assert_eq!(found.acceleration_m_s2, [1.0, 2.0, 0.0]);
    assert_eq!(found.current_a, [0.25, 0.5, 0.0]);
    assert_eq!(found.rate_hz, 1000.0);
    let theirs = "t;a;i [mA]\n0;1,0;250\n1;2,0;500\n2;0,0;0\n";
    let said = import(
        &[("time", "t"), ("accel", "a")],
        &[("time", "ms"), ("accel", "m/s2")],
    );
    let (mapped, _) = sweep(theirs, &said).expect("what is said");
    assert_eq!(mapped, found);
    let missing = sweep("time_s,x_m_s2\n0,1\n1,1\n", &plain).expect_err("no current");
    assert!(missing.to_string().contains("--column current="), "{missing}");
    let two = sweep("time_s,x_m_s2,a_a,b_a\n0,1,1,1\n1,1,1,1\n", &plain).expect_err("two currents");
    assert!(two.to_string().contains("--column current="), "{two}");
    let strict = ImportSettings::strict();
    let cell = sweep("time_s,x_m_s2,i_a\n0,1,1\n1,x,1\n", &strict).expect_err("no number");
    assert!(cell.to_string().contains("\"x\" in x_m_s2"), "{cell}");
    assert_eq!(line_of(cell), (3, 2));
}
