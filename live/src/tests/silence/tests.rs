//! A live run whose input fell silent, and its replay: the same bits, and nothing of a forged log.

use super::{link, press};
use haptograph_engine::document::Document;
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::node::FrameWriter;
use haptograph_engine::run::{
    FileSinks, OfflineError, Probe, ReplayBounds, ReplayError, Session, SessionOptions,
};
use std::path::Path;
use std::sync::{Arc, Mutex};

type Bits = Arc<Mutex<Vec<u64>>>;

struct Heard(Bits);

impl FrameWriter for Heard {
    fn write(&mut self, _: usize, frames: &[f64]) -> std::io::Result<()> {
        self.0.lock().unwrap().extend(frames.iter().map(|x| x.to_bits()));
        Ok(())
    }
    fn finish(self: Box<Self>) -> std::io::Result<()> {
        Ok(())
    }
}

/// The actuator is on a driver of its own where there are two.
fn graph(listen: &str, two: bool) -> Graph {
    let (clocks, sum, bias) = match two {
        true => (
            r#", "audio": Driver(rate_hz: 8000)"#,
            r#"Add(clock: "audio", inputs: [Ring(from: "felt", latency_ms: 20), "bias"])"#,
            "audio",
        ),
        false => ("", r#"Add(inputs: ["felt", "bias"])"#, "servo"),
    };
    let text = format!(
        r#"Graph(format: 1, clocks: {{ "servo": Driver(rate_hz: 1000){clocks} }},
        nodes: {{
            "stylus": Tablet(clock: "servo", endpoint: "stylus"),
            "felt": Calibrate(input: "stylus.force", from: "force", to: "current", factor: 0.1),
            "bias": Constant(clock: "{bias}", value: 0.4, quantity: "current"),
            "sum": {sum},
            "out": ActuatorSink(current: "sum", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
        }},
        endpoints: {{ "simulated": {{ "stylus": UdpDevice(listen: "{listen}"), "coil": SimulatedHaptuator() }} }})"#
    );
    let document = Document::parse("g.ron", &text).unwrap();
    check(&document, &haptograph_nodes::registry(), &CheckOptions::default())
        .unwrap_or_else(|wrong| panic!("{wrong}"))
}

/// What the stylus felt and what the actuator was given.
fn listening(graph: &Graph) -> (FileSinks<'_>, [Bits; 2]) {
    let mut outlets = FileSinks::new(graph);
    let bits: [Bits; 2] = [Bits::default(), Bits::default()];
    for (path, bits) in ["felt", "out"].iter().zip(&bits) {
        let node = graph.nodes().find(path).unwrap();
        let writer = Box::new(Heard(Arc::clone(bits)));
        outlets.probe(Probe { node, output: 0, writer });
    }
    (outlets, bits)
}

fn taken(bits: &[Bits; 2]) -> [Vec<u64>; 2] {
    bits.clone().map(|bits| bits.lock().unwrap().clone())
}

/// Speaks from a wake on, falls silent, and comes back; then it is stopped.
fn live_run(graph: &Graph, from: usize, folder: &Path) -> [Vec<u64>; 2] {
    let (outlets, bits) = listening(graph);
    let stylus = link(graph, "stylus");
    let (mut lives, mut session) =
        Session::open_all(outlets, &SessionOptions::default(), Some(folder)).unwrap();
    let rates: Vec<usize> = lives.iter().map(|live| live.run().rate_hz() as usize).collect();
    for wake in 0..400_usize {
        if !(150..280).contains(&wake) && wake % 7 < 3 && wake >= from {
            press(&stylus, 1.0 + 0.001 * wake as f64);
        }
        if wake == 380 {
            session.stop();
        }
        for (live, rate_hz) in lives.iter_mut().zip(&rates) {
            // Wakes of all lengths, some of nothing.
            let due = |wake: usize| (wake + wake % 3) * rate_hz / 1000;
            live.process(due(wake + 1).saturating_sub(due(wake)));
        }
        session.poll();
    }
    let ended = session.finish_all(lives);
    assert_eq!((ended.lost_arrivals, ended.lost_numbers), (0, 0));
    taken(&bits)
}

fn replay(graph: &Graph, block: usize, folder: &Path) -> Result<[Vec<u64>; 2], OfflineError> {
    let (outlets, bits) = listening(graph);
    let bounds = ReplayBounds::new(3.0);
    Session::replay(outlets, (folder, &bounds), &SessionOptions::default().block(block), &mut |_| {})?;
    Ok(taken(&bits))
}

#[test]
fn a_run_whose_input_fell_silent_is_repeated_bit_for_bit() {
    // The last two are heard before their first frame.
    for (listen, two, from) in [
        ("127.0.0.1:61761", false, 21),
        ("127.0.0.1:61762", true, 21),
        ("127.0.0.1:61764", false, 0),
        ("127.0.0.1:61765", true, 0),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let graph = graph(listen, two);
        let live = live_run(&graph, from, folder.path());
        // It was driven, it was not, and it was again.
        let [_, out] = &live;
        let last_zero = out[..out.len() - out.len() / 10].iter().rposition(|bits| *bits == 0);
        let first_drive = out.iter().position(|bits| *bits != 0);
        assert!(first_drive.unwrap() + 100 < last_zero.unwrap() && last_zero.unwrap() + 100 < out.len());
        for block in [1, 13, 64] {
            assert!(replay(&graph, block, folder.path()).unwrap() == live, "{two}, block {block}");
        }
        // It hangs on when the silence ended.
        let path = { ["arrivals/0.csv", "arrivals/1.csv"] }
            .map(|name| folder.path().join(name))
            .into_iter()
            .find(|path| std::fs::read_to_string(path).is_ok_and(|text| text.contains("open out")));
        let path = path.unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        let is_open = |line: &String| line.split(',').nth(2) == Some("1");
        let last_closed = lines.iter().rposition(|line| !is_open(line)).unwrap();
        for line in &mut lines[last_closed - 5..=last_closed] {
            let mut cells: Vec<&str> = line.split(',').collect();
            cells[2] = "1";
            *line = cells.join(",");
        }
        std::fs::write(&path, lines.join("\n") + "\n").unwrap();
        assert!(replay(&graph, 64, folder.path()).unwrap() != live);
    }
}

#[test]
fn what_no_device_can_have_sensed_is_refused_at_its_line() {
    let listen = "127.0.0.1:61763";
    let folder = tempfile::tempdir().unwrap();
    let graph = graph(listen, false);
    live_run(&graph, 21, folder.path());
    let logs = std::fs::read_dir(folder.path().join("arrivals")).unwrap();
    let mut logs = logs.map(|entry| entry.unwrap().path());
    let path = logs.find(|path| path.to_string_lossy().contains(".input-")).unwrap();
    let right = std::fs::read_to_string(&path).unwrap();
    let columns = right.lines().next().unwrap().split(',').count();
    let zeros = ",0".repeat(columns - 2);
    for wrong in [
        format!("2,NaN{zeros}"),
        format!("2,inf{zeros}"),
        format!("2,-1e8{zeros}"),
        format!("2,1e300{zeros}"),
        format!("0,0{zeros}"),
        format!("4000,0{zeros}"),
        format!("18446744073709551616,0{zeros}"),
        format!("-1,0{zeros}"),
        "2".to_owned(),
        format!("2,0{zeros},0"),
        "2,".repeat(1 << 17),
    ] {
        let mut lines: Vec<&str> = right.lines().take(2).collect();
        lines.push(&wrong);
        std::fs::write(&path, lines.join("\n") + "\n").unwrap();
        let refused = replay(&graph, 64, folder.path());
        assert!(
            matches!(
                refused,
                Err(OfflineError::Replay(
                    ReplayError::Implausible { line: 3, .. } | ReplayError::Line { line: 3, .. }
                ))
            ),
            "{wrong:.40}: {refused:?}"
        );
    }
}
