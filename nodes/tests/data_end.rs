//! Where the data of a source end, the run does what the source says, to the frame.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::run::{FileSinks, Outcome, Session, SessionOptions};
use haptograph_nodes::wav::{Format, WavWriter};
use std::fs::{self, File};
use std::path::Path;

/// A driver of 1 kHz and a slower clock of 300 Hz; a file of 37 samples at the latter.
fn graph(folder: &Path, at_end: &str) -> Graph {
    let format = Format { channels: 1, rate_hz: 300 };
    let mut writer = WavWriter::new(File::create(folder.join("x.wav")).unwrap(), format).unwrap();
    for sample in 1..=37_u8 {
        writer.write(&[sample.into()]).unwrap();
    }
    writer.finish().unwrap();
    let text = format!(
        r#"Graph(format: 1, clocks: {{ "fast": Driver(rate_hz: 1000), "slow": Derived(of: "fast", rate_hz: 300) }}, nodes: {{
            "played": WavSource(clock: "slow", file: "x.wav"{at_end}),
            "tone": Sine(clock: "fast", frequency_hz: 100),
            "played file": WavSink(input: "played", file: "played.wav"),
            "tone file": WavSink(input: "tone", file: "tone.wav"),
        }})"#
    );
    let path = folder.join("graph.ron");
    fs::write(&path, text).unwrap();
    let document = Document::load(path, &LoadOptions::default()).unwrap_or_else(|wrong| panic!("{wrong}"));
    let options = CheckOptions::default();
    check(&document, &haptograph_nodes::registry(), &options).unwrap_or_else(|wrong| panic!("{wrong}"))
}

/// What the run did, and the samples of both files.
fn run(graph: &Graph, block: usize) -> (Outcome, [Vec<f32>; 2]) {
    let folder = tempfile::tempdir().unwrap();
    let mut outlets = FileSinks::new(graph);
    outlets.open_files(folder.path()).unwrap();
    let options = SessionOptions::default().block(block).seconds(0.5);
    let outcome = Session::run_offline(outlets, &options, &mut |_| {}).unwrap();
    let samples = ["played.wav", "tone.wav"].map(|file| {
        let mut reader = hound::WavReader::open(folder.path().join(file)).unwrap();
        reader.samples::<f32>().map(Result::unwrap).collect()
    });
    (outcome, samples)
}

#[test]
fn the_run_ends_with_the_data_to_the_frame_whatever_the_block() {
    let folder = tempfile::tempdir().unwrap();
    let graph = graph(folder.path(), "");
    // Tick 37 of the slow clock would come at 123.3 ms: the last frame before it is number 123.
    for block in [1, 7, 16, 64, 123, 1024] {
        let (outcome, [played, tone]) = run(&graph, block);
        assert_eq!((outcome.driver_frames, outcome.stopped), (123, false), "{block}");
        assert_eq!((played.len(), tone.len()), (37, 123), "{block}");
        assert_eq!(played.last(), Some(&37.0));
    }
}

#[test]
fn the_run_goes_on_where_the_graph_asks_for_it() {
    let folder = tempfile::tempdir().unwrap();
    for (at_end, follows) in [("Hold", [37.0, 37.0]), ("Silence", [0.0, 0.0]), ("Loop", [1.0, 2.0])] {
        let graph = graph(folder.path(), &format!(", at_end: {at_end}"));
        let (outcome, [played, _]) = run(&graph, 64);
        assert_eq!((outcome.driver_frames, played.len()), (500, 150));
        assert_eq!(played[36..39], [37.0, follows[0], follows[1]], "{at_end}");
        assert_eq!(graph.data_ends().count(), usize::from(at_end != "Loop"));
    }
}
