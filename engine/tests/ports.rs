//! Inputs whose connections have names.

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
    own.filter(|code| !["W0101", "W0102", "W0103"].contains(code))
        .collect()
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
    of.iter()
        .map(|(a, b)| ((*a).to_owned(), (*b).to_owned()))
        .collect()
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
    let wanted = [
        ("near", "tone"),
        ("bridged", "slow"),
        ("echo", "mix"),
        ("pair", "pair/mix"),
    ];
    assert_eq!(connections(&found, "mix"), pairs(&wanted));
    assert_eq!(
        connections(&found, "pair/mix"),
        pairs(&[("first", "tone"), ("own", "pair/own")])
    );
    let listed = graph(r#""mix": Mix(terms: ["tone", Hold("slow")])"#);
    assert_eq!(
        connections(&listed, "mix"),
        pairs(&[("terms", "tone"), ("terms", "slow")])
    );
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
    let terms = || {
        [
            ("near", "tone".into()),
            ("far", hold("slow")),
            ("echo", delay("mix", 3)),
        ]
    };
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
    assert_eq!(
        node(&built, "mix").fingerprint,
        node(&graph(written), "mix").fingerprint
    );
}

#[test]
fn a_map_has_a_largest_size() {
    let map = |count: usize| {
        let each = (0..count).map(|i| format!("\"n{i}\": \"tone\",\n"));
        checked(&format!(
            "\"mix\": Mix(terms: {{\n{}}})",
            each.collect::<String>()
        ))
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
