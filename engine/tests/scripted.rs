//! Kinds of nodes that are described while the program runs: registered as all are, checked as all are, and kept from
//! live runs.

#[path = "common/golden.rs"]
mod golden;

use haptograph_engine::diagnostic::{Diagnostics, render};
use haptograph_engine::document::Document;
use haptograph_engine::frame::{AnyKind, Kind};
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::host::{HostError, Scalar};
use haptograph_engine::node::{
    Built, Io, KindRule, NodeEntry, NodeSpec, OfflineOnly, Output, OutputCount, OutputRole, OutputSpec,
    Processor, QuantityRule, ScriptBuild, Scripted, ScriptedKind, Tick,
};
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::registry::Registry;
use haptograph_engine::run::{ChangeError, FileSinks, Player, Run, Session, SessionOptions};
use haptograph_engine::settings::{Fields, Reading, SettingSpec};
use haptograph_signal::quantity::Quantity;
use std::sync::Arc;

/// Counts frames in steps; it is described by a value, as a script is.
struct Counter(NodeSpec);

#[derive(Clone)]
struct Counting {
    step: f64,
    count: Output<Scripted, AnyKind>,
}

impl Processor<Scripted> for Counting {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Scripted>) {
        for (frame, value) in io.write(self.count).iter_mut().enumerate() {
            *value = self.step * (tick.first + frame as u64) as f64;
        }
    }
}

impl ScriptedKind for Counter {
    fn spec(&'static self) -> &'static NodeSpec {
        &self.0
    }

    fn settings(&self) -> Vec<SettingSpec> {
        let doc = "What a frame adds.".to_owned();
        vec![SettingSpec::new("step", doc, Some(&1.0), Some((0.0, 10.0)))]
    }

    fn read(&'static self, fields: &mut Fields, reading: &mut Reading<'_>) -> Option<ScriptBuild> {
        let step: f64 = fields.setting("step", Some(1.0), Some((0.0, 10.0)), reading)?;
        let (_, count) = self.0.any_outputs().next().expect("it has one");
        Some(Box::new(move |_| Ok(Built::new(Counting { step, count }))))
    }
}

fn registry() -> Registry {
    let counter: &'static Counter = Box::leak(Box::new(Counter(NodeSpec {
        name: "Counter",
        group: "scripts",
        doc: "Counts frames.",
        source: "",
        inputs: &[],
        outputs: Box::leak(Box::new([OutputSpec {
            name: "count",
            kind: KindRule::Is(Kind::SCALAR),
            quantity: QuantityRule::Is(Quantity::NUMBER),
            role: OutputRole::Plain,
            count: OutputCount::One,
            doc: "",
        }])),
        example: "",
    })));
    let mut registry = Registry::new();
    registry.add(NodeEntry::scripted(counter));
    registry
}

fn graph(fields: &str) -> Result<Graph, Diagnostics> {
    let text = format!(
        r#"Graph(format: 1, clocks: {{ "c": Driver(rate_hz: 1000) }}, nodes: {{ "n": Counter(clock: "c"{fields}) }})"#
    );
    check(&Document::parse("script.ron", &text)?, &registry(), &CheckOptions::default())
}

#[test]
fn a_scripted_node_runs_offline_with_its_settings_and_is_marked_as_slow() {
    let graph = graph(", step: 3").unwrap_or_else(|wrong| panic!("{wrong}"));
    let port = graph.find_output("n").expect("its output");
    let options = PlanOptions::default().block(8).taps([port]);
    let mut run = Run::new(Arc::new(Plan::of(&graph, &options).remove(0)));
    run.advance(3);
    run.advance(2);
    assert_eq!(run.tap(0), [9.0, 12.0]);
    let marked = graph.warnings().iter().find(|warning| warning.message.contains("slow"));
    assert_eq!(marked.map(|warning| warning.code), Some("W0107"));
    assert_eq!(graph.scripted_nodes().map(|node| &*node.path).collect::<Vec<_>>(), ["n"]);
}

#[test]
fn its_settings_are_checked_as_those_of_all_nodes() {
    for (fields, code) in [(", step: 11", "E0302"), (r#", step: "a""#, "E0301"), (", stepp: 1", "E0204")] {
        let wrong = graph(fields).expect_err(fields);
        assert_eq!(wrong.list[0].code, code, "{fields}");
    }
}

#[test]
fn no_live_run_takes_it_unless_nobody_waits() {
    let graph = graph("").unwrap_or_else(|wrong| panic!("{wrong}"));
    let only = OfflineOnly { node: "n".to_owned(), kind: "Counter" };
    let refused = Player::open(&graph, &SessionOptions::default()).err();
    assert!(matches!(refused, Some(HostError::OfflineOnly(found)) if found == only));
    let refused = Session::open_all(FileSinks::new(&graph), &SessionOptions::default(), None).err();
    assert!(refused.is_some_and(|error| error.to_string() == only.to_string()));

    let mut options = SessionOptions::default().probe("n");
    options.offline = true;
    let (mut player, mut session) = Player::open(&graph, &options).expect("nobody waits");
    let mut counted = session.probe::<Scalar>("n").expect("a probe");
    player.process(3);
    let mut got = [0.0; 3];
    assert_eq!(counted.read(&mut got), 3);
    assert_eq!(got, [0.0, 1.0, 2.0]);
    let refused = session.change_and_probe(&graph, None, &[]).err();
    assert!(matches!(refused, Some(ChangeError::OfflineOnly(found)) if found == only));
    session.finish(player);
}

#[test]
fn what_it_raises_is_a_finding_at_its_place() {
    let graph = graph("").unwrap_or_else(|wrong| panic!("{wrong}"));
    let node = graph.scripted_nodes().next().expect("a node");
    let found = Diagnostics {
        sources: graph.sources().clone(),
        list: vec![node.raised("KeyError: 'x'", "line 3, in tick")],
    };
    assert_eq!((found.list[0].code, &found.list[0].help[..]), ("E0801", &["line 3, in tick".to_owned()][..]));
    golden::compare("tests/wrong/program_script_raised.stderr", &render(&found, false));
}
