//! Tables that are not text: MATLAB and spreadsheets.

use super::*;
use std::io::Write;

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
    let parts = [element(6, &flags), element(5, &size), element(1, name.as_bytes()), element(9, &values)];
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
    assert_eq!((recording.rate_hz(), &recording.signals().acceleration_m_s2), (1000.0, &accel));
    assert_eq!(recording.signals().force_normal_n, force);
    for end in [130, 500, file.len() - 3] {
        let path = folder.with("cut.mat", &file[..end]);
        assert!(read(&[path], &ImportSettings::default()).is_err(), "{end}");
    }
    let newer = folder.with("new.mat", b"MATLAB 7.3 MAT-file, and HDF5 from here on");
    let error = read(&[newer], &ImportSettings::default()).expect_err("HDF5").to_string();
    assert_eq!(error.matches("7.3").count(), 1, "{error}");
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
        read(std::slice::from_ref(&path), import).expect_err("not all is there").to_string()
    };
    let unsaid = said(&ImportSettings::default());
    assert!(unsaid.contains("acc, v, Fz (20 values)") && !unsaid.contains("line"), "{unsaid}");
    let columns = [("accel", "acc"), ("force_normal", "Fz"), ("speed", "v")];
    let mapped = said(&import(&columns, &[("accel", "g"), ("force", "N"), ("speed", "mm/s")]));
    assert!(mapped.contains("variable Fz has 20 values, acc has 200; all need the same length"), "{mapped}");
    // One column as it stands, and what is not text is not shown.
    assert_eq!(load_column(&path, "v").expect("a column"), [80.0; 200]);
    let binary = folder.with("x.bin", [7_u8; 3000]);
    let error = load_column(&binary, "v").expect_err("no table").to_string();
    assert!(error.contains("not text") && error.len() < 300, "{error}");
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
    sheet += &cells(2, &[text("A2", "accel_m_s2"), text("B2", "force_normal_n"), text("C2", "speed_mm_s")]);
    for (i, (_, a, f, v)) in rows(30).enumerate() {
        let row = i + 3;
        sheet += &cells(
            row,
            &[number(format!("A{row}"), a), number(format!("B{row}"), f), number(format!("C{row}"), v)],
        );
    }
    sheet += &cells(33, &[text("A33", last), number("B33".into(), 1.0), number("C33".into(), 80.0)]);
    let main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main";
    let relations = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
    let package = "http://schemas.openxmlformats.org/package/2006";
    let members = [
        ("[Content_Types].xml", format!("<Types xmlns=\"{package}/content-types\"/>")),
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
    assert_eq!((recording.rate_hz(), &recording.signals().acceleration_m_s2), (1000.0, &expected));
    let path = folder.with("y.xlsx", workbook("broken", ""));
    assert_eq!(line_of(read(&[path], &ImportSettings::strict()).expect_err("no number")), (33, 1));
}

#[cfg(feature = "spreadsheets")]
#[test]
fn a_damaged_spreadsheet_is_refused_at_the_last_cell_that_was_read() {
    let folder = Folder::new();
    let unknown = "<row r=\"34\"><c r=\"A34\"><v>1</v></c><c r=\"B34\" t=\"tea\"><v>1</v></c></row>";
    let path = folder.with("x.xlsx", workbook("0.5", unknown));
    let Err(LoadError::Read { source: ReadError::Sheet { sheet, after, .. }, .. }) =
        read(&[path], &ImportSettings::default())
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
    assert!(error.to_string().contains("`xl/worksheets/sheet1.xml`"), "{error}");
}

#[test]
fn other_spreadsheets_are_refused_with_what_to_do() {
    let folder = Folder::new();
    let old = folder.with("old.xls", [&[0xd0, 0xcf, 0x11, 0xe0][..], &[0; 600]].concat());
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(vec![]));
    archive.start_file("content.xml", zip::write::SimpleFileOptions::default()).expect("memory");
    let open = folder.with("open.ods", archive.finish().expect("memory").into_inner());
    for path in [old, open] {
        let error = read(&[path], &ImportSettings::default()).expect_err("it is not read");
        assert!(error.to_string().contains("save the file as"), "{error}");
    }
}
