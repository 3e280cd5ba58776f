//! Optional hardware support of this build, and messages about support that is missing.

use super::Failure;
use crate::engine::graph::Graph;
use crate::live::soundcard::{self, SoundcardError};
use crate::live::{BACKENDS, BackendEntry, midi};

/// Backends that this build lacks and that devices of a graph need, with the endpoints that need them.
fn missing(graph: &Graph) -> Vec<(BackendEntry, Vec<&str>)> {
    let lacking = BACKENDS.iter().copied().filter(|backend| !backend.is_built);
    let with_needs = lacking.map(|backend| (backend, backend.endpoints(graph).collect()));
    with_needs.filter(|(_, endpoints): &(_, Vec<&str>)| !endpoints.is_empty()).collect()
}

/// Refuses a live run of a graph whose devices this build does not support, and names all missing features.
pub(super) fn refuse_missing(graph: &Graph, set: &str) -> Result<(), Failure> {
    let missing = missing(graph);
    if missing.is_empty() {
        return Ok(());
    }
    let needs: Vec<String> = missing
        .iter()
        .map(|(backend, endpoints)| format!("{} (`{}`)", backend.what, endpoints.join("`, `")))
        .collect();
    let features: Vec<&str> = missing.iter().map(|(backend, _)| backend.feature).collect();
    Err(Failure::Message(format!(
        "the {set} endpoints of this graph need {}, which this build of haptograph does not support; {}; to run without \
         hardware, give --endpoints simulated",
        needs.join(" and "),
        how_to_build(&features)
    )))
}

/// The command that builds haptograph with these features.
pub(super) fn how_to_build(features: &[&str]) -> String {
    let of_alsa = [soundcard::BACKEND.feature, midi::BACKEND.feature];
    let headers = match features.iter().any(|feature| of_alsa.contains(feature)) {
        true => {
            "; on Linux it needs `sudo apt install libasound2-dev pkg-config` (Fedora: `sudo dnf install alsa-lib-devel`)"
        }
        false => "",
    };
    format!("build with `cargo build --release --features {}`{headers}", features.join(","))
}

/// The error that the sound of a run cannot be played, with the effect on the run and the page that plays the sound.
pub(super) fn cannot_play(error: &SoundcardError, run: &str) -> Failure {
    let help = match error {
        SoundcardError::NotBuilt => format!("; {}", how_to_build(&[soundcard::BACKEND.feature])),
        _ => String::new(),
    };
    Failure::Message(format!(
        "--play: {error}{help}; {run}: the player on the run's page needs no soundcard here"
    ))
}
