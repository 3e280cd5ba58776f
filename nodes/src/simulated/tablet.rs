//! A simulated pen tablet (3.1.1): Wacom's Cintiq 12WX as the thesis describes it, drawn upon by a simulated hand.

use super::stroke::{Stroke, StrokeError, StrokeSettings};

/// Readings per second.
pub(crate) const TABLET_RATE_HZ: f64 = 125.0;
/// Steps of the position, m: along x and along y.
pub(crate) const TABLET_STEP_M: [f64; 2] = [4.934e-6, 4.861e-6];
/// Step of the force, N.
pub(crate) const TABLET_STEP_N: f64 = 0.0013;

/// Reading of the tablet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TabletReading {
    /// Position of the tip, m.
    pub position_m: [f64; 2],
    /// Normal force of the tip, N; zero while it is lifted.
    pub force_n: f64,
}

/// The tablet and the hand that draws on it. One tick is 1/125 s. It is labelled simulated wherever it is shown.
#[derive(Debug, Clone)]
pub(crate) struct SimulatedTablet {
    stroke: Stroke,
    tick: u64,
}

impl SimulatedTablet {
    /// A tablet at the start of a stroke; the seed is the person and the attempt.
    pub(crate) fn new(stroke: StrokeSettings, seed: u64) -> Result<Self, StrokeError> {
        Ok(Self { stroke: Stroke::new(stroke, seed)?, tick: 0 })
    }

    /// The reading of this tick.
    pub(crate) fn read(&self) -> TabletReading {
        let point = self.stroke.at(self.tick as f64 / TABLET_RATE_HZ);
        let [x, y] = point.position_m;
        TabletReading {
            position_m: [quantise(x, TABLET_STEP_M[0]), quantise(y, TABLET_STEP_M[1])],
            force_n: quantise(point.force_n, TABLET_STEP_N),
        }
    }

    /// Advances to the next tick.
    pub(crate) fn advance(&mut self) {
        self.tick += 1;
    }
}

/// The nearest whole number of steps.
pub(crate) fn quantise(value: f64, step: f64) -> f64 {
    (value / step).round() * step
}

#[cfg(test)]
mod tests {
    use super::super::stroke::StrokeShape;
    use super::*;

    #[test]
    fn readings_are_whole_steps_of_the_stroke() {
        let settings = StrokeSettings::natural(StrokeShape::Writing { letter_m: 0.006, line_m: 0.1 }, 0.9);
        let mut tablet = SimulatedTablet::new(settings.clone(), 5).unwrap();
        let stroke = Stroke::new(settings, 5).unwrap();
        for k in 0..1000 {
            let (reading, truth) = (tablet.read(), stroke.at(f64::from(k) * 0.008));
            let axes = reading.position_m.iter().zip(truth.position_m).zip(TABLET_STEP_M);
            for ((seen, true_m), step_m) in axes {
                assert!((seen / step_m - (seen / step_m).round()).abs() < 1e-6);
                assert!((seen - true_m).abs() <= 0.5001 * step_m);
            }
            assert!((reading.force_n - truth.force_n).abs() <= 0.5001 * TABLET_STEP_N);
            tablet.advance();
        }
    }
}
