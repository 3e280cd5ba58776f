//! Graph files through the front door: right ones become graphs, wrong ones say what is wrong.
//!
//! Every `tests/wrong/*.ron` has beside it what is printed for it; `BLESS=1 cargo test` writes these anew, to be
//! read before they are committed. A first line `// --set a=1 --endpoints live` gives options.

mod common;
#[path = "common/golden.rs"]
mod golden;

use haptograph_engine::bridges::{BridgeContext, BridgeEntry, BridgeSpec, BridgeType, Ends, Hold, Resample};
use haptograph_engine::device::{Channel, DeviceSpec};
use haptograph_engine::diagnostic::{Diagnostics, render, to_json};
use haptograph_engine::document::{Builder, Document, LoadOptions, Part, delay, hold, ring};
use haptograph_engine::frame::{Kind, KindSpec};
use haptograph_engine::graph::{Bridge, CheckOptions, Graph, check};
use haptograph_engine::node::Latency;
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::registry::Registry;
use haptograph_engine::run::Run;
use haptograph_signal::files::Roots;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::Rate;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn options_of(text: &str) -> CheckOptions {
    let mut options = CheckOptions::default();
    let line = text.lines().next().unwrap_or_default();
    let mut words = line.strip_prefix("// ").unwrap_or_default().split_whitespace();
    while let Some(word) = words.next() {
        let mut value = || words.next().expect("a value").to_owned();
        match word {
            "--set" => {
                let pair = value();
                let (name, value) = pair.split_once('=').expect("NAME=VALUE");
                options.set.push((name.into(), value.into()));
            }
            "--endpoints" => options.endpoints = value(),
            _ => break,
        }
    }
    options
}

fn load(path: &Path) -> Result<Graph, Diagnostics> {
    let options = std::fs::read_to_string(path).map(|text| options_of(&text)).unwrap_or_default();
    let document = Document::load(path, &LoadOptions::default())?;
    check(&document, &common::registry(), &options)
}

fn files(folder: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect(folder);
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "ron"))
        .collect();
    files.sort();
    files
}

#[test]
fn a_computed_value_is_the_number_it_comes_to() {
    let text = |rate: &str, gain: &str, part: &str| {
        format!(
            r#"Graph(
                format: 1, include: ["std/tones.ron"],
                parameters: {{ "whole": 3.0, "half": Expr("whole / 2") }},
                clocks: {{ "audio": Driver(rate_hz: {rate}) }},
                nodes: {{
                    "tone": Sine(clock: "audio", frequency_hz: Param("half")),
                    "a": Gain(input: "tone", gain: {gain}),
                    "b": Halved(input: "a", part: {part}),
                    "file": Wav(inputs: ["b"], file: "out.wav"),
                }},
            )"#
        )
    };
    let graph = |text: &str, set: &[(&str, &str)]| {
        let options = CheckOptions::default();
        let options = set.iter().fold(options, |options, (name, value)| options.set(*name, *value));
        let document = Document::parse("computed.ron", text).unwrap_or_else(|d| panic!("{d}"));
        check(&document, &common::registry(), &options).unwrap_or_else(|d| panic!("{d}"))
    };
    let live = |graph: &Graph| -> Vec<f64> {
        let nodes = graph.nodes().iter();
        nodes.flat_map(|node| node.live.iter().map(|(_, value)| *value)).collect()
    };
    let computed = text("Expr(\"2^4 * 3000\")", "Expr(\"whole * -0.5\")", "Expr(\"whole + half\")");
    let found = graph(&computed, &[]);
    assert_eq!(found.clocks()[0].rate.hz(), 48_000.0);
    let mut values = live(&found);
    values.sort_by(f64::total_cmp);
    assert_eq!(values, [-1.5, 1.5, 2.25]);
    let mut values = live(&graph(&computed, &[("whole", "8")]));
    values.sort_by(f64::total_cmp);
    assert_eq!(values, [-4.0, 4.0, 6.0]);
    let written = graph(&text("48000", "-1.5", "4.5"), &[]);
    assert_eq!(live(&written), live(&found));
}

#[test]
fn right_graphs_are_sound_and_without_warnings() {
    for path in files("tests/right") {
        match load(&path) {
            Ok(graph) => assert!(graph.warnings().is_empty(), "{}: {:?}", path.display(), graph.warnings()),
            Err(diagnostics) => panic!("{diagnostics}"),
        }
    }
}

/// A stylus that is there with some endpoints only, what reads it, and a parameter that begins elsewhere with others.
const BY_ENDPOINTS: &str = r#"Graph(
    format: 1,
    parameters: { "frequency_hz": 440.0 },
    defaults: { "live": { "frequency_hz": 100.0 } },
    clocks: { "audio": Driver(rate_hz: 48000), "slow": Derived(of: "audio", rate_hz: 1000) },
    nodes: {
        "pen": Stylus(clock: "slow", endpoint: "stylus", only: "simulated"),
        "loud": Gain(input: "pen.force", gain: 2),
        "tone": Sine(clock: "slow", frequency_hz: Param("frequency_hz")),
        "both": Wav(inputs: ["loud", "tone"], file: "both.wav"),
        "one": Wav(inputs: ["loud"], file: "one.wav"),
    },
    endpoints: { "simulated": { "stylus": Tablet() }, "live": {} },
)"#;

#[test]
fn a_node_of_other_endpoints_is_left_out_with_what_depends_on_it() {
    let document = Document::parse("g.ron", BY_ENDPOINTS).expect("a document");
    let paths = |endpoints: &str| -> Vec<String> {
        let options = CheckOptions::default().endpoints(endpoints);
        let graph = check(&document, &common::registry(), &options).unwrap_or_else(|wrong| panic!("{wrong}"));
        assert!(graph.warnings().is_empty());
        graph.nodes().iter().map(|node| node.path.clone()).collect()
    };
    assert_eq!(paths("simulated"), ["pen", "loud", "tone", "both", "one"]);
    // A file of several signals goes on with those that are left.
    assert_eq!(paths("live"), ["tone", "both"]);
}

#[test]
fn sets_and_parameters_that_are_not_there_are_refused() {
    let text = BY_ENDPOINTS.replace("only: \"simulated\"", "only: \"simulatd\"").replace(
        "{ \"live\": { \"frequency_hz\": 100.0 } }",
        "{ \"live\": { \"frequency\": 1 }, \"lively\": {} }",
    );
    let document = Document::parse("g.ron", &text).expect("a document");
    let checked = check(&document, &common::registry(), &CheckOptions::default());
    let Err(found) = checked else { panic!("it is sound") };
    let codes: Vec<&str> = found.list.iter().map(|diagnostic| diagnostic.code).collect();
    assert_eq!(codes, ["E0209", "E0210", "E0210"]);
}

#[test]
fn a_chosen_set_of_endpoints_has_to_be_there_whoever_has_the_endpoints() {
    let none =
        "Graph(format: 1, clocks: { \"c\": Driver(rate_hz: 1000) }, nodes: { \"tone\": Sine(clock: \"c\") })";
    for (text, set, is_there) in [
        (BY_ENDPOINTS, "simulated", true),
        (BY_ENDPOINTS, "live", true),
        (BY_ENDPOINTS, "lvie", false),
        // The default asks for nothing.
        (none, "simulated", true),
        (none, "live", false),
    ] {
        let document = Document::parse("g.ron", text).expect("a document");
        for options in [CheckOptions::default(), CheckOptions::hosted()] {
            let checked = check(&document, &common::registry(), &options.endpoints(set));
            let codes: Vec<&str> =
                checked.err().iter().flat_map(|found| &found.list).map(|one| one.code).collect();
            assert_eq!(codes.is_empty(), is_there, "{set}: {codes:?}");
            assert!(codes.iter().all(|code| *code == "E0210"), "{set}: {codes:?}");
        }
    }
}

#[test]
fn parameters_begin_as_their_endpoints_want_them_and_the_command_line_says_the_last_word() {
    let document = Document::parse("g.ron", BY_ENDPOINTS).expect("a document");
    let frequency = |endpoints: &str, set: &[(&str, &str)]| {
        let options = CheckOptions::default().endpoints(endpoints);
        let options = set.iter().fold(options, |options, (name, value)| options.set(*name, *value));
        let graph = check(&document, &common::registry(), &options).unwrap_or_else(|wrong| panic!("{wrong}"));
        let mut live = graph.live_settings().into_iter();
        live.find(|live| live.name() == "tone.frequency_hz").map(|live| live.value)
    };
    assert_eq!(frequency("simulated", &[]), Some(440.0));
    assert_eq!(frequency("live", &[]), Some(100.0));
    assert_eq!(frequency("live", &[("frequency_hz", "50")]), Some(50.0));
}

#[test]
fn wrong_graphs_say_what_is_wrong() {
    let bless = std::env::var_os("BLESS").is_some();
    let mut differing = Vec::new();
    for path in files("tests/wrong") {
        let printed = match load(&path) {
            Err(diagnostics) => render(&diagnostics, false),
            Ok(graph) => {
                assert!(!graph.warnings().is_empty(), "{} is right", path.display());
                let list = graph.warnings().to_vec();
                let sources = graph.sources().clone();
                render(&Diagnostics { sources, list }, false)
            }
        };
        let kept = path.with_extension("stderr");
        if bless {
            std::fs::write(&kept, &printed).expect("writable");
        } else if std::fs::read_to_string(&kept).unwrap_or_default() != printed {
            differing.push(format!("{}:\n{printed}", path.display()));
        }
    }
    assert!(differing.is_empty(), "{}", differing.join("\n"));
}

#[test]
fn a_template_becomes_nodes_with_paths_and_everything_inferred() {
    let graph = load(Path::new("tests/right/texturepad.ron")).unwrap_or_else(|d| panic!("{d}"));
    let nodes = graph.nodes();
    let lines: Vec<String> = nodes
        .iter()
        .map(|node| {
            let clock = node.clock.map_or("-", |clock| graph.clocks()[clock].name.as_str());
            let outputs: Vec<String> =
                node.outputs.iter().map(|o| format!("{} {} {}", o.name, o.kind, o.quantity)).collect();
            format!("{} @{clock} sim={} [{}]", node.path, node.simulated, outputs.join("; "))
        })
        .collect();
    assert_eq!(
        lines,
        [
            "stylus @tablet sim=true [position 3-vector length (m); force scalar force (N)]",
            "speed @tablet sim=true [speed scalar speed (m/s)]",
            "texture/locate @tablet sim=true [weights weights number (1)]",
            "texture/filter @synth sim=true [acceleration scalar acceleration (m/s2)]",
            "drive @synth sim=true [current scalar current (A)]",
            "out @audio sim=true [delivered scalar current (A)]",
            "file @- sim=true []",
            "pen @- sim=true []",
        ]
    );
    let bridges: Vec<Bridge> =
        nodes.connections().map(|wire| wire.edge.bridge).filter(|b| *b != Bridge::Direct).collect();
    assert_eq!(
        bridges,
        [Bridge::Between(BridgeEntry::of::<Hold>()), Bridge::Between(BridgeEntry::of::<Resample>())]
    );
    assert_eq!(graph.devices().len(), 2);
    assert_eq!((graph.seed(), graph.about()), (7, "A tablet, a surface, a coil."));
}

#[test]
fn a_graph_can_be_built_in_code() {
    let document = Builder::new("A tone \"and\" its echo.\nTwo lines.")
        .seed(3)
        .driver("audio", 48_000.0)
        .derived("slow", "audio", 1000.0)
        .node("tone", Part::new("Sine").on("audio").set("quantity", "force"))
        .node("slow", Part::new("Gain").on("slow").wire("input", hold("tone.output")).set("gain", 0.5))
        .node("mix", Part::new("Sum").wires("inputs", ["tone.output".into(), delay("mix.output", 5)]))
        .node("file", Part::new("Wav").wires("inputs", ["slow"]).set("file", "a.wav"))
        .node("other", Part::new("Wav").wires("inputs", ["mix"]).set("file", "b.wav"))
        .build()
        .unwrap_or_else(|d| panic!("{d}"));
    let graph =
        check(&document, &common::registry(), &CheckOptions::default()).unwrap_or_else(|d| panic!("{d}"));
    assert_eq!(graph.about(), "A tone \"and\" its echo.\nTwo lines.");
    assert_eq!(graph.nodes().len(), 5);
    assert!(graph.warnings().is_empty());
}

#[test]
fn the_latency_of_a_ring_is_on_every_way_through_it() {
    // There and back again: a loop through rings needs no delay.
    let document = Builder::new("Two drivers.")
        .driver("audio", 48_000.0)
        .driver("servo", 1000.0)
        .node("tone", Part::new("Sine").on("audio"))
        .node("there", Part::new("Sum").on("servo").wires("inputs", [ring("tone", 12.5), ring("back", 20.0)]))
        .node("back", Part::new("Sum").on("audio").wires("inputs", [ring("there", 10.0)]))
        .node("near", Part::new("Wav").wires("inputs", ["there"]).set("file", "near.wav"))
        .node("far", Part::new("Wav").wires("inputs", ["back"]).set("file", "far.wav"))
        .build()
        .unwrap_or_else(|d| panic!("{d}"));
    let graph =
        check(&document, &common::registry(), &CheckOptions::default()).unwrap_or_else(|d| panic!("{d}"));
    let drivers = graph.drivers().into_iter().map(|clock| graph.clocks()[clock].name.as_str());
    assert_eq!(drivers.collect::<Vec<_>>(), ["audio", "servo"]);
    let latencies = graph.latencies();
    let ms = |sink: &str| {
        let found = latencies.iter().find(|path| path.source == "tone" && path.sink == sink);
        found.map(|path| (path.transport_s * 1e6).round() / 1e3)
    };
    assert_eq!((ms("near"), ms("far")), (Some(12.5), Some(22.5)));
}

/// A graph of `count` gains and sums, in the words of a file.
fn large(count: usize) -> String {
    let mut nodes = String::from("\"n0\": Sine(clock: \"audio\", frequency_hz: Param(\"pitch\")),\n");
    for i in 1..count {
        let (a, b) = (i - 1, i / 2);
        nodes += &match i % 2 {
            0 => format!("        \"n{i}\": Gain(input: \"n{a}.output\", gain: 0.5), // a gain\n"),
            _ => format!("        \"n{i}\": Sum(inputs: [\"n{a}.output\", \"n{b}\"]),\n"),
        };
    }
    format!(
        "Graph(format: 1, parameters: {{ \"pitch\": 220 }}, clocks: {{ \"audio\": Driver(rate_hz: 48000) }}, nodes: {{\n\
         {nodes} \"file\": Wav(inputs: [\"n{}\"], file: \"a.wav\") }})",
        count - 1
    )
}

#[test]
#[expect(clippy::print_stdout, reason = "a time to look at, not to depend on")]
fn a_thousand_nodes_are_read_and_checked() {
    let text = large(1000);
    let started = std::time::Instant::now();
    let document = Document::parse("large.ron", &text).unwrap_or_else(|d| panic!("{d}"));
    let read = started.elapsed();
    let graph =
        check(&document, &common::registry(), &CheckOptions::default()).unwrap_or_else(|d| panic!("{d}"));
    println!("1000 nodes: read in {read:?}, read and checked in {:?}", started.elapsed());
    assert_eq!(graph.nodes().len(), 1001);
    assert!(graph.warnings().is_empty());
}

/// Checked, its latencies found, planned, and run for a block, without overflowing a stack of the usual size.
fn goes_the_whole_way(text: &str, nodes: usize) {
    let document = Document::parse("large.ron", text).unwrap_or_else(|d| panic!("{d}"));
    let graph =
        check(&document, &common::registry(), &CheckOptions::default()).unwrap_or_else(|d| panic!("{d}"));
    assert_eq!(graph.nodes().len(), nodes);
    assert_eq!(graph.latencies().len(), 1);
    let plans = Plan::of(&graph, &PlanOptions::default());
    for plan in plans {
        let mut run = Run::new(Arc::new(plan));
        run.advance(64);
        assert_eq!(run.driver_frames(), 64);
    }
}

fn at_48_khz(nodes: &str, last: &str) -> String {
    format!(
        "Graph(format: 1, clocks: {{ \"audio\": Driver(rate_hz: 48000) }}, nodes: {{\n{nodes} \
         \"file\": Wav(inputs: [\"{last}\"], file: \"a.wav\") }})"
    )
}

#[test]
fn a_chain_of_a_hundred_thousand_nodes_is_checked_planned_and_run() {
    let mut nodes = String::from("\"n0\": Sine(),\n");
    for i in 1..99_999 {
        nodes += &format!("\"n{i}\": Gain(input: \"n{}.output\", gain: 0.5),\n", i - 1);
    }
    goes_the_whole_way(&at_48_khz(&nodes, "n99998"), 100_000);
}

/// Two ways at each stage, which are 2^1000 in all.
#[test]
fn a_thousand_dry_and_wet_stages_are_checked_planned_and_run() {
    let mut nodes = String::from("\"m0\": Sine(),\n");
    for i in 1..=1000 {
        let dry = format!("m{}", i - 1);
        nodes += &format!(
            "\"w{i}\": Gain(input: \"{dry}\", gain: 0.5),\n\"m{i}\": Sum(inputs: [\"{dry}\", \"w{i}\"]),\n"
        );
    }
    goes_the_whole_way(&at_48_khz(&nodes, "m1000"), 2002);
}

/// A graph of so many ten thousands of nodes, which a template multiplies.
fn multiplied(ten_thousands: usize, clock: &str) -> String {
    let list = |count: usize, item: &dyn Fn(usize) -> String| (0..count).map(item).collect::<String>();
    let gains = list(100, &|i| format!("\"g{i}\": Gain(input: Input(\"x\"), gain: 1), "));
    let inner = list(100, &|i| format!("\"i{i}\": Inner(x: Input(\"x\")), "));
    let outer = list(ten_thousands, &|i| format!("\"o{i}\": Outer(x: \"tone\"), "));
    format!(
        "Graph(format: 1, clocks: {{ \"audio\": Driver(rate_hz: 48000), \"slow\": Derived(of: \"audio\", rate_hz: 100) }},
        templates: {{
            \"Inner\": Template(inputs: [\"x\"], nodes: {{ {gains} }}, outputs: {{ \"y\": \"g0\" }}),
            \"Outer\": Template(inputs: [\"x\"], nodes: {{ {inner} }}, outputs: {{ \"y\": \"i0\" }}),
        }},
        nodes: {{ \"tone\": Sine(clock: \"{clock}\", frequency_hz: 10), {outer} }})"
    )
}

#[test]
fn the_memory_of_their_buffers_and_a_million_bound_the_nodes_of_templates() {
    let checked = |text: &str| {
        let document = Document::parse("many.ron", text).unwrap_or_else(|d| panic!("{d}"));
        let graph = check(&document, &common::registry(), &CheckOptions::default());
        graph.map(|graph| graph.nodes().len()).map_err(|wrong| wrong.list[0].code)
    };
    assert_eq!(checked(&multiplied(14, "slow")), Ok(140_001));
    // A buffer of each holds a whole block of the driver's clock.
    assert_eq!(checked(&multiplied(14, "audio")), Err("E0305"));
    assert_eq!(checked(&multiplied(100, "slow")), Err("E0702"));
}

/// Deep chains and wide templates end in a graph or a message, never in a crash.
#[test]
fn size_alone_breaks_nothing() {
    let document = Document::parse("large.ron", &large(20_000)).unwrap_or_else(|d| panic!("{d}"));
    assert!(check(&document, &common::registry(), &CheckOptions::default()).is_ok());

    let mut templates = String::from(
        "\"T0\": Template(inputs: [\"x\"], nodes: { \"g\": Gain(input: Input(\"x\"), gain: 1) }, outputs: { \"y\": \"g\" }),",
    );
    for i in 1..40 {
        let k = i - 1;
        templates += &format!(
            "\"T{i}\": Template(inputs: [\"x\"], nodes: {{ \"a\": T{k}(x: Input(\"x\")), \"b\": T{k}(x: \"a\") }}, outputs: {{ \"y\": \"b\" }}),"
        );
    }
    let text = format!(
        "Graph(format: 1, clocks: {{ \"c\": Driver(rate_hz: 1000) }}, templates: {{ {templates} }}, nodes: {{ \"s\": Sine(), \"t\": T39(x: \"s\") }})"
    );
    let document = Document::parse("bomb.ron", &text).unwrap_or_else(|d| panic!("{d}"));
    let diagnostics =
        check(&document, &common::registry(), &CheckOptions::default()).expect_err("too many nodes");
    assert!(diagnostics.list.iter().any(|d| d.code == "E0702"), "{diagnostics}");
}

/// Whatever is done to a right file, the answer is a graph or at least one finding, and the finding can be shown.
#[test]
fn what_was_meant_is_searched_for_findings_that_are_shown() {
    let node = |i: usize| format!("\"leak{i}\": Gain(input: \"laek{i}\", gain: 0.5)");
    let nodes: Vec<String> = (0..1500).map(node).collect();
    let text = format!(
        "Graph(format: 1, clocks: {{ \"main\": Driver(rate_hz: 1000) }}, nodes: {{ {} }})",
        nodes.join(",\n")
    );
    let document = Document::parse("wrong.ron", &text).unwrap_or_else(|d| panic!("{d}"));
    let wrong = check(&document, &common::registry(), &CheckOptions::default()).expect_err("unknown inputs");
    let unknown: Vec<bool> = wrong
        .list
        .iter()
        .filter(|finding| finding.code == "E0202")
        .map(|finding| !finding.help.is_empty())
        .collect();
    assert_eq!(unknown.len(), 1500);
    assert!(unknown[..100].iter().all(|helped| *helped));
    assert!(!unknown[100..].contains(&true));
}

#[test]
fn mutations_of_right_files_never_panic() {
    use rand::{RngExt, SeedableRng};
    let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(2);
    let registry = common::registry();
    let texts: Vec<String> = files("tests/right")
        .iter()
        .chain(&files("tests/wrong"))
        .map(|path| std::fs::read_to_string(path).expect("readable"))
        .collect();
    let words: Vec<&str> =
        texts.iter().flat_map(|text| text.split_inclusive(|c: char| !c.is_alphanumeric())).collect();
    let (mut graphs, mut refused) = (0, 0);
    for _ in 0..20_000 {
        // Half of them begin as right files, which are the first.
        let of = [2, texts.len()][random.random_range(0..2)];
        let mut text = texts[random.random_range(0..of)].clone();
        for _ in 0..random.random_range(1..4) {
            let boundary = |text: &str, mut at: usize| {
                while !text.is_char_boundary(at) {
                    at -= 1;
                }
                at
            };
            let start = boundary(&text, random.random_range(0..=text.len()));
            let length = random.random_range(0..12).min(text.len() - start);
            let end = boundary(&text, start + length);
            let put = match random.random_range(0..4) {
                0 => "",
                1 => ["(", ")", "[", "]", "{", "}", "\"", ",", ":", "//", "/*", "µ", "-", "1e9"]
                    [random.random_range(0..14)],
                _ => words[random.random_range(0..words.len())],
            };
            text.replace_range(start..end.max(start), put);
        }
        let found = Document::parse("tests/right/mutant.ron", &text)
            .and_then(|document| check(&document, &registry, &CheckOptions::default()));
        match found {
            Ok(_) => graphs += 1,
            Err(diagnostics) => {
                refused += 1;
                assert!(!diagnostics.list.is_empty(), "{text}");
                assert!(!render(&diagnostics, false).is_empty());
                assert!(to_json(&diagnostics).starts_with('['));
            }
        }
    }
    assert!(graphs > 200 && refused > 10_000);
}

#[test]
fn findings_for_editors_have_their_place() {
    let diagnostics = load(Path::new("tests/wrong/syntax_many_byte_letters.ron")).expect_err("wrong");
    let json: serde_json::Value = serde_json::from_str(&to_json(&diagnostics)).expect("JSON");
    let first = &json[0];
    assert_eq!(first["code"], "E0204");
    assert_eq!(first["path"], "tests/wrong/syntax_many_byte_letters.ron");
    assert_eq!((first["line"].as_u64(), first["column"].as_u64()), (Some(6), Some(35)));
    assert_eq!((first["end_line"].as_u64(), first["end_column"].as_u64()), (Some(6), Some(39)));
    assert_eq!(first["help"][0], "did you mean `gain`?");
}

/// `docs/diagnostics.md` lists every code, each with one meaning, and no others; and the corpus shows nearly all.
#[test]
fn every_code_is_documented() {
    use std::collections::BTreeSet;
    fn codes(text: &str, before: char) -> BTreeSet<String> {
        let starts = text.match_indices(before).map(|(i, c)| &text[i + c.len()..]);
        let code = |rest: &str| {
            let code = rest.get(..5)?;
            let digits = code.bytes().skip(1).all(|b| b.is_ascii_digit());
            (code.starts_with(['E', 'W']) && digits).then(|| code.to_owned())
        };
        starts.filter_map(code).collect()
    }
    fn sources(folder: &Path, text: &mut String) {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            match path.is_dir() {
                true => sources(&path, text),
                false => *text += &std::fs::read_to_string(&path).expect("readable"),
            }
        }
    }
    let mut source = String::new();
    sources(Path::new("src"), &mut source);
    let used = codes(&source, '"');
    let page = std::fs::read_to_string("../docs/diagnostics.md").expect("docs/diagnostics.md");
    assert_eq!(used, codes(&page, '`'), "the source and docs/diagnostics.md differ");

    let mut printed = String::new();
    sources(Path::new("tests/wrong"), &mut printed);
    let shown = codes(&printed, '[');
    let never: Vec<&String> = used.difference(&shown).collect();
    assert_eq!(never, [""; 0], "codes that no golden text shows");
}

#[test]
fn a_file_outside_the_folders_is_refused_by_name() {
    let folder = Path::new("tests/wrong/parts");
    let roots = Arc::new(Roots::of([folder]).expect("a folder"));
    let text = r#"Graph(
    format: 1,
    clocks: { "c": Driver(rate_hz: 1000) },
    nodes: {
        "locate": Locate(clock: "c"),
        "filter": Filter(clock: "c", weights: "locate", surface: "../../right/texturepad.ron"),
    },
)"#;
    let document = Document::parse(folder.join("given.ron"), text).expect("a document");
    let checked = roots.confine(|| check(&document, &common::registry(), &CheckOptions::default()));
    let mut wrong = checked.expect_err("it leads out");
    wrong.list.retain(|one| one.code == "E0112");
    assert_eq!(wrong.list.len(), 1);
    let here = roots.folders()[0].display().to_string();
    golden::compare(
        "tests/wrong/program_confined.stderr",
        &render(&wrong, false).replace(&here, "tests/wrong/parts"),
    );
}

#[test]
fn two_kinds_of_one_name_are_an_error_and_one_in_the_place_of_another_is_none() {
    let document = Document::load(Path::new("tests/right/texturepad.ron"), &LoadOptions::default());
    let document = document.expect("it is right");
    let mut registry = common::registry();
    let gain = registry.node("Gain").expect("a kind of node");
    registry.replace(gain);
    check(&document, &registry, &CheckOptions::default()).expect("no name stands twice");
    let device = registry.devices()[0];
    registry.replace_device(device);
    check(&document, &registry, &CheckOptions::default()).expect("no name stands twice");
    registry.add(gain).add(gain).add_device(device);
    let wrong = check(&document, &registry, &CheckOptions::default()).expect_err("names stand twice");
    let codes: Vec<_> = wrong.list.iter().map(|one| one.code).collect();
    assert_eq!(codes, ["E0212", "E0212"], "each name once");
    golden::compare("tests/wrong/program_name_twice.stderr", &render(&wrong, false));
    registry.replace(gain).replace_device(device);
    check(&document, &registry, &CheckOptions::default()).expect("no name stands twice any more");
    registry.add_kind(common::WEIGHTS).add_bridge(BridgeEntry::of::<Hold>());
    let wrong = check(&document, &registry, &CheckOptions::default()).expect_err("names stand twice");
    let codes: Vec<_> = wrong.list.iter().map(|one| one.code).collect();
    assert_eq!(codes, ["E0212", "E0212"], "of kinds of frames and of bridges");
    let [kinds, bridges] = [0, 1].map(|one: usize| &wrong.list[one]);
    assert!(kinds.message.contains("frames") && kinds.message.contains("`weights`"));
    assert!(bridges.message.contains("bridges") && bridges.message.contains("`Hold`"));
    // What replaces nodes and devices replaces neither of these; the registry has the names that are taken.
    for (wrong, taken) in [(kinds, "`wrench`, `event`, `weights`"), (bridges, "`Hold`, `Linear`")] {
        assert!(!wrong.help[0].contains("replace") && wrong.help[0].contains(taken), "{wrong:?}");
    }
}

#[test]
fn a_bridge_cannot_have_the_name_of_another_form_of_a_connection() {
    struct Ring(Hold);
    impl BridgeType for Ring {
        const SPEC: BridgeSpec = BridgeSpec { name: "Ring", ..Hold::SPEC };
        fn new(cx: &BridgeContext) -> Self {
            Self(Hold::new(cx))
        }
        fn latency(from: Rate, to: Rate) -> Latency {
            Hold::latency(from, to)
        }
        fn cross(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
            self.0.cross(ends, x, y);
        }
        fn copy_state_from(&mut self, old: &Self) {
            self.0.copy_state_from(&old.0);
        }
    }
    let document = Document::load(Path::new("tests/right/texturepad.ron"), &LoadOptions::default());
    let mut registry = common::registry();
    registry.add_bridge(BridgeEntry::of::<Ring>());
    let wrong = check(&document.expect("it is right"), &registry, &CheckOptions::default());
    let [wrong] = &wrong.expect_err("the name is taken").list[..] else {
        panic!("one error");
    };
    assert_eq!(wrong.code, "E0212");
    assert!(wrong.message.contains("a bridge is registered as `Ring`"), "{wrong:?}");
}

#[test]
fn an_actuator_is_driven_by_what_a_limiter_takes() {
    const TWO: DeviceSpec = DeviceSpec {
        name: "Two",
        doc: "",
        source: "",
        simulated: true,
        senses: &[],
        drives: &[Channel::new("axes", common::WEIGHTS, Quantity::CURRENT, "")],
        example: "",
    };
    let document = Document::load(Path::new("tests/right/texturepad.ron"), &LoadOptions::default());
    let mut registry = common::registry();
    let mut device = registry.devices()[0];
    device.spec = &TWO;
    registry.add_device(device);
    let wrong = check(&document.expect("it is right"), &registry, &CheckOptions::default());
    let wrong = wrong.expect_err("no limiter takes two components");
    assert_eq!(wrong.list.iter().map(|one| one.code).collect::<Vec<_>>(), ["E0213"]);
    golden::compare("tests/wrong/program_kind_unlimited.stderr", &render(&wrong, false));
}

#[test]
fn ports_carry_registered_kinds_only() {
    const WIDER: KindSpec =
        KindSpec { components: &["model", "weight", "height"], ..*common::WEIGHTS.spec() };
    let document = Document::load(Path::new("tests/right/texturepad.ron"), &LoadOptions::default());
    let document = document.expect("it is right");
    let gain = common::registry().node("Locate").expect("a kind of node");
    let mut registry = Registry::new();
    registry.add(gain);
    let codes = |registry: &Registry| {
        let wrong =
            check(&document, registry, &CheckOptions::default()).expect_err("the kind is not registered");
        let of_kinds = wrong.list.iter().filter(|one| one.code == "E0213");
        of_kinds.map(|one| one.message.clone()).collect::<Vec<_>>()
    };
    assert_eq!(codes(&registry).len(), 1);
    let mut wrong = check(&document, &registry, &CheckOptions::default()).expect_err("it is not registered");
    wrong.list.retain(|one| one.code == "E0213");
    golden::compare("tests/wrong/program_kind_unregistered.stderr", &render(&wrong, false));
    registry.add_kind(Kind::new(&WIDER));
    let [message] = &codes(&registry)[..] else { panic!("one port") };
    assert!(message.contains("kind `weights` that differs"), "{message}");
    let mut registry = Registry::new();
    registry.add_kind(common::WEIGHTS).add(gain);
    assert_eq!(codes(&registry), [""; 0]);
}
