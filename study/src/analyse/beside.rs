//! The thesis's printed numbers beside one's own, where both mean the same.

use super::{Analysis, ComparisonRow, RAW, SIGNIFICANT, THESIS, components, rated, responsiveness};
use crate::document::{Phase, Study};
use crate::statistics::regression::pearson;
use crate::thesis::{is_same_name, published};
use serde::Serialize;
use serde_json::{Value, json};

/// The studies of the thesis that a file can repeat.
pub(crate) const REPEATED_STUDIES: [&str; 3] = ["3.3", "4.5", "4.6"];

/// A number of one's own beside that of the thesis.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct BesideRow {
    /// Of one's own study.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub phase: String,
    pub what: String,
    pub own: Value,
    pub thesis: Value,
    /// Where the thesis has it.
    pub source: &'static str,
}

/// Why there is nothing to lay beside.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "the study does not say which study of the thesis it repeats; add `thesis: \"3.3\"`, \"4.5\" or \"4.6\" to its file before the first participant"
)]
pub struct RepeatsNone;

impl Analysis {
    /// The thesis's numbers beside one's own.
    ///
    /// # Errors
    /// If the study does not say which of the thesis's it repeats.
    pub fn beside_thesis(&self, study: &Study) -> Result<Vec<BesideRow>, RepeatsNone> {
        let number = study.thesis.as_deref().ok_or(RepeatsNone)?;
        let mut beside =
            Beside { analysis: self, numbers: &published()["studies"][number], rows: Vec::new() };
        match number {
            "3.3" => beside.textures(study),
            "4.5" => {
                let of = |version| format!("p_{version}_against_FS");
                let versions = ["F", "S", "phi"].map(|version| (version, of(version)));
                beside.versions(study, ("FS", THESIS, "4.5.3"), &versions);
                beside.slopes();
            }
            "4.6" => {
                let of = |part: &str| format!("p_without_{part}");
                let versions =
                    [("no friction", of("friction")), ("no taps", of("taps")), ("no texture", of("texture"))];
                beside.versions(study, ("all", RAW, "4.6.3"), &versions);
                for (name, _) in study.phases.0.iter().filter(|(_, phase)| matches!(phase, Phase::Rate(_))) {
                    let rated = self.means.iter().filter(|row| row.phase == name.text);
                    let mut versions = rated.map(|row| &*row.version);
                    match versions.next().filter(|first| versions.all(|of| of == *first)) {
                        Some("real") => beside.correlations(&name.text, "Table 4.3"),
                        Some("all") => beside.correlations(&name.text, "Table 4.4"),
                        _ => {}
                    }
                }
                beside.regressions();
            }
            _ => return Err(RepeatsNone),
        }
        Ok(beside.rows)
    }
}

struct Beside<'a> {
    analysis: &'a Analysis,
    /// Of the study.
    numbers: &'static Value,
    rows: Vec<BesideRow>,
}

impl Beside<'_> {
    fn add(&mut self, (phase, source): (&str, &'static str), what: String, own: Value, thesis: &Value) {
        if !thesis.is_null() {
            let (phase, thesis) = (phase.to_owned(), thesis.clone());
            self.rows.push(BesideRow { phase, what, own, thesis, source });
        }
    }

    /// Study 3.3: ratings over each person's deviation, their regression on dissimilarity, and the map.
    fn textures(&mut self, study: &Study) {
        let (analysis, numbers) = (self.analysis, self.numbers);
        for row in analysis.variance.iter().filter(|row| row.phase == rated(study) && row.test == THESIS) {
            let term = match row.term {
                "surface" => "texture",
                // The thesis has two levels, real and virtual.
                "version" if row.df == 1.0 => "real_virtual",
                _ => continue,
            };
            let thesis = &numbers["anova"][&row.of][term];
            let what = |of: &str| format!("{}, {}: {of}", row.of, row.term);
            self.add((&row.phase, "3.3.3"), what("F"), json!(row.f), &thesis["F"]);
            self.add((&row.phase, "3.3.3"), what("p"), json!(row.p), &thesis["p"]);
        }
        let regression = &numbers["regression"];
        let terms = regression["terms"].as_array().into_iter().flatten();
        let mut r_squared = None;
        for (at, term) in terms.enumerate() {
            let is_it = |row: &&super::RelationRow| row.kind.contains("Eq. 3.3.1") && term == &*row.with;
            let Some(row) = analysis.relations.iter().find(is_it) else { continue };
            let what = format!("dissimilarity on difference of {}", row.with);
            self.add((&row.phase, "Eq. 3.3.1"), what, json!(row.value), &regression["coefficients"][at]);
            r_squared = Some((&row.phase, row.r_squared));
        }
        if let Some((phase, own)) = r_squared {
            let what = "dissimilarity on all differences: R2".to_owned();
            self.add((phase, "Eq. 3.3.1"), what, json!(own), &regression["r2"]);
        }
        self.correlations(rated(study), "Table 3.2");
        let dimensions = numbers["mds"]["map_dimensions"].as_u64().unwrap_or_default() as usize;
        for row in analysis.maps.scree.iter().filter(|row| row.dimensions == dimensions) {
            let what = format!("map in {dimensions} dimensions: R2");
            self.add((&row.phase, "3.3.3"), what, json!(row.r_squared), &numbers["mds"]["r2_at_least"]);
        }
    }

    /// Versions against the reference: on how many surfaces they are less similar, and p on surfaces of the thesis's names.
    fn versions(
        &mut self,
        study: &Study,
        (reference, test, source): (&str, &str, &'static str),
        versions: &[(&str, String)],
    ) {
        let analysis = self.analysis;
        let compared = study.phases.0.iter().filter_map(|(name, phase)| match phase {
            Phase::Compare(of) if study.reference(of) == reference => Some(&*name.text),
            _ => None,
        });
        for (phase, (version, key)) in compared.flat_map(|phase| versions.iter().map(move |of| (phase, of))) {
            let is_pair = |row: &&ComparisonRow| row.test == test && row.is_of(phase, [version, reference]);
            let own: Vec<&ComparisonRow> = analysis.comparisons.iter().filter(is_pair).collect();
            let is_less = |row: &&&ComparisonRow| {
                let sign = if row.to == *version { 1.0 } else { -1.0 };
                row.p < SIGNIFICANT && row.difference.is_some_and(|difference| sign * difference < 0.0)
            };
            let Some(printed) = self.numbers[key].as_object().filter(|_| !own.is_empty()) else { continue };
            let count = |some: usize, all: usize| json!(format!("{some} of {all}"));
            let found = count(own.iter().filter(is_less).count(), own.len());
            let thesis = count(printed.values().filter(|p| !p.is_null()).count(), printed.len());
            let what = format!("surfaces on which {version} is less similar than {reference}, p < 0.05");
            self.add((phase, source), what, found, &thesis);
            for row in own {
                let named = printed.iter().find(|(name, _)| is_same_name(name, &row.surface));
                let Some((_, p)) = named else { continue };
                let p = if p.is_null() { json!("not significant") } else { p.clone() };
                let what = format!("{}, {version} against {reference}: p", row.surface);
                self.add((phase, source), what, json!(row.p), &p);
            }
        }
    }

    /// Table 4.2: the thesis prints no units of its slopes, so that only R2 means the same.
    fn slopes(&mut self) {
        let table = &published()["tables"]["4.2"]["rows"];
        for row in self.analysis.relations.iter().filter(|row| row.kind == responsiveness::KIND) {
            let line = table.as_array().into_iter().flatten().find(|line| line[0] == *row.of);
            let column = ["P", "SC", "SD"].iter().position(|name| row.with.split(',').next() == Some(name));
            if let Some((line, column)) = line.zip(column) {
                let what = format!("decrease of similarity of {} on {}: R2", row.of, row.with);
                self.add((&row.phase, "Table 4.2"), what, json!(row.r_squared), &line[2 * column + 2]);
            }
        }
    }

    /// The regressions of 4.6.3.
    fn regressions(&mut self) {
        for row in self.analysis.relations.iter().filter(|row| row.kind == components::KIND) {
            let is_it = |[of, with, _]: &[&str; 3]| [*of, *with] == [&*row.of, &*row.with];
            let place = components::regressions().find(is_it).map_or("", |[.., place]| place);
            let Some(printed) = self.numbers["regressions"].pointer(place) else { continue };
            for (what, own) in [("r2", row.r_squared.unwrap_or(f64::NAN)), ("p", row.p)] {
                let name = format!("{} on {}: {}", row.of, row.with, what.replace('r', "R"));
                self.add((&row.phase, "4.6.3"), name, json!(own), &printed[what]);
            }
        }
    }

    /// A table of correlations beside those of the mean ratings of a phase, over the surfaces that have every version.
    fn correlations(&mut self, phase: &str, source: &'static str) {
        let (table, analysis) = (&published()["tables"][&source["Table ".len()..]], self.analysis);
        let labels: Vec<&str> =
            table["labels"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        let column = |scale: &str| -> Vec<f64> {
            let rows = || analysis.means.iter().filter(|row| row.phase == phase && row.scale == scale);
            let versions = |surface: &str| rows().filter(|row| row.surface == surface).count();
            let most = rows().map(|row| versions(&row.surface)).max();
            rows().filter(|row| Some(versions(&row.surface)) == most).map(|row| row.mean_over_sd).collect()
        };
        for (b, a) in (0..labels.len()).flat_map(|b| (0..b).map(move |a| (b, a))) {
            let Ok(own) = pearson(&column(labels[a]), &column(labels[b]), 0.95) else { continue };
            let (above, below) = (&table["values"][a][b], &table["values"][b][a]);
            // Table 4.4 is not symmetric in print.
            let printed = if above == below { above.clone() } else { json!(format!("{above} or {below}")) };
            let what = format!("{} and {}: r, {} stimuli", labels[a], labels[b], own.count);
            self.add((phase, source), what, json!(own.r.value), &printed);
        }
    }
}
