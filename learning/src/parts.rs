//! Work in parts: its items are numbered, each is a pure function of the work and its number, and processes share them.
//!
//! A finished item or part is a file that was renamed into place, so that going on is looking at what is there, and merging too.

use haptograph_signal::parallel;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};

/// One of `of` parts, of about equal size, of a list of numbered items.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: u64,
    of: u64,
}

impl Shard {
    /// Part `number`, from 1, of `of`; `None` if there is no such part.
    pub fn new(number: u64, of: u64) -> Option<Self> {
        (1..=of).contains(&number).then_some(Self { number, of })
    }

    /// True if the part contains the item of this number, from 0.
    pub fn has(&self, item: u64) -> bool {
        item % self.of == self.number - 1
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text
            .split_once('/')
            .and_then(|(number, of)| Self::new(number.trim().parse().ok()?, of.trim().parse().ok()?));
        parts.ok_or_else(|| "write it as K/N, with K from 1 to N".to_owned())
    }
}

/// An item after a pass over the work.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome<T> {
    /// It was there.
    Kept(T),
    /// It was computed; with the damage of the one that was there, if any.
    Computed(T, Option<String>),
    /// It is not there: another part has it, or the work was stopped before it.
    Absent,
}

/// Looks at all items, on several threads, and computes those of a part (`None`: all) that are not there, until `stop` is set.
///
/// `find` gives an item that is there, or the damage of it. `compute` puts an item there as a whole; `None` if it was stopped.
/// `progress` receives the fraction done, from any thread.
///
/// # Errors
/// The first error of `compute`; items computed before stay there.
pub fn resume<T: Send, E: Send>(
    (threads, items, shard): (usize, u64, Option<Shard>),
    (progress, stop): (&(dyn Fn(f64) + Sync), &AtomicBool),
    find: impl Fn(u64) -> Result<Option<T>, String> + Sync,
    compute: impl Fn(u64) -> Result<Option<T>, E> + Sync,
) -> Result<Vec<Outcome<T>>, E> {
    let is_stopped = || stop.load(Ordering::Relaxed);
    let one = |item: usize| {
        let item = item as u64;
        if is_stopped() {
            return Ok(Outcome::Absent);
        }
        let damage = match find(item) {
            Ok(Some(there)) => return Ok(Outcome::Kept(there)),
            Ok(None) => None,
            Err(damage) => Some(damage),
        };
        if !shard.is_none_or(|shard| shard.has(item)) {
            return Ok(Outcome::Absent);
        }
        let computed = compute(item)?;
        Ok(computed.map_or(Outcome::Absent, |item| Outcome::Computed(item, damage)))
    };
    // Items that are left out after a stop are not done.
    let progress = |part| {
        if !is_stopped() {
            progress(part)
        }
    };
    parallel::try_map(threads, 0..items as usize, &progress, one)
}

/// A computed part: the file or folder that it is in, what all parts of the work have in common, and its items by number.
#[derive(Debug)]
pub struct Part<'a, H, T> {
    /// The file or folder.
    pub path: &'a Path,
    /// Equal in all parts of the work.
    pub head: H,
    /// Items with their numbers, from 0.
    pub items: Vec<(u64, &'a T)>,
}

/// An error of putting parts together.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum PartsError {
    #[error("there is nothing to merge; name all parts")]
    Nothing,
    #[error("{} and {} are not parts of one whole: their plans, recordings, settings or versions differ", first.display(), second.display())]
    Different { first: PathBuf, second: PathBuf },
    #[error("{item} is in both {} and {}; name one of them", first.display(), second.display())]
    Twice { item: String, first: PathBuf, second: PathBuf },
    #[error("{} has item {number}, but the whole has {of}; compute that part again", path.display())]
    Number { path: PathBuf, number: u64, of: u64 },
    #[error(
        "{missing} of {of} items are in none of the parts, the first is item {first} (from 0); compute the missing shards"
    )]
    Missing { missing: u64, of: u64, first: u64 },
}

/// Every one of `of` items once, in order, with the part that it is in. `name` is that of an item in messages.
///
/// # Errors
/// [`PartsError`] if an item is missing or there twice, or a part belongs to other work.
pub(crate) fn whole<'a, H: PartialEq, T>(
    parts: &[Part<'a, H, T>],
    of: u64,
    name: impl Fn(&T) -> String,
) -> Result<Vec<(&'a Path, &'a T)>, PartsError> {
    let first = parts.first().ok_or(PartsError::Nothing)?;
    let mut found: BTreeMap<u64, (&Path, &T)> = BTreeMap::new();
    for part in parts {
        if part.head != first.head {
            let (first, second) = (first.path.to_owned(), part.path.to_owned());
            return Err(PartsError::Different { first, second });
        }
        for &(number, item) in &part.items {
            if number >= of {
                return Err(PartsError::Number { path: part.path.to_owned(), number, of });
            }
            if let Some((first, _)) = found.insert(number, (part.path, item)) {
                let (first, second) = (first.to_owned(), part.path.to_owned());
                return Err(PartsError::Twice { item: name(item), first, second });
            }
        }
    }
    match (0..of).find(|number| !found.contains_key(number)) {
        Some(first) => Err(PartsError::Missing { missing: of - found.len() as u64, of, first }),
        None => Ok(found.into_values().collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    #[test]
    fn a_pass_keeps_what_is_there_and_computes_what_is_missing_or_damaged() {
        let stop = AtomicBool::new(false);
        let find = |item| match item {
            0 => Ok(Some("there")),
            1 => Err("cut short".to_owned()),
            _ => Ok(None),
        };
        let compute = |item| {
            stop.fetch_or(item == 5, Ordering::Relaxed);
            Ok::<_, Infallible>((item != 3).then_some("new"))
        };
        let pass = |shard: Option<&str>| {
            stop.store(false, Ordering::Relaxed);
            let shard = shard.map(|shard| shard.parse().unwrap());
            let Ok(outcomes) = resume((1, 8, shard), (&|_| (), &stop), find, compute);
            outcomes
        };
        let (new, absent) = (Outcome::Computed("new", None), Outcome::Absent);
        let damaged = Outcome::Computed("new", Some("cut short".to_owned()));
        let kept = Outcome::Kept("there");
        // Item 3 is stopped while it is computed, and the pass after item 5.
        let whole = [&kept, &damaged, &new, &absent, &new, &new, &absent, &absent];
        assert_eq!(pass(None).iter().collect::<Vec<_>>(), whole);
        let even = [&kept, &absent, &new, &absent, &new, &absent, &new, &absent];
        assert_eq!(pass(Some("1/2")).iter().collect::<Vec<_>>(), even);
    }
}
