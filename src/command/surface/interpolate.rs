//! `haptograph surface interpolate`: the filter that a texture has at any speed and force.

use super::{Failure, load, texture};
use crate::command::{say, snippet};
use haptograph::surfaces::files::decimal::{format_thousandfold, parse_thousandth};
use haptograph::surfaces::{Coefficients, Interpolator, Spot};
use serde::Serialize;
use std::io::BufRead;
use std::path::PathBuf;

/// Interpolate a texture at speeds and forces read from standard input
///
/// Each line holds `speed_mm_s force_n`; empty lines and those that begin with # are passed over. Speed and force saturate at the largest
/// modelled ones, and count as zero below zero.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The surface file
    file: PathBuf,
    /// Print one JSON object a line: speed_mm_s and force_n (after saturation), triangle (three 0-based vertex numbers), weights, ar, ma,
    /// gain, variance
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Json<'a> {
    speed_mm_s: f64,
    force_n: f64,
    triangle: [u32; 3],
    weights: [f64; 3],
    ar: &'a [f64],
    ma: &'a [f64],
    gain: f64,
    variance: f64,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let surface = load(&arguments.file)?;
    let mut interpolator = Interpolator::new(texture(&surface, &arguments.file)?);
    let mut coefficients = Coefficients::SILENCE;
    for (index, line) in std::io::stdin().lock().split(b'\n').enumerate() {
        let line = line.map_err(|error| Failure::Message(format!("cannot read standard input: {error}")))?;
        let line = String::from_utf8_lossy(&line);
        let Some((speed_m_s, force_n)) = parse(&line).map_err(|wrong| wrong.at(&line, index + 1))? else {
            continue;
        };
        let spot = interpolator.interpolate(speed_m_s, force_n, &mut coefficients);
        let text = if arguments.json {
            json(&spot, &coefficients)?
        } else {
            describe(&spot, &coefficients)
        };
        say(&(text + "\n"))?;
    }
    Ok(())
}

/// What is wrong with a line, and from which byte on.
#[derive(Debug, PartialEq)]
struct Wrong {
    byte: usize,
    message: String,
}

impl Wrong {
    fn at(&self, line: &str, number: usize) -> Failure {
        let column = line[..self.byte].chars().count() + 1;
        let message = format!("line {number}, column {column}: {}", self.message);
        Failure::Shown(snippet::at(
            "standard input",
            line.trim_end(),
            number,
            column,
            &message,
        ))
    }
}

/// Speed in m/s and force in N; `None` for a line that says nothing.
fn parse(line: &str) -> Result<Option<(f64, f64)>, Wrong> {
    if line.trim().is_empty() || line.trim_start().starts_with('#') {
        return Ok(None);
    }
    let start = |word: &str| word.as_ptr() as usize - line.as_ptr() as usize;
    let mut words = line
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter(|word| !word.is_empty());
    let mut number = |what: &str, parse: fn(&str) -> Option<f64>| {
        let missing = || Wrong {
            byte: line.trim_end().len(),
            message: format!("the {what} is missing; write `speed_mm_s force_n`"),
        };
        let word = words.next().ok_or_else(missing)?;
        let wrong = || Wrong {
            byte: start(word),
            message: format!("the {what} {word:?} is no finite number"),
        };
        parse(word).filter(|value| value.is_finite()).ok_or_else(wrong)
    };
    let speed_m_s = number("speed", parse_thousandth)?;
    let force_n = number("force", |word| word.parse().ok())?;
    match words.next() {
        None => Ok(Some((speed_m_s, force_n))),
        Some(word) => {
            let message = format!("{word:?} is one word too many; write `speed_mm_s force_n`");
            Err(Wrong {
                byte: start(word),
                message,
            })
        }
    }
}

/// In mm/s, as the file would have it.
fn speed_mm_s(spot: &Spot) -> f64 {
    format_thousandfold(spot.speed_m_s)
        .parse()
        .unwrap_or(spot.speed_m_s * 1000.0)
}

fn json(spot: &Spot, coefficients: &Coefficients) -> Result<String, Failure> {
    let line = Json {
        speed_mm_s: speed_mm_s(spot),
        force_n: spot.force_n,
        triangle: spot.vertices,
        weights: spot.weights,
        ar: coefficients.ar(),
        ma: coefficients.ma(),
        gain: coefficients.gain,
        variance: coefficients.variance,
    };
    serde_json::to_string(&line).map_err(|error| Failure::Message(format!("cannot say it as JSON: {error}")))
}

fn describe(spot: &Spot, coefficients: &Coefficients) -> String {
    let list = |values: &[f64]| {
        values
            .iter()
            .map(|value| format!("{value:.6}"))
            .collect::<Vec<_>>()
            .join(" ")
    };
    let [a, b, c] = spot.vertices;
    let mut text = format!(
        "{} mm/s, {} N: models {a}, {b}, {c} by {}; variance {:e}, gain {}, ar {}",
        speed_mm_s(spot),
        spot.force_n,
        list(&spot.weights),
        coefficients.variance,
        coefficients.gain,
        list(coefficients.ar()),
    );
    if coefficients.ma_order > 0 {
        text += &format!(", ma {}", list(coefficients.ma()));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_with_exact_thousandths() {
        assert_eq!(parse("221.974244 6.382478"), Ok(Some((0.221974244, 6.382478))));
        assert_eq!(parse("  100,\t2\r"), Ok(Some((0.1, 2.0))));
        assert_eq!(parse("-5 -1e-3"), Ok(Some((-0.005, -0.001))));
        for nothing in ["", "   \r", "# speed force"] {
            assert_eq!(parse(nothing), Ok(None));
        }
    }

    #[test]
    fn wrong_lines_are_wrong_at_a_place() {
        for (line, byte) in [
            ("100", 3),
            ("100 x", 4),
            ("nan 1", 0),
            ("1 inf", 2),
            ("1 2 3", 4),
            ("é 1", 0),
            ("1e999 1", 0),
        ] {
            assert_eq!(parse(line).unwrap_err().byte, byte, "{line}");
        }
    }
}
