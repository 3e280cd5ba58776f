//! Inputs whose connections have names, and outputs that settings name.

mod common;
#[path = "common/golden.rs"]
mod golden;

use haptograph_engine::diagnostic::{Diagnostics, render};
use haptograph_engine::document::{Builder, Document, Part, delay, hold};
use haptograph_engine::graph::{CheckOptions, Graph, Node, check};

fn checked(nodes: &str) -> Result<Graph, Diagnostics> {
    let text = format!(
        r#"Graph(
            format: 1,
            parameters: {{ "late": 3 }},
            clocks: {{ "fast": Driver(rate_hz: 2000), "slow": Derived(of: "fast", rate_hz: 1000) }},
            templates: {{ "Pair": Template(
                inputs: ["first"],
                nodes: {{ "own": Sine(clock: "fast"), "mix": Mix(terms: {{"first": Input("first"), "own": "own"}}) }},
                outputs: {{ "output": "mix" }},
            ) }},
            nodes: {{ "tone": Sine(clock: "fast"), "slow": Sine(clock: "slow"), {nodes} }},
        )"#
    );
    let document = Document::parse("ports.ron", &text)?;
    check(&document, &common::registry(), &CheckOptions::default())
}

fn graph(nodes: &str) -> Graph {
    checked(nodes).unwrap_or_else(|wrong| panic!("{wrong}"))
}

fn codes(found: &Result<Graph, Diagnostics>) -> Vec<&'static str> {
    let list = match found {
        Ok(graph) => graph.warnings(),
        Err(wrong) => &wrong.list,
    };
    let own = list.iter().map(|finding| finding.code);
    // What is not used.
    own.filter(|code| !["W0101", "W0102", "W0103"].contains(code)).collect()
}

fn node<'g>(graph: &'g Graph, path: &str) -> &'g Node {
    graph.nodes().iter().find(|node| node.path == path).expect(path)
}

/// The names of the inputs, and where each comes from.
fn connections(graph: &Graph, path: &str) -> Vec<(String, String)> {
    let nodes = graph.nodes();
    let id = nodes.find(path).expect(path);
    let mut reads = nodes.incoming(id);
    reads.sort_by_key(|read| read.edge.input);
    let reads = reads.iter().map(|read| {
        let input = &nodes[id].inputs[read.edge.input];
        assert!(input.connected);
        (input.shown().to_owned(), nodes[read.from].path.clone())
    });
    reads.collect()
}

fn pairs(of: &[(&str, &str)]) -> Vec<(String, String)> {
    of.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect()
}

#[test]
fn a_map_takes_everything_that_a_list_takes() {
    let found = graph(
        r#""mix": Mix(terms: {
            "near": "tone.output",
            "bridged": Hold("slow"),
            "echo": Delay(from: "mix", frames: Param("late")),
            "pair": "pair.output",
        }),
        "pair": Pair(first: "tone")"#,
    );
    let wanted = [("near", "tone"), ("bridged", "slow"), ("echo", "mix"), ("pair", "pair/mix")];
    assert_eq!(connections(&found, "mix"), pairs(&wanted));
    assert_eq!(connections(&found, "pair/mix"), pairs(&[("first", "tone"), ("own", "pair/own")]));
    let listed = graph(r#""mix": Mix(terms: ["tone", Hold("slow")])"#);
    assert_eq!(connections(&listed, "mix"), pairs(&[("terms", "tone"), ("terms", "slow")]));
}

#[test]
fn names_are_part_of_the_fingerprint_and_their_absence_is_not() {
    let of = |terms: &str| node(&graph(&format!(r#""mix": Mix(terms: {terms})"#)), "mix").fingerprint;
    let named = of(r#"{"a": "tone", "b": "tone"}"#);
    assert_eq!(named, of(r#"{"a": "tone", "b": "tone"}"#));
    let others = [
        of(r#"{"a": "tone", "c": "tone"}"#),
        of(r#"{"b": "tone", "a": "tone"}"#),
        of(r#"["tone", "tone"]"#),
        of(r#"{"a": "tone"}"#),
    ];
    for (place, other) in others.iter().enumerate() {
        assert!(*other != named && !others[..place].contains(other), "{place}");
    }
}

#[test]
fn a_connection_is_named_in_code_as_in_a_file() {
    let terms = || [("near", "tone".into()), ("far", hold("slow")), ("echo", delay("mix", 3))];
    let builder = Builder::new("A mix.")
        .driver("fast", 2000.0)
        .derived("slow", "fast", 1000.0)
        .node("tone", Part::new("Sine").on("fast"))
        .node("slow", Part::new("Sine").on("slow"))
        .node("mix", Part::new("Mix").named_wires("terms", terms()));
    let built = builder.build().unwrap_or_else(|wrong| panic!("{wrong}"));
    let built = check(&built, &common::registry(), &CheckOptions::default());
    let built = built.unwrap_or_else(|wrong| panic!("{wrong}"));
    let wanted = [("near", "tone"), ("far", "slow"), ("echo", "mix")];
    assert_eq!(connections(&built, "mix"), pairs(&wanted));
    let written =
        r#""mix": Mix(terms: {"near": "tone", "far": Hold("slow"), "echo": Delay(from: "mix", frames: 3)})"#;
    assert_eq!(node(&built, "mix").fingerprint, node(&graph(written), "mix").fingerprint);
}

#[test]
fn a_map_has_a_largest_size() {
    let map = |count: usize| {
        let each = (0..count).map(|i| format!("\"n{i}\": \"tone\",\n"));
        checked(&format!("\"mix\": Mix(terms: {{\n{}}})", each.collect::<String>()))
    };
    assert_eq!(codes(&map(1024)), [""; 0]);
    let wrong = map(1025).expect_err("it is too large");
    assert_eq!(wrong.list.len(), 1);
    golden::compare("tests/wrong/program_map_too_large.stderr", &render(&wrong, false));
}

#[test]
fn a_template_takes_one_connection_for_each_of_its_inputs() {
    let found = checked(r#""pair": Pair(first: {"a": "tone"})"#);
    assert_eq!(codes(&found), ["E0411"]);
}

/// The names of the outputs of a node.
fn outputs(graph: &Graph, path: &str) -> Vec<String> {
    let outputs = node(graph, path).outputs.iter();
    outputs.map(|output| output.name.to_string()).collect()
}

#[test]
fn settings_name_outputs() {
    let found = graph(
        r#""fan": Fan(input: "tone", names: ["left", "right"]),
        "mix": Mix(terms: {"a": "fan.right", "b": Delay(from: "fan.left", frames: 2)}),
        "none": Fan(input: "tone", names: []),
        "how_many": Gain(input: "none.count", gain: 1)"#,
    );
    assert_eq!(outputs(&found, "fan"), ["count", "left", "right"]);
    assert_eq!(outputs(&found, "none"), ["count"]);
    let nodes = found.nodes();
    let reads = nodes.incoming(nodes.find("mix").unwrap());
    let mut read: Vec<(usize, usize)> =
        reads.iter().map(|read| (read.edge.input, read.edge.output)).collect();
    read.sort_unstable();
    assert_eq!(read, [(0, 2), (1, 1)]);
    let spec = |output| node(&found, "fan").output_spec(output).map(|port| port.name);
    assert_eq!([0, 1, 2].map(spec), [Some("count"), Some("copies"), Some("copies")]);
}

#[test]
fn a_renamed_output_is_another_node() {
    let of = |names: &str| {
        node(&graph(&format!(r#""fan": Fan(input: "tone", names: {names})"#)), "fan").fingerprint
    };
    assert_eq!(of(r#"["a", "b"]"#), of(r#"["a", "b"]"#));
    assert_ne!(of(r#"["a", "b"]"#), of(r#"["a", "c"]"#));
    assert_ne!(of(r#"["a", "b"]"#), of(r#"["b", "a"]"#));
}

#[test]
fn members_that_are_not_known_cause_no_second_error() {
    let found = checked(
        r#""fan": Fan(input: "tone", names: [7]),
        "a": Gain(input: Delay(from: "fan.x", frames: 1), gain: 1), "b": Gain(input: "fan.count", gain: 1)"#,
    );
    assert_eq!(codes(&found), ["E0301"]);
    let out = checked(
        r#""fan": Fan(input: "tone", names: ["a", "a"], only: "live"), "a": Gain(input: "fan.x", gain: 1)"#,
    );
    assert_eq!(codes(&out), ["E0210"]);
}

#[test]
fn a_node_with_outputs_of_settings_is_edited_without_end() {
    for turn in 0..2000 {
        let names = format!(
            r#""fan": Fan(input: "tone", names: ["a{turn}", "b{turn}"]), "a": Gain(input: "fan.a{turn}", gain: 1)"#
        );
        assert_eq!(
            outputs(&graph(&names), "fan"),
            ["count".to_owned(), format!("a{turn}"), format!("b{turn}")]
        );
    }
}
