//! What a texture loses that does not respond to force or speed, and how much less similar it is called (Table 4.2).

use super::{Analysis, MeanRow, RelationRow};
use crate::check::{Checked, hash};
use crate::data::{DataError, Folder};
use crate::document::{Compare, Phase};
use crate::statistics::regression::regress;
use haptograph_engine::settings::Setting;
use haptograph_learning::evaluate::{Condition, ConditionLoss, condition_losses};
use haptograph_signal::files;
use haptograph_surfaces::TextureModel;

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

impl Analysis {
    /// Adds Table 4.2 to the relations: in phases that compare versions of other responses (`condition`) with one that responds to force
    /// and speed, the decrease of similarity on what the signal of each surface loses. Surfaces are read from the study's own paths.
    ///
    /// # Errors
    /// If the data cannot be read, or are of another study.
    pub fn add_responsiveness(&mut self, study: &Checked, folder: &Folder) -> Result<(), DataError> {
        folder.check_text(&study.identity(None).text)?;
        let answers = folder.answers()?;
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
            let presented = |surface: &str| {
                let row = answers.iter().find(|row| row.phase == name.text && row.second_surface == surface);
                row.map(|row| row.surface_sha256.clone())
            };
            let textures = self.textures(study, presented);
            let textures: Vec<(&str, &TextureModel)> =
                textures.iter().map(|(name, texture)| (&**name, texture)).collect();
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

    /// The textures of the surfaces that were presented, as they were then.
    fn textures(
        &mut self,
        study: &Checked,
        presented: impl Fn(&str) -> Option<String>,
    ) -> Vec<(String, TextureModel)> {
        let mut textures = Vec::new();
        for (name, of) in &study.study.surfaces.0 {
            let (Some(file), Some(sha256)) = (&of.file, presented(&name.text)) else { continue };
            let what = format!("signal of {}", name.text);
            let bytes = self.keep(&what, files::read(file, u64::MAX));
            if bytes.is_none_or(|bytes| hash(&bytes) != sha256) {
                self.left_out.push(format!("{what}: its file is not the one that was presented"));
                continue;
            }
            let Some(surface) = self.keep(&what, haptograph_surfaces::files::load(file)) else { continue };
            textures.extend(surface.texture.map(|texture| (name.text.clone(), texture)));
        }
        textures
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
            let (x, y): (Vec<f64>, Vec<f64>) = points.unzip();
            let what = format!("{phase}, {version} on {property}");
            let Some(line) = self.keep(&what, regress(&[&x], &y, true)) else { continue };
            let slope = line.coefficients[0];
            let row = RelationRow::new((phase, KIND), (version, property), slope.estimate, slope.p);
            self.relations.push(RelationRow { count: x.len(), r_squared: Some(line.r_squared), ..row });
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
