//! Interpolates a texture at any speed and force, in real time: locates the triangle, mixes the line spectral frequencies
//! of its three models by the barycentric weights, and converts the mix to coefficients (thesis 2.4).

use crate::MAX_ORDER;
use crate::lsf::{lsf_into_ar, warped_into_ar};
use crate::model::ArmaModel;
use crate::texture::TextureModel;
use crate::triangulation::{Location, Triangle, Triangulation};

/// A filter's coefficients and excitation at one time, in arrays of fixed size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients {
    /// a_1..a_p of A(z) = 1 + Σ a_k z⁻ᵏ; zero from the order on.
    pub ar: [f64; MAX_ORDER],
    /// Order p of the AR polynomial.
    pub ar_order: usize,
    /// b_1..b_q of the monic MA polynomial; zero from the order on.
    pub ma: [f64; MAX_ORDER],
    /// Order q of the MA polynomial; 0 for an AR model.
    pub ma_order: usize,
    /// Multiplies the whole MA polynomial; 1 for an AR model.
    pub gain: f64,
    /// Variance of the excitation, (m/s²)²; exactly 0 at zero speed or force.
    pub variance: f64,
    /// Warping factor of the AR polynomial's frequency axis; 0 if it is not warped.
    pub warping: f64,
}

impl Coefficients {
    /// No filter and no excitation.
    pub const SILENCE: Coefficients = Coefficients {
        ar: [0.0; MAX_ORDER],
        ar_order: 0,
        ma: [0.0; MAX_ORDER],
        ma_order: 0,
        gain: 1.0,
        variance: 0.0,
        warping: 0.0,
    };

    /// a_1..a_p.
    pub fn ar(&self) -> &[f64] {
        &self.ar[..self.ar_order.min(MAX_ORDER)]
    }

    /// b_1..b_q.
    pub fn ma(&self) -> &[f64] {
        &self.ma[..self.ma_order.min(MAX_ORDER)]
    }
}

/// The position on the map of a set of coefficients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Speed after saturation, m/s.
    pub speed_m_s: f64,
    /// Force after saturation, N.
    pub force_n: f64,
    /// The triangle's number, from 0.
    pub triangle: u32,
    /// The vertices' numbers, from 0.
    pub vertices: Triangle,
    /// The weights.
    pub weights: [f64; 3],
}

/// Interpolates a texture. Only the constructor allocates. The search for a triangle begins at the last one.
#[derive(Debug, Clone)]
pub struct Interpolator {
    map: Triangulation,
    /// One row of `stride` values for each model: AR LSFs, MA LSFs, gain, variance (the amplitude of warped models: the root of
    /// their power), padding.
    rows: Vec<f64>,
    stride: usize,
    ar_order: usize,
    ma_order: usize,
    warping: f64,
    last_triangle: u32,
}

/// Rows are padded to whole vectors.
const LANES: usize = 4;
/// Longest row.
const MAX_ROW: usize = 2 * MAX_ORDER + LANES;

impl Interpolator {
    /// Prepares the models of `texture` for interpolation.
    pub fn new(texture: &TextureModel) -> Self {
        let (ar_order, ma_order) = (texture.ar_order(), texture.ma_order());
        let stride = (ar_order + ma_order + 2).next_multiple_of(LANES);
        let warping = texture.warping();
        let level = |model: &ArmaModel| match warping {
            0.0 => model.variance(),
            _ => model.power().sqrt(),
        };
        let mut rows = vec![0.0; stride * texture.models().len()];
        for (row, at) in rows.chunks_exact_mut(stride).zip(texture.models()) {
            let numbers = at.model.ar_lsf().iter().chain(at.model.ma_lsf());
            let numbers = numbers.copied().chain([at.model.gain(), level(&at.model)]);
            row.iter_mut().zip(numbers).for_each(|(place, number)| *place = number);
        }
        let map = texture.triangulation().clone();
        Interpolator { map, rows, stride, ar_order, ma_order, warping, last_triangle: 0 }
    }

    /// The coefficients at a speed in m/s and a force in N. Both saturate at the largest modelled values; negative values and
    /// NaN count as zero. The result does not depend on the last triangle, except for rounding.
    pub fn interpolate(&mut self, speed_m_s: f64, force_n: f64, into: &mut Coefficients) -> Spot {
        let spot = self.locate(speed_m_s, force_n);
        self.interpolate_at(spot.vertices, spot.weights, into);
        // All models at rest are silent; rounding could leave weight on a model that is not.
        if spot.speed_m_s == 0.0 || spot.force_n == 0.0 {
            into.variance = 0.0;
        }
        spot
    }

    /// The coefficients of a mix of three models by number, such as those of a located spot; silence for invalid numbers.
    pub fn interpolate_at(&self, models: Triangle, weights: [f64; 3], into: &mut Coefficients) {
        let count = self.rows.len() / self.stride;
        if models.iter().any(|model| *model as usize >= count) {
            *into = Coefficients::SILENCE;
            return;
        }
        let mut mix = [0.0; MAX_ROW];
        self.mix(models, weights, &mut mix);
        let (ar_lsf, rest) = mix.split_at(self.ar_order);
        let (ma_lsf, rest) = rest.split_at(self.ma_order);
        into.ar_order = self.ar_order;
        into.ma_order = self.ma_order;
        let ar = &mut into.ar[..self.ar_order];
        into.variance = if self.warping == 0.0 {
            lsf_into_ar(ar_lsf, ar);
            rest[1]
        } else {
            rest[1] * rest[1] / warped_into_ar(ar_lsf, self.warping, ar)
        };
        into.ar[self.ar_order..].fill(0.0);
        lsf_into_ar(ma_lsf, &mut into.ma[..self.ma_order]);
        into.ma[self.ma_order..].fill(0.0);
        into.gain = rest[0];
        into.warping = self.warping;
    }

    /// Writes the unconverted mix at a spot into a lane of `rows`: line spectral frequencies of the AR and the MA polynomial,
    /// gain, and variance (for warped models the square root of their power).
    #[inline(always)]
    pub(crate) fn mix_into<const L: usize>(&self, spot: &Spot, lane: usize, rows: &mut [[f64; L]]) {
        let mut mix = [0.0; MAX_ROW];
        self.mix(spot.vertices, spot.weights, &mut mix);
        for (row, mixed) in rows.iter_mut().zip(&mix) {
            row[lane] = *mixed;
        }
    }

    /// The triangle and weights at a speed in m/s and a force in N, saturated.
    pub fn locate(&mut self, speed_m_s: f64, force_n: f64) -> Spot {
        let mut last_triangle = self.last_triangle;
        let spot = self.locate_from(&mut last_triangle, speed_m_s, force_n);
        self.last_triangle = last_triangle;
        spot
    }

    /// Like [`Self::locate`], for one of several voices that share these models: each keeps its own last triangle.
    pub(crate) fn locate_from(&self, last_triangle: &mut u32, speed_m_s: f64, force_n: f64) -> Spot {
        let (speed_m_s, force_n) = self.map.saturate(speed_m_s, force_n);
        let Location { triangle, weights } = self.map.locate_from(*last_triangle, speed_m_s, force_n);
        *last_triangle = triangle;
        Spot { speed_m_s, force_n, triangle, vertices: self.map.triangles()[triangle as usize], weights }
    }

    /// The map that is interpolated on.
    pub fn map(&self) -> &Triangulation {
        &self.map
    }

    /// The weighted mean of the three models' rows; exactly a model's row at its vertex.
    #[inline(always)]
    fn mix(&self, models: Triangle, [u, v, w]: [f64; 3], mix: &mut [f64; MAX_ROW]) {
        let row = |vertex: u32| {
            let start = vertex as usize * self.stride;
            self.rows[start..start + self.stride].as_chunks::<LANES>().0
        };
        let [a, b, c] = models.map(row);
        for (((mix, a), b), c) in mix.as_chunks_mut::<LANES>().0.iter_mut().zip(a).zip(b).zip(c) {
            for i in 0..LANES {
                mix[i] = u * a[i] + v * b[i] + w * c[i];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::hatt::tests::real_files::{AT_1_KHZ, AT_10_KHZ, hatt_files};
    use crate::hull::Hull;

    use crate::{ModelAt, VertexKind};
    use haptograph_signal::prediction::ar_to_reflection;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// A texture of models with `pairs` resonances each, as sharp as `radius`, and MA parts of half the order.
    fn wild_texture(pairs: usize, radius: f64, seed: u64) -> TextureModel {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let lsf = |random: &mut Xoshiro256PlusPlus, pairs: usize| {
            // A pair of frequencies about π (1 - radius) / 2 apart is a pole pair of that radius.
            let gap = std::f64::consts::PI * (1.0 - radius) / 2.0;
            let room = 3.1 - 4.0 * gap * pairs as f64;
            let mut centres: Vec<f64> = (0..pairs).map(|_| random.random_range(0.01..room)).collect();
            centres.sort_by(f64::total_cmp);
            let apart = centres.iter().zip(0..).map(|(centre, k)| centre + 4.0 * gap * f64::from(k));
            apart.flat_map(|centre| [centre, centre + gap]).collect::<Vec<_>>()
        };
        let measured = (0..14)
            .map(|_| {
                let (ar, ma) = (lsf(&mut random, pairs), lsf(&mut random, pairs / 2));
                let (gain, variance) = (random.random_range(0.5..9.0), random.random_range(0.01..5.0));
                ModelAt {
                    speed_m_s: random.random_range(0.001..0.25),
                    force_n: random.random_range(0.05..4.0),
                    model: ArmaModel::from_lsf(&ar, &ma, gain, variance).unwrap(),
                    kind: VertexKind::Measured,
                }
            })
            .collect();
        TextureModel::from_measured(1000.0, measured, &Hull::default()).unwrap()
    }

    /// The definition, written the plain way.
    fn by_definition(texture: &TextureModel, spot: &Spot) -> (Vec<f64>, Vec<f64>, f64, f64) {
        let models = spot.vertices.map(|vertex| &texture.models()[vertex as usize].model);
        let mean = |number: &dyn Fn(&ArmaModel) -> f64| -> f64 {
            (0..3).map(|i| spot.weights[i] * number(models[i])).sum()
        };
        let convert = |order: usize, lsf: &dyn Fn(&ArmaModel) -> Vec<f64>| {
            let lsf: Vec<f64> = (0..order).map(|k| mean(&|model| lsf(model)[k])).collect();
            let mut coefficients = vec![0.0; order];
            lsf_into_ar(&lsf, &mut coefficients);
            coefficients
        };
        (
            convert(texture.ar_order(), &|model| model.ar_lsf().to_vec()),
            convert(texture.ma_order(), &|model| model.ma_lsf().to_vec()),
            mean(&ArmaModel::gain),
            mean(&ArmaModel::variance),
        )
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-9 * b.abs().max(1.0)
    }

    #[test]
    fn it_is_the_weighted_mean_of_frequencies_converted() {
        let texture = wild_texture(6, 0.97, 3);
        let mut interpolator = Interpolator::new(&texture);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(4);
        let mut got = Coefficients::SILENCE;
        for _ in 0..2000 {
            let (speed, force) = (random.random_range(-0.01..0.3), random.random_range(-0.1..4.5));
            let spot = interpolator.interpolate(speed, force, &mut got);
            let (ar, ma, gain, variance) = by_definition(&texture, &spot);
            assert!(got.ar().iter().zip(&ar).all(|(a, b)| close(*a, *b)));
            assert!(got.ma().iter().zip(&ma).all(|(a, b)| close(*a, *b)));
            assert!(close(got.gain, gain) && close(got.variance, variance));
        }
    }

    #[test]
    fn at_a_model_it_is_that_model_to_the_bit() {
        let texture = wild_texture(6, 0.97, 5);
        let mut interpolator = Interpolator::new(&texture);
        let mut got = Coefficients::SILENCE;
        for at in texture.models() {
            interpolator.interpolate(at.speed_m_s, at.force_n, &mut got);
            let mut ar = vec![0.0; texture.ar_order()];
            lsf_into_ar(at.model.ar_lsf(), &mut ar);
            assert_eq!(got.ar(), ar);
            assert_eq!((got.gain, got.variance), (at.model.gain(), at.model.variance()));
        }
    }

    #[test]
    fn silence_at_zero_speed_or_force_and_nowhere_else() {
        let texture = wild_texture(3, 0.95, 6);
        let mut interpolator = Interpolator::new(&texture);
        let mut got = Coefficients::SILENCE;
        for k in 0..=1000 {
            let (speed, force) = (0.25 * f64::from(k) / 1000.0, 4.0 * f64::from(k) / 1000.0);
            for (speed, force) in
                [(0.0, force), (speed, 0.0), (-1.0, force), (f64::NAN, force), (-0.0, force)]
            {
                interpolator.interpolate(speed, force, &mut got);
                assert_eq!(got.variance, 0.0);
            }
            if k > 0 {
                interpolator.interpolate(speed, force, &mut got);
                assert!(got.variance > 0.0);
            }
        }
    }

    #[test]
    fn crossing_a_side_is_continuous() {
        let texture = wild_texture(5, 0.95, 7);
        let map = texture.triangulation();
        let mut interpolator = Interpolator::new(&texture);
        let (mut here, mut there) = (Coefficients::SILENCE, Coefficients::SILENCE);
        for triangle in map.triangles() {
            let [a, b, _] = triangle.map(|v| &texture.models()[v as usize]);
            let (speed, force) = (0.3 * a.speed_m_s + 0.7 * b.speed_m_s, 0.3 * a.force_n + 0.7 * b.force_n);
            interpolator.interpolate(speed, force, &mut here);
            for (towards_speed, towards_force) in [(1e-13, 0.0), (-1e-13, 0.0), (0.0, 1e-12), (0.0, -1e-12)] {
                interpolator.interpolate(speed + towards_speed, force + towards_force, &mut there);
                assert!(here.ar().iter().zip(there.ar()).all(|(x, y)| (x - y).abs() < 1e-7));
            }
        }
    }

    #[test]
    fn beyond_the_maximum_is_the_maximum() {
        let texture = wild_texture(4, 0.95, 8);
        let mut interpolator = Interpolator::new(&texture);
        let (mut at, mut beyond) = (Coefficients::SILENCE, Coefficients::SILENCE);
        let (max_speed, max_force) = (texture.max_speed_m_s(), texture.max_force_n());
        for k in 0..=100 {
            let part = f64::from(k) / 100.0;
            let spot = interpolator.interpolate(max_speed, part * max_force, &mut at);
            assert_eq!(spot, interpolator.interpolate(f64::INFINITY, part * max_force, &mut beyond));
            assert_eq!(at, beyond);
            interpolator.interpolate(part * max_speed, max_force, &mut at);
            interpolator.interpolate(part * max_speed, max_force + 1e-9, &mut beyond);
            assert_eq!(at, beyond);
        }
    }

    /// Random points of a map: coefficients are finite, and both polynomials have all roots inside the circle.
    fn stays_stable(texture: &TextureModel, points: usize, seed: u64) {
        let mut interpolator = Interpolator::new(texture);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut got = Coefficients::SILENCE;
        for _ in 0..points {
            let speed = random.random::<f64>() * texture.max_speed_m_s() * 1.01;
            let force = random.random::<f64>() * texture.max_force_n() * 1.01;
            let spot = interpolator.interpolate(speed, force, &mut got);
            assert!(ar_to_reflection(got.ar()).is_ok(), "AR at {spot:?}");
            assert!(ar_to_reflection(got.ma()).is_ok(), "MA at {spot:?}");
            assert!(got.gain > 0.0 && got.gain.is_finite());
            assert!(got.variance >= 0.0 && got.variance.is_finite());
        }
    }

    /// The shipped surfaces, and the toolkit's if available.
    fn available() -> Vec<TextureModel> {
        let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/surfaces");
        let mut files: Vec<_> =
            std::fs::read_dir(shipped).unwrap().map(|file| file.unwrap().path()).collect();
        files.retain(|file| file.extension().is_some_and(|extension| extension == "ron"));
        files.extend([AT_10_KHZ, AT_1_KHZ].into_iter().flat_map(hatt_files));
        files.iter().filter_map(|file| crate::files::load(file).unwrap().texture).collect()
    }

    #[test]
    fn stable_everywhere() {
        for seed in 0..8 {
            stays_stable(&wild_texture(10, 0.9999, seed), 2_000, seed);
            stays_stable(&wild_texture(4, 0.9986, seed), 2_000, seed);
        }
        let available = available();
        assert!(!available.is_empty());
        available.iter().for_each(|texture| stays_stable(texture, 500, 9));
    }

    #[test]
    #[ignore = "ten million points on adversarial maps, a hundred thousand on each other: minutes"]
    fn stable_at_ten_million_points() {
        for seed in 0..10 {
            stays_stable(&wild_texture(10, 0.9999, seed), 1_000_000, seed);
        }
        available().iter().for_each(|texture| stays_stable(texture, 100_000, 10));
    }
}
