//! Work on several cores.

use std::convert::Infallible;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Number of cores, at least 1.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The result of each item, in the order of the items. `progress` receives the fraction done after each item, from any thread.
///
/// # Panics
/// If `one` panics.
pub fn map<I: Send, R: Send>(
    threads: usize,
    items: impl IntoIterator<Item = I, IntoIter: Send + ExactSizeIterator>,
    progress: &(dyn Fn(f64) + Sync),
    one: impl Fn(I) -> R + Sync,
) -> Vec<R> {
    let results: Result<_, Infallible> = try_map(threads, items, progress, |item| Ok(one(item)));
    results.unwrap_or_default()
}

/// Like [`map`]; no further item begins after an error.
///
/// # Errors
/// The error of the first item that fails. Items begin in order, so it does not depend on the number of threads.
///
/// # Panics
/// If `one` panics.
pub fn try_map<I: Send, R: Send, E: Send>(
    threads: usize,
    items: impl IntoIterator<Item = I, IntoIter: Send + ExactSizeIterator>,
    progress: &(dyn Fn(f64) + Sync),
    one: impl Fn(I) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    let items = items.into_iter();
    let (count, done) = (items.len(), AtomicUsize::new(0));
    let one = |item: I| {
        let result = one(item);
        progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / count as f64);
        result
    };
    let threads = threads.min(count);
    if threads <= 1 {
        return items.map(one).collect();
    }
    let (next, has_failed) = (Mutex::new(items.enumerate()), AtomicBool::new(false));
    let work = || {
        let mut results = Vec::new();
        while !has_failed.load(Ordering::Relaxed) {
            let item = next.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some((number, item)) = item else { break };
            let result = one(item);
            has_failed.fetch_or(result.is_err(), Ordering::Relaxed);
            results.push((number, result));
        }
        results
    };
    let mut results: Vec<(usize, Result<R, E>)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let ended = workers.into_iter().map(|worker| worker.join());
        ended.flat_map(|ended| ended.unwrap_or_else(|panic| resume_unwind(panic))).collect()
    });
    results.sort_by_key(|(number, _)| *number);
    results.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_items() {
        let last = Mutex::new(0.0_f64);
        for threads in [0, 1, 2, 7] {
            let progress = |part: f64| {
                let mut last = last.lock().expect("whole");
                *last = last.max(part);
            };
            let squares = map(threads, 0..100_usize, &progress, |item| item * item);
            assert!(squares.into_iter().eq((0..100).map(|item| item * item)), "{threads}");
        }
        assert_eq!(*last.lock().expect("whole"), 1.0);
        assert!(map(4, Vec::<u8>::new(), &|_| (), |item| item).is_empty());
        let mut numbers = [1, 2, 3];
        map(2, &mut numbers, &|_| (), |number| *number *= 2);
        assert_eq!(numbers, [2, 4, 6]);
    }

    #[test]
    fn the_first_error_counts_and_ends_the_work() {
        let begun = AtomicUsize::new(0);
        let one = |item: usize| {
            begun.fetch_add(1, Ordering::Relaxed);
            if item == 3 || item == 5 { Err(item) } else { Ok(item) }
        };
        for threads in [1, 2, 8] {
            begun.store(0, Ordering::Relaxed);
            assert_eq!(try_map(threads, 0..1_000_000, &|_| (), one), Err(3), "{threads}");
            assert!(begun.load(Ordering::Relaxed) < 1_000_000);
        }
        assert_eq!(try_map(2, 6..9, &|_| (), one), Ok(vec![6, 7, 8]));
    }
}
