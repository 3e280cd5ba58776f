//! Status display of a live run: a line per second, or a block of lines on a terminal.

use super::super::{eprint, screen, stderr};
use super::drivers::Drivers;
use super::silence::{SilenceMonitor, received};
use crate::engine::node::FileProgress;
use crate::engine::run::{ActuatorLevel, InputStatus, Meters, RingReport, Session};
use crate::engine::silence::InputState;
use crate::live::Connections;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Periods of the line and of the block.
const LINE: Duration = Duration::from_secs(1);
const BLOCK: Duration = Duration::from_millis(200);
/// Period over which input rates are counted.
const RATE: Duration = Duration::from_secs(1);
/// Width of a level bar, columns.
const BAR: usize = 24;

/// The data shown in the status.
pub struct Facts<'a> {
    pub session: &'a mut Session,
    pub drivers: &'a Drivers,
    pub network: &'a Connections,
    pub silence: &'a SilenceMonitor,
    /// The last setting, and its origin.
    pub set: Option<String>,
}

/// Progress of file sinks, by the paths of the sinks.
pub type Progress = Vec<(String, Arc<dyn FileProgress>)>;

/// State of the display.
pub struct Status {
    start: Instant,
    /// True on a terminal that can show a block.
    block: bool,
    shown: Instant,
    progress: Progress,
    /// Per input: name, packet count, and packet rate.
    inputs: Vec<(String, u64, f64)>,
    counted: Instant,
}

impl Status {
    /// Starts the display.
    pub fn new(start: Instant, progress: Progress, block: bool) -> Self {
        Self {
            start,
            block,
            shown: start,
            progress,
            inputs: Vec::new(),
            counted: start,
        }
    }

    /// Displays the status when it is due.
    pub fn show(&mut self, facts: Facts<'_>) {
        let every = if self.block { BLOCK } else { LINE };
        if self.shown.elapsed() < every {
            // Polls the session all the same, to collect the drivers' reports.
            facts.session.poll();
            return;
        }
        self.shown += every;
        match self.block {
            true => stderr::show_block(self.lines(facts)),
            false => eprint(&self.line(facts)),
        }
    }

    /// The status line.
    fn line(&self, facts: Facts<'_>) -> String {
        let seconds = self.start.elapsed().as_secs_f64();
        let drivers = facts.session.poll();
        let mut parts: Vec<String> = match &drivers[..] {
            [(_, meters)] => vec![lateness(meters).join("; ")],
            several => several
                .iter()
                .map(|(name, meters)| format!("{name}: {}", lateness(meters).join("; ")))
                .collect(),
        };
        let verdict = verdict(drivers.iter().map(|(_, meters)| *meters));
        parts.extend(
            facts
                .session
                .rings()
                .chain(facts.drivers.rings())
                .map(|ring| ring_line(&ring)),
        );
        parts.extend(
            self.progress
                .iter()
                .filter_map(|(sink, progress)| Some(format!("{sink}: {}", progress.lines().first()?))),
        );
        let (status, silent) = (facts.drivers.status(), facts.silence.status());
        format!(
            "{seconds:.0} s: {}{status}{silent}; {verdict}\n",
            parts.join("; ")
        )
    }

    /// The status block.
    fn lines(&mut self, facts: Facts<'_>) -> Vec<String> {
        let now = Instant::now();
        let seconds = self.start.elapsed().as_secs_f64();
        let mut lines = Vec::new();
        let (width, status) = (screen::width().saturating_sub(1), facts.drivers.status());
        for (name, meters) in facts.session.poll() {
            let mut parts = lateness(meters);
            parts.extend(status.strip_prefix(", ").map(str::to_owned));
            let head = format!("{seconds:7.1} s  {name}  ");
            lines.push(fitting(&head, parts, &verdict([meters].into_iter()), width));
        }
        let rings = facts.session.rings().chain(facts.drivers.rings());
        lines.extend(rings.map(|ring| format!("           {}", ring_line(&ring))));
        let levels = facts.session.actuator_levels();
        let inputs = facts.session.live_inputs();
        self.count(now, facts.network);
        let names = levels
            .iter()
            .map(|level| &level.path)
            .chain(inputs.iter().map(|input| &input.device));
        let width = names.map(|name| name.chars().count()).max().unwrap_or(0);
        lines.extend(
            levels
                .iter()
                .map(|level| format!("{:<width$}  {}", level.path, shown_level(level))),
        );
        lines.extend(inputs.iter().map(|input| {
            format!(
                "{:<width$}  {}",
                input.device,
                self.shown_input(input, &facts, now)
            )
        }));
        for (sink, progress) in &self.progress {
            let mut shown = progress.lines().into_iter();
            lines.extend(shown.next().map(|first| format!("{sink}  {first}")));
            lines.extend(shown);
        }
        lines.extend(facts.set.map(|set| format!("set last: {set}")));
        lines
    }

    /// Updates the packet counts and rates.
    fn count(&mut self, now: Instant, network: &Connections) {
        let lasts = now.saturating_duration_since(self.counted);
        if !self.inputs.is_empty() && lasts < RATE {
            return;
        }
        let before = std::mem::take(&mut self.inputs);
        self.inputs = network
            .packets()
            .map(|(device, counts, _)| {
                let known = before.iter().find(|(name, ..)| *name == device);
                let come = known.map_or(0, |(_, before, _)| counts.accepted.saturating_sub(*before));
                (
                    device,
                    counts.accepted,
                    come as f64 / lasts.as_secs_f64().max(1e-3),
                )
            })
            .collect();
        self.counted = now;
    }

    fn shown_input(&self, input: &InputStatus, facts: &Facts<'_>, now: Instant) -> String {
        let rate = self.inputs.iter().find(|(name, ..)| *name == input.device);
        let rate = rate.map_or_else(|| "heard".to_owned(), |(_, _, hz)| format!("{hz:.0} a second"));
        let silent_s = facts
            .silence
            .silent_for(&input.device, now)
            .map_or(0.0, |lasts| lasts.as_secs_f64());
        match input.state {
            InputState::Never => {
                let place = facts.network.place(&input.device);
                let place = place.map_or_else(String::new, |place| format!(" at {place}"));
                let received = received(&input.device, facts.network);
                format!("nothing heard yet{place}{received}")
            }
            InputState::Silent => format!("silent for {:.1} s", silent_s + input.timeout_s),
            InputState::Jumped => format!("{rate}, jumped: its actuators and force are at zero"),
            InputState::Heard => {
                let mut counts = facts.network.packets();
                let counts = counts.find(|(device, ..)| *device == input.device);
                match counts.map_or(0, |(_, counts, _)| counts.refused_zeros) {
                    0 => rate,
                    refused => format!("{rate}, force not steady: taring failed {refused} times"),
                }
            }
        }
    }
}

fn ring_line(ring: &RingReport) -> String {
    let counts = ring.counts;
    let fill = counts
        .fill_s
        .map_or_else(|| "empty".to_owned(), |fill_s| format!("{:.2} ms", fill_s * 1e3));
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
        format!(
            "late {:.2} ms p99, {:.2} max",
            ms(late.quantile_ns(0.99)),
            ms(late.max_ns())
        ),
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
    let ActuatorLevel {
        rms,
        peak,
        limit,
        unit,
        ..
    } = level;
    let columns = |value: f64| ((value / limit.peak * BAR as f64).ceil().max(0.0) as usize).min(BAR);
    let bar: String = (0..BAR)
        .map(|column| match column {
            column if column < columns(*rms) => '#',
            column if column < columns(*peak) => '-',
            _ => ' ',
        })
        .collect();
    format!(
        "[{bar}] {rms:.3} {unit} rms of {}, peak {peak:.3} of {}",
        limit.continuous, limit.peak
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::limiter::ClipCounts;
    use crate::engine::node::Limit;

    #[test]
    fn what_does_not_fit_is_left_out_whole() {
        let parts = || {
            ["late 0.07 ms", "work 0.09 ms", "0 overruns"]
                .map(str::to_owned)
                .to_vec()
        };
        let line = |width| fitting("1.0 s  audio  ", parts(), "keeps time", width);
        let all = "1.0 s  audio  late 0.07 ms; work 0.09 ms; 0 overruns; keeps time";
        assert_eq!(line(all.len()), all);
        assert_eq!(
            line(all.len() - 1),
            "1.0 s  audio  late 0.07 ms; work 0.09 ms; keeps time"
        );
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
        let limit = Limit {
            peak: 0.5,
            continuous: 0.25,
            window_s: 10.0,
            slew_per_s: None,
        };
        let level = ActuatorLevel {
            path: "out".to_owned(),
            unit: "A".to_owned(),
            rms: 0.125,
            peak: 0.25,
            limit,
            clipped: ClipCounts::default(),
        };
        let shown = shown_level(&level);
        assert!(
            shown.starts_with("[######------            ] 0.125 A rms of 0.25, peak 0.250 of 0.5"),
            "{shown}"
        );
        let most = shown_level(&ActuatorLevel {
            rms: 0.25,
            peak: 0.5,
            ..level
        });
        assert!(most.starts_with("[############------------]"), "{most}");
    }
}
