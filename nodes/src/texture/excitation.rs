//! The excitation of the synthesis filter.

use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Held, Io, NodeKind, Optional, Port, Processor, Tick,
};
use haptograph_signal::quantity::Quantity;
use haptograph_surfaces::rendering;
use std::path::PathBuf;

use super::frames::Coefficients;
use super::load_texture;

haptograph_engine::settings! {
    /// Settings of [`Excitation`].
    pub struct ExcitationSettings {
        /// The rendered surface, whose clips or grain the excitation has. None: Gaussian noise.
        surface: Option<PathBuf> = None;
    }
}

haptograph_engine::node! {
    /// White Gaussian noise that excites a synthesis filter, with the variance of the coefficients (exactly zero if that is
    /// zero). Without coefficients the variance is 1. If the surface has grain, the level fluctuates about that variance
    /// as its file says; if it has clips, they play in place of the noise.
    pub struct Excitation(ExcitationSettings) in "texture";
    source: "2.4.2; grain: docs/texture-models.md";
    example: r#""excite": Excitation(clock: "synth", coefficients: Hold("interpolate.coefficients"))"#;
    in COEFFICIENTS: Coefficients<'static>, Optional<Held> =
        Port::of(Quantity::NUMBER, "Coefficients, held, whose variance the noise has.");
    out EXCITATION: Scalar = Port::of(Quantity::ACCELERATION, "The noise, m/s2.");
}

impl NodeKind for Excitation {
    fn build(settings: ExcitationSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let texture = settings.surface.as_deref().map(load_texture).transpose()?;
        Ok(Built::new(Exciting(rendering::Excitation::new(texture.as_ref(), cx.rate.hz(), cx.seed))))
    }
}

#[derive(Debug, Clone)]
struct Exciting(rendering::Excitation);

impl Processor<Excitation> for Exciting {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Excitation>) {
        let runs = io.read(Excitation::COEFFICIENTS);
        let out = io.write(Excitation::EXCITATION);
        self.0.fill(out);
        for (frames, coefficients) in runs.into_iter().flatten() {
            let variance = Coefficients::from_components(coefficients).variance;
            rendering::Excitation::scale(&mut out[frames], variance);
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.0.copy_state_from(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::super::plain;
    use super::*;
    use haptograph_engine::frame::OneKind;
    use haptograph_engine::testing::Bench;
    use haptograph_surfaces::{Grain, files};

    fn frame(variance: f64) -> [f64; Coefficients::WIDTH] {
        let mut lanes = [0.0; Coefficients::WIDTH];
        Coefficients { ar: &[], ma: &[], gain: 1.0, variance, warping: 0.0 }.write(&mut lanes);
        lanes
    }

    fn white() -> ExcitationSettings {
        ExcitationSettings { surface: None }
    }

    #[test]
    fn the_excitation_has_the_variance_of_the_coefficients_and_none_at_rest() {
        let variances: Vec<f64> = (0..3000).map(|k| [1.0, 0.0, 4.0][k / 1000]).collect();
        let held: Vec<f64> = variances.iter().flat_map(|v| frame(*v)).collect();
        let mut scaled = Bench::new::<Excitation>(white(), 1000.0, &[Coefficients::KIND]).unwrap();
        let mut unit = Bench::new::<Excitation>(white(), 1000.0, &[]).unwrap();
        let scaled = scaled.run_in_blocks(&[&held], &[64, 3]).remove(0);
        let unit = unit.run_source(1024).remove(0);
        assert_eq!(scaled[..1000], unit[..1000]);
        assert!(scaled[1000..2000].iter().all(|e| e.to_bits() == 0));
        let power = scaled[2000..].iter().map(|e| e * e).sum::<f64>() / 1000.0;
        assert!((power / 4.0 - 1.0).abs() < 4.0 * (2.0_f64 / 1000.0).sqrt());
    }

    /// A surface with grain of this depth, in a file.
    fn grained(depth: f64) -> (tempfile::NamedTempFile, ExcitationSettings) {
        let mut surface = files::load(&plain()).unwrap();
        let grain = Grain::of_crackle(depth, 0.008).unwrap();
        surface.texture = surface.texture.map(|texture| texture.with_grain(Some(grain)));
        let file = tempfile::NamedTempFile::with_suffix(".ron").unwrap();
        std::fs::write(file.path(), files::native::write(&surface)).unwrap();
        let settings = ExcitationSettings { surface: Some(file.path().to_owned()) };
        (file, settings)
    }

    fn bench(settings: ExcitationSettings) -> Bench {
        Bench::new::<Excitation>(settings, 10_000.0, &[Coefficients::KIND]).unwrap()
    }

    #[test]
    fn a_surface_without_grain_is_excited_as_if_there_were_none() {
        let held = frame(2.0).repeat(500);
        let named = ExcitationSettings { surface: Some(plain()) };
        assert_eq!(bench(named).run(&[&held]), bench(white()).run(&[&held]));
    }

    #[test]
    fn grain_keeps_the_power_makes_the_noise_spiky_and_depends_on_no_block() {
        let (_file, settings) = grained(1.0);
        let held = frame(1.0).repeat(200_000);
        let blocks = bench(settings.clone()).run_in_blocks(&[&held], &[7, 64, 1]).remove(0);
        assert_eq!(bench(settings).run(&[&held]).remove(0), blocks);
        let moment = |k: i32| blocks.iter().map(|e| e.powi(k)).sum::<f64>() / blocks.len() as f64;
        assert!((moment(2) - 1.0).abs() < 0.1, "{}", moment(2));
        assert!(moment(4) / moment(2).powi(2) > 5.0);
    }

    #[test]
    fn a_successor_goes_on_with_noise_and_grain() {
        let (_file, settings) = grained(0.7);
        let held = frame(1.0).repeat(1000);
        let whole = bench(settings.clone()).run(&[&held]).remove(0);
        let half = held.len() / 2;
        let mut old = bench(settings.clone());
        old.run(&[&held[..half]]);
        let mut new = bench(settings);
        old.copy_state_into(&mut new);
        assert_eq!(new.run(&[&held[half..]])[0], whole[500..]);
        // To a surface without grain, and back to one: the noise beneath goes on.
        let mut plain = bench(white());
        old.copy_state_into(&mut plain);
        let went_on = plain.run(&[&held[half..]]).remove(0);
        assert!(went_on.iter().zip(&whole[500..]).all(|(white, e)| (white * e) >= 0.0));
    }
}
