//! A group of up to [`LANES`] voices of one shape.

use super::super::synthesis::{SynthesisError, UpdatePoints, updates};
use super::VoiceInto;
use crate::crackle::{CrackleLanes, CrackleSource};
use crate::interpolation::{Coefficients, Interpolator, Spot};
use crate::lines::{LineSource, MAX_LINES, mixed_powers};
use crate::lsf::lsf_to_ar_lanes;
use crate::{MAX_ORDER, TextureModel};
use haptograph_signal::arma::{ArmaError, Form, VoiceBank, WarpedBank};
use haptograph_signal::elementwise::CacheLines;
use haptograph_signal::filter::SectionLanes;
use haptograph_signal::noise::{Gaussian, stream_seed};
use haptograph_signal::prediction::PredictionError;
use haptograph_signal::warped::power_gains;
use pulp::{Arch, Simd, WithSimd};
use std::f64::consts::PI;
use std::ops::{ControlFlow, Range};

/// Maximum number of voices in a group.
pub const LANES: usize = WarpedBank::GROUP;
/// Frames processed at a time: a batch of the random numbers.
const BLOCK: usize = 64;
/// Blocks between two calls of `advance`.
const BLOCKS_TOLD: usize = 256;
/// Voices whose random numbers are drawn before they are put side by side.
const DRAWN: usize = 8;
/// Lanes of the widest vector.
const WIDTH: usize = 8;
/// Rows of an interpolated model: frequencies of both polynomials, gain and level.
const MIX: usize = 2 * MAX_ORDER + 2;

/// One value per voice.
type Row = [f64; LANES];

/// Voices during synthesis.
pub struct Group<'a> {
    lanes: Vec<Lane<'a>>,
    /// One per texture.
    interpolators: Vec<Interpolator>,
    filters: Filters,
    crackle: Option<CrackleLanes<LANES>>,
    highpass: Option<SectionLanes<LANES>>,
    deviation: CacheLines<Row>,
    buffers: Box<Buffers>,
    arch: Arch,
}

/// State of one voice.
struct Lane<'a> {
    texture: &'a TextureModel,
    points: &'a UpdatePoints,
    /// Number of its texture's interpolator.
    interpolator: usize,
    last_triangle: u32,
    noise: Gaussian,
    lines: Option<LineSource>,
    moves: Vec<LineMove>,
    out: &'a mut [f64],
}

/// Speed and powers of a voice's lines from a frame of the block on.
struct LineMove {
    frame: usize,
    speed_m_s: f64,
    powers_m2_s4: [f64; MAX_LINES],
}

/// Filters of all voices.
enum Filters {
    Plain(VoiceBank),
    Warped {
        bank: WarpedBank,
        mix: Box<CacheLines<[Row; MIX]>>,
    },
}

/// Buffers of a block of frames, on whole cache lines.
#[repr(C, align(64))]
struct Buffers {
    drawn: [[f64; BLOCK]; DRAWN],
    excitation: [Row; BLOCK],
    /// What crackle draws, then the output.
    out: [Row; BLOCK],
}

impl<'a> Lane<'a> {
    fn new(voice: VoiceInto<'a>, interpolator: usize) -> Self {
        let seed = stream_seed(voice.lines_seed, "lines");
        let (lines, rate_hz) = (voice.texture.lines(), voice.texture.rate_hz());
        Self {
            texture: voice.texture,
            points: voice.points,
            interpolator,
            last_triangle: 0,
            noise: Gaussian::new(voice.seed),
            lines: (!lines.is_empty()).then(|| LineSource::new(lines, rate_hz, rate_hz, seed)),
            moves: vec![],
            out: voice.out,
        }
    }

    /// The frames of a block that belong to this voice.
    fn of(&self, block: &Range<usize>) -> Range<usize> {
        let samples = self.out.len();
        block.start.min(samples)..block.end.min(samples)
    }

    /// Writes the frames of a block, of which this is lane `l`, and adds the lines.
    fn write(&mut self, l: usize, block: &Range<usize>, frames: &[Row; BLOCK]) {
        let own = self.of(block);
        let own = &mut self.out[own];
        for (sample, row) in own.iter_mut().zip(frames) {
            *sample = row[l];
        }
        if let Some(lines) = &mut self.lines {
            let mut done = 0;
            for step in self.moves.drain(..) {
                let frame = step.frame.min(own.len());
                lines.add_to(&mut own[done..frame]);
                lines.set(step.speed_m_s, step.powers_m2_s4);
                done = frame;
            }
            lines.add_to(&mut own[done..]);
        }
    }
}

impl<'a> Group<'a> {
    /// Creates a group of voices of one [`Shape`](super::Shape), at least one and at most [`LANES`].
    pub fn new(voices: Vec<VoiceInto<'a>>) -> Self {
        let first = voices[0].texture;
        let crackles = voices.iter().filter_map(|voice| {
            let seed = stream_seed(voice.seed, "crackle");
            let crackle = voice.texture.crackle()?;
            Some(CrackleSource::new(crackle, voice.texture.rate_hz(), seed))
        });
        let crackle = first.crackle().map(|_| CrackleLanes::new(crackles));
        let highpasses = voices.iter().filter_map(|voice| voice.texture.output_highpass());
        let highpasses: Vec<_> = highpasses.collect();
        let mut textures: Vec<&TextureModel> = vec![];
        let lane = |voice: VoiceInto<'a>| {
            let known = textures
                .iter()
                .position(|known| std::ptr::eq(*known, voice.texture));
            let number = known.unwrap_or(textures.len());
            if known.is_none() {
                textures.push(voice.texture);
            }
            Lane::new(voice, number)
        };
        let lanes = voices.into_iter().map(lane).collect();
        Self {
            filters: Filters::of(first),
            crackle,
            highpass: (!highpasses.is_empty()).then(|| SectionLanes::new(&highpasses)),
            lanes,
            interpolators: textures.into_iter().map(Interpolator::new).collect(),
            deviation: CacheLines([0.0; LANES]),
            buffers: Box::new(Buffers {
                drawn: [[0.0; BLOCK]; DRAWN],
                excitation: [[0.0; LANES]; BLOCK],
                out: [[0.0; LANES]; BLOCK],
            }),
            arch: Arch::new(),
        }
    }

    /// Computes the vibrations; an error names the lane. `advance` receives the number of further samples
    /// done, and says whether to go on.
    pub fn play(mut self, advance: &dyn Fn(usize) -> ControlFlow<()>) -> Result<(), (usize, SynthesisError)> {
        let samples = self.lanes.iter().map(|lane| lane.out.len()).max().unwrap_or(0);
        let UpdatePoints {
            rate_hz, update_hz, ..
        } = *self.lanes[0].points;
        let mut updates = updates(rate_hz, update_hz, samples).enumerate().peekable();
        let mut told = 0;
        for (number, start) in (0..samples).step_by(BLOCK).enumerate() {
            let block = start..samples.min(start + BLOCK);
            self.excite(&block);
            let mut at = start;
            while at < block.end {
                while let Some((update, _)) = updates.next_if(|(_, (_, range))| range.start <= at) {
                    self.update(update, at - start)?;
                }
                let next = updates.peek().map_or(block.end, |(_, (_, range))| range.start);
                let end = next.min(block.end);
                self.filter(at - start..end - start);
                at = end;
            }
            self.write(&block);
            if number % BLOCKS_TOLD == 0 {
                if advance(block.end - told).is_break() {
                    return Err((0, SynthesisError::Stopped));
                }
                told = block.end;
            }
        }
        // It is done.
        let _ = advance(samples - told);
        Ok(())
    }

    /// Draws the excitation of a block, of deviation 1.
    fn excite(&mut self, block: &Range<usize>) {
        let Buffers {
            drawn,
            excitation,
            out,
        } = &mut *self.buffers;
        for (number, lanes) in self.lanes.chunks_mut(DRAWN).enumerate() {
            for (lane, drawn) in lanes.iter_mut().zip(&mut *drawn) {
                let own = lane.of(block).len();
                lane.noise.fill(&mut drawn[..own]);
                drawn[own..].fill(0.0);
            }
            put_side_by_side(drawn, number * DRAWN, excitation);
        }
        let Some(crackle) = &mut self.crackle else {
            return;
        };
        for first in (0..self.lanes.len()).step_by(DRAWN) {
            crackle.draw(first, drawn);
            put_side_by_side(drawn, first, out);
        }
        self.arch.dispatch(Modulate {
            crackle,
            excitation,
            drawn: out,
        });
    }

    /// Updates the coefficients from a frame of the block on.
    fn update(&mut self, number: usize, frame: usize) -> Result<(), (usize, SynthesisError)> {
        let rests = self.move_to(number, frame)?;
        if let Filters::Warped { bank, mix } = &mut self.filters {
            let first = self.lanes[0].texture;
            let (order, warping) = (first.ar_order(), first.warping());
            let converted = self.arch.dispatch(Convert {
                mix: &mix.0,
                order,
                warping,
            });
            let (ar, deviation) = converted.map_err(|(lane, error)| (lane, ArmaError::from(error).into()))?;
            let set = bank.set_group(0, &ar.0[..order], warping, &mix.0[order]);
            set.map_err(|(lane, error)| (lane, error.into()))?;
            self.deviation = deviation;
        }
        // All models at rest are silent; rounding could leave weight on a model that is not.
        for (deviation, rests) in self.deviation.0.iter_mut().zip(rests) {
            if rests {
                *deviation = 0.0;
            }
        }
        Ok(())
    }

    /// Moves each voice to its speed and force at an update; returns which voices are at rest.
    fn move_to(&mut self, number: usize, frame: usize) -> Result<[bool; LANES], (usize, SynthesisError)> {
        let mut rests = [false; LANES];
        for (l, lane) in self.lanes.iter_mut().enumerate() {
            let points = lane.points;
            let here = points.speed_m_s.get(number).zip(points.force_n.get(number));
            let Some((&speed_m_s, &force_n)) = here else {
                continue;
            };
            let interpolator = &self.interpolators[lane.interpolator];
            let spot = interpolator.locate_from(&mut lane.last_triangle, speed_m_s, force_n);
            rests[l] = spot.speed_m_s == 0.0 || spot.force_n == 0.0;
            match &mut self.filters {
                Filters::Plain(bank) => {
                    let mut at = Coefficients::SILENCE;
                    interpolator.interpolate_at(spot.vertices, spot.weights, &mut at);
                    self.deviation.0[l] = at.variance.sqrt();
                    let set = bank.set_coefficients(l, at.ar(), at.ma(), at.gain);
                    set.map_err(|error| (l, error.into()))?;
                }
                Filters::Warped { mix, .. } => {
                    // Warped models have no MA part.
                    let rows = &mut mix.0[..interpolator.ar_order() + 2];
                    interpolator.mix_into(&spot, l, rows);
                }
            }
            lane.move_lines(&spot, frame);
        }
        Ok(rests)
    }

    /// Filters some frames of the block.
    fn filter(&mut self, frames: Range<usize>) {
        let Buffers { excitation, out, .. } = &mut *self.buffers;
        let (excitation, out) = (&mut excitation[frames.clone()], &mut out[frames]);
        self.arch.dispatch(Scale {
            deviation: &self.deviation.0,
            excitation,
        });
        let (excitation, out) = (excitation.as_flattened(), out.as_flattened_mut());
        match &mut self.filters {
            Filters::Plain(bank) => bank.process(excitation, out),
            Filters::Warped { bank, .. } => bank.process(excitation, out),
        }
    }

    /// Ends a block: high-pass, output and lines.
    fn write(&mut self, block: &Range<usize>) {
        let out = &mut self.buffers.out;
        if let Some(highpass) = &mut self.highpass {
            highpass.process_in_place(&mut out[..block.len()]);
        }
        for (l, lane) in self.lanes.iter_mut().enumerate() {
            lane.write(l, block, out);
        }
    }
}

impl Lane<'_> {
    /// Moves the lines to a position on the map from a frame of the block on.
    fn move_lines(&mut self, spot: &Spot, frame: usize) {
        if self.lines.is_some() {
            self.moves.push(LineMove {
                frame,
                speed_m_s: spot.speed_m_s,
                powers_m2_s4: mixed_powers(self.texture.lines(), spot.vertices, spot.weights),
            });
        }
    }
}

impl Filters {
    fn of(texture: &TextureModel) -> Self {
        if texture.warping() == 0.0 {
            return Self::Plain(VoiceBank::new(Form::Lattice, LANES));
        }
        let order = texture.ar_order();
        let mut mix = Box::new(CacheLines([[0.0; LANES]; MIX]));
        // Lanes without a voice get the flat spectrum.
        for (k, row) in mix.0[..order].iter_mut().enumerate() {
            *row = [PI * (k + 1) as f64 / (order + 1) as f64; LANES];
        }
        mix.0[order] = [1.0; LANES];
        let bank = WarpedBank::new(LANES);
        Self::Warped { bank, mix }
    }
}

/// Puts the samples of [`DRAWN`] voices into the lanes from `first` on.
///
/// Made without the widest instructions on purpose: those that gather from many places are slower on many processors.
fn put_side_by_side(drawn: &[[f64; BLOCK]; DRAWN], first: usize, rows: &mut [Row; BLOCK]) {
    for (n, row) in rows.iter_mut().enumerate() {
        if let Some(lanes) = row[first..].first_chunk_mut::<DRAWN>() {
            for l in 0..DRAWN {
                lanes[l] = drawn[l][n];
            }
        }
    }
}

/// Converts interpolated warped models to coefficients and excitation deviations, like
/// [`Interpolator::interpolate_at`].
struct Convert<'a> {
    mix: &'a [Row; MIX],
    order: usize,
    warping: f64,
}

/// Coefficients, and deviations of the excitation.
type Converted = (CacheLines<[Row; MAX_ORDER]>, CacheLines<Row>);

impl WithSimd for Convert<'_> {
    type Output = Result<Converted, (usize, PredictionError)>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self { mix, order, warping } = self;
        let mut all = CacheLines([[0.0; LANES]; MAX_ORDER]);
        let mut deviation = CacheLines([0.0; LANES]);
        // A vector of lanes at a time.
        let mut lsf = CacheLines([[0.0; WIDTH]; MAX_ORDER]);
        let mut ar = CacheLines([[0.0; WIDTH]; MAX_ORDER]);
        let (lsf, ar) = (&mut lsf.0[..order], &mut ar.0[..order]);
        for part in 0..LANES / WIDTH {
            for (lsf, row) in lsf.iter_mut().zip(mix) {
                *lsf = row.as_chunks::<WIDTH>().0[part];
            }
            lsf_to_ar_lanes(lsf, ar);
            let gains = match power_gains(ar, warping) {
                Ok(gains) => gains,
                Err((lane, error)) => return Err((part * WIDTH + lane, error)),
            };
            for (row, ar) in all.0.iter_mut().zip(&*ar) {
                row.as_chunks_mut::<WIDTH>().0[part] = *ar;
            }
            let level = &mix[order + 1].as_chunks::<WIDTH>().0[part];
            let deviation = &mut deviation.0.as_chunks_mut::<WIDTH>().0[part];
            for l in 0..WIDTH {
                deviation[l] = (level[l] * level[l] / gains[l]).sqrt();
            }
        }
        Ok((all, deviation))
    }
}

/// Modulates a block of excitation with crackle.
struct Modulate<'a> {
    crackle: &'a mut CrackleLanes<LANES>,
    excitation: &'a mut [Row; BLOCK],
    drawn: &'a [Row; BLOCK],
}

impl WithSimd for Modulate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.crackle.modulate(self.excitation, self.drawn);
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
    fn with_simd<S: Simd>(self, _: S) {
        let deviation = *self.deviation;
        for frame in self.excitation {
            for l in 0..LANES {
                frame[l] *= deviation[l];
            }
        }
    }
}
