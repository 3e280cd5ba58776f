//! Samples at an even rate from the rows of a table, which are repaired if that is allowed and refused otherwise.

use super::{Column, Fault, SIGNAL, Table, is_vibration};
use crate::recording::csv::units::plain_name;
use crate::recording::import::{
    Finding, Timing, clipped, interpolate_missing, remove_offset, remove_outliers, resampled, shown, timing,
    too_large,
};
use crate::recording::{ReadError, Series};
use haptograph_surfaces::bounds::{self, RATES, RATES_HZ};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Longest run of missing acceleration rows that is interpolated.
const LONGEST_REPAIR: usize = 5;
/// Longest run of missing values that is interpolated for slower quantities, s.
const LONGEST_SLOW_REPAIR_S: f64 = 0.05;
/// Lowest plausible rate of a vibration, Hz: below it the time column has the wrong unit.
const PLAUSIBLE_HZ: f64 = 100.0;

/// Samples of several columns at an even rate.
pub(in crate::recording) struct Even {
    pub rate_hz: f64,
    pub start_s: f64,
    pub columns: Vec<Vec<f64>>,
}

impl Even {
    /// Number of samples.
    pub(crate) fn samples(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// Time of the last sample, s.
    pub(crate) fn end_s(&self) -> f64 {
        self.start_s + self.samples().saturating_sub(1) as f64 / self.rate_hz
    }

    /// Sample `index` of the columns from `first` on.
    pub(crate) fn at<const N: usize>(&self, index: usize, first: usize) -> [f64; N] {
        std::array::from_fn(|column| self.columns[first + column][index])
    }

    /// A series of what `sample` makes of each index.
    pub(crate) fn series<T>(&self, sample: impl Fn(usize) -> T) -> Series<T> {
        let samples = (0..self.samples()).map(sample).collect();
        Series { rate_hz: self.rate_hz, start_s: self.start_s, samples }
    }
}

/// The rows that samples are taken from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::recording) enum Taken {
    /// All; what is missing in few of them is interpolated, or refused if that is not allowed.
    All,
    /// Those where the columns of one sensor have values; the others are those of faster sensors.
    Filled,
}

/// One signal, or its three axes.
pub(in crate::recording) struct SignalColumns {
    pub name: String,
    pub unit: Option<&'static str>,
    pub rate_hz: Option<f64>,
    pub values: Vec<Vec<f64>>,
}

impl Table {
    /// Treats a vibration on one axis as unprocessed if it has a mean that no processed vibration has.
    pub(in crate::recording) fn take_offset(
        &mut self,
        column: &str,
        has_unit: bool,
        values: &mut Vec<f64>,
        rate_hz: f64,
    ) -> Result<(), ReadError> {
        let Some(found) = remove_offset(column, has_unit, values, rate_hz) else {
            return Ok(());
        };
        if self.strict {
            let message = format!("{found}; --strict does not allow this");
            return Err(self.error(self.header_line, message));
        }
        self.findings.push(found);
        Ok(())
    }

    fn rate_without_times(&self) -> Result<Option<f64>, ReadError> {
        match self.given_rate_hz {
            Some(rate_hz) if !RATES_HZ.contains(&rate_hz) => {
                let message = format!("the given rate is {rate_hz} Hz; it must be {RATES}");
                Err(self.error(self.header_line, message))
            }
            Some(rate_hz) => Ok(Some(rate_hz)),
            None if self.has("time") => Ok(None),
            None => noted_rate_hz(&self.notes),
        }
    }

    /// The rate and start of the samples in these rows, with their times if they have to be resampled.
    fn timing(&self, rows: Option<&[usize]>) -> Result<(Timing, Vec<f64>), ReadError> {
        if let Some(rate_hz) = self.rate_without_times()? {
            let timing = Timing { rate_hz, start_s: 0.0, is_uneven: false, finding: None };
            return Ok((timing, vec![]));
        }
        let place = self.needed("time")?;
        let all = &self.columns[place].values;
        let mut times = match rows {
            Some(rows) => Cow::Owned(rows.iter().map(|&row| all[row]).collect()),
            None => Cow::Borrowed(&all[..]),
        };
        let line =
            |index: usize| self.lines.of(rows.map_or(index, |rows| rows.get(index).copied().unwrap_or(0)));
        self.check_bound(place, &times, line)?;
        let longest = if self.strict { 0 } else { LONGEST_REPAIR };
        if !times.iter().all(|time| time.is_finite()) {
            interpolate_missing(times.to_mut(), longest)
                .map_err(|at| self.error(line(at.start), "time is missing"))?;
        }
        let mut found =
            timing(&times, self.strict).map_err(|(index, message)| self.error(line(index), message))?;
        if !RATES_HZ.contains(&found.rate_hz) {
            let strange = self.strange_rate(found.rate_hz).map(|strange| strange.to_string());
            let what = strange.unwrap_or_else(|| format!("the rows come at {} Hz", shown(found.rate_hz)));
            return Err(self.error(self.header_line, format!("{what}; the rate must be {RATES}")));
        }
        found.start_s += self.since_s;
        let times = if found.is_uneven { times.into_owned() } else { vec![] };
        Ok((found, times))
    }

    /// The samples of columns, which are taken out of the table, at one rate.
    pub(in crate::recording) fn conform(&mut self, names: &[&str], rows: Taken) -> Result<Even, Fault> {
        self.conformed(names, rows).map_err(|error| self.at_fault(error))
    }

    fn conformed(&mut self, names: &[&str], taken: Taken) -> Result<Even, ReadError> {
        let places: Vec<usize> = names.iter().map(|name| self.needed(name)).collect::<Result<_, _>>()?;
        let rows = match taken {
            Taken::All => None,
            Taken::Filled => Some(self.filled(names, &places)?),
        };
        let (timing, times) = self.timing(rows.as_deref())?;
        let mut columns = vec![];
        for (name, place) in names.iter().zip(places) {
            let mut values = std::mem::take(&mut self.columns[place].values);
            if let Some(rows) = &rows {
                values = rows.iter().map(|&row| values[row]).collect();
            }
            let line = |index: usize| self.lines.of(rows.as_ref().map_or(index, |rows| rows[index]));
            self.check_bound(place, &values, line)?;
            self.inspect(name, &values, &timing);
            match &rows {
                None => self.repair(name, place, &mut values, timing.rate_hz)?,
                Some(rows) => self.fill(name, place, &mut values, rows)?,
            }
            columns.push(match timing.is_uneven {
                true => resampled(&times, &values, &timing, is_vibration(name)),
                false => values,
            });
        }
        // Of several columns that are taken one after another.
        let found = timing.finding.filter(|finding| !self.findings.contains(finding));
        self.findings.extend(found);
        Ok(Even { rate_hz: timing.rate_hz, start_s: timing.start_s, columns })
    }

    /// The rows where the columns of a sensor have values.
    fn filled(&self, names: &[&str], places: &[usize]) -> Result<Vec<usize>, ReadError> {
        let mut rows = vec![];
        for row in 0..self.lines.rows() {
            let there = places.iter().filter(|&&place| !self.columns[place].values[row].is_nan()).count();
            if there == names.len() {
                rows.push(row);
            } else if there > 0 {
                let message = format!("{} must all have values or all be empty", names.join(", "));
                return Err(self.error(self.lines.of(row), message));
            }
        }
        Ok(rows)
    }

    /// Interpolates what could not be read in the rows of a sensor.
    fn fill(
        &mut self,
        name: &str,
        place: usize,
        values: &mut [f64],
        rows: &[usize],
    ) -> Result<(), ReadError> {
        let unreadable = interpolate_missing(values, LONGEST_REPAIR).map_err(|at| {
            let message = format!("{name} is unreadable in {} rows from here on", at.len());
            self.cell_error(self.lines.of(rows[at.start]), self.columns[place].number, message)
        })?;
        if unreadable > 0 {
            self.note_interpolated(place, [unreadable, 0], values.len());
        }
        Ok(())
    }

    fn repair(
        &mut self,
        name: &str,
        place: usize,
        values: &mut [f64],
        rate_hz: f64,
    ) -> Result<(), ReadError> {
        let Column { number, unreadable, .. } = self.columns[place];
        let at = |row: usize, message: String| self.cell_error(self.lines.of(row), number, message);
        if self.strict {
            return match values.iter().position(|x| x.is_nan()) {
                Some(row) if name != SIGNAL => {
                    Err(self.error(self.lines.of(row), format!("{name} is missing")))
                }
                _ => self.refuse_empty(place, values),
            };
        }
        let longest = match is_vibration(name) {
            true => LONGEST_REPAIR,
            false => ((LONGEST_SLOW_REPAIR_S * rate_hz).ceil() as usize).max(LONGEST_REPAIR),
        };
        let of = values.len();
        let count = interpolate_missing(values, longest).map_err(|missing| {
            let rows = missing.len();
            at(
                missing.start,
                format!("{name} is missing in {rows} rows from here on; at most {longest} can be interpolated; cut the file here"),
            )
        })?;
        let outliers = remove_outliers(values).len();
        if count > 0 {
            self.note_interpolated(place, [unreadable, count.saturating_sub(unreadable)], of);
        }
        if outliers > 0 {
            self.findings.push(Finding::Outliers { quantity: name.to_owned(), count: outliers });
        }
        Ok(())
    }

    fn note_interpolated(&mut self, place: usize, [unreadable, empty]: [usize; 2], of: usize) {
        let column = &self.columns[place];
        self.findings.push(Finding::Interpolated {
            quantity: column.name.clone(),
            unreadable,
            empty,
            of,
            first: column.first_unreadable.clone().filter(|_| self.has_lines),
        });
    }

    /// Refuses a number that no sensor gives, at its cell; `line` is that of an index.
    fn check_bound(
        &self,
        place: usize,
        values: &[f64],
        line: impl Fn(usize) -> u64,
    ) -> Result<(), ReadError> {
        let Column { name, header, number, .. } = &self.columns[place];
        let Some((most, unit)) = bounds::largest(name) else {
            return Ok(());
        };
        // What could not be read is infinite.
        let is_beyond = |x: &f64| x.is_finite() && x.abs() > most;
        match values.iter().position(is_beyond) {
            None => Ok(()),
            Some(index) => {
                let value = shown(values[index]);
                let advice = too_large(name);
                let message = format!(
                    "{header} is {value} {unit} here; at most {} {unit} is read: {advice}",
                    shown(most)
                );
                Err(self.cell_error(line(index), *number, message))
            }
        }
    }

    /// The finding about a rate whose times probably have another unit.
    fn strange_rate(&self, rate_hz: f64) -> Option<Finding> {
        let column = self.header_of("time").filter(|_| !self.clock.is_calendar())?.to_owned();
        Some(Finding::StrangeRate { column, rate_hz })
    }

    /// Adds findings about a vibration that no repair can correct.
    fn inspect(&mut self, name: &str, values: &[f64], timing: &Timing) {
        if !is_vibration(name) {
            return;
        }
        if self.given_rate_hz.is_none()
            && timing.rate_hz < PLAUSIBLE_HZ
            && let Some(finding) = self.strange_rate(timing.rate_hz)
            && !self.findings.contains(&finding)
        {
            self.findings.push(finding);
        }
        let count = clipped(values).len();
        if count > 0 {
            self.findings.push(Finding::Clipped { quantity: name.to_owned(), count, of: values.len() });
        }
    }

    /// The column that was selected as a signal, without unit conversion. In the table of a raw recording, where slower
    /// sensors leave cells empty, empty cells are skipped.
    pub(in crate::recording) fn unscaled(&mut self) -> Result<Vec<f64>, ReadError> {
        let place = self.needed(SIGNAL)?;
        let mut values = std::mem::take(&mut self.columns[place].values);
        match self.is_raw() {
            true => values.retain(|value| !value.is_nan()),
            false => self.refuse_empty(place, &values)?,
        }
        Ok(values)
    }

    fn refuse_empty(&self, place: usize, values: &[f64]) -> Result<(), ReadError> {
        let Column { number, header, .. } = &self.columns[place];
        match values.iter().position(|value| value.is_nan()) {
            Some(row) => {
                let message = format!("the cell of {header} is empty");
                Err(self.cell_error(self.lines.of(row), *number, message))
            }
            None => Ok(()),
        }
    }

    fn is_raw(&self) -> bool {
        let quantity = |name: &String| plain_name(&name.to_lowercase()).map(|(plain, _)| plain);
        let has = |wanted: &str| self.names.iter().filter_map(quantity).any(|name| name == wanted);
        has("accel_x") && (has("force_x") || has("position_x"))
    }

    /// The columns that were selected as a signal, their name and unit, and their rate if known.
    pub(in crate::recording) fn signal(&mut self) -> Result<SignalColumns, ReadError> {
        let is_signal = |column: &&Column| column.name != "time";
        let chosen: Vec<&Column> = self.columns.iter().filter(is_signal).collect();
        let names: Vec<String> = chosen.iter().map(|column| column.name.clone()).collect();
        let headers: Vec<&str> = chosen.iter().map(|column| &*column.header).collect();
        let name = headers.join(", ");
        let unit = match &chosen[..] {
            [column] if column.name == SIGNAL => column.unit,
            _ => self.knows_unit.then_some("m/s2"),
        };
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let has_rate = !self.lacks_rate();
        if !has_rate {
            self.given_rate_hz = Some(*RATES_HZ.start());
        }
        let rows = if self.is_raw() { Taken::Filled } else { Taken::All };
        let Even { rate_hz, columns: values, .. } = self.conformed(&names, rows)?;
        Ok(SignalColumns { name, unit, rate_hz: has_rate.then_some(rate_hz), values })
    }
}

/// The rate from a line `# rate_hz: ...`.
pub(in crate::recording) fn noted_rate_hz(
    notes: &BTreeMap<String, String>,
) -> Result<Option<f64>, ReadError> {
    let Some(text) = notes.get("rate_hz") else {
        return Ok(None);
    };
    match text.parse::<f64>() {
        Ok(rate) if RATES_HZ.contains(&rate) => Ok(Some(rate)),
        _ => Err(ReadError::Io(format!("the file's rate_hz is {text}; it must be a number {RATES}"))),
    }
}
