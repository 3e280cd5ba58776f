//! The static-resolution experiment of thesis 5.2.5, simulated: a probe is held at five points of a cube's top, five trials each;
//! how far does the located contact stray, and do x and y differ?
//!
//! ```text
//! cargo run --release --example static_resolution -- 1
//! ```
//!
//! The number is the seed.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use haptograph::nodes::simulated::static_resolution::{StaticSettings, static_resolution};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let seed = std::env::args().nth(1).map_or(Ok(1), |text| text.parse())?;
    let settings = StaticSettings::default();
    let found = static_resolution(&settings, seed)?;
    println!(
        "simulated: {} N held on a cube of {} mm, 5 points x {} trials of {} s, the first and last 50 ms left out\n",
        settings.force_n,
        1e3 * settings.edge_m,
        settings.trials,
        settings.trial_s
    );
    println!("point   x mm    y mm   sd x mm  sd y mm  largest mm");
    for (number, point) in found.points.iter().enumerate() {
        let [x, y] = point.position_m.map(|m| 1e3 * m);
        let [sd_x, sd_y] = point.deviation_m.map(|m| 1e3 * m);
        println!("{:5}  {x:6.1}  {y:6.1}  {sd_x:8.4} {sd_y:8.4}  {:10.4}", number + 1, 1e3 * point.largest_m);
    }
    let test = found.directions;
    println!(
        "\nlargest of all {:.3} mm (thesis: at most 0.5 mm); x against y: Kolmogorov-Smirnov D = {:.3}, p = {:.2} (thesis: p = 0.29)",
        1e3 * found.largest_m,
        test.distance,
        test.p
    );
    Ok(())
}
