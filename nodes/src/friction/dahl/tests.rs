use super::*;
use crate::contact::mesh::TriangleMesh;
use crate::contact::shape::{Shape, Touch};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::sync::Arc;

const MU: f64 = 0.4;
/// z_max
const MAX_M: f64 = 0.004 * MU;
const PRINTED: DahlSettings = DahlSettings { stretch_m: 0.004, under_load: UnderLoad::AsPrinted };

fn on_plane(x: f64, y: f64) -> Contact {
    let ihip_m = [x, y, 0.0];
    Contact { touching: true, ihip_m, normal: [0.0, 0.0, 1.0], ..Contact::free(ihip_m) }
}

fn laws() -> [Dahl; 2] {
    [Dahl::new(DahlSettings::default()), Dahl::new(PRINTED)]
}

/// Work that friction does on the tool along a path of (x, y, load), by the trapezoid rule.
fn work_on_tool(law: &mut Dahl, path: impl Iterator<Item = (f64, f64, f64)>) -> f64 {
    let mut work = 0.0;
    let mut last: Option<(Vec3, Vec3)> = None;
    for (x, y, load_n) in path {
        let force = law.update(&on_plane(x, y), load_n, MU);
        if let Some((at, before)) = last {
            work += 0.5 * dot(add(before, force), sub([x, y, 0.0], at));
        }
        last = Some(([x, y, 0.0], force));
    }
    work
}

#[test]
fn a_slow_pull_sticks_by_the_spring_and_then_slides_by_coulomb() {
    for mut law in laws() {
        for k in 0..1000 {
            let x = f64::from(k) * 1e-5;
            let force = law.update(&on_plane(x, 0.0), 1.5, MU);
            let expected = -MU * 1.5 * (x / MAX_M).min(1.0);
            assert!((force[0] - expected).abs() < 1e-12, "at {x}: {force:?}");
        }
    }
}

#[test]
fn friction_never_exceeds_mu_times_load_in_any_motion() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    for mut law in laws() {
        let (mut x, mut y) = (0.0, 0.0);
        for _ in 0..100_000 {
            x += rng.random_range(-1e-3..1e-3);
            y += rng.random_range(-1e-3..1e-3);
            let (load_n, mu) = (rng.random_range(0.0..5.0), rng.random_range(0.0..1.4));
            let mut contact = on_plane(x, y);
            contact.touching = rng.random_range(0..50) > 0;
            let force = law.update(&contact, load_n, mu);
            assert!(norm(force) <= mu * load_n * (1.0 + 1e-12));
            assert!(contact.touching || force == ZERO);
        }
    }
}

#[test]
fn under_constant_load_no_closed_path_gives_energy() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(2);
    for round in 0..300 {
        let size_m = if round % 2 == 0 { 0.3 * MAX_M } else { 4.0 * MAX_M };
        let waves: Vec<[f64; 4]> = (1..=4)
            .map(|_| {
                [
                    rng.random_range(-size_m..size_m),
                    rng.random_range(0.0..6.3),
                    rng.random_range(-size_m..size_m),
                    rng.random_range(0.0..6.3),
                ]
            })
            .collect();
        let path = (0..=4000).map(|k| {
            let turn = std::f64::consts::TAU * f64::from(k) / 4000.0;
            let at = |size: usize, phase: usize| -> f64 {
                waves.iter().zip(1..).map(|(w, n)| w[size] * (f64::from(n) * turn + w[phase]).sin()).sum()
            };
            (at(0, 1), at(2, 3), 1.2)
        });
        for mut law in laws() {
            let work = work_on_tool(&mut law, path.clone());
            assert!(work <= 1e-12, "round {round}: {work} J gained");
        }
    }
}

/// The law stretched at a low load and released at a high one: stretch, press, go home.
fn stretch_and_release(law: &mut Dahl) -> (f64, f64) {
    let steps = 2000;
    let way = |k: i32| MAX_M * f64::from(k) / f64::from(steps);
    let put_in = -work_on_tool(law, (0..=steps).map(|k| (way(k), 0.0, 0.3)));
    let press = (0..=steps).map(|k| (MAX_M, 0.0, 0.3 + 2.45 * f64::from(k) / f64::from(steps)));
    assert!(work_on_tool(law, press).abs() < 1e-15, "pressing moves nothing along the surface");
    let given_back = work_on_tool(law, (0..=steps).rev().map(|k| (way(k), 0.0, 2.75)));
    (put_in, given_back)
}

#[test]
fn stretched_at_a_low_load_and_released_at_a_high_one_only_the_printed_law_gives_energy() {
    let [mut passive, mut printed] = laws();
    let (put_in, given_back) = stretch_and_release(&mut printed);
    assert!((put_in - 0.5 * MU * 0.3 * MAX_M).abs() < 1e-9);
    assert!((given_back / put_in - 2.75 / 0.3).abs() < 0.01, "{given_back} J for {put_in} J");
    let (put_in, given_back) = stretch_and_release(&mut passive);
    assert!(given_back <= put_in * 1.001, "{given_back} J for {put_in} J");
}

#[test]
fn under_any_load_the_passive_law_gives_no_energy_and_the_printed_one_does() {
    let gained = |mut law: Dahl, seed: u64| {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let phases: [f64; 3] = std::array::from_fn(|_| rng.random_range(0.0..6.3));
        // Back and forth within the sticking range, the load in step with the motion: worst for the printed law.
        let path = (0..=40_000).map(|k| {
            let t = f64::from(k) * 1e-3;
            let x = 0.4 * MAX_M * (3.0 * t + phases[0]).sin();
            let load_n = 1.5 + 1.2 * (6.0 * t + phases[1]).sin();
            (x, 0.2 * MAX_M * (2.0 * t + phases[2]).cos(), load_n)
        });
        work_on_tool(&mut law, path)
    };
    let printed: f64 = (0..8).map(|seed| gained(Dahl::new(PRINTED), seed)).fold(f64::MIN, f64::max);
    assert!(printed > 1e-4, "the printed law gains {printed} J at its worst");
    for seed in 0..8 {
        let passive = gained(Dahl::new(DahlSettings::default()), seed);
        assert!(passive < 0.0, "{passive} J");
    }
}

#[test]
fn a_trembling_load_does_not_loosen_a_held_tool() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
    let [mut law, _] = laws();
    law.update(&on_plane(0.0, 0.0), 1.0, MU);
    let held = law.update(&on_plane(0.9 * MAX_M, 0.0), 1.0, MU)[0];
    for _ in 0..10_000 {
        law.update(&on_plane(0.9 * MAX_M, 0.0), rng.random_range(0.9..1.1), MU);
    }
    let later = law.update(&on_plane(0.9 * MAX_M, 0.0), 1.0, MU)[0];
    assert!((later / held - 1.0).abs() < 0.06, "{held} N became {later} N");
}

#[test]
fn the_force_does_not_jump_at_onset_at_stops_or_when_it_turns() {
    for mut law in laws() {
        let mut last = law.update(&on_plane(0.3, 0.0), 0.5, MU);
        assert_eq!(last, ZERO, "the spring starts loose");
        for k in 1..6000 {
            let t = f64::from(k) * 1e-3;
            // Strokes with stops in between, pressed harder and softer (thus z_max F_n changes too).
            let x = 0.3 + 0.02 * (t.sin() * 2.0).clamp(-1.0, 1.0);
            let load_n = 0.5 + 0.2 * (2.0 * t).sin();
            let force = law.update(&on_plane(x, 0.0), load_n, MU);
            // At most the spring's rate times the step, and the load's own change.
            assert!(norm(sub(force, last)) < 1e-3 * (0.7 / 0.004 * 0.045 + 0.4 * MU * 2.0), "at {t}");
            last = force;
        }
    }
}

#[test]
fn the_magnitude_does_not_jump_across_the_edges_of_a_mesh() {
    // Round a prism of eight sides from outside and from inside: edges of 45 degrees, convex and concave.
    let mesh = Arc::new(TriangleMesh::cylinder(0.012, 0.04, 8).unwrap());
    for (start_m, radius_m) in [(None, 0.0107), (Some([0.0; 3]), 0.0123)] {
        let mut touch = Touch::new(&Shape::Mesh { mesh: mesh.clone(), start_m }, 0.0).unwrap();
        let mut law = Dahl::new(DahlSettings::default());
        let mut faces = std::collections::BTreeSet::new();
        let mut last: Option<(f64, Contact)> = None;
        touch.update([0.02, 0.0, 0.0].map(|x| if start_m.is_none() { x } else { 0.0 }));
        for k in 0..40_000 {
            let (sin, cos) = (f64::from(k) * 1.7e-4).sin_cos();
            let contact = touch.update([radius_m * cos, radius_m * sin, 0.003 * sin]);
            assert!(contact.touching);
            let size = norm(law.update(&contact, 1.0, MU));
            if let Some((before, previous)) = last {
                let step_m = norm(sub(contact.ihip_m, previous.ihip_m));
                assert!((size - before).abs() <= step_m / 0.004 + 1e-9, "tick {k}: {before} to {size}");
            }
            faces.insert(contact.face);
            last = Some((size, contact));
        }
        assert!(faces.len() >= 8, "{faces:?}");
        assert!((last.unwrap().0 - MU).abs() < 1e-9, "it slides");
    }
}

#[test]
fn a_turned_stretch_keeps_its_length_and_stays_tangent() {
    let normals = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.6, 0.0, 0.8], [0.0, 0.0, -1.0]];
    for from in normals {
        for to in normals {
            let v = reject([0.3, -0.2, 0.5], from);
            let turned = turn(v, from, to);
            assert!((norm(turned) - norm(v)).abs() < 1e-12, "{from:?} {to:?}");
            assert!(dot(turned, to).abs() < 1e-12);
        }
    }
}

#[test]
fn without_friction_or_contact_there_is_no_force() {
    let [mut law, _] = laws();
    law.update(&on_plane(0.0, 0.0), 1.0, 0.0);
    assert_eq!(norm(law.update(&on_plane(0.01, 0.0), 1.0, 0.0)), 0.0);
    law.update(&on_plane(0.02, 0.0), 1.0, MU);
    assert!(norm(law.update(&on_plane(0.03, 0.0), 1.0, MU)) > 0.3);
    assert_eq!(law.update(&Contact::free([0.03, 0.0, 0.01]), 0.0, MU), ZERO);
    assert_eq!(norm(law.update(&on_plane(0.0, 0.0), 1.0, MU)), 0.0, "a new touch starts loose");
    assert_eq!(law.update(&on_plane(0.01, 0.0), f64::NAN, MU), ZERO);
}
