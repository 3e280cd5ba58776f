//! Live runs, mostly of several drivers, their callbacks at scripted moments, and their replays.

use super::virtual_clock::{all_bits, graphs, listening};
use super::world::{random_graph, random_graph_with_drivers};
use crate::graph::fingerprint::VERSION;
use crate::graph::{Bridge, Graph, Work};
use crate::node::SettingId;
use crate::run::{Change, OfflineError, PlayerState, ReplayBounds, ReplayError, Session, SessionOptions};
use petgraph::graph::NodeIndex;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::path::{Path, PathBuf};

/// A folder of its own that is gone afterwards.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("haptograph-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// All of its leaky nodes can be set while it runs.
fn settable(mut graph: Graph) -> Graph {
    for node in graph.nodes.node_weights_mut() {
        if let Work::Process(_) = node.work {
            node.live.push((SettingId::at(0), 0.7));
            node.live.push((SettingId::at(0).with_item(1), 0.3));
        }
    }
    graph
}

/// What was heard of a run whose drivers wake at random, stall, are set and stopped; and how often a ring ran dry or
/// over.
fn live_run(graph: &Graph, seed: u64, folder: &Path) -> (Vec<Vec<u64>>, u64) {
    let (file_sinks, heard) = listening(graph);
    let options = SessionOptions { block: 32, rested: true, ..SessionOptions::default() };
    let (mut lives, mut session) = Session::open_all(file_sinks, &options, Some(folder)).unwrap();
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let rates: Vec<f64> = lives.iter().map(|live| live.run().rate_hz()).collect();
    let mut wakes = 0;
    let mut done = vec![0_u64; lives.len()];
    let settings: Vec<String> = session.settings().map(|live| live.name()).collect();
    while lives.iter().any(|live| live.state() == PlayerState::Running) {
        wakes += 1;
        // Less than what is on its way to the writing thread may last, however slow that is.
        assert!(wakes < 1000, "it does not stop");
        if wakes == 850 {
            session.stop();
        }
        // Often enough that one leaves while it is still on its way.
        if wakes < 700 && !settings.is_empty() && random.random_bool(0.1) {
            let name = &settings[random.random_range(0..settings.len())];
            session.set_by_name(name, random.random_range(0.0..0.9)).unwrap();
        }
        let now_s = f64::from(wakes) * 1e-3;
        for (driver, live) in lives.iter_mut().enumerate() {
            // One of them stands still for a while; the others are late now and then, and then make up for it.
            let stalls = driver == 0 && (450..600).contains(&wakes);
            if stalls || random.random_bool(0.3) {
                continue;
            }
            if [200, 205, 600].contains(&wakes) {
                live.resume();
            }
            let due = (now_s * rates[driver]) as u64;
            live.process((due - done[driver]) as usize);
            done[driver] = due;
        }
    }
    let ended = session.finish_all(lives);
    assert_eq!((ended.lost_numbers, ended.lost_arrivals), (0, 0));
    assert!(ended.failed.is_empty());
    let troubles = ended.outcome.rings.iter().map(|ring| ring.counts.underruns + ring.counts.overruns);
    (all_bits(&heard), troubles.sum())
}

fn replay(graph: &Graph, block: usize, folder: &Path) -> Result<Vec<Vec<u64>>, OfflineError> {
    let (file_sinks, heard) = listening(graph);
    Session::replay(
        file_sinks,
        (folder, &ReplayBounds::default()),
        &SessionOptions::default().block(block),
        &mut |_| {},
    )?;
    Ok(all_bits(&heard))
}

#[test]
fn a_replay_gives_the_bits_of_the_live_run() {
    let mut troubles = 0;
    for (seed, graph) in graphs().take(10) {
        let folder = Folder::new(&format!("replay-{seed}"));
        let (heard, more) = live_run(&graph, seed, &folder.0);
        troubles += more;
        for block in [1, 64] {
            assert!(replay(&graph, block, &folder.0).unwrap() == heard, "seed {seed}, block {block}");
        }
    }
    assert!(troubles > 0, "no ring ever ran dry or over: the easy case only");
}

#[test]
fn what_was_set_while_it_ran_is_repeated_too() {
    let alone = (0..4).map(|seed| (seed, random_graph(seed, seed)));
    for (seed, graph) in graphs().take(6).chain(alone) {
        let graph = settable(graph);
        let folder = Folder::new(&format!("set-{}-{seed}", graph.drivers().len()));
        let (heard, _) = live_run(&graph, seed, &folder.0);
        for block in [1, 7, 64] {
            assert!(replay(&graph, block, &folder.0).unwrap() == heard, "seed {seed}, block {block}");
        }
        // It hangs on every line.
        for driver in 0..graph.drivers().len() {
            let path = folder.0.join(format!("arrivals/{driver}.settings.csv"));
            let text = std::fs::read_to_string(&path).unwrap();
            let Some((earlier, _)) = text.trim_end().rsplit_once('\n') else {
                continue;
            };
            std::fs::write(&path, earlier).unwrap();
            assert!(replay(&graph, 64, &folder.0).unwrap() != heard, "seed {seed}, {}", path.display());
            std::fs::write(&path, text).unwrap();
        }
    }
}

#[test]
fn a_replay_ends_where_another_graph_took_over() {
    let alone = (0..4).map(|seed| (seed, [0, 1].map(|_| random_graph(seed, seed))));
    let several = graphs().take(6).map(|(seed, graph)| (seed, [graph, random_graph_with_drivers(seed)]));
    for (seed, [graph, other]) in alone.chain(several) {
        let (graph, mut other) = (settable(graph), settable(other));
        other.nodes.node_weights_mut().for_each(|node| node.fingerprint += 1);
        let folder = Folder::new(&format!("ends-{}-{seed}", graph.drivers().len()));
        let (file_sinks, heard) = listening(&graph);
        let (mut lives, mut session) =
            Session::open_all(file_sinks, &SessionOptions::default(), Some(&folder.0)).unwrap();
        let setting = session.settings().next().unwrap().name();
        for wake in 0..20 {
            session.set_by_name(&setting, 0.04 * f64::from(wake)).unwrap();
            if wake == 10 {
                let changed = session.change(&other, &folder.0).unwrap();
                assert!(!matches!(changed.change, Change::Settings(_)), "seed {seed}");
            }
            for live in &mut lives {
                let due = f64::from(wake + 1) * 0.037 * live.run().rate_hz();
                live.process((due as u64 - live.frames()) as usize);
            }
        }
        session.finish_all(lives);
        let (live, again) = (all_bits(&heard), replay(&graph, 64, &folder.0).unwrap());
        for (node, (live, again)) in graph.nodes.node_weights().zip(live.iter().zip(&again)) {
            assert!(live.starts_with(again), "seed {seed}: {}", node.path);
            let expected = graph.clocks[node.clock.unwrap()].rate.hz() * 0.37;
            assert!(
                (again.len() as f64 - expected).abs() <= 1.0,
                "seed {seed}: {} frames of {expected}",
                again.len()
            );
        }
    }
}

#[test]
fn a_replay_says_what_it_cannot_repeat() {
    let (seed, graph) = graphs().next().unwrap();
    let folder = Folder::new("wrong-replay");
    live_run(&graph, seed, &folder.0);
    let path = folder.0.join("arrivals/0.csv");
    let right = std::fs::read_to_string(&path).unwrap();
    let with = |text: &str| {
        std::fs::write(&path, text).unwrap();
        replay(&graph, 64, &folder.0).unwrap_err()
    };
    let wrong = with(&right.replacen("frames", "shoes", 1));
    assert!(matches!(wrong, OfflineError::Replay(ReplayError::OtherGraph { .. })), "{wrong}");
    for line in ["1", "1,0,x", ""] {
        let wrong = with(&format!("{right}{line}\n"));
        assert!(matches!(wrong, OfflineError::Replay(ReplayError::Line { .. })), "{wrong}");
    }
    let columns = right.lines().next().unwrap().split(',').count();
    let impossible = vec!["4000000000"; columns - 2].join(",");
    let wrong = with(&format!("{right}1,1,{impossible}\n"));
    assert!(matches!(wrong, OfflineError::Replay(ReplayError::Contradiction { .. })), "{wrong}");
    std::fs::write(&path, right).unwrap();
    let settings = folder.0.join("arrivals/0.settings.csv");
    for line in ["1,2,3", "1,0.5,0.7,20,nobody.gain", "x,0.5,0.7,20,n00.gain"] {
        std::fs::write(&settings, format!("frame,from,to,glide frames,setting\n{line}\n")).unwrap();
        let wrong = replay(&graph, 64, &folder.0).unwrap_err();
        assert!(matches!(wrong, OfflineError::Replay(ReplayError::Setting { line: 2, .. })), "{wrong}");
    }
    std::fs::remove_file(&path).unwrap();
    let wrong = replay(&graph, 64, &folder.0).unwrap_err();
    assert!(matches!(wrong, OfflineError::Replay(ReplayError::Read { .. })), "{wrong}");
}

/// Where a log of a run of this graph is refused, as not of the run or as no line at all.
fn refused_at(graph: &Graph, folder: &Path, bounds: &ReplayBounds) -> Option<usize> {
    let (file_sinks, _) = listening(graph);
    let replayed =
        Session::replay(file_sinks, (folder, bounds), &SessionOptions::default().block(64), &mut |_| {});
    match replayed.err()? {
        OfflineError::Replay(ReplayError::Implausible { line, .. } | ReplayError::Line { line, .. }) => {
            Some(line)
        }
        other => panic!("{other}"),
    }
}

#[test]
fn damaged_and_forged_callbacks_are_refused_at_their_line() {
    let (seed, graph) = graphs().next().unwrap();
    let folder = Folder::new("forged-callbacks");
    live_run(&graph, seed, &folder.0);
    let path = folder.0.join("arrivals/0.csv");
    let right = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<&str> = right.lines().collect();
    let columns = lines[0].split(',').count();
    let zeros = ",0".repeat(columns - 2);
    let total = lines[1..].iter().map(|line| line.split(',').next().unwrap().parse::<u64>().unwrap());
    let (total, end) = (total.sum::<u64>(), lines.len());
    let whole = ReplayBounds { longest_s: 2.0, frames: Some((total, true)) };
    assert_eq!(refused_at(&graph, &folder.0, &whole), None);
    let with = |text: &[u8]| {
        std::fs::write(&path, text).unwrap();
        refused_at(&graph, &folder.0, &whole)
    };
    let third = |line: &str| {
        let mut lines = lines.clone();
        lines[2] = line;
        with((lines.join("\n") + "\n").as_bytes())
    };
    for line in [
        format!("4294967295,0{zeros}"),
        format!("4294967296,0{zeros}"),
        format!("-1,0{zeros}"),
        format!("1e3,0{zeros}"),
        format!("1,4{zeros}"),
        // It has no such device.
        format!("99,3{zeros}"),
        format!("1,0{zeros},0"),
        "9".repeat(1 << 20),
        ",".repeat(1 << 12),
        "\0\0\0".to_owned(),
        String::new(),
    ] {
        assert_eq!(third(&line), Some(3), "{line:.40}");
    }
    let longer = |more: &[u8]| with(&[right.as_bytes(), more].concat());
    assert_eq!(longer(b"\xff\xfe\n"), Some(end + 1));
    // It was faded out; another graph took over.
    assert_eq!(longer(format!("0,0{zeros}\n").as_bytes()), Some(end + 1));
    assert_eq!(longer(format!("0,2{zeros}\n0,2{zeros}\n").as_bytes()), Some(end + 2));
    assert_eq!(longer(format!("1,1{zeros}\n").as_bytes()), Some(end + 1));
    let many = format!("0,1{zeros}\n").repeat(200_000);
    assert!(longer(many.as_bytes()).is_some_and(|line| line < 100_000));
    assert_eq!(with((lines[..end - 20].join("\n") + "\n").as_bytes()), Some(end - 20));
}

#[test]
fn forged_settings_are_refused_at_their_line() {
    let (seed, graph) = graphs().next().unwrap();
    let graph = settable(graph);
    let folder = Folder::new("forged-settings");
    live_run(&graph, seed, &folder.0);
    let path = folder.0.join("arrivals/0.settings.csv");
    let right = std::fs::read_to_string(&path).unwrap();
    let (header, rest) = right.split_once('\n').unwrap();
    let name = rest.lines().next().unwrap().rsplit(',').next().unwrap();
    for lines in [
        format!("9,0.5,0.7,20,{name}\n8,0.5,0.7,20,{name}"),
        format!("1,0.5,0.7,20,{name}\n18446744073709551615,0.5,0.7,20,{name}"),
        format!("1,0.5,0.7,20,{name}\n1,0.5,0.7,18446744073709551615,{name}"),
    ] {
        std::fs::write(&path, format!("{header}\n{lines}\n")).unwrap();
        let refused = refused_at(&graph, &folder.0, &ReplayBounds::default());
        assert_eq!(refused, Some(3), "{lines}");
    }
}

/// The run's graph after one change, and what is then refused.
fn refused(change: impl Fn(&mut Graph)) -> String {
    let (seed, graph) = graphs().next().unwrap();
    let folder = Folder::new(&format!("changed-{:?}", std::thread::current().id()));
    live_run(&graph, seed, &folder.0);
    let (_, mut changed) = graphs().next().unwrap();
    assert!(replay(&changed, 64, &folder.0).is_ok());
    change(&mut changed);
    let wrong = replay(&changed, 64, &folder.0).unwrap_err();
    assert!(matches!(wrong, OfflineError::Replay(ReplayError::Changed { .. })), "{wrong}");
    wrong.to_string()
}

#[test]
fn a_replay_refuses_fingerprints_of_another_version() {
    let (seed, graph) = graphs().next().unwrap();
    let folder = Folder::new("other-version");
    live_run(&graph, seed, &folder.0);
    let path = folder.0.join("arrivals/graph.txt");
    let right = std::fs::read_to_string(&path).unwrap();
    let version = |number: u64| format!("{number:016x} version of these fingerprints\n");
    for (written, expected) in [(version(1), "1"), (version(99), "99"), (String::new(), "unknown")] {
        let older = right.replacen(&version(VERSION), &written, 1);
        assert_ne!(older, right);
        std::fs::write(&path, older).unwrap();
        match replay(&graph, 64, &folder.0).unwrap_err() {
            OfflineError::Replay(ReplayError::OtherVersion { found, .. }) => assert_eq!(found, expected),
            wrong => panic!("{wrong}"),
        }
    }
    std::fs::write(&path, right).unwrap();
    assert!(replay(&graph, 64, &folder.0).is_ok());
}

#[test]
fn a_replay_refuses_a_graph_that_would_give_other_samples() {
    let told = refused(|graph| {
        let rings = graph.nodes.edge_weights_mut().find_map(|edge| match &mut edge.bridge {
            Bridge::Ring { latency_s } => Some(latency_s),
            _ => None,
        });
        *rings.unwrap() += 1e-3;
    });
    assert!(told.contains("`connection ") && told.contains("differs"), "{told}");
    assert!(!told.contains("node ") && !told.contains("clock "), "{told}");
    let told = refused(|graph| graph.nodes[NodeIndex::new(0)].fingerprint += 1);
    assert!(told.contains("`node ") && !told.contains("connection "), "{told}");
    let told = refused(|graph| graph.nodes[NodeIndex::new(0)].live.push((SettingId::at(0), 0.3)));
    assert!(told.contains("`node "), "{told}");
    let told = refused(|graph| graph.nodes[NodeIndex::new(0)].path = "renamed".to_owned());
    assert!(told.contains("`node renamed` is new") && told.contains("is missing"), "{told}");
    assert!(refused(|graph| graph.seed += 1).contains("`seed` differs"));
}
