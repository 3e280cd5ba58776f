//! Inputs and outputs of a processor: typed slices with the frames of a tick.

use crate::frame::{Contact, Weights};
use rtrb::{Consumer, Producer, RingBuffer};
use std::hint::black_box;

/// The memory of a run: all buffers in one slice, each aligned to a cache line.
///
/// Alignment makes cheap nodes twice as fast; an offset into a vector gives it. With one slice a step borrows its own
/// buffer and everything around it by two splits.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    data: Vec<f64>,
    base: usize,
    len: usize,
}

/// f64s in a cache line.
pub(crate) const LINE: usize = 8;

impl Memory {
    pub(crate) fn new(len: usize) -> Self {
        let data = touched(vec![0.0; len + LINE]);
        let base = data.as_ptr().align_offset(64).min(LINE);
        Self { data, base, len }
    }

    #[inline]
    pub(crate) fn all(&self) -> &[f64] {
        &self.data[self.base..self.base + self.len]
    }

    #[inline]
    pub(crate) fn all_mut(&mut self) -> &mut [f64] {
        &mut self.data[self.base..self.base + self.len]
    }
}

/// f64s in the smallest page that systems have.
const PAGE: usize = 512;

/// Touches every page of a buffer. The system maps a page of a zeroed buffer at its first write, which must not
/// happen in the real-time thread.
pub(crate) fn touched(mut buffer: Vec<f64>) -> Vec<f64> {
    let last = buffer.len().checked_sub(1);
    for at in (0..buffer.len()).step_by(PAGE).chain(last) {
        buffer[at] = black_box(buffer[at]);
    }
    buffer
}

/// Makes an empty ring whose pages are mapped.
pub(crate) fn touched_ring(capacity: usize) -> (Producer<f64>, Consumer<f64>) {
    let (mut into, mut out) = RingBuffer::new(capacity);
    if let Ok(all) = into.write_chunk_uninit(capacity) {
        all.fill_from_iter(std::iter::repeat_n(black_box(0.0), capacity));
    }
    if let Ok(all) = out.read_chunk(capacity) {
        all.commit_all();
    }
    (into, out)
}

/// A buffer in the memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Extent {
    pub start: u32,
    pub len: u32,
}

impl Extent {
    /// Splits the memory into the part before the buffer, the buffer, and the part behind it.
    #[inline]
    pub(crate) fn split(self, memory: &mut [f64]) -> (&[f64], &mut [f64], &[f64]) {
        let (before, rest) = memory.split_at_mut(self.start as usize);
        let (own, behind) = rest.split_at_mut(self.len as usize);
        (before, own, behind)
    }
}

/// An input of a step, resolved to memory.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ResolvedInput {
    /// First component of the port, in the memory before the step's own buffer or behind it.
    pub at: u32,
    pub width: u32,
    pub behind: bool,
    pub form: Form,
}

/// An input of a step in a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Binding {
    pub slot: u32,
    /// First component of the port in its buffer.
    pub start: u32,
    pub width: u32,
    pub form: Form,
    /// Clock whose window selects the frames of the buffer.
    pub clock: u32,
}

/// Layout of an input's frames in its buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    /// One frame per tick of the reader's clock.
    Sampled,
    /// `[count, (start, components..), ..]` as written by a hold.
    Runs,
    /// Not connected.
    Absent,
}

/// Place of an output in the buffer of its step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Placing {
    pub start: u32,
    pub width: u32,
}

/// The inputs and outputs of one call of `process`.
///
/// Inputs are numbered in the order of the node's spec, the connections of a [`Many`](crate::node::Presence::Many)
/// port one after the other; outputs likewise. A port that does not exist or has another width gives an empty slice;
/// with debug assertions, as in tests, it panics.
pub struct Io<'a> {
    pub(crate) frames: usize,
    /// Frames of the buffers that earlier calls of the same block have used.
    pub(crate) offset: usize,
    pub(crate) inputs: &'a [ResolvedInput],
    pub(crate) outputs: &'a [Placing],
    /// The memory before the step's own buffer, that buffer, and the memory behind it.
    pub(crate) before: &'a [f64],
    pub(crate) out: &'a mut [f64],
    pub(crate) behind: &'a [f64],
}

impl<'a> Io<'a> {
    /// Frames of this call.
    #[inline]
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Number of inputs, every connection of a `Many` port counted.
    #[inline]
    pub fn input_count(&self) -> usize {
        self.inputs.len()
    }

    /// Whether this input is connected.
    #[inline]
    pub fn connected(&self, input: usize) -> bool {
        self.inputs
            .get(input)
            .is_some_and(|wire| wire.form != Form::Absent)
    }

    /// Components of one frame of an input.
    #[inline]
    pub fn width(&self, input: usize) -> usize {
        self.inputs.get(input).map_or(0, |wire| wire.width as usize)
    }

    /// All components of a sampled input, `frames` times its width, frame by frame. For scalars: its samples.
    #[inline]
    pub fn components(&self, input: usize) -> &'a [f64] {
        debug_assert!(input < self.inputs.len(), "there is no input {input}");
        match self.inputs.get(input) {
            Some(wire) if wire.form == Form::Sampled => {
                let width = wire.width as usize;
                let start = wire.at as usize + self.offset * width;
                &self.side(wire)[start..][..self.frames * width]
            }
            _ => &[],
        }
    }

    /// The part of the memory that an input lies in.
    #[inline]
    fn side(&self, wire: &ResolvedInput) -> &'a [f64] {
        if wire.behind { self.behind } else { self.before }
    }

    /// The frames of a sampled input of `W` components: `frames::<3>` of a 3-vector.
    #[inline]
    pub fn frames_of<const W: usize>(&self, input: usize) -> &'a [[f64; W]] {
        debug_assert!(
            !self.connected(input) || self.width(input) == W,
            "input {input} has {} components, not {W}",
            self.width(input)
        );
        if self.width(input) == W {
            self.components(input).as_chunks().0
        } else {
            &[]
        }
    }

    /// The frames of a contact input.
    #[inline]
    pub fn contacts(&self, input: usize) -> impl Iterator<Item = Contact> + use<'a> {
        self.frames_of::<{ Contact::WIDTH }>(input)
            .iter()
            .map(Contact::from_components)
    }

    /// The frames of a weights input.
    #[inline]
    pub fn weights(&self, input: usize) -> impl Iterator<Item = Weights> + use<'a> {
        self.frames_of::<{ Weights::WIDTH }>(input)
            .iter()
            .map(Weights::from_components)
    }

    /// The runs of a held input.
    #[inline]
    pub fn held(&self, input: usize) -> Held<'a> {
        let absent = Held {
            at: 0,
            frames: 0,
            width: 1,
            runs: 0,
            components: &[],
        };
        let Some(wire) = self.inputs.get(input) else {
            return absent;
        };
        let width = wire.width as usize;
        match wire.form {
            Form::Absent => absent,
            Form::Sampled => Held {
                at: 0,
                frames: self.frames,
                width,
                runs: usize::MAX,
                components: self.components(input),
            },
            Form::Runs => {
                let components = &self.side(wire)[wire.at as usize..];
                let runs = components[0] as usize;
                Held {
                    at: 0,
                    frames: self.frames,
                    width,
                    runs,
                    components: &components[1..1 + runs * (width + 1)],
                }
            }
        }
    }

    /// All components of an output, to be filled completely.
    #[inline]
    pub fn out(&mut self, output: usize) -> &mut [f64] {
        debug_assert!(output < self.outputs.len(), "there is no output {output}");
        let Some(placing) = self.outputs.get(output) else {
            return &mut [];
        };
        let width = placing.width as usize;
        let start = placing.start as usize + self.offset * width;
        &mut self.out[start..][..self.frames * width]
    }

    /// The frames of an output of `W` components, to be filled completely.
    #[inline]
    pub fn out_frames<const W: usize>(&mut self, output: usize) -> &mut [[f64; W]] {
        debug_assert!(
            self.outputs
                .get(output)
                .is_some_and(|placing| placing.width as usize == W),
            "there is no output {output} of {W} components"
        );
        if self
            .outputs
            .get(output)
            .is_some_and(|placing| placing.width as usize == W)
        {
            self.out(output).as_chunks_mut().0
        } else {
            &mut []
        }
    }

    /// The first `N` outputs at once, each to be filled completely.
    #[inline]
    pub fn outs<const N: usize>(&mut self) -> [&mut [f64]; N] {
        let mut rest: &mut [f64] = self.out;
        let mut taken = 0;
        std::array::from_fn(|output| {
            let Some(placing) = self.outputs.get(output) else {
                return Default::default();
            };
            let width = placing.width as usize;
            let start = placing.start as usize + self.offset * width;
            let (_, from) = std::mem::take(&mut rest).split_at_mut(start - taken);
            let (port, after) = from.split_at_mut(self.frames * width);
            rest = after;
            taken = start + self.frames * width;
            port
        })
    }
}

/// The runs of a held input: an iterator of (frames of this call, the frame that holds during them).
#[derive(Debug, Clone)]
pub struct Held<'a> {
    at: usize,
    frames: usize,
    width: usize,
    /// Runs written by a hold, or `usize::MAX` for a sampled signal: a run a frame.
    runs: usize,
    components: &'a [f64],
}

impl<'a> Iterator for Held<'a> {
    type Item = (std::ops::Range<usize>, &'a [f64]);

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        if self.runs == usize::MAX {
            let frame = self.at;
            self.at += 1;
            let components = self
                .components
                .get(frame * self.width..(frame + 1) * self.width)?;
            return Some((frame..frame + 1, components));
        }
        let stride = self.width + 1;
        let run = self.components.get(self.at * stride..(self.at + 1) * stride)?;
        self.at += 1;
        let end = self
            .components
            .get(self.at * stride)
            .map_or(self.frames, |start| *start as usize);
        Some((run[0] as usize..end, &run[1..]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touching_changes_no_value() {
        for len in [0, 1, PAGE - 1, PAGE, 3 * PAGE + 7] {
            let buffer: Vec<f64> = (0..len).map(|x| x as f64).collect();
            assert_eq!(touched(buffer.clone()), buffer);
        }
    }

    #[test]
    fn a_touched_ring_is_empty_and_has_room_for_all() {
        let (mut into, mut out) = touched_ring(5);
        for round in 0..3 {
            assert_eq!((into.slots(), out.slots()), (5, 0));
            let frames = [1.0, 2.0, 3.0, 4.0, f64::from(round)];
            into.push_entire_slice(&frames).unwrap();
            let mut got = [0.0; 5];
            out.pop_entire_slice(&mut got).unwrap();
            assert_eq!(got, frames);
        }
    }
}
