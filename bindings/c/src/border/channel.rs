//! Inputs and outputs.

use super::memory::{self, Answer};
use super::{Graph, Input, Output, Status};
use crate::channels::{self, When};
use crate::failure::{Failure, guard, guard_realtime};
use crate::table::{self, Entry, What};
use haptograph_engine::host::AnyOutput;
use std::ffi::c_char;
use std::sync::Mutex;

/// Gives the caller's end of a channel that nodes read: "stylus.position", or "hand" where that endpoint has one channel.
/// `components`: HAPTOGRAPH_SCALAR, HAPTOGRAPH_VECTOR or HAPTOGRAPH_WRENCH; another shape than the channel's is an error.
/// The input is the caller's, to be freed by haptograph_input_free(), and outlives the graph. Any thread; not real-time.
///
/// # Safety
/// `name` is null or a text that ends with 0; `input` is null or of room for a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_graph_input(
    graph: Graph,
    name: *const c_char,
    components: u32,
    input: *mut Input,
) -> Status {
    guard(|| {
        // SAFETY: what the header asks of each pointer; so it is below.
        let answer = unsafe { Answer::to(input)? };
        // SAFETY: as above.
        let name = unsafe { memory::text("name", name)? };
        let made = table::graph(graph.id, |graph| channels::input(graph, name, components))?;
        let id = table::insert(Entry::Input(Box::new(Mutex::new(made))))?;
        answer.write(Input { id });
        Ok(())
    })
}

/// Gives the caller's end of a channel that nodes drive; what it gets has passed the sink's limits. As
/// haptograph_graph_input() otherwise.
///
/// # Safety
/// As of haptograph_graph_input.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_graph_output(
    graph: Graph,
    name: *const c_char,
    components: u32,
    output: *mut Output,
) -> Status {
    guard(|| {
        // SAFETY: what the header asks of each pointer; so it is below.
        let answer = unsafe { Answer::to(output)? };
        // SAFETY: as above.
        let name = unsafe { memory::text("name", name)? };
        let made = table::graph(graph.id, |graph| channels::output(graph, name, components))?;
        let id = table::insert(Entry::Output(Box::new(Mutex::new(made))))?;
        answer.write(Output { id });
        Ok(())
    })
}

/// Frees an input. Any thread; not real-time.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_input_free(input: Input) -> Status {
    guard(|| table::free(input.id, What::Input))
}

/// Frees an output. Any thread; not real-time.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_output_free(output: Output) -> Status {
    guard(|| table::free(output.id, What::Output))
}

/// From its next tick on the channel has this value. `length`: how many numbers, the components of the channel or whole
/// frames of them, of which the last counts. One thread at a time; real-time.
///
/// # Safety
/// `values` is null or of `length` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_input_set(input: Input, values: *const f64, length: usize) -> Status {
    guard_realtime(|| {
        // SAFETY: what the header asks of it.
        let values = unsafe { memory::values(values, length)? };
        table::input(input.id, |input| channels::give(input, When::Now, values).1)
    })
}

/// The same from `seconds` of the run on, at the first tick at or after that time. Values come in the order of their
/// times. One thread at a time; real-time.
///
/// # Safety
/// As of haptograph_input_set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_input_set_at(
    input: Input,
    seconds: f64,
    values: *const f64,
    length: usize,
) -> Status {
    guard_realtime(|| {
        // SAFETY: what the header asks of it.
        let values = unsafe { memory::values(values, length)? };
        table::input(input.id, |input| {
            channels::give(input, When::At(seconds), values).1
        })
    })
}

/// Frames for the next ticks that have none yet: a signal. `length`: how many numbers, whole frames. `pushed`: how many
/// frames found room, also where the call ends in HAPTOGRAPH_STATUS_FULL or HAPTOGRAPH_STATUS_NOT_FINITE; or null. One
/// thread at a time; real-time.
///
/// # Safety
/// `values` is null or of `length` numbers; `pushed` is null or of room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_input_push(
    input: Input,
    values: *const f64,
    length: usize,
    pushed: *mut usize,
) -> Status {
    guard_realtime(|| {
        // SAFETY: what the header asks of each pointer; so it is below.
        let answer = unsafe { Answer::maybe_to(pushed)? };
        answer.write(0);
        // SAFETY: as above.
        let values = unsafe { memory::values(values, length)? };
        table::input(input.id, |input| {
            let (count, ended) = channels::give(input, When::Next, values);
            answer.write(count);
            ended
        })
    })
}

/// Fills all of `values` with the oldest frames that were not read, and with zeros where there are no more. `length`: for
/// how many numbers there is room, whole frames. `read`: how many frames there were, or null. One thread at a time;
/// real-time.
///
/// # Safety
/// `values` is null or of room for `length` numbers; `read` is null or of room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_output_read(
    output: Output,
    values: *mut f64,
    length: usize,
    read: *mut usize,
) -> Status {
    guard_realtime(|| {
        // SAFETY: what the header asks of each pointer; so it is below.
        let answer = unsafe { Answer::maybe_to(read)? };
        answer.write(0);
        // SAFETY: as above.
        let values = unsafe { memory::room(values, length)? };
        table::output(output.id, |output| channels::read(output, values)).map(|count| answer.write(count))
    })
}

/// What is known of a channel's handle: its components, the rate of its ticks (Hz) and the frames that wait in it; each
/// may be null. One thread at a time; real-time.
///
/// # Safety
/// Each pointer is null or of room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_input_about(
    input: Input,
    components: *mut u32,
    rate_hz: *mut f64,
    waiting: *mut usize,
) -> Status {
    guard_realtime(|| {
        // SAFETY: what the header asks of each pointer.
        let about = unsafe { About::to(components, rate_hz, waiting)? };
        let found = table::input(input.id, |input| {
            Ok((input.kind().width(), input.rate().hz(), input.waiting()))
        })?;
        about.write(found);
        Ok(())
    })
}

/// As haptograph_input_about().
///
/// # Safety
/// As of haptograph_input_about.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_output_about(
    output: Output,
    components: *mut u32,
    rate_hz: *mut f64,
    waiting: *mut usize,
) -> Status {
    guard_realtime(|| {
        // SAFETY: what the header asks of each pointer.
        let about = unsafe { About::to(components, rate_hz, waiting)? };
        let found = table::output(output.id, |output| {
            Ok((output.kind().width(), output.rate().hz(), output.waiting()))
        })?;
        about.write(found);
        Ok(())
    })
}

struct About(Answer<u32>, Answer<f64>, Answer<usize>);

impl About {
    /// # Safety
    /// Each pointer is null or of room for a number that nobody else uses until the answers are written.
    unsafe fn to(components: *mut u32, rate_hz: *mut f64, waiting: *mut usize) -> Result<Self, Status> {
        // SAFETY: the condition of this function, for all three.
        let to = unsafe {
            (
                Answer::maybe_to(components)?,
                Answer::maybe_to(rate_hz)?,
                Answer::maybe_to(waiting)?,
            )
        };
        Ok(Self(to.0, to.1, to.2))
    }

    fn write(&self, (components, rate_hz, waiting): (usize, f64, usize)) {
        self.0.write(components as u32);
        self.1.write(rate_hz);
        self.2.write(waiting);
    }
}

/// For probes, which come from a player.
pub(super) fn insert(made: Result<AnyOutput, Failure>) -> Result<Output, Failure> {
    let id = table::insert(Entry::Output(Box::new(Mutex::new(made?))))?;
    Ok(Output { id })
}
