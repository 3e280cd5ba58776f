//! The module that a page loads to learn a recording, to listen to one, to export sound, or to conduct a study.

#![expect(unsafe_code, reason = "names that the page calls by")]

use haptograph_studio::page::{Engine, Mapping, export, learn_recording, read_recording};
use haptograph_wasm::{keep_panics, open, show, with};
use serde_json::json;
use std::path::Path;

/// Starts the study in the input buffer, `{ "file": PATH }`, like `haptograph_open`.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_open_study() -> u32 {
    open(|opened| Engine::open_study(&opened, &haptograph_nodes::registry()))
}

/// Learns the surface of a recording; the input buffer holds the path of its file, `path_length` bytes, and then what its columns are, as
/// in the message `learn`. Returns 1 with the message `{ "name", "surface", "report" }`, where `surface` is the text of the surface file and
/// `report` that of the page; or 0 with the reason as the message.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_learn(path_length: usize) -> u32 {
    keep_panics();
    with(|state| {
        let (path, mapping) = state.room.split_at(path_length.min(state.room.len()));
        let path = String::from_utf8_lossy(path);
        let mapping = serde_json::from_slice::<Mapping>(mapping).map_err(|error| error.to_string());
        let learned = mapping.and_then(|mapping| learn_recording(Path::new(&*path), &mapping));
        let (message, is_learned) = match learned {
            Ok([name, surface, report]) => {
                let learned = json!({ "name": name, "surface": surface, "report": report });
                (learned.to_string(), 1)
            }
            Err(why) => (why, 0),
        };
        state.message = message.into_bytes();
        is_learned
    })
}

/// Answers the page's message `listen` in the input buffer, whose recording is a file here. Returns 1, or 0 for another message.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_listen() -> u32 {
    keep_panics();
    with(|state| {
        let said = String::from_utf8_lossy(&state.room).into_owned();
        let answer = state.checker.as_ref().and_then(|checker| checker.listen(&said));
        show(&mut state.message, answer)
    })
}

/// Answers the page's message `export` in the input buffer. Returns 1, or 0 for another message.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_export() -> u32 {
    keep_panics();
    with(|state| {
        let said = String::from_utf8_lossy(&state.room).into_owned();
        show(&mut state.message, export(&said))
    })
}

/// What reading a recording finds, with the input buffer as for `haptograph_learn`: the message, as in the reply to `learn` with `reads`.
/// Returns 1, or 0 with the reason as the message.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_read(path_length: usize) -> u32 {
    keep_panics();
    with(|state| {
        let (path, mapping) = state.room.split_at(path_length.min(state.room.len()));
        let mapping = serde_json::from_slice::<Mapping>(mapping).map_err(|error| error.to_string());
        let read =
            mapping.map(|mapping| read_recording(Path::new(&*String::from_utf8_lossy(path)), &mapping));
        let (message, is_read) = read.map_or_else(|why| (why, 0), |read| (read.to_string(), 1));
        state.message = message.into_bytes();
        is_read
    })
}
