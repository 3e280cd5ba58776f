//! `haptograph simulate-recording`: simulates a recording with the recording graph.

use super::import::number;
use super::placing::{Force, Output};
use super::progress::Progress;
use super::run::stop_on_interrupt;
use super::{Failure, eprint, print, print_json};
use crate::engine::registry::Registry;
use crate::learning::recording::{Gesture, save};
use crate::nodes::simulated::material::MaterialName;
use crate::recorder::{RecordError, SimulatedTake, record};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde_json::json;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// Simulate the recording of a surface by graphs/recorder.ron, as input for learn
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The simulated material
    #[arg(long, value_parser = materials())]
    material: MaterialName,
    /// The gesture: drag for textures, circle for friction, tap for taps, press for stiffness
    #[arg(long, value_parser = motions())]
    motion: Gesture,
    /// Let the material stick and slip, and begin the strokes of a drag from rest
    #[arg(long)]
    from_rest: bool,
    /// Number of the simulated person; each has its own hand, posture and habits
    #[arg(long, default_value_t = 1)]
    person: u64,
    /// Length of the recording
    #[arg(long, default_value_t = 10.0, value_parser = seconds)]
    seconds: f64,
    /// Seed of the material sample and of the take
    #[arg(long, default_value_t = 1, value_parser = super::seed)]
    seed: u64,
    /// The file to write: haptograph's own archive (.npz) or a table (.csv)
    #[arg(short, long = "output", value_name = "FILE", value_parser = recording_file)]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

fn materials() -> impl TypedValueParser<Value = MaterialName> {
    PossibleValuesParser::new(MaterialName::ALL.map(MaterialName::as_str))
        .try_map(|text| text.parse::<MaterialName>())
}

fn motions() -> impl TypedValueParser<Value = Gesture> {
    PossibleValuesParser::new(Gesture::ALL.map(Gesture::as_str)).try_map(|text| text.parse::<Gesture>())
}

fn seconds(text: &str) -> Result<f64, String> {
    number(text, 0.1..=3600.0, "give a number of seconds from 0.1 to 3600")
}

fn recording_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().unwrap_or_default().to_ascii_lowercase().to_str() {
        Some("npz" | "csv") => Ok(path),
        _ => Err("a recording is written as .npz (haptograph's own archive) or .csv".to_owned()),
    }
}

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let take = SimulatedTake {
        material: arguments.material,
        gesture: arguments.motion,
        from_rest: arguments.from_rest,
        person: arguments.person,
        seconds: arguments.seconds,
        seed: arguments.seed,
    };
    let output = Output::claim(&arguments.output, arguments.force)?;
    let stop = stop_on_interrupt()?;
    let bar = Progress::of("recording");
    let mut recorded_s = 0.0;
    let recording = record(&take, &stop, &mut |done_s| {
        recorded_s = done_s;
        bar.at(done_s / take.seconds);
    });
    drop(bar);
    let recording = recording.map_err(|error| match error {
        RecordError::Graph(diagnostics) => Failure::Graph(diagnostics),
        _ if stop.load(Ordering::Relaxed) => Failure::Message(format!(
            "stopped after {recorded_s:.3} s, too early for a recording; nothing was written"
        )),
        error => Failure::Message(error.to_string()),
    })?;
    let (output, ()) = output.write_by(|path| save(&recording, path))?;
    if stop.load(Ordering::Relaxed) {
        eprint(&format!("warning: stopped after {recorded_s:.3} s of {} s\n", take.seconds));
    }
    let (motion, material) = (take.gesture.as_str(), take.material.as_str());
    match arguments.json {
        true => print_json(
            &json!({ "written": [output], "simulated": true, "motion": motion, "material": material }),
        )?,
        false => print(&format!("wrote {} (simulated: {motion} over {material})\n", output.display()))?,
    }
    if stop.load(Ordering::Relaxed) { Err(Failure::Interrupted) } else { Ok(()) }
}
