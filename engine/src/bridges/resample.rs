//! Band-limited resampling.

use super::{BridgeContext, BridgeSpec, BridgeType, Carries, Direction, Ends};
use crate::node::Latency;
use haptograph_signal::resample::{Quality, ResampleError, Resampler};
use haptograph_signal::time::Rate;

/// Band-limited interpolation, component by component.
#[derive(Debug, Clone)]
pub struct Resample {
    /// One for each component, of its deviation from the neutral frame.
    resamplers: Vec<Resampler>,
    neutral: Vec<f64>,
    /// A component of the writer's frames, and of the reader's.
    gathered: Vec<f64>,
    resampled: Vec<f64>,
}

fn resampler(from: Rate, to: Rate) -> Result<Resampler, ResampleError> {
    Resampler::new(from, to, Quality::LOW_LATENCY)
}

impl BridgeType for Resample {
    const SPEC: BridgeSpec = BridgeSpec {
        name: "Resample",
        doc: "Band-limited interpolation between clocks of one driver",
        gives: "band-limited",
        direction: Direction::Any,
        carries: Carries::Linear,
    };

    fn check(from: Rate, to: Rate) -> Result<(), String> {
        resampler(from, to).map(drop).map_err(|error| error.to_string())
    }

    fn new(cx: &BridgeContext) -> Self {
        let components = 0..cx.kind.width();
        Self {
            // The check accepts only rates that can be resampled.
            resamplers: components.filter_map(|_| resampler(cx.from, cx.to).ok()).collect(),
            neutral: cx.kind.neutral().collect(),
            gathered: vec![0.0; cx.max_from],
            resampled: vec![0.0; cx.max_to],
        }
    }

    fn latency(from: Rate, to: Rate) -> Latency {
        Latency::of_transport(resampler(from, to).map_or(0.0, |resampler| resampler.latency_s()))
    }

    fn cross(&mut self, _: &Ends, x: &[f64], y: &mut [f64]) {
        let width = self.resamplers.len();
        if width == 0 {
            y.fill(0.0);
            return;
        }
        if let ([resampler], [0.0]) = (&mut self.resamplers[..], &self.neutral[..]) {
            resampler.process(x, y);
            return;
        }
        let neutral = &self.neutral;
        for (component, (resampler, neutral)) in self.resamplers.iter_mut().zip(neutral).enumerate() {
            let (frames_in, frames_out) = (x.len() / width, y.len() / width);
            for (gathered, frame) in self.gathered.iter_mut().zip(x.chunks_exact(width)) {
                *gathered = frame[component] - neutral;
            }
            resampler.process(&self.gathered[..frames_in], &mut self.resampled[..frames_out]);
            for (resampled, frame) in self.resampled.iter().zip(y.chunks_exact_mut(width)) {
                // Adding a zero would lose the sign of another.
                frame[component] = if *neutral == 0.0 { *resampled } else { resampled + neutral };
            }
        }
    }

    fn copy_state_from(&mut self, old: &Self) {
        for (resampler, old) in self.resamplers.iter_mut().zip(&old.resamplers) {
            resampler.copy_state_from(old);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_of_too_fine_a_ratio_are_refused_and_write_silence() {
        let (odd, even) = (Rate::new(100_001, 10).unwrap(), Rate::from_hz(48_000).unwrap());
        assert!(Resample::check(odd, even).is_err());
        assert!(Resample::check(Rate::from_hz(10_000).unwrap(), even).is_ok());
        let mut bridge = Resample {
            resamplers: Vec::new(),
            neutral: Vec::new(),
            gathered: Vec::new(),
            resampled: Vec::new(),
        };
        let window = crate::bridges::Ticks { first: 0, count: 0, period: 1 };
        let ends = Ends { from: window, to: window };
        let mut out = [1.0; 4];
        bridge.cross(&ends, &[1.0; 2], &mut out);
        assert_eq!(out, [0.0; 4]);
    }
}
