//! Players.

use super::memory::{self, OutPointer};
use super::{Change, Graph, Outcome, Output, PlayOptions, Player, Setting, State, Status, channel};
use crate::failure::{Failure, guard, guard_realtime};
use crate::players::{self, PlayRequest};
use crate::table::{self, Entry, ObjectKind};
use std::ffi::c_char;

/// # Safety
/// The lists and texts in `options` are as the header says.
unsafe fn request<'a>(options: &PlayOptions) -> Result<PlayRequest<'a>, Failure> {
    let folder = (!options.folder.is_null())
        // SAFETY: the condition of this function; so it is below.
        .then(|| unsafe { memory::path("folder", options.folder) })
        .transpose()?;
    // SAFETY: as above.
    let probes = unsafe { memory::texts("probes", options.probes, options.probe_count)? };
    Ok(PlayRequest {
        rested: options.rested != 0,
        folder: folder.map(Into::into),
        probes,
        block: options.block as usize,
        seconds: options.seconds,
    })
}

/// Opens a run of a graph with one driver. Inputs and outputs can be opened before or after. Values set before the first
/// call of haptograph_player_process() apply from the first frame on. The caller ends the player with
/// haptograph_player_finish(); it outlives the graph. A graph has one player at a time. `options`: null for the defaults.
/// Any thread; not real-time.
///
/// # Safety
/// Every pointer that is not null points to what its type says, texts end with 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_player_open(
    graph: Graph,
    options: *const PlayOptions,
    player: *mut Player,
) -> Status {
    guard(|| {
        // SAFETY: what the header asks of each pointer; so it is below.
        let out = unsafe { OutPointer::required(player)? };
        // SAFETY: as above.
        let request = unsafe { request(&memory::options(options)?)? };
        let id = table::graph(graph.id, |graph| players::open(graph, request))?;
        out.write(Player { id });
        Ok(())
    })
}

/// Runs `frames` frames of the graph's driver, at most 2^25. Nodes read the inputs at the ticks at which they are due;
/// outputs and probes contain their frames afterwards. One thread at a time; real-time.
///
/// HAPTOGRAPH_STATUS_ENDED: the run is over; its outputs have no further frames. HAPTOGRAPH_STATUS_BUSY: another thread is
/// processing or freeing this player; no frame was run.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_player_process(player: Player, frames: usize) -> Status {
    guard_realtime(|| table::player(player.id, |player| player.process(frames)))
}

/// Returns the state after the last call of haptograph_player_process() and the number of frames run; each pointer may be
/// null. Any thread, also while another processes; real-time.
///
/// # Safety
/// Each pointer is null or of room for what its type says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_player_state(
    player: Player,
    state: *mut State,
    frames: *mut u64,
) -> Status {
    guard_realtime(|| {
        // SAFETY: what the header asks of each pointer.
        let (state, count) = unsafe { (OutPointer::optional(state)?, OutPointer::optional(frames)?) };
        table::player(player.id, |player| {
            state.write(player.state());
            count.write(player.frames());
            Ok(())
        })
    })
}

/// Opens the output of a probe in the player's options, from the first frame on, or of one that haptograph_player_change() named;
/// possible once for each probe. The caller
/// frees it with haptograph_output_free(). Not while another thread processes; not real-time.
///
/// # Safety
/// `name` is null or a text that ends with 0; `output` is null or of room for a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_player_probe(
    player: Player,
    name: *const c_char,
    components: u32,
    output: *mut Output,
) -> Status {
    guard(|| {
        // SAFETY: what the header asks of each pointer; so it is below.
        let out = unsafe { OutPointer::required(output)? };
        // SAFETY: as above.
        let name = unsafe { memory::text("name", name)? };
        let made = table::player(player.id, |player| player.probe(name, components))?;
        out.write(channel::insert(made)?);
        Ok(())
    })
}

/// Replaces the graph of a run without a click, from the next frames of haptograph_player_process() on. Nodes that both graphs
/// have keep their state; settings that were set keep their values unless the graph changes them. Files go on, and new ones are
/// begun in the player's folder. A later change waits for the fades of an earlier one. In a cross-fade both graphs run frame by
/// frame for 10 ms, in which haptograph_player_process() takes about 13 times as long.
///
/// An endpoint that both graphs have, with the same channels and clock, continues with its inputs and outputs: keep them. Those of
/// other endpoints are opened from `graph`, before or after this call; old ones stay valid handles, but are no longer read or
/// written. Settings are found again by name. `probes`: the outputs to probe from now on, as in haptograph_play_options; a probe
/// of the running graph that is among them keeps its output, other probes end. `change`: how the graph was replaced, or null.
///
/// HAPTOGRAPH_STATUS_GRAPH: the graph cannot replace the running one: its driver has another rate, it has several drivers or a
/// script. HAPTOGRAPH_STATUS_TAKEN: an input or output of `graph` is open whose endpoint continues, or another player runs it.
/// HAPTOGRAPH_STATUS_SYSTEM: a file cannot be written. After any failure the running graph continues. The player uses both graphs
/// until haptograph_player_finish(), and outlives them. Any thread, also while another processes; not real-time.
///
/// # Safety
/// `probes` is null or of `probe_count` texts that end with 0; `change` is null or of room for one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_player_change(
    player: Player,
    graph: Graph,
    probes: *const *const c_char,
    probe_count: usize,
    change: *mut Change,
) -> Status {
    guard(|| {
        // SAFETY: what the header asks of each pointer; so it is below.
        let out = unsafe { OutPointer::optional(change)? };
        // SAFETY: as above.
        let probes = unsafe { memory::texts("probes", probes, probe_count)? };
        let changed =
            table::player(player.id, |player| table::graph(graph.id, |graph| player.change(graph, &probes)))?;
        out.write(changed);
        Ok(())
    })
}

/// Sets a live setting by name, "out.gain"; the value ramps in 20 ms. Any thread, also while another processes; not
/// real-time.
///
/// # Safety
/// `name` is null or a text that ends with 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_player_set(player: Player, name: *const c_char, value: f64) -> Status {
    guard(|| {
        // SAFETY: what the header asks of it.
        let name = unsafe { memory::text("name", name)? };
        table::player(player.id, |player| player.set(name, value))
    })
}

/// Finds a live setting by name; after haptograph_player_change() it is the setting of that name of the new graph. The caller
/// frees it with haptograph_setting_free(). Any thread, also while another processes; not real-time.
///
/// # Safety
/// `name` is null or a text that ends with 0; `setting` is null or of room for a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_player_setting(
    player: Player,
    name: *const c_char,
    setting: *mut Setting,
) -> Status {
    guard(|| {
        // SAFETY: what the header asks of each pointer; so it is below.
        let out = unsafe { OutPointer::required(setting)? };
        // SAFETY: as above.
        let name = unsafe { memory::text("name", name)? };
        let found = table::player(player.id, |entry| entry.setting(player.id, name))?;
        let id = table::insert(Entry::Setting(Box::new(found)))?;
        out.write(Setting { id });
        Ok(())
    })
}

/// Sets a live setting; the value ramps in 20 ms. HAPTOGRAPH_STATUS_BUSY: another thread uses a setting of this player, or
/// changes its graph; try again. Any thread, also while another processes; real-time.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_setting_set(setting: Setting, value: f64) -> Status {
    guard_realtime(|| {
        table::with(setting.id, |entry| match entry {
            Entry::Setting(setting) => setting.set(value),
            _ => Err(Status::Kind),
        })
    })
}

/// Frees a setting. Any thread; not real-time.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_setting_free(setting: Setting) -> Status {
    guard(|| table::free(setting.id, ObjectKind::Setting))
}

/// Ends the run: its outputs fade out in 10 ms, from the next call of haptograph_player_process() on. Any thread, also
/// while another processes; real-time.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_player_stop(player: Player) -> Status {
    guard_realtime(|| {
        table::player(player.id, |player| {
            player.stop();
            Ok(())
        })
    })
}

/// Ends a run, completes its files and frees the player. `outcome`: its outcome, or null. Not while another thread uses
/// the player (HAPTOGRAPH_STATUS_BUSY, without effect); not real-time. HAPTOGRAPH_STATUS_SYSTEM: a file could not be
/// written; the player is freed nevertheless.
///
/// # Safety
/// `outcome` is null or of room for one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_player_finish(player: Player, outcome: *mut Outcome) -> Status {
    guard(|| {
        // SAFETY: what the header asks of it.
        let out = unsafe { OutPointer::optional(outcome)? };
        let Entry::Player(player) = table::take(player.id, ObjectKind::Player)? else {
            return Err(Status::Kind.into());
        };
        let (outcome, ended) = player.finish();
        out.write(outcome);
        ended
    })
}
