//! Every kind of processor at the ends of what its settings may be, under inputs that are as large, small and sudden as can
//! be: it is refused when it is built, or what it puts out is numbers.

use super::{RATE_HZ, fill, folder, slices};
use haptograph_engine::frame::Kind;
use haptograph_engine::node::NodeEntry;
use haptograph_engine::settings::SettingSpec;
use haptograph_engine::testing::{Bench, MAX_FRAMES};
use haptograph_nodes::registry;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::path::Path;

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
        bare.into_iter()
            .chain(inner.map(move |fields| format!("{choice}({fields})")))
    });
    let mut all: Vec<String> = parts.collect();
    let (low, high) = match setting.range {
        Some(range) => range,
        None if !all.is_empty() || !setting.expected.contains("number") => return all,
        None => (-1e300, 1e300),
    };
    let whole = setting.expected.contains("whole");
    let nyquist = 0.5 * rate_hz;
    let tries = [
        low,
        high,
        0.0,
        1.0,
        -1.0,
        nyquist,
        nyquist * (1.0 - 1e-12),
        nyquist * 0.999,
        1e-12,
        1e-5,
        1e9,
    ];
    let within = tries
        .into_iter()
        .filter(|x| (low..=high).contains(x) && (!whole || x.fract() == 0.0));
    all.extend(within.map(|x| {
        if whole {
            format!("{x:.0}")
        } else {
            format!("{x:e}")
        }
    }));
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
            Kind::Scalar | Kind::Vector | Kind::Wrench => {
                // Along an axis, or along none.
                let axis = random.random_range(0..kind.width());
                frame.fill(if k % 3 == 0 { level } else { 0.0 });
                frame[axis] = level;
            }
            Kind::Coefficients | Kind::Weights | Kind::Event => fill(kind, &mut frame, &mut random),
            Kind::Contact => {
                fill(kind, &mut frame, &mut random);
                let far = 1.0 + level.abs();
                // All but the flag and the unit normal.
                for lane in [1, 2, 3, 4, 5, 6, 10] {
                    frame[lane] *= far;
                }
            }
        }
        lanes.extend_from_slice(&frame);
    }
    lanes
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
        self.attempt(entry, "", folder, rate_hz);
        for setting in entry.settings() {
            for value in ends(&setting, rate_hz) {
                self.attempt(entry, &format!("{}: {value}", setting.name), folder, rate_hz);
            }
        }
    }

    fn attempt(&mut self, entry: &NodeEntry, settings: &str, folder: &Path, rate_hz: f64) {
        let kinds = [Kind::Scalar, Kind::Vector];
        let benches = kinds.map(|linear| Bench::from_example_with(entry, settings, folder, rate_hz, linear));
        if benches.iter().all(Result::is_err) {
            self.refused += 1;
        }
        for mut bench in benches.into_iter().filter_map(|bench| bench.ok().flatten()) {
            self.built += 1;
            let kinds: Vec<Kind> = bench.kinds().iter().flatten().copied().collect();
            let inputs = kinds
                .iter()
                .zip(1..)
                .map(|(kind, seed)| extreme(*kind, FRAMES, seed));
            let inputs: Vec<Vec<f64>> = inputs.collect();
            let outputs = bench.run_frames(FRAMES, &slices(&inputs), &[MAX_FRAMES, 1, 64]);
            for (output, lanes) in outputs.iter().enumerate() {
                if let Some(at) = lanes.iter().position(|y| !y.is_finite()) {
                    let (name, port) = (entry.spec.name, entry.spec.outputs[output].name);
                    self.wrong.push(format!(
                        "{name}({settings}) at {rate_hz} Hz: {port} is {} at {at}",
                        lanes[at]
                    ));
                }
            }
        }
    }
}

#[test]
fn at_the_ends_of_its_settings_every_kind_is_refused_or_puts_out_numbers() {
    let folder = folder();
    let (mut kinds, mut built, mut refused, mut wrong) = (0, 0, 0, Vec::new());
    for entry in registry().nodes().iter().filter(|entry| !entry.is_file()) {
        let mut tried = Tried::default();
        for rate_hz in RATES_HZ {
            tried.attempt_ends(entry, folder.path(), rate_hz);
        }
        if tried.built == 0 {
            // It goes by the rate of a recording.
            tried.attempt_ends(entry, folder.path(), RATE_HZ);
        }
        kinds += usize::from(tried.built > 0);
        built += tried.built;
        refused += tried.refused;
        wrong.extend(tried.wrong);
    }
    assert!(
        wrong.is_empty(),
        "{} of {built}:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
    assert!(
        kinds > 65 && built > 3000 && refused > 500,
        "{kinds} kinds, {built} built, {refused} refused"
    );
}
