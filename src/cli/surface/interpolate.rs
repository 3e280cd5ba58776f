//! `haptograph surface interpolate`: the filter of a texture at any speed and force.

use super::show::mm_s;
use super::{Failure, load, texture};
use crate::cli::result::{CommandResult, show};
use crate::cli::snippet;
use crate::signal::files;
use crate::signal::units::decimal::parse_thousandth;
use crate::surfaces::{Coefficients, Interpolator};
use serde::Serialize;
use std::path::PathBuf;

/// Interpolate a texture at speeds and forces read from standard input
///
/// Each line holds `speed_mm_s force_n`; empty lines and lines that begin with # are ignored. Values above
/// the largest modelled ones are clamped to these, negative values to zero.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The surface file
    file: PathBuf,
    /// Print one JSON object per line: speed_mm_s and force_n (after clamping; also asked_speed_mm_s and
    /// asked_force_n if they differ), triangle (three 0-based vertex numbers), weights, ar, ma, gain,
    /// variance
    #[arg(long)]
    json: bool,
}

/// The filter at a speed and a force.
#[derive(Serialize)]
struct Interpolated<'a> {
    speed_mm_s: f64,
    force_n: f64,
    /// As asked, if that lies outside the modelled range.
    #[serde(skip_serializing_if = "Option::is_none")]
    asked_speed_mm_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    asked_force_n: Option<f64>,
    triangle: [u32; 3],
    weights: [f64; 3],
    ar: &'a [f64],
    ma: &'a [f64],
    gain: f64,
    variance: f64,
    /// 0 for models on an unwarped axis.
    warping: f64,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let surface = load(&arguments.file)?;
    let texture = texture(&surface, &arguments.file)?;
    let (speed_m_s, force_n) = (texture.max_speed_m_s(), texture.max_force_n());
    let most = Request { speed_mm_s: mm_s(speed_m_s), speed_m_s, force_n };
    let mut interpolator = Interpolator::new(texture);
    let mut coefficients = Coefficients::SILENCE;
    for (index, line) in files::lines(std::io::stdin().lock(), files::MAX_LINE_BYTES).enumerate() {
        let line = line.map_err(|error| {
            let number = index + 1;
            Failure::Message(format!("cannot read line {number} of standard input: {error}"))
        })?;
        let line = String::from_utf8_lossy(&line);
        let Some(asked) = parse(&line).map_err(|wrong| wrong.at(&line, index + 1))? else {
            continue;
        };
        let spot = interpolator.interpolate(asked.speed_m_s, asked.force_n, &mut coefficients);
        let at = asked.saturated(&most);
        let beyond = asked.differs_from(&at).then_some(asked);
        let interpolated = Interpolated {
            speed_mm_s: at.speed_mm_s,
            force_n: at.force_n,
            asked_speed_mm_s: beyond.map(|asked| asked.speed_mm_s),
            asked_force_n: beyond.map(|asked| asked.force_n),
            triangle: spot.vertices,
            weights: spot.weights,
            ar: coefficients.ar(),
            ma: coefficients.ma(),
            gain: coefficients.gain,
            variance: coefficients.variance,
            warping: coefficients.warping,
        };
        show(&interpolated, arguments.json)?;
    }
    Ok(())
}

/// A requested speed and force, as given: several values in mm/s can map to one in m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Request {
    speed_mm_s: f64,
    speed_m_s: f64,
    force_n: f64,
}

impl Request {
    /// Clamped to the modelled range; values inside it stay as given.
    fn saturated(&self, most: &Self) -> Self {
        let within = |value: f64, most: f64| if value > 0.0 { value.min(most) } else { 0.0 };
        Self {
            speed_mm_s: within(self.speed_mm_s, most.speed_mm_s),
            speed_m_s: within(self.speed_m_s, most.speed_m_s),
            force_n: within(self.force_n, most.force_n),
        }
    }

    /// True if the values differ by more than the rounding of the conversion to mm/s.
    fn differs_from(&self, other: &Self) -> bool {
        let apart = |a: f64, b: f64| (a - b).abs() > 1e-9 * a.abs().max(b.abs());
        apart(self.speed_mm_s, other.speed_mm_s) || apart(self.force_n, other.force_n)
    }
}

/// An error in a line, and the byte at which it begins.
#[derive(Debug, PartialEq)]
struct LineError {
    byte: usize,
    message: String,
}

impl LineError {
    fn at(&self, line: &str, number: usize) -> Failure {
        let column = line[..self.byte].chars().count() + 1;
        let message = format!("line {number}, column {column}: {}", self.message);
        Failure::Rendered(snippet::at("standard input", line.trim_end(), number, column, &message))
    }
}

/// Parses speed and force; `None` for an empty line or a comment.
fn parse(line: &str) -> Result<Option<Request>, LineError> {
    if line.trim().is_empty() || line.trim_start().starts_with('#') {
        return Ok(None);
    }
    let start = |word: &str| word.as_ptr() as usize - line.as_ptr() as usize;
    let mut words = line.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
    let mut number = |what: &str| {
        let missing = || LineError {
            byte: line.trim_end().len(),
            message: format!("the {what} is missing; write `speed_mm_s force_n`"),
        };
        let word = words.next().ok_or_else(missing)?;
        let wrong = || LineError {
            byte: start(word),
            message: format!("the {what} {word:?} is not a finite number"),
        };
        let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
        let thousandth = parse_thousandth(word).filter(|value| value.is_finite());
        value.zip(thousandth).ok_or_else(wrong)
    };
    let (speed_mm_s, speed_m_s) = number("speed")?;
    let (force_n, _) = number("force")?;
    match words.next() {
        None => Ok(Some(Request { speed_mm_s, speed_m_s, force_n })),
        Some(word) => {
            let message = format!("unexpected {word:?}; write `speed_mm_s force_n`");
            Err(LineError { byte: start(word), message })
        }
    }
}

impl CommandResult for Interpolated<'_> {
    fn text(&self) -> String {
        let list =
            |values: &[f64]| values.iter().map(|value| format!("{value:.6}")).collect::<Vec<_>>().join(" ");
        let [a, b, c] = self.triangle;
        let asked = self.asked_speed_mm_s.zip(self.asked_force_n);
        let asked = asked.map_or_else(String::new, |(speed_mm_s, force_n)| {
            format!(" in place of {speed_mm_s} mm/s, {force_n} N")
        });
        let Self { speed_mm_s, force_n, variance, gain, .. } = self;
        let (weights, ar) = (list(&self.weights), list(self.ar));
        let mut text = format!(
            "{speed_mm_s} mm/s, {force_n} N{asked}: models {a}, {b}, {c} by {weights}; variance {variance:e}, gain {gain}, ar {ar}"
        );
        if self.warping != 0.0 {
            text += &format!(" on an axis warped by {}", self.warping);
        }
        if !self.ma.is_empty() {
            text += &format!(", ma {}", list(self.ma));
        }
        text + "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_with_exact_thousandths() {
        let asked = |speed_mm_s, speed_m_s, force_n| Ok(Some(Request { speed_mm_s, speed_m_s, force_n }));
        assert_eq!(parse("221.974244 6.382478"), asked(221.974244, 0.221974244, 6.382478));
        assert_eq!(parse("  100,\t2\r"), asked(100.0, 0.1, 2.0));
        assert_eq!(parse("-5 -1e-3"), asked(-5.0, -0.005, -0.001));
        for nothing in ["", "   \r", "# speed force"] {
            assert_eq!(parse(nothing), Ok(None));
        }
    }

    #[test]
    fn what_lies_inside_is_echoed_as_it_was_given() {
        let asked =
            |speed_mm_s: f64, force_n: f64| Request { speed_mm_s, speed_m_s: speed_mm_s / 1000.0, force_n };
        let most = asked(200.0, 3.0);
        let just_below = asked(200.0_f64.next_down(), 3.0_f64.next_down());
        assert_eq!(just_below.saturated(&most), just_below);
        assert_eq!(asked(200.0_f64.next_up(), 4.0).saturated(&most), most);
        assert_eq!(asked(-1.0, -0.0).saturated(&most), asked(0.0, 0.0));
    }

    #[test]
    fn wrong_lines_are_wrong_at_a_place() {
        for (line, byte) in
            [("100", 3), ("100 x", 4), ("nan 1", 0), ("1 inf", 2), ("1 2 3", 4), ("é 1", 0), ("1e999 1", 0)]
        {
            assert_eq!(parse(line).unwrap_err().byte, byte, "{line}");
        }
    }
}
