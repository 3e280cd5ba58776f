//! Fitted lines of friction, tap forces and stiffness.

use crate::plot::{Axis, Mark, Plot, Style, Weight};
use crate::theme::Ink;
use crate::thinning::Decimated;
use haptograph_learning::learn::friction::FrictionReport;
use haptograph_learning::learn::stiffness::StiffnessReport;
use haptograph_learning::learn::taps::TapReport;
use haptograph_surfaces::{Line, Taps};

/// A fitted line over a range of x.
fn fitted(line: &Line, (from, to): (f64, f64), x_factor: f64, name: String) -> Mark {
    let at = |x: f64| (x * x_factor, line.intercept + line.slope * x);
    Mark::Line(Style::named(Ink::Orange, name).weight(Weight::Bold), vec![at(from), at(to)])
}

/// The points that a line was fitted to, and those that were left out.
fn dots(names: [&str; 2], weight: Weight, [used, others]: [Vec<(f64, f64)>; 2]) -> Vec<Mark> {
    let of = |ink, name, points| Mark::Dots(Style::named(ink, name).weight(weight), points);
    let mut marks = vec![of(Ink::Blue, names[0], used)];
    if !others.is_empty() {
        marks.push(of(Ink::Rose, names[1], others));
    }
    marks
}

/// Maximum number of dots, taken evenly.
const MAX_DOTS: usize = 1500;

fn thinned(points: impl IntoIterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut kept = Decimated::new(MAX_DOTS);
    points.into_iter().for_each(|point| kept.push(point));
    kept.kept().to_vec()
}

pub(super) fn friction(found: &FrictionReport) -> Plot {
    let of = |used: bool| {
        let points = found.points.iter().zip(&found.used).filter(move |(_, u)| **u == used);
        thinned(points.map(|(point, _)| *point))
    };
    let hardest = found.points.iter().fold(0.0_f64, |most, point| most.max(point.0));
    let mut marks = dots(["moment", "outlier"], Weight::Hair, [of(true), of(false)]);
    let name = format!("mu = {:.3}, R² = {:.3}", found.line.slope, found.line.r_squared);
    marks.push(fitted(&found.line, (0.0, hardest), 1.0, name));
    Plot {
        title: "Tangential over normal force".into(),
        x: Axis::of("Normal force (N)").over(0.0, 1.02 * hardest),
        y: Axis::of("Tangential force (N)"),
        marks,
        size: (0.0, 330.0),
        caption: "The slope of the line is the friction coefficient.".to_owned(),
        ..Plot::default()
    }
}

/// Peak force over incoming speed; its slope is the tap response factor (thesis 4.4.2).
pub(super) fn contacts(taps: &Taps, found: &TapReport) -> Plot {
    let of = |used: bool| {
        let contacts = found.contacts.iter().filter(move |contact| contact.used == used);
        contacts.map(|c| (c.speed_m_s * 1e3, c.peak_force_n)).collect::<Vec<_>>()
    };
    let fastest = found.contacts.iter().fold(0.0_f64, |most, contact| most.max(contact.speed_m_s));
    let mut marks = dots(["tap", "not used"], Weight::default(), [of(true), of(false)]);
    if let Some(line) = taps.response() {
        let name = format!("{:.1} N per m/s, R² = {:.3}", line.slope, line.r_squared);
        // Extrapolated to rest the line can be negative, so it is drawn over the range of the taps only.
        let used = found.contacts.iter().filter(|contact| contact.used);
        let speeds = used.map(|contact| contact.speed_m_s);
        let range = speeds
            .fold((fastest, 0.0_f64), |(slowest, fastest), speed| (slowest.min(speed), fastest.max(speed)));
        marks.push(fitted(&line, range, 1e3, name));
    }
    Plot {
        title: "Peak force over incoming speed".into(),
        x: Axis::of("Incoming speed (mm/s)").over(0.0, 1.02e3 * fastest),
        y: Axis::of("Peak normal force (N)"),
        marks,
        size: (0.0, 260.0),
        caption: "A faster tap is harder: a rendered tap grows with its speed along this line.".to_owned(),
        ..Plot::default()
    }
}

/// Range shown before the contact, relative to the length of the line.
const BEFORE_CONTACT: f64 = 0.1;

pub(super) fn stiffness(found: &StiffnessReport) -> Plot {
    let deepest = found.curve.iter().fold(0.0_f64, |most, point| most.max(point.0));
    let (line, slope) = (&found.line, found.line.slope);
    // From the zero of the line to the deepest point.
    let from = (-line.intercept / slope).clamp(0.0, deepest);
    let name = format!("{:.1} N/mm, R² = {:.3}", slope * 1e-3, line.r_squared);
    // Most of the travel is in the air.
    let begin = (from - BEFORE_CONTACT * (deepest - from)).max(0.0);
    let shown = found.curve.iter().filter(|(depth, _)| *depth >= begin);
    let path = thinned(shown.map(|(depth, force)| (depth * 1e3, *force)));
    Plot {
        title: "Force of a press".into(),
        x: Axis::of("Indentation (mm)").over(1e3 * begin, 1e3 * (deepest + 0.02 * (deepest - begin))),
        y: Axis::of("Normal force (N)"),
        marks: vec![
            Mark::Line(Style::named(Ink::Blue, "press"), path),
            fitted(line, (from, deepest), 1e3, name),
        ],
        size: (0.0, 280.0),
        caption: "The slope of the line is the stiffness.".to_owned(),
        ..Plot::default()
    }
}
