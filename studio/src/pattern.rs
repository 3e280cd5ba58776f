//! The last seconds of a page's sound as a file of phones and controllers.

use super::error::{StageError, other};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use haptograph_learning::pattern::{Format, encode};
use serde::Deserialize;
use serde_json::{Value, json};

/// Longest name of a unit.
const MOST_UNIT_BYTES: usize = 64;

/// Samples that a page has kept.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct Kept {
    format: Format,
    rate_hz: f64,
    /// Physical value of a sample of 1, and its unit.
    full_scale: f64,
    unit: String,
    /// 32-bit floats, little-endian, as base64.
    samples: String,
}

impl Kept {
    /// The `text` of the file, and what is lost in it.
    ///
    /// # Errors
    /// [`StageError`] for samples that make no file.
    pub(crate) fn pattern(&self) -> Result<Value, StageError> {
        let failed =
            |error: &dyn std::fmt::Display| other(format_args!("the sound cannot be exported: {error}"));
        let bytes = STANDARD.decode(&self.samples).map_err(|error| failed(&error))?;
        if self.unit.len() > MOST_UNIT_BYTES || !bytes.len().is_multiple_of(4) {
            return Err(failed(&"its unit is too long, or its samples are no 32-bit floats"));
        }
        let samples = bytes.as_chunks().0.iter();
        let samples: Vec<f64> =
            samples.map(|bytes| f64::from(f32::from_le_bytes(*bytes)) * self.full_scale).collect();
        let pattern =
            encode(&samples, self.rate_hz, &self.unit, self.format).map_err(|error| failed(&error))?;
        Ok(json!({ "text": pattern.text, "loss": pattern.loss }))
    }
}
