//! Live settings and live inputs of a player.

use super::memory::{self, OutPointer};
use super::{Actuator, LiveInput, LiveSetting, Player, Setting, Status};
use crate::failure::{guard, guard_realtime};
use crate::table::{self, Entry};
use std::ffi::c_char;

/// Copies at most `capacity` of the live settings of the running graph, in the order of its nodes. `count`: the full number, or
/// null. Any thread, also while another processes; not real-time.
///
/// # Safety
/// `settings` is null or of room for `capacity` of them; `count` is null or of room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_player_settings(
    player: Player,
    settings: *mut LiveSetting,
    capacity: usize,
    count: *mut usize,
) -> Status {
    let found = || table::player(player.id, |player| player.settings());
    // SAFETY: the condition of this function.
    guard(|| unsafe { memory::list(found, (settings, capacity), count) })
}

/// Returns the value of a live setting: the one set last, or that of the graph. The running value ramps there in 20 ms.
/// HAPTOGRAPH_STATUS_NAME: haptograph_player_change() brought a graph without it. HAPTOGRAPH_STATUS_BUSY: another thread uses
/// a setting of this player, or changes its graph; try again. Any thread, also while another processes; real-time.
///
/// # Safety
/// `value` is null or of room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_setting_value(setting: Setting, value: *mut f64) -> Status {
    guard_realtime(|| {
        // SAFETY: what the header asks of it.
        let out = unsafe { OutPointer::required(value)? };
        table::with(setting.id, |entry| match entry {
            Entry::Setting(setting) => setting.value().map(|value| out.write(value)),
            _ => Err(Status::Kind),
        })
    })
}

/// Copies at most `capacity` of the endpoints whose silence acts on actuators, and their state after the last call of
/// haptograph_player_process(). `count`: the full number, or null. Any thread, also while another processes; not real-time.
///
/// # Safety
/// `inputs` is null or of room for `capacity` of them; `count` is null or of room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_player_live_inputs(
    player: Player,
    inputs: *mut LiveInput,
    capacity: usize,
    count: *mut usize,
) -> Status {
    let found = || table::player(player.id, |player| player.live_inputs());
    // SAFETY: the condition of this function.
    guard(|| unsafe { memory::list(found, (inputs, capacity), count) })
}

/// Copies at most `capacity` of the actuators that depend on the live input `endpoint`, like haptograph_player_live_inputs().
///
/// # Safety
/// `endpoint` is null or a text that ends with 0; `actuators` is null or of room for `capacity` of them; `count` is null or of
/// room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn haptograph_player_actuators(
    player: Player,
    endpoint: *const c_char,
    actuators: *mut Actuator,
    capacity: usize,
    count: *mut usize,
) -> Status {
    guard(|| {
        // SAFETY: what the header asks of each pointer; so it is below.
        let endpoint = unsafe { memory::text("endpoint", endpoint)? };
        let found = || table::player(player.id, |player| player.actuators(endpoint));
        // SAFETY: as above.
        unsafe { memory::list(found, (actuators, capacity), count) }
    })
}
