//! `haptograph surface constants`: what the thesis's studies and its pen take from a set of surfaces.

use super::Surfaces;
use crate::cli::Failure;
use crate::cli::beside::{Beside, Rows, show_with};
use crate::cli::evaluate::Centre;
use crate::cli::result::CommandResult;
use crate::cli::table::facts;
use crate::learning::evaluate::centre_of;
use crate::surfaces::Surface;
use serde::Serialize;

/// Show the constant force and speed of a set of surfaces, and how many frictions a pen can take on
///
/// The constant speed and force of a texture that responds to one of them are the means of the measured models up to 2.75 N (thesis
/// 4.5.2). The friction of the pen with a braked ball is counted against those of the surfaces (5.3.5, 5.5.2, 5.5.4).
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    surfaces: Surfaces,
    #[command(flatten)]
    beside: Beside,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// Ranges of friction, and whose they are.
const RANGES: [(f64, f64, &str); 3] = [
    (0.17, f64::INFINITY, "above the pen's own 0.17 (5.3.5)"),
    (0.20, 0.52, "from 0.20 to 0.52, as measured on the braked pen (5.5.4)"),
    (0.0, 0.578, "below 0.578, the largest in theory (5.5.2)"),
];

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let surfaces = arguments.surfaces.load()?;
    let constants = Constants::of(&surfaces);
    let mut rows = Rows::default();
    Centre::beside(constants.centre.as_ref(), &mut rows);
    show_with(&constants, &arguments.beside.rows(|| Ok(rows.0))?, arguments.json)
}

/// The constants of a set of surfaces.
#[derive(Serialize)]
struct Constants {
    centre: Option<Centre>,
    friction: Vec<Counted>,
    surfaces: usize,
    with_friction: usize,
}

/// Number of surfaces whose friction is in a range.
#[derive(Debug, PartialEq, Serialize)]
struct Counted {
    range: &'static str,
    surfaces: usize,
}

impl Constants {
    fn of(surfaces: &[Surface]) -> Self {
        let frictions: Vec<f64> = surfaces.iter().filter_map(|one| Some(one.friction?.mu())).collect();
        let count = |(low, high, range): (f64, f64, &'static str)| Counted {
            range,
            surfaces: frictions.iter().filter(|mu| **mu > low && **mu < high).count(),
        };
        Self {
            centre: centre_of(surfaces.iter().filter_map(|one| one.texture.as_ref())).map(Centre::from),
            friction: RANGES.map(count).into(),
            surfaces: surfaces.len(),
            with_friction: frictions.len(),
        }
    }
}

impl CommandResult for Constants {
    fn text(&self) -> String {
        let (label, centre) = Centre::fact(self.centre.as_ref());
        let counts =
            self.friction.iter().map(|of| (of.range, format!("{} of {}", of.surfaces, self.with_friction)));
        let rows: Vec<(&str, String)> =
            [("surfaces", self.surfaces.to_string()), (label, centre)].into_iter().chain(counts).collect();
        facts(&rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_surfaces_have_their_frictions() {
        // Frictions 0.18, 0.36, 0.32, 0.30, 0.49 and 0.42; their textures follow laws.
        let surfaces = super::super::select::collect("graphs/surfaces".as_ref()).unwrap();
        let surfaces: Vec<Surface> = surfaces.into_iter().map(|found| found.surface).collect();
        let constants = Constants::of(&surfaces);
        assert_eq!((constants.surfaces, constants.with_friction), (6, 6));
        assert!(constants.friction.iter().map(|of| of.surfaces).eq([6, 5, 6]), "{:?}", constants.friction);
        assert!(constants.centre.is_none());
    }
}
