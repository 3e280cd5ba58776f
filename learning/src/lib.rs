//! Surfaces from recordings: readers of recordings, processing, learning, and measures of how well a virtual surface matches
//! a real one; data sets of rendered vibrations, and vibrations as files of phones and controllers. The crate does not depend on graphs.
//!
//! # Features
//!
//! | feature | default | adds |
//! |---|---|---|
//! | `spreadsheets` | yes | recordings in XLSX files |
//! | `genetic` | | the island genetic algorithm of the thesis for segmentation, slower and never better than the exact search |

#![cfg_attr(not(test), warn(unreachable_pub))]

#[cfg(not(target_family = "wasm"))]
pub mod batch;
pub mod evaluate;
pub mod learn;
pub mod metrics;
pub mod parts;
pub mod pattern;
pub mod processing;
pub mod recording;
pub mod select;
pub(crate) mod signals;
