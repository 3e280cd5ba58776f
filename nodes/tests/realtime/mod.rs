//! Checks that code is fit for real time. Allocations are counted; with RealtimeSanitizer's library preloaded
//! (`.ci/run` does so), a lock that waits, or a call into the system that the sanitizer knows, ends the test there.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator unchanged; counting touches a `const`-initialised thread-local
// without a destructor, which neither allocates nor unwinds.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's obligations are the system allocator's.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Allocations and deallocations of this thread during `work`, which RealtimeSanitizer watches where it is there.
pub fn allocations(work: impl FnOnce()) -> usize {
    sanitizer::load();
    let before = ALLOCATIONS.get();
    sanitizer::watched(work);
    ALLOCATIONS.get() - before
}

/// RealtimeSanitizer, where it is loaded before the program.
mod sanitizer {
    use std::ffi::{CStr, c_char, c_void};
    use std::ptr::null_mut;
    use std::sync::LazyLock;

    type Call = unsafe extern "C" fn();

    struct Sanitizer {
        enter: Call,
        exit: Call,
    }

    static LOADED: LazyLock<Option<Sanitizer>> = LazyLock::new(|| {
        let found = symbol(c"__rtsan_realtime_enter").zip(symbol(c"__rtsan_realtime_exit"));
        let is_preloaded = std::env::var("LD_PRELOAD").is_ok_and(|list| list.contains("rtsan"));
        assert!(found.is_some() || !is_preloaded, "RealtimeSanitizer is not what was preloaded");
        let (enter, exit) = found?;
        // SAFETY: it takes nothing, and may be called any number of times.
        unsafe { symbol(c"__rtsan_ensure_initialized")?() };
        Some(Sanitizer { enter, exit })
    });

    #[cfg(target_os = "linux")]
    fn symbol(name: &CStr) -> Option<Call> {
        unsafe extern "C" {
            fn dlsym(handle: *mut c_void, name: *const c_char) -> *mut c_void;
        }
        // SAFETY: a null handle means every library that is loaded, and the name ends in zero.
        let found = unsafe { dlsym(null_mut(), name.as_ptr()) };
        // SAFETY: these names are the sanitizer's, whose functions take and return nothing.
        (!found.is_null()).then(|| unsafe { std::mem::transmute::<*mut c_void, Call>(found) })
    }

    #[cfg(not(target_os = "linux"))]
    fn symbol(_: &CStr) -> Option<Call> {
        None
    }

    /// Looks for it, which allocates the first time.
    pub fn load() {
        LazyLock::force(&LOADED);
    }

    pub fn watched(work: impl FnOnce()) {
        let Some(Sanitizer { enter, exit }) = LOADED.as_ref() else {
            return work();
        };
        // SAFETY: the two only move a counter of the thread, and are called in pairs: a panic ends the test anyway.
        unsafe { enter() };
        work();
        // SAFETY: as above.
        unsafe { exit() };
    }
}
