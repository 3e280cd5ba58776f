//! Selection of the columns of a file, with their quantities and scales.

use super::{Column, SIGNAL, TIME, Table, is_vibration};
use crate::recording::ReadError;
use crate::recording::csv::alias::{is_like_ours, taken_as};
use crate::recording::csv::units::{QUANTITIES, is_of, parse_unit, plain_name, unit_in_file, unit_of_column};
use crate::recording::error::listed;
use crate::recording::import::{Finding, ImportSettings};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::Scale;

/// The columns of a table to read.
#[derive(Debug, Clone, Copy)]
pub(in crate::recording) enum ColumnSelection<'a> {
    /// The columns of a recording.
    Recording,
    /// Time, and the column of this name; without a name, the acceleration or the only other column.
    Signal(Option<&'a str>),
    /// The column of this name, without unit conversion.
    Unscaled(&'a str),
    /// Time, current and acceleration of an actuator.
    Sweep,
}

/// Index and scale of a column to read.
pub(super) type Chosen = (usize, Scale);

/// True if a column of that name is read.
pub(in crate::recording) fn is_wanted(
    name: &str,
    import: &ImportSettings,
    wanted: ColumnSelection<'_>,
) -> bool {
    let is = |requested: &str| requested.trim().eq_ignore_ascii_case(name);
    match wanted {
        ColumnSelection::Unscaled(requested) => is(requested),
        ColumnSelection::Signal(Some(requested)) => {
            is(requested) || plain(name, import).is_some_and(|plain| plain == "time")
        }
        ColumnSelection::Recording | ColumnSelection::Signal(None) => {
            plain(name, import).is_some() || is_like_ours(name)
        }
        ColumnSelection::Sweep => plain(name, import).is_some() || is_of(name, "", Quantity::CURRENT),
    }
}

impl Table {
    /// Selects the columns to read, and records the others as a finding.
    pub(super) fn choose(
        &mut self,
        import: &ImportSettings,
        wanted: ColumnSelection<'_>,
    ) -> Result<Vec<Chosen>, ReadError> {
        let names = std::mem::take(&mut self.names);
        let units = std::mem::take(&mut self.units);
        let chosen = match wanted {
            ColumnSelection::Unscaled(name) => self.find(&names, name).map(|index| {
                self.columns.push(Column::new(SIGNAL.to_owned(), &names[index], index));
                vec![(index, Scale::One)]
            }),
            _ => self.chosen(&names, &units, import, wanted),
        };
        (self.names, self.units) = (names, units);
        let chosen = chosen?;
        if matches!(wanted, ColumnSelection::Recording) {
            let is_unused = |&(index, name): &(usize, &String)| {
                let is_said =
                    |finding: &Finding| matches!(finding, Finding::TimesNotUsed { column } if column == name);
                !name.is_empty()
                    && !chosen.iter().any(|(chosen, _)| *chosen == index)
                    && !self.findings.iter().any(is_said)
            };
            let unused = self.names.iter().enumerate().filter(is_unused);
            let columns: Vec<String> = unused.map(|(_, name)| name.clone()).collect();
            if !columns.is_empty() {
                self.findings.push(Finding::NotUsed { columns });
            }
        }
        Ok(chosen)
    }

    fn chosen(
        &mut self,
        names: &[String],
        units: &[String],
        import: &ImportSettings,
        wanted: ColumnSelection<'_>,
    ) -> Result<Vec<Chosen>, ReadError> {
        let below = |index: usize| units.get(index).map_or("", String::as_str);
        let mut plain: Vec<Option<String>> = names.iter().map(|name| self::plain(name, import)).collect();
        if matches!(wanted, ColumnSelection::Recording | ColumnSelection::Signal(None)) {
            let has_rate = import.rate_hz.is_some() || self.notes.contains_key("rate_hz");
            let is_signal = !matches!(wanted, ColumnSelection::Recording);
            let taken = taken_as(names, units, &mut plain, import, has_rate, is_signal).into_iter();
            let is_read = |finding: &Finding| match finding {
                Finding::TakenAs { quantity, .. } => is_vibration(quantity) || quantity == TIME,
                _ => true,
            };
            let is_all = matches!(wanted, ColumnSelection::Recording);
            self.findings.extend(taken.filter(|finding| is_all || is_read(finding)));
        }
        match wanted {
            ColumnSelection::Unscaled(_) | ColumnSelection::Recording => {}
            ColumnSelection::Sweep => self.choose_sweep(names, units, &mut plain)?,
            ColumnSelection::Signal(requested) => self.choose_signal(names, requested, &mut plain)?,
        }
        let mut chosen = vec![];
        for (index, (name, plain)) in names.iter().zip(plain).enumerate() {
            let Some(plain) = plain else { continue };
            if plain == TIME && import.rate_hz.is_some() {
                let column = name.clone();
                self.findings.push(Finding::TimesNotUsed { column });
                continue;
            }
            if self.has(&plain) {
                let message =
                    format!("two columns are read as {plain}; choose one with --column {plain}=NAME");
                return Err(self.cell_error(self.header_line, index + 1, message));
            }
            let mut column = Column::new(plain, name, index);
            let scale = self.scale(&mut column, below(index), import);
            let scale = scale.map_err(|message| self.cell_error(self.header_line, index + 1, message))?;
            chosen.push((index, scale));
            self.columns.push(column);
        }
        Ok(chosen)
    }

    /// The scale of a column, with findings about its unit.
    fn scale(&mut self, column: &mut Column, below: &str, import: &ImportSettings) -> Result<Scale, String> {
        if column.name == SIGNAL {
            let (scale, unit) = scale_of_signal(&column.header, below, import)?;
            column.unit = unit;
            return Ok(scale);
        }
        match scale(&column.header, below, &column.name, import) {
            // Times of a calendar have no unit: what they are is seen at the first row.
            Err(message) if column.name == TIME => {
                self.time_without_unit = Some(message);
                Ok(Scale::One)
            }
            Err(message) => Err(message),
            Ok((scale, contradicted)) => {
                let column_of = |given| Finding::OtherUnit { column: column.header.clone(), given };
                self.findings.extend(contradicted.map(column_of));
                if column.name == TIME {
                    self.time_scale = scale;
                }
                Ok(scale)
            }
        }
    }

    /// Keeps the requested column as the signal, else the acceleration or the only column; and the times.
    fn choose_signal(
        &self,
        names: &[String],
        requested: Option<&str>,
        plain: &mut [Option<String>],
    ) -> Result<(), ReadError> {
        let has = |wanted: &str| plain.iter().flatten().any(|plain| plain == wanted);
        let has_accel = has("accel");
        let has_axes = ["accel_x", "accel_y", "accel_z"].into_iter().all(has);
        let signal = match requested {
            Some(name) => Some(self.find(names, name)?),
            None if has_accel || has_axes => None,
            None => {
                let is_other =
                    |&index: &usize| plain[index].as_deref() != Some(TIME) && !names[index].is_empty();
                match (0..names.len()).filter(is_other).collect::<Vec<_>>()[..] {
                    [index] => Some(index),
                    _ => {
                        let message = format!(
                            "cannot choose the signal; select a column with --column: {}",
                            listed(names)
                        );
                        return Err(self.error(self.header_line, message));
                    }
                }
            }
        };
        for (index, plain) in plain.iter_mut().enumerate() {
            let is_kept = match (signal, plain.as_deref()) {
                (_, Some(TIME)) | (None, Some("accel")) => true,
                (None, Some(axis)) => !has_accel && axis.starts_with("accel_"),
                _ => false,
            };
            if signal == Some(index) {
                *plain = Some(SIGNAL.to_owned());
            } else if !is_kept {
                *plain = None;
            }
        }
        Ok(())
    }

    /// Finds the only columns of current and acceleration, unless the settings name them.
    fn choose_sweep(
        &self,
        names: &[String],
        units: &[String],
        plain: &mut [Option<String>],
    ) -> Result<(), ReadError> {
        for (quantity, wanted) in [(Quantity::CURRENT, "current"), (Quantity::ACCELERATION, "accel")] {
            if plain.iter().flatten().any(|plain| plain == wanted) {
                continue;
            }
            let below = |index: usize| units.get(index).map_or("", String::as_str);
            let fitting = (0..names.len()).filter(|&index| is_of(&names[index], below(index), quantity));
            match fitting.collect::<Vec<_>>()[..] {
                [] => {}
                [index] => plain[index] = Some(wanted.to_owned()),
                [first, ..] => {
                    let message = format!(
                        "several columns have a unit of {wanted}; select one, such as --column {wanted}={:?}",
                        names[first]
                    );
                    return Err(self.error(self.header_line, message));
                }
            }
        }
        for plain in plain.iter_mut() {
            let is_ours = |plain: &String| ["time", "current", "accel"].contains(&plain.as_str());
            *plain = plain.take().filter(is_ours);
        }
        Ok(())
    }

    /// Finds a column by name; ignores case if no name matches exactly.
    fn find(&self, names: &[String], requested: &str) -> Result<usize, ReadError> {
        let exact = names.iter().position(|known| known == requested.trim());
        let found =
            exact.or_else(|| names.iter().position(|known| known.eq_ignore_ascii_case(requested.trim())));
        found.ok_or_else(|| {
            let message = format!("there is no column {requested:?}; the columns are {}", listed(names));
            self.error(self.header_line, message)
        })
    }
}

/// The quantity of a column, from the settings or else from its name.
fn plain(name: &str, import: &ImportSettings) -> Option<String> {
    if let Some((plain, _)) = import.columns.iter().find(|(_, column)| *column == name) {
        return Some(plain.clone());
    }
    let (plain, _) = plain_name(&name.to_lowercase())?;
    // A mapping in the settings overrides the column's name.
    let is_elsewhere = import.columns.contains_key(&plain) || import.constants.contains_key(&plain);
    (QUANTITIES.contains(&&*plain) && !is_elsewhere).then_some(plain)
}

/// The scale and the SI unit of a signal: those of the settings, or else of the file, or else none.
fn scale_of_signal(
    name: &str,
    below: &str,
    import: &ImportSettings,
) -> Result<(Scale, Option<&'static str>), String> {
    if let Some(unit) = import.units.get("accel").filter(|unit| *unit != "1") {
        return Ok((parse_unit("accel", unit)?, Some("m/s2")));
    }
    let own = unit_of_column(name, below);
    Ok(own.map_or((Scale::One, None), |(scale, unit)| (scale, Some(unit))))
}

/// The scale of a column, and the given unit if it contradicts the file's.
fn scale(
    name: &str,
    below: &str,
    plain: &str,
    import: &ImportSettings,
) -> Result<(Scale, Option<String>), String> {
    let is_mapped = import.columns.get(plain).is_some_and(|column| column == name);
    // The unit of `accel` is that of its axes too.
    let whole = plain.split('_').next().unwrap_or(plain);
    let given = import.units.get(plain).or_else(|| import.units.get(whole));
    let own = unit_in_file(name, below, plain, is_mapped);
    let Some(unit) = given else {
        return own.map(|scale| (scale, None));
    };
    let scale = parse_unit(plain, unit)?;
    let contradicts = unit.trim() != "1" && own.is_ok_and(|own| own != scale);
    Ok((scale, contradicts.then(|| format!("{plain}={unit}"))))
}
