//! The synthesis of a texture is right: what the four nodes of the `Texture` template put out has the power and the
//! spectrum of the surface's models, is silent at rest, and shows no trace of its coefficients' changing. Surfaces on a warped
//! frequency axis are rendered at their rate and, interpolated, at that of a soundcard.
#![expect(clippy::unwrap_used, reason = "helpers of tests; a skip is said")]

use haptograph_engine::frame::{Kind, OneKind};
use haptograph_engine::testing::{Bench, MAX_FRAMES};
use haptograph_nodes::texture::excitation::{Excitation, ExcitationSettings};
use haptograph_nodes::texture::filter::{ArmaFilter, ArmaFilterSettings, Form};
use haptograph_nodes::texture::frames::{Coefficients, Weights};
use haptograph_nodes::texture::interpolator::LsfInterpolator;
use haptograph_nodes::texture::locator::{SurfaceSettings, TriangleLocator};
use haptograph_signal::Complex64;
use haptograph_signal::spectrum::{expected_welch, welch};
use haptograph_signal::warped::squared_response;
use haptograph_signal::window::Window;
use haptograph_surfaces::{Interpolator, ModelAt, SpatialLine, TextureModel};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

#[path = "../../tests/skip/mod.rs"]
mod skip;

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
        None => skip::skip("HATT_DIR names no folder of the toolkit's files; one surface is tried"),
    }
    all
}

fn texture(surface: &Path) -> TextureModel {
    let surface = haptograph_surfaces::files::load(surface).unwrap();
    surface.texture.unwrap()
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
        let settings = || SurfaceSettings { surface: surface.to_owned() };
        let texture = texture(surface);
        Self {
            locator: Bench::new::<TriangleLocator>(settings(), 240.0, &[Kind::SCALAR; 2]).unwrap(),
            interpolator: Bench::new::<LsfInterpolator>(settings(), 240.0, &[Weights::KIND]).unwrap(),
            most_m_s: texture.max_speed_m_s(),
            most_n: texture.max_force_n(),
            rate_hz: texture.rate_hz(),
        }
    }

    /// The coefficients at fractions of the largest modelled speed and force.
    fn at(&mut self, speed: f64, force: f64) -> Frame {
        let weights = self.locator.run(&[&[speed * self.most_m_s], &[force * self.most_n]]).remove(0);
        self.interpolator.run(&[&weights])[0].as_slice().try_into().unwrap()
    }
}

/// Excitation and filter, at the rate of the models.
struct Voice {
    excitation: Bench,
    filter: Bench,
}

impl Voice {
    fn new(rate_hz: f64, form: Form) -> Self {
        Self::of(None, rate_hz, form)
    }

    /// With the high-pass and the interpolation of a surface.
    fn of(surface: Option<&Path>, rate_hz: f64, form: Form) -> Self {
        let surface = surface.map(Path::to_owned);
        let settings = ArmaFilterSettings { form, surface };
        let kinds = [Coefficients::KIND, Kind::SCALAR];
        Self {
            excitation: Bench::new::<Excitation>(ExcitationSettings { surface: None }, rate_hz, &kinds[..1])
                .unwrap(),
            filter: Bench::new::<ArmaFilter>(settings, rate_hz, &kinds).unwrap(),
        }
    }

    /// The vibration while the coefficients stay.
    fn play(&mut self, coefficients: &Frame, frames: usize) -> Vec<f64> {
        self.filtered(coefficients, frames, |excitation, held| excitation.run(&[held]).remove(0))
    }

    /// What the filter makes of a single 1.
    fn response(&mut self, coefficients: &Frame, frames: usize) -> Vec<f64> {
        self.response_to(0, coefficients, frames)
    }

    /// What the filter makes of a single 1 in this frame of the first block.
    fn response_to(&mut self, frame: usize, coefficients: &Frame, frames: usize) -> Vec<f64> {
        let mut next = 1.0;
        self.filtered(coefficients, frames, |_, held| {
            let mut excitation = vec![0.0; held.len() / Coefficients::WIDTH];
            if let Some(e) = excitation.get_mut(frame) {
                *e = std::mem::take(&mut next);
            }
            excitation
        })
    }

    fn filtered(
        &mut self,
        coefficients: &Frame,
        frames: usize,
        mut excite: impl FnMut(&mut Bench, &[f64]) -> Vec<f64>,
    ) -> Vec<f64> {
        let held = coefficients.repeat(frames.min(MAX_FRAMES));
        let mut vibration = Vec::with_capacity(frames);
        while vibration.len() < frames {
            let block = (frames - vibration.len()).min(MAX_FRAMES);
            let held = &held[..block * Coefficients::WIDTH];
            let excitation = excite(&mut self.excitation, held);
            vibration.append(&mut self.filter.run(&[held, &excitation])[0]);
        }
        vibration
    }
}

/// Autocovariances of the model, from its impulse response by the difference equation.
fn autocovariance(frame: &Frame, lags: usize) -> Vec<f64> {
    let model = Coefficients::from_components(frame);
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
            assert!((power - r[0]).abs() < 4.0 * deviation, "{power} instead of {} +- {deviation}", r[0]);
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
                assert!(deviations.abs() < 4.0, "{} bin {bin}: {deviations}", surface.display());
            }
            let mean = |density: &[f64]| density[1..SEGMENT / 2].iter().sum::<f64>();
            let total = mean(&seen.density) / mean(&wanted.density);
            assert!((total - 1.0).abs() < 0.1, "{total}");
        }
    }
}

/// Shipped surfaces: laws on a warped frequency axis, learned without the high-pass that their rendering has.
fn warped_surfaces() -> [PathBuf; 2] {
    ["t2-canvas", "t3-tile"].map(|name| {
        let path = format!("../graphs/surfaces/{name}.ron");
        Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
    })
}

const SOUNDCARD_HZ: f64 = 48_000.0;

fn energy(response: &[f64]) -> f64 {
    response.iter().map(|h| h * h).sum()
}

fn db(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}

/// Frames of a soundcard, in one round of its phases against 10 kHz, in which the models have a sample due.
const DUE: [usize; 5] = [0, 5, 10, 15, 20];

/// White noise of this variance gives in expectation the energy of the response to a 1, times the variance.
#[test]
fn the_power_of_a_warped_surface_is_the_stored_one() {
    for surface in warped_surfaces() {
        let (texture, mut map) = (texture(&surface), Map::of(&surface));
        assert!(texture.warping() > 0.0 && texture.highpass_hz().is_some());
        let mut locator = Interpolator::new(&texture);
        for (speed, force) in POINTS {
            let spot = locator.locate(speed * map.most_m_s, force * map.most_n);
            // Between models the amplitude is interpolated.
            let amplitude_of = |vertex: u32| texture.models()[vertex as usize].model.power().sqrt();
            let mixed: f64 = (0..3).map(|i| spot.weights[i] * amplitude_of(spot.vertices[i])).sum();
            let stored = mixed * mixed;
            let coefficients = map.at(speed, force);
            let variance = Coefficients::from_components(&coefficients).variance;
            let mut plain = Voice::new(map.rate_hz, Form::Lattice);
            let off = db(variance * energy(&plain.response(&coefficients, 20_000)) / stored);
            assert!(off.abs() < 0.001, "{off} dB at {spot:?}");
            // The high-pass takes some of it, and what is interpolated has the power of what it is interpolated from.
            let mut rendered = Voice::of(Some(&surface), map.rate_hz, Form::Lattice);
            let passed = energy(&rendered.response(&coefficients, 20_000));
            assert!((-1.0..0.0).contains(&db(variance * passed / stored)));
            let mut faster = Voice::of(Some(&surface), SOUNDCARD_HZ, Form::Lattice);
            let interpolated = energy(&faster.response(&coefficients, 48_000)) * map.rate_hz / SOUNDCARD_HZ;
            let off = db(interpolated / passed);
            assert!(off.abs() < 0.05, "{off} dB");
        }
    }
}

#[test]
fn the_noise_of_a_warped_surface_has_that_power() {
    for surface in warped_surfaces() {
        let mut map = Map::of(&surface);
        let coefficients = map.at(0.5, 0.5);
        let variance = Coefficients::from_components(&coefficients).variance;
        for (clock_hz, frames) in [(map.rate_hz, FRAMES), (SOUNDCARD_HZ, 3 * FRAMES)] {
            let voice = || Voice::of(Some(&surface), clock_hz, Form::Lattice);
            let h = voice().response(&coefficients, frames / 20);
            let scale = variance * map.rate_hz / clock_hz;
            let r: Vec<f64> = (0..frames / 100)
                .map(|lag| scale * h.iter().zip(&h[lag..]).map(|(a, b)| a * b).sum::<f64>())
                .collect();
            let mut voice = voice();
            voice.play(&coefficients, frames / 10);
            let power = energy(&voice.play(&coefficients, frames)) / frames as f64;
            // The variance of the mean of squares of a Gaussian process.
            let spread = r[1..].iter().fold(r[0] * r[0], |sum, r| sum + 2.0 * r * r);
            let deviations = (power - r[0]) / (2.0 * spread / frames as f64).sqrt();
            assert!(deviations.abs() < 4.0, "{clock_hz}: {deviations}");
        }
    }
}

#[test]
fn the_spectrum_of_a_warped_surface_is_the_models_through_its_high_pass() {
    for surface in warped_surfaces() {
        let (texture, mut map) = (texture(&surface), Map::of(&surface));
        let highpass = texture.output_highpass().unwrap();
        for (speed, force) in &POINTS[..2] {
            let coefficients = map.at(*speed, *force);
            let model = Coefficients::from_components(&coefficients);
            let wanted = |f_hz: f64| {
                let angle = TAU * f_hz / map.rate_hz;
                let passed = highpass.response(f_hz, map.rate_hz).norm_sqr();
                model.gain * model.gain * squared_response(model.ar, model.warping, angle) * passed
            };
            for (clock_hz, frames, due) in
                [(map.rate_hz, 20_000, &DUE[..1]), (SOUNDCARD_HZ, 48_000, &DUE[..])]
            {
                let respond = |frame: &usize| {
                    let mut voice = Voice::of(Some(&surface), clock_hz, Form::Lattice);
                    voice.response_to(*frame, &coefficients, frames)
                };
                let responses: Vec<Vec<f64>> = due.iter().map(respond).collect();
                assert!(responses.iter().all(|h| energy(h) > 0.0));
                // The mean over the phases: what noise has, whose samples do not know of one another.
                let seen = |f_hz: f64| {
                    let turn = |n: usize| Complex64::cis(-TAU * f_hz * n as f64 / clock_hz);
                    let power_of = |h: &Vec<f64>| {
                        let sum: Complex64 = h.iter().enumerate().map(|(n, h)| turn(n) * h).sum();
                        (sum * map.rate_hz / clock_hz).norm_sqr()
                    };
                    responses.iter().map(power_of).sum::<f64>() / due.len() as f64
                };
                for f_hz in [6.0, 20.0, 33.0, 80.0, 150.0, 250.0, 400.0, 900.0, 2100.0, 4000.0, 4850.0] {
                    let off = db(seen(f_hz) / wanted(f_hz));
                    assert!(off.abs() < 0.1, "{off} dB at {f_hz} Hz of {clock_hz}");
                }
                if clock_hz > map.rate_hz {
                    // From one of the phases to the next as many components of the models fold onto the same frequency.
                    let folded = |f_hz: f64| {
                        let of_models = |alias: usize| (f_hz + alias as f64 * clock_hz) % map.rate_hz;
                        (0..due.len()).map(|alias| wanted(of_models(alias))).sum::<f64>()
                    };
                    for f_hz in [5400.0, 9000.0, 9900.0, 10_100.0, 19_750.0] {
                        let image = db(seen(f_hz) / folded(f_hz));
                        assert!(image < -60.0, "{image} dB at {f_hz} Hz");
                    }
                }
            }
        }
    }
}

#[test]
fn rest_is_silence() {
    for surface in surfaces().into_iter().chain(warped_surfaces()) {
        let mut map = Map::of(&surface);
        for form in [Form::Lattice, Form::Direct] {
            for (speed, force) in [(0.0, 0.5), (0.5, 0.0), (0.0, 0.0)] {
                let (sliding, resting) = (map.at(0.5, 0.5), map.at(speed, force));
                let mut voice = Voice::new(map.rate_hz, form.clone());
                assert!(voice.play(&sliding, 1000).iter().any(|y| *y != 0.0));
                let tail = voice.play(&resting, 100_000);
                assert!(tail[99_000..].iter().all(|y| *y == 0.0), "it decays to exactly zero");
                let mut voice = Voice::new(map.rate_hz, form.clone());
                assert!(voice.play(&resting, 1000).iter().all(|y| *y == 0.0), "and starts so");
            }
        }
    }
}

/// A filter that renders a surface file.
fn renderer(surface: &Path, rate_hz: f64) -> Bench {
    let settings = ArmaFilterSettings { form: Form::Lattice, surface: Some(surface.to_owned()) };
    Bench::new::<ArmaFilter>(settings, rate_hz, &[Coefficients::KIND, Kind::SCALAR]).unwrap()
}

#[test]
fn lines_are_added_to_the_noise_with_the_maps_power() {
    let plain = surfaces().remove(0);
    let mut surface = haptograph_surfaces::files::load(&plain).unwrap();
    surface.texture = surface.texture.map(|texture| {
        let rests = |at: &ModelAt| at.speed_m_s == 0.0 || at.force_n == 0.0;
        let powers = texture.models().iter().map(|at| if rests(at) { 0.0 } else { 8.0 });
        let line = SpatialLine::new(1000.0, 0.0, powers.collect()).unwrap();
        texture.with_lines(vec![line]).unwrap()
    });
    let file = tempfile::NamedTempFile::with_suffix(".ron").unwrap();
    let written = haptograph_surfaces::files::native::write(&surface);
    std::fs::write(file.path(), written).unwrap();

    let frames = 20_000;
    let (mut bare, mut lined) = (Map::of(&plain), Map::of(file.path()));
    let (at, without) = (lined.at(0.8, 0.8), bare.at(0.8, 0.8));
    let tail = Coefficients::WIDTH - 1 - haptograph_surfaces::layers::COMPONENTS;
    assert_eq!(at[..tail], without[..tail]);
    let (at, without) = (at.repeat(frames), without.repeat(frames));
    let noise: Vec<f64> = (0..frames).map(|n| (n as f64 * n as f64 * 0.37).sin()).collect();
    let play =
        |e: &[f64]| renderer(file.path(), bare.rate_hz).run_in_blocks(&[&at, e], &[7, 64, 1]).remove(0);
    let line = play(&vec![0.0; frames]);
    let power = line[1000..].iter().map(|y| y * y).sum::<f64>() / (frames - 1000) as f64;
    assert!((power / 8.0 - 1.0).abs() < 0.02, "{power}");
    let crossings = line.windows(2).filter(|y| y[0] < 0.0 && y[1] >= 0.0).count();
    let expected = 1000.0 * 0.8 * bare.most_m_s * frames as f64 / bare.rate_hz;
    assert!((crossings as f64 - expected).abs() <= 1.0, "{crossings} for {expected}");
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
    [largest(mean, 0.0, standard_error), largest(square, 1.0, 2.0_f64.sqrt() * standard_error)]
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
