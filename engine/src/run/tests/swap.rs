//! One graph in the place of another, under virtual time.

use super::naive;
use super::player::{Trouble, hear, panic_quietly, plan, sink};
use super::world::{LIMIT, Nothing, as_leaky, random_graph, with_delays, with_processor};
use crate::graph::{Bridge, Graph, Work};
use crate::node::{Io, Processor, Tick};
use crate::plan::Plan;
use crate::run::actuator::AnyLimiter;
use crate::run::{
    Change, Control, ControlError, FADE_S, NoCrossFade, Player, PlayerState, Run, Wake, player,
};
use petgraph::graph::NodeIndex;
use std::sync::Arc;

#[test]
fn a_swap_to_the_same_graph_changes_no_bit() {
    for seed in 0..40 {
        let graph = random_graph(seed, seed);
        let taps = graph.nodes.node_count();
        let mut all = [vec![Vec::new(); taps], vec![Vec::new(); taps]];
        for (swapping, heard) in all.iter_mut().enumerate() {
            let (mut live, mut control) = player(plan(&graph, 16));
            for block in 0..100 {
                if swapping == 1 && block % 7 == 3 {
                    control.swap(plan(&graph, 16)).unwrap();
                }
                live.process_with(11, |run, _| hear(run, taps, heard));
                control.poll();
            }
            assert_eq!(control.freed(), if swapping == 1 { 14 } else { 0 });
        }
        for (a, b) in all[0].iter().zip(&all[1]) {
            assert!(a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits())), "seed {seed}");
        }
    }
}

/// What every node of `new` puts out when it is put in the place of `old` at frame `at`, up to frame `frames`; before,
/// what the node of that number of `old` does.
fn swapped(old: &Graph, new: &Graph, at: usize, frames: usize) -> (Change, Vec<Vec<f64>>) {
    let taps = new.nodes.node_count();
    let mut heard = vec![Vec::new(); taps];
    let (mut live, mut control) = player(plan(old, 8));
    live.process_with(at, |run, _| hear(run, taps, &mut heard));
    let change = control.swap(plan(new, 8)).unwrap();
    live.process_with(frames - at, |run, _| hear(run, taps, &mut heard));
    assert_eq!(live.run().driver_frames(), frames as u64, "no tick is missed");
    (change, heard)
}

/// The same nodes with other weights, all of them or every second one, and another gain.
fn with_other_weights(seed: u64) -> Graph {
    let mut graph = random_graph(seed, seed);
    for (number, node) in graph.nodes.node_weights_mut().enumerate() {
        match &mut node.work {
            Work::Process(_) if (seed & 1) == 0 || (number & 1) == 0 => {
                as_leaky(&mut node.work).unwrap().weight = 0.4;
                node.fingerprint += 1;
            }
            Work::Actuator { gain, .. } => *gain = -0.07,
            _ => {}
        }
    }
    graph
}

#[test]
fn another_graph_rises_over_the_one_that_runs_as_the_definition_says() {
    let (mut faded, mut through_bodies) = (0, 0);
    for seed in 0..80 {
        let (old, new) = (random_graph(seed, seed), with_other_weights(seed));
        let (change, heard) = swapped(&old, &new, 203, 400);
        if !matches!(change, Change::CrossFade | Change::AtOnce) {
            continue;
        }
        faded += 1;
        through_bodies += usize::from(sink(&new).is_some());
        // 10 ms at 1 kHz.
        let expected = naive::cross_fade(&old, &new, 203, 10, 400);
        for (node, (a, b)) in new.nodes.node_weights().zip(heard.iter().zip(&expected)) {
            assert_eq!(a.len(), b.len(), "seed {seed}, {}", node.path);
            for (tick, (a, b)) in a.iter().zip(b).enumerate() {
                let close = (a - b).abs() <= 1e-9 * b.abs().max(1.0);
                assert!(close, "seed {seed}, {} at tick {tick}: {a} against {b}", node.path);
            }
        }
    }
    assert!(faded >= 30 && through_bodies >= 15, "{faded}, {through_bodies} through bodies");
}

#[test]
fn a_graph_that_computes_the_same_takes_over_unheard() {
    let mut faded = 0;
    for seed in 0..80 {
        let (old, mut new) = (random_graph(seed, seed), random_graph(seed, seed));
        new.nodes.node_weights_mut().for_each(|node| node.fingerprint += 1);
        let (change, heard) = swapped(&old, &new, 203, 400);
        faded += usize::from(change == Change::CrossFade);
        if change == Change::CrossFade {
            for (a, b) in heard.iter().zip(naive::evaluate(&old, 400)) {
                assert!(
                    a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 1e-9 * b.abs().max(1.0)),
                    "seed {seed}"
                );
            }
        }
    }
    assert!(faded >= 30, "{faded}");
}

#[test]
fn where_they_cannot_run_together_the_new_one_begins_at_the_zero_of_a_fade() {
    let mut seen = 0;
    for seed in 0..40 {
        // These have nothing but the driver's clock in common.
        let (old, mut new) = (random_graph(seed, seed), random_graph(seed + 500, 0));
        new.nodes.node_weights_mut().for_each(|node| node.path.insert_str(0, "new "));
        let (mut live, mut control) = player(plan(&old, 8));
        live.process(100);
        if control.swap(plan(&new, 8)) != Ok(Change::FadeThroughZero(NoCrossFade::Actuators)) {
            continue;
        }
        seen += 1;
        // Ten frames of fade, to the end of the block of eight that holds the last one.
        let begin = 116;
        let taps = new.nodes.node_count();
        let mut heard = [vec![Vec::new(); taps], vec![Vec::new(); taps]];
        live.process_with(400, |run, _| {
            if run.driver_frames() > begin {
                hear(run, taps, &mut heard[0]);
            }
        });
        let mut alone = Run::new(plan(&new, 8));
        alone.state.windows.start_at(begin);
        alone.fade_in(FADE_S);
        while alone.driver_frames() < 500 {
            alone.advance(8);
            hear(&alone, taps, &mut heard[1]);
        }
        for (node, (a, b)) in new.nodes.node_weights().zip(heard[0].iter().zip(&heard[1])) {
            // The new one's actuator begins with its heat spent, which takes a billionth of a limit that is the peak.
            let close = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-8 * b.abs().max(1.0);
            assert!(a.len() == b.len() && a.iter().zip(b).all(close), "seed {seed}, {}", node.path);
        }
    }
    assert!(seen >= 15, "{seen}");
}

/// Puts out a number from the beginning.
fn constant(value: f64) -> Trouble {
    Trouble { from: 0, value, panics: false }
}

/// Puts out 100 and panics at 25 ms.
const PANIC: Trouble = Trouble { from: 25, value: 0.0, panics: true };

/// What the body is given, frame by frame, where one graph fades into another after 20 ms; at frame `at` something is
/// done. The gain is a tenth.
fn faded(old: Trouble, new: Trouble, at: usize, and: impl Fn(&mut Control)) -> (Player, Vec<f64>) {
    let (before, _, sink) = with_processor(old);
    let (mut after, node, _) = with_processor(new);
    after.nodes[node].fingerprint += 1;
    let (mut live, mut control) = player(plan(&before, 8));
    let mut given = Vec::new();
    for frame in 0..100 {
        if frame == 20 {
            assert_eq!(control.swap(plan(&after, 8)), Ok(Change::CrossFade));
        }
        if frame == at {
            and(&mut control);
        }
        live.process_with(1, |run, _| given.extend_from_slice(run.tap(sink.index())));
    }
    (live, given)
}

#[test]
fn one_constant_becomes_another_in_a_straight_line() {
    let (_, given) = faded(constant(100.0), constant(-50.0), 0, |_| {});
    for (frame, given) in given.iter().enumerate() {
        let share = (frame as f64 - 20.0).clamp(0.0, 10.0) / 10.0;
        assert!((given - (10.0 - 15.0 * share)).abs() < 1e-12, "{given} at {frame}");
    }
}

#[test]
fn from_what_is_no_number_the_new_graph_rises_from_zero() {
    let (_, given) = faded(constant(f64::NAN), constant(100.0), 0, |_| {});
    assert!(given[..21].iter().all(|x| *x == 0.0), "{given:?}");
    let mut pairs = given.windows(2);
    assert!(pairs.all(|pair| (0.0..1.0 + 1e-12).contains(&(pair[1] - pair[0]))), "{given:?}");
    assert_eq!(given[30], 10.0);
}

#[test]
fn a_stop_in_the_middle_of_a_cross_fade_is_a_stop() {
    let (live, given) = faded(constant(100.0), constant(90.0), 25, |control| control.stop());
    assert_eq!((live.state(), given.len()), (PlayerState::Stopped, 36));
    assert!(given.windows(2).all(|pair| (pair[1] - pair[0]).abs() <= 1.1), "{given:?}");
    assert_eq!(given[35], 0.0);
}

#[test]
fn a_panic_of_either_graph_in_a_cross_fade_takes_the_actuators_to_zero() {
    for (old, new) in [(PANIC, constant(100.0)), (constant(100.0), PANIC)] {
        let (live, given) = faded(old, new, 0, |_| {});
        assert_eq!((live.state(), given.len()), (PlayerState::Panicked, 25));
        assert!(live.is_idle());
    }
}

#[test]
fn swaps_in_a_row_wait_for_each_other() {
    let (graph, _, sink) = with_processor(constant(100.0));
    let (mut live, mut control) = player(plan(&graph, 8));
    for swap in 1..=6 {
        let (mut next, node, _) = with_processor(constant(100.0 - 10.0 * f64::from(swap)));
        next.nodes[node].fingerprint += swap as u64;
        assert_eq!(control.swap(plan(&next, 8)), Ok(Change::CrossFade));
    }
    let mut given = Vec::new();
    for _ in 0..100 {
        live.process_with(1, |run, _| given.extend_from_slice(run.tap(sink.index())));
    }
    for (frame, given) in given.iter().enumerate() {
        let expected = 10.0 - (frame as f64 / 10.0).min(6.0);
        assert!((given - expected).abs() < 1e-12, "{given} at {frame}");
    }
    control.poll();
    assert_eq!(control.freed(), 6);
}

#[test]
fn where_an_actuator_changes_the_outputs_fall_to_zero_and_rise_again() {
    // One driven at the driver's clock.
    let seed = (0..)
        .find(|seed| random_graph(*seed, 0).devices.first().is_some_and(|device| device.clock == 0))
        .unwrap();
    let (old, mut new) = (random_graph(seed, 0), random_graph(seed, 0));
    let at = sink(&new).unwrap();
    let Work::Actuator { limit, .. } = &mut new.nodes[at].work else {
        panic!("a sink");
    };
    limit.peak /= 2.0;
    limit.continuous /= 2.0;
    let (change, heard) = swapped(&old, &new, 200, 400);
    assert_eq!(change, Change::FadeThroughZero(NoCrossFade::Actuators));
    let (fade, drive) = ((FADE_S * 1e3) as usize, &heard[at.index()]);
    // To the end of the block in which the fade is over.
    let zero = (200..200 + fade + 8).position(|tick| drive[tick] == 0.0);
    assert!(zero.is_some(), "{:?}", &drive[195..240]);
    assert!(drive[200 + 2 * fade + 8..].iter().all(|x| x.abs() <= LIMIT.peak / 2.0));
    assert!(drive[200 + 2 * fade + 8..].iter().any(|x| *x != 0.0));
}

#[test]
fn an_actuator_that_the_new_graph_does_not_drive_comes_to_rest_first() {
    let find = |driven| {
        let mut graphs = (0..).map(|seed| random_graph(seed, 0));
        graphs.find(|graph| sink(graph).is_some() == driven).unwrap()
    };
    let (with, without) = (find(true), find(false));
    let reason = |old: &Graph, new: &Graph| swapped(old, new, 50, 100).0;
    assert_eq!(reason(&with, &without), Change::FadeThroughZero(NoCrossFade::Actuators));
    assert_eq!(reason(&without, &with), Change::CrossFade);
}

#[test]
fn a_device_that_ticks_faster_than_the_driver_is_not_shared() {
    let period = |graph: &Graph, clock| graph.base.period(clock);
    let fast = |seed: &u64| {
        let graph = random_graph(*seed, 0);
        let device = graph.devices.first();
        device.is_some_and(|device| period(&graph, device.clock) < period(&graph, 0))
    };
    let seed = (0..).find(fast).unwrap();
    let mut new = random_graph(seed, 0);
    new.nodes.node_weights_mut().for_each(|node| node.fingerprint += 1);
    let (change, _) = swapped(&random_graph(seed, 0), &new, 50, 100);
    assert_eq!(change, Change::FadeThroughZero(NoCrossFade::FastDevice));
    // Nor does it begin beside a graph that drives nothing.
    let nothing = (0..).map(|seed| random_graph(seed, 0)).find(|graph| sink(graph).is_none());
    let (change, _) = swapped(&nothing.unwrap(), &new, 50, 100);
    assert_eq!(change, Change::FadeThroughZero(NoCrossFade::FastDevice));
}

/// A hundred, and a tenth of it for a body, within another limit each time.
fn limited(peak: f64) -> (Arc<Plan>, NodeIndex) {
    let (mut graph, _, sink) = with_processor(constant(100.0));
    let Work::Actuator { limit, .. } = &mut graph.nodes[sink].work else {
        panic!("a sink");
    };
    limit.peak = peak;
    limit.continuous = peak;
    (plan(&graph, 1), sink)
}

/// No frame differs from the one before by more than a fade's.
fn assert_no_step(given: &[f64]) {
    let mut pairs = given.windows(2);
    assert!(pairs.all(|pair| (pair[1] - pair[0]).abs() <= 1.0 + 1e-9), "{given:?}");
}

#[test]
fn a_fall_begins_where_a_rise_has_come_to() {
    for again in 20..60 {
        let (mut live, mut control) = player(limited(50.0).0);
        let mut given = Vec::new();
        for frame in 0..120 {
            for (at, peak) in [(20, 40.0), (again, 45.0)] {
                if frame == at {
                    assert_eq!(
                        control.swap(limited(peak).0),
                        Ok(Change::FadeThroughZero(NoCrossFade::Actuators))
                    );
                }
            }
            live.process_with(1, |run, _| given.extend_from_slice(run.tap(limited(50.0).1.index())));
        }
        assert_no_step(&given);
        assert!(given.contains(&0.0) && given[119] == 10.0, "{given:?}");
    }
}

#[test]
fn after_a_pause_of_the_driver_nothing_begins_at_once() {
    // The change was asked for before the pause, in it, or is under way.
    for asked in [0, 16, 20] {
        let (mut live, mut control) = player(limited(50.0).0);
        let mut given = Vec::new();
        for frame in 0..80 {
            if frame == asked {
                control.swap(limited(40.0).0).unwrap();
            }
            if frame == 20 {
                live.resume();
                given.clear();
                given.push(0.0);
            }
            live.process_with(1, |run, _| given.extend_from_slice(run.tap(limited(50.0).1.index())));
        }
        assert_no_step(&given);
        assert_eq!(given.last(), Some(&10.0));
    }
}

#[test]
fn where_there_is_no_time_for_both_one_waits_for_the_other() {
    let (old, mut new) = (random_graph(3, 3), random_graph(3, 3));
    new.nodes.node_weights_mut().for_each(|node| node.fingerprint += 1);
    // A millisecond for each frame.
    for (work_ns, wanted) in
        [(50_000, Change::CrossFade), (100_000, Change::FadeThroughZero(NoCrossFade::Load))]
    {
        let (mut live, mut control) = player(plan(&old, 8));
        live.report(Wake { work_ns, frames: 1, ..Wake::default() });
        control.poll();
        assert_eq!(control.swap(plan(&new, 8)), Ok(wanted));
    }
}

/// Counts milliseconds.
#[derive(Clone)]
struct Counts;

impl Processor<Nothing> for Counts {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Nothing>) {
        let frames = io.ports.out(0).iter_mut().enumerate();
        frames.for_each(|(j, out)| *out = 1e-3 * (tick.first + j as u64) as f64);
    }
}

/// Drives a body by the time that it was so many frames ago.
fn delayed(frames: u64, fingerprint: u64) -> (Graph, NodeIndex) {
    let (mut graph, node, sink) = with_processor(Counts);
    graph.nodes[node].fingerprint += fingerprint;
    let edge = graph.nodes.find_edge(node, sink).unwrap();
    graph.nodes[edge].bridge = Bridge::Delay { frames, initial: None };
    (graph, sink)
}

#[test]
fn a_long_delay_changes_places_and_is_not_copied() {
    // The longest that is copied, and one more.
    for (frames, moves) in [(65_536, false), (65_537, true)] {
        let ((old, sink), (new, _)) = (delayed(frames, 0), delayed(frames, 1));
        let (mut live, mut control) = player(plan(&old, 1024));
        live.process(500);
        let ring = |live: &Player| live.run().state.delays[0].ring.as_ptr();
        let before = ring(&live);
        let expected = match moves {
            true => Change::FadeThroughZero(NoCrossFade::Delays),
            false => Change::CrossFade,
        };
        assert_eq!(control.swap(plan(&new, 1024)), Ok(expected));
        live.process(100);
        assert_eq!(ring(&live) == before, moves);
        // What the old graph wrote comes out of the new one.
        live.process(frames as usize - 500);
        let mut given = Vec::new();
        live.process_with(200, |run, _| given.extend_from_slice(run.tap(sink.index())));
        assert_eq!(given.len(), 200);
        for (frame, given) in given.iter().enumerate() {
            let expected = 0.1 * 1e-3 * (100 + frame) as f64;
            assert!((given - expected).abs() < 1e-12, "{given} at {frame}");
        }
    }
}

#[test]
fn of_several_delays_that_go_on_as_one_each_has_what_it_held() {
    let (old, new) = (with_delays(Counts, 1, 70_000), with_delays(Counts, 3, 70_000));
    let (mut live, mut control) = player(plan(&old, 1024));
    live.process(500);
    let address = live.run().state.delays[0].ring.as_ptr();
    let held = live.run().state.delays[0].ring.clone();
    control.swap(plan(&new, 1024)).unwrap();
    while live.run().plan.delays.len() == 1 {
        live.process(1);
    }
    let delays = &live.run().state.delays;
    assert_eq!(delays.iter().filter(|delay| delay.ring.as_ptr() == address).count(), 1);
    for delay in delays {
        assert_eq!(delay.ring[..500], held[..500]);
        assert!(delay.ring[500..600].iter().any(|x| *x != 0.0));
    }
}

#[test]
fn a_sink_by_another_name_is_as_warm_as_the_one_it_replaces() {
    let seed = (0..).find(|seed| sink(&random_graph(*seed, 0)).is_some()).unwrap();
    let (old, mut new) = (random_graph(seed, 0), random_graph(seed, 0));
    let at = sink(&new).unwrap();
    new.nodes[at].path = String::from("renamed");
    new.nodes[at].fingerprint += 1;
    let (mut live, mut control) = player(plan(&old, 8));
    live.process(500);
    let warm = live.run().state.actuators[0].limiter.counts().ticks;
    control.swap(plan(&new, 8)).unwrap();
    live.process(500);
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
        live.process(1);
    }
    let AnyLimiter::One(limiter) = &live.run().state.actuators[0].limiter else {
        panic!("a scalar sink");
    };
    assert!(limiter.mean_square() > 0.99 * LIMIT.continuous * LIMIT.continuous);
}

#[test]
fn a_thousand_swaps_come_home_and_leave_nothing() {
    let graphs = [random_graph(1, 1), random_graph(2, 2)];
    let (mut live, mut control) = player(plan(&graphs[0], 32));
    for swap in 0..1000 {
        control.swap(plan(&graphs[(swap + 1) % 2], 32)).unwrap();
        live.process(64);
        control.poll();
    }
    live.process(64);
    control.poll();
    assert_eq!((control.freed(), live.unreported()), (1000, 0));
}

#[test]
fn a_swap_that_is_refused_changes_nothing() {
    let (graph, _, _) = with_processor(Clinging);
    let (mut live, mut control) = player(plan(&graph, 8));
    let gain = control.settings().iter().find(|live| live.name() == "n37.gain").unwrap();
    let (node, setting) = (gain.node, gain.setting);
    while control.set(node, setting, 0.2).is_ok() {}
    let running = Arc::clone(control.plan());
    assert_eq!(control.swap(plan(&graph, 8)), Err(ControlError::Full));
    assert!(Arc::ptr_eq(&running, control.plan()));
    live.process(8);
    control.poll();
    assert_eq!(control.freed(), 0);
    assert_eq!(control.swap(plan(&graph, 8)), Ok(Change::Settings(1)));
}

#[test]
fn a_panic_in_a_swap_takes_the_actuators_to_zero_too() {
    let (old, _, _) = with_processor(Clinging);
    let (mut new, node, _) = with_processor(Clinging);
    new.nodes[node].fingerprint += 1;
    let (mut live, mut control) = player(plan(&old, 8));
    live.process(80);
    control.swap(plan(&new, 8)).unwrap();
    live.process(80);
    assert_eq!(live.state(), PlayerState::Panicked);
    live.process(80);
    assert!(live.is_idle());
}

/// Panics when it has to hand its state on.
#[derive(Clone)]
struct Clinging;

impl Processor<Nothing> for Clinging {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Nothing>) {
        io.ports.out(0).fill(100.0);
    }

    fn copy_state_into(&self, _: &mut Self) {
        panic_quietly();
    }
}
