//! `evaluate --holdout`: errors of textures on parts of recordings that they were not learned from.

use super::conclusion;
use crate::cli::Failure;
use crate::cli::progress::Progress;
use crate::cli::result::CommandResult;
use crate::learning::evaluate::holdout::{ContactResult, Measure, MethodMean, SplitResult, hold_out_contact};
use crate::learning::evaluate::{Holdout, HoldoutSettings, Take, hold_out};
use crate::learning::processing::ProcessingSettings;
use crate::report::holdout::tables::{self, Measures};
use crate::report::table::Table;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Evaluates all drags by hold-out, with a progress bar.
pub(super) fn found(dir: &Path, takes: &[Take], settings: &HoldoutSettings) -> Result<Holdout, Failure> {
    let found = Progress::during("holding out", |at| hold_out(takes, settings, at));
    found.map_err(Failure::doing("evaluate", dir))
}

/// Evaluates all taps, circles and presses by hold-out.
pub(super) fn contacts(takes: &[Take], processing: &ProcessingSettings) -> Vec<ContactResult> {
    let _progress = Progress::unknown("holding out taps, friction and stiffness");
    hold_out_contact(takes, processing)
}

/// All measures of all splits, and the errors of contacts.
pub(super) struct HeldOut {
    pub found: Holdout,
    pub contact: Vec<ContactResult>,
    /// Number of simulated recordings.
    pub simulated: usize,
    pub recordings: usize,
    pub page: Option<PathBuf>,
}

impl CommandResult for HeldOut {
    /// For each split tables of methods with all measures, then tables of materials; then a table of methods for each
    /// quantity of a contact.
    fn text(&self) -> String {
        let over = match self.found.materials.len() {
            1 => "of 1 material".to_owned(),
            several => format!("means over {several} materials ± standard error"),
        };
        let head = format!(
            "Errors on held-out parts: {over}, {} seeds of noise averaged as powers.\n\
             LSD: log-spectral distance over third octaves from 20 to 1000 Hz, dB; felt: from 40 to 250 Hz. 20-40 Hz, total: error of the\n\
             power, dB. envelope: of levels over 50 ms, in brackets between two noises of one method. * worse than a plain baseline.\n\
             Single seeds: mean errors, in brackets their standard deviation. LSD, dB; of the 2 ms envelope: modulation from 2 to 128 Hz, dB,\n\
             and autocorrelation; of the levels over 5 ms: quantiles, dB; kurtosis, octaves; crest, dB; correlation of four bands' envelopes;\n\
             standard deviation (spread) of the levels over 5 and 50 ms, dB. –: a piece is shorter than 0.5 s, constant or below 1 kHz.\n\
             Floor: a stretch of the training part as long as the shortest piece. best: the floor left out.\n\
             floor: the training part's own spectrum. one_model: plain, of order 20 for the part. windows: plain, of 0.2 s, the nearest.\n\
             one_warped: plain, warped of order 12. phases: plain, regressed spectra with random phases. clips: plain, of 0.3 s, the three nearest.\n",
            self.found.seeds
        );
        let splits = self.found.splits().into_iter().map(|split| of_split(&self.found, &split));
        let contacts = tables::contacts(&self.contact).into_iter().map(|table| format!("\n{}", table.text()));
        let tables: String = splits.chain(contacts).collect();
        head + &tables + &conclusion(self.simulated, self.recordings, self.page.as_ref())
    }
}

impl Serialize for HeldOut {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        json!({
            "materials": self.found.materials, "seeds": self.found.seeds, "simulated": self.simulated > 0,
            "folds": self.found.folds.len(),
            "splits": self.found.splits().iter().map(split_json).collect::<Vec<_>>(),
            "contact": self.contact.iter().map(contact_json).collect::<Vec<_>>(),
        })
        .serialize(serializer)
    }
}

fn of_split(found: &Holdout, split: &SplitResult) -> String {
    let of = |measures: [Measures; 2]| measures.into_iter().filter_map(|shown| tables::methods(split, shown));
    let text = |table: Table| table.text() + "\n";
    let together = of([Measures::First, Measures::Others]).chain(tables::materials(found, split));
    let together: String = together.map(text).collect();
    let seeds: String = of([Measures::FirstOfSeeds, Measures::OthersOfSeeds]).map(text).collect();
    let head = if seeds.is_empty() { "" } else { "Single seeds\n\n" };
    format!("\n{}\n\n{together}{head}{seeds}{}\n", split.split.as_str(), tables::limits(split))
}

fn split_json(split: &SplitResult) -> Value {
    json!({
        "split": split.split.as_str(), "methods": split.methods.iter().map(method_json).collect::<Vec<_>>(),
        "best_baseline": split.best_baseline.as_str(), "unexplained_level_db": split.unexplained_level_db,
        "estimator_two_takes_db": split.estimator_db.0, "estimator_mean_of_seeds_db": split.estimator_db.1,
    })
}

fn contact_json(result: &ContactResult) -> Value {
    let method = |(number, method): (usize, &&str)| {
        json!({
            "method": method, "mean": result.means[number], "by_material": result.by_material[number],
        })
    };
    json!({
        "error": result.contact.as_str(), "tested_on": result.split, "materials": result.materials,
        "loses": result.loses,
        "methods": result.contact.methods().iter().enumerate().map(method).collect::<Vec<_>>(),
    })
}

fn method_json(method: &MethodMean) -> Value {
    let mut json = json!({
        "method": method.method.as_str(), "loses": method.loses,
        "lsd_by_material_db": method.by_material(Measure::Lsd),
        "lsd_100_500_by_material_db": method.by_material(Measure::MiddleLsd),
        "error_20_40_by_material_db": method.by_material(Measure::Low),
        "error_total_by_material_db": method.by_material(Measure::Total), "signed_error_db": method.by_band,
    });
    for measure in Measure::all() {
        json[measure.as_str()] = json!(method.mean(measure));
    }
    json
}
