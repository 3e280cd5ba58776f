//! `haptograph export`: a vibration as files of phones and controllers.

use super::compare::signal::{Signal, chosen};
use super::import::{NamedColumn, Tables, named_column, number};
use super::placing::{Force, Output};
use super::result::{CommandResult, show};
use super::table::{significant, table};
use super::{Failure, recording, refuse_overwrite, surface};
use crate::engine::registry::Registry;
use crate::learning::pattern::{Format, Loss, Pattern, encode};
use crate::learning::processing::processed;
use crate::learning::recording::ImportSettings;
use crate::surfaces::bounds::{MAX_FORCE_N, MAX_SPEED_M_S};
use crate::surfaces::rendering::{SynthesisSettings, Trajectory, synthesise};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Write a vibration as .ahap (Apple), .haptic (Meta) or .hjif (ISO/IEC 23090-31), and measure what is lost
///
/// A vibration is a WAV file, table or recording, as for `compare`, or a surface at a force and speed, or along a recording's.
/// These files hold curves of amplitude and frequency, and taps, in place of samples. Each is decoded again, and its levels are
/// compared with those of the vibration.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The vibration, or a surface
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The files to write; the extension determines the format: .ahap, .haptic or .hjif
    #[arg(value_name = "OUT", required = true, num_args = 1..)]
    outputs: Vec<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print what is lost as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    motion: Motion,
    /// The column of a table, or the channel of a WAV file, from 0; or the column of a quantity, as for
    /// learn: accel=acc_z
    #[arg(long = "column", value_name = "NAME", value_parser = named_column, help_heading = "Reading tables")]
    columns: Vec<NamedColumn>,
    #[command(flatten)]
    tables: Tables,
}

/// Flags for the motion over a surface.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Rendering a surface")]
struct Motion {
    /// The normal force on the surface
    #[arg(long, value_name = "N", value_parser = |text: &str| number(text, 0.0..=MAX_FORCE_N, "give a force from 0 to 10000 N"), requires = "speed_mm_s")]
    force_n: Option<f64>,
    /// The speed over the surface
    #[arg(long, value_name = "MM_S", value_parser = |text: &str| number(text, 0.0..=1000.0 * MAX_SPEED_M_S, "give a speed from 0 to 100000 mm/s"), requires = "force_n")]
    speed_mm_s: Option<f64>,
    /// The duration at this force and speed
    #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = |text: &str| number(text, 0.05..=300.0, "give a number of seconds from 0.05 to 300"))]
    seconds: f64,
    /// A recording, along whose force and speed the surface is rendered
    #[arg(long, value_name = "RECORDING", conflicts_with = "force_n")]
    along: Option<PathBuf>,
    /// Seed of the rendering
    #[arg(long, default_value_t = 1, value_parser = super::seed)]
    seed: u64,
}

/// A written file, and what is lost in it.
#[derive(Serialize)]
struct Row {
    #[serde(flatten)]
    loss: Loss,
    written: PathBuf,
}

/// The files of a vibration.
#[derive(Serialize)]
struct Exported {
    files: Vec<Row>,
    rate_hz: f64,
    seconds: f64,
}

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let mut outputs = vec![];
    for path in &arguments.outputs {
        let format = Format::of(path).map_err(Failure::doing("write", path))?;
        refuse_overwrite([&arguments.input].into_iter().chain(&arguments.motion.along), path)?;
        outputs.push((Output::claim(path, arguments.force)?, format));
    }
    let (column, import) = chosen(&arguments.columns, &arguments.tables)?;
    let is_surface = surface::check_extension(&arguments.input).is_ok_and(|()| {
        arguments.input.extension().is_some_and(|extension| extension == "ron") || arguments.motion.is_given()
    });
    let (samples, rate_hz, unit) = match is_surface {
        true => rendered(&arguments.input, &arguments.motion, &import)?,
        false if arguments.motion.is_given() => {
            let input = arguments.input.display();
            return Err(Failure::Message(format!(
                "{input} is no surface, which --force-n and --speed-mm-s or --along render; leave them out, or give a .ron or .xml file"
            )));
        }
        false => Signal::read(&arguments.input, column, &import)?.with_rate()?,
    };
    let mut files = vec![];
    for (output, format) in outputs {
        let encoded = encode(&samples, rate_hz, &unit, format);
        let Pattern { text, loss } = encoded.map_err(Failure::doing("export", &arguments.input))?;
        files.push(Row { written: output.write(text)?, loss });
    }
    let seconds = samples.len() as f64 / rate_hz;
    show(&Exported { files, rate_hz, seconds }, arguments.json)
}

impl Motion {
    fn is_given(&self) -> bool {
        self.force_n.is_some() || self.along.is_some()
    }
}

/// The vibration of a surface, its rate and its unit.
fn rendered(
    path: &Path,
    motion: &Motion,
    import: &ImportSettings,
) -> Result<(Vec<f64>, f64, String), Failure> {
    let failed = |why: &str| Failure::file("render", path, &why);
    let surface = surface::load(path)?;
    let texture =
        surface.texture.as_ref().ok_or_else(|| failed("it has no texture; give another surface"))?;
    let rate_hz = texture.rate_hz();
    let trajectory = match (motion.force_n.zip(motion.speed_mm_s), &motion.along) {
        (Some((force_n, speed_mm_s)), _) => {
            let samples = (motion.seconds * rate_hz) as usize;
            Trajectory {
                rate_hz,
                speed_m_s: vec![speed_mm_s / 1000.0; samples],
                force_n: vec![force_n; samples],
            }
        }
        (None, Some(along)) => {
            let loaded = recording::load_with(along, import)?;
            let processed = processed(&loaded.recording, &Default::default());
            processed.map_err(Failure::doing("process", along))?.trajectory_at(rate_hz)
        }
        (None, None) => {
            return Err(failed("give --force-n and --speed-mm-s, or a recording by --along"));
        }
    };
    let settings = SynthesisSettings { seed: motion.seed, lines_seed: motion.seed, ..Default::default() };
    let vibration = synthesise(texture, &trajectory, &settings).map_err(Failure::doing("render", path))?;
    Ok((vibration, rate_hz, "m/s2".to_owned()))
}

impl CommandResult for Exported {
    const INDENTED: bool = true;

    fn text(&self) -> String {
        let number =
            |value: Option<f64>| value.map_or_else(|| "none".to_owned(), |value| format!("{value:.1}"));
        let mut text = String::new();
        for Row { loss, written } in &self.files {
            let Loss { bytes, points, taps, unit, lost, .. } = loss;
            let full_scale = significant(loss.full_scale, 4);
            text += &format!(
                "wrote {}: {points} points and {taps} taps in {bytes} bytes; an amplitude of 1 is {full_scale} {unit}\n\
                 \x20 lost  {lost}\n",
                written.display()
            );
        }
        let header: Vec<&str> = ["decoded again, dB", "vibration"]
            .into_iter()
            .chain(self.files.iter().map(|row| row.loss.format))
            .collect();
        let row = |name: String, before: String, of: &dyn Fn(&Loss) -> Option<f64>| -> Vec<String> {
            [name, before].into_iter().chain(self.files.iter().map(|row| number(of(&row.loss)))).collect()
        };
        let mut rows = vec![
            row("error of the levels over 50 ms".to_owned(), String::new(), &|loss| Some(loss.envelope_db)),
            row("log-spectral distance".to_owned(), String::new(), &|loss| loss.lsd_db),
        ];
        let bands = self.files.first().map_or(&[][..], |row| &row.loss.bands);
        for (index, band) in bands.iter().enumerate() {
            let name = format!("level at {:.0} Hz", band.centre_hz);
            rows.push(row(name, number(band.before_db), &|loss| loss.bands.get(index)?.after_db));
        }
        text + "\n" + &table(&header, &rows)
    }
}
