//! Habits of the people who record: each draws larger or smaller, faster or slower, harder or softer.

use super::ground::Ground;
use super::script::{Action, ScriptSettings};
use super::stroke::{StrokeSettings, StrokeShape};
use crate::sinks::recording::Motion;
use haptograph_signal::noise::stream_seed;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Duration longer than any recording, s.
const LONG_S: f64 = 40_000.0;

/// Time in which a press of 1 N goes down and up again, s.
const PRESS_S_PER_N: f64 = 1.2;

/// Actions of a person for a motion. A machine makes the press, the same for every person: once down to `press_n` and up
/// again, 5 N within six seconds. A drag `from_rest` stops before each stroke.
pub(crate) fn habit(motion: &Motion, person: u64, press_n: f64, from_rest: bool) -> ScriptSettings {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(stream_seed(person, "habit"));
    let mut around = || 1.15_f64.powf(rng.random_range(-1.0..1.0));
    let (size, pace, force) = (around(), around(), around());
    let draw = |shape, force_n, force_variation, pace_variation| Action::Draw {
        stroke: StrokeSettings { shape, force_n, force_variation, pace_variation, size_variation: 0.1 },
        duration_s: LONG_S,
    };
    let actions = match motion {
        Motion::Drag => {
            let shape = match from_rest {
                true => StrokeShape::FromRest { side_m: 0.08 * size },
                false => StrokeShape::Wander { side_m: 0.045 * size, fastest_hz: 0.7 * pace },
            };
            vec![draw(shape, 1.2 * force, 0.45, 0.25)]
        }
        Motion::Circle => {
            let shape = StrokeShape::Circles { radius_m: 0.025 * size, period_s: 1.3 / pace };
            vec![draw(shape, 1.1 * force, 0.3, 0.1)]
        }
        Motion::Tap => vec![Action::Taps {
            count: (LONG_S / 0.7) as u32,
            slowest_m_s: 0.06 * pace,
            fastest_m_s: 0.3 * pace,
            interval_s: 0.7,
            force_n: 0.5 * force,
        }],
        Motion::Press => {
            let press = Action::Press { force_n: press_n, duration_s: PRESS_S_PER_N * press_n };
            vec![press, Action::Hover { duration_s: LONG_S }]
        }
    };
    ScriptSettings { ground: Ground::TABLE, actions, hover_m: 0.008, gives_n_per_m: f64::INFINITY }
}
