//! One graph of several drivers in the place of another, in virtual time.

use super::Heard;
use super::virtual_clock::{bits, graphs, listening};
use super::world::{as_leaky, random_graph_with_drivers, with_a_node_more, with_rings_more};
use crate::graph::NodeId;
use crate::graph::{Graph, id_of};
use crate::node::SettingId;
use crate::run::{Change, ChangeError, ControlError, Player, RingReport, Session, SessionOptions};
use std::path::Path;

/// A session whose drivers wake once a millisecond.
struct Driven<'a> {
    graph: &'a Graph,
    lives: Vec<Player>,
    session: Session,
    heard: Vec<Heard>,
    wakes: u64,
}

impl<'a> Driven<'a> {
    fn new(graph: &'a Graph) -> Self {
        let (file_sinks, heard) = listening(graph);
        let (lives, session) = Session::open_all(file_sinks, &SessionOptions::default(), None).unwrap();
        Self { graph, lives, session, heard, wakes: 0 }
    }

    fn run(&mut self, wakes: u64) {
        for _ in 0..wakes {
            self.wakes += 1;
            for live in &mut self.lives {
                let due = (self.wakes as f64 * 1e-3 * live.run().rate_hz()) as u64;
                live.process((due - live.frames()) as usize);
            }
        }
        self.session.poll();
    }

    fn change(&mut self, graph: &Graph) -> Result<Change, ChangeError> {
        self.session.change(graph, Path::new(".")).map(|changed| changed.change)
    }

    /// Ends it: all that was heard of each node of the graph that it began with, by path, and its rings.
    fn end(self) -> (Vec<(String, Vec<u64>)>, Vec<RingReport>) {
        for live in &self.lives {
            let due = (self.wakes as f64 * 1e-3 * live.run().rate_hz()) as u64;
            assert_eq!(live.run().driver_frames(), due, "a tick was missed");
        }
        let ended = self.session.finish_all(self.lives);
        assert_eq!((ended.lost_numbers, ended.failed.len()), (0, 0));
        let paths = self.graph.nodes.node_weights().map(|node| node.path.clone());
        let heard = self.heard.iter().map(|heard| bits(&heard.0.lock().unwrap()));
        (paths.zip(heard).collect(), ended.outcome.rings)
    }
}

/// Its leaky nodes of these paths have other settings.
fn with_other_weights(seed: u64, paths: &[String]) -> Graph {
    let mut graph = random_graph_with_drivers(seed);
    for node in graph.nodes.node_weights_mut() {
        if paths.contains(&node.path)
            && let Some(leaky) = as_leaky(&mut node.work)
        {
            leaky.weight = 0.4;
            node.fingerprint += 1;
        }
    }
    graph
}

/// Whatever no actuator is in: a fade would be heard in it.
fn quiet_graphs() -> impl Iterator<Item = (u64, Graph)> {
    graphs().filter(|(_, graph)| graph.devices.is_empty())
}

fn troubles(ring: &RingReport) -> (u64, u64, u64) {
    let counts = &ring.counts;
    (counts.underruns, counts.overruns, counts.lost_frames)
}

#[test]
fn the_same_graph_changes_no_bit() {
    for (seed, graph) in graphs().take(12) {
        let mut plain = Driven::new(&graph);
        plain.run(300);
        let mut changed = Driven::new(&graph);
        for _ in 0..30 {
            changed.run(10);
            let again = random_graph_with_drivers(seed);
            assert_eq!(changed.change(&again).unwrap(), Change::Settings(0));
        }
        changed.run(0);
        let (plain, changed) = (plain.end(), changed.end());
        assert!(plain.0 == changed.0, "seed {seed}");
        assert_eq!(plain.1, changed.1, "seed {seed}");
    }
}

#[test]
fn what_hangs_on_nothing_that_changed_goes_on_bit_for_bit_through_rings_too() {
    let (mut same, mut other, mut rings) = (0, 0, 0);
    for (seed, graph) in quiet_graphs() {
        // Of one driver the leaky nodes change, every second one.
        let driver = graph.drivers()[0];
        let nodes = graph.nodes();
        let own = nodes.ids().filter(|node| graph.driver_of(*node) == Some(driver));
        let changing: Vec<NodeId> = own.step_by(2).collect();
        let paths: Vec<String> = changing.iter().map(|node| nodes[*node].path.clone()).collect();
        let mut plain = Driven::new(&graph);
        plain.run(600);
        let mut changed = Driven::new(&graph);
        changed.run(200);
        let change = changed.change(&with_other_weights(seed, &paths)).unwrap();
        assert!(!matches!(change, Change::Settings(_)), "seed {seed}");
        changed.run(400);
        let ((plain, plain_rings), (changed, changed_rings)) = (plain.end(), changed.end());
        for ((node, (path, plain)), (_, changed)) in nodes.ids().zip(&plain).zip(&changed) {
            assert_eq!(plain.len(), changed.len(), "seed {seed}: {path}");
            if changing.iter().any(|from| *from == node || graph.reaches(*from, node)) {
                other += usize::from(plain != changed);
            } else {
                same += 1;
                assert!(plain == changed, "seed {seed}: {path}");
            }
        }
        assert_eq!(plain_rings, changed_rings, "seed {seed}");
        rings += plain_rings.len();
    }
    assert!(same > 20 && other > 10 && rings > 15, "{same} nodes stayed, {other} changed, {rings} rings");
}

#[test]
fn rings_come_and_go_and_those_that_stay_are_not_disturbed() {
    let mut tried = 0;
    for (seed, less) in quiet_graphs() {
        let Some(more) = with_rings_more(seed) else {
            continue;
        };
        tried += 1;
        let mut plain = Driven::new(&less);
        plain.run(900);
        let (plain, plain_rings) = plain.end();
        let mut changed = Driven::new(&less);
        changed.run(200);
        changed.change(&more).unwrap();
        changed.run(400);
        let with_more: Vec<RingReport> = changed.session.rings().collect();
        assert_eq!(with_more.len(), plain_rings.len() + 2, "seed {seed}");
        for ring in &with_more {
            assert_eq!(troubles(ring), (0, 0, 0), "seed {seed}: {ring:?}");
            let (least_s, most_s) = ring.counts.range_s.unwrap();
            assert!(most_s < 2.0 * ring.latency_s && least_s > 0.0, "seed {seed}: {ring:?}");
        }
        changed.change(&random_graph_with_drivers(seed)).unwrap();
        changed.run(300);
        let (changed, changed_rings) = changed.end();
        assert!(plain == changed, "seed {seed}");
        assert_eq!(plain_rings, changed_rings, "seed {seed}");
    }
    assert!(tried >= 5, "rings came to {tried} graphs");
}

/// Bodies and what drives them too: no driver but that one fades.
#[test]
fn a_node_that_comes_to_one_driver_interrupts_no_other() {
    let (mut driven_by_others, mut interrupted) = (0, 0);
    for (seed, graph) in graphs() {
        let body = graph.devices.first().map(|device| graph.clocks[device.clock].driver);
        for driver in graph.drivers() {
            let mut plain = Driven::new(&graph);
            plain.run(300);
            let mut changed = Driven::new(&graph);
            changed.run(150);
            let more = with_a_node_more(seed, driver);
            let change = changed.change(&more).unwrap();
            if body != Some(driver) {
                // Of a driver without rings two plans can run together.
                assert!(matches!(change, Change::AtOnce | Change::CrossFade), "seed {seed}");
            }
            changed.run(150);
            let same = plain.end() == changed.end();
            if body == Some(driver) {
                interrupted += usize::from(!same);
            } else {
                assert!(same, "seed {seed}, driver {driver}");
                driven_by_others += usize::from(body.is_some());
            }
        }
    }
    assert!(driven_by_others > 5 && interrupted > 3, "{driven_by_others}, {interrupted}");
}

#[test]
fn a_hundred_graphs_come_home() {
    let (seed, graph) = quiet_graphs().next().unwrap();
    let everything: Vec<String> = graph.nodes.node_weights().map(|node| node.path.clone()).collect();
    let mut driven = Driven::new(&graph);
    for number in 0..100 {
        let paths = if number % 2 == 0 { &everything[..] } else { &[] };
        driven.change(&with_other_weights(seed, paths)).unwrap();
        driven.run(30);
    }
    // A driver at 48 Hz takes its time.
    driven.run(3000);
    let drivers = driven.lives.len() as u64;
    assert_eq!(driven.session.freed(), 100 * drivers);
    assert!(driven.lives.iter().all(|live| live.unreported() == 0));
}

#[test]
fn what_is_refused_changes_nothing() {
    let (seed, graph) = quiet_graphs().next().unwrap();
    let mut plain = Driven::new(&graph);
    plain.run(200);
    let mut driven = Driven::new(&graph);
    driven.run(100);
    let mut all = graphs();
    let (_, stranger) = all.find(|(_, other)| other.drivers().len() != graph.drivers().len()).unwrap();
    let refused = driven.change(&stranger).unwrap_err();
    assert!(matches!(refused, ChangeError::OtherDrivers { .. }), "{refused}");
    let mut renamed = random_graph_with_drivers(seed);
    let driver = renamed.drivers()[1];
    renamed.clocks[driver].name = "renamed".to_owned();
    let refused = driven.change(&renamed).unwrap_err().to_string();
    assert!(refused.contains("renamed at") && refused.contains("c0 at"), "{refused}");
    driven.run(100);
    assert!(plain.end() == driven.end());
}

#[test]
fn a_driver_that_does_not_listen_keeps_the_others_from_changing_too() {
    let (seed, mut graph) = quiet_graphs().next().unwrap();
    let driver = graph.drivers().last().copied();
    let mut nodes = graph.nodes.node_indices();
    let last = nodes.rfind(|node| graph.driver_of(id_of(*node)) == driver).unwrap();
    graph.nodes[last].live.push((SettingId::at(0), 0.7));
    let name = format!("{}.gain", graph.nodes[last].path);
    let everything: Vec<String> = graph.nodes.node_weights().map(|node| node.path.clone()).collect();
    let heard = [false, true].map(|changes| {
        let mut driven = Driven::new(&graph);
        driven.run(100);
        while driven.session.set_by_name(&name, 0.5).is_ok() {}
        if changes {
            let refused = driven.change(&with_other_weights(seed, &everything)).unwrap_err();
            assert!(matches!(refused, ChangeError::Control(ControlError::Full)), "{refused}");
        }
        driven.run(100);
        driven.end()
    });
    assert!(heard[0] == heard[1]);
}
