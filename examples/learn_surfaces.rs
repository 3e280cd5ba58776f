//! Makes the surfaces that ship in `graphs/surfaces/`: each of the six simulated materials is recorded by one person, dragging,
//! circling, tapping and pressing, and learned from that. The same program gives the same bytes again.
//!
//! ```text
//! cargo run --release --example learn_surfaces -- graphs/surfaces
//! ```

use haptograph::learning::learn::law::LawSettings;
use haptograph::learning::learn::{LearnSettings, TextureMethod, learn};
use haptograph::learning::recording::Gesture;
use haptograph::nodes::simulated::material::MaterialName;
use haptograph::recorder::{SimulatedTake, record};
use haptograph::signal::files::write_atomically;
use haptograph::surfaces::{Surface, files};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// File and name of each material's surface. The first five share stiffness, friction and fineness with materials of the thesis;
/// they are simulated, not those materials.
pub const SHIPPED: [(MaterialName, &str, &str); 6] = [
    (MaterialName::T1, "t1-plastic.ron", "T1, like rough plastic (simulated)"),
    (MaterialName::T2, "t2-canvas.ron", "T2, like canvas (simulated)"),
    (MaterialName::T3, "t3-tile.ron", "T3, like floor tile (simulated)"),
    (MaterialName::T4, "t4-silk.ron", "T4, like silk (simulated)"),
    (MaterialName::T5, "t5-vinyl.ron", "T5, like vinyl (simulated)"),
    (MaterialName::T6, "t6-coarse.ron", "T6, coarse and sticky (simulated, made up)"),
];
/// Rate at which taps are kept: that of the arms that play them.
const TAP_RATE_HZ: f64 = 1000.0;

#[allow(dead_code)] // The test of the shipped files includes this one for `learned` alone.
fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("name the folder to write to, such as graphs/surfaces")?;
    for (material, file, name) in SHIPPED {
        let surface = learned(material, name)?;
        let text = files::native::write(&surface);
        write_atomically(&Path::new(&folder).join(file), text.as_bytes())?;
    }
    Ok(())
}

/// The surface of a material.
pub fn learned(material: MaterialName, name: &str) -> Result<Surface, Box<dyn Error>> {
    let gestures =
        [(Gesture::Drag, 10.0), (Gesture::Circle, 10.0), (Gesture::Tap, 10.0), (Gesture::Press, 6.0)];
    let take = |(gesture, seconds)| {
        let session = SimulatedTake { material, gesture, from_rest: false, person: 1, seconds, seed: 1 };
        record(&session, &Arc::default(), &mut |_| ())
    };
    // Clips of each would be four times the rest of its file.
    let texture = TextureMethod::Law(LawSettings { clips: false, ..LawSettings::default() });
    let settings = LearnSettings { texture, ..LearnSettings::default() };
    let recordings = gestures.into_iter().map(take).collect::<Result<Vec<_>, _>>()?;
    let (mut surface, _) = learn(name, &recordings, &settings, &|_| ())?;
    surface.taps = surface.taps.map(|taps| taps.resampled(TAP_RATE_HZ)).transpose()?;
    surface.provenance = surface.provenance.with_setting("taps.rate_hz", TAP_RATE_HZ);
    Ok(surface)
}
