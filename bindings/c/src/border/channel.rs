//! Inputs and outputs.

use super::memory::{self, OutPointer};
use super::{Graph, Input, Output, Status};
use crate::channels::{self, FrameTime, Sample};
use crate::failure::{Failure, guard, guard_realtime};
use crate::table::{self, Entry, ObjectKind};
use haptograph_engine::host::AnyOutput;
use std::ffi::c_char;
use std::sync::Mutex;

/// Opens an input: the caller's end of a channel that nodes read, "stylus.position", or "hand" if that endpoint has one
/// channel. `components`: HAPTOGRAPH_SCALAR, HAPTOGRAPH_VECTOR, HAPTOGRAPH_WRENCH, or of inputs HAPTOGRAPH_MODEL; it must be
/// the shape of the channel.
/// The caller frees the input with haptograph_input_free(); it outlives the graph. Any thread; not real-time.
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
        let out = unsafe { OutPointer::required(input)? };
        // SAFETY: as above.
        let name = unsafe { memory::text("name", name)? };
        let made = table::graph(graph.id, |graph| channels::input(graph, name, components))?;
        let id = table::insert(Entry::Input(Box::new(Mutex::new(made))))?;
        out.write(Input { id });
        Ok(())
    })
}

/// Opens an output: the caller's end of a channel that nodes write. Its frames have passed the sink's limits. Otherwise
/// like haptograph_graph_input().
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
        let out = unsafe { OutPointer::required(output)? };
        // SAFETY: as above.
        let name = unsafe { memory::text("name", name)? };
        let made = table::graph(graph.id, |graph| channels::output(graph, name, components))?;
        out.write(insert(made)?);
        Ok(())
    })
}

/// Frees an input. Any thread; not real-time.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_input_free(input: Input) -> Status {
    guard(|| table::free(input.id, ObjectKind::Input))
}

/// Frees an output. Any thread; not real-time.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_output_free(output: Output) -> Status {
    guard(|| table::free(output.id, ObjectKind::Output))
}

/// Sets the value of the channel from its next tick on. `length`: number of values, the components of one frame or of
/// several frames, of which the last one is used. One thread at a time; real-time.
///
/// # Safety
/// `values` is null or of `length` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_input_set(input: Input, values: *const f64, length: usize) -> Status {
    guard_realtime(|| {
        // SAFETY: what the header asks of it.
        let values = unsafe { memory::values(values, length)? };
        table::input(input.id, |input| channels::write(input, FrameTime::Now, values).1)
    })
}

/// Sets the value of the channel at the first tick at or after `seconds` of the run. Times must not decrease from call to
/// call. One thread at a time; real-time.
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
        table::input(input.id, |input| channels::write(input, FrameTime::At(seconds), values).1)
    })
}

/// Queues frames of a signal, one for each of the next ticks without a frame. `length`: number of values, whole frames.
/// `pushed`: number of frames queued, also if the call returns HAPTOGRAPH_STATUS_FULL or HAPTOGRAPH_STATUS_NOT_FINITE; or
/// null. One thread at a time; real-time.
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
    // SAFETY: the condition of this function.
    guard_realtime(|| unsafe { push(input, (values, length), pushed) })
}

/// Like haptograph_input_push(), from a buffer of float, which each become the double of the same value. One thread at a time;
/// real-time.
///
/// # Safety
/// As of haptograph_input_push.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_input_push_float(
    input: Input,
    values: *const f32,
    length: usize,
    pushed: *mut usize,
) -> Status {
    // SAFETY: the condition of this function.
    guard_realtime(|| unsafe { push(input, (values, length), pushed) })
}

/// # Safety
/// `values.0` is null or of `values.1` numbers; `pushed` is null or of room for a number.
unsafe fn push<T: Sample>(input: Input, values: (*const T, usize), pushed: *mut usize) -> Result<(), Status> {
    // SAFETY: the condition of this function; so it is below.
    let out = unsafe { OutPointer::optional(pushed)? };
    out.write(0);
    // SAFETY: as above.
    let values = unsafe { memory::values(values.0, values.1)? };
    table::input(input.id, |input| {
        let (count, ended) = channels::write(input, FrameTime::Next, values);
        out.write(count);
        ended
    })
}

/// Fills `values` with the oldest unread frames, and with zeros after the last one: a loop that skipped a read reads until `read`
/// is 0. After one second unread the newest frames are lost. `length`: capacity of `values`, whole frames. `read`: number of
/// frames read, or null. One thread at a time; real-time.
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
    // SAFETY: the condition of this function.
    guard_realtime(|| unsafe { read_into(output, (values, length), read) })
}

/// Like haptograph_output_read(), into a buffer of float: each value is rounded to the nearest one, and is infinite beyond its
/// range. One thread at a time; real-time.
///
/// # Safety
/// As of haptograph_output_read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_output_read_float(
    output: Output,
    values: *mut f32,
    length: usize,
    read: *mut usize,
) -> Status {
    // SAFETY: the condition of this function.
    guard_realtime(|| unsafe { read_into(output, (values, length), read) })
}

/// # Safety
/// `values.0` is null or of room for `values.1` numbers; `read` is null or of room for a number.
unsafe fn read_into<T: Sample>(
    output: Output,
    values: (*mut T, usize),
    read: *mut usize,
) -> Result<(), Status> {
    // SAFETY: the condition of this function; so it is below.
    let out = unsafe { OutPointer::optional(read)? };
    out.write(0);
    // SAFETY: as above.
    let values = unsafe { memory::room(values.0, values.1)? };
    table::output(output.id, |output| channels::read(output, values)).map(|count| out.write(count))
}

/// Returns the components of a channel, its tick rate (Hz) and the number of queued frames; each pointer may be null. One
/// thread at a time; real-time.
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
        let info = unsafe { ChannelInfo::to(components, rate_hz, waiting)? };
        let found =
            table::input(input.id, |input| Ok((input.kind().width(), input.rate().hz(), input.waiting())))?;
        info.write(found);
        Ok(())
    })
}

/// Like haptograph_input_about().
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
        let info = unsafe { ChannelInfo::to(components, rate_hz, waiting)? };
        let found = table::output(output.id, |output| {
            Ok((output.kind().width(), output.rate().hz(), output.waiting()))
        })?;
        info.write(found);
        Ok(())
    })
}

struct ChannelInfo(OutPointer<u32>, OutPointer<f64>, OutPointer<usize>);

impl ChannelInfo {
    /// # Safety
    /// Each pointer is null or of room for a number that nobody else uses until the results are written.
    unsafe fn to(components: *mut u32, rate_hz: *mut f64, waiting: *mut usize) -> Result<Self, Status> {
        // SAFETY: the condition of this function, for all three.
        let to = unsafe {
            (
                OutPointer::optional(components)?,
                OutPointer::optional(rate_hz)?,
                OutPointer::optional(waiting)?,
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

/// Stores an output.
pub(super) fn insert(made: AnyOutput) -> Result<Output, Failure> {
    let id = table::insert(Entry::Output(Box::new(Mutex::new(made))))?;
    Ok(Output { id })
}
