//! Studies with people: the document, the order of trials, what is kept, and statistics.

pub mod analyse;
pub mod check;
pub mod conduct;
pub mod data;
pub mod document;
pub mod order;
pub mod people;
mod phase;
pub mod power;
pub mod progress;
pub mod statistics;
pub mod tally;
pub mod thesis;
