//! Position of speed and force on the map of a texture.

use haptograph_engine::frame::{Record, Scalar};
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, NodeKind, Port, Processor, Tick};
use haptograph_signal::quantity::Quantity;
use haptograph_surfaces::Interpolator;
use std::path::PathBuf;

use super::frames::Weights;
use super::load_texture;

haptograph_engine::settings! {
    /// The surface to render.
    pub struct SurfaceSettings {
        /// The surface file, relative to the graph file.
        surface: PathBuf;
    }
}

haptograph_engine::node! {
    /// Clamps speed and force to the range of the surface's models: from zero to the largest of each. `TriangleLocator`
    /// does this by itself; use it to obtain the rendered speed and force.
    pub struct Saturation(SurfaceSettings) in "texture";
    source: "2.4.1";
    example: r#""within": Saturation(speed: "speed.speed", force: "stylus.force", surface: "surfaces/t3-tile.ron")"#;
    in SPEED: Scalar = Port::of(Quantity::SPEED, "Speed of the tip, m/s.");
    in FORCE: Scalar = Port::of(Quantity::FORCE, "Normal force, N.");
    out SPEED_WITHIN as "speed": Scalar = Port::of(Quantity::SPEED, "Speed within the model, m/s.");
    out FORCE_WITHIN as "force": Scalar = Port::of(Quantity::FORCE, "Force within the model, N.");
}

impl NodeKind for Saturation {
    fn build(settings: SurfaceSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Saturating { texture: Interpolator::new(&load_texture(&settings.surface)?) }))
    }
}

#[derive(Debug, Clone)]
struct Saturating {
    texture: Interpolator,
}

impl Processor<Saturation> for Saturating {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Saturation>) {
        let (speeds, forces) = (io.read(Saturation::SPEED), io.read(Saturation::FORCE));
        let (speed, force) = io.write_all((Saturation::SPEED_WITHIN, Saturation::FORCE_WITHIN));
        for (((speed, force), v), f) in speed.iter_mut().zip(force).zip(speeds).zip(forces) {
            (*speed, *force) = self.texture.map().saturate(*v, *f);
        }
    }
}

haptograph_engine::node! {
    /// Finds the triangle of models that contains the hand's speed and force, and the barycentric weights of its three
    /// corners. Walks from the last triangle; beyond the largest modelled speed or force it stays on the edge.
    pub struct TriangleLocator(SurfaceSettings) in "texture";
    source: "2.4.1, Eq. 2.4.1";
    example: r#""locate": TriangleLocator(speed: "speed.speed", force: "stylus.force", surface: "surfaces/t3-tile.ron")"#;
    in SPEED: Scalar = Port::of(Quantity::SPEED, "Speed of the tip, m/s.");
    in FORCE: Scalar = Port::of(Quantity::FORCE, "Normal force, N.");
    out WEIGHTS: Weights = Port::of(Quantity::NUMBER, "Three models and their weights.");
}

impl NodeKind for TriangleLocator {
    fn build(settings: SurfaceSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Walker { texture: Interpolator::new(&load_texture(&settings.surface)?) }))
    }
}

#[derive(Debug, Clone)]
struct Walker {
    texture: Interpolator,
}

impl Processor<TriangleLocator> for Walker {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, TriangleLocator>) {
        let (speeds, forces) = (io.read(TriangleLocator::SPEED), io.read(TriangleLocator::FORCE));
        let places = io.write(TriangleLocator::WEIGHTS).iter_mut();
        for ((components, v), f) in places.zip(speeds).zip(forces) {
            let spot = self.texture.locate(*v, *f);
            *components = Weights {
                models: spot.vertices,
                weights: spot.weights,
                speed_m_s: spot.speed_m_s,
                force_n: spot.force_n,
            }
            .to_components();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tile;
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    #[test]
    fn weights_give_back_the_point_they_were_found_for() {
        let texture = load_texture(&tile()).unwrap();
        let settings = || SurfaceSettings { surface: tile() };
        let kinds = [Kind::SCALAR; 2];
        let mut locator = Bench::new::<TriangleLocator>(settings(), 240.0, &kinds).unwrap();
        let mut within = Bench::new::<Saturation>(settings(), 240.0, &kinds).unwrap();
        let (speed, force): (Vec<f64>, Vec<f64>) = (0..2000)
            .map(|k| (0.15 * (0.37 * f64::from(k)).sin() + 0.1, 2.0 * (0.11 * f64::from(k)).sin() + 1.0))
            .unzip();
        let found = locator.run_in_blocks(&[&speed, &force], &[1, 9]).remove(0);
        let kept = within.run(&[&speed, &force]);
        for (k, lanes) in found.as_chunks().0.iter().enumerate() {
            let at = Weights::from_components(lanes);
            let mean = |f: &dyn Fn(usize) -> f64| -> f64 {
                (0..3).map(|i| at.weights[i] * f(at.models[i] as usize)).sum()
            };
            assert!((at.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            assert!((mean(&|i| texture.models()[i].speed_m_s) - kept[0][k]).abs() < 1e-12);
            assert!((mean(&|i| texture.models()[i].force_n) - kept[1][k]).abs() < 1e-12);
            assert_eq!((at.speed_m_s, at.force_n), (kept[0][k], kept[1][k]));
            assert_eq!(kept[0][k], speed[k].clamp(0.0, texture.max_speed_m_s()));
        }
    }

    #[test]
    fn a_missing_surface_is_an_error_at_its_field() {
        let settings = SurfaceSettings { surface: "nowhere.ron".into() };
        let refused = Bench::new::<TriangleLocator>(settings, 240.0, &[Kind::SCALAR; 2]).err();
        assert_eq!(refused.and_then(|e| e.field), Some("surface"));
    }
}
