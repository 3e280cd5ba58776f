//! Scripts: the intended actions of a simulated hand, in a loop.

use super::ground::Ground;
use super::stroke::{Stroke, StrokeError, StrokeSettings, minimum_jerk};
use crate::vector::{Vec3, add_scaled};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// An action of the tip. Each starts and ends with the tip lifted.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Action {
    /// Hold the tip lifted.
    Hover {
        /// Duration, s.
        duration_s: f64,
    },
    /// Draw.
    Draw {
        /// Shape and force.
        stroke: StrokeSettings,
        /// Duration, s.
        duration_s: f64,
    },
    /// Tap the surface, each time at a speed drawn evenly from a range.
    Taps {
        /// Number of taps.
        count: u32,
        /// Slowest intended speed at contact, m/s.
        slowest_m_s: f64,
        /// Fastest intended speed at contact, m/s.
        fastest_m_s: f64,
        /// Time from tap to tap, s.
        interval_s: f64,
        /// Intended force at the bottom of a tap, N.
        force_n: f64,
    },
    /// Press and release.
    Press {
        /// Largest force, N.
        force_n: f64,
        /// Time from lifted to lifted, s.
        duration_s: f64,
    },
}

/// Actions on a surface.
#[derive(Debug, Clone)]
pub(crate) struct ScriptSettings {
    /// The surface.
    pub ground: Ground,
    /// The actions, played in a loop.
    pub actions: Vec<Action>,
    /// Height of the lifted tip, m.
    pub hover_m: f64,
    /// Stiffness of the surface as the hand expects it, N/m; the hand aims as deep as its force can press. Infinite for a
    /// rigid surface.
    pub gives_n_per_m: f64,
}

/// Error of a script.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum ScriptError {
    /// The script is empty.
    #[error("the script has no actions: give at least one")]
    Empty,
    /// A number is out of range.
    #[error("action {action} (counted from 0): {name} is {value}: give a finite number above zero")]
    NotPositive {
        /// Index of the action.
        action: usize,
        /// The setting.
        name: &'static str,
        /// The value.
        value: f64,
    },
    /// A tap takes longer than its interval.
    #[error(
        "action {action} (counted from 0): a tap at {slowest_m_s} m/s takes longer than its interval: slow down the taps or speed up the slowest"
    )]
    NoTimeToTap {
        /// Index of the action.
        action: usize,
        /// Slowest speed.
        slowest_m_s: f64,
    },
    /// A stroke is invalid.
    #[error("action {action} (counted from 0): {source}")]
    Stroke {
        /// Index of the action.
        action: usize,
        /// The reason.
        source: StrokeError,
    },
}

/// Intent of a hand at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Intent {
    /// Intended position of the tip, m: on the surface, above it, or (at the bottom of a tap) below.
    pub position_m: Vec3,
    /// Outward normal of the surface there.
    pub normal: Vec3,
    /// Force with which to press on it, N.
    pub force_n: f64,
}

/// A script as one person plays it.
#[derive(Debug, Clone)]
pub(crate) struct Script {
    ground: Ground,
    hover_m: f64,
    gives_n_per_m: f64,
    stiffness_n_per_m: f64,
    segments: Vec<Segment>,
    pub(super) period_s: f64,
}

#[derive(Debug, Clone)]
struct Segment {
    start_s: f64,
    duration_s: f64,
    motion: Motion,
}

#[derive(Debug, Clone)]
enum Motion {
    Travel { from: [f64; 2], to: [f64; 2] },
    Draw(Box<Stroke>),
    Taps { speeds_m_s: Vec<f64>, interval_s: f64, force_n: f64 },
    Press { force_n: f64 },
}

/// Time to come down to the surface, or to lift off, s.
const APPROACH_S: f64 = 0.25;
/// Time from the end of one action to the start of the next, s.
const TRAVEL_S: f64 = 0.35;

impl Script {
    /// The script as the person of this seed would play it, with a grip of this stiffness (it says how deep
    /// a tap of a certain force is meant).
    pub(crate) fn new(
        settings: &ScriptSettings,
        stiffness_n_per_m: f64,
        seed: u64,
    ) -> Result<Self, ScriptError> {
        if settings.actions.is_empty() {
            return Err(ScriptError::Empty);
        }
        let hover_m = settings.hover_m;
        require(0, &[("hover_m", hover_m), ("stiffness_n_per_m", stiffness_n_per_m)])?;
        if settings.gives_n_per_m.is_finite() || settings.gives_n_per_m.is_nan() {
            require(0, &[("gives_n_per_m", settings.gives_n_per_m)])?;
        }
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut script = Self {
            ground: settings.ground.clone(),
            hover_m,
            gives_n_per_m: settings.gives_n_per_m,
            stiffness_n_per_m,
            segments: Vec::new(),
            period_s: 0.0,
        };
        for (index, action) in settings.actions.iter().enumerate() {
            let (motion, duration_s) = script.motion(action, index, &mut rng)?;
            if let Some(last) = script.segments.last() {
                let (from, to) = (last.motion.sheet(last.duration_s), motion.sheet(0.0));
                script.push(Motion::Travel { from, to }, TRAVEL_S);
            }
            script.push(motion, duration_s);
        }
        if let [first, .., last] = script.segments.as_slice() {
            let (from, to) = (last.motion.sheet(last.duration_s), first.motion.sheet(0.0));
            script.push(Motion::Travel { from, to }, TRAVEL_S);
        }
        Ok(script)
    }

    fn motion(
        &self,
        action: &Action,
        index: usize,
        rng: &mut Xoshiro256PlusPlus,
    ) -> Result<(Motion, f64), ScriptError> {
        match action {
            Action::Hover { duration_s } => {
                require(index, &[("duration_s", *duration_s)])?;
                Ok((Motion::Travel { from: [0.0; 2], to: [0.0; 2] }, *duration_s))
            }
            Action::Draw { stroke, duration_s } => {
                require(index, &[("duration_s", *duration_s)])?;
                let stroke = Stroke::new(stroke.clone(), rng.random())
                    .map_err(|source| ScriptError::Stroke { action: index, source })?;
                Ok((Motion::Draw(Box::new(stroke)), *duration_s))
            }
            Action::Press { force_n, duration_s } => {
                require(index, &[("force_n", *force_n), ("duration_s", *duration_s)])?;
                Ok((Motion::Press { force_n: *force_n }, *duration_s))
            }
            &Action::Taps { count, slowest_m_s, fastest_m_s, interval_s, force_n } => {
                let count_or_none = ("count", f64::from(count));
                let span = ("fastest_m_s - slowest_m_s + 1", fastest_m_s - slowest_m_s + 1.0);
                let numbers =
                    [("slowest_m_s", slowest_m_s), ("interval_s", interval_s), ("force_n", force_n)];
                require(index, &[count_or_none, span])?;
                require(index, &numbers)?;
                let depth_m = force_n / self.stiffness_n_per_m;
                if 2.0 * (self.hover_m + depth_m) / slowest_m_s > 0.8 * interval_s {
                    return Err(ScriptError::NoTimeToTap { action: index, slowest_m_s });
                }
                let speeds_m_s = (0..count)
                    .map(|_| slowest_m_s + (fastest_m_s - slowest_m_s).max(0.0) * rng.random::<f64>())
                    .collect();
                Ok((Motion::Taps { speeds_m_s, interval_s, force_n }, f64::from(count) * interval_s))
            }
        }
    }

    fn push(&mut self, motion: Motion, duration_s: f64) {
        self.segments.push(Segment { start_s: self.period_s, duration_s, motion });
        self.period_s += duration_s;
    }

    /// Intent of the hand at a time in s.
    pub(crate) fn at(&self, time_s: f64) -> Intent {
        let t = time_s.rem_euclid(self.period_s);
        let index = self.segments.partition_point(|s| s.start_s <= t).saturating_sub(1);
        let segment = &self.segments[index];
        let (sheet, height_m, force_n) = segment.motion.at(t - segment.start_s, segment.duration_s, self);
        let ground = self.ground.at(sheet);
        let above_m = add_scaled(ground.position_m, ground.lift, height_m);
        Intent {
            position_m: add_scaled(above_m, ground.normal, -force_n / self.gives_n_per_m),
            normal: ground.normal,
            force_n,
        }
    }
}

impl Motion {
    /// Coordinates on the surface's sheet.
    fn sheet(&self, t: f64) -> [f64; 2] {
        match self {
            Self::Travel { from, to } => {
                let way = minimum_jerk(t / TRAVEL_S);
                [from[0] + way * (to[0] - from[0]), from[1] + way * (to[1] - from[1])]
            }
            Self::Draw(stroke) => stroke.at(t).position_m,
            Self::Taps { .. } | Self::Press { .. } => [0.0; 2],
        }
    }

    /// Coordinates on the surface's sheet, height of the intended tip over the surface, m, and the force it presses with, N.
    fn at(&self, t: f64, duration_s: f64, script: &Script) -> ([f64; 2], f64, f64) {
        let hover_m = script.hover_m;
        match self {
            Self::Travel { .. } => (self.sheet(t), hover_m, 0.0),
            Self::Draw(stroke) => {
                let down = minimum_jerk(t / APPROACH_S) * minimum_jerk((duration_s - t) / APPROACH_S);
                let point = stroke.at(t);
                (point.position_m, hover_m * (1.0 - down).max(point.lifted), down * point.force_n)
            }
            Self::Press { force_n } => {
                let down = minimum_jerk(2.0 * t / duration_s) * minimum_jerk(2.0 * (1.0 - t / duration_s));
                (self.sheet(t), hover_m * (1.0 - down), down * force_n)
            }
            Self::Taps { speeds_m_s, interval_s, force_n } => {
                let tap = (t / interval_s) as usize;
                let speed_m_s = speeds_m_s[tap.min(speeds_m_s.len() - 1)];
                let depth_m = force_n / script.stiffness_n_per_m;
                let height_m =
                    tap_height(t - tap as f64 * interval_s, speed_m_s, *interval_s, hover_m, depth_m);
                (self.sheet(t), height_m, 0.0)
            }
        }
    }
}

/// Height over the surface at a time within one tap: from rest above, through the surface at a speed, to rest below,
/// and up again.
fn tap_height(t: f64, speed_m_s: f64, interval_s: f64, hover_m: f64, depth_m: f64) -> f64 {
    let (fall_s, stop_s) = (2.0 * hover_m / speed_m_s, 2.0 * depth_m / speed_m_s);
    if t < fall_s {
        let u = t / fall_s;
        let end = u * u * u * (-4.0 + u * (7.0 - 3.0 * u));
        hover_m * (1.0 - minimum_jerk(u)) - speed_m_s * fall_s * end
    } else if t < fall_s + stop_s {
        let u = (t - fall_s) / stop_s;
        let start = u + u * u * u * (-6.0 + u * (8.0 - 3.0 * u));
        -depth_m * minimum_jerk(u) - speed_m_s * stop_s * start
    } else {
        let rise_s = interval_s - fall_s - stop_s;
        (hover_m + depth_m) * minimum_jerk((t - fall_s - stop_s) / rise_s) - depth_m
    }
}

fn require(action: usize, numbers: &[(&'static str, f64)]) -> Result<(), ScriptError> {
    match numbers.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
        Some(&(name, value)) => Err(ScriptError::NotPositive { action, name, value }),
        None => Ok(()),
    }
}
