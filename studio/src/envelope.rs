//! Safety envelope: the actuators, limits and devices of a graph in all of its sets of endpoints, which no
//! edit from a page may exceed.

use super::error::StageError;
use super::load::Source;
use haptograph_engine::diagnostic::{Diagnostics, Severity};
use haptograph_engine::document::Document;
use haptograph_engine::graph::{DeclaredDevice, Hosted, check, declared_devices};
use haptograph_live::{LimitChange, ProtectedActuator};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The envelopes confirmed by the person who opened the studio: those of the graph's file and of the
/// parameters on the command line.
#[derive(Debug)]
pub(crate) struct Confirmed {
    set: Vec<(String, String)>,
    /// Envelope of the file with its defaults, and with the given parameters.
    as_written: SafetyEnvelope,
    as_set: SafetyEnvelope,
}

impl Confirmed {
    /// The envelopes of a graph as it is opened.
    ///
    /// # Errors
    /// [`Diagnostics`] if the text cannot be parsed.
    pub(crate) fn of(source: &Source, text: &str) -> Result<Self, Diagnostics> {
        let as_written = SafetyEnvelope::of(&source.with_set(Vec::new()), text)?;
        let as_set = match source.set.is_empty() {
            true => as_written.clone(),
            false => SafetyEnvelope::of(source, text)?,
        };
        Ok(Self { set: source.set.clone(), as_written, as_set })
    }

    /// Checks that a text may run.
    ///
    /// # Errors
    /// [`StageError`] with everything that exceeds the confirmed envelope.
    pub(crate) fn permits_run(&self, source: &Source, text: &str) -> Result<(), StageError> {
        within(&self.as_set, source, text)
    }

    /// Checks that a text may be written to the file, both with its defaults and with the given parameters.
    ///
    /// # Errors
    /// [`StageError`] with everything that exceeds the confirmed envelope.
    pub(crate) fn permits_save(&self, source: &Source, text: &str) -> Result<(), StageError> {
        within(&self.as_written, &source.with_set(Vec::new()), text)?;
        if self.set.is_empty() {
            return Ok(());
        }
        within(&self.as_set, &source.with_set(self.set.clone()), text)
    }
}

/// What edits from pages may do, and the latest that was refused.
#[derive(Debug, Default)]
pub(crate) struct Permitted {
    /// Limits and devices that no edit may exceed; `None` if no real device can be reached.
    pub confirmed: Option<Arc<Confirmed>>,
    /// The latest edit beyond them, and the number of such edits.
    pub proposal: Option<Proposal>,
    pub proposals: u64,
}

/// A graph that a page asked for and that exceeds the confirmed envelope.
#[derive(Debug)]
pub(crate) struct Proposal {
    /// Counts the proposals of a studio, from 1.
    pub number: u64,
    /// The ways in which it exceeds the envelope, one sentence each.
    pub beyond: Vec<String>,
    pub source: Source,
    pub text: String,
}

fn within(envelope: &SafetyEnvelope, source: &Source, text: &str) -> Result<(), StageError> {
    match envelope.exceeded_by(&SafetyEnvelope::of(source, text)?) {
        beyond if beyond.is_empty() => Ok(()),
        beyond => Err(StageError::Beyond(beyond)),
    }
}

/// The actuators of a graph with their limits and devices.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SafetyEnvelope {
    sets: Vec<EndpointSet>,
    /// Source text of the expressions for limits and devices: with other parameters they may yield more.
    depends: BTreeMap<String, String>,
}

#[derive(Debug, Clone, PartialEq)]
struct EndpointSet {
    name: String,
    /// The first error if the graph cannot run with these endpoints.
    actuators: Result<Vec<ProtectedActuator>, String>,
    /// The devices that are not simulated.
    devices: Vec<DeclaredDevice>,
}

impl SafetyEnvelope {
    /// The envelope of a text in place of the graph's file.
    ///
    /// # Errors
    /// [`Diagnostics`] if the text cannot be parsed.
    pub(crate) fn of(source: &Source, text: &str) -> Result<Self, Diagnostics> {
        source.confined(|| Self::of_confined(source, text))
    }

    fn of_confined(source: &Source, text: &str) -> Result<Self, Diagnostics> {
        let document = Document::parse(&source.path, text)?;
        let sets = document.endpoints().map(|name| {
            let mut options = source.options(&document);
            name.clone_into(&mut options.endpoints);
            let mut devices = declared_devices(&document, &source.registry, &options);
            devices.retain(|device| !device.is_simulated);
            // Limits do not depend on the devices, and not every build has every kind of device. Only some
            // sources need their device to determine what they read.
            options.hosted = Hosted::All;
            let graph = check(&document, &source.registry, &options).or_else(|_| {
                options.hosted = Hosted::AsWritten;
                check(&document, &source.registry, &options)
            });
            EndpointSet {
                name: name.to_owned(),
                actuators: graph.map(|graph| ProtectedActuator::all(&graph)).map_err(|wrong| first(&wrong)),
                devices,
            }
        });
        Ok(Self { sets: sets.collect(), depends: document.dependent_safety(&source.registry) })
    }

    /// The ways in which `next` exceeds this envelope, one sentence each; empty if it does not.
    pub(crate) fn exceeded_by(&self, next: &Self) -> Vec<String> {
        let mut beyond = Vec::new();
        for (place, text) in &next.depends {
            if self.depends.get(place) != Some(text) {
                beyond.push(format!("{place} now depends on parameters differently: {text}"));
            }
        }
        for set in &next.sets {
            match self.sets.iter().find(|known| known.name == set.name) {
                Some(known) => known.compare(set, &mut beyond),
                None => beyond.push(format!("the set of endpoints `{}` is new", set.name)),
            }
        }
        beyond
    }
}

impl EndpointSet {
    fn compare(&self, next: &Self, beyond: &mut Vec<String>) {
        let name = &self.name;
        for device in &next.devices {
            let endpoint = &device.endpoint;
            match self.devices.iter().find(|known| known.endpoint == *endpoint) {
                Some(known) if known == device => {}
                Some(known) => beyond.push(format!(
                    "endpoint `{endpoint}` of `{name}` changes from {} to {}",
                    known.written, device.written
                )),
                None => beyond
                    .push(format!("endpoint `{endpoint}` of `{name}` becomes the device {}", device.written)),
            }
        }
        match (&self.actuators, &next.actuators) {
            (_, Err(why)) if self.actuators.is_ok() => {
                beyond.push(format!("the limits of `{name}` cannot be determined: {why}"));
            }
            (known, Ok(actuators)) => {
                for actuator in actuators {
                    let known = known.iter().flatten().find(|known| known.sink == actuator.sink);
                    compare(actuator, known, name, beyond);
                }
            }
            (_, Err(_)) => {}
        }
    }
}

/// The ways in which an actuator exceeds the one of that name, if it is known.
fn compare(
    actuator: &ProtectedActuator,
    known: Option<&ProtectedActuator>,
    set: &str,
    beyond: &mut Vec<String>,
) {
    let sink = &actuator.sink;
    let Some(known) = known else {
        beyond.push(format!("actuator `{sink}` of `{set}` is new"));
        return;
    };
    for (what, was, now) in [
        ("kind", known.kind, actuator.kind),
        ("unit", &*known.unit, &*actuator.unit),
        ("endpoint", &*known.endpoint, &*actuator.endpoint),
    ] {
        if was != now {
            beyond.push(format!("actuator `{sink}` of `{set}`: {what} changes from `{was}` to `{now}`"));
        }
    }
    for LimitChange { part, was, now, unit, .. } in
        actuator.limit_changes(known).filter(|change| change.now > change.was)
    {
        let now = match now.is_finite() {
            true => format!("{now} {unit}"),
            false => "no limit".to_owned(),
        };
        beyond.push(format!("limit of `{sink}` of `{set}`: {part} rises from {was} {unit} to {now}"));
    }
}

fn first(wrong: &Diagnostics) -> String {
    let errors = wrong.list.iter().filter(|found| found.severity == Severity::Error);
    let mut errors = errors.map(|found| format!("{}: {}", found.code, found.message));
    errors.next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// Everything in which an edit of the TexturePad exceeds its envelope.
    fn beyond(edit: impl Fn(&str) -> String, set: &[(&str, &str)]) -> Vec<String> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/texturepad.ron");
        let mut source = Source::new(path, &haptograph_nodes::registry(), Vec::new());
        let text = source.read().expect("it ships");
        // The limit depends on a parameter.
        let text = text
            .replace("peak_a: 0.5", "peak_a: Param(\"most\")")
            .replace("parameters: {", "parameters: { \"most\": 0.5,");
        let known = SafetyEnvelope::of(&source, &text).expect("a graph");
        assert_eq!(known.sets.len(), 5);
        let edited = edit(&text);
        source.set = set.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
        known.exceeded_by(&SafetyEnvelope::of(&source, &edited).expect("a graph"))
    }

    fn replaced(from: &'static str, to: &'static str) -> impl Fn(&str) -> String {
        move |text| {
            assert!(text.contains(from), "{from}");
            text.replace(from, to)
        }
    }

    #[test]
    fn what_raises_nothing_is_within_the_envelope() {
        for (from, to) in [
            ("nodes: {", "nodes: { "),
            ("\"most\": 0.5", "\"most\": 0.3"),
            ("continuous_a: 0.25", "continuous_a: 0.1"),
            ("window_s: 10", "window_s: 5"),
            (", window_s: 10", ""),
            ("radius_mm: 30", "radius_mm: 20"),
            ("SimulatedHaptuator()", "SimulatedHaptuator( )"),
            ("amperes_full_scale: 1.0, buffer_frames: 64", "buffer_frames: 64, amperes_full_scale: 1"),
        ] {
            assert_eq!(beyond(replaced(from, to), &[]), [""; 0], "{to}");
        }
        assert_eq!(beyond(str::to_owned, &[("gain", "0.02"), ("most", "0.4")]), [""; 0]);
    }

    #[test]
    fn what_raises_a_limit_or_changes_a_device_is_beyond_it_in_every_set() {
        for (from, to, said, times) in [
            ("\"most\": 0.5", "\"most\": 0.6", "peak rises from 0.5 A to 0.6 A", 5),
            ("continuous_a: 0.25", "continuous_a: 0.3", "continuous rises", 5),
            ("window_s: 10", "window_s: 11", "window rises", 5),
            ("\"out", "\"other", "`other` of `live` is new", 1),
            ("amperes_full_scale: 1.0", "amperes_full_scale: 0.1", "`haptuator` of `live` changes", 1),
            ("pressed_n: 3.0", "pressed_n: 0.1", "`stylus` of `live` changes", 1),
            ("\"osc\": {", "\"soon\": {", "the set of endpoints `soon` is new", 1),
            ("SimulatedHaptuator()", "Soundcard(amperes_full_scale: 1)", "becomes the device Soundcard", 1),
            (
                "parameters: {",
                "defaults: { \"live\": { \"most\": 1 } }, parameters: {",
                "`out` of `live`: peak rises",
                1,
            ),
        ] {
            let beyond = beyond(replaced(from, to), &[]);
            let count = beyond.iter().filter(|beyond| beyond.contains(said)).count();
            assert_eq!(count, times, "{to}: {beyond:?}");
        }
        assert_eq!(beyond(str::to_owned, &[("most", "0.6")]).len(), 5);
        assert!(!beyond(str::to_owned, &[("hand", "\"/dev/input/event9\"")]).is_empty());
    }

    #[test]
    fn a_slew_limit_is_neither_raised_nor_removed() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/texturepad.ron");
        let source = Source::new(path, &haptograph_nodes::registry(), Vec::new());
        let text = source.read().expect("it ships");
        let with = |slew: &str| {
            let text = text.replace("continuous_a: 0.25", &format!("continuous_a: 0.25{slew}"));
            SafetyEnvelope::of(&source, &text).expect("a graph")
        };
        let (known, raised) = (with(", slew_a_per_s: 100"), with(", slew_a_per_s: 101"));
        let (lowered, removed) = (with(", slew_a_per_s: 99"), with(""));
        for (next, said) in [(raised, "to 101 A/s"), (removed, "to no limit")] {
            let beyond = known.exceeded_by(&next);
            let is_said = |beyond: &String| beyond.contains("slew rises") && beyond.ends_with(said);
            assert!(beyond.len() == 5 && beyond.iter().all(is_said), "{beyond:?}");
        }
        assert_eq!(known.exceeded_by(&lowered), [""; 0]);
    }

    #[test]
    fn a_set_that_cannot_run_any_more_shows_no_limits() {
        let beyond = beyond(replaced("continuous_a", "continous_a"), &[]);
        let of = |name: &str| {
            let said = format!("the limits of `{name}` cannot be determined: E");
            beyond.iter().any(|beyond| beyond.contains(&said))
        };
        assert!(of("live") && of("simulated"), "{beyond:?}");
    }

    #[test]
    fn no_limit_comes_to_depend_on_a_parameter() {
        for (from, to) in [
            ("Param(\"most\")", "Expr(\"if(gain > 1, 50, 0.5)\")"),
            ("\"most\": 0.5", "\"most\": Expr(\"0.5 * gain\")"),
            ("continuous_a: 0.25", "continuous_a: Param(\"quarter\")"),
            ("pressed_n: 3.0", "pressed_n: Expr(\"3 / gain\")"),
        ] {
            let moved = |text: &str| {
                replaced(from, to)(text).replace("parameters: {", "parameters: { \"quarter\": 0.25,")
            };
            let beyond = beyond(moved, &[]);
            assert!(beyond.iter().any(|beyond| beyond.contains("depends on parameters")), "{to}: {beyond:?}");
        }
    }
}
