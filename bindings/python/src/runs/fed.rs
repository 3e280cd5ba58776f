//! A run whose endpoints are fed with arrays.

use super::{Done, Feed, Signal, Wanted, drain, fits, probes, seconds};
use crate::errors::Failure;
use crate::players::{is_model, put};
use crate::work::Progress;
use haptograph::engine::graph::Graph;
use haptograph::engine::host::{AnyInput, AnyOutput, Full};
use haptograph::engine::run::{Player, SessionOptions};

/// Duration of the parts between which the queues are filled, s; a queue holds one second.
const PART_S: f64 = 0.25;

/// An input and its feed.
struct Fed<'a> {
    input: AnyInput,
    feed: &'a Feed,
    given: usize,
}

impl<'a> Fed<'a> {
    fn of(graph: &Graph, feed: &'a Feed) -> Result<Self, Failure> {
        let input = graph.any_input(&feed.name).map_err(Failure::of)?;
        let width = input.kind().width();
        if feed.width != width && !is_model(&input, feed.width) {
            return Err(Failure::Message(format!(
                "a frame of `{}` has {width} components, not {}",
                feed.name, feed.width
            )));
        }
        let given = 0;
        Ok(Self { input, feed, given })
    }

    /// Fills the queue to twice a part.
    fn fill(&mut self) -> Result<(), Failure> {
        let wanted = (2.0 * PART_S * self.input.rate().hz()).ceil() as usize + 1;
        while self.input.waiting() < wanted {
            let Some(frame) = self.feed.frame(self.given) else {
                return Ok(());
            };
            match put(&mut self.input, frame, AnyInput::push) {
                Ok(()) => self.given += 1,
                Err(Full::Full) => return Ok(()),
                Err(error) => {
                    let (name, number) = (&self.feed.name, self.given);
                    return Err(Failure::Message(format!("frame {number} of `{name}`: {error}")));
                }
            }
        }
        Ok(())
    }

    /// Duration of the feed, s.
    fn seconds(&self) -> f64 {
        match self.feed.constant {
            true => f64::INFINITY,
            false => self.feed.frames() as f64 / self.input.rate().hz(),
        }
    }
}

/// Checks that all channels of a fed endpoint are fed.
fn all_fed(graph: &Graph, feeds: &[Feed]) -> Result<(), Failure> {
    let is_fed = |name: &str| {
        let endpoint = name.split('.').next();
        feeds.iter().any(|feed| feed.name == name || Some(feed.name.as_str()) == endpoint)
    };
    let missing: Vec<String> =
        graph.host_inputs().map(|(name, _)| name).filter(|name| !is_fed(name)).collect();
    match missing.is_empty() {
        true => Ok(()),
        false => Err(Failure::Message(format!(
            "give `{}` as well: who feeds an endpoint feeds all of its channels",
            missing.join("`, `")
        ))),
    }
}

/// Duration of the shortest feed, s.
fn lasting(fed: &[Fed<'_>], wanted: &Wanted) -> Result<f64, Failure> {
    let shortest = fed.iter().min_by(|a, b| a.seconds().total_cmp(&b.seconds()));
    let Some(shortest) = shortest.filter(|fed| fed.seconds().is_finite()) else {
        return seconds(wanted, None);
    };
    let seconds = seconds(wanted, Some(shortest.seconds()))?;
    if seconds > shortest.seconds() * (1.0 + 1e-9) {
        return Err(Failure::Message(format!(
            "`{}` has {} frames at {} Hz, {} s, for a run of {seconds} s",
            shortest.feed.name,
            shortest.feed.frames(),
            shortest.input.rate().hz(),
            shortest.seconds()
        )));
    }
    Ok(seconds)
}

/// Runs a graph with the caller's arrays.
pub(super) fn fed(
    graph: &Graph,
    feeds: &[Feed],
    wanted: &Wanted,
    progress: &Progress,
    goes_on: &dyn Fn() -> bool,
) -> Result<Done, Failure> {
    let mut fed = feeds.iter().map(|feed| Fed::of(graph, feed)).collect::<Result<Vec<_>, _>>()?;
    all_fed(graph, feeds)?;
    let seconds = lasting(&fed, wanted)?;
    let probes = probes(graph, wanted, false)?;
    fits(&probes, seconds)?;
    let mut options = SessionOptions::default().rested();
    options.offline = true;
    options.probes = probes.iter().map(|(name, _)| name.clone()).collect();
    options.folder.clone_from(&wanted.folder);
    let (mut player, mut session) = Player::open(graph, &options).map_err(Failure::of)?;
    let mut kept: Vec<(AnyOutput, Signal)> = Vec::new();
    for (name, stream) in &probes {
        let output = session.any_probe(name).map_err(Failure::of)?;
        kept.push((output, Signal::of(stream, name)));
    }
    let driver = graph.drivers().first().copied().unwrap_or_default();
    let rate_hz = graph.clocks()[driver].rate.hz();
    let total = (seconds * rate_hz).round() as u64;
    let part = ((PART_S * rate_hz) as u64).max(1);
    while player.frames() < total && goes_on() {
        fed.iter_mut().try_for_each(Fed::fill)?;
        player.process(part.min(total - player.frames()) as usize);
        kept.iter_mut().for_each(|(output, signal)| drain(output, &mut signal.frames));
        progress.at(player.frames() as f64 / total as f64);
    }
    let done = session.finish(player);
    if let Some(failed) = done.failed.first() {
        return Err(Failure::of(failed));
    }
    Ok(Done { signals: kept.into_iter().map(|(_, signal)| signal).collect(), outcome: done.outcome })
}
