//! Any text is a graph or at least one finding that can be shown; a sound graph can be planned and run.
#![no_main]

use haptograph_engine::document::Document;
use haptograph_engine::graph::{CheckOptions, check};
use haptograph_engine::registry::Registry;
use haptograph_engine::diagnostic::{render, to_json};
use haptograph_engine::run::{Offline, Outlets};
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;
use std::sync::atomic::AtomicBool;

static REGISTRY: LazyLock<Registry> = LazyLock::new(haptograph_nodes::registry);

fuzz_target!(|text: &str| {
    let found = Document::parse("graphs/fuzzed.ron", text)
        .and_then(|document| check(&document, &REGISTRY, &CheckOptions::default()));
    match found {
        Ok(graph) => {
            let _ = Offline::new(Outlets::new(&graph), 0).run(0.002, &AtomicBool::new(false), &mut |_| {});
        }
        Err(diagnostics) => {
            assert!(!diagnostics.list.is_empty());
            assert!(!render(&diagnostics, false).is_empty());
            assert!(to_json(&diagnostics).starts_with('['));
        }
    }
});
