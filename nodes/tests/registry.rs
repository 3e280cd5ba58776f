//! What holds for every registered kind: its example works, it runs without allocating, the same bits come out for any
//! blocks, and what is not a number neither panics nor sticks.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]
#![expect(unsafe_code, reason = "an allocator that counts can only be written so")]

mod extremes;
mod realtime;

use haptograph_engine::frame::{Kind, OneKind};
use haptograph_engine::node::{NodeEntry, Presence, SettingId};
use haptograph_engine::settings::{Expected, SettingSpec};
use haptograph_engine::testing::{Bench, ExampleNode, MAX_FRAMES, device_from_example, node_from_example};
use haptograph_nodes::contact::Contact;
use haptograph_nodes::registry;
use haptograph_nodes::texture::frames::{Coefficients, Weights};
use haptograph_nodes::wav::{Format, WavWriter};
use haptograph_signal::quantity::Quantity;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use realtime::allocations;
use std::fs::File;
use std::path::Path;
use std::time::Instant;

/// Of every node on this bench; that of the recording among the examples' files.
const RATE_HZ: f64 = 10_000.0;
/// Of the taps of the surface, for the nodes that need it.
const SERVO_HZ: f64 = 1000.0;

/// Live frequencies that may be above half of the rate of their node: (kind, setting, why).
const ABOVE_NYQUIST: [(&str, &str, &str); 0] = [];

fn is_frequency(setting: &SettingSpec) -> bool {
    let scale = setting.unit.as_ref().and_then(|unit| unit.scale);
    scale.is_some_and(|(quantity, _)| quantity == Quantity::FREQUENCY)
}

#[test]
fn live_frequencies_stay_below_half_the_rate() {
    let registry = registry();
    let mut found = 0;
    for entry in registry.nodes() {
        let settings = entry.settings();
        let frequencies = settings.iter().filter(|setting| setting.live && is_frequency(setting));
        for setting in frequencies {
            let excepted =
                ABOVE_NYQUIST.iter().any(|(kind, name, _)| (*kind, *name) == (entry.spec.name, setting.name));
            assert_ne!(
                setting.below_nyquist, excepted,
                "{}.{}: mark it `[live, below_nyquist]`, or list it with a reason",
                entry.spec.name, setting.name
            );
            found += 1;
        }
        for setting in settings.iter().filter(|setting| setting.below_nyquist) {
            assert!(setting.live, "{}.{}", entry.spec.name, setting.name);
        }
    }
    assert!(found >= 2, "{found} live frequencies");
}

/// What is neither a frequency nor a gain nor a level: where, how long, how heavy, how warm.
const OTHERS: [Quantity; 5] =
    [Quantity::LENGTH, Quantity::TIME, Quantity::ANGLE, Quantity::MASS, Quantity::TEMPERATURE];

/// Settings of processors that are a frequency, a gain or a level and do not change while a graph runs: (kind, setting,
/// why).
const NOT_LIVE: [(&str, &str, &str); 22] = [
    (
        "Crossover",
        "at_hz",
        "frequencies that have to ascend: a change of one at a time passes through lists that are refused",
    ),
    (
        "Curve",
        "points",
        "pairs whose x has to rise: a change of one number at a time passes through curves that are refused",
    ),
    ("SecondOrderSection", "b", COEFFICIENTS),
    ("SecondOrderSection", "a", COEFFICIENTS),
    ("WavOverPosition", "axis", "a direction, neither a gain nor a level: its length does not count"),
    ("Integrator", "start", "it has its effect at the start and at a reset"),
    ("WavOverPosition", "recorded_mm_s", "it lays the recording out, which is done once"),
    (
        "DynamicCompensator",
        "most_a_per_m_s2",
        "a bound: the corner that keeps another one takes longer to find than a tick lasts",
    ),
    ("NormalForce", "device_damping_n_s_per_m", "only the check of the stiffness reads it"),
    ("ContactFromWrench", "press_n", "only the check of the object's size reads it"),
    ("AccelerometerModel", "m_s2_per_v", SENSOR),
    ("AccelerometerModel", "zero_v", SENSOR),
    ("AccelerometerModel", "range_m_s2", SENSOR),
    ("AccelerometerModel", "noise_m_s2", SENSOR),
    ("AccelerometerModel", "cutoff_hz", SENSOR),
    ("AccelerometerModel", "full_scale_v", SENSOR),
    ("ForceSensorModel", "force_step_n", SENSOR),
    ("ForceSensorModel", "torque_step_n_mm", SENSOR),
    ("ForceSensorModel", "most_force_n", SENSOR),
    ("SteeredModel", "warping", "of the models that come; on another axis they would be other filters"),
    ("ForceSensorModel", "most_torque_n_mm", SENSOR),
    ("ForceSensorModel", "noise_steps", SENSOR),
];
const COEFFICIENTS: &str = "they belong together: a change of one at a time passes through other filters, unstable ones too; \
                            `Biquad` has live frequencies";
const SENSOR: &str = "a constant of a simulated sensor; with another it would be another sensor";

#[test]
fn frequencies_gains_and_levels_are_live() {
    let folder = folder();
    let mut wrong = Vec::new();
    for entry in registry().nodes() {
        if !is_processor(entry, folder.path()) {
            continue;
        }
        for setting in entry.settings() {
            let quantity = setting.unit.as_ref().and_then(|unit| unit.scale);
            let is_other = quantity.is_some_and(|(quantity, _)| OTHERS.contains(&quantity));
            let is_one = setting.expected.is_numeric() && !setting.whole && !is_other;
            let excepted =
                NOT_LIVE.iter().any(|(kind, name, _)| (*kind, *name) == (entry.spec.name, setting.name));
            if is_one && setting.live == excepted || excepted && !is_one {
                wrong.push(format!("{}.{}", entry.spec.name, setting.name));
            }
        }
    }
    assert!(wrong.is_empty(), "make them live, or list them with a reason: {wrong:?}");
}

/// Settings beside which others have an effect on the bench: (kind, settings).
const BESIDE: [(&str, &str); 5] = [
    // Else the brake is free: it measures more than is asked of it.
    ("BrakeController", "mu: 2.0"),
    ("Responsiveness", "condition: Neither"),
    ("Tapping", "rearm_ms: 0.0"),
    ("WavSource", "repeat: true"),
    ("Adsr", "attack_ms: 0.0"),
];

/// Live settings whose change is not seen on the bench: (kind, setting, why).
const UNSEEN: [(&str, &str, &str); 0] = [];

/// Settings to try a kind with: those of its example; without its optional inputs, for which settings may stand; and
/// such as let others have an effect.
fn tries(entry: &NodeEntry) -> Vec<String> {
    let inputs = entry.spec.inputs.iter();
    let optional = inputs.filter(|port| port.presence == Presence::Optional);
    let unconnected: String = optional.map(|port| format!("{}: None, ", port.name)).collect();
    let beside = BESIDE.iter().filter(|(kind, _)| *kind == entry.spec.name);
    let beside = beside.map(|(_, settings)| format!("{unconnected}{settings}"));
    [String::new(), unconnected.clone()].into_iter().chain(beside).collect()
}

#[test]
fn every_live_setting_changes_what_its_node_puts_out() {
    const FRAMES: usize = 3000;
    let folder = folder();
    let (mut wrong, mut tested) = (Vec::new(), 0);
    for entry in registry().nodes() {
        if !is_processor(entry, folder.path()) {
            continue;
        }
        for (id, setting) in live_numbers(entry) {
            let (low, high) = setting.range.unwrap_or((-1e3, 1e3));
            let high = match setting.below_nyquist {
                true => high.min(0.4 * SERVO_HZ),
                false => high,
            };
            let values = [low, high, low.midpoint(high), 0.5, 1.0, 7.5, 120.0, 1e-3 * high];
            let values = values.map(|x| if setting.whole { x.round() } else { x }.clamp(low, high));
            let is_seen = tries(entry).iter().any(|settings| {
                let build = || {
                    [RATE_HZ, SERVO_HZ].into_iter().find_map(|rate_hz| {
                        match node_from_example(entry, settings, folder.path(), rate_hz, Kind::SCALAR) {
                            Ok(ExampleNode::Processor(bench)) => Some(bench),
                            _ => None,
                        }
                    })
                };
                let (Some(mut kept), Some(mut turned)) = (build(), build()) else {
                    return false; // It needs one of its inputs.
                };
                let inputs = |bench: &Bench, seed| -> Vec<Vec<f64>> {
                    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
                    let kinds = bench.kinds().iter();
                    kinds
                        .map(|kind| kind.map_or_else(Vec::new, |kind| signal(kind, FRAMES, false, &mut rng)))
                        .collect()
                };
                let inputs = [inputs(&kept, 31), inputs(&kept, 32)];
                values.iter().any(|value| {
                    let run =
                        |bench: &mut Bench, at: usize| bench.run_frames(FRAMES, &slices(&inputs[at]), &[64]);
                    let before = [run(&mut kept, 0), run(&mut turned, 0)];
                    turned.set(id, value * setting.si_per_unit);
                    let after = [run(&mut kept, 1), run(&mut turned, 1)];
                    !same(&before[0], &before[1]) || !same(&after[0], &after[1])
                })
            });
            tested += 1;
            let is_excepted =
                UNSEEN.iter().any(|(kind, name, _)| (*kind, *name) == (entry.spec.name, setting.name));
            if is_seen == is_excepted {
                wrong.push(format!("{}.{}", entry.spec.name, setting.name));
            }
        }
    }
    assert!(wrong.is_empty(), "a change of these is not seen, or seen and listed: {wrong:?}");
    assert!(tested > 60, "only {tested} were tested");
}

/// Live settings with another effect when the node is built: (kind, setting, why).
const OTHERWISE_WHEN_BUILT: [(&str, &str, &str); 1] =
    [("DynamicCompensator", "corner_hz", "`most_a_per_m_s2` bounds it when it is built")];

#[test]
fn a_live_setting_means_the_same_whether_built_with_or_set() {
    const FRAMES: usize = 500;
    let folder = folder();
    let (mut wrong, mut tested) = (Vec::new(), 0);
    for entry in registry().nodes() {
        if !is_processor(entry, folder.path()) {
            continue;
        }
        for (id, setting) in entry.live_settings() {
            let (low, high) = setting.range.unwrap_or((-1e3, 1e3));
            let value = if setting.whole { 3.0 } else { 0.37 };
            let value = if (low..=high).contains(&value) { value } else { low };
            let handles = handles(id, &setting);
            let written = match handles[0].item() {
                None => format!("{}: {value}", setting.name),
                Some(_) => format!("{}: {:?}", setting.name, vec![value; handles.len()]),
            };
            let build = |settings: &str| {
                let made = node_from_example(entry, settings, folder.path(), SERVO_HZ, Kind::SCALAR);
                match made {
                    Ok(ExampleNode::Processor(bench)) => Some(bench),
                    _ => None,
                }
            };
            let tries = tries(entry);
            // Where an input stands in for the setting, the node is built with that until the input has a value.
            let first = usize::from(build(&tries[1]).is_some());
            for settings in &tries[first..] {
                let settings = settings.trim_end_matches(", ");
                if settings.contains(setting.name) {
                    continue;
                }
                let (Some(mut set), Some(mut built)) =
                    (build(settings), build(format!("{settings}, {written}").trim_start_matches(", ")))
                else {
                    continue;
                };
                for id in &handles {
                    set.set(*id, value * setting.si_per_unit);
                }
                let mut rng = Xoshiro256PlusPlus::seed_from_u64(33);
                let kinds = set.kinds().iter();
                let inputs: Vec<Vec<f64>> = kinds
                    .map(|kind| kind.map_or_else(Vec::new, |kind| signal(kind, FRAMES, false, &mut rng)))
                    .collect();
                let run = |bench: &mut Bench| bench.run_frames(FRAMES, &slices(&inputs), &[64]);
                let excepted = OTHERWISE_WHEN_BUILT
                    .iter()
                    .any(|(kind, name, _)| (*kind, *name) == (entry.spec.name, setting.name));
                let (set, built) = (run(&mut set), run(&mut built));
                if !excepted && !close(&set, &built) {
                    let flat = |outputs: &[Vec<f64>]| outputs.concat();
                    let (set, built) = (flat(&set), flat(&built));
                    let at = set.iter().zip(&built).position(|(a, b)| a != b);
                    let pair = at.map(|at| (at, set[at], built[at]));
                    wrong.push(format!(
                        "{}.{} = {value} with `{settings}`: {pair:?}",
                        entry.spec.name, setting.name
                    ));
                }
                tested += 1;
            }
        }
    }
    assert!(wrong.is_empty(), "not the same: {wrong:#?}");
    assert!(tested > 60, "only {tested} were tested");
}

/// The handles of the numbers of a live setting: of a list those of its first two or, of a fixed length, of all.
fn handles(id: SettingId, setting: &SettingSpec) -> Vec<SettingId> {
    match setting.expected {
        Expected::List(_) => (0..2).map(|item| id.with_item(item)).collect(),
        Expected::Array(count, _) => (0..count).map(|item| id.with_item(item)).collect(),
        _ => vec![id],
    }
}

/// The live numbers of a kind.
fn live_numbers(entry: &NodeEntry) -> impl Iterator<Item = (SettingId, SettingSpec)> {
    entry.live_settings().flat_map(|(id, setting)| {
        let handles = handles(id, &setting);
        handles.into_iter().map(move |id| (id, setting.clone()))
    })
}

/// A folder with the files that examples name.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for sub in ["surfaces", "recordings", "shapes"] {
        std::fs::create_dir(folder.path().join(sub)).unwrap();
    }
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/surfaces/t3-tile.ron");
    std::fs::copy(shipped, folder.path().join("surfaces/t3-tile.ron")).unwrap();
    std::fs::write(folder.path().join("recordings/stroke.csv"), "time_s,force_n\n0,1\n0.05,2\n0.2,0.5\n")
        .unwrap();
    let wedge = "solid wedge\nfacet normal 0 0 1\nouter loop\nvertex -50 -50 0\nvertex 50 -50 0\nvertex 0 50 0\n\
                 endloop\nendfacet\nendsolid wedge\n";
    std::fs::write(folder.path().join("shapes/wedge.stl"), wedge).unwrap();
    let format = Format { channels: 1, rate_hz: RATE_HZ as u32 };
    let felt = File::create(folder.path().join("recordings/felt.wav")).unwrap();
    let mut felt = WavWriter::new(felt, format).unwrap();
    let samples: Vec<f32> = (0..3000).map(|k| (0.1 * k as f32).sin()).collect();
    felt.write(&samples).unwrap();
    felt.finish().unwrap();
    folder
}

/// At the first rate that suits it.
fn from_example(entry: &NodeEntry, folder: &Path, linear: Kind) -> Option<Bench> {
    Bench::from_example(entry, folder, RATE_HZ, linear)
        .or_else(|_| Bench::from_example(entry, folder, SERVO_HZ, linear))
        .unwrap_or_else(|wrong| panic!("{}: {wrong}", entry.spec.name))
}

/// Settings with which a kind is another machine: (kind, settings).
const AS_WELL: [(&str, &str); 3] = [
    ("Contact", "solids: Plane(), proxy_diameter_mm: 0.0"),
    ("Contact", "solids: Box(size_mm: [20.0, 20.0, 2.0])"),
    ("Contact", "solids: [Mesh(file: \"shapes/wedge.stl\"), Sphere(diameter_mm: 10.0)]"),
];

fn is_processor(entry: &NodeEntry, folder: &Path) -> bool {
    !entry.is_file() && from_example(entry, folder, Kind::SCALAR).is_some()
}

/// Builds every processor, once for scalars and once for vectors where it takes either.
fn each_processor(mut test: impl FnMut(&NodeEntry, &dyn Fn() -> Bench)) {
    let folder = folder();
    let mut tested = 0;
    for entry in registry().nodes().iter().filter(|entry| !entry.is_file()) {
        for linear in [Kind::SCALAR, Kind::VECTOR] {
            let build = || from_example(entry, folder.path(), linear);
            if build().is_some() {
                test(entry, &|| build().expect("the same as just now"));
                tested += 1;
            }
        }
        for (_, settings) in AS_WELL.iter().filter(|(kind, _)| *kind == entry.spec.name) {
            test(entry, &|| match node_from_example(entry, settings, folder.path(), RATE_HZ, Kind::VECTOR) {
                Ok(ExampleNode::Processor(bench)) => bench,
                Ok(_) => panic!("{settings} makes no processor"),
                Err(wrong) => panic!("{wrong}"),
            });
        }
    }
    assert!(tested > 80, "only {tested} processors were tested");
}

/// A signal of some kind. With `bad`, one frame in ten has something in it that no sensor should send.
fn signal(kind: Kind, frames: usize, bad: bool, rng: &mut Xoshiro256PlusPlus) -> Vec<f64> {
    let mut lanes = Vec::with_capacity(frames * kind.width());
    let mut frame = vec![0.0; kind.width()];
    for k in 0..frames {
        // Signals dwell on a value now and then, so that held ports see runs.
        if k == 0 || rng.random_bool(0.5) {
            fill(kind, &mut frame, rng);
        }
        lanes.extend_from_slice(&frame);
        if bad && rng.random_bool(0.1) {
            let evil = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308, -1e308, 5e-324, -0.0];
            let at = lanes.len() - 1 - rng.random_range(0..kind.width());
            lanes[at] = evil[rng.random_range(0..evil.len())];
        }
    }
    lanes
}

fn fill(kind: Kind, frame: &mut [f64], rng: &mut Xoshiro256PlusPlus) {
    match kind {
        coefficients if coefficients == Coefficients::KIND => {
            let ar = [rng.random_range(-0.5..0.5), rng.random_range(-0.4..0.4)];
            let variance = if rng.random_bool(0.2) { 0.0 } else { rng.random_range(0.0..2.0) };
            let filter = Coefficients { ar: &ar, ma: &[0.2], gain: 1.5, variance, warping: 0.0 };
            if let Ok(frame) = frame.try_into() {
                filter.write(frame);
            }
        }
        weights if weights == Weights::KIND => {
            let (u, v) = (rng.random_range(0.0..0.5), rng.random_range(0.0..0.5));
            frame.copy_from_slice(&[0.0, 1.0, 2.0, u, v, 1.0 - u - v, 0.1, 1.0]);
        }
        event if event == Kind::EVENT => {
            frame.copy_from_slice(&[f64::from(u8::from(rng.random_bool(0.01))), 1.0])
        }
        contact if contact == Contact::KIND => {
            let depth = rng.random_range(-0.002..0.002_f64);
            let (x, y) = (rng.random_range(-0.02..0.02), rng.random_range(-0.02..0.02));
            let touching = f64::from(u8::from(depth > 0.0));
            let inside = depth.max(0.0);
            frame.copy_from_slice(&[
                touching,
                x,
                y,
                -depth,
                x,
                y,
                inside - depth,
                0.0,
                0.0,
                touching,
                inside,
                0.0,
            ]);
        }
        _ => frame.fill_with(|| rng.random_range(-1.0..2.0)),
    }
}

fn inputs(bench: &Bench, frames: usize, bad: bool, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let kinds = bench.kinds().iter().flatten();
    kinds.map(|kind| signal(*kind, frames, bad, &mut rng)).collect()
}

fn slices(inputs: &[Vec<f64>]) -> Vec<&[f64]> {
    inputs.iter().map(Vec::as_slice).collect()
}

/// Equal bits; one not-a-number is as good as another.
fn same(a: &[Vec<f64>], b: &[Vec<f64>]) -> bool {
    let equal = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.len() == b.len() && a.iter().zip(b).all(equal))
}

#[test]
fn every_example_works() {
    let folder = folder();
    for entry in registry().nodes() {
        // A file sink may take any kind but draw only one of them.
        let vectors = Bench::from_example(entry, folder.path(), RATE_HZ, Kind::VECTOR);
        if !(entry.is_file() && vectors.is_ok()) {
            from_example(entry, folder.path(), Kind::SCALAR);
        }
    }
    for entry in registry().devices() {
        let wrong: Vec<String> = [125.0, SERVO_HZ, RATE_HZ]
            .iter()
            .filter_map(|rate_hz| device_from_example(entry, "", folder.path(), *rate_hz).err())
            .collect();
        assert!(wrong.len() < 3, "{}: {}", entry.spec.name, wrong[0]);
    }
}

#[test]
fn every_kind_is_documented() {
    for entry in registry().nodes() {
        let spec = entry.spec;
        assert!(spec.doc.ends_with('.'), "{}: {}", spec.name, spec.doc);
        let inputs = spec.inputs.iter().map(|port| port.doc);
        for doc in inputs.chain(spec.outputs.iter().map(|port| port.doc)) {
            assert!(!doc.is_empty(), "{}", spec.name);
        }
        for setting in entry.settings() {
            assert!(!setting.doc.is_empty(), "{}: {}", spec.name, setting.name);
        }
    }
}

#[test]
fn the_same_bits_for_any_blocks() {
    each_processor(|entry, build| {
        for bad in [false, true] {
            let inputs = inputs(&build(), 3000, bad, 5);
            let whole = build().run_frames(3000, &slices(&inputs), &[MAX_FRAMES]);
            for blocks in [&[1][..], &[64], &[7, 1, 130, 33, 2]] {
                let cut = build().run_frames(3000, &slices(&inputs), blocks);
                assert!(same(&whole, &cut), "{} in blocks of {blocks:?}, bad: {bad}", entry.spec.name);
            }
        }
    });
}

#[test]
fn a_single_frame_has_the_bits_of_a_block() {
    let mut without_ports = 0;
    each_processor(|entry, build| {
        for bad in [false, true] {
            let inputs = inputs(&build(), 3000, bad, 6);
            let whole = build().run_frames(3000, &slices(&inputs), &[MAX_FRAMES]);
            let mut bench = build();
            let mut outputs = vec![Vec::new(); whole.len()];
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
            let (mut done, mut single) = (0, false);
            while done < 3000 {
                // Single frames and blocks in turn, so that each goes on from the state that the other left.
                let frames = if rng.random_bool(0.9) { 1 } else { rng.random_range(1..150) }.min(3000 - done);
                let kinds = bench.kinds().iter().flatten();
                let part = |(x, kind): (&Vec<f64>, &Kind)| {
                    x[done * kind.width()..(done + frames) * kind.width()].to_vec()
                };
                let parts: Vec<Vec<f64>> = inputs.iter().zip(kinds).map(part).collect();
                bench.load(&slices(&parts), frames);
                match frames {
                    1 => single |= bench.step_single(),
                    _ => bench.step(),
                }
                for (output, all) in bench.outputs().iter().zip(&mut outputs) {
                    all.extend_from_slice(bench.components(output));
                }
                done += frames;
            }
            assert!(same(&whole, &outputs), "{}, bad: {bad}", entry.spec.name);
            without_ports += usize::from(single);
        }
    });
    assert!(without_ports >= 20, "only {without_ports} were run without ports");
}

#[test]
fn nothing_is_allocated_while_running() {
    each_processor(|entry, build| {
        let mut bench = build();
        for (seed, frames) in [(1, 64), (2, 1), (3, MAX_FRAMES), (4, 37)] {
            let inputs = inputs(&bench, frames, seed == 3, seed);
            bench.load(&slices(&inputs), frames);
            assert_eq!(allocations(|| bench.step()), 0, "{}", entry.spec.name);
        }
    });
}

/// Equal but for rounding.
fn close(a: &[Vec<f64>], b: &[Vec<f64>]) -> bool {
    let near = |(a, b): (&f64, &f64)| {
        a == b || (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(1e-3) || (a.is_nan() && b.is_nan())
    };
    a.len() == b.len() && a.iter().flatten().zip(b.iter().flatten()).all(near)
}

#[test]
fn every_live_setting_goes_to_the_ends_of_its_range_without_allocating() {
    let mut tested = 0;
    each_processor(|entry, build| {
        for (id, setting) in live_numbers(entry) {
            // The rate of the slowest bench.
            let (low, high) = setting.range_at(SERVO_HZ).unwrap_or((-1e3, 1e3));
            let mut bench = build();
            for (seed, value) in (1..).zip([high, low, 0.5 * (low + high), high, low.midpoint(1.0)]) {
                let inputs = inputs(&bench, 200, false, seed);
                bench.load(&slices(&inputs), 200);
                let set = allocations(|| bench.set(id, value * setting.si_per_unit));
                assert_eq!(set, 0, "{}.{}", entry.spec.name, setting.name);
                bench.step();
                for output in bench.outputs() {
                    let finite = bench.components(output).iter().all(|y| y.is_finite());
                    assert!(finite, "{}.{} at {value}", entry.spec.name, setting.name);
                }
            }
            tested += 1;
        }
    });
    assert!(tested > 50, "only {tested} were tested");
}

#[test]
fn what_is_not_a_number_does_not_stick() {
    each_processor(|entry, build| {
        let mut bench = build();
        let bad = inputs(&bench, 500, true, 8);
        bench.run_frames(500, &slices(&bad), &[64]);
        let good = inputs(&bench, 3000, false, 9);
        let outputs = bench.run_frames(3000, &slices(&good), &[64]);
        for output in outputs {
            let settled = &output[output.len() / 2..];
            assert!(settled.iter().all(|y| y.is_finite()), "{}", entry.spec.name);
        }
    });
}

#[test]
fn a_copy_that_takes_over_goes_on_as_if_nothing_happened() {
    each_processor(|entry, build| {
        let (mut old, mut new) = (build(), build());
        let first = inputs(&old, 700, false, 21);
        let second = inputs(&old, 300, false, 22);
        old.run_frames(700, &slices(&first), &[64]);
        new.skip_to(&old);
        old.copy_state_into(&mut new);
        let wanted = old.run_frames(300, &slices(&second), &[64]);
        let got = new.run_frames(300, &slices(&second), &[64]);
        assert!(same(&wanted, &got), "{}", entry.spec.name);
    });
}

#[test]
fn devices_do_not_allocate_and_stay_finite_whatever_drives_them() {
    let folder = folder();
    for entry in registry().devices() {
        let build = |rate_hz| device_from_example(entry, "", folder.path(), rate_hz).ok();
        let mut device = [125.0, SERVO_HZ, RATE_HZ].into_iter().find_map(build).unwrap();
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(11);
        let mut frame = [0.0; 64];
        for _ in 0..2000 {
            let mut sensed = true;
            let asked: [f64; 6] = std::array::from_fn(|_| rng.random_range(-3.0..3.0));
            let allocated = allocations(|| {
                device.poll(Instant::now());
                device.advance();
                for (index, channel) in entry.spec.senses.iter().enumerate() {
                    device.read(index, &mut frame[..channel.kind.width()]);
                    sensed &= frame[..channel.kind.width()].iter().all(|x| x.is_finite());
                }
                for (index, channel) in entry.spec.drives.iter().enumerate() {
                    device.write(index, &asked[..channel.kind.width()]);
                }
            });
            assert_eq!(allocated, 0, "{}", entry.spec.name);
            assert!(sensed, "{}", entry.spec.name);
        }
    }
}
