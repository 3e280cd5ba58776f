//! Messages about silent live inputs, with the actuators that depend on each and the values delivered to
//! them.

use super::report::{SilenceReport, SilencedActuator};
use crate::connections::Connections;
use haptograph_engine::run::{ActuatorStatus, InputStatus};
use haptograph_engine::silence::InputState;
use std::time::{Duration, Instant};

/// Initial wait for an input before a message.
const PATIENCE: Duration = Duration::from_secs(3);
/// A silence is reported after the shorter time if the dependent actuators have reached zero, after the
/// longer time in any case.
const SHORTEST: Duration = Duration::from_millis(150);
const LONGEST: Duration = Duration::from_secs(1);
/// Maximum number of silences kept for `run.json`.
const MAX_EVENTS: usize = 1000;

/// Monitors the live inputs of a run.
#[derive(Debug)]
pub(super) struct SilenceMonitor {
    start: Instant,
    known: Vec<Known>,
    events: Vec<SilenceReport>,
}

/// An input and its state at the last poll.
#[derive(Debug)]
struct Known {
    device: String,
    is_heard: bool,
    /// True if the input delivered data before.
    was_heard: bool,
    /// Number and total duration of past silences.
    silences: u32,
    silent: Duration,
    /// Time of the last change between heard and silent.
    since: Instant,
    is_reported: bool,
}

impl SilenceMonitor {
    /// Starts at `now`.
    pub(super) fn new(now: Instant) -> Self {
        Self { start: now, known: Vec::new(), events: Vec::new() }
    }

    /// Takes the states of the inputs; returns messages for the user.
    pub(super) fn poll(
        &mut self,
        now: Instant,
        inputs: &[InputStatus],
        network: &Connections,
    ) -> Vec<String> {
        // An input that leaves the graph and returns counts as new.
        self.known.retain(|known| inputs.iter().any(|input| input.device == known.device));
        inputs.iter().filter_map(|input| self.poll_one(now, input, network)).collect()
    }

    fn poll_one(&mut self, now: Instant, input: &InputStatus, network: &Connections) -> Option<String> {
        let is_heard = input.state.is_heard();
        let place = self.known.iter().position(|known| known.device == input.device);
        let place = place.unwrap_or_else(|| {
            self.known.push(Known {
                device: input.device.clone(),
                is_heard,
                was_heard: is_heard,
                silences: 0,
                silent: Duration::ZERO,
                since: now,
                is_reported: false,
            });
            self.known.len() - 1
        });
        let known = &mut self.known[place];
        if is_heard != known.is_heard {
            let is_again = std::mem::replace(&mut known.was_heard, true);
            if is_heard && is_again {
                known.silent += now.saturating_duration_since(known.since);
            }
            known.silences += u32::from(!is_heard);
            (known.is_heard, known.since) = (is_heard, now);
            let is_reported = std::mem::take(&mut known.is_reported);
            return (is_heard && is_reported).then(|| returned(input, is_again));
        }
        let lasts = now.saturating_duration_since(known.since);
        if is_heard || known.is_reported || !is_due(input, lasts) {
            return None;
        }
        known.is_reported = true;
        if self.events.len() < MAX_EVENTS {
            self.events.push(event(input, now.saturating_duration_since(self.start)));
        }
        Some(match input.state {
            InputState::Never => format!(
                "{} has sent nothing yet{}: {}",
                name(input, network),
                received(&network.unclaimed(&input.device)),
                delivered(input)
            ),
            _ => {
                let silent_ms = 1e3 * (lasts.as_secs_f64() + input.timeout_s);
                let held = if input.holds { ", and is held" } else { "" };
                format!(
                    "`{}` has been silent for {silent_ms:.0} ms{held}: {}",
                    input.device,
                    delivered(input)
                )
            }
        })
    }

    /// The inputs whose silence was reported and lasts.
    pub(super) fn silent(&self) -> impl Iterator<Item = &str> {
        let silent = self.known.iter().filter(|known| known.is_reported);
        silent.map(|known| &*known.device)
    }

    /// Duration of an input's silence, beyond its timeout.
    pub(super) fn silent_for(&self, device: &str, now: Instant) -> Option<Duration> {
        let known = self.known.iter().find(|known| known.device == device && !known.is_heard)?;
        Some(now.saturating_duration_since(known.since))
    }

    /// Final warnings, one for each input that never sent or fell silent.
    pub(super) fn warnings(
        &self,
        now: Instant,
        inputs: &[InputStatus],
        network: &Connections,
    ) -> Vec<String> {
        let warning = |input: &InputStatus| {
            if input.state == InputState::Never {
                return Some(format!(
                    "{} sent nothing in this run{}: {}",
                    name(input, network),
                    received(&network.unclaimed(&input.device)),
                    delivered(input)
                ));
            }
            let known = self.known.iter().find(|known| known.device == input.device);
            let known = known.filter(|known| known.silences > 0)?;
            let (lasts, end) = match known.is_heard {
                true => (Duration::ZERO, String::new()),
                false => (
                    now.saturating_duration_since(known.since),
                    format!(", and still is at the end: {}", delivered(input)),
                ),
            };
            // Each silence is noticed one timeout after its start.
            let unnoticed_s = f64::from(known.silences) * input.timeout_s;
            let silent_s = (known.silent + lasts).as_secs_f64() + unnoticed_s;
            let times = match known.silences {
                1 => "once".to_owned(),
                more => format!("{more} times"),
            };
            Some(format!("`{}` was silent {times}, {silent_s:.1} s in all{end}", input.device))
        };
        inputs.iter().filter_map(warning).collect()
    }

    /// The reported silences, for `run.json`.
    pub(super) fn into_events(self) -> Vec<SilenceReport> {
        self.events
    }
}

/// True if a silence must be reported now.
fn is_due(input: &InputStatus, lasts: Duration) -> bool {
    if input.state == InputState::Never {
        return lasts > PATIENCE;
    }
    let settled = input.actuators.iter().all(|actuator| actuator.at_zero || !actuator.is_closed);
    lasts > LONGEST || lasts > SHORTEST && settled
}

/// `` `stylus` at 127.0.0.1:9751 ``
fn name(input: &InputStatus, network: &Connections) -> String {
    match network.place(&input.device) {
        Some(place) => format!("`{}` at {place}", input.device),
        None => format!("`{}`", input.device),
    }
}

/// The actuators that depend on a silent input, with the delivered values.
fn delivered(input: &InputStatus) -> String {
    let each = input.actuators.iter().map(|actuator| {
        let ActuatorStatus { path, delivered, unit, .. } = actuator;
        let does = match (actuator.at_zero, actuator.is_closed, input.state) {
            (true, _, InputState::Never) => "is at zero",
            (true, ..) => "ramped to zero",
            (false, true, _) => "is still ramping to zero",
            (false, false, _) => "continues",
        };
        format!("actuator `{path}` {does} (delivered {delivered:.3} {unit})")
    });
    match each.collect::<Vec<_>>() {
        none if none.is_empty() => "no actuator depends on it".to_owned(),
        each => each.join(", "),
    }
}

/// Messages received at the port of an input under unknown addresses, in words; empty if there are none.
pub fn received(unclaimed: &[(String, u64)]) -> String {
    let each: Vec<String> = unclaimed
        .iter()
        .map(|(address, times)| {
            let plural = if *times == 1 { "" } else { "s" };
            format!("{address} ({times} message{plural})")
        })
        .collect();
    match each.is_empty() {
        true => String::new(),
        false => format!(", but received {}", each.join(", ")),
    }
}

fn returned(input: &InputStatus, is_again: bool) -> String {
    let again = if is_again { " again" } else { "" };
    let each = input.actuators.iter().map(|actuator| {
        let path = &actuator.path;
        match actuator.is_closed {
            true => format!("actuator `{path}` stays at zero because another input is silent"),
            false => format!("actuator `{path}` follows it{again}"),
        }
    });
    let each = each.collect::<Vec<_>>().join(", ");
    let colon = if each.is_empty() { "" } else { ": " };
    format!("`{}` delivers data{again}{colon}{each}", input.device)
}

fn event(input: &InputStatus, at: Duration) -> SilenceReport {
    let actuators = input.actuators.iter().map(|actuator| SilencedActuator {
        actuator: actuator.path.clone(),
        delivered: actuator.delivered,
        unit: actuator.unit.clone(),
        at_zero: actuator.at_zero,
    });
    SilenceReport {
        input: input.device.clone(),
        at_s: (at.as_secs_f64() * 1e3).round() / 1e3,
        never_heard: input.state == InputState::Never,
        on_silence: if input.holds { "Hold" } else { "Zero" }.to_owned(),
        actuators: actuators.collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::limiter::Limit;

    fn input(state: InputState, delivered: f64, is_closed: bool) -> InputStatus {
        InputStatus {
            device: "stylus".to_owned(),
            state,
            holds: !is_closed,
            timeout_s: 0.2,
            actuators: vec![ActuatorStatus {
                path: "out".to_owned(),
                delivered,
                unit: "A".to_owned(),
                limit: Limit { peak: 0.5, continuous: 0.25, window_s: 1.0, slew_per_s: None },
                is_closed,
                at_zero: is_closed && delivered == 0.0,
            }],
        }
    }

    #[test]
    fn zero_is_said_of_what_is_at_zero_only() {
        use InputState::{Heard, Silent};
        let start = Instant::now();
        let mut monitor = SilenceMonitor::new(start);
        let network = Connections::new(&haptograph_nodes::registry());
        let mut message = |ms: u64, input: InputStatus| {
            let now = start + Duration::from_millis(ms);
            monitor.poll(now, &[input], &network).join("; ")
        };
        assert_eq!(message(0, input(Heard, 0.4, false)), "");
        assert_eq!(message(1000, input(Silent, 0.4, true)), "");
        assert_eq!(message(1200, input(Silent, 0.2, true)), "", "it is on its way");
        let late = message(2050, input(Silent, 0.1, true));
        assert!(late.contains("still ramping to zero") && late.contains("delivered 0.100 A"), "{late}");
        assert_eq!(message(2100, input(Silent, 0.0, true)), "", "said once");
        assert!(message(2200, input(Heard, 0.0, false)).contains("`out` follows it again"));
        assert_eq!(message(3000, input(Silent, 0.0, true)), "");
        let zero = message(3200, input(Silent, 0.0, true));
        assert!(
            zero.contains("silent for 400 ms") && zero.contains("`out` ramped to zero (delivered 0.000 A)"),
            "{zero}"
        );
        assert!(message(4000, input(Heard, 0.0, true)).contains("another input is silent"));
        message(5000, input(Silent, 0.4, false));
        let held = message(5200, input(Silent, 0.4, false));
        assert!(held.contains("`out` continues (delivered 0.400 A)"), "{held}");
        let end = start + Duration::from_millis(6000);
        let last = [input(Silent, 0.4, false)];
        let [warning] = &monitor.warnings(end, &last, &Connections::new(&haptograph_nodes::registry()))[..]
        else {
            panic!("one line a source");
        };
        assert!(
            warning.contains("`stylus` was silent 3 times, 3.8 s in all, and still is at the end"),
            "{warning}"
        );
        let events = monitor.into_events();
        let zero: Vec<bool> = events.iter().map(|event| event.actuators[0].at_zero).collect();
        assert_eq!(zero, [false, true, false]);
    }

    #[test]
    fn an_input_that_never_sent_is_said_once_and_at_the_end() {
        let start = Instant::now();
        let mut monitor = SilenceMonitor::new(start);
        let network = Connections::new(&haptograph_nodes::registry());
        let never = [input(InputState::Never, 0.0, true)];
        let mut message = |s: u64| monitor.poll(start + Duration::from_secs(s), &never, &network);
        assert!(
            message(0).is_empty() && message(2).is_empty() && message(4).len() == 1 && message(9).is_empty()
        );
        assert_eq!(monitor.silent().collect::<Vec<_>>(), ["stylus"]);
        let end = start + Duration::from_secs(9);
        assert_eq!(monitor.warnings(end, &never, &network).len(), 1);
        let first = monitor.poll(end, &[input(InputState::Heard, 0.0, false)], &network);
        assert!(first[0].contains("`stylus` delivers data: actuator `out` follows it"), "{first:?}");
        let heard = [input(InputState::Heard, 0.1, false)];
        assert!(monitor.warnings(end, &heard, &network).is_empty());
    }
}
