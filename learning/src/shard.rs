//! Shards: parts of a job that several processes share.

use std::str::FromStr;

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
