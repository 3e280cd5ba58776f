//! `haptograph doctor`: checks of this machine for low latency, with advice.

use super::Failure;
use super::bench::bytes;
use super::placing::dead_in;
use super::result::{CommandResult, show};
use crate::engine::document::Document;
use crate::engine::graph::{CheckOptions, check};
use crate::engine::registry::Registry;
use crate::engine::run::{FileSinks, Meters, Session, SessionOptions};
use crate::live::haply;
use crate::live::soundcard::{SoundcardError, list};
use crate::live::timer::TimerThread;
use crate::signal::files;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Check this machine for low latency and advise
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Print the findings as JSON
    #[arg(long)]
    json: bool,
}

/// The result of one check.
#[derive(Serialize)]
struct Finding {
    /// The remedy; `None` if nothing is wrong.
    advice: Option<&'static str>,
    found: String,
    what: &'static str,
}

impl Finding {
    fn new(what: &'static str, found: impl Into<String>, is_well: bool, advice: &'static str) -> Self {
        Self { what, found: found.into(), advice: (!is_well).then_some(advice) }
    }
}

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    let mut findings = Vec::new();
    if cfg!(target_os = "linux") {
        findings.extend(limits(&read(Path::new("/proc/self/limits"))));
        findings.push(kernel(&read(Path::new("/proc/version"))));
        findings.push(governors(Path::new("/sys/devices/system/cpu")));
        findings.push(group(&read(Path::new("/etc/group")), &read(Path::new("/proc/self/status"))));
        findings.push(cards(&read(Path::new("/proc/asound/cards"))));
        findings.push(servers());
        findings.push(headers());
    }
    findings.push(feature());
    findings.extend(arms());
    findings.push(leftovers());
    findings.push(timer(registry)?);
    show(&findings, arguments.json)
}

impl CommandResult for Vec<Finding> {
    fn text(&self) -> String {
        let text: String = self.iter().map(shown).collect();
        text + &match self.iter().filter(|finding| finding.advice.is_some()).count() {
            0 => "no problems found\n".to_owned(),
            1 => "found 1 possible improvement\n".to_owned(),
            lacking => format!("found {lacking} possible improvements\n"),
        }
    }
}

fn shown(finding: &Finding) -> String {
    let Finding { what, found, advice } = finding;
    let mark = if advice.is_some() { "!" } else { " " };
    let advice = advice.map_or_else(String::new, |advice| format!("{:20}-> {advice}\n", ""));
    format!("{mark} {what:17} {found}\n{advice}")
}

fn read(path: &Path) -> String {
    files::read_text(path, files::MAX_NOTE_BYTES).unwrap_or_default()
}

fn limits(text: &str) -> [Finding; 2] {
    // Columns: name, soft limit, hard limit, unit. Names contain spaces.
    let soft = |name: &str| {
        let line = text.lines().find(|line| line.starts_with(name))?;
        line[name.len()..].split_whitespace().next()
    };
    let priority = soft("Max realtime priority").unwrap_or("unknown");
    let locked = soft("Max locked memory").unwrap_or("unknown");
    let can_rise = priority == "unlimited" || priority.parse().is_ok_and(|most: u32| most >= 60);
    [
        Finding::new(
            "real-time priority",
            format!("up to {priority}"),
            can_rise,
            "write `@audio - rtprio 95` to /etc/security/limits.d/haptograph.conf, and log in again",
        ),
        Finding::new(
            "locked memory",
            locked.parse().map_or_else(|_| locked.to_owned(), bytes),
            locked == "unlimited",
            "write `@audio - memlock unlimited` to /etc/security/limits.d/haptograph.conf, and log in again",
        ),
    ]
}

/// The names, or what stands for none.
fn listed<S: std::borrow::Borrow<str>>(names: &[S], separator: &str, none: &str) -> String {
    if names.is_empty() { none.to_owned() } else { names.join(separator) }
}

/// Finds the folders of crashed runs, in the current folder and in `out`.
fn leftovers() -> Finding {
    let mut found = dead_in(Path::new("."));
    found.extend(dead_in(Path::new("out")));
    let names: Vec<String> = found.iter().map(|path| path.display().to_string()).collect();
    Finding::new(
        "crashed runs",
        listed(&names, ", ", "none here and in out"),
        names.is_empty(),
        "`haptograph recover FOLDER` repairs the files of a crashed run; remove the folders that you do not need",
    )
}

fn kernel(version: &str) -> Finding {
    let kinds = ["PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT"];
    let kind = kinds.into_iter().find(|kind| version.contains(kind));
    Finding::new(
        "kernel",
        kind.unwrap_or("not preemptible, or not stated"),
        kind.is_some(),
        "boot a kernel with PREEMPT_DYNAMIC and `preempt=full`, or a PREEMPT_RT one",
    )
}

fn governors(cpus: &Path) -> Finding {
    let mut found: Vec<String> = files::entries(cpus)
        .into_iter()
        .flatten()
        .flatten()
        .map(|cpu| read(&cpu.path().join("cpufreq/scaling_governor")).trim().to_owned())
        .filter(|governor| !governor.is_empty())
        .collect();
    found.sort();
    found.dedup();
    let fixed = found.iter().all(|governor| governor == "performance");
    Finding::new(
        "processor clock",
        listed(&found, ", ", "unknown: the system does not report it"),
        fixed,
        "set the governor before a live run: `sudo cpupower frequency-set -g performance`",
    )
}

fn group(groups: &str, status: &str) -> Finding {
    let audio = groups.lines().find(|line| line.starts_with("audio:"));
    let id = audio.and_then(|line| line.split(':').nth(2));
    let own = |name: &str| status.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_default();
    let is_root = own("Uid:").split_whitespace().next() == Some("0");
    let is_in = id.is_some_and(|id| own("Groups:").split_whitespace().any(|own| own == id));
    Finding::new(
        "group audio",
        match (is_in, is_root) {
            (true, _) => "you are in it",
            (_, true) => "not needed: you are root",
            _ => "you are not in it",
        },
        is_in || is_root,
        "`sudo usermod -aG audio $USER`, and log in again",
    )
}

fn cards(text: &str) -> Finding {
    // Two lines per card; the first is ` 0 [PCH            ]: HDA-Intel - HDA Intel PCH`.
    let names: Vec<&str> =
        text.lines().filter_map(|line| line.split_once("]: ")).map(|(_, name)| name).collect();
    Finding::new(
        "soundcards",
        listed(&names, "; ", "none"),
        !names.is_empty(),
        "connect one; until then graphs run offline and with simulated devices",
    )
}

fn servers() -> Finding {
    let run = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).unwrap_or_default();
    let jack = std::env::var_os("PATH")
        .is_some_and(|path| std::env::split_paths(&path).any(|folder| folder.join("jackd").exists()));
    let (pipewire, pulse) = (run.join("pipewire-0").exists(), run.join("pulse/native").exists());
    let all = [("PipeWire", pipewire), ("PulseAudio", pulse), ("JACK (installed)", jack)];
    let found: Vec<&str> = all.into_iter().filter_map(|(name, there)| there.then_some(name)).collect();
    Finding::new("sound servers", listed(&found, ", ", "none: ALSA alone, the lowest latency"), true, "")
}

fn headers() -> Finding {
    let places = ["/usr/include/alsa/asoundlib.h", "/usr/local/include/alsa/asoundlib.h"];
    let there = places.iter().any(|place| Path::new(place).exists());
    Finding::new(
        "ALSA's headers",
        if there { "installed" } else { "missing" },
        there,
        "`sudo apt install libasound2-dev pkg-config` (Fedora: `sudo dnf install alsa-lib-devel`)",
    )
}

fn feature() -> Finding {
    let built = !matches!(list(), Err(SoundcardError::NotBuilt));
    Finding::new(
        "this program",
        if built { "built with soundcards" } else { "built without soundcards" },
        built,
        "`cargo build --release --features soundcard`, with ALSA's headers installed",
    )
}

/// The arms of the Haply Inverse Service, in a build that reaches them. Most machines have no such service.
fn arms() -> Option<Finding> {
    let arms = haply::BACKEND.is_built.then(haply::list)?;
    let (found, is_well) = match arms {
        Ok(arms) => (listed(&arms, ", ", "none at the Inverse Service"), !arms.is_empty()),
        Err(_) => (format!("no Inverse Service at {}", haply::SERVICE), true),
    };
    Some(Finding::new("Haply arms", found, is_well, "connect an arm and its power supply"))
}

/// Measures the accuracy of a timer for half a second. Information only, since the next second may differ.
fn timer(registry: &Registry) -> Result<Finding, Failure> {
    let failed = |error: &dyn std::fmt::Display| Failure::Message(format!("cannot test the timer: {error}"));
    let text = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000) },
        nodes: { "one": Constant(clock: "servo", value: 1, quantity: "number") })"#;
    let document = Document::parse("doctor.ron", text).map_err(|wrong| failed(&wrong))?;
    let graph = check(&document, registry, &CheckOptions::default());
    let graph = graph.map_err(|wrong| failed(&wrong))?;
    let options = SessionOptions::default().seconds(0.5);
    let (live, session) = Session::open(FileSinks::new(&graph), &options).map_err(|error| failed(&error))?;
    let thread = TimerThread::start(live).map_err(|error| failed(&error))?;
    let live = thread.join().ok_or_else(|| failed(&"its thread ended early"))?;
    let Meters { lateness, stalls, .. } = session.finish(live).meters;
    let us = |ns: u64| ns as f64 / 1e3;
    let found = format!(
        "half of its wake-ups within {:.0} us, 99 % within {:.0} us, the latest {:.0} us, {stalls} stalls (in 0.5 s)",
        us(lateness.quantile_ns(0.5)),
        us(lateness.quantile_ns(0.99)),
        us(lateness.max_ns())
    );
    let is_well = lateness.quantile_ns(0.99) < 200_000;
    Ok(Finding::new(
        "timer at 1 kHz",
        found,
        is_well,
        "follow the advice above; a virtual machine may not do better",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_as_the_kernel_writes_them() {
        let text = "Limit                     Soft Limit           Hard Limit           Units     \n\
                    Max locked memory         8388608              unlimited            bytes     \n\
                    Max realtime priority     95                   95                             \n";
        let [priority, locked] = limits(text);
        assert!(priority.advice.is_none() && priority.found.contains("95"));
        assert!(locked.advice.is_some() && locked.found == "8192.0 KiB");
    }

    #[test]
    fn the_group_counts_only_where_the_process_is_in_it() {
        let groups = "root:x:0:\naudio:x:29:someone\n";
        let finding = |status: &str| group(groups, status).advice.is_none();
        assert!(finding("Uid:\t1000\t1000\nGroups:\t29 1000 \n"));
        assert!(!finding("Uid:\t1000\t1000\nGroups:\t129 290 \n"));
        assert!(finding("Uid:\t0\t0\nGroups:\t \n"));
    }

    #[test]
    fn soundcards_and_kernels_are_told_by_name() {
        let text = " 0 [PCH            ]: HDA-Intel - HDA Intel PCH\n                      HDA Intel PCH at 0x1 irq 1\n";
        assert_eq!(cards(text).found, "HDA-Intel - HDA Intel PCH");
        assert!(cards("--- no soundcards ---\n").advice.is_some());
        assert_eq!(kernel("Linux version 6.1 SMP PREEMPT_RT Debian").found, "PREEMPT_RT");
        assert!(kernel("Linux version 6.1 SMP").advice.is_some());
    }
}
