//! The page of an identified actuator: its frequency response and the residual of the fit.

use super::headlines::{Headline, cards};
use super::page::{Sheet, Simulation, facts, figures_of};
use super::plot::{Axis, Mark, Plot, Style};
use super::scale::{fixed, plain};
use super::theme::Ink;
use haptograph_nodes::actuators::identify::{BandAnswer, Identified};

/// The page as HTML; `recording` names the recorded file.
pub fn page(recording: &str, found: &Identified, simulation: &Simulation) -> String {
    let headlines = cards(&headlines(found)) + &simulation.remark();
    Sheet {
        title: "An actuator, identified",
        about: &format!(
            "From {recording}: the response of acceleration to current, and the fit of two masses on springs."
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

/// The fitted masses, springs and dampers.
fn parameters(found: &Identified) -> String {
    let Some(p) = found.parameters else {
        return "<p>With the masses of magnet and body, or the magnet's and the force by current, the masses, springs and dampers are \
                determined too.</p>"
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
        Headline::new("Delay", format!("{} ms", plain(1e3 * found.delay_s)), "of the recording"),
    ]
}

fn plots(bands: &[BandAnswer]) -> Vec<Plot> {
    let curve = |show: &dyn Fn(&BandAnswer) -> f64| -> Vec<(f64, f64)> {
        bands.iter().map(|band| (band.frequency_hz, show(band))).collect()
    };
    let frequency = || {
        let ends = [bands.first(), bands.last()].map(|band| band.map_or(1.0, |band| band.frequency_hz));
        // Margin for the dots at both ends.
        Axis::of("Frequency (Hz)").log().over(ends[0] / 1.03, ends[1] * 1.03)
    };
    let both = |measured, fitted| {
        vec![
            Mark::Dots(Style::named(Ink::Blue, "measured"), measured),
            Mark::Line(Style::named(Ink::Orange, "fit"), fitted),
        ]
    };
    let fitted_deg = unwrapped(curve(&|b| b.fitted.arg().to_degrees()));
    let measured_deg = near(curve(&|b| b.measured.arg().to_degrees()), &fitted_deg);
    let (low_deg, high_deg) = quarters(fitted_deg.iter().chain(&measured_deg));
    let right_angles = (0..=((high_deg - low_deg) / 90.0) as usize)
        .map(|i| low_deg + 90.0 * i as f64)
        .map(|deg| (deg, fixed(deg, 0)));
    let sizes = || bands.iter().flat_map(|b| [b.measured.norm(), b.fitted.norm()]);
    let (low, high) = sizes().fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
    vec![
        Plot {
            title: "Magnitude".into(),
            x: frequency(),
            // Margin above the peak.
            y: Axis::of("Acceleration by current (m/s² per A)")
                .over(low / 1.3, 1.6 * high)
                .log(),
            marks: both(curve(&|b| b.measured.norm()), curve(&|b| b.fitted.norm())),
            size: (0.0, 320.0),
            caption: "A peak is a resonance. Dots that leave the line at one end of the band indicate a sensor or a hold that the \
                      model does not include."
                .into(),
            ..Plot::default()
        },
        Plot {
            title: "Phase".into(),
            note: "without the recording's whole samples of delay".into(),
            x: frequency(),
            y: Axis::of("Phase (degrees)").over(low_deg, high_deg).named(right_angles),
            marks: both(measured_deg, fitted_deg),
            size: (0.0, 260.0),
            caption: "The phase falls by 180° through each resonance, more steeply for a higher quality.".into(),
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
            caption: "A low, flat residual is noise. A peak indicates an effect outside the model, such as a second mode of the tool.".into(),
            ..Plot::default()
        },
    ]
}

/// Unwraps phases in degrees, starting from the first.
fn unwrapped(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let (mut turns, mut last): (f64, Option<f64>) = (0.0, None);
    let unwrap = |(hz, deg): (f64, f64)| {
        if let Some(last) = last {
            turns -= 360.0 * ((deg - last) / 360.0).round();
        }
        last = Some(deg);
        (hz, deg + turns)
    };
    points.into_iter().map(unwrap).collect()
}

/// Shifts phases by whole turns towards `to`.
fn near(points: Vec<(f64, f64)>, to: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let pairs = points.into_iter().zip(to);
    pairs.map(|((hz, deg), (_, other))| (hz, deg - 360.0 * ((deg - other) / 360.0).round())).collect()
}

/// Multiples of 90 degrees that enclose all points.
fn quarters<'a>(points: impl Iterator<Item = &'a (f64, f64)>) -> (f64, f64) {
    let (low, high) =
        points.fold((0.0_f64, 0.0_f64), |(low, high), (_, deg)| (low.min(*deg), high.max(*deg)));
    ((low / 90.0).floor() * 90.0, (high / 90.0).ceil() * 90.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_go_on_where_they_would_jump() {
        let points = [170.0, -175.0, -100.0, 179.0].map(|deg| (1.0, deg)).to_vec();
        let deg: Vec<f64> = unwrapped(points).iter().map(|(_, deg)| *deg).collect();
        assert_eq!(deg, [170.0, 185.0, 260.0, 179.0]);
        let close = near(vec![(1.0, -175.0)], &[(1.0, 190.0)]);
        assert_eq!(close, [(1.0, 185.0)]);
        assert_eq!(quarters(close.iter()), (0.0, 270.0));
    }
}
