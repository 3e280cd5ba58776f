//! Vibrations to compare by ear: that of a recording, and those of surfaces along its motion.

use super::describe;
use super::error::{StageError, other};
use super::learn::Compared;
use super::load::Source;
use super::talk;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use haptograph_learning::processing::{ProcessingSettings, processed};
use haptograph_learning::recording::load_with;
use haptograph_signal::resample::{Quality, resample_whole};
use haptograph_signal::time::Rate;
use haptograph_surfaces::files::load;
use haptograph_surfaces::rendering::synthesise;
use serde_json::{Value, json};
use std::path::Path;

/// Longest part that is heard, s.
const LONGEST_S: f64 = 20.0;
/// Least rate that every browser plays, Hz.
const LEAST_HZ: f64 = 8000.0;
/// Largest recording, which is read in the process of the graph, bytes.
const MAX_BYTES: usize = 16 << 20;

/// The reply with `voices`: the vibration of the recording in a file, then those of the surfaces.
pub(crate) fn reply(request: u64, table: &Path, compared: &Compared, source: &Source) -> Value {
    let voices = voices(table, compared, source);
    let (voices, result) = match voices {
        Ok(voices) => (Value::Array(voices), Ok(String::new())),
        Err(error) => (Value::Null, Err(error)),
    };
    let mut reply = talk::reply(request, result);
    reply["voices"] = voices;
    reply
}

/// Checks the size of a recording before it is read.
///
/// # Errors
/// [`StageError`] with its size.
pub(crate) fn check_size(compared: &Compared) -> Result<(), StageError> {
    match compared.dropped.csv.len() {
        ..=MAX_BYTES => Ok(()),
        bytes => Err(other(format_args!(
            "{} has {} MiB; to listen at most {} MiB are read: cut the recording",
            compared.dropped.name,
            bytes >> 20,
            MAX_BYTES >> 20
        ))),
    }
}

fn voices(table: &Path, compared: &Compared, source: &Source) -> Result<Vec<Value>, StageError> {
    let settings = compared.dropped.mapping.settings().map_err(other)?;
    let name = &compared.dropped.name;
    let unread = |error: &dyn std::fmt::Display| other(format_args!("{name} cannot be heard: {error}"));
    let (recording, _) = load_with(&[table.to_owned()], &settings).map_err(|error| unread(&error))?;
    let recording = processed(&recording, &ProcessingSettings::default()).map_err(|error| unread(&error))?;
    let samples = recording.samples().min((LONGEST_S * recording.rate_hz()) as usize);
    let recorded = &recording.signals().acceleration_m_s2[..samples];
    let mut voices = vec![voice(name, recording.rate_hz(), recorded)];
    let listed = describe::listed(source);
    for path in &compared.surfaces {
        let listed = listed.iter().find(|file| describe::from_graph(file, source.folder()) == *path);
        let file = listed.ok_or_else(|| other(format_args!("{path} is no surface of this graph")))?;
        let surface = load(file).map_err(other)?;
        let texture = surface
            .texture
            .as_ref()
            .ok_or_else(|| other(format_args!("`{}` has no texture", surface.name)))?;
        let mut hand = recording.trajectory_at(texture.rate_hz());
        let samples = (samples as f64 / recording.rate_hz() * hand.rate_hz) as usize;
        [&mut hand.speed_m_s, &mut hand.force_n].into_iter().for_each(|values| values.truncate(samples));
        let heard = synthesise(texture, &hand, &Default::default()).map_err(other)?;
        voices.push(voice(&surface.name, hand.rate_hz, &heard));
    }
    Ok(voices)
}

/// Samples in m/s², as 32-bit floats, little-endian, at a rate that browsers play.
fn voice(name: &str, rate_hz: f64, samples: &[f64]) -> Value {
    let rate = |hz: f64| Rate::parse(&hz.to_string()).ok();
    let raised = (rate_hz < LEAST_HZ).then_some(LEAST_HZ).and_then(|to_hz| {
        let raised = resample_whole(samples, rate(rate_hz)?, rate(to_hz)?, Quality::FINE).ok()?;
        Some((to_hz, raised))
    });
    let (rate_hz, samples) =
        raised.as_ref().map_or((rate_hz, samples), |(rate_hz, raised)| (*rate_hz, raised));
    let bytes: Vec<u8> = samples.iter().flat_map(|sample| (*sample as f32).to_le_bytes()).collect();
    json!({ "name": name, "rate_hz": rate_hz, "samples": STANDARD.encode(bytes) })
}
