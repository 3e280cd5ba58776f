//! The law of a texture: the spectrum on a warped axis as powers of speed and force, and the map of models made from it.
//!
//! The law is fitted to observations, each a place in speed and force with its spectrum: windows of recordings when a
//! texture is learned, measured models when a law is compared with other maps.

use super::cells::{CELLS, Cells};
use super::correction::{Correction, Stretch};
use super::regression::{Law, Place, Prior, fit, fit_robustly};
use super::texture::LearnTextureError;
use haptograph_surfaces::bounds::{MAX_FORCE_N, MAX_SPEED_M_S};
use haptograph_surfaces::{ArmaModel, ModelAt, TextureModel, VertexKind};
use nalgebra::{Vector2, Vector3};

/// Exponents of speed and force of the power of real textures: one regression over the 1,425 measured models of 100
/// public textures with a level for each texture; see docs/texture-models.md.
pub(crate) const POWER_SLOPES: [f64; 2] = [1.95, 0.44];
/// The prior of the power's exponents of speed and force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Exponents {
    /// The prior means.
    pub slopes: [f64; 2],
    /// The least and greatest exponents.
    pub speed: (f64, f64),
    pub force: (f64, f64),
}

impl Exponents {
    /// The prior for the acceleration of a tool.
    pub(crate) const ACCELERATION: Self = Self { slopes: POWER_SLOPES, speed: (0.5, 3.5), force: (0.0, 1.5) };
    /// The prior for a sensor in an unknown unit: constant over speed and force.
    pub(crate) const UNKNOWN: Self = Self { slopes: [0.0; 2], speed: (0.0, 3.5), ..Self::ACCELERATION };
}

/// Weight of the exponents of real textures, in observations. The spread of the exponents over textures (0.60 and 0.49,
/// docs/texture-models.md) against that of a texture's models around its own law (0.39, the median over textures, in natural
/// logarithms of power) makes 0.4 and 0.6; 1 is a round number above both.
const POWER_STRENGTH: f64 = 1.0;
/// The prior of shapes: constant over speed and force.
const SHAPE: Prior = Prior { slopes: [0.0; 2], strength: 1.0 };
/// Extrapolation of shapes and of the power beyond the data, as ratios.
const SHAPE_REACH: f64 = 1.5;
const POWER_REACH: f64 = 3.0;
/// Below this part of the lightest force observed the amplitude falls linearly to zero; above, real textures follow their
/// power of force, as leave-one-out tests show. Forces below 0.05 N count as unknown.
const FADE_PART: f64 = 1.0 / 3.0;
const LEAST_FADE_N: f64 = 0.05;
/// The amplitude falls below this force at most. Where the power does not depend on the force, 0.1 N is then 19 dB below the
/// law, and less in all other cases: nothing that is touched so much is mute.
const MAX_FADE_N: f64 = 0.9;
/// Limit of the law over the loudest observation: 6 dB.
const LOUDEST: f64 = 4.0;
/// Ratio between neighbouring speeds and forces of the grid.
const SPEED_RATIO: f64 = 1.5;
const FORCE_RATIO: f64 = 1.6;
/// Slowest speed of the grid, m/s: below it amplitude falls linearly to zero at rest.
const SLOWEST_M_S: f64 = 0.003;

/// An observation: a place and its spectrum.
#[derive(Debug, Clone)]
pub(crate) struct Observation {
    pub speed_m_s: f64,
    pub force_n: f64,
    /// Power of the vibration, (m/s²)².
    pub power: f64,
    /// Means of its one-sided density over the cells, (m/s²)²/Hz.
    pub cells: Vec<f64>,
}

/// Rate, order and warping of the models of a law.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axis {
    pub rate_hz: f64,
    pub warping: f64,
    pub order: usize,
}

impl Observation {
    /// A measured model as an observation.
    pub(crate) fn of_model(at: &ModelAt, rate_hz: f64, cells: &Cells) -> Self {
        let variance = at.model.variance();
        let density = |frequency_hz: f64| {
            let frequency_rad = std::f64::consts::TAU * frequency_hz / rate_hz;
            2.0 / rate_hz * variance * at.model.power_gain_at(frequency_rad)
        };
        Self {
            speed_m_s: at.speed_m_s,
            force_n: at.force_n,
            power: at.model.power(),
            cells: cells.means_of(density),
        }
    }
}

/// Densities over the cells as powers of speed and force.
#[derive(Debug, Clone)]
pub(crate) struct SpectralLaw {
    /// Centre of the data, ln m/s and ln N.
    centre: [f64; 2],
    /// Range of speed and of force in the data.
    speed_m_s: (f64, f64),
    force_n: (f64, f64),
    /// Below this force the amplitude falls linearly.
    fade_n: f64,
    power: Law,
    loudest: f64,
    /// Density of each cell over the power.
    shape: Vec<Law>,
    /// Correction of the powers above.
    correction: Option<Correction>,
}

impl SpectralLaw {
    /// Fits the law to at least one observation of positive speed, force and power.
    pub(crate) fn fit(observations: &[Observation], exponents: Exponents) -> Self {
        let values = |value: fn(&Observation) -> f64| observations.iter().map(value);
        let mean_log = |value: fn(&Observation) -> f64| {
            values(value).map(f64::ln).sum::<f64>() / observations.len() as f64
        };
        let range = |value: fn(&Observation) -> f64| {
            values(value).fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)))
        };
        let centre = [mean_log(|at| at.speed_m_s), mean_log(|at| at.force_n)];
        let place =
            |at: &Observation| Vector3::new(1.0, at.speed_m_s.ln() - centre[0], at.force_n.ln() - centre[1]);
        let places: Vec<Place> = observations.iter().map(place).collect();
        let powers: Vec<f64> = values(|at| at.power).collect();
        let prior = Prior { slopes: exponents.slopes, strength: POWER_STRENGTH };
        let (power, weights) = fit_robustly(&places, &powers, prior);
        let power = within_exponents(power, exponents, &places, &powers, &weights);
        let shape = (0..CELLS).map(|cell| {
            let shares: Vec<f64> = observations.iter().map(|at| at.cells[cell] / at.power).collect();
            fit(&places, &shares, &weights, SHAPE)
        });
        let force_n = range(|at| at.force_n);
        Self {
            centre,
            speed_m_s: range(|at| at.speed_m_s),
            force_n,
            fade_n: (force_n.0 * FADE_PART).clamp(LEAST_FADE_N, MAX_FADE_N).min(force_n.0),
            power,
            loudest: LOUDEST * powers.iter().copied().fold(0.0, f64::max),
            shape: shape.collect(),
            correction: None,
        }
    }

    /// The same law without the linear fall of amplitude below the lightest force of the data.
    pub(crate) fn without_fade(mut self) -> Self {
        self.fade_n = 0.0;
        self
    }

    /// Density over the cells; zero at rest and in the air.
    pub(crate) fn cells(&self, speed_m_s: f64, force_n: f64) -> Vec<f64> {
        let within = |x: f64, (low, high): (f64, f64)| x.clamp(low / SHAPE_REACH, high * SHAPE_REACH).ln();
        let logs = Vector2::new(within(speed_m_s, self.speed_m_s), within(force_n, self.force_n));
        let place = Vector3::new(1.0, logs[0] - self.centre[0], logs[1] - self.centre[1]);
        let power = self.power_at(speed_m_s, force_n);
        let mut cells: Vec<f64> = self.shape.iter().map(|law| power * law.dot(&place).exp()).collect();
        if let Some(correction) = &self.correction {
            let logs = correction.at(&logs);
            cells.iter_mut().zip(logs).for_each(|(cell, log)| *cell *= log.exp());
        }
        cells
    }

    /// The power of the law before the cells are scaled: below [`Self::fade_n`] the amplitude falls linearly.
    fn power_at(&self, speed_m_s: f64, force_n: f64) -> f64 {
        if !(speed_m_s > 0.0 && force_n > 0.0) {
            return 0.0;
        }
        let fade = (force_n / self.fade_n).min(1.0).powi(2);
        let place = Vector3::new(
            1.0,
            speed_m_s.min(self.speed_m_s.1 * POWER_REACH).ln() - self.centre[0],
            force_n.clamp(self.fade_n, (self.force_n.1 * POWER_REACH).max(self.fade_n)).ln() - self.centre[1],
        );
        self.power.dot(&place).exp() * fade
    }

    /// Scales each cell by the ratio of observed to expected power over all stretches; scales the expectations too.
    pub(super) fn scale_cells(&mut self, stretches: &mut [Stretch]) {
        for (cell, law) in self.shape.iter_mut().enumerate() {
            let sum = |densities: fn(&Stretch) -> &Vec<f64>| -> f64 {
                stretches.iter().map(|stretch| densities(stretch)[cell]).sum()
            };
            let (seen, expected) = (sum(|stretch| &stretch.seen), sum(|stretch| &stretch.expected));
            if seen > 0.0 && expected > 0.0 {
                law[0] += (seen / expected).ln();
                stretches.iter_mut().for_each(|stretch| stretch.expected[cell] *= seen / expected);
            }
        }
    }

    /// Corrects the law by its residuals, as far as that improves leave-one-out prediction.
    pub(super) fn correct(&mut self, stretches: &[Stretch]) {
        self.correction = Correction::fit(stretches);
    }

    /// Like [`Self::correct`], with each observation as a stretch.
    pub(crate) fn corrected(mut self, observations: &[Observation]) -> Self {
        let stretch = |at: &Observation| Stretch {
            place: Vector2::new(at.speed_m_s.ln(), at.force_n.ln()),
            seen: at.cells.clone(),
            expected: self.cells(at.speed_m_s, at.force_n),
        };
        let stretches: Vec<Stretch> = observations.iter().map(stretch).collect();
        self.correct(&stretches);
        self
    }

    /// Models at the points of a grid from rest to beyond the data, and triangles between them.
    pub(crate) fn on_grid(&self, axis: Axis) -> Result<TextureModel, LearnTextureError> {
        let slowest = SLOWEST_M_S.min(self.speed_m_s.0);
        let fastest = (self.speed_m_s.1 * POWER_REACH).min(MAX_SPEED_M_S);
        let speeds = grid(slowest, fastest, SPEED_RATIO);
        let lightest = self.fade_n;
        // Triangles between (0, 0) and two speeds at the lightest force are crude: the smaller they are, the less.
        let mut forces = vec![0.0, lightest / 4.0, lightest / 2.0];
        let firmest = (self.force_n.1 * POWER_REACH).min(MAX_FORCE_N);
        forces.extend(&grid(lightest, firmest, FORCE_RATIO)[1..]);
        let mut models = Vec::with_capacity(speeds.len() * forces.len());
        for &speed_m_s in &speeds {
            for &force_n in &forces {
                models.push(self.vertex(speed_m_s, force_n, (speeds[1], forces[1]), axis)?);
            }
        }
        let triangles = rectangles(speeds.len(), forces.len());
        Ok(TextureModel::new(axis.rate_hz, models, triangles)?)
    }

    /// A vertex of the map; at rest a silent model of the filter at `least` speed and force.
    fn vertex(
        &self,
        speed_m_s: f64,
        force_n: f64,
        least: (f64, f64),
        axis: Axis,
    ) -> Result<ModelAt, LearnTextureError> {
        let model = self.model(speed_m_s.max(least.0), force_n.max(least.1), axis)?;
        let at_rest = speed_m_s == 0.0 || force_n == 0.0;
        let within = |x: f64, (low, high): (f64, f64)| x >= low && x <= high;
        let fitted = within(speed_m_s, self.speed_m_s) && within(force_n, self.force_n);
        Ok(ModelAt {
            speed_m_s,
            force_n,
            model: if at_rest { model.with_power(0.0)? } else { model },
            kind: if fitted { VertexKind::Fitted } else { VertexKind::Edge },
        })
    }

    /// The model of a positive speed and force, nowhere louder than [`LOUDEST`] allows.
    pub(crate) fn model(
        &self,
        speed_m_s: f64,
        force_n: f64,
        axis: Axis,
    ) -> Result<ArmaModel, LearnTextureError> {
        let cells = self.cells(speed_m_s, force_n);
        let model = ArmaModel::warped_from_cells(&cells, axis.warping, axis.rate_hz, axis.order)
            .map_err(|error| LearnTextureError::NoModels { reason: error.to_string() })?;
        let power = model.power().min(self.loudest);
        Ok(model.with_power(power)?)
    }
}

/// The law with exponents that textures have, its level fitted again.
fn within_exponents(
    law: Law,
    exponents: Exponents,
    places: &[Place],
    powers: &[f64],
    weights: &[f64],
) -> Law {
    let mut bounded = law;
    bounded[1] = law[1].clamp(exponents.speed.0, exponents.speed.1);
    bounded[2] = law[2].clamp(exponents.force.0, exponents.force.1);
    let scaled = places.iter().zip(powers).zip(weights);
    let (sum, total) = scaled.fold((0.0, 0.0), |(sum, total), ((place, y), w)| {
        (sum + w * y / bounded.dot(place).exp(), total + w)
    });
    if sum > 0.0 {
        bounded[0] += (sum / total).ln();
    }
    bounded
}

/// Zero, then even ratios of about `ratio` from `low` to `high`.
fn grid(low: f64, high: f64, ratio: f64) -> Vec<f64> {
    let steps = ((high / low).ln() / ratio.ln()).ceil().max(1.0);
    let step = |k: usize| low * (high / low).powf(k as f64 / steps);
    // Six decimals, as files have.
    let rounded = |x: f64| (x * 1e6).round() / 1e6;
    std::iter::once(0.0).chain((0..=steps as usize).map(|k| rounded(step(k)))).collect()
}

/// Two triangles for each rectangle of the grid.
fn rectangles(speeds: usize, forces: usize) -> Vec<[u32; 3]> {
    let vertex = |speed: usize, force: usize| (speed * forces + force) as u32;
    let corners = (0..speeds - 1).flat_map(|v| (0..forces - 1).map(move |f| (v, f)));
    corners
        .flat_map(|(v, f)| {
            let [a, b, c, d] = [vertex(v, f), vertex(v + 1, f), vertex(v + 1, f + 1), vertex(v, f + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_surfaces::interpolation::{Coefficients, Interpolator};
    use haptograph_surfaces::model::warping_for;

    const RATE_HZ: f64 = 10_000.0;

    fn axis() -> Axis {
        Axis { rate_hz: RATE_HZ, warping: warping_for(RATE_HZ), order: 8 }
    }

    /// Power speed^a force^b at three speeds by three forces; the spectrum tilts with speed by `tilt`.
    fn observed(a: f64, b: f64, tilt: f64) -> Vec<Observation> {
        let cells = Cells::new(RATE_HZ, axis().warping);
        let places = [0.04, 0.08, 0.16].into_iter().flat_map(|v| [0.5, 1.0, 2.0].map(|f| (v, f)));
        places
            .map(|(speed_m_s, force_n)| {
                let level = 100.0 * f64::powf(speed_m_s / 0.08, a) * f64::powf(force_n, b);
                let shape = |f: f64| (1.0 + f / 200.0).powf(-3.0 + tilt * f64::ln(speed_m_s / 0.08));
                let cells_of = cells.means_of(shape);
                let unit = cells.power(&cells_of);
                Observation {
                    speed_m_s,
                    force_n,
                    power: level,
                    cells: cells_of.iter().map(|p| p * level / unit).collect(),
                }
            })
            .collect()
    }

    fn rendered(texture: &TextureModel, speed_m_s: f64, force_n: f64) -> f64 {
        let mut mix = Coefficients::SILENCE;
        Interpolator::new(texture).interpolate(speed_m_s, force_n, &mut mix);
        mix.variance * haptograph_signal::warped::power_gain(mix.ar(), mix.warping).expect("stable")
    }

    fn db(a: f64, b: f64) -> f64 {
        10.0 * (a / b).log10()
    }

    #[test]
    fn exponents_stay_within_what_textures_have() {
        for (a, b, speed, force) in [(6.0, 3.0, 3.5, 1.5), (-2.0, -2.0, 0.5, 0.0)] {
            let law = SpectralLaw::fit(&observed(a, b, 0.0), Exponents::ACCELERATION);
            assert_eq!((law.power[1], law.power[2]), (speed, force));
        }
    }

    #[test]
    fn beyond_the_data_the_shape_is_held_and_the_power_goes_on_to_three_times_the_range() {
        let law = SpectralLaw::fit(&observed(1.0, 0.5, 0.8), Exponents::ACCELERATION);
        let shape = |speed: f64, force: f64| {
            let cells = law.cells(speed, force);
            let level = law.power_at(speed, force);
            cells.iter().map(|p| p / level).collect::<Vec<_>>()
        };
        let far = |a: Vec<f64>, b: Vec<f64>| {
            let pairs = a.iter().zip(&b).map(|(a, b)| db(*a, *b).abs());
            pairs.fold(0.0, f64::max)
        };
        assert!(far(shape(0.16, 1.0), shape(0.24, 1.0)) > 0.5);
        for (v, f) in [(0.3, 1.0), (0.9, 1.0), (0.24, 9.0), (5.0, 9.0)] {
            assert!(far(shape(v, f), shape(0.24, f64::min(f, 3.0))) < 1e-9, "{v} {f}");
        }
        assert!(far(shape(0.001, 1.0), shape(0.04 / 1.5, 1.0)) < 1e-9);
        let rise = db(law.power_at(0.46, 1.0), law.power_at(0.16, 1.0));
        assert!((rise / db(2.875, 1.0) - law.power[1]).abs() < 1e-9);
        assert_eq!(law.power_at(0.5, 1.0), law.power_at(2.0, 1.0));
    }

    #[test]
    fn nowhere_is_a_model_more_than_six_decibels_above_the_loudest_even_where_cells_were_scaled() {
        let observed = observed(3.0, 1.2, 0.0);
        let loudest = observed.iter().map(|at| at.power).fold(0.0, f64::max);
        let mut law = SpectralLaw::fit(&observed, Exponents::ACCELERATION);
        let recorded: Vec<f64> = (0..CELLS).map(|cell| if cell > 40 { 50.0 } else { 1.0 }).collect();
        law.scale_cells(&mut [Stretch {
            place: Vector2::zeros(),
            seen: recorded,
            expected: vec![1.0; CELLS],
        }]);
        let texture = law.on_grid(axis()).expect("a map");
        let powers = || texture.models().iter().map(|at| at.model.power());
        assert!(powers().all(|power| power <= 4.0 * loudest * (1.0 + 1e-9)));
        let at_ceiling = powers().filter(|power| *power > 3.99 * loudest).count();
        assert!(at_ceiling > 3, "{at_ceiling}");
    }

    #[test]
    fn the_map_renders_the_law_and_below_a_third_of_the_lightest_force_its_amplitude_falls_to_zero() {
        let law = SpectralLaw::fit(&observed(2.0, 0.5, 0.0), Exponents::ACCELERATION);
        let texture = law.on_grid(axis()).expect("a map");
        let wanted = |v: f64, f: f64| law.model(v, f, axis()).expect("a model").power();
        for k in 0..300 {
            let (v, f) = (0.004 + 0.0105 * f64::from(k % 20), 0.17 + 0.16 * f64::from(k / 20));
            let off = db(rendered(&texture, v, f), wanted(v, f));
            assert!(off.abs() < 0.2, "{v} {f}: {off}");
        }
        // Triangles that begin at zero force mix two speeds of the grid: at most their whole difference.
        let bound = db(SPEED_RATIO.powf(law.power[1]), 1.0);
        for v in [0.005, 0.03, 0.047, 0.1, 0.2] {
            let mut before = 0.0;
            for k in 1..=200 {
                let f = law.fade_n * f64::from(k) / 200.0;
                let power = rendered(&texture, v, f);
                let off = db(power, wanted(v, f));
                assert!(off.abs() < bound, "{v} {f}: {off}");
                // No step: the amplitude grows with the force by little each time.
                let grown = power.sqrt() - before;
                assert!(grown > 0.0 && grown < 1.6 * wanted(v, law.fade_n).sqrt() / 200.0, "{v} {f}");
                before = power.sqrt();
            }
        }
        assert_eq!(rendered(&texture, 0.1, 0.0), 0.0);
        // Half as near to zero force is half the amplitude.
        let halves = db(rendered(&texture, 0.1, 2e-6), rendered(&texture, 0.1, 1e-6));
        assert!((halves - db(4.0, 1.0)).abs() < 1e-3, "{halves}");
    }

    #[test]
    fn nothing_is_mute_on_the_map() {
        let constant = Exponents { slopes: [1.95, 0.0], ..Exponents::ACCELERATION };
        // Forces of 0.5 to 2 N, and of 6 to 24 N; power that grows with force, and that does not.
        for (scale, b, exponents) in
            [(1.0, 0.5, Exponents::ACCELERATION), (12.0, 0.5, Exponents::ACCELERATION), (12.0, 0.0, constant)]
        {
            let mut observed = observed(2.0, b, 0.5);
            observed.iter_mut().for_each(|at| at.force_n *= scale);
            let law = SpectralLaw::fit(&observed, exponents);
            let texture = law.on_grid(axis()).expect("a map");
            let law = law.without_fade();
            for k in 0..900 {
                let (v, f) = (0.0051 + 0.015 * f64::from(k % 30), 0.101 + 0.19 * scale * f64::from(k / 30));
                let wanted = law.model(v, f, axis()).expect("a model").power();
                let below = db(rendered(&texture, v, f), wanted);
                assert!(below > -20.0, "{scale} {b}, {v} m/s {f} N: {below} dB");
            }
        }
    }
}
