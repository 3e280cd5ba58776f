//! Plots of recorded signals, each kind in a suitable form.

use super::plot::{Axis, Image, Mark, Plot, Style, Weight};
use super::raster::Grid;
use super::record::{Content, Recorded, SPECTRAL_RATE_HZ};
use super::scale::plain;
use super::spectra::{SHOWN_HZ, Spectra, receptors, top_with_receptors};
use super::theme::Ink;
use super::thinning::Envelope;
use haptograph_engine::frame::Kind;
use haptograph_engine::node::Stream;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units;

pub(crate) use super::texture_map::strokes_on_map;
pub use super::texture_map::triangulation;

/// Display unit of a quantity: for example millimetres and degrees Celsius.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// The symbol; empty for plain numbers.
    pub symbol: String,
    factor: f64,
    offset: f64,
}

impl Unit {
    /// The display unit of a quantity.
    pub fn of(quantity: Quantity) -> Self {
        let (symbol, si, offset) = match quantity {
            Quantity::TEMPERATURE => ("°C".to_owned(), 1.0, -273.15),
            Quantity::NUMBER => (String::new(), 1.0, 0.0),
            other => {
                let (symbol, si) = units::shown(other);
                (symbol, si, 0.0)
            }
        };
        Self { symbol, factor: 1.0 / si, offset }
    }

    /// Converts an SI value to this unit.
    pub(crate) fn show(&self, si: f64) -> f64 {
        si * self.factor + self.offset
    }

    /// Formats an SI value in this unit with three digits and the symbol.
    pub(super) fn text(&self, si: f64) -> String {
        let value = plain(self.show(si));
        match self.symbol.as_str() {
            "" => value,
            symbol => format!("{value} {symbol}"),
        }
    }
}

/// Name of a quantity: `Force`.
pub(super) fn quantity_name(quantity: Quantity) -> String {
    let name = match quantity {
        Quantity::NUMBER => "value",
        other => other.name().unwrap_or("value"),
    };
    capitalised(name)
}

/// Axis label of a signal: `Force (N)`, `Position (mm)`; of a plain number its own name, `Trim (1)`.
pub(super) fn axis_label(stream: &Stream) -> String {
    match (stream.quantity, stream.kind) {
        (Quantity::NUMBER, _) => format!("{} (1)", capitalised(&stream.name)),
        (Quantity::LENGTH, kind) if kind == Kind::VECTOR => with_unit("Position", Quantity::LENGTH),
        (quantity, _) => with_unit(&quantity_name(quantity), quantity),
    }
}

fn with_unit(name: &str, quantity: Quantity) -> String {
    match Unit::of(quantity).symbol.as_str() {
        "" => name.to_owned(),
        symbol => format!("{name} ({symbol})"),
    }
}

/// Axis label of a number that is always 0 or 1.
pub(super) fn switch_label(name: &str) -> String {
    format!("{} (0 or 1)", capitalised(name))
}

/// The text with a capital first letter.
pub(super) fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Unit of the power spectral density of a quantity: `A²/Hz`, `(m/s²)²/Hz`.
fn density_unit(quantity: Quantity) -> String {
    let unit = quantity.unit().replace("s2", "s²");
    match unit.chars().all(char::is_alphabetic) {
        true => format!("{unit}²/Hz"),
        false => format!("({unit})²/Hz"),
    }
}

fn note(recorded: &Recorded) -> String {
    let simulated = if recorded.stream.simulated { "simulated, " } else { "" };
    format!("{simulated}{}", recorded.stream.rate)
}

/// The plots of one signal over time, in the colour `ink`.
pub fn over_time(recorded: &Recorded, ink: Ink) -> Vec<Plot> {
    match &recorded.content {
        Content::Components(envelopes, spectra) => {
            let mut plots = components(recorded, envelopes, ink);
            if let Some(spectra) = spectra {
                let mut spectra = spectra.as_ref().clone();
                spectra.finish();
                plots.extend(spectrogram(recorded, &spectra));
            }
            plots
        }
        Content::Contact(depth, _) => vec![Plot {
            title: format!("{}, penetration", recorded.stream.name),
            y: Axis::of("Penetration (mm)"),
            marks: vec![Mark::signal(Style::of(ink), depth, |metres| 1e3 * metres)],
            caption: "Depth of the tip in the surface; 0 in the air.".to_owned(),
            ..frame(recorded)
        }],
        Content::Events(points, count) => vec![events(recorded, points.kept(), *count, ink)],
        Content::Map(_) | Content::Nothing => Vec::new(),
    }
}

fn frame(recorded: &Recorded) -> Plot {
    Plot {
        title: recorded.stream.name.clone(),
        note: note(recorded),
        x: Axis::time().over(0.0, recorded.duration_s().max(1e-9)),
        ..Plot::default()
    }
}

/// Components in one plot.
const IN_A_PLOT: usize = 3;

/// Number of leading plots, among those of a signal over time, that show its values.
pub(super) fn components_of(recorded: &Recorded) -> usize {
    match &recorded.content {
        Content::Components(envelopes, _) => envelopes.len().div_ceil(IN_A_PLOT),
        _ => 1,
    }
}

/// A plot for each group of components with a common quantity.
fn components(recorded: &Recorded, envelopes: &[Envelope], ink: Ink) -> Vec<Plot> {
    let quantity = recorded.stream.quantity;
    let is_wrench = recorded.stream.kind == Kind::WRENCH;
    let inks = [Ink::Blue, Ink::Orange, Ink::Teal];
    let names = recorded.stream.kind.spec().components.chunks(IN_A_PLOT);
    let groups = envelopes.chunks(IN_A_PLOT).zip(names).enumerate();
    let plot = |(group, (envelopes, names)): (usize, (&[Envelope], &[&'static str]))| {
        let (suffix, quantity) = match (is_wrench, group) {
            (true, 0) => (" force", Quantity::FORCE),
            (true, _) => (" torque", Quantity::TORQUE),
            (false, _) => ("", quantity),
        };
        let unit = Unit::of(quantity);
        let envelopes: Vec<&Envelope> = envelopes.iter().collect();
        let styles: Vec<Style> = match envelopes.len() {
            1 => vec![Style::of(ink)],
            // The axis of `force_x`.
            _ => (names.iter().zip(inks))
                .map(|(name, ink)| Style::named(ink, name.rsplit('_').next().unwrap_or_default()))
                .collect(),
        };
        let marks = envelopes.iter().zip(styles);
        let label = match envelopes.as_slice() {
            [envelope] if envelope.is_switch() => switch_label(&recorded.stream.name),
            _ => axis_label(&Stream { quantity, ..recorded.stream.clone() }),
        };
        Plot {
            title: format!("{}{suffix}", recorded.stream.name),
            y: Axis::of(label),
            marks: marks.map(|(envelope, style)| Mark::signal(style, envelope, |si| unit.show(si))).collect(),
            caption: levels(recorded, &envelopes, &unit),
            ..frame(recorded)
        }
    };
    groups.map(plot).collect()
}

/// The most informative level of a signal, as a sentence.
fn levels(recorded: &Recorded, envelopes: &[&Envelope], unit: &Unit) -> String {
    let [envelope] = envelopes else {
        let most = envelopes.iter().map(|envelope| envelope.peak()).fold(0.0, f64::max);
        return format!("Largest component {}.", unit.text(most));
    };
    level(&recorded.stream, envelope).map_or_else(
        || "All of its samples are NaN or infinite.".to_owned(),
        |level| format!("{}.", capitalised(&level)),
    )
}

/// Level of a signal: of a switch the share of time that it is on, of a signal that only rises its end,
/// otherwise the range, with the RMS of a bipolar signal or the mean of another. `None` if no sample is
/// finite.
pub(super) fn level(stream: &Stream, envelope: &Envelope) -> Option<String> {
    let unit = Unit::of(stream.quantity);
    let (low, high) = envelope.range()?;
    if envelope.is_switch() {
        return Some(format!("1 for {} % of the time", percent(envelope.presence())));
    }
    if let Some((first, last)) = envelope.rises() {
        let first = plain(unit.show(first));
        return Some(format!("rises from {first} to {}", unit.text(last)));
    }
    let range = format!("from {} to {}", plain(unit.show(low)), unit.text(high));
    let heating = heating(stream, envelope);
    Some(match low < 0.0 && high > 0.0 {
        true => format!("RMS {}, {range}{heating}", unit.text(envelope.rms())),
        false => format!("mean {}, {range}{heating}", unit.text(envelope.mean())),
    })
}

/// Share of the time in percent, as a whole number unless that would be 0.
fn percent(part: f64) -> String {
    match 100.0 * part {
        little if little < 1.0 => plain(little),
        percent => format!("{percent:.0}"),
    }
}

/// Share of the RMS of a current above which its mean is mentioned.
const LARGE_MEAN: f64 = 0.3;

/// Mean of a current that drives a vibration, A, if it is a large part of it.
pub(super) fn constant_current(stream: &Stream, envelope: &Envelope) -> Option<f64> {
    let vibrates = stream.quantity == Quantity::CURRENT
        && stream.kind == Kind::SCALAR
        && stream.rate.hz() >= SPECTRAL_RATE_HZ;
    (vibrates && envelope.mean().abs() > LARGE_MEAN * envelope.rms()).then(|| envelope.mean())
}

/// Note about a large mean current, to append to a sentence.
pub(super) fn heating(stream: &Stream, envelope: &Envelope) -> String {
    constant_current(stream, envelope).map_or_else(String::new, |mean| {
        let mean = Unit::of(Quantity::CURRENT).text(mean);
        format!("; its mean of {mean} heats the coil and is not felt")
    })
}

fn events(recorded: &Recorded, kept: &[(f64, f64)], count: u64, ink: Ink) -> Plot {
    let unit = Unit::of(recorded.stream.quantity);
    let stems = kept.iter().map(|(t, v)| [(*t, unit.show(0.0)), (*t, unit.show(*v))]).collect();
    let heads = kept.iter().map(|(t, v)| (*t, unit.show(*v))).collect();
    Plot {
        title: format!("{}, {count} events", recorded.stream.name),
        y: Axis::of(axis_label(&recorded.stream)),
        marks: vec![Mark::Segments(Style::of(ink), stems), Mark::Dots(Style::of(ink), heads)],
        caption: "A stem for each event, as high as its value.".to_owned(),
        ..frame(recorded)
    }
}

/// Tactile sensitivity ends near 1 kHz; spectrograms end at twice that.
const HIGHEST_SHOWN_HZ: f64 = 2000.0;
/// Dynamic range of a spectrogram below the maximum, dB.
const DEPTH_DB: f64 = 60.0;
/// The brightest colour is at a multiple of this many decibels.
const ROUND_DB: f64 = 5.0;

/// Explanations of spectrograms and mean spectra, shown once per page.
pub(super) const EXPLAINED: [&str; 2] = [
    "Strength of each frequency over time: a tap is a vertical line, a resonance a horizontal band; a vibration that follows the hand \
     is brighter where the hand is faster or presses harder.",
    "The skin is most sensitive to vibration near 250 Hz, and hardly sensitive above 1 kHz. The lines above are the bands of its receptors; \
     those of SA-I and SA-II end at 5 Hz.",
];

/// Keeps each of the sentences [`EXPLAINED`] only in the first caption that contains it.
pub(super) fn explain_once(plots: &mut [Plot]) {
    for sentence in EXPLAINED {
        let explained = plots.iter_mut().filter(|plot| plot.caption.contains(sentence));
        for plot in explained.skip(1) {
            plot.caption = plot.caption.replace(sentence, "").trim().to_owned();
        }
    }
}

fn spectrogram(recorded: &Recorded, spectra: &Spectra) -> Option<Plot> {
    let bin_hz = spectra.bin_hz();
    let bins = spectra.columns().first()?.len().min((HIGHEST_SHOWN_HZ / bin_hz) as usize + 1);
    let width = spectra.columns().len();
    let decibel = |density: f64| 10.0 * density.max(1e-300).log10();
    let rows = (0..bins).flat_map(|bin| spectra.columns().iter().map(move |column| decibel(column[bin])));
    let values: Vec<f64> = rows.collect();
    let loudest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if loudest <= decibel(0.0) {
        return None; // silence
    }
    let loudest = (loudest / ROUND_DB).ceil() * ROUND_DB;
    Some(Plot {
        title: format!("{}, spectrogram", recorded.stream.name),
        x: Axis::time().over(0.0, recorded.duration_s()),
        y: Axis::of("Frequency (Hz)").over(0.0, (bins as f64 - 0.5) * bin_hz),
        marks: vec![Mark::Image(Image {
            cells: Grid { width, height: bins, values },
            // The first and last half segments have no column of their own.
            x: (0.0, recorded.duration_s()),
            y: (-0.5 * bin_hz, (bins as f64 - 0.5) * bin_hz),
            colours: (loudest - DEPTH_DB, loudest),
            label: format!("dB re 1 {}", density_unit(recorded.stream.quantity)),
        })],
        size: (0.0, 250.0),
        caption: EXPLAINED[0].to_owned(),
        ..frame(recorded)
    })
}

/// The mean spectrum of a signal, if it has one.
pub(crate) fn mean_spectrum(recorded: &Recorded, ink: Ink) -> Option<Plot> {
    let Content::Components(_, Some(spectra)) = &recorded.content else {
        return None;
    };
    let mut spectra = spectra.as_ref().clone();
    spectra.finish();
    let points = spectra.shown();
    let (_, loudest) = points.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let strongest_hz = spectra.strongest_hz()?;
    Some(Plot {
        title: format!("{}, mean spectrum", recorded.stream.name),
        note: note(recorded),
        x: Axis::of("Frequency (Hz)").over(SHOWN_HZ.0, SHOWN_HZ.1).log(),
        y: Axis::of(format!("Density ({})", density_unit(recorded.stream.quantity)))
            .over(loudest * 10f64.powf(-DEPTH_DB / 10.0), top_with_receptors(loudest))
            .log(),
        marks: { receptors(SHOWN_HZ, loudest).into_iter() }
            .chain([Mark::Line(Style::of(ink), points)])
            .collect(),
        size: (0.0, 230.0),
        caption: format!("Over the whole run, strongest at {strongest_hz:.0} Hz. {}", EXPLAINED[1]),
        ..Plot::default()
    })
}

/// Path of the proxy during contact, seen from above.
pub(crate) fn contact_path(recorded: &Recorded) -> Option<Plot> {
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
        caption: "Seen from above.".to_owned(),
        ..Plot::default()
    })
}
