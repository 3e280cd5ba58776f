//! The result of `learn` as text and JSON.

use super::super::beside::{Rows, is_material};
use super::super::surface::clips_of;
use super::super::table::significant;
use crate::learning::learn::coverage as covered;
use crate::learning::learn::friction::{FrictionFit, FrictionReport};
use crate::learning::learn::stiffness::StiffnessReport;
use crate::learning::learn::taps::TapReport;
use crate::learning::learn::texture::{Fate, TextureReport};
use crate::learning::learn::{LearnSettings, LearningReport, NoOnset, TextureMethod};
use crate::signal::statistics::median;
use crate::surfaces::coverage::Coverage;
use crate::surfaces::layers::{Layer, Onset};
use crate::surfaces::{Surface, Taps, TextureModel};
use haptograph_study::thesis::{is_same_name, published};
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

/// The numbers of the thesis that mean the same as those of a learned surface.
pub(super) fn beside(surface: &Surface, learned: &LearningReport, settings: &LearnSettings) -> Rows {
    let mut rows = Rows::default();
    if let [drag] = &learned.drags[..] {
        // The recording of an onset is cut.
        let seconds = drag.samples() as f64 / drag.rate_hz();
        rows.constant("recording length", learned.onset.iter().all(Result::is_err).then_some(seconds));
        rows.constant("force and acceleration rate", drag.rate_hz());
        if let (TextureMethod::Thesis(method), Some(report)) = (&settings.texture, &learned.texture) {
            let segments = report.segments.len();
            let orders = report.segments.iter().map(|segment| segment.order as f64).collect::<Vec<_>>();
            rows.constant("minimum segment", method.segmentation.min_span);
            rows.constant("largest AR order", method.segmentation.max_order);
            let is_canvas = is_material(&surface.name, "T2 Canvas");
            rows.constant("canvas segments", is_canvas.then_some(segments));
            let mean_ms = 1e3 * seconds / segments as f64;
            rows.constant("canvas mean segment as a time", is_canvas.then_some(mean_ms));
            rows.constant("canvas median order", is_canvas.then(|| median(&orders)));
        }
    }
    let taps = surface.taps.as_ref().filter(|_| learned.taps.is_some());
    rows.constant("tap length", taps.map(|taps| 1e3 * taps.length() as f64 / taps.rate_hz()));
    let is_named = |name: &str| is_same_name(name, &surface.name);
    if let Some(FrictionReport { fit: FrictionFit::ThroughOrigin, line, .. }) = &learned.friction {
        let of = |name: &str, value: f64| is_named(name).then_some(value);
        rows.constant("least mu of the toolkit (wax paper)", of("Wax Paper", line.slope));
        rows.constant("largest mu of the toolkit (EPDM foam)", of("EPDM Foam", line.slope));
        let r_squared = &published()["figures"]["4.2"]["r2"];
        rows.add("Fig. 4.2", "friction of MDF, R²", of("MDF", line.r_squared), r_squared);
    }
    if let Some(StiffnessReport { line, .. }) = &learned.stiffness {
        rows.constant("press fit from", settings.stiffness.from_n);
        rows.constant("press fit to", settings.stiffness.to_n);
        let mut materials = published()["tables"]["3.1"]["rows"].as_array().into_iter().flatten();
        let is_own =
            |row: &&Value| row[0].as_str().is_some_and(|printed| is_material(&surface.name, printed));
        if let Some(row) = materials.find(is_own) {
            rows.add("Table 3.1", "stiffness, N/mm", 1e-3 * line.slope, &row[2]);
            rows.add("Table 3.1", "stiffness, R²", line.r_squared, &row[3]);
        }
    }
    rows
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::learn::learn;
    use crate::learning::learn::texture::TextureSettings;
    use crate::learning::recording::{AnyRecording, Gesture};
    use crate::nodes::simulated::material::MaterialName;
    use crate::recorder::{SimulatedTake, record};

    type Rows = Vec<(String, Value, &'static str)>;

    fn rows(recordings: &[AnyRecording], texture: TextureMethod, name: &str) -> Rows {
        let settings = LearnSettings { texture, ..LearnSettings::default() };
        let (surface, report) = learn(name, recordings, &settings, &|_| ()).unwrap();
        let rows = beside(&surface, &report, &settings).0;
        rows.into_iter().map(|row| (row.what, row.thesis, row.source)).collect()
    }

    #[test]
    fn only_what_means_the_same_stands_beside_a_learned_surface() {
        let take = |gesture| {
            let material = MaterialName::T2;
            let take =
                SimulatedTake { material, gesture, from_rest: false, person: 1, seconds: 2.0, seed: 1 };
            record(&take, &Default::default(), &mut |_| ()).unwrap()
        };
        let takes = Gesture::ALL.map(take);
        let of_thesis = rows(&takes, TextureMethod::Thesis(TextureSettings::default()), "Canvas");
        for (what, thesis, source) in [
            ("recording length, s", json!(10), "2.2.2"),
            ("largest AR order", json!(20), "2.3.2"),
            ("canvas segments", json!(19), "2.3.2"),
            ("canvas mean segment as a time, ms", json!(523), "2.3.2"),
            ("canvas median order", json!(19), "2.3.3"),
            ("tap length, ms", json!(100), "4.2.2"),
            ("stiffness, N/mm", json!(17.82), "Table 3.1"),
        ] {
            assert!(of_thesis.contains(&(what.to_owned(), thesis, source)), "{what}: {of_thesis:?}");
        }
        // A law has no segments; the friction of circles is through the origin, that of Table 3.1 is not.
        let of_law = rows(&takes, TextureMethod::default(), "MDF");
        let has = |begin: &str| of_law.iter().any(|(what, ..)| what.starts_with(begin));
        assert!(has("recording length") && !has("canvas") && !has("largest AR order") && !has("stiffness"));
        assert!(of_law.contains(&("friction of MDF, R²".to_owned(), json!(0.84), "Fig. 4.2")), "{of_law:?}");
    }
}
