//! What the connections of a supervised run say about its drivers and streams.

use crate::backend::{Connected, Counts, Role};
use crate::connections::Connections;
use crate::soundcard::CardCounts;
use haptograph_engine::run::Histogram;

/// Description of the drivers of a run.
pub(super) fn description(connections: &Connections) -> String {
    let all = connections.counted(Role::Driver).map(|(driver, _)| driver);
    let mut all: Vec<Connected> = all.collect();
    all.sort_by_key(|driver| driver.clock);
    match &all[..] {
        [one] => one.place.clone(),
        several => {
            let each = several.iter().map(|driver| format!("{} by {}", driver.names.concat(), driver.place));
            each.collect::<Vec<_>>().join("; ")
        }
    }
}

/// The output latency that the system stated.
pub(super) fn output_latency(connections: &Connections) -> Option<Histogram> {
    connections.counted(Role::Driver).find_map(|(_, counts)| match counts {
        Counts::Stream(counts) => Some(counts.latency),
        Counts::None | Counts::Packets(..) => None,
    })
}

/// Warnings about the streams of a run.
pub(super) fn warnings(connections: &Connections) -> Vec<String> {
    let mut list = Vec::new();
    for (connected, counts) in
        [Role::Driver, Role::Input].into_iter().flat_map(|role| connections.counted(role))
    {
        let (whose, xrun) = match connected.role {
            Role::Input => (format!("the input of {}", connected.names.join(" and ")), "ran over"),
            Role::Driver | Role::Link => ("the soundcard".to_owned(), "ran dry"),
        };
        if let Counts::Stream(counts) = counts {
            list.extend(troubles(&whose, xrun, &counts));
        }
    }
    list
}

/// Warnings about a stream; `xrun` describes an xrun of it.
fn troubles(whose: &str, xrun: &str, counts: &CardCounts) -> Vec<String> {
    let mut list = Vec::new();
    if counts.xruns > 0 {
        list.push(format!("{whose} {xrun} {} times: the signal has gaps", counts.xruns));
    }
    if counts.clipped > 0 {
        list.push(format!(
            "{} samples were beyond the full scale of {whose} and were cut off",
            counts.clipped
        ));
    }
    list
}
