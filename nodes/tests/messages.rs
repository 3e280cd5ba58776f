//! What kinds of nodes and devices say where their settings contradict each other, kept as it is printed.

use haptograph_engine::diagnostic::{Diagnostics, render};
use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{CheckOptions, check};

#[path = "../../engine/tests/common/golden.rs"]
mod golden;

/// How many nodes and devices of the graph are wrong.
const WRONG: usize = 35;

#[test]
fn each_kind_that_refuses_settings_says_why() {
    let document = Document::load("tests/wrong/kinds.ron", &LoadOptions::default());
    let document = document.unwrap_or_else(|wrong| panic!("{wrong}"));
    let wrong = check(&document, &haptograph_nodes::registry(), &CheckOptions::default());
    let wrong = wrong.expect_err("most nodes are wrong");
    golden::compare("tests/wrong/kinds.stderr", &render(&wrong, false));
    let of_kinds = wrong.list.iter().filter(|one| one.code == "E0304");
    assert_eq!((wrong.list.len(), of_kinds.count()), (WRONG, WRONG));
}

#[test]
fn each_kind_that_doubts_its_settings_says_why() {
    let document = Document::load("tests/wrong/doubtful.ron", &LoadOptions::default());
    let document = document.unwrap_or_else(|wrong| panic!("{wrong}"));
    let graph = check(&document, &haptograph_nodes::registry(), &CheckOptions::default());
    let graph = graph.unwrap_or_else(|wrong| panic!("{wrong}"));
    let doubts = Diagnostics { sources: graph.sources().clone(), list: graph.warnings().to_vec() };
    golden::compare("tests/wrong/doubtful.stderr", &render(&doubts, false));
    assert!(doubts.list.iter().all(|one| one.code == "W0107"));
    assert_eq!(doubts.list.len(), 3);
}
