//! The engine of the studio as a WebAssembly module without imports: plain calls, and bytes in its own memory. Two modules are made of it:
//! `modules/engine.rs` runs graphs, `modules/whole.rs` learns recordings and conducts studies, too.
//!
//! Input is written to the buffer that [`haptograph_room`] returns; output is read at [`haptograph_message`] and
//! [`haptograph_played`] before the next call. The module reads only files that [`haptograph_file`] has added. A module
//! opens one graph or study, either to run it ([`haptograph_open`]) or to check edits of it ([`haptograph_open_checker`]). A
//! panic of the engine ends the module by a trap; [`haptograph_panic`] then returns its message.

#![expect(unsafe_code, reason = "names that the page calls by")]

use haptograph_studio::page::{Checker, Engine, Message, Opened};
use std::cell::RefCell;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// What a module holds.
#[derive(Default)]
pub struct State {
    engine: Option<Engine>,
    /// What checks edits.
    pub checker: Option<Checker>,
    /// The input buffer.
    pub room: Vec<u8>,
    /// The latest message.
    pub message: Vec<u8>,
}

thread_local! {
    static STATE: RefCell<State> = RefCell::default();
}

static PANIC: Mutex<String> = Mutex::new(String::new());

/// Works on what the module holds.
pub fn with<T>(work: impl FnOnce(&mut State) -> T) -> T {
    STATE.with_borrow_mut(work)
}

/// Returns the input buffer, resized to `length` bytes. The pointer is valid until the next call.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_room(length: usize) -> *mut u8 {
    with(|state| {
        state.room.resize(length, 0);
        state.room.as_mut_ptr()
    })
}

/// Adds a file to the module's memory. The input buffer holds its path, `path_length` bytes, and then its content.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_file(path_length: usize) {
    with(|state| {
        let (path, bytes) = state.room.split_at(path_length.min(state.room.len()));
        put(Path::new(&*String::from_utf8_lossy(path)), bytes);
    });
}

#[cfg(target_family = "wasm")]
use haptograph_signal::files::put;

/// Does nothing: a machine with a file system uses its own files.
#[cfg(not(target_family = "wasm"))]
fn put(_: &Path, _: &[u8]) {}

#[cfg(target_family = "wasm")]
use haptograph_signal::files::next_change;

/// Nothing: as [`put`].
#[cfg(not(target_family = "wasm"))]
fn next_change() -> Option<(std::path::PathBuf, Option<std::sync::Arc<[u8]>>)> {
    None
}

/// Sets the clock: milliseconds since 1970, UTC. A study has no other.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_clock(since_1970_ms: f64) {
    #[cfg(target_family = "wasm")]
    haptograph_signal::time::set_clock(milliseconds(since_1970_ms));
    #[cfg(not(target_family = "wasm"))]
    let _ = since_1970_ms;
}

/// Takes the path of a file of the study that was written or removed since the last call: the message. Returns 0 if there is none, 1
/// for one that was removed, 2 for one whose content is in the input buffer until the next call.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_changed() -> u32 {
    with(|state| {
        let Some((path, bytes)) = next_change() else { return 0 };
        state.message = path.to_string_lossy().into_owned().into_bytes();
        state.room.clear();
        state.room.extend_from_slice(bytes.as_deref().unwrap_or_default());
        1 + u32::from(bytes.is_some())
    })
}

/// Returns the length of the input buffer, bytes.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_room_length() -> usize {
    with(|state| state.room.len())
}

/// Lets the participant's page of a study in (1), which is page 1 then, or says that it is gone (0).
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_participant(is_there: u32) {
    with(|state| {
        if let Some(engine) = &mut state.engine {
            if is_there == 1 { engine.let_in() } else { engine.let_out() }
        }
    });
}

/// Starts the graph in the input buffer, `{ "file": PATH, "set": [[NAME, VALUE]] }`. Returns 1, or 0 with the reason as the message.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_open() -> u32 {
    open(|opened| Engine::open(opened, &haptograph_nodes::registry()))
}

/// Starts what is in the input buffer by this function, for [`haptograph_open`].
pub fn open(open: impl FnOnce(Opened) -> Result<Engine, String>) -> u32 {
    keep_panics();
    with(|state| {
        let opened = read(&state.room).and_then(open);
        kept(opened, &mut state.engine, &mut state.message)
    })
}

/// Opens the graph in the input buffer in a module that checks edits, like [`haptograph_open`].
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

/// Handles the message of a page in the input buffer.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_hear(page: usize, is_text: u32) {
    with(|state| {
        let bytes = std::mem::take(&mut state.room);
        let message = match is_text {
            0 => Message::Binary(bytes),
            _ => Message::Text(String::from_utf8_lossy(&bytes).into_owned()),
        };
        if let Some(engine) = &mut state.engine {
            engine.hear(page, &message);
        }
    });
}

/// Checks the page's message in the input buffer, which requests a check or an edit. Returns 1 if the message is the
/// answer, 0 if the engine has to answer.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_check() -> u32 {
    with(|state| {
        let said = String::from_utf8_lossy(&state.room).into_owned();
        let answer = state.checker.as_ref().and_then(|checker| checker.answer(&said));
        show(&mut state.message, answer)
    })
}

/// Takes the engine's message `graph` in the input buffer: later edits are checked against that graph.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_follow() {
    with(|state| {
        let said = String::from_utf8_lossy(&state.room).into_owned();
        if let Some(checker) = &mut state.checker {
            checker.follow(&said);
        }
    });
}

/// Adds a new surface to those of the graph. The input buffer holds its name, `name_length` bytes, and then its text. A
/// checker sets the message to its path as a parameter; an engine sends its graph again. Returns 0 if a thousand
/// surfaces of that name exist.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_surface(name_length: usize) -> u32 {
    with(|state| {
        let (name, text) = state.room.split_at(name_length.min(state.room.len()));
        let name = String::from_utf8_lossy(name);
        let checked = state.checker.as_ref().and_then(|checker| checker.surface_file(&name));
        let runs = state.engine.as_ref().and_then(|engine| engine.surface_file(&name));
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

/// Runs `frames` frames of the driver. Returns the number of samples to play.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_process(frames: usize) -> usize {
    with(|state| state.engine.as_mut().map_or(0, |engine| engine.process(frames).len()))
}

/// Returns a pointer to these samples, doubles; 1 is the actuator's peak limit.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_played() -> *const f64 {
    with(|state| { state.engine.as_ref() }.map_or(std::ptr::null(), |engine| engine.played().as_ptr()))
}

/// Queues messages with the new data. `passed_ms` is the time since the last call, `busy_ms` the part of it that
/// running took.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_publish(passed_ms: f64, busy_ms: f64) {
    with(|state| {
        if let Some(engine) = &mut state.engine {
            engine.publish(milliseconds(passed_ms), milliseconds(busy_ms));
        }
    });
}

fn milliseconds(ms: f64) -> Duration {
    Duration::try_from_secs_f64(ms * 1e-3).unwrap_or_default()
}

/// Takes the next message to a page. Returns 0 if there is none, 1 for JSON, 2 for a binary message.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_next(page: usize) -> u32 {
    with(|state| {
        let next = state.engine.as_mut().and_then(|engine| engine.next_message(page));
        show(&mut state.message, next)
    })
}

/// Makes this the latest message; returns its kind, 0 for none.
pub fn show(message: &mut Vec<u8>, next: Option<Message>) -> u32 {
    let (bytes, kind) = match next {
        None => return 0,
        Some(Message::Text(text)) => (text.into_bytes(), 1),
        Some(Message::Binary(bytes)) => (bytes, 2),
    };
    *message = bytes;
    kind
}

/// Returns a pointer to the latest message.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_message() -> *const u8 {
    with(|state| state.message.as_ptr())
}

/// Returns the length of the latest message, bytes.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_message_length() -> usize {
    with(|state| state.message.len())
}

/// Returns the rate of the driver, Hz; 0 if no graph runs.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_driver_hz() -> f64 {
    with(|state| state.engine.as_ref().map_or(0.0, Engine::driver_hz))
}

/// Returns the rate of the played samples, Hz; 0 if the graph drives nothing audible.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_sound_hz() -> f64 {
    with(|state| state.engine.as_ref().and_then(Engine::sound_hz).unwrap_or(0.0))
}

/// Keeps the message of a panic for [`haptograph_panic`].
pub fn keep_panics() {
    std::panic::set_hook(Box::new(|panic| {
        *PANIC.lock().unwrap_or_else(PoisonError::into_inner) = panic.to_string();
    }));
}

/// Returns a pointer to the message of the panic that ended the module.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_panic() -> *const u8 {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner).as_ptr()
}

/// Returns the length of that message, bytes; 0 if there was no panic.
#[unsafe(no_mangle)]
pub extern "C" fn haptograph_panic_length() -> usize {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner).len()
}
