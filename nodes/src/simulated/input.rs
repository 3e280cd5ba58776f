//! A simulated fader.

use crate::network::inputs::VALUE;
use haptograph_engine::device::{Device, DeviceKind, DeviceSpec};
use haptograph_engine::node::{BuildContext, BuildError};
use std::f64::consts::TAU;

haptograph_engine::settings! {
    /// A simulated fader that moves up and down.
    pub struct SimulatedInputSettings {
        /// Values at the start and half a period later, in the SI unit of the `LiveInput`'s quantity.
        to: [f64; 2] = [0.0, 1.0];
        /// Period of the movement, s.
        period_s: f64 = 4.0, in 0.01..=1e6;
    }
}

/// A simulated fader that moves up and down.
pub(crate) struct SimulatedInput;

impl DeviceKind for SimulatedInput {
    type Settings = SimulatedInputSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "SimulatedInput",
        doc: "A simulated fader that moves up and down as a cosine.",
        source: "",
        simulated: true,
        senses: VALUE,
        drives: &[],
        example: r#""pitch": SimulatedInput(to: [80, 320], period_s: 4)"#,
    };

    fn build(settings: SimulatedInputSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        Ok(Box::new(Moved { to: settings.to, turns_a_tick: cx.rate.period_s() / settings.period_s, tick: 0 }))
    }
}

#[derive(Debug, Clone)]
struct Moved {
    to: [f64; 2],
    turns_a_tick: f64,
    tick: u64,
}

impl Device for Moved {
    fn advance(&mut self) {
        self.tick += 1;
    }

    fn read(&mut self, _: usize, frame: &mut [f64]) {
        let turns = (self.tick as f64 * self.turns_a_tick).fract();
        let [start, far] = self.to;
        frame.fill(start + (far - start) * 0.5 * (1.0 - (TAU * turns).cos()));
    }

    fn range(&self, _: usize) -> Option<[f64; 2]> {
        Some(self.to)
    }

    fn write(&mut self, _: usize, _: &[f64]) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::time::Rate;

    #[test]
    fn it_goes_to_the_far_end_and_back() {
        let cx = BuildContext::new("fader", Rate::new(100, 1).unwrap());
        let settings = SimulatedInputSettings { to: [80.0, 320.0], period_s: 1.0 };
        let mut fader = SimulatedInput::build(settings, &cx).unwrap();
        let mut at = |ticks: usize| {
            (0..ticks).for_each(|_| fader.advance());
            let mut frame = [0.0];
            fader.read(0, &mut frame);
            frame[0]
        };
        assert_eq!(at(0), 80.0);
        assert!(
            (at(25) - 200.0).abs() < 1e-9 && (at(25) - 320.0).abs() < 1e-9 && (at(50) - 80.0).abs() < 1e-9
        );
    }
}
