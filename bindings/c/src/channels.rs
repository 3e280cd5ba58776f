//! Handles of channels. The shape is checked when the handle is made; each call checks its number of values against it.

use crate::border::{
    HAPTOGRAPH_MODEL as MODEL, HAPTOGRAPH_SCALAR as SCALAR, HAPTOGRAPH_VECTOR as VECTOR,
    HAPTOGRAPH_WRENCH as WRENCH, Status,
};
use crate::failure::Failure;
use haptograph_engine::frame::Kind;
use haptograph_engine::graph::Graph;
use haptograph_engine::host::{AnyInput, AnyOutput, Full, Scalar, Vector, Wrench};
use haptograph_engine::run::Session;
use haptograph_nodes::texture::Model;
use std::mem::MaybeUninit;

const _: () = assert!(
    SCALAR as usize == Kind::SCALAR.width()
        && VECTOR as usize == Kind::VECTOR.width()
        && WRENCH as usize == Kind::WRENCH.width()
        && MODEL as usize == Model::WIDTH
);

/// The tick at which a value written to an input takes effect.
#[derive(Clone, Copy)]
pub(crate) enum FrameTime {
    /// The next tick.
    Now,
    /// The first tick at or after this time of the run, s.
    At(f64),
    /// The next tick without a frame.
    Next,
}

/// A number of the caller's memory; any bits of it are one.
pub(crate) trait Sample: Copy + Into<f64> {
    /// The nearest number of this type.
    fn of(value: f64) -> Self;
}

impl Sample for f64 {
    fn of(value: f64) -> Self {
        value
    }
}

impl Sample for f32 {
    fn of(value: f64) -> Self {
        value as Self
    }
}

/// Most components of a frame.
const WIDTH: usize = MODEL as usize;

/// Writes frames in order; returns the number written, and the error that stopped the rest. Real-time.
pub(crate) fn write<T: Sample>(
    input: &mut AnyInput,
    time: FrameTime,
    values: &[T],
) -> (usize, Result<(), Status>) {
    let width = input.kind().width();
    if values.is_empty() || !values.len().is_multiple_of(width) {
        return (0, Err(Status::Shape));
    }
    let mut given = 0;
    for frame in values.chunks_exact(width) {
        let mut components = [0.0; WIDTH];
        components.iter_mut().zip(frame).for_each(|(component, value)| *component = (*value).into());
        let frame = &components[..width.min(WIDTH)];
        let put: Result<(), Full> = match time {
            FrameTime::Now => input.set(frame),
            FrameTime::At(seconds) => input.set_at(seconds, frame),
            FrameTime::Next => input.push(frame),
        };
        match put {
            Ok(()) => given += 1,
            Err(full) => return (given, Err(full.into())),
        }
    }
    (given, Ok(()))
}

/// Fills `values` with frames, then with zeros; returns the number of frames. Real-time.
pub(crate) fn read<T: Sample>(
    output: &mut AnyOutput,
    values: &mut [MaybeUninit<T>],
) -> Result<usize, Status> {
    let width = output.kind().width();
    if !values.len().is_multiple_of(width) {
        return Err(Status::Shape);
    }
    let mut count = 0;
    for values in values.chunks_exact_mut(width) {
        let mut room = [0.0; WIDTH];
        let lanes = room.get_mut(..width).ok_or(Status::Shape)?;
        count += usize::from(output.take(lanes));
        values.iter_mut().zip(lanes).for_each(|(value, lane)| {
            value.write(T::of(*lane));
        });
    }
    Ok(count)
}

fn no_shape<R>(components: u32) -> Result<R, Failure> {
    let message = format_args!(
        "`components` must be 1 (scalar), 3 (vector), 6 (wrench) or 33 (model), not {components}"
    );
    Err(Failure::new(Status::Shape, message))
}

/// Opens an input of a graph whose frames have `components` components.
pub(crate) fn input(graph: &Graph, name: &str, components: u32) -> Result<AnyInput, Failure> {
    Ok(match components {
        SCALAR => graph.input::<Scalar>(name)?.into_any(),
        VECTOR => graph.input::<Vector>(name)?.into_any(),
        WRENCH => graph.input::<Wrench>(name)?.into_any(),
        MODEL => graph.input::<Model>(name)?.into_any(),
        other => return no_shape(other),
    })
}

/// Opens an output of a graph whose frames have `components` components.
pub(crate) fn output(graph: &Graph, name: &str, components: u32) -> Result<AnyOutput, Failure> {
    Ok(match components {
        SCALAR => graph.output::<Scalar>(name)?.into_any(),
        VECTOR => graph.output::<Vector>(name)?.into_any(),
        WRENCH => graph.output::<Wrench>(name)?.into_any(),
        other => return no_shape(other),
    })
}

/// Opens the output of a probe.
pub(crate) fn probe(session: &mut Session, name: &str, components: u32) -> Result<AnyOutput, Failure> {
    Ok(match components {
        SCALAR => session.probe::<Scalar>(name)?.into_any(),
        VECTOR => session.probe::<Vector>(name)?.into_any(),
        WRENCH => session.probe::<Wrench>(name)?.into_any(),
        other => return no_shape(other),
    })
}
