//! The spectrum of a texture, which each has: the filter of its map and the high-pass that the map leaves out, in one voice and
//! in the lanes of a bank.

use crate::interpolation::{Interpolator, Spot};
use crate::lsf::lsf_to_ar_lanes;
use crate::rendering::{LANES, Row};
use crate::{MAX_ORDER, TextureModel};
use haptograph_signal::arma::{ArmaError, ArmaFilter, Form, VoiceBank, WarpedBank, WarpedLattice};
use haptograph_signal::elementwise::CacheLines;
use haptograph_signal::filter::{SectionLanes, SectionsState};
use haptograph_signal::instructions::arch;
use pulp::{Arch, Simd, WithSimd};
use std::f64::consts::PI;

/// The filter of one voice: excitation in, vibration at the models' rate out. Real-time code.
#[derive(Debug, Clone)]
pub(crate) struct SpectrumVoice {
    plain: ArmaFilter,
    warped: WarpedLattice,
    /// Which of the two is active.
    is_warped: bool,
    highpass: Option<SectionsState>,
}

impl SpectrumVoice {
    /// A filter of this form for models that are not warped. Without a texture there is no high-pass.
    pub(crate) fn new(form: Form, texture: Option<&TextureModel>) -> Self {
        let highpass = texture.and_then(TextureModel::output_highpass);
        Self {
            plain: ArmaFilter::new(form),
            warped: WarpedLattice::new(),
            is_warped: false,
            highpass: highpass.map(|sections| SectionsState::new(&sections)),
        }
    }

    /// Changes the coefficients; invalid ones leave the old ones active, so that the vibration stays bounded.
    ///
    /// # Errors
    /// Coefficients of an unstable filter.
    pub(crate) fn set(&mut self, ar: &[f64], ma: &[f64], gain: f64, warping: f64) -> Result<(), ArmaError> {
        let is_warped = warping != 0.0;
        if is_warped {
            self.warped.set_coefficients(ar, warping, gain)?;
        } else {
            self.plain.set_coefficients(ar, ma, gain)?;
        }
        self.is_warped = is_warped;
        Ok(())
    }

    /// Filters the next samples.
    pub(crate) fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        if self.is_warped {
            self.warped.process(excitation, out);
        } else {
            self.plain.process(excitation, out);
        }
        if let Some(highpass) = &mut self.highpass {
            highpass.process_in_place(out);
        }
    }

    /// Continues the state of the voice that this one replaces.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        self.plain.clone_from(&other.plain);
        self.warped.copy_state_from(&other.warped);
        self.is_warped = other.is_warped;
        if let (Some(new), Some(old)) = (&mut self.highpass, &other.highpass) {
            new.copy_state_from(old);
        }
    }
}

/// Rows of an interpolated model: frequencies of both polynomials, gain and level.
const MIX: usize = 2 * MAX_ORDER + 2;

/// The filters of voices of one order, warping factor and rate, one in each lane. The bits of a voice do not depend on the others.
pub(crate) struct SpectrumBank {
    filters: Filters,
    highpass: Option<SectionLanes<LANES>>,
    /// Numbers of coefficients of both polynomials.
    orders: [usize; 2],
    warping: f64,
    buffers: Box<Buffers>,
    arch: Arch,
}

/// Filters of all voices.
enum Filters {
    Plain {
        bank: VoiceBank,
        /// Standard deviation of the excitation.
        deviation: CacheLines<Row>,
    },
    Warped(WarpedBank),
}

/// The interpolated models, on whole cache lines.
#[repr(C, align(64))]
struct Buffers {
    /// Line spectral frequencies of both polynomials, gains, levels.
    mix: [Row; MIX],
    coefficients: [Row; MIX],
}

impl SpectrumBank {
    /// Filters of `textures`, at least one.
    pub(crate) fn new(textures: &[&TextureModel]) -> Self {
        let first = textures[0];
        let orders = [first.ar_order(), first.ma_order()];
        let highpasses = textures.iter().filter_map(|texture| texture.output_highpass());
        let highpasses: Vec<_> = highpasses.collect();
        let filters = if first.warping() == 0.0 {
            let bank = VoiceBank::new(Form::Lattice, LANES);
            Filters::Plain { bank, deviation: CacheLines([0.0; LANES]) }
        } else {
            Filters::Warped(WarpedBank::new(LANES))
        };
        Self {
            filters,
            highpass: (!highpasses.is_empty()).then(|| SectionLanes::new(&highpasses)),
            orders,
            warping: first.warping(),
            buffers: Box::new(Buffers { mix: flat(orders), coefficients: [[0.0; LANES]; MIX] }),
            arch: arch(),
        }
    }

    /// Moves a voice to a position on its map; takes effect with [`Self::update`].
    #[inline(always)]
    pub(crate) fn move_to(&mut self, lane: usize, spot: &Spot, map: &Interpolator) {
        let [p, q] = self.orders;
        let mix = &mut self.buffers.mix;
        map.mix_into(spot, lane, &mut mix[..p + q + 2]);
        // All models at rest are silent; rounding could leave weight on a model that is not.
        if spot.speed_m_s == 0.0 || spot.force_n == 0.0 {
            mix[p + q + 1][lane] = 0.0;
        }
    }

    /// Computes the coefficients of all voices; an error names the lane.
    pub(crate) fn update(&mut self) -> Result<(), (usize, ArmaError)> {
        let Buffers { mix, coefficients } = &mut *self.buffers;
        let [p, q] = self.orders;
        let (ar, ma) = coefficients[..p + q].split_at_mut(p);
        let (ar_lsf, ma_lsf) = mix[..p + q].split_at(p);
        for (lsf, coefficients) in [(ar_lsf, &mut *ar), (ma_lsf, &mut *ma)] {
            self.arch.dispatch(Convert { lsf, coefficients });
        }
        let (gain, level) = (&mix[p + q], mix[p + q + 1]);
        match &mut self.filters {
            Filters::Plain { bank, deviation } => {
                // The level is a variance.
                deviation.0 = level.map(f64::sqrt);
                bank.set_group(0, ar, ma, gain)
            }
            // It is the square root of a power, and the gain 1.
            Filters::Warped(bank) => bank.set_group(0, ar, self.warping, &level.map(|level| level * level)),
        }
    }

    /// Filters excitation of deviation 1, which it changes.
    pub(crate) fn process(&mut self, excitation: &mut [Row], out: &mut [Row]) {
        match &mut self.filters {
            Filters::Plain { bank, deviation } => {
                self.arch.dispatch(Scale { deviation: &deviation.0, excitation });
                bank.process(excitation.as_flattened(), out.as_flattened_mut());
            }
            Filters::Warped(bank) => bank.process(excitation.as_flattened(), out.as_flattened_mut()),
        }
    }

    /// Applies the high-pass to filtered frames.
    pub(crate) fn pass_high(&mut self, frames: &mut [Row]) {
        if let Some(highpass) = &mut self.highpass {
            highpass.process_in_place(frames);
        }
    }
}

/// Flat spectra of polynomials of these orders, of gain 1 and without power: those of lanes without a voice.
fn flat(orders: [usize; 2]) -> [Row; MIX] {
    let mut mix = [[0.0; LANES]; MIX];
    let even = |order: usize| (1..=order).map(move |k| PI * k as f64 / (order + 1) as f64);
    let numbers = orders.into_iter().flat_map(even).chain([1.0]);
    for (row, number) in mix.iter_mut().zip(numbers) {
        *row = [number; LANES];
    }
    mix
}

/// Makes coefficients of line spectral frequencies.
struct Convert<'a> {
    lsf: &'a [Row],
    coefficients: &'a mut [Row],
}

impl WithSimd for Convert<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        lsf_to_ar_lanes(self.lsf, self.coefficients);
    }
}

/// Gives frames of excitation their deviation.
struct Scale<'a> {
    deviation: &'a Row,
    excitation: &'a mut [Row],
}

impl WithSimd for Scale<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let deviation = S::as_simd_f64s(self.deviation).0;
        for frame in self.excitation {
            for (e, deviation) in S::as_mut_simd_f64s(frame).0.iter_mut().zip(deviation) {
                *e = simd.mul_f64s(*e, *deviation);
            }
        }
    }
}
