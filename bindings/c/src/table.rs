//! Handles: numbers that name a place in a table and the generation of what stands there. A handle that was freed, made
//! up or given out by another copy of the library finds nothing, or something of another kind; it is never followed as a
//! pointer.
//!
//! Nobody waits: a call on an object that another thread is inside ends with [`Status::Busy`] where the two exclude each
//! other. A look-up takes two atomic operations and neither allocates nor calls the system; that is why places are never
//! given back to the system and a place's lock is only ever tried.

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

static TABLE: [OnceLock<Box<[Place]>>; CHUNKS] = [const { OnceLock::new() }; CHUNKS];
static FREE: Mutex<Free> = Mutex::new(Free {
    places: VecDeque::new(),
    chunks: 0,
});

/// What a handle stands for.
pub enum Entry {
    Graph(Box<Graph>),
    Input(Box<Mutex<AnyInput>>),
    Output(Box<Mutex<AnyOutput>>),
    Player(Box<PlayerEntry>),
    Setting(Setting),
}

/// The kinds of objects, without them.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum What {
    Graph,
    Input,
    Output,
    Player,
    Setting,
}

impl Entry {
    fn what(&self) -> What {
        match self {
            Self::Graph(_) => What::Graph,
            Self::Input(_) => What::Input,
            Self::Output(_) => What::Output,
            Self::Player(_) => What::Player,
            Self::Setting(_) => What::Setting,
        }
    }
}

struct Place(RwLock<Inside>);

struct Inside {
    /// Never 0, so that no handle is.
    generation: u32,
    entry: Option<Entry>,
}

struct Free {
    /// The place that has been free longest comes first: its generation comes round last.
    places: VecDeque<usize>,
    chunks: usize,
}

fn place(number: usize) -> Option<&'static Place> {
    TABLE.get(number / CHUNK)?.get()?.get(number % CHUNK)
}

fn split(handle: u64) -> (usize, u32) {
    ((handle & 0xffff_ffff) as usize, (handle >> 32) as u32)
}

/// Gives an object a handle; none where the table is full. Not real-time.
pub fn insert(entry: Entry) -> Result<u64, Status> {
    let number = {
        let mut free = FREE.lock().unwrap_or_else(PoisonError::into_inner);
        if free.places.is_empty() {
            grow(&mut free)?;
        }
        free.places.pop_front().ok_or(Status::System)?
    };
    let place = place(number).ok_or(Status::System)?;
    // A look-up by an old handle may be inside for a moment; one that waits would hold up others.
    let mut inside = loop {
        match place.0.try_write() {
            Ok(inside) => break inside,
            Err(TryLockError::Poisoned(inside)) => break inside.into_inner(),
            Err(TryLockError::WouldBlock) => std::thread::yield_now(),
        }
    };
    inside.entry = Some(entry);
    Ok(u64::from(inside.generation) << 32 | number as u64)
}

fn grow(free: &mut Free) -> Result<(), Status> {
    let chunk = TABLE.get(free.chunks).ok_or(Status::System)?;
    // Handles of another copy of the library, or of an earlier run, are not those of this one.
    let seed = RandomState::new();
    let first = |number: usize| (seed.hash_one(number) as u32).max(1);
    let fresh = |number: usize| {
        let inside = Inside {
            generation: first(number),
            entry: None,
        };
        Place(RwLock::new(inside))
    };
    let base = free.chunks * CHUNK;
    chunk.get_or_init(|| (base..base + CHUNK).map(fresh).collect());
    free.places.extend(base..base + CHUNK);
    free.chunks += 1;
    Ok(())
}

/// Takes an object of this kind out of the table, unless a thread is inside it. Not real-time.
pub fn take(handle: u64, what: What) -> Result<Entry, Status> {
    let (number, generation) = split(handle);
    let place = place(number).ok_or(Status::Handle)?;
    let mut inside = match place.0.try_write() {
        Ok(inside) => inside,
        Err(TryLockError::Poisoned(inside)) => inside.into_inner(),
        Err(TryLockError::WouldBlock) => return Err(Status::Busy),
    };
    match &inside.entry {
        Some(entry) if inside.generation == generation && entry.what() != what => return Err(Status::Kind),
        Some(_) if inside.generation == generation => {}
        _ => return Err(Status::Handle),
    }
    inside.generation = inside.generation.wrapping_add(1).max(1);
    let entry = inside.entry.take().ok_or(Status::Handle);
    drop(inside);
    let mut free = FREE.lock().unwrap_or_else(PoisonError::into_inner);
    free.places.push_back(number);
    entry
}

/// Frees an object of this kind, unless a thread is inside it. Not real-time.
pub fn free(handle: u64, what: What) -> Result<(), Failure> {
    let entry = take(handle, what)?;
    drop(entry);
    Ok(())
}

/// Does something with the object of a handle. Real-time safe if `work` is.
pub fn with<R, E: From<Status>>(handle: u64, work: impl FnOnce(&Entry) -> Result<R, E>) -> Result<R, E> {
    let (number, generation) = split(handle);
    let place = place(number).ok_or(Status::Handle)?;
    let inside = match place.0.try_read() {
        Ok(inside) => inside,
        Err(TryLockError::Poisoned(inside)) => inside.into_inner(),
        Err(TryLockError::WouldBlock) => return Err(Status::Busy.into()),
    };
    match &inside.entry {
        Some(entry) if inside.generation == generation => work(entry),
        _ => Err(Status::Handle.into()),
    }
}

/// The graph of a handle.
pub fn graph<R, E: From<Status>>(handle: u64, work: impl FnOnce(&Graph) -> Result<R, E>) -> Result<R, E> {
    with(handle, |entry| match entry {
        Entry::Graph(graph) => work(graph),
        _ => Err(Status::Kind.into()),
    })
}

/// The player of a handle.
pub fn player<R, E: From<Status>>(
    handle: u64,
    work: impl FnOnce(&PlayerEntry) -> Result<R, E>,
) -> Result<R, E> {
    with(handle, |entry| match entry {
        Entry::Player(player) => work(player),
        _ => Err(Status::Kind.into()),
    })
}

/// The input of a handle, for this thread alone.
pub fn input<R>(handle: u64, work: impl FnOnce(&mut AnyInput) -> Result<R, Status>) -> Result<R, Status> {
    with(handle, |entry| match entry {
        Entry::Input(input) => work(&mut *held(input)?),
        _ => Err(Status::Kind),
    })
}

/// The output of a handle, for this thread alone.
pub fn output<R>(handle: u64, work: impl FnOnce(&mut AnyOutput) -> Result<R, Status>) -> Result<R, Status> {
    with(handle, |entry| match entry {
        Entry::Output(output) => work(&mut *held(output)?),
        _ => Err(Status::Kind),
    })
}

/// What is for one thread at a time, if no other is inside.
pub fn held<T: ?Sized>(mutex: &Mutex<T>) -> Result<MutexGuard<'_, T>, Status> {
    match mutex.try_lock() {
        Ok(inside) => Ok(inside),
        Err(TryLockError::WouldBlock) => Err(Status::Busy),
        // Half-way through something when it panicked.
        Err(TryLockError::Poisoned(_)) => Err(Status::Panic),
    }
}
