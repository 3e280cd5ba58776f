//! `evaluate --holdout`: errors of textures on parts of recordings that they were not learned from.

use crate::cli::Failure;
use crate::cli::progress::Progress;
use crate::learning::evaluate::holdout::{
    BandMean, ContactResult, Mean, Measure, MethodMean, SplitResult, hold_out_contact,
};
use crate::learning::evaluate::{Holdout, HoldoutSettings, Take, hold_out};
use crate::learning::processing::ProcessingSettings;
use crate::report::holdout::tables::{self, Measures};
use serde_json::{Value, json};
use std::path::Path;

/// Evaluates all drags by hold-out, with a progress bar.
pub fn found(dir: &Path, takes: &[Take], settings: &HoldoutSettings) -> Result<Holdout, Failure> {
    let progress = Progress::of("holding out");
    hold_out(takes, settings, &|part| progress.at(part))
        .map_err(|error| Failure::file("evaluate", dir, &error))
}

/// Evaluates all taps, circles and presses by hold-out.
pub fn contacts(takes: &[Take], processing: &ProcessingSettings) -> Vec<ContactResult> {
    let _progress = Progress::unknown("holding out taps, friction and stiffness");
    hold_out_contact(takes, processing)
}

/// Text: for each split tables of methods with all measures, then tables of materials.
pub fn describe(found: &Holdout) -> String {
    let over = match found.materials.len() {
        1 => "of 1 material".to_owned(),
        several => format!("means over {several} materials ± standard error"),
    };
    let head = format!(
        "Errors on held-out parts: {over}, {} seeds of noise averaged as powers.\n\
         LSD: log-spectral distance over third octaves from 20 to 1000 Hz, dB; felt: from 40 to 250 Hz. 20-40 Hz, total: error of the\n\
         power, dB. envelope: of levels over 50 ms, in brackets between two noises of one method. * worse than a plain baseline.\n\
         floor: the training part's own spectrum. one_model: plain, of order 20 for the part. windows: plain, of 0.2 s, the nearest.\n",
        found.seeds
    );
    found.splits().iter().fold(head, |text, split| text + &of_split(found, split))
}

fn of_split(found: &Holdout, split: &SplitResult) -> String {
    let methods = [Measures::First, Measures::Others].map(|measures| tables::methods(split, measures));
    let shown = methods.into_iter().chain(tables::materials(found, split));
    let shown: String = shown.map(|table| table.text() + "\n").collect();
    format!("\n{}\n\n{shown}{}\n", split.split.as_str(), tables::limits(split))
}

/// Text: a table of methods for each quantity of a contact.
pub fn describe_contact(found: &[ContactResult]) -> String {
    let tables = tables::contacts(found);
    tables.iter().map(|table| format!("\n{}", table.text())).collect()
}

/// All measures of all splits, and the distance in each fold.
pub fn to_json(found: &Holdout, contact: &[ContactResult], simulated: bool) -> Value {
    let split = |split: &SplitResult| {
        json!({
            "split": split.split.as_str(),
            "methods": split.methods.iter().map(method_json).collect::<Vec<_>>(),
            "best_baseline": split.best_baseline.as_str(),
            "unexplained_level_db": mean_json(split.unexplained_level_db),
            "estimator_two_takes_db": split.estimator_db.0,
            "estimator_mean_of_seeds_db": split.estimator_db.1,
        })
    };
    json!({
        "materials": found.materials,
        "seeds": found.seeds,
        "simulated": simulated,
        "folds": found.folds.len(),
        "splits": found.splits().iter().map(split).collect::<Vec<_>>(),
        "contact": contact.iter().map(contact_json).collect::<Vec<_>>(),
    })
}

fn contact_json(result: &ContactResult) -> Value {
    let method = |(number, method): (usize, &&str)| {
        json!({
            "method": method,
            "mean": mean_json(Some(result.means[number])),
            "by_material": result.by_material[number],
        })
    };
    json!({
        "error": result.contact.as_str(),
        "tested_on": result.split,
        "materials": result.materials,
        "loses": result.loses,
        "methods": result.contact.methods().iter().enumerate().map(method).collect::<Vec<_>>(),
    })
}

fn method_json(method: &MethodMean) -> Value {
    let mut json = json!({
        "method": method.method.as_str(),
        "loses": method.loses,
        "lsd_by_material_db": method.by_material(Measure::Lsd),
        "lsd_100_500_by_material_db": method.by_material(Measure::MiddleLsd),
        "error_20_40_by_material_db": method.by_material(Measure::Low),
        "error_total_by_material_db": method.by_material(Measure::Total),
        "signed_error_db": method.by_band.iter().map(band_json).collect::<Vec<_>>(),
    });
    for measure in Measure::all() {
        json[measure.as_str()] = mean_json(method.mean(measure));
    }
    json
}

fn band_json(band: &BandMean) -> Value {
    json!({ "centre_hz": band.centre_hz, "db": band.signed_db, "absolute_db": band.absolute_db })
}

fn mean_json(mean: Option<Mean>) -> Value {
    mean.map_or(Value::Null, |Mean { mean, error }| json!({ "mean": mean, "standard_error": error }))
}
