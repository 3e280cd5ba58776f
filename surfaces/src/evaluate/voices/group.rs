//! A group of up to [`LANES`] voices of one shape.

use super::super::synthesis::{SynthesisError, TOLD_EVERY, updates};
use super::Voice;
use crate::crackle::{CrackleLanes, CrackleSource};
use crate::interpolation::{Coefficients, Interpolator, Spot};
use crate::lines::{LineSource, mixed_powers};
use crate::lsf::lsf_to_ar_lanes;
use crate::{MAX_ORDER, TextureModel};
use haptograph_signal::arma::{ArmaError, Form, VoiceBank, WarpedBank};
use haptograph_signal::filter::SectionLanes;
use haptograph_signal::noise::{Gaussian, stream_seed};
use haptograph_signal::prediction::PredictionError;
use haptograph_signal::warped::power_gains;
use pulp::{Arch, Simd, WithSimd};
use std::f64::consts::PI;
use std::ops::{ControlFlow, Range};

/// Maximum number of voices in a group.
pub const LANES: usize = WarpedBank::GROUP;
/// Frames processed at a time.
const RUN: usize = 64;
/// Rows of an interpolated model: frequencies of both polynomials, gain and level.
const MIX: usize = 2 * MAX_ORDER + 2;

/// One value per voice.
type Row = [f64; LANES];

/// Voices during synthesis.
pub struct Group<'a> {
    lanes: Vec<Lane<'a>>,
    filters: Filters,
    crackle: Option<CrackleLanes<LANES>>,
    highpass: Option<SectionLanes<LANES>>,
    deviation: Row,
    buffers: Box<Buffers>,
    arch: Arch,
}

/// State of one voice.
struct Lane<'a> {
    voice: &'a Voice<'a>,
    interpolator: Interpolator,
    noise: Gaussian,
    lines: Option<LineSource>,
    vibration: Vec<f64>,
}

/// Filters of all voices.
enum Filters {
    Plain(VoiceBank),
    Warped { bank: WarpedBank, mix: Box<[Row; MIX]> },
}

/// Buffers of a run of frames.
struct Buffers {
    noise: [[f64; RUN]; LANES],
    drawn: [[f64; RUN]; LANES],
    excitation: [Row; RUN],
    out: [Row; RUN],
}

impl<'a> Lane<'a> {
    fn new(voice: &'a Voice<'a>) -> Self {
        let Voice {
            texture, settings, ..
        } = voice;
        let seed = stream_seed(settings.lines_seed, "lines");
        let rate_hz = texture.rate_hz();
        let has_lines = !texture.lines().is_empty();
        Self {
            interpolator: Interpolator::new(texture),
            noise: Gaussian::new(settings.seed),
            lines: has_lines.then(|| LineSource::new(texture.lines(), rate_hz, rate_hz, seed)),
            vibration: vec![0.0; voice.trajectory.speed_m_s.len()],
            voice,
        }
    }

    /// The frames of a run that belong to this voice.
    fn of(&self, run: &Range<usize>) -> Range<usize> {
        let samples = self.vibration.len();
        run.start.min(samples)..run.end.min(samples)
    }

    /// Moves the lines to a position on the map.
    fn move_lines(&mut self, spot: &Spot) {
        if let Some(lines) = &mut self.lines {
            let powers = mixed_powers(self.voice.texture.lines(), spot.vertices, spot.weights);
            lines.set(spot.speed_m_s, powers);
        }
    }
}

impl<'a> Group<'a> {
    /// Creates a group of voices of one [`Shape`](super::Shape), at least one and at most [`LANES`].
    pub fn new(voices: &[&'a Voice<'a>]) -> Self {
        let first = voices[0].texture;
        let crackles = voices.iter().filter_map(|voice| {
            let seed = stream_seed(voice.settings.seed, "crackle");
            let crackle = voice.texture.crackle()?;
            Some(CrackleSource::new(crackle, voice.texture.rate_hz(), seed))
        });
        let highpasses = voices.iter().filter_map(|voice| voice.texture.output_highpass());
        let highpasses: Vec<_> = highpasses.collect();
        Self {
            filters: Filters::of(first),
            crackle: first.crackle().map(|_| CrackleLanes::new(crackles)),
            highpass: (!highpasses.is_empty()).then(|| SectionLanes::new(&highpasses)),
            lanes: voices.iter().map(|voice| Lane::new(voice)).collect(),
            deviation: [0.0; LANES],
            buffers: Box::new(Buffers {
                noise: [[0.0; RUN]; LANES],
                drawn: [[0.0; RUN]; LANES],
                excitation: [[0.0; LANES]; RUN],
                out: [[0.0; LANES]; RUN],
            }),
            arch: Arch::new(),
        }
    }

    /// Computes the vibrations; an error names the voice. `advance` receives the number of further samples
    /// done, and says whether to go on.
    pub fn play(
        mut self,
        advance: &dyn Fn(usize) -> ControlFlow<()>,
    ) -> Result<Vec<Vec<f64>>, (usize, SynthesisError)> {
        let first = self.lanes[0].voice;
        let longest = self.lanes.iter().map(|lane| lane.vibration.len()).max();
        let updates = updates(
            first.texture.rate_hz(),
            first.settings.update_hz,
            longest.unwrap_or(0),
        );
        let mut told = 0;
        for (number, (place, samples)) in updates.enumerate() {
            self.update(place)?;
            for start in samples.clone().step_by(RUN) {
                self.run(start..samples.end.min(start + RUN));
            }
            if number % TOLD_EVERY == 0 {
                if advance(samples.end - told).is_break() {
                    return Err((0, SynthesisError::Stopped));
                }
                told = samples.end;
            }
        }
        // It is done.
        let _ = advance(longest.unwrap_or(0) - told);
        Ok(self.lanes.into_iter().map(|lane| lane.vibration).collect())
    }

    /// Updates the coefficients for the speeds and forces at a sample.
    fn update(&mut self, place: usize) -> Result<(), (usize, SynthesisError)> {
        let rests = self.move_to(place)?;
        if let Filters::Warped { bank, mix } = &mut self.filters {
            let first = self.lanes[0].voice.texture;
            let (order, warping) = (first.ar_order(), first.warping());
            let converted = self.arch.dispatch(Convert { mix, order, warping });
            let (ar, deviation) = converted.map_err(|(lane, error)| (lane, ArmaError::from(error).into()))?;
            let set = bank.set_group(0, &ar[..order], warping, &mix[order]);
            set.map_err(|(lane, error)| (lane, error.into()))?;
            self.deviation = deviation;
        }
        // All models at rest are silent; rounding could leave weight on a model that is not.
        for (deviation, rests) in self.deviation.iter_mut().zip(rests) {
            if rests {
                *deviation = 0.0;
            }
        }
        Ok(())
    }

    /// Moves each voice to its speed and force at a sample; returns which voices are at rest.
    fn move_to(&mut self, place: usize) -> Result<[bool; LANES], (usize, SynthesisError)> {
        let mut rests = [false; LANES];
        for (l, lane) in self.lanes.iter_mut().enumerate() {
            let along = lane.voice.trajectory;
            let here = along.speed_m_s.get(place).zip(along.force_n.get(place));
            let Some((&speed_m_s, &force_n)) = here else {
                continue;
            };
            let spot = match &mut self.filters {
                Filters::Plain(bank) => {
                    let mut at = Coefficients::SILENCE;
                    let spot = lane.interpolator.interpolate(speed_m_s, force_n, &mut at);
                    self.deviation[l] = at.variance.sqrt();
                    let set = bank.set_coefficients(l, at.ar(), at.ma(), at.gain);
                    set.map_err(|error| (l, error.into()))?;
                    spot
                }
                Filters::Warped { mix, .. } => {
                    let spot = lane.interpolator.locate(speed_m_s, force_n);
                    lane.interpolator.mix_into(&spot, l, &mut mix[..]);
                    spot
                }
            };
            rests[l] = spot.speed_m_s == 0.0 || spot.force_n == 0.0;
            lane.move_lines(&spot);
        }
        Ok(rests)
    }

    /// Renders a run of frames.
    fn run(&mut self, run: Range<usize>) {
        let (count, buffers) = (run.len(), &mut *self.buffers);
        for (lane, noise) in self.lanes.iter_mut().zip(&mut buffers.noise) {
            let own = lane.of(&run).len();
            lane.noise.fill(&mut noise[..own]);
            noise[own..count].fill(0.0);
        }
        if let Some(crackle) = &mut self.crackle {
            crackle.draw(count, &mut buffers.drawn);
        }
        self.arch.dispatch(Excite {
            crackle: self.crackle.as_mut(),
            noise: &buffers.noise,
            drawn: &buffers.drawn,
            deviation: &self.deviation,
            excitation: &mut buffers.excitation[..count],
        });
        let (excitation, out) = (&buffers.excitation[..count], &mut buffers.out[..count]);
        match &mut self.filters {
            Filters::Plain(bank) => bank.process(excitation.as_flattened(), out.as_flattened_mut()),
            Filters::Warped { bank, .. } => bank.process(excitation.as_flattened(), out.as_flattened_mut()),
        }
        if let Some(highpass) = &mut self.highpass {
            highpass.process_in_place(out);
        }
        for (l, lane) in self.lanes.iter_mut().enumerate() {
            let own = lane.of(&run);
            let own = &mut lane.vibration[own];
            for (sample, row) in own.iter_mut().zip(&*out) {
                *sample = row[l];
            }
            if let Some(lines) = &mut lane.lines {
                lines.add_to(own);
            }
        }
    }
}

impl Filters {
    fn of(texture: &TextureModel) -> Self {
        if texture.warping() == 0.0 {
            return Self::Plain(VoiceBank::new(Form::Lattice, LANES));
        }
        let order = texture.ar_order();
        let mut mix = Box::new([[0.0; LANES]; MIX]);
        // Lanes without a voice get the flat spectrum.
        for (k, row) in mix[..order].iter_mut().enumerate() {
            *row = [PI * (k + 1) as f64 / (order + 1) as f64; LANES];
        }
        mix[order] = [1.0; LANES];
        let bank = WarpedBank::new(LANES);
        Self::Warped { bank, mix }
    }
}

/// Converts interpolated warped models to coefficients and excitation deviations, like
/// [`Interpolator::interpolate_at`].
struct Convert<'a> {
    mix: &'a [Row; MIX],
    order: usize,
    warping: f64,
}

impl WithSimd for Convert<'_> {
    type Output = Result<([Row; MAX_ORDER], Row), (usize, PredictionError)>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self { mix, order, warping } = self;
        let (mut ar, mut deviation) = ([[0.0; LANES]; MAX_ORDER], [0.0; LANES]);
        lsf_to_ar_lanes(&mix[..order], &mut ar[..order]);
        let gains = power_gains(&ar[..order], warping)?;
        let level = &mix[order + 1];
        for l in 0..LANES {
            deviation[l] = (level[l] * level[l] / gains[l]).sqrt();
        }
        Ok((ar, deviation))
    }
}

/// Computes frames of excitation from the noise of each voice.
struct Excite<'a> {
    crackle: Option<&'a mut CrackleLanes<LANES>>,
    noise: &'a [[f64; RUN]; LANES],
    drawn: &'a [[f64; RUN]; LANES],
    deviation: &'a Row,
    excitation: &'a mut [Row],
}

impl WithSimd for Excite<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        for (n, frame) in self.excitation.iter_mut().enumerate() {
            for (e, noise) in frame.iter_mut().zip(self.noise) {
                *e = noise[n];
            }
            if let Some(crackle) = &mut self.crackle {
                let mut drawn = [0.0; LANES];
                for (fresh, stream) in drawn.iter_mut().zip(self.drawn) {
                    *fresh = stream[n];
                }
                crackle.modulate(frame, &drawn);
            }
            for (e, deviation) in frame.iter_mut().zip(self.deviation) {
                *e *= deviation;
            }
        }
    }
}
