//! What the sink of recordings writes is read again.

use haptograph::engine::frame::Kind;
use haptograph::engine::node::{FileContext, FileKind, Stream};
use haptograph::learning::processing::tip_positions;
use haptograph::learning::recording::{AnyRecording, Gesture, Recording, load, write_csv};
use haptograph::nodes::sinks::recording::{Motion, RecordingSink, RecordingSinkSettings};
use haptograph::signal::quantity::Quantity;
use haptograph::signal::time::Rate;
use haptograph::signal::units::{Degrees, Millimetres};
use haptograph::signal::vector::{norm, sub};
use haptograph::surfaces::Origin;
use haptograph::surfaces::recorder::{assemble, spool_folder};

fn stream(name: &str, kind: Kind, rate: &str, simulated: bool) -> Stream {
    Stream {
        name: name.into(),
        kind,
        quantity: Quantity::NUMBER,
        rate: Rate::parse(rate).unwrap(),
        simulated,
    }
}

fn context(tracker: [&str; 2], simulated: bool) -> FileContext {
    let streams = vec![
        stream("tracker.position", Kind::VECTOR, tracker[0], simulated),
        stream("tracker.orientation", Kind::VECTOR, tracker[1], simulated),
        stream("force.wrench", Kind::WRENCH, "1000", simulated),
        stream("accelerometer.voltage", Kind::VECTOR, "1000", simulated),
    ];
    FileContext { streams, graph_seed: 7 }
}

fn settings(file: &str) -> RecordingSinkSettings {
    RecordingSinkSettings {
        file: file.into(),
        motion: Motion::Tap,
        material: "T3".into(),
        person: 2,
        m_s2_per_v: 100.0,
        zero_v: 1.5,
        tracker_to_tip_mm: [0.0, 0.0, -120.0].map(Millimetres),
        force_sensor_turn_deg: [0.0, 0.0, 90.0].map(Degrees),
    }
}

/// Writes ten frames of the fast sensors and five poses; reads them again.
fn written(file: &str, simulated: bool) -> Recording {
    let cx = context(["500", "500"], simulated);
    let folder = tempfile::tempdir().unwrap();
    let sink = RecordingSink::build(settings(file), &cx).unwrap();
    let path = folder.path().join(sink.file_name());
    let mut writer = sink.open(&path, &cx.streams).unwrap();
    for block in 0..5 {
        let t = f64::from(block);
        writer.write(0, &[t, 2.0, 3.0]).unwrap();
        writer.write(1, &[0.0, 0.1 * t, 0.0]).unwrap();
        writer.write(2, &[t, 0.0, 1.0, 0.0, 0.5, 0.0, t, 0.0, 1.0, 0.0, 0.5, 0.0]).unwrap();
        writer.write(3, &[1.5, 1.5, t, 1.5, 1.5, t]).unwrap();
    }
    writer.finish().unwrap();
    match load(&path).unwrap() {
        AnyRecording::Raw(recording) => recording,
        AnyRecording::Processed(_) => panic!("readings of sensors are raw"),
    }
}

#[test]
fn what_the_sensors_read_is_found_in_the_file_with_its_calibration_and_source() {
    for file in ["felt.npz", "felt.csv"] {
        let recording = written(file, true);
        assert_eq!((recording.motion().samples.len(), recording.motion().rate_hz), (5, 500.0));
        assert_eq!((recording.wrench().iter().count(), recording.wrench().rate_hz), (10, 1000.0));
        // Whether a file keeps readings and calibration apart or not: the physical quantities are the same.
        let calibration = recording.calibration();
        let last_v = recording.acceleration_v().iter().nth(9).unwrap();
        assert_eq!(calibration.acceleration_m_s2(&last_v), [0.0, 0.0, 250.0]);
        let tip_m = tip_positions(&recording)[4];
        let sway = 0.4_f64;
        let wanted_m = [4.0 - 0.12 * sway.sin(), 2.0, 3.0 - 0.12 * sway.cos()];
        assert!(norm(sub(tip_m, wanted_m)) < 1e-12, "{tip_m:?}");
        let load = calibration.load_on_tool(&recording.wrench().iter().nth(2).unwrap());
        assert!(norm(sub(load.force_n, [0.0, 1.0, 1.0])) < 1e-12, "{load:?}");
        assert!(norm(sub(load.torque_n_m, [-0.5, 0.0, 0.0])) < 1e-12, "{load:?}");
        assert_eq!(recording.gesture(), Gesture::Tap);
        let provenance = recording.provenance();
        assert_eq!(provenance.origin, Origin::Simulated);
        // A table has no place for the rest.
        for (name, value) in [("material", "T3"), ("person", "2"), ("seed", "7")] {
            assert!(file.ends_with("csv") || provenance.settings[name] == value);
        }
    }
}

#[test]
fn a_table_is_written_as_it_goes_and_is_that_of_the_whole_recording() {
    let cx = context(["500", "500"], true);
    let folder = tempfile::tempdir().unwrap();
    let open = |file: &str| {
        let sink = RecordingSink::build(settings(file), &cx).unwrap();
        let path = folder.path().join(sink.file_name());
        (sink.open(&path, &cx.streams).unwrap(), path)
    };
    let ((mut table, at), (mut archive, whole)) = (open("x.csv"), open("x.npz"));
    for block in 0..2000 {
        let t = f64::from(block);
        for writer in [&mut table, &mut archive] {
            writer.write(3, &[1.5, 1.5, t, 1.5, 1.5, 0.3 * t]).unwrap();
            writer.write(1, &[0.0, 0.001 * t, 0.0]).unwrap();
            writer.write(0, &[0.1 * t, 2.0, 3.0]).unwrap();
            writer.write(2, &[0.7; 12]).unwrap();
        }
    }
    // All but the last second is there for a process that is killed.
    let killed = std::fs::read_to_string(&at).unwrap();
    table.finish().unwrap();
    archive.finish().unwrap();
    assert!(killed.lines().count() > 2000, "{}", killed.lines().count());
    let now = std::fs::read_to_string(&at).unwrap();
    assert!(now.starts_with(&killed) && !spool_folder(&at).exists());
    // But for the provenance, of which a table keeps less.
    let of_whole = write_csv(&load(&whole).unwrap()).unwrap();
    assert!(now.as_bytes() == of_whole);
    let (mut wrong, _) = open("y.csv");
    assert!(wrong.write(3, &[f64::NAN; 3]).is_err());
}

#[test]
fn what_no_simulation_made_is_measured() {
    let provenance = written("felt.npz", false).provenance().clone();
    assert_eq!(provenance.origin, Origin::Measured);
    assert!(!provenance.settings.contains_key("seed"));
}

#[test]
fn poses_of_two_rates_are_refused() {
    let refused = RecordingSink::build(settings("x.npz"), &context(["240", "1000"], true)).err();
    assert_eq!(refused.and_then(|e| e.field), Some("orientation"));
}

#[test]
fn what_a_dead_run_left_is_the_recording_up_to_there() {
    let cx = context(["500", "500"], true);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    let sink = RecordingSink::build(settings("x.npz"), &cx).unwrap();
    let mut writer = sink.open(&path, &cx.streams).unwrap();
    for second in 0..2 {
        let t = f64::from(second);
        for stream in [0, 1] {
            writer.write(stream, &[t; 1500]).unwrap();
        }
        writer.write(2, &[t; 6000]).unwrap();
        writer.write(3, &[t; 3000]).unwrap();
    }
    // Nothing after this point is done for a process that is killed.
    let (left, made) = (spool_folder(&path), folder.path().join("made.npz"));
    assemble(&left, &made).unwrap();
    let AnyRecording::Raw(recording) = load(&made).unwrap() else {
        panic!("readings of sensors are raw");
    };
    assert_eq!(recording.motion().samples.len(), 1000);
    assert_eq!(recording.acceleration_v().iter().count(), 2000);
    assert_eq!(recording.gesture(), Gesture::Tap);
    writer.finish().unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), std::fs::read(&made).unwrap());
    assert!(!left.exists());
}

#[test]
fn a_run_too_short_for_a_recording_says_so() {
    let cx = context(["500", "500"], true);
    let folder = tempfile::tempdir().unwrap();
    let sink = RecordingSink::build(settings("x.npz"), &cx).unwrap();
    let writer = sink.open(&folder.path().join("x.npz"), &cx.streams).unwrap();
    assert!(writer.finish().unwrap_err().to_string().contains("needs two"));
    assert!(!folder.path().join("x.npz").exists());
}
