//! From what was recorded to plots: each kind of signal in the form in which it is read at a glance.

use super::plot::{Axis, Image, Mark, Plot, Style, Weight};
use super::raster::Grid;
use super::record::{Content, Recorded, SPECTRAL_RATE_HZ};
use super::scale::plain;
use super::spectra::{SHOWN_HZ, Spectra};
use super::theme::Ink;
use super::thinning::Envelope;
use haptograph_engine::frame::Kind;
use haptograph_engine::node::Stream;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units;

pub use super::texture_map::{strokes_on_map, triangulation};

/// The unit that a quantity is shown in: millimetres and degrees Celsius where the field uses them.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Its symbol; empty for plain numbers.
    pub symbol: String,
    factor: f64,
    offset: f64,
}

impl Unit {
    /// The unit of a quantity.
    pub fn of(quantity: Quantity) -> Self {
        let (symbol, si, offset) = match quantity {
            Quantity::TEMPERATURE => ("°C".to_owned(), 1.0, -273.15),
            Quantity::NUMBER => (String::new(), 1.0, 0.0),
            other => {
                let (symbol, si) = units::shown(other);
                (symbol, si, 0.0)
            }
        };
        Self {
            symbol,
            factor: 1.0 / si,
            offset,
        }
    }

    /// An SI value in this unit.
    pub fn show(&self, si: f64) -> f64 {
        si * self.factor + self.offset
    }

    /// An SI value in this unit, with three digits and the symbol.
    pub(super) fn text(&self, si: f64) -> String {
        let value = plain(self.show(si));
        match self.symbol.as_str() {
            "" => value,
            symbol => format!("{value} {symbol}"),
        }
    }
}

/// The name of a quantity: `Force`.
pub(super) fn quantity_name(quantity: Quantity) -> String {
    let name = match quantity {
        Quantity::NUMBER => "value",
        other => other.name().unwrap_or("value"),
    };
    capitalised(name)
}

/// What an axis shows of a signal: `Force (N)`, `Position (mm)`; of a plain number its own name, `Trim (1)`.
pub(super) fn axis_label(stream: &Stream) -> String {
    match (stream.quantity, stream.kind) {
        (Quantity::NUMBER, _) => format!("{} (1)", capitalised(&stream.name)),
        (Quantity::LENGTH, Kind::Vector) => with_unit("Position", Quantity::LENGTH),
        (quantity, _) => with_unit(&quantity_name(quantity), quantity),
    }
}

fn with_unit(name: &str, quantity: Quantity) -> String {
    match Unit::of(quantity).symbol.as_str() {
        "" => name.to_owned(),
        symbol => format!("{name} ({symbol})"),
    }
}

/// The same of a number that is 0 or 1 all the time.
pub(super) fn switch_label(name: &str) -> String {
    format!("{} (0 or 1)", capitalised(name))
}

/// A text with a capital first letter.
pub(super) fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// The unit of a power spectral density of a quantity: `A²/Hz`, `(m/s²)²/Hz`.
fn density_unit(quantity: Quantity) -> String {
    let unit = quantity.unit().replace("s2", "s²");
    match unit.chars().all(char::is_alphabetic) {
        true => format!("{unit}²/Hz"),
        false => format!("({unit})²/Hz"),
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
    match &recorded.content {
        Content::Lanes(lanes, spectra) => {
            let mut plots = components(recorded, lanes, ink);
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
            caption: "How deep the tip is in the surface; 0 in the air.".to_owned(),
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

/// How many of the plots of a signal over time show its values: the first ones.
pub(super) fn components_of(recorded: &Recorded) -> usize {
    match recorded.stream.kind {
        Kind::Wrench => 2,
        _ => 1,
    }
}

/// A plot of each group of components that has a quantity of its own.
fn components(recorded: &Recorded, lanes: &[Envelope], ink: Ink) -> Vec<Plot> {
    let quantity = recorded.stream.quantity;
    let groups: &[(&str, std::ops::Range<usize>, Quantity)] = match recorded.stream.kind {
        Kind::Wrench => &[
            (" force", 0..3, Quantity::FORCE),
            (" torque", 3..6, Quantity::TORQUE),
        ],
        Kind::Vector => &[("", 0..3, quantity)],
        _ => &[("", 0..1, quantity)],
    };
    let plot = |(suffix, range, quantity): &(&str, std::ops::Range<usize>, Quantity)| {
        let unit = Unit::of(*quantity);
        let lanes: Vec<&Envelope> = range.clone().filter_map(|lane| lanes.get(lane)).collect();
        let inks = [Ink::Blue, Ink::Orange, Ink::Teal];
        let styles: Vec<Style> = match lanes.len() {
            1 => vec![Style::of(ink)],
            _ => (["x", "y", "z"].into_iter().zip(inks))
                .map(|(axis, ink)| Style::named(ink, axis))
                .collect(),
        };
        let marks = lanes.iter().zip(styles);
        let label = match lanes.as_slice() {
            [lane] if lane.is_switch() => switch_label(&recorded.stream.name),
            _ => axis_label(&Stream {
                quantity: *quantity,
                ..recorded.stream.clone()
            }),
        };
        Plot {
            title: format!("{}{suffix}", recorded.stream.name),
            y: Axis::of(label),
            marks: marks
                .map(|(lane, style)| Mark::signal(style, lane, |si| unit.show(si)))
                .collect(),
            caption: levels(recorded, &lanes, &unit),
            ..frame(recorded)
        }
    };
    groups.iter().map(plot).collect()
}

/// What is read of a signal first, as a sentence.
fn levels(recorded: &Recorded, lanes: &[&Envelope], unit: &Unit) -> String {
    let [lane] = lanes else {
        let most = lanes.iter().map(|lane| lane.peak()).fold(0.0, f64::max);
        return format!("Largest component {}.", unit.text(most));
    };
    level(&recorded.stream, lane).map_or_else(
        || "All of its samples are NaN or infinite.".to_owned(),
        |level| format!("{}.", capitalised(&level)),
    )
}

/// How large a signal is: the part of the time that a switch is on, the end of what only rises, else its range with the root
/// mean square of one that goes both ways, the mean of another. `None` where no sample is finite.
pub(super) fn level(stream: &Stream, lane: &Envelope) -> Option<String> {
    let unit = Unit::of(stream.quantity);
    let (low, high) = lane.range()?;
    if lane.is_switch() {
        return Some(format!("1 for {} % of the time", percent(lane.presence())));
    }
    if let Some((first, last)) = lane.rises() {
        let first = plain(unit.show(first));
        return Some(format!("rises from {first} to {}", unit.text(last)));
    }
    let range = format!("from {} to {}", plain(unit.show(low)), unit.text(high));
    let heating = heating(stream, lane);
    Some(match low < 0.0 && high > 0.0 {
        true => format!("RMS {}, {range}{heating}", unit.text(lane.rms())),
        false => format!("mean {}, {range}{heating}", unit.text(lane.mean())),
    })
}

/// A part of the time, in whole percent where that is not nothing.
fn percent(part: f64) -> String {
    match 100.0 * part {
        little if little < 1.0 => plain(little),
        percent => format!("{percent:.0}"),
    }
}

/// Parts of the RMS of a current above which its mean is worth a word.
const LARGE_MEAN: f64 = 0.3;

/// The mean of a current that is to be felt as a vibration, A, where it is a large part of it.
pub(super) fn constant_current(stream: &Stream, lane: &Envelope) -> Option<f64> {
    let vibrates = stream.quantity == Quantity::CURRENT
        && stream.kind == Kind::Scalar
        && stream.rate.hz() >= SPECTRAL_RATE_HZ;
    (vibrates && lane.mean().abs() > LARGE_MEAN * lane.rms()).then(|| lane.mean())
}

/// What a large mean of a current does, to be added to a sentence.
pub(super) fn heating(stream: &Stream, lane: &Envelope) -> String {
    constant_current(stream, lane).map_or_else(String::new, |mean| {
        let mean = Unit::of(Quantity::CURRENT).text(mean);
        format!("; its mean of {mean} heats the coil and is not felt")
    })
}

fn events(recorded: &Recorded, kept: &[(f64, f64)], count: u64, ink: Ink) -> Plot {
    let unit = Unit::of(recorded.stream.quantity);
    let stems = kept
        .iter()
        .map(|(t, v)| [(*t, unit.show(0.0)), (*t, unit.show(*v))])
        .collect();
    let heads = kept.iter().map(|(t, v)| (*t, unit.show(*v))).collect();
    Plot {
        title: format!("{}, {count} events", recorded.stream.name),
        y: Axis::of(axis_label(&recorded.stream)),
        marks: vec![
            Mark::Segments(Style::of(ink), stems),
            Mark::Dots(Style::of(ink), heads),
        ],
        caption: "A stem for each event, as high as its value.".to_owned(),
        ..frame(recorded)
    }
}

/// Touch ends near 1 kHz; what lies above twice that is left out of spectrograms.
const HIGHEST_SHOWN_HZ: f64 = 2000.0;
/// Decibels below the loudest that are still told apart.
const DEPTH_DB: f64 = 60.0;
/// The loudest colour is at a multiple of this many decibels.
const ROUND_DB: f64 = 5.0;

/// What spectrograms and mean spectra show, each said once on a page.
pub(super) const EXPLAINED: [&str; 2] = [
    "How strong each frequency is at each time: a tap is an upright line, a resonance a level band; what follows the hand \
     grows brighter where it is faster or harder.",
    "The skin is most sensitive to vibration near 250 Hz, and hardly senses it above 1 kHz.",
];

/// Leaves each of the sentences [`EXPLAINED`] in the first caption that has it only.
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
    let loudest = (loudest / ROUND_DB).ceil() * ROUND_DB;
    Some(Plot {
        title: format!("{}, spectrogram", recorded.stream.name),
        x: Axis::time().over(0.0, recorded.duration_s()),
        y: Axis::of("Frequency (Hz)").over(0.0, (bins as f64 - 0.5) * bin_hz),
        marks: vec![Mark::Image(Image {
            cells: Grid {
                width,
                height: bins,
                values,
            },
            // Half a segment at either end has no column of its own.
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

/// The mean spectrum of a signal that has one.
pub fn mean_spectrum(recorded: &Recorded, ink: Ink) -> Option<Plot> {
    let Content::Lanes(_, Some(spectra)) = &recorded.content else {
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
            .over(loudest * 10f64.powf(-DEPTH_DB / 10.0), loudest * 2.0)
            .log(),
        marks: vec![Mark::Line(Style::of(ink), points)],
        size: (0.0, 230.0),
        caption: format!(
            "Over the whole run, strongest at {strongest_hz:.0} Hz. {}",
            EXPLAINED[1]
        ),
        ..Plot::default()
    })
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
        caption: "Seen from above.".to_owned(),
        ..Plot::default()
    })
}
