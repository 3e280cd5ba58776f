//! A texture inside another program, from the program's own positions and forces: `cargo run --example embed`.
#![allow(clippy::print_stdout)]
use haptograph::engine::graph::CheckOptions;
use haptograph::engine::host::{Scalar, Vector};
use haptograph::engine::run::{Player, SessionOptions};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let graph = haptograph::open("graphs/texturepad.ron", &CheckOptions::hosted())?;
    let mut position_m = graph.input::<Vector>("stylus.position")?;
    let mut force_n = graph.input::<Scalar>("stylus.force")?;
    let mut touching = graph.input::<Scalar>("stylus.touching")?;
    let mut current = graph.output::<Scalar>("haptuator.current")?;
    let (mut player, _session) = Player::open(&graph, &SessionOptions::default().rested())?;
    let mut current_a = [0.0; 480];
    for call in 0..100 {
        let angle = f64::from(call) * 0.05;
        position_m.set([0.03 * angle.cos(), 0.03 * angle.sin(), 0.0])?;
        force_n.set(1.0).and(touching.set(1.0))?;
        player.process(current_a.len());
        current.read(&mut current_a);
        let peak_a = current_a.iter().fold(0.0_f64, |most, i| most.max(i.abs()));
        println!("{:4} ms  {}", call * 10, "#".repeat((peak_a * 100.0) as usize));
    }
    Ok(())
}
