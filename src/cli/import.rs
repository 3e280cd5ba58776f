//! Flags that say what loggers' files do not.

use crate::engine::settings::closest;
use crate::surfaces::recording::{ImportSettings, QUANTITIES};

/// How files of other people's loggers are read.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Reading tables")]
pub struct Import {
    /// The column that holds a quantity, such as speed=v_mm_s
    #[arg(long = "column", value_name = "QUANTITY=NAME", value_parser = pair)]
    columns: Vec<(String, String)>,
    #[command(flatten)]
    tables: Tables,
}

/// What is said of tables besides their columns.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Reading tables")]
pub struct Tables {
    /// The unit of a quantity whose column does not name it, such as accel=g; 1 is a unit that is not known
    #[arg(long = "unit", value_name = "QUANTITY=UNIT", value_parser = pair)]
    units: Vec<(String, String)>,
    /// A quantity that did not change, such as speed_mm_s=50
    #[arg(long = "constant", value_name = "QUANTITY_UNIT=VALUE", value_parser = pair)]
    constants: Vec<(String, String)>,
    /// Samples a second: rows follow evenly, whatever their times
    #[arg(long, value_name = "HZ", value_parser = positive)]
    sample_rate: Option<f64>,
    /// What the full scale of WAV files is, m/s²; the note that a run wrote beside the file where it is not given
    #[arg(long, value_name = "M_S2", value_parser = positive)]
    full_scale: Option<f64>,
    /// Refuse what would be repaired: jittered times, missing or unreadable cells
    #[arg(long)]
    strict: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("a number above 0 is expected".to_owned()),
    }
}

fn pair(text: &str) -> Result<(String, String), String> {
    let parts = text
        .split_once('=')
        .map(|(name, value)| (name.trim(), value.trim()));
    match parts {
        Some((name, value)) if !name.is_empty() && !value.is_empty() => {
            Ok((name.to_lowercase(), value.to_owned()))
        }
        _ => Err("two parts with = between them are expected".to_owned()),
    }
}

impl Import {
    /// What the flags say.
    pub fn settings(&self) -> Result<ImportSettings, String> {
        self.tables.settings(&self.columns)
    }
}

impl Tables {
    /// What the flags say, with the columns that hold quantities.
    pub fn settings(&self, columns: &[(String, String)]) -> Result<ImportSettings, String> {
        let settings = ImportSettings {
            rate_hz: self.sample_rate,
            full_scale_m_s2: self.full_scale,
            strict: self.strict,
            ..ImportSettings::default()
        };
        let settings = self.units.iter().try_fold(settings, |s, (name, unit)| {
            s.with_unit(name, unit).map_err(|why| with_nearest(why, name))
        })?;
        let settings = columns
            .iter()
            .try_fold(settings, |s, (name, column)| with_column(s, name, column))?;
        self.constants
            .iter()
            .try_fold(settings, |s, (name, value)| s.with_constant(name, value))
    }
}

/// A column, or the quantity and the column that holds it.
#[derive(Debug, Clone, PartialEq)]
pub enum NamedColumn {
    /// A column by its name.
    Plain(String),
    /// A quantity and its column.
    Quantity(String, String),
}

/// What stands before = is a quantity, unless the column is called so.
pub fn named_column(text: &str) -> Result<NamedColumn, String> {
    Ok(match pair(text) {
        Ok((quantity, column)) if QUANTITIES.contains(&&*quantity) => NamedColumn::Quantity(quantity, column),
        _ => NamedColumn::Plain(text.to_owned()),
    })
}

/// What is not a quantity, with the one that may have been meant.
fn with_nearest(why: String, name: &str) -> String {
    match closest(name, QUANTITIES).filter(|_| !QUANTITIES.contains(&name)) {
        Some(meant) => format!("{why}; did you mean {meant}?"),
        None => why,
    }
}

/// Says which way round the two belong where they were swapped.
fn with_column(settings: ImportSettings, quantity: &str, column: &str) -> Result<ImportSettings, String> {
    let other = settings.clone();
    settings.with_column(quantity, column).map_err(|why| {
        match other.with_column(&column.to_lowercase(), quantity) {
            Ok(_) => format!("{why}; the quantity stands first: --column {column}={quantity}"),
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
