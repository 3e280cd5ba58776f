//! Tests: properties of other people's files: gravity, dates, other names, a position instead of a speed.

use super::loggers::{Folder, import, line_of, read, rows};
use super::*;

fn high_passed(findings: &[Finding]) -> Option<f64> {
    findings.iter().find_map(|finding| match finding {
        Finding::HighPassed { mean, .. } => Some(*mean),
        _ => None,
    })
}

fn with_offset(offset: f64) -> String {
    let lines = rows(2000).map(|(t, a, f, v)| format!("{t},{},{f},{v}\n", a + offset));
    format!("time_s,accel_m_s2,force_normal_n,speed_mm_s\n{}", lines.collect::<String>())
}

#[test]
fn gravity_in_a_processed_column_is_high_passed_and_said() {
    let folder = Folder::new();
    let (clean, heavy) =
        (folder.with("clean.csv", with_offset(0.0)), folder.with("heavy.csv", with_offset(9.81)));
    let usual = ImportSettings::default();
    let (kept, findings) = read(&[clean], &usual).expect("a recording");
    assert_eq!(high_passed(&findings), None);
    let expected: Vec<f64> = rows(2000).map(|row| row.1).collect();
    assert_eq!(kept.signals().acceleration_m_s2, expected);
    let (taken, findings) = read(std::slice::from_ref(&heavy), &usual).expect("a recording");
    assert!((high_passed(&findings).expect("a mean") - 9.81).abs() < 0.01);
    let power = |signals: &Signals| signals.acceleration_m_s2.iter().map(|a| a * a).sum::<f64>();
    let db = 10.0 * (power(taken.signals()) / power(kept.signals())).log10();
    assert!(db.abs() < 0.2, "{db} dB");
    assert_eq!(
        line_of(read(std::slice::from_ref(&heavy), &ImportSettings::strict()).expect_err("strict")),
        (1, 0)
    );
    // As a signal likewise; a force keeps its mean.
    let (signal, found) = load_signal(&heavy, Some("accel_m_s2"), &usual).expect("a signal");
    assert!(high_passed(&found).is_some());
    assert_eq!(signal.values, taken.signals().acceleration_m_s2);
    let (force, found) = load_signal(&heavy, Some("force_normal_n"), &usual).expect("a signal");
    assert!(high_passed(&found).is_none() && force.values[0] == 1.0);
}

#[test]
fn dates_are_times_from_the_first_second_on_and_show_their_gaps() {
    let folder = Folder::new();
    let line = |(t, a, f, v): (f64, f64, f64, f64)| {
        let (second, fraction) = ((t + 59.5) as u64, (t + 59.5).fract());
        let (minute, second) = (3 + second / 60, second % 60);
        let decimals = format!("{fraction:.6}");
        format!("2026-11-12T14:{minute:02}:{second:02}{}+01:00\t{a}\t{f}\t{v}\n", &decimals[1..])
    };
    let head = "Timestamp\tAcc [m/s^2]\tForce [N]\tSpeed [mm/s]\n";
    let lines: Vec<String> = rows(2000).map(line).collect();
    let path = folder.with("felt.tsv", format!("{head}{}", lines.concat()));
    let (recording, findings) = read(&[path], &ImportSettings::default()).expect("a recording");
    assert_eq!((recording.rate_hz(), recording.samples()), (1000.0, 2000));
    let taken = |column: &str, quantity: &str| Finding::TakenAs {
        column: column.to_owned(),
        quantity: quantity.to_owned(),
    };
    let expected =
        [taken("Timestamp", "time"), taken("Acc [m/s^2]", "accel"), taken("Force [N]", "force_normal")];
    assert_eq!(findings, expected);
    let cut = [&lines[..700], &lines[1000..]].concat().concat();
    let gap = folder.with("gap.tsv", format!("{head}{cut}"));
    let error = read(std::slice::from_ref(&gap), &ImportSettings::default()).expect_err("a gap");
    assert_eq!(line_of(error), (702, 0));
    // A rate that is given needs no unit of times, and hides the gap.
    let import = ImportSettings { rate_hz: Some(1000.0), ..import(&[("time", "Timestamp")], &[]) };
    let (recording, findings) = read(&[gap], &import).expect("a recording");
    assert_eq!(recording.samples(), 1700);
    let column = "Timestamp".to_owned();
    assert!(findings.contains(&Finding::TimesNotUsed { column }), "{findings:?}");
    // Times that are numbers still need one.
    let numbers = folder.with("n.csv", "t,accel_m_s2,force_normal_n,speed_mm_s\n0,1,1,1\n1,2,1,1\n");
    let mapped = super::loggers::import(&[("time", "t")], &[]);
    assert_eq!(line_of(read(&[numbers], &mapped).expect_err("no unit")), (1, 1));
}

#[test]
fn times_since_an_epoch_lose_no_sample() {
    let folder = Folder::new();
    let lines = |epoch: u64| -> String {
        let line = |(t, a, f, v): (f64, f64, f64, f64)| {
            let micros = (t * 1e6).round() as u64;
            let (second, micros) = (epoch + micros / 1_000_000, micros % 1_000_000);
            format!("{second}.{micros:06},{a},{f},{v}\n")
        };
        // Two rows are missing, so that all are resampled.
        let kept = rows(3000).enumerate().filter(|(row, _)| ![1200, 1201].contains(row));
        kept.map(|(_, row)| line(row)).collect()
    };
    let head = "time_s,accel_m_s2,force_normal_n,speed_mm_s\n";
    let [near, far] = [("near.csv", 0), ("far.csv", 1_794_492_202)].map(|(name, epoch)| {
        let path = folder.with(name, format!("{head}{}", lines(epoch)));
        read(&[path], &ImportSettings::default()).expect("a recording")
    });
    assert_eq!((near.0.samples(), far.0.samples()), (3000, 3000));
    let both = [&near, &far].map(|read| &read.0.signals().acceleration_m_s2);
    assert!(both[0].iter().zip(both[1]).all(|(a, b)| (a - b).abs() < 1e-9));
    // The rows that are there do not jitter.
    let [jitter] = &far.1[..] else { panic!("{:?}", far.1) };
    assert!(matches!(jitter, Finding::Jitter { missing_rows: 2, .. }));
    assert_eq!(jitter.to_string(), "2 rows are missing; resampled to 1000 Hz");
    // Files that share the epoch's clock are joined, though each begins in another second.
    let motion: String =
        (0..150).map(|i| format!("{}.{:02},1,50\n", 1_794_492_203 + i / 100, i % 100)).collect();
    let motion = folder.with("motion.csv", format!("time_s,force_normal_n,speed_mm_s\n{motion}"));
    let accel: String = rows(3000)
        .map(|(t, a, ..)| format!("{}.{:03},{a}\n", 1_794_492_202 + t as u64, (t.fract() * 1000.0).round()))
        .collect();
    let accel = folder.with("accel.csv", format!("time_s,accel_m_s2\n{accel}"));
    let (joined, _) = read(&[motion, accel], &ImportSettings::default()).expect("a recording");
    let first = joined.signals().acceleration_m_s2[0];
    assert!((first - (1000.0_f64 * 0.7).sin()).abs() < 1e-9, "{first}");
    assert_eq!(joined.samples(), 1491);
}

#[test]
fn a_position_stands_in_for_the_speed() {
    let folder = Folder::new();
    let accel: String = rows(2000).map(|(t, a, ..)| format!("{t},{a}\n")).collect();
    let accel = folder.with("accel.csv", format!("time_s,accel_m_s2\n{accel}"));
    // A circle of 20 mm, 80 mm/s along it.
    let motion: String = (0..400)
        .map(|i| {
            let time = f64::from(i) / 200.0;
            let (y, x) = (time * 4.0).sin_cos();
            format!("{time},1.5,{},{}\n", 20.0 * x, 20.0 * y)
        })
        .collect();
    let head = "time_s,force_n,pos_x_mm,pos_y_mm\n";
    let path = folder.with("motion.csv", format!("{head}{motion}"));
    let both = [accel, path];
    let (recording, findings) = read(&both, &ImportSettings::default()).expect("a recording");
    let signals = recording.signals();
    let middle = &signals.speed_m_s[200..1800];
    assert!(middle.iter().all(|v| (v - 0.08).abs() < 0.0008), "{middle:?}");
    assert!(signals.force_normal_n.iter().all(|f| (f - 1.5).abs() < 1e-9));
    assert!(findings.iter().any(|finding| matches!(
        finding,
        Finding::SpeedOfPosition { columns, .. } if columns == &["pos_x_mm", "pos_y_mm"]
    )));
    // A speed that is known counts, and the position does not.
    let known = ImportSettings::default().with_constant("speed_mm_s", "50").expect("a quantity");
    let (recording, findings) = read(&both, &known).expect("a recording");
    assert!(recording.signals().speed_m_s.iter().all(|v| *v == 0.05));
    assert!(!findings.iter().any(|f| matches!(f, Finding::SpeedOfPosition { .. })));
}

#[test]
fn constants_and_the_order_of_files_are_independent() {
    let folder = Folder::new();
    let accel: String = rows(2000).map(|(t, a, ..)| format!("{t},{a}\n")).collect();
    let accel = folder.with("accel.csv", format!("time_s,accel_m_s2\n{accel}"));
    let motion: String = (0..150).map(|i| format!("{},50\n", 0.1 + f64::from(i) / 100.0)).collect();
    let motion = folder.with("motion.csv", format!("time_s,speed_mm_s\n{motion}"));
    // Without a time of its own: nothing of it is used.
    let notes = folder.with("notes.csv", "sample,room\n1,23\n2,23\n");
    let constant = ImportSettings::default().with_constant("force_normal_n", "1.5").expect("a quantity");
    let joined =
        [[&accel, &motion, &notes], [&motion, &notes, &accel], [&notes, &accel, &motion]].map(|paths| {
            let paths = paths.map(Clone::clone);
            read(&paths, &constant).expect("a recording").0
        });
    for other in &joined {
        assert_eq!(other.signals(), joined[0].signals());
        assert_eq!((other.samples(), other.signals().force_normal_n[0]), (1491, 1.5));
    }
}

#[test]
fn names_that_leave_no_doubt_are_taken_and_others_are_not() {
    let folder = Folder::new();
    let taken = |head: &str| {
        let lines: String = rows(30).map(|(t, a, f, v)| format!("{t},{a},{f},{v}\n")).collect();
        let path = folder.with("x.csv", format!("{head}\n{lines}"));
        read(&[path], &ImportSettings::default()).map(|(_, findings)| findings)
    };
    let findings = taken("time_s,accel_z_m_s2,force_n,speed_mm_s").expect("a recording");
    let quantities: Vec<&str> = { findings.iter() }
        .filter_map(|finding| match finding {
            Finding::TakenAs { quantity, .. } => Some(quantity.as_str()),
            _ => None,
        })
        .collect();
    assert_eq!(quantities, ["accel", "force_normal"]);
    let missing = |head: &str| match taken(head) {
        Err(LoadError::Read { source: ReadError::Missing { missing, hints, .. }, .. }) => (missing, hints),
        other => panic!("{other:?}"),
    };
    let path =
        folder.with("y.csv", "Timestamp,Acc [g],x\n2026-11-12 14:00:00,1,0\n2026-11-12 14:00:00.05,2,0\n");
    let (signal, findings) = load_signal(&path, None, &ImportSettings::default()).expect("a signal");
    assert_eq!((signal.values[0], signal.rate_hz, findings.len()), (9.80665, Some(20.0), 2), "{findings:?}");
    // Without a unit, or where two could be it, nothing is taken; the hint asks for a unit only where there is none.
    let (lacks, hints) = missing("time_s,accel_m_s2,Force,speed_mm_s");
    assert_eq!(lacks, ["force_normal"]);
    assert_eq!(hints, ["--column force_normal=\"Force\" --unit force_normal=N"]);
    let (lacks, hints) = missing("time_s,Acc [g],Acceleration [g],Kraft [N]");
    assert_eq!(lacks, ["accel", "force_normal", "speed"]);
    assert_eq!(hints[1], "--column force_normal=\"Kraft [N]\"");
    assert!(hints[2].contains("position_x") && hints[2].contains("--constant speed_mm_s"), "{hints:?}");
}
