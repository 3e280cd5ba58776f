//! Axes: mapping of values to pixels, and tick labels.

/// Spacing of values along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Spread {
    /// Evenly.
    #[default]
    Linear,
    /// Logarithmic; values at or below zero are not shown.
    Log,
}

/// Maps values of `low..=high` to pixels of `from..=to`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    pub low: f64,
    pub high: f64,
    pub from: f64,
    pub to: f64,
    pub spread: Spread,
}

/// A tick of an axis; minor ticks have no text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tick {
    pub value: f64,
    pub text: String,
}

impl Scale {
    pub(crate) fn pixel(&self, value: f64) -> f64 {
        let part = match self.spread {
            Spread::Linear => (value - self.low) / (self.high - self.low),
            Spread::Log => (value / self.low).ln() / (self.high / self.low).ln(),
        };
        self.from + part * (self.to - self.from)
    }

    /// Round values, about `most` of them with a text, at least two.
    pub(crate) fn ticks(&self, most: usize) -> Vec<Tick> {
        let of = |most| match self.spread {
            Spread::Linear => linear_ticks(self.low, self.high, most),
            Spread::Log => log_ticks(self.low, self.high, most),
        };
        let suffices = |ticks: &Vec<Tick>| ticks.iter().filter(|tick| !tick.text.is_empty()).count() > 1;
        let finer = [1, 2, 4, 8].map(|times| times * most.max(1));
        let found = finer.into_iter().map(of).find(suffices);
        // Within less than a decade there may be no round multiples of its power.
        found.unwrap_or_else(|| linear_ticks(self.low, self.high, 8 * most.max(1)))
    }
}

/// A range that contains all values, is not empty, and has a margin.
pub(crate) fn padded(values: impl Iterator<Item = f64>, spread: Spread) -> (f64, f64) {
    let usable = values.filter(|v| v.is_finite() && (spread == Spread::Linear || *v > 0.0));
    let (low, high) = usable.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low > high {
        return if spread == Spread::Log { (0.1, 10.0) } else { (-1.0, 1.0) };
    }
    match spread {
        Spread::Log if low == high => (low / 2.0, high * 2.0),
        Spread::Log => {
            // Bounded, so that both limits stay finite.
            let air = (0.04 * (high.ln() - low.ln())).min(1.0).exp();
            (low / air, high * air)
        }
        Spread::Linear if low == high => {
            let air = if low == 0.0 { 1.0 } else { low.abs() * 0.5 };
            (low - air, high + air)
        }
        Spread::Linear => {
            let air = (high - low) * 0.06;
            // A quantity that is not negative keeps zero in its range.
            let bottom = if low >= 0.0 && low < 0.4 * high { 0.0 } else { low - air };
            let top = if high <= 0.0 && high > 0.4 * low { 0.0 } else { high + air };
            (bottom, top)
        }
    }
}

/// A number in a sentence, with three significant digits.
pub fn plain(value: f64) -> String {
    let magnitude = value.abs().log10().floor();
    if value == 0.0 || !magnitude.is_finite() {
        return "0".to_owned();
    }
    if !(-4.0..6.0).contains(&magnitude) {
        return format!("{value:.2e}").replace('-', "\u{2212}");
    }
    let decimals = (2.0 - magnitude).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    let text = match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => &text,
    };
    text.replace('-', "\u{2212}")
}

/// A number with `decimals` decimals and a typographic minus sign.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    // A value that rounds to zero has no sign.
    match text.strip_prefix('-') {
        Some(size) if !size.contains(|digit: char| ('1'..='9').contains(&digit)) => size.to_owned(),
        Some(size) => format!("\u{2212}{size}"),
        None => text,
    }
}

fn linear_ticks(low: f64, high: f64, most: usize) -> Vec<Tick> {
    let rough = (high - low) / most.max(1) as f64;
    let decade = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|step| *step >= rough * 0.999);
    let step = step.unwrap_or(rough);
    if !(step.is_finite() && step > 0.0) {
        return Vec::new();
    }
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    let largest = low.abs().max(high.abs());
    (first..=last.min(first.saturating_add(50)))
        .map(|k| k as f64 * step)
        .map(|value| Tick { value, text: format_value(value, step, largest) })
        .collect()
}

fn log_ticks(low: f64, high: f64, most: usize) -> Vec<Tick> {
    let decades = (high / low).log10();
    let labelled: &[u32] = if decades * 3.0 <= most as f64 { &[1, 2, 5] } else { &[1] };
    let skip = (decades / most.max(1) as f64).ceil().max(1.0) as i32;
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let mut ticks = Vec::new();
    for exponent in first..=last.min(first.saturating_add(60)) {
        for digit in 1..10 {
            let value = f64::from(digit) * 10f64.powi(exponent);
            if value < low * 0.9999 || value > high * 1.0001 {
                continue;
            }
            let shown = labelled.contains(&digit) && (exponent - first) % skip == 0;
            let text = if shown { format_value(value, value, value) } else { String::new() };
            ticks.push(Tick { value, text });
        }
    }
    ticks
}

/// `value` with the digits that a step of `step` needs, in powers of ten if the largest is far from one.
fn format_value(value: f64, step: f64, largest: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if (1e-3..1e6).contains(&largest) {
        let digits = (-(step.log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize;
        return format!("{value:.digits$}").replace('-', "\u{2212}");
    }
    let exponent = largest.log10().floor() as i32;
    let scaled = value / 10f64.powi(exponent);
    let digits = (-((step / 10f64.powi(exponent)).log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize;
    let power = superscript(exponent);
    if digits == 0 && scaled == 1.0 {
        return format!("10{power}");
    }
    format!("{scaled:.digits$}\u{d7}10{power}").replace('-', "\u{2212}")
}

fn superscript(exponent: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digits = exponent.unsigned_abs().to_string();
    let raised = digits.chars().filter_map(|c| c.to_digit(10)).map(|d| DIGITS[d as usize]);
    if exponent < 0 { "⁻".chars().chain(raised).collect() } else { raised.collect() }
}

/// The largest magnitude of samples.
pub(crate) fn peak(samples: &[f64]) -> f64 {
    samples.iter().fold(0.0, |peak, x| x.abs().max(peak))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(low: f64, high: f64, spread: Spread) -> Vec<String> {
        texts_of(low, high, spread, 5)
    }

    fn texts_of(low: f64, high: f64, spread: Spread, most: usize) -> Vec<String> {
        let scale = Scale { low, high, from: 0.0, to: 1.0, spread };
        scale.ticks(most).into_iter().map(|t| t.text).filter(|t| !t.is_empty()).collect()
    }

    #[test]
    fn ticks_are_round_and_carry_the_digits_they_need() {
        assert_eq!(texts(0.0, 10.0, Spread::Linear), ["0", "2", "4", "6", "8", "10"]);
        assert_eq!(
            texts(-0.3, 0.31, Spread::Linear),
            ["−0.2", "0.0", "0.2"].map(|t| if t == "0.0" { "0" } else { t })
        );
        assert_eq!(texts(0.0, 3e-5, Spread::Linear), ["0", "1×10⁻⁵", "2×10⁻⁵", "3×10⁻⁵"]);
        assert_eq!(texts(10.0, 5000.0, Spread::Log), ["10", "100", "1000"]);
    }

    #[test]
    fn no_axis_is_left_with_a_single_value() {
        assert_eq!(texts_of(-0.17, 0.17, Spread::Linear, 2), ["\u{2212}0.1", "0", "0.1"]);
        for most in 1..12 {
            for step in 1..200 {
                let (low, high) = (0.013 * f64::from(step), 0.9 + 0.02 * f64::from(step));
                for (from, spread) in [(-high, Spread::Linear), (low, Spread::Linear), (low, Spread::Log)] {
                    let texts = texts_of(from, high + low, spread, most);
                    assert!(texts.len() > 1, "{from}..{}: {texts:?} of {most}", high + low);
                }
            }
        }
    }

    #[test]
    fn every_range_can_be_drawn() {
        for values in [vec![], vec![0.0], vec![-3.0], vec![f64::NAN], vec![1e300, -1e300], vec![1e-300]] {
            for spread in [Spread::Linear, Spread::Log] {
                let (low, high) = padded(values.iter().copied(), spread);
                assert!(low < high, "{values:?} {low} {high}");
            }
        }
    }

    #[test]
    fn numbers_in_sentences_keep_three_digits() {
        for (value, shown) in [
            (0.0, "0"),
            (1234.5, "1234"),
            (12.345, "12.3"),
            (-0.5, "\u{2212}0.5"),
            (0.00123456, "0.00123"),
            (1.5e-9, "1.50e\u{2212}9"),
        ] {
            assert_eq!(plain(value), shown);
        }
        assert_eq!(fixed(-2.38, 1), "\u{2212}2.4");
        assert_eq!((fixed(-0.001, 2), fixed(-0.0, 0)), ("0.00".into(), "0".into()));
    }
}
