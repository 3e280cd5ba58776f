//! The engine of the studio as a WebAssembly module without imports: plain calls, and bytes in its own memory.
//!
//! What goes in is written to the place that [`haptograph_room`] gives; what comes out is read at
//! [`haptograph_message`] and [`haptograph_played`] before the next call. Files are those of [`haptograph_file`]. A
//! module opens one graph, either to run it ([`haptograph_open`]) or to check edits of it ([`haptograph_open_checker`]).
//! A fault of the engine ends the module by a trap; [`haptograph_panic`] then says where.

#![expect(unsafe_code, reason = "names that the page calls by")]

use haptograph_studio::page::{Checker, Engine, Message, Opened, learn_recording};
use serde_json::json;
use std::cell::RefCell;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

#[derive(Default)]
struct State {
    engine: Option<Engine>,
    checker: Option<Checker>,
    room: Vec<u8>,
    message: Vec<u8>,
}

thread_local! {
    static STATE: RefCell<State> = RefCell::default();
}

static PANIC: Mutex<String> = Mutex::new(String::new());

fn with<T>(work: impl FnOnce(&mut State) -> T) -> T {
    STATE.with_borrow_mut(work)
}

/// Room for so many bytes of what goes in; valid until the next call.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_room(length: usize) -> *mut u8 {
    with(|state| {
        state.room.resize(length, 0);
        state.room.as_mut_ptr()
    })
}

/// Puts a file into the module's memory: the room holds its path, of so many bytes, then its bytes.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_file(path_length: usize) {
    with(|state| {
        let (path, bytes) = state.room.split_at(path_length.min(state.room.len()));
        put(Path::new(&*String::from_utf8_lossy(path)), bytes);
    });
}

#[cfg(target_family = "wasm")]
use haptograph_signal::files::put;

/// On a machine with files of its own they are those.
#[cfg(not(target_family = "wasm"))]
fn put(_: &Path, _: &[u8]) {}

/// Begins to run the graph that the room names, `{ "graph": PATH, "set": [[NAME, VALUE]] }`: 1, or 0 and the message is
/// why not.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_open() -> u32 {
    keep_panics();
    with(|state| {
        let opened = read(&state.room).and_then(|opened| Engine::open(opened, &haptograph_nodes::registry()));
        kept(opened, &mut state.engine, &mut state.message)
    })
}

/// The same for a module that checks edits.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_open_checker() -> u32 {
    keep_panics();
    with(|state| {
        let opened =
            read(&state.room).and_then(|opened| Checker::open(opened, &haptograph_nodes::registry()));
        kept(opened, &mut state.checker, &mut state.message)
    })
}

fn read(room: &[u8]) -> Result<Opened, String> {
    serde_json::from_slice(room).map_err(|error| error.to_string())
}

fn kept<T>(opened: Result<T, String>, place: &mut Option<T>, message: &mut Vec<u8>) -> u32 {
    match opened {
        Ok(opened) => {
            *place = Some(opened);
            1
        }
        Err(why) => {
            *message = why.into_bytes();
            0
        }
    }
}

/// The room holds a message of the page.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_hear(is_text: u32) {
    with(|state| {
        let bytes = std::mem::take(&mut state.room);
        let message = match is_text {
            0 => Message::Binary(bytes),
            _ => Message::Text(String::from_utf8_lossy(&bytes).into_owned()),
        };
        if let Some(engine) = &mut state.engine {
            engine.hear(&message);
        }
    });
}

/// The room holds a message of the page that asks for a check or an edit: 1 where the message is the answer, 0 where
/// the engine has to answer.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_check() -> u32 {
    with(|state| {
        let said = String::from_utf8_lossy(&state.room).into_owned();
        let answer = state.checker.as_ref().and_then(|checker| checker.answer(&said));
        show(&mut state.message, answer)
    })
}

/// The room holds a message of the engine that says what it runs: edits are checked against that.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_follow() {
    with(|state| {
        let said = String::from_utf8_lossy(&state.room).into_owned();
        if let Some(checker) = &mut state.checker {
            checker.follow(&said);
        }
    });
}

/// Learns the surface of a recording, a file whose path the room holds: 1 and the message is `{ "name", "surface",
/// "report" }`, the texts of its file and of the page about it; 0 and the message is why not.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_learn() -> u32 {
    keep_panics();
    with(|state| {
        let path = String::from_utf8_lossy(&state.room).into_owned();
        let (message, is_learned) = match learn_recording(Path::new(&path)) {
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

/// Puts a new surface beside the graph's others: the room holds its name, of so many bytes, then its text. A checker's
/// message is its path as a parameter; an engine describes its graph anew. 0 where a thousand of that name exist.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_surface(name_length: usize) -> u32 {
    with(|state| {
        let (name, text) = state.room.split_at(name_length.min(state.room.len()));
        let name = String::from_utf8_lossy(name);
        let checked = state
            .checker
            .as_ref()
            .and_then(|checker| checker.surface_file(&name));
        let runs = state
            .engine
            .as_ref()
            .and_then(|engine| engine.surface_file(&name));
        if let Some(path) = checked.as_ref().map(|(path, _)| path).or(runs.as_ref()) {
            put(path, text);
        } else {
            return 0;
        }
        if let Some((_, parameter)) = checked {
            state.message = parameter.into_bytes();
        }
        if let Some(engine) = &mut state.engine {
            engine.tell_graph();
        }
        1
    })
}

/// Runs so many frames of the driver; how many samples are played.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_process(frames: usize) -> usize {
    with(|state| {
        state
            .engine
            .as_mut()
            .map_or(0, |engine| engine.process(frames).len())
    })
}

/// Where they are, as doubles; 1 is the actuator's peak limit.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_played() -> *const f64 {
    with(|state| { state.engine.as_ref() }.map_or(std::ptr::null(), |engine| engine.played().as_ptr()))
}

/// Makes messages of what came; the last time was so many ms ago, of which running took so many.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_publish(passed_ms: f64, busy_ms: f64) {
    let time = |ms: f64| Duration::try_from_secs_f64(ms * 1e-3).unwrap_or_default();
    with(|state| {
        if let Some(engine) = &mut state.engine {
            engine.publish(time(passed_ms), time(busy_ms));
        }
    });
}

/// Takes the next message to the page: 0 there is none, 1 JSON, 2 binary.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_next() -> u32 {
    with(|state| {
        let next = state.engine.as_mut().and_then(Engine::next_message);
        show(&mut state.message, next)
    })
}

fn show(message: &mut Vec<u8>, next: Option<Message>) -> u32 {
    let (bytes, kind) = match next {
        None => return 0,
        Some(Message::Text(text)) => (text.into_bytes(), 1),
        Some(Message::Binary(bytes)) => (bytes, 2),
    };
    *message = bytes;
    kind
}

/// Where the message is that was taken last.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_message() -> *const u8 {
    with(|state| state.message.as_ptr())
}

/// Its bytes.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_message_length() -> usize {
    with(|state| state.message.len())
}

/// Frames of the driver in a second, Hz; 0 where no graph runs.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_driver_hz() -> f64 {
    with(|state| state.engine.as_ref().map_or(0.0, Engine::driver_hz))
}

/// Samples that are played in a second, Hz; 0 where there is nothing to be heard.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_sound_hz() -> f64 {
    with(|state| state.engine.as_ref().and_then(Engine::sound_hz).unwrap_or(0.0))
}

fn keep_panics() {
    std::panic::set_hook(Box::new(|panic| {
        *PANIC.lock().unwrap_or_else(PoisonError::into_inner) = panic.to_string();
    }));
}

/// Where the text is that says why the module ended.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_panic() -> *const u8 {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner).as_ptr()
}

/// Its bytes; 0 while nothing went wrong.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_panic_length() -> usize {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner).len()
}
