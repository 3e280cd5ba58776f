//! Handles of channels: their shape is checked where they are made, and each call's number of values against it.

use crate::border::{
    HAPTOGRAPH_SCALAR as SCALAR, HAPTOGRAPH_VECTOR as VECTOR, HAPTOGRAPH_WRENCH as WRENCH, Status,
};
use crate::failure::Failure;
use haptograph_engine::frame::Kind;
use haptograph_engine::graph::Graph;
use haptograph_engine::host::{Full, HostError, HostFrame, Input, Output, Player, Scalar, Vector, Wrench};
use haptograph_signal::time::Rate;
use std::mem::MaybeUninit;

/// When what is given to an input takes effect.
#[derive(Clone, Copy)]
pub enum When {
    /// At the next tick.
    Now,
    /// At this time of the run, s.
    At(f64),
    /// At a tick of its own.
    Next,
}

/// An input of any shape.
pub trait AnyInput: Send {
    /// Gives frames, one after the other; says how many found room, and what stopped the others.
    fn give(&mut self, when: When, values: &[f64]) -> (usize, Result<(), Status>);
    fn waiting(&self) -> usize;
    fn components(&self) -> usize;
    fn rate(&self) -> Rate;
}

impl<V: HostFrame> AnyInput for Input<V> {
    fn give(&mut self, when: When, values: &[f64]) -> (usize, Result<(), Status>) {
        let width = V::KIND.width();
        if values.is_empty() || !values.len().is_multiple_of(width) {
            return (0, Err(Status::Shape));
        }
        let mut given = 0;
        for values in values.chunks_exact(width) {
            let mut frame = V::default();
            frame.lanes_mut().copy_from_slice(values);
            let put: Result<(), Full> = match when {
                When::Now => self.set(frame),
                When::At(seconds) => self.set_at(seconds, frame),
                When::Next => self.push(frame),
            };
            match put {
                Ok(()) => given += 1,
                Err(full) => return (given, Err(full.into())),
            }
        }
        (given, Ok(()))
    }

    fn waiting(&self) -> usize {
        Self::waiting(self)
    }

    fn components(&self) -> usize {
        V::KIND.width()
    }

    fn rate(&self) -> Rate {
        Self::rate(self)
    }
}

/// An output of any shape.
pub trait AnyOutput: Send {
    /// Fills all of `values`, with zeros where there are no more frames; says how many frames there were.
    fn read(&mut self, values: &mut [MaybeUninit<f64>]) -> Result<usize, Status>;
    fn waiting(&self) -> usize;
    fn components(&self) -> usize;
    fn rate(&self) -> Rate;
}

impl<V: HostFrame> AnyOutput for Output<V> {
    fn read(&mut self, values: &mut [MaybeUninit<f64>]) -> Result<usize, Status> {
        let width = V::KIND.width();
        if !values.len().is_multiple_of(width) {
            return Err(Status::Shape);
        }
        let mut count = 0;
        for values in values.chunks_exact_mut(width) {
            let frame = self.take();
            count += usize::from(frame.is_some());
            let frame = frame.unwrap_or_default();
            values.iter_mut().zip(frame.lanes()).for_each(|(value, lane)| {
                value.write(*lane);
            });
        }
        Ok(count)
    }

    fn waiting(&self) -> usize {
        Self::waiting(self)
    }

    fn components(&self) -> usize {
        V::KIND.width()
    }

    fn rate(&self) -> Rate {
        Self::rate(self)
    }
}

const _: () = assert!(
    SCALAR as usize == Kind::Scalar.width()
        && VECTOR as usize == Kind::Vector.width()
        && WRENCH as usize == Kind::Wrench.width()
);

fn no_shape(components: u32) -> Failure {
    let message =
        format_args!("a channel has 1 (scalar), 3 (vector) or 6 (wrench) components, not {components}");
    Failure::new(Status::Shape, message)
}

fn boxed_input<V: HostFrame>(made: Result<Input<V>, HostError>) -> Result<Box<dyn AnyInput>, Failure> {
    Ok(Box::new(made?))
}

/// The input of a graph with frames of so many components.
pub fn input(graph: &Graph, name: &str, components: u32) -> Result<Box<dyn AnyInput>, Failure> {
    match components {
        SCALAR => boxed_input(graph.input::<Scalar>(name)),
        VECTOR => boxed_input(graph.input::<Vector>(name)),
        WRENCH => boxed_input(graph.input::<Wrench>(name)),
        other => Err(no_shape(other)),
    }
}

fn boxed_output<V: HostFrame>(made: Result<Output<V>, HostError>) -> Result<Box<dyn AnyOutput>, Failure> {
    Ok(Box::new(made?))
}

/// The output of a graph with frames of so many components.
pub fn output(graph: &Graph, name: &str, components: u32) -> Result<Box<dyn AnyOutput>, Failure> {
    match components {
        SCALAR => boxed_output(graph.output::<Scalar>(name)),
        VECTOR => boxed_output(graph.output::<Vector>(name)),
        WRENCH => boxed_output(graph.output::<Wrench>(name)),
        other => Err(no_shape(other)),
    }
}

/// The frames of a probe.
pub fn probe(player: &mut Player, name: &str, components: u32) -> Result<Box<dyn AnyOutput>, Failure> {
    match components {
        SCALAR => boxed_output(player.probe::<Scalar>(name)),
        VECTOR => boxed_output(player.probe::<Vector>(name)),
        WRENCH => boxed_output(player.probe::<Wrench>(name)),
        other => Err(no_shape(other)),
    }
}
