//! What the pen's friction brake can do (thesis, Fig. 5.22 and 5.23), and how far the friction of simulated pens is from
//! what is wanted, by the measured line alone and with the slow correction: `cargo run --example brake_range`.

use haptograph::nodes::actuators::brake::solenoid::MAX_CURRENT_A;
use haptograph::nodes::actuators::brake::{BrakeSettings, Reach, Solenoid};
use haptograph::nodes::simulated::pen_brake::{PenConstants, dragged};
use haptograph::report::plot::{Axis, Mark, Plot, Style, Weight};
use haptograph::report::theme::Ink;
use std::io::Write;

/// The frictions that the thesis measured its pen at.
const MEASURED: [f64; 2] = [0.20, 0.52];
const MAX_SHOWN_N: f64 = 6.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1).unwrap_or_else(|| "brake-range.svg".into());
    let [least, most] = MEASURED;
    let at = |k: u32| least + (most - least) * f64::from(k) / 200.0;
    let limit = |current_a: f64| {
        let points =
            (0..=200).map(at).map(move |mu| (mu, Solenoid::THESIS.most_normal_force_n(mu, current_a)));
        points.filter(|(_, force_n)| *force_n <= MAX_SHOWN_N).collect::<Vec<_>>()
    };
    // Left of the curve the pen can be pressed harder than the plot shows.
    let corners = [(least, 0.0), (least, MAX_SHOWN_N)].into_iter();
    let reachable = corners.chain(limit(MAX_CURRENT_A)).chain([(most, 0.0)]).collect();
    let plot = Plot {
        title: "What the brake can do".into(),
        note: "by the experimental line, Eq. 5.5.10 and 5.5.12".into(),
        x: Axis::of("Friction coefficient").over(least, most),
        y: Axis::of("Normal force (N)").over(0.0, MAX_SHOWN_N),
        marks: vec![
            Mark::Areas(Style::of(Ink::Grey), vec![reachable]),
            Mark::Line(Style::named(Ink::Blue, "0.3 A").weight(Weight::Bold), limit(MAX_CURRENT_A)),
            Mark::Line(Style::named(Ink::Orange, "0.25 A"), limit(0.25)),
            Mark::Line(Style::named(Ink::Teal, "0.2 A"), limit(0.2)),
        ],
        size: (0.0, 340.0),
        ..Plot::default()
    };
    std::fs::write(&file, plot.to_standalone_svg())?;
    let table = [1.1, 2.0, 2.75, 4.3]
        .map(|n| format!("{n} N: {:.3}", Solenoid::THESIS.most_friction_at(n, MAX_CURRENT_A)));
    let mut out = std::io::stdout().lock();
    writeln!(out, "largest friction at {MAX_CURRENT_A} A: {}; see {file}\n", table.join(", "))?;
    writeln!(
        out,
        "error of the friction of {PENS} simulated pens, each constant up to 8 % off, at 0.5 to 4 N"
    )?;
    writeln!(out, "wanted   open loop: rms  worst   corrected: rms  worst   out of the brake's range")?;
    for wanted in [0.20, 0.28, 0.36, 0.44, 0.52] {
        let open = errors(wanted, BrakeSettings { trim_per_s: 0.0, ..BrakeSettings::default() });
        let closed = errors(wanted, BrakeSettings::default());
        let refused = closed.iter().filter(|(_, reach)| *reach != Reach::Within).count();
        let ([open_rms, open_worst], [rms, worst]) = (summary(&open, &closed), summary(&closed, &closed));
        let count = closed.len();
        writeln!(
            out,
            "  {wanted:.2}          {open_rms:.4} {open_worst:.4}          {rms:.4} {worst:.4}        {refused} of {count}"
        )?;
    }
    Ok(())
}

const PENS: u64 = 20;

/// Of every pen and load, the friction's error and whether the brake could do it.
fn errors(wanted: f64, settings: BrakeSettings) -> Vec<(f64, Reach)> {
    let loads_n = [0.5, 1.1, 2.0, 2.75, 4.0];
    let cases = (0..PENS).flat_map(|seed| loads_n.map(|normal_n| (PenConstants::of_pen(seed), normal_n)));
    cases
        .map(|(pen, normal_n)| {
            let (found, reach) = dragged(&pen, wanted, normal_n, settings);
            (found - wanted, reach)
        })
        .collect()
}

/// Root of the mean square and largest magnitude, where the corrected brake was within its range.
fn summary(errors: &[(f64, Reach)], closed: &[(f64, Reach)]) -> [f64; 2] {
    let within = errors.iter().zip(closed).filter(|(_, (_, reach))| *reach == Reach::Within);
    let errors: Vec<f64> = within.map(|((error, _), _)| error.abs()).collect();
    let square = errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64;
    [square.sqrt(), errors.iter().copied().fold(0.0, f64::max)]
}
