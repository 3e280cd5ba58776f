//! What the pen's friction brake can do (thesis, Fig. 5.22 and 5.23), from the library's own functions:
//! `cargo run --example brake_range -- brake-range.svg`.

use haptograph::nodes::actuators::brake::solenoid::{MOST_CURRENT_A, most_friction_at, most_normal_force_n};
use haptograph::report::plot::{Axis, Mark, Plot, Style, Weight};
use haptograph::report::theme::Ink;

/// The frictions that the thesis measured its pen at.
const MEASURED: [f64; 2] = [0.20, 0.52];
const MOST_SHOWN_N: f64 = 6.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "brake-range.svg".into());
    let [least, most] = MEASURED;
    let at = |k: u32| least + (most - least) * f64::from(k) / 200.0;
    let limit = |current_a: f64| {
        let points = (0..=200)
            .map(at)
            .map(move |mu| (mu, most_normal_force_n(mu, current_a)));
        points
            .filter(|(_, force_n)| *force_n <= MOST_SHOWN_N)
            .collect::<Vec<_>>()
    };
    // Left of the curve the pen can be pressed harder than the plot shows.
    let corners = [(least, 0.0), (least, MOST_SHOWN_N)].into_iter();
    let reachable = corners
        .chain(limit(MOST_CURRENT_A))
        .chain([(most, 0.0)])
        .collect();
    let plot = Plot {
        title: "What the brake can do".into(),
        note: "by the experimental line, Eq. 5.5.10 and 5.5.12".into(),
        x: Axis::of("Friction coefficient").over(least, most),
        y: Axis::of("Normal force (N)").over(0.0, MOST_SHOWN_N),
        marks: vec![
            Mark::Areas(Style::of(Ink::Grey), vec![reachable]),
            Mark::Line(
                Style::named(Ink::Blue, "0.3 A").weight(Weight::Bold),
                limit(MOST_CURRENT_A),
            ),
            Mark::Line(Style::named(Ink::Orange, "0.25 A"), limit(0.25)),
            Mark::Line(Style::named(Ink::Teal, "0.2 A"), limit(0.2)),
        ],
        size: (0.0, 340.0),
    };
    std::fs::write(&file, plot.to_standalone_svg())?;
    let table = [1.1, 2.0, 2.75, 4.3].map(|n| format!("{n} N: {:.3}", most_friction_at(n, MOST_CURRENT_A)));
    use std::io::Write;
    writeln!(
        std::io::stdout(),
        "largest friction at {MOST_CURRENT_A} A: {}; see {file}",
        table.join(", ")
    )?;
    Ok(())
}
