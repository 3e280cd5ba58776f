//! The description length of single segments and of whole segmentations (Eq. 2.3.3).

use super::moments::Moments;
use super::variance::{Estimator, LANES, Lanes, Scratch, end_size};
use super::{Segmentation, SegmentationSettings};
use std::f64::consts::TAU;
use std::marker::PhantomData;

/// Rates segments of one signal.
pub(super) struct Objective<'a, E> {
    pub moments: &'a Moments<'a>,
    pub min_span: usize,
    /// Added to every variance: keeps the logarithm of digital silence finite.
    pub floor: f64,
    ln_samples: f64,
    scratch: Scratch,
    estimator: PhantomData<E>,
}

/// A segment at its best order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rated {
    pub cost: f64,
    pub order: usize,
}

impl<'a, E: Estimator> Objective<'a, E> {
    pub(super) fn new(moments: &'a Moments<'a>, settings: &SegmentationSettings) -> Self {
        let samples = moments.signal.len() as f64;
        let mean_square = moments.signal.iter().map(|x| x * x).sum::<f64>() / samples;
        Self {
            moments,
            min_span: settings.min_span,
            floor: (1e-15 * mean_square).max(f64::MIN_POSITIVE),
            ln_samples: samples.ln(),
            scratch: Scratch::new(moments.order),
            estimator: PhantomData,
        }
    }

    pub(super) fn samples(&self) -> usize {
        self.moments.signal.len()
    }

    /// The highest order that a segment of `span` samples may have.
    pub(super) fn highest_order(&self, span: usize) -> usize {
        self.moments.order.min(span / 2)
    }

    /// Cost of a segment of `span` samples besides its likelihood.
    pub(super) fn penalty(&self, order: usize, span: usize) -> f64 {
        self.ln_samples + (order as f64).ln() + (order as f64 + 2.0) / 2.0 * (span as f64).ln()
    }

    /// Cost of the number of breaks.
    pub(super) fn break_penalty(breaks: usize) -> f64 {
        (breaks.max(1) as f64).ln()
    }

    /// The likelihood term of a segment.
    pub(super) fn surprise(&self, variance: f64, span: usize) -> f64 {
        span as f64 / 2.0 * (TAU * (variance + self.floor)).ln()
    }

    /// Innovation variances at orders 0, 1, ... of segments (first sample, end), as `visit(segment number, variances)`.
    pub(super) fn variances(
        &mut self,
        segments: &[(usize, usize)],
        mut visit: impl FnMut(&Self, usize, &[f64]),
    ) {
        let order = self.moments.order;
        let size = end_size(order);
        let mut starts = vec![Lanes::default(); size];
        let mut ends = vec![Lanes::default(); size];
        let mut variances = vec![Lanes::default(); order + 1];
        // Mostly one end of all segments is the same.
        let mut start = Described::new(size);
        let mut end = Described::new(size);
        let arch = haptograph_signal::instructions::arch();
        for (batch, group) in segments.chunks(LANES).enumerate() {
            let mut spans = Lanes::splat(1.0);
            for (lane, &(from, to)) in group.iter().enumerate() {
                spans.0[lane] = (to - from) as f64;
                put_lane(&mut starts, lane, start.at(from, |out| E::describe_start(self.moments, from, out)));
                put_lane(&mut ends, lane, end.at(to, |out| E::describe_end(self.moments, to, out)));
            }
            arch.dispatch(Estimate::<E> {
                starts: &starts,
                ends: &ends,
                spans,
                scratch: &mut self.scratch,
                variances: &mut variances,
                estimator: PhantomData,
            });
            for lane in 0..group.len() {
                let of_lane: Vec<f64> = variances.iter().map(|v| v.0[lane]).collect();
                visit(self, batch * LANES + lane, &of_lane);
            }
        }
    }

    /// Every segment at its best order.
    pub(super) fn rated(&mut self, segments: &[(usize, usize)]) -> Vec<Rated> {
        let mut rated = Vec::with_capacity(segments.len());
        self.variances(segments, |this, i, variances| {
            let span = segments[i].1 - segments[i].0;
            let mut best = Rated { cost: f64::INFINITY, order: 1 };
            for (order, &variance) in variances.iter().enumerate().take(this.highest_order(span) + 1).skip(1)
            {
                let cost = this.surprise(variance, span) + this.penalty(order, span);
                if cost < best.cost {
                    best = Rated { cost, order };
                }
            }
            rated.push(best);
        });
        rated
    }

    /// The segmentation with these breaks, every segment at its best order.
    pub(super) fn rate(&mut self, breaks: Vec<usize>) -> Segmentation {
        let starts = std::iter::once(0).chain(breaks.iter().copied());
        let ends = breaks.iter().copied().chain(std::iter::once(self.samples()));
        let rated = self.rated(&starts.zip(ends).collect::<Vec<_>>());
        let mdl = Self::break_penalty(breaks.len()) + rated.iter().map(|r| r.cost).sum::<f64>();
        Segmentation { breaks, orders: rated.iter().map(|r| r.order).collect(), mdl }
    }
}

/// [`Estimator::estimate`] with the widest vectors the processor has.
struct Estimate<'a, E> {
    starts: &'a [Lanes],
    ends: &'a [Lanes],
    spans: Lanes,
    scratch: &'a mut Scratch,
    variances: &'a mut [Lanes],
    estimator: PhantomData<E>,
}

impl<E: Estimator> pulp::WithSimd for Estimate<'_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        E::estimate(self.starts, self.ends, self.spans, self.scratch, self.variances);
    }
}

/// Cached description of one end of a segment.
struct Described {
    position: Option<usize>,
    values: Vec<f64>,
}

impl Described {
    fn new(size: usize) -> Self {
        Self { position: None, values: vec![0.0; size] }
    }

    fn at(&mut self, position: usize, describe: impl FnOnce(&mut [f64])) -> &[f64] {
        if self.position.replace(position) != Some(position) {
            describe(&mut self.values);
        }
        &self.values
    }
}

/// Writes one segment's numbers into its lane.
pub(super) fn put_lane(lanes: &mut [Lanes], lane: usize, values: &[f64]) {
    for (lanes, &value) in lanes.iter_mut().zip(values) {
        lanes.0[lane] = value;
    }
}
