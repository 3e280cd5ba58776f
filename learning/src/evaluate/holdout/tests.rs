use super::super::{RecordingName, Take};
use super::*;
use crate::recording::AnyRecording;
use crate::recording::tests::synthetic::drag;

/// A material whose vibration is a resonance that grows with speed.
fn take(material: &str, number: u64, angle: f64) -> Take {
    let steps: Vec<_> =
        (0..10).map(|i| (0.4, 0.06 + 0.03 * f64::from(i % 4), 0.7 + 0.3 * f64::from(i % 3))).collect();
    let seed = number + (1000.0 * angle) as u64;
    let recording =
        drag(&steps, 0.3, seed, |speed, _| (vec![-1.8 * angle.cos(), 0.81], 300.0 * speed * speed));
    Take {
        name: RecordingName { material: material.into(), person: "p".into(), take: number.to_string() },
        recording: AnyRecording::Processed(recording),
    }
}

fn takes() -> Vec<Take> {
    vec![take("b", 1, 0.2), take("a", 1, 0.35), take("a", 2, 0.35), take("b", 2, 0.2)]
}

fn settings() -> HoldoutSettings {
    HoldoutSettings {
        // Synthetic drags have no high-pass to compensate.
        texture: TextureMethod::Law(crate::learn::law::LawSettings {
            highpass_hz: None,
            ..Default::default()
        }),
        seeds: 4,
        ..HoldoutSettings::default()
    }
}

#[test]
fn folds_never_test_on_what_they_learn_from() {
    let AnyRecording::Processed(recording) = take("a", 1, 0.3).recording else {
        panic!("it is processed");
    };
    let samples = recording.samples();
    for split in [Split::Halves, Split::Quarters] {
        let folds = split.folds(std::slice::from_ref(&recording));
        assert_eq!(folds.len(), 2);
        for fold in folds {
            let (train, test) = (fold.train.recordings().unwrap(), fold.test.recordings().unwrap());
            let all: usize = train.iter().chain(&test).map(ProcessedRecording::samples).sum();
            assert_eq!(all, samples);
            let values = |parts: &[ProcessedRecording]| -> std::collections::BTreeSet<u64> {
                let of = |part: &ProcessedRecording| part.signals().acceleration_m_s2.clone();
                parts.iter().flat_map(of).map(f64::to_bits).collect()
            };
            assert!(values(&train).is_disjoint(&values(&test)));
        }
    }
    assert!(Split::Takes.folds(std::slice::from_ref(&recording)).is_empty());
}

#[test]
fn a_method_that_knows_the_process_comes_near_the_floor_and_a_plain_one_is_shown_beside_it() {
    let found = hold_out(&takes(), &settings(), &|_| ()).unwrap();
    assert_eq!(found.materials, ["a", "b"]);
    let splits = found.splits();
    assert_eq!(splits.iter().map(|s| s.split).collect::<Vec<_>>(), Split::ALL);
    for split in &splits {
        assert_eq!(split.methods.len(), Method::ALL.len());
        let of = |method: Method| &split.methods[method as usize];
        let (floor, law) = (of(Method::Floor), of(Method::Default));
        let mean = |of: &MethodMean, measure: Measure| of.mean(measure).unwrap().mean;
        assert_eq!(mean(floor, Measure::AboveFloor), 0.0);
        assert!(mean(law, Measure::Lsd) < mean(floor, Measure::Lsd) + 0.5, "{law:?}");
        for measure in [Measure::Lsd, Measure::MiddleLsd, Measure::Low, Measure::Total] {
            let each = law.by_material(measure);
            assert_eq!(each.len(), 2);
            assert!((each.iter().sum::<f64>() / 2.0 - mean(law, measure)).abs() < 1e-12);
        }
        assert!(Measure::all().enumerate().all(|(number, measure)| measure as usize == number));
        // The mean of sizes is at least the size of the mean, and over all bands it is the one of the table.
        let (bands, sizes): (Vec<_>, Vec<_>) =
            law.by_band.iter().map(|b| (b.signed_db, b.absolute_db)).unzip();
        assert!(bands.iter().zip(&sizes).all(|(signed, size)| signed.abs() <= *size + 1e-12));
        assert!(bands.iter().zip(&sizes).any(|(signed, size)| signed.abs() + 0.01 < *size));
        let over_all = sizes.iter().sum::<f64>() / sizes.len() as f64;
        assert!((over_all - mean(law, Measure::Absolute)).abs() < 1e-9, "{over_all} {law:?}");
        assert!(mean(law, Measure::Total).abs() < 1.0 && mean(law, Measure::Kurtosis).abs() < 1.0);
        // Here levels follow force and speed, up to the estimation error of 500 samples.
        assert!(split.unexplained_level_db.unwrap().mean < 1.5);
        assert!(mean(law, Measure::Envelope) < 2.0 * mean(law, Measure::EnvelopeFloor));
        assert!(split.estimator_db.1 < split.estimator_db.0);
        // The process is Gaussian noise: so is what is learned, and clips of it are it.
        for method in [Method::Default, Method::Granular] {
            let over_db = mean(of(method), Measure::Modulation) - mean(floor, Measure::Modulation);
            let [lsd_db, floor_db] = [method, Method::Floor].map(|method| mean(of(method), Measure::SeedLsd));
            let octaves = mean(of(method), Measure::KurtosisRatio);
            let found = (method, over_db, lsd_db, floor_db, octaves);
            assert!(over_db < 2.0 && lsd_db < floor_db + 1.0 && octaves < 1.0, "{found:?}");
        }
        let spreads = Measure::all().filter_map(|measure| law.mean(measure)?.spread);
        assert_eq!(spreads.filter(|spread| *spread > 0.0).count(), 9);
        // Both spectra follow speed and force less closely than the law.
        for method in [Method::OneWarped, Method::Phases] {
            assert!(
                mean(of(method), Measure::SeedLsd) > 0.0 && mean(of(method), Measure::Total).abs() < 1.5,
                "{method:?}"
            );
        }
        // One model for all speeds has the wrong level at each speed.
        assert!(mean(of(Method::OneModel), Measure::Envelope) > mean(law, Measure::Envelope));
        assert!(!floor.loses && !of(Method::OneModel).loses);
        for method in [Method::Default, Method::Thesis] {
            assert_eq!(of(method).loses, mean(of(method), Measure::AboveBaseline) > 0.0);
        }
    }
}

#[test]
fn a_method_that_is_worse_than_a_plain_one_loses() {
    // A model of order one cannot represent a resonance; the plain models of order 20 can.
    let poor = HoldoutSettings {
        texture: TextureMethod::Law(crate::learn::law::LawSettings {
            order: 1,
            highpass_hz: None,
            ..Default::default()
        }),
        splits: vec![Split::Takes],
        ..settings()
    };
    let found = hold_out(&takes(), &poor, &|_| ()).unwrap().splits();
    let law = &found[0].methods[Method::Default as usize];
    assert!(law.loses && law.mean(Measure::AboveBaseline).unwrap().mean > 1.0, "{law:?}");
}

#[test]
fn holding_out_twice_gives_the_same_bits_and_nothing_gives_no_result() {
    let settings = HoldoutSettings { splits: vec![Split::Halves], seeds: 2, ..settings() };
    let some = takes()[..2].to_vec();
    let twice = [(); 2].map(|()| hold_out(&some, &settings, &|_| ()).unwrap());
    assert_eq!(twice[0], twice[1]);
    assert!(matches!(hold_out(&[], &settings, &|_| ()), Err(HoldoutError::Study(StudyError::NoRecordings))));
}
