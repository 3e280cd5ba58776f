//! Tests: recognition of columns and units.

use super::*;

#[test]
fn columns_and_units_are_said_where_the_file_does_not() {
    let folder = Folder::new();
    let path = folder.with("x.csv", "t;acc;Fz;v;note\n0;0,5;1;100;a\n1;1,0;2;200;b\n2;-0,5;2;200;c\n");
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
    let slashed =
        folder.with("y.csv", "t/ms;acc/g;Fz/gf;v/(cm/s)\n0;0,5;100;10\n1;1,0;200;20\n2;-0,5;200;20\n");
    let names = [("time", "t/ms"), ("accel", "acc/g"), ("force_normal", "Fz/gf"), ("speed", "v/(cm/s)")];
    let mapped = ImportSettings::default();
    let mapped =
        names.iter().try_fold(mapped, |import, (quantity, column)| import.with_column(quantity, column));
    let (of_slashed, _) = read(&[slashed], &mapped.expect("quantities")).expect("a recording");
    assert_eq!(of_slashed.signals().force_normal_n, [0.980665, 1.96133, 1.96133]);
    assert_eq!((&of_slashed.signals().speed_m_s, of_slashed.signals().rate_hz), (&signals.speed_m_s, 1000.0));
    // Without a unit, at the header's cell.
    let unsaid = ImportSettings::default().with_column("accel", "acc").expect("a quantity");
    assert_eq!(line_of(read(std::slice::from_ref(&path), &unsaid).expect_err("no unit")), (1, 2));
    let nowhere = import.with_column("speed", "w").expect("a quantity");
    assert_eq!(line_of(read(&[path], &nowhere).expect_err("no column")), (1, 0));
    assert!(ImportSettings::default().with_unit("accel", "N").is_err());
    assert!(ImportSettings::default().with_column("colour", "x").is_err());
}

#[test]
fn rates_and_constants_are_said_where_the_file_does_not() {
    let folder = Folder::new();
    let path = folder.with("taxels.csv", "channel7\n10\n20\n10\n");
    let import = ImportSettings { rate_hz: Some(500.0), ..ImportSettings::default() };
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
fn a_preamble_and_a_row_of_units_are_no_data() {
    let folder = Folder::new();
    let lines = "0;0,5;1;100\n1;1,0;2;200\n2;-0,5;2;200\n";
    let table = format!("Logger 7;\nDatum: 3.4.2024;12\n\nt;Beschl\u{e4};Kraft;v\nms;g;N;mm/s\n{lines}");
    let latin: Vec<u8> = table.chars().map(|c| u8::try_from(u32::from(c)).expect("Latin-1")).collect();
    let mapped =
        import(&[("time", "t"), ("accel", "Beschl\u{e4}"), ("force_normal", "Kraft"), ("speed", "v")], &[]);
    for (name, bytes) in [("utf8.csv", table.clone().into_bytes()), ("latin.csv", latin)] {
        let path = folder.with(name, bytes);
        let (recording, findings) = read(&[path], &mapped).expect("a recording");
        let signals = recording.signals();
        assert_eq!(signals.acceleration_m_s2, [4.903325, 9.80665, -4.903325]);
        assert_eq!((signals.rate_hz, &signals.speed_m_s[..]), (1000.0, &[0.1, 0.2, 0.2][..]));
        assert_eq!(findings, []);
    }
    // Without a mapping the header is told by its shape, and all that is missing at once.
    let path = folder.with("unsaid.csv", &table);
    let Err(LoadError::Read { source: ReadError::Missing { missing, columns, hints }, .. }) =
        read(&[path], &ImportSettings::default())
    else {
        panic!("columns are missing")
    };
    assert_eq!(missing, ["accel", "force_normal", "speed", "time"]);
    assert_eq!(columns, ["t", "Beschl\u{e4}", "Kraft", "v"]);
    // Each with its column, and without a unit, as the row below the header says it.
    let filled = ["accel=\"Beschl\u{e4}\"", "force_normal=\"Kraft\"", "speed=\"v\"", "time=\"t\""];
    for (hint, filled) in hints.iter().zip(filled) {
        assert!(hint.starts_with(&format!("--column {filled}")) && !hint.contains("--unit"), "{hint}");
    }
    let twice = folder.with("twice.csv", "x\ntime_s,accel_g\n1,2\ntime_s,accel_g\n1,2\n");
    assert_eq!(line_of(read(&[twice], &ImportSettings::default()).expect_err("two headers")), (2, 0));
    let words = folder.with("words.csv", format!("t;Beschl\u{e4};Kraft;v\nsec;Gs;Newton;kmh\n{lines}"));
    assert_eq!(line_of(read(&[words], &mapped).expect_err("unknown units")), (2, 0));
    let half = folder.with("half.csv", format!("t;Beschl\u{e4};Kraft;v\nms;Gs;N;mm/s\n{lines}"));
    assert_eq!(line_of(read(&[half], &mapped).expect_err("an unknown unit")), (1, 2));
}

#[test]
fn units_in_brackets_are_understood_and_contradictions_said() {
    let folder = Folder::new();
    let rows = "0,0.5,1,100\n0.001,1,2,90\n0.002,-0.5,2,90\n";
    let ours = folder.with("ours.csv", format!("time [s],accel [g],force_normal [N],speed (mm/s)\n{rows}"));
    let (recording, findings) = read(std::slice::from_ref(&ours), &ImportSettings::default()).expect("units");
    assert_eq!(recording.signals().acceleration_m_s2[0], 4.903325);
    assert_eq!((recording.signals().speed_m_s[0], findings), (0.1, vec![]));
    let theirs = folder.with("theirs.csv", format!("Zeit [s],Beschleunigung [g],Kraft [N],v [mm/s]\n{rows}"));
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
    assert!(
        findings.contains(&Finding::OtherUnit {
            column: "speed (mm/s)".to_owned(),
            given: "speed=m/s".to_owned()
        })
    );
    assert!(findings.iter().any(|finding| matches!(
        finding,
        Finding::Implausible { column, largest: 100.0, .. } if column == "speed (mm/s)"
    )));
}

#[test]
fn a_signal_is_read_from_the_same_tables_and_repaired() {
    let folder = Folder::new();
    let mut lines: Vec<String> = rows(500).map(|(t, a, ..)| format!("{};{a}\n", t * 1000.0)).collect();
    lines[100] = "100;?\n".to_owned();
    let path = folder.with("x.csv", format!("t;acc\nms;g\n{}", lines.concat()));
    let (signal, findings) =
        load_signal(&path, Some("acc"), &import(&[("time", "t")], &[])).expect("a signal");
    assert_eq!((signal.unit, signal.rate_hz, signal.values.len()), (Some("m/s2"), Some(1000.0), 500));
    assert!((signal.values[1] - 9.80665 * 0.7_f64.sin()).abs() < 1e-9);
    assert!(
        matches!(&findings[..], [Finding::Interpolated { unreadable: 1, first: Some(cell), .. }] if cell.line == 103),
        "{findings:?}"
    );
    let strict = ImportSettings { strict: true, ..import(&[("time", "t")], &[]) };
    assert_eq!(line_of(load_signal(&path, Some("acc"), &strict).expect_err("strict")), (103, 2));
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
    let said = import(&[("time", "t"), ("accel", "a")], &[("time", "ms"), ("accel", "m/s2")]);
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
