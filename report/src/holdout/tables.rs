//! Tables of a hold-out evaluation, shared by the terminal and the page.

use crate::table::Table;
use haptograph_learning::evaluate::Holdout;
use haptograph_learning::evaluate::holdout::{
    BASELINES, Contact, ContactResult, Mean, Measure, Method, MethodMean, SplitResult,
};

/// Selection of the measures that a table shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measures {
    /// The measures of all seeds together.
    All,
    /// Their main columns.
    First,
    /// Their other columns.
    Others,
    /// The main columns of single seeds.
    FirstOfSeeds,
    /// The other columns of single seeds.
    OthersOfSeeds,
}

/// A column of a method's row: its head, the table that shows it, its digits, whether it is signed, and whether it has its
/// standard error.
type Column = (&'static str, Measures, Measure, usize, bool, bool);

/// The columns after the name.
const COLUMNS: [Column; 22] = [
    ("LSD", Measures::First, Measure::Lsd, 2, false, true),
    ("over the floor", Measures::First, Measure::AboveFloor, 2, true, true),
    ("over the best plain", Measures::First, Measure::AboveBaseline, 2, true, true),
    ("100-500 Hz", Measures::First, Measure::MiddleLsd, 2, false, true),
    ("20-40 Hz", Measures::First, Measure::Low, 1, true, true),
    ("total", Measures::First, Measure::Total, 2, true, false),
    ("felt", Measures::Others, Measure::PacinianLsd, 2, false, false),
    ("absolute", Measures::Others, Measure::Absolute, 2, false, false),
    ("misplaced %", Measures::Others, Measure::Misplaced, 1, false, false),
    ("kurtosis", Measures::Others, Measure::Kurtosis, 2, true, false),
    ("envelope (its seeds)", Measures::Others, Measure::Envelope, 2, false, false),
    ("NSE", Measures::Others, Measure::Nse, 4, false, false),
    ("PE", Measures::Others, Measure::Pe, 3, false, false),
    ("LSD", Measures::FirstOfSeeds, Measure::SeedLsd, 2, false, false),
    ("modulation", Measures::FirstOfSeeds, Measure::Modulation, 2, false, false),
    ("autocorr.", Measures::FirstOfSeeds, Measure::Autocorrelation, 2, false, false),
    ("levels 5 ms", Measures::FirstOfSeeds, Measure::Levels, 2, false, false),
    ("kurtosis", Measures::FirstOfSeeds, Measure::KurtosisRatio, 2, false, false),
    ("crest", Measures::OthersOfSeeds, Measure::Crest, 1, false, false),
    ("band corr.", Measures::OthersOfSeeds, Measure::BandCorrelation, 2, false, false),
    ("spread 5 ms", Measures::OthersOfSeeds, Measure::Deviation5, 2, false, false),
    ("spread 50 ms", Measures::OthersOfSeeds, Measure::Deviation50, 2, false, false),
];

/// The measures of every method, by its title or, in narrow tables, its name; `*` marks a method that is worse than a
/// plain baseline. Under single seeds the last row names the method with the smallest error. `None` if nothing was measured.
pub fn methods(split: &SplitResult, measures: Measures) -> Option<Table> {
    let is_seeds = |measures: Measures| matches!(measures, Measures::FirstOfSeeds | Measures::OthersOfSeeds);
    let is_shown = |of: Measures| of == measures || (measures == Measures::All && !is_seeds(of));
    let columns = || COLUMNS.iter().filter(|column| is_shown(column.1));
    if columns().all(|column| split.methods.iter().all(|method| method.mean(column.2).is_none())) {
        return None;
    }
    let rows = split.methods.iter().map(|method| {
        let name = match measures {
            Measures::All => method.method.title(),
            _ => method.method.as_str(),
        };
        let star = if method.loses && !is_seeds(measures) { " *" } else { "" };
        let cells = columns().map(|column| cell(method, column));
        std::iter::once(format!("{name}{star}")).chain(cells).collect()
    });
    let heads = columns().map(|column| column.0.to_owned());
    let mut rows: Vec<Vec<String>> = rows.collect();
    if is_seeds(measures) {
        let best = columns().map(|column| best(split, column.2).to_owned());
        rows.push(std::iter::once("best".to_owned()).chain(best).collect());
    }
    Some(Table { head: std::iter::once(String::new()).chain(heads).collect(), rows })
}

/// The method with the smallest mean of a measure, the floor left out.
fn best(split: &SplitResult, measure: Measure) -> &'static str {
    let methods = split.methods.iter().filter(|method| method.method != Method::Floor);
    let means = methods.filter_map(|method| Some((method.method, method.mean(measure)?.mean)));
    means.min_by(|a, b| a.1.total_cmp(&b.1)).map_or("–", |(method, _)| method.as_str())
}

fn cell(method: &MethodMean, &(_, _, measure, digits, signed, with_error): &Column) -> String {
    let factor = if measure == Measure::Misplaced { 100.0 } else { 1.0 };
    let mean = method.mean(measure).map(|found| Mean {
        mean: factor * found.mean,
        error: found.error.filter(|_| with_error),
        ..found
    });
    let cell = shown(mean, digits, signed);
    let between_seeds = match (measure, mean) {
        (_, None) => None,
        (Measure::Envelope, _) => method.mean(Measure::EnvelopeFloor).map(|between| between.mean),
        (_, Some(mean)) => mean.spread,
    };
    between_seeds.map_or(cell.clone(), |between| format!("{cell} ({between:.digits$})"))
}

/// A mean with its standard error.
fn shown(value: Option<Mean>, digits: usize, signed: bool) -> String {
    let Some(Mean { mean, error, .. }) = value else {
        return "–".to_owned();
    };
    let mean = if signed { format!("{mean:+.digits$}") } else { format!("{mean:.digits$}") };
    error.map_or_else(|| mean.clone(), |error| format!("{mean} ±{error:.digits$}"))
}

/// The measures that are shown by material: name, and whether it is signed.
const ON_MATERIALS: [(&str, Measure, bool); 4] = [
    ("LSD, dB", Measure::Lsd, false),
    ("100-500 Hz, dB", Measure::MiddleLsd, false),
    ("20-40 Hz, dB", Measure::Low, true),
    ("total, dB", Measure::Total, true),
];

/// A table of materials and methods for each measure that all materials have; `*` marks a method that is worse than a
/// plain baseline on that material.
pub fn materials(found: &Holdout, split: &SplitResult) -> Vec<Table> {
    let tables = ON_MATERIALS.into_iter();
    tables.filter_map(|shown| on_materials(found, split, shown)).collect()
}

fn on_materials(
    found: &Holdout,
    split: &SplitResult,
    (name, measure, signed): (&str, Measure, bool),
) -> Option<Table> {
    let complete = |method: &MethodMean| method.by_material(measure).len() == found.materials.len();
    if !split.methods.iter().all(complete) {
        return None;
    }
    let words = split.methods.iter().map(|method| method.method.as_str().to_owned());
    let rows = found.materials.iter().enumerate().map(|(material, name)| {
        let off = |method: &MethodMean| method.by_material(measure)[material];
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
