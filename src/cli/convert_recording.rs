//! `haptograph convert-recording`: writes a recording in another format.

use super::import::{Import, Touch};
use super::placing::{Force, Output};
use super::result::{Written, show};
use super::{Failure, eprint, recording, refuse_overwrite};
use crate::engine::registry::Registry;
use crate::learning::recording::{Gesture, contents, file_names};
use std::path::PathBuf;

/// Convert a recording between haptograph's archive, tables and the toolkit's (HaTT) XML
///
/// Reads what `learn` reads. The toolkit's three files hold a processed recording with all axes in the
/// world's frame; a raw one is processed as by `learn`. They have no field for the gesture.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The recording
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The file to write: .npz, .csv, or Accel_<material>.xml, which also writes Position_<material>.xml and
    /// Force_<material>.xml
    #[arg(value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    touch: Touch,
    #[command(flatten)]
    import: Import,
}

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let failed = |error: &dyn std::fmt::Display| Failure::file("write", &arguments.output, error);
    let names = file_names(&arguments.output).map_err(|error| failed(&error))?;
    for name in &names {
        refuse_overwrite(recording::parts(&arguments.input), name)?;
    }
    let outputs = names.iter().map(|name| Output::claim(name, arguments.force));
    let outputs = outputs.collect::<Result<Vec<Output>, Failure>>()?;
    let import = arguments.import.settings().map_err(Failure::Message)?;
    let loaded = recording::load_with(&arguments.input, &arguments.touch.added_to(import))?;
    let gesture = loaded.recording.gesture();
    if names.len() > 1 && gesture != Gesture::Drag {
        let name = gesture.as_str();
        eprint(&format!(
            "warning: the toolkit's files do not state that this is a {name}: learn from them with --{name}\n"
        ));
    }
    let contents = contents(&loaded.recording, &arguments.output).map_err(|error| failed(&error))?;
    let written = outputs.iter().zip(contents).map(|(output, bytes)| output.write(bytes));
    let written = written.collect::<Result<Vec<PathBuf>, Failure>>()?;
    let text = written.iter().map(|path| format!("wrote {}\n", path.display())).collect();
    show(&Written::several(written, text), arguments.json)
}
