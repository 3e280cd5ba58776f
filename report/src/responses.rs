//! Responses of a surface: vibration to force and speed in the four conditions (Fig. 4.9), transients to taps
//! (Fig. 4.3).

use super::page::figures_of;
use super::plot::{Axis, Mark, Plot, Style, Weight};
use super::scale::{fixed, peak};
use super::table::grid;
use super::theme::Ink;
use super::{figures, texture_map, thinning::Decimated};
use haptograph_learning::evaluate::{Condition, Responses};
use haptograph_signal::spectrum::welch;
use haptograph_signal::window::Window;
use haptograph_surfaces::rendering::Trajectory;
use haptograph_surfaces::{Tap, Taps, TextureModel};

pub(super) fn section(texture: &TextureModel) -> String {
    let Ok(responses) = Responses::of(texture) else {
        return String::new();
    };
    let losses = responses.losses();
    let rows = losses.iter().map(|(condition, loss)| {
        vec![condition.symbol().to_owned(), fixed(loss.power, 3), fixed(loss.centroid_hz, 1)]
    });
    let head = ["condition", "power variation lost ((m/s²)²)", "spectral centroid variation lost (Hz)"];
    format!(
        "<p>Played along one random walk: responding to force and speed (FS), to force at a constant speed (F), to speed at a constant \
         force (S), and to neither (ϕ).</p>{}{}",
        figures_of(&plots(texture, &responses)),
        grid("", head.map(str::to_owned).into_iter(), rows)
    )
}

fn plots(texture: &TextureModel, responses: &Responses) -> Vec<Plot> {
    let (speed, force) = (texture.max_speed_m_s() * 1e3, texture.max_force_n());
    let mut path = Decimated::new(1200);
    let hand = &responses.hand;
    hand.speed_m_s.iter().zip(&hand.force_n).for_each(|(v, f)| path.push((v * 1e3, *f)));
    let (centre_speed, centre_force) = (responses.centre.0 * 1e3, responses.centre.1);
    let mut marks = figures::triangulation(texture);
    marks.extend([
        Mark::Line(Style::named(Ink::Orange, "FS"), path.kept().to_vec()),
        Mark::Line(Style::named(Ink::Teal, "F"), vec![(centre_speed, 0.0), (centre_speed, force)]),
        Mark::Line(Style::named(Ink::Plum, "S"), vec![(0.0, centre_force), (speed, centre_force)]),
        Mark::Dots(Style::named(Ink::Rose, "ϕ").weight(Weight::Bold), vec![(centre_speed, centre_force)]),
    ]);
    let mut plots = vec![Plot {
        title: "Where the conditions are on the map".into(),
        x: Axis::of("Speed (mm/s)").over(-0.015 * speed, 1.015 * speed),
        y: Axis::of("Normal force (N)").over(-0.02 * force, 1.02 * force),
        marks,
        size: (0.0, 330.0),
        caption: "Each condition plays the models along its line: a line that crosses less of the map gives a vibration that follows \
                  the hand less."
            .to_owned(),
        ..Plot::default()
    }];
    let loudest = 1.05 * responses.played.iter().map(|(_, played)| peak(played)).fold(0.0, f64::max);
    let inks = [Ink::Orange, Ink::Teal, Ink::Plum, Ink::Rose];
    let seconds = hand.speed_m_s.len() as f64 / hand.rate_hz;
    for ((condition, played), ink) in responses.played.iter().zip(inks) {
        let along = condition.trajectory(hand, responses.centre);
        let mut marks = beyond(texture, &along, loudest).into_iter().collect::<Vec<_>>();
        marks.push(Mark::samples(Style::of(ink), hand.rate_hz, played, 1.0));
        plots.push(Plot {
            title: condition.symbol().into(),
            caption: what(*condition).to_owned(),
            x: Axis::of("Time (s)").over(0.0, seconds),
            y: Axis::of("Acceleration (m/s²)").over(-loudest, loudest),
            marks,
            size: (0.0, 130.0),
            ..Plot::default()
        });
    }
    plots
}

/// The times at which a motion is faster or harder than what was recorded, as areas up to a height.
fn beyond(texture: &TextureModel, along: &Trajectory, height: f64) -> Option<Mark> {
    let (speed_mm_s, force_n) = texture_map::recorded(texture);
    let both = along.speed_m_s.iter().zip(&along.force_n);
    let is_beyond: Vec<bool> = both.map(|(v, f)| 1e3 * v > speed_mm_s || *f > force_n).collect();
    let mut end_s = 0.0;
    let spans = is_beyond.chunk_by(|a, b| a == b).filter_map(|run| {
        let start_s = end_s;
        end_s += run.len() as f64 / along.rate_hz;
        let corners = [(start_s, -height), (end_s, -height), (end_s, height), (start_s, height)];
        run[0].then(|| corners.to_vec())
    });
    let spans: Vec<_> = spans.collect();
    (!spans.is_empty()).then(|| Mark::Areas(Style::named(Ink::Grey, "beyond what was recorded"), spans))
}

fn what(condition: Condition) -> &'static str {
    match condition {
        Condition::ForceAndSpeed => "Follows the force and the speed of the hand.",
        Condition::Force => "Follows the force only.",
        Condition::Speed => "Follows the speed only.",
        Condition::Neither => "Follows neither.",
    }
}

/// A few taps from the slowest to the fastest, with their colours.
fn chosen(taps: &Taps) -> Vec<(&Tap, Ink)> {
    const MAX: usize = 4;
    let last = taps.taps().len() - 1;
    let count = MAX.min(last + 1);
    let number = |i: usize| if count > 1 { i * last / (count - 1) } else { 0 };
    (0..count).map(|i| (&taps.taps()[number(i)], Ink::number(i))).collect()
}

fn name(tap: &Tap) -> String {
    format!("{:.0} mm/s", tap.speed_m_s * 1e3)
}

pub(super) fn tap_waves(taps: &Taps) -> Plot {
    let wave = |(tap, ink): (&Tap, Ink)| {
        let points =
            tap.acceleration_m_s2.iter().enumerate().map(|(i, a)| (1e3 * i as f64 / taps.rate_hz(), *a));
        Mark::Line(Style::named(ink, name(tap)), points.collect())
    };
    Plot {
        title: "Transients by incoming speed".into(),
        note: format!("{} taps", taps.taps().len()),
        x: Axis::of("Time after contact (ms)"),
        y: Axis::of("Acceleration (m/s²)"),
        // The fastest tap is the loudest and is drawn first.
        marks: chosen(taps).into_iter().rev().map(wave).collect(),
        size: (0.0, 240.0),
        caption: "The transient played at a contact is stronger for a faster tip.".to_owned(),
        ..Plot::default()
    }
}

pub(super) fn tap_spectra(taps: &Taps) -> Plot {
    let highest_hz = (0.5 * taps.rate_hz()).min(1000.0);
    let spectrum = |(tap, ink): (&Tap, Ink)| {
        let samples = &tap.acceleration_m_s2;
        let psd = welch(samples, taps.rate_hz(), samples.len(), 0, Window::Rectangular).ok()?;
        let points = psd.frequency_hz.iter().copied().zip(psd.density.iter().copied());
        let shown = points.filter(|(f, d)| *f > 0.0 && *f <= highest_hz && *d > 0.0);
        Some(Mark::Line(Style::named(ink, name(tap)), shown.collect()))
    };
    Plot {
        title: "Their spectra".into(),
        x: Axis::of("Frequency (Hz)").over(0.0, highest_hz),
        y: Axis::of("Density ((m/s²)²/Hz)").log(),
        marks: chosen(taps).into_iter().filter_map(spectrum).collect(),
        size: (0.0, 240.0),
        caption: "A hard material rings at high frequencies, a soft one at low.".to_owned(),
        ..Plot::default()
    }
}
