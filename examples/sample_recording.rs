//! Makes `examples/data/t3-tile-drag-simulated.csv`, the recording that the page `docs/recording.md` learns from: a simulated session,
//! processed as `learn` does, brought to 2 kHz, and written with few digits. The same program gives the same table again.
//!
//! ```text
//! cargo run --release --example sample_recording -- examples/data/t3-tile-drag-simulated.csv
//! ```

use haptograph::learning::processing::{ProcessingSettings, processed};
use haptograph::learning::recording::Gesture;
use haptograph::nodes::simulated::material::MaterialName;
use haptograph::recorder::{SimulatedTake, record};
use haptograph::signal::files::write_atomically;
use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

/// What is simulated: `haptograph simulate-recording --material T3 --motion drag --seconds 6 --seed 1`.
const TAKE: SimulatedTake = SimulatedTake {
    material: MaterialName::T3,
    gesture: Gesture::Drag,
    from_rest: false,
    person: 1,
    seconds: 6.0,
    seed: 1,
};
const RATE_HZ: f64 = 2000.0;
const HEAD: &str = "\
# SIMULATED: no real material. haptograph simulate-recording --material T3 --motion drag --seconds 6 --seed 1
# gesture: drag
# origin: simulated
# source: simulated recording tool, T3 like floor tile
# rate_hz: 2000
accel_m_s2,force_normal_n,force_tangential_n,speed_mm_s
";

#[allow(dead_code)] // The test of the book includes this one for `table` alone.
fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("name the file to write")?;
    Ok(write_atomically(Path::new(&file), table()?.as_bytes())?)
}

/// The file's text.
pub fn table() -> Result<String, Box<dyn Error>> {
    let raw = record(&TAKE, &Arc::default(), &mut |_| ())?;
    let settings = ProcessingSettings { rate_hz: Some(RATE_HZ), ..Default::default() };
    let recording = processed(&raw, &settings)?;
    let signals = recording.signals();
    let tangential_n = signals.force_tangential_n.as_ref().ok_or("no tangential force was recorded")?;
    let mut text = String::from(HEAD);
    for (i, acceleration_m_s2) in signals.acceleration_m_s2.iter().enumerate() {
        let (normal_n, speed_mm_s) = (signals.force_normal_n[i], 1000.0 * signals.speed_m_s[i]);
        let tangential_n = tangential_n[i];
        writeln!(text, "{acceleration_m_s2:.2},{normal_n:.2},{tangential_n:.2},{speed_mm_s:.1}")?;
    }
    Ok(text)
}
