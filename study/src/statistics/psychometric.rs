//! Psychometric functions: the probability of an answer over a level of stimulation, by maximum likelihood (Wichmann and Hill
//! 2001).

use super::{Estimate, StatisticsError, all_finite, at_least};
use rand::SeedableRng;
use rand_distr::{Binomial, Distribution};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;

/// Steps of the search for the maximum.
const STEPS: usize = 300;
/// Steepest slope: the function rises within this share of the range of levels.
const STEEPEST: f64 = 0.001;

/// Shape of the rise from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Shape {
    /// 1 / (1 + exp(-slope (x - threshold))): 0.5 at the threshold; the slope is in 1 over the unit of x.
    Logistic,
    /// 1 - exp(-(x / threshold)^slope), 0 below 0: 0.632 at the threshold; the slope has no unit.
    Weibull,
}

impl Shape {
    /// The value at a level.
    pub fn at(self, level: f64, threshold: f64, slope: f64) -> f64 {
        match self {
            Self::Logistic => (1.0 + (-slope * (level - threshold)).exp()).recip(),
            Self::Weibull => -(-(level.max(0.0) / threshold).powf(slope)).exp_m1(),
        }
    }
}

/// Trials at one level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Block {
    /// Level of stimulation.
    pub level: f64,
    /// Number of trials.
    pub trials: u32,
    /// Trials with the answer that is counted.
    pub positive: u32,
}

/// How a function is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FitSettings {
    /// Shape.
    pub shape: Shape,
    /// Probability of the answer without stimulation: 0.5 for two alternatives, 0 for yes or no.
    pub guess: f64,
    /// Bound of the probability of an answer at random at any level; 0 for none.
    pub largest_lapse: f64,
    /// Number of simulated data sets for the intervals; 0 for none.
    pub resamples: usize,
    /// Seed of these.
    pub seed: u64,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self { shape: Shape::Logistic, guess: 0.5, largest_lapse: 0.06, resamples: 1000, seed: 1 }
    }
}

/// A fitted function: guess + (1 - guess - lapse) shape(x).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Psychometric {
    /// Threshold, with the interval of 95 % of the simulated data sets (without these, its ends are NaN).
    pub threshold: Estimate,
    /// Slope, likewise.
    pub slope: Estimate,
    /// Lapse rate, likewise.
    pub lapse: Estimate,
    /// Twice the logarithm of the likelihood of the observed shares over that of the function.
    pub deviance: f64,
    /// Share of the simulated data sets that the function fits no better; NaN without these.
    pub p: f64,
    /// Whether the slope is the steepest or flattest that was sought: the answers do not determine it.
    pub slope_at_bound: bool,
}

/// Fits a function to blocks of trials.
pub fn fit(blocks: &[Block], settings: &FitSettings) -> Result<Psychometric, StatisticsError> {
    let problem = Problem::new(blocks, settings)?;
    let best = problem.maximise(blocks, problem.start(blocks));
    let (threshold, slope, lapse) = problem.parameters(best);
    let deviance = problem.deviance(blocks, best);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(settings.seed);
    let mut found = [const { Vec::new() }; 4];
    for _ in 0..settings.resamples {
        let simulated = problem.simulated(blocks, best, &mut random);
        let place = problem.maximise(&simulated, best);
        let (threshold, slope, lapse) = problem.parameters(place);
        let values = [threshold, slope, lapse, problem.deviance(&simulated, place)];
        found.iter_mut().zip(values).for_each(|(all, value)| all.push(value));
    }
    let worse = found[3].iter().filter(|&&d| d >= deviance).count();
    found.iter_mut().for_each(|all| all.sort_by(f64::total_cmp));
    let end = |i: usize, level: f64| {
        let last = found[i].len().saturating_sub(1) as f64;
        found[i].get((level * last).round() as usize).copied().unwrap_or(f64::NAN)
    };
    let estimate = |i: usize, value: f64| Estimate { value, low: end(i, 0.025), high: end(i, 0.975) };
    Ok(Psychometric {
        threshold: estimate(0, threshold),
        slope: estimate(1, slope),
        lapse: estimate(2, lapse),
        deviance,
        p: worse as f64 / settings.resamples as f64,
        slope_at_bound: best[1] <= problem.slopes.0 || best[1] >= problem.slopes.1,
    })
}

/// A place of the search: threshold in the range of levels (0 to 1), logarithm of the slope, share of the largest lapse rate.
type Place = [f64; 3];

/// The bounds of a search.
struct Problem<'a> {
    settings: &'a FitSettings,
    lowest: f64,
    range: f64,
    /// Logarithms of the flattest and steepest slope.
    slopes: (f64, f64),
}

impl<'a> Problem<'a> {
    fn new(blocks: &[Block], settings: &'a FitSettings) -> Result<Self, StatisticsError> {
        let levels: Vec<f64> = blocks.iter().filter(|b| b.trials > 0).map(|b| b.level).collect();
        all_finite("levels", &levels)?;
        at_least("blocks", levels.len(), 2)?;
        if let Some(block) = blocks.iter().find(|b| b.positive > b.trials) {
            let (what, value) = ("number of positive answers", f64::from(block.positive));
            return Err(StatisticsError::OutOfRange {
                what,
                value,
                expected: "at most the number of trials",
            });
        }
        let rates = [("guess rate", settings.guess), ("largest lapse rate", settings.largest_lapse)];
        let sum = ("guess and largest lapse rate together", settings.guess + settings.largest_lapse);
        for (what, value) in rates.into_iter().chain([sum]) {
            if !(0.0..1.0).contains(&value) {
                return Err(StatisticsError::OutOfRange { what, value, expected: "at least 0, less than 1" });
            }
        }
        let lowest = levels.iter().copied().fold(f64::INFINITY, f64::min);
        let range = levels.iter().copied().fold(f64::NEG_INFINITY, f64::max) - lowest;
        all_finite("range of levels", &[range])?;
        if range <= 0.0 {
            return Err(StatisticsError::NoVariation { what: "levels" });
        }
        let slopes = match settings.shape {
            Shape::Logistic => ((0.1 / range).ln(), (STEEPEST * range).recip().ln()),
            Shape::Weibull => (0.05_f64.ln(), STEEPEST.recip().ln()),
        };
        Ok(Self { settings, lowest, range, slopes })
    }

    /// Threshold, slope and lapse rate of a place.
    fn parameters(&self, place: Place) -> (f64, f64, f64) {
        let threshold = self.lowest + self.range * place[0];
        let threshold = match self.settings.shape {
            Shape::Logistic => threshold,
            Shape::Weibull => threshold.max(1e-9 * self.range),
        };
        (threshold, place[1].exp(), self.settings.largest_lapse * place[2])
    }

    fn bounded(&self, place: Place) -> Place {
        [place[0].clamp(-2.0, 3.0), place[1].clamp(self.slopes.0, self.slopes.1), place[2].clamp(0.0, 1.0)]
    }

    fn probability(&self, level: f64, place: Place) -> f64 {
        let (threshold, slope, lapse) = self.parameters(place);
        let guess = self.settings.guess;
        guess + (1.0 - guess - lapse) * self.settings.shape.at(level, threshold, slope)
    }

    /// Half of the deviance: the likelihood of the observed shares less that at a place.
    fn loss(&self, blocks: &[Block], place: Place) -> f64 {
        let part = |count: u32, of: u32, p: f64| match count {
            0 => 0.0,
            count => f64::from(count) * (f64::from(count) / f64::from(of) / p.max(1e-300)).ln(),
        };
        let block = |b: &Block| {
            let p = self.probability(b.level, place);
            part(b.positive, b.trials, p) + part(b.trials - b.positive, b.trials, 1.0 - p)
        };
        blocks.iter().map(block).sum()
    }

    fn deviance(&self, blocks: &[Block], place: Place) -> f64 {
        2.0 * self.loss(blocks, place).max(0.0)
    }

    /// The best place of a grid.
    fn start(&self, blocks: &[Block]) -> Place {
        let mut best = ([0.5, self.slopes.0, 0.3], f64::INFINITY);
        for (i, j) in (0..9).flat_map(|i| (0..8).map(move |j| (i, j))) {
            let slope = self.slopes.0 + (self.slopes.1 - self.slopes.0) * f64::from(j) / 8.0;
            let place = [f64::from(i) / 8.0, slope, 0.3];
            let here = self.loss(blocks, place);
            if here < best.1 {
                best = (place, here);
            }
        }
        best.0
    }

    /// The likeliest place near a start.
    fn maximise(&self, blocks: &[Block], start: Place) -> Place {
        self.bounded(simplex(start, [0.15, 0.7, 0.3], |place| self.loss(blocks, self.bounded(place))))
    }

    fn simulated(&self, blocks: &[Block], place: Place, random: &mut Xoshiro256PlusPlus) -> Vec<Block> {
        let answer = |block: &Block| {
            let answers = Binomial::new(block.trials.into(), self.probability(block.level, place));
            let positive = answers.map_or(0, |answers| answers.sample(random) as u32);
            Block { positive, ..*block }
        };
        blocks.iter().map(answer).collect()
    }
}

/// The least place of a function by the simplex method (Nelder and Mead 1965).
fn simplex(start: Place, sizes: Place, loss: impl Fn(Place) -> f64) -> Place {
    let mix = |a: Place, b: Place, share: f64| std::array::from_fn(|i| a[i] + share * (b[i] - a[i]));
    let valued = |place: Place| (place, loss(place));
    let mut corners: [(Place, f64); 4] = std::array::from_fn(|corner| {
        let mut place = start;
        if corner > 0 {
            place[corner - 1] += sizes[corner - 1];
        }
        valued(place)
    });
    for _ in 0..STEPS {
        corners.sort_by(|a, b| a.1.total_cmp(&b.1));
        if corners[3].1 - corners[0].1 < 1e-12 {
            break;
        }
        let centre = std::array::from_fn(|i| (corners[0].0[i] + corners[1].0[i] + corners[2].0[i]) / 3.0);
        let worst = corners[3];
        let reflected = valued(mix(centre, worst.0, -1.0));
        let next = if reflected.1 < corners[0].1 {
            let further = valued(mix(centre, worst.0, -2.0));
            if further.1 < reflected.1 { further } else { reflected }
        } else if reflected.1 < corners[2].1 {
            reflected
        } else {
            valued(mix(centre, worst.0, if reflected.1 < worst.1 { -0.5 } else { 0.5 }))
        };
        if next.1 < worst.1.min(reflected.1.max(corners[2].1)) {
            corners[3] = next;
        } else {
            let best = corners[0].0;
            corners[1..].iter_mut().for_each(|corner| *corner = valued(mix(best, corner.0, 0.5)));
        }
    }
    corners.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(start, |best| best.0)
}
