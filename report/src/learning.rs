//! The page that learning a surface leaves behind: what each part was learned from, and how well it fits.

mod fits;

use super::headlines::{Headline, cards};
use super::page::{Sheet, figures_of};
use super::plot::{Axis, Mark, Plot, Style, Weight};
use super::scale::{peak, plain};
use super::svg::escape;
use super::theme::Ink;
use super::{figures, loci, responses, texture_map};
use fits::{contacts, friction, stiffness};
use haptograph_signal::spectrum::welch;
use haptograph_signal::window::Window;
use haptograph_surfaces::evaluate::{Trajectory, synthesise};
use haptograph_surfaces::learning::LearningReport;
use haptograph_surfaces::learning::texture::{Fate, SegmentReport, TextureReport};
use haptograph_surfaces::recording::ProcessedRecording;
use haptograph_surfaces::{Origin, Surface, TextureModel, VertexKind};

/// The page.
pub fn page(surface: &Surface, report: &LearningReport) -> String {
    let simulated = is_simulated(surface);
    let made: String = surface
        .provenance
        .settings
        .iter()
        .map(|(name, value)| format!("<dt>{}</dt><dd>{}</dd>", escape(name), escape(value)))
        .collect();
    let warnings: Vec<String> = report.missing.iter().map(ToString::to_string).collect();
    let mut sections = sections(surface, report);
    sections.push((
        "",
        format!("<details><summary>How it was made</summary><dl>{made}</dl></details>"),
    ));
    let source = match surface.provenance.source.as_str() {
        tool @ ("recording tool" | "simulated recording tool") => format!("a {tool}"),
        source => source.to_owned(),
    };
    let about = format!("Learned by {} from {source}.", surface.provenance.version);
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
    let mut sections = vec![("", cards(&headlines(surface, report)))];
    if let (Some(texture), Some(found)) = (&surface.texture, &report.texture) {
        sections.push(("Texture map", figures_of(&[map(texture, found)])));
        sections.push((
            "What it was learned from",
            segments(surface, &report.drags, found),
        ));
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
    if let Some(texture) = &surface.texture {
        sections.push(("Between models", loci::section(texture)));
    }
    sections
}

/// What was learned, and from how much.
fn headlines(surface: &Surface, report: &LearningReport) -> Vec<Headline> {
    let mut found = Vec::new();
    if let (Some(texture), Some(learned)) = (&surface.texture, &report.texture) {
        let models = texture.models().iter().filter(|at| at.kind != VertexKind::Edge);
        let order = format!("of order {}", learned.order);
        found.push(Headline::new("Models", models.count().to_string(), order));
        let used: Vec<&SegmentReport> = learned.segments.iter().filter(|s| s.fate == Fate::Kept).collect();
        let rate_of = |s: &SegmentReport| report.drags.get(s.recording).map(|drag| drag.signals().rate_hz);
        let length = |s: &&SegmentReport| Some(s.samples.len() as f64 / rate_of(s)?);
        let used_s: f64 = used.iter().filter_map(length).sum();
        let all_s: f64 = (report.drags.iter())
            .map(|drag| drag.samples() as f64 / drag.signals().rate_hz)
            .sum();
        let of = format!("of {} s of dragging", plain(all_s));
        found.push(Headline::new("Used", format!("{} s", plain(used_s)), of));
        let range = |value: &dyn Fn(&SegmentReport) -> f64| {
            let values = used.iter().map(|s| value(s));
            let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            format!("{} to {}", plain(low), plain(high))
        };
        if !used.is_empty() {
            let speeds = format!("{} mm/s", range(&|s| 1e3 * s.speed_m_s));
            let forces = format!("{} N", range(&|s| s.force_n));
            found.push(Headline::new(
                "Speeds covered",
                speeds,
                "medians of what was used",
            ));
            found.push(Headline::new(
                "Forces covered",
                forces,
                "medians of what was used",
            ));
        }
    }
    if let Some(friction) = &report.friction {
        let fit = format!("mu, R² = {}", plain(friction.line.r_squared));
        found.push(Headline::new(
            "Friction coefficient",
            plain(friction.line.slope),
            fit,
        ));
    }
    if let Some(taps) = &report.taps {
        let used = taps.contacts.iter().filter(|contact| contact.used).count();
        found.push(Headline::new(
            "Taps",
            used.to_string(),
            format!("of {} contacts", taps.contacts.len()),
        ));
    }
    if let Some(press) = &report.stiffness {
        let stiffness = format!("{} N/mm", plain(1e-3 * press.line.slope));
        let fit = format!("R² = {}", plain(press.line.r_squared));
        found.push(Headline::new("Stiffness", stiffness, fit));
    }
    found
}

/// Acceleration with its breaks; speed and force with the medians that label the models (Fig. 2.5).
fn segments(surface: &Surface, drags: &[ProcessedRecording], found: &TextureReport) -> String {
    let mut plots = vec![];
    // The method of the thesis cuts where the vibration changes, the usual one at equal distances.
    let (piece, pieces) = match surface.provenance.settings.get("texture.method") {
        Some(method) if method == "thesis" => ("segment", "segments"),
        _ => ("window", "windows"),
    };
    for (number, drag) in drags.iter().enumerate() {
        let signals = drag.signals();
        let seconds = drag.samples() as f64 / signals.rate_hz;
        let of_drag: Vec<&SegmentReport> = found.segments.iter().filter(|s| s.recording == number).collect();
        let time_s = |sample: usize| sample as f64 / signals.rate_hz;
        let breaks = |low: f64, high: f64| {
            let at = of_drag.iter().skip(1).map(|s| time_s(s.samples.start));
            Mark::Segments(
                Style::named(Ink::Grey, format!("limit of a {piece}")).weight(Weight::Dashed),
                at.map(|t| [(t, low), (t, high)]).collect(),
            )
        };
        let plot = |title: String, note: String, label: &str, low: f64, high: f64, marks: Vec<Mark>| Plot {
            caption: match label {
                "Acceleration (m/s²)" => format!("The recorded vibration, cut into {pieces}."),
                _ => format!("A model is learned from each {piece}, for the median of the hand in it."),
            },
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
                &format!("median of a {piece} that is used"),
                value,
            )];
            if of_drag.iter().any(|s| s.fate != Fate::Kept) {
                marks.push(medians(
                    |fate| *fate != Fate::Kept,
                    Ink::Rose,
                    &format!("of a {piece} left out"),
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
        let note = format!("{} {pieces}, order {}", of_drag.len(), found.order);
        let loudest = 1.05 * peak(&signals.acceleration_m_s2);
        let acceleration = Mark::samples(
            Style::named(Ink::Blue, "acceleration"),
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
        let speed = Mark::samples(
            Style::named(Ink::Teal, "speed"),
            signals.rate_hz,
            &signals.speed_m_s,
            1e3,
        );
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
            Style::named(Ink::Plum, "force"),
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
    // Vertices at rest and in the air, which have no place on a logarithmic axis, stand at its beginning.
    let least = |value: &dyn Fn((f64, f64)) -> f64| {
        let values = texture
            .models()
            .iter()
            .map(|at| value((at.speed_m_s * 1e3, at.force_n)));
        0.7 * values.filter(|x| *x > 0.0).fold(f64::INFINITY, f64::min)
    };
    let (slowest, lightest) = (least(&|(speed, _)| speed), least(&|(_, force)| force));
    let into = |(speed, force): &mut (f64, f64)| (*speed, *force) = (speed.max(slowest), force.max(lightest));
    for mark in &mut marks {
        match mark {
            Mark::Areas(_, areas) => areas.iter_mut().flatten().for_each(into),
            Mark::Dots(_, points) => points.iter_mut().for_each(into),
            _ => {}
        }
    }
    Plot {
        title: "Models over speed and force".into(),
        note: format!("{} triangles", texture.triangles().len()),
        x: Axis::of("Speed (mm/s)").over(slowest, 1.05 * speed).log(),
        y: Axis::of("Normal force (N)").over(lightest, 1.05 * force).log(),
        marks,
        size: (0.0, 400.0),
        caption: format!(
            "Every dot is a model of the vibration at this speed and force; between dots it is mixed of those at the corners of the \
             triangle. {}",
            texture_map::legend(texture)
        ),
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
        Plot {
            caption: "It should be as strong as the recording at each moment; the noise in it is another."
                .to_owned(),
            ..over_time("Synthesised along the same speed and force", Ink::Orange, &played)
        },
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
        caption:
            "Where the curves lie on each other, what is played has the mean spectrum of what was recorded."
                .to_owned(),
        ..Plot::default()
    }
}

#[cfg(test)]
pub(super) mod tests;
