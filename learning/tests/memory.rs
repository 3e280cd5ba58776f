//! The memory that learning takes for each sample of a long recording.

#![allow(clippy::unwrap_used)] // Helpers of tests are tests.

use haptograph_learning::learn::{LearnSettings, learn};
use haptograph_learning::processing::{AxisReduction, ProcessingSettings, reduce};
use haptograph_learning::recording::{
    AnyRecording, Calibration, Gesture, Pose, Recording, Series, Wrench, load, save,
};
use haptograph_surfaces::{Origin, Provenance};
use peak_alloc::PeakAlloc;
use std::f64::consts::TAU;
use std::sync::Mutex;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;
/// One test at a time, since all share an allocator.
static ALONE: Mutex<()> = Mutex::new(());

/// Bytes at the peak of some work, beyond those before.
fn peak(work: impl FnOnce()) -> f64 {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    work();
    MEMORY.peak_usage().saturating_sub(before) as f64
}

/// So many seconds of circles over noise, at 10 kHz; or of strokes of 0.7 s from rest, which begin louder.
fn drag(seconds: usize, from_rest: bool) -> AnyRecording {
    let samples = 10_000 * seconds;
    let mut state = 1_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24) - 0.5
    };
    let pose = |k: usize| {
        let turn = match from_rest {
            true => TAU * (0.7 * (k / 240) as f64 + ((k % 240) as f64 / 240.0 - 0.3).max(0.0)),
            false => TAU * k as f64 / 240.0,
        };
        Pose { position_m: [0.02 * turn.cos(), 0.02 * turn.sin(), 0.0], orientation: [1.0, 0.0, 0.0, 0.0] }
    };
    let poses = (0..240 * seconds).map(pose).collect();
    let load = Wrench { force_n: [0.1, 0.0, 1.0], torque_n_m: [0.0; 3] };
    let level = |k: usize| match k % 10_000 {
        0..2900 if from_rest => 0.01,
        2900..3800 if from_rest => 10.0,
        _ => 1.0,
    };
    let volts = (0..samples).map(|k| [noise(), noise(), noise()].map(|x| level(k) * x)).collect();
    let recording = Recording::new(
        Series::new(240.0, poses),
        Series::new(10_000.0, vec![load; samples]),
        Series::new(10_000.0, volts),
        Calibration::default(),
        Gesture::Drag,
        Provenance::new(Origin::Simulated, "made up for a test"),
    );
    AnyRecording::Raw(recording.unwrap())
}

/// Bytes for each sample by which learning an archive of the second length takes more than of the first, s.
fn slope(seconds: [usize; 2], from_rest: bool) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    // Without transforms of the whole, which short recordings have.
    let processing =
        ProcessingSettings { reduction: AxisReduction::SingleAxis(0), ..ProcessingSettings::default() };
    let settings = LearnSettings { processing, ..LearnSettings::default() };
    let [short, long] = seconds.map(|seconds| {
        let path = folder.path().join("drag.npz");
        save(&drag(seconds, from_rest), &path).unwrap();
        peak(|| {
            let (surface, report) = learn("long", &[load(&path).unwrap()], &settings, &|_| ()).unwrap();
            assert!(surface.texture.is_some());
            assert_eq!(report.onset.unwrap().is_ok(), from_rest);
        })
    });
    (long - short) / (10_000 * (seconds[1] - seconds[0])) as f64
}

#[test]
fn a_long_archive_is_learned_in_forty_bytes_a_sample() {
    let _alone = ALONE.lock();
    let bytes = slope([50, 100], false);
    assert!(bytes < 40.0, "{bytes} bytes a sample");
}

#[test]
fn a_long_archive_with_strokes_from_rest_is_learned_in_sixty_bytes_a_sample() {
    let _alone = ALONE.lock();
    let bytes = slope([110, 150], true);
    assert!(bytes < 60.0, "{bytes} bytes a sample");
}

#[test]
fn three_long_axes_are_reduced_in_thirty_bytes_a_sample() {
    let _alone = ALONE.lock();
    let of = |samples: usize| {
        let axes = [1, 2, 3].map(|axis| (0..samples).map(|k| ((k * axis) as f64).sin()).collect());
        peak(|| assert_eq!(reduce(&axes, AxisReduction::Dft321).unwrap().len(), samples))
    };
    let (short, long) = (of(1_100_000), of(2_100_000));
    let bytes = (long - short) / 1_000_000.0;
    assert!(bytes < 30.0, "{bytes} bytes a sample");
}
