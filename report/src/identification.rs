//! The page of an actuator that was identified: how it answers a current, and what the fit leaves.

use super::headlines::{Headline, cards};
use super::page::{Sheet, Simulation, facts, figures_of};
use super::plot::{Axis, Mark, Plot, Style};
use super::scale::plain;
use super::theme::Ink;
use haptograph_nodes::actuators::identify::{BandAnswer, Identified};

/// The page as HTML; `recording` names what was recorded.
pub fn page(recording: &str, found: &Identified, simulation: &Simulation) -> String {
    let headlines = cards(&headlines(found)) + &simulation.remark();
    Sheet {
        title: "An actuator, identified",
        about: &format!(
            "From {recording}: the acceleration that a current gives, and the fit of two masses on springs."
        ),
        badge: simulation.badge(),
        warnings: &[],
        sections: &[
            ("The actuator", parameters(found) + &headlines),
            ("Recording and fit", figures_of(&plots(&found.bands))),
        ],
    }
    .to_html()
}

/// The answer itself: masses, springs and dampers.
fn parameters(found: &Identified) -> String {
    let Some(p) = found.parameters else {
        return "<p>With <code>--magnet-g</code> and <code>--body-g</code> (or <code>--force-n-per-a</code>) the masses, springs and \
                dampers are told apart.</p>"
            .to_owned();
    };
    let value = |name: &str, value: f64, unit: &str| (name.to_owned(), format!("{} {unit}", plain(value)));
    facts(&[
        value("Force by current", p.force_n_per_a, "N/A"),
        value("Magnet", 1e3 * p.magnet_kg, "g"),
        value("Its suspension, stiffness", 1e-3 * p.suspension_n_per_m, "N/mm"),
        value("Its suspension, damping", p.suspension_n_s_per_m, "N s/m"),
        value("Body, tool and hand", 1e3 * p.body_kg, "g"),
        value("Grip, stiffness", 1e-3 * p.hand_n_per_m, "N/mm"),
        value("Grip, damping", p.hand_n_s_per_m, "N s/m"),
    ])
}

fn headlines(found: &Identified) -> Vec<Headline> {
    let [high, low] = found.modes;
    let hertz = |hz: f64| format!("{} Hz", plain(hz));
    let quality = |q: f64| format!("Q {}", plain(q));
    vec![
        Headline::new("Upper resonance", hertz(high.frequency_hz), quality(high.q)),
        Headline::new("Lower resonance", hertz(low.frequency_hz), quality(low.q)),
        Headline::new(
            "Gain above them",
            format!("{} m/s² per A", plain(found.response.gain)),
            "acceleration by current",
        ),
        Headline::new(
            "Unexplained",
            match 100.0 * found.unexplained {
                little if little < 0.01 => "< 0.01 %".to_owned(),
                percent => format!("{} %", plain(percent)),
            },
            "of the power in the band",
        ),
        Headline::new(
            "Delay",
            format!("{} ms", plain(1e3 * found.delay_s)),
            "of the recording",
        ),
    ]
}

fn plots(bands: &[BandAnswer]) -> Vec<Plot> {
    let curve = |show: &dyn Fn(&BandAnswer) -> f64| -> Vec<(f64, f64)> {
        bands.iter().map(|band| (band.frequency_hz, show(band))).collect()
    };
    let frequency = || {
        let ends = [bands.first(), bands.last()].map(|band| band.map_or(1.0, |band| band.frequency_hz));
        Axis::of("Frequency (Hz)").log().over(ends[0], ends[1])
    };
    let both = |measured, fitted| {
        vec![
            Mark::Dots(Style::named(Ink::Blue, "measured"), measured),
            Mark::Line(Style::named(Ink::Orange, "fit"), fitted),
        ]
    };
    let sizes = || bands.iter().flat_map(|b| [b.measured.norm(), b.fitted.norm()]);
    let (low, high) = sizes().fold((f64::INFINITY, 0.0_f64), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    vec![
        Plot {
            title: "Magnitude".into(),
            x: frequency(),
            // With room above the peak.
            y: Axis::of("Acceleration by current (m/s² per A)")
                .over(low / 1.3, 1.6 * high)
                .log(),
            marks: both(curve(&|b| b.measured.norm()), curve(&|b| b.fitted.norm())),
            size: (0.0, 320.0),
            caption: "A peak is a resonance. Dots that leave the line at one end of the band tell of a sensor or a hold that the \
                      model lacks."
                .into(),
            ..Plot::default()
        },
        Plot {
            title: "Phase".into(),
            note: "without the recording's whole samples of delay".into(),
            x: frequency(),
            y: Axis::of("Phase (degrees)").over(-180.0, 180.0),
            marks: both(
                curve(&|b| b.measured.arg().to_degrees()),
                turned(curve(&|b| b.fitted.arg().to_degrees())),
            ),
            size: (0.0, 260.0),
            caption: "It falls by 180° through each resonance, the more suddenly the higher its quality.".into(),
            ..Plot::default()
        },
        Plot {
            title: "Residual".into(),
            x: frequency(),
            y: Axis::of("Distance of the fit (% of the measured)").log(),
            marks: vec![Mark::Dots(
                Style::of(Ink::Blue),
                curve(&|b| 100.0 * (b.measured - b.fitted).norm() / b.measured.norm()),
            )],
            caption: "Level and low: noise. A hump: something that the model has not, such as a second mode of the tool.".into(),
            ..Plot::default()
        },
    ]
}

/// A phase that is broken where it jumps from one end of its circle to the other.
fn turned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut broken: Vec<(f64, f64)> = Vec::with_capacity(points.len());
    for point in points {
        if let Some(last) = broken.last()
            && (point.1 - last.1).abs() > 180.0
        {
            broken.push((point.0, f64::NAN));
        }
        broken.push(point);
    }
    broken
}
