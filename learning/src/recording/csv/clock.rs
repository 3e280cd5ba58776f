//! Times as loggers write them: numbers from zero, large ones that count from an epoch, and dates with a time of day.

use super::table::number;
use haptograph_signal::units::Scale;

/// A first time beyond this counts from an epoch, whatever its unit.
const EPOCH: f64 = 1e6;

/// Reads a column of times.
///
/// A double holds today's seconds since 1970 to a quarter of a microsecond, which moves samples. So times that count from an epoch are taken
/// from the whole unit of the first one, and wall-clock times from its whole second; others stand as they are.
#[derive(Default)]
pub(super) struct Clock {
    origin: Option<Origin>,
}

/// Origin of the times, from the first that was read.
#[derive(Clone, Copy)]
enum Origin {
    Zero,
    /// An offset in the column's unit.
    Unit(i64),
    /// Seconds of the calendar.
    Second(i64),
}

impl Clock {
    /// A cell in seconds; `None` if it does not hold a time of the same kind as the first.
    pub(super) fn seconds(&mut self, cell: &[u8], scale: Scale) -> Option<f64> {
        let origin = match self.origin {
            Some(origin) => origin,
            None => *self.origin.insert(origin_of(cell)?),
        };
        match origin {
            Origin::Zero => number(cell, scale),
            Origin::Unit(first) => Some(scale.si(since(cell, first)?)),
            Origin::Second(first) => {
                let (second, fraction) = wall_clock(std::str::from_utf8(cell).ok()?)?;
                Some((second - first) as f64 + fraction)
            }
        }
    }

    /// True if the times are dates, which have no unit.
    pub(super) fn is_calendar(&self) -> bool {
        matches!(self.origin, Some(Origin::Second(_)))
    }

    /// Offset that was subtracted from all times, s.
    pub(super) fn origin_s(&self, scale: Scale) -> f64 {
        match self.origin {
            None | Some(Origin::Zero) => 0.0,
            Some(Origin::Unit(first)) => scale.si(first as f64),
            Some(Origin::Second(first)) => first as f64,
        }
    }
}

fn origin_of(cell: &[u8]) -> Option<Origin> {
    match number(cell, Scale::One) {
        Some(time) if time.abs() < EPOCH => Some(Origin::Zero),
        // Whole within the range of i64, as a cast ends there.
        Some(time) => Some(Origin::Unit(time.floor() as i64)),
        None => wall_clock(std::str::from_utf8(cell).ok()?).map(|(second, _)| Origin::Second(second)),
    }
}

/// The number in a cell less a whole one, with all its decimals.
fn since(cell: &[u8], first: i64) -> Option<f64> {
    let text = std::str::from_utf8(cell).ok()?.replace(',', ".");
    let (whole, decimals) = text.split_once('.').unwrap_or((&text, ""));
    let are_digits = !whole.starts_with('-') && decimals.bytes().all(|byte| byte.is_ascii_digit());
    match whole.parse::<i64>() {
        Ok(whole) if are_digits => {
            let fraction: f64 = format!("0.{decimals}").parse().ok()?;
            Some(whole.checked_sub(first)? as f64 + fraction)
        }
        _ => Some(number(cell, Scale::One)? - first as f64),
    }
}

/// Seconds of the calendar, whole and part, of an ISO 8601 date with a time of day: `2026-11-12 14:03:22.123`, with `T` or a space, with or
/// without seconds, decimals and a zone; without one it counts as UTC.
fn wall_clock(text: &str) -> Option<(i64, f64)> {
    let (date, time) = text.trim().split_at_checked(10)?;
    let time = time.strip_prefix(['T', 't', ' '])?.trim_start();
    let mut date = date.split('-');
    let (year, month, day) = (
        digits(date.next()?, 4, 0..=9999)?,
        digits(date.next()?, 2, 1..=12)?,
        digits(date.next()?, 2, 1..=31)?,
    );
    let (time, zone_s) = zoned(time)?;
    let mut parts = time.split(':');
    let (hour, minute) = (digits(parts.next()?, 2, 0..=24)?, digits(parts.next()?, 2, 0..=59)?);
    let (second, fraction) = match parts.next() {
        Some(second) => seconds(second)?,
        None => (0, 0.0),
    };
    let is_time = hour < 24 || (minute, second, fraction) == (0, 0, 0.0);
    let is_whole = date.next().is_none() && parts.next().is_none() && is_time;
    let whole = days(year, month, day) * 86_400 + hour * 3600 + minute * 60 + second - zone_s;
    is_whole.then_some((whole, fraction))
}

/// A time of day and its zone's seconds east of Greenwich, 0 where it has none.
fn zoned(time: &str) -> Option<(&str, i64)> {
    if let Some(time) = time.strip_suffix(['Z', 'z']) {
        return Some((time.trim_end(), 0));
    }
    let Some(at) = time.rfind(['+', '-']) else {
        return Some((time, 0));
    };
    let (time, zone) = time.split_at_checked(at)?;
    let (sign, zone) = zone.split_at_checked(1)?;
    let (hours, minutes) = zone.split_at_checked(2)?;
    let minutes = match minutes.strip_prefix(':').unwrap_or(minutes) {
        "" => 0,
        minutes => digits(minutes, 2, 0..=59)?,
    };
    let east_s = digits(hours, 2, 0..=23)? * 3600 + minutes * 60;
    Some((time.trim_end(), if sign == "-" { -east_s } else { east_s }))
}

fn seconds(text: &str) -> Option<(i64, f64)> {
    let (whole, decimals) = text.split_once(['.', ',']).unwrap_or((text, ""));
    if !decimals.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let fraction = format!("0.{decimals}").parse().ok()?;
    Some((digits(whole, 2, 0..=60)?, fraction))
}

fn digits(text: &str, count: usize, allowed: std::ops::RangeInclusive<i64>) -> Option<i64> {
    let is_number = text.len() == count && text.bytes().all(|byte| byte.is_ascii_digit());
    let value = is_number.then(|| text.parse().ok()).flatten()?;
    allowed.contains(&value).then_some(value)
}

/// Days from 1 March of the year 0 to 1970.
const TO_1970: i64 = 719_468;

/// Days of the calendar since 1970. Years begin in March, so that a leap day is the last of one.
fn days(year: i64, month: i64, day: i64) -> i64 {
    let (year, month) = match month {
        1 | 2 => (year - 1, month + 9),
        _ => (year, month - 3),
    };
    let leap = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    365 * year + leap + (153 * month + 2) / 5 + day - 1 - TO_1970
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(cells: &[&str], scale: Scale) -> Vec<Option<f64>> {
        let mut clock = Clock::default();
        let all = cells.iter().map(|cell| clock.seconds(cell.as_bytes(), scale));
        all.collect()
    }

    #[test]
    fn times_since_an_epoch_keep_their_decimals() {
        let cells = ["1794492202.000400", "1794492202.0008", "1794492203", "x"];
        let expected = [Some(0.0004), Some(0.0008), Some(1.0), None];
        assert_eq!(read(&cells, Scale::One), expected);
        let ms = ["1794492202000,5", "1794492203001.5"];
        assert_eq!(read(&ms, Scale::Thousandth), [Some(0.0005), Some(1.0015)]);
        assert_eq!(read(&["5.25", "6"], Scale::One), [Some(5.25), Some(6.0)]);
    }

    #[test]
    fn wall_clock_times_are_read_with_their_zone_and_over_midnight() {
        let cells = [
            "2026-12-31 23:59:58.25",
            "2026-12-31T23:59:59,75",
            "2027-01-01T00:00:00Z",
            "2027-01-01T01:00:01+01:00",
            "2026-12-31T19:00:02.5-0500",
            "2027-01-01 00:01",
        ];
        let expected = [0.25, 1.75, 2.0, 3.0, 4.5, 62.0].map(Some);
        assert_eq!(read(&cells, Scale::One), expected);
        assert_eq!(days(2028, 3, 1) - days(2028, 2, 28), 2);
        assert_eq!(days(2100, 3, 1) - days(2100, 2, 28), 1);
        for wrong in [
            "2026-13-01 00:00:00",
            "2026-12-01",
            "2026-12-01 25:00:00",
            "2026-12-01 5:00:00",
            "2026-12-01 05:00:00.x",
            "2026-12-01 05:00:00+1",
            "12.11.2026 14:03:22",
        ] {
            assert_eq!(read(&[wrong], Scale::One), [None], "{wrong}");
        }
    }
}
