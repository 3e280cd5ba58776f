//! What ten simulated voice-coil actuators make felt of what is commanded, each within the default tolerance of its data
//! sheet: compensated by the data sheet, and by what `identify` finds. `cargo run --example haptuator_tolerance`.

use haptograph::nodes::simulated::compensation::{Felt, compensated};
use haptograph::nodes::simulated::haptuator::TOLERANCE;
use std::io::Write;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "felt over commanded, 20 to 500 Hz, in dB; simulated, each parameter up to {:.0} % off",
        100.0 * TOLERANCE
    )?;
    writeln!(out, "(the target is a high-pass, -3.0 dB at 20 Hz)\n")?;
    writeln!(out, "seed   stated: least  most  off target   identified: least  most  off target")?;
    let row = |felt: &Felt| format!("{:6.2} {:5.2}  {:10.2}", felt.least_db, felt.most_db, felt.off_db);
    let mut worst = [0.0_f64; 2];
    for seed in 1..=10 {
        let found = compensated(seed, TOLERANCE).ok_or("an actuator could not be identified")?;
        let (stated, identified) = (found.stated, found.identified);
        writeln!(out, "{seed:4}         {}             {}", row(&stated), row(&identified))?;
        worst = [worst[0].max(stated.off_db), worst[1].max(identified.off_db)];
    }
    writeln!(out, "\nworst off target: {:.2} stated, {:.2} identified", worst[0], worst[1])?;
    Ok(())
}
