//! Handles: each is the number of a slot in a table and the generation of its entry. A handle that was freed, invented or
//! made by another copy of the library finds no entry, or one of another type; it is never dereferenced as a pointer.
//!
//! Calls never wait: if another thread is using the object exclusively, the call returns [`Status::Busy`]. A look-up takes
//! two atomic operations and neither allocates nor calls the system; therefore slots are never returned to the system and
//! a slot's lock is only tried.

use crate::border::Status;
use crate::failure::Failure;
use crate::players::{PlayerEntry, Setting};
use haptograph_engine::graph::Graph;
use haptograph_engine::host::{AnyInput, AnyOutput};
use std::collections::VecDeque;
use std::collections::hash_map::RandomState;
use std::hash::BuildHasher;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError, RwLock, TryLockError};

const CHUNKS: usize = 64;
const CHUNK: usize = 1024;

static TABLE: [OnceLock<Box<[Slot]>>; CHUNKS] = [const { OnceLock::new() }; CHUNKS];
static FREE: Mutex<FreeList> = Mutex::new(FreeList { slots: VecDeque::new(), chunks: 0 });

/// The object of a handle.
pub(crate) enum Entry {
    Graph(Box<Graph>),
    Input(Box<Mutex<AnyInput>>),
    Output(Box<Mutex<AnyOutput>>),
    Player(Box<PlayerEntry>),
    Setting(Box<Setting>),
}

/// The type of an object.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum ObjectKind {
    Graph,
    Input,
    Output,
    Player,
    Setting,
}

impl Entry {
    fn kind(&self) -> ObjectKind {
        match self {
            Self::Graph(_) => ObjectKind::Graph,
            Self::Input(_) => ObjectKind::Input,
            Self::Output(_) => ObjectKind::Output,
            Self::Player(_) => ObjectKind::Player,
            Self::Setting(_) => ObjectKind::Setting,
        }
    }
}

struct Slot(RwLock<SlotState>);

struct SlotState {
    /// Never 0, so that no handle is 0.
    generation: u32,
    entry: Option<Entry>,
}

struct FreeList {
    /// Free slots, the longest free first, so that generations repeat as late as possible.
    slots: VecDeque<usize>,
    chunks: usize,
}

fn slot(number: usize) -> Option<&'static Slot> {
    TABLE.get(number / CHUNK)?.get()?.get(number % CHUNK)
}

fn split(handle: u64) -> (usize, u32) {
    ((handle & 0xffff_ffff) as usize, (handle >> 32) as u32)
}

/// Stores an object and returns its handle; an error if the table is full. Not real-time.
pub(crate) fn insert(entry: Entry) -> Result<u64, Status> {
    let number = {
        let mut free = FREE.lock().unwrap_or_else(PoisonError::into_inner);
        if free.slots.is_empty() {
            grow(&mut free)?;
        }
        free.slots.pop_front().ok_or(Status::System)?
    };
    let slot = slot(number).ok_or(Status::System)?;
    // A look-up by an old handle may hold the lock for a moment; a waiting writer would block other look-ups.
    let mut state = loop {
        match slot.0.try_write() {
            Ok(state) => break state,
            Err(TryLockError::Poisoned(state)) => break state.into_inner(),
            Err(TryLockError::WouldBlock) => std::thread::yield_now(),
        }
    };
    state.entry = Some(entry);
    Ok(u64::from(state.generation) << 32 | number as u64)
}

fn grow(free: &mut FreeList) -> Result<(), Status> {
    let chunk = TABLE.get(free.chunks).ok_or(Status::System)?;
    // Random first generations make handles of another copy of the library, or of an earlier run, invalid.
    let seed = RandomState::new();
    let first = |number: usize| (seed.hash_one(number) as u32).max(1);
    let fresh = |number: usize| {
        let state = SlotState { generation: first(number), entry: None };
        Slot(RwLock::new(state))
    };
    let base = free.chunks * CHUNK;
    chunk.get_or_init(|| (base..base + CHUNK).map(fresh).collect());
    free.slots.extend(base..base + CHUNK);
    free.chunks += 1;
    Ok(())
}

/// Removes an object of this type from the table, unless a thread is using it. Not real-time.
pub(crate) fn take(handle: u64, kind: ObjectKind) -> Result<Entry, Status> {
    let (number, generation) = split(handle);
    let slot = slot(number).ok_or(Status::Handle)?;
    let mut state = match slot.0.try_write() {
        Ok(state) => state,
        Err(TryLockError::Poisoned(state)) => state.into_inner(),
        Err(TryLockError::WouldBlock) => return Err(Status::Busy),
    };
    match &state.entry {
        Some(entry) if state.generation == generation && entry.kind() != kind => return Err(Status::Kind),
        Some(_) if state.generation == generation => {}
        _ => return Err(Status::Handle),
    }
    state.generation = state.generation.wrapping_add(1).max(1);
    let entry = state.entry.take().ok_or(Status::Handle);
    drop(state);
    let mut free = FREE.lock().unwrap_or_else(PoisonError::into_inner);
    free.slots.push_back(number);
    entry
}

/// Frees an object of this type, unless a thread is using it. Not real-time.
pub(crate) fn free(handle: u64, kind: ObjectKind) -> Result<(), Failure> {
    let entry = take(handle, kind)?;
    drop(entry);
    Ok(())
}

/// Calls `work` with the object of a handle. Real-time safe if `work` is.
pub(crate) fn with<R, E: From<Status>>(
    handle: u64,
    work: impl FnOnce(&Entry) -> Result<R, E>,
) -> Result<R, E> {
    let (number, generation) = split(handle);
    let slot = slot(number).ok_or(Status::Handle)?;
    let state = match slot.0.try_read() {
        Ok(state) => state,
        Err(TryLockError::Poisoned(state)) => state.into_inner(),
        Err(TryLockError::WouldBlock) => return Err(Status::Busy.into()),
    };
    match &state.entry {
        Some(entry) if state.generation == generation => work(entry),
        _ => Err(Status::Handle.into()),
    }
}

/// The graph of a handle.
pub(crate) fn graph<R, E: From<Status>>(
    handle: u64,
    work: impl FnOnce(&Graph) -> Result<R, E>,
) -> Result<R, E> {
    with(handle, |entry| match entry {
        Entry::Graph(graph) => work(graph),
        _ => Err(Status::Kind.into()),
    })
}

/// The player of a handle.
pub(crate) fn player<R, E: From<Status>>(
    handle: u64,
    work: impl FnOnce(&PlayerEntry) -> Result<R, E>,
) -> Result<R, E> {
    with(handle, |entry| match entry {
        Entry::Player(player) => work(player),
        _ => Err(Status::Kind.into()),
    })
}

/// The input of a handle, for this thread alone.
pub(crate) fn input<R>(
    handle: u64,
    work: impl FnOnce(&mut AnyInput) -> Result<R, Status>,
) -> Result<R, Status> {
    with(handle, |entry| match entry {
        Entry::Input(input) => work(&mut *try_lock(input)?),
        _ => Err(Status::Kind),
    })
}

/// The output of a handle, for this thread alone.
pub(crate) fn output<R>(
    handle: u64,
    work: impl FnOnce(&mut AnyOutput) -> Result<R, Status>,
) -> Result<R, Status> {
    with(handle, |entry| match entry {
        Entry::Output(output) => work(&mut *try_lock(output)?),
        _ => Err(Status::Kind),
    })
}

/// Locks a mutex if no other thread holds it.
pub(crate) fn try_lock<T: ?Sized>(mutex: &Mutex<T>) -> Result<MutexGuard<'_, T>, Status> {
    match mutex.try_lock() {
        Ok(state) => Ok(state),
        Err(TryLockError::WouldBlock) => Err(Status::Busy),
        // Its thread panicked while it changed the object.
        Err(TryLockError::Poisoned(_)) => Err(Status::Panic),
    }
}
