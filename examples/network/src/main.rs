//! A network that steers a filter while it plays: a perceptron of 16 units learns the models of a surface over force and speed,
//! runs by tract, and gives a model every 10 ms. From the root: `cargo run --release --manifest-path examples/network/Cargo.toml`.

mod perceptron;

use haptograph::engine::graph::CheckOptions;
use haptograph::engine::run::{Player, SessionOptions};
use haptograph::nodes::texture::Model;
use haptograph::surfaces::lsf::ar_to_lsf;
use haptograph::surfaces::{Coefficients, Interpolator, TextureModel, files};
use perceptron::Perceptron;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::path::Path;
use std::time::Instant;

type Failure = Box<dyn std::error::Error>;

/// Frames of the graph between two models: 10 ms.
const FRAMES: usize = 100;

/// What a model of the surface is as numbers around 0 to 1: the logarithm of its deviation, then its LSFs.
struct Targets(Interpolator);

impl Targets {
    fn at(&mut self, speed_m_s: f64, force_n: f64) -> Vec<f64> {
        let mut at = Coefficients::SILENCE;
        self.0.interpolate(speed_m_s, force_n, &mut at);
        let mut lsf = vec![0.0; at.ar_order];
        ar_to_lsf(at.ar(), &mut lsf).expect("models of a surface are stable");
        let deviation = (at.variance.sqrt() + 1e-4).ln() / 5.0;
        std::iter::once(deviation).chain(lsf.iter().map(|w| w / std::f64::consts::PI)).collect()
    }
}

/// Inputs around 0 to 1, as loudness and pitch follow logarithms.
fn features(speed_m_s: f64, force_n: f64) -> [f64; 2] {
    [(speed_m_s / 0.05).ln(), force_n.ln()]
}

/// The frame of the graph's input.
fn model(outputs: &[f64]) -> Result<Model, Failure> {
    let lsf: Vec<f64> = outputs[1..].iter().map(|w| w * std::f64::consts::PI).collect();
    Model::new((5.0 * outputs[0]).exp().powi(2), &lsf).ok_or("a model has at most 32 coefficients".into())
}

/// Root mean square of the differences, in dB of the level and in rad of the LSFs.
fn errors(
    texture: &TextureModel,
    mut guess: impl FnMut(f64, f64) -> Result<Vec<f64>, Failure>,
) -> Result<[f64; 2], Failure> {
    let (mut targets, mut random) =
        (Targets(Interpolator::new(texture)), Xoshiro256PlusPlus::seed_from_u64(99));
    let (mut level, mut lsf, mut count) = (0.0, 0.0, 0.0);
    for _ in 0..200 {
        let (speed_m_s, force_n) = (random.random_range(0.02..0.15), random.random_range(0.3..2.5));
        let (wanted, given) = (targets.at(speed_m_s, force_n), guess(speed_m_s, force_n)?);
        let to_db = 5.0 * 20.0 / std::f64::consts::LN_10;
        level += (to_db * (wanted[0] - given[0])).powi(2);
        lsf += wanted[1..]
            .iter()
            .zip(&given[1..])
            .map(|(a, b)| (std::f64::consts::PI * (a - b)).powi(2))
            .sum::<f64>();
        count += 1.0;
    }
    let order = texture.models()[0].model.ar().len() as f64;
    Ok([(level / count).sqrt(), (lsf / count / order).sqrt()])
}

fn main() -> Result<(), Failure> {
    let surface = files::load(Path::new("graphs/surfaces/t2-canvas.ron"))?;
    let texture = surface.texture.ok_or("the surface has no texture")?;
    let (mut targets, mut random) =
        (Targets(Interpolator::new(&texture)), Xoshiro256PlusPlus::seed_from_u64(1));

    // Training: points of the plane that a hand reaches.
    let outputs = 1 + texture.models()[0].model.ar().len();
    let mut network = Perceptron::new(2, 16, outputs, &mut random);
    let middle = targets.at(0.08, 1.0);
    network.begin_at(&middle);
    for step in 0..60_000 {
        let (speed_m_s, force_n) = (random.random_range(0.02..0.15), random.random_range(0.3..2.5));
        network.learn(
            &features(speed_m_s, force_n),
            &targets.at(speed_m_s, force_n),
            0.02 / (1.0 + step as f64 / 6e3),
        );
    }
    let mut by_tract = network.runnable()?;
    let learned = errors(&texture, |speed, force| by_tract.run(&features(speed, force)))?;
    let constant = errors(&texture, |_, _| Ok(middle.clone()))?;
    println!(
        "level {:.2} dB, frequencies {:.4} rad from the surface; one model for all: {:.2} dB, {:.4} rad",
        learned[0], learned[1], constant[0], constant[1]
    );
    assert!(learned[0] < 0.5 * constant[0] && learned[1] < 0.5 * constant[1], "the network learned nothing");

    // Playing: a stroke whose speed and force change all the time.
    let options = CheckOptions::default().set("warping", &texture.warping().to_string());
    let graph = haptograph::open("examples/network/network.ron", &options)?;
    let mut steer = graph.input::<Model>("network")?;
    let options = SessionOptions::default().rested().probe("filter").probe("steer.corrected");
    let (mut player, mut session) = Player::open(&graph, &options)?;
    let (mut felt, mut corrected) =
        (session.probe::<f64>("filter")?, session.probe::<f64>("steer.corrected")?);
    let (mut vibration, mut took) = (vec![0.0; FRAMES], Vec::new());
    for call in 0..500 {
        let time_s = 0.01 * f64::from(call);
        let (speed_m_s, force_n) = (0.085 + 0.06 * (2.1 * time_s).sin(), 1.4 + (1.3 * time_s).cos());
        let begun = Instant::now();
        steer.set(model(&by_tract.run(&features(speed_m_s, force_n))?)?)?;
        took.push(begun.elapsed().as_secs_f64());
        player.process(FRAMES);
        felt.read(&mut vibration);
        if call % 25 == 24 {
            let rms = (vibration.iter().map(|x| x * x).sum::<f64>() / FRAMES as f64).sqrt();
            println!(
                "{:5.2} s {:4.0} mm/s {:4.1} N {}",
                time_s,
                1e3 * speed_m_s,
                force_n,
                "#".repeat((4.0 * rms) as usize)
            );
        }
    }
    took.sort_by(f64::total_cmp);
    let mut counts = vec![0.0; corrected.waiting()];
    corrected.read(&mut counts);
    println!(
        "a model takes {:.0} us in the median, {:.0} us at the 95th percentile; it is felt from the next 2 ms on, whole after 10 ms; {:.0} were made stable",
        1e6 * took[took.len() / 2],
        1e6 * took[took.len() * 95 / 100],
        counts.last().copied().unwrap_or_default()
    );
    Ok(())
}
