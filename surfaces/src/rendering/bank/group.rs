//! A group of up to [`LANES`] voices of one shape.

use super::VoiceInto;
use super::lanes::{BLOCK, Block, DRAWN, Drawn, LANES, Row, put_side_by_side, take_apart};
use crate::TextureModel;
use crate::interpolation::{Interpolator, Spot};
use crate::layers::{LayerBank, LayerVoices, SpectrumBank, Stage};
use crate::rendering::{SynthesisError, UpdatePoints, updates};
#[cfg(target_arch = "x86_64")]
use haptograph_signal::elementwise::CacheLines;
use haptograph_signal::instructions::arch;
use haptograph_signal::noise::Gaussian;
use pulp::Arch;
use std::ops::{ControlFlow, Range};

/// Blocks between two calls of `advance`.
const BLOCKS_PER_REPORT: usize = 256;

/// Voices during synthesis.
pub(super) struct Group<'a> {
    lanes: Vec<Lane<'a>>,
    /// One per texture.
    interpolators: Vec<Interpolator>,
    excitation_layers: Vec<Box<dyn LayerBank>>,
    spectrum: SpectrumBank,
    buffers: Box<Buffers>,
    arch: Arch,
}

/// State of one voice.
struct Lane<'a> {
    points: &'a UpdatePoints,
    /// Number of its texture's interpolator.
    interpolator: usize,
    last_triangle: u32,
    noise: Gaussian,
    output_layers: LayerVoices,
    /// Where its output layers move to in a block, and from which frame on.
    moves: Vec<(usize, Spot)>,
    out: &'a mut [f64],
}

/// Buffers of a block of frames, on whole cache lines.
#[repr(C, align(64))]
struct Buffers {
    drawn: Drawn,
    excitation: [Row; BLOCK],
    out: [Row; BLOCK],
}

impl<'a> Lane<'a> {
    fn new(voice: VoiceInto<'a>, interpolator: usize) -> Self {
        let rate_hz = voice.texture.rate_hz();
        Self {
            points: voice.points,
            interpolator,
            last_triangle: 0,
            noise: Gaussian::new(voice.seed),
            output_layers: LayerVoices::new(voice.texture, Stage::Output, rate_hz, voice.lines_seed),
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

    /// Writes the samples of a block, and applies the layers of the output.
    fn write(&mut self, block: &Range<usize>, samples: &[f64; BLOCK]) {
        let own = self.of(block);
        let own = &mut self.out[own];
        own.copy_from_slice(&samples[..own.len()]);
        if self.output_layers.is_empty() {
            return;
        }
        let mut done = 0;
        for (frame, spot) in self.moves.drain(..) {
            let frame = frame.min(own.len());
            self.output_layers.process(&mut own[done..frame]);
            self.output_layers.move_to(&spot);
            done = frame;
        }
        self.output_layers.process(&mut own[done..]);
    }
}

impl<'a> Group<'a> {
    /// Creates a group of voices of one [`Shape`](super::Shape), at least one and at most [`LANES`].
    pub(super) fn new(voices: Vec<VoiceInto<'a>>) -> Self {
        let excitations = voices.iter().map(|voice| {
            LayerVoices::new(voice.texture, Stage::Excitation, voice.texture.rate_hz(), voice.seed)
        });
        let excitation_layers = LayerVoices::banks(excitations.collect());
        let spectra: Vec<&TextureModel> = voices.iter().map(|voice| voice.texture).collect();
        let spectrum = SpectrumBank::new(&spectra);
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
        Self {
            excitation_layers,
            spectrum,
            lanes,
            interpolators: textures.into_iter().map(Interpolator::new).collect(),
            buffers: Box::new(Buffers {
                drawn: [[0.0; BLOCK]; DRAWN],
                excitation: [[0.0; LANES]; BLOCK],
                out: [[0.0; LANES]; BLOCK],
            }),
            arch: arch(),
        }
    }

    /// Computes the vibrations; an error names the lane. `advance` receives the number of further samples
    /// done, and returns whether to continue.
    pub(super) fn play(
        mut self,
        advance: &dyn Fn(usize) -> ControlFlow<()>,
    ) -> Result<(), (usize, SynthesisError)> {
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
                let frames = at - start..end - start;
                let Buffers { excitation, out, .. } = &mut *self.buffers;
                self.spectrum.process(&mut excitation[frames.clone()], &mut out[frames]);
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
        let Buffers { drawn, excitation, .. } = &mut *self.buffers;
        for (number, lanes) in self.lanes.chunks_mut(DRAWN).enumerate() {
            for (lane, drawn) in lanes.iter_mut().zip(&mut *drawn) {
                let own = lane.of(block).len();
                lane.noise.fill(&mut drawn[..own]);
                drawn[own..].fill(0.0);
            }
            put_side_by_side(drawn, number * DRAWN, excitation);
        }
        let (voices, arch) = (self.lanes.len(), self.arch);
        let mut block = Block { frames: excitation, drawn, voices, arch };
        self.excitation_layers.iter_mut().for_each(|layer| layer.process(&mut block));
    }

    /// Updates the coefficients from a frame of the block on.
    fn update(&mut self, number: usize, frame: usize) -> Result<(), (usize, SynthesisError)> {
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
            self.spectrum.move_to(l, &spot, interpolator);
            if !lane.output_layers.is_empty() {
                lane.moves.push((frame, spot));
            }
        }
        self.spectrum.update().map_err(|(lane, error)| (lane, error.into()))
    }

    /// Ends a block: high-pass, output and its layers.
    fn write(&mut self, block: &Range<usize>) {
        let Buffers { drawn, out, .. } = &mut *self.buffers;
        self.spectrum.pass_high(&mut out[..block.len()]);
        for (number, lanes) in self.lanes.chunks_mut(DRAWN).enumerate() {
            take_apart(out, number * DRAWN, drawn);
            for (lane, samples) in lanes.iter_mut().zip(&*drawn) {
                lane.write(block, samples);
            }
        }
    }
}
