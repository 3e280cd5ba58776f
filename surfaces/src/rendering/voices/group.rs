//! A group of up to [`LANES`] voices of one shape.

use super::super::synthesis::{SynthesisError, UpdatePoints, updates};
use super::VoiceInto;
use crate::crackle::{CrackleLanes, CrackleSource};
use crate::interpolation::{Interpolator, Spot};
use crate::lines::{LineSource, MAX_LINES, mixed_powers};
use crate::lsf::lsf_to_ar_lanes;
use crate::{MAX_ORDER, TextureModel};
use haptograph_signal::arma::{Form, VoiceBank, WarpedBank};
use haptograph_signal::elementwise::CacheLines;
use haptograph_signal::filter::SectionLanes;
use haptograph_signal::noise::{Gaussian, stream_seed};
use pulp::{Arch, Simd, WithSimd};
use std::f64::consts::PI;
use std::ops::{ControlFlow, Range};

/// Maximum number of voices in a group.
pub const LANES: usize = WarpedBank::GROUP;
/// Frames processed at a time: a batch of the random numbers.
const BLOCK: usize = 64;
/// Blocks between two calls of `advance`.
const BLOCKS_PER_REPORT: usize = 256;
/// Voices whose random numbers are drawn before they are put side by side.
const DRAWN: usize = 8;
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
    /// Numbers of coefficients of both polynomials.
    orders: [usize; 2],
    warping: f64,
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
    Plain {
        bank: VoiceBank,
        /// Standard deviation of the excitation.
        deviation: CacheLines<Row>,
    },
    Warped(WarpedBank),
}

/// Buffers of a block of frames, on whole cache lines.
#[repr(C, align(64))]
struct Buffers {
    drawn: [[f64; BLOCK]; DRAWN],
    excitation: [Row; BLOCK],
    /// The random numbers of crackle, then the output.
    out: [Row; BLOCK],
    /// The interpolated models: line spectral frequencies of both polynomials, gains, levels.
    mix: [Row; MIX],
    /// The coefficients.
    coefficients: [Row; MIX],
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

    /// Has the processor fetch the memory that the samples of a block go to: it would wait for it when it writes them.
    #[cfg(target_arch = "x86_64")]
    fn fetch(&self, block: &Range<usize>) {
        if let Some(sse) = pulp::core_arch::x86::Sse::try_new() {
            for line in self.out[self.of(block)].chunks(size_of::<CacheLines<f64>>() / size_of::<f64>()) {
                sse._mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(line.as_ptr().cast());
            }
        }
    }

    /// Writes the samples of a block, and adds the lines.
    fn write(&mut self, block: &Range<usize>, samples: &[f64; BLOCK]) {
        let own = self.of(block);
        let own = &mut self.out[own];
        own.copy_from_slice(&samples[..own.len()]);
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
            let known = textures.iter().position(|known| std::ptr::eq(*known, voice.texture));
            let number = known.unwrap_or(textures.len());
            if known.is_none() {
                textures.push(voice.texture);
            }
            Lane::new(voice, number)
        };
        let lanes = voices.into_iter().map(lane).collect();
        let orders = [first.ar_order(), first.ma_order()];
        Self {
            filters: Filters::of(first),
            crackle,
            highpass: (!highpasses.is_empty()).then(|| SectionLanes::new(&highpasses)),
            lanes,
            interpolators: textures.into_iter().map(Interpolator::new).collect(),
            orders,
            warping: first.warping(),
            buffers: Box::new(Buffers {
                mix: flat(orders),
                coefficients: [[0.0; LANES]; MIX],
                drawn: [[0.0; BLOCK]; DRAWN],
                excitation: [[0.0; LANES]; BLOCK],
                out: [[0.0; LANES]; BLOCK],
            }),
            arch: Arch::new(),
        }
    }

    /// Computes the vibrations; an error names the lane. `advance` receives the number of further samples
    /// done, and returns whether to continue.
    pub fn play(mut self, advance: &dyn Fn(usize) -> ControlFlow<()>) -> Result<(), (usize, SynthesisError)> {
        let samples = self.lanes.iter().map(|lane| lane.out.len()).max().unwrap_or(0);
        let UpdatePoints { rate_hz, update_hz, .. } = *self.lanes[0].points;
        let mut updates = updates(rate_hz, update_hz, samples).enumerate().peekable();
        let mut reported = 0;
        for (number, start) in (0..samples).step_by(BLOCK).enumerate() {
            let block = start..samples.min(start + BLOCK);
            #[cfg(target_arch = "x86_64")]
            self.lanes.iter().for_each(|lane| lane.fetch(&block));
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
            if number % BLOCKS_PER_REPORT == 0 {
                if advance(block.end - reported).is_break() {
                    return Err((0, SynthesisError::Stopped));
                }
                reported = block.end;
            }
        }
        // It is done.
        let _ = advance(samples - reported);
        Ok(())
    }

    /// Draws the excitation of a block, of deviation 1.
    fn excite(&mut self, block: &Range<usize>) {
        let Buffers { drawn, excitation, out, .. } = &mut *self.buffers;
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
        self.arch.dispatch(Modulate { crackle, excitation, drawn: out });
    }

    /// Updates the coefficients from a frame of the block on.
    fn update(&mut self, number: usize, frame: usize) -> Result<(), (usize, SynthesisError)> {
        let Buffers { mix, coefficients, .. } = &mut *self.buffers;
        let [p, q] = self.orders;
        // Not by the widest instructions: those that write to many places are slower than as many writes.
        for (l, lane) in self.lanes.iter_mut().enumerate() {
            let points = lane.points;
            // What has ended changes no more.
            let Some((&speed_m_s, &force_n)) = points.speed_m_s.get(number).zip(points.force_n.get(number))
            else {
                continue;
            };
            let interpolator = &self.interpolators[lane.interpolator];
            let spot = interpolator.locate_from(&mut lane.last_triangle, speed_m_s, force_n);
            interpolator.mix_into(&spot, l, &mut mix[..p + q + 2]);
            // All models at rest are silent; rounding could leave weight on a model that is not.
            if spot.speed_m_s == 0.0 || spot.force_n == 0.0 {
                mix[p + q + 1][l] = 0.0;
            }
            lane.move_lines(&spot, frame);
        }
        let (ar, ma) = coefficients[..p + q].split_at_mut(p);
        let (ar_lsf, ma_lsf) = mix[..p + q].split_at(p);
        for (lsf, coefficients) in [(ar_lsf, &mut *ar), (ma_lsf, &mut *ma)] {
            self.arch.dispatch(Convert { lsf, coefficients });
        }
        let (gain, level) = (&mix[p + q], mix[p + q + 1]);
        let set = match &mut self.filters {
            Filters::Plain { bank, deviation } => {
                // The level is a variance.
                deviation.0 = level.map(f64::sqrt);
                bank.set_group(0, ar, ma, gain)
            }
            // It is the square root of a power, and the gain 1.
            Filters::Warped(bank) => bank.set_group(0, ar, self.warping, &level.map(|level| level * level)),
        };
        set.map_err(|(lane, error)| (lane, error.into()))
    }

    /// Filters some frames of the block.
    fn filter(&mut self, frames: Range<usize>) {
        let Buffers { excitation, out, .. } = &mut *self.buffers;
        let (excitation, out) = (&mut excitation[frames.clone()], &mut out[frames]);
        match &mut self.filters {
            Filters::Plain { bank, deviation } => {
                self.arch.dispatch(Scale { deviation: &deviation.0, excitation });
                bank.process(excitation.as_flattened(), out.as_flattened_mut());
            }
            Filters::Warped(bank) => bank.process(excitation.as_flattened(), out.as_flattened_mut()),
        }
    }

    /// Ends a block: high-pass, output and lines.
    fn write(&mut self, block: &Range<usize>) {
        let Buffers { drawn, out, .. } = &mut *self.buffers;
        if let Some(highpass) = &mut self.highpass {
            highpass.process_in_place(&mut out[..block.len()]);
        }
        for (number, lanes) in self.lanes.chunks_mut(DRAWN).enumerate() {
            take_apart(out, number * DRAWN, drawn);
            for (lane, samples) in lanes.iter_mut().zip(&*drawn) {
                lane.write(block, samples);
            }
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
            let bank = VoiceBank::new(Form::Lattice, LANES);
            let deviation = CacheLines([0.0; LANES]);
            Self::Plain { bank, deviation }
        } else {
            Self::Warped(WarpedBank::new(LANES))
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

/// Puts the samples of [`DRAWN`] voices into the lanes from `first` on.
fn put_side_by_side(drawn: &[[f64; BLOCK]; DRAWN], first: usize, rows: &mut [Row; BLOCK]) {
    for (n, rows) in rows.as_chunks_mut::<2>().0.iter_mut().enumerate() {
        let [Some(one), Some(next)] = rows.each_mut().map(|row| row[first..].first_chunk_mut::<DRAWN>())
        else {
            return;
        };
        for l in (0..DRAWN).step_by(2) {
            let [a, b] = [l, l + 1].map(|l| drawn[l].as_chunks().0[n]);
            let [a, b] = turn(a, b);
            (one.as_chunks_mut().0[l / 2], next.as_chunks_mut().0[l / 2]) = (a, b);
        }
    }
}

/// Takes the samples of [`DRAWN`] voices out of the lanes from `first` on.
fn take_apart(rows: &[Row; BLOCK], first: usize, voices: &mut [[f64; BLOCK]; DRAWN]) {
    for (n, rows) in rows.as_chunks::<2>().0.iter().enumerate() {
        let [Some(one), Some(next)] = rows.each_ref().map(|row| row[first..].first_chunk::<DRAWN>()) else {
            return;
        };
        for l in (0..DRAWN).step_by(2) {
            let [a, b] = [one, next].map(|row| row.as_chunks().0[l / 2]);
            let [a, b] = turn(a, b);
            (voices[l].as_chunks_mut().0[n], voices[l + 1].as_chunks_mut().0[n]) = (a, b);
        }
    }
}

/// Two numbers of two voices as two of two frames, or back.
#[inline(always)]
fn turn(a: [f64; 2], b: [f64; 2]) -> [[f64; 2]; 2] {
    // Written out: made of loops, it goes number by number, or with the widest instructions, which are slow at gathering.
    #[cfg(target_arch = "x86_64")]
    if let Some(sse2) = pulp::core_arch::x86::Sse2::try_new() {
        let (a, b) = (pulp::cast(a), pulp::cast(b));
        return [sse2._mm_unpacklo_pd(a, b), sse2._mm_unpackhi_pd(a, b)].map(pulp::cast);
    }
    [[a[0], b[0]], [a[1], b[1]]]
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
    fn with_simd<S: Simd>(self, simd: S) {
        let deviation = S::as_simd_f64s(self.deviation).0;
        for frame in self.excitation {
            for (e, deviation) in S::as_mut_simd_f64s(frame).0.iter_mut().zip(deviation) {
                *e = simd.mul_f64s(*e, *deviation);
            }
        }
    }
}
