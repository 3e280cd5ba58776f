//! `evaluate --holdout`: what textures do on parts of recordings that they were not learned from.

use crate::cli::Failure;
use crate::cli::progress::Progress;
use crate::cli::table::table;
use crate::surfaces::evaluate::holdout::{
    BASELINES, Contact, ContactResult, Mean, Method, MethodMean, SplitResult,
};
use crate::surfaces::evaluate::{Holdout, HoldoutSettings, Take, hold_out};
use serde_json::{Value, json};
use std::path::Path;

/// Holds out parts of all drags, with progress.
pub fn found(dir: &Path, takes: &[Take], settings: &HoldoutSettings) -> Result<Holdout, Failure> {
    let progress = Progress::of("holding out");
    hold_out(takes, settings, &|part| progress.at(part))
        .map_err(|error| Failure::file("evaluate", dir, &error))
}

/// A table of materials and one of methods for each split, with the measures to read first.
pub fn describe(found: &Holdout) -> String {
    let over = match found.materials.len() {
        1 => "of 1 material".to_owned(),
        several => format!("means over {several} materials ± standard error"),
    };
    let head = format!(
        "Errors on parts that were not learned from: {over}, {} seeds of noise averaged as powers.\n\
         LSD: log-spectral distance over third octaves from 20 to 1000 Hz, dB. * loses to a plain baseline.\n\
         --report draws more measures, --json has all.\n",
        found.seeds
    );
    found
        .splits()
        .iter()
        .fold(head, |text, split| text + &of_split(found, split))
}

fn of_split(found: &Holdout, split: &SplitResult) -> String {
    let materials = materials_table(found, split);
    let gap = if materials.is_empty() { "" } else { "\n" };
    let mut text = format!(
        "\n{}\n\n{materials}{gap}{}",
        split.split.word(),
        methods_table(split)
    );
    text += &format!(
        "\nTwo stationary takes as long as these parts are {:.2} dB apart, one and the mean over seeds {:.2} dB.\n",
        split.estimator_db.0, split.estimator_db.1
    );
    if let Some(left) = split.unexplained_level_db {
        text += &format!(
            "Force and speed leave {:.2} dB of the recorded levels over 50 ms unexplained.\n",
            left.mean
        );
    }
    text
}

fn methods_table(split: &SplitResult) -> String {
    let header = [
        "",
        "LSD",
        "over the floor",
        "over the best plain",
        "100-500 Hz",
        "felt",
        "total",
    ];
    let row = |method: &MethodMean| {
        vec![
            marked(method),
            shown(Some(method.lsd_db), 2, false),
            shown(Some(method.above_floor_db), 2, true),
            shown(Some(method.above_baseline_db), 2, true),
            shown(method.middle_lsd_db, 2, false),
            format!("{:.2}", method.pacinian_lsd_db.mean),
            format!("{:+.2}", method.total_db.mean),
        ]
    };
    table(&header, &split.methods.iter().map(row).collect::<Vec<_>>())
}

fn marked(method: &MethodMean) -> String {
    let star = if method.loses { " *" } else { "" };
    format!("{}{star}", method.method.title())
}

fn shown(value: Option<Mean>, digits: usize, signed: bool) -> String {
    let Some(Mean { mean, error }) = value else {
        return "–".to_owned();
    };
    let mean = if signed {
        format!("{mean:+.digits$}")
    } else {
        format!("{mean:.digits$}")
    };
    error.map_or_else(|| mean.clone(), |error| format!("{mean} ±{error:.digits$}"))
}

/// Distances material by material.
fn materials_table(found: &Holdout, split: &SplitResult) -> String {
    let words = split.methods.iter().map(|method| method.method.word());
    let header: Vec<&str> = std::iter::once("LSD, dB").chain(words).collect();
    let complete = |method: &&MethodMean| method.lsd_by_material.len() == found.materials.len();
    if !split.methods.iter().all(|method| complete(&method)) {
        return String::new();
    }
    let best = |material: usize| {
        let plain = split.methods.iter().filter(|m| BASELINES.contains(&m.method));
        plain
            .map(|m| m.lsd_by_material[material])
            .fold(f64::INFINITY, f64::min)
    };
    let rows = found.materials.iter().enumerate().map(|(material, name)| {
        let cells = split.methods.iter().map(|method| {
            let lsd = method.lsd_by_material[material];
            let plain = BASELINES.contains(&method.method);
            let floor = method.method == Method::Floor;
            let star = if !plain && !floor && lsd > best(material) {
                "*"
            } else {
                ""
            };
            format!("{star}{lsd:.2}")
        });
        std::iter::once(name.clone()).chain(cells).collect()
    });
    table(&header, &rows.collect::<Vec<Vec<String>>>())
}

/// A table of methods for each quantity of a contact.
pub fn describe_contact(found: &[ContactResult]) -> String {
    let of = |contact: Contact| -> Vec<&ContactResult> {
        found.iter().filter(|result| result.contact == contact).collect()
    };
    let tables = Contact::ALL
        .into_iter()
        .map(of)
        .filter(|results| !results.is_empty());
    tables.map(|results| contact_table(&results)).collect()
}

/// The splits of one quantity, side by side.
fn contact_table(results: &[&ContactResult]) -> String {
    let contact = results[0].contact;
    let splits = results
        .iter()
        .map(|result| format!("{} ({})", result.split, result.materials.len()));
    let header: Vec<String> = std::iter::once(contact.title().to_owned())
        .chain(splits)
        .collect();
    let rows = contact.methods().iter().enumerate().map(|(method, title)| {
        let cells = results.iter().map(|result| {
            let star = if method == 0 && result.loses { "*" } else { "" };
            format!("{star}{}", shown(Some(result.means[method]), 1, false))
        });
        std::iter::once((*title).to_owned()).chain(cells).collect()
    });
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    format!("\n{}", table(&header, &rows.collect::<Vec<Vec<String>>>()))
}

/// All measures of all splits, and the distance in each fold.
pub fn to_json(found: &Holdout, contact: &[ContactResult], simulated: bool) -> Value {
    let split = |split: &SplitResult| {
        json!({
            "split": split.split.word(),
            "methods": split.methods.iter().map(method_json).collect::<Vec<_>>(),
            "best_baseline": split.best_baseline.word(),
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
        "error": result.contact.word(),
        "tested_on": result.split,
        "materials": result.materials,
        "loses": result.loses,
        "methods": result.contact.methods().iter().enumerate().map(method).collect::<Vec<_>>(),
    })
}

fn method_json(method: &MethodMean) -> Value {
    let some = |mean: Mean| mean_json(Some(mean));
    json!({
        "method": method.method.word(),
        "loses": method.loses,
        "lsd_by_material_db": method.lsd_by_material,
        "lsd_db": some(method.lsd_db),
        "above_floor_db": some(method.above_floor_db),
        "above_baseline_db": some(method.above_baseline_db),
        "lsd_100_500_db": mean_json(method.middle_lsd_db),
        "above_floor_100_500_db": mean_json(method.middle_above_floor_db),
        "lsd_pacinian_db": some(method.pacinian_lsd_db),
        "absolute_db": some(method.absolute_db),
        "error_20_40_db": mean_json(method.low_db),
        "error_total_db": some(method.total_db),
        "misplaced": some(method.misplaced),
        "kurtosis_error": some(method.kurtosis),
        "envelope_db": mean_json(method.envelope_db),
        "envelope_between_seeds_db": mean_json(method.envelope_floor_db),
        "nse": mean_json(method.nse),
        "pe": mean_json(method.pe),
        "signed_error_db": method.signed_db.iter().map(|(hz, db)| json!({ "centre_hz": hz, "db": db })).collect::<Vec<_>>(),
    })
}

fn mean_json(mean: Option<Mean>) -> Value {
    mean.map_or(
        Value::Null,
        |Mean { mean, error }| json!({ "mean": mean, "standard_error": error }),
    )
}
