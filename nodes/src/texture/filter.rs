//! The synthesis filter.

use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Held, Io, Latency, NodeKind, Port, Processor, Tick,
};
use haptograph_signal::arma;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::Rate;
use haptograph_surfaces::TextureModel;
use haptograph_surfaces::rendering::{self, Upsampler};
use std::path::PathBuf;

use super::frames::{Coefficients, LayersAt};
use super::load_texture;

haptograph_engine::choices! {
    /// The structure of an [`ArmaFilter`].
    pub enum Form {
        /// Direct form, as in the thesis. It can grow without bound while coefficients alternate.
        Direct,
        /// Normalised lattice: the same filter for constant coefficients, and bounded for any change of them.
        Lattice,
    }
}

haptograph_engine::settings! {
    /// Settings of [`ArmaFilter`].
    pub struct ArmaFilterSettings {
        /// Structure for models that are not warped; warped models always use a lattice.
        form: Form = Form::Lattice;
        /// The rendered surface. If its models have a lower rate than this node's clock, the filter runs at their rate, and its
        /// output is interpolated to the clock; models of a higher rate are an error. The high-pass that its models do not contain is
        /// applied here. None: the models have the clock's rate, and there is no high-pass.
        surface: Option<PathBuf> = None;
    }
}

haptograph_engine::node! {
    /// The synthesis filter: gain B(z) / A(z) with coefficients that change while it runs. Its state after the excitation
    /// ends decays to exactly zero. Coefficients of an unstable filter are ignored. Whether they are plain or on a warped
    /// frequency axis is the surface's content, not a setting: warped ones run in a lattice of all-pass sections, and the
    /// high-pass that learning removed from such a surface is applied at the output. Models of a lower rate than the
    /// clock's run at their own rate, and are interpolated without spectrum above half of it. The surface's lines fixed in
    /// space are added.
    pub struct ArmaFilter(ArmaFilterSettings) in "texture";
    source: "2.4.2; A(z) = 1 + sum a_k z^-k; lattice after Gray and Markel (1975); warped after Härmä and others (2000)";
    example: r#""filter": ArmaFilter(coefficients: Hold("interpolate.coefficients"), excitation: "excite.excitation")"#;
    in COEFFICIENTS: Coefficients<'static>, Held = Port::of(Quantity::NUMBER, "The filter, held.");
    in EXCITATION: Scalar = Port::of(Quantity::ACCELERATION, "White noise of the filter's variance, m/s2.");
    out ACCELERATION: Scalar = Port::of(Quantity::ACCELERATION, "The vibration, m/s2.");
}

impl NodeKind for ArmaFilter {
    fn build(settings: ArmaFilterSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let texture = settings.surface.as_deref().map(load_texture).transpose()?;
        let upsampler = texture.as_ref().map(|texture| upsampler_of(texture, cx.rate)).transpose()?;
        let form = match settings.form {
            Form::Direct => arma::Form::Direct,
            Form::Lattice => arma::Form::Lattice,
        };
        let synthesis = rendering::Synthesis::new(texture.as_ref(), form, cx.rate.hz(), cx.seed);
        Ok(Built::new(Synthesis {
            synthesis: synthesis.upsampled(upsampler.flatten()),
            form,
            lanes: [f64::NAN; Coefficients::WIDTH],
        }))
    }

    fn advice(settings: &ArmaFilterSettings, cx: &BuildContext) -> Vec<BuildError> {
        let Some(Ok(texture)) = settings.surface.as_deref().map(load_texture) else {
            return Vec::new();
        };
        let (models_hz, clock) = (texture.rate_hz(), cx.rate);
        if models_hz >= clock.hz() {
            return Vec::new();
        }
        let message = format!(
            "the surface's models are for {models_hz} Hz, but this node's clock ticks at {clock}: the vibration is synthesised at {models_hz} \
             Hz and interpolated, and contains nothing above {} Hz",
            models_hz / 2.0
        );
        vec![BuildError::at("surface", message).help(
            "if the recording ended there, ignore this; else learn the surface again at the clock's rate",
        )]
    }
}

/// The upsampler from the rate of a surface's models to the clock's, if they differ.
fn upsampler_of(texture: &TextureModel, clock: Rate) -> Result<Option<Upsampler>, BuildError> {
    let models_hz = texture.rate_hz();
    if models_hz == clock.hz() {
        return Ok(None);
    }
    let message = format!("the surface's models are for {models_hz} Hz, the node's clock ticks at {clock}");
    let refuse = |help: String| BuildError::at("surface", message.clone()).help(help);
    if models_hz > clock.hz() {
        return Err(refuse(format!(
            "put the synthesis on a clock of {models_hz} Hz and resample its output, or bring the surface to {} Hz: haptograph \
             surface resample",
            clock.hz()
        )));
    }
    let made = Rate::parse(&models_hz.to_string()).ok().and_then(|models| Upsampler::new(models, clock));
    let refused = || {
        refuse(format!(
            "the ratio of these rates is too fine to interpolate; use a clock of {models_hz} Hz or a whole multiple"
        ))
    };
    made.map(Some).ok_or_else(refused)
}

#[derive(Debug, Clone)]
struct Synthesis {
    synthesis: rendering::Synthesis,
    form: arma::Form,
    /// The present coefficients, initially none: comparing them costs less than converting them again.
    lanes: [f64; Coefficients::WIDTH],
}

impl Synthesis {
    fn take(&mut self, lanes: &[f64; Coefficients::WIDTH]) {
        if *lanes == self.lanes {
            return;
        }
        self.lanes = *lanes;
        let Coefficients { ar, ma, gain, warping, .. } = Coefficients::from_components(&self.lanes);
        // Invalid coefficients leave the old ones active: the vibration stays bounded.
        let _ = self.synthesis.set_filter(ar, ma, gain, warping);
    }
}

impl Processor<ArmaFilter> for Synthesis {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, ArmaFilter>) {
        let (runs, excitation) = (io.read(ArmaFilter::COEFFICIENTS), io.read(ArmaFilter::EXCITATION));
        let out = io.write(ArmaFilter::ACCELERATION);
        for (frames, coefficients) in runs {
            self.take(coefficients);
            if self.synthesis.has_layers() {
                let at = LayersAt::from_components(coefficients);
                self.synthesis.set_layers(at.speed_m_s, &at.components);
            }
            self.synthesis.process(&excitation[frames.clone()], &mut out[frames]);
        }
    }

    fn latency(&self) -> Latency {
        Latency::of_group(self.synthesis.group_delay_s())
    }

    fn copy_state_into(&self, new: &mut Self) {
        if new.form == self.form {
            new.synthesis.copy_state_from(&self.synthesis);
            new.lanes = self.lanes;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::plain;
    use super::*;
    use haptograph_engine::frame::{Kind, OneKind};
    use haptograph_engine::testing::Bench;
    use haptograph_signal::Complex64;
    use haptograph_signal::spectrum::arma_density;
    use haptograph_surfaces::resampling;
    use std::path::Path;

    fn bench(form: Form) -> Bench {
        let settings = ArmaFilterSettings { form, surface: None };
        Bench::new::<ArmaFilter>(settings, 1000.0, &[Coefficients::KIND, Kind::SCALAR]).unwrap()
    }

    fn frame(ar: &[f64], ma: &[f64], gain: f64) -> [f64; Coefficients::WIDTH] {
        let mut lanes = [0.0; Coefficients::WIDTH];
        Coefficients { ar, ma, gain, variance: 1.0, warping: 0.0 }.write(&mut lanes);
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
        let held: Vec<f64> = (0..200).flat_map(|k| resonance([50.0, 920.0][k % 2]).repeat(41)).collect();
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
        let held = [good, frame(&[-2.0], &[], 1.0), [f64::NAN; Coefficients::WIDTH], good].concat();
        let y = bench(Form::Lattice).run(&[&held, &[1.0, 0.0, 0.0, 0.0]]).remove(0);
        assert!(y.iter().zip([1.0, 0.5, 0.25, 0.125]).all(|(y, w)| (y - w).abs() < 1e-15));
    }

    #[test]
    fn a_clock_that_is_not_the_models_is_refused() {
        let settings = ArmaFilterSettings { form: Form::Lattice, surface: Some(plain()) };
        let refused = Bench::new::<ArmaFilter>(settings, 999.0, &[Coefficients::KIND, Kind::SCALAR]).err();
        assert_eq!(refused.and_then(|e| e.field), Some("surface"));
    }

    const KINDS: [Kind; 2] = [Coefficients::KIND, Kind::SCALAR];

    /// The tile at 1 kHz, as models with zeros and gains, in a file.
    fn slow_plain() -> tempfile::NamedTempFile {
        let surface = haptograph_surfaces::files::load(&plain()).unwrap();
        let (slow, _) = resampling::resample_surface(&surface, 1000.0, resampling::Method::Zoh).unwrap();
        let file = tempfile::NamedTempFile::with_suffix(".ron").unwrap();
        std::fs::write(file.path(), haptograph_surfaces::files::native::write(&slow)).unwrap();
        file
    }

    fn rendering(surface: &Path, form: Form, clock_hz: f64) -> Bench {
        let surface = Some(surface.to_owned());
        Bench::new::<ArmaFilter>(ArmaFilterSettings { form, surface }, clock_hz, &KINDS).unwrap()
    }

    #[test]
    fn slower_models_have_their_spectrum_and_nothing_above_it() {
        let file = slow_plain();
        let texture = load_texture(file.path()).unwrap();
        let (up, clock_hz) = (10, 10_000.0);
        for at in [0, texture.models().len() / 2] {
            let model = &texture.models()[at].model;
            assert!(!model.ma().is_empty() && model.gain() != 1.0);
            let held = frame(model.ar(), model.ma(), model.gain()).repeat(8000);
            let mut e = vec![0.0; 8000];
            e[0] = 1.0;
            for form in [Form::Direct, Form::Lattice] {
                let mut bench = rendering(file.path(), form, clock_hz);
                let y = bench.run_in_blocks(&[&held, &e], &[7, 64, 1]).remove(0);
                // The excitation's density and the response's gain at the clock's rate, against those at the models'.
                let density = |f_hz: f64| {
                    let turn = |n: usize| Complex64::cis(-std::f64::consts::TAU * f_hz * n as f64 / clock_hz);
                    let sum: Complex64 = y.iter().enumerate().map(|(n, y)| turn(n) * y).sum();
                    2.0 * (sum / f64::from(up)).norm_sqr() / 1000.0
                };
                let wanted = |f_hz| {
                    let variance = model.gain().powi(2);
                    arma_density(model.ar(), model.ma(), variance, 1000.0, f_hz)
                };
                for f_hz in [5.0, 20.0, 60.0, 150.0, 300.0, 400.0, 450.0, 485.0] {
                    let db = 10.0 * (density(f_hz) / wanted(f_hz)).log10();
                    assert!(db.abs() < 0.1, "{db} dB at {f_hz} Hz");
                }
                for f_hz in [540.0, 700.0, 1000.0, 1060.0, 2000.0, 4900.0] {
                    let db = 10.0 * (density(f_hz) / wanted(1000.0 * (f_hz / 1000.0).round() - f_hz)).log10();
                    assert!(db < -50.0, "{db} dB at {f_hz} Hz");
                }
            }
        }
    }

    #[test]
    fn slower_models_say_so_come_later_and_hand_their_state_over() {
        let file = slow_plain();
        let mut old = rendering(file.path(), Form::Lattice, 10_000.0);
        let late_s = old.latency().group_delay_s;
        assert!((0.001..0.004).contains(&late_s), "{late_s}");
        let held = frame(&[-1.2, 0.7], &[0.4], 2.0).repeat(400);
        let e: Vec<f64> = (0..400).map(|n| (n as f64 * n as f64 * 0.37).sin()).collect();
        let whole = rendering(file.path(), Form::Lattice, 10_000.0).run(&[&held, &e]).remove(0);
        let half = held.len() / 2;
        old.run(&[&held[..half], &e[..200]]);
        let mut new = rendering(file.path(), Form::Lattice, 10_000.0);
        old.copy_state_into(&mut new);
        assert_eq!(new.run(&[&held[half..], &e[200..]])[0], whole[200..]);
    }

    #[test]
    fn models_of_the_clocks_rate_run_as_they_are() {
        let held = frame(&[-1.2, 0.7], &[0.4], 2.0).repeat(400);
        let e: Vec<f64> = (0..400).map(|n| (n as f64 * n as f64 * 0.37).sin()).collect();
        let (mut named, mut plain) = (rendering(&plain(), Form::Lattice, 10_000.0), bench(Form::Lattice));
        assert_eq!(named.run(&[&held, &e]), plain.run(&[&held, &e]));
        assert_eq!(named.latency(), Latency::default());
    }
}
