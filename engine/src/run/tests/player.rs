//! Player runs under virtual time: stops, faults and panics.

use super::heat::Asks;
use super::virtual_clock::listening;
use super::world::{Body, LIMIT, Nothing, process, random_graph, with_processor};
use crate::device::Device;
use crate::graph::{Graph, Node, Work, id_of};
use crate::node::{Io, Processor, SettingId, Tick};
use crate::plan::{Plan, PlanOptions};
use crate::run::cost;
use crate::run::{
    ControlError, FileSinks, OfflineError, Player, PlayerState, Run, Session, SessionOptions, player,
};
use crate::silence::{InputCell, InputState, LiveInput};
use petgraph::graph::NodeIndex;
use std::sync::Arc;
use std::sync::atomic::Ordering;

pub fn plan(graph: &Graph, block: usize) -> Arc<Plan> {
    let taps = graph.nodes().ids().map(|node| (node, 0)).collect();
    Arc::new(Plan::of(graph, &PlanOptions { block, taps }).remove(0))
}

pub fn sink(graph: &Graph) -> Option<NodeIndex> {
    graph.nodes.node_indices().find(|node| matches!(graph.nodes[*node].work, Work::Actuator { .. }))
}

/// Everything heard on all taps, frame by frame of the driver's blocks.
pub fn hear(run: &Run, taps: usize, heard: &mut [Vec<f64>]) {
    for (tap, heard) in heard.iter_mut().enumerate().take(taps) {
        heard.extend_from_slice(run.tap(tap));
    }
}

#[test]
fn a_stop_fades_out_and_then_nothing_runs() {
    let graph = (0..).map(|seed| random_graph(seed, 0)).find(|graph| sink(graph).is_some()).unwrap();
    let sink = sink(&graph).unwrap().index();
    let (mut live, control) = player(plan(&graph, 4));
    live.process(200);
    control.stop();
    let mut last = f64::INFINITY;
    live.process_with(1000, |run, _| last = run.tap(sink).last().copied().unwrap_or(last));
    assert_eq!(live.state(), PlayerState::Stopped);
    assert!(live.frames() <= 200 + 16);
    let most = LIMIT.peak / 10.0;
    assert!(last.abs() <= most, "{last} is more than a tenth of the fade leaves");
}

/// A panic that is meant to happen: it unwinds as any does, without the message.
pub fn panic_quietly() -> ! {
    std::panic::resume_unwind(Box::new("as asked"))
}

/// Puts out what it is told to from a tick on.
#[derive(Clone)]
pub struct Trouble {
    pub from: u64,
    pub value: f64,
    pub panics: bool,
}

impl Processor<Nothing> for Trouble {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Nothing>) {
        if self.panics && tick.first >= self.from {
            panic_quietly();
        }
        for (j, out) in io.ports.out(0).iter_mut().enumerate() {
            *out = if tick.first + j as u64 >= self.from { self.value } else { 100.0 };
        }
    }
}

#[test]
fn what_is_not_a_number_becomes_zero_at_the_sink_and_is_traced_to_its_node() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let trouble = Trouble { from: 50, value, panics: false };
        let (graph, node, sink) = with_processor(trouble);
        let (mut live, _control) = player(plan(&graph, 8));
        let mut heard = vec![Vec::new(); 3];
        live.process_with(100, |run, _| hear(run, 3, &mut heard));
        let drive = &heard[sink.index()];
        assert!(drive[20..50].iter().all(|x| *x == 10.0), "{drive:?}");
        assert!(drive[50..].iter().all(|x| *x == 0.0));
        assert_eq!(live.faults().origin.as_deref(), Some(&*graph.nodes[node].path));
        assert!(live.faults().ticks > 0);
    }
}

#[test]
fn a_panic_takes_the_actuators_to_zero_outside_the_plan() {
    let trouble = Trouble { from: 50, value: 0.0, panics: true };
    let (graph, _, _) = with_processor(trouble);
    let (mut live, _control) = player(plan(&graph, 1));
    live.process(51);
    assert_eq!(live.state(), PlayerState::Panicked);
    let drive = |run: &Run| run.state.devices[0].device.clone_box();
    let mut drives = Vec::new();
    for _ in 0..12 {
        live.process(1);
        drives.push(drive_of(drive(live.run())));
    }
    assert!(drives[0] > 5.0 && drives[0] < 10.0, "{drives:?}");
    assert!(drives.windows(2).all(|pair| pair[1] < pair[0] || pair[1] == 0.0), "{drives:?}");
    assert_eq!(drives[11], 0.0);
    // What is shown of it falls with it.
    let level = |run: &Run| run.plan.delivered[0].take_level();
    let (before, ..) = level(live.run());
    (0..10_000).for_each(|_| live.process(1));
    let (after, peak, _) = level(live.run());
    assert!(before > 1.0 && after < 1e-3 * before, "{before} to {after}");
    assert_eq!(peak, 0.0);
}

#[test]
fn what_is_not_a_number_is_traced_to_the_same_node_whatever_the_block() {
    /// Once only not a number: gone when the sink has seen it.
    #[derive(Clone)]
    struct Once;
    impl Processor<Nothing> for Once {
        fn process(&mut self, tick: &Tick, io: &mut Io<'_, Nothing>) {
            for (j, out) in io.ports.out(0).iter_mut().enumerate() {
                *out = if tick.first + j as u64 == 50 { f64::NAN } else { 1.0 };
            }
        }
    }
    let (graph, node, _) = with_processor(Once);
    for block in [1, 7, 64, 1000] {
        let options = SessionOptions::default().block(block).seconds(0.2);
        let outcome = Session::run_offline(FileSinks::new(&graph), &options, &mut |_| {}).unwrap();
        let found = (outcome.faults.ticks, outcome.faults.origin.as_deref());
        assert_eq!(found, (1, Some(&*graph.nodes[node].path)));
    }
}

/// A graph in which a processor that leads nowhere puts out no number long before the one that the sink reads.
fn with_bystander() -> (Graph, NodeIndex) {
    let trouble = |from| Trouble { from, value: f64::NAN, panics: false };
    let (mut graph, node, _) = with_processor(trouble(50));
    let blamed = &graph.nodes[node];
    let bystander = Node {
        path: String::from("bystander"),
        entry: blamed.entry,
        clock: blamed.clock,
        inputs: Vec::new(),
        outputs: blamed.outputs.clone(),
        work: process(trouble(10)),
        span: blamed.span,
        simulated: false,
        fingerprint: 1,
        live: Vec::new(),
        given: Arc::default(),
        files: Vec::new(),
    };
    graph.nodes.add_node(bystander);
    (graph, node)
}

#[test]
fn a_node_that_leads_to_no_sink_is_not_blamed() {
    let (graph, node) = with_bystander();
    for block in [1, 64] {
        let options = SessionOptions::default().block(block).seconds(0.1);
        let outcome = Session::run_offline(FileSinks::new(&graph), &options, &mut |_| {}).unwrap();
        assert_eq!(outcome.faults.origin.as_deref(), Some(&*graph.nodes[node].path), "block {block}");
    }
}

#[test]
fn a_stopped_run_does_not_look_for_who_is_to_blame() {
    let (graph, _) = with_bystander();
    let options = SessionOptions::default().block(60).seconds(1e7);
    let stop = &mut |_| options.stop.store(true, Ordering::Relaxed);
    let outcome = Session::run_offline(FileSinks::new(&graph), &options, stop);
    let faults = outcome.unwrap().faults;
    assert_eq!((faults.ticks, faults.origin), (10, None));
}

/// What drives the body, seen through its motion: p' = 0.9 p + drive + 1.
fn drive_of(mut device: Box<dyn crate::device::Device>) -> f64 {
    let (mut before, mut after) = ([0.0], [0.0]);
    device.read(0, &mut before);
    device.advance();
    device.read(0, &mut after);
    let _ = Body { position: 0.0, drive: 0.0 };
    let drive = after[0] - 0.9 * before[0] - 1.0;
    if drive.abs() < 1e-12 { 0.0 } else { drive }
}

#[test]
fn gain_is_set_while_running() {
    let (graph, _, sink) = with_processor(Trouble { from: u64::MAX, value: 0.0, panics: false });
    let (mut live, mut control) = player(plan(&graph, 8));
    live.process(40);
    control.set(id_of(sink), SettingId::at(0), 0.05).unwrap();
    let mut heard = Vec::new();
    live.process_with(30, |run, _| heard.extend_from_slice(run.tap(sink.index())));
    // 100 times the gain, from the limit of 10 down to 5 in a straight line of 20 ms.
    assert_eq!((heard[0], heard[29]), (10.0, 5.0));
    let steps = heard.windows(2).map(|pair| pair[0] - pair[1]);
    assert!(steps.clone().all(|step| (0.0..5.0).contains(&step)), "{heard:?}");
    assert!(heard[19] > 5.0 && heard[20] == 5.0, "{heard:?}");
    assert_eq!(control.set(id_of(sink), SettingId::at(1), 0.1), Err(ControlError::NotLive));
}

#[test]
fn a_stop_waits_for_no_command() {
    let graph = random_graph(3, 0);
    let (mut live, mut control) = player(plan(&graph, 4));
    // Another plan is on its way, and the ring of commands is full of it.
    while control.swap(plan(&graph, 4)).is_ok() {}
    control.stop();
    live.process(1000);
    assert_eq!(live.state(), PlayerState::Stopped);
}

/// A body that is heard when it is told so.
#[derive(Clone)]
struct Heard {
    cell: Arc<InputCell>,
}

impl Device for Heard {
    fn advance(&mut self) {}
    fn read(&mut self, _: usize, _: &mut [f64]) {}
    fn write(&mut self, _: usize, _: &[f64]) {}
    fn live_input(&self) -> Option<LiveInput> {
        Some(LiveInput { cell: Arc::clone(&self.cell), holds: false, timeout_s: 0.1 })
    }
}

/// A graph that is read again has inputs of its own, which nobody hears; the device that goes on is the one that is
/// heard.
#[test]
fn what_is_heard_stays_heard_and_what_falls_silent_is_silent_in_every_plan_that_takes_over() {
    let cells: Vec<Arc<InputCell>> = (0..3).map(|_| Arc::default()).collect();
    let plans = cells.iter().zip([1.0, 1.0, 2.0]).map(|(cell, asks)| {
        let (mut graph, node, _) = with_processor(Asks(asks));
        graph.nodes[node].fingerprint = f64::to_bits(asks);
        graph.devices[0].device = Box::new(Heard { cell: Arc::clone(cell) });
        plan(&graph, 1)
    });
    let plans: Vec<Arc<Plan>> = plans.collect();
    cells[0].set(InputState::Heard);
    let (mut live, mut control) = player(Arc::clone(&plans[0]));
    let given = |live: &Player| live.run().state.actuators[0].limiter.output()[0];
    live.process(20);
    assert!((given(&live) - 0.1).abs() < 1e-12);
    for (next, wanted) in [(1, 0.1), (2, 0.2)] {
        control.swap(Arc::clone(&plans[next])).unwrap();
        for _ in 0..40 {
            live.process(1);
            assert!(given(&live) > 0.1 - 1e-12, "plan {next}: {}", given(&live));
        }
        assert!((given(&live) - wanted).abs() < 1e-12, "plan {next}");
    }
    cells[0].set(InputState::Silent);
    (0..20).for_each(|_| live.process(1));
    assert_eq!(given(&live), 0.0);
}

#[test]
fn a_live_run_whose_costs_are_sampled_gives_the_same_bits_and_sees_its_nodes() {
    for seed in 0..20 {
        let graph = random_graph(seed, seed);
        let heard = |is_sampled: bool| {
            let plan = plan(&graph, 16);
            let taps = plan.tap_streams().count();
            let mut heard = vec![Vec::new(); taps];
            let (mut live, _control) = player(Arc::clone(&plan));
            if is_sampled {
                live.sample_costs();
            }
            for _ in 0..400 {
                live.process_with(48, |run, _| hear(run, taps, &mut heard));
            }
            (heard, cost::of_nodes(&plan))
        };
        let ((plain, nothing), (sampled, costs)) = (heard(false), heard(true));
        let bits = |heard: &[Vec<f64>]| -> Vec<u64> { heard.iter().flatten().map(|x| x.to_bits()).collect() };
        assert!(bits(&plain) == bits(&sampled), "seed {seed}");
        assert!(nothing.is_empty());
        // A clock of a graph may be too slow to tick in the few blocks that are timed.
        assert!(costs.len() * 2 > graph.nodes.node_count(), "seed {seed}: {costs:?}");
        assert!(costs.iter().all(|(_, ns)| *ns >= 0.0), "seed {seed}: {costs:?}");
    }
}

#[test]
fn a_panic_ends_an_offline_run_with_an_error_and_complete_files() {
    let (graph, _, _) = with_processor(Trouble { from: 50, value: 0.0, panics: true });
    let (sinks, heard) = listening(&graph);
    let options = SessionOptions::default().block(10).seconds(0.2);
    let ended = Session::run_offline(sinks, &options, &mut |_| {});
    assert!(matches!(ended, Err(OfflineError::Panicked)), "{ended:?}");
    assert!(heard.iter().all(|heard| heard.0.lock().unwrap().len() == 50));
}
