//! The page that learning a surface leaves behind: what each part was learned from, and how well it fits.

use super::page::{Sheet, figures_of};
use super::plot::{Axis, Mark, Plot, Style, Weight};
use super::scale::peak;
use super::svg::escape;
use super::theme::Ink;
use super::thinning::Decimated;
use super::{figures, loci, responses};
use haptograph_signal::spectrum::welch;
use haptograph_signal::window::Window;
use haptograph_surfaces::evaluate::{Trajectory, synthesise};
use haptograph_surfaces::learning::LearningReport;
use haptograph_surfaces::learning::friction::FrictionReport;
use haptograph_surfaces::learning::stiffness::StiffnessReport;
use haptograph_surfaces::learning::taps::TapReport;
use haptograph_surfaces::learning::texture::{Fate, SegmentReport, TextureReport};
use haptograph_surfaces::recording::ProcessedRecording;
use haptograph_surfaces::{Line, Origin, Surface, Taps, TextureModel};

/// The page.
pub fn page(surface: &Surface, report: &LearningReport) -> String {
    let simulated = is_simulated(surface);
    let facts: String = surface
        .provenance
        .settings
        .iter()
        .map(|(name, value)| format!("<dt>{}</dt><dd>{}</dd>", escape(name), escape(value)))
        .collect();
    let warnings: Vec<String> = report.missing.iter().map(ToString::to_string).collect();
    let mut sections = sections(surface, report);
    sections.push(("How it was made", format!("<dl>{facts}</dl>")));
    let about = format!(
        "Learned by {} from {}.",
        surface.provenance.version, surface.provenance.source
    );
    Sheet {
        title: &surface.name,
        about: &about,
        badge: badge(simulated),
        warnings: &warnings,
        sections: &sections,
    }
    .to_html()
}

/// What stands beside the title.
pub(super) fn badge(simulated: bool) -> &'static str {
    if simulated { "simulated" } else { "" }
}

/// Nothing simulated may pass for measured, nor what was drawn by a procedure.
pub(super) fn is_simulated(surface: &Surface) -> bool {
    matches!(surface.provenance.origin, Origin::Simulated | Origin::Procedural)
}

/// A section for each part of the surface; parts that were not learned have none.
pub(super) fn sections(surface: &Surface, report: &LearningReport) -> Vec<(&'static str, String)> {
    let mut sections = vec![];
    if let (Some(texture), Some(found)) = (&surface.texture, &report.texture) {
        sections.push(("Segments", segments(&report.drags, found)));
        sections.push(("Texture map", figures_of(&[map(texture, found)])));
        sections.push(("Between models", loci::section(texture)));
        if let Some(drag) = report.drags.first() {
            sections.push((
                "Recorded and synthesised",
                recorded_and_synthesised(texture, drag),
            ));
        }
        sections.push(("Response to force and speed", responses::section(texture)));
    }
    if let Some(found) = &report.friction {
        sections.push(("Friction", figures_of(&[friction(found)])));
    }
    if let (Some(taps), Some(found)) = (&surface.taps, &report.taps) {
        sections.push((
            "Taps",
            figures_of(&[
                responses::tap_waves(taps),
                responses::tap_spectra(taps),
                contacts(taps, found),
            ]),
        ));
    }
    if let Some(found) = &report.stiffness {
        sections.push(("Stiffness", figures_of(&[stiffness(found)])));
    }
    sections
}

/// Acceleration with its breaks; speed and force with the medians that label the models (Fig. 2.5).
fn segments(drags: &[ProcessedRecording], found: &TextureReport) -> String {
    let mut plots = vec![];
    for (number, drag) in drags.iter().enumerate() {
        let signals = drag.signals();
        let seconds = drag.samples() as f64 / signals.rate_hz;
        let of_drag: Vec<&SegmentReport> = found.segments.iter().filter(|s| s.recording == number).collect();
        let time_s = |sample: usize| sample as f64 / signals.rate_hz;
        let breaks = |low: f64, high: f64| {
            let at = of_drag.iter().skip(1).map(|s| time_s(s.samples.start));
            Mark::Segments(
                Style::of(Ink::Grey).weight(Weight::Dashed),
                at.map(|t| [(t, low), (t, high)]).collect(),
            )
        };
        let plot = |title: String, note: String, label: &str, low: f64, high: f64, marks: Vec<Mark>| Plot {
            title,
            note,
            x: Axis::of("Time (s)").over(0.0, seconds),
            y: Axis::of(label).over(low, high),
            marks: [marks, vec![breaks(low, high)]].concat(),
            size: (0.0, 170.0),
            ..Plot::default()
        };
        let medians =
            |fate: fn(&Fate) -> bool, ink: Ink, name: &str, value: &dyn Fn(&SegmentReport) -> f64| {
                let chosen = of_drag.iter().filter(|s| fate(&s.fate));
                let line = |s: &&SegmentReport| {
                    [
                        (time_s(s.samples.start), value(s)),
                        (time_s(s.samples.end), value(s)),
                    ]
                };
                Mark::Segments(
                    Style::named(ink, name).weight(Weight::Bold),
                    chosen.map(line).collect(),
                )
            };
        let labelled = |value: &dyn Fn(&SegmentReport) -> f64| {
            let mut marks = vec![medians(
                |fate| *fate == Fate::Kept,
                Ink::Orange,
                "median of a model's segment",
                value,
            )];
            if of_drag.iter().any(|s| s.fate != Fate::Kept) {
                marks.push(medians(
                    |fate| *fate != Fate::Kept,
                    Ink::Rose,
                    "of a segment left out",
                    value,
                ));
            }
            marks
        };
        let title = if drags.len() == 1 {
            "Acceleration".to_owned()
        } else {
            format!("Acceleration, drag {}", number + 1)
        };
        let note = format!("{} segments, median order {}", of_drag.len(), found.order);
        let loudest = 1.05 * peak(&signals.acceleration_m_s2);
        let acceleration = Mark::samples(
            Style::of(Ink::Blue),
            signals.rate_hz,
            &signals.acceleration_m_s2,
            1.0,
        );
        plots.push(plot(
            title,
            note,
            "Acceleration (m/s²)",
            -loudest,
            loudest,
            vec![acceleration],
        ));
        let speed = Mark::samples(Style::of(Ink::Teal), signals.rate_hz, &signals.speed_m_s, 1e3);
        let speeds = [vec![speed], labelled(&|s| s.speed_m_s * 1e3)].concat();
        let fastest = 1.05e3 * peak(&signals.speed_m_s);
        plots.push(plot(
            "Speed".into(),
            String::new(),
            "Speed (mm/s)",
            0.0,
            fastest,
            speeds,
        ));
        let force = Mark::samples(
            Style::of(Ink::Plum),
            signals.rate_hz,
            &signals.force_normal_n,
            1.0,
        );
        let forces = [vec![force], labelled(&|s| s.force_n)].concat();
        let hardest = 1.05 * peak(&signals.force_normal_n);
        plots.push(plot(
            "Normal force".into(),
            String::new(),
            "Force (N)",
            0.0,
            hardest,
            forces,
        ));
    }
    figures_of(&plots)
}

/// The triangles over speed and force, with the models that were left out (Fig. 2.6).
fn map(texture: &TextureModel, found: &TextureReport) -> Plot {
    let (speed, force) = (texture.max_speed_m_s() * 1e3, texture.max_force_n());
    let mut marks = figures::triangulation(texture);
    let outliers = found
        .segments
        .iter()
        .filter(|s| matches!(s.fate, Fate::Outlier { .. }));
    let outliers: Vec<_> = outliers.map(|s| (s.speed_m_s * 1e3, s.force_n)).collect();
    if !outliers.is_empty() {
        marks.push(Mark::Dots(Style::named(Ink::Rose, "outlier"), outliers));
    }
    Plot {
        title: "Models over speed and force".into(),
        note: format!("{} triangles", texture.triangles().len()),
        x: Axis::of("Speed (mm/s)").over(-0.015 * speed, 1.015 * speed),
        y: Axis::of("Normal force (N)").over(-0.02 * force, 1.02 * force),
        marks,
        size: (0.0, 400.0),
        ..Plot::default()
    }
}

/// What was recorded, what the texture gives along the same speed and force, and the spectra of both (Fig. 2.10).
fn recorded_and_synthesised(texture: &TextureModel, drag: &ProcessedRecording) -> String {
    let rate_hz = drag.rate_hz();
    let recorded = &drag.signals().acceleration_m_s2;
    let Ok(played) = synthesise(texture, &Trajectory::of(drag), &Default::default()) else {
        return "<p>The texture has another rate than the recording.</p>".to_owned();
    };
    let loudest = 1.05 * peak(recorded).max(peak(&played));
    let over_time = |title: &str, ink: Ink, samples: &[f64]| Plot {
        title: title.into(),
        x: Axis::of("Time (s)").over(0.0, samples.len() as f64 / rate_hz),
        y: Axis::of("Acceleration (m/s²)").over(-loudest, loudest),
        marks: vec![Mark::samples(Style::of(ink), rate_hz, samples, 1.0)],
        size: (0.0, 180.0),
        ..Plot::default()
    };
    let plots = [
        over_time("Recorded", Ink::Blue, recorded),
        over_time("Synthesised along the same speed and force", Ink::Orange, &played),
        spectra(
            rate_hz,
            &[
                ("recorded", Ink::Blue, recorded),
                ("synthesised", Ink::Orange, &played),
            ],
        ),
    ];
    figures_of(&plots)
}

/// Touch ends near 1 kHz.
const SHOWN_HZ: (f64, f64) = (20.0, 2000.0);

/// Mean spectra over each other.
fn spectra(rate_hz: f64, signals: &[(&str, Ink, &[f64])]) -> Plot {
    let segment = (0.2 * rate_hz) as usize;
    let line = |&(name, ink, samples): &(&str, Ink, &[f64])| {
        let psd = welch(
            samples,
            rate_hz,
            segment.min(samples.len()),
            segment / 2,
            Window::Hann,
        )
        .ok()?;
        let points = psd.frequency_hz.iter().copied().zip(psd.density.iter().copied());
        let shown = points.filter(|(f, d)| (SHOWN_HZ.0..=SHOWN_HZ.1).contains(f) && *d > 0.0);
        Some(Mark::Line(Style::named(ink, name), shown.collect()))
    };
    Plot {
        title: "Mean spectra".into(),
        x: Axis::of("Frequency (Hz)")
            .over(SHOWN_HZ.0, SHOWN_HZ.1.min(0.5 * rate_hz))
            .log(),
        y: Axis::of("Density ((m/s²)²/Hz)").log(),
        marks: signals.iter().filter_map(line).collect(),
        size: (0.0, 250.0),
        ..Plot::default()
    }
}

/// A fitted line over a range of x.
fn fitted(line: &Line, (from, to): (f64, f64), x_factor: f64, name: String) -> Mark {
    let at = |x: f64| (x * x_factor, line.intercept + line.slope * x);
    Mark::Line(
        Style::named(Ink::Orange, name).weight(Weight::Bold),
        vec![at(from), at(to)],
    )
}

/// At most this many dots, evenly taken.
const MOST_DOTS: usize = 1500;

fn thinned(points: impl IntoIterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut kept = Decimated::new(MOST_DOTS);
    points.into_iter().for_each(|point| kept.push(point));
    kept.kept().to_vec()
}

fn friction(found: &FrictionReport) -> Plot {
    let of = |used: bool| {
        let points = found
            .points
            .iter()
            .zip(&found.used)
            .filter(move |(_, u)| **u == used);
        thinned(points.map(|(point, _)| *point))
    };
    let hardest = found.points.iter().fold(0.0_f64, |most, point| most.max(point.0));
    let mut marks = vec![Mark::Dots(
        Style::named(Ink::Blue, "moment").weight(Weight::Hair),
        of(true),
    )];
    if found.used.contains(&false) {
        marks.push(Mark::Dots(
            Style::named(Ink::Rose, "outlier").weight(Weight::Hair),
            of(false),
        ));
    }
    let name = format!("mu = {:.3}, R² = {:.3}", found.line.slope, found.line.r_squared);
    marks.push(fitted(&found.line, (0.0, hardest), 1.0, name));
    Plot {
        title: "Tangential over normal force".into(),
        x: Axis::of("Normal force (N)").over(0.0, 1.02 * hardest),
        y: Axis::of("Tangential force (N)"),
        marks,
        size: (0.0, 330.0),
        ..Plot::default()
    }
}

/// Peak force over incoming speed: the tap response factor is the slope (4.4.2).
fn contacts(taps: &Taps, found: &TapReport) -> Plot {
    let of = |used: bool| {
        let contacts = found.contacts.iter().filter(move |contact| contact.used == used);
        contacts
            .map(|c| (c.speed_m_s * 1e3, c.peak_force_n))
            .collect::<Vec<_>>()
    };
    let fastest = found
        .contacts
        .iter()
        .fold(0.0_f64, |most, contact| most.max(contact.speed_m_s));
    let mut marks = vec![Mark::Dots(Style::named(Ink::Blue, "tap"), of(true))];
    if found.contacts.iter().any(|contact| !contact.used) {
        marks.push(Mark::Dots(Style::named(Ink::Rose, "not used"), of(false)));
    }
    if let Some(line) = taps.response() {
        let name = format!("{:.1} N per m/s, R² = {:.3}", line.slope, line.r_squared);
        marks.push(fitted(&line, (0.0, fastest), 1e3, name));
    }
    Plot {
        title: "Peak force over incoming speed".into(),
        x: Axis::of("Incoming speed (mm/s)").over(0.0, 1.02e3 * fastest),
        y: Axis::of("Peak normal force (N)"),
        marks,
        size: (0.0, 260.0),
        ..Plot::default()
    }
}

fn stiffness(found: &StiffnessReport) -> Plot {
    let deepest = found.curve.iter().fold(0.0_f64, |most, point| most.max(point.0));
    let (line, slope) = (&found.line, found.line.slope);
    // The line from where it meets no force to where the tip went.
    let from = (-line.intercept / slope).clamp(0.0, deepest);
    let name = format!("{:.1} N/mm, R² = {:.3}", slope * 1e-3, line.r_squared);
    let path = thinned(found.curve.iter().map(|(depth, force)| (depth * 1e3, *force)));
    Plot {
        title: "Force of a press".into(),
        x: Axis::of("Indentation (mm)").over(0.0, 1.02e3 * deepest),
        y: Axis::of("Normal force (N)"),
        marks: vec![
            Mark::Line(Style::named(Ink::Blue, "press"), path),
            fitted(line, (from, deepest), 1e3, name),
        ],
        size: (0.0, 280.0),
        ..Plot::default()
    }
}

#[cfg(test)]
pub(super) mod tests;
