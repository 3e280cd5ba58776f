//! What excites the synthesis filter.

use haptograph_engine::frame::{Coefficients, Kind};
use haptograph_engine::node::{
    BuildContext, BuildError, Io, NodeKind, NodeSpec, Processor, Tick, input, output,
};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::noise::Gaussian;
use haptograph_signal::quantity::Quantity;

use crate::successor;

/// White Gaussian excitation.
pub struct Excitation;

impl NodeKind for Excitation {
    type Settings = NoSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Excitation",
        group: "texture",
        doc: "White Gaussian noise to excite a synthesis filter with, of the variance that comes with the coefficients \
              (exactly zero where that is zero). Without coefficients, of variance 1.",
        source: "2.4.2",
        inputs: &[input(
            "coefficients",
            Kind::Coefficients,
            Quantity::NUMBER,
            "Their variance, held, is that of the noise.",
        )
        .held()
        .optional()],
        outputs: &[output(
            "excitation",
            Kind::Scalar,
            Quantity::ACCELERATION,
            "The noise, m/s2.",
        )],
        example: r#""excite": Excitation(clock: "synth", coefficients: Hold("interpolate.coefficients"))"#,
    };

    fn build(_: NoSettings, cx: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        Ok(Box::new(Exciting {
            stream: Gaussian::new(cx.seed),
        }))
    }
}

#[derive(Debug, Clone)]
struct Exciting {
    stream: Gaussian,
}

impl Processor for Exciting {
    fn process(&mut self, _: &Tick, io: &mut Io<'_>) {
        let (scaled, runs) = (io.connected(0), io.held(0));
        let out = io.out(0);
        // The stream goes on through silence, so that it depends on time alone.
        self.stream.fill(out);
        if !scaled {
            return;
        }
        for (frames, lanes) in runs {
            let Some(lanes) = lanes.first_chunk() else {
                continue;
            };
            let variance = Coefficients::from_lanes(lanes).variance;
            let run = &mut out[frames];
            if variance > 0.0 {
                let deviation = variance.sqrt();
                run.iter_mut().for_each(|e| *e *= deviation);
            } else {
                run.fill(0.0);
            }
        }
    }

    fn copy_state_into(&self, new: &mut dyn Processor) {
        if let Some(new) = successor::<Self>(new) {
            new.stream.clone_from(&self.stream);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::testing::Bench;

    fn frame(variance: f64) -> [f64; Coefficients::WIDTH] {
        let mut lanes = [0.0; Coefficients::WIDTH];
        Coefficients {
            ar: &[],
            ma: &[],
            gain: 1.0,
            variance,
            warping: 0.0,
        }
        .write(&mut lanes);
        lanes
    }

    #[test]
    fn the_excitation_has_the_variance_of_the_coefficients_and_none_at_rest() {
        let variances: Vec<f64> = (0..3000).map(|k| [1.0, 0.0, 4.0][k / 1000]).collect();
        let held: Vec<f64> = variances.iter().flat_map(|v| frame(*v)).collect();
        let mut scaled = Bench::new::<Excitation>(NoSettings {}, 1000.0, &[Kind::Coefficients]).unwrap();
        let mut unit = Bench::new::<Excitation>(NoSettings {}, 1000.0, &[]).unwrap();
        let scaled = scaled.run_in_blocks(&[&held], &[64, 3]).remove(0);
        let unit = unit.run_source(1024).remove(0);
        assert_eq!(scaled[..1000], unit[..1000]);
        assert!(scaled[1000..2000].iter().all(|e| e.to_bits() == 0));
        let power = scaled[2000..].iter().map(|e| e * e).sum::<f64>() / 1000.0;
        assert!((power / 4.0 - 1.0).abs() < 4.0 * (2.0_f64 / 1000.0).sqrt());
    }
}
