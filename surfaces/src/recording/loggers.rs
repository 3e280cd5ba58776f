//! Files as other people's loggers write them.

use super::*;
use std::io::Write;
use std::path::PathBuf;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn with(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).expect("a file");
        path
    }
}

fn read(paths: &[PathBuf], import: &ImportSettings) -> Result<(ProcessedRecording, Vec<Finding>), LoadError> {
    load_with(paths, import).map(|(recording, findings)| match recording {
        AnyRecording::Processed(processed) => (processed, findings),
        AnyRecording::Raw(_) => panic!("a raw recording"),
    })
}

fn line_of(error: LoadError) -> (u64, usize) {
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
fn rows(count: usize) -> impl Iterator<Item = (f64, f64, f64, f64)> {
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
    assert_eq!(findings, []);
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
        (2000.0, 1000, vec![])
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

#[cfg(feature = "spreadsheets")]
#[test]
fn a_spreadsheet_is_a_table_and_its_errors_name_the_cell() {
    let workbook = |last: &str| {
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
                format!("<worksheet xmlns=\"{main}\"><sheetData>{sheet}</sheetData></worksheet>"),
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
    };
    let folder = Folder::new();
    let path = folder.with("x.xlsx", workbook("0.5"));
    let (recording, _) = read(&[path], &ImportSettings::default()).expect("a recording");
    let expected: Vec<f64> = rows(30).map(|row| row.1).chain([0.5]).collect();
    assert_eq!(
        (recording.rate_hz(), &recording.signals().acceleration_m_s2),
        (1000.0, &expected)
    );
    let path = folder.with("y.xlsx", workbook("broken"));
    assert_eq!(
        line_of(read(&[path], &ImportSettings::strict()).expect_err("no number")),
        (33, 1)
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
        assert!(error.to_string().contains("save it as"), "{error}");
    }
}
