//! Random sequences of edits to a run of two drivers: limits, windows, gains, sinks and endpoints change, and
//! actuators move from one driver to the other. What each actuator is given is judged by the limit in force, tick by
//! tick.

use super::heat::{Asks, Coil, RealCoil};
use super::world::{TestDrive, process, with_drives};
use crate::device::DeviceEntry;
use crate::graph::Graph;
use crate::node::Limit;
use crate::run::{ChangeError, FileSinks, Player, Session, SessionOptions};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::path::Path;

/// Of the faster driver; the other one ticks at every second of its ticks.
const RATE_HZ: f64 = 2000.0;
const WINDOWS_S: [f64; 4] = [0.01, 0.05, 0.3, 0.5];
const SINKS: [&str; 3] = ["sink 0", "sink 1", "sink 2"];

/// How an actuator is driven, if it is.
#[derive(Clone, Copy)]
struct Wired {
    driver: usize,
    sink: usize,
    endpoint: usize,
    limit: Limit,
    ask: f64,
}

/// Two coils, and how they are driven.
type Wiring = [Option<Wired>; 2];

fn any_limit(random: &mut Xoshiro256PlusPlus) -> Limit {
    let mut one_of = |choices: &[f64]| *choices.choose(random).unwrap();
    Limit {
        peak: one_of(&[0.4, 0.5, 1.0]),
        continuous: one_of(&[0.02, 0.2, 0.25]),
        window_s: one_of(&WINDOWS_S),
        slew_per_s: Some(one_of(&[50.0, 100.0, 1e9])),
    }
}

fn any_wired(random: &mut Xoshiro256PlusPlus, coil: usize) -> Wired {
    Wired {
        driver: random.random_range(0..2),
        sink: coil,
        endpoint: coil,
        limit: any_limit(random),
        ask: any_ask(random),
    }
}

/// Hard against the limits, or not a number.
fn any_ask(random: &mut Xoshiro256PlusPlus) -> f64 {
    match random.random_range(0..12) {
        0 => f64::NAN,
        1 => f64::NEG_INFINITY,
        2 => -1e300,
        _ => random.random_range(-1.5..1.5),
    }
}

/// One edit of the wiring.
fn edit(wiring: &Wiring, random: &mut Xoshiro256PlusPlus) -> Wiring {
    let mut new = *wiring;
    let coil = random.random_range(0..2);
    let both = new.iter().all(Option::is_some);
    let Some(wired) = &mut new[coil] else {
        new[coil] = Some(any_wired(random, coil));
        return new;
    };
    match random.random_range(0..12) {
        0 => new[coil] = None,
        1 => new = [None, None],
        2 => wired.driver = 1 - wired.driver,
        3 => (wired.sink, wired.endpoint) = (2, coil),
        4 => (wired.sink, wired.endpoint) = (coil, 2 + coil),
        // They change names.
        5 if both => {
            let [a, b] = &mut new;
            if let (Some(a), Some(b)) = (a, b) {
                std::mem::swap(&mut a.sink, &mut b.sink);
                std::mem::swap(&mut a.endpoint, &mut b.endpoint);
            }
        }
        6 => wired.limit.window_s = *WINDOWS_S.choose(random).unwrap(),
        7 => wired.limit.continuous = *[0.02, 0.2, 0.25].choose(random).unwrap(),
        8 => wired.ask = any_ask(random),
        _ => wired.limit = any_limit(random),
    }
    let names = |of: fn(&Wired) -> usize| new.map(|wired| wired.map(|wired| of(&wired)));
    let clash = |[a, b]: [Option<usize>; 2]| a.is_some() && a == b;
    if clash(names(|wired| wired.sink)) || clash(names(|wired| wired.endpoint)) {
        return *wiring;
    }
    new
}

/// What was seen in all.
#[derive(Default)]
struct Seen {
    hot: usize,
    in_debt: usize,
    slewing: usize,
    moved: usize,
    changed: usize,
    refused: usize,
}

struct Judge {
    coils: [Coil; 2],
    real: bool,
    before: [f64; 2],
    /// By coil and window.
    means: [[f64; WINDOWS_S.len()]; 2],
    last_driver: [Option<usize>; 2],
    tick: usize,
}

impl Judge {
    fn graph(&self, wiring: &Wiring) -> Graph {
        let drives = wiring.iter().enumerate().filter_map(|(coil, wired)| {
            let wired = (*wired)?;
            Some(TestDrive {
                work: process(Asks(wired.ask * 10.0)),
                fingerprint: wired.ask.to_bits(),
                driver: wired.driver,
                sink: SINKS[wired.sink].to_owned(),
                limit: wired.limit,
                endpoint: format!("endpoint {}", wired.endpoint),
                device: Box::new(self.coils[coil].clone()),
                device_fingerprint: coil as u64,
            })
        });
        let mut graph = with_drives(drives.collect());
        if self.real {
            let devices = graph.devices.iter_mut();
            devices.for_each(|device| device.entry = DeviceEntry::of::<RealCoil>());
        }
        graph
    }

    fn watch(&mut self, lives: &[Player], seen: &mut Seen) {
        self.tick += 1;
        for coil in 0..2 {
            let drives = lives.iter().enumerate().filter_map(|(driver, live)| {
                let plan = &live.run().plan;
                let mut devices = plan.devices.iter();
                let device = devices.find(|device| device.key.fingerprint == coil as u64)?;
                let (actuator, ..) = device.driven_by.first()?;
                Some((driver, plan.actuators[*actuator].limit))
            });
            let drives: Vec<(usize, Limit)> = drives.collect();
            assert!(drives.len() < 2, "tick {}: coil {coil} is driven twice", self.tick);
            self.judge(coil, drives.first(), seen);
        }
    }

    fn judge(&mut self, coil: usize, drive: Option<&(usize, Limit)>, seen: &mut Seen) {
        let (tick, given) = (self.tick, self.coils[coil].given());
        if let Some((driver, limit)) = drive {
            assert!(given.abs() <= limit.peak, "tick {tick}: {given}, {limit:?}");
            let most = limit.slew_per_s.unwrap() / [1000.0, 2000.0][*driver];
            let change = (given - self.before[coil]).abs();
            assert!(change <= most * (1.0 + 1e-9), "tick {tick}: {change} of {most}");
            seen.slewing += usize::from(change > 0.99 * most);
            let last = self.last_driver[coil].replace(*driver);
            seen.moved += usize::from(last.is_some_and(|last| last != *driver));
        } else {
            assert_eq!(given, 0.0, "tick {tick}: nobody drives coil {coil}");
        }
        self.before[coil] = given;
        for (window_s, mean) in WINDOWS_S.iter().zip(&mut self.means[coil]) {
            let keep = (-1.0 / (window_s * RATE_HZ)).exp();
            let before = *mean;
            *mean = keep * before + (1.0 - keep) * given * given;
            let Some((_, limit)) = drive.filter(|(_, limit)| limit.window_s == *window_s) else {
                continue;
            };
            let most = limit.continuous * limit.continuous;
            let allowed = keep * (before - most).max(0.0) + 1e-12 * most;
            assert!(*mean - most <= allowed, "tick {tick}, coil {coil}: {limit:?}, {mean} of {most}");
            seen.hot += usize::from(*mean > 0.9 * most);
            seen.in_debt += usize::from(*mean > most);
        }
    }
}

/// A run that is edited and watched.
struct Bout {
    lives: Vec<Player>,
    session: Session,
    judge: Judge,
    wiring: Wiring,
}

impl Bout {
    /// Of simulated coils, which begin cold, or of real ones, of which nobody knows how warm they are.
    fn begin(wiring: Wiring, real: bool) -> Self {
        let judge = Judge {
            coils: Default::default(),
            real,
            before: [0.0; 2],
            means: Default::default(),
            last_driver: [None; 2],
            tick: 0,
        };
        let first = judge.graph(&wiring);
        let opened = Session::open_all(FileSinks::new(&first), &SessionOptions::default(), None);
        let (lives, session) = opened.unwrap();
        Self { lives, session, judge, wiring }
    }

    /// Ticks of the faster driver.
    fn run(&mut self, ticks: usize, seen: &mut Seen) {
        for _ in 0..ticks {
            self.lives[1].process(1);
            if self.judge.tick.is_multiple_of(2) {
                self.lives[0].process(1);
            }
            self.judge.watch(&self.lives, seen);
        }
        self.session.poll();
    }

    fn change(&mut self, new: Wiring, seen: &mut Seen) {
        match self.session.change(&self.judge.graph(&new), Path::new(".")) {
            Ok(_) => {
                self.wiring = new;
                seen.changed += 1;
            }
            Err(ChangeError::MovedDevice { .. } | ChangeError::NotReleased { .. }) => seen.refused += 1,
            Err(other) => panic!("{other}"),
        }
    }
}

/// So many edits to a run of its own.
fn attack(seed: u64, edits: usize, seen: &mut Seen) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let wiring = [0, 1].map(|coil| Some(any_wired(&mut random, coil)));
    let mut bout = Bout::begin(wiring, false);
    for number in 0..edits {
        // Often before what was changed last is done.
        let ticks = [1, 4, 30, 100, 1200][random.random_range(0..5)];
        bout.run(random.random_range(0..2 * ticks), seen);
        if random.random_bool(0.2) {
            let gain = *[0.0, 1e308, -0.3].choose(&mut random).unwrap();
            // A setting of a sink that there is not is refused.
            let _ = bout.session.set_by_name(&format!("{}.gain", SINKS[number % 3]), gain);
        }
        let new = edit(&bout.wiring, &mut random);
        bout.change(new, seen);
    }
}

fn attack_all(seeds: std::ops::Range<u64>) {
    let mut seen = Seen::default();
    let runs = seeds.end - seeds.start;
    seeds.for_each(|seed| attack(seed, 60, &mut seen));
    let per_run = |count: usize| count as f64 / runs as f64;
    assert!(per_run(seen.hot) > 500.0 && per_run(seen.in_debt) > 50.0, "{}, {}", seen.hot, seen.in_debt);
    assert!(per_run(seen.slewing) > 20.0 && per_run(seen.moved) > 0.5, "{}, {}", seen.slewing, seen.moved);
    assert!(
        per_run(seen.changed) > 30.0 && per_run(seen.refused) > 1.0,
        "{}, {}",
        seen.changed,
        seen.refused
    );
}

#[test]
fn no_sequence_of_edits_to_two_drivers_lets_an_actuator_exceed_the_limit_in_force() {
    attack_all(0..16);
}

#[test]
#[ignore = "thousands of runs: minutes"]
fn no_sequence_of_edits_to_two_drivers_lets_an_actuator_exceed_the_limit_in_force_in_thousands_of_runs() {
    attack_all(1000..4000);
}

/// An edit of how the first coil is driven, and for how many ticks of the faster driver it stays.
type Step = (usize, fn(&mut Option<Wired>));

fn limit(wired: &mut Option<Wired>, change: impl FnOnce(&mut Limit)) {
    change(&mut wired.as_mut().expect("it is driven").limit);
}

fn continuous(wired: &mut Option<Wired>, continuous: f64) {
    limit(wired, |limit| limit.continuous = continuous);
}

fn window(wired: &mut Option<Wired>, window_s: f64) {
    limit(wired, |limit| limit.window_s = window_s);
}

/// How the coil is driven again after it was let go.
fn drive(wired: &mut Option<Wired>, sink: usize, endpoint: usize, driver: usize) {
    *wired = Some(Wired { sink, endpoint, driver, ..BY_HAND });
}

/// Hard against the limits all the time.
const BY_HAND: Wired = Wired {
    driver: 0,
    sink: 0,
    endpoint: 0,
    limit: Limit { peak: 0.5, continuous: 0.25, window_s: 0.5, slew_per_s: Some(100.0) },
    ask: 1.5,
};

/// Edits that might make a limiter forget heat; each is done several times over.
const SEQUENCES: [(&str, &[Step]); 9] = [
    (
        "lower and raise the continuous limit",
        &[(120, |w| continuous(w, 0.02)), (600, |w| continuous(w, 0.25))],
    ),
    ("shorten and lengthen the window", &[(120, |w| window(w, 0.01)), (600, |w| window(w, 0.5))]),
    (
        "change window and limit at once",
        &[
            (60, |w| limit(w, |limit| (limit.window_s, limit.continuous) = (0.01, 0.02))),
            (400, |w| limit(w, |limit| (limit.window_s, limit.continuous) = (0.5, 0.25))),
        ],
    ),
    ("remove and add again", &[(100, |w| *w = None), (500, |w| drive(w, 0, 0, 0))]),
    (
        "remove and add again under other names",
        &[
            (100, |w| *w = None),
            (500, |w| drive(w, 2, 2, 0)),
            (100, |w| *w = None),
            (500, |w| drive(w, 0, 0, 0)),
        ],
    ),
    ("rename the sink", &[(300, |w| drive(w, 2, 0, 0)), (300, |w| drive(w, 0, 0, 0))]),
    ("rename the endpoint", &[(300, |w| drive(w, 0, 2, 0)), (300, |w| drive(w, 0, 0, 0))]),
    ("move to the other driver at once", &[(300, |w| drive(w, 0, 0, 1)), (300, |w| drive(w, 0, 0, 0))]),
    (
        "let go, and drive by the other driver",
        &[
            (100, |w| *w = None),
            (400, |w| drive(w, 0, 0, 1)),
            (100, |w| *w = None),
            (400, |w| drive(w, 0, 0, 0)),
        ],
    ),
];

#[test]
#[expect(clippy::print_stdout, reason = "which sequence it was, if one fails")]
fn no_known_sequence_of_edits_lets_an_actuator_exceed_the_limit_in_force() {
    for (name, steps) in SEQUENCES {
        for real in [false, true] {
            println!("{name}, real: {real}");
            let mut seen = Seen::default();
            let mut bout = Bout::begin([Some(BY_HAND), None], real);
            bout.run(3000, &mut seen);
            for (ticks, edit) in steps.iter().cycle().take(6 * steps.len()) {
                let mut new = bout.wiring;
                edit(&mut new[0]);
                bout.change(new, &mut seen);
                bout.run(*ticks, &mut seen);
            }
            assert!(seen.hot > 500 && seen.changed + seen.refused == 6 * steps.len());
        }
    }
}
