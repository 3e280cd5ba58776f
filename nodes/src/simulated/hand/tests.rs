use super::super::ground::Ground;
use super::super::script::Action;
use super::super::stroke::{StrokeSettings, StrokeShape};
use super::*;

const PERIOD_S: f64 = 1e-3;
const STEADY: Grip = Grip { tremor_m: 0.0, ..Grip::TYPICAL };

fn script(actions: Vec<Action>) -> ScriptSettings {
    ScriptSettings { ground: Ground::TABLE, actions, hover_m: 0.02, gives_n_per_m: f64::INFINITY }
}

fn hand(grip: Grip, load: Load, actions: Vec<Action>) -> Hand {
    Hand::new(grip, &script(actions), load, PERIOD_S, 1).unwrap()
}

/// A wall of 2 N/mm below z = 0; what it pushes with, tick by tick.
fn against_a_wall(hand: &mut Hand, ticks: usize) -> Vec<(HandReading, f64)> {
    let mut seen = Vec::with_capacity(ticks);
    for _ in 0..ticks {
        let reading = hand.read();
        let force_n = (-2000.0 * reading.position_m[2]).max(0.0);
        seen.push((reading, force_n));
        hand.advance([0.0, 0.0, force_n]);
    }
    seen
}

#[test]
fn a_pushed_hand_gives_way_by_its_stiffness() {
    let mut hand = hand(STEADY, Load::NONE, vec![Action::Hover { duration_s: 1.0 }]);
    let home_m = hand.read().position_m;
    (0..3000).for_each(|_| hand.advance([1.0, 0.0, 0.0]));
    assert!((hand.read().position_m[0] - home_m[0] - 1.0 / 500.0).abs() < 1e-9);
}

#[test]
fn free_oscillation_is_the_closed_form() {
    let loose = Grip { damping_n_s_per_m: 1.0, ..STEADY };
    let mut hand = hand(loose, Load { mass_kg: 0.05, ..Load::NONE }, vec![Action::Hover { duration_s: 9.0 }]);
    hand.position_m[1] += 1e-3;
    let (omega, decay) = ((500.0 / 0.1_f64 - 25.0).sqrt(), 5.0);
    for k in 1..500 {
        hand.advance([0.0; 3]);
        let t = f64::from(k) * PERIOD_S;
        let expected = 1e-3 * (-decay * t).exp() * ((omega * t).cos() + decay / omega * (omega * t).sin());
        assert!((hand.read().position_m[1] - expected).abs() < 1e-12, "at {t}");
    }
}

#[test]
fn dry_friction_holds_a_hand_that_is_pushed_less() {
    let load = Load { mass_kg: 0.045, dry_friction_n: 0.26, ..Load::NONE };
    let mut held = hand(STEADY, load, vec![Action::Hover { duration_s: 9.0 }]);
    let home_m = held.read().position_m;
    (0..1000).for_each(|_| held.advance([0.25, 0.0, 0.0]));
    let drift_m = (held.read().position_m[0] - home_m[0]).abs();
    assert!(drift_m < 1e-12, "{drift_m}");
    (0..3000).for_each(|_| held.advance([1.0, 0.0, 0.0]));
    let way_m = held.read().position_m[0] - home_m[0];
    assert!(way_m > 0.7 / 500.0 && way_m < 1.0 / 500.0 * 1.5, "{way_m}");
    assert_eq!(held.read().velocity_m_s, [0.0; 3], "it sticks in the end");
}

#[test]
fn a_stroke_is_drawn_at_about_the_force_that_was_meant() {
    let circles = StrokeShape::Circles { radius_m: 0.02, period_s: 1.5 };
    let stroke = StrokeSettings::exact(circles, 1.2);
    let mut hand = hand(Grip::TYPICAL, Load::NONE, vec![Action::Draw { stroke, duration_s: 6.0 }]);
    let seen = against_a_wall(&mut hand, 5000);
    let steady = &seen[1000..];
    let mean_n = steady.iter().map(|(_, f)| f).sum::<f64>() / steady.len() as f64;
    assert!((mean_n - 1.2 * 2000.0 / 2500.0).abs() < 0.02, "two springs in series: {mean_n}");
    let radius_m = steady.iter().map(|(r, _)| r.position_m[0].hypot(r.position_m[1])).sum::<f64>() / 4000.0;
    assert!((radius_m - 0.02).abs() < 5e-4, "{radius_m}");
}

#[test]
fn taps_come_at_about_the_speeds_that_were_meant() {
    let taps = Action::Taps { count: 8, slowest_m_s: 0.1, fastest_m_s: 0.3, interval_s: 0.7, force_n: 1.0 };
    let mut hand = hand(Grip::TYPICAL, Load::NONE, vec![taps]);
    let seen = against_a_wall(&mut hand, 5600);
    let mut onsets = Vec::new();
    let mut free_since = 0;
    for (k, pair) in seen.windows(2).enumerate() {
        if pair[0].1 == 0.0 && pair[1].1 > 0.0 && k > free_since + 300 {
            // Bounces follow sooner.
            onsets.push(-pair[0].0.velocity_m_s[2]);
            free_since = k;
        }
    }
    assert_eq!(onsets.len(), 8, "{onsets:?}");
    assert!(onsets.iter().all(|v| (0.07..0.33).contains(v)), "{onsets:?}");
}

#[test]
fn a_press_reaches_its_force_and_lets_go() {
    let mut hand = hand(STEADY, Load::NONE, vec![Action::Press { force_n: 2.5, duration_s: 3.0 }]);
    let seen = against_a_wall(&mut hand, 3000);
    let most_n = seen.iter().map(|(_, f)| *f).fold(0.0, f64::max);
    assert!((most_n - 2.5 * 0.8).abs() < 0.1, "{most_n}");
    assert_eq!(seen[0].1, 0.0);
    assert_eq!(seen[2999].1, 0.0);
}

#[test]
fn the_same_seed_moves_the_same_and_people_differ() {
    let draw = || {
        let stroke = StrokeSettings::natural(StrokeShape::Wander { side_m: 0.05, fastest_hz: 1.0 }, 1.0);
        vec![Action::Draw { stroke, duration_s: 5.0 }, Action::Hover { duration_s: 0.5 }]
    };
    let end = |seed| {
        let mut hand = Hand::new(Grip::of_person(seed), &script(draw()), Load::NONE, PERIOD_S, seed).unwrap();
        against_a_wall(&mut hand, 2000)[1999].0
    };
    assert_eq!(end(1), end(1));
    assert_ne!(end(1), end(2));
}

#[test]
fn the_intended_path_has_no_jumps_over_a_whole_round() {
    let zigzag = StrokeShape::ZigZag { width_m: 0.05, height_m: 0.02, period_s: 1.0 };
    let settings = script(vec![
        Action::Draw { stroke: StrokeSettings::natural(zigzag, 1.0), duration_s: 2.3 },
        Action::Taps { count: 3, slowest_m_s: 0.1, fastest_m_s: 0.2, interval_s: 0.8, force_n: 0.5 },
        Action::Press { force_n: 2.0, duration_s: 2.0 },
    ]);
    let script = Script::new(&settings, 500.0, 3).unwrap();
    let mut previous = script.at(0.0);
    for k in 1..(2.0 * script.period_s / 1e-4) as u32 {
        let next = script.at(f64::from(k) * 1e-4);
        assert!(norm(sub(next.position_m, previous.position_m)) < 1e-4 * 0.6, "at {}", f64::from(k) * 1e-4);
        previous = next;
    }
}

#[test]
fn hands_and_scripts_without_meaning_are_refused() {
    let refused =
        |grip, actions| Hand::new(grip, &script(actions), Load::NONE, PERIOD_S, 0).unwrap_err().to_string();
    let hover = || vec![Action::Hover { duration_s: 1.0 }];
    assert!(refused(Grip { mass_kg: 0.0, ..STEADY }, hover()).contains("mass_kg is 0"));
    assert!(refused(STEADY, vec![]).contains("no actions"));
    assert!(refused(STEADY, vec![Action::Press { force_n: 0.0, duration_s: 1.0 }]).contains("force_n is 0"));
    let hasty = Action::Taps { count: 1, slowest_m_s: 0.01, fastest_m_s: 0.2, interval_s: 0.5, force_n: 0.5 };
    assert!(refused(STEADY, vec![hasty]).contains("longer than its interval"));
}
