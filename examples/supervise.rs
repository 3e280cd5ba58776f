//! A live run inside another program, with its devices, settings and report: `cargo run --example supervise`.
#![allow(clippy::print_stdout)]
use haptograph::live::supervisor::{RunOptions, Supervisor};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut options = RunOptions::of("graphs/texturepad.ron");
    options.source.endpoints = Some("simulated".to_owned());
    let mut run = Supervisor::start(options, &haptograph::nodes::registry(), None)?;
    println!("driven by {}", run.description());
    let gain = run.setting("out.gain")?;
    gain.set(0.5)?;
    while !run.is_finished() {
        run.wait();
        for event in run.poll() {
            println!("{event}");
        }
        let status = run.status();
        for level in &status.actuators {
            println!("{:.2} s  {}: {:.3} {}", status.seconds, level.path, level.rms, level.unit);
        }
        if status.seconds > 1.0 {
            run.stop();
        }
    }
    let report = run.finish()?.report;
    println!("{}", serde_json::to_string_pretty(&report)?);
    Ok(())
}
