//! The head of an archive of a recording, the text `head.ron`: format, kind, rates, calibration, gesture, provenance.

use super::{Calibration, Gesture, RawHead};
use crate::Provenance;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The format version in the head. A reader refuses others.
pub const FORMAT: u32 = 1;

#[derive(Debug, Serialize, Deserialize)]
#[allow(missing_docs)] // as in the file
#[serde(rename = "Recording", deny_unknown_fields)]
pub struct Head {
    pub format: u32,
    pub kind: Kind,
    pub gesture: String,
    pub provenance: ProvenanceHead,
}

#[derive(Debug, Serialize, Deserialize)]
#[allow(missing_docs)] // as in the file
pub enum Kind {
    Raw { motion: Timing, wrench: Timing, acceleration: Timing, calibration: CalibrationHead },
    Processed { rate_hz: f64 },
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[allow(missing_docs)] // as in the file
#[serde(deny_unknown_fields)]
pub struct Timing {
    pub rate_hz: f64,
    pub start_s: f64,
}

#[derive(Debug, Serialize, Deserialize)]
#[allow(missing_docs)] // as in the file
#[serde(deny_unknown_fields)]
pub struct CalibrationHead {
    pub acceleration_m_s2_per_v: [f64; 3],
    pub acceleration_zero_v: [f64; 3],
    pub force_sensor_to_tool: [[f64; 3]; 3],
    pub tracker_to_tip_m: [f64; 3],
}

#[derive(Debug, Serialize, Deserialize)]
#[allow(missing_docs)] // as in the file
#[serde(deny_unknown_fields)]
pub struct ProvenanceHead {
    pub origin: String,
    pub source: String,
    pub settings: BTreeMap<String, String>,
    pub made_by: String,
}

impl Head {
    /// A head of this version of the format.
    pub fn new(kind: Kind, gesture: Gesture, provenance: &Provenance) -> Self {
        Self {
            format: FORMAT,
            kind,
            gesture: gesture.as_str().to_owned(),
            provenance: ProvenanceHead {
                origin: provenance.origin.as_str().to_owned(),
                source: provenance.source.clone(),
                settings: provenance.settings.clone(),
                made_by: provenance.version.clone(),
            },
        }
    }

    /// The head of a raw recording that begins at time zero.
    pub fn raw(head: &RawHead<'_>) -> Self {
        let timing = |rate_hz| Timing { rate_hz, start_s: 0.0 };
        let kind = Kind::Raw {
            motion: timing(head.motion_hz),
            wrench: timing(head.wrench_hz),
            acceleration: timing(head.acceleration_hz),
            calibration: head.calibration.into(),
        };
        Self::new(kind, head.gesture, head.provenance)
    }

    /// The text of the member `head.ron`.
    ///
    /// # Errors
    /// A number that RON cannot hold.
    pub fn text(&self) -> std::io::Result<String> {
        let pretty = ron::ser::PrettyConfig::new().struct_names(true);
        ron::ser::to_string_pretty(self, pretty).map_err(std::io::Error::other)
    }
}

impl From<&Calibration> for CalibrationHead {
    fn from(calibration: &Calibration) -> Self {
        Self {
            acceleration_m_s2_per_v: calibration.acceleration_m_s2_per_v,
            acceleration_zero_v: calibration.acceleration_zero_v,
            force_sensor_to_tool: calibration.force_sensor_to_tool,
            tracker_to_tip_m: calibration.tracker_to_tip_m,
        }
    }
}

impl From<CalibrationHead> for Calibration {
    fn from(head: CalibrationHead) -> Self {
        Self {
            acceleration_m_s2_per_v: head.acceleration_m_s2_per_v,
            acceleration_zero_v: head.acceleration_zero_v,
            force_sensor_to_tool: head.force_sensor_to_tool,
            tracker_to_tip_m: head.tracker_to_tip_m,
        }
    }
}
