//! Status display of a live run: a line per second, or a block of lines on a terminal.

use super::super::stderr::{self, Message};
use super::super::{eprint, screen};
use crate::engine::graph::Graph;
use crate::engine::node::FileProgress;
use crate::engine::run::{ActuatorLevel, Meters, RingReport};
use crate::engine::silence::InputState;
use crate::live::supervisor::{InputNow, Status, received};
use crate::live::{Counts, Role};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Periods of the line and of the block.
const LINE: Duration = Duration::from_secs(1);
const BLOCK: Duration = Duration::from_millis(200);
/// Period over which input rates are counted.
const RATE: Duration = Duration::from_secs(1);
/// Width of a level bar, columns.
const BAR: usize = 24;

/// Progress of file sinks, by the paths of the sinks.
type Progress = Vec<(String, Arc<dyn FileProgress>)>;

/// State of the display.
pub(super) struct StatusDisplay {
    /// True on a terminal that can show a block.
    block: bool,
    shown: Instant,
    progress: Progress,
    /// Per input: name, packet count, and packet rate.
    inputs: Vec<(String, u64, f64)>,
    counted: Instant,
}

impl StatusDisplay {
    /// Starts the display for a run of a graph.
    pub(super) fn new(graph: &Graph, block: bool) -> Self {
        let now = Instant::now();
        let progress = graph.file_progress();
        Self {
            block,
            shown: now,
            progress: progress.map(|(sink, progress)| (sink.to_owned(), progress)).collect(),
            inputs: Vec::new(),
            counted: now,
        }
    }

    /// Displays the status when it is due.
    pub(super) fn show(&mut self, status: impl FnOnce() -> Status) {
        let every = if self.block { BLOCK } else { LINE };
        if self.shown.elapsed() < every {
            return;
        }
        self.shown += every;
        match self.block {
            true => stderr::display(Message::Block(self.lines(&status()))),
            false => eprint(&self.line(&status())),
        }
    }

    /// The status line.
    fn line(&self, status: &Status) -> String {
        let mut parts: Vec<String> = match &status.drivers[..] {
            [(_, meters)] => vec![lateness(meters).join("; ")],
            several => several
                .iter()
                .map(|(name, meters)| format!("{name}: {}", lateness(meters).join("; ")))
                .collect(),
        };
        let verdict = verdict(status.drivers.iter().map(|(_, meters)| meters));
        parts.extend(status.rings.iter().map(ring_line));
        parts.extend(
            self.progress
                .iter()
                .filter_map(|(sink, progress)| Some(format!("{sink}: {}", progress.lines().first()?))),
        );
        let silent = status.silent.iter();
        let silent: String = silent.map(|device| format!(", `{device}` is silent")).collect();
        format!("{:.0} s: {}{}{silent}; {verdict}\n", status.seconds, parts.join("; "), xruns(status))
    }

    /// The status block.
    fn lines(&mut self, status: &Status) -> Vec<String> {
        let mut lines = Vec::new();
        let (width, xruns) = (screen::width().saturating_sub(1), xruns(status));
        for (name, meters) in &status.drivers {
            let mut parts = lateness(meters);
            parts.extend(xruns.strip_prefix(", ").map(str::to_owned));
            let head = format!("{:7.1} s  {name}  ", status.seconds);
            lines.push(fitting(&head, parts, &verdict([meters].into_iter()), width));
        }
        let rings = status.rings.iter();
        lines.extend(rings.map(|ring| format!("           {}", ring_line(ring))));
        let (levels, inputs) = (&status.actuators, &status.inputs);
        self.count(inputs);
        let names =
            levels.iter().map(|level| &level.path).chain(inputs.iter().map(|input| &input.status.device));
        let width = names.map(|name| name.chars().count()).max().unwrap_or(0);
        lines.extend(levels.iter().map(|level| format!("{:<width$}  {}", level.path, shown_level(level))));
        lines.extend(
            inputs
                .iter()
                .map(|input| format!("{:<width$}  {}", input.status.device, self.shown_input(input))),
        );
        for (sink, progress) in &self.progress {
            let mut shown = progress.lines().into_iter();
            lines.extend(shown.next().map(|first| format!("{sink}  {first}")));
            lines.extend(shown);
        }
        let set = status.last_set.iter();
        lines.extend(set.map(|set| format!("set last: {set}")));
        lines
    }

    /// Updates the packet counts and rates.
    fn count(&mut self, inputs: &[InputNow]) {
        let now = Instant::now();
        let lasts = now.saturating_duration_since(self.counted);
        if !self.inputs.is_empty() && lasts < RATE {
            return;
        }
        let before = std::mem::take(&mut self.inputs);
        let rate = |input: &InputNow| {
            let (device, accepted) = (&input.status.device, input.packets.as_ref()?.accepted);
            let known = before.iter().find(|(name, ..)| name == device);
            let come = known.map_or(0, |(_, before, _)| accepted.saturating_sub(*before));
            let hz = come as f64 / lasts.as_secs_f64().max(1e-3);
            Some((device.clone(), accepted, hz))
        };
        self.inputs = inputs.iter().filter_map(rate).collect();
        self.counted = now;
    }

    fn shown_input(&self, input: &InputNow) -> String {
        let rate = self.inputs.iter().find(|(name, ..)| *name == input.status.device);
        let rate = rate.map_or_else(|| "receiving".to_owned(), |(_, _, hz)| format!("{hz:.0} a second"));
        match input.status.state {
            InputState::Never => {
                let place = input.place.iter();
                let place: String = place.map(|place| format!(" at {place}")).collect();
                format!("nothing received yet{place}{}", received(&input.unclaimed))
            }
            InputState::Silent => {
                format!("silent for {:.1} s", input.silent_s + input.status.timeout_s)
            }
            InputState::Jumped => format!("{rate}, jumped: its actuators and force are at zero"),
            InputState::Heard => {
                let refused = input.packets.as_ref().map_or(0, |packets| packets.refused_zeros);
                match refused {
                    0 => rate,
                    refused => format!("{rate}, force not steady: taring failed {refused} times"),
                }
            }
        }
    }
}

/// Under- and overruns of the soundcards, for the end of a line; empty without soundcards.
fn xruns(status: &Status) -> String {
    let streams = status.streams.iter();
    let each = streams.filter_map(|(connected, counts)| match (counts, connected.role) {
        (Counts::Stream(counts), Role::Input) => {
            Some(format!(", {} xruns at {}", counts.xruns, connected.names.join(" and ")))
        }
        (Counts::Stream(counts), _) => Some(format!(", {} xruns", counts.xruns)),
        _ => None,
    });
    each.collect()
}

fn ring_line(ring: &RingReport) -> String {
    let counts = ring.counts;
    let fill = counts.fill_s.map_or_else(|| "empty".to_owned(), |fill_s| format!("{:.2} ms", fill_s * 1e3));
    format!(
        "ring {}: {fill}, {:+.0} ppm, {} underruns, {} overruns",
        ring.name, counts.correction_ppm, counts.underruns, counts.overruns
    )
}

/// Timing of a driver, the most important part first.
fn lateness(meters: &Meters) -> Vec<String> {
    let ms = |ns: u64| ns as f64 / 1e6;
    let (late, work) = (&meters.lateness, &meters.work);
    vec![
        format!("late {:.2} ms p99, {:.2} max", ms(late.quantile_ns(0.99)), ms(late.max_ns())),
        format!("work {:.2} ms p99", ms(work.quantile_ns(0.99))),
        format!("{} overruns, {} stalls", meters.overruns, meters.stalls),
    ]
}

/// Number of wake-ups of all drivers that were late by a period or lost in a stall.
fn verdict<'m>(drivers: impl Iterator<Item = &'m Meters>) -> String {
    match drivers.map(|meters| meters.overruns + meters.lost_wakes).sum() {
        0_u64 => "keeps time".to_owned(),
        late => format!("{late} late"),
    }
}

/// A line of at most `width` characters that ends with `last`; parts at the end are dropped to fit.
fn fitting(head: &str, mut parts: Vec<String>, last: &str, width: usize) -> String {
    loop {
        let all: Vec<&str> = parts.iter().map(String::as_str).chain([last]).collect();
        let line = format!("{head}{}", all.join("; "));
        if line.chars().count() <= width || parts.pop().is_none() {
            return line;
        }
    }
}

/// A bar of an actuator's peak level up to its limit, with RMS and peak values and their limits.
fn shown_level(level: &ActuatorLevel) -> String {
    let ActuatorLevel { rms, peak, limit, unit, .. } = level;
    let columns = |value: f64| ((value / limit.peak * BAR as f64).ceil().max(0.0) as usize).min(BAR);
    let bar: String = (0..BAR)
        .map(|column| match column {
            column if column < columns(*rms) => '#',
            column if column < columns(*peak) => '-',
            _ => ' ',
        })
        .collect();
    format!("[{bar}] {rms:.3} {unit} rms of {}, peak {peak:.3} of {}", limit.continuous, limit.peak)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::limiter::ClipCounts;
    use crate::engine::node::Limit;

    #[test]
    fn what_does_not_fit_is_left_out_whole() {
        let parts = || ["late 0.07 ms", "work 0.09 ms", "0 overruns"].map(str::to_owned).to_vec();
        let line = |width| fitting("1.0 s  audio  ", parts(), "keeps time", width);
        let all = "1.0 s  audio  late 0.07 ms; work 0.09 ms; 0 overruns; keeps time";
        assert_eq!(line(all.len()), all);
        assert_eq!(line(all.len() - 1), "1.0 s  audio  late 0.07 ms; work 0.09 ms; keeps time");
        assert_eq!(line(10), "1.0 s  audio  keeps time");
    }

    #[test]
    fn a_driver_keeps_time_until_a_wake_up_is_late_or_lost() {
        let mut meters = Meters::default();
        assert_eq!(verdict([&meters].into_iter()), "keeps time");
        (meters.overruns, meters.lost_wakes) = (2, 5);
        assert_eq!(verdict([&meters, &meters].into_iter()), "14 late");
    }

    #[test]
    fn a_level_is_shown_against_its_limits() {
        let limit = Limit { peak: 0.5, continuous: 0.25, window_s: 10.0, slew_per_s: None };
        let level = ActuatorLevel {
            path: "out".to_owned(),
            unit: "A".to_owned(),
            rms: 0.125,
            peak: 0.25,
            heat: 0.0,
            limit,
            clipped: ClipCounts::default(),
        };
        let shown = shown_level(&level);
        assert!(
            shown.starts_with("[######------            ] 0.125 A rms of 0.25, peak 0.250 of 0.5"),
            "{shown}"
        );
        let most = shown_level(&ActuatorLevel { rms: 0.25, peak: 0.5, ..level });
        assert!(most.starts_with("[############------------]"), "{most}");
    }
}
