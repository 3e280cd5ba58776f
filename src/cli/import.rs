//! Command-line flags for facts that tables do not state themselves.

use crate::engine::settings::closest;
use crate::learning::recording::{ImportSettings, QUANTITIES};
use crate::surfaces::provenance::{LICENCE, TOUCH, check_touch};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::ops::RangeInclusive;

/// Flags for reading the tables of other data loggers.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Reading tables")]
pub(super) struct Import {
    /// The column that holds a quantity, such as speed=v_mm_s
    #[arg(long = "column", value_name = "QUANTITY=NAME", value_parser = pair)]
    columns: Vec<(String, String)>,
    #[command(flatten)]
    tables: Tables,
}

/// Import flags other than the columns.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Reading tables")]
pub(super) struct Tables {
    /// The unit of a quantity whose column does not state it, such as accel=g; 1 stands for an unknown unit
    #[arg(long = "unit", value_name = "QUANTITY=UNIT", value_parser = pair)]
    units: Vec<(String, String)>,
    /// A constant quantity, such as speed_mm_s=50
    #[arg(long = "constant", value_name = "QUANTITY_UNIT=VALUE", value_parser = pair)]
    constants: Vec<(String, String)>,
    /// Sampling rate of evenly spaced rows; it replaces their times
    #[arg(long, value_name = "HZ", value_parser = positive)]
    sample_rate: Option<f64>,
    /// The full scale of WAV files, m/s²; default: the value in the note that a run wrote beside the file
    #[arg(long, value_name = "M_S2", value_parser = positive)]
    full_scale: Option<f64>,
    /// Reject what would otherwise be repaired: jittered times, missing or unreadable cells
    #[arg(long)]
    strict: bool,
}

/// Flags for what touched the surface, which recordings rarely state.
#[derive(Debug, Clone, Default, clap::Args)]
#[command(next_help_heading = "What touched the surface")]
pub(super) struct Touch {
    /// Diameter of the tool's tip, mm
    #[arg(long, value_name = "MM", value_parser = |text: &str| touch("tip_diameter_mm", text))]
    tip_diameter: Option<String>,
    /// How the hand held the tool, such as "as a pen"
    #[arg(long, value_name = "TEXT", value_parser = |text: &str| touch("grip", text))]
    grip: Option<String>,
    /// A tool or the bare finger
    #[arg(long, value_name = "tool|finger", value_parser = |text: &str| touch("touched_with", text))]
    touched_with: Option<String>,
    /// Licence under which others may have the recording, such as CC-BY-4.0; its surface contains clips of it
    #[arg(long, value_name = "TEXT", value_parser = |text: &str| touch(LICENCE, text))]
    licence: Option<String>,
}

fn touch(name: &str, text: &str) -> Result<String, String> {
    check_touch(name, text).map(|()| text.to_owned())
}

impl Touch {
    /// The same import settings with these facts.
    pub(super) fn added_to(&self, mut settings: ImportSettings) -> ImportSettings {
        let stated = [&self.tip_diameter, &self.grip, &self.touched_with, &self.licence];
        for (name, value) in TOUCH.into_iter().zip(stated) {
            settings.touch.extend(value.clone().map(|value| (name.to_owned(), value)));
        }
        settings
    }
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    number(text, f64::MIN_POSITIVE..=f64::MAX, "expected a number above 0")
}

/// A number within a range; `refusal` says what is expected.
pub(super) fn number(text: &str, range: RangeInclusive<f64>, refusal: &str) -> Result<f64, String> {
    text.parse().ok().filter(|value| range.contains(value)).ok_or_else(|| refusal.to_owned())
}

/// Values of a flag with their names and help.
pub(super) type Choices<T> = &'static [(&'static str, T, &'static str)];

/// The parser of a flag with such values.
pub(super) fn choice<T: Copy + Send + Sync>(all: Choices<T>) -> impl TypedValueParser<Value = T> {
    let values = all.iter().map(|(name, _, help)| PossibleValue::new(name).help(help));
    let value = |name: String| all.iter().find(|(known, ..)| *known == name).map(|(_, value, _)| *value);
    PossibleValuesParser::new(values).try_map(move |name| value(name).ok_or(""))
}

fn pair(text: &str) -> Result<(String, String), String> {
    let parts = text.split_once('=').map(|(name, value)| (name.trim(), value.trim()));
    match parts {
        Some((name, value)) if !name.is_empty() && !value.is_empty() => {
            Ok((name.to_lowercase(), value.to_owned()))
        }
        _ => Err("expected two parts separated by =".to_owned()),
    }
}

impl Import {
    /// The import settings of these flags.
    pub(super) fn settings(&self) -> Result<ImportSettings, String> {
        self.tables.settings(&self.columns)
    }
}

impl Tables {
    /// The import settings of these flags, with the columns of quantities.
    pub(super) fn settings(&self, columns: &[(String, String)]) -> Result<ImportSettings, String> {
        let settings = ImportSettings {
            rate_hz: self.sample_rate,
            full_scale_m_s2: self.full_scale,
            strict: self.strict,
            ..ImportSettings::default()
        };
        let settings = self.units.iter().try_fold(settings, |s, (name, unit)| {
            s.with_unit(name, unit).map_err(|why| with_nearest(why, name))
        })?;
        let settings = columns.iter().try_fold(settings, |s, (name, column)| with_column(s, name, column))?;
        self.constants.iter().try_fold(settings, |s, (name, value)| s.with_constant(name, value))
    }
}

/// A column, alone or with the quantity it holds.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum NamedColumn {
    /// Column name.
    Plain(String),
    /// Quantity and column name.
    Quantity(String, String),
}

/// Parses `NAME` or `QUANTITY=NAME`. Text with `=` is a column name if its first part is not a quantity.
pub(super) fn named_column(text: &str) -> Result<NamedColumn, String> {
    Ok(match pair(text) {
        Ok((quantity, column)) if QUANTITIES.contains(&&*quantity) => NamedColumn::Quantity(quantity, column),
        _ => NamedColumn::Plain(text.to_owned()),
    })
}

/// Appends the nearest quantity to an error about an unknown one.
fn with_nearest(why: String, name: &str) -> String {
    match closest(name, QUANTITIES).filter(|_| !QUANTITIES.contains(&name)) {
        Some(near) => format!("{why}; did you mean {near}?"),
        None => why,
    }
}

/// Adds a column; the error of swapped parts shows the right order.
fn with_column(settings: ImportSettings, quantity: &str, column: &str) -> Result<ImportSettings, String> {
    let other = settings.clone();
    settings.with_column(quantity, column).map_err(|why| {
        match other.with_column(&column.to_lowercase(), quantity) {
            Ok(_) => format!("{why}; write the quantity first: --column {column}={quantity}"),
            Err(_) => with_nearest(why, quantity),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_and_its_quantity_that_are_swapped_are_noticed() {
        let told =
            |quantity: &str, column: &str| with_column(ImportSettings::default(), quantity, column).err();
        assert_eq!(told("accel", "acc_z"), None);
        let swapped = told("acc_z", "accel").unwrap();
        assert!(swapped.ends_with("--column accel=acc_z"), "{swapped}");
        assert!(!told("acc_z", "acc_y").unwrap().contains("--column"));
        assert!(told("spede", "v").unwrap().ends_with("did you mean speed?"));
    }

    #[test]
    fn a_column_may_be_named_alone_or_with_its_quantity() {
        let plain = |text: &str| NamedColumn::Plain(text.to_owned());
        let of = |quantity: &str, column: &str| NamedColumn::Quantity(quantity.to_owned(), column.to_owned());
        assert_eq!(named_column("acc"), Ok(plain("acc")));
        assert_eq!(named_column("a=b"), Ok(plain("a=b")));
        assert_eq!(named_column("accel=acc [g]"), Ok(of("accel", "acc [g]")));
    }
}
