//! Takes of several files.

use super::*;

#[test]
fn files_of_a_take_are_joined_by_time_or_by_name() {
    let folder = Folder::new();
    let fast: String = rows(1000).map(|(t, a, ..)| format!("{t},{a}\n")).collect();
    let slow: String = (0..80)
        .map(|i| format!("{},{},{}\n", 0.1 + f64::from(i) / 100.0, 1.0 + f64::from(i) / 100.0, 50))
        .collect();
    let accel = folder.with("accel.csv", format!("time_s,accel_m_s2\n{fast}"));
    let motion = folder.with("motion.csv", format!("time_s,force_normal_n,speed_mm_s\n{slow}"));
    let (recording, _) = read(&[motion, accel], &ImportSettings::default()).expect("a recording");
    let signals = recording.signals();
    // From 0.1 s to 0.89 s, at the rate of the vibration.
    assert_eq!((signals.rate_hz, recording.samples()), (1000.0, 791));
    assert!((signals.acceleration_m_s2[0] - (100.0 * 0.7_f64).sin()).abs() < 1e-9);
    assert!((signals.force_normal_n[5] - 1.005).abs() < 1e-9);

    let wav = folder.wav("take.wav", rows(900).map(|(_, a, ..)| a / 50.0));
    folder.with("take.csv", format!("time_s,force_normal_n,speed_mm_s\n{slow}"));
    assert!(read(std::slice::from_ref(&wav), &ImportSettings::default()).is_err(), "no full scale");
    let import = ImportSettings { full_scale_m_s2: Some(50.0), ..ImportSettings::default() };
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
    let slow: Vec<String> = (0..80).map(|i| format!("{},1,50\n", f64::from(i) / 100.0)).collect();
    let head = "time_s,force_normal_n,speed_mm_s\n";
    let gap = format!("{head}{}{}", slow[..30].concat(), slow[50..].concat());
    assert_eq!(place("gap.csv", gap), 32);
    let worse: String = (0..80).map(|i| format!("{},x,50\n", f64::from(i) / 100.0)).collect();
    assert_eq!(place("cells.csv", format!("{head}{worse}")), 2);
    let wrong_gesture = format!("# gesture: wave\n{head}{}", slow.concat());
    assert_eq!(place("gesture.csv", wrong_gesture), 1);
}

#[test]
fn what_one_file_has_beyond_another_is_said_and_a_lone_wav_asks_for_its_table() {
    let folder = Folder::new();
    let wav = folder.wav("w3.wav", rows(10_001).map(|(_, a, ..)| a));
    let import = ImportSettings { full_scale_m_s2: Some(50.0), ..ImportSettings::default() };
    let alone = read(std::slice::from_ref(&wav), &import).expect_err("no table");
    let LoadError::Read { source: ReadError::NoTable { missing, table }, .. } = alone else {
        panic!("{alone}")
    };
    assert_eq!((&missing[..], &*table), (&["force_normal".to_owned(), "speed".to_owned()][..], "w3.csv"));
    let slow: String = (0..201).map(|i| format!("{},1,50\n", f64::from(i) / 100.0)).collect();
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
    assert_eq!(cut.to_string(), "w3.csv ends at 2 s, w3.wav at 10 s: 8 s of w3.wav are not used");
}
