//! Inputs and outputs of a processor: typed slices with the frames of a tick.

use crate::frame::{AnyWidth, FrameKind, Kinds, Record};
use crate::node::{Input, Mode, Output, OutputFamily, Outputs};
use rtrb::{Consumer, Producer, RingBuffer};
use std::hint::black_box;
use std::marker::PhantomData;
use std::ops::Range;

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
    /// First place behind it.
    #[inline]
    pub(crate) fn end(self) -> u32 {
        self.start + self.len
    }

    /// Splits the memory into the part before the buffer, the buffer, and the part behind it.
    #[inline]
    pub(crate) fn split(self, memory: &mut [f64]) -> (&[f64], &mut [f64], &[f64]) {
        let (before, rest) = memory.split_at_mut(self.start as usize);
        let (own, behind) = rest.split_at_mut(self.len as usize);
        (before, own, behind)
    }
}

/// An input of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ResolvedInput {
    /// First component of the port, in the memory before the step's own buffer or behind it.
    pub at: u32,
    pub width: u32,
    pub behind: bool,
    pub form: Form,
}

impl ResolvedInput {
    /// Resolves an input at `place` of the memory. Buffers do not overlap and no step reads the one that it writes, so an
    /// input lies wholly before or wholly behind the step's own.
    pub(crate) fn new(place: Placing, form: Form, out: Extent) -> Self {
        let behind = form != Form::Absent && place.start >= out.end();
        let at = match form {
            Form::Absent => 0,
            _ => place.start - if behind { out.end() } else { 0 },
        };
        Self { at, width: place.width, behind, form }
    }

    /// First component of the port in the memory.
    pub(crate) fn place(&self, out: Extent) -> u32 {
        self.at + if self.behind { out.end() } else { 0 }
    }
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

/// Place of a port: an output's in the buffer of its step, any other in the memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Placing {
    pub start: u32,
    pub width: u32,
}

/// Where the inputs and outputs of a step lie in the memory.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Wires {
    /// Buffer that it writes; empty for none.
    pub out: Extent,
    /// In the order of the node's spec, the connections of a `Many` port one after the other.
    pub inputs: Box<[ResolvedInput]>,
    /// In the order of the node's spec.
    pub outputs: Box<[Placing]>,
}

impl Wires {
    /// Places of the only connected inputs, the first `count`, and of the only output if all are scalars. Of one input the
    /// place is given twice; without inputs, that of the output.
    pub(crate) fn scalars(&self, count: usize) -> Option<([u32; 2], u32)> {
        let [output] = *self.outputs else { return None };
        let to = self.out.start + output.start;
        // A source ignores its input.
        if self.inputs.is_empty() && count == 1 {
            return (output.width == 1).then_some(([to; 2], to));
        }
        let (own, others) = self.inputs.split_at_checked(count)?;
        let is_scalar = |input: &ResolvedInput| input.form == Form::Sampled && input.width == 1;
        let are_scalars = own.iter().all(is_scalar) && output.width == 1;
        let is_absent = |input: &ResolvedInput| input.form == Form::Absent;
        let from = [own.first()?, own.last()?].map(|input| input.place(self.out));
        (are_scalars && others.iter().all(is_absent)).then_some((from, to))
    }
}

/// The inputs and outputs of one call of [`Processor::process`](crate::node::Processor::process), read and written by the
/// handles of the ports of the kind `K`. A handle of another kind does not compile.
pub struct Io<'a, K> {
    pub(crate) ports: Ports<'a>,
    kind: PhantomData<fn() -> K>,
}

impl<'a, K> Io<'a, K> {
    pub(crate) fn new(ports: Ports<'a>) -> Self {
        Self { ports, kind: PhantomData }
    }

    /// Frames of this call.
    #[inline]
    pub fn frames(&self) -> usize {
        self.ports.frames
    }

    /// The frames of an input: a slice of numbers or arrays, its components if the width is not fixed, an [`Option`] if
    /// it may be left out, [`Runs`] if it is held, [`Connections`] if it has many.
    #[inline]
    pub fn read<F: FrameKind, M: Mode>(&self, input: Input<K, F, M>) -> M::Read<'a, F> {
        M::read(&self.ports, input.index())
    }

    /// The frames of an input as values of its kind's type.
    #[inline]
    pub fn decode<F: Record>(&self, input: Input<K, F>) -> impl Iterator<Item = F> + use<'a, F, K> {
        self.read(input).iter().map(F::from_components)
    }

    /// Components of one frame of an input, at least 1. The connections of a `Many` input have the same.
    #[inline]
    pub fn width<F: AnyWidth, M: Mode>(&self, input: Input<K, F, M>) -> usize {
        self.ports.width(input.index()).max(1)
    }

    /// The frames of an output, to be filled completely.
    #[inline]
    pub fn write<F: FrameKind>(&mut self, output: Output<K, F>) -> F::FramesMut<'_> {
        self.ports.write::<F>(output.index())
    }

    /// Number of members of the family of outputs.
    #[inline]
    pub fn members<F: FrameKind>(&self, family: OutputFamily<K, F>) -> usize {
        self.ports.outputs.len().saturating_sub(family.index())
    }

    /// Components of one frame of the members of the family, at least 1.
    #[inline]
    pub fn member_width<F: AnyWidth>(&self, family: OutputFamily<K, F>) -> usize {
        let first = self.ports.outputs.get(family.index());
        first.map_or(1, |placing| placing.width as usize)
    }

    /// The frames of a member of the family of outputs, counted from 0 in the order of
    /// [`NodeKind::members`](crate::node::NodeKind::members), to be filled completely.
    ///
    /// # Panics
    /// If the family has no such member.
    #[inline]
    pub fn write_member<F: FrameKind>(
        &mut self,
        family: OutputFamily<K, F>,
        member: usize,
    ) -> F::FramesMut<'_> {
        let members = self.members(family);
        assert!(member < members, "there are {members} members, and no member {member}");
        self.ports.write::<F>(family.index() + member)
    }

    /// The frames of several outputs, a tuple of different handles in any order, each to be filled completely:
    /// `let (speed, velocity) = io.write_all((SPEED, VELOCITY));`
    ///
    /// # Panics
    /// If a handle is given twice.
    #[inline]
    pub fn write_all<T: Outputs<K>>(&mut self, outputs: T) -> T::Write<'_> {
        outputs.write(&mut self.ports)
    }
}

/// The inputs and outputs of one call of `process`, by their places in the node's spec.
pub struct Ports<'a> {
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

impl<'a> Ports<'a> {
    /// So many frames in the buffers of the memory, behind those that earlier calls of the block have used.
    #[inline]
    pub(crate) fn new(frames: usize, offset: usize, wires: &'a Wires, memory: &'a mut [f64]) -> Self {
        let (before, out, behind) = wires.out.split(memory);
        Self { frames, offset, inputs: &wires.inputs, outputs: &wires.outputs, before, out, behind }
    }

    /// One frame of a scalar input, the only one that is connected, and of a scalar output.
    #[inline]
    pub(crate) fn one_frame(x: &'a [f64; 1], y: &'a mut [f64; 1]) -> Self {
        const INPUT: ResolvedInput = ResolvedInput { at: 0, width: 1, behind: false, form: Form::Sampled };
        const OUTPUT: Placing = Placing { start: 0, width: 1 };
        Self { frames: 1, offset: 0, inputs: &[INPUT], outputs: &[OUTPUT], before: x, out: y, behind: &[] }
    }

    /// True if this input is connected.
    #[inline]
    pub(crate) fn connected(&self, input: usize) -> bool {
        self.inputs.get(input).is_some_and(|wire| wire.form != Form::Absent)
    }

    /// Components of one frame of an input.
    #[inline]
    fn width(&self, input: usize) -> usize {
        self.inputs.get(input).map_or(0, |wire| wire.width as usize)
    }

    /// The frames of an input that has one per tick.
    #[inline]
    pub(crate) fn sampled<F: FrameKind>(&self, input: usize) -> F::Frames<'a> {
        debug_assert!(
            F::KINDS.have_width(self.width(input)),
            "input {input} is not connected, or has another width"
        );
        F::frames(self.components(input))
    }

    /// All components of a sampled input, `frames` times its width, frame by frame.
    #[inline]
    pub(crate) fn components(&self, input: usize) -> &'a [f64] {
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

    /// The connections from an input on.
    #[inline]
    pub(crate) fn connections<F: FrameKind>(&self, first: usize) -> Connections<'a, F> {
        Connections {
            ports: Ports {
                frames: self.frames,
                offset: self.offset,
                inputs: self.inputs.get(first..).unwrap_or_default(),
                outputs: &[],
                before: self.before,
                out: &mut [],
                behind: self.behind,
            },
            kind: PhantomData,
        }
    }

    /// The runs of a held input.
    #[inline]
    pub(crate) fn runs<F: FrameKind>(&self, input: usize) -> Runs<'a, F> {
        debug_assert!(
            F::KINDS.have_width(self.width(input)),
            "input {input} is not connected, or has another width"
        );
        let absent = Runs { at: 0, frames: 0, width: 1, runs: 0, components: &[], kind: PhantomData };
        let Some(wire) = self.inputs.get(input) else {
            return absent;
        };
        let width = wire.width as usize;
        match wire.form {
            Form::Absent => absent,
            Form::Sampled => Runs {
                at: 0,
                frames: self.frames,
                width,
                runs: usize::MAX,
                components: self.components(input),
                kind: PhantomData,
            },
            Form::Runs => {
                let components = &self.side(wire)[wire.at as usize..];
                let runs = components[0] as usize;
                Runs {
                    at: 0,
                    frames: self.frames,
                    width,
                    runs,
                    components: &components[1..1 + runs * (width + 1)],
                    kind: PhantomData,
                }
            }
        }
    }

    /// The components of an output in the step's buffer.
    #[inline]
    fn place(&self, output: usize) -> Range<usize> {
        debug_assert!(output < self.outputs.len(), "there is no output {output}");
        let Some(placing) = self.outputs.get(output) else {
            return 0..0;
        };
        let width = placing.width as usize;
        let start = placing.start as usize + self.offset * width;
        start..start + self.frames * width
    }

    /// The frames of an output.
    #[inline]
    fn write<F: FrameKind>(&mut self, output: usize) -> F::FramesMut<'_> {
        debug_assert!(
            F::KINDS.have_width(self.outputs.get(output).map_or(0, |placing| placing.width as usize)),
            "output {output} does not exist or has another width"
        );
        F::frames_mut(self.out(output))
    }

    /// All components of an output, to be filled completely.
    #[inline]
    pub(crate) fn out(&mut self, output: usize) -> &mut [f64] {
        let place = self.place(output);
        &mut self.out[place]
    }

    /// All components of several outputs, each with the kinds that its handle stands for.
    #[inline]
    pub(crate) fn outs<const N: usize>(&mut self, outputs: [(usize, Kinds); N]) -> [&mut [f64]; N] {
        let places = outputs.map(|(output, kinds)| {
            debug_assert!(
                kinds.have_width(self.outputs.get(output).map_or(0, |placing| placing.width as usize)),
                "output {output} does not exist or has another width"
            );
            self.place(output)
        });
        match self.out.get_disjoint_mut(places) {
            Ok(ports) => ports,
            Err(_) => panic!("one output was requested twice: {outputs:?}"),
        }
    }
}

/// The connections of an input that has one or more, in the order of the graph file.
pub struct Connections<'a, F> {
    /// Its inputs are the connections.
    ports: Ports<'a>,
    kind: PhantomData<fn() -> F>,
}

impl<'a, F: FrameKind> Connections<'a, F> {
    /// How many there are; at least one.
    #[inline]
    #[expect(clippy::len_without_is_empty, reason = "there is always one")]
    pub fn len(&self) -> usize {
        self.ports.inputs.len()
    }

    /// The frames of a connection, counted from 0, or of the last one for any number beyond it.
    #[inline]
    pub fn nth_or_last(&self, connection: usize) -> F::Frames<'a> {
        self.ports.sampled::<F>(connection.min(self.len().saturating_sub(1)))
    }

    /// The frames of each connection.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = F::Frames<'a>> {
        (0..self.len()).map(|connection| self.ports.sampled::<F>(connection))
    }
}

/// The runs of a held input: an iterator of (frames of this call, the frame that holds during them).
pub struct Runs<'a, F> {
    at: usize,
    frames: usize,
    width: usize,
    /// Runs written by a hold, or `usize::MAX` for a sampled signal: a run a frame.
    runs: usize,
    components: &'a [f64],
    kind: PhantomData<fn() -> F>,
}

impl<'a, F: FrameKind> Iterator for Runs<'a, F> {
    type Item = (Range<usize>, F::Frame<'a>);

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        if self.runs == usize::MAX {
            let frame = self.at;
            self.at += 1;
            let components = self.components.get(frame * self.width..(frame + 1) * self.width)?;
            return Some((frame..frame + 1, F::frame(components)?));
        }
        let stride = self.width + 1;
        let run = self.components.get(self.at * stride..(self.at + 1) * stride)?;
        self.at += 1;
        let end = self.components.get(self.at * stride).map_or(self.frames, |start| *start as usize);
        Some((run[0] as usize..end, F::frame(&run[1..])?))
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
