//! What a real device gets before it is armed, while it is, and after.

use super::heat::{Asks, Coil, RealCoil};
use super::world::with_processor;
use crate::device::DeviceEntry;
use crate::graph::{Graph, Work};
use crate::node::Limit;
use crate::run::{
    ARM_FALL_S, ARM_HOLD_S, ARM_RISE_S, ArmSwitch, Change, FADE_S, FileSinks, Player, Session, SessionOptions,
};
use std::path::Path;
use std::sync::Arc;

const RATE_HZ: f64 = 1000.0;

/// A graph that asks a coil, real or simulated, for 0.5, by a gain of 0.1.
fn graph(coil: &Coil, real: bool, slew_per_s: Option<f64>) -> Graph {
    graph_of(1, coil, real, slew_per_s)
}

/// The same as another edit of it.
fn graph_of(edit: u64, coil: &Coil, real: bool, slew_per_s: Option<f64>) -> Graph {
    let (mut graph, node, sink) = with_processor(Asks(5.0));
    graph.nodes[node].fingerprint = edit;
    if let Work::Actuator { limit, .. } = &mut graph.nodes[sink].work {
        *limit = Limit { peak: 1.0, continuous: 1.0, window_s: 1.0, slew_per_s };
    }
    graph.devices[0].device = Box::new(coil.clone());
    if real {
        graph.devices[0].entry = DeviceEntry::of::<RealCoil>();
    }
    graph
}

struct Rig {
    coil: Coil,
    switch: Arc<ArmSwitch>,
    live: Player,
    session: Session,
}

impl Rig {
    fn new(real: bool, slew_per_s: Option<f64>) -> Self {
        let (coil, switch) = (Coil::default(), Arc::new(ArmSwitch::default()));
        let graph = graph(&coil, real, slew_per_s);
        let options =
            SessionOptions { rested: true, arm: Some(Arc::clone(&switch)), ..SessionOptions::default() };
        let (live, session) = Session::open(FileSinks::new(&graph), &options).unwrap();
        Self { coil, switch, live, session }
    }

    /// What the coil gets in so many ticks, while somebody holds it armed or not.
    fn given(&mut self, seconds: f64, is_held: bool) -> Vec<f64> {
        let ticks = (seconds * RATE_HZ).round() as usize;
        let tick = |_| {
            if is_held {
                self.switch.hold();
            }
            self.live.process(1);
            self.coil.given()
        };
        (0..ticks).map(tick).collect()
    }
}

fn steepest(given: &[f64]) -> f64 {
    let steps = given.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    steps.fold(0.0, f64::max)
}

fn is_zero(given: &[f64]) -> bool {
    given.iter().all(|x| x.to_bits() == 0)
}

#[test]
fn a_real_device_gets_zeros_until_it_is_armed_and_rises_slowly_then() {
    let mut rig = Rig::new(true, None);
    assert!(is_zero(&rig.given(0.5, true)), "holding is not arming");
    rig.switch.arm(0.2);
    let rise = rig.given(ARM_RISE_S, true);
    assert!(steepest(&rise) < 0.5 / (ARM_RISE_S * RATE_HZ) * 1.01);
    assert!((rise[rise.len() - 1] - 0.1).abs() < 1e-12 && rise[0] < 0.001);
    rig.switch.set_gain(7.0);
    let rise = rig.given(ARM_RISE_S, true);
    assert!(steepest(&rise) < 0.5 / (ARM_RISE_S * RATE_HZ) * 1.01);
    assert!((rise[rise.len() - 1] - 0.5).abs() < 1e-12);
}

#[test]
fn a_simulated_device_needs_no_arming() {
    let given = Rig::new(false, None).given(0.1, false);
    assert!(given.iter().all(|x| *x == 0.5), "{given:?}");
}

#[test]
fn disarming_takes_it_to_zero_in_the_stated_time_and_holding_does_not_end_that() {
    for gain in [0.0, -1.0, f64::NAN] {
        let mut rig = Rig::new(true, None);
        rig.switch.arm(1.0);
        assert!(rig.given(ARM_RISE_S + 0.01, true).ends_with(&[0.5]));
        // NaN and what is not above zero arm nothing.
        rig.switch.arm(gain);
        let fall = rig.given(ARM_FALL_S, true);
        assert!(steepest(&fall) < 0.5 / (ARM_FALL_S * RATE_HZ) * 1.01 && fall[0] > 0.4, "{fall:?}");
        rig.switch.set_gain(1.0);
        assert!(is_zero(&rig.given(1.0, true)) && !rig.switch.is_armed());
    }
}

#[test]
fn whoever_stops_holding_it_has_disarmed_it() {
    let mut rig = Rig::new(true, None);
    rig.switch.arm(1.0);
    rig.given(ARM_RISE_S + 0.01, true);
    let given = rig.given(ARM_HOLD_S, false);
    assert!(given.iter().all(|x| *x == 0.5) && rig.switch.is_armed());
    rig.given(ARM_FALL_S + 0.002, false);
    assert!(!rig.switch.is_armed());
    assert!(is_zero(&rig.given(1.0, true)), "it takes another press");
    rig.switch.arm(1.0);
    assert!(!is_zero(&rig.given(0.1, true)));
}

#[test]
fn the_slew_limit_holds_behind_the_gate_too() {
    let mut rig = Rig::new(true, Some(2.0));
    rig.switch.arm(1.0);
    let mut given = rig.given(ARM_RISE_S + 0.3, true);
    assert!(given.ends_with(&[0.5]));
    rig.switch.disarm();
    let fall = rig.given(0.5 / 2.0 + ARM_FALL_S, true);
    assert!(fall.ends_with(&[0.0]), "{fall:?}");
    given.extend(fall);
    assert!(steepest(&given) < 2.0 / RATE_HZ * (1.0 + 1e-9));
}

#[test]
fn a_panic_while_it_is_armed_ends_at_zero() {
    let mut rig = Rig::new(true, None);
    rig.switch.arm(1.0);
    rig.given(ARM_RISE_S + 0.01, true);
    rig.live.process_with(1, |_, _| std::panic::resume_unwind(Box::new("as asked")));
    let given = rig.given(0.1, true);
    assert!(given.ends_with(&[0.0]) && steepest(&given) < 0.06, "{given:?}");
}

#[test]
fn an_edit_goes_on_with_the_gate_of_a_device_and_begins_that_of_a_new_one_at_zero() {
    for same in [true, false] {
        let mut rig = Rig::new(true, None);
        rig.switch.arm(1.0);
        rig.given(ARM_RISE_S + 0.01, true);
        let other = Coil::default();
        let mut next = graph_of(2, if same { &rig.coil } else { &other }, true, None);
        if !same {
            next.devices[0].name = "another".to_owned();
        }
        let changed = rig.session.change(&next, Path::new("nowhere")).unwrap();
        assert_ne!(changed.change, Change::Settings(0));
        let given: Vec<f64> = (0..50)
            .map(|_| {
                rig.switch.hold();
                rig.live.process(1);
                if same { rig.coil.given() } else { other.given() }
            })
            .collect();
        match same {
            true => assert!(given.iter().all(|x| (x - 0.5).abs() < 1e-9), "{given:?}"),
            false => {
                let most = |tick: usize| 0.5 * (tick + 1) as f64 / (ARM_RISE_S * RATE_HZ);
                let within = |(tick, x): (usize, &f64)| *x < most(tick) * 1.01;
                assert!(given.iter().enumerate().all(within) && given[49] > 0.0, "{given:?}");
            }
        }
    }
}

#[test]
fn what_comes_back_after_an_interruption_is_not_armed() {
    let mut rig = Rig::new(true, None);
    rig.switch.arm(1.0);
    let armed = rig.given(2.0 * ARM_RISE_S, true);
    assert!(armed.last().is_some_and(|current| *current > 0.4));
    rig.live.resume();
    assert!(!rig.switch.is_armed());
    assert!(rig.given(1.0, true).iter().all(|current| *current == 0.0));
    rig.switch.arm(1.0);
    assert!(rig.given(1.0, true).iter().any(|current| *current > 0.0));
}

#[test]
fn hardware_that_was_given_zeros_begins_from_zero_and_is_not_armed() {
    let mut rig = Rig::new(true, None);
    rig.switch.arm(1.0);
    rig.given(2.0 * ARM_RISE_S, true);
    rig.coil.interrupt();
    assert!(rig.given(0.1, true).iter().all(|current| *current == 0.0));
    assert!(!rig.switch.is_armed());
}

#[test]
fn hardware_that_was_given_zeros_rises_from_zero_where_nothing_is_armed_too() {
    for real in [true, false] {
        let coil = Coil::default();
        let graph = graph(&coil, real, None);
        let options = SessionOptions { rested: true, ..SessionOptions::default() };
        let (mut live, session) = Session::open(FileSinks::new(&graph), &options).unwrap();
        let given = |live: &mut Player| -> Vec<f64> {
            let tick = |_| {
                live.process(1);
                coil.given()
            };
            (0..50).map(tick).collect()
        };
        assert_eq!(given(&mut live)[49], 0.5);
        coil.interrupt();
        let given = given(&mut live);
        assert!(given[0] < 0.1, "{given:?}");
        assert!(steepest(&given) <= 0.5 / (FADE_S * RATE_HZ) * 1.001 && given[49] == 0.5, "{given:?}");
        session.finish(live);
    }
}
