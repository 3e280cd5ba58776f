//! Facts and warnings of a finished live run.

use crate::engine::run::{Histogram, LiveOutcome, Meters};
use crate::live::Connections;
use crate::nodes::network::link::Counts;
use serde_json::{Value, json};

pub fn facts_of(ended: &LiveOutcome) -> Vec<(&'static str, &'static str, Value)> {
    let meters = &ended.meters;
    let mut facts = vec![
        ("live", "Live", json!(true)),
        ("late_us", "Lateness (us)", quantiles(&meters.lateness)),
        ("work_us", "Execution time (us)", quantiles(&meters.work)),
        ("wakes", "Wake-ups", json!(meters.wakes)),
        ("overruns", "Overruns", json!(meters.overruns)),
        ("stalls", "Stalls of the machine", json!(meters.stalls)),
        ("lost_wakes", "Wake-ups lost in stalls", json!(meters.lost_wakes)),
        (
            "lost_numbers",
            "Values lost on the way to files",
            json!(ended.lost_numbers),
        ),
        (
            "lost_callbacks",
            "Callbacks missing from the replay record",
            json!(ended.lost_arrivals),
        ),
    ];
    if let [_, _, ..] = ended.drivers[..] {
        let each = ended.drivers.iter().map(|(name, meters)| {
            let kept = json!({
                "late_us": quantiles(&meters.lateness), "work_us": quantiles(&meters.work), "wakes": meters.wakes,
                "overruns": meters.overruns, "stalls": meters.stalls, "lost_wakes": meters.lost_wakes,
            });
            (name.clone(), kept)
        });
        facts.push(("drivers", "Each driver", Value::Object(each.collect())));
    }
    facts
}

/// Packet counts of each network device.
pub fn packets(network: &Connections) -> Option<(&'static str, &'static str, Value)> {
    let counted = |(device, counts, unclaimed_addresses): (String, Counts, Vec<(String, u64)>)| {
        let Counts {
            accepted,
            missing,
            outdated,
            malformed,
            not_numbers,
            too_large,
            strangers,
            jumps,
            refused_zeros,
            unclaimed,
        } = counts;
        let received = unclaimed_addresses.into_iter();
        let received: serde_json::Map<String, Value> =
            received.map(|(address, times)| (address, json!(times))).collect();
        let counts = json!({
            "accepted": accepted, "missing": missing, "outdated": outdated, "malformed": malformed,
            "not_numbers": not_numbers, "too_large": too_large, "strangers": strangers, "jumps": jumps,
            "refused_zeros": refused_zeros, "unclaimed": unclaimed, "unclaimed_addresses": received,
        });
        (device, counts)
    };
    let devices: serde_json::Map<String, Value> = network.packets().map(counted).collect();
    (!devices.is_empty()).then_some(("packets", "Packets", Value::Object(devices)))
}

fn quantiles(histogram: &Histogram) -> Value {
    let us = |ns: u64| (ns as f64 / 100.0).round() / 10.0;
    let at = |fraction: f64| us(histogram.quantile_ns(fraction));
    json!({ "p50": at(0.5), "p99": at(0.99), "p99.9": at(0.999), "max": us(histogram.max_ns()) })
}

pub fn warnings_of(ended: &LiveOutcome) -> Vec<String> {
    let Meters {
        overruns,
        stalls,
        lost_wakes,
        ..
    } = ended.meters;
    let mut list = Vec::new();
    if ended.panicked {
        list.push("a node panicked; the actuators were ramped to zero and the run ended".to_owned());
    }
    for device in &ended.lost_devices {
        list.push(format!(
            "`{device}` panicked during its ramp to zero and keeps its last value: switch it off"
        ));
    }
    if overruns > 0 {
        list.push(format!("{overruns} ticks took longer than their period"));
    }
    if stalls > 0 {
        list.push(format!(
            "the machine stalled {stalls} times and lost {lost_wakes} wake-ups; the run continued from there"
        ));
    }
    if ended.lost_numbers > 0 {
        list.push(format!(
            "{} values were lost on the way to the files, which have gaps",
            ended.lost_numbers
        ));
    }
    if ended.lost_arrivals > 0 {
        list.push(format!(
            "a replay will end {} callbacks early: the disk was too slow for its record",
            ended.lost_arrivals
        ));
    }
    list.extend(ended.failed.iter().map(ToString::to_string));
    list
}
