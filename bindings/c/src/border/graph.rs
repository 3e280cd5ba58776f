//! Graphs.

use super::memory::{self, OutPointer};
use super::{Channel, Graph, GraphOptions, Status};
use crate::failure::{Failure, guard};
use crate::graphs::{self, Direction, GraphRequest, Text};
use crate::table::{self, ObjectKind};
use std::ffi::c_char;
use std::path::Path;

/// # Safety
/// The lists and texts in `options` are as the header says.
unsafe fn request<'a>(options: &GraphOptions) -> Result<GraphRequest<'a>, Failure> {
    // SAFETY: the condition of this function; so it is with each below.
    let set = unsafe { memory::texts("set", options.set, options.set_count)? };
    // SAFETY: as above.
    let endpoints = unsafe { memory::optional_text("endpoints", options.endpoints)? };
    let hosted = (!options.hosted.is_null())
        // SAFETY: as above.
        .then(|| unsafe { memory::texts("hosted", options.hosted, options.hosted_count) });
    Ok(GraphRequest {
        set,
        endpoints,
        hosted: hosted.transpose()?,
        seed: (options.has_seed != 0).then_some(options.seed),
    })
}

/// Reads and checks a graph file. The caller frees the graph with haptograph_graph_free(). The library keeps no pointer to
/// the arguments. Any thread; not real-time.
///
/// `path`: the file; paths in it are relative to its folder. `options`: null for the defaults. `graph`: receives the handle.
/// HAPTOGRAPH_STATUS_GRAPH: the graph has errors; haptograph_last_error_rendered() returns them.
///
/// # Safety
/// Every pointer that is not null points to what its type says, texts end with 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_graph_open(
    path: *const c_char,
    options: *const GraphOptions,
    graph: *mut Graph,
) -> Status {
    guard(|| {
        // SAFETY: what the header asks of each pointer; so it is with each below.
        let out = unsafe { OutPointer::required(graph)? };
        // SAFETY: as above.
        let path = unsafe { memory::path("path", path)? };
        // SAFETY: as above.
        let request = unsafe { request(&memory::options(options)?)? };
        let id = graphs::open(&Text::File(path), &request)?;
        out.write(Graph { id });
        Ok(())
    })
}

/// Reads and checks a graph from `length` bytes of UTF-8 text, which need not end with 0. `name`: the file name for
/// messages and relative paths; null: "graph.ron" in the working folder. Any thread; not real-time.
///
/// # Safety
/// As of haptograph_graph_open; `text` has `length` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_graph_parse(
    text: *const c_char,
    length: usize,
    name: *const c_char,
    options: *const GraphOptions,
    graph: *mut Graph,
) -> Status {
    guard(|| {
        // SAFETY: what the header asks of each pointer; so it is with each below.
        let out = unsafe { OutPointer::required(graph)? };
        // SAFETY: as above.
        let text = unsafe { memory::sized_text("text", text, length)? };
        let name = match name.is_null() {
            true => Path::new("graph.ron"),
            // SAFETY: as above.
            false => unsafe { memory::path("name", name)? },
        };
        // SAFETY: as above.
        let request = unsafe { request(&memory::options(options)?)? };
        let id = graphs::open(&Text::Memory(text, name), &request)?;
        out.write(Graph { id });
        Ok(())
    })
}

/// Frees a graph. Its inputs, outputs and players stay valid. Any thread; not real-time.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_graph_free(graph: Graph) -> Status {
    guard(|| table::free(graph.id, ObjectKind::Graph))
}

/// Returns the rate of the driver frames that haptograph_player_process() counts, Hz. Any thread; not real-time.
///
/// # Safety
/// `rate_hz` is null or of room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_graph_rate(graph: Graph, rate_hz: *mut f64) -> Status {
    guard(|| {
        // SAFETY: what the header asks of it.
        let out = unsafe { OutPointer::required(rate_hz)? };
        let rate_hz = table::graph(graph.id, |graph| Ok::<_, Failure>(graphs::rate_hz(graph)))?;
        out.write(rate_hz);
        Ok(())
    })
}

/// Copies the warnings of a graph, as printed on a terminal: at most `capacity` bytes with a final 0. `length`: the full
/// length in bytes without the 0, or null. Any thread; not real-time.
///
/// # Safety
/// `text` is null or of room for `capacity` bytes; `length` is null or of room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_graph_warnings(
    graph: Graph,
    text: *mut c_char,
    capacity: usize,
    length: *mut usize,
) -> Status {
    guard(|| {
        // SAFETY: what the header asks of it; so it is with each below.
        let out = unsafe { OutPointer::optional(length)? };
        let found = table::graph(graph.id, |graph| Ok::<_, Failure>(graphs::warnings(graph)))?;
        out.write(found.len());
        if capacity == 0 {
            return Ok(());
        }
        let cut = memory::boundary(&found, capacity - 1);
        let bytes: Vec<c_char> = found.as_bytes()[..cut].iter().map(|byte| *byte as c_char).collect();
        let ended: Vec<c_char> = bytes.into_iter().chain([0]).collect();
        // SAFETY: as above. The number is not needed.
        let discarded = unsafe { OutPointer::optional(std::ptr::null_mut())? };
        // SAFETY: as above.
        unsafe { memory::copy(&ended, (text, capacity), &discarded) }.map_err(Into::into)
    })
}

/// Copies at most `capacity` of the channels that nodes read and this program feeds. `count`: the full number, or null. Any
/// thread; not real-time.
///
/// # Safety
/// `channels` is null or of room for `capacity` of them; `count` is null or of room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_graph_inputs(
    graph: Graph,
    channels: *mut Channel,
    capacity: usize,
    count: *mut usize,
) -> Status {
    // SAFETY: the condition of this function.
    guard(|| unsafe { list(graph, Direction::In, (channels, capacity), count) })
}

/// Copies the channels that nodes write and this program reads, like haptograph_graph_inputs().
///
/// # Safety
/// As of haptograph_graph_inputs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_graph_outputs(
    graph: Graph,
    channels: *mut Channel,
    capacity: usize,
    count: *mut usize,
) -> Status {
    // SAFETY: the condition of this function.
    guard(|| unsafe { list(graph, Direction::Out, (channels, capacity), count) })
}

/// # Safety
/// `channels.0` is null or of room for `channels.1` of them; `count` is null or of room for a number.
unsafe fn list(
    graph: Graph,
    direction: Direction,
    channels: (*mut Channel, usize),
    count: *mut usize,
) -> Result<(), Failure> {
    let shown = |(name, channel): (String, haptograph_engine::device::Channel)| Channel {
        name: memory::fixed(&name),
        unit: memory::fixed(&channel.quantity.unit()),
        components: channel.kind.width() as u32,
    };
    let found = || {
        table::graph(graph.id, |graph| {
            Ok(graphs::channels(graph, direction).into_iter().map(shown).collect())
        })
    };
    // SAFETY: the condition of this function.
    unsafe { memory::list(found, channels, count) }
}
