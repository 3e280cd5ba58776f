//! Strokes: the intended path of a hand on a surface, as a function of time. Every simulated hand follows
//! one. Two people (seeds) drawing the same shape differ in pace, size and pressure.

use super::wobble::Wobble;
use haptograph_signal::noise::stream_seed;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

mod trajectory;

pub(crate) use trajectory::Trajectory;

/// The shape that is drawn, centred at the origin of the surface.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum StrokeShape {
    /// The tip rests in the centre.
    Still,
    /// Circles of a radius, one each period.
    Circles {
        /// Radius, m.
        radius_m: f64,
        /// Time of one circle, s.
        period_s: f64,
    },
    /// To and fro along x, creeping along y and back.
    ZigZag {
        /// Extent along x, m.
        width_m: f64,
        /// Extent along y, m.
        height_m: f64,
        /// Time of one to-and-fro, s.
        period_s: f64,
    },
    /// Cursive writing: words of loops (two coupled oscillations, after Hollerbach 1981), the pen lifted between them.
    Writing {
        /// Height of the letters, m.
        letter_m: f64,
        /// Length of a line, m.
        line_m: f64,
    },
    /// Aimless exploration over a square.
    Wander {
        /// Side of the square that holds two thirds of it, m.
        side_m: f64,
        /// Fastest oscillation, Hz.
        fastest_hz: f64,
    },
    /// Straight strokes over a square, each from rest: the tip stays down for 0.08 to 0.6 s before it.
    FromRest {
        /// Side of the square, m.
        side_m: f64,
    },
    /// A recorded path; past its end the tip is lifted.
    Recorded(Arc<Trajectory>),
}

/// A shape with force and natural variation.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StrokeSettings {
    /// The shape.
    pub shape: StrokeShape,
    /// Mean normal force, N. A recorded path has its own.
    pub force_n: f64,
    /// Standard deviation of the force as a fraction of its mean, 0 to 1; it never falls below a tenth of the mean.
    pub force_variation: f64,
    /// Standard deviation of the pace as a fraction of its mean, 0 to 0.3.
    pub pace_variation: f64,
    /// Standard deviation of the size as a fraction, 0 to 0.3.
    pub size_variation: f64,
}

/// Error of a stroke.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum StrokeError {
    /// A setting is out of its range.
    #[error("the stroke's {name} is {value}: give {range}")]
    OutOfRange {
        /// The setting.
        name: &'static str,
        /// The value.
        value: f64,
        /// The allowed range.
        range: &'static str,
    },
}

/// Intended position of the tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StrokePoint {
    /// Position on the surface, m.
    pub position_m: [f64; 2],
    /// Normal force, N; zero while lifted.
    pub force_n: f64,
    /// Height, from 0 on the surface to 1 lifted.
    pub lifted: f64,
}

/// A stroke drawn by one person.
#[derive(Debug, Clone)]
pub(crate) struct Stroke {
    settings: StrokeSettings,
    pace: Wobble,
    force: Wobble,
    size: [Wobble; 2],
    wander: [Wobble; 2],
    seed: u64,
}

impl Stroke {
    /// A person's way of drawing; the seed is the person and the attempt.
    pub(crate) fn new(settings: StrokeSettings, seed: u64) -> Result<Self, StrokeError> {
        check(&settings)?;
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let fastest_hz = match settings.shape {
            StrokeShape::Wander { fastest_hz, .. } => fastest_hz,
            _ => 1.0,
        };
        Ok(Self {
            pace: Wobble::new(0.05, 0.6, &mut rng),
            force: Wobble::new(0.2, 2.5, &mut rng),
            size: [(); 2].map(|()| Wobble::new(0.05, 0.5, &mut rng)),
            wander: [(); 2].map(|()| Wobble::new(0.1 * fastest_hz, fastest_hz, &mut rng)),
            settings,
            seed,
        })
    }

    /// Intended position of the tip at a time since the start, s.
    pub(crate) fn at(&self, time_s: f64) -> StrokePoint {
        if let StrokeShape::Recorded(path) = &self.settings.shape {
            return path.at(time_s);
        }
        let drawn_s = time_s + self.settings.pace_variation * self.pace.integral(time_s);
        let (shape, pressed, lifted) = self.shape(drawn_s);
        let [width, height, force] = Wobble::at([&self.size[0], &self.size[1], &self.force], time_s);
        let grow = [width, height].map(|size| 1.0 + self.settings.size_variation * size);
        let pressure = 1.0 + self.settings.force_variation * force;
        StrokePoint {
            position_m: [shape[0] * grow[0], shape[1] * grow[1]],
            force_n: self.settings.force_n * pressure.max(0.1) * pressed,
            lifted,
        }
    }

    /// Position along the undisturbed shape, the part of the force that is given and how far the tip is lifted.
    fn shape(&self, t: f64) -> ([f64; 2], f64, f64) {
        match self.settings.shape {
            StrokeShape::Still | StrokeShape::Recorded(_) => ([0.0; 2], 1.0, 0.0),
            StrokeShape::Circles { radius_m, period_s } => {
                let (sin, cos) = (TAU * t / period_s).sin_cos();
                ([radius_m * cos, radius_m * sin], 1.0, 0.0)
            }
            StrokeShape::ZigZag { width_m, height_m, period_s } => {
                let y = 0.5 * height_m * (TAU * t / (8.0 * period_s)).sin();
                ([width_m * (to_and_fro(t / period_s) - 0.5), y], 1.0, 0.0)
            }
            StrokeShape::Writing { letter_m, line_m } => writing(t, letter_m, line_m),
            StrokeShape::Wander { side_m, .. } => {
                (Wobble::at(self.wander.each_ref(), t).map(|wander| 0.5 * side_m * wander), 1.0, 0.0)
            }
            StrokeShape::FromRest { side_m } => (from_rest(t, self.seed).map(|x| side_m * x), 1.0, 0.0),
        }
    }
}

/// A minimum-jerk movement from 0 to 1 while u goes from 0 to 1; at rest before and after.
pub(crate) fn minimum_jerk(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * u * (10.0 + u * (6.0 * u - 15.0))
}

/// 0 to 1 and back by minimum-jerk movements, once for each unit of u.
fn to_and_fro(u: f64) -> f64 {
    let phase = u.rem_euclid(1.0);
    if phase < 0.5 { minimum_jerk(2.0 * phase) } else { 1.0 - minimum_jerk(2.0 * phase - 1.0) }
}

/// Straight movements between random places of the square from -0.5 to 0.5, one a second, each after a rest of random length.
fn from_rest(t: f64, seed: u64) -> [f64; 2] {
    const STROKE_S: f64 = 1.0;
    let number = (t / STROKE_S).floor().max(0.0);
    let of = |number: f64| -> [f64; 3] {
        Xoshiro256PlusPlus::seed_from_u64(stream_seed(seed, "rest") ^ number as u64).random()
    };
    let ([x, y, rest], [next_x, next_y, _]) = (of(number), of(number + 1.0));
    let rest_s = 0.08 * (0.6_f64 / 0.08).powf(rest);
    let way = minimum_jerk((t - number * STROKE_S - rest_s) / (STROKE_S - rest_s));
    [x + way * (next_x - x) - 0.5, y + way * (next_y - y) - 0.5]
}

/// Words of loops along a line, then the next line below, four lines in all.
fn writing(t: f64, letter_m: f64, line_m: f64) -> ([f64; 2], f64, f64) {
    const WORD_S: f64 = 1.6;
    const LIFT_S: f64 = 0.4;
    const LOOPS_PER_S: f64 = 4.0;
    const LINES: f64 = 4.0;
    let word_m = 5.0 * letter_m;
    let words = (line_m / (1.3 * word_m)).floor().max(1.0);
    let count = (t / (WORD_S + LIFT_S)).floor();
    let start = |n: f64| {
        let line = (n / words).floor().rem_euclid(LINES);
        [n.rem_euclid(words) * 1.3 * word_m - 0.5 * line_m, (0.5 * (LINES - 1.0) - line) * 2.0 * letter_m]
    };
    let (u, here, next) = (t - count * (WORD_S + LIFT_S), start(count), start(count + 1.0));
    if u >= WORD_S {
        let way = minimum_jerk((u - WORD_S) / LIFT_S);
        let from = [here[0] + word_m, here[1]];
        let lifted = minimum_jerk((u - WORD_S) / 0.1) * minimum_jerk((WORD_S + LIFT_S - u) / 0.1);
        return ([from[0] + way * (next[0] - from[0]), from[1] + way * (next[1] - from[1])], 0.0, lifted);
    }
    // The loops grow from nothing and shrink again, so that the lift starts where the word ends.
    let swell = (PI * u / WORD_S).sin().abs().sqrt();
    let phase = TAU * LOOPS_PER_S * u;
    let x = here[0] + word_m * u / WORD_S + 0.3 * letter_m * swell * ((phase + 1.0).sin() - 1.0_f64.sin());
    let y = here[1] + 0.5 * letter_m * swell * phase.sin();
    let pressed = minimum_jerk(u / 0.03) * minimum_jerk((WORD_S - u) / 0.03);
    ([x, y], pressed, 0.0)
}

fn check(settings: &StrokeSettings) -> Result<(), StrokeError> {
    let positive = |name, value: f64| {
        let range = "a finite number above zero";
        if value > 0.0 && value.is_finite() {
            Ok(())
        } else {
            Err(StrokeError::OutOfRange { name, value, range })
        }
    };
    let within = |name, value: f64, most: f64, range| {
        if (0.0..=most).contains(&value) {
            Ok(())
        } else {
            Err(StrokeError::OutOfRange { name, value, range })
        }
    };
    within("force_variation", settings.force_variation, 1.0, "a fraction from 0 to 1")?;
    within("pace_variation", settings.pace_variation, 0.3, "a fraction from 0 to 0.3")?;
    within("size_variation", settings.size_variation, 0.3, "a fraction from 0 to 0.3")?;
    within("force_n", settings.force_n, f64::MAX, "a force in N, zero or more")?;
    match settings.shape {
        StrokeShape::Still | StrokeShape::Recorded(_) => Ok(()),
        StrokeShape::Circles { radius_m, period_s } => {
            positive("radius_m", radius_m).and(positive("period_s", period_s))
        }
        StrokeShape::ZigZag { width_m, height_m, period_s } => positive("width_m", width_m)
            .and(within("height_m", height_m, f64::MAX, "a length in m, zero or more"))
            .and(positive("period_s", period_s)),
        StrokeShape::Writing { letter_m, line_m } => {
            positive("letter_m", letter_m).and(positive("line_m", line_m))
        }
        StrokeShape::FromRest { side_m } => positive("side_m", side_m),
        StrokeShape::Wander { side_m, fastest_hz } => {
            positive("side_m", side_m).and(positive("fastest_hz", fastest_hz))
        }
    }
}

#[cfg(test)]
mod tests;
