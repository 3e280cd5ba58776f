//! From what was recorded to plots: each kind of signal in the form in which it is read at a glance.

use super::plot::{Axis, Image, Mark, Plot, Style, Weight};
use super::raster::Grid;
use super::record::{Content, Recorded, Spectra};
use super::theme::Ink;
use haptograph_engine::frame::Kind;
use haptograph_signal::quantity::Quantity;
use haptograph_surfaces::{TextureModel, VertexKind};

/// The unit that a quantity is shown in, and what SI values are multiplied by: millimetres where the field uses them.
pub fn shown_in(quantity: Quantity) -> (String, f64) {
    match quantity {
        Quantity::LENGTH => ("mm".to_owned(), 1e3),
        Quantity::SPEED => ("mm/s".to_owned(), 1e3),
        Quantity::TORQUE => ("N mm".to_owned(), 1e3),
        Quantity::STIFFNESS => ("N/mm".to_owned(), 1e-3),
        Quantity::ACCELERATION => ("m/s²".to_owned(), 1.0),
        Quantity::NUMBER => (String::new(), 1.0),
        other => (other.unit(), 1.0),
    }
}

/// `Force (N)`, by the quantity.
pub(super) fn axis_label(quantity: Quantity) -> String {
    let (unit, _) = shown_in(quantity);
    let name = quantity.name().unwrap_or("value");
    let name = if quantity == Quantity::NUMBER {
        "value"
    } else {
        name
    };
    let mut letters = name.chars();
    let capital = letters
        .next()
        .map(|c| c.to_uppercase().collect::<String>())
        .unwrap_or_default();
    let name = capital + letters.as_str();
    if unit.is_empty() {
        name
    } else {
        format!("{name} ({unit})")
    }
}

fn note(recorded: &Recorded) -> String {
    let simulated = if recorded.stream.simulated {
        "simulated, "
    } else {
        ""
    };
    format!("{simulated}{}", recorded.stream.rate)
}

/// The plots of one signal over time, `ink` telling it from its neighbours.
pub fn over_time(recorded: &Recorded, ink: Ink) -> Vec<Plot> {
    let name = &recorded.stream.name;
    let quantity = recorded.stream.quantity;
    let end_s = recorded.duration_s().max(1e-9);
    let plot = |title: String, y: Axis, marks: Vec<Mark>| Plot {
        title,
        note: note(recorded),
        x: Axis::of("Time (s)").over(0.0, end_s),
        y,
        marks,
        ..Plot::default()
    };
    match &recorded.content {
        Content::Lanes(lanes, spectra) => {
            let groups: &[(&str, std::ops::Range<usize>, Quantity)] = match recorded.stream.kind {
                Kind::Wrench => &[
                    (" force", 0..3, Quantity::FORCE),
                    (" torque", 3..6, Quantity::TORQUE),
                ],
                Kind::Vector => &[("", 0..3, quantity)],
                _ => &[("", 0..1, quantity)],
            };
            let mut plots = Vec::new();
            for (suffix, range, quantity) in groups {
                let (_, factor) = shown_in(*quantity);
                let marks = range
                    .clone()
                    .zip(["x", "y", "z"])
                    .zip([ink, Ink::Orange, Ink::Teal])
                    .filter_map(|((lane, axis), lane_ink)| {
                        let lane_ink = if range.len() == 1 {
                            ink
                        } else if axis == "x" {
                            Ink::Blue
                        } else {
                            lane_ink
                        };
                        let style = if range.len() == 1 {
                            Style::of(lane_ink)
                        } else {
                            Style::named(lane_ink, axis)
                        };
                        lanes
                            .get(lane)
                            .map(|envelope| Mark::signal(style, envelope, factor))
                    });
                plots.push(plot(
                    format!("{name}{suffix}"),
                    Axis::of(axis_label(*quantity)),
                    marks.collect(),
                ));
            }
            if let Some(spectra) = spectra {
                let mut spectra = spectra.as_ref().clone();
                spectra.finish();
                plots.extend(spectrogram(recorded, &spectra));
            }
            plots
        }
        Content::Contact(depth, _) => {
            let marks = vec![Mark::signal(Style::of(ink), depth, 1e3)];
            vec![plot(
                format!("{name}, penetration"),
                Axis::of("Penetration (mm)"),
                marks,
            )]
        }
        Content::Events(points, count) => {
            let (_, factor) = shown_in(quantity);
            let stems = points
                .kept()
                .iter()
                .map(|(t, v)| [(*t, 0.0), (*t, v * factor)])
                .collect();
            let heads = points.kept().iter().map(|(t, v)| (*t, v * factor)).collect();
            let marks = vec![
                Mark::Segments(Style::of(ink), stems),
                Mark::Dots(Style::of(ink), heads),
            ];
            vec![plot(
                format!("{name}, {count} events"),
                Axis::of(axis_label(quantity)),
                marks,
            )]
        }
        Content::Map(_) | Content::Nothing => Vec::new(),
    }
}

/// Touch ends near 1 kHz; what lies above twice that is left out of spectrograms.
const HIGHEST_SHOWN_HZ: f64 = 2000.0;
/// Decibels below the loudest that are still told apart.
const DEPTH_DB: f64 = 60.0;

fn spectrogram(recorded: &Recorded, spectra: &Spectra) -> Option<Plot> {
    let bin_hz = spectra.bin_hz();
    let bins = spectra
        .columns()
        .first()?
        .len()
        .min((HIGHEST_SHOWN_HZ / bin_hz) as usize + 1);
    let width = spectra.columns().len();
    let decibel = |density: f64| 10.0 * density.max(1e-300).log10();
    let rows = (0..bins).flat_map(|bin| spectra.columns().iter().map(move |column| decibel(column[bin])));
    let values: Vec<f64> = rows.collect();
    let loudest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if loudest <= decibel(0.0) {
        return None; // silence
    }
    let unit = shown_in_si(recorded.stream.quantity);
    Some(Plot {
        title: format!("{}, spectrogram", recorded.stream.name),
        note: note(recorded),
        x: Axis::of("Time (s)").over(0.0, recorded.duration_s()),
        y: Axis::of("Frequency (Hz)").over(0.0, (bins as f64 - 0.5) * bin_hz),
        marks: vec![Mark::Image(Image {
            cells: Grid {
                width,
                height: bins,
                values,
            },
            x: (0.0, spectra.duration_s()),
            y: (-0.5 * bin_hz, (bins as f64 - 0.5) * bin_hz),
            colours: (loudest - DEPTH_DB, loudest),
            label: format!("Density (dB re 1 ({unit})²/Hz)"),
        })],
        size: (0.0, 250.0),
    })
}

fn shown_in_si(quantity: Quantity) -> String {
    quantity.unit().replace("s2", "s²")
}

/// The mean spectrum of a signal that has one.
pub fn mean_spectrum(recorded: &Recorded, ink: Ink) -> Option<Plot> {
    let Content::Lanes(_, Some(spectra)) = &recorded.content else {
        return None;
    };
    let mut spectra = spectra.as_ref().clone();
    spectra.finish();
    let mean = spectra.mean();
    let points: Vec<(f64, f64)> = mean
        .iter()
        .enumerate()
        .skip(1)
        .map(|(i, d)| (i as f64 * spectra.bin_hz(), *d))
        .filter(|p| p.1 > 0.0)
        .collect();
    let loudest = points.iter().map(|p| p.1).fold(0.0, f64::max);
    let last_hz = points.last()?.0;
    Some(Plot {
        title: format!("{}, mean spectrum", recorded.stream.name),
        note: note(recorded),
        x: Axis::of("Frequency (Hz)").over(points[0].0, last_hz).log(),
        y: Axis::of(format!(
            "Density (({})²/Hz)",
            shown_in_si(recorded.stream.quantity)
        ))
        .over(loudest * 10f64.powf(-DEPTH_DB / 10.0), loudest * 2.0)
        .log(),
        marks: vec![Mark::Line(Style::of(ink), points)],
        size: (0.0, 230.0),
    })
}

/// Where hands went on a texture's map of speed and force (Fig. 2.8, 4.9), over its triangles where they are known: named
/// strokes, of one signal in one run or in several.
pub fn strokes_on_map(strokes: &[(&str, &Recorded)], texture: Option<&TextureModel>) -> Option<Plot> {
    let (_, first) = strokes.first()?;
    let paths = strokes
        .iter()
        .filter_map(|(name, recorded)| match &recorded.content {
            Content::Map(points) => {
                let path = points.kept().iter().map(|(v, f)| (v * 1e3, *f));
                Some((*name, path.collect::<Vec<_>>()))
            }
            _ => None,
        });
    let paths: Vec<_> = paths.collect();
    if paths.is_empty() {
        return None;
    }
    let mut plot = Plot {
        title: format!("The stroke over speed and force, {}", first.stream.name),
        note: if first.stream.simulated {
            "simulated".to_owned()
        } else {
            String::new()
        },
        x: Axis::of("Speed (mm/s)"),
        y: Axis::of("Normal force (N)"),
        marks: Vec::new(),
        size: (0.0, 380.0),
    };
    if let Some(texture) = texture {
        let (speed, force) = (texture.max_speed_m_s() * 1e3, texture.max_force_n());
        plot.x = plot.x.over(-0.015 * speed, 1.015 * speed);
        plot.y = plot.y.over(-0.02 * force, 1.02 * force);
        plot.marks.extend(triangulation(texture));
    }
    // One stroke is orange over blue models; several begin there.
    for (number, (name, path)) in paths.into_iter().enumerate() {
        let ink = Ink::number(number + 1);
        let line = Style::named(ink, name).weight(Weight::Hair);
        plot.marks.push(Mark::Line(line, path.clone()));
        plot.marks
            .push(Mark::Dots(Style::of(ink).weight(Weight::Hair), path));
    }
    Some(plot)
}

/// The triangles of a texture and its models, those of each kind that there are: measured, of a law, extending it to the border.
pub fn triangulation(texture: &TextureModel) -> Vec<Mark> {
    let at = |i: usize| {
        let model = &texture.models()[i];
        (model.speed_m_s * 1e3, model.force_n)
    };
    let triangles = texture
        .triangles()
        .iter()
        .map(|t| t.iter().map(|i| at(*i as usize)).collect())
        .collect();
    let of = |kind: VertexKind| {
        (0..texture.models().len())
            .filter(|i| texture.models()[*i].kind == kind)
            .map(at)
            .collect::<Vec<_>>()
    };
    let kinds = [
        (Style::named(Ink::Grey, "border"), VertexKind::Edge),
        (
            Style::named(Ink::Blue, "model").weight(Weight::Bold),
            VertexKind::Measured,
        ),
        (Style::named(Ink::Blue, "law"), VertexKind::Fitted),
    ];
    let dots = kinds.into_iter().map(|(style, kind)| (style, of(kind)));
    let dots = dots.filter(|(_, places)| !places.is_empty());
    std::iter::once(Mark::Areas(Style::of(Ink::Grey), triangles))
        .chain(dots.map(|(style, places)| Mark::Dots(style, places)))
        .collect()
}

/// Where the proxy went while it touched, seen from above.
pub fn contact_path(recorded: &Recorded) -> Option<Plot> {
    let Content::Contact(_, path) = &recorded.content else {
        return None;
    };
    let points: Vec<_> = path.kept().iter().map(|p| (p[0] * 1e3, p[1] * 1e3)).collect();
    (!points.is_empty()).then(|| Plot {
        title: format!("Where it touched ({})", recorded.stream.name),
        note: note(recorded),
        x: Axis::of("x (mm)"),
        y: Axis::of("y (mm)"),
        marks: vec![Mark::Dots(Style::of(Ink::Teal).weight(Weight::Hair), points)],
        size: (0.0, 320.0),
    })
}
