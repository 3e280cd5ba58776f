//! `haptograph identify`: fits the parameters of a voice-coil actuator to a recorded sweep.

use super::import::{Import, positive};
use super::placing::{Force, Output};
use super::result::{CommandResult, look_at, show};
use super::{Failure, eprint, recording};
use crate::engine::registry::Registry;
use crate::engine::settings::Setting;
use crate::learning::recording::load_sweep;
use crate::nodes::actuators::identify::{Known, Sweep, identify};
use crate::nodes::simulated::haptuator::TwoMassSettings;
use crate::report::identification;
use crate::report::page::Simulation;
use crate::signal::units::{Grams, NewtonsPerMillimetre};
use clap::ArgGroup;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Fit a voice-coil actuator on its tool to a recorded sweep of current and acceleration
///
/// The recording is a table, about ten seconds long, with the columns `time_s`, a current (`..._a`) and an
/// acceleration (`..._m_s2`), or the columns named by --column time, current and accel; `haptograph run
/// graphs/identify.ron` makes one. A sweep alone determines the resonances, their quality and the gain. With
/// the magnet's mass and either the total mass that moves with the tool or the force per current, it
/// determines every mass, spring and damper. One mass is not enough: the model has seven parameters, one of
/// them an unobservable scale, and the sweep yields five numbers.
#[derive(Debug, clap::Args)]
#[command(group = ArgGroup::new("scale").args(["body_g", "force_n_per_a"]))]
pub(super) struct Arguments {
    /// The recording
    recording: PathBuf,
    /// Known mass of the magnet
    #[arg(long, value_name = "GRAMS", value_parser = positive, requires = "scale")]
    magnet_g: Option<f64>,
    /// Known mass of the body, the tool and the part of the hand that moves with them
    #[arg(long, value_name = "GRAMS", value_parser = positive, requires = "magnet_g")]
    body_g: Option<f64>,
    /// Known force per current, from the data sheet
    #[arg(long, value_name = "N/A", value_parser = positive, requires = "magnet_g")]
    force_n_per_a: Option<f64>,
    /// Lowest frequency of the sweep
    #[arg(long, value_name = "HZ", default_value_t = 10.0, value_parser = positive)]
    from_hz: f64,
    /// Highest frequency of the sweep
    #[arg(long, value_name = "HZ", default_value_t = 1000.0, value_parser = positive)]
    to_hz: f64,
    /// Also write a page with the result, the fit and its residual into this folder
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print the fit as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    import: Import,
}

impl Arguments {
    fn known(&self) -> Known {
        let kilograms = |grams: f64| grams * 1e-3;
        match (self.magnet_g, self.body_g, self.force_n_per_a) {
            (Some(magnet_g), Some(body_g), _) => {
                Known::Masses { magnet_kg: kilograms(magnet_g), body_kg: kilograms(body_g) }
            }
            (Some(magnet_g), None, Some(force_n_per_a)) => {
                Known::MagnetAndForce { magnet_kg: kilograms(magnet_g), force_n_per_a }
            }
            _ => Known::Nothing,
        }
    }
}

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let page = Output::claim_page(arguments.report.as_deref(), arguments.force)?;
    let import = arguments.import.settings().map_err(Failure::Message)?;
    let (file, findings) =
        load_sweep(&arguments.recording, &import).map_err(|error| recording::failure(&error))?;
    for finding in &findings {
        eprint(&format!("warning: {}\n", recording::said(&arguments.recording, finding)));
    }
    let sweep = Sweep {
        current_a: &file.current_a,
        acceleration_m_s2: &file.acceleration_m_s2,
        rate_hz: file.rate_hz,
        band_hz: [arguments.from_hz, arguments.to_hz],
    };
    let found =
        identify(&sweep, arguments.known()).map_err(Failure::doing("identify", &arguments.recording))?;
    let simulated = recording::is_simulated(&arguments.recording)?;
    let simulation = match simulated {
        true => Simulation::Whole("The recording is of a simulated actuator.".to_owned()),
        false => Simulation::None,
    };
    let name = arguments.recording.display().to_string();
    let page = page.map(|page| page.write(identification::page(&name, &found, &simulation))).transpose()?;
    let fit = Fit {
        delay_s: found.delay_s,
        gain_m_s2_per_a: found.response.gain,
        parameters: found.parameters.map(|model| parameters(&model.into())),
        resonances: found.modes.map(|mode| Resonance { frequency_hz: mode.frequency_hz, q: mode.q }),
        simulated,
        unexplained: found.unexplained,
        model: found.parameters.map(TwoMassSettings::from),
        page,
    };
    show(&fit, arguments.json)
}

/// An actuator fitted to a recording.
#[derive(Serialize)]
struct Fit {
    delay_s: f64,
    gain_m_s2_per_a: f64,
    parameters: Option<Value>,
    /// The higher first.
    resonances: [Resonance; 2],
    simulated: bool,
    unexplained: f64,
    #[serde(skip)]
    model: Option<TwoMassSettings>,
    #[serde(skip)]
    page: Option<PathBuf>,
}

#[derive(Serialize)]
struct Resonance {
    frequency_hz: f64,
    q: f64,
}

fn parameters(model: &TwoMassSettings) -> Value {
    json!({
        "force_n_per_a": model.force_n_per_a, "magnet_g": model.magnet_g.0,
        "suspension_n_per_mm": model.suspension_n_per_mm.0,
        "suspension_n_s_per_m": model.suspension_n_s_per_m, "body_g": model.body_g.0,
        "hand_n_per_mm": model.hand_n_per_mm.0, "hand_n_s_per_m": model.hand_n_s_per_m,
    })
}

impl CommandResult for Fit {
    const INDENTED: bool = true;

    fn text(&self) -> String {
        let Self { resonances: [high, low], gain_m_s2_per_a: gain, .. } = self;
        let (delay_ms, unexplained_percent) = (self.delay_s * 1e3, self.unexplained * 100.0);
        let mut text = format!(
            "resonances {:.1} Hz (Q {:.2}) and {:.1} Hz (Q {:.2})\n\
             gain above them {gain:.1} m/s2 per A, delay {delay_ms:.2} ms; {unexplained_percent:.2} % of the power in the band is left unexplained\n",
            high.frequency_hz, high.q, low.frequency_hz, low.q
        );
        if self.simulated {
            text += "of a simulated actuator\n";
        }
        text += &match &self.model {
            Some(model) => format!("\nfor DynamicCompensator(model: ...):\n\n{}\n", rounded(model).show()),
            None => "\nwith --magnet-g and --body-g (or --force-n-per-a) the masses, springs and dampers are determined too\n".to_owned(),
        };
        text + &look_at(self.page.as_ref())
    }
}

/// Rounds to four digits, beyond the accuracy of a recording.
fn rounded(p: &TwoMassSettings) -> TwoMassSettings {
    let round = |value: f64| {
        let scale = 10_f64.powf(3.0 - value.abs().log10().floor());
        (value * scale).round() / scale
    };
    TwoMassSettings {
        force_n_per_a: round(p.force_n_per_a),
        magnet_g: Grams(round(p.magnet_g.0)),
        suspension_n_per_mm: NewtonsPerMillimetre(round(p.suspension_n_per_mm.0)),
        suspension_n_s_per_m: round(p.suspension_n_s_per_m),
        body_g: Grams(round(p.body_g.0)),
        hand_n_per_mm: NewtonsPerMillimetre(round(p.hand_n_per_mm.0)),
        hand_n_s_per_m: round(p.hand_n_s_per_m),
    }
}
