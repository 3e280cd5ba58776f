//! Two vibrations beside each other: heard with a switch between them, over time, by frequency, and in how they fluctuate.

use super::learning::badge;
use super::page::{Sheet, facts, figures_of};
use super::plot::{Axis, Mark, Plot, Style};
use super::scale::peak;
use super::sound::{LONGEST_S, wav_of_pair};
use super::spectra::receptors;
use super::svg::escape;
use super::theme::Ink;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use haptograph_learning::metrics::Fluctuation;
use haptograph_learning::metrics::level::levels_db;
use haptograph_signal::spectrum::welch;
use haptograph_signal::window::Window;

/// Plotted frequencies, Hz; tactile sensitivity ends near 1 kHz.
const SHOWN_HZ: (f64, f64) = (20.0, 2000.0);
const INKS: [Ink; 2] = [Ink::Blue, Ink::Orange];

/// Two vibrations.
pub struct Pair<'a> {
    /// What they are called.
    pub names: [&'a str; 2],
    /// Samples.
    pub samples: [&'a [f64]; 2],
    /// Unit of the samples.
    pub unit: &'a str,
    /// Rate of both, Hz.
    pub rate_hz: f64,
    /// True for those of simulated devices.
    pub simulated: [bool; 2],
}

impl Pair<'_> {
    /// A page of them with measures, by name and value.
    pub fn page(&self, measures: &[(String, String)]) -> String {
        let [a, b] = self.names;
        Sheet {
            title: &format!("{a} beside {b}"),
            about: "Both over the time that both cover.",
            badge: badge(self.simulated.contains(&true)),
            warnings: &[],
            sections: &[("", self.section()), ("Measures", facts(measures))],
        }
        .to_html()
    }

    /// The player and the figures.
    pub(super) fn section(&self) -> String {
        let loudest = 1.05 * self.samples.map(peak).into_iter().fold(0.0, f64::max);
        let over_time = |k: usize| Plot {
            title: self.names[k].into(),
            note: badge(self.simulated[k]).into(),
            x: Axis::time().over(0.0, self.samples[k].len() as f64 / self.rate_hz),
            y: Axis::of(format!("Vibration ({})", self.unit)).over(-loudest, loudest),
            marks: vec![Mark::samples(Style::of(INKS[k]), self.rate_hz, self.samples[k], 1.0)],
            size: (0.0, 180.0),
            ..Plot::default()
        };
        let mut plots = vec![over_time(0), over_time(1), self.levels(), self.spectra()];
        plots.extend(self.fluctuation().into_iter().flatten());
        self.player() + &figures_of(&plots)
    }

    /// One player of both as two channels, which the page's script switches.
    fn player(&self) -> String {
        let Some(wav) = wav_of_pair(self.samples, self.rate_hz) else { return String::new() };
        let [a, b] = self.names.map(escape);
        format!(
            "<div class=\"beside\"><audio controls=\"\" preload=\"metadata\" src=\"data:audio/wav;base64,{}\"></audio>\
             <div class=\"choice\" hidden=\"\"><button type=\"button\" aria-pressed=\"true\">{a}</button>\
             <button type=\"button\" aria-pressed=\"false\">{b}</button></div>\
             <p class=\"caption\">At most {LONGEST_S:.0} s, at one scale: left {a}, right {b}; with the buttons one of them on \
             both sides.</p></div>",
            STANDARD.encode(wav)
        )
    }

    fn lines(&self, of: impl Fn(usize) -> Vec<(f64, f64)>) -> Vec<Mark> {
        (0..2).map(|k| Mark::Line(Style::named(INKS[k], self.names[k]), of(k))).collect()
    }

    fn levels(&self) -> Plot {
        let of = |k: usize| {
            let levels = levels_db(self.samples[k], self.rate_hz);
            let step_s = self.samples[k].len() as f64 / self.rate_hz / levels.len().max(1) as f64;
            let levels = levels.into_iter().enumerate();
            levels.map(|(n, level_db)| ((n as f64 + 0.5) * step_s, level_db)).collect()
        };
        Plot {
            title: "Levels over 50 ms".into(),
            x: Axis::time().over(0.0, self.samples[0].len() as f64 / self.rate_hz),
            y: Axis::of(format!("Level (dB re 1 {})", self.unit)),
            marks: self.lines(of),
            size: (0.0, 180.0),
            caption:
                "Equal where force and speed explain the level; the rest is each vibration's own fluctuation."
                    .to_owned(),
            ..Plot::default()
        }
    }

    fn spectra(&self) -> Plot {
        let shown_hz = (SHOWN_HZ.0, SHOWN_HZ.1.min(0.5 * self.rate_hz));
        let segment = (0.2 * self.rate_hz) as usize;
        let of = |k: usize| {
            let samples = self.samples[k];
            let psd = welch(samples, self.rate_hz, segment.min(samples.len()), segment / 2, Window::Hann);
            let points = psd.into_iter().flat_map(|psd| psd.frequency_hz.into_iter().zip(psd.density));
            points.filter(|(hz, density)| (shown_hz.0..=shown_hz.1).contains(hz) && *density > 0.0).collect()
        };
        let mut marks = self.lines(of);
        let loudest = marks.iter().map(highest).fold(0.0, f64::max);
        marks.extend((loudest > 0.0).then(|| receptors(shown_hz, loudest)).into_iter().flatten());
        Plot {
            title: "Mean spectra".into(),
            x: Axis::of("Frequency (Hz)").over(shown_hz.0, shown_hz.1).log(),
            y: Axis::of(format!("Density (({})²/Hz)", self.unit)).log(),
            marks,
            size: (0.0, 250.0),
            caption:
                "The lines above are the bands of the hand's receptors; those of SA-I and SA-II end at 5 Hz."
                    .to_owned(),
            ..Plot::default()
        }
    }

    /// Modulation spectra and distributions of the levels; `None` for vibrations that are too short.
    fn fluctuation(&self) -> Option<[Plot; 2]> {
        let [a, b] = self.samples.map(|samples| Fluctuation::of(samples, self.rate_hz));
        let both = [a?, b?];
        let modulation = Plot {
            title: "Modulation of the envelope".into(),
            x: Axis::of("Octave (Hz)").log(),
            y: Axis::of("Power over the mean level (dB)"),
            marks: self.lines(|k| both[k].modulation_db().collect()),
            size: (0.0, 220.0),
            caption: "How much the level over 2 ms fluctuates, and how fast.".to_owned(),
            ..Plot::default()
        };
        let levels = Plot {
            title: "Distribution of the levels over 5 ms".into(),
            x: Axis::of(format!("Level (dB re 1 {})", self.unit)),
            y: Axis::of("Time below (%)").over(0.0, 100.0),
            marks: self.lines(|k| both[k].quantiles_db().map(|(part, db)| (db, 100.0 * part)).collect()),
            size: (0.0, 220.0),
            ..Plot::default()
        };
        Some([modulation, levels])
    }
}

fn highest(curve: &Mark) -> f64 {
    match curve {
        Mark::Line(_, points) => points.iter().map(|(_, density)| *density).fold(0.0, f64::max),
        _ => 0.0,
    }
}
