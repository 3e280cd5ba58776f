//! Converts C pointers to Rust types. Null and misaligned pointers and impossible lengths are refused; the caller
//! guarantees that other pointers are valid, as the header states.

use crate::border::{GraphOptions, PlayOptions, Status};
use crate::channels::Sample;
use crate::failure::Failure;
use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;
use std::path::Path;

/// Most texts in a list.
const MAX_TEXTS: usize = 1 << 16;

fn refused(what: &str, why: &str) -> Failure {
    Failure::new(Status::Argument, format_args!("`{what}` {why}"))
}

/// Reads a text of the caller.
///
/// # Safety
/// Unless it is null, `pointer` is of bytes that end with 0 and stay as they are for `'a`.
pub unsafe fn bytes<'a>(what: &str, pointer: *const c_char) -> Result<&'a CStr, Failure> {
    if pointer.is_null() {
        return Err(refused(what, "is null"));
    }
    // SAFETY: it is not null; the rest is this function's own condition.
    Ok(unsafe { CStr::from_ptr(pointer) })
}

/// Reads a UTF-8 text.
///
/// # Safety
/// As of [`bytes`].
pub unsafe fn text<'a>(what: &str, pointer: *const c_char) -> Result<&'a str, Failure> {
    // SAFETY: this function's own condition.
    let bytes = unsafe { bytes(what, pointer)? };
    bytes.to_str().map_err(|_| refused(what, "is not UTF-8"))
}

/// Reads a UTF-8 text that may be null.
///
/// # Safety
/// As of [`bytes`].
pub unsafe fn optional_text<'a>(what: &str, pointer: *const c_char) -> Result<Option<&'a str>, Failure> {
    // SAFETY: this function's own condition.
    (!pointer.is_null()).then(|| unsafe { text(what, pointer) }).transpose()
}

/// Reads a path: any bytes on Unix, UTF-8 elsewhere.
///
/// # Safety
/// As of [`bytes`].
pub unsafe fn path<'a>(what: &str, pointer: *const c_char) -> Result<&'a Path, Failure> {
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        // SAFETY: this function's own condition.
        let bytes = unsafe { bytes(what, pointer)? };
        Ok(Path::new(std::ffi::OsStr::from_bytes(bytes.to_bytes())))
    }
    #[cfg(not(unix))]
    {
        // SAFETY: this function's own condition.
        Ok(Path::new(unsafe { text(what, pointer)? }))
    }
}

/// Reads a UTF-8 text of a given length.
///
/// # Safety
/// Unless it is null, `pointer` is of `length` bytes that stay as they are for `'a`.
pub unsafe fn sized_text<'a>(what: &str, pointer: *const c_char, length: usize) -> Result<&'a str, Failure> {
    if pointer.is_null() {
        return Err(refused(what, "is null"));
    }
    if length > isize::MAX as usize {
        return Err(refused(what, "is longer than the address space"));
    }
    // SAFETY: bytes are aligned anywhere, it is not null, and the length was checked; the rest is the condition.
    let bytes = unsafe { std::slice::from_raw_parts(pointer.cast::<u8>(), length) };
    std::str::from_utf8(bytes).map_err(|_| refused(what, "is not UTF-8"))
}

/// Reads a list of UTF-8 texts; an empty list may be null.
///
/// # Safety
/// Unless it is null, `pointer` is of `count` pointers, each as of [`bytes`].
pub unsafe fn texts<'a>(
    what: &str,
    pointer: *const *const c_char,
    count: usize,
) -> Result<Vec<&'a str>, Failure> {
    if count == 0 {
        return Ok(Vec::new());
    }
    if pointer.is_null() || !pointer.is_aligned() {
        return Err(refused(what, "is null or misaligned"));
    }
    if count > MAX_TEXTS {
        return Err(refused(what, "has more than 65536 texts"));
    }
    // SAFETY: not null, aligned, and short; that there are so many is the condition.
    let pointers = unsafe { std::slice::from_raw_parts(pointer, count) };
    let read = |pointer: &*const c_char| {
        // SAFETY: this function's own condition.
        unsafe { text(what, *pointer) }
    };
    pointers.iter().map(read).collect()
}

fn has_memory<T: Sample>(pointer: *const T, length: usize) -> bool {
    !pointer.is_null() && pointer.is_aligned() && length <= isize::MAX as usize / size_of::<T>()
}

/// Reads values of the caller. Real-time.
///
/// # Safety
/// Unless it is null, `pointer` is of `length` values that stay as they are for `'a`.
pub unsafe fn values<'a, T: Sample>(pointer: *const T, length: usize) -> Result<&'a [T], Status> {
    if !has_memory(pointer, length) {
        return Err(Status::Argument);
    }
    // SAFETY: not null, aligned, no longer than memory; the rest is the condition.
    Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// A buffer of the caller for values. Real-time.
///
/// # Safety
/// Unless it is null, `pointer` is of room for `length` values that nobody else uses for `'a`.
pub unsafe fn room<'a, T: Sample>(
    pointer: *mut T,
    length: usize,
) -> Result<&'a mut [MaybeUninit<T>], Status> {
    if !has_memory(pointer, length) {
        return Err(Status::Argument);
    }
    // SAFETY: not null, aligned, no longer than memory; what is there may be anything; the rest is the condition.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer.cast(), length) })
}

/// A pointer to which the call writes a result.
pub struct OutPointer<T>(*mut T);

impl<T: Copy> OutPointer<T> {
    /// A pointer that must not be null.
    ///
    /// # Safety
    /// Unless it is null, `pointer` has room for a `T` that nobody else uses until the result is written.
    pub unsafe fn required(pointer: *mut T) -> Result<Self, Status> {
        match pointer.is_null() || !pointer.is_aligned() {
            true => Err(Status::Argument),
            false => Ok(Self(pointer)),
        }
    }

    /// A pointer that may be null if the caller does not need the result.
    ///
    /// # Safety
    /// As of [`Self::to`].
    pub unsafe fn optional(pointer: *mut T) -> Result<Self, Status> {
        match pointer.is_aligned() {
            true => Ok(Self(pointer)),
            false => Err(Status::Argument),
        }
    }

    /// Writes the result unless the pointer is null.
    pub fn write(&self, value: T) {
        if !self.0.is_null() {
            // SAFETY: it is aligned and not null; the constructor's caller guaranteed the rest.
            unsafe { self.0.write(value) };
        }
    }
}

/// Copies at most `capacity` items to the caller and writes the full number to `count`. If `capacity` is 0, `pointer` may
/// be null.
///
/// # Safety
/// Unless it is null, `pointer` is of room for `capacity` of them that nobody else uses.
pub unsafe fn copy<T: Copy>(
    items: &[T],
    (pointer, capacity): (*mut T, usize),
    count: &OutPointer<usize>,
) -> Result<(), Status> {
    count.write(items.len());
    if capacity == 0 {
        return Ok(());
    }
    if pointer.is_null() || !pointer.is_aligned() {
        return Err(Status::Argument);
    }
    let copied = items.len().min(capacity);
    // SAFETY: the source has so many, the target too by the condition, and is not null but aligned; what was just made
    // here does not lie where the caller's memory is.
    unsafe { std::ptr::copy_nonoverlapping(items.as_ptr(), pointer, copied) };
    Ok(())
}

/// Copies a list that the library makes, as [`copy`] does.
///
/// # Safety
/// As of [`copy`]; `count` is null or of room for a number.
pub unsafe fn list<T: Copy>(
    found: impl FnOnce() -> Result<Vec<T>, Failure>,
    to: (*mut T, usize),
    count: *mut usize,
) -> Result<(), Failure> {
    // SAFETY: the condition of this function; so it is below.
    let count = unsafe { OutPointer::optional(count)? };
    // SAFETY: as above.
    unsafe { copy(&found()?, to, &count) }.map_err(Into::into)
}

/// The number of bytes of whole characters that fit into `room`.
pub fn boundary(text: &str, room: usize) -> usize {
    (0..=room.min(text.len())).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0)
}

/// As much of a text as fits, with a final 0.
pub fn fixed<const ROOM: usize>(text: &str) -> [c_char; ROOM] {
    let mut fixed = [0; ROOM];
    let cut = boundary(text, ROOM - 1);
    fixed.iter_mut().zip(&text.as_bytes()[..cut]).for_each(|(to, byte)| *to = *byte as c_char);
    fixed
}

/// An options structure that begins with its own size.
pub trait Options: Copy {
    /// The default options.
    const NOTHING: Self;
    fn size(&self) -> usize;
}

impl Options for GraphOptions {
    const NOTHING: Self = Self {
        size: size_of::<Self>(),
        set: std::ptr::null(),
        set_count: 0,
        endpoints: std::ptr::null(),
        hosted: std::ptr::null(),
        hosted_count: 0,
        has_seed: 0,
        seed: 0,
    };
    fn size(&self) -> usize {
        self.size
    }
}

impl Options for PlayOptions {
    const NOTHING: Self = Self {
        size: size_of::<Self>(),
        rested: 0,
        block: 0,
        seconds: 0.0,
        folder: std::ptr::null(),
        probes: std::ptr::null(),
        probe_count: 0,
    };
    fn size(&self) -> usize {
        self.size
    }
}

/// Reads options of the caller; null means the defaults. A size other than this version's is an error.
///
/// # Safety
/// Unless it is null, `pointer` is of a `T`.
pub unsafe fn options<T: Options>(pointer: *const T) -> Result<T, Failure> {
    if pointer.is_null() {
        return Ok(T::NOTHING);
    }
    if !pointer.is_aligned() {
        return Err(refused("options", "is misaligned"));
    }
    // SAFETY: not null, aligned, and a `T` by the condition, all of whose fields take any bits.
    let options = unsafe { pointer.read() };
    match options.size() == size_of::<T>() {
        true => Ok(options),
        false => Err(refused(
            "options",
            "has a size of another version: initialise it with HAPTOGRAPH_GRAPH_OPTIONS or HAPTOGRAPH_PLAY_OPTIONS",
        )),
    }
}
