//! Every kind of node and device at the ends of what its settings may be, under inputs that are as large, small and sudden
//! as can be: it is refused when it is built, or what it puts out is numbers, what it delivers keeps its limit, and what it
//! writes is a whole file in its folder.

use super::{RATE_HZ, fill, folder, slices};
use haptograph_engine::device::DeviceEntry;
use haptograph_engine::frame::{Kind, OneKind};
use haptograph_engine::limiter::Limiter;
use haptograph_engine::node::{FileSink, Limit, NodeEntry, NodeSpec, Stream};
use haptograph_engine::settings::SettingSpec;
use haptograph_engine::testing::{Bench, ExampleNode, MAX_FRAMES, device_from_example, node_from_example};
use haptograph_nodes::contact::Contact;
use haptograph_nodes::registry;
use haptograph_nodes::sinks::plots::GROUP;
use haptograph_nodes::wav;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::fs::{self, File};
use std::path::{Component, Path};
use std::time::Instant;

const RATES_HZ: [f64; 2] = [1000.0, 48_000.0];
const FRAMES: usize = 160;

/// Values of a setting that are worth a try at a rate, as they are written.
fn ends(setting: &SettingSpec, rate_hz: f64) -> Vec<String> {
    let parts = setting.parts.iter().flat_map(|part| {
        let inner = part.fields.iter().enumerate().flat_map(move |(at, field)| {
            let others = part.fields.iter().enumerate();
            let required = others.filter(move |(other, field)| *other != at && field.default.is_none());
            let required: Option<String> = required
                .map(|(_, other)| Some(format!(", {}: {}", other.name, ends(other, rate_hz).first()?)))
                .collect();
            let own = ends(field, rate_hz).into_iter();
            let both =
                required.map(|required| own.map(move |value| format!("{}: {value}{required}", field.name)));
            both.into_iter().flatten()
        });
        let choice = part.choice.unwrap_or_default();
        let bare = part.choice.filter(|_| part.fields.is_empty()).map(str::to_owned);
        bare.into_iter().chain(inner.map(move |fields| format!("{choice}({fields})")))
    });
    let mut all: Vec<String> = parts.collect();
    let (low, high) = match setting.range {
        Some(range) => range,
        None if !all.is_empty() || !setting.expected.is_numeric() => return all,
        None => (-1e300, 1e300),
    };
    let whole = setting.whole;
    let nyquist = 0.5 * rate_hz;
    let tries =
        [low, high, 0.0, 1.0, -1.0, nyquist, nyquist * (1.0 - 1e-12), nyquist * 0.999, 1e-12, 1e-5, 1e9];
    let within = tries.into_iter().filter(|x| (low..=high).contains(x) && (!whole || x.fract() == 0.0));
    all.extend(within.map(|x| if whole { format!("{x:.0}") } else { format!("{x:e}") }));
    all.dedup();
    all
}

/// Signals of some kind: nothing, the largest and the least of both signs, steps and spikes; where frames have a form of
/// their own, frames of that form with such numbers in them.
fn extreme(kind: Kind, frames: usize, seed: u64) -> Vec<f64> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let (mut lanes, mut frame) = (Vec::new(), vec![0.0; kind.width()]);
    for k in 0..frames {
        let level = match 8 * k / frames {
            0 => 0.0,
            1 => 1e9,
            2 => -1e9,
            3 => 1e-310,
            4 => [1e9, -1e9][k % 2],
            5 => [0.0, 1e9][usize::from(random.random_bool(0.1))],
            6 => random.random_range(-1e9..1e9),
            _ => 0.0,
        };
        match kind {
            linear if linear.is_linear() => {
                // Along an axis, or along none.
                let axis = random.random_range(0..kind.width());
                frame.fill(if k % 3 == 0 { level } else { 0.0 });
                frame[axis] = level;
            }
            contact if contact == Contact::KIND => {
                fill(kind, &mut frame, &mut random);
                let far = 1.0 + level.abs();
                // All but the flag and the unit normal.
                for lane in [1, 2, 3, 4, 5, 6, 10] {
                    frame[lane] *= far;
                }
            }
            _ => fill(kind, &mut frame, &mut random),
        }
        lanes.extend_from_slice(&frame);
    }
    lanes
}

/// Names of files that would lie elsewhere than in a run's folder, or nowhere.
const NAMES: [&str; 6] = ["../x.wav", "/tmp/x.csv", "", ".", "a/../../x.npz", "a\\\\b\\0.csv"];

/// Settings in place of the example's: none, and each at each of its ends.
fn variants(settings: Vec<SettingSpec>, rate_hz: f64) -> Vec<String> {
    let each = settings.iter().flat_map(|setting| {
        let names = NAMES.iter().filter(|_| setting.name == "file");
        let names = names.map(|name| format!("\"{name}\""));
        let values = ends(setting, rate_hz).into_iter().chain(names);
        values.map(|value| format!("{}: {value}", setting.name))
    });
    std::iter::once(String::new()).chain(each).collect()
}

/// Runs a processor: what it puts out is numbers.
fn process(mut bench: Bench) -> Result<(), String> {
    let kinds: Vec<Kind> = bench.kinds().iter().flatten().copied().collect();
    let inputs = kinds.iter().zip(1..).map(|(kind, seed)| extreme(*kind, FRAMES, seed));
    let inputs: Vec<Vec<f64>> = inputs.collect();
    let outputs = bench.run_frames(FRAMES, &slices(&inputs), &[MAX_FRAMES, 1, 64]);
    for (output, lanes) in outputs.iter().enumerate() {
        if let Some(at) = lanes.iter().position(|y| !y.is_finite()) {
            return Err(format!("{} is {} at {at}", bench.outputs()[output], lanes[at]));
        }
    }
    Ok(())
}

/// Asks an actuator for too much: what it is given keeps its limit.
fn deliver(gain: f64, limit: &Limit, rate_hz: f64) -> Result<(), String> {
    let mut limiter = Limiter::<1>::new(limit, rate_hz).map_err(|error| error.to_string())?;
    let (most, step) = (limit.continuous * limit.continuous, limit.slew_per_s.unwrap_or(f64::MAX) / rate_hz);
    let keep = (-1.0 / (limit.window_s * rate_hz)).exp();
    let (mut before, mut mean) = (0.0_f64, 0.0);
    for asked in extreme(Kind::SCALAR, 8 * FRAMES, 1).into_iter().chain([f64::NAN, f64::INFINITY]) {
        let [given] = limiter.apply([gain * asked]);
        mean = keep * mean + (1.0 - keep) * given * given;
        let is_kept = given.abs() <= limit.peak
            && (given - before).abs() <= step * (1.0 + 1e-9) + 1e-12 * limit.peak
            && mean <= most * (1.0 + 1e-6);
        if !is_kept {
            return Err(format!(
                "asked for {asked} gives {given} after {before}, mean square {mean} of {most}"
            ));
        }
        before = given;
    }
    Ok(())
}

/// Writes frames, also such as are no numbers: the file is in the folder, and whole. Plots have no file of their own.
fn write(spec: &NodeSpec, sink: &dyn FileSink, streams: &[Stream], folder: &Path) -> Result<(), String> {
    let failed = |error: std::io::Error| error.to_string();
    let name = sink.file_name();
    let mut parts = name.components();
    if !parts.all(|part| matches!(part, Component::Normal(_))) {
        return Err(format!("it would write to {}", name.display()));
    }
    let run = tempfile::tempdir_in(folder).map_err(failed)?;
    let path = run.path().join(name);
    fs::create_dir_all(path.parent().unwrap()).map_err(failed)?;
    let mut writer = sink.open(&path, streams).map_err(failed)?;
    for (number, stream) in streams.iter().enumerate() {
        writer.write(number, &extreme(stream.kind, FRAMES, 1)).map_err(failed)?;
        for bad in [f64::NAN, f64::INFINITY, -1e308] {
            // A recording refuses them, and says so.
            let _ = writer.write(number, &vec![bad; stream.kind.width()]);
        }
    }
    if writer.finish().is_err() {
        // What it cannot make a recording of stays as it came.
        let left = fs::read_dir(run.path()).map_err(failed)?.count();
        return (left > 0).then_some(()).ok_or("nothing is left".to_owned());
    }
    if spec.group == GROUP {
        return Ok(());
    }
    let mut file = File::open(&path).map_err(failed)?;
    if path.extension().is_some_and(|extension| extension == "wav") {
        let layout = wav::read_layout(&mut file).map_err(|error| error.to_string())?;
        assert_eq!(layout.frames(), FRAMES as u64 + 3);
    }
    match file.metadata().map_err(failed)?.len() {
        0 => Err("the file is empty".to_owned()),
        _ => Ok(()),
    }
}

/// Drives a device hard: what it senses is numbers.
fn drive(
    entry: &DeviceEntry,
    settings: &str,
    folder: &Path,
    rate_hz: f64,
) -> Result<Result<(), String>, String> {
    let mut device = device_from_example(entry, settings, folder, rate_hz)?;
    let drives = entry.spec.drives.iter().zip(1..);
    let asked: Vec<Vec<f64>> = drives.map(|(drive, seed)| extreme(drive.kind, FRAMES, seed)).collect();
    let mut frame = [0.0; 64];
    for tick in 0..FRAMES {
        device.poll(Instant::now());
        device.advance();
        for (index, channel) in entry.spec.senses.iter().enumerate() {
            let frame = &mut frame[..channel.kind.width()];
            device.read(index, frame);
            if frame.iter().any(|x| !x.is_finite()) {
                return Ok(Err(format!("{} is {frame:?} at {tick}", channel.name)));
            }
        }
        for (index, (channel, asked)) in entry.spec.drives.iter().zip(&asked).enumerate() {
            let width = channel.kind.width();
            // As much as the largest limit that can be stated lets through.
            let given: Vec<f64> = asked[tick * width..][..width].iter().map(|x| x * 1e-3).collect();
            device.write(index, &given);
        }
    }
    Ok(Ok(()))
}

/// What was tried of one kind.
#[derive(Default)]
struct Tried {
    built: usize,
    refused: usize,
    wrong: Vec<String>,
}

impl Tried {
    /// The example as it is, and with each of its settings at each of its ends.
    fn attempt_ends(&mut self, entry: &NodeEntry, folder: &Path, rate_hz: f64) {
        for settings in variants(entry.settings(), rate_hz) {
            let kinds = [Kind::SCALAR, Kind::VECTOR];
            let built = kinds.map(|linear| node_from_example(entry, &settings, folder, rate_hz, linear));
            self.refused += usize::from(built.iter().all(Result::is_err));
            for built in built.into_iter().flatten() {
                let result = match built {
                    ExampleNode::Processor(bench) => process(bench),
                    ExampleNode::Actuator(gain, limit) => deliver(gain, &limit, rate_hz),
                    ExampleNode::File(sink, streams) => write(entry.spec, &*sink, &streams, folder),
                    ExampleNode::Source => Ok(()),
                };
                self.note(result, entry.spec.name, &settings, rate_hz);
            }
        }
    }

    /// The same for a device.
    fn attempt_device(&mut self, entry: &DeviceEntry, folder: &Path, rate_hz: f64) {
        for settings in variants(entry.settings(), rate_hz) {
            match drive(entry, &settings, folder, rate_hz) {
                Ok(result) => self.note(result, entry.spec.name, &settings, rate_hz),
                Err(_) => self.refused += 1,
            }
        }
    }

    fn note(&mut self, result: Result<(), String>, name: &str, settings: &str, rate_hz: f64) {
        self.built += 1;
        let wrong = result.err();
        self.wrong.extend(wrong.map(|wrong| format!("{name}({settings}) at {rate_hz} Hz: {wrong}")));
    }
}

/// Tries all kinds, each with `attempt` at some rates; so many of them, builds and refusals there are at least.
fn attempt_all<K>(
    kinds: &[K],
    attempt: impl Fn(&mut Tried, &K, &Path, f64),
    (least_built, least_refused): (usize, usize),
) {
    let folder = folder();
    let (mut built, mut refused, mut wrong) = (0, 0, Vec::new());
    for kind in kinds {
        let mut tried = Tried::default();
        for rate_hz in RATES_HZ {
            attempt(&mut tried, kind, folder.path(), rate_hz);
        }
        // Some go by the rate of a recording, or of a tablet.
        for rate_hz in [RATE_HZ, 125.0] {
            if tried.built == 0 {
                attempt(&mut tried, kind, folder.path(), rate_hz);
            }
        }
        assert!(tried.built > 0, "a kind was never built");
        built += tried.built;
        refused += tried.refused;
        wrong.extend(tried.wrong);
    }
    assert!(wrong.is_empty(), "{} of {built}:\n{}", wrong.len(), wrong.join("\n"));
    assert!(built > least_built && refused > least_refused, "{built} built, {refused} refused");
}

#[test]
fn at_the_ends_of_its_settings_every_kind_of_node_is_refused_or_sound() {
    attempt_all(registry().nodes(), Tried::attempt_ends, (3000, 500));
}

#[test]
fn at_the_ends_of_its_settings_every_kind_of_device_is_refused_or_senses_numbers() {
    attempt_all(registry().devices(), Tried::attempt_device, (500, 5));
}
