//! Live runs under virtual time: swaps, stops, faults and panics.

use super::world::{Body, LIMIT, random_graph, with_processor};
use crate::graph::{Graph, Node, Work};
use crate::node::{Io, Processor, Tick};
use crate::plan::{Plan, PlanOptions};
use crate::run::actuator::AnyLimiter;
use crate::run::{Change, ControlError, LiveState, Offline, Outlets, Run, live};
use petgraph::graph::NodeIndex;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

fn plan(graph: &Graph, block: usize) -> Arc<Plan> {
    let taps = graph.nodes.node_indices().map(|node| (node, 0)).collect();
    Arc::new(Plan::new(graph, &PlanOptions { block, taps }))
}

fn sink(graph: &Graph) -> Option<NodeIndex> {
    graph
        .nodes
        .node_indices()
        .find(|node| matches!(graph.nodes[*node].work, Work::Actuator { .. }))
}

/// Everything heard on all taps, frame by frame of the driver's blocks.
fn hear(run: &Run, taps: usize, heard: &mut [Vec<f64>]) {
    for (tap, heard) in heard.iter_mut().enumerate().take(taps) {
        heard.extend_from_slice(run.tap(tap));
    }
}

#[test]
fn a_swap_to_the_same_graph_changes_no_bit() {
    for seed in 0..40 {
        let graph = random_graph(seed, seed);
        let taps = graph.nodes.node_count();
        let mut all = [vec![Vec::new(); taps], vec![Vec::new(); taps]];
        for (swapping, heard) in all.iter_mut().enumerate() {
            let (mut live, mut control) = live(plan(&graph, 16));
            for block in 0..100 {
                if swapping == 1 && block % 7 == 3 {
                    control.swap(plan(&graph, 16)).unwrap();
                }
                live.callback(11, |run, _| hear(run, taps, heard));
                control.poll();
            }
            assert_eq!(control.freed(), if swapping == 1 { 14 } else { 0 });
        }
        for (a, b) in all[0].iter().zip(&all[1]) {
            assert!(
                a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits())),
                "seed {seed}"
            );
        }
    }
}

#[test]
fn another_graph_takes_over_at_the_zero_of_a_fade_and_misses_no_tick() {
    // The worlds of these seeds have the driver's clock only in common.
    for seed in 0..20 {
        let (old, new) = (random_graph(seed, seed), random_graph(seed + 500, 0));
        let (mut live, mut control) = live(plan(&old, 8));
        live.callback(100, |_, _| {});
        control.swap(plan(&new, 8)).unwrap();
        let taps = new.nodes.node_count();
        let mut heard = vec![Vec::new(); taps];
        let mut frames = 0;
        live.callback(400, |run, block| {
            frames += block;
            if run.plan.taps.len() == taps && run.driver_frames() > 116 {
                hear(run, taps, &mut heard);
            }
        });
        assert_eq!((frames, live.run().driver_frames()), (400, 500));
        // 10 ms of fade at 1 kHz: 10 frames, to the end of the block of 8 that holds the last one.
        let mut alone = Run::new(plan(&new, 8));
        alone.state.windows.start_at(live_change_frame(100));
        alone.fade_in(super::super::FADE_S);
        let mut expected = vec![Vec::new(); taps];
        while alone.driver_frames() < 500 {
            let left = 500 - alone.driver_frames() as usize;
            alone.advance(left.min(8));
            if alone.driver_frames() > 116 {
                hear(&alone, taps, &mut expected);
            }
        }
        for (node, (a, b)) in new.nodes.node_weights().zip(heard.iter().zip(&expected)) {
            assert_eq!(a, b, "seed {seed}, {}", node.path);
        }
    }
}

/// Where a swap asked for at `frame` happens: the first end of a block of 8 at which ten frames of fade are over.
fn live_change_frame(frame: u64) -> u64 {
    frame + 16
}

#[test]
fn a_sink_by_another_name_is_as_warm_as_the_one_it_replaces() {
    let seed = (0..)
        .find(|seed| sink(&random_graph(*seed, 0)).is_some())
        .unwrap();
    let (old, mut new) = (random_graph(seed, 0), random_graph(seed, 0));
    let at = sink(&new).unwrap();
    new.nodes[at].path = String::from("renamed");
    new.nodes[at].fingerprint += 1;
    let (mut live, mut control) = live(plan(&old, 8));
    live.callback(500, |_, _| {});
    let warm = live.run().state.actuators[0].limiter.counts().ticks;
    control.swap(plan(&new, 8)).unwrap();
    live.callback(500, |_, _| {});
    assert_eq!(live.run().plan.actuators[0].path, "renamed");
    let limiter = &live.run().state.actuators[0].limiter;
    assert!(limiter.counts().ticks > warm);
    // Of a device that the old graph did not drive nobody knows how warm it is.
    let mut other = random_graph(seed, 0);
    other.nodes[at].fingerprint += 2;
    other.nodes[at].path = String::from("renamed again");
    other.devices[0].name = String::from("another");
    control.swap(plan(&other, 8)).unwrap();
    while live.run().plan.actuators[0].path != "renamed again" {
        live.callback(1, |_, _| {});
    }
    let AnyLimiter::One(limiter) = &live.run().state.actuators[0].limiter else {
        panic!("a scalar sink");
    };
    assert!(limiter.mean_square() > 0.99 * LIMIT.continuous * LIMIT.continuous);
}

#[test]
fn a_thousand_swaps_come_home_and_leave_nothing() {
    let graphs = [random_graph(1, 1), random_graph(2, 2)];
    let (mut live, mut control) = live(plan(&graphs[0], 32));
    for swap in 0..1000 {
        control.swap(plan(&graphs[(swap + 1) % 2], 32)).unwrap();
        live.callback(64, |_, _| {});
        control.poll();
    }
    live.callback(64, |_, _| {});
    control.poll();
    assert_eq!((control.freed(), live.unreported()), (1000, 0));
}

#[test]
fn a_stop_fades_out_and_then_nothing_runs() {
    let graph = (0..)
        .map(|seed| random_graph(seed, 0))
        .find(|graph| sink(graph).is_some())
        .unwrap();
    let sink = sink(&graph).unwrap().index();
    let (mut live, mut control) = live(plan(&graph, 4));
    live.callback(200, |_, _| {});
    control.stop().unwrap();
    let mut last = f64::INFINITY;
    live.callback(1000, |run, _| {
        last = run.tap(sink).last().copied().unwrap_or(last)
    });
    assert_eq!(live.state(), LiveState::Stopped);
    assert!(live.frames() <= 200 + 16);
    let most = LIMIT.peak / 10.0;
    assert!(
        last.abs() <= most,
        "{last} is more than a tenth of the fade leaves"
    );
}

#[test]
fn a_swap_that_is_refused_changes_nothing() {
    let (graph, _, _) = with_processor(Box::new(Clinging));
    let (mut live, mut control) = live(plan(&graph, 8));
    while control.set_by_name("n37.gain", 0.2).is_ok() {}
    let running = Arc::clone(control.plan());
    assert_eq!(control.swap(plan(&graph, 8)), Err(ControlError::Full));
    assert!(Arc::ptr_eq(&running, control.plan()));
    live.callback(8, |_, _| {});
    control.poll();
    assert_eq!(control.freed(), 0);
    assert_eq!(control.swap(plan(&graph, 8)), Ok(Change::Settings(1)));
}

#[test]
fn a_panic_in_a_swap_takes_the_actuators_to_zero_too() {
    let (old, _, _) = with_processor(Box::new(Clinging));
    let (mut new, node, _) = with_processor(Box::new(Clinging));
    new.nodes[node].fingerprint += 1;
    let (mut live, mut control) = live(plan(&old, 8));
    live.callback(80, |_, _| {});
    control.swap(plan(&new, 8)).unwrap();
    quietly(|| live.callback(80, |_, _| {}));
    assert_eq!(live.state(), LiveState::Panicked);
    live.callback(80, |_, _| {});
    assert!(live.is_at_rest());
}

/// Panics when it has to hand its state on.
#[derive(Clone)]
struct Clinging;

impl Processor for Clinging {
    fn process(&mut self, _: &Tick, io: &mut Io<'_>) {
        io.out(0).fill(100.0);
    }

    fn copy_state_into(&self, _: &mut dyn Processor) {
        panic!("as asked");
    }
}

/// Without the message of a panic that is meant to happen.
fn quietly(run: impl FnOnce()) {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    run();
    std::panic::set_hook(hook);
}

/// Puts out what it is told to from a tick on.
#[derive(Clone)]
struct Trouble {
    from: u64,
    value: f64,
    panics: bool,
}

impl Processor for Trouble {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_>) {
        assert!(!self.panics || tick.first < self.from, "as asked");
        for (j, out) in io.out(0).iter_mut().enumerate() {
            *out = if tick.first + j as u64 >= self.from {
                self.value
            } else {
                100.0
            };
        }
    }
}

#[test]
fn what_is_not_a_number_becomes_zero_at_the_sink_and_is_traced_to_its_node() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let trouble = Trouble {
            from: 50,
            value,
            panics: false,
        };
        let (graph, node, sink) = with_processor(Box::new(trouble));
        let (mut live, _control) = live(plan(&graph, 8));
        let mut heard = vec![Vec::new(); 3];
        live.callback(100, |run, _| hear(run, 3, &mut heard));
        let drive = &heard[sink.index()];
        assert!(drive[20..50].iter().all(|x| *x == 10.0), "{drive:?}");
        assert!(drive[50..].iter().all(|x| *x == 0.0));
        assert_eq!(live.faults().origin, Some(node));
        assert!(live.faults().ticks > 0);
    }
}

#[test]
fn a_panic_takes_the_actuators_to_zero_outside_the_plan() {
    let trouble = Trouble {
        from: 50,
        value: 0.0,
        panics: true,
    };
    let (graph, _, _) = with_processor(Box::new(trouble));
    let (mut live, _control) = live(plan(&graph, 1));
    quietly(|| live.callback(51, |_, _| {}));
    assert_eq!(live.state(), LiveState::Panicked);
    let drive = |run: &Run| run.state.devices[0].device.clone_box();
    let mut drives = Vec::new();
    for _ in 0..12 {
        live.callback(1, |_, _| {});
        drives.push(drive_of(drive(live.run())));
    }
    assert!(drives[0] > 5.0 && drives[0] < 10.0, "{drives:?}");
    assert!(
        drives.windows(2).all(|pair| pair[1] < pair[0] || pair[1] == 0.0),
        "{drives:?}"
    );
    assert_eq!(drives[11], 0.0);
}

#[test]
fn what_is_not_a_number_is_traced_to_the_same_node_whatever_the_block_and_the_threads() {
    /// Once only not a number: gone when the sink has seen it.
    #[derive(Clone)]
    struct Once;
    impl Processor for Once {
        fn process(&mut self, tick: &Tick, io: &mut Io<'_>) {
            for (j, out) in io.out(0).iter_mut().enumerate() {
                *out = if tick.first + j as u64 == 50 {
                    f64::NAN
                } else {
                    1.0
                };
            }
        }
    }
    let (graph, node, _) = with_processor(Box::new(Once));
    for (block, threads) in [(1, 1), (7, 1), (64, 1), (64, 2), (1000, 3)] {
        let offline = Offline::new(Outlets::new(&graph), block).threads(threads);
        let outcome = offline.run(0.2, &AtomicBool::new(false), &mut |_| {}).unwrap();
        assert_eq!((outcome.faults.ticks, outcome.faults.origin), (1, Some(node)));
    }
}

/// A graph in which a processor that leads nowhere puts out no number long before the one that the sink reads.
fn with_bystander() -> (Graph, NodeIndex) {
    let trouble = |from| Trouble {
        from,
        value: f64::NAN,
        panics: false,
    };
    let (mut graph, node, _) = with_processor(Box::new(trouble(50)));
    let blamed = &graph.nodes[node];
    let bystander = Node {
        path: String::from("bystander"),
        entry: blamed.entry,
        clock: blamed.clock,
        inputs: Vec::new(),
        outputs: blamed.outputs.clone(),
        work: Work::Process(Box::new(trouble(10))),
        span: blamed.span,
        simulated: false,
        fingerprint: 1,
        live: Vec::new(),
        files: Vec::new(),
    };
    graph.nodes.add_node(bystander);
    (graph, node)
}

#[test]
fn a_node_that_leads_to_no_sink_is_not_blamed() {
    let (graph, node) = with_bystander();
    for (block, threads) in [(1, 1), (64, 1), (64, 2)] {
        let offline = Offline::new(Outlets::new(&graph), block).threads(threads);
        let outcome = offline.run(0.1, &AtomicBool::new(false), &mut |_| {}).unwrap();
        assert_eq!(
            outcome.faults.origin,
            Some(node),
            "block {block}, {threads} threads"
        );
    }
}

#[test]
fn a_stopped_run_does_not_look_for_who_is_to_blame() {
    let (graph, _) = with_bystander();
    let stop = AtomicBool::new(false);
    let offline = Offline::new(Outlets::new(&graph), 60);
    let outcome = offline.run(1e7, &stop, &mut |_| stop.store(true, Ordering::Relaxed));
    let faults = outcome.unwrap().faults;
    assert_eq!((faults.ticks, faults.origin), (10, None));
}

/// What drives the body, seen through its motion: p' = 0.9 p + drive + 1.
fn drive_of(mut device: Box<dyn crate::device::Device>) -> f64 {
    let (mut before, mut after) = ([0.0], [0.0]);
    device.read(0, &mut before);
    device.advance();
    device.read(0, &mut after);
    let _ = Body {
        position: 0.0,
        drive: 0.0,
    };
    let drive = after[0] - 0.9 * before[0] - 1.0;
    if drive.abs() < 1e-12 { 0.0 } else { drive }
}

#[test]
fn gain_is_set_while_running() {
    let (graph, _, sink) = with_processor(Box::new(Trouble {
        from: u64::MAX,
        value: 0.0,
        panics: false,
    }));
    let (mut live, mut control) = live(plan(&graph, 8));
    live.callback(40, |_, _| {});
    control.set(sink, 0, 0.05).unwrap();
    let mut heard = Vec::new();
    live.callback(30, |run, _| heard.extend_from_slice(run.tap(sink.index())));
    // 100 times the gain, from the limit of 10 down to 5 in a straight line of 20 ms.
    assert_eq!((heard[0], heard[29]), (10.0, 5.0));
    let steps = heard.windows(2).map(|pair| pair[0] - pair[1]);
    assert!(steps.clone().all(|step| (0.0..5.0).contains(&step)), "{heard:?}");
    assert!(heard[19] > 5.0 && heard[20] == 5.0, "{heard:?}");
    assert_eq!(control.set(sink, 1, 0.1), Err(ControlError::NotLive));
}
