//! Writes `graphs/surfaces/modest.ron`: a made-up surface that imitates no material, for pipelines to run on where no
//! learned surface is at hand, and an example of how to put a surface together in code.
//!
//! ```text
//! cargo run -p haptograph-surfaces --example procedural_surface -- graphs/surfaces/modest.ron
//! ```

use haptograph_surfaces::hull::Hull;
use haptograph_surfaces::{
    ArmaModel, Friction, ModelAt, Origin, Provenance, Stiffness, Surface, Tap, Taps, TextureModel,
    VertexKind, files,
};
use std::error::Error;
use std::f64::consts::TAU;

const RATE_HZ: f64 = 10_000.0;
const MAX_SPEED_MM_S: f64 = 200.0;
const MAX_FORCE_N: f64 = 3.0;

/// Where models stand (speed in mm/s, force in N), scattered as measured ones are.
const PLACES: [(f64, f64); 12] = [
    (22.0, 0.4),
    (31.0, 1.7),
    (38.0, 2.6),
    (67.0, 0.9),
    (74.0, 2.1),
    (92.0, 1.4),
    (104.0, 2.8),
    (121.0, 0.5),
    (133.0, 1.9),
    (158.0, 1.1),
    (171.0, 2.5),
    (187.0, 0.7),
];

#[allow(dead_code)] // The test of the shipped file includes this one for `modest` alone.
fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("name the file to write, such as graphs/surfaces/modest.ron")?;
    files::write_atomically(path.as_ref(), files::native::write(&modest()?).as_bytes())?;
    Ok(())
}

/// The surface: texture, friction, taps and stiffness, all of it made up.
pub fn modest() -> Result<Surface, Box<dyn Error>> {
    let provenance = Provenance::new(Origin::Procedural, "surfaces/examples/procedural_surface.rs")
        .with_setting("note", "made up; imitates no material");
    let mut surface = Surface::new("modest", provenance);
    surface.friction = Some(Friction::new(0.35, None)?);
    surface.stiffness = Some(Stiffness::new(15.0, None)?);
    surface.taps = Some(taps()?);
    let hull = Hull {
        max_speed_m_s: Some(MAX_SPEED_MM_S / 1000.0),
        max_force_n: Some(MAX_FORCE_N),
        ..Hull::default()
    };
    let measured = PLACES.map(|(speed_mm_s, force_n)| texture_at(speed_mm_s, force_n));
    let measured = measured.into_iter().collect::<Result<Vec<_>, _>>()?;
    surface.texture = Some(TextureModel::from_measured(RATE_HZ, measured, &hull)?);
    Ok(surface)
}

/// The texture at one speed and force: six resonances, the lower of which rise with speed as a tool meets asperities
/// faster and the higher with force as the contact stiffens; louder with both.
fn texture_at(speed_mm_s: f64, force_n: f64) -> Result<ModelAt, Box<dyn Error>> {
    let (speed, force) = (speed_mm_s / MAX_SPEED_MM_S, force_n / MAX_FORCE_N);
    let resonances: [(f64, f64); 6] = [
        (180.0 + 90.0 * speed, 0.97),
        (800.0 + 150.0 * speed, 0.95),
        (1850.0 + 150.0 * force, 0.93),
        (2750.0 + 150.0 * force, 0.92),
        (3700.0, 0.92),
        (4600.0, 0.92),
    ];
    let mut ar = vec![0.0; 12];
    for (frequency_hz, radius) in resonances {
        let first = -2.0 * radius * (TAU * frequency_hz / RATE_HZ).cos();
        let second = radius * radius;
        for k in (0..12).rev() {
            let one_back = if k >= 1 { ar[k - 1] } else { 1.0 };
            let two_back = if k >= 2 { ar[k - 2] } else { f64::from(k == 1) };
            ar[k] += first * one_back + second * two_back;
        }
    }
    let rms_m_s2 = 2.5 * speed.powf(0.7) * force.powf(0.4);
    let variance = rms_m_s2 * rms_m_s2 / power_gain(&ar);
    let model = ArmaModel::from_ar(&ar, variance)?;
    Ok(ModelAt {
        speed_m_s: speed_mm_s / 1000.0,
        force_n,
        model,
        kind: VertexKind::Measured,
    })
}

/// The filter's output variance for unit white noise: the energy of its impulse response.
fn power_gain(ar: &[f64]) -> f64 {
    let mut response = vec![0.0; 4000];
    for n in 0..response.len() {
        let past: f64 = ar
            .iter()
            .enumerate()
            .take(n)
            .map(|(k, a)| a * response[n - 1 - k])
            .sum();
        response[n] = f64::from(n == 0) - past;
    }
    response.iter().map(|y| y * y).sum()
}

/// Taps: a decaying sinusoid whose peak grows with impact speed.
fn taps() -> Result<Taps, Box<dyn Error>> {
    const TAP_RATE_HZ: f64 = 1000.0;
    let tap = |speed_mm_s: f64| {
        let sample = |n: i32| {
            let time_s = f64::from(n) / TAP_RATE_HZ;
            0.3 * speed_mm_s * (-time_s / 0.012).exp() * (TAU * 170.0 * time_s).sin()
        };
        Tap {
            speed_m_s: speed_mm_s / 1000.0,
            acceleration_m_s2: (0..100).map(sample).collect(),
            peak_force_n: None,
        }
    };
    Ok(Taps::new(
        TAP_RATE_HZ,
        [20.0, 50.0, 90.0, 140.0, 200.0, 280.0, 380.0, 500.0]
            .map(tap)
            .to_vec(),
    )?)
}
