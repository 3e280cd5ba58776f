//! How well virtual surfaces match the simulated ones, over many seeds and people; printed rather than tuned to. Run with
//! `cargo test --release --test evaluation -- --ignored --nocapture --test-threads 1`.

#![allow(clippy::print_stdout, clippy::unwrap_used)]

use haptograph::nodes::simulated::material::MaterialName;
use haptograph::recorder::{Session, record};
use haptograph::surfaces::evaluate::{Evaluation, RecordingName, StudySettings, Take, evaluate};
use haptograph::surfaces::learning::processing::processed;
use haptograph::surfaces::metrics::Pooling;
use haptograph::surfaces::recording::Gesture;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

fn take(material: MaterialName, person: u64, seed: u64) -> Take {
    let session = Session {
        material,
        gesture: Gesture::Drag,
        person,
        seconds: 10.0,
        seed,
    };
    let recording = record(&session, &AtomicBool::new(false), &mut |_| ()).unwrap();
    let name = RecordingName {
        material: material.word().to_owned(),
        person: person.to_string(),
        take: seed.to_string(),
    };
    Take { name, recording }
}

/// Mean power of the recorded acceleration, (m/s²)².
fn power(take: &Take) -> f64 {
    let recording = processed(&take.recording, &Default::default()).unwrap();
    let acceleration = &recording.signals().acceleration_m_s2;
    acceleration.iter().map(|a| a * a).sum::<f64>() / acceleration.len() as f64
}

fn study(takes: &[Take]) -> Evaluation {
    evaluate(takes, &StudySettings::default(), &|_| ()).unwrap()
}

#[test]
#[ignore = "240 simulated recordings: minutes"]
fn own_materials_are_nearest_over_ten_seeds() {
    let mut least = [0; 2];
    for seed in 1..=10 {
        let takes: Vec<Take> = MaterialName::ALL
            .into_iter()
            .flat_map(|material| (0..4).map(move |number| take(material, 1, 1000 * seed + number)))
            .collect();
        let powers: Vec<String> = takes
            .chunks(4)
            .map(|takes| format!("{:.1}", takes.iter().map(power).sum::<f64>() / 4.0))
            .collect();
        let found = study(&takes);
        print!("seed {seed}: powers {}", powers.join(" "));
        for (count, pooling) in least.iter_mut().zip([Pooling::Pair, Pooling::All]) {
            let table = found.materials_table.pooled(pooling);
            *count += usize::from(table.diagonal_is_least());
            let own = (0..6)
                .filter(|&i| table.is_least_of_row(i, i) && table.is_least_of_column(i, i))
                .count();
            print!(
                "; by {pooling:?} {own} of 6 least, baseline {:.2}",
                table.baseline()
            );
        }
        println!();
    }
    let [pair, all] = least;
    println!(
        "diagonal least of every row and column: {pair} of 10 seeds by pair, {all} of 10 by all windows"
    );
    assert!(all >= 8, "{all}");
}

#[test]
#[ignore = "60 simulated recordings: minutes"]
fn nine_people_and_six_materials_make_a_map() {
    let mut takes: Vec<Take> = vec![];
    for material in MaterialName::ALL {
        takes.extend((1..=9).map(|person| take(material, person, 50 + person)));
        takes.extend((0..3).map(|test| take(material, 9, 90 + test)));
    }
    let start = Instant::now();
    let found = study(&takes);
    let took = start.elapsed();
    let map = found.map.unwrap();
    println!("54 textures learned, compared and mapped in {took:.1?}");
    println!(
        "stress {:.3?}; purity {:.2} (k-means), {:.2} (tree); roughness and fineness {:.0?} degrees apart",
        map.scaling.stress, map.k_means_purity, map.tree_purity, map.angle_deg
    );
    for (person, (mean, deviation)) in found
        .people
        .iter()
        .zip(found.people_table.unwrap().row_statistics())
    {
        println!("person {person}: {mean:.2} (sd {deviation:.2})");
    }
    assert_eq!(map.names.len(), 54);
    assert!(map.tree_purity > 0.5);
}
