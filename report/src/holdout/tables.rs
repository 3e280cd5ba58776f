//! Tables of a hold-out evaluation, shared by the terminal and the page.

use haptograph_learning::evaluate::Holdout;
use haptograph_learning::evaluate::holdout::{
    BASELINES, ByMaterial, Contact, ContactResult, Mean, Method, MethodMean, SplitResult,
};

/// A table of text: a header, and rows whose first cell is a name.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Table {
    /// Column headers; the first is that of the names.
    pub head: Vec<String>,
    /// Rows, each as long as the header.
    pub rows: Vec<Vec<String>>,
}

/// Selection of the measures that a table shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measures {
    /// All measures.
    All,
    /// The main columns.
    First,
    /// The measures that are not among the main columns.
    Others,
}

/// The heads of a method's row after its name, and the table that shows the column.
const MEASURES: [(&str, Measures); 13] = [
    ("LSD", Measures::First),
    ("over the floor", Measures::First),
    ("over the best plain", Measures::First),
    ("100-500 Hz", Measures::First),
    ("20-40 Hz", Measures::First),
    ("total", Measures::First),
    ("felt", Measures::Others),
    ("absolute", Measures::Others),
    ("misplaced %", Measures::Others),
    ("kurtosis", Measures::Others),
    ("envelope (its seeds)", Measures::Others),
    ("NSE", Measures::Others),
    ("PE", Measures::Others),
];

/// The measures of every method, by its title or, in narrow tables, its name; `*` marks a method that is worse than a
/// plain baseline.
pub fn methods(split: &SplitResult, measures: Measures) -> Table {
    let row = |name: String, cells: [String; 13]| -> Vec<String> {
        let shown = cells.into_iter().zip(MEASURES);
        let shown = shown.filter(|(_, (_, of))| measures == Measures::All || *of == measures);
        std::iter::once(name).chain(shown.map(|(cell, _)| cell)).collect()
    };
    let rows = split.methods.iter().map(|method| {
        let name = match measures {
            Measures::All => method.method.title(),
            _ => method.method.as_str(),
        };
        let star = if method.loses { " *" } else { "" };
        row(format!("{name}{star}"), cells(method))
    });
    Table { head: row(String::new(), MEASURES.map(|(head, _)| head.to_owned())), rows: rows.collect() }
}

fn cells(method: &MethodMean) -> [String; 13] {
    let envelope = match (method.envelope_db, method.envelope_floor_db) {
        (Some(error), Some(floor)) => format!("{:.2} ({:.2})", error.mean, floor.mean),
        _ => "–".to_owned(),
    };
    let alone = |value: Option<Mean>, digits: usize| {
        value.map_or_else(|| "–".to_owned(), |value| format!("{:.digits$}", value.mean))
    };
    [
        shown(Some(method.lsd_db), 2, false),
        shown(Some(method.above_floor_db), 2, true),
        shown(Some(method.above_baseline_db), 2, true),
        shown(method.middle_lsd_db, 2, false),
        shown(method.low_db, 1, true),
        format!("{:+.2}", method.total_db.mean),
        format!("{:.2}", method.pacinian_lsd_db.mean),
        format!("{:.2}", method.absolute_db.mean),
        format!("{:.1}", 100.0 * method.misplaced.mean),
        format!("{:+.2}", method.kurtosis.mean),
        envelope,
        alone(method.nse, 4),
        alone(method.pe, 3),
    ]
}

/// A mean with its standard error.
fn shown(value: Option<Mean>, digits: usize, signed: bool) -> String {
    let Some(Mean { mean, error }) = value else {
        return "–".to_owned();
    };
    let mean = if signed { format!("{mean:+.digits$}") } else { format!("{mean:.digits$}") };
    error.map_or_else(|| mean.clone(), |error| format!("{mean} ±{error:.digits$}"))
}

/// A measure of a method on each material.
type OnMaterials = fn(&ByMaterial) -> &[f64];

/// The measures that are shown by material: name, value, and whether it is signed.
const ON_MATERIALS: [(&str, OnMaterials, bool); 4] = [
    ("LSD, dB", |on| &on.lsd_db, false),
    ("100-500 Hz, dB", |on| &on.middle_lsd_db, false),
    ("20-40 Hz, dB", |on| &on.low_db, true),
    ("total, dB", |on| &on.total_db, true),
];

/// A table of materials and methods for each measure that all materials have; `*` marks a method that is worse than a
/// plain baseline on that material.
pub fn materials(found: &Holdout, split: &SplitResult) -> Vec<Table> {
    let tables = ON_MATERIALS.into_iter();
    tables.filter_map(|(name, on, signed)| on_materials(found, split, (name, on, signed))).collect()
}

fn on_materials(
    found: &Holdout,
    split: &SplitResult,
    (name, on, signed): (&str, OnMaterials, bool),
) -> Option<Table> {
    let complete = |method: &MethodMean| on(&method.by_material).len() == found.materials.len();
    if !split.methods.iter().all(complete) {
        return None;
    }
    let words = split.methods.iter().map(|method| method.method.as_str().to_owned());
    let rows = found.materials.iter().enumerate().map(|(material, name)| {
        let off = |method: &MethodMean| on(&method.by_material)[material];
        let plain = split.methods.iter().filter(|m| BASELINES.contains(&m.method));
        let best = plain.map(|m| off(m).abs()).fold(f64::INFINITY, f64::min);
        let cells = split.methods.iter().map(|method| {
            let off = off(method);
            let star = if is_learned(method.method) && off.abs() > best { "*" } else { "" };
            match signed {
                true => format!("{star}{off:+.2}"),
                false => format!("{star}{off:.2}"),
            }
        });
        std::iter::once(name.clone()).chain(cells).collect()
    });
    Some(Table { head: std::iter::once(name.to_owned()).chain(words).collect(), rows: rows.collect() })
}

/// True for a method that is neither the floor nor a plain baseline.
fn is_learned(method: Method) -> bool {
    method != Method::Floor && !BASELINES.contains(&method)
}

/// A table for each quantity of a contact with its splits side by side; `*` marks results worse than a plain
/// alternative.
pub fn contacts(found: &[ContactResult]) -> Vec<Table> {
    let of = |contact: Contact| -> Vec<&ContactResult> {
        found.iter().filter(|result| result.contact == contact).collect()
    };
    let results = Contact::ALL.into_iter().map(of);
    results.filter_map(|results| contact(results.first()?.contact, &results)).collect()
}

fn contact(contact: Contact, results: &[&ContactResult]) -> Option<Table> {
    let splits = results.iter().map(|result| format!("{} ({})", result.split, result.materials.len()));
    let rows = contact.methods().iter().enumerate().map(|(method, title)| {
        let cells = results.iter().map(|result| {
            let star = if method == 0 && result.loses { "*" } else { "" };
            format!("{star}{}", shown(result.means.get(method).copied(), 1, false))
        });
        std::iter::once((*title).to_owned()).chain(cells).collect()
    });
    (!results.is_empty()).then(|| Table {
        head: std::iter::once(contact.title().to_owned()).chain(splits).collect(),
        rows: rows.collect(),
    })
}

/// Sentences about the distance between the parts themselves: by chance, and unexplained by force and speed.
pub fn limits(split: &SplitResult) -> String {
    let by_chance = format!(
        "Two stationary takes as long as these parts are {:.2} dB apart, one and the mean over seeds {:.2} dB.",
        split.estimator_db.0, split.estimator_db.1
    );
    match split.unexplained_level_db {
        Some(left) => format!(
            "{by_chance}\nForce and speed leave {:.2} dB of the recorded levels over 50 ms unexplained.",
            left.mean
        ),
        None => by_chance,
    }
}
