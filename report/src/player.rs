//! The sound player of a page, with a description and a close-up of the strongest moment.

use super::figures::axis_label;
use super::plot::{Axis, Mark, Plot, Style};
use super::scale::plain;
use super::sound::{PEAK_DBFS, RATE_HZ, Sound};
use super::svg::escape;
use super::theme::Ink;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use haptograph_signal::quantity::Quantity;

/// Length of the close-up, s.
const CLOSE_UP_S: f64 = 0.05;

pub(super) fn section(sound: &Sound) -> String {
    let wav = STANDARD.encode(sound.to_wav());
    format!(
        "<audio controls=\"\" preload=\"metadata\" src=\"data:audio/wav;base64,{wav}\"></audio>\
         <p class=\"caption\">{}</p>{}",
        escape(&about(sound)),
        close_up(sound)
    )
}

/// Description of the sound and its processing.
fn about(sound: &Sound) -> String {
    let stream = &sound.stream;
    let simulated = if stream.simulated { ", simulated" } else { "" };
    let extent = match sound.of_s - sound.duration_s() > 1e-3 {
        true => format!("The first {:.0} s of {:.1} s of", sound.duration_s(), sound.of_s),
        false if stream.quantity == Quantity::ACCELERATION => "The vibration of".to_owned(),
        false => format!("The {} of", stream.quantity.name().unwrap_or("signal")),
    };
    let resampled = match stream.rate.hz() == f64::from(RATE_HZ) {
        true => String::new(),
        false => format!("resampled from {} to {RATE_HZ} Hz, ", stream.rate),
    };
    format!(
        "{extent} {}{simulated}: {resampled}without its mean, normalised to a peak of {} dB of full scale, so that its \
         loudness does not show its strength.",
        stream.name,
        plain(PEAK_DBFS),
    )
}

/// Plot of the samples around the strongest one.
fn close_up(sound: &Sound) -> String {
    let rate_hz = f64::from(RATE_HZ);
    let count = ((CLOSE_UP_S * rate_hz) as usize).min(sound.samples.len());
    let strongest = (0..sound.samples.len())
        .max_by(|a, b| sound.samples[*a].abs().total_cmp(&sound.samples[*b].abs()))
        .unwrap_or(0);
    let first = strongest.saturating_sub(count / 2).min(sound.samples.len() - count);
    let at = |i: usize| (first + i) as f64 / rate_hz;
    let value = |i: usize| f64::from(sound.samples[first + i]) * sound.full_scale;
    let most = 1.08 * sound.peak;
    Plot {
        title: format!("{}, 50 ms up close", sound.stream.name),
        note: if sound.stream.simulated { "simulated" } else { "" }.to_owned(),
        x: Axis::time().over(at(0), at(count)),
        y: Axis::of(axis_label(&sound.stream)).over(-most, most),
        marks: vec![Mark::Line(Style::of(Ink::Blue), (0..count).map(|i| (at(i), value(i))).collect())],
        caption: "The highest peak; click on a plot over time to show another moment.".to_owned(),
        ..Plot::default()
    }
    .to_close_up(rate_hz, sound.full_scale)
}
