//! The report of a live run as facts for `run.json` and the page.

use crate::live::supervisor::RunReport;
use crate::report::facts::Fact;
use serde_json::Value;

/// The fields of the report in the order of the page, with their names there.
const NAMES: [(&str, &str); 27] = [
    ("driver", "Driver"),
    ("xruns", "Xruns"),
    ("clipped_samples", "Samples beyond full scale"),
    ("vanished", "Times the soundcard was gone"),
    ("output_latency_ms", "Output latency that the system stated (ms)"),
    ("inputs", "Inputs of soundcards"),
    ("latencies_ms", "Latencies, measured (ms)"),
    ("changes", "Changed while running"),
    ("swaps", "Graphs swapped in"),
    ("saved_while_running", "Graphs saved while running"),
    ("unrested", "Sinks whose actuators began as warm as their limits allow"),
    ("packets", "Packets"),
    ("silences", "Live inputs that fell silent"),
    ("set_while_running", "Set while running"),
    ("osc_malformed", "OSC packets that set nothing"),
    ("live", "Live"),
    ("late_us", "Lateness (us)"),
    ("work_us", "Execution time (us)"),
    ("wakes", "Wake-ups"),
    ("overruns", "Overruns"),
    ("stalls", "Stalls of the machine"),
    ("lost_wakes", "Wake-ups lost in stalls"),
    ("stalled_at_s", "Stalls in the files, where recorded signals jump (s)"),
    ("lost_numbers", "Values lost on the way to files"),
    ("lost_callbacks", "Callbacks missing from the replay record"),
    ("drivers", "Each driver"),
    ("panics", "Panics"),
];

/// The fields that every summary of a run states already.
#[cfg(test)]
const STATED: [&str; 4] = ["clocks", "seconds", "driver_frames", "took_s"];

/// The facts of a report that a summary does not state already.
pub(super) fn facts_of(report: &RunReport) -> Vec<Fact> {
    let fields = serde_json::to_value(report).unwrap_or_default();
    let fact = |(key, name): (&'static str, &'static str)| {
        let value: &Value = fields.get(key)?;
        Some((key, name, value.clone()))
    };
    NAMES.into_iter().filter_map(fact).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::supervisor::{
        CardReport, InputReport, PacketReport, QuantilesMs, TimingReport, XrunReport,
    };

    #[test]
    fn every_field_of_a_report_has_a_name() {
        let xruns = XrunReport { count: 1, longest_ms: 2.0, last_at_ms: 3.0 };
        let latency_ms = QuantilesMs { p50: 1.0, p99: 2.0, max: 3.0 };
        let report = RunReport {
            card: Some(CardReport {
                xruns: xruns.clone(),
                clipped_samples: 0,
                vanished: 0,
                output_latency_ms: latency_ms.clone(),
            }),
            inputs: [(
                "tool".to_owned(),
                InputReport {
                    stream: String::new(),
                    xruns,
                    clipped_samples: 0,
                    vanished: 0,
                    input_latency_ms: latency_ms,
                },
            )]
            .into(),
            packets: [("pen".to_owned(), PacketReport::default())].into(),
            osc_malformed: Some(0),
            drivers: [("audio".to_owned(), TimingReport::default())].into(),
            ..RunReport::default()
        };
        let value = serde_json::to_value(&report).unwrap();
        let named: Vec<&str> = facts_of(&report).iter().map(|(key, ..)| *key).collect();
        for key in value.as_object().unwrap().keys() {
            assert!(named.contains(&&**key) != STATED.contains(&&**key), "{key}");
        }
        assert_eq!(serde_json::from_value::<RunReport>(value).unwrap(), report);
    }
}
