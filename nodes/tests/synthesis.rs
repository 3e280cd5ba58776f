//! The synthesis of a texture is right: what the four nodes of the `Texture` template put out has the power and the
//! spectrum of the surface's models, is silent at rest, and shows no trace of its coefficients' changing.
#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "helpers of tests; a skip is said"
)]

use haptograph_engine::frame::{Coefficients, Kind};
use haptograph_engine::testing::{Bench, MAX_FRAMES};
use haptograph_nodes::texture::excitation::{Excitation, ExcitationSettings};
use haptograph_nodes::texture::filter::{ArmaFilter, ArmaFilterSettings, Form};
use haptograph_nodes::texture::interpolator::LsfInterpolator;
use haptograph_nodes::texture::locator::{SurfaceSettings, TriangleLocator};
use haptograph_signal::spectrum::{expected_welch, welch};
use haptograph_signal::window::Window;
use haptograph_surfaces::{ModelAt, SpatialLine};
use std::path::{Path, PathBuf};

type Frame = [f64; Coefficients::WIDTH];

/// A surface of the thesis's method, and three of the public toolkit's where `HATT_DIR` names them.
fn surfaces() -> Vec<PathBuf> {
    let mut all = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/canvas-thesis.ron")];
    match std::env::var_os("HATT_DIR") {
        Some(folder) => {
            let models = Path::new(&folder).join("Models/Models10000Hz/XML");
            let mut files: Vec<PathBuf> = std::fs::read_dir(models)
                .unwrap()
                .map(|entry| entry.unwrap().path())
                .filter(|path| path.extension().is_some_and(|ending| ending == "xml"))
                .collect();
            files.sort();
            all.extend(files.into_iter().step_by(33).take(3));
        }
        None => println!("HATT_DIR is not set: tried on one surface only"),
    }
    all
}

/// Locator and interpolator of a surface, at the rate of a hand.
struct Map {
    locator: Bench,
    interpolator: Bench,
    most_m_s: f64,
    most_n: f64,
    rate_hz: f64,
}

impl Map {
    fn of(surface: &Path) -> Self {
        let settings = || SurfaceSettings {
            surface: surface.to_owned(),
        };
        let texture = haptograph_surfaces::files::load(surface)
            .unwrap()
            .texture
            .unwrap();
        Self {
            locator: Bench::new::<TriangleLocator>(settings(), 240.0, &[Kind::Scalar; 2]).unwrap(),
            interpolator: Bench::new::<LsfInterpolator>(settings(), 240.0, &[Kind::Weights]).unwrap(),
            most_m_s: texture.max_speed_m_s(),
            most_n: texture.max_force_n(),
            rate_hz: texture.rate_hz(),
        }
    }

    /// The coefficients at fractions of the largest modelled speed and force.
    fn at(&mut self, speed: f64, force: f64) -> Frame {
        let weights = self
            .locator
            .run(&[&[speed * self.most_m_s], &[force * self.most_n]])
            .remove(0);
        self.interpolator.run(&[&weights])[0]
            .as_slice()
            .try_into()
            .unwrap()
    }
}

/// Excitation and filter, at the rate of the models.
struct Voice {
    excitation: Bench,
    filter: Bench,
}

impl Voice {
    fn new(rate_hz: f64, form: Form) -> Self {
        let settings = ArmaFilterSettings { form, surface: None };
        let kinds = [Kind::Coefficients, Kind::Scalar];
        Self {
            excitation: Bench::new::<Excitation>(ExcitationSettings { surface: None }, rate_hz, &kinds[..1])
                .unwrap(),
            filter: Bench::new::<ArmaFilter>(settings, rate_hz, &kinds).unwrap(),
        }
    }

    /// The vibration while the coefficients stay.
    fn play(&mut self, coefficients: &Frame, frames: usize) -> Vec<f64> {
        let held = coefficients.repeat(frames.min(MAX_FRAMES));
        let mut vibration = Vec::with_capacity(frames);
        while vibration.len() < frames {
            let block = (frames - vibration.len()).min(MAX_FRAMES);
            let held = &held[..block * Coefficients::WIDTH];
            let excitation = self.excitation.run(&[held]).remove(0);
            vibration.append(&mut self.filter.run(&[held, &excitation])[0]);
        }
        vibration
    }
}

/// Autocovariances of the model, from its impulse response by the difference equation.
fn autocovariance(frame: &Frame, lags: usize) -> Vec<f64> {
    let model = Coefficients::from_lanes(frame);
    let length = 60_000;
    let mut h = vec![0.0; length];
    for n in 0..length {
        let past = |k: usize| if n >= k { h[n - k] } else { 0.0 };
        let fed_back: f64 = model.ar.iter().zip(1..).map(|(a, k)| a * past(k)).sum();
        let b = match n {
            0 => 1.0,
            n => model.ma.get(n - 1).copied().unwrap_or(0.0),
        };
        h[n] = model.gain * b - fed_back;
    }
    let products = |lag: usize| h.iter().zip(&h[lag..]).map(|(a, b)| a * b).sum::<f64>();
    (0..lags).map(|lag| model.variance * products(lag)).collect()
}

const POINTS: [(f64, f64); 4] = [(0.3, 0.4), (0.8, 0.2), (0.5, 0.9), (1.0, 1.0)];
const FRAMES: usize = 200_000;

#[test]
fn the_power_is_the_variance_times_the_power_gain() {
    for surface in surfaces() {
        let mut map = Map::of(&surface);
        for (speed, force) in POINTS {
            let coefficients = map.at(speed, force);
            let r = autocovariance(&coefficients, 2000);
            let mut voice = Voice::new(map.rate_hz, Form::Lattice);
            voice.play(&coefficients, 5000);
            let y = voice.play(&coefficients, FRAMES);
            let power = y.iter().map(|y| y * y).sum::<f64>() / FRAMES as f64;
            // The variance of the mean of squares of a Gaussian process.
            let spread = r[1..].iter().fold(r[0] * r[0], |sum, r| sum + 2.0 * r * r);
            let deviation = (2.0 * spread / FRAMES as f64).sqrt();
            assert!(
                (power - r[0]).abs() < 4.0 * deviation,
                "{power} instead of {} +- {deviation}",
                r[0]
            );
        }
    }
}

#[test]
fn the_spectrum_is_the_models_convolved_with_the_window() {
    const SEGMENT: usize = 512;
    for surface in surfaces() {
        let mut map = Map::of(&surface);
        for (speed, force) in POINTS {
            let coefficients = map.at(speed, force);
            let r = autocovariance(&coefficients, SEGMENT);
            let mut voice = Voice::new(map.rate_hz, Form::Lattice);
            voice.play(&coefficients, 5000);
            let y = voice.play(&coefficients, FRAMES);
            let seen = welch(&y, map.rate_hz, SEGMENT, 0, Window::Hann).unwrap();
            let wanted = expected_welch(&r, map.rate_hz, SEGMENT, Window::Hann).unwrap();
            // A bin of one segment is exponentially distributed; at both ends it has half the degrees of freedom.
            let segments = (FRAMES / SEGMENT) as f64;
            let inner = 1..SEGMENT / 2;
            for bin in inner {
                let (seen, wanted) = (seen.density[bin], wanted.density[bin]);
                let deviations = (seen / wanted - 1.0) * segments.sqrt();
                assert!(
                    deviations.abs() < 4.0,
                    "{} bin {bin}: {deviations}",
                    surface.display()
                );
            }
            let mean = |density: &[f64]| density[1..SEGMENT / 2].iter().sum::<f64>();
            let total = mean(&seen.density) / mean(&wanted.density);
            assert!((total - 1.0).abs() < 0.1, "{total}");
        }
    }
}

#[test]
fn rest_is_silence() {
    for surface in surfaces() {
        let mut map = Map::of(&surface);
        for form in [Form::Lattice, Form::Direct] {
            for (speed, force) in [(0.0, 0.5), (0.5, 0.0), (0.0, 0.0)] {
                let (sliding, resting) = (map.at(0.5, 0.5), map.at(speed, force));
                let mut voice = Voice::new(map.rate_hz, form.clone());
                assert!(voice.play(&sliding, 1000).iter().any(|y| *y != 0.0));
                let tail = voice.play(&resting, 100_000);
                assert!(
                    tail[99_000..].iter().all(|y| *y == 0.0),
                    "it decays to exactly zero"
                );
                let mut voice = Voice::new(map.rate_hz, form.clone());
                assert!(
                    voice.play(&resting, 1000).iter().all(|y| *y == 0.0),
                    "and starts so"
                );
            }
        }
    }
}

/// A filter that renders a surface file.
fn renderer(surface: &Path, rate_hz: f64) -> Bench {
    let settings = ArmaFilterSettings {
        form: Form::Lattice,
        surface: Some(surface.to_owned()),
    };
    Bench::new::<ArmaFilter>(settings, rate_hz, &[Kind::Coefficients, Kind::Scalar]).unwrap()
}

#[test]
fn lines_are_added_to_the_noise_with_the_maps_power() {
    let plain = surfaces().remove(0);
    let mut surface = haptograph_surfaces::files::load(&plain).unwrap();
    surface.texture = surface.texture.map(|texture| {
        let rests = |at: &ModelAt| at.speed_m_s == 0.0 || at.force_n == 0.0;
        let powers = texture
            .models()
            .iter()
            .map(|at| if rests(at) { 0.0 } else { 8.0 });
        let line = SpatialLine::new(1000.0, 0.0, powers.collect()).unwrap();
        texture.with_lines(vec![line]).unwrap()
    });
    let file = tempfile::NamedTempFile::with_suffix(".ron").unwrap();
    let written = haptograph_surfaces::files::native::write(&surface);
    std::fs::write(file.path(), written).unwrap();

    let frames = 20_000;
    let (mut bare, mut lined) = (Map::of(&plain), Map::of(file.path()));
    let (at, without) = (lined.at(0.8, 0.8), bare.at(0.8, 0.8));
    let tail = Coefficients::WIDTH - 4;
    assert_eq!(at[..tail], without[..tail]);
    let (at, without) = (at.repeat(frames), without.repeat(frames));
    let noise: Vec<f64> = (0..frames).map(|n| (n as f64 * n as f64 * 0.37).sin()).collect();
    let play = |e: &[f64]| {
        renderer(file.path(), bare.rate_hz)
            .run_in_blocks(&[&at, e], &[7, 64, 1])
            .remove(0)
    };
    let line = play(&vec![0.0; frames]);
    let power = line[1000..].iter().map(|y| y * y).sum::<f64>() / (frames - 1000) as f64;
    assert!((power / 8.0 - 1.0).abs() < 0.02, "{power}");
    let crossings = line.windows(2).filter(|y| y[0] < 0.0 && y[1] >= 0.0).count();
    let expected = 1000.0 * 0.8 * bare.most_m_s * frames as f64 / bare.rate_hz;
    assert!(
        (crossings as f64 - expected).abs() <= 1.0,
        "{crossings} for {expected}"
    );
    let noisy = renderer(&plain, bare.rate_hz).run(&[&without, &noise]).remove(0);
    let sum: Vec<f64> = noisy.iter().zip(&line).map(|(a, b)| a + b).collect();
    assert_eq!(play(&noise), sum);
}

const PERIOD: usize = 41;
const ROUNDS: usize = 6000;

/// Two sets of coefficients that take turns every 41 samples, as at 240 Hz. The vibration and its power, averaged
/// locked to the switches: their largest distance from zero and from the model's power, in standard errors.
fn trace(sets: &[Frame; 2], rate_hz: f64, form: Form) -> [f64; 2] {
    let powers = sets.map(|set| autocovariance(&set, 1)[0]);
    let mut voice = Voice::new(rate_hz, form);
    let (mut mean, mut square) = ([[0.0; PERIOD]; 2], [[0.0; PERIOD]; 2]);
    for round in 0..2 * ROUNDS {
        let set = round % 2;
        for (lag, y) in voice.play(&sets[set], PERIOD).iter().enumerate() {
            let x = y / powers[set].sqrt();
            mean[set][lag] += x / ROUNDS as f64;
            square[set][lag] += x * x / ROUNDS as f64;
        }
    }
    // Rounds are nearly independent: the resonances of the surface die within one or two.
    let standard_error = (1.0 / ROUNDS as f64).sqrt();
    let largest = |values: [[f64; PERIOD]; 2], expected: f64, error: f64| {
        let away = values.as_flattened().iter().map(|x| (x - expected).abs() / error);
        away.fold(0.0, f64::max)
    };
    [
        largest(mean, 0.0, standard_error),
        largest(square, 1.0, 2.0_f64.sqrt() * standard_error),
    ]
}

#[test]
fn changing_coefficients_leave_no_trace() {
    let surface = surfaces().remove(0);
    let mut map = Map::of(&surface);
    // Far apart, to make it hard; of the same innovation variance, so that only the filter changes.
    let mut sets = [map.at(0.15, 0.9), map.at(0.95, 0.15)];
    sets[1][3] = sets[0][3];
    let [mean, power] = trace(&sets, map.rate_hz, Form::Lattice);
    assert!(mean < 5.0, "{mean} standard errors");
    assert!(power < 5.0, "{power} standard errors");
    // The direct form has such traces, so the test can see them.
    let [_, power] = trace(&sets, map.rate_hz, Form::Direct);
    assert!(power > 10.0, "{power} standard errors");
}
