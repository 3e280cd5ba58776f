//! The weights of the models at points of a map, as the engine has them: a table that the page's own are compared with
//! (`units.test.mjs`).

use haptograph_surfaces::files;
use serde_json::{Value, json};
use std::path::Path;

const POINTS: usize = 100;
/// The points reach from this part of the largest speed and force to that, beyond the map on both sides.
const REACH: (f64, f64) = (-0.2, 1.4);
const NEAR: f64 = 1e-12;

/// The map of a surface, and the weights at points of it, as [speed, force, [[vertex, weight]]].
fn table() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/surfaces/t2-canvas.ron");
    let texture = files::load(&path).expect("it ships").texture.expect("a texture");
    let map = texture.triangulation();
    let mut seed = 7_u64;
    let mut part = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as f64 / (1_u64 << 31) as f64
    };
    let mut point = |number: usize| {
        let of = |part: f64, most: f64| (REACH.0 + (REACH.1 - REACH.0) * part) * most;
        let (speed, force) = (of(part(), map.max_speed_m_s()), of(part(), map.max_force_n()));
        match texture.models().get(number) {
            // Some models themselves, and the corners of the map.
            Some(at) if number.is_multiple_of(3) => (at.speed_m_s, at.force_n),
            _ => (speed, force),
        }
    };
    let cases = (0..POINTS).map(|number| {
        let (speed, force) = point(number);
        let within = map.saturate(speed, force);
        let found = map.locate_from(0, within.0, within.1);
        let vertices = map.triangles()[found.triangle as usize];
        let weights: Vec<_> = vertices.iter().zip(found.weights).collect();
        json!([speed, force, weights])
    });
    let models = texture.models().iter();
    let points: Vec<_> = models.map(|at| [at.speed_m_s, at.force_n]).collect();
    json!({ "points": points, "triangles": map.triangles(), "cases": cases.collect::<Vec<_>>() })
}

fn assert_near(kept: &Value, now: &Value) {
    match (kept, now) {
        (Value::Array(kept), Value::Array(now)) => {
            assert_eq!(kept.len(), now.len());
            kept.iter().zip(now).for_each(|(kept, now)| assert_near(kept, now));
        }
        _ => {
            let (kept, now) = (kept.as_f64().expect("a number"), now.as_f64().expect("a number"));
            assert!((kept - now).abs() <= NEAR, "{kept} is kept, {now} is now");
        }
    }
}

#[test]
fn the_kept_weights_are_those_of_the_engine() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/weights.json");
    let now = table();
    if std::env::var_os("HAPTOGRAPH_WRITE_WEIGHTS").is_some() {
        std::fs::write(&path, format!("{now}\n")).expect("written");
    }
    let kept = std::fs::read_to_string(&path).expect("HAPTOGRAPH_WRITE_WEIGHTS=1 writes it");
    let kept: Value = serde_json::from_str(&kept).expect("JSON");
    let cases = now["cases"].as_array().expect("a list");
    let beyond = |case: &&Value| case[0].as_f64() < Some(0.0) || case[1].as_f64() < Some(0.0);
    assert!(cases.iter().filter(beyond).count() > 5);
    for part in ["points", "triangles", "cases"] {
        assert_near(&kept[part], &now[part]);
    }
}
