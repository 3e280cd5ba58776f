//! The page of textures on parts of recordings that they were not learned from: a table and two figures for each split.

use super::learning;
use super::page::{Sheet, figures_of};
use super::plot::{Axis, Mark, Plot, Style, Weight};
use super::scale::fixed;
use super::svg::escape;
use super::theme::Ink;
use haptograph_surfaces::evaluate::Holdout;
use haptograph_surfaces::evaluate::holdout::{Mean, Method, MethodMean, SplitResult};

/// The page.
pub fn page(title: &str, found: &Holdout, simulated: bool) -> String {
    let splits = found.splits();
    let sections: Vec<(&str, String)> = splits
        .iter()
        .map(|split| (split.split.as_str(), section(found, split)))
        .collect();
    let about = format!(
        "What is learned from one part of a recording against another part, {} materials, powers of {} seeds of noise averaged.",
        found.materials.len(),
        found.seeds
    );
    Sheet {
        title,
        about: &about,
        badge: learning::badge(simulated),
        warnings: &[],
        sections: &sections,
    }
    .to_html()
}

fn section(found: &Holdout, split: &SplitResult) -> String {
    let rows: String = split.methods.iter().map(row).collect();
    format!(
        "<p>Mean over materials ± standard error. LSD: root mean square over third octaves from 20 to 1000 Hz of the error of power. Two \
         stationary takes as long as these parts are {:.2} dB apart.</p>\
         <div class=\"scroll\"><table class=\"grid\"><tr><th></th><th>LSD (dB)</th><th>over the floor</th><th>100 to 500 Hz</th><th>felt</th>\
         <th>20 to 40 Hz</th><th>total</th><th>envelope</th><th>envelope between seeds</th></tr>{rows}</table></div>{TERMS}{}",
        split.estimator_db.0,
        figures_of(&[by_band(split), by_material(found, split)])
    )
}

/// What the heads of the table mean.
const TERMS: &str = "<p class=\"remark\"><b>floor</b>: the training part's own spectrum, which no method that knows the material \
    alone can be expected to beat by much; <b>over the floor</b>: LSD less the floor's. <b>felt</b>: LSD from 40 to 250 Hz, which skin feels \
    best. <b>20 to 40 Hz</b> and <b>total</b>: error of the power there and of all of it, positive where too loud. \
    <b>envelope</b>: error of the levels over 50 ms, and <b>between seeds</b> what two noises of one texture differ by.</p>";

fn row(method: &MethodMean) -> String {
    let loses = if method.loses {
        ": <b>loses to a plain baseline</b>"
    } else {
        ""
    };
    let shown = |mean: Option<Mean>| match mean {
        Some(Mean {
            mean,
            error: Some(error),
        }) => format!("<td>{} ± {error:.2}</td>", fixed(mean, 2)),
        Some(Mean { mean, error: None }) => format!("<td>{}</td>", fixed(mean, 2)),
        None => "<td>–</td>".to_owned(),
    };
    let cells = [
        Some(method.lsd_db),
        Some(method.above_floor_db),
        method.middle_lsd_db,
        Some(method.pacinian_lsd_db),
        method.low_db,
        Some(method.total_db),
        method.envelope_db,
        method.envelope_floor_db,
    ];
    format!(
        "<tr><td>{}{loses}</td>{}</tr>",
        escape(method.method.title()),
        cells.map(shown).concat()
    )
}

fn ink(method: Method) -> Ink {
    if method == Method::Floor {
        Ink::Grey
    } else {
        Ink::CYCLE[(method as usize - 1) % Ink::CYCLE.len()]
    }
}

fn by_band(split: &SplitResult) -> Plot {
    let line = |method: &MethodMean| {
        let style = Style::named(ink(method.method), method.method.title());
        Mark::Line(style, method.signed_db.clone())
    };
    Plot {
        title: "Too loud (+) or too soft, by third octave".into(),
        x: Axis::of("Frequency (Hz)").log(),
        y: Axis::of("Error of power (dB)"),
        marks: split.methods.iter().map(line).collect(),
        caption: "A curve at 0 is as loud as what was held out, in every band.".into(),
        ..Plot::default()
    }
}

fn by_material(found: &Holdout, split: &SplitResult) -> Plot {
    let dots = |method: &MethodMean| {
        let style = Style::named(ink(method.method), method.method.title()).weight(Weight::Bold);
        let points = method.lsd_by_material.iter().enumerate();
        Mark::Dots(style, points.map(|(at, lsd)| (at as f64, *lsd)).collect())
    };
    let values = split.methods.iter().flat_map(|method| &method.lsd_by_material);
    let most = values.fold(1.0_f64, |most, lsd| most.max(*lsd));
    let names = found.materials.iter().enumerate();
    Plot {
        title: "Log-spectral distance by material".into(),
        x: Axis::of("Material")
            .over(-0.5, found.materials.len() as f64 - 0.5)
            .named(names.map(|(at, name)| (at as f64, name.clone()))),
        y: Axis::of("LSD (dB)").over(0.0, 1.1 * most),
        marks: split.methods.iter().map(dots).collect(),
        caption: "The lower a dot, the more what is played is like what was held out.".into(),
        ..Plot::default()
    }
}
