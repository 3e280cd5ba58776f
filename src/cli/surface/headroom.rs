//! `haptograph surface headroom`: how often the limits of a graph's actuators act on surfaces, and the gain at which they rarely do.

use super::Surfaces;
use crate::cli::progress::Progress;
use crate::cli::result::{CommandResult, show};
use crate::cli::table::{significant, table};
use crate::cli::{Failure, GraphArguments, interrupt};
use crate::engine::document::{Document, LoadOptions};
use crate::engine::graph::Graph;
use crate::engine::limiter::ClipCounts;
use crate::engine::registry::Registry;
use crate::engine::run::{ActuatorReport, Player, SessionOptions};
use crate::signal::parallel;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// Show how often the limits of the actuators act on surfaces, and the gain at which they rarely do
///
/// Runs the graph with each surface and its simulated hands, and counts the ticks in which a limit reduced what an actuator was asked
/// for. All surfaces have one gain, so that their amplitudes keep their ratios. Where the hands do not go, nothing is known.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Arguments {
    /// The graph file
    #[arg(value_name = "GRAPH.ron")]
    graph: PathBuf,
    #[command(flatten)]
    surfaces: Surfaces,
    /// Override a parameter of the graph; can be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = crate::cli::assignment)]
    set: Vec<(String, String)>,
    /// The graph's parameter that takes the file of a surface
    #[arg(long, value_name = "NAME", default_value = "surface")]
    parameter: String,
    /// The graph's parameter that scales what the actuators are asked for; default: `gain`, if the graph has it
    #[arg(long, value_name = "NAME")]
    gain: Option<String>,
    /// Largest share of ticks of a surface in which a limit may act, %
    #[arg(long, value_name = "PERCENT", default_value_t = 1.0, value_parser = percent)]
    most: f64,
    /// Duration of each run, in its own time
    #[arg(long = "for", value_name = "SECONDS", default_value_t = SECONDS, value_parser = crate::cli::run::seconds)]
    duration_s: f64,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

fn percent(text: &str) -> Result<f64, String> {
    crate::cli::import::number(text, 0.0..=100.0, "give a share from 0 to 100 %")
}

/// Default duration of a run, s: twice the usual window of a continuous limit.
pub(in crate::cli) const SECONDS: f64 = 20.0;
/// Length of the parts in which ticks are counted, s.
const PART_S: f64 = 0.01;
/// Force, N, and speed, m/s, of a cell in which parts are counted together.
const CELL: [f64; 2] = [0.5, 0.05];
/// Parts below which a cell says nothing.
const FEWEST_PARTS: u64 = 10;
/// Smallest and largest factor of a gain, and the precision of the search.
const FACTORS: [f64; 2] = [1.0 / 64.0, 16.0];
const PRECISION: f64 = 1.01;

/// What the limits of an actuator did in a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::cli) struct Headroom {
    pub actuator: String,
    /// Shares of ticks in which each limit acted.
    pub continuous: f64,
    /// Largest request over the peak limit.
    pub largest_over_peak: f64,
    pub peak: f64,
    /// The largest of the three shares.
    pub share: f64,
    pub slew: f64,
    /// Where a limit acts most; nowhere if none does or the graph has no force and speed.
    pub worst: Option<Worst>,
}

/// A force and a speed, and the share of ticks there in which a limit acts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(in crate::cli) struct Worst {
    pub force_n: f64,
    pub share: f64,
    pub speed_mm_s: f64,
}

/// Parts of a run with nearly the same force and speed.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    parts: u64,
    ticks: u64,
    limited: u64,
    /// Sums of force and speed.
    sums: [f64; 2],
}

/// The outputs that give a graph's texture the force and the speed of the hand, if it has both.
fn force_and_speed(graph: &Graph) -> Option<[String; 2]> {
    let nodes = graph.nodes();
    nodes.ids().find_map(|id| {
        let source = |wanted: &str| {
            let incoming = nodes.incoming(id).into_iter();
            let of = incoming.into_iter().find(|of| nodes[id].inputs[of.edge.input].name == wanted)?;
            let from = &nodes[of.from];
            Some(format!("{}.{}", from.path, from.outputs[of.edge.output].name))
        };
        Some([source("force")?, source("speed")?])
    })
}

/// Runs a graph offline and reads from the run what the limits of its actuators did.
pub(in crate::cli) fn headroom_of(
    graph: &Graph,
    duration_s: f64,
    stop: &AtomicBool,
) -> Result<Vec<Headroom>, Failure> {
    let mut options = SessionOptions::default().rested();
    options.offline = true;
    options.probes = force_and_speed(graph).into_iter().flatten().collect();
    let (mut player, mut session) = Player::open(graph, &options).map_err(Failure::message)?;
    let ports = options.probes.iter().map(|name| session.any_probe(name));
    let mut ports = ports.collect::<Result<Vec<_>, _>>().map_err(Failure::message)?;
    let rate_hz = graph.drivers().first().map_or(1.0, |driver| graph.clocks()[*driver].rate.hz());
    let (step, frames) = ((rate_hz * PART_S).max(1.0) as usize, (duration_s * rate_hz) as u64);
    let mut of = vec![(ClipCounts::default(), BTreeMap::<_, Cell>::new()); player.actuators().count()];
    let mut place = [0.0; 2];
    while player.frames() < frames && !stop.load(Ordering::Relaxed) {
        player.process(step);
        session.poll();
        for (value, port) in place.iter_mut().zip(&mut ports) {
            while port.take(std::slice::from_mut(value)) {}
        }
        let key = [0, 1].map(|axis| (place[axis] / CELL[axis]).floor() as i64);
        for ((before, cells), ActuatorReport { clipped: now, .. }) in of.iter_mut().zip(player.actuators()) {
            let cell = cells.entry(key).or_default();
            let own = |of: fn(&ClipCounts) -> u64| of(&now) - of(before);
            cell.parts += 1;
            cell.ticks += own(|of| of.ticks);
            // Each limit by itself: the largest may be another one in each part.
            cell.limited += own(|of| of.peak).max(own(|of| of.continuous)).max(own(|of| of.slew));
            cell.sums = [0, 1].map(|axis| cell.sums[axis] + place[axis]);
            *before = now;
        }
    }
    if stop.load(Ordering::Relaxed) {
        return Err(Failure::Interrupted);
    }
    let found = player.actuators().zip(&of);
    Ok(found
        .map(|(actuator, (_, cells))| Headroom::new(actuator, cells.values().filter(|_| !ports.is_empty())))
        .collect())
}

fn share(of: u64, ticks: u64) -> f64 {
    of as f64 / ticks.max(1) as f64
}

impl Headroom {
    fn new<'c>(actuator: ActuatorReport, cells: impl Iterator<Item = &'c Cell>) -> Self {
        let counts = actuator.clipped;
        let [peak, continuous, slew] =
            [counts.peak, counts.continuous, counts.slew].map(|of| share(of, counts.ticks));
        let worst = cells.filter(|cell| cell.parts >= FEWEST_PARTS && cell.limited > 0).map(|cell| {
            let [force_n, speed_m_s] = cell.sums.map(|sum| sum / cell.parts as f64);
            Worst { force_n, share: share(cell.limited, cell.ticks), speed_mm_s: 1000.0 * speed_m_s }
        });
        Self {
            actuator: actuator.path,
            continuous,
            largest_over_peak: actuator.largest_request / actuator.limit.peak,
            peak,
            // Some ticks may be counted by two limits.
            share: peak.max(continuous).max(slew),
            slew,
            worst: worst.max_by(|a, b| a.share.total_cmp(&b.share)),
        }
    }

    fn row(&self, run: &str) -> Vec<String> {
        let percent = |share: f64| significant(100.0 * share, 3);
        let worst = self.worst.map_or_else(String::new, |at| {
            let (force, speed) = (significant(at.force_n, 3), significant(at.speed_mm_s, 3));
            format!("{force} N, {speed} mm/s: {} %", percent(at.share))
        });
        let [share, peak, continuous, slew] =
            [self.share, self.peak, self.continuous, self.slew].map(percent);
        let largest = significant(self.largest_over_peak, 3);
        vec![run.to_owned(), self.actuator.clone(), share, peak, continuous, slew, largest, worst]
    }
}

/// The headroom of several runs of `seconds` s as text, with the names of the runs under `head`.
pub(in crate::cli) fn text_of<'a>(
    head: &str,
    seconds: f64,
    runs: impl Iterator<Item = (String, &'a [Headroom])>,
) -> String {
    let rows: Vec<_> = runs.flat_map(|(run, of)| of.iter().map(move |one| one.row(&run))).collect();
    let header =
        [head, "actuator", "limited %", "peak %", "continuous %", "slew %", "largest / peak", "worst at"];
    let table = table(&header, &rows);
    format!("ticks in which a limit acts, in {seconds} s of the graph's simulated hands\n{table}")
}

/// The largest factor within [`FACTORS`] for which `is_allowed`; `None` if there is none. `is_allowed_now` is that of 1.
fn largest_factor(
    is_allowed_now: bool,
    is_allowed: impl Fn(f64) -> Result<bool, Failure>,
) -> Result<Option<f64>, Failure> {
    let step = if is_allowed_now { 2.0 } else { 0.5 };
    let mut next = step;
    while is_allowed(next)? == is_allowed_now {
        next *= step;
        if !(FACTORS[0]..=FACTORS[1]).contains(&next) {
            return Ok(is_allowed_now.then_some(FACTORS[1]));
        }
    }
    let (mut low, mut high) = (next.min(next / step), next.max(next / step));
    while high / low > PRECISION {
        let middle = (low * high).sqrt();
        *(if is_allowed(middle)? { &mut low } else { &mut high }) = middle;
    }
    Ok(Some(low))
}

pub(in crate::cli) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    arguments.graph().refuse_repeated()?;
    let stop = interrupt::flag()?;
    show(&arguments.measure(registry, &stop)?, arguments.json)
}

impl Arguments {
    fn graph(&self) -> GraphArguments {
        GraphArguments { graph: self.graph.clone(), set: self.set.clone(), endpoints: None }
    }

    /// Runs the graph with all surfaces, and searches the gain.
    fn measure(&self, registry: &Registry, stop: &AtomicBool) -> Result<Shown, Failure> {
        let (gain, files) = (self.gain()?, self.surfaces.files()?);
        let run = |surface: &PathBuf, factor: f64| {
            let mut graph = self.graph();
            let file = std::path::absolute(surface).map_err(Failure::doing("find", surface))?;
            // The last value of a parameter counts.
            graph.set.push((self.parameter.clone(), file.display().to_string()));
            graph.set.extend(gain.iter().map(|(name, value)| (name.clone(), (value * factor).to_string())));
            let graph = graph.load(registry, None).map_err(Failure::Graph)?;
            let actuators = headroom_of(&graph, self.duration_s, stop)?;
            Ok(OfSurface { actuators, surface: surface.clone() })
        };
        let all = |factor: f64, at: &(dyn Fn(f64) + Sync)| {
            parallel::try_map(parallel::cores(), &files, at, |surface| run(surface, factor))
        };
        let is_allowed = |runs: &[OfSurface]| {
            let mut shares = runs.iter().flat_map(|run| &run.actuators).map(|one| one.share);
            shares.all(|share| share <= self.most / 100.0)
        };
        let surfaces = Progress::during("running", |at| all(1.0, at))?;
        let scale = |(parameter, value): &(String, f64)| {
            let _progress = Progress::unknown("scaling");
            let factor = largest_factor(is_allowed(&surfaces), |by| Ok(is_allowed(&all(by, &|_| ())?)))?;
            let scaled = factor.map(|factor| factor * value);
            Ok::<_, Failure>(Gain { factor, parameter: parameter.clone(), scaled, value: *value })
        };
        let gain = gain.as_ref().map(scale).transpose()?;
        Ok(Shown { gain, most_percent: self.most, seconds: self.duration_s, surfaces })
    }

    /// The parameter that scales what the actuators are asked for, and its value.
    fn gain(&self) -> Result<Option<(String, f64)>, Failure> {
        let document = Document::load(&self.graph, &LoadOptions::default()).map_err(Failure::Graph)?;
        let name = self.gain.as_deref().unwrap_or("gain");
        let set = self.set.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        let known = set.chain(document.parameters()).find(|(known, _)| *known == name);
        match known.map(|(_, value)| (value, value.trim().parse())) {
            None if self.gain.is_none() => Ok(None),
            None => Err(Failure::Message(format!("the graph has no parameter `{name}`"))),
            Some((_, Ok(number))) if number != 0.0 => Ok(Some((name.to_owned(), number))),
            Some((value, _)) => {
                Err(Failure::Message(format!("parameter `{name}` is {value}, which no factor can scale")))
            }
        }
    }
}

/// The headroom of a set of surfaces.
#[derive(Serialize)]
struct Shown {
    gain: Option<Gain>,
    most_percent: f64,
    seconds: f64,
    surfaces: Vec<OfSurface>,
}

/// One gain for the whole set.
#[derive(Serialize)]
struct Gain {
    /// None if limits act more often than allowed at any.
    factor: Option<f64>,
    parameter: String,
    scaled: Option<f64>,
    /// As it is.
    value: f64,
}

#[derive(Serialize)]
struct OfSurface {
    actuators: Vec<Headroom>,
    surface: PathBuf,
}

impl CommandResult for Shown {
    fn text(&self) -> String {
        let name = |path: &PathBuf| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let runs = self.surfaces.iter().map(|of| (name(&of.surface), &*of.actuators));
        let (text, most) = (text_of("surface", self.seconds, runs), self.most_percent);
        let Some(Gain { factor, parameter, scaled, value }) = &self.gain else {
            return text + "the graph has no parameter `gain`; name another by --gain\n";
        };
        let scaled = match (factor, scaled) {
            (Some(factor), Some(scaled)) => {
                let more = if *factor >= FACTORS[1] { " or more" } else { "" };
                let (factor, scaled) = (significant(*factor, 3), significant(*scaled, 3));
                format!(
                    "`{parameter}` {scaled}{more}, {factor} times its {value}, limits no surface in more than {most} % of ticks"
                )
            }
            _ => format!(
                "no `{parameter}` down to a 64th of its {value} limits every surface in at most {most} % of ticks"
            ),
        };
        format!("{text}{scaled}\n")
    }
}

#[cfg(test)]
mod tests {
    use super::super::Only;
    use super::*;

    /// A sine of amplitude 1 A, times `gain`, at a peak limit of 0.5 A.
    const SINE: &str = r#"Graph(format: 1, parameters: { "surface": "", "gain": 1.0 },
        clocks: { "audio": Driver(rate_hz: 48000) },
        nodes: {
            "tone": Sine(clock: "audio", frequency_hz: 97.0, quantity: "current"),
            "out": ActuatorSink(endpoint: "coil", current: "tone", gain: Param("gain"),
                limit: (peak_a: 0.5, continuous_a: 0.5, window_s: 10)),
        },
        endpoints: { "simulated": { "coil": SimulatedHaptuator() } })"#;

    #[test]
    fn a_sine_above_a_limit_has_the_share_of_an_arc() {
        let registry = crate::nodes::registry();
        let folder = tempfile::tempdir().unwrap();
        let graph = folder.path().join("sine.ron");
        std::fs::write(&graph, SINE).unwrap();
        let mut arguments = Arguments {
            graph,
            surfaces: Surfaces { paths: vec!["a.ron".into(), "b.ron".into()], only: Only { only: None } },
            set: Vec::new(),
            parameter: "surface".to_owned(),
            gain: None,
            most: 1.0,
            duration_s: 2.0,
            json: false,
        };
        let stop = AtomicBool::new(false);
        let mut with = |gain: &str| {
            arguments.set = vec![("gain".to_owned(), gain.to_owned())];
            let Shown { gain, surfaces, .. } = arguments.measure(&registry, &stop)?;
            let [_, OfSurface { actuators, .. }] = &surfaces[..] else { panic!("two surfaces") };
            Ok::<_, Failure>((actuators[0].clone(), gain.unwrap().factor))
        };
        let (one, factor) = with("1.0").unwrap();
        // |sin| > 1/2 for two thirds of a turn.
        assert!((one.share - 2.0 / 3.0).abs() < 1e-3 && one.share == one.peak, "{one:?}");
        assert!((one.largest_over_peak - 2.0).abs() < 1e-3 && one.worst.is_none(), "{one:?}");
        // 1 % of a turn is above cos(0.005 pi) of the amplitude: half the gain, within the precision of the search.
        let limit = 0.5 / (0.005 * std::f64::consts::PI).cos();
        let is_it = |factor: f64, limit: f64| factor <= limit + 1e-5 && factor > limit / PRECISION;
        assert!(is_it(factor.unwrap(), limit), "{factor:?} {limit}");
        // From below the same.
        let (_, factor) = with("0.1").unwrap();
        assert!(is_it(factor.unwrap(), 10.0 * limit), "{factor:?}");
        // Beyond both ends.
        assert_eq!(with("0.001").unwrap().1, Some(FACTORS[1]));
        assert_eq!(with("1000").unwrap().1, None);
        stop.store(true, Ordering::Relaxed);
        assert!(matches!(with("1.0"), Err(Failure::Interrupted)));
    }
}
