//! Players.

use super::memory::{self, Answer};
use super::{Graph, Outcome, Output, PlayOptions, Player, Setting, State, Status, channel};
use crate::failure::{Failure, guard, guard_realtime};
use crate::players::{self, Wanted};
use crate::table::{self, Entry, What};
use std::ffi::c_char;

/// # Safety
/// The lists and texts in `options` are as the header says.
unsafe fn wanted<'a>(options: &PlayOptions) -> Result<Wanted<'a>, Failure> {
    let folder = (!options.folder.is_null())
        // SAFETY: the condition of this function; so it is below.
        .then(|| unsafe { memory::path("folder", options.folder) })
        .transpose()?;
    // SAFETY: as above.
    let probes = unsafe { memory::texts("probes", options.probes, options.probe_count)? };
    Ok(Wanted {
        rested: options.rested != 0,
        folder: folder.map(Into::into),
        probes,
        block: options.block as usize,
        seconds: options.seconds,
    })
}

/// Opens a run of a graph with one driver. Look up inputs and outputs before or after; what is set before the first call
/// of haptograph_player_process() counts from the first frame on. The player is the caller's, to be ended by
/// haptograph_player_finish(), and outlives the graph. A graph has one player at a time. `options`: null for none. Any
/// thread; not real-time.
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
        let answer = unsafe { Answer::to(player)? };
        // SAFETY: as above.
        let wanted = unsafe { wanted(&memory::options(options)?)? };
        let id = table::graph(graph.id, |graph| players::open(graph, wanted))?;
        answer.write(Player { id });
        Ok(())
    })
}

/// Runs `frames` frames of the graph's driver, at most 2^25. What has been given to the inputs is taken at the ticks that
/// it is due at; outputs and probes have their frames afterwards. Call it from one thread at a time; real-time.
///
/// HAPTOGRAPH_STATUS_ENDED: the run is over, and its outputs got zeros. HAPTOGRAPH_STATUS_BUSY: another thread processes
/// or frees this player, and nothing was run.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_player_process(player: Player, frames: usize) -> Status {
    guard_realtime(|| table::player(player.id, |player| player.process(frames)))
}

/// What the run is doing after the last call of haptograph_player_process(), and how many frames it has run; each may be
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
        let (state, count) = unsafe { (Answer::maybe_to(state)?, Answer::maybe_to(frames)?) };
        table::player(player.id, |player| {
            state.write(player.state());
            count.write(player.frames());
            Ok(())
        })
    })
}

/// The frames of a probe that HAPTOGRAPH_PLAY_OPTIONS asked for, from the first on; given out once. The output is the
/// caller's, to be freed by haptograph_output_free(). Not while another thread processes; not real-time.
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
        let answer = unsafe { Answer::to(output)? };
        // SAFETY: as above.
        let name = unsafe { memory::text("name", name)? };
        let made = table::player(player.id, |player| player.probe(name, components));
        answer.write(channel::insert(made)?);
        Ok(())
    })
}

/// Sets a live setting by its name, "out.gain"; it glides there in 20 ms. Any thread, also while another processes; not
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

/// Looks a live setting up by its name. The setting is the caller's, to be freed by haptograph_setting_free(). Any
/// thread, also while another processes; not real-time.
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
        let answer = unsafe { Answer::to(setting)? };
        // SAFETY: as above.
        let name = unsafe { memory::text("name", name)? };
        let found = table::player(player.id, |entry| entry.setting(player.id, name))?;
        let id = table::insert(Entry::Setting(found))?;
        answer.write(Setting { id });
        Ok(())
    })
}

/// Sets a live setting; it glides there in 20 ms. HAPTOGRAPH_STATUS_BUSY: another thread sets one of this player; try
/// again. Any thread, also while another processes; real-time.
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
    guard(|| table::free(setting.id, What::Setting))
}

/// Lets the outputs fade out in 10 ms, from the next call of haptograph_player_process() on; then the run has ended. Any
/// thread, also while another processes; real-time.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_player_stop(player: Player) -> Status {
    guard_realtime(|| {
        table::player(player.id, |player| {
            player.stop();
            Ok(())
        })
    })
}

/// Ends a run, completes its files and frees the player. `outcome`: what it did, or null. Not while another thread is
/// inside (HAPTOGRAPH_STATUS_BUSY: nothing was done); not real-time. HAPTOGRAPH_STATUS_SYSTEM: a file could not be
/// written; the player is freed all the same.
///
/// # Safety
/// `outcome` is null or of room for one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_player_finish(player: Player, outcome: *mut Outcome) -> Status {
    guard(|| {
        // SAFETY: what the header asks of it.
        let answer = unsafe { Answer::maybe_to(outcome)? };
        let Entry::Player(player) = table::take(player.id, What::Player)? else {
            return Err(Status::Kind.into());
        };
        let (outcome, ended) = player.finish();
        answer.write(outcome);
        ended
    })
}
