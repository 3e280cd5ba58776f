//! What friction, taps and texture add to a surface, regressed over surfaces on what is measured and on how they are rated (thesis 4.6.3).

use super::{Analysis, MeanRow};
use crate::check::Checked;
use crate::data::{DataError, Folder, Row};
use haptograph_learning::select::features;
use haptograph_surfaces::Surface;
use haptograph_surfaces::rendering::RandomWalk;
use std::collections::BTreeMap;

/// Kind of these rows among the relations.
pub(super) const KIND: &str = "regression over surfaces (4.6.3)";
/// Seed of the vibration whose power is taken.
const SEED: u64 = 0;

/// What is regressed on what, and where the thesis's numbers are.
pub(super) fn regressions() -> impl Iterator<Item = [&'static str; 3]> {
    let lines = include_str!("regressions.txt").lines().map(|line| line.split(" | "));
    lines.filter_map(|mut line| Some([line.next()?, line.next()?, line.next()?]))
}

/// A number of each surface, by name.
type Column = BTreeMap<String, f64>;

impl Analysis {
    /// Adds the regressions of thesis 4.6.3 to the relations: mean ratings, over each person's deviation, and how much less similar a
    /// surface is called without a component (Eq. 4.6.1), on each other and, with the study's own file, on what its surfaces have.
    ///
    /// # Errors
    /// If the data cannot be read, or are of another study.
    pub fn add_components(&mut self, study: Option<&Checked>, folder: &Folder) -> Result<(), DataError> {
        let mut measured = BTreeMap::new();
        match study {
            Some(study) => self.measure((study, &study.answers(folder)?), &mut measured),
            None => self.left_out.push(format!("{KIND} on friction, power and taps: give --study STUDY.ron")),
        }
        for [of, with, _] in regressions() {
            let column = |name: &str| measured.get(name).cloned().unwrap_or_else(|| self.rated_as(name));
            let (y, x) = (column(of), column(with));
            let both = y.iter().filter_map(|(surface, y)| Some((*x.get(surface)?, *y)));
            let both: Vec<(f64, f64)> = both.collect();
            if !both.is_empty() {
                self.line(("all", KIND), (of, with), both);
            }
        }
        Ok(())
    }

    /// The means of `scale, version`, or by which part less similar a version is called than `all`.
    fn rated_as(&self, name: &str) -> Column {
        let Some((scale, version)) = name.split_once(", ") else { return Column::new() };
        let own = self.means.iter().filter(|row| row.version == version);
        if scale != "% less" {
            let of = own.filter(|row| row.scale == scale);
            return of.map(|row| (row.surface.clone(), row.mean_over_sd)).collect();
        }
        let less = |row: &MeanRow| {
            let is_all = |all: &&MeanRow| {
                (&all.phase, &all.surface, &*all.version) == (&row.phase, &row.surface, "all")
            };
            let all = self.means.iter().find(is_all)?.mean_over_sd;
            let is_compared = row.less_than_reference_percent.is_some();
            is_compared.then(|| (row.surface.clone(), 100.0 * (all - row.mean_over_sd) / all))
        };
        own.filter_map(less).collect()
    }

    /// What the surfaces that were presented have; says what they lack.
    fn measure(&mut self, presented: (&Checked, &[Row]), into: &mut BTreeMap<&'static str, Column>) {
        for (name, surface) in self.surfaces(presented) {
            let found = self.keep(&name, features(&surface, &RandomWalk::default(), SEED));
            let Some(found) = found else { continue };
            let centroid = |surface: &Surface| surface.taps.as_ref()?.spectral_centroid_hz();
            let numbers = [
                ("friction coefficient", found.friction),
                ("power of the vibration, (m/s²)²", found.power),
                ("tap response, N s/m", found.tap_response),
                ("spectral centroid of taps, Hz", centroid(&surface)),
            ];
            for (what, number) in numbers {
                match number {
                    Some(number) => drop(into.entry(what).or_default().insert(name.clone(), number)),
                    None => self.left_out.push(format!("{what} of {name}: its file has none")),
                }
            }
        }
    }
}
