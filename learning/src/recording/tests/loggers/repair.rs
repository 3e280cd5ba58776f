//! Tests: data that are repaired, refused or reported.

use super::*;

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
    assert!(recording.signals().acceleration_m_s2.iter().all(|a| a.abs() < 1.1));
    let interpolated = |quantity: &str, unreadable, empty| Finding::Interpolated {
        quantity: quantity.to_owned(),
        unreadable,
        empty,
        of: 500,
        first: (unreadable > 0).then(|| BadCell { line: 102, column: 2, text: Some("?".to_owned()) }),
    };
    let spike = Finding::Outliers { quantity: "accel".to_owned(), count: 1 };
    let expected =
        [interpolated("accel", 1, 0), spike, interpolated("force_normal", 0, 2), interpolated("speed", 0, 1)];
    assert_eq!(findings, expected);
    assert_eq!(line_of(read(&[path], &ImportSettings::strict()).expect_err("strict")), (501, 0));
    // One in ten is no accident.
    for row in (0..500).step_by(10) {
        lines[row] = "0.1,?,1,80\n".to_owned();
    }
    let path = folder.with("y.csv", format!("{HEAD}{}", lines.concat()));
    assert_eq!(line_of(read(&[path], &ImportSettings::default()).expect_err("unreadable")), (2, 2));
}

#[test]
fn gaps_are_refused_where_they_are_and_jitter_is_not() {
    let folder = Folder::new();
    let mut lines = table(1000);
    lines.drain(500..600);
    let gap = folder.with("gap.csv", format!("{HEAD}{}", lines.concat()));
    assert_eq!(line_of(read(&[gap], &ImportSettings::default()).expect_err("a gap")), (502, 0));
    let jittered: String = rows(1000)
        .enumerate()
        .map(|(i, (t, a, f, v))| format!("{:.6},{a},{f},{v}\n", t + if i % 2 == 1 { 0.0002 } else { 0.0 }))
        .collect();
    let path = folder.with("jitter.csv", format!("{HEAD}{jittered}"));
    let (recording, findings) =
        read(std::slice::from_ref(&path), &ImportSettings::default()).expect("a recording");
    assert_eq!(recording.rate_hz(), 1000.0);
    assert!(matches!(findings[..], [Finding::Jitter { missing_rows: 0, .. }]), "{findings:?}");
    // By the flag, times do not count.
    let import = ImportSettings { rate_hz: Some(2000.0), ..ImportSettings::default() };
    let (recording, findings) = read(&[path], &import).expect("a recording");
    assert_eq!(
        (recording.rate_hz(), recording.samples(), findings),
        (2000.0, 1000, vec![Finding::TimesNotUsed { column: "time_s".to_owned() }])
    );
}

#[test]
fn a_speed_of_90_m_s_is_implausible() {
    let folder = Folder::new();
    let lines: String = rows(100).map(|(t, a, f, _)| format!("{t},{a},{f},90\n")).collect();
    let path = folder.with("x.csv", format!("time_s,accel_m_s2,force_normal_n,speed_m_s\n{lines}"));
    let (_, findings) = read(&[path], &ImportSettings::default()).expect("a recording");
    assert!(matches!(findings[..], [Finding::Implausible { quantity: "speed", .. }]), "{findings:?}");
}

#[test]
fn strange_rates_and_clipped_samples_are_noticed() {
    let folder = Folder::new();
    let lines: String =
        rows(200).map(|(t, a, f, v)| format!("{},{},{f},{v}\n", t * 100.0, a.clamp(-0.8, 0.8))).collect();
    let path = folder.with("leder.csv", format!("{HEAD}{lines}"));
    let (recording, findings) = read(&[path], &ImportSettings::default()).expect("a recording");
    assert!(
        matches!(&findings[0], Finding::StrangeRate { column, rate_hz: 10.0 } if column == "time_s"),
        "{findings:?}"
    );
    let cut = recording.signals().acceleration_m_s2.iter().filter(|a| a.abs() == 0.8).count();
    let Some(Finding::Clipped { count, of: 200, .. }) = findings.get(1) else { panic!("{findings:?}") };
    assert!(*count > 10 && *count <= cut, "{count} of {cut}");
}

#[test]
fn quoted_decimal_commas_and_lines_of_blanks_are_no_faults() {
    let folder = Folder::new();
    let row = |(t, a, f, v)| format!("\"{t:.4}\"|\"{a}\"|\"{f}\"|{v}\n \t\n").replace('.', ",");
    let lines: String = rows(200).map(row).collect();
    let path = folder.with("x.csv", format!("{HEAD}\t\n{}", lines.replace('|', ",")));
    let (recording, findings) = read(&[path], &ImportSettings::default()).expect("a recording");
    let expected: Vec<f64> = rows(200).map(|row| row.1).collect();
    assert_eq!(recording.signals().acceleration_m_s2, expected);
    assert_eq!(findings, []);
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
    let LoadError::Read { source: ReadError::CsvCell { line: 7, column: 2, message }, .. } = error else {
        panic!("{error}")
    };
    assert!(
        message.contains("\"oops\"") && message.contains("11 of 1000") && message.contains("1 in 100"),
        "{message}"
    );
}
