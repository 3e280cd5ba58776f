//! Figures that the evaluation and the segmentation have to reach, with the numbers printed. Run in release:
//! `cargo test --release -p haptograph-surfaces --test figures -- --ignored --nocapture --test-threads 1`.

#![allow(clippy::print_stdout, clippy::unwrap_used)]

use haptograph_learning::evaluate::{MapSettings, perceptual_map};
use haptograph_learning::learn::segmentation::{SegmentationSettings, segment};
use haptograph_signal::noise::Gaussian;
use haptograph_surfaces::hull::Hull;
use haptograph_surfaces::{ArmaModel, ModelAt, TextureModel, VertexKind};
use std::time::Instant;

/// A texture of order 20 with thirty models; people differ a little, materials much.
fn texture(material: usize, person: usize) -> TextureModel {
    let mut random = Gaussian::new((100 * material + person) as u64);
    let measured = (0..30)
        .map(|i| {
            let (speed_m_s, force_n) = (0.02 + 0.03 * (i % 6) as f64, 0.3 + 0.55 * (i / 6) as f64);
            // Ten resonances, spread more closely the finer the material.
            let lsf: Vec<f64> = (0..20)
                .map(|k| {
                    let even = (f64::from(k) + 1.0) / 21.0;
                    3.1 * even.powf(1.0 + 0.15 * material as f64) + 0.002 * random.next_sample()
                })
                .collect();
            let variance = (0.01 + 0.01 * material as f64) * speed_m_s * force_n;
            ModelAt {
                speed_m_s,
                force_n,
                model: ArmaModel::from_lsf(&lsf, &[], 1.0, variance).unwrap(),
                kind: VertexKind::Measured,
            }
        })
        .collect();
    TextureModel::from_measured(10_000.0, measured, &Hull::default()).unwrap()
}

#[test]
#[ignore = "timing: run in release, alone"]
fn nine_people_and_six_materials_are_mapped_in_eight_seconds() {
    let made: Vec<(String, String, TextureModel)> = (0..54)
        .map(|i| {
            let (material, person) = (i / 9, i % 9);
            (format!("m{material}.p{person}"), format!("m{material}"), texture(material, person))
        })
        .collect();
    let textures: Vec<_> =
        made.iter().map(|(name, material, t)| (name.clone(), material.clone(), t)).collect();
    let start = Instant::now();
    let map = perceptual_map(&textures, &MapSettings::default(), &|_| ()).unwrap();
    let took = start.elapsed();
    println!(
        "54 textures of 30 s, {} pairs: {took:.2?}; purity {:.2} (k-means), {:.2} (tree)",
        map.differences.len(),
        map.k_means_purity,
        map.tree_purity
    );
    assert_eq!(map.differences.len(), 1431);
    assert!(took.as_secs_f64() < 8.0, "{took:?}");
}

#[test]
#[ignore = "timing: run in release, alone"]
fn ten_seconds_at_ten_kilohertz_are_segmented_in_half_a_second() {
    let mut noise = Gaussian::new(1);
    let mut y = vec![0.0, 0.0];
    for i in 0..100_000 {
        // Twenty stretches that ring and sound differently.
        let stretch = (i / 5000) as f64;
        let angle = 0.1 + 0.05 * (7.0 * stretch % 11.0);
        let e = (1.0 + stretch % 3.0) * noise.next_sample();
        y.push(1.8 * angle.cos() * y[i + 1] - 0.81 * y[i] + e);
    }
    let start = Instant::now();
    let found = segment(&y[2..], &SegmentationSettings::default()).unwrap();
    let took = start.elapsed();
    println!("100 000 samples, order 1 to 20: {took:.3?}, {} segments", found.orders.len());
    assert!(took.as_secs_f64() < 0.5, "{took:?}");
    assert!((18..=24).contains(&found.orders.len()), "{found:?}");
}
