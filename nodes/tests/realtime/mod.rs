//! Is a stretch of code fit for real time? Allocations are counted; built with `--cfg rtsan` and RealtimeSanitizer's
//! library linked in, a lock that waits, or a call into the system that it knows, ends
//! the test at the spot.

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
    let before = ALLOCATIONS.get();
    sanitizer::watched(work);
    ALLOCATIONS.get() - before
}

#[cfg(rtsan)]
mod sanitizer {
    unsafe extern "C" {
        fn __rtsan_realtime_enter();
        fn __rtsan_realtime_exit();
    }

    pub fn watched(work: impl FnOnce()) {
        // SAFETY: the two only move a counter of the thread, and are called in pairs: a panic ends the test anyway.
        unsafe { __rtsan_realtime_enter() };
        work();
        // SAFETY: as above.
        unsafe { __rtsan_realtime_exit() };
    }
}

#[cfg(not(rtsan))]
mod sanitizer {
    pub fn watched(work: impl FnOnce()) {
        work();
    }
}
