//! The synthesis filter.

use haptograph_engine::frame::{Coefficients, Kind};
use haptograph_engine::node::{
    BuildContext, BuildError, Io, NodeKind, NodeSpec, Processor, Tick, input, output,
};
use haptograph_signal::arma;
use haptograph_signal::quantity::Quantity;
use std::path::PathBuf;

use super::load_texture;
use crate::successor;

haptograph_engine::choices! {
    /// How an [`ArmaFilter`] is computed.
    pub enum Form {
        /// Past outputs times coefficients, as in the thesis. It can grow without bound while coefficients alternate.
        Direct,
        /// The normalised lattice: the same filter while coefficients stay, and bounded however they change.
        Lattice,
    }
}

haptograph_engine::settings! {
    /// Settings of [`ArmaFilter`].
    pub struct ArmaFilterSettings {
        /// How it is computed.
        form: Form = Form::Lattice;
        /// The surface that is rendered, to check that this node's clock has the rate of its models.
        surface: Option<PathBuf> = None;
    }
}

/// Turns excitation into vibration.
pub struct ArmaFilter;

impl NodeKind for ArmaFilter {
    type Settings = ArmaFilterSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "ArmaFilter",
        group: "texture",
        doc: "The synthesis filter: gain B(z) / A(z) with coefficients that change while it runs. What it holds when \
              the excitation ends dies away to exactly zero. Coefficients of an unstable filter are not taken.",
        source: "2.4.2; A(z) = 1 + sum a_k z^-k; lattice after Gray and Markel (1975)",
        inputs: &[
            input(
                "coefficients",
                Kind::Coefficients,
                Quantity::NUMBER,
                "The filter, held.",
            )
            .held(),
            input(
                "excitation",
                Kind::Scalar,
                Quantity::ACCELERATION,
                "White noise of the filter's variance, m/s2.",
            ),
        ],
        outputs: &[output(
            "acceleration",
            Kind::Scalar,
            Quantity::ACCELERATION,
            "The vibration, m/s2.",
        )],
        example: r#""filter": ArmaFilter(coefficients: Hold("interpolate.coefficients"), excitation: "excite.excitation")"#,
    };

    fn build(settings: ArmaFilterSettings, cx: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        if let Some(surface) = &settings.surface {
            let models_hz = load_texture(surface)?.rate_hz();
            if models_hz != cx.rate.hz() {
                let message = format!(
                    "the surface's models are for {models_hz} Hz, this node's clock has {}",
                    cx.rate
                );
                let help = format!("put the synthesis on a clock of {models_hz} Hz and resample its output");
                return Err(BuildError::at("surface", message).help(help));
            }
        }
        let form = match settings.form {
            Form::Direct => arma::Form::Direct,
            Form::Lattice => arma::Form::Lattice,
        };
        Ok(Box::new(Synthesis {
            filter: arma::ArmaFilter::new(form),
            form,
            lanes: [f64::NAN; Coefficients::WIDTH],
        }))
    }
}

#[derive(Debug, Clone)]
struct Synthesis {
    filter: arma::ArmaFilter,
    form: arma::Form,
    /// The coefficients at work, at first none: converting them again would cost more than comparing.
    lanes: [f64; Coefficients::WIDTH],
}

impl Synthesis {
    fn take(&mut self, lanes: &[f64; Coefficients::WIDTH]) {
        if *lanes == self.lanes {
            return;
        }
        self.lanes = *lanes;
        let Coefficients { ar, ma, gain, .. } = Coefficients::from_lanes(&self.lanes);
        // Refused coefficients leave the old ones at work: the vibration stays bounded.
        let _ = self.filter.set_coefficients(ar, ma, gain);
    }
}

impl Processor for Synthesis {
    fn process(&mut self, _: &Tick, io: &mut Io<'_>) {
        let (runs, excitation) = (io.held(0), io.lanes(1));
        let out = io.out(0);
        for (frames, lanes) in runs {
            if let Some(lanes) = lanes.first_chunk() {
                self.take(lanes);
            }
            self.filter.process(&excitation[frames.clone()], &mut out[frames]);
        }
    }

    fn copy_state_into(&self, new: &mut dyn Processor) {
        if let Some(new) = successor::<Self>(new)
            && new.form == self.form
        {
            new.filter.clone_from(&self.filter);
            new.lanes = self.lanes;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tile;
    use super::*;
    use haptograph_engine::testing::Bench;

    fn bench(form: Form) -> Bench {
        let settings = ArmaFilterSettings { form, surface: None };
        Bench::new::<ArmaFilter>(settings, 1000.0, &[Kind::Coefficients, Kind::Scalar]).unwrap()
    }

    fn frame(ar: &[f64], ma: &[f64], gain: f64) -> [f64; Coefficients::WIDTH] {
        let mut lanes = [0.0; Coefficients::WIDTH];
        Coefficients {
            ar,
            ma,
            gain,
            variance: 1.0,
        }
        .write(&mut lanes);
        lanes
    }

    #[test]
    fn the_impulse_response_is_that_of_the_difference_equation() {
        let (ar, ma, gain) = ([-1.2, 0.7], [0.4], 2.0);
        let held = frame(&ar, &ma, gain).repeat(100);
        let mut e = vec![0.0; 100];
        e[3] = 1.0;
        let mut wanted = vec![0.0; 100];
        for n in 2..100 {
            wanted[n] = gain * (e[n] + ma[0] * e[n - 1]) - ar[0] * wanted[n - 1] - ar[1] * wanted[n - 2];
        }
        for form in [Form::Direct, Form::Lattice] {
            let y = bench(form).run_in_blocks(&[&held, &e], &[7, 1]).remove(0);
            assert!(y.iter().zip(&wanted).all(|(y, w)| (y - w).abs() < 1e-12));
        }
    }

    #[test]
    fn when_the_excitation_ends_the_vibration_decays_to_exactly_zero() {
        let held = frame(&[-1.99, 0.995], &[], 1.0).repeat(40_000);
        let e: Vec<f64> = (0..40_000).map(|n| if n < 1000 { 1.0 } else { 0.0 }).collect();
        for form in [Form::Direct, Form::Lattice] {
            let y = bench(form).run(&[&held, &e]).remove(0);
            assert!(y[1000].abs() > 1.0);
            assert!(y[39_000..].iter().all(|y| *y == 0.0));
        }
    }

    /// Two resonances of pole radius 0.9986 at 50 and 920 Hz of 10 kHz, alternating every 41 samples.
    #[test]
    fn the_lattice_is_bounded_where_the_direct_form_explodes() {
        let resonance = |f_hz: f64| {
            let (r, w) = (0.9986_f64, std::f64::consts::TAU * f_hz / 10_000.0);
            frame(&[-2.0 * r * w.cos(), r * r], &[], 1.0)
        };
        let held: Vec<f64> = (0..200)
            .flat_map(|k| resonance([50.0, 920.0][k % 2]).repeat(41))
            .collect();
        let mut e = vec![0.0; 8200];
        e[0] = 1.0;
        let most = |form| {
            let y = bench(form).run(&[&held, &e]).remove(0);
            y.iter().fold(0.0_f64, |m, y| m.max(y.abs()))
        };
        assert!(most(Form::Direct) > 1e6);
        assert!(most(Form::Lattice) < 1e3);
    }

    #[test]
    fn unstable_or_broken_coefficients_leave_the_old_ones_at_work() {
        let good = frame(&[-0.5], &[], 1.0);
        let held = [
            good,
            frame(&[-2.0], &[], 1.0),
            [f64::NAN; Coefficients::WIDTH],
            good,
        ]
        .concat();
        let y = bench(Form::Lattice)
            .run(&[&held, &[1.0, 0.0, 0.0, 0.0]])
            .remove(0);
        assert!(
            y.iter()
                .zip([1.0, 0.5, 0.25, 0.125])
                .all(|(y, w)| (y - w).abs() < 1e-15)
        );
    }

    #[test]
    fn a_clock_that_is_not_the_models_is_refused() {
        let settings = ArmaFilterSettings {
            form: Form::Lattice,
            surface: Some(tile()),
        };
        let refused = Bench::new::<ArmaFilter>(settings, 999.0, &[Kind::Coefficients, Kind::Scalar]).err();
        assert_eq!(refused.and_then(|e| e.field), Some("surface"));
    }
}
