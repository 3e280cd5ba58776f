//! A graph file as written: RON in, every value with its place, nothing yet known of its meaning.

pub mod value;
