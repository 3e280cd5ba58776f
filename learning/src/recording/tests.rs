mod habits;
mod loggers;
pub(crate) mod synthetic;

use self::synthetic::{circle, drag, normal, provenance};
use super::*;
use haptograph_surfaces::provenance::TOUCH;
use haptograph_surfaces::{Origin, Provenance};
use proptest::prelude::*;
use std::collections::BTreeMap;

fn raw() -> AnyRecording {
    AnyRecording::Raw(circle(0.2, 0.03, 1.0, 1.0, 0.3))
}

fn processed() -> AnyRecording {
    let recording = drag(&[(0.05, 0.1, 1.0), (0.02, 0.2, 2.0)], 0.3, 1, |_, _| (vec![-0.5], 1.0));
    let mut signals = recording.signals().clone();
    signals.axes_m_s2 = Some(signals.acceleration_m_s2.iter().map(|&a| [a, 0.1, -a / 3.0]).collect());
    let provenance = provenance().with_setting("seed", 7).with_setting("Größe", "\"ß\"\n");
    let world = WorldAxes { position_m: signals.axes_m_s2.clone(), force_n: None };
    let recording = ProcessedRecording::new(signals, Gesture::Tap, provenance).unwrap();
    AnyRecording::Processed(recording.with_world(world).unwrap())
}

#[test]
fn an_archive_keeps_every_bit() {
    for recording in [raw(), processed()] {
        let bytes = write_archive(&recording).unwrap();
        assert!(read_archive(&bytes).unwrap() == recording);
        assert!(write_archive(&recording).unwrap() == bytes, "the same recording gives the same bytes");
    }
}

#[test]
fn a_file_is_told_by_its_content() {
    let folder = tempfile::tempdir().unwrap();
    for (recording, name) in
        [(raw(), "raw.npz"), (processed(), "misnamed.csv.bak"), (processed(), "table.CSV")]
    {
        let path = folder.path().join(name);
        save(&recording, &path).unwrap();
        let back = load(&path).unwrap();
        assert_eq!(back.gesture(), recording.gesture());
        assert_eq!(back.provenance().origin, Origin::Simulated);
    }
    assert!(matches!(load(&folder.path().join("missing")), Err(LoadError::Io { .. })));
    assert!(matches!(load(folder.path()), Err(LoadError::Io { .. })));
    let stray = folder.path().join("stray.xml");
    std::fs::write(&stray, "<?xml version=\"1.0\"?><set/>").unwrap();
    assert!(matches!(load(&stray), Err(LoadError::Read { source: ReadError::NotATriple, .. })));
}

#[test]
fn csv_keeps_every_bit_of_a_processed_recording() {
    let recording = processed();
    let AnyRecording::Processed(expected) = &recording else { panic!() };
    let bytes = write_csv(&recording).unwrap();
    let Ok(AnyRecording::Processed(back)) = read_csv(&bytes, "here") else { panic!() };
    assert_eq!(back.signals(), expected.signals());
    assert_eq!(back.gesture(), Gesture::Tap);
    assert_eq!(back.provenance().source, "made up for a test");
    assert_eq!(read_column(&bytes[..], "accel_m_s2").unwrap(), expected.signals().acceleration_m_s2);
    assert!(read_column(&bytes[..], "nonsense").unwrap_err().to_string().contains("time_s, accel_m_s2"));
}

#[test]
fn csv_of_a_raw_recording_holds_the_same_physical_quantities() {
    let recording = raw();
    let AnyRecording::Raw(expected) = &recording else { panic!() };
    let bytes = write_csv(&recording).unwrap();
    let Ok(AnyRecording::Raw(back)) = read_csv(&bytes, "here") else { panic!() };
    let accelerations = |of: &Recording| -> Vec<[f64; 3]> {
        of.acceleration_v().iter().map(|volts| of.calibration().acceleration_m_s2(&volts)).collect()
    };
    let loads = |of: &Recording| -> Vec<Wrench> {
        of.wrench().iter().map(|load| of.calibration().load_on_tool(&load)).collect()
    };
    assert_eq!(accelerations(&back), accelerations(expected));
    assert_eq!(loads(&back), loads(expected));
    use crate::processing::tip_positions;
    assert_eq!(tip_positions(&back), tip_positions(expected));
    assert_eq!((back.motion().rate_hz, back.wrench().rate_hz), (240.0, 10_000.0));
}

#[test]
fn csv_understands_units_delimiters_and_a_noted_rate() {
    let text = "# rate_hz: 1000\n# gesture: circle\nforce_normal_n;speed_m_s;accel_g;comment\n1;0.1;1;a\n2;0.2;-2;b\n";
    let Ok(AnyRecording::Processed(recording)) = read_csv(text.as_bytes(), "here") else { panic!() };
    assert_eq!(recording.signals().acceleration_m_s2, [9.80665, -19.6133]);
    assert_eq!((recording.rate_hz(), recording.gesture()), (1000.0, Gesture::Circle));
    assert_eq!(recording.provenance().origin, Origin::Imported);
    assert_eq!(recording.signals().force_tangential_n, None);
}

#[test]
fn what_is_wrong_with_a_table_is_said_with_its_line() {
    let error = |text: &str| read_csv(text.as_bytes(), "here").unwrap_err().to_string();
    let head = "time_s,accel_m_s2,force_normal_n,speed_mm_s\n";
    assert!(error("").contains("the file is empty"));
    assert!(error("time_s,accel_m_s2,force_normal_n,speed_kmh\n").contains("speed_m_s or speed_mm_s"));
    assert!(error("time_s,accel_m_s2\n0,1\n0.1,1\n").contains("missing columns: force_normal, speed."));
    assert!(error(&format!("{head}0,1,1,1\n0.1,x,1,1\n")).contains("line 3, column 2: \"x\" in accel"));
    assert!(error(&format!("{head}0,1,1,1\n0.1,inf,1,1\n")).contains("not a finite number"));
    assert!(error(&format!("{head}0,1,1,1\n0.1,,1,1\n")).contains("line 3: accel is missing"));
    assert!(error(&format!("{head}0,1,1,1\n0.1,1,1\n")).contains("line 3"));
    assert!(error(&format!("{head}0,1,1,1\n0.1,1,1,1\n0.5,1,1,1\n0.6,1,1,1\n")).contains("time jumps"));
    assert!(error(&format!("{head}0,1,1,1\n")).contains("one row only"));
    assert!(error("# gesture: wave\ntime_s\n0\n").contains("expected one of: drag"));
}

#[test]
fn what_touched_the_surface_is_kept_by_every_file() {
    let folder = tempfile::tempdir().unwrap();
    let plain = folder.path().join("plain.npz");
    save(&processed(), &plain).unwrap();
    let stated = [("tip_diameter_mm", "3.2"), ("grip", "as a pen"), ("touched_with", "tool")];
    let stated = BTreeMap::from(stated.map(|(name, value)| (name.to_owned(), value.to_owned())));
    let import = ImportSettings { touch: stated.clone(), ..ImportSettings::strict() };
    let (recording, _) = load_with(&[plain], &import).unwrap();
    for name in ["a.npz", "a.csv"] {
        let path = folder.path().join(name);
        save(&recording, &path).unwrap();
        let back = load(&path).unwrap();
        let of_touch = back.provenance().settings.iter().filter(|(name, _)| TOUCH.contains(&&***name));
        assert!(of_touch.eq(&stated), "{name}: {:?}", back.provenance());
    }
    for (name, value) in [("tip_diameter_mm", "wide"), ("tip_diameter_mm", "0"), ("touched_with", "foot")] {
        let text = format!(
            "# {name}: {value}\n# rate_hz: 1000\naccel_m_s2,force_normal_n,speed_mm_s\n0,1,1\n0,1,1\n"
        );
        let error = read_csv(text.as_bytes(), "here").unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
    }
}

#[test]
fn the_low_pass_of_a_velocity_from_positions_can_be_chosen() {
    let rows: String = (0..400)
        .map(|n| {
            // A wave of 40 Hz across a drag of 100 mm/s.
            let time_s = f64::from(n) / 1000.0;
            let across_mm = (std::f64::consts::TAU * 40.0 * time_s).sin();
            format!("0,1,{},{across_mm}\n", 100.0 * time_s)
        })
        .collect();
    let text = format!("# rate_hz: 1000\naccel_m_s2,force_normal_n,position_x_mm,position_y_mm\n{rows}");
    let fastest = |velocity_lowpass_hz| {
        let import = ImportSettings { velocity_lowpass_hz, ..ImportSettings::strict() };
        let table = csv::Table::read(text.as_bytes(), &import, csv::ColumnSelection::Recording).unwrap();
        let read = csv::recording(&mut [table], "here", &import);
        let Ok((AnyRecording::Processed(recording), _)) = read.map_err(|fault| fault.error) else { panic!() };
        recording.signals().speed_m_s[100..300].iter().copied().fold(0.0, f64::max)
    };
    assert!(fastest(None) < 0.12, "{}", fastest(None));
    assert!(fastest(Some(1000.0)) > 0.25, "{}", fastest(Some(1000.0)));
}

#[test]
fn a_raw_recording_becomes_the_files_of_the_toolkit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("Force_slate.xml");
    save(&raw(), &path).unwrap();
    let Ok(AnyRecording::Processed(back)) = load(&folder.path().join("Accel_slate.xml")) else { panic!() };
    let AnyRecording::Raw(raw) = raw() else { panic!() };
    let expected = crate::processing::process(&raw, &Default::default()).unwrap();
    assert_eq!(back.signals().acceleration_m_s2, expected.signals().acceleration_m_s2);
    assert_eq!(back.signals().force_normal_n, expected.signals().force_normal_n);
    assert_eq!(back.provenance().origin, expected.provenance().origin);
    // The speed is that of the positions, and the normal force that of the forces along the normal.
    let world = back.world();
    let (tips, forces) = (world.position_m.as_ref().unwrap(), world.force_n.as_ref().unwrap());
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let step = |pair: &[[f64; 3]]| {
        let squares: f64 = (0..3).map(|axis| (pair[1][axis] - pair[0][axis]).powi(2)).sum();
        squares.sqrt() * back.rate_hz()
    };
    let speed = mean(&tips.windows(2).map(step).collect::<Vec<_>>());
    assert!((speed / mean(&back.signals().speed_m_s) - 1.0).abs() < 0.05, "{speed}");
    let along = |force: &[f64; 3]| force.iter().zip(&normal()).map(|(f, n)| f * n).sum::<f64>();
    let normal = mean(&forces.iter().map(along).collect::<Vec<_>>());
    assert!((normal / mean(&back.signals().force_normal_n) - 1.0).abs() < 0.05, "{normal}");
    let wrong = save(&AnyRecording::Raw(raw), &folder.path().join("slate.xml"));
    assert!(wrong.unwrap_err().to_string().contains("Accel_<material>.xml"));
}

#[test]
fn damaged_archives_are_refused_with_the_member() {
    let error = |bytes: &[u8]| read_archive(bytes).unwrap_err().to_string();
    assert!(error(b"PK\x03\x04").contains("damaged"));
    let bytes = write_archive(&processed()).unwrap();
    assert!(read_archive(&bytes[..bytes.len() / 2]).is_err());
    // Same length, so that the archive stays well-formed but for the check sum.
    let with = |from: &[u8], to: &[u8]| {
        let at = bytes.windows(from.len()).position(|w| w == from).unwrap();
        [&bytes[..at], to, &bytes[at + from.len()..]].concat()
    };
    assert!(error(&with(b"rate_hz: 10000.0", b"rate_hz: -1000.0")).contains("head.ron"));
    assert!(error(&with(b"(700, )", b"(701, )")).contains("acceleration_m_s2.npy"));
}

#[test]
fn unsound_recordings_are_refused() {
    let Ok(AnyRecording::Raw(good)) = read_archive(&write_archive(&raw()).unwrap()) else { panic!() };
    let remake = |motion: Series<Pose>, calibration: Calibration| {
        let (wrench, acceleration) = (good.wrench().clone(), good.acceleration_v().clone());
        Recording::new(motion, wrench, acceleration, calibration, Gesture::Drag, provenance())
    };
    let mut mirrored = *good.calibration();
    mirrored.force_sensor_to_tool[0] = mirrored.force_sensor_to_tool[0].map(|x| -x);
    assert_eq!(remake(good.motion().clone(), mirrored), Err(RecordingError::Calibration));
    let mut late = good.motion().clone();
    late.start_s = 100.0;
    assert!(matches!(remake(late, *good.calibration()), Err(RecordingError::NoOverlap { .. })));
    let mut skewed = good.motion().clone();
    skewed.samples[3].orientation[0] += 0.5;
    assert!(matches!(
        remake(skewed, *good.calibration()),
        Err(RecordingError::Orientation { sample: 3, .. })
    ));
    let signals = |speed: f64| Signals {
        rate_hz: 1000.0,
        acceleration_m_s2: vec![0.0; 2],
        force_normal_n: vec![0.0; 2],
        force_tangential_n: None,
        speed_m_s: vec![0.0, speed],
        axes_m_s2: None,
    };
    let make = |signals| ProcessedRecording::new(signals, Gesture::Drag, provenance());
    assert!(make(signals(0.1)).is_ok());
    assert!(matches!(make(signals(-0.1)), Err(RecordingError::NegativeSpeed { sample: 1, .. })));
    assert!(matches!(make(signals(f64::NAN)), Err(RecordingError::NotFinite { sample: 1, .. })));
    assert!(matches!(
        make(Signals { speed_m_s: vec![0.0], ..signals(0.1) }),
        Err(RecordingError::Lengths { .. })
    ));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..Default::default() })]

    #[test]
    fn any_bytes_give_an_error_or_a_recording(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), kind in 0_usize..3, cut in any::<prop::sample::Index>()) {
        use std::sync::LazyLock;
        static FILES: LazyLock<[Vec<u8>; 3]> = LazyLock::new(|| {
            let small = AnyRecording::Processed(drag(&[(0.002, 0.1, 1.0)], 0.3, 1, |_, _| (vec![], 1.0)));
            let raw = AnyRecording::Raw(circle(0.02, 0.03, 1.0, 1.0, 0.3));
            [write_archive(&small).unwrap(), write_archive(&raw).unwrap(), write_csv(&raw).unwrap()]
        });
        let mut bytes = FILES[kind].clone();
        for (index, value) in flips {
            let at = index.index(bytes.len());
            bytes[at] = value;
        }
        let _ = read_archive(&bytes);
        let _ = read_csv(&bytes, "here");
        bytes.truncate(cut.index(bytes.len()));
        let _ = read_archive(&bytes);
        let _ = read_csv(&bytes, "here");
        let _ = read_hatt(&bytes[..], &bytes[..], &bytes[..], "here");
    }
}

#[test]
#[ignore = "timing: run in release, alone"]
fn ten_seconds_load_in_well_under_a_tenth_of_a_second() {
    let recording = AnyRecording::Raw(circle(10.0, 0.03, 1.0, 1.0, 0.3));
    let bytes = write_archive(&recording).unwrap();
    let began = std::time::Instant::now();
    let back = read_archive(&bytes).unwrap();
    let took = began.elapsed();
    assert!(back == recording, "what was read is not what was written");
    assert!(took.as_millis() < 100, "{took:?} for {} bytes", bytes.len());
}

#[test]
fn numbers_without_bounds_are_refused_at_their_cell_or_by_name() {
    let table = |rows: &str| format!("accel_m_s2,force_normal_n,speed_mm_s\n1,1,80\n{rows}\n");
    for (text, place) in [
        ("# rate_hz: 1000\n".to_owned() + &table("2,1,1e16"), Some((4, 3))),
        ("# rate_hz: 1000\n".to_owned() + &table("2,1,1e308"), Some((4, 3))),
        ("# rate_hz: 1000\n".to_owned() + &table("2,-1e5,80"), Some((4, 2))),
        ("# rate_hz: 1000\n".to_owned() + &table("1e12,1,80"), Some((4, 1))),
        ("# rate_hz: 1e12\n".to_owned() + &table("2,1,80"), None),
        ("# rate_hz: 1e-3\n".to_owned() + &table("2,1,80"), None),
        ("time_s,accel_m_s2,force_normal_n,speed_mm_s\n0,1,1,1\n1e-9,1,1,1\n".to_owned(), Some((1, 0))),
        ("time_s,accel_m_s2,force_normal_n,speed_mm_s\n0,1,1,1\n1e300,1,1,1\n".to_owned(), Some((3, 1))),
    ] {
        let found = match read_csv(text.as_bytes(), "x") {
            Err(ReadError::Csv { line, .. }) => Some((line, 0)),
            Err(ReadError::CsvCell { line, column, .. }) => Some((line, column)),
            Err(ReadError::Io(message)) => {
                assert!(message.contains("from 1 Hz to 1 MHz"), "{message}");
                None
            }
            other => panic!("{text}: {other:?}"),
        };
        assert_eq!(found, place, "{text}");
    }
    let signals = |rate_hz, speed| Signals {
        rate_hz,
        acceleration_m_s2: vec![0.0, 1.0],
        force_normal_n: vec![1.0; 2],
        speed_m_s: vec![0.1, speed],
        ..Signals::default()
    };
    let made = |rate_hz, speed| {
        let provenance = Provenance::new(Origin::Procedural, "a test");
        ProcessedRecording::new(signals(rate_hz, speed), Gesture::Drag, provenance).map(drop)
    };
    assert_eq!(made(1000.0, 100.0), Ok(()));
    assert!(matches!(made(1000.0, 1e13), Err(RecordingError::TooLarge { sample: 1, .. })));
    assert!(matches!(made(1000.0, f64::NAN), Err(RecordingError::NotFinite { sample: 1, .. })));
    assert!(matches!(made(1e12, 0.1), Err(RecordingError::Rate { .. })));
}
