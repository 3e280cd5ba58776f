//! The same inside the callback of a soundcard, at a level that is safe to hear:
//! `cargo run --features soundcard --example embed_soundcard`.

use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use haptograph::engine::graph::CheckOptions;
use haptograph::engine::host::{Scalar, Vector};
use haptograph::engine::run::{Player, SessionOptions};
use std::time::Duration;

/// Amperes at which the card's output is at full scale: a loud texture stays 14 dB below it.
const FULL_SCALE_A: f64 = 2.5;
const SECONDS: f64 = 5.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let graph = haptograph::open("graphs/texturepad.ron", &CheckOptions::hosted())?;
    let mut position_m = graph.input::<Vector>("stylus.position")?;
    let mut force_n = graph.input::<Scalar>("stylus.force")?;
    let mut touching = graph.input::<Scalar>("stylus.touching")?;
    let mut current_a = graph.output::<Scalar>("haptuator.current")?;
    let (mut player, _session) = Player::open(&graph, &SessionOptions::default().rested())?;

    let card = cpal::default_host().default_output_device().ok_or("there is no soundcard")?;
    let config =
        cpal::StreamConfig { channels: 2, sample_rate: 48_000, buffer_size: cpal::BufferSize::Default };
    let callback = move |samples: &mut [f32], _: &cpal::OutputCallbackInfo| {
        player.process(samples.len() / 2);
        for frame in samples.chunks_exact_mut(2) {
            frame.fill((current_a.take().unwrap_or(0.0) / FULL_SCALE_A) as f32);
        }
    };
    let stream = card.build_output_stream(config, callback, |_| (), None)?;
    stream.play()?;
    // The hand: a circle a second, from this thread.
    let pause = Duration::from_millis(8);
    for step in 0..(SECONDS / pause.as_secs_f64()) as u32 {
        let angle = std::f64::consts::TAU * f64::from(step) * pause.as_secs_f64();
        // A full queue means that the card does not play: there is nothing to feel then.
        let _ = position_m.set([0.03 * angle.cos(), 0.03 * angle.sin(), 0.0]);
        let _ = force_n.set(1.0).and(touching.set(1.0));
        std::thread::sleep(pause);
    }
    Ok(())
}
