//! `haptograph surface leave-one-out`: compares the accuracy of kinds of maps between and beyond measured
//! models.

use super::{Failure, Surfaces};
use crate::cli::progress::Progress;
use crate::cli::result::{CommandResult, show};
use crate::cli::table::table;
use crate::learning::evaluate::holdout::Mean;
use crate::learning::evaluate::leave_one_out::{FAR, PowerExponents};
use crate::learning::evaluate::{LeaveOneOut, MapKind, Prediction, Summary, leave_one_out};
use crate::surfaces::TextureModel;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

/// Compare kinds of maps: predict each measured model of a texture from the others
///
/// Reads surfaces with measured models: the toolkit's files, and the output of `learn --method thesis`. Each
/// model is left out and predicted by the thesis's triangulation, by the nearest model, and by the law that
/// `learn` fits by default; then models at least 1.7 times the speed away are predicted from a narrow third
/// of the models. Errors are log-spectral distances over the third octaves from 20 to 1000 Hz, and errors of
/// the power.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    surfaces: Surfaces,
    /// Print all figures as JSON
    #[arg(long)]
    json: bool,
}

const CAVEAT: &str = "The toolkit's models were cleaned by planes in force and speed before publication, which favours trends: \
     a law may do worse on raw recordings.";
const FADE: &str = "The law is what a surface renders: models on a grid, interpolated, with an amplitude that falls linearly below a third of the lightest \
     known force, 0.9 N at most. Without fade it is what was fitted.";

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let surfaces = arguments.surfaces.load()?;
    let textures: Vec<&TextureModel> = surfaces.iter().filter_map(|one| one.texture.as_ref()).collect();
    let found = Progress::during("leaving out", |at| leave_one_out(&textures, at));
    let found = found.map_err(Failure::doing("compare maps of", &arguments.surfaces.paths[0]))?;
    show(&Compared(found), arguments.json)
}

/// Accuracy of all kinds of maps.
struct Compared(LeaveOneOut);

impl CommandResult for Compared {
    fn text(&self) -> String {
        describe(&self.0)
    }
}

/// A named subset of the predictions.
type Part = (&'static str, fn(&Prediction) -> bool);
const PARTS: [Part; 3] = [("all", |_| true), ("inside", |one| one.inside), ("outside", |one| !one.inside)];

fn describe(found: &LeaveOneOut) -> String {
    let models = Summary::of(&found.left_out, MapKind::Law, |_| true).map_or(0, |law| law.models);
    let mut text = format!(
        "{models} measured models of {} textures, each predicted from the others of its texture.\n\
         Means over textures ± standard error; LSD over third octaves from 20 to 1000 Hz.\n\n",
        found.textures
    );
    let mut rows = vec![];
    for (part, count) in PARTS {
        for map in MapKind::ALL {
            rows.extend(Summary::of(&found.left_out, map, count).map(|one| row(part, map, &one)));
        }
    }
    text += &table(&HEADER, &rows);
    let far = MapKind::ALL.map(|map| Summary::of(&found.far, map, |_| true).map(|one| row("far", map, &one)));
    text += &format!(
        "\nFrom a narrow third of the models, predictions at speeds at least {FAR} times away:\n\n{}",
        table(&HEADER, &far.into_iter().flatten().collect::<Vec<_>>())
    );
    if let Some(exponents) = &found.exponents {
        text += &format!("\n{}\n", describe_exponents(exponents));
    }
    text + &format!("\n{FADE}\n{CAVEAT}\n")
}

const HEADER: [&str; 7] =
    ["models", "map", "LSD dB", "power off by dB", "beyond 6 dB %", "of all models %", "count"];

fn row(part: &str, map: MapKind, one: &Summary) -> Vec<String> {
    let number = |value: &Mean, scale: f64, digits: usize| {
        let error = value.error.map_or_else(String::new, |error| format!(" ± {:.digits$}", error * scale));
        format!("{:.digits$}{error}", value.mean * scale)
    };
    let [lsd, power] = [&one.lsd_db, &one.power_db].map(|value| number(value, 1.0, 2));
    let (beyond, of_models) = (number(&one.beyond, 100.0, 1), format!("{:.1}", 100.0 * one.beyond_of_models));
    let names = [part, map.as_str()].map(str::to_owned);
    names.into_iter().chain([lsd, power, beyond, of_models, one.models.to_string()]).collect()
}

fn describe_exponents(exponents: &PowerExponents) -> String {
    let PowerExponents { pooled, mean, deviation, textures } = exponents;
    format!(
        "Power is proportional to speed^{:.2} force^{:.2} over all models, with a level per texture; fitted to each of {textures} textures alone, \
         to speed^{:.2} force^{:.2}, with standard deviations of {:.2} and {:.2}. The law is regularised towards the former, without the predicted texture.",
        pooled[0], pooled[1], mean[0], mean[1], deviation[0], deviation[1]
    )
}

impl Serialize for Compared {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self(found) = self;
        let of = |predictions: &[Prediction], count: fn(&Prediction) -> bool| -> Value {
            let maps = MapKind::ALL.into_iter().filter_map(|map| {
                let one = Summary::of(predictions, map, count)?;
                Some((map.as_str().replace(' ', "_"), summary(&one)))
            });
            Value::Object(maps.collect())
        };
        let parts = PARTS.map(|(part, count)| (part.to_owned(), of(&found.left_out, count)));
        json!({
            "textures": found.textures, "left_out": Value::Object(parts.into_iter().collect()),
            "narrow_third": { "speeds_apart": FAR, "maps": of(&found.far, |_| true) },
            "power_exponents": found.exponents, "notes": [FADE, CAVEAT],
        })
        .serialize(serializer)
    }
}

fn summary(one: &Summary) -> Value {
    json!({
        "lsd_db": one.lsd_db.mean, "lsd_error_db": one.lsd_db.error, "power_db": one.power_db.mean,
        "power_error_db": one.power_db.error, "beyond_6_db": one.beyond.mean,
        "beyond_6_db_of_models": one.beyond_of_models, "models": one.models, "textures": one.textures,
    })
}
