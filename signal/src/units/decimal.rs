//! Converts numbers between a file's mm/s and m/s in memory exactly: in decimal, a factor of a thousand only moves the
//! point. (Multiplying and dividing doubles by 1000 loses bits.)

/// A thousandth of the decimal number `text`, correctly rounded.
pub fn parse_thousandth(text: &str) -> Option<f64> {
    parse_shifted(text, -3)
}

/// The decimal number `text` with its point moved right by `places`, correctly rounded.
pub fn parse_shifted(text: &str, places: i32) -> Option<f64> {
    let text = text.trim();
    if let Some(value) = short_shifted(text, places) {
        return Some(value);
    }
    let is_digit = |c: char| c.is_ascii_digit();
    // Texts such as "inf", which `f64::from_str` accepts, have no decimal point.
    if !text.contains(is_digit) {
        return None;
    }
    let (digits, exponent) = match text.split_once(['e', 'E']) {
        // The clamp prevents overflow; beyond it every number is zero or infinite.
        Some((digits, exponent)) => (digits, parse_exponent(exponent)?),
        None => (text, 0),
    };
    format!("{digits}e{}", exponent + i64::from(places)).parse().ok()
}

/// Like [`parse_shifted`], for short plain numbers, which are the most frequent in tables: a whole number below 2^53 and a
/// power of ten up to 10^22 are both exact, so that only their product or quotient is rounded.
fn short_shifted(text: &str, places: i32) -> Option<f64> {
    let bare = text.strip_prefix('-').unwrap_or(text);
    let (mut whole, mut digits, mut fraction) = (0_u64, 0, None);
    for byte in bare.bytes() {
        match byte {
            b'0'..=b'9' if digits < 15 => {
                whole = 10 * whole + u64::from(byte - b'0');
                digits += 1;
                fraction = fraction.map(|places: i32| places + 1);
            }
            b'.' if fraction.is_none() => fraction = Some(0),
            _ => return None,
        }
    }
    let places = places.checked_sub(fraction.unwrap_or(0))?;
    let power = *POWERS_OF_TEN.get(places.unsigned_abs() as usize)?;
    let whole = whole as f64;
    let value = if places < 0 { whole / power } else { whole * power };
    (digits > 0).then_some(if bare.len() < text.len() { -value } else { value })
}

const POWERS_OF_TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

fn parse_exponent(text: &str) -> Option<i64> {
    let digits = text.strip_prefix(['+', '-']).unwrap_or(text);
    if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let size = digits.parse::<i64>().unwrap_or(i64::MAX).min(1_000_000);
    Some(if text.starts_with('-') { -size } else { size })
}

/// A thousand times `value`, as the shortest decimal number that [`parse_thousandth`] converts back to the same bits.
pub fn format_thousandfold(value: f64) -> String {
    format_shifted(value, 3)
}

/// `value` as the shortest decimal number with its point moved right by `places`. [`parse_shifted`] with `-places` converts it
/// back to the same bits.
pub fn format_shifted(value: f64, places: i32) -> String {
    if value == 0.0 {
        return format!("{value:?}");
    }
    let scientific = format!("{value:e}");
    let Some((digits, exponent)) = scientific.split_once('e') else {
        return scientific;
    };
    let exponent = exponent.parse::<i32>().unwrap_or(0) + places;
    if !(-5..=15).contains(&exponent) {
        return format!("{digits}e{exponent}");
    }
    let (sign, digits) = digits.strip_prefix('-').map_or(("", digits), |digits| ("-", digits));
    let digits: String = digits.chars().filter(|&c| c != '.').collect();
    let point = exponent + 1;
    if point <= 0 {
        return format!("{sign}0.{}{digits}", "0".repeat(-point as usize));
    }
    let point = point as usize;
    match digits.len() {
        short if short <= point => format!("{sign}{digits}{}.0", "0".repeat(point - short)),
        _ => format!("{sign}{}.{}", &digits[..point], &digits[point..]),
    }
}

/// Formats a number with `digits` significant digits, without trailing zeros.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..=6).contains(&exponent) {
        return format!("{value:.*e}", digits.saturating_sub(1));
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_point_moves_by_three() {
        for (value, text) in [
            (0.0, "0.0"),
            (0.2, "200.0"),
            (0.24226926, "242.26926"),
            (0.000001, "0.001"),
            (1234.5, "1234500.0"),
            (1e-30, "1e-27"),
            (-0.04, "-40.0"),
        ] {
            assert_eq!(format_thousandfold(value), text);
            assert_eq!(parse_thousandth(text), Some(value));
        }
        assert_eq!(parse_thousandth("40"), Some(0.04));
        assert_eq!(parse_thousandth(" 4.0E1 "), Some(0.04));
        assert_eq!(parse_thousandth("1e99999999999999999999"), Some(f64::INFINITY));
        for wrong in ["", "inf", "NaN", "1e", "1e+", "1e2e3", "--1", "1 2", "0x1"] {
            assert_eq!(parse_thousandth(wrong), None, "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn every_bit_survives(bits in any::<u64>()) {
            let value = f64::from_bits(bits);
            prop_assume!(value.is_finite());
            let back = parse_thousandth(&format_thousandfold(value)).unwrap();
            prop_assert_eq!(back.to_bits(), value.to_bits());
        }

        #[test]
        fn short_numbers_are_those_of_the_standard_library(text in "-?[0-9]{0,9}\\.?[0-9]{0,9}", places in -25_i32..25) {
            let wanted = format!("{text}e{places}").parse::<f64>().ok();
            prop_assert_eq!(parse_shifted(&text, places).map(f64::to_bits), wanted.map(f64::to_bits));
        }

        #[test]
        fn a_files_decimals_come_back_as_written(thousandths in 0u32..10_000_000) {
            let text = format!("{}.{:03}", thousandths / 1000, thousandths % 1000);
            let back = format_thousandfold(parse_thousandth(&text).unwrap());
            prop_assert_eq!(back.parse::<f64>().unwrap(), text.parse::<f64>().unwrap());
        }
    }
}
