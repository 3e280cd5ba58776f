//! Studies with people: the document, the order of trials, what is kept, and statistics.

pub mod statistics;
