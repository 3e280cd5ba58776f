//! What a texture loses that does not respond to force or speed, and how much less similar it is called (Table 4.2).

use super::{Analysis, MeanRow, RelationRow};
use crate::check::{Checked, hash};
use crate::data::{DataError, Folder, Row};
use crate::document::{Compare, Phase};
use crate::statistics::regression::regress;
use haptograph_engine::settings::Setting;
use haptograph_learning::evaluate::{Condition, ConditionLoss, condition_losses};
use haptograph_signal::files;
use haptograph_surfaces::{Surface, TextureModel};

const CONDITIONS: [(&str, Condition); 4] = [
    ("ForceAndSpeed", Condition::ForceAndSpeed),
    ("Force", Condition::Force),
    ("Speed", Condition::Speed),
    ("Neither", Condition::Neither),
];

/// Kind of these rows among the relations.
pub(super) const KIND: &str = "decrease of similarity on lost variation of the signal (Table 4.2)";

/// A property of a signal by its name in the table.
type Property = (&'static str, fn(&ConditionLoss) -> Option<f64>);

/// P and SC of Eq. 4.5.1 and 4.5.3, SD of Eq. 4.5.4.
const PROPERTIES: [Property; 3] = [
    ("P, (m/s²)²", |of| Some(of.loss.power)),
    ("SC, Hz", |of| Some(of.loss.centroid_hz)),
    ("SD", |of| of.difference),
];

impl Checked {
    /// The answers of a folder that is of this study.
    pub(super) fn answers(&self, folder: &Folder) -> Result<Vec<Row>, DataError> {
        folder.check_text(&self.identity(None).text)?;
        folder.answers()
    }
}

impl Analysis {
    /// Adds Table 4.2 to the relations: in phases that compare versions of other responses (`condition`) with one that responds to force
    /// and speed, the decrease of similarity on what the signal of each surface loses. Surfaces are read from the study's own paths.
    ///
    /// # Errors
    /// If the data cannot be read, or are of another study.
    pub fn add_responsiveness(&mut self, study: &Checked, folder: &Folder) -> Result<(), DataError> {
        let answers = study.answers(folder)?;
        let mut is_found = false;
        for (name, phase) in &study.study.phases.0 {
            let Phase::Compare(compare) = phase else { continue };
            let versions = responding(study, compare);
            let reference = study.study.reference(compare);
            let control = versions.iter().find(|(name, _)| name == reference);
            if versions.len() < 2 || control.is_none_or(|(_, of)| *of != Condition::ForceAndSpeed) {
                continue;
            }
            is_found = true;
            let surfaces = self.surfaces((study, &answers));
            let textures = surfaces.iter().filter_map(|(name, of)| Some((&**name, of.texture.as_ref()?)));
            let textures: Vec<(&str, &TextureModel)> = textures.collect();
            let losses = condition_losses(&textures);
            for (version, condition) in versions.iter().filter(|(name, _)| name != reference) {
                let losses: Vec<&ConditionLoss> =
                    losses.iter().filter(|of| of.condition == *condition).collect();
                self.slopes((&name.text, reference, version), &losses);
            }
        }
        if !is_found {
            let why = "no phase compares versions that set `condition` with one of `ForceAndSpeed`";
            self.left_out.push(format!("Table 4.2: {why}"));
        }
        Ok(())
    }

    /// The surfaces that were presented, as they were then.
    pub(super) fn surfaces(&mut self, (study, answers): (&Checked, &[Row])) -> Vec<(String, Surface)> {
        let mut surfaces = Vec::new();
        for (name, of) in &study.study.surfaces.0 {
            // The hash is that of the second stimulus if it is virtual, else of the first.
            let is_of = |row: &&Row| {
                let is_second = !matches!(&*row.second_version, "" | "real");
                let hashed = if is_second { &row.second_surface } else { &row.first_surface };
                *hashed == name.text && !row.surface_sha256.is_empty()
            };
            let (Some(file), Some(row)) = (&of.file, answers.iter().find(is_of)) else { continue };
            let what = format!("surface {}", name.text);
            let bytes = self.keep(&what, files::read(file, u64::MAX));
            if bytes.is_none_or(|bytes| hash(&bytes) != row.surface_sha256) {
                self.left_out.push(format!("{what}: its file is not the one that was presented"));
                continue;
            }
            let surface = self.keep(&what, haptograph_surfaces::files::load(file));
            surfaces.extend(surface.map(|surface| (name.text.clone(), surface)));
        }
        surfaces
    }

    /// Adds a line through points to the relations, or says why there is none.
    pub(super) fn line(&mut self, names: (&str, &'static str), of: (&str, &str), points: Vec<(f64, f64)>) {
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        let what = format!("{}, {} on {}", names.0, of.0, of.1);
        let Some(line) = self.keep(&what, regress(&[&x], &y, true)) else { return };
        let slope = line.coefficients[0];
        let row = RelationRow::new(names, of, slope.estimate, slope.p);
        self.relations.push(RelationRow { count: x.len(), r_squared: Some(line.r_squared), ..row });
    }

    /// The decrease of similarity of a version on each property.
    fn slopes(&mut self, (phase, reference, version): (&str, &str, &str), losses: &[&ConditionLoss]) {
        let mean = |surface: &str, version: &str| {
            let is_it =
                |row: &&MeanRow| (&*row.phase, &*row.surface, &*row.version) == (phase, surface, version);
            self.means.iter().find(is_it).map(|row| row.mean)
        };
        let less = |of: &&ConditionLoss| Some(mean(&of.surface, reference)? - mean(&of.surface, version)?);
        let less: Vec<Option<f64>> = losses.iter().map(less).collect();
        for (property, value) in PROPERTIES {
            let points = losses.iter().zip(&less).filter_map(|(of, less)| Some((value(of)?, (*less)?)));
            self.line((phase, KIND), (version, property), points.collect());
        }
    }
}

/// The versions of a phase that set what a texture responds to.
fn responding(study: &Checked, compare: &Compare) -> Vec<(String, Condition)> {
    let versions = study.study.some_versions(&compare.versions).into_iter();
    let versions = versions.filter_map(|at| study.study.versions.0.get(at));
    let condition = |values: &[(_, haptograph_engine::document::value::Value)]| {
        let shown = values.iter().map(|(_, value)| value.show());
        shown.filter_map(|shown| CONDITIONS.iter().find(|(name, _)| *name == shown)).next().map(|(_, of)| *of)
    };
    versions.filter_map(|(name, values)| Some((name.text.clone(), condition(&values.0)?))).collect()
}
