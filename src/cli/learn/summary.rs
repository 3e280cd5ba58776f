//! The result of `learn` as text and JSON.

use super::super::surface::clips_of;
use super::super::table::significant;
use crate::learning::learn::coverage as covered;
use crate::learning::learn::taps::TapReport;
use crate::learning::learn::texture::{Fate, TextureReport};
use crate::learning::learn::{LearningReport, NoOnset};
use crate::surfaces::coverage::Coverage;
use crate::surfaces::layers::{Layer, Onset};
use crate::surfaces::{Surface, Taps, TextureModel};
use serde_json::{Value, json};

/// The coverage of the plane of force and speed, and what to record next. No advice if a quantity may be in
/// the wrong unit.
fn verdict(coverage: &Coverage, is_implausible: bool) -> String {
    let text = format!(
        "{} of 9 areas of speed and force, {} s used",
        9 - coverage.missing().len(),
        significant(coverage.used_s, 3)
    );
    match coverage.next_to_record().filter(|_| !is_implausible) {
        Some(next) => format!("{text}; record next: {next}"),
        None => text,
    }
}

/// The coverage as JSON; `None` without a texture.
pub(super) fn coverage(surface: &Surface, report: &LearningReport, is_implausible: bool) -> Option<Value> {
    let (texture, report) = (surface.texture.as_ref()?, report.texture.as_ref()?);
    let coverage = covered(&report.segments, texture.rate_hz());
    Some(json!({
        "areas": 9 - coverage.missing().len(), "of": 9, "used_s": coverage.used_s,
        "segments": coverage.segments, "record_next": coverage.next_to_record().filter(|_| !is_implausible),
    }))
}

/// Warning about a texture learned from too little data.
pub(super) fn shortness(surface: &Surface, report: &LearningReport) -> Option<String> {
    let (texture, report) = (surface.texture.as_ref()?, report.texture.as_ref()?);
    let coverage = covered(&report.segments, texture.rate_hz());
    coverage.is_short().then(|| {
        format!(
            "the texture is learned from only {} s in {} segments; record at least 3 s and 3 segments, preferably 10 s",
            significant(coverage.used_s, 3),
            coverage.segments
        )
    })
}

/// The data that a surface is learned from.
pub(super) fn facts_of(
    surface: &Surface,
    learned: &LearningReport,
    is_implausible: bool,
) -> Vec<(&'static str, String)> {
    let mut found = vec![("origin", surface.provenance.origin.as_str().to_owned())];
    if let (Some(texture), Some(report)) = (&surface.texture, &learned.texture) {
        found.push(("texture", describe_texture(texture, report)));
        let coverage = covered(&report.segments, texture.rate_hz());
        found.push(("coverage", verdict(&coverage, is_implausible)));
        found.extend(clips_of(surface).map(|clips| ("clips", clips)));
        match (texture.layer::<Onset>(), learned.onset.as_ref()) {
            (Some(onset), _) => found.push(("onset", onset.summary(texture.rate_hz()))),
            // Free dragging has none, and wants none.
            (None, Some(Err(reason))) if *reason != NoOnset::NoStrokes => {
                found.push(("onset", format!("none: {reason}")))
            }
            _ => {}
        }
    }
    if let Some(friction) = surface.friction {
        let mu = significant(friction.mu(), 3);
        found.push(("friction", format!("mu {mu}{}", fit(friction.r_squared()))));
    }
    if let (Some(taps), Some(report)) = (&surface.taps, &learned.taps) {
        found.push(("taps", describe_taps(taps, report)));
    }
    if let Some(stiffness) = surface.stiffness {
        let n_per_mm = significant(stiffness.n_per_mm(), 3);
        found.push(("stiffness", format!("{n_per_mm} N/mm{}", fit(stiffness.r_squared()))));
    }
    let missing = learned.missing.iter();
    found.extend(missing.map(|missing| (missing.part, "none".to_owned())));
    found
}

fn fit(r_squared: Option<f64>) -> String {
    r_squared.map_or_else(String::new, |r| format!(" (R² {})", significant(r, 3)))
}

fn describe_taps(taps: &Taps, report: &TapReport) -> String {
    let used = report.contacts.iter().filter(|contact| contact.used).count();
    let response = taps.response().map_or_else(String::new, |line| {
        let slope = significant(line.slope, 3);
        format!(", response {slope} N per m/s{}", fit(Some(line.r_squared)))
    });
    let (taps, contacts) = (taps.taps().len(), report.contacts.len());
    format!("{taps} of {contacts} contacts, {used} used{response}")
}

/// The data that a texture is learned from, and its range of speed and force.
fn describe_texture(texture: &TextureModel, report: &TextureReport) -> String {
    let count = |fate: fn(&Fate) -> bool| {
        let segments = report.segments.iter();
        segments.filter(|segment| fate(&segment.fate)).count()
    };
    let kept = count(|fate| *fate == Fate::Kept);
    let outliers = count(|fate| matches!(fate, Fate::Outlier { .. }));
    let (order, all) = (report.order, report.segments.len());
    let most = |speed_m_s: f64, force_n: f64| {
        let (speed_mm_s, force_n) = (significant(speed_m_s * 1000.0, 3), significant(force_n, 3));
        format!("{speed_mm_s} mm/s and {force_n} N")
    };
    let known = most(texture.max_speed_m_s(), texture.max_force_n());
    if texture.warping() == 0.0 {
        return format!(
            "{kept} models of order {order} from {all} segments ({outliers} outliers), to {known}"
        );
    }
    // A law extends beyond the recorded windows.
    let recorded = report
        .segments
        .iter()
        .filter(|segment| segment.fate == Fate::Kept)
        .fold((0.0_f64, 0.0_f64), |(speed, force), segment| {
            (speed.max(segment.speed_m_s), force.max(segment.force_n))
        });
    let recorded = most(recorded.0, recorded.1);
    format!(
        "a law of order {order} from {kept} of {all} windows, recorded to {recorded}; extrapolated to {known}"
    )
}
