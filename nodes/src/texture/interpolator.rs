//! Interpolation of the synthesis filter on the map of a texture.

use haptograph_engine::node::{BuildContext, BuildError, Built, Io, NodeKind, Port, Processor, Tick};
use haptograph_signal::quantity::Quantity;
use haptograph_surfaces::{Coefficients, Interpolator, Spot, TextureModel};

use super::frames::{self, LayersAt, Weights};
use super::load_texture;
use super::locator::SurfaceSettings;

haptograph_engine::node! {
    /// Mixes the line spectral frequencies, gains and variances of three models by their weights and converts the mix to
    /// filter coefficients, AR or ARMA as the surface has them. At zero speed or force the variance is exactly zero.
    pub struct LsfInterpolator(SurfaceSettings) in "texture";
    source: "2.4.1";
    example: r#""interpolate": LsfInterpolator(weights: "locate.weights", surface: "surfaces/t3-tile.ron")"#;
    in WEIGHTS: Weights = Port::of(Quantity::NUMBER, "Weights from a `TriangleLocator` of the same surface.");
    out COEFFICIENTS: frames::Coefficients<'static> =
        Port::of(Quantity::NUMBER, "The synthesis filter, the variance of its excitation, and the powers \
                                    of lines fixed in space.");
}

impl NodeKind for LsfInterpolator {
    fn build(settings: SurfaceSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        let texture = load_texture(&settings.surface)?;
        Ok(Built::new(Mixing {
            interpolator: Interpolator::new(&texture),
            layered: Some(texture).filter(|texture| texture.layers().next().is_some()),
            mix: Coefficients::SILENCE,
        }))
    }
}

#[derive(Debug, Clone)]
struct Mixing {
    interpolator: Interpolator,
    /// The texture, if it has layers.
    layered: Option<TextureModel>,
    mix: Coefficients,
}

impl Processor<LsfInterpolator> for Mixing {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, LsfInterpolator>) {
        let places = io.decode(LsfInterpolator::WEIGHTS);
        for (components, at) in io.write(LsfInterpolator::COEFFICIENTS).iter_mut().zip(places) {
            self.interpolate(&at);
            frames::Coefficients {
                ar: self.mix.ar(),
                ma: self.mix.ma(),
                gain: self.mix.gain,
                variance: self.mix.variance,
                warping: self.mix.warping,
            }
            .write(components);
            let Weights { models: vertices, weights, speed_m_s, force_n } = at;
            let spot = Spot { speed_m_s, force_n, triangle: 0, vertices, weights };
            let layers = |texture: &TextureModel| texture.interpolate_layers(&spot);
            if let Some(layers) = self.layered.as_ref().and_then(layers) {
                LayersAt { speed_m_s: at.speed_m_s, components: layers }.write(components);
            }
        }
    }
}

impl Mixing {
    fn interpolate(&mut self, at: &Weights) {
        self.interpolator.interpolate_at(at.models, at.weights, &mut self.mix);
        // All models at rest are silent: without this, rounding could leave the weight of one that is not.
        if at.speed_m_s == 0.0 || at.force_n == 0.0 {
            self.mix.variance = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::locator::TriangleLocator;
    use super::super::tile;
    use super::*;
    use haptograph_engine::frame::{Kind, OneKind};
    use haptograph_engine::testing::Bench;

    #[test]
    fn locator_and_interpolator_together_are_the_interpolation_of_the_surface() {
        let settings = || SurfaceSettings { surface: tile() };
        let mut locator = Bench::new::<TriangleLocator>(settings(), 240.0, &[Kind::SCALAR; 2]).unwrap();
        let mut mixer = Bench::new::<LsfInterpolator>(settings(), 240.0, &[Weights::KIND]).unwrap();
        let mut whole = Interpolator::new(&load_texture(&tile()).unwrap());
        let (speed, force): (Vec<f64>, Vec<f64>) = (0..500)
            .map(|k| ((0.02 * f64::from(k)).sin() * 0.2, (0.03 * f64::from(k)).cos().max(0.0) * 3.0))
            .unzip();
        let weights = locator.run(&[&speed, &force]).remove(0);
        let filters = mixer.run_in_blocks(&[&weights], &[3, 64]).remove(0);
        let mut wanted = Coefficients::SILENCE;
        for (k, lanes) in filters.as_chunks().0.iter().enumerate() {
            whole.interpolate(speed[k], force[k], &mut wanted);
            let got = frames::Coefficients::from_components(lanes);
            assert_eq!((got.ar, got.ma), (wanted.ar(), wanted.ma()));
            assert_eq!((got.gain, got.variance), (wanted.gain, wanted.variance));
        }
    }

    #[test]
    fn weights_of_no_model_are_silence() {
        let settings = SurfaceSettings { surface: tile() };
        let mut mixer = Bench::new::<LsfInterpolator>(settings, 240.0, &[Weights::KIND]).unwrap();
        let nowhere = [1e9, f64::NAN, 2.0, 0.3, 0.3, 0.4, 0.1, 1.0];
        let filter = mixer.run(&[&nowhere]).remove(0);
        let got = frames::Coefficients::from_components(filter.as_chunks().0.first().unwrap());
        assert_eq!((got.ar.len(), got.variance), (0, 0.0));
    }
}
