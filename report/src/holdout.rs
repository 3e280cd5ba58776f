//! The page of a hold-out evaluation: first the result, then the tables that the terminal prints, and three
//! figures for each split.

pub mod tables;

use super::headlines::{Headline, cards};
use super::learning;
use super::page::{Sheet, figures_of};
use super::plot::{Axis, Mark, Plot, Style, Weight};
use super::table::Table;
use super::theme::Ink;
use haptograph_learning::evaluate::Holdout;
use haptograph_learning::evaluate::holdout::{
    BASELINES, BandMean, ContactResult, Mean, Measure, Method, MethodMean, SplitResult,
};
use tables::Measures;

/// The page as HTML.
pub fn page(title: &str, found: &Holdout, contact: &[ContactResult], simulated: bool) -> String {
    let splits = found.splits();
    let mut sections = vec![("", splits.first().map_or_else(String::new, result))];
    sections.extend(splits.iter().map(|split| (split.split.as_str(), section(found, split))));
    let contacts: String = tables::contacts(contact).iter().map(Table::to_html).collect();
    if !contacts.is_empty() {
        sections.push(("Taps, friction and stiffness", format!("{CONTACTS}{contacts}")));
    }
    let about = format!(
        "Textures learned from one part of a recording, tested on another part; {}, powers averaged over {} seeds of noise.",
        match found.materials.len() {
            1 => "1 material".to_owned(),
            count => format!("{count} materials"),
        },
        found.seeds
    );
    Sheet { title, about: &about, badge: learning::badge(simulated), warnings: &[], sections: &sections }
        .to_html()
}

/// Headlines of the first split: the default method, the floor, and the best plain baseline.
fn result(split: &SplitResult) -> String {
    let of = |label: &str, method: Method| {
        let found = split.methods.iter().find(|found| found.method == method)?;
        let Mean { mean, error, .. } = found.mean(Measure::Lsd)?;
        let error = error.map_or_else(String::new, |error| format!(" ± {error:.2}"));
        let title = match method {
            Method::Default => "log-spectral distance to the held-out part",
            other => other.title(),
        };
        let of = format!("{title}, {}", split.split.as_str());
        Some(Headline::new(label, format!("{mean:.2}{error} dB"), of))
    };
    let found = [
        of("Default", Method::Default),
        of("Best plain baseline", split.best_baseline),
        of("Floor", Method::Floor),
    ];
    cards(&found.into_iter().flatten().collect::<Vec<_>>())
}

fn section(found: &Holdout, split: &SplitResult) -> String {
    let materials: String = tables::materials(found, split).iter().map(Table::to_html).collect();
    let of = |measures: Measures| tables::methods(split, measures).map(|table| table.to_html());
    let seeds: String =
        [Measures::FirstOfSeeds, Measures::OthersOfSeeds].into_iter().filter_map(of).collect();
    let seeds = match seeds.as_str() {
        "" => seeds,
        _ => format!("<h3>Single seeds</h3>{seeds}{SEED_TERMS}"),
    };
    format!(
        "<p>Mean over materials ± standard error. LSD: root mean square over third octaves from 20 to 1000 Hz of the error of power, dB. \
         * worse than a plain baseline.</p>{}{TERMS}<p>{}</p>{}{materials}{}",
        of(Measures::All).unwrap_or_default(),
        tables::limits(split).replace('\n', " "),
        seeds,
        figures_of(&[signed_by_band(split), size_by_band(split), by_material(found, split)])
    )
}

/// Explanation of the column headers.
const TERMS: &str = "<p class=\"remark\"><b>floor</b>: the spectrum of the training part itself; a method that uses nothing but the material \
    is not expected to beat it by much; <b>over the floor</b>, <b>over the best plain</b>: LSD minus that of the floor, or of the best \
    plain baseline. <b>20-40 Hz</b> and <b>total</b>: error of the power there and of all of it, dB, positive if too loud. \
    <b>felt</b>: LSD from 40 to 250 Hz, where skin is most sensitive to vibration. <b>absolute</b>: mean size of \
    the error over bands, dB. \
    <b>misplaced</b>: energy in the wrong one of nine bands. <b>kurtosis</b>: error of the excess kurtosis. <b>envelope</b>: error of the \
    levels over 50 ms, dB, and in brackets the difference between two seeds of one texture. <b>NSE</b>, <b>PE</b>: normalized spectral error and \
    power error.</p>";

const SEED_TERMS: &str = "<p class=\"remark\">Errors of a rendering with one seed: mean over the seeds, in brackets their standard deviation. The floor is \
    a stretch of the training part as long as the shortest piece, as the mean over such stretches. <b>best</b>: method with the smallest error, the floor left out. –: a piece is shorter than 0.5 s, constant or below 1 kHz. \
    <b>modulation</b>: power of the 2 ms envelope over its mean in octaves from 2 to 128 Hz, dB. <b>autocorr.</b>: autocorrelation of that \
    envelope from 2 to 256 ms. <b>levels 5 ms</b>: seven quantiles of the levels over 5 ms, dB. <b>kurtosis</b>: ratio of excess + 1, octaves; samples \
    beyond the 99.9 % quantile are clipped. <b>crest</b>: crest factor, dB. <b>band corr.</b>: correlations between the 8 ms envelopes of \
    four bands from 30 to 1000 Hz. <b>spread 5 ms</b>, <b>spread 50 ms</b>: standard deviation of the levels over 5 and 50 ms, dB.</p>";

const CONTACTS: &str = "<p>Errors at held-out speeds and forces; in brackets the number of materials. * worse than a plain \
    alternative.</p>";

fn ink(method: Method) -> Ink {
    // The floor and the last baseline, which is dashed, have the colour that is left.
    let number = (method as usize).checked_sub(1);
    number.and_then(|number| Ink::CYCLE.get(number)).copied().unwrap_or(Ink::Grey)
}

fn signed_by_band(split: &SplitResult) -> Plot {
    Plot {
        title: "Too loud (+) or too soft, by third octave".into(),
        y: Axis::of("Error of power (dB)"),
        caption: "A curve at 0 is as loud as what was held out, in every band.".into(),
        ..by_band(split, |band| band.signed_db)
    }
}

fn size_by_band(split: &SplitResult) -> Plot {
    Plot {
        title: "Size of the error, by third octave".into(),
        y: Axis::of("Mean absolute error (dB)"),
        caption: "Errors of single parts, which cancel in the figure above where they differ in sign.".into(),
        ..by_band(split, |band| band.absolute_db)
    }
}

fn by_band(split: &SplitResult, error: fn(&BandMean) -> f64) -> Plot {
    let line = |method: &MethodMean| {
        let weight = if BASELINES.contains(&method.method) { Weight::Dashed } else { Weight::Normal };
        let style = Style::named(ink(method.method), method.method.title()).weight(weight);
        let points = method.by_band.iter().map(|band| (band.centre_hz, error(band)));
        Mark::Line(style, points.collect())
    };
    Plot {
        x: Axis::of("Frequency (Hz)").log(),
        marks: split.methods.iter().map(line).collect(),
        ..Plot::default()
    }
}

fn by_material(found: &Holdout, split: &SplitResult) -> Plot {
    let plain = |method: &MethodMean| BASELINES.contains(&method.method);
    let shown = || split.methods.iter().filter(|m| !plain(m) || m.method == split.best_baseline);
    let dots = |method: &MethodMean| {
        let ink = if plain(method) { Ink::Teal } else { ink(method.method) };
        let style = Style::named(ink, method.method.title()).weight(Weight::Bold);
        let points = method.by_material(Measure::Lsd).iter().enumerate();
        Mark::Dots(style, points.map(|(at, lsd)| (at as f64, *lsd)).collect())
    };
    let most =
        shown().flat_map(|method| method.by_material(Measure::Lsd)).fold(1.0_f64, |most, lsd| most.max(*lsd));
    let names = found.materials.iter().enumerate();
    Plot {
        title: "Log-spectral distance by material".into(),
        x: Axis::of("Material")
            .over(-0.5, found.materials.len() as f64 - 0.5)
            .named(names.map(|(at, name)| (at as f64, name.clone()))),
        y: Axis::of("LSD (dB)").over(0.0, 1.1 * most),
        marks: shown().map(dots).collect(),
        caption: "The lower a dot, the more the rendered vibration resembles the held-out part. Of the plain baselines the best is shown.".into(),
        ..Plot::default()
    }
}
