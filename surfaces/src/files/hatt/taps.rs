//! Reads tap files.

use super::cursor::Cursor;
use super::models::{need, once, same};
use super::{HattProblem, TAP_RATE_HZ};
use crate::files::{MAX_TAP_SAMPLES, MAX_TAPS, Problem};
use crate::{Origin, Provenance, Surface, Tap, Taps};

const SET: &str = "tapSet";
const TAP: &str = "tap";

/// Reads a tap set after the start of its root element. The file does not name its material.
pub(super) fn read(cursor: &mut Cursor) -> Result<Surface, Problem> {
    let (mut count, mut speeds, mut taps) = (None, None, Vec::new());
    while let Some(element) = cursor.child(SET)? {
        match element.name.as_str() {
            "numTap" => once(&mut count, cursor.number("numTap")?, "numTap", SET)?,
            "speedList" => {
                once(
                    &mut speeds,
                    cursor.values("speedList", MAX_TAPS, Cursor::thousandth)?,
                    "speedList",
                    SET,
                )?;
            }
            "tap" if taps.len() == MAX_TAPS => {
                return Err(HattProblem::TooMany { field: TAP, most: MAX_TAPS }.into());
            }
            "tap" => taps.push(read_tap(cursor)?),
            _ => {
                return Err(HattProblem::Unknown { field: element.name, parent: SET }.into());
            }
        }
    }
    let speeds = need(speeds, "speedList", SET)?;
    same("numTap", need(count, "numTap", SET)?, taps.len() as f64)?;
    same("numTap", taps.len() as f64, speeds.len() as f64)?;
    for (tap, listed) in taps.iter().zip(&speeds) {
        same("tapSpeed", 1000.0 * tap.speed_m_s, 1000.0 * listed)?;
    }
    let provenance = Provenance::new(Origin::Imported, "Penn Haptic Texture Toolkit tap file");
    let mut surface = Surface::new("", provenance);
    surface.taps = Some(Taps::new(TAP_RATE_HZ, taps)?);
    Ok(surface)
}

fn read_tap(cursor: &mut Cursor) -> Result<Tap, HattProblem> {
    let (mut speed, mut acceleration) = (None, None);
    while let Some(element) = cursor.child(TAP)? {
        match element.name.as_str() {
            "tapSpeed" => once(&mut speed, cursor.thousandth("tapSpeed")?, "tapSpeed", TAP)?,
            "tapAccel" => {
                let samples = cursor.values("tapAccel", MAX_TAP_SAMPLES, Cursor::number)?;
                once(&mut acceleration, samples, "tapAccel", TAP)?;
            }
            _ => {
                return Err(HattProblem::Unknown { field: element.name, parent: TAP });
            }
        }
    }
    Ok(Tap {
        speed_m_s: need(speed, "tapSpeed", TAP)?,
        acceleration_m_s2: need(acceleration, "tapAccel", TAP)?,
        peak_force_n: None,
    })
}
