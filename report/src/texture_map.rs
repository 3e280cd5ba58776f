//! A texture's map of speed and force with the strokes of a run.

use super::plot::{Axis, Mark, Plot, Style, Weight};
use super::record::{Content, Recorded};
use super::theme::Ink;
use haptograph_surfaces::{TextureModel, VertexKind};

/// Named strokes of one signal, in one run or in several, on a texture's map of speed and force (Fig. 2.8,
/// 4.9), over its triangles if they are known.
pub(crate) fn strokes_on_map(strokes: &[(&str, &Recorded)], texture: Option<&TextureModel>) -> Option<Plot> {
    let (_, first) = strokes.first()?;
    let paths = strokes.iter().filter_map(|(name, recorded)| match &recorded.content {
        Content::Map(points) => {
            let path = points.kept().iter().map(|(v, f)| on_surface(v * 1e3, *f));
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
        note: if first.stream.simulated { "simulated".to_owned() } else { String::new() },
        x: Axis::of("Speed (mm/s)"),
        y: Axis::of("Normal force (N)"),
        size: (0.0, 380.0),
        caption: STROKES.to_owned(),
        ..Plot::default()
    };
    if let Some(texture) = texture {
        let (speed, force) = extent(texture, paths.iter().flat_map(|(_, path)| path));
        plot.x = plot.x.over(-0.015 * speed, 1.05 * speed);
        plot.y = plot.y.over(-0.02 * force, 1.05 * force);
        plot.marks.extend(triangulation(texture));
        plot.caption = format!("{STROKES} {}", legend(texture));
    }
    for (number, (name, path)) in paths.into_iter().enumerate() {
        let ink = Ink::of_run(number);
        let line = Style::named(ink, name).weight(Weight::Hair);
        plot.marks.push(Mark::Line(line, path.clone()));
        plot.marks.push(Mark::Dots(Style::of(ink).weight(Weight::Hair), path));
    }
    Some(plot)
}

const STROKES: &str = "Each point of the map has its own vibration, interpolated from the models at the corners of its triangle. The \
    curve is the stroke of the hand; it is interrupted without contact.";

/// A point on the map; NaN without contact.
fn on_surface(speed_mm_s: f64, force_n: f64) -> (f64, f64) {
    match force_n > 0.0 {
        true => (speed_mm_s, force_n),
        false => (f64::NAN, f64::NAN),
    }
}

/// The largest speed in mm/s and force in N of the strokes and of the recording. The map itself extends far
/// beyond.
fn extent<'a>(texture: &TextureModel, strokes: impl Iterator<Item = &'a (f64, f64)>) -> (f64, f64) {
    let (speed, force) = strokes.fold(recorded(texture), |most, at| (most.0.max(at.0), most.1.max(at.1)));
    let or = |value: f64, whole: f64| if value > 0.0 { value } else { whole };
    (or(speed, texture.max_speed_m_s() * 1e3), or(force, texture.max_force_n()))
}

/// The largest speed in mm/s and force in N of models within what was recorded.
pub(super) fn recorded(texture: &TextureModel) -> (f64, f64) {
    let recorded = texture.models().iter().filter(|at| at.kind != VertexKind::Edge);
    recorded.fold((0.0, 0.0), |most, at| (most.0.max(at.speed_m_s * 1e3), most.1.max(at.force_n)))
}

/// Explanation of the colours of models.
pub(super) fn legend(texture: &TextureModel) -> &'static str {
    match texture.models().iter().any(|at| at.kind == VertexKind::Fitted) {
        true => "Blue dots: models within what was recorded; grey: continued by the law.",
        false => "Blue dots: models of what was recorded; grey: beyond it, filters of these models.",
    }
}

/// The triangles and models of a texture by kind: measured, continued by the law, and at the border.
pub fn triangulation(texture: &TextureModel) -> Vec<Mark> {
    let at = |i: usize| {
        let model = &texture.models()[i];
        (model.speed_m_s * 1e3, model.force_n)
    };
    let triangles = texture.triangles().iter().map(|t| t.iter().map(|i| at(*i as usize)).collect()).collect();
    let of = |kind: VertexKind| {
        (0..texture.models().len()).filter(|i| texture.models()[*i].kind == kind).map(at).collect::<Vec<_>>()
    };
    let kinds = [
        (Style::named(Ink::Grey, "beyond what was recorded"), VertexKind::Edge),
        (Style::named(Ink::Blue, "recorded").weight(Weight::Bold), VertexKind::Measured),
        (Style::named(Ink::Blue, "within what was recorded"), VertexKind::Fitted),
    ];
    let dots = kinds.into_iter().map(|(style, kind)| (style, of(kind)));
    let dots = dots.filter(|(_, places)| !places.is_empty());
    std::iter::once(Mark::Areas(Style::of(Ink::Grey), triangles))
        .chain(dots.map(|(style, places)| Mark::Dots(style, places)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Reduction;
    use haptograph_engine::frame::{OneKind, Record as _};
    use haptograph_engine::node::Stream;
    use haptograph_nodes::texture::frames::Weights;
    use haptograph_signal::quantity::Quantity;
    use haptograph_signal::time::Rate;

    #[test]
    fn the_map_shows_what_was_recorded_and_the_stroke_is_broken_in_the_air() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/surfaces/t3-tile.ron");
        let texture = haptograph_surfaces::files::load(&path).unwrap().texture.unwrap();
        let mut recorded = Recorded::of(Stream {
            name: "locate.weights".into(),
            kind: Weights::KIND,
            quantity: Quantity::NUMBER,
            rate: Rate::from_hz(240).unwrap(),
            simulated: true,
        });
        for (speed_m_s, force_n) in [(0.1, 1.0), (0.1, 0.0), (0.12, 1.5)] {
            let weights = Weights { speed_m_s, force_n, ..Weights::default() };
            recorded.extend(&weights.to_components());
        }
        let plot = strokes_on_map(&[("stroke", &recorded)], Some(&texture)).unwrap();
        let stroke = plot.marks.iter().find_map(|mark| match mark {
            Mark::Line(_, points) => Some(points),
            _ => None,
        });
        let broken = stroke.unwrap().iter().map(|(speed, _)| speed.is_nan());
        assert_eq!(broken.collect::<Vec<_>>(), [false, true, false]);
        let (_, fastest) = plot.x.range.unwrap();
        let recorded = texture.models().iter().filter(|at| at.kind != VertexKind::Edge);
        let recorded = recorded.map(|at| 1e3 * at.speed_m_s).fold(120.0, f64::max);
        assert!((fastest - 1.05 * recorded).abs() < 1e-9, "{fastest}");
    }
}
