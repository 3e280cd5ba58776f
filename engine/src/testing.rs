//! A bench that runs one node outside a graph, for tests of nodes.
//!
//! ```
//! use haptograph_engine::frame::{Kind, Linear};
//! # use haptograph_engine::node::*;
//! # use haptograph_signal::quantity::Quantity;
//! # haptograph_engine::settings! { /** Settings of the example. */ pub struct TwiceSettings {} }
//! # #[derive(Clone)] struct Doubler;
//! # haptograph_engine::node! {
//! #     /// Doubles.
//! #     struct Twice(TwiceSettings) in "math";
//! #     example: "";
//! #     in INPUT: Linear = Port::any("What is doubled.");
//! #     out OUTPUT: Linear = Port::like("input", "Twice the input.");
//! # }
//! # impl NodeKind for Twice {
//! #     fn build(_: TwiceSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { Ok(Built::new(Doubler)) }
//! # }
//! # impl Processor<Twice> for Doubler {
//! #     fn process(&mut self, _: &Tick, io: &mut Io<'_, Twice>) {
//! #         let x = io.read(Twice::INPUT);
//! #         io.write(Twice::OUTPUT).iter_mut().zip(x).for_each(|(y, x)| *y = 2.0 * x);
//! #     }
//! # }
//! use haptograph_engine::testing::Bench;
//!
//! let mut bench = Bench::new::<Twice>(TwiceSettings {}, 1000.0, &[Kind::SCALAR]).unwrap();
//! assert_eq!(bench.run(&[&[1.0, 2.0, 3.0]]), [[2.0, 4.0, 6.0]]);
//!
//! bench.load(&[&[5.0]], 1);
//! bench.step();
//! assert_eq!(bench.output(Twice::OUTPUT), [10.0]);
//! assert_eq!(bench.components("output"), [10.0]);
//! ```

mod example;

pub use example::{ExampleNode, device_from_example, node_from_example};

use crate::frame::{FrameKind, Kind};
use crate::io::{Extent, Form, LINE, Memory, Placing, ResolvedInput, Wires};
use crate::node::{
    AnyProcessor, BuildContext, BuildError, DataEnd, Flow, InputSpec, KindRule, Latency, NodeKind, NodeSpec,
    Output, SettingId, Tick, build,
};
use crate::plan::{MAX_BLOCK, without_ports};
use haptograph_signal::laws::LawStep;
use haptograph_signal::time::Rate;

/// Largest number of frames that a node on the bench receives at a time.
pub const MAX_FRAMES: usize = MAX_BLOCK;

/// A node, its clock and its wires.
pub struct Bench {
    processor: Box<dyn AnyProcessor>,
    kinds: Vec<Option<Kind>>,
    tick: Tick,
    wires: Wires,
    memory: Memory,
    outputs: Vec<String>,
}

impl Bench {
    /// Builds a node at a whole rate in hertz, its random stream seeded with 1.
    ///
    /// `inputs` has the kind of each connection in the order of the spec, those of a port that takes several last; inputs left
    /// out at the end are not connected.
    ///
    /// # Errors
    /// [`BuildError`] as the node reports it.
    ///
    /// # Panics
    /// If the rate is not a whole number of hertz above zero.
    pub fn new<K: NodeKind>(
        settings: K::Settings,
        rate_hz: f64,
        inputs: &[Kind],
    ) -> Result<Self, BuildError> {
        let connected: Vec<Option<Kind>> = inputs.iter().copied().map(Some).collect();
        Self::built::<K>(settings, &context(&K::SPEC, rate_hz, &connected), &connected)
    }

    /// As [`new`](Self::new), with `None` for inputs that are not connected.
    ///
    /// # Errors
    /// [`BuildError`] as the node reports it.
    pub fn with_gaps<K: NodeKind>(
        settings: K::Settings,
        rate_hz: f64,
        inputs: &[Option<Kind>],
    ) -> Result<Self, BuildError> {
        Self::built::<K>(settings, &context(&K::SPEC, rate_hz, inputs), inputs)
    }

    /// As [`new`](Self::new), with names of the connections of the [`Named`](crate::node::Named) input, in their order.
    ///
    /// # Errors
    /// [`BuildError`] as the node reports it.
    pub fn with_names<K: NodeKind>(
        settings: K::Settings,
        rate_hz: f64,
        inputs: &[Kind],
        names: &[&str],
    ) -> Result<Self, BuildError> {
        let connected: Vec<Option<Kind>> = inputs.iter().copied().map(Some).collect();
        let cx = context(&K::SPEC, rate_hz, &connected).named(names);
        Self::built::<K>(settings, &cx, &connected)
    }

    fn built<K: NodeKind>(
        settings: K::Settings,
        cx: &BuildContext,
        inputs: &[Option<Kind>],
    ) -> Result<Self, BuildError> {
        let members = K::members(&settings)?;
        let processor = build::<K>(settings, cx)?;
        Ok(Self::around(processor, &K::SPEC, members, cx, inputs))
    }

    fn around(
        processor: Box<dyn AnyProcessor>,
        spec: &NodeSpec,
        members: Vec<String>,
        cx: &BuildContext,
        inputs: &[Option<Kind>],
    ) -> Self {
        let plain = spec.outputs.get(..spec.family().unwrap_or(spec.outputs.len()));
        let plain = plain.unwrap_or_default().iter().map(|port| port.name.to_owned());
        let names: Vec<String> = plain.chain(members).collect();
        let ports = ports(spec, cx.inputs.len());
        let width_of = |slot: usize| cx.inputs[slot].map_or(0, Kind::width);
        let mut at = 0;
        let wire = |(slot, port): (usize, &&InputSpec)| {
            let width = width_of(slot);
            let begin = at;
            at += (1 + MAX_FRAMES * (width + 1)).next_multiple_of(LINE);
            ResolvedInput {
                at: begin as u32,
                width: width as u32,
                behind: false,
                form: match (inputs.get(slot).copied().flatten(), port.flow) {
                    (None, _) => Form::Absent,
                    (Some(_), Flow::Held) => Form::Runs,
                    (Some(_), Flow::Sampled) => Form::Sampled,
                },
            }
        };
        let inputs_at = ports.iter().enumerate().map(wire).collect();
        let mut start = 0;
        let mut place = |width: usize| {
            let placing = Placing { start, width: width as u32 };
            start += (MAX_FRAMES * width) as u32;
            placing
        };
        let declared = (0..names.len()).filter_map(|output| spec.output(output));
        let widths = declared.map(|port| match port.kind {
            KindRule::Is(kind) => kind.width(),
            KindRule::Same(name) => {
                let at = ports.iter().position(|input| input.name == name);
                at.map_or(1, width_of)
            }
            KindRule::Linear | KindRule::Any => 1,
        });
        let outputs = widths.map(&mut place).collect();
        let out = Extent { start: at as u32, len: start };
        Self {
            processor,
            kinds: inputs.to_vec(),
            tick: Tick { first: 0, frames: 0, period_s: cx.rate.period_s() },
            wires: Wires { out, inputs: inputs_at, outputs },
            memory: Memory::new(out.end() as usize),
            outputs: names,
        }
    }

    /// Puts frames on the wires, the components of each input frame by frame; equal successive frames of a held input
    /// make one run. At most [`MAX_FRAMES`]; all inputs must have the same number.
    pub fn load(&mut self, inputs: &[&[f64]], frames: usize) {
        assert!(frames <= MAX_FRAMES, "at most {MAX_FRAMES} frames at a time");
        self.tick.first += self.tick.frames as u64;
        self.tick.frames = frames;
        for (wire, components) in self.wires.inputs.iter().zip(inputs) {
            let width = wire.width as usize;
            let buffer = &mut self.memory.all_mut()[wire.at as usize..];
            match wire.form {
                Form::Absent => {}
                Form::Sampled => buffer[..frames * width].copy_from_slice(components),
                Form::Runs => write_runs(buffer, components, width),
            }
        }
    }

    /// Calls `process` once for the frames that were loaded.
    pub fn step(&mut self) {
        let memory = self.memory.all_mut();
        self.processor.process(&self.tick, 0, &self.wires, memory);
    }

    /// Runs a single loaded frame as the engine does: without ports if the node makes a scalar from at most one scalar.
    /// Returns true if it ran without ports.
    pub fn step_single(&mut self) -> bool {
        assert_eq!(self.tick.frames, 1, "a single frame");
        let Some(LawStep { law, from, with, to, .. }) = without_ports(&self.wires, self.processor.law())
        else {
            self.step();
            return false;
        };
        let memory = self.memory.all_mut();
        let [x, z] = [from, with].map(|place| memory[place as usize]);
        memory[to as usize] = match law {
            Some(law) => law.of(x, z),
            None => self.processor.frame(&self.tick, x),
        };
        true
    }

    /// The frames of an output after [`step`](Self::step).
    ///
    /// # Panics
    /// If the handle is of another node, whose frames have another width.
    pub fn output<K, F: FrameKind>(&self, output: Output<K, F>) -> F::Frames<'_> {
        let placing = self.wires.outputs.get(output.index());
        let width = placing.map_or(0, |placing| placing.width as usize);
        assert!(F::KINDS.have_width(width), "{output:?} is none of this node's");
        F::frames(self.at(output.index()))
    }

    /// The components of the output of this name after [`step`](Self::step).
    ///
    /// # Panics
    /// If the node has no output of this name.
    pub fn components(&self, output: &str) -> &[f64] {
        match self.outputs.iter().position(|name| name == output) {
            Some(index) => self.at(index),
            None => panic!("there is no output `{output}`"),
        }
    }

    /// The names of the outputs, members of a family included, in the order of what [`run`](Self::run) returns.
    pub fn outputs(&self) -> &[String] {
        &self.outputs
    }

    fn at(&self, output: usize) -> &[f64] {
        let Placing { start, width } = self.wires.outputs[output];
        let first = (self.wires.out.start + start) as usize;
        &self.memory.all()[first..][..self.tick.frames * width as usize]
    }

    /// Runs the node over whole signals, in blocks of [`MAX_FRAMES`]. Returns the components of every output.
    pub fn run(&mut self, inputs: &[&[f64]]) -> Vec<Vec<f64>> {
        self.run_in_blocks(inputs, &[MAX_FRAMES])
    }

    /// Like [`run`](Self::run), in blocks of the given sizes, which are repeated.
    pub fn run_in_blocks(&mut self, inputs: &[&[f64]], blocks: &[usize]) -> Vec<Vec<f64>> {
        let first = self.wires.inputs.iter().zip(inputs);
        let frames = first
            .filter(|(wire, _)| wire.form != Form::Absent)
            .map(|(wire, components)| components.len() / wire.width as usize)
            .next();
        self.run_frames(frames.unwrap_or(0), inputs, blocks)
    }

    /// Runs a source for a number of frames.
    pub fn run_source(&mut self, frames: usize) -> Vec<Vec<f64>> {
        self.run_frames(frames, &[], &[MAX_FRAMES])
    }

    /// Runs the node for a number of frames in blocks of the given sizes, which are repeated.
    pub fn run_frames(&mut self, frames: usize, inputs: &[&[f64]], blocks: &[usize]) -> Vec<Vec<f64>> {
        let mut outputs = vec![Vec::new(); self.wires.outputs.len()];
        let (mut done, mut blocks) = (0, blocks.iter().copied().cycle());
        while done < frames {
            let block = blocks.next().unwrap_or(MAX_FRAMES).min(frames - done);
            let parts: Vec<&[f64]> = self
                .wires
                .inputs
                .iter()
                .zip(inputs)
                .map(|(wire, components)| match wire.form {
                    Form::Absent => &[][..],
                    _ => &components[done * wire.width as usize..][..block * wire.width as usize],
                })
                .collect();
            self.load(&parts, block);
            self.step();
            for (output, all) in outputs.iter_mut().enumerate() {
                all.extend_from_slice(self.at(output));
            }
            done += block;
        }
        outputs
    }

    /// Sets the clock to that of another bench.
    pub fn skip_to(&mut self, other: &Self) {
        self.tick = other.tick;
    }

    /// The kind connected to each input; `None` if there is none.
    pub fn kinds(&self) -> &[Option<Kind>] {
        &self.kinds
    }

    /// Sets a live setting, as [`Processor::set`](crate::node::Processor::set) gets it: in SI.
    pub fn set(&mut self, setting: impl Into<SettingId>, value: f64) {
        self.processor.set(setting.into(), value);
    }

    /// Copies the node's state into the one that replaces it, as
    /// [`Processor::copy_state_into`](crate::node::Processor::copy_state_into) does; nothing where that has another type.
    pub fn copy_state_into(&self, new: &mut Self) {
        self.processor.copy_state_into(&mut *new.processor);
    }

    /// The node's delay.
    pub fn latency(&self) -> Latency {
        self.processor.latency()
    }

    /// End of the data that the node plays.
    pub fn data_end(&self) -> Option<DataEnd> {
        self.processor.data_end()
    }
}

/// The port of each connection: one that takes several as often as it is connected.
fn ports(spec: &NodeSpec, connections: usize) -> Vec<&InputSpec> {
    (0..connections).filter_map(|i| spec.inputs.get(i).or(spec.inputs.last())).collect()
}

fn context(spec: &NodeSpec, rate_hz: f64, inputs: &[Option<Kind>]) -> BuildContext {
    let single = spec.inputs.iter().filter(|port| !port.presence.is_several());
    let connections = inputs.len().max(single.count());
    let kind = |i: usize| inputs.get(i).copied().flatten();
    bare_context(rate_hz).connected(&(0..connections).map(kind).collect::<Vec<_>>())
}

fn bare_context(rate_hz: f64) -> BuildContext {
    let rate = Rate::parse(&format!("{rate_hz}")).unwrap_or_else(|error| panic!("{error}"));
    BuildContext::new("bench", rate)
}

fn write_runs(buffer: &mut [f64], components: &[f64], width: usize) {
    let (mut runs, mut previous) = (0, &[][..]);
    for (start, frame) in components.chunks_exact(width).enumerate() {
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        if runs == 0 || !frame.iter().zip(previous).all(same) {
            let run = &mut buffer[1 + runs * (width + 1)..][..width + 1];
            run[0] = start as f64;
            run[1..].copy_from_slice(frame);
            runs += 1;
        }
        previous = frame;
    }
    buffer[0] = runs as f64;
}
